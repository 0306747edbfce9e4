"""Events with outdated names or rows refer to the parts that carried them."""

import json

import pytest

import pgraph_core as pg
from pgraph_app.core.edit import renamed
from pgraph_app.core.events import from_page
from pgraph_app.core.state import Reply
from pgraph_app.properties.view import properties

from .store import ME, OTHER, after, begun, do, reply

pytestmark = pytest.mark.quick


@pytest.fixture
def state():
    model = pg.Model.serial(3).replace(parameters={"rod": 0.2})
    return begun(model.close_loop("3", "1", joint="spherical"), ME, OTHER)


def named(body, name):
    return do.EditBodies(OTHER, 1, (body,), "name", (((), name),))


def test_an_edit_by_a_name_of_before_is_of_the_same_body(state):
    two = after(state, named("2", "knee"), named("1", "2"))
    two = after(two, do.EditBodies(ME, 1, ("2",), "mass", (((), "5"),), seen=0))
    assert two.model.body("knee").mass == 5.0
    two = after(two, do.EditBodies(ME, 2, ("2",), "mass", (((), "6"),), seen=2))
    assert (two.model.body("2").mass, two.model.body("knee").mass) == (6.0, 5.0)
    undone = after(state, named("2", "knee"), do.Undo(OTHER))
    undone = after(undone, do.EditBodies(ME, 1, ("knee",), "mass", (((), "7"),), seen=1))
    assert undone.model.body("2").mass == 7.0


def test_names_in_lists_cells_and_questions_follow(state):
    state = after(state, named("2", "knee"))
    state = after(state, do.SelectBodies(ME, "2", ("2", "3"), seen=0))
    assert state.clients[ME].selected == ("knee", "3")
    state = after(state, do.EditBodies(ME, 1, ("3",), "parent", (((), "2"),), seen=0))
    assert state.clients[ME].reply == Reply(1, "")
    state = after(state, do.EditBodies(ME, 2, ("2",), "mass", (((), "3"),), seen=0))
    assert state.model.body("knee").mass == 3.0
    state = after(state, do.SetParent(ME, ("2",), "ground", seen=0))
    assert state.model.body("knee").parent == "ground"


def test_parts_and_parameters_follow_too(state):
    (loop,) = (c.name for c in state.model.constraints)
    for serial, field, index, text in ((1, "name", (), "pin"), (2, "point", (0,), "0.1")):
        event = do.EditPart(ME, serial, "constraints", loop, field, ((index, text),), seen=0)
        state = after(state, event)
    assert state.model.constraints[0].name == "pin"
    assert state.model.constraints[0].point[0] == 0.1
    state = after(state, do.RenameParameter(ME, 3, "rod", "length", seen=1))
    state = after(state, do.EditParameter(ME, 4, "rod", "0.3", seen=1))
    assert state.model.parameters == {"length": 0.3}


def test_another_model_or_another_body_in_a_row_is_no_rename(state):
    old = state.model
    assert list(renamed(old, old.edit("2", name="b"))) == [("bodies", "2", "b")]
    assert list(renamed(old, old.edit("2", name="b", mass=9.0))) == []
    state = after(state, do.NewModel(OTHER, 1, "3"), named("1", "a"))
    assert state.renamed == 1
    text = pg.Model.serial(3).edit("2", name="other").to_json()
    state = after(state, do.OpenText(OTHER, "x", text))
    state = after(state, do.EditBodies(ME, 1, ("2",), "mass", (((), "7"),), seen=0))
    assert "'2'" in reply(state)


def hello(client, page, body=None):
    bodies = () if body is None else (body,)
    return do.Hello(client, 7, page, body, bodies, True, ("deg", "m", "euler", "com"))


def test_1_11_a_page_that_comes_back_is_what_it_was(state):
    state = after(state, hello(ME, "a page"), do.Download(ME), do.Plot(ME, "q", "2", True))
    was = state.clients[ME]
    state = after(state, do.Disconnected(ME), do.Connected(5), hello(5, "a page", "2"))
    now = state.clients[5]
    assert (now.plots, now.display, now.dark) == (was.plots, was.display, True)
    assert (now.selection, now.selected, now.asked) == ("2", ("2",), None)
    assert now.reply == Reply(7, "")
    assert state.left == {}
    state = after(state, do.Connected(6), hello(6, "unknown to this server", "gone"))
    assert (state.clients[6].selection, state.clients[6].display.angle) == (None, "deg")


def test_only_the_last_pages_are_remembered(state):
    for k in range(60):
        state = after(state, do.Connected(9), hello(9, f"{k}"), do.Disconnected(9))
    assert list(state.left) == [f"{k}" for k in range(10, 60)]


def test_open_parts_of_a_page_follow_renames_and_undo(state):
    (loop,) = (c.name for c in state.model.constraints)
    state = after(state, do.OpenPart(ME, "constraints", loop))
    state = after(state, do.OpenConstraints(ME, "2"), do.Plot(ME, "q", "2", True))
    edit = do.EditPart(OTHER, 1, "constraints", loop, "name", (((), "pin"),))
    state = after(state, edit, named("2", "knee"))
    page = state.clients[ME]
    opened = (page.opened, page.listed, page.plots)
    assert opened == (("constraints", "pin"), "knee", (("q", "knee"),))
    page = after(state, do.Undo(OTHER), do.Undo(OTHER)).clients[ME]
    assert (page.opened, page.listed) == (("constraints", loop), "2")


def points(state):
    return [point[0] for point in state.model.contacts[0].points]


def point(number, text, *rest, client=ME):
    return do.EditPart(client, 1, "contacts", "k", "points", (((number, *rest), text),))


