"""Cables and ropes on the page: picked body by body, and the rows of their stations."""

import numpy as np
import pytest

import pgraph_core as pg
from pgraph_app.constraints import cables
from pgraph_app.constraints.mobility import mobility_report
from pgraph_app.constraints.view import constraints
from pgraph_app.core.state import derive
from pgraph_app.digraph.view import digraph
from pgraph_app.scene import ties
from pgraph_core.show import shapes

from .store import ME, after, begun, do, reply

UPRIGHT = (0.5**0.5, 0.5**0.5, 0.0, 0.0)  # a cylinder along y
DISC = {"kind": "cylinder", "radius": 0.1, "length": 0.04, "rotation": UPRIGHT}


def wheel(name, at, **fields):
    inertia = (0.01, 0.02, 0.01)
    return pg.Body(name=name, axes=[(0, 1, 0)], mass=1, inertia=inertia, link=at, **fields)


def weight(name, at, mass=1.0):
    return pg.Body(name=name, joint="prismatic", axes=[(0, 0, 1)], mass=mass, link=at)


ATWOOD = pg.Model(bodies=[
    wheel("sheave", (0, 0, 2), shape=DISC), weight("left", (-0.1, 0, 0), 3.0),
    weight("right", (0.1, 0, 0.5)),
])  # fmt: skip
BELT = pg.Model(bodies=[wheel("motor", (0, 0, 0)), wheel("load", (1, 0, 0))])


def led(model, *names, kind="rope", closed=False):
    """The state after a cable was led along bodies by clicks."""
    part = "constraints" if kind == "rope" else "forces"
    state = after(begun(model), do.AddPart(ME, part, kind, None))
    state = after(state, *(do.PickName(ME, name) for name in names))
    return after(state, do.EndWay(ME, closed))


def part(state):
    return (*state.model.constraints, *state.model.forces)[0]


def banner(state):
    return constraints(state, state.clients[ME])["picking"]


def rows(state):
    kind = "forces" if state.model.forces else "constraints"
    listed = constraints(state, state.clients[ME])["lists"]
    (line,) = next(one for one in listed if one["part"] == kind)["items"]
    return [f for group in line["form"] for f in group["fields"] if f["field"] == "through"]


def edit(state, *entries):
    of = part(state)
    kind = "forces" if state.model.forces else "constraints"
    return after(state, do.EditPart(ME, 1, kind, of.name, "through", entries))


def lies(state):
    """No reason why it could not lie on its wheels."""
    return cables.faults(state.model) == {}


@pytest.mark.parametrize("kind", ["rope", "cable"])
def test_a_rope_is_led_over_a_wheel_of_the_radius_of_its_shape(kind):
    state = led(ATWOOD, "left", "sheave", "right", kind=kind)
    one = part(state)
    assert [(x.body, x.radius) for x in one.through] == [
        ("left", 0.0), ("sheave", 0.1), ("right", 0.0)
    ]  # fmt: skip
    assert state.clients[ME].opened == ("constraints" if kind == "rope" else "forces", one.name)
    assert state.clients[ME].picking is None
    assert len(state.undo) == 1
    assert lies(state)
    if kind == "cable":
        stretch = 4.0 * 9.81 / one.stiffness  # under the weight of both, and of the sheave
        assert 1e-4 < stretch / derive(state.model).size < 1e-2


def test_a_wheel_without_a_round_shape_on_its_hinge_is_small():
    beside = wheel("a", (0, 0, 0), shape={**DISC, "position": (0.1, 0, 0)})
    crossed = wheel("a", (0, 0, 0), shape={**DISC, "rotation": (1.0, 0.0, 0.0, 0.0)})
    for body in (beside, crossed, wheel("a", (0, 0, 0))):
        model = pg.Model(bodies=[body, wheel("b", (1, 0, 0))])
        radius = cables.station(model, "a")["radius"]
        assert radius == pytest.approx(0.05 * derive(model).size, rel=0.5)
    moved = wheel("a", (0, 0, 0), shape={**DISC, "position": (0.0, 0.3, 0.0)})
    found = cables.station(pg.Model(bodies=[moved]), "a")
    assert (found["point"], found["radius"]) == ((0.0, 0.3, 0.0), 0.1)


def test_the_banner_names_what_is_picked_and_takes_it_back():
    state = after(begun(ATWOOD), do.AddPart(ME, "constraints", "rope", "left"))
    assert "left → click the next body" in banner(state)["text"]
    assert banner(state)["ends"] == []
    state = after(state, do.Select(ME, "sheave"), do.Select(ME, "sheave"))  # a double click
    assert "left → sheave (wheel) → click" in banner(state)["text"]
    assert banner(state)["ends"] == [["Done", False]]
    assert banner(after(state, do.BackWay(ME)))["text"].startswith("left → click")
    gone = after(state, do.DeleteBodies(ME, ("sheave",), "attach"))
    assert banner(gone)["text"].startswith("left → ")
    assert after(state, do.Select(ME, None)).clients[ME].picking is None
    early = after(begun(ATWOOD), do.AddPart(ME, "constraints", "rope", "left"), do.EndWay(ME))
    assert (early.model.constraints, len(early.clients[ME].picking.way)) == ((), 1)


