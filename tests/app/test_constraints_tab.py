"""Constraints, contacts, forces, limits and loops in their tab."""

import math
from dataclasses import replace

import numpy as np
import pytest

import pgraph_core as pg
from pgraph_app.constraints import KINDS, MobilityReport, parts, places
from pgraph_app.constraints import curves as curve_texts
from pgraph_app.constraints.curves import knots, table_of
from pgraph_app.constraints.mobility import mobility_report
from pgraph_app.constraints.parts import added
from pgraph_app.constraints.view import constraints, form
from pgraph_app.core.cells import Display
from pgraph_app.digraph.view import digraph
from pgraph_app.picking import Aim, Spot
from pgraph_app.picking.update import in_axes_of, taken
from pgraph_app.plots import Signal, curves, of_scene, unit
from pgraph_app.scene import ties
from pgraph_core.show import shapes

from .store import ME, OTHER, after, answered, begun, built_in, do, notice, reply


@pytest.fixture
def state():
    model = pg.Model.serial(3).edit("3", shape={"kind": "sphere", "radius": 0.05})
    return begun(model)


def add(state, part, kind, body="3", other="1"):
    state = after(state, do.AddPart(ME, part, kind, body))
    state = after(state, do.Select(ME, other)) if state.clients[ME].picking else state
    return after(state, do.EndWay(ME)) if state.clients[ME].picking else state


def side_by_side(state):
    """The same with the third body on the ground, for a cam and its follower."""
    return begun(state.model.edit("3", parent="ground", link=(0.3, 0.0, 0.4)))


def test_all_that_is_selected_gets_the_new_part_in_one_step(state):
    chosen = after(state, do.SelectBodies(ME, "3", ("1", "2", "3")))
    asked = after(chosen, do.AddPart(ME, "contacts", "soft", "3"))
    assert "3" in shown(asked)["picking"]["text"]
    touching = after(asked, do.PickName(ME, "ground"))
    found = [(c.body, c.other, c.law) for c in touching.model.contacts]
    assert found == [(name, "ground", "soft") for name in "123"]
    assert after(touching, do.Undo(ME)).model.contacts == ()
    driven = after(chosen, do.AddPart(ME, "forces", "motor", "3"))
    assert [force.body for force in driven.model.forces] == ["1", "2", "3"]
    assert driven.clients[ME].opened == ("forces", driven.model.forces[-1].name)
    two = after(state, do.SelectBodies(ME, "3", ("2", "3")))
    closed = add(two, "loops", "revolute")
    assert [(c.body, c.other, c.kind) for c in closed.model.constraints] == [
        (name, "1", "revolute") for name in "23"
    ]
    assert len(closed.undo) == 1
    assert closed.model.body("3").parent == "2"  # the tree stays
    assert [(loop["body"], loop["other"]) for loop in digraph(closed)["loops"]] == [(2, 1), (3, 1)]


def test_a_hinge_is_added_about_the_axis_of_its_joint_and_a_locked_loop_is_reported():
    state = begun(pg.Model.serial(3).edit("2", q=1.0).edit("3", q=0.7))  # hinges about y
    state = after(state, do.AddPart(ME, "constraints", "revolute", "3"), do.PickName(ME, "ground"))
    hinge = state.model.constraints[0]
    assert hinge.axis == state.model.body("3").axes[0] == (0, 1, 0)
    for axis, locked in (((0, 1, 0), False), ((0, 0, 1), True)):
        model = state.model.edit(hinge.name, axis=axis)
        lines = mobility_report(after(replace(state, model=model), report(model)))["lines"]
        assert any(line["bad"] for line in lines) == locked


def edit(state, part, name, field, *entries):
    return after(state, do.EditPart(ME, 7, part, name, field, tuple(entries)))


def shown(state):
    return constraints(state, state.clients[ME])


@pytest.mark.parametrize(
    ("part", "kind"),
    [
        (part, kind)
        for part in ("constraints", "forces", "loops", "sites", "outputs")
        for kind in KINDS[part]
    ],
)
def test_d12_every_kind_is_added_by_clicks_with_what_it_needs(state, part, kind):
    now = add(side_by_side(state) if kind == "cam" else state, part, kind)
    assert len(now.undo) == 1
    kept = "constraints" if part == "loops" else part
    (item,) = getattr(now.model, kept)
    assert now.clients[ME].opened == (kept, item.name)
    pg.Mechanism(now.model)  # and it can run
    form = next(x["form"] for ls in shown(now)["lists"] for x in ls["items"])
    assert form[0]["fields"]
    if part == "constraints":
        assert item.name in now.derived.constraints["3"]
        assert now.derived.constraints["2"] == ()
        assert (item.name in now.derived.constraints["1"]) == ("1" in item.touches)


