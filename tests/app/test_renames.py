"""What pages say by names that changed meanwhile is meant of what carries them now."""

from __future__ import annotations

import colorsys
import json
from itertools import combinations

import pytest

import pgraph_core as pg
from pgraph_app.constraints.update import EditPart, OpenConstraints, OpenPart
from pgraph_app.core.events import Event, FromPage, from_page
from pgraph_app.core.state import Reply, State, initial
from pgraph_app.digraph.view import digraph
from pgraph_app.features import update
from pgraph_app.model.update import Download, Edit, NewModel, OpenText, Redo, Undo
from pgraph_app.plots.update import Plot
from pgraph_app.properties.update import EditBodies
from pgraph_app.properties.view import properties
from pgraph_app.properties.world import EditParameter, RenameParameter
from pgraph_app.run.update import SetScenario
from pgraph_app.scenario.update import DeleteScenario, EditScenario
from pgraph_app.session.update import Connected, Disconnected, Hello, SelectBodies
from pgraph_app.table.update import (
    AddBody,
    CountBodies,
    DeleteBodies,
    Duplicate,
    MirrorBranch,
    MoveRows,
    Paste,
    SetParent,
)
from pgraph_app.table.view import table

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


# -- rows without names ----------------------------------------------------------------------------


def points(state: State) -> list[float]:
    return [point[0] for point in state.model.contacts[0].points]


def point(number: int, text: str, *rest: int, client: int = ME) -> EditPart:
    return EditPart(client, 1, "contacts", "k", "points", (((number, *rest), text),))


@pytest.fixture
def three() -> State:
    """Three contact points that are alike, as they are when they are new."""
    contact = pg.Contact(name="k", body="3", points=((1.0, 0.0, 0.0),) * 3)
    return after(
        initial(pg.Model.serial(3).replace(contacts=(contact,))), Connected(ME), Connected(OTHER)
    )


@pytest.mark.parametrize(("out", "value"), [(0, [5.0, 1.0]), (2, [1.0, 5.0])])
def test_a_number_typed_while_another_takes_out_a_row_is_of_its_row(three, out, value):
    state = after(three, point(out, "", client=OTHER), point(1, "5", 0))
    assert points(state) == value


def test_a_number_typed_into_a_row_that_is_gone_is_refused_with_why(three):
    state = after(three, point(1, "", client=OTHER), point(1, "5", 0))
    assert points(state) == [1.0, 1.0]
    assert "taken out meanwhile" in state.clients[ME].reply.text
    more = EditPart(OTHER, 1, "contacts", "k", "points", (((), "add"),))
    state = after(state, more, point(1, "5", 0))  # a new row has a number of its own
    assert 5.0 not in points(state)


def test_rows_are_themselves_again_after_undo_and_redo(three):
    gone = after(three, point(0, "", client=OTHER))
    back = after(gone, Undo(OTHER))
    assert points(after(back, point(0, "5", 0))) == [5.0, 1.0, 1.0]
    again = after(back, Redo(OTHER))
    assert points(after(again, point(2, "5", 0))) == [1.0, 5.0]
    between = after(gone, point(2, "7", 0), Edit(ME, 1, "1", "mass", (), "4"))
    assert points(after(between, point(1, "5", 0))) == [5.0, 7.0]


def test_shapes_and_motions_follow_too():
    ball = pg.Shape(kind="sphere", radius=0.1)
    turns = tuple(("rotate", axis) for axis in ((1, 0, 0), (0, 1, 0), (0, 0, 1)))
    bodies = (pg.Body(name="a", joint="compound", motions=turns, shapes=(ball, ball)),)
    state = after(initial(pg.Model(bodies=bodies)), Connected(ME), Connected(OTHER))

    def typed(field: str, text: str, *at: int, client: int = ME) -> EditBodies:
        return EditBodies(client, 1, ("a",), field, ((at, text),))  # type: ignore[arg-type]

    state = after(state, typed("shape_kind", "none", client=OTHER), typed("shape_1_radius", "2"))
    assert [shape.radius for shape in state.model.body("a").shapes] == [2.0]
    state = after(state, typed("shape_more_kind", "box"), typed("shape_1_radius", "3"))
    assert state.model.body("a").shapes[0].radius == 3.0
    state = after(state, typed("motions", "", 0, client=OTHER), typed("v", "0.5", 2))
    assert state.model.body("a").v == (0.0, 0.5)
    state = after(state, typed("axes", "0.25", 1, 0))
    assert state.model.body("a").axes[0] == (0.25, 1.0, 0.0)


