"""Given steps of radau5 that Newton's method cannot solve, taken in narrower ones."""

from __future__ import annotations

import numpy as np
import pytest

import pgraph_core as pg


def pendulum(friction, speed):
    rod = pg.Body(
        name="rod",
        joint="revolute",
        axes=((0.0, 1.0, 0.0),),
        mass=1.0,
        com=(0.0, 0.0, -0.5),
        friction=friction,
        v=(speed,),
    )
    return pg.Mechanism(pg.Model(bodies=(rod,)))


def parted(run):
    return [notice for notice in run.notices if "narrower ones" in notice]


@pytest.mark.parametrize("friction", [0.1, 1.0, 3.0, 10.0, 100.0])
@pytest.mark.parametrize("step", [1e-3, 1e-2])
@pytest.mark.parametrize("speed", [1.0, 5.0, 100.0, 1000.0])
def test_a_pendulum_with_joint_friction_comes_to_its_end(friction, step, speed):
    """Whatever the friction: where it holds, the joint creeps by less than the regularisation."""
    mech = pendulum(friction, speed)
    run = pg.simulate(mech, t_end=1.0, method="radau5", step=step, estimate=False)
    assert run.status.ok, run.message
    assert len(run.t) == round(1 / step) + 1
    np.testing.assert_allclose(np.diff(run.t), step, rtol=1e-9)
    assert run.energy_drift < 1e-3  # of steps of up to ten radians
    if friction > 1.0 * 9.81 * 0.5 and friction * 0.9 > speed:
        assert abs(run.v[-1, 0]) < 1e-3


@pytest.mark.parametrize("step", [1e-3, 1e-2])
def test_steps_in_parts_follow_the_motion(step):
    """As far as the tolerance of 1e-9 goes in the parts, and the error of the other steps."""
    mech = pendulum(10.0, 5.0)
    run = pg.simulate(mech, t_end=1.0, method="radau5", step=step)
    fine = pg.simulate(mech, t_end=1.0, method="radau5", rtol=1e-11, t_eval=run.t, estimate=False)
    assert float(np.abs(run.q - fine.q).max()) < 1e-6
    assert parted(run) == [
        f"the equations of 1 step of {step:g} s could not be solved at once, as where forces "
        "change fast: narrower ones were taken there"
    ]
    assert run.t.tolist() == pytest.approx(np.linspace(0, 1, len(run.t)).tolist())


def test_few_frames_are_recorded_when_they_are_asked_for():
    """The frame of the failed step is taken back: none is recorded there."""
    run = pg.simulate(pendulum(10.0, 5.0), t_end=1.0, method="radau5", step=1e-2, frames=3)
    assert run.t.tolist() == [0.0, 0.5, 1.0]
    assert len(parted(run)) == 1
    assert run.energy_drift < 1e-6