@pytest.mark.parametrize("kind", list(KINDS["constraints"]))
@pytest.mark.parametrize("hub", ["distance", "revolute", "line"])  # no, two and one direction
def test_a_constraint_becomes_another_kind_and_comes_back(state, hub, kind):
    state = side_by_side(state) if kind == "cam" else state
    for old, new in ((kind, hub), (hub, kind)):
        now = edit(add(state, "constraints", old), "constraints", old, "kind", ((), new))
        assert (reply(now), now.model.constraints[0].kind) == ("", new)


@pytest.mark.parametrize(("turned", "axis"), [(0.0, 0), (np.pi / 2, 1)])
def test_a_slider_begins_along_the_way_from_its_origin(state, turned, axis):
    model = pg.Model.serial(2).edit("1", axes=((0, 0, 1),), q=(turned,), com=(0.1, 0, 0))
    model = model.edit("2", link=(0.2, 0, 0), com=(0.1, 0, 0))
    new = parts.needed(model, "constraints", "line", "2", "ground")
    assert new["other_axis"] == tuple(float(k == axis) for k in range(3))


@pytest.mark.parametrize("law", list(KINDS["contacts"]))
def test_d17_d18_contacts_of_every_law_on_ground_and_body(state, law):
    asked = after(state, do.AddPart(ME, "contacts", law, "3"))
    now = after(asked, do.PickName(ME, "ground"))
    (contact,) = now.model.contacts
    assert (contact.law, contact.body, contact.other) == (law, "3", "ground")
    for other in KINDS["contacts"]:
        now = edit(now, "contacts", "contact", "law", ((), other))
        assert now.model.contacts[0].law == other
    everything = shown(asked)["picking"]["names"][-1][0]
    drawn = after(asked, do.PickName(ME, everything))
    (contact,) = drawn.model.contacts
    assert (contact.body, contact.other) == ("*", "ground")
    changing = after(drawn, do.Pick(ME, "contacts", contact.name, "other"))
    assert everything not in [name for name, _ in shown(changing)["picking"]["names"]]


def test_d14_a_body_of_a_constraint_is_picked_by_a_click(state):
    asking = after(state, do.AddPart(ME, "constraints", "point", "3"))
    for end in (do.Select(ME, None), do.Unpick(ME)):
        assert after(asking, end).clients[ME].picking is None
    assert after(asking, do.PickName(ME, "nobody")).clients[ME].picking
    state = add(after(state, do.Connected(OTHER)), "constraints", "point")
    state = after(state, do.Pick(ME, "constraints", "point", "other"))
    assert shown(state)["picking"]
    other = after(state, do.Select(OTHER, "2"))
    assert other.clients[OTHER].selection == "2"
    assert other.clients[ME].picking  # each picks for themselves
    now = after(state, do.Select(ME, "2"))
    assert now.model.constraints[0].other == "2"
    assert now.clients[ME].picking is None
    assert now.clients[ME].selection is None  # a click while picking selects nothing


def test_d15_a_body_clicked_twice_is_still_asked_for_its_second(state):
    state = after(state, do.AddPart(ME, "loops", "revolute", "3"))
    asked = state.clients[ME].picking
    state = after(state, do.Select(ME, "3"))
    assert state.clients[ME].picking is asked
    state = after(state, do.PickName(ME, "ground"))
    (loop,) = state.model.constraints
    assert (loop.body, loop.other, loop.kind) == ("3", "ground", "revolute")
    state = after(add(state, "forces", "motor", "2"), do.OpenConstraints(ME, "2"))
    assert [x["name"] for ls in shown(state)["lists"] for x in ls["items"]] == ["motor"]


def test_constraints_that_cannot_be_met_and_late_reports():
    state = begun(built_in("four_bar"))
    bent = edit(state, "constraints", "loop", "other_point", ((1,), "9"))
    mobility = shown(reported(bent))["mobility"]
    assert mobility["state"] == "failed"
    assert mobility["lines"][0]["constraint"] == "loop"
    off = after(state, do.SwitchPart(ME, "constraints", "loop", False))
    assert after(off, report(state.model)) is off
    assert shown(off)["mobility"]["text"].startswith("3 ")  # the tree's own


@pytest.mark.parametrize("listed", [("point",), ()])
@pytest.mark.parametrize("active", [True, False])
def test_a_box_shows_and_switches_what_acts_in_the_chosen_scenario(listed, active):
    """Its dash said that the scenario has it otherwise, and a click changed the model alone."""
    tie = pg.Point(name="point", body="2", active=active)
    own = pg.Scenario(name="own", constraints=listed)
    model = pg.Model.serial(2).add(tie).replace(scenarios=(own, pg.Scenario(name="as model")))
    state = begun(model)
    for name, acts in (("own", bool(listed)), ("as model", active), ("", active)):
        now = after(state, do.SetScenario(ME, 1, name))
        (line,) = shown(now)["lists"][0]["items"]
        assert line["active"] == acts
        assert shown(now)["lists"][0]["of"] == (name if name == "own" else "")
        now = after(now, do.SwitchPart(ME, "constraints", "point", not acts))
        assert shown(now)["lists"][0]["items"][0]["active"] == (not acts)
        assert now.model.constraints[0].active == (active if name == "own" else not active)
        assert (now.model.scenarios[0].constraints == listed) == (name != "own")


