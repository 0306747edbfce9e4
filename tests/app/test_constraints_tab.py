"""Constraints, contacts, forces, limits and loops in their tab (interface.md 1.6; D12-D18)."""

from __future__ import annotations

from dataclasses import replace
from typing import Any

import numpy as np
import pytest

import pgraph_core as pg
import pgraph_models
from pgraph_app import features
from pgraph_app.constraints import KINDS, parts
from pgraph_app.constraints.mobility import mobility_report, report, wanted
from pgraph_app.constraints.parts import added, knots, table_of
from pgraph_app.constraints.update import (
    AddPart,
    AssembleState,
    DeletePart,
    DuplicatePart,
    EditPart,
    OpenConstraints,
    Pick,
    PickName,
    SwitchPart,
    Unpick,
)
from pgraph_app.constraints.view import constraints, form
from pgraph_app.core.cells import Display
from pgraph_app.core.events import Misread, from_page
from pgraph_app.core.state import initial
from pgraph_app.digraph.view import digraph
from pgraph_app.model.update import Undo
from pgraph_app.model.worker import answer
from pgraph_app.plots import Signal, curves, of_scene, unit
from pgraph_app.session.update import Connected, Sees, Select, SelectBodies

ME = 1
update: Any = features.update  # what each kind of part has, these tests know and no type


@pytest.fixture
def state():
    model = pg.Model.serial(3).edit("3", shape={"kind": "sphere", "radius": 0.05})
    return update(initial(model), Connected(ME))


def add(state, part, kind, body="3", other="1"):
    state = update(state, AddPart(ME, part, kind, body))
    return update(state, Select(ME, other)) if state.clients[ME].picking else state


def test_all_that_is_selected_gets_the_new_part_in_one_step(state):
    chosen = update(state, SelectBodies(ME, "3", ("1", "2", "3")))
    asked = update(chosen, AddPart(ME, "contacts", "soft", "3"))
    assert "on 3 bodies" in constraints(asked, asked.clients[ME])["picking"]["text"]
    touching = update(asked, PickName(ME, "ground"))
    found = [(c.body, c.other, c.law) for c in touching.model.contacts]
    assert found == [(name, "ground", "soft") for name in "123"]
    assert update(touching, Undo(ME)).model.contacts == ()
    driven = update(chosen, AddPart(ME, "forces", "motor", "3"))
    assert [force.body for force in driven.model.forces] == ["1", "2", "3"]
    assert driven.clients[ME].opened == ("forces", driven.model.forces[-1].name)


def test_the_six_legs_of_a_platform_are_closed_in_one_step():
    bodies = [pg.Body(name="plate", joint="free", link=(0, 0, 1), mass=10)]
    for k in range(6):
        angle = k * np.pi / 3
        foot, head = (r * np.array([np.cos(a), np.sin(a), 0]) for r, a in (
            (1.0, angle), (0.5, angle + (0.3 if k % 2 else -0.3)),
        ))  # fmt: skip
        half = tuple((head - foot + np.array([0, 0, 1])) / 2)
        bodies += [
            pg.Body(name=f"foot {k}", joint="universal", link=tuple(foot), tip=half),
            pg.Body(name=f"leg {k}", parent=f"foot {k}", joint="prismatic", axes=(half,), link=half,
                    tip=half),
        ]  # fmt: skip
    legs = tuple(f"leg {k}" for k in range(6))
    state = update(initial(pg.Model(bodies=tuple(bodies), up="z")), Connected(ME))
    state = update(state, SelectBodies(ME, legs[-1], legs))
    closed = add(state, "loops", "spherical", legs[-1], "plate")
    assert [c.body for c in closed.model.constraints] == [*legs]
    assert len(closed.undo) == 1
    assert pg.Mechanism(closed.model).mobility().dof == 6


def test_every_body_with_the_ground_is_one_click(state):
    asked = update(state, AddPart(ME, "contacts", "complementarity", "3"))
    names = [name for name, _ in constraints(asked, asked.clients[ME])["picking"]["names"]]
    (contact,) = update(asked, PickName(ME, names[-1])).model.contacts
    assert (contact.body, contact.other) == ("*", "ground")
    drawn = update(asked, PickName(ME, names[-1]))
    changing = update(drawn, Pick(ME, "contacts", contact.name, "other"))
    kept = [name for name, _ in constraints(changing, changing.clients[ME])["picking"]["names"]]
    assert names[-1] not in kept


