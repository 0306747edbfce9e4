"""Derivatives through comparisons of the motion, at whose changes forces jump."""

import numpy as np
import pytest

import pgraph_core as pg
from tests.refusals import assert_names

from ..nights import combined

X, G = (1, 0, 0), (0, 0, -9.81)
WAYS = {
    "rk4": {"method": "rk4", "step": 0.02},
    "dop853": {"method": "dop853", "rtol": 1e-10},
    "gauss6": {"method": "gauss6", "step": 0.02},
    "radau5": {"method": "radau5", "rtol": 1e-9},
}
STEPPED = {"method": "moreau_jean", "step": 1e-3}
WRT = ["a", "f", "q.m", "v.m"]


def mass(law, controls=(), **fields):
    """A slider of 2 kg at 0 with 1 m/s."""
    body = pg.Body(name="m", joint="prismatic", axes=[X], mass=2.0, v=[1.0])
    push = pg.Motor(name="push", body="m", torque="=" + law)
    return pg.Model(
        bodies=[body], gravity=(0, 0, 0), forces=[push], controls=controls,
        parameters={"a": 0.7, "f": -0.6, "k": 3.0}, **fields,
    )  # fmt: skip


def differences(model, path, h=1e-4, **call):
    """Central differences of order 6 of the last state, in a run of a tight tolerance."""
    call = {"t_end": call["t_end"], "method": "dop853", "rtol": 1e-12}
    found = 0.0
    for k, weight in {1: 3 / 4, 2: -3 / 20, 3: 1 / 60}.items():
        for sign in (1, -1):
            d = sign * k * h
            if "." in path:
                given = {path[0]: [(1.0 if path[0] == "v" else 0.0) + d]}
                run = pg.simulate(model, **call, **given)
            else:
                numbers = {**model.parameters, path: model.parameters[path] + d}
                run = pg.simulate(model.replace(parameters=numbers), **call)
            found = found + sign * weight / h * np.append(run.q[-1], run.v[-1])
    return found


@pytest.mark.parametrize("way", WAYS)
def test_a_force_that_begins_at_a_place_has_its_closed_form(way):
    """From q = a on, v² = v₀² + 2 (f/m) (q - a): the place is met at t = a/v₀."""
    run = pg.simulate(mass("if(q.m > a, f, 0)"), t_end=2.0, wrt=WRT, frames=9, **WAYS[way])
    gone, rate, a = np.maximum(run.t - 0.7, 0.0), -0.3, 0.7
    late = run.t > 0.7
    exact = {
        "a": np.stack((-rate * gone, -rate * late), 1),
        "f": np.stack((gone**2 / 4, gone / 2), 1),
        "q.m": np.stack((1 + rate * gone, rate * late), 1),
        "v.m": np.stack((run.t + rate * gone * a, 1 + rate * late * a), 1),
    }
    for path, wanted in exact.items():
        assert np.allclose(run.sensitivity(path), wanted, rtol=0, atol=2e-9)


LAWS = [
    "if(q.m > a and v.m > 0.5, f, 0.1*cos(3*t))",  # both ends of a window of two signals
    "if(q.m > 0.2 + 0.5*a*t, f, 0)*v.m",  # a threshold that moves
    "k*max(0, a - q.m) + if(not (q.m < 1.1), f*q.m, 0)",  # a corner, and then a jump
    "if(q.m > a, if(q.m > a + 0.2, -1*f, f), 0) - k*q.m",  # one within another, there and back
    "if(t < 0.5, 0, f) + if(q.m > a, f, 0)",  # a jump at a given time has no derivative of its own
]


@pytest.mark.parametrize(("law", "way"), combined(LAWS, ["dop853", "gauss6"]))
def test_derivatives_through_jumps_are_those_of_differences(law, way):
    model = mass(law)
    run = pg.simulate(model, t_end=1.9, wrt=WRT, **WAYS[way])
    for path in WRT:
        wanted = differences(model, path, t_end=1.9)
        assert np.allclose(run.sensitivity(path)[-1], wanted, rtol=0, atol=1e-9), path