def test_d16_d17_active_switch_and_joint_limits(state):
    now = add(state, "constraints", "point")
    off = after(now, do.SwitchPart(ME, "constraints", "point", False))
    assert not off.model.constraints[0].active
    limited = after(off, do.AddPart(ME, "limits", "limits", "2"))
    assert limited.model.body("2").limits == ((-np.pi, np.pi),)
    assert shown(limited)["limits"][0]["body"] == "2"
    ball = begun(pg.Model.serial(1).edit("1", joint="spherical"))
    refused = after(ball, do.AddPart(ME, "limits", "limits", "1"))
    assert refused.model is ball.model
    assert "limit" in notice(refused)


@pytest.mark.parametrize("kind", ["motor", "servo", "speed_servo", "actuator"])
@pytest.mark.parametrize("coordinate", [0, 1])
def test_a_drive_that_gets_a_second_body_keeps_its_own(kind, coordinate):
    model = pg.Model.serial(3).edit("2", joint="universal", axes=((1, 0, 0), (0, 1, 0)))
    state = add(begun(model), "forces", kind, "2")
    if coordinate:
        state = edit(state, "forces", kind, "coordinate", ((), str(coordinate)))
    state = edit(state, "forces", kind, "coefficients", ((), "3"))
    (drive,) = state.model.forces
    row = tuple(float(i == coordinate) for i in range(2))
    assert (drive.body, dict(drive.coefficients)) == ("2", {"2": row, "3": (1.0,)})


def rows_of(state, *fields):
    """The rows of the form of the first force, all or those of some fields."""
    groups = form(state, Display(), "forces", state.model.forces[0])
    return [r for g in groups for r in g["fields"] if not fields or r["field"] in fields]


def pulls(state):
    """The length of the path that the page shows [m]."""
    d = state.derived
    springs = ties.joinings(state, d.positions, shapes.to_matrix(d.wxyz))["springs"]
    return np.linalg.norm(springs.ends[:, 0] - springs.ends[:, 1], axis=1).sum()


@pytest.mark.parametrize("kind", ["spring", "strut"])
def test_via_points_are_added_typed_drawn_and_taken_out(state, kind):
    state = add(state, "forces", kind, "3", "1")
    length = pulls(state)
    for name in ("2", "2", "ground"):
        state = edit(state, "forces", kind, "via", ((), name))
        assert pulls(state) == pytest.approx(length, rel=1e-12)  # the path is as it was
    state = edit(state, "forces", kind, "via", ((0,), ""))
    state = edit(state, "forces", kind, "via", ((1, 1, 0), "200 mm"), ((1, 1, 2), "0.5"))
    one, two = state.model.forces[0].via
    assert (one.body, two.body) == ("2", "ground")
    assert (two.point[0], two.point[2]) == (0.2, 0.5)
    (line,) = next(x for x in shown(state)["lists"] if x["part"] == "forces")["items"]
    assert line["between"] == "3, 2, ground, 1"
    d = state.derived
    ends = ties.joinings(state, d.positions, shapes.to_matrix(d.wxyz))["springs"].ends
    assert len(ends) == 3
    np.testing.assert_allclose(ends[1:, 0], ends[:-1, 1])
    np.testing.assert_allclose(ends[1, 1], two.point)
    if kind == "spring":
        at = places.at_home(d.names, d.positions, d.wxyz)
        rest = places.implied(state.model, state.model.forces[0], "rest", at)
        assert rest == pytest.approx(pulls(state))
    refused = edit(state, "forces", kind, "via", ((), "nobody"))
    assert refused.model is state.model
    assert "nobody" in reply(refused)
    state = edit(state, "forces", kind, "via", ((0,), ""))
    assert [x.body for x in state.model.forces[0].via] == ["ground"]


def test_shifts_and_ranges_of_points_are_typed_as_text_and_drawn(state):
    state = edit(add(state, "forces", "spring", "3", "1"), "forces", "spring", "via", ((), "2"))
    at = [places.OF_VIA.index(name) for name in ("shifts", "when")]
    shift, when = "3 (0 0 1) 0 0.1; 1 0.3", "2 -0.5 1.5"
    state = edit(state, "forces", "spring", "via", ((0, at[0]), shift), ((0, at[1]), when))
    (via,) = state.model.forces[0].via
    assert (via.shifts[0].body, via.shifts[0].along, via.shifts[0].curve.value) == (
        "3", (0, 0, 1), (0.1, 0.3),
    )  # fmt: skip
    assert (via.when.body, via.when.low, via.when.high) == ("2", -0.5, 1.5)
    texts = [row["cells"][0]["value"] for row in rows_of(state, "via") if row["kind"] == "text"]
    assert texts == [shift, when]
    length = pg.Mechanism(state.model).path_length(pg.Mechanism(state.model).home()[0])[0]
    assert pulls(state) == pytest.approx(length, rel=1e-12)
    for k, text in ((at[0], "3 0 0 1"), (at[1], "2 1"), (at[1], "nobody 0 1")):
        refused = edit(state, "forces", "spring", "via", ((0, k), text))
        assert refused.model is state.model
        assert reply(refused)
    state = edit(state, "forces", "spring", "via", ((0, at[0]), ""), ((0, at[1]), ""))
    assert not state.model.forces[0]._rides
    state = edit(state, "forces", "spring", "shifts", ((), shift))
    assert [x.body for x in state.model.forces[0].shifts] == ["3"]