def edit(state, part, name, field, *entries):
    return update(state, EditPart(ME, 7, part, name, field, tuple(entries)))


def told(state) -> str:
    return state.clients[ME].reply.text


def shown(state):
    return constraints(state, state.clients[ME])


def test_a_hinge_is_added_about_the_axis_of_its_joint_and_a_locked_loop_is_called_so():
    bent = pg.Model.serial(3).edit("2", q=1.0).edit("3", q=0.7)  # hinges about y
    state = update(initial(bent), Connected(ME))
    state = update(state, AddPart(ME, "constraints", "revolute", "3"))
    state = update(state, PickName(ME, "ground"))
    hinge = state.model.constraints[0]
    assert hinge.axis == state.model.body("3").axes[0] == (0, 1, 0)
    for axis, locked in (((0, 1, 0), False), ((0, 0, 1), True)):
        model = state.model.edit(hinge.name, axis=axis)
        lines = mobility_report(replace(state, model=model, mobility=report(model)), 300)["lines"]
        assert any("Nothing can move" in line["text"] for line in lines) == locked


LISTS = ("constraints", "forces", "loops", "sites", "outputs")
CASES = [(part, kind) for part in LISTS for kind in KINDS[part]]


@pytest.mark.parametrize(("part", "kind"), CASES)
def test_d12_every_kind_is_added_by_clicks_with_what_it_needs(state, part, kind):
    after = add(state, part, kind)
    assert len(after.undo) == 1
    kept = "constraints" if part == "loops" else part
    (item,) = getattr(after.model, kept)
    assert after.clients[ME].opened == (kept, item.name)
    pg.Mechanism(after.model)  # and it can run
    form = next(x["form"] for ls in shown(after)["lists"] for x in ls["items"])
    assert form[0]["fields"]


@pytest.mark.parametrize("law", list(KINDS["contacts"]))
def test_d17_d18_contacts_of_every_law_on_ground_and_body(state, law):
    after = update(state, AddPart(ME, "contacts", law, "3"))
    after = update(after, PickName(ME, "ground"))
    assert after.model.contacts[0].law == law
    assert after.model.contacts[0].other == "ground"
    for other in KINDS["contacts"]:
        after = edit(after, "contacts", "contact", "law", ((), other))
        assert after.model.contacts[0].law == other


def test_d13_the_last_column_is_filled_from_the_list(state):
    after = add(state, "constraints", "distance")
    assert after.derived.constraints["3"] == ("distance",)
    assert after.derived.constraints["1"] == ("distance",)
    assert after.derived.constraints["2"] == ()


def test_d14_a_body_of_a_constraint_is_picked_by_a_click(state):
    state = add(state, "constraints", "point")
    state = update(state, Pick(ME, "constraints", "point", "other"))
    assert "other body" in shown(state)["picking"]["text"]
    after = update(state, Select(ME, "2"))
    assert after.model.constraints[0].other == "2"
    assert after.clients[ME].picking is None
    assert after.clients[ME].selection is None  # a click while picking selects nothing


def test_d14_escape_ends_picking_and_the_ground_can_be_picked(state):
    picking = update(state, AddPart(ME, "constraints", "point", "3"))
    assert update(picking, Select(ME, None)).clients[ME].picking is None
    assert update(picking, Unpick(ME)).clients[ME].picking is None
    grounded = update(picking, PickName(ME, "ground"))
    assert grounded.model.constraints[0].other == "ground"
    assert update(picking, PickName(ME, "nobody")).clients[ME].picking is not None


def test_d14_two_people_pick_each_for_themselves(state):
    state = update(state, Connected(2))
    state = update(state, AddPart(ME, "constraints", "point", "3"))
    state = update(state, Select(2, "2"))
    assert state.clients[2].selection == "2"
    assert state.clients[ME].picking is not None


def test_d15_a_second_parent_is_a_cut_joint_and_a_loop_edge(state):
    after = add(state, "loops", "revolute")
    assert after.model.constraints[0].kind == "revolute"
    assert after.model.body("3").parent == "2"
    assert [(loop["body"], loop["other"]) for loop in digraph(after)["loops"]] == [(3, 1)]


def test_d15_a_loop_through_the_ground_and_a_body_clicked_twice_is_still_asked_for_its_second(
    state,
):
    state = update(state, AddPart(ME, "loops", "revolute", "3"))
    asked = state.clients[ME].picking
    state = update(state, Select(ME, "3"))
    assert state.clients[ME].picking is asked
    state = update(state, PickName(ME, "ground"))
    assert [(x.body, x.other, x.kind) for x in state.model.constraints] == [
        ("3", "ground", "revolute")
    ]