def test_a_belt_is_offered_over_wheels_and_turns_them_in_one_sense():
    state = after(begun(BELT), do.AddPart(ME, "constraints", "rope", "motor"))
    state = after(state, do.PickName(ME, "load"))
    assert banner(state)["ends"] == [["Belt", True], ["Done", False]]
    state = after(state, do.EndWay(ME, True))
    assert part(state).closed
    assert [x.side for x in part(state).through] == [1, 1]
    assert lies(state)


def test_a_belt_over_hinges_of_opposite_axes_is_not_crossed():
    turned = pg.Body(name="load", axes=[(0, -1, 0)], mass=1, link=(1, 0, 0))
    state = led(pg.Model(bodies=[BELT.bodies[0], turned]), "motor", "load", closed=True)
    assert [x.side for x in part(state).through] == [1, -1]
    assert lies(state)


@pytest.mark.parametrize("order", [1, -1])
@pytest.mark.parametrize("x", [0.1, -0.1])
def test_a_hook_hangs_upright_from_a_drum(x, order):
    model = pg.Model(bodies=[wheel("winch", (0, 0, 2), shape=DISC), weight("hook", (x, 0, 0))])
    state = led(model, *("winch", "hook")[::order])
    assert lies(state)
    d = state.derived
    threads = ties.joinings(state, d.positions, shapes.to_matrix(d.wxyz))["rods"]
    np.testing.assert_allclose(threads.ends[0, :, 0], x, atol=1e-12)  # a vertical span


def test_a_point_of_the_ground_is_above_the_block_that_hangs_on_it():
    block = weight("block", (0, 0, 0), 5.0)
    below = wheel("below", (0, 0, 0), parent="block", shape=DISC)
    above = wheel("above", (0.2, 0, 2), shape=DISC)
    model = pg.Model(bodies=[block, below, above, weight("end", (0.3, 0, 0.5))])
    state = led(model, "ground", "below", "above", "end")
    assert part(state).through[0].point == (-0.1, 0.0, 2.0)
    assert lies(state)
    d = state.derived
    threads = ties.joinings(state, d.positions, shapes.to_matrix(d.wxyz))["rods"]
    assert {round(x, 9) for x in threads.ends[[0, -1], 0, 0]} == {-0.1, 0.3}


def test_the_digraph_joins_bodies_that_follow_each_other():
    state = led(ATWOOD, "left", "sheave", "right")
    number = state.derived.number
    pairs = [{loop["body"], loop["other"]} for loop in digraph(state)["loops"]]
    assert pairs == [{number["left"], number["sheave"]}, {number["sheave"], number["right"]}]
    belt = led(BELT, "motor", "load", closed=True)
    assert [(x.body, x.other) for x in belt.derived.loops] == [(1, 2)]
    grounded = led(ATWOOD, "ground", "sheave", "right").derived.loops
    assert [(x.body, x.other) for x in grounded] == [
        (number["sheave"], 0), (number["sheave"], number["right"])
    ]  # fmt: skip


def test_rows_show_each_station_and_edit_it():
    state = led(ATWOOD, "left", "sheave", "right")
    labels = [row["label"] for row in rows(state)]
    assert labels == [
        "1. point", "Point", "2. wheel", "Centre", "Radius", "Axis", "Side", "Grip",
        "Friction", "3. point", "Point", "+ body",
    ]  # fmt: skip
    axis = rows(state)[5]
    assert [(c["value"], c["implied"]) for c in axis["cells"]] == [(0, True), (1, True), (0, True)]
    state = edit(state, ((1, 2), "120 mm"), ((0, 1, 2), "0.25"))
    assert (part(state).through[1].radius, part(state).through[0].point) == (0.12, (0, 0, 0.25))
    state = edit(state, ((1, 4), "-1"), ((1, 5), "no"))
    assert (part(state).through[1].side, part(state).through[1].grip) == (-1, False)
    state = edit(state, ((1, 4), ""), ((1, 5), ""), ((1, 3, 0), "0"))
    assert part(state).through[1] == pg.Pulley("sheave", radius=0.12, axis=(0, 1, 0))
    state = edit(state, ((1, 2), ""))
    assert part(state).through[1] == pg.Pulley("sheave")
    state = edit(state, ((1, 2), "120 mm"), ((1, 5), "no"), ((1, 6), "0.3"))
    assert (part(state).through[1].grip, part(state).through[1].friction) == (None, 0.3)
    state = edit(state, ((1, 5), "yes"))
    assert (part(state).through[1].grip, part(state).through[1].friction) == (True, None)
    refused = edit(state, ((0, 0), "nobody"))
    assert "nobody" in reply(refused)