def test_a_picked_via_point_is_in_the_axes_of_its_own_body(state):
    state = edit(add(state, "forces", "spring", "3", "1"), "forces", "spring", "via", ((), "2"))
    aim = Aim("point", "via", (0, 1), part="forces", name="spring")
    found = in_axes_of(state, aim, Spot("2", (0.1, 0.2, 0.3), (0.0, 0.0, 1.0), ""))
    assert found == (0.1, 0.2, 0.3)


@pytest.mark.parametrize("field", ["point", "axis", "side"])
def test_a_pick_for_an_obstacle_fills_the_row_that_it_was_asked_for(state, field):
    state = edit(add(state, "forces", "spring", "3", "1"), "forces", "spring", "via", ((), "2"))
    state = edit(state, "forces", "spring", "via", ((0, 2), "0.05"))
    rows = rows_of(state)
    row = next(r for r in rows if r["field"] == "via" and r["label"].lower() == field)
    index = tuple(row["cells"][0]["index"][:-1])  # as the page sends it
    aim = Aim(row["pick"], "via", index, part="forces", name="spring", seen=state.version)
    old = state.model.forces[0].via[0]
    spot = Spot("2", (0.1, 0.2, 0.3), (0.0, 1.0, 0.0), "")
    (via,) = taken(state, ME, aim, spot).model.forces[0].via
    picked = (0.0, 1.0, 0.0) if field == "axis" else (0.1, 0.2, 0.3)
    assert via == old.model_copy(update={field: picked})


def test_via_points_have_beads_and_obstacles_are_drawn_once(state):
    state = edit(add(state, "forces", "spring", "3", "1"), "forces", "spring", "via", ((), "2"))
    for body in ("1", "2"):
        state = edit(state, "forces", "spring", "via", ((), body))
    state = edit(state, "forces", "spring", "via", ((0, 2), "0.05"))
    state = edit(state, "forces", "spring", "via", ((0, 3, 0), "0"), ((0, 3, 1), "2"))
    state = edit(state, "forces", "spring", "via", ((2, 2), "0.07"))
    state = after(state, do.DuplicatePart(ME, "forces", "spring"))
    d = state.derived
    found = ties.joinings(state, d.positions, shapes.to_matrix(d.wxyz))
    assert [len(found[kind].at) for kind in ("beads", "balls", "drums")] == [1, 1, 1]
    drum, ball, bead = (found[kind] for kind in ("drums", "balls", "beads"))
    assert drum.size[0] == pytest.approx([0.1, 0.1, 0.05])  # half as long as it is wide
    assert ball.size[0] == pytest.approx([0.14] * 3)
    R = shapes.to_matrix(d.wxyz)[d.number["2"] - 1]
    way = drum.ends[0, 1] - drum.ends[0, 0]
    assert way == pytest.approx(0.05 * R[:, 1])
    vias = state.model.forces[0].via
    at = places.at_home(d.names, d.positions, d.wxyz)
    for one, via in zip((drum, bead, ball), vias):
        p, turn = at[via.body]
        assert one.at[0] == pytest.approx(p + turn @ via.point)


def test_a_via_point_gets_another_body_where_it_is(state):
    state = edit(add(state, "forces", "spring", "3", "1"), "forces", "spring", "via", ((), "2"))
    length = pulls(state)
    moved = edit(state, "forces", "spring", "via", ((0, 0), "ground"))
    assert moved.model.forces[0].via[0].body == "ground"
    assert pulls(moved) == pytest.approx(length, rel=1e-12)
    for index, text, fact in (((0, 0), "nobody", "nobody"), ((0, 99), "1", "no longer")):
        assert fact in reply(edit(state, "forces", "spring", "via", (index, text)))


@pytest.mark.parametrize(("name", "body"), [("slider_crank", "crank"), ("four_bar", "left crank")])
def test_a_driven_mechanism_is_not_called_locked(name, body):
    model = built_in(name)
    start = model.body(body).q[0]
    curve = pg.Sine(mean=start, amplitude=0.1, frequency=1.0)
    motion = pg.Motion(name="drive", body=body, q_of_t=curve)
    lines = shown(reported(begun(model.add(motion))))["mobility"]["lines"]
    assert not any(line["bad"] for line in lines)
    found = pg.Mechanism(model.add(motion)).mobility()
    assert (found.dof, found.prescribed) == (0, 1)
    assert pg.Mechanism(model).mobility().prescribed == 0