def test_d16_d17_active_switch_and_joint_limits(state):
    after = add(state, "constraints", "point")
    off = update(after, SwitchPart(ME, "constraints", "point", False))
    assert not off.model.constraints[0].active
    limited = update(off, AddPart(ME, "limits", "limits", "2"))
    assert limited.model.body("2").limits == ((-np.pi, np.pi),)
    assert shown(limited)["limits"][0]["body"] == "2"
    ball = pg.Model.serial(1).edit("1", joint="spherical")
    refused = update(update(initial(ball), Connected(ME)), AddPart(ME, "limits", "limits", "1"))
    assert "no motion that a limit could bound" in refused.clients[ME].notice.text


@pytest.mark.parametrize(
    ("part", "kind", "field", "entries", "value"),
    [
        ("constraints", "point", "point", (((0,), "0.1"),), (0.1, 0.0, 0.0)),
        ("constraints", "point", "other_point", (((2,), "2 mm"),), (0.6, 0.0, 0.002)),
        ("constraints", "distance", "length", (((), "0.7"),), 0.7),
        ("constraints", "gear", "ratio", (((), "-2"),), -2.0),
        ("constraints", "revolute", "axis", (((1,), "1"),), (0.0, 1.0, 0.0)),
        ("constraints", "rolling", "radius", (((), "0.2"),), 0.2),
        ("constraints", "velocity", "value", (((), "3"),), 3.0),
        ("constraints", "velocity", "coefficients", (((2, 0), "2"),), {"3": (2.0,)}),
        ("forces", "servo", "kp", (((), "100"),), 100.0),
        ("forces", "servo", "torque_limit", (((), "5"),), 5.0),
        ("forces", "motor", "torque", (((), "0.5"),), 0.5),
        ("forces", "spring", "rest", (((), "0.3"),), 0.3),
        ("forces", "wrench", "force", (((0,), "10"),), (10.0, 0.0, 0.0)),
        ("forces", "motor", "integrates", (((), "yes"),), True),
        ("forces", "drag", "rotation", (((0,), "0"), ((2,), "1")), (0.0, 0.0, 1.0, 0.0)),
        ("sites", "site", "point", (((1,), "20 mm"),), (0.0, 0.02, 0.0)),
        ("sites", "site", "body", (((), "ground"),), "ground"),
        ("outputs", "gyro", "at", (((), "2"),), "2"),
        ("outputs", "joint_velocity", "kind", (((), "accelerometer"),), "accelerometer"),
    ],
)
def test_points_directions_and_numbers_are_set(state, part, kind, field, entries, value):
    after = edit(add(state, part, kind), part, kind, field, *entries)
    assert told(after) == ""
    found = getattr(getattr(after.model, part)[0], field)
    assert found == (value if isinstance(value, (dict, str)) else pytest.approx(value))
    assert len(after.undo) == 2


def test_an_output_follows_its_site_and_its_undo_leaves_what_another_did(state):
    two = update(state, Connected(2))
    pages = {me: replace(page, page=f"page {me}") for me, page in two.clients.items()}
    state = add(replace(two, clients=pages), "sites", "site")
    state = edit(state, "sites", "site", "name", ((), "imu"))
    state = edit(add(state, "outputs", "gyro"), "outputs", "gyro", "at", ((), "imu"))
    state = edit(state, "sites", "imu", "name", ((), "head"))
    assert state.model.outputs[0].at == "head"
    after = update(update(state, AddPart(2, "outputs", "accelerometer", "1")), Undo(ME))
    assert {o.name: o.at for o in after.model.outputs} == {"gyro": "imu", "accelerometer": "1"}
    assert after.model.sites[0].name == "imu"
    run = pg.simulate(after.model, t_end=0.1)
    signal = Signal("output", "gyro")
    assert signal in of_scene(run)
    assert unit(after.model, signal) == "rad/s"
    assert [c.label for c in curves(run, signal)] == ["x", "y", "z"]


def test_an_empty_cell_leaves_it_out_again(state):
    state = add(state, "constraints", "distance")
    state = edit(state, "constraints", "distance", "length", ((), "0.7"))
    state = edit(state, "constraints", "distance", "length", ((), ""))
    assert state.model.constraints[0].length is None


