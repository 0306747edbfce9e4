"""The methods converge with the orders they claim, on rotating bodies too (R21)."""

from __future__ import annotations

import numpy as np
import pytest

import pgraph_core as pg

from .trees import random_case

ORDER = {"rk4": 4, "semi_implicit_euler": 1, "dopri5": 5, "dop853": 8, "ros2": 2, "radau5": 5}
RANGE = {  # duration [s] and steps: errors above rounding, and small enough for the order to show
    "rk4": (0.25, (25, 50, 100, 200)),
    "semi_implicit_euler": (0.25, (100, 200, 400, 800)),
    "dopri5": (1.0, (120, 150, 190, 240)),
    "dop853": (0.5, (8, 10, 12, 15)),
    "ros2": (0.25, (50, 100, 200)),
    "radau5": (0.25, (8, 12, 18, 27)),
}


def tumbling_body():
    """A free body that turns about its middle axis, which is not stable."""
    body = pg.Body(
        name="tumbling",
        joint="free",
        mass=2.0,
        com=(0.1, -0.05, 0.2),
        inertia=((0.1, 0, 0), (0, 0.2, 0), (0, 0, 0.25)),
        q=(0, 0, 0, 1, 0, 0, 0),
        v=(0.3, 5.0, 0.2, 1.0, 0.5, -0.3),
    )
    return pg.Model(bodies=(body,))


def heavy_top():
    """A fast top on a ball joint."""
    top = pg.Body(
        name="top",
        joint="spherical",
        mass=1.0,
        com=(0, 0, 0.2),
        inertia=((0.02, 0, 0), (0, 0.02, 0), (0, 0, 0.03)),
        q=(np.cos(0.2), np.sin(0.2), 0, 0),
        v=(0.2, 1.0, 15.0),
    )
    return pg.Model(bodies=(top,))


def mixed_tree():
    """A forest with ball, free and compound joints, in motion."""
    s = random_case(5, most=6)
    model, i, j = s.model, 0, 0
    for name in s.topology.names:
        body = model.body(name)
        nq, nv = len(body.q), body.dof
        if nv:
            q, v = tuple(s.q[i : i + nq]), tuple(0.3 * s.v[j : j + nv])
            model = model.edit(name, q=q, v=v)
        i, j = i + nq, j + nv
    return model


def error(model, method, steps, t_end, reference):
    """Largest error of q at the end."""
    mech = pg.Mechanism(model)
    run = pg.simulate(mech, t_end=t_end, method=method, step=t_end / steps, frames=2)
    return abs(run.q[-1] - reference).max()


@pytest.mark.parametrize("method", ORDER)
@pytest.mark.parametrize("make", [tumbling_body, heavy_top, mixed_tree])
def test_observed_order_is_the_claimed_order(make, method):
    """Slope of the log error over four steps, within 0.3."""
    model, (t_end, steps) = make(), RANGE[method]
    fine = pg.simulate(pg.Mechanism(model), t_end=t_end, method="dop853", rtol=1e-14, frames=2)
    errors = [error(model, method, int(n), t_end, fine.q[-1]) for n in steps]
    slope = -np.polyfit(np.log(steps), np.log(errors), 1)[0]
    assert slope == pytest.approx(ORDER[method], abs=0.3), errors


@pytest.mark.parametrize("make", [tumbling_body, heavy_top, mixed_tree])
def test_energy_drift_of_rk4_falls_at_least_as_its_order(make):
    mech = pg.Mechanism(make())
    drifts = [
        pg.simulate(mech, t_end=0.25, method="rk4", step=0.25 / n).energy_drift for n in (50, 200)
    ]
    assert drifts[1] < max(drifts[0] / 4**3.7, 1e-13)


def test_energy_of_semi_implicit_euler_does_not_creep():
    """A pendulum over 100 swings: the error stays a ripple of the size of the step."""
    mech = pg.Mechanism(pg.Model.serial(1).edit("1", q=(1.0,)))
    run = pg.simulate(mech, t_end=60.0, method="semi_implicit_euler", step=1e-3)
    early = run.t < 10
    balance = abs(run.energy - run.energy[0])
    assert balance.max() < 1.2 * balance[early].max()
    assert run.energy_drift < 0.05


def test_a_tumbling_body_keeps_its_angular_momentum():
    """About its centre of mass, in world axes; only gravity acts, and has no torque there."""
    body = tumbling_body().bodies[0].model_copy(update={"com": (0.0, 0.0, 0.0)})
    mech = pg.Mechanism(pg.Model(bodies=(body,)))
    run = pg.simulate(mech, t_end=2.0, method="rk4", step=1e-3, frames=50)
    spin = []
    for q, v in zip(run.q, run.v):
        _, R = mech.pose(q, "tumbling")
        spin.append(R @ np.array(body.inertia) @ R.T @ v[:3])
    np.testing.assert_allclose(spin, np.tile(spin[0], (len(spin), 1)), rtol=0, atol=1e-9)


@pytest.mark.parametrize("method", ["rk4", "semi_implicit_euler"])
@pytest.mark.parametrize("make", [heavy_top, mixed_tree])
def test_the_error_estimate_is_the_error(make, method):
    """Within a factor of two, where the step is small enough for the order to show."""
    mech = pg.Mechanism(make())
    fine = pg.simulate(mech, t_end=0.25, method="rk4", step=0.25 / 4000, frames=2)
    run = pg.simulate(mech, t_end=0.25, method=method, step=0.25 / 200, frames=2)
    true = abs(run.q[-1] - fine.q[-1]).max()
    assert true / 2 < run.error_estimate < true * 2