@pytest.mark.parametrize(
    ("part", "kind", "field", "entries", "value"),
    [
        ("constraints", "point", "point", (((0,), "0.1"),), (0.1, 0.0, 0.0)),
        ("constraints", "point", "other_point", (((2,), "2 mm"),), (0.6, 0.0, 0.002)),
        ("constraints", "gear", "ratio", (((), "-2"),), -2.0),
        ("constraints", "velocity", "coefficients", (((0, 0), "2"),), {"3": (2.0,)}),
        ("forces", "wrench", "force", (((0,), "10"),), (10.0, 0.0, 0.0)),
        ("forces", "motor", "integrates", (((), "yes"),), True),
        ("forces", "drag", "rotation", (((0,), "0"), ((2,), "1")), (0.0, 0.0, 1.0, 0.0)),
        ("sites", "site", "body", (((), "ground"),), "ground"),
        ("outputs", "gyro", "at", (((), "2"),), "2"),
        ("outputs", "joint_velocity", "kind", (((), "accelerometer"),), "accelerometer"),
    ],
)
def test_points_directions_and_numbers_are_set(state, part, kind, field, entries, value):
    now = edit(add(state, part, kind), part, kind, field, *entries)
    assert reply(now) == ""
    found = getattr(getattr(now.model, part)[0], field)
    assert found == (value if isinstance(value, (dict, str)) else pytest.approx(value))
    assert len(now.undo) == 2


def test_a_setpoint_is_typed_in_the_unit_of_its_signal_and_kd_brings_its_filter(state):
    state = after(state, do.AddPart(ME, "controls", "pid", "3"))
    (pid,) = state.model.controls
    row = next(
        f for f in form(state, Display(), "controls", pid)[0]["fields"] if f["field"] == "setpoint"
    )
    assert row["unit"] == "rad"
    state = after(state, do.SetDisplay(ME, "angle", "deg"))
    for field, text in (("setpoint", "90"), ("kp", "4"), ("kd", "2")):
        state = edit(state, "controls", pid.name, field, ((), text))
    (pid,) = state.model.controls
    assert pid.setpoint == pytest.approx(math.pi / 2)
    assert (pid.kd, pid.filter) == (2.0, 2 / 40)


def test_a_contact_shows_the_friction_of_the_ground_that_it_has():
    contact = pg.Contact(name="heel", body="1", points=((0, 0, 0),), law="soft")
    model = pg.Model.serial(1).replace(contacts=(contact,), ground=pg.Ground(friction=0.2))
    (found, *_) = form(begun(model), Display(), "contacts", contact)
    (friction,) = [f for f in found["fields"] if f["field"] == "friction"]
    assert friction["cells"][0]["value"] == 0.2


def test_an_output_follows_its_site(state):
    state = add(state, "sites", "site")
    state = edit(state, "sites", "site", "name", ((), "imu"))
    state = edit(add(state, "outputs", "gyro"), "outputs", "gyro", "at", ((), "imu"))
    state = edit(state, "sites", "imu", "name", ((), "head"))
    assert state.model.outputs[0].at == "head"
    now = after(state, do.Undo(ME))
    assert (now.model.sites[0].name, now.model.outputs[0].at) == ("imu", "imu")
    run, signal = pg.simulate(now.model, t_end=0.1), Signal("output", "gyro")
    assert signal in of_scene(run)
    assert unit(now.model, signal) == "rad/s"
    assert [c.label for c in curves(run, signal)] == ["x", "y", "z"]


def test_motions_over_time(state):
    state = add(state, "constraints", "motion")
    state = edit(state, "constraints", "motion", "curve", ((), "polynomial"))
    state = edit(state, "constraints", "motion", "polynomial", ((1,), "2"))
    assert state.model.constraints[0].q_of_t.coefficients[:2] == (0.0, 2.0)
    turns = edit(state, "constraints", "motion", "polynomial", ((0,), "30 deg"), ((1,), "1500 rpm"))
    found = turns.model.constraints[0].q_of_t.coefficients[:2]
    assert found == pytest.approx((math.pi / 6, 50 * math.pi))
    state = edit(state, "constraints", "motion", "curve", ((), "table"))
    state = edit(state, "constraints", "motion", "table", ((), "0 0; 1 0.5; 2 0"))
    assert state.model.constraints[0].q_of_t.value == (0.0, 0.5, 0.0)
    assert edit(state, "constraints", "motion", "table", ((), "0 0; 0 1")).model is state.model
    kerb = edit(state, "constraints", "motion", "table", ((), "0 0; 0.1 0; 0.12 0.05; 0.2 0.05"))
    for way, most in (("spline", 0.0749), ("monotone", 0.05)):
        kerb = edit(kerb, "constraints", "motion", "interpolation", ((), way))
        motion = kerb.model.constraints[0]
        rows = form(kerb, Display(), "constraints", motion)[0]["fields"]
        (drawn,) = [row["curve"] for row in rows if row["field"] == "table"]
        assert motion.interpolation == way
        assert max(drawn["lines"][0]["y"]) == pytest.approx(most, rel=0.01)
    table = {"t": (0.0, 0.5), "value": (1.0, -2.5)}
    assert table_of(knots(table), 1) == table
    assert table_of("0\t1\n0.5\t-2.5\n", 1) == table  # pasted from a spreadsheet
    state = add(state, "constraints", "distance")
    for text, length in (("0.7", 0.7), ("", None)):
        state = edit(state, "constraints", "distance", "length", ((), text))
        assert state.model.constraints[1].length == length