def test_shapes_of_several_bodies_are_those_that_were_seen():
    """One person types for the second shape of two bodies; another takes out a first one."""
    ball, box = pg.Shape(kind="sphere", radius=0.1), pg.Shape(kind="box", size=(1.0, 1.0, 1.0))
    two = tuple(pg.Body(name=name, shapes=(box, ball)) for name in "ab")
    bare = pg.Body(name="c")
    start = after(initial(pg.Model(bodies=(*two, bare))), Connected(ME), Connected(OTHER))

    def fields(state: State, *names: str) -> list[str]:
        return [f["field"] for g in properties(state, names)["groups"] for f in g["fields"]]

    def typed(names: str, field: str, text: str, client: int = ME) -> FromPage:
        words = {"event": "EditBodies", "serial": 1, "bodies": [*names], "field": field}
        return from_page(client, json.dumps({**words, "entries": [[[], text]]}))

    def radii(state: State) -> list[float | None]:
        return [shape.radius for body in state.model.bodies for shape in body.shapes]

    assert "shape_1_radius" in fields(start, "a", "b")
    both = after(start, typed("ab", "shape_1_radius", "2"))
    assert radii(both) == [None, 2.0, None, 2.0]
    gone = after(start, typed("a", "shape_kind", "none", OTHER))
    late = after(gone, typed("ab", "shape_1_radius", "2"))
    assert late.model is gone.model
    assert late.clients[ME].reply.text.startswith("The selected bodies have different shapes by")
    gone = after(gone, typed("b", "shape_kind", "none", OTHER))
    assert radii(after(gone, typed("ab", "shape_1_radius", "2"))) == [2.0, 2.0]
    only = after(start, typed("a", "shape_kind", "none", OTHER))
    one = after(only, typed("a", "shape_more_kind", "box"), typed("a", "shape_1_radius", "3"))
    name = next(f for f in fields(one, "a", "b") if f.endswith("_kind"))
    assert name == "shape_1.0_kind"
    none = after(one, typed("ab", name, "none"))
    assert [len(body.shapes) for body in none.model.bodies] == [1, 1, 0]
    # a body without a shape gets its first; one more goes to bodies that have as many
    assert "shape_0.more_kind" in fields(start, "a", "c")
    boxed = after(start, typed("ac", "shape_0.more_kind", "box"))
    assert [len(body.shapes) for body in boxed.model.bodies] == [2, 2, 1]
    refused = after(start, typed("ac", "shape_more_kind", "box"))
    assert refused.model is start.model
    assert after(start, typed("ab", "shape_0.1.1_kind", "box")).model is start.model


def test_what_is_typed_for_a_scenario_is_not_of_the_one_chosen_meanwhile(state):
    own = [pg.Scenario(name=n, t_end=1.0, q={"3": (0.0,)}) for n in ("one", "two")]
    state = after(state, OpenText(ME, "m", state.model.replace(scenarios=own).to_json()))
    state = after(state, SetScenario(OTHER, 1, "two"))
    state = after(state, EditScenario(ME, 2, "t_end", (((), "3"),), scenario=0))
    assert [s.t_end for s in state.model.scenarios] == [3.0, 1.0]
    assert (state.request.scenario, state.request.t_end) == ("two", 1.0)
    state = after(
        state, DeleteBodies(OTHER, ("1",), "attach")
    )  # its children go to the ground: rows move up
    state = after(state, EditScenario(ME, 3, "q", (((2, 0), "0.5"),), scenario=1))
    assert state.model.scenario("two").q == {"3": (0.5,)}
    state = after(state, DeleteScenario(OTHER, scenario=0))
    state = after(state, EditScenario(ME, 4, "t_end", (((), "9"),), scenario=0))
    assert "taken out" in state.clients[ME].reply.text
    assert state.model.scenarios[0].t_end == 1.0


# -- colours ---------------------------------------------------------------------------------------


def colors(state: State) -> dict[str, tuple[int, int, int]]:
    return dict(zip(state.derived.names, state.colors))


@pytest.fixture
def quadruped_state(quadruped) -> State:
    return after(initial(quadruped), Connected(ME))


@pytest.mark.parametrize(
    "event",
    [
        AddBody(ME, None), AddBody(ME, "pelvis"), AddBody(ME, "left_femur"),
        Duplicate(ME, ("left_femur",), True), MirrorBranch(ME, "left_femur", "y"),
        DeleteBodies(ME, ("left_femur",), "attach"), DeleteBodies(ME, ("left_femur",), "delete"),
        MoveRows(ME, ("right_femur",), "left_femur"), SetParent(ME, ("left_femur",), "ground"),
        CountBodies(ME, 1, "30"), CountBodies(ME, 1, "5"), Paste(ME, 1, "x\ny", (), 0, "pelvis"),
        Edit(ME, 1, "left_femur", "name", (), "thigh"), Edit(ME, 1, "left_femur", "dof", (), "0"),
    ],
    ids=str,
)  # fmt: skip
def test_a_body_keeps_its_colour(quadruped_state, event):
    """Whatever is put in, taken out, moved or renamed; and what comes back has its own again."""
    before, own = (
        colors(quadruped_state),
        quadruped_state.rows.named(quadruped_state.model, "bodies"),
    )
    state = after(quadruped_state, event)
    assert state.model is not quadruped_state.model
    now, number = colors(state), state.rows.named(state.model, "bodies")
    again = {number[name]: color for name, color in now.items()}
    there = [name for name in before if own[name] in again]
    assert len(there) >= min(len(before), len(now)) - 1
    assert {n: before[n] for n in there} == {n: again[own[n]] for n in there}
    for back in (Undo(ME), Redo(ME), Undo(ME)):
        state = after(state, back)
    assert colors(state) == before
    shown = [node["color"] for node in table(state)["rows"]]
    assert sorted(shown) == sorted(digraph(state)["colors"])


def test_colours_that_are_given_later_differ_from_their_neighbours():
    """Legs put onto a body one after the other, in an order that no file has."""
    state = after(initial(pg.Model.serial(1)), Connected(ME))
    for k in range(8):
        parent = "1" if k % 2 == 0 else state.model.bodies[-1].name
        state = after(state, AddBody(ME, parent))
    found = colors(state)
    legs = [body.name for body in state.model.bodies if body.parent == "1"]
    hue = {name: colorsys.rgb_to_hls(*(c / 255 for c in own))[0] for name, own in found.items()}
    assert len(legs) == 4
    assert min(abs(a - b) for a, b in combinations([hue[name] for name in legs], 2)) > 0.03
    for name in legs:  # a leg goes on in its own hue, lighter
        child = next(b.name for b in state.model.bodies if b.parent == name)
        assert hue[child] == pytest.approx(hue[name], abs=0.02)
        assert found[child] != found[name]