@pytest.mark.parametrize("way", WAYS)
def test_values_do_not_depend_on_derivatives(way):
    model = mass(LAWS[3])
    plain = pg.simulate(model, t_end=1.9, frames=20, **WAYS[way])
    run = pg.simulate(model, t_end=1.9, frames=20, wrt=WRT, **WAYS[way])
    for name in ("t", "q", "v", "vdot", "work"):
        assert np.array_equal(getattr(run, name), getattr(plain, name))


def test_a_controller_that_reaches_its_bounds_has_derivatives():
    """Anti-windup holds the integral by comparisons with its bounds."""
    control = pg.PID(
        name="c", signal="=v.m", setpoint="=if(t < 0.3, 1, 2)", kp=6.0, ki=4.0, low=-1.0,
        high=1.5,
    )  # fmt: skip
    model = mass("x.c*k/3 + f*0.1*if(q.m > a, 1, 0)", [control])
    run = pg.simulate(model, t_end=2.0, wrt=["k", *WRT], **WAYS["dop853"])
    assert np.ptp(run.controls["c"]) > 0.5
    for path in ("k", *WRT):
        wanted = differences(model, path, t_end=2.0)
        assert np.allclose(run.sensitivity(path)[-1], wanted, rtol=0, atol=1e-9), path


def test_constraints_keep_derivatives_on_them_after_a_jump():
    """A rod on a second one that slides: the loop holds the end of the second at a height."""
    one = pg.Body(name="m", tip=(1, 0, 0), com=(0.5, 0, 0), mass=1.0, v=[0.6])
    two = pg.Body(name="n", parent="m", tip=(1, 0, 0), com=(0.5, 0, 0), link=(1, 0, 0))
    line = pg.Line(name="rail", body="n", point=(1, 0, 0), other_axis=X)
    push = pg.Motor(name="push", body="m", torque="=if(q.m > a, f, 0)")
    model = pg.Model(
        bodies=[one, two], gravity=(0, 0, 0), forces=[push], constraints=[line],
        parameters={"a": 0.9, "f": -0.6},
    )  # fmt: skip
    q, v, *_ = pg.Mechanism(model).assemble([0.6, -1.2], [0.6, -1.2])
    call = {"q": q, "v": v, "t_end": 1.5, "method": "dop853", "rtol": 1e-11}
    run = pg.simulate(model, wrt=["a"], **call)
    ends = [
        pg.simulate(model.replace(parameters={"a": a, "f": -0.6}), **call)
        for a in (0.9 - 1e-4, 0.9 + 1e-4)
    ]
    wanted = (ends[1].q[-1] - ends[0].q[-1]) / 2e-4
    assert np.abs(wanted).max() > 0.1
    assert np.allclose(run.sensitivity("a")[-1, :2], wanted, rtol=0, atol=1e-6)


def test_derivatives_end_where_the_motion_slides():
    run = pg.simulate(mass("if(v.m > 0.5, -1, 1)"), t_end=2.0, wrt=["v.m"], **WAYS["dop853"])
    (notice,) = [text for text in run.notices if "derivatives end" in text]
    assert_names(notice, "1 s", "slides")
    assert np.isnan(run.sensitivity("v.m")[-1]).all()


@pytest.mark.parametrize(
    ("law", "call", "facts"),
    [
        ("if(q.m > a, f, 0)", STEPPED, ["wrt", "moreau_jean"]),
        ("if(q.m*k, f, 0)", {}, ["wrt", "comparisons"]),
        ("if(t > a, f, 0)", {}, ["a", "time", "smoothstep"]),
        ("if(sin(a*t) > 0.5, f, 0)", {}, ["a", "time", "smoothstep"]),
    ],
)
def test_jumps_that_no_step_tells_are_refused(law, call, facts):
    model = mass(law).edit("m", limits=[(-9.0, 9.0)] if call else ())
    with pytest.raises(pg.InputError) as error:
        pg.simulate(model, t_end=2.0, wrt=["a"], **call)
    assert_names(str(error.value), *facts)


