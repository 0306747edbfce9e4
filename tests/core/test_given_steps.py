"""Runs at given steps: tables with corners inside them, hard equations, and fast spin."""

import numpy as np
import pytest

import pgraph_core as pg

from ..worlds import ball, box, on_ground

pytestmark = pytest.mark.quick


def driven(apart, *, kind="servo"):
    t = np.arange(0.0, 0.3 + apart / 2, apart)
    table = pg.Table(t=tuple(t.tolist()), value=tuple((0.4 * np.sin(12 * t)).tolist()))
    fields = {"kp": 200.0, "kd": 2.0, "target": table} if kind == "servo" else {"torque": table}
    force = pg.Force(name="f", kind=kind, body="rod", **fields)
    rod = pg.Body(name="rod", joint="revolute", axes=((0, 1, 0),), mass=1.0, com=(0, 0, -0.5))
    return pg.Mechanism(pg.Model(bodies=(rod,), forces=(force,)))


def told(run, key):
    return [notice for notice in run.notices if key in notice]


@pytest.mark.parametrize("kind", ["servo", "motor"])
@pytest.mark.parametrize(("apart", "frames"), [(2.5e-3, 31), (1.3e-3, None), (0.0155, 31)])
def test_rk4_keeps_its_accuracy_where_tables_bend_inside_steps(apart, kind, frames):
    """The error is that of a step of 1e-3 s at 25 rad/s to the power of 4, as estimated."""
    mech = driven(apart, kind=kind)
    run = pg.simulate(mech, method="rk4", step=1e-3, t_end=0.3, frames=frames)
    exact = pg.simulate(mech, method="dop853", rtol=1e-13, t_end=0.3, t_eval=run.t)
    true = float(np.abs(run.q - exact.q).max())
    assert true < 1e-8
    assert true < 10 * run.error_estimate + 1e-13


@pytest.mark.parametrize("method", ["dop853", "dopri5", "radau5"])
def test_a_pulse_late_in_a_long_run_acts(method):
    """At 1e6 s times are good to 1e-10 s, and a pulse of 2 ms to 1e-7."""
    late = 1e6
    push = pg.Table(t=(late, late + 1e-3, late + 2e-3), value=(0.0, 1.0, 0.0))
    body = pg.Body(name="a", joint="prismatic", axes=((1, 0, 0),), inertia=np.zeros((3, 3)))
    motor = pg.Motor(name="push", body="a", torque=push)
    model = pg.Model(bodies=(body,), gravity=(0, 0, 0), forces=(motor,))
    run = pg.simulate(model, t_end=late + 1.0, method=method, estimate=False)
    assert run.status.ok, run.message
    assert run.v[-1, 0] == pytest.approx(1e-3, rel=1e-6)


def pendulum(friction, speed):
    rod = pg.Body(name="rod", axes=((0, 1, 0),), com=(0, 0, -0.5), friction=friction, v=(speed,))
    return pg.Model(bodies=(rod,))


@pytest.mark.parametrize("friction", [0.1, 3.0, 100.0])
@pytest.mark.parametrize(("step", "speed"), [(1e-2, 1.0), (1e-3, 5.0), (1e-2, 1000.0)])
def test_radau5_solves_a_pendulum_with_joint_friction(friction, step, speed):
    """A joint held by friction creeps by less than the regularisation."""
    run = pg.simulate(
        pendulum(friction, speed), t_end=1.0, method="radau5", step=step, estimate=False
    )
    assert run.status.ok, run.message
    np.testing.assert_allclose(np.diff(run.t), step, rtol=1e-9)
    assert run.energy_drift < 1e-3  # of steps of up to ten radians
    if friction * 0.9 > speed:
        assert abs(run.v[-1, 0]) < 1e-3


@pytest.mark.parametrize("frames", [None, 3])
def test_steps_that_are_divided_follow_the_motion(frames):
    """Steps that Newton's method cannot solve: the frame of a failed step is not recorded."""
    model = pendulum(10.0, 5.0)
    run = pg.simulate(model, t_end=1.0, method="radau5", step=1e-2, frames=frames)
    fine = pg.simulate(model, t_end=1.0, method="radau5", rtol=1e-11, t_eval=run.t, estimate=False)
    assert float(np.abs(run.q - fine.q).max()) < 1e-6
    (notice,) = told(run, "did not converge")
    assert "0.01" in notice
    np.testing.assert_allclose(run.t, np.linspace(0, 1, frames or 101), rtol=1e-12)


def spun(spin, joint, com, **options):
    speed = (*spin, 0.0, 0.0, 0.0) if joint == "free" else tuple(spin)
    given = {"joint": joint, "mass": 2.0, "com": com, "inertia": np.diag((1.0, 2.0, 2.5))}
    model = on_ground(ball(place=(0, 0, 1e9), v=speed, **given), model={"gravity": (0, 0, 0)})
    run = pg.simulate(model, frames=11, **options)
    assert run.status.ok
    return run


@pytest.mark.parametrize("com", [(0.0, 0.0, 0.0), (0.1, 0.2, -0.3)])
@pytest.mark.parametrize("joint", ["free", "spherical"])
def test_time_stepping_turns_a_free_top(joint, com):
    """It keeps the energy at any turn per step, and is of second order."""
    spin, given = np.array((0.3, 0.8, 0.52)), {"method": "moreau_jean", "t_end": 0.1}
    for turn in (0.1, 20.0, 1e4):
        run = spun(1e3 * turn * spin, joint, com, step=1e-3, **given)
        assert run.energy == pytest.approx(run.energy[0], rel=1e-11)
    given["t_end"] = 1.0
    exact = spun(9.0 * spin, joint, com, t_end=1.0, method="dop853", rtol=1e-11).q[-1]
    runs = [spun(9.0 * spin, joint, com, step=step, **given) for step in (2e-3, 1e-3)]
    coarse, fine = (float(abs(run.q[-1] - exact).max()) for run in runs)
    assert fine < 2e-4
    assert fine == pytest.approx(coarse / 4, rel=0.05)


@pytest.mark.parametrize("seed", range(2))
def test_a_small_brick_thrown_at_the_floor_gains_no_energy(seed):
    """5 mm at 10 m/s leaves the floor with about 2 rad per step."""
    turn = np.random.default_rng(seed).normal(size=4)
    q = (0, 0, 0.3, *turn / np.linalg.norm(turn))
    brick = box(size=(0.005, 0.0075, 0.01), place=(0, 0, 0), q=q, v=(0, 0, 0, 7, 0, -7), mass=0.01)
    model = on_ground(brick, friction=0.3, restitution=0.5)
    run = pg.simulate(model, t_end=0.3, step=1e-3, frames=61)
    assert run.status.ok
    assert abs(run.v[:, :3]).max() > 300
    assert run.energy.max() < 1.001 * run.energy[0]
