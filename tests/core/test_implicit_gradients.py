"""Derivatives of implicit steps: the parts of a step before an event, constraints, singular
positions."""

import numpy as np
import pytest

import pgraph_core as pg

from ..nights import combined
from ..worlds import built_in
from .test_methods import stiff_pendulum

PATH = "bodies.a.mass"
FRAMES = {"t_eval": [0.0, 0.3, 0.6, 0.9, 1.2], "estimate": False}
EXACT = FRAMES | {"method": "dop853", "rtol": 1e-12}
WAYS = [
    {"method": "radau5", "rtol": 1e-7},
    {"method": "radau5", "step": 5e-3},
    {"method": "gauss6", "step": 5e-3},
    {"method": "gauss6", "step": 5e-4},
]


def link(name, parent, mass, length, place):
    inertia = np.diag([1.0, 1.1, 0.5]) * mass * length * length / 12
    com = (0, 0, -length / 2)
    return pg.Body(
        name=name, parent=parent, mass=mass, axes=(0, 1, 0), com=com, inertia=inertia, link=place
    )


def constraint(kind):
    if kind == "gear":
        return [pg.Gear(name="held", body="b", other="a", ratio=0.4)]
    if kind == "velocity":
        return [pg.Velocity(name="held", coefficients={"b": [1.0], "a": [0.2]})]
    if kind == "distance":
        ends = {"point": (0, 0, -0.7), "other_point": (0.9, 0, -0.6)}
        return [pg.Distance(name="held", body="b", **ends, length=0.8)]
    return []


def pendulum(kind, switched=False):
    """Two links with a constraint. Its switch is watched, and never acts."""
    has_force = kind == "distance"  # the others have a torque only
    when = {"force": "held", "above": 1e6} if has_force else {"holds": "=v.a > 1000"}
    switch = {"when": when, "constraint": "held", "active": False}
    return pg.Model(
        bodies=[link("a", "ground", 1.2, 1.0, (0, 0, 0)), link("b", "a", 0.7, 0.8, (0, 0, -1))],
        constraints=constraint(kind),
        scenarios=[pg.Scenario(name="s", switches=[switch] if switched else [])],
    )


def crossed(t, q, v):
    return q[0] - 0.2


def watched(kind, what):
    """The way in which a step is repeated in part: by an event, or by the condition of a switch."""
    return {"events": [crossed]} if what == "event" else {"scenario": "s"} if what else {}


def state(run):
    return np.hstack((run.q, run.v))


STEPS = [
    (kind, what)
    for kind in ("", "gear", "velocity", "distance")
    for what in ("", "event", "switch")
    if kind or what != "switch"  # which ends a constraint
]


@pytest.mark.parametrize(("steps", "way"), combined(STEPS, WAYS), ids=str)
def test_implicit_steps_have_the_derivatives_of_the_motion(steps, way):
    """Steps are repeated in part to look for events, and end on constraints of all kinds.

    The bound of 1e-6 is 20 times the error of a tolerance of 1e-7, and that of differences is 1e-8.
    """
    kind, what = steps
    model = pendulum(kind, switched=what == "switch")
    mech = pg.Mechanism(model)
    q, _, _ = mech.assemble([1.0, 0.4], [0.0, 0.0])
    options = way | FRAMES | watched(kind, what)
    run = pg.simulate(model, q, wrt=PATH, **options)
    plain = pg.simulate(model, q, **options)
    assert run == plain
    assert run.counters == plain.counters
    model = pendulum(kind)
    ends = [pg.simulate(model.edit("a", mass=1.2 + h), q, **EXACT) for h in (1e-4, -1e-4)]
    expected = (state(ends[0]) - state(ends[1])) / 2e-4
    error = np.abs(run.sensitivity(PATH) - expected).max(axis=1)
    assert (error < 1e-6 * np.abs(expected).max()).all()


def test_the_steps_of_gauss_keep_a_relation_of_velocities():
    """Each end of a step is projected by the factors of its own mass matrix."""
    model = pendulum("velocity")
    run = pg.simulate(model, [1.0, 0.4], method="gauss6", step=5e-4, **FRAMES)
    exact = pg.simulate(model, [1.0, 0.4], **EXACT | {"rtol": 1e-13})
    assert np.abs(state(run) - state(exact)).max() < 1e-11


@pytest.mark.parametrize("way", [{"method": "radau5"}, {"method": "gauss6", "step": 1e-3}], ids=str)
def test_derivatives_beyond_a_singular_position_are_right_or_end_with_a_notice(way):
    model = built_in("four_bar").model
    q = {"left crank": 0.5, "coupler": -0.5, "right crank": 0.5}
    options = {"q": q, "wrt": "q.left crank", "t_end": 1.0, "frames": 11, "estimate": False}
    exact = pg.simulate(model, method="dop853", rtol=1e-11, **options).sensitivity("q.left crank")
    run = pg.simulate(model, **options | way)
    found = run.sensitivity("q.left crank")
    known = np.isfinite(found).all(axis=1)
    assert known[:6].all()  # before the singular position, which is at 0.5515 s
    assert np.abs(found - exact)[known].max() < 1e-5 * np.abs(exact).max()
    named = [text for text in run.notices if "derivatives by q.left crank end before" in text]
    assert len(named) == (not known.all())
    assert known.all() or f"t = {run.t[(~known).argmax()]:.6g} s" in named[0]


def test_a_difference_is_told_from_its_first_frame_on():
    """Errors that grow later do not hide those before them."""
    run = pg.simulate(pendulum(""), [1.0, 0.4], wrt=PATH, method="radau5", step=5e-3, **FRAMES)
    carried = run.derivatives.source
    finer = carried.finer()
    finer.out, finer._record = carried.out.copy(), carried._record
    finer.out[:, 2:, :, 1:] *= 1e3
    finer.out[:, 4:, :, 1:] *= 1e9
    rows = np.arange(len(run.t))
    (told,) = carried.unlike(finer, np.array(run.t), rows, rows)
    assert PATH in told
    assert f"t = {run.t[2]:.6g} s" in told


def test_derivatives_of_stiff_gauss_steps_follow_newtons_method():
    """Steps of 0.01 s over a spring of 1e8 N/m: differences of runs, and no step is divided."""
    options = {"method": "gauss6", "step": 0.01, "t_end": 0.3, "estimate": False}
    mech, q = stiff_pendulum(1e8)
    run = pg.simulate(mech, q, wrt=["q.a.0"], **options)
    h = 1e-5
    more, less = (pg.simulate(mech, q + np.array([s * h, 0.0]), **options) for s in (1, -1))
    assert run.counters["rejected_steps"] == 0
    slope = run.sensitivity("q.a.0")[:, 0]
    np.testing.assert_allclose(slope, (more.q - less.q)[:, 0] / (2 * h), rtol=1e-6, atol=1e-7)