ARM = pg.Body(name="a", axes=(0, 1, 0), com=(0.3, 0, 0), inertia=(0.05, 0.06, 0.02), q=[0.2])
BLOCK = pg.Body(name="b", joint="prismatic", axes=[X], mass=1.0, q=[0.5], v=[-2.0])
SERVO = pg.Servo(name="s", body="a", kp=40.0, kd=2.0, target=1.2, torque_limit=3.0)
STOP = pg.Strut(
    name="s", body="b", other="ground", point=(0, 0, 0), other_point=(0, 0.1, 0),
    spring={"x": (0.0, 0.4, 1.0), "value": (-8.0, 0.0, 12.0)}, bump_length=0.3,
    bump_stiffness=500.0, bump_damping=0.5, damper={"x": (-1, 0, 1), "value": (-2, 0, 0.5)},
)  # fmt: skip
CABLE = STOP.model_copy(
    update={"spring": pg.Lines(x=(0.2, 0.4, 1.0), value=(0, 0, 60)), "bump_stiffness": 0.0}
)


BENDS = [  # body, force, its field and the steps of differences by it
    (ARM, SERVO, "kp", 1e-2),
    (ARM, SERVO, "torque_limit", 1e-3),
    (ARM, SERVO.model_copy(update={"torque_low": -1.0, "gear": 1.5}), "kd", 1e-3),
    (BLOCK, STOP, "bump_stiffness", 1e-1),
    (BLOCK, STOP, "bump_length", 1e-4),
    (BLOCK, CABLE, "bump_damping", 0.0),
]


@pytest.mark.parametrize(("bend", "way"), combined(BENDS, ["dop853", "gauss6", "radau5"]))
def test_derivatives_through_bends_of_forces_are_those_of_differences(bend, way):
    """Steps end at limits of torque, stops and slack cables, and keep to the side of each."""
    body, force, field, h = bend
    model = pg.Model(bodies=[body], forces=[force], gravity=(0, 0, 0) if body is BLOCK else G)
    path = f"forces.s.{field}" if h else "v.b"
    given = WAYS[way] | ({"step": 0.005} if way == "gauss6" else {})
    run = pg.simulate(model, t_end=0.8, wrt=path, frames=9, **given)
    wanted = 0.0
    for k, weight in {1: 3 / 4, 2: -3 / 20, 3: 1 / 60}.items():
        for d in (k, -k):
            change = {field: getattr(force, field) + d * h} if h else {}
            start = {} if h else {"v": [-2.0 + 1e-3 * d]}
            call = {"t_end": 0.8, "method": "dop853", "rtol": 1e-12, "frames": 9}
            found = pg.simulate(model.edit("s", **change) if h else model, **call, **start)
            size = np.sign(d) * weight / (h or 1e-3)
            wanted = wanted + size * np.hstack((found.q, found.v))
    assert np.allclose(run.sensitivity(path), wanted, rtol=0, atol=2e-8 * np.abs(wanted).max())


def test_derivatives_at_a_frame_in_which_they_jump_are_not_compared():
    """The threshold is met at 0.75 s, a frame, which is after it in one of two runs alone."""
    law = mass("if(q.m > a, f, 0)").replace(parameters={"a": 0.75, "f": -0.6, "k": 3.0})
    run = pg.simulate(law, t_end=2.0, wrt=WRT, frames=9, **WAYS["dop853"])
    assert not any("apart" in text for text in run.notices)


BETWEEN = [
    pg.Spring(name="s", body="m", other_point=(-2, 0, 0), stiffness=1.0, rest=2.0),
    pg.Strut(name="s", body="m", other_point=(-2, 0, 0), bump_length=2.1, bump_stiffness=10.0),
    pg.Torsion(name="s", body="m", stiffness=1.0),
]


@pytest.mark.parametrize(("force", "way"), combined(BETWEEN, WAYS))
def test_forces_between_points_do_not_hide_a_jump_of_another_force(force, way):
    model = mass("-4*q.m + if(q.m > 0.2, 3, 0)").add(force)
    found = pg.simulate(model, t_end=0.6, wrt=["v.m"], frames=61, **WAYS[way])
    wanted = differences(model, "v.m", t_end=0.6)
    np.testing.assert_allclose(found.sensitivity("v.m")[-1], wanted, rtol=1e-4)


def test_derivatives_of_a_run_that_an_event_ends_are_finite_without_a_notice():
    def passed(t, q, v):
        return q[0] - 0.3

    passed.terminal = True
    run = pg.simulate(mass("0"), t_end=0.6, wrt=["v.m"], events=[passed])
    assert np.isfinite(run.sensitivity("v.m")).all()
    assert not [notice for notice in run.notices if "derivatives" in notice]