def test_forces_over_time(state):
    state = add(state, "forces", "servo")
    state = edit(state, "forces", "servo", "target", ((), "0 0; 1 0.5"))
    assert state.model.forces[0].target == pg.Table(t=(0.0, 1.0), value=(0.0, 0.5))
    state = add(state, "forces", "wrench")
    state = edit(state, "forces", "wrench", "force_over", ((), "over time"))
    state = edit(state, "forces", "wrench", "force", ((), "0 0 0 1; 2 0 0 3"))
    assert state.model.forces[1].force.value == ((0.0, 0.0, 1.0), (0.0, 0.0, 3.0))
    state = edit(state, "forces", "wrench", "force_over", ((), "constant"))
    assert state.model.forces[1].force == (0.0, 0.0, 1.0)


def test_names_are_followed_by_scenarios_and_duplicates_are_free():
    quadruped = built_in("quadruped")
    name = quadruped.constraints[0].name
    now = edit(begun(quadruped), "constraints", name, "name", ((), "sole"))
    copied = after(now, do.DuplicatePart(ME, "constraints", "sole"))
    assert copied.model.constraints[1].name == "sole_2"
    gone = after(copied, do.DeletePart(ME, "constraints", "sole"))
    for state, there in ((now, True), (gone, False)):
        users = [s for s in state.model.scenarios if "sole" in (s.constraints or ())]
        assert (bool(users), "sole" in [x.name for x in state.model.constraints]) == (there, there)


def report(model):
    return do.Learned(MobilityReport.about(model))


def reported(state):
    state = after(state, do.Sees(ME, "constraints", True))
    assert MobilityReport.wanted(state)
    return after(state, report(state.model))


def test_redundant_rows_are_named_with_a_sufficient_kind():
    """A pin that becomes a line has no redundant row and leaves the same freedom."""
    model = built_in("slider_crank")
    line = shown(reported(begun(model)))["mobility"]["lines"][0]
    assert (line["constraint"], line["bad"]) == ("pin", False)
    words = ("translation along z", "rotation about x", "rotation about y", "'line'")
    assert all(word in line["text"] for word in words)
    pin = model.constraints[0]
    as_line = {"name": "pin", "kind": "line", "body": pin.body, "other": pin.other,
               "other_axis": (0, 0, 1)}  # fmt: skip
    found = MobilityReport.about(model.replace(constraints=(as_line,))).found
    assert (found.dof, bool(found.redundant)) == (1, False)


def test_assemble_moves_the_initial_state_in_one_step():
    state = begun(built_in("four_bar").edit("coupler", q=(0.2,)))
    now = answered(state, do.AssembleState(ME))
    assert len(now.undo) == 1
    q, v = pg.Mechanism(now.model).home()
    assert pg.Mechanism(now.model).assemble(q, v)[2].moved < 1e-9
    again = answered(now, do.AssembleState(ME))
    assert again.model is now.model
    assert notice(again) != notice(now)


def test_a_drive_has_the_unit_and_the_motion_of_its_joint_and_few_fields_first():
    model = pg.Model(bodies=[
        pg.Body(name="wheel", joint="compound",
                motions=(("translate", (0, 0, 1)), ("rotate", (0, 1, 0)))),
        pg.Body(name="slide", joint="prismatic"), pg.Body(name="hinge"),
    ])  # fmt: skip

    def fields(model, name):
        forms = form(begun(model), Display(), "forces", parts.item_of(model, "forces", name))
        return [{f["field"]: f for f in one["fields"]} for one in forms]

    units = {"slide": ("N/m", "N s/m", "m"), "hinge": ("N m/rad", "N m s/rad", "rad")}
    units["wheel"] = units["slide"]
    for name, expected in units.items():
        first, more = fields(*added(model, "forces", "servo", name, "ground"))
        assert tuple(first[f]["unit"] for f in ("kp", "kd", "target")) == expected
        assert first["target"]["cells"][0]["value"] == "0"
        shown = {"name", "kind", "body", "coordinate", "kp", "kd", "target", "feedback"}
        assert set(first) == shown
        assert "torque_limit" in more
    drive, name = added(model, "forces", "speed_servo", "wheel", "ground")
    turned = parts.changed(drive, "forces", name, "coordinate", (((), "1"),), Display(), {})
    first, _ = fields(turned, name)
    assert first["coordinate"]["options"] == [("0", "along z"), ("1", "about y")]
    assert (first["kd"]["unit"], first["speed"]["unit"]) == ("N m s/rad", "rad/s")


