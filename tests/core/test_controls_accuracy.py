"""States of controls have the order of their method, and a run tells their error."""

import numpy as np
import pytest
from scipy.integrate import solve_ivp

import pgraph_core as pg
from tests.controlled import EVERY, STATES, TORQUE, Z, pendulum
from tests.nights import combined


def noted(run, name):
    return any(f"'{name}'" in text for text in run.notices)


@pytest.mark.parametrize("size", [1e-6, 1.0, 1e6])
@pytest.mark.parametrize("v", [0.0, 0.3])
def test_an_error_of_a_state_that_no_force_reads_is_told(size, v):
    rod = pg.Body(name="rod", axes=[Z], v=[v], inertia=(0.01,) * 3)
    state = pg.State(name="s", rate=f"=100*({size!r}*sin(50*t) - x.s)")
    model = pg.Model(bodies=[rod], gravity=(0, 0, 0), controls=[state])
    coarse, fine = (pg.simulate(model, t_end=1.0, method="rk4", step=step) for step in (2e-2, 2e-3))
    assert noted(coarse, "s")
    assert not noted(fine, "s")
    assert coarse.error_estimate < 1e-12  # of the motion


@pytest.mark.parametrize("options", [{}, {"method": "rk4", "step": 1e-2}])
def test_states_that_are_right_or_at_rest_are_not_told(options):
    resting, moving = pendulum([STATES[1]]), pendulum(EVERY, TORQUE)
    for model, q in ((resting, -np.pi / 2), (moving, 0.4)):
        run = pg.simulate(model, [q], t_end=1.0, **options)
        assert not any("control" in text for text in run.notices)


LIMITED = {"limits": [(-9.0, 9.0)]}


@pytest.mark.parametrize("controls", [STATES, (*STATES, *EVERY[2:3])], ids=["states", "pid"])
def test_time_stepping_takes_states_to_the_order_of_its_step(controls):
    torque = TORQUE if len(controls) == 2 else f"{TORQUE} + x.pid"
    plain = pendulum(controls, torque)
    off = []
    for step in (1e-2, 5e-3, 2.5e-3):
        call = {"t_end": 1.0, "q": [0.4], "v": [0.5]}
        run = pg.simulate(plain.edit("arm", **LIMITED), method="moreau_jean", step=step, **call)
        exact = pg.simulate(plain, t_eval=run.t, rtol=1e-12, **call)
        apart = [np.abs(getattr(run, x) - getattr(exact, x)) for x in ("q", "v", "states")]
        off.append(np.concatenate([x.max(axis=0) for x in apart]))
        told = run.state_error_at[-1]
        assert (off[-1][2:] < 2 * told).all()
        assert (told < 2 * off[-1][2:]).all()
    # no force depends on the velocity itself: order two
    assert (off[1] < 0.27 * off[0]).all()
    assert (off[2] < 0.27 * off[1]).all()


def test_states_go_on_through_impacts():
    """The integral of the speed of a bouncing ball is its height, a count of time its time."""
    ball = pg.Body(name="ball", joint="prismatic", axes=[Z], mass=1.0, q=[0.5],
                   shape=pg.Shape(kind="sphere", radius=0.1))  # fmt: skip
    states = [pg.State(name="s", rate="=v.ball"), pg.State(name="t", rate=1.0)]
    floor = pg.Contact(name="floor", body="ball", restitution=0.7)
    model = pg.Model(bodies=[ball], contacts=[floor], controls=states)
    run = pg.simulate(model, t_end=1.5, method="moreau_jean", step=5e-3)
    assert np.allclose(run.states[:, 0], run.q[:, 0] - 0.5, rtol=0, atol=1e-12)
    assert np.allclose(run.states[:, 1], run.t, rtol=0, atol=1e-12)


def test_the_estimate_has_the_states():
    model = pendulum(STATES, TORQUE)
    coarse = pg.simulate(model, t_end=1.0, q=[0.4], step=5e-2, method="rk4")
    exact = pg.simulate(model, t_end=1.0, q=[0.4], rtol=1e-13, t_eval=coarse.t)
    assert coarse.state_error_at.shape == coarse.states.shape
    assert (np.diff(coarse.state_error_at, axis=0) >= 0).all()
    off = np.abs(coarse.states - exact.states).max(axis=0)
    assert (off < 2 * coarse.state_error_at[-1]).all()
    assert (coarse.state_error_at[-1] < 2 * off + 1e-12).all()
    shares = coarse.state_error_at[-1] / np.ptp(coarse.states, axis=0)
    assert coarse.relative_error[-1] >= shares.max()
    assert "x.f[1]" in coarse.accuracy or shares.max() <= coarse.error_estimate
    assert pg.simulate(model, t_end=1.0, step=5e-2, estimate=False).state_error_at.shape[1] == 2


@pytest.mark.parametrize(
    ("method", "rtol", "lag"),
    combined(["dopri5", "dop853", "radau5"], [1e-4, 1e-6, 1e-8], [1.0, 0.1, 0.01]),
)
def test_frames_between_steps_are_as_good_as_their_ends(method, rtol, lag):
    controls = [pg.Filter(name="f", input="=v.arm + sin(5*t)", lag=lag)]
    model = pendulum(controls, "=-3*x.f")

    def rate(t, y):
        return y[1], (-3 * y[2] - 9.81 * np.cos(y[0])) / 0.7, (y[1] + np.sin(5 * t) - y[2]) / lag

    exact = solve_ivp(rate, (0, 3), (0.4, 0.0, 0.0), rtol=1e-13, atol=1e-14, method="DOP853",
                      dense_output=True)  # fmt: skip
    run = pg.simulate(model, t_end=3.0, q=[0.4], method=method, rtol=rtol, frames=301)
    found = np.column_stack((run.q, run.v, run.states))
    assert np.abs(found - exact.sol(run.t).T).max() < 100 * rtol


@pytest.mark.parametrize("method", ["dopri5", "dop853", "radau5"])
@pytest.mark.parametrize("rtol", [1e-4, 1e-6, 1e-8])
def test_a_state_that_begins_at_zero_is_as_accurate_as_others(method, rtol):
    """Its scale is that of accepted steps; SciPy's DOP853 is off by 2 rtol here."""
    rod = pg.Body(name="rod", axes=[Z], v=[0.3], inertia=(0.01,) * 3)
    state = pg.State(name="s", rate="=100*(sin(50*t) - x.s)")
    model = pg.Model(bodies=[rod], gravity=(0, 0, 0), controls=[state])
    run = pg.simulate(model, t_end=1.0, method=method, rtol=rtol, frames=1001)
    a, b = 0.8, -0.4  # of the response a sin + b cos
    exact = a * np.sin(50 * run.t) + b * np.cos(50 * run.t) - b * np.exp(-100 * run.t)
    off = np.abs(run.states[:, 0] - exact)
    assert off.max() < 50 * rtol
    assert off.max() < 3 * run.state_error_at[-1, 0] + 1e-12
