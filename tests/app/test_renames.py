"""Outdated names refer to the parts that carried them; outdated places of rows are refused."""

import json

import pytest

import pgraph_core as pg
from pgraph_app.core.edit import renamed
from pgraph_app.core.events import from_page
from pgraph_app.core.state import Reply
from pgraph_app.properties.view import properties

from .store import ME, OTHER, after, begun, do, notice, reply

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
    assert state.version == 2
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


@pytest.mark.parametrize("first", ["gone", "back"])
def test_a_page_that_comes_back_hears_once_what_was_not_done(state, first):
    state = after(state, hello(ME, "a page"))
    gone, back = do.Disconnected(ME, lost=2), (do.Connected(5), hello(5, "a page"))
    state = after(state, *((gone, *back) if first == "gone" else (*back, gone)))
    assert "2 edits" in notice(state, 5)
    state = after(state, do.Disconnected(5), do.Connected(6), hello(6, "a page"))
    assert notice(state, 6) == ""


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


def point(number, text, *rest, client=ME, **version):
    entries = (((number, *rest), text),)
    return do.EditPart(client, 1, "contacts", "k", "points", entries, **version)


@pytest.fixture
def three():
    """Three contact points that are alike, as they are when they are new."""
    contact = pg.Contact(name="k", body="3", points=((1.0, 0.0, 0.0),) * 3)
    return begun(pg.Model.serial(3).replace(contacts=(contact,)), ME, OTHER)


def test_a_number_typed_by_place_is_refused_after_rows_have_moved(three):
    late = after(three, point(0, "", client=OTHER), point(1, "5", 0, seen=0))
    assert points(late) == [1.0, 1.0]
    assert reply(late)
    assert points(after(late, point(1, "5", 0, seen=late.version))) == [1.0, 5.0]
    begun_before = point(1, "5", 0, seen=late.version, typed=0)
    assert points(after(late, begun_before)) == [1.0, 1.0]
    back = after(late, do.Undo(OTHER))
    assert reply(after(back, point(1, "5", 0, seen=late.version)))


@pytest.mark.parametrize("way", [do.EditBodies(OTHER, 1, ("1",), "mass", (((), "4"),)),
                                 named("1", "hip")])  # fmt: skip
def test_edits_that_move_no_row_refuse_nothing(three, way):
    assert points(after(three, way, point(1, "5", 0, seen=0))) == [1.0, 5.0, 1.0]


def test_what_is_typed_by_name_is_taken_after_rows_have_moved(three):
    state = after(three, point(0, "", client=OTHER), do.AddBody(OTHER, "3"))
    state = after(state, do.EditBodies(ME, 1, ("2",), "link", (((1,), "0.5"),), seen=0))
    assert state.model.body("2").link[1] == 0.5


def test_shapes_motions_steps_and_switches_move_too():
    ball = pg.Shape(kind="sphere", radius=0.1)
    turns = tuple(("rotate", axis) for axis in ((1, 0, 0), (0, 1, 0), (0, 0, 1)))
    body = pg.Body(name="a", joint="compound", motions=turns, shapes=(ball, ball))
    tie = pg.Constraint(name="k", kind="point", body="a", active=False)
    switches = tuple(pg.Switch(constraint="k", t=t, active=True) for t in (0.25, 0.5))
    own = pg.Scenario(name="own", t_end=1.0, switches=switches, q={"a": (0.0,) * 3})
    ground = pg.Ground(steps=(pg.Step(low=(0, 0), high=(1, 1), height=0.1),))
    model = pg.Model(bodies=(body,), constraints=(tie,), scenarios=(own,), ground=ground)
    start = begun(model, ME, OTHER)
    gone = ("shape_1_kind", (), "none"), ("motions", (0,), "")
    late = ("shape_radius", (), "2"), ("v", (1,), "2"), ("axes", (0, 0), "2"), ("motions", (1,), "")
    for field, index, text in gone:
        moved = after(start, do.EditBodies(OTHER, 1, ("a",), field, ((index, text),)))
        assert moved.moved == moved.version == 1
        for again, at, typed in late:
            event = do.EditBodies(ME, 1, ("a",), again, ((at, typed),), seen=0)
            assert after(moved, event).model is moved.model
    moved = after(start, do.EditWorld(OTHER, 1, "steps", (((0,), ""),)))
    assert reply(after(moved, do.EditWorld(ME, 1, "steps", (((), ""),), seen=0))) == ""
    moved = after(start, do.DeleteSwitch(OTHER, 0))
    assert after(moved, do.DeleteSwitch(ME, 1, seen=0)).model is moved.model
    event = do.EditScenario(ME, 1, "q", (((0, 0), "1"),), seen=0, scenario=0)
    assert after(moved, event).model is moved.model


def test_shapes_of_several_bodies_have_the_place_that_was_seen():
    """One person types for the second shape of two bodies while another removes a first one."""
    ball, box = pg.Shape(kind="sphere", radius=0.1), pg.Shape(kind="box", size=(1.0, 1.0, 1.0))
    two = tuple(pg.Body(name=name, shapes=(box, ball)) for name in "ab")
    start = begun(pg.Model(bodies=(*two, pg.Body(name="c"))), ME, OTHER)

    def fields(state, *names):
        return [f["field"] for g in properties(state, names)["groups"] for f in g["fields"]]

    def typed(names, field, text, client=ME):
        words = {"event": "EditBodies", "serial": 1, "bodies": [*names], "field": field}
        return from_page(client, json.dumps({**words, "entries": [[[], text]], "seen": 0}))

    def radii(state):
        return [shape.radius for body in state.model.bodies for shape in body.shapes]

    assert "shape_1_radius" in fields(start, "a", "b")
    assert radii(after(start, typed("ab", "shape_1_radius", "2"))) == [None, 2.0, None, 2.0]
    gone = after(start, typed("a", "shape_kind", "none", OTHER))
    late = after(gone, typed("ab", "shape_1_radius", "2"))
    assert late.model is gone.model
    # a body without a shape gets its first
    more = after(start, typed("ac", "shape_kind", "box"))
    assert [len(body.shapes) for body in more.model.bodies] == [2, 2, 1]


def test_an_edit_of_a_scenario_is_not_of_the_one_chosen_meanwhile(state):
    own = [pg.Scenario(name=n, t_end=1.0, q={"3": (0.0,)}) for n in ("one", "two")]
    state = begun(state.model.replace(scenarios=own), ME, OTHER)
    state = after(state, do.SetScenario(OTHER, 1, "two"))
    state = after(state, do.EditScenario(ME, 2, "description", (((), "a"),), scenario=0))
    assert [s.description for s in state.model.scenarios] == ["a", ""]
    assert state.request.scenario == "two"
    state = after(state, do.DeleteBodies(OTHER, ("1",), "attach"))  # rows move up
    state = after(state, do.EditScenario(ME, 3, "q", (((1, 0), "0.5"),), scenario=1))
    assert state.model.scenario("two").q == {"3": (0.5,)}
    state = after(state, do.DeleteScenario(OTHER, scenario=0))
    state = after(state, do.EditScenario(ME, 4, "description", (((), "b"),), scenario=0))
    assert reply(state)
    assert state.model.scenarios[0].description == ""