@pytest.mark.parametrize(
    ("value", "text"),
    [
        (pg.Lines(x=(0, 1.5), value=(-2, 3)), "0 -2; 1.5 3"),
        (pg.Bushing(name="r", body="a", stiffness=(1, 2, 3, 4, 5, 6)).stiffness, "1 2 3 4 5 6"),
        (pg.Bushing(name="r", body="a", stiffness=[[1.0] * 6] * 6).stiffness,
         "; ".join(["1 1 1 1 1 1"] * 6)),
    ],
)  # fmt: skip
def test_tables_and_matrices_are_typed_as_rows(value, text):
    assert curve_texts.rows(value) == text
    typed = curve_texts.rows_of(value, text)
    fields = {"stiffness": typed} if isinstance(value, tuple) else {}
    again = pg.Bushing(name="r", body="a", **fields).stiffness if fields else pg.Lines(**typed)
    assert again == value


def test_expressions_are_typed_where_a_number_may_vary():
    motor = pg.Motor(name="drive", body="3")
    motion = pg.Motion(name="turn", body="1", q_of_t={"kind": "polynomial", "coefficients": (0.1,)})
    model = pg.Model.serial(3).replace(forces=[motor], constraints=[motion])
    text = "=2*sin(3*t) - 4*q['3'] "
    typed = parts.changed(model, "forces", "drive", "torque", (((), text),), Display(), {})
    assert typed.forces[0].torque == text.strip()
    assert knots(typed.forces[0].torque) == text.strip()
    typed = parts.changed(typed, "constraints", "turn", "table", (((), "=0.2 * t"),), Display(), {})
    assert typed.constraints[0].q_of_t == "=0.2 * t"
    assert "=0.2 * t" in str(form(begun(typed), Display(), "constraints", typed.constraints[0]))
    assert text.strip() in str(form(begun(typed), Display(), "forces", typed.forces[0]))
    sine = parts.changed(typed, "constraints", "turn", "curve", (((), "sine"),), Display(), {})
    assert sine.constraints[0].q_of_t.kind == "sine"
    with pytest.raises(pg.ModelError, match="column 6"):
        parts.changed(model, "forces", "drive", "torque", (((), "=2*t t"),), Display(), {})


def test_the_friction_of_a_contact_is_typed_as_an_expression():
    floor = pg.Contact(name="floor", body="3", points=[(0, 0, 0)])
    model = pg.Model.serial(3).replace(contacts=[floor])
    typed = parts.changed(
        model, "contacts", "floor", "friction", (((), "=0.5 - 0.1*sin(t)"),), Display(), {}
    )
    assert typed.contacts[0].friction == "=0.5 - 0.1*sin(t)"
    rows = form(begun(typed), Display(), "contacts", typed.contacts[0])
    (cell,) = (f for group in rows for f in group["fields"] if f["field"] == "friction")
    assert cell["expression"]
    assert "=0.5 - 0.1*sin(t)" in str(cell)
    back = parts.changed(typed, "contacts", "floor", "friction", (((), ""),), Display(), {})
    assert back.contacts[0].friction is None


@pytest.mark.parametrize(("joint", "unit"), [("revolute", "rad"), ("prismatic", "m")])
def test_the_numbers_of_a_motion_show_the_units_of_its_joint(joint, unit):
    state = begun(pg.Model.serial(2).edit("2", joint=joint))
    state = after(state, do.AddPart(ME, "constraints", "motion", "2"))
    for curve, units in (
        ("polynomial", [unit, f"{unit}/s", f"{unit}/s²", f"{unit}/s³"]),
        ("sine", [unit, unit, "rad/s", "rad"]),
    ):
        state = edit(state, "constraints", "motion", "curve", ((), curve))
        rows = form(state, Display(), "constraints", state.model.constraints[0])[0]["fields"]
        (cells,) = [row["cells"] for row in rows if row["field"] == curve]
        assert [cell["name"].split("[")[1].rstrip("]") for cell in cells] == units


@pytest.mark.parametrize("joint", ["prismatic", "revolute"])
@pytest.mark.parametrize("copies", [1, 2])
def test_what_locks_a_joint_is_named(joint, copies):
    state = begun(pg.Model.serial(1).replace(bodies=({"name": "slider", "joint": joint, "mass": 1.0,
                                                      "axes": ["z"]},)))  # fmt: skip
    for _ in range(copies):
        state = after(state, do.AddPart(ME, "constraints", "weld", "slider"))
        state = after(state, do.PickName(ME, "ground"))
    lines = mobility_report(after(state, report(state.model)))["lines"]
    (text,) = [line["text"] for line in lines if line["bad"]]
    assert all(f"'{c.name}'" in text for c in state.model.constraints)
    assert "'slider'" in text
    assert "hinge" not in text
    assert "loop" not in text