def test_rows_are_added_moved_and_taken_out():
    state = led(ATWOOD, "left", "sheave")  # a drum at its end
    assert part(state).through[1].side is not None
    state = edit(state, ((), "right"))
    assert [x.body for x in part(state).through] == ["left", "sheave", "right"]
    assert part(state).through[1].side is None  # the drum has become a wheel
    assert lies(state)
    third = next(row for row in rows(state) if row["label"].startswith("3. "))
    up = next(b["fields"] for b in third["buttons"] if b["text"] == "↑")
    state = edit(state, (tuple(up["index"]), up["text"]))
    assert [x.body for x in part(state).through] == ["left", "right", "sheave"]
    assert lies(state)
    out = rows(state)[0]["buttons"][-1]["fields"]
    state = edit(state, (tuple(out["index"]), out["text"]))
    assert [x.body for x in part(state).through] == ["right", "sheave"]
    refused = edit(state, ((0,), ""))
    assert "two or more" in reply(refused)
    state = edit(state, ((0, 0), "left"))
    assert [x.body for x in part(state).through] == ["left", "sheave"]


def test_a_point_becomes_a_wheel_across_its_spans():
    bodies = [weight("a", (-1, 0, 0)), weight("b", (0, 0, 1)), weight("c", (1, 0, 0))]
    state = led(pg.Model(bodies=bodies), "a", "b", "c")
    round_ = next(row for row in rows(state) if row["label"] == "2. point")["buttons"][0]
    state = edit(state, (tuple(round_["fields"]["index"]), round_["fields"]["text"]))
    assert part(state).through[1].radius == cables.usual_radius(state.model)
    assert np.abs(part(state).through[1].axis).tolist() == [0, 1, 0]
    assert lies(state)


def test_what_cannot_lie_says_so_at_its_rows_and_is_not_drawn():
    state = edit(led(ATWOOD, "left", "sheave", "right"), ((1, 2), "3"))
    first = rows(state)[0]
    assert first["bad"]
    assert "move them apart" in first["note"]
    other = edit(led(BELT, "motor", "load", closed=True), ((0, 4), ""))
    first = rows(other)[0]
    assert "give side=1" in first["note"]
    assert "bad" not in rows(edit(other, ((0, 4), "1")))[0]
    d = other.derived
    threads = ties.joinings(other, d.positions, shapes.to_matrix(d.wxyz))["rods"]
    assert not len(threads.ends)


def test_an_axis_that_is_picked_fills_the_cells_of_the_axis():
    state = led(ATWOOD, "left", "sheave", "right")
    aim = do.StartAim(ME, "axis", "through", (1, 3), (), "constraints", "rope")
    state = after(state, aim)
    ray = do.ClickSpot(ME, (0.05, -5.0, 2.0), (0.0, 1.0, 0.0), 1e-6)  # the face of the sheave
    state = after(state, ray)
    station = part(state).through[1]
    assert np.abs(station.axis) == pytest.approx([0, 1, 0], abs=1e-9)
    assert station.point == (0, 0, 0)


def test_a_click_near_a_corner_leads_to_that_point():
    box = {"kind": "box", "size": (0.2, 0.2, 0.2)}
    model = ATWOOD.edit("right", shape=box)
    state = after(begun(model), do.AddPart(ME, "constraints", "rope", "sheave"))
    at = np.add(model.body("right").link, (0.1, -0.1, 0.1))  # a corner
    ray = do.ClickView(ME, (at[0] - 0.01, -5.0, at[2] - 0.01), (0.0, 1.0, 0.0), 0.01)
    for events in ((ray, do.Select(ME, "right")), (do.Select(ME, "right"), ray)):
        led_to = after(state, *events, do.EndWay(ME, False))
        assert part(led_to).through[1].point == pytest.approx((0.1, -0.1, 0.1))
        assert len(part(led_to).through) == 2


def test_a_wheel_that_no_shape_shows_is_drawn():
    state = led(ATWOOD, "left", "sheave", "right")
    d = state.derived

    def drums(state):
        return ties.joinings(state, d.positions, shapes.to_matrix(d.wxyz))["drums"]

    assert not len(drums(state).size)  # its cylinder
    drawn = drums(edit(state, ((1, 2), "0.2")))
    np.testing.assert_allclose(drawn.at, [(0, 0, 2)], atol=1e-12)
    np.testing.assert_allclose(drawn.size[0, :2], 0.4)
    bare = led(BELT, "motor", "load", closed=True)
    assert len(ties.joinings(bare, np.zeros((2, 3)), np.array([np.eye(3)] * 2))["drums"].size) == 2


def test_a_cable_that_cannot_lie_there_is_named_in_the_report_of_the_page():
    """As a rope is, which is a constraint."""
    through = ["left", pg.Pulley("sheave", radius=0.1), "right"]
    cable = pg.Cable(name="hoist", through=through, length=2.0)
    (line,) = mobility_report(begun(ATWOOD.add(cable)))["lines"]
    assert (line["constraint"], line["part"], line["bad"]) == ("hoist", "forces", True)
    assert "2 segments" in line["text"]
    assert not mobility_report(begun(ATWOOD.add(cable.model_copy(update={"length": None}))))[
        "lines"
    ]