def test_motions_over_time(state):
    state = add(state, "constraints", "motion")
    for curve in ("sine", "table", "polynomial"):
        state = edit(state, "constraints", "motion", "curve", ((), curve))
        assert told(state) == ""
    state = edit(state, "constraints", "motion", "polynomial", ((1,), "2"))
    assert state.model.constraints[0].q_of_t.coefficients[:2] == (0.0, 2.0)
    state = edit(state, "constraints", "motion", "curve", ((), "table"))
    state = edit(state, "constraints", "motion", "table", ((), "0 0; 1 0.5; 2 0"))
    assert state.model.constraints[0].q_of_t.value == (0.0, 0.5, 0.0)
    bad = edit(state, "constraints", "motion", "table", ((), "0 0; 0 1"))
    assert "ascend" in told(bad)


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


def test_tables_are_typed_as_they_are_shown():
    table = {"t": (0.0, 0.5), "value": (1.0, -2.5)}
    assert table_of(knots(table), 1) == table
    assert table_of("0\t1\n0.5\t-2.5\n", 1) == table  # pasted from a spreadsheet


@pytest.mark.parametrize("kind", list(KINDS["constraints"]))
@pytest.mark.parametrize("other", list(KINDS["constraints"]))
def test_a_constraint_becomes_any_other_kind(state, kind, other):
    after = edit(add(state, "constraints", kind), "constraints", kind, "kind", ((), other))
    assert told(after) == "" or "gear needs a second body" in told(after) or "ground" in told(after)
    if not told(after):
        assert after.model.constraints[0].kind == other


def test_names_are_followed_by_scenarios_and_duplicates_are_free():
    quadruped = pg.Model.load(pgraph_models.path("quadruped"))
    state = update(initial(quadruped), Connected(ME))
    name = quadruped.constraints[0].name
    using = [s.name for s in quadruped.scenarios if name in (s.constraints or ())]
    after = edit(state, "constraints", name, "name", ((), "sole"))
    assert all("sole" in after.model.scenario(s).constraints for s in using)
    copied = update(after, DuplicatePart(ME, "constraints", "sole"))
    assert copied.model.constraints[1].name == "sole 2"
    gone = update(copied, DeletePart(ME, "constraints", "sole"))
    assert "sole" not in [x.name for x in gone.model.constraints]
    assert all("sole" not in (s.constraints or ()) for s in gone.model.scenarios)


@pytest.mark.parametrize(
    ("field", "text", "part"),
    [
        ("length", "-1", "a length > 0"),
        ("length", "1e400", "too large"),
        ("length", "<i>", "must be a number"),
        ("point", "nan", "must be a number"),
        ("name", "", "not empty"),
        ("name", "x" * 10_000, "at most 100 characters"),
        ("other", "3", "constrained to itself"),
        ("other", "nobody", "no body is named"),
        ("kind", "glue", "must be one of"),
    ],
)
def test_what_does_not_fit_is_a_sentence(state, field, text, part):
    state = add(state, "constraints", "distance")
    index = (0,) if field == "point" else ()
    after = edit(state, "constraints", "distance", field, (index, text))
    assert after.model is state.model
    assert part in told(after)
    assert len(told(after)) < 300


def test_the_list_of_one_body(state):
    state = add(add(state, "constraints", "point"), "forces", "motor", "2")
    state = update(state, OpenConstraints(ME, "2"))
    names = [x["name"] for ls in shown(state)["lists"] for x in ls["items"]]
    assert names == ["motor"]
    assert state.clients[ME].called == 3  # also for each new one
    assert shown(update(state, OpenConstraints(ME, None)))["listed"] is None


# -- mobility and assembly ---------------------------------------------------------------------


def reported(state):
    """The state with a page that watches, and the report on its model."""
    state = update(state, Sees(ME, "constraints", True))
    assert wanted(state)
    return update(state, report(state.model))


def test_redundant_rows_are_named_with_what_would_do():
    model = pg.Model.load(pgraph_models.path("slider_crank"))
    state = reported(update(initial(model), Connected(ME)))
    told_ = shown(state)["mobility"]
    assert told_["text"].startswith("1 degree of freedom left: 3 of the tree")
    assert told_["lines"][0] == {
        "constraint": "pin",
        "text": "unnecessarily removes translation along z, rotation about x and rotation about y; "
        "a 'line' would do",
        "bad": False,
    }
    assert "singular matrix" not in str(told_)