def test_undo_withdraws_what_an_edit_changed_besides(state):
    for _ in range(5):
        state = add(state, "constraints", "point")
    removed = after(state, do.DeleteBodies(ME, ("3",), "delete"))
    assert all(f"'{c.name}'" in notice(removed) for c in state.model.constraints)
    for event in (do.Undo, do.Redo):
        removed = after(removed, event(ME))
        assert removed.clients[ME].notice.withdrawn


@pytest.mark.parametrize("kind", [pg.Spring, pg.Strut])
@pytest.mark.parametrize("count", [0, 1, 3])
def test_a_form_lists_points_in_the_order_of_the_path(kind, count):
    via = tuple(pg.Via(body="1", point=(0.1 * i, 0.0, 0.0)) for i in range(count))
    free = {"stiffness": 10.0} if kind is pg.Spring else {"bump_stiffness": 1.0, "bump_length": 0.1}
    rope = kind(name="rope", body="2", other_point=(1.0, 0.0, 0.0), via=via, **free)
    model = pg.Model.serial(2).model_copy(update={"forces": (rope,)})
    groups = form(begun(model), Display(), "forces", rope)
    (path,) = (one for one in groups if one["title"] == "Path")
    rows = path["fields"]
    between = [label for i in range(count) for label in (f"Via {i + 1}", "Point")]
    assert [row["label"] for row in rows] == ["Point", *between, "+ via", "Other point"]
    assert (path["title"], path["state"], path["open"]) == (
        "Path", f"{count + 2} points", count == 0
    )  # fmt: skip
    assert next(row for row in rows if row["label"] == "+ via")["cells"][0]["value"] == ""


def test_a_point_of_a_path_becomes_an_obstacle_with_an_axis_and_a_side():
    via = (pg.Via(body="1", point=(0.1, 0.0, 0.0)), pg.Via(body="ground", point=(0.5, 0.0, 0.0)))
    rope = pg.Spring(name="rope", body="2", other_point=(1.0, 0.0, 0.0), via=via, stiffness=10.0)
    state = begun(pg.Model.serial(2).model_copy(update={"forces": (rope,)}))

    def typed(*entries):
        return edit(state, "forces", "rope", "via", *entries)

    def labels():
        return [row["label"] for row in rows_of(state) if row["field"] == "via"][:6]

    assert labels() == ["Via 1", "Point", "Via 2", "Point", "+ via"]
    round_, out = rows_of(state, "via")[0]["buttons"]
    assert (round_["text"], out["text"]) == ("Round", "×")
    state = typed((tuple(round_["fields"]["index"]), round_["fields"]["text"]))
    assert 0.0 < state.model.forces[0].via[0].radius < 0.4
    assert labels() == ["Via 1", "Point", "Radius", "Axis", "Side", "Inner"]
    assert [b["text"] for b in rows_of(state, "via")[0]["buttons"]] == ["×"]
    state = typed(((0, 2), "0.05"))
    assert state.model.forces[0].via[0].radius == 0.05
    state = typed(((0, 3, 0), "0"), ((0, 3, 1), "0"), ((0, 3, 2), "1"))
    state = typed(((0, 4, 0), "0.1"), ((0, 4, 1), "0.2"), ((0, 4, 2), "0"))
    found = state.model.forces[0].via[0]
    assert (found.axis, found.side) == ((0.0, 0.0, 1.0), (0.1, 0.2, 0.0))
    state = typed(((0, 4, 0), ""))
    assert state.model.forces[0].via[0].side is None
    state = typed(((0, 5), "yes"))
    assert state.model.forces[0].via[0].inner
    assert not typed(((0, 5), "")).model.forces[0].via[0].inner
    state = typed(((0, 8, 0), "0.03"))  # a sphere becomes an ellipsoid with the same axes
    found = state.model.forces[0].via[0]
    assert (found.radii, found.radius, found.inner) == ((0.03, 0.03, 0.03), None, False)
    assert labels() == ["Via 1", "Point", "Radius", "Side", "Half axes", "Rotation"]
    assert [b["text"] for b in rows_of(state, "via")[0]["buttons"]] == ["×"]
    state = typed(((0, 8, 1), "0.02"), ((0, 9, 3), "1"))
    found = state.model.forces[0].via[0]
    assert (found.radii, found.rotation) == ((0.03, 0.02, 0.03), (1.0, 0.0, 0.0, 1.0))
    R = shapes.to_matrix(state.derived.wxyz)
    balls = ties.joinings(state, state.derived.positions, R)["balls"]
    assert balls.size[0] == pytest.approx([0.06, 0.04, 0.06])
    state = typed(((0, 2), "0.05"))
    assert (state.model.forces[0].via[0].radius, state.model.forces[0].via[0].radii) == (0.05, None)
    state = typed(((0, 2), ""))
    assert state.model.forces[0].via == via