@pytest.fixture
def three():
    """Three contact points that are alike, as they are when they are new."""
    contact = pg.Contact(name="k", body="3", points=((1.0, 0.0, 0.0),) * 3)
    return begun(pg.Model.serial(3).replace(contacts=(contact,)), ME, OTHER)


def test_a_number_typed_into_a_row_that_is_gone_is_refused(three):
    state = after(three, point(1, "", client=OTHER), point(1, "5", 0))
    assert points(state) == [1.0, 1.0]
    assert reply(state)
    more = do.EditPart(OTHER, 1, "contacts", "k", "points", (((), "add"),))
    state = after(state, more, point(1, "5", 0))  # a new row has a number of its own
    assert 5.0 not in points(state)


@pytest.mark.parametrize(("out", "value"), [(0, [5.0, 1.0]), (2, [1.0, 5.0])])
def test_a_number_typed_while_another_takes_out_a_row_is_of_its_row(three, out, value):
    state = after(three, point(out, "", client=OTHER), point(1, "5", 0))
    assert points(state) == value


def test_rows_are_themselves_again_after_undo_and_redo(three):
    gone = after(three, point(0, "", client=OTHER))
    back = after(gone, do.Undo(OTHER))
    assert points(after(back, point(0, "5", 0))) == [5.0, 1.0, 1.0]
    again = after(back, do.Redo(OTHER))
    assert points(after(again, point(2, "5", 0))) == [1.0, 5.0]
    between = after(gone, point(2, "7", 0), do.EditBodies(ME, 1, ("1",), "mass", (((), "4"),)))
    assert points(after(between, point(1, "5", 0))) == [5.0, 7.0]


def test_shapes_and_motions_follow_too():
    ball = pg.Shape(kind="sphere", radius=0.1)
    turns = tuple(("rotate", axis) for axis in ((1, 0, 0), (0, 1, 0), (0, 0, 1)))
    bodies = (pg.Body(name="a", joint="compound", motions=turns, shapes=(ball, ball)),)

    def typed(field, text, *at, client=ME):
        return do.EditBodies(client, 1, ("a",), field, ((at, text),))

    state = begun(pg.Model(bodies=bodies), ME, OTHER)
    state = after(state, typed("shape_kind", "none", client=OTHER), typed("shape_1_radius", "2"))
    assert [shape.radius for shape in state.model.body("a").shapes] == [2.0]
    state = after(state, typed("shape_more_kind", "box"), typed("shape_1_radius", "3"))
    assert state.model.body("a").shapes[0].radius == 3.0
    state = after(state, typed("motions", "", 0, client=OTHER), typed("v", "0.5", 2))
    assert state.model.body("a").v == (0.0, 0.5)
    state = after(state, typed("axes", "0.25", 1, 0))
    assert state.model.body("a").axes[0] == (0.25, 1.0, 0.0)


def test_shapes_of_several_bodies_are_those_that_were_seen():
    """One person types for the second shape of two bodies while another removes a first one."""
    ball, box = pg.Shape(kind="sphere", radius=0.1), pg.Shape(kind="box", size=(1.0, 1.0, 1.0))
    two = tuple(pg.Body(name=name, shapes=(box, ball)) for name in "ab")
    start = begun(pg.Model(bodies=(*two, pg.Body(name="c"))), ME, OTHER)

    def fields(state, *names):
        return [f["field"] for g in properties(state, names)["groups"] for f in g["fields"]]

    def typed(names, field, text, client=ME):
        words = {"event": "EditBodies", "serial": 1, "bodies": [*names], "field": field}
        return from_page(client, json.dumps({**words, "entries": [[[], text]]}))

    def radii(state):
        return [shape.radius for body in state.model.bodies for shape in body.shapes]

    assert "shape_1_radius" in fields(start, "a", "b")
    assert radii(after(start, typed("ab", "shape_1_radius", "2"))) == [None, 2.0, None, 2.0]
    gone = after(start, typed("a", "shape_kind", "none", OTHER))
    late = after(gone, typed("ab", "shape_1_radius", "2"))
    assert late.model is gone.model
    assert "shapes" in reply(late)
    gone = after(gone, typed("b", "shape_kind", "none", OTHER))
    assert radii(after(gone, typed("ab", "shape_1_radius", "2"))) == [2.0, 2.0]
    # a body without a shape gets its first; one more goes to bodies that have as many
    assert "shape_0.more_kind" in fields(start, "a", "c")
    more = after(start, typed("ac", "shape_0.more_kind", "box"))
    assert [len(body.shapes) for body in more.model.bodies] == [2, 2, 1]
    assert after(start, typed("ac", "shape_more_kind", "box")).model is start.model


def test_an_edit_of_a_scenario_is_not_of_the_one_chosen_meanwhile(state):
    own = [pg.Scenario(name=n, t_end=1.0, q={"3": (0.0,)}) for n in ("one", "two")]
    state = begun(state.model.replace(scenarios=own), ME, OTHER)
    state = after(state, do.SetScenario(OTHER, 1, "two"))
    state = after(state, do.EditScenario(ME, 2, "description", (((), "a"),), scenario=0))
    assert [s.description for s in state.model.scenarios] == ["a", ""]
    assert state.request.scenario == "two"
    state = after(state, do.DeleteBodies(OTHER, ("1",), "attach"))  # rows move up
    state = after(state, do.EditScenario(ME, 3, "q", (((2, 0), "0.5"),), scenario=1))
    assert state.model.scenario("two").q == {"3": (0.5,)}
    state = after(state, do.DeleteScenario(OTHER, scenario=0))
    state = after(state, do.EditScenario(ME, 4, "description", (((), "b"),), scenario=0))
    assert reply(state)
    assert state.model.scenarios[0].description == ""