def test_the_advice_is_right():
    """As a line the pin has no redundant row and leaves the same freedom."""
    model: Any = pg.Model.load(pgraph_models.path("slider_crank"))
    state = update(initial(model), Connected(ME))
    line = {"name": "pin", "kind": "line", "body": model.constraints[0].body,
            "other": model.constraints[0].other, "other_axis": (0, 0, 1)}  # fmt: skip
    found = report(state.model.replace(constraints=(line,))).found
    assert found.dof == 1
    assert not found.redundant


def test_a_report_of_another_model_is_dropped():
    model = pg.Model.load(pgraph_models.path("four_bar"))
    state = update(initial(model), Connected(ME))
    late = report(model)
    after = update(state, SwitchPart(ME, "constraints", "loop", False))
    assert update(after, late) is after
    assert (
        shown(after)["mobility"]["text"] == "3 degrees of freedom; no active constraint takes any."
    )


def test_constraints_that_cannot_be_met_are_said_with_their_gap():
    model = pg.Model.load(pgraph_models.path("four_bar"))
    state = update(initial(model), Connected(ME))
    state = edit(state, "constraints", "loop", "other_point", ((1,), "9"))
    told_ = shown(reported(state))["mobility"]
    assert told_["state"] == "failed"
    assert "misses by" in told_["text"]
    assert told_["lines"][0]["constraint"] == "loop"


def test_assemble_moves_the_initial_state_in_one_step():
    model = pg.Model.load(pgraph_models.path("four_bar")).edit("coupler", q=(0.2,))
    state = update(initial(model), Connected(ME))
    asked = update(state, AssembleState(ME))
    after = update(asked, answer(asked.errands[0]))
    assert len(after.undo) == 1
    assert "moved by up to" in after.clients[ME].notice.text
    again = update(after, AssembleState(ME))
    same = update(again, answer(again.errands[0]))
    assert same.model is after.model
    assert "already" in same.clients[ME].notice.text


def test_a_page_cannot_send_what_is_no_event():
    good = '{"event": "AddPart", "part": "constraints", "kind": "point", "body": null}'
    assert isinstance(from_page(ME, good), AddPart)
    for bad in (
        '{"event": "AddPart", "part": "bodies", "kind": "point", "body": null}',
        '{"event": "EditPart", "serial": 1, "part": "forces", "name": "a", "field": "b", '
        '"entries": []}',
        '{"event": "ErrandDone", "id": 1}',
        '{"event": "MobilityFound", "model": null, "found": null}',
    ):
        assert isinstance(from_page(ME, bad), Misread)
    unknown = '{"event": "AddPart", "part": "constraints", "kind": "glue", "body": "1"}'
    state = update(initial(pg.Model.serial(2)), Connected(ME))
    assert update(state, from_page(ME, unknown)) is state


@pytest.mark.parametrize("scale", [0.1, 1.0, 10.0])
@pytest.mark.parametrize("turned", [False, True])
def test_servos_as_they_are_added_hold_an_arm_and_its_gripper(turned, scale):
    """Six joints about axes across each other and a finger that slides, heavy or light."""
    axes = [(0, 0, 1), (0, 1, 0), (0, 1, 0), (1, 0, 0), (0, 1, 0), (1, 0, 0)]
    model = pg.Model.serial(6)
    for body, axis in zip(model.bodies, axes):
        heavy = {"mass": body.mass * scale, "inertia": np.array(body.inertia) * scale}
        model = model.edit(body.name, axes=axis, q=(0.3 if turned else 0.0,), **heavy)
    finger = pg.Body(name="finger", parent="6", joint="prismatic", axes=(0, 0, 1), mass=0.1 * scale,
                     inertia=np.eye(3) * 1e-5, link=(0.2, 0.0, 0.0))  # fmt: skip
    model = model.add(finger)
    for body in model.bodies:
        model, _ = added(model, "forces", "servo", body.name, "ground")
    run = pg.simulate(model, t_end=2.0)
    assert run.status.ok, run.message
    for body in model.bodies:
        moved = run[body.name] - body.q[0]
        bound = 0.01 if body.name == "finger" else 0.1
        assert np.abs(moved).max() < bound
        assert np.abs(moved[-10:] - moved[-1]).max() < 0.05 * bound  # at rest


