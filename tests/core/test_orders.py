"""The methods converge at their orders, on rotating bodies and with constraints too."""

import numpy as np
import pytest

import pgraph_core as pg
import pgraph_models

from ..nights import combined
from .trees import random_case, with_joints

pytestmark = pytest.mark.quick

METHODS = {  # order, duration [s] and steps of trees, steps of the loop and of the disc
    "rk4": (4, 0.25, (25, 50, 100, 200), (100, 200, 400), (25, 50, 100)),
    "semi_implicit_euler": (1, 0.25, (100, 200, 400, 800), (100, 200, 400), (100, 200, 400)),
    "dopri5": (5, 1.0, (120, 150, 190, 240), (60, 90, 130), (20, 30, 45)),
    # fewer steps than 13: the tumbling body's error, 3e-15 at 15 steps, is near that of the
    # reference, 1e-15 (with a reference of 34 digits the slope from 8 to 15 steps is 7.9)
    "dop853": (8, 0.5, (6, 8, 10, 12), (10, 13, 17), (8, 10, 13)),
    "radau5": (5, 0.25, (8, 12, 18, 27), (20, 30, 45), (8, 12, 18)),
    "gauss6": (6, 0.25, (6, 8, 11, 15), (10, 13, 17), (10, 13, 17)),
}


def assert_order(order, model, method, counts, t_end, reference=None, **options):
    """Assert that the slope of log error over log step is the order within 0.3. Return the runs."""
    mech, options = pg.Mechanism(model), {"t_end": t_end, "frames": 2, **options}
    fine = pg.simulate(reference or mech, method="dop853", rtol=1e-14, **options).q[-1]
    runs = [pg.simulate(mech, method=method, step=t_end / n, **options) for n in counts]
    errors = [abs(run.q[-1] - fine).max() for run in runs]
    slope = -np.polyfit(np.log(counts), np.log(errors), 1)[0]
    assert slope == pytest.approx(order, abs=0.3), errors
    return runs


def tumbling_body():
    body = pg.Body(
        name="tumbling", joint="free", mass=2.0, com=(0.1, -0.05, 0.2),
        inertia=np.diag([0.1, 0.2, 0.25]), v=(0.3, 5.0, 0.2, 1.0, 0.5, -0.3),
    )  # fmt: skip
    return pg.Model(bodies=(body,))


def heavy_top():
    top = pg.Body(
        name="top", joint="spherical", mass=1.0, com=(0, 0, 0.2), v=(0.2, 1.0, 15.0),
        inertia=np.diag([0.02, 0.02, 0.03]), q=(np.cos(0.2), np.sin(0.2), 0, 0),
    )  # fmt: skip
    return pg.Model(bodies=(top,))


def mixed_tree():
    s = random_case(0, most=6)
    return with_joints(s, q=s.q, v=0.3 * s.v)


@pytest.mark.parametrize(
    ("make", "method"), combined([tumbling_body, heavy_top, mixed_tree], METHODS)
)
def test_observed_order_is_the_claimed_order(make, method):
    order, t_end, counts, *_ = METHODS[method]
    assert_order(order, make(), method, counts, t_end)


@pytest.mark.parametrize(("name", "method"), combined(["slider_crank", "rolling_disc"], METHODS))
def test_the_order_holds_with_constraints(name, method):
    """A driven loop with redundant rows, and a rolling disc."""
    model = pg.Model.load(pgraph_models.path(name))
    order, *_, loop, disc = METHODS[method]
    counts, t_end, scenario = (loop, 0.4, "turn") if name == "slider_crank" else (disc, 0.5, "roll")
    runs = assert_order(order, model, method, counts, t_end, scenario=scenario)
    assert max(run.constraint_drift.max() for run in runs) < 1e-9


def test_moreau_jeans_order_is_two_between_events():
    """On a body that tumbles above a ground that it does not reach, and carries an arm."""
    ball = pg.Shape(kind="sphere", radius=0.1)
    free = tumbling_body().edit("tumbling", link=(0, 0, 9.0), shape=ball)
    free = free.add(pg.Body(name="arm", parent="tumbling", axes=(1, 0, 0), com=(0, 0.2, 0)))
    model = free.add(pg.Contact(name="c", body="tumbling"))
    assert_order(2, model, "moreau_jean", (100, 200, 400, 800), 0.25, reference=free)


@pytest.mark.parametrize("method", METHODS)
def test_frames_between_steps_are_as_good_as_the_steps(method):
    """Errors at random times of a top, and at the ends of equal steps."""
    mech, (_, t_end, steps, *_) = pg.Mechanism(heavy_top()), METHODS[method]
    step = t_end / steps[1]
    odd = t_end * np.sort(np.random.default_rng(1).uniform(0, 1, 41))
    even = np.linspace(0.0, t_end, steps[1] + 1)
    worst = []
    for times in (even, odd):
        fine = pg.simulate(mech, t_end=t_end, t_eval=times, method="dop853", rtol=1e-14).q
        run = pg.simulate(mech, t_end=t_end, t_eval=times, method=method, step=step)
        worst.append(abs(run.q - fine).max())
    assert worst[1] < 2.0 * worst[0]


def test_energy_of_semi_implicit_euler_does_not_creep():
    """A pendulum over 30 swings: the error stays a ripple of the size of the step."""
    mech = pg.Mechanism(pg.Model.serial(1).edit("1", q=(1.0,)))
    run = pg.simulate(mech, t_end=20.0, method="semi_implicit_euler", step=1e-3, estimate=False)
    early = run.t < 5
    balance = abs(run.energy - run.energy[0])
    assert balance.max() < 1.2 * balance[early].max()
    assert run.energy_drift < 0.05


def test_a_tumbling_body_keeps_its_angular_momentum():
    """It is constant about the centre of mass in world axes, where gravity has no torque."""
    body = tumbling_body().bodies[0].model_copy(update={"com": (0.0, 0.0, 0.0)})
    mech = pg.Mechanism(pg.Model(bodies=(body,)))
    run = pg.simulate(mech, t_end=2.0, method="rk4", step=1e-3, frames=50)
    spin = []
    for q, v in zip(run.q, run.v):
        _, R = mech.pose(q, "tumbling")
        spin.append(R @ np.array(body.inertia) @ R.T @ v[:3])
    np.testing.assert_allclose(spin, np.tile(spin[0], (len(spin), 1)), rtol=0, atol=1e-9)
