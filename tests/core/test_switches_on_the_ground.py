"""Constraints that are switched on while something rests on the ground."""

import numpy as np
import pytest

import pgraph_core as pg


def hammer_and_box(force=()):
    """A falling slider that can be tied to another, which rests on the ground."""

    def slider(name, height):
        return pg.Body(
            name=name, joint="prismatic", axes=((0, 0, 1),), mass=1.0, inertia=np.eye(3), q=height
        )

    foot = pg.Contact(name="foot", body="box", points=((0, 0, 0),), friction=0.5)
    tie = pg.Constraint(name="tie", body="hammer", other="box", point=(0, 0, 0), active=False)
    bodies = [slider("box", 0.0), slider("hammer", 3.0)]
    return pg.Model(bodies=bodies, contacts=[foot], constraints=[tie], forces=force)


@pytest.mark.parametrize("method", ["rk4", "moreau_jean"])
def test_the_ground_takes_the_impulse_of_a_falling_body_that_is_tied_to_a_resting_one(method):
    run = pg.simulate(
        hammer_and_box(), method=method, t_end=0.3, step=1e-3, switches=((0.2, "tie", True),)
    )
    assert run.status.ok, run.message
    fall = 9.81 * 0.2
    assert run.v[run.t < 0.2][-1] == pytest.approx([0.0, -fall], abs=0.05)
    np.testing.assert_allclose(run.v[run.t > 0.2 + 1e-9], 0.0, atol=1e-9)
    assert run.q[-1] == pytest.approx([0.0, 3.0 - fall * 0.1], abs=2e-3)


@pytest.mark.parametrize("method", ["rk4", "moreau_jean"])
def test_a_body_that_has_left_the_ground_is_tied_without_it(method):
    """The momentum of both is the same before and after."""
    up = pg.VectorTable(
        t=(0.05, 0.0501, 1.0), value=((0.0, 0.0, 0.0), (0.0, 0.0, 20.0), (0.0, 0.0, 20.0))
    )
    lift = pg.Force(name="lift", kind="wrench", body="box", force=up)
    model = hammer_and_box([lift])
    run = pg.simulate(model, method=method, t_end=0.21, step=1e-3, switches=((0.2, "tie", True),))
    assert run.status.ok, run.message
    before, after = run.v[run.t < 0.2 - 1e-9][-1], run.v[run.t > 0.2 + 1e-9][0]
    assert before[0] > 1.4
    assert after == pytest.approx(np.full(2, before.mean()), abs=0.02)


@pytest.mark.parametrize("options", [{"step": 1e-3}, {"rtol": 1e-9}])
@pytest.mark.parametrize("friction", [0.0, 0.3])
def test_what_rests_does_not_rebound_from_the_impulse_of_a_switch(options, friction):
    """A slider on the floor is led down into it: its approach speed was zero, so it stays.

    Time stepping took the impulse for an impact, from which the slider rebounded at 0.54 m/s.
    """
    motions = [("translate", (1, 0, 0)), ("translate", (0, 0, 1))]
    body = pg.Body(
        name="b", joint="compound", motions=motions, mass=1.0, inertia=(0.1,) * 3, v=(1.0, 0.0)
    )
    floor = pg.Contact(name="f", body="b", points=[(0, 0, 0)], friction=friction, restitution=0.6)
    down = pg.Velocity(
        name="c", body="b", coefficients={"b": (np.sin(0.3), np.cos(0.3))}, active=False
    )
    model = pg.Model(bodies=[body], contacts=[floor], constraints=[down])
    run = pg.simulate(model, t_end=0.15, frames=16, switches=[(0.1, "c", True)], **options)
    assert run.v[-5:] == pytest.approx(0.0, abs=1e-9)
    way = 0.1 - 0.5 * friction * 9.81 * 0.1**2
    assert run.q[-1] == pytest.approx([way, 0.0], abs=2e-6)
    missed = run.energy - run.energy[0] - run.work + run.dissipation
    assert np.abs(missed).max() < 1e-9


@pytest.mark.parametrize("t", [0.1, 0.1004])
@pytest.mark.parametrize("speed", [3.0, -0.4])
def test_a_lever_on_its_stop_does_not_rebound_from_a_clutch(speed, t):
    """A clutch joins it to a wheel, which turns into the stop, or away from it."""
    lever = pg.Body(
        name="a", axes=((0, 1, 0),), mass=1.0, com=(0.3, 0, 0), inertia=(0.02,) * 3,
        limits=((-2.0, 0.0),), limit_restitution=0.6,
    )  # fmt: skip
    wheel = pg.Body(
        name="w", axes=((0, 1, 0),), mass=1.0, inertia=(0.1,) * 3, link=(0, 1, 0), v=(speed,)
    )
    clutch = pg.Velocity(name="c", body="a", coefficients={"a": (1.0,), "w": (-1.0,)}, active=False)
    model = pg.Model(bodies=[lever, wheel], constraints=[clutch])
    run = pg.simulate(model, t_end=0.15, step=1e-3, switches=[(t, "c", True)])
    after = run.v[run.t > t + 1e-3]
    if speed > 0.0:
        assert after == pytest.approx(0.0, abs=1e-9)
        assert run.q[-1, 0] == pytest.approx(0.0, abs=1e-9)
    else:  # the momentum of both, at first
        assert after[0] == pytest.approx(np.full(2, -0.4 * 0.1 / (0.1 + 0.02 + 0.09)), abs=0.03)
