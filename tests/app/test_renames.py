"""What pages say by names that changed meanwhile is meant of what carries them now."""

from __future__ import annotations

import pytest

import pgraph_core as pg
from pgraph_app.constraints.update import EditPart, OpenConstraints, OpenPart
from pgraph_app.core.events import Event
from pgraph_app.core.state import Reply, State, initial
from pgraph_app.features import update
from pgraph_app.model.update import Download, Edit, NewModel, OpenText, Undo
from pgraph_app.plots.update import Plot
from pgraph_app.properties.update import EditBodies
from pgraph_app.properties.world import EditParameter, RenameParameter
from pgraph_app.session.update import Connected, Disconnected, Hello, SelectBodies
from pgraph_app.table.update import SetParent

pytestmark = pytest.mark.fast

ME, OTHER = 1, 2


def after(state: State, *happened: Event) -> State:
    for event in happened:
        state = update(state, event)
    return state


@pytest.fixture
def state() -> State:
    model = pg.Model.serial(3).replace(parameters={"rod": 0.2})
    model = model.close_loop("3", "1", joint="spherical")
    return after(initial(model), Connected(ME), Connected(OTHER))


def named(body: str, name: str, client: int = OTHER) -> Edit:
    return Edit(client, 1, body, "name", (), name)


def test_an_edit_by_a_name_of_before_is_of_the_same_body(state):
    state = after(state, named("2", "knee"), named("1", "2"))
    state = after(state, Edit(ME, 1, "2", "mass", (), "5", seen=0))
    assert state.model.body("knee").mass == 5.0
    state = after(state, Edit(ME, 2, "2", "mass", (), "6", seen=2))
    assert (state.model.body("2").mass, state.model.body("knee").mass) == (6.0, 5.0)


def test_names_in_lists_cells_and_questions_follow(state):
    state = after(state, named("2", "knee"))
    state = after(state, SelectBodies(ME, "2", ("2", "3"), seen=0))
    assert state.clients[ME].selected == ("knee", "3")
    state = after(state, Edit(ME, 1, "3", "parent", (), "2", seen=0))
    assert state.clients[ME].reply == Reply(1, "")
    state = after(state, EditBodies(ME, 2, ("2",), "mass", (((), "3"),), seen=0))
    assert state.model.body("knee").mass == 3.0
    state = after(state, SetParent(ME, ("2",), "ground", seen=0))
    assert state.model.body("knee").parent == "ground"


def test_parts_and_parameters_follow_too(state):
    (loop,) = (c.name for c in state.model.constraints)
    edit = EditPart
    state = after(state, edit(ME, 1, "constraints", loop, "name", (((), "pin"),), seen=0))
    state = after(state, edit(ME, 2, "constraints", loop, "point", (((0,), "0.1"),), seen=0))
    assert state.model.constraints[0].name == "pin"
    assert state.model.constraints[0].point[0] == 0.1
    state = after(state, RenameParameter(ME, 3, "rod", "length", seen=1))
    state = after(state, EditParameter(ME, 4, "rod", "0.3", seen=1))
    assert state.model.parameters == {"length": 0.3}


def test_undo_gives_names_back_and_what_is_under_way_follows(state):
    state = after(state, named("2", "knee"), Undo(OTHER))
    state = after(state, Edit(ME, 1, "knee", "mass", (), "7", seen=1))
    assert state.model.body("2").mass == 7.0


def test_another_model_is_no_rename(state):
    state = after(state, NewModel(OTHER, 1, "3"), named("1", "a"))
    assert state.renamed == 1
    text = pg.Model.serial(3).edit("2", name="other").to_json()
    state = after(state, OpenText(OTHER, "x", text))
    state = after(state, Edit(ME, 1, "2", "mass", (), "7", seen=0))
    assert "no body has this name" in state.clients[ME].reply.text


def hello(client: int, page: str, body: str | None = None) -> Hello:
    bodies = () if body is None else (body,)
    units = ("deg", "m", "euler", "com")
    return Hello(client, 7, page, body, bodies, True, units)  # type: ignore[arg-type]


def test_1_11_a_page_that_comes_back_is_what_it_was(state):
    state = after(state, hello(ME, "a page"), Download(ME), Plot(ME, "q", "2", True))
    was = state.clients[ME]
    state = after(state, Disconnected(ME), Connected(5), hello(5, "a page", "2"))
    now = state.clients[5]
    assert (now.plots, now.display, now.dark) == (was.plots, was.display, True)
    assert (now.selection, now.selected, now.downloads) == ("2", ("2",), 0)
    assert now.reply == Reply(7, "")
    assert state.left == {}


def test_1_11_a_new_server_takes_a_page_s_word_for_it(state):
    state = after(state, Connected(5), hello(5, "unknown", "gone"))
    assert (state.clients[5].selection, state.clients[5].display.angle) == (None, "deg")


def test_only_the_last_pages_are_remembered(state):
    for k in range(60):
        state = after(state, Connected(9), hello(9, f"{k}"), Disconnected(9))
    assert list(state.left) == [f"{k}" for k in range(10, 60)]


def test_what_a_page_has_open_follows_its_name_and_undo(state):
    (loop,) = (c.name for c in state.model.constraints)
    state = after(state, OpenPart(ME, "constraints", loop))
    state = after(state, OpenConstraints(ME, "2"), Plot(ME, "q", "2", True))
    edit = EditPart(OTHER, 1, "constraints", loop, "name", (((), "pin"),))
    state = after(state, edit, named("2", "knee"))
    page = state.clients[ME]
    opened = (page.opened, page.listed, page.plots)
    assert opened == (("constraints", "pin"), "knee", (("q", "knee"),))
    page = after(state, Undo(OTHER), Undo(OTHER)).clients[ME]
    assert (page.opened, page.listed) == (("constraints", loop), "2")