@pytest.mark.parametrize("order", [("left", "right"), ("right",)])
@pytest.mark.parametrize("legs", ["free beam", "beam on one leg"])
def test_servos_of_a_closed_mechanism_hold_what_its_loops_carry(legs, order):
    """A beam of 33 kg on two sliding rods of 1 kg, joined by points; a guide keeps it upright.

    Where one rod alone has a servo, the other hangs on the beam.
    """
    rod = {"joint": "prismatic", "axes": (0, 0, 1), "mass": 1.0, "inertia": np.eye(3) * 0.01}
    apart = (("left", -1.0), ("right", 1.0))
    rods = [pg.Body(name=name, link=(x, 0, 0), tip=(0, 0, 1), **rod) for name, x in apart]
    on_leg = legs == "beam on one leg"
    how = ({"parent": "left", "joint": "spherical", "link": (0, 0, 1), "com": (1, 0, 0)}
           if on_leg else {"joint": "free", "link": (0, 0, 1)})  # fmt: skip
    beam = pg.Body(name="beam", mass=33.0, inertia=np.eye(3) * 10.0, **how)
    ends = apart[on_leg:]
    points = [
        pg.Constraint(name=name, kind="point", body=name, other="beam", point=(0, 0, 1))
        for name, _ in ends
    ]
    upright = pg.Constraint(name="guide", kind="orientation", body="beam")
    model = pg.Model(bodies=(*rods, beam), constraints=(*points, upright))
    for name in order:
        model, _ = added(model, "forces", "servo", name, "ground")
    run = pg.simulate(model, t_end=2.0)
    assert run.status.ok, run.message
    down = np.asarray(run.body_pose)[:, list(run.mechanism.names).index("beam"), 2]
    assert 1e-4 < down[0] - down[-1] < 5.01e-3
    assert np.ptp(down[-10:]) < 1e-4  # at rest


def test_a_servo_of_a_standing_leg_holds_the_trunk():
    """A trunk of 30 kg on a leg whose foot is held on the ground, by a point or by a contact."""
    trunk = pg.Body(name="trunk", joint="free", link=(0, 0, 1), com=(0.3, 0, 0), mass=30.0)
    leg = pg.Body(name="leg", parent="trunk", mass=2.0, com=(0, 0, -0.5), tip=(0, 0, -1))
    held = pg.Constraint(name="foot", kind="point", body="leg")
    touches = pg.Contact(name="foot", body="leg", points=((0, 0, -1),))
    model = pg.Model(bodies=(trunk, leg))
    alone = parts.gains(model, "leg")["kp"]
    for standing in (model.add(held), model.add(touches)):
        kp = 9.81 * 30.0 * 0.3 / parts.SAG["rotate"]
        assert parts.gains(standing, "leg")["kp"] == pytest.approx(kp, rel=0.05)
    assert alone == pytest.approx(9.81 * 2.0 * 0.5 / parts.SAG["rotate"], rel=0.05)


def test_a_drive_has_the_unit_and_the_motion_of_its_joint_and_few_fields_first():
    model = pg.Model(bodies=[
        pg.Body(name="wheel", joint="compound",
                motions=(("translate", (0, 0, 1)), ("rotate", (0, 1, 0)))),
        pg.Body(name="slide", joint="prismatic"), pg.Body(name="hinge"),
    ])  # fmt: skip
    units = {"slide": ("N/m", "N s/m", "m"), "hinge": ("N m/rad", "N m s/rad", "rad")}
    units["wheel"] = units["slide"]
    for name, expected in units.items():
        with_one, servo = added(model, "forces", "servo", name, "ground")
        state = update(initial(with_one), Connected(ME))
        first, more = form(state, Display(), "forces", parts.item_of(with_one, "forces", servo))
        shown = {f["field"]: f for f in first["fields"]}
        assert tuple(shown[f]["unit"] for f in ("kp", "kd", "target")) == expected
        assert shown["target"]["cells"][0]["value"] == "0"
        assert "over time" in shown["target"]["note"]
        assert set(shown) == {"name", "kind", "body", "coordinate", "kp", "kd", "target"}
        assert (more["title"], more["open"]) == ("More", False)
        assert "torque_limit" in {f["field"] for f in more["fields"]}
    drive, name = added(model, "forces", "speed_servo", "wheel", "ground")
    turned = parts.changed(drive, "forces", name, "coordinate", (((), "1"),), Display(), {})
    state = update(initial(turned), Connected(ME))
    (first, _) = form(state, Display(), "forces", turned.forces[0])
    shown = {f["field"]: f for f in first["fields"]}
    assert shown["coordinate"]["options"] == [("0", "along z"), ("1", "about y")]
    assert (shown["kd"]["unit"], shown["speed"]["unit"]) == ("N m s/rad", "rad/s")
