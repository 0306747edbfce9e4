"""Drives, controls and motions that are added and edited by clicks."""

import math

import numpy as np
import pytest

import pgraph_core as pg
from pgraph_app.constraints import gains
from pgraph_app.constraints.parts import added
from pgraph_app.constraints.view import constraints

from .store import ME, after, begun, do, notice, reply
from .test_constraints_tab import edit


@pytest.mark.parametrize(("turned", "scale"), [(False, 1.0), (True, 0.1), (True, 10.0)])
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


@pytest.mark.parametrize(
    ("on_leg", "driven"), [(False, "left right"), (False, "right"), (True, "left right")]
)
def test_servos_of_a_closed_mechanism_hold_the_weight_on_its_loops(on_leg, driven):
    """A guide keeps a beam of 33 kg upright on two sliding rods of 1 kg, joined by points.

    The beam is free or hangs on a leg. If only one rod has a servo, the other hangs on the beam.
    """
    rod = {"joint": "prismatic", "axes": (0, 0, 1), "mass": 1.0, "inertia": np.eye(3) * 0.01}
    apart = (("left", -1.0), ("right", 1.0))
    rods = [pg.Body(name=name, link=(x, 0, 0), tip=(0, 0, 1), **rod) for name, x in apart]
    how = ({"parent": "left", "joint": "spherical", "link": (0, 0, 1), "com": (1, 0, 0)}
           if on_leg else {"joint": "free", "link": (0, 0, 1)})  # fmt: skip
    beam = pg.Body(name="beam", mass=33.0, inertia=np.eye(3) * 10.0, **how)
    points = [
        pg.Constraint(name=name, kind="point", body=name, other="beam", point=(0, 0, 1))
        for name, _ in apart[on_leg:]
    ]
    upright = pg.Constraint(name="guide", kind="orientation", body="beam")
    model = pg.Model(bodies=(*rods, beam), constraints=(*points, upright))
    for name in driven.split():
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
    alone = gains.gains(model, "leg")["kp"]
    for standing in (model.add(held), model.add(touches)):
        kp = 9.81 * 30.0 * 0.3 / gains.SAG[0]
        assert gains.gains(standing, "leg")["kp"] == pytest.approx(kp, rel=0.05)
    assert alone == pytest.approx(9.81 * 2.0 * 0.5 / gains.SAG[0], rel=0.05)


@pytest.mark.parametrize("kind", pg.Control.KINDS)
@pytest.mark.parametrize("body", ["two", None])
def test_a_control_is_added_edited_changed_and_taken_away_by_clicks(kind, body):
    """Its form follows from its fields, and what it reads stays when its kind is another one."""
    bodies = [pg.Body(name="one"), pg.Body(name="two", parent="one", joint="universal", q=(0, 1))]
    start = begun(pg.Model(bodies=bodies))
    state = after(start, do.AddPart(ME, "controls", kind, body))
    (control,) = state.model.controls
    name = control.name
    assert state.clients[ME].opened == ("controls", name)
    read = pg.Control.KINDS[kind].READS
    assert getattr(control, read) == ("=q.two[0]" if body else "=q.one")
    shown = constraints(state, state.clients[ME])["lists"][-1]["items"][0]
    names = {f["field"]: f for g in shown["form"] for f in g["fields"]}
    assert set(names) - {"response"} == set(type(control).model_fields)
    assert names[read]["expression"]
    edit = lambda field, text: do.EditPart(ME, 1, "controls", name, field, (((), text),))  # noqa: E731
    state = after(state, edit(read, "=2*v.one"), edit("name", "mine"))
    assert reply(state) == ""
    assert getattr(state.model.controls[0], read) == "=2*v.one"
    name = "mine"
    for other in pg.Control.KINDS:
        state = after(state, edit("kind", other))
        assert reply(state) == ""
        assert getattr(state.model.controls[0], pg.Control.KINDS[other].READS) == "=2*v.one"
    assert "gone" in reply(after(state, edit("kind", kind), edit(read, "=q.gone")))
    assert after(state, do.DeletePart(ME, "controls", "mine")).model.controls == ()


def test_a_control_of_a_model_without_joints_is_refused():
    state = after(begun(pg.Model()), do.AddPart(ME, "controls", "pid", None))
    assert "joint" in notice(state)
    assert state.model.controls == ()


@pytest.mark.parametrize("pick", [False, True])
@pytest.mark.parametrize("curve", ["polynomial", "sine", "table"])
@pytest.mark.parametrize(
    ("change", "value", "joint"), [("body", "2", "2"), ("body", "3", "3"), ("coordinate", "1", "3")]
)
def test_a_motion_begins_at_the_joint_that_it_drives(pick, curve, change, value, joint):
    q = {"1": 0.4, "2": -1.2, "3": (0.7, -0.3)}
    model = pg.Model.serial(3).edit("3", joint="universal")
    for name, start in q.items():
        model = model.edit(name, q=start)
    of = "3" if change == "coordinate" else "1"
    state = after(begun(model), do.AddPart(ME, "constraints", "motion", of))
    state = edit(state, "constraints", "motion", "curve", ((), curve))
    if curve == "polynomial":
        state = edit(state, "constraints", "motion", "polynomial", ((1,), "2"))
    if pick and change == "body":
        asked = after(state, do.Pick(ME, "constraints", "motion", "body"))
        state = after(asked, do.PickName(ME, value))
    else:
        state = edit(state, "constraints", "motion", change, ((), value))
    motion = state.model.constraints[0]
    assert getattr(motion, change) == (int(value) if change == "coordinate" else value)
    start = np.ravel(q[joint])[motion.coordinate]
    begins = {
        pg.Sine: lambda c: c.mean + c.amplitude * math.sin(c.phase),
        pg.Polynomial: lambda c: c.coefficients[0],
        pg.Table: lambda c: c.value[0],
    }[type(motion.q_of_t)]
    assert begins(motion.q_of_t) == pytest.approx(start)
    if curve == "polynomial":
        assert motion.q_of_t.coefficients[1] == 2.0  # as typed


@pytest.mark.parametrize("target", [1.5, {"t": (0.0, 2.0), "value": (0.2, 0.9)}, "=sin(t)"])
@pytest.mark.parametrize(
    ("change", "value", "start"), [("body", "2", -1.2), ("coordinate", "1", -0.3)]
)
def test_the_target_of_a_servo_begins_at_its_new_joint(target, change, value, start):
    q = {"1": 0.4, "2": -1.2, "3": (0.7, -0.3)}
    model = pg.Model.serial(3).edit("3", joint="universal")
    for name, own in q.items():
        model = model.edit(name, q=own)
    body = "3" if change == "coordinate" else "1"
    servo = pg.Servo(name="hold", body=body, kp=1.0, target=target)
    state = edit(begun(model.replace(forces=[servo])), "forces", "hold", change, ((), value))
    new = state.model.forces[0].target
    if isinstance(target, dict):
        assert new.value == pytest.approx((start, start + 0.7))
    else:
        assert new == (target if isinstance(target, str) else start)
    assert getattr(state.model.forces[0], change) == (1 if change == "coordinate" else "2")
