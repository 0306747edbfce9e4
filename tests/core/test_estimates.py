"""The error estimate of a run: within 0.2 to 10 of its error, or unknown where runs part."""

import gc
import tracemalloc
import weakref
from typing import Any

import numpy as np
import pytest
from numba import njit
from scipy.interpolate import PPoly, make_interp_spline
from scipy.special import ellipj, ellipk

import pgraph_core as pg
from pgraph_core.dynamics.states import differences

from ..nights import combined
from ..worlds import built_in as model
from .trees import random_case

G = 9.81


def slider(axis=(1, 0, 0), gravity=0.0, contacts=(), **fields) -> pg.Model:
    body = pg.Body(name="a", joint="prismatic", axes=axis, inertia=np.zeros((3, 3)), **fields)
    return pg.Model(bodies=[body], gravity=(0, 0, -gravity), contacts=contacts)


def pushed(knots, values, **fields) -> pg.Model:
    table = pg.Table(t=list(knots), value=list(values))
    return slider(**fields).add(pg.Motor(name="m", body="a", torque=table))


def ball(radius, height, gravity, e) -> pg.Model:
    floor = pg.Contact(name="floor", body="a", restitution=e, friction=0.0)
    shape = {"kind": "sphere", "radius": radius}
    return slider((0, 0, 1), gravity, (floor,), q=(radius + height,), shape=shape)


def true_error(mech, run, q=None, v=None):
    """Return the largest difference of q from a far finer run, nan if that costs too much."""
    span = {"t_start": run.t[0], "t_end": run.t[-1], "t_eval": run.t, "max_steps": 50_000}
    fine = pg.simulate(mech, q, v, **span, method="dop853", rtol=1e-14, estimate=False)
    if not fine.status.ok:
        return np.nan
    return np.maximum(*differences(mech.packed, run.q, fine.q)).max()


# Closed forms: each returns a model, the options of its run, and q as a function of time.


def ramp(late, width):
    """A steep ramp at a late time, whose times are known to rounding."""
    knots = late + 2.4 + width * np.arange(4)
    values = np.array([0.0, 0.4, 0.4, 0.0]) / width
    options = {"t_start": late, "t_end": late + 10, "t_eval": [late, late + 10]}
    known = driven([0.0, *(knots - late), 10.0], [0.0, *values, 0.0])
    return pushed(knots, values), options, lambda t: known(t - late)


def driven(knots, values):
    return PPoly.from_spline(make_interp_spline(knots, values, k=1)).antiderivative(2)


def falling(radius, e):
    def known(t):
        after = np.maximum(t - np.sqrt(2), 0.0)
        rise = e * 10 * np.sqrt(2) * after - 5 * after**2 if e else 0 * after
        return radius * np.where(after > 0, 1 + rise, 11 - 5 * t**2)

    return ball(radius, 10 * radius, 10 * radius, e), {"t_end": 2.0}, known


def last_bounces(radius, g, height, e, t_end, lively):
    assert np.sqrt(2 * height / g) * (1 + e) / (1 - e) < t_end
    scene = ball(radius, height, g, e)
    if lively:
        other = {"limits": ((-0.1, 0.1),), "v": (20.0,), "limit_restitution": 1.0}
        scene = scene.add(pg.Body(name="s", joint="prismatic", axes=(1, 0, 0), **other))
    known = lambda t: np.where(t == t[-1], radius, np.nan)  # noqa: E731
    return scene, {"t_end": t_end, "frames": 101}, known


def incline(v0, **options):
    slope, mu = 0.5, 0.3
    way = np.array([np.cos(slope), np.sin(slope)])
    up, down = G * (way[1] + mu * way[0]), G * (way[1] - mu * way[0])
    block = pg.Body(
        name="b", joint="compound", motions=(("translate", (1, 0, 0)), ("translate", (0, 0, 1))),
        mass=2, inertia=np.eye(3), v=tuple(v0 * way),
    )  # fmt: skip
    floor = pg.Contact(name="c", body="b", points=((0, 0, 0),), friction=mu)

    def known(t):
        rising = np.minimum(t, v0 / up)
        return np.outer(v0 * rising - up * rising**2 / 2 - down * (t - rising) ** 2 / 2, way)

    scene = pg.Model(bodies=(block,), ground=pg.Ground(slope=slope), contacts=(floor,))
    return scene, {"t_end": 1.5, **options}, known


def overdamped(stiffness, damping, q, v, **options):
    """Return a slider on a spring whose damper settles it within some steps, then it creeps."""
    w = np.sqrt(damping**2 / 4 - stiffness)
    fast = -damping / 2 - w
    slow = stiffness / fast
    share = (v - slow * q) / (fast - slow)
    scene = slider(q=q, v=v, stiffness=stiffness, damping=damping)
    return scene, options, lambda t: share * np.exp(fast * t) + (q - share) * np.exp(slow * t)


def penalty(**options):
    k, radius = 1e4, 0.1
    law = {"law": "penalty", "stiffness": k, "damping": 0.0, "friction": 0.0}
    floor = pg.Contact(name="c", body="a", **law)
    shape = pg.Shape(kind="sphere", radius=radius)
    fall, speed, w = np.sqrt(0.4 / G), np.sqrt(0.4 * G), np.sqrt(k)
    sag = G / w**2

    def known(t):
        since = (t + fall) % (2 * fall + 2 * (np.pi - np.arctan(speed / w / sag)) / w)
        air = radius + speed * since - 0.5 * G * since**2
        deep = w * (since - 2 * fall)
        ground = radius - sag + sag * np.cos(deep) - speed / w * np.sin(deep)
        return np.where(since < 2 * fall, air, ground)

    return slider((0, 0, 1), G, (floor,), q=0.3, shape=shape), {"t_end": 1.0, **options}, known


def jump(when, method):
    @njit
    def tau(t, q, v):
        return np.array([10.0 if t >= when else 0.0])

    options = {"t_end": 1.0, "frames": 101, "method": method, "step": 0.01, "tau": tau}
    return slider(), options, lambda t: 5 * np.maximum(t - when, 0) ** 2


THROWN = {"method": "radau5", "step": 1e-2, "t_end": 10.0}
EARLY = {"t_end": 10.0, "t_eval": [0.03, 10.0], "step": 0.1}
LOOSE = {"method": "radau5", "rtol": 3e-5, "frames": 11, "t_end": 1.0}
ABOVE = 0.2, np.inf  # the least and the largest ratio of the estimate to the error
CLOSE = 0.2, 10
LUCKY = 0.2, 20  # the error is small where it turns in this step; see test_jumps_within_steps
CLOSED = {
    "steep ramp": (ramp(0.0, 1e-6), ABOVE),
    "late ramp": (ramp(1e6, 1e-3), ABOVE),
    "small ball stays": (falling(1e-3, 0.0), ABOVE),
    "ball bounces": (falling(0.1, 0.5), ABOVE),
    "large ball bounces": (falling(100.0, 0.5), ABOVE),
    "last bounces": (last_bounces(1.405, 2.42, 0.9135, 0.3, 1.741, False), CLOSE),
    "last bounces beside others": (last_bounces(83.62, 422.6, 855.4, 0.5, 11.8, True), CLOSE),
    "friction turns in the first step": (incline(2e-3), CLOSE),
    "friction turns between frames": (incline(2.9), CLOSE),
    "friction turns early": (incline(0.7, t_end=15.0, frames=2), CLOSE),
    "friction turns in a wide step": (incline(0.37, t_end=0.4, step=0.05), LUCKY),
    "thrown into a damper": (overdamped(1.0, 1e2, 0.0, 1e2, **THROWN), CLOSE),
    "damper that no step resolves": (overdamped(1, 1e5, 0, 1e5, step=0.01, t_end=10.0), CLOSE),
    "settles to a tolerance": (overdamped(30.8, 333.0, 0.2, -5.0, **LOOSE), CLOSE),
    "settles within the first step": (overdamped(20.0, 100.0, 0.2, -5.0, **EARLY), CLOSE),
    "penalty contact": (penalty(), CLOSE),
    "penalty contact, wide steps": (penalty(step=0.01), CLOSE),
    "jump, rk4": (jump(0.17530291379231935, "rk4"), (0.1, np.inf)),
    "jump, gauss6": (jump(0.28944840527687976, "gauss6"), (0.1, np.inf)),
}


@pytest.mark.parametrize(("scene", "ratio"), CLOSED.values(), ids=CLOSED)
def test_the_estimate_is_the_error_of_a_closed_form(scene, ratio):
    model, options, known = scene
    run = pg.simulate(model, **options)
    exact = np.asarray(known(run.t)).reshape(len(run.t), -1)
    true = np.nanmax(np.abs(run.q[:, : exact.shape[1]] - exact))
    assert ratio[0] * true < run.error_estimate < min(ratio[1] * true, 10.0)


# References: a mechanism, its start and options, compared with a far finer run.

KNOTS = np.arange(0.5, 10.0, 0.5)
SHAKEN = pushed(KNOTS, 20 * np.random.default_rng(1).normal(size=len(KNOTS)), q=0.2, v=1.0,
                stiffness=40.0, damping=0.1)  # fmt: skip
SAW = pushed(np.linspace(0, 1, 21), np.where(np.arange(21) % 2, 5.0, -5.0), stiffness=9.0)
SPUN = pg.Body(name="b", joint="spherical", mass=1.0, inertia=np.diag([1.0, 2.0, 2.5]))
TUMBLING = pg.Model(bodies=(SPUN,), gravity=(0, 0, 0))
CHAIN = np.random.default_rng(3).uniform(-1.0, 1.0, 20)
RK4, RADAU5, DOP853 = (dict[str, Any](method=m) for m in ("rk4", "radau5", "dop853"))
TWENTY = {"t_end": 0.5, "step": 1e-3, "method": "semi_implicit_euler"}
REFERENCED: dict[str, Any] = {
    "wide steps, rk4": ("pendulum", [2.5], None, {"t_end": 2.0, "step": 0.1, **RK4}),
    "wide steps, radau5": ("pendulum", [2.5], None, {"t_end": 2.0, "step": 0.5, **RADAU5}),
    "frames end steps": ("pendulum", [1], None, {"t_end": 1, "frames": 101, "step": 0.015, **RK4}),
    "frames in steps": ("pendulum", [1], None, {"t_end": 1, "frames": 101, "step": 0.04, **RADAU5}),
    "knots at steps": (SAW, None, None, {"t_end": 1.0, "step": 0.01, **RK4}),
    "knots end steps": (SHAKEN, None, None, {"t_end": 10, "frames": 50, "step": 1.0, **DOP853}),
    "loose": (SHAKEN, None, None, {"t_end": 10, "frames": 50, "rtol": 1e-2, **DOP853}),
    "attitudes": (TUMBLING, None, [1, 200, 1], {"t_end": 30, "method": "dopri5", "rtol": 1e-5}),
    "two frames": (pg.Model.serial(20), CHAIN, 0.2 * CHAIN[::-1], {"frames": 2, **TWENTY}),
    "parts of steps": ("heavy_top", None, None, {"scenario": "spin", "t_end": 0.2, "frames": 21,
                                                 "step": 0.01, **RADAU5}),
}  # fmt: skip


@pytest.mark.parametrize(("what", "q", "v", "options"), REFERENCED.values(), ids=REFERENCED)
def test_the_estimate_is_the_difference_from_a_finer_run(what, q, v, options):
    mech = model(what) if isinstance(what, str) else pg.Mechanism(what)
    run = pg.simulate(mech, q, v, **options)
    true = true_error(mech, run, run.q[0], run.v[0])
    assert run.error_estimate > 0.1 * true
    assert np.isinf(run.error_estimate) or run.error_estimate < 10 * true


def test_smooth_runs_are_estimated_within_a_factor_of_ten():
    choices = [
        {}, {"rtol": 1e-4}, {"rtol": 1e-10}, {"method": "dopri5", "rtol": 1e-6},
        *({"rtol": 1e-4, **RADAU5}, {"rtol": 1e-6, **RADAU5}, {"step": 2e-3, **RK4}),
        {"method": "semi_implicit_euler", "step": 1e-3},
    ]  # fmt: skip
    found = []
    for seed in range(24):
        case = random_case(700 + seed, most=6)
        mech = pg.Mechanism(case.model)
        run = pg.simulate(mech, case.q, case.v, t_end=0.5, frames=101, **choices[seed % 8])
        true = true_error(mech, run, case.q, case.v)
        if true > 1e-13 and not np.isinf(run.error_estimate):
            found.append(run.error_estimate / true)
    assert len(found) > 16
    assert np.mean((np.array(found) > 0.2) & (np.array(found) < 10)) >= 0.95
    assert min(found) > 0.01


@pytest.mark.parametrize("frames", [601, 2])
@pytest.mark.parametrize("options", [{"rtol": 1e-8}, {"rtol": 1e-5}, {"step": 2e-3, **RK4}])
def test_the_error_of_chaotic_motion_is_unknown_from_where_runs_part(options, frames):
    """A double pendulum over 60 s, off by 90 rad at the end."""
    mech = model("double_pendulum")
    run = pg.simulate(mech, t_end=60.0, frames=frames, **options)
    known = np.isfinite(run.error_at)
    assert run.error_estimate == np.inf
    assert (np.diff(run.error_at[known]) >= 0.0).all()
    assert not known[known.argmin() :].any()
    last, first = known.argmin() - 1, known.argmin()
    assert any(f"{run.t[first]:.4g}" in text for text in run.notices)
    if frames == 2:
        assert (last, first) == (0, 1)
        return
    fine = pg.simulate(
        mech, t_end=run.t[first], t_eval=run.t[: first + 1], method="dop853", rtol=1e-14
    )
    off = np.abs(run.q[: first + 1] - fine.q).max(axis=1)
    assert 5.0 < run.t[last] < 40.0
    assert (off[1:first] < 10 * run.error_at[1:first]).all()
    assert off[last] < 1.0
    assert off[first] > 0.1
    assert run.at(0.5 * run.t[last])[2] < 0.3
    assert run.at(run.t[first])[2] == np.inf


@pytest.mark.parametrize("seed", [0, 3, 6, 9])
def test_errors_of_chaotic_runs_are_known_or_reported_as_unknown(seed):
    rng = np.random.default_rng(seed)
    mech, q, v = model("double_pendulum"), rng.uniform(-3, 3, 2), rng.uniform(-6, 6, 2)
    run = pg.simulate(mech, q, v, t_end=8.0, rtol=1e-5, frames=101)
    assert run.error_estimate > 0.1 * true_error(mech, run, q, v)
    assert np.isinf(run.error_estimate) == any("not known" in text for text in run.notices)


def test_rounding_of_times_is_in_the_estimate():
    mech = model("pendulum")
    early = pg.simulate(mech, t_end=1.0, frames=11, rtol=1e-13)
    for t in (0.0, 1e9, 1e12):
        late = pg.simulate(mech, t_start=t, t_end=t + 1, frames=11, rtol=1e-13)
        true = np.abs(late.q - early.q).max()
        assert true / 5 < late.error_estimate < 1e3 * true + 1e-11
    steps: dict[str, Any] = {"step": 0.01, **RK4}
    late = pg.simulate(mech, t_start=1e12, t_end=1e12 + 5, **steps)
    true = np.abs(late.q - pg.simulate(mech, t_end=5.0, **steps).q).max()
    assert true / 5 < late.error_estimate < 10 * true


@pytest.mark.parametrize("method", ["dopri5", "dop853", "radau5"])
def test_steps_of_a_late_start_add_up_to_its_time(method):
    """5000 sums of time and step, each rounded, would be off by 1e-8."""
    scene, rate = slider(q=1.0, stiffness=1e6), 1000.0
    late: dict[str, Any] = {"t_start": 1e4, "t_end": 1e4 + 0.05}
    run = pg.simulate(scene, **late, frames=11, method=method, step=1e-5)
    assert np.abs(run.q[:, 0] - np.cos(rate * (run.t - 1e4))).max() < 1e-10


@njit
def swinging(t, q, v):
    return np.array([0.5 * np.sin(3.0 * t)])


def test_a_compiled_torque_has_an_estimate_and_a_python_one_on_request():
    mech = model("pendulum")
    fast = pg.simulate(mech, t_end=1.0, tau=swinging, rtol=1e-6)
    slow = pg.simulate(mech, t_end=1.0, tau=swinging.py_func, rtol=1e-6, estimate=True)
    assert fast.error_estimate == slow.error_estimate
    tight = pg.simulate(mech, t_end=1.0, tau=swinging, rtol=1e-13)
    true = np.abs(tight.q - fast.q).max()
    assert true / 10 < fast.error_estimate < 10 * true
    silent = pg.simulate(mech, t_end=1.0, tau=swinging.py_func, rtol=1e-6)
    assert np.isnan(silent.error_estimate)
    assert "estimate=True" in silent.message


@pytest.mark.parametrize("options", [{}, {"step": 0.1, **RK4}, {"rtol": 1e-6, **RADAU5}])
def test_a_run_that_is_exact_to_rounding_has_an_estimate(options):
    """A pendulum so long that runs at two tolerances are the same."""
    body = pg.Body(
        name="b", mass=0.8291670740535318, com=(0, 0, -636468.712560516), inertia=np.zeros((3, 3)),
        axes=((0, 1, 0),), q=(1.6299952464951657,),
    )  # fmt: skip
    mech = pg.Mechanism(pg.Model(bodies=(body,), gravity=(0, 0, -15.11361999981945)))
    assert 0.0 < pg.simulate(mech, t_end=22.576, frames=101, **options).error_estimate < 1e-8


def test_what_rests_and_the_initial_state_have_no_error_but_rounding():
    run = pg.simulate(ball(0.1, 0.0, G, 0.0), t_end=1.0)
    assert np.abs(run.q - 0.1).max() <= run.error_estimate < 1e-9
    for options in ({}, {"step": 1e-3, **RK4}):
        run = pg.simulate(model("pendulum"), t_end=0.5, t_eval=[0.0], **options)
        assert (len(run.t), run.error_estimate) == (1, 0.0)


def test_the_estimate_leaves_the_run_as_it_is():
    mech = pg.Mechanism(pg.Model.serial(20))
    run, alone = (pg.simulate(mech, CHAIN, frames=3, **TWENTY, estimate=e) for e in (True, False))
    every = pg.simulate(mech, CHAIN, **TWENTY, frames=501, estimate=False)
    assert np.isnan(alone.error_estimate)
    assert np.array_equal(run.q, alone.q)
    assert np.array_equal(run.q[-1], every.q[-1])


def test_a_pulse_of_a_torque_function_that_no_step_meets_is_reported():
    """The pulse lasts 1 ms of a second, within a step of the adaptive default."""

    short = lambda t, q, v: np.array([1e3 if 0.5034 < t < 0.5044 else 0.0])  # noqa: E731
    step = lambda t, q, v: np.array([np.sin(30 * t) + 5.0 * (t > 0.3)])  # noqa: E731
    missed = pg.simulate(slider(), t_end=1.0, tau=short)
    assert missed.v[-1, 0] == 0.0
    assert missed.notices
    met = pg.simulate(slider(), t_end=1.0, tau=short, step=2e-4)
    assert met.v[-1, 0] == pytest.approx(1, abs=0.1)
    assert met.notices == pg.simulate(slider(), t_end=1.0, tau=step).notices == ()


@pytest.mark.parametrize(
    "frames",
    [
        {"t_eval": [0, 1, 1.0000001, 2, 3]},
        {"t_eval": np.sort([0, 3, *np.random.default_rng(1).uniform(0, 3, 28)])},
        {"frames": 4, "t_end": 10.0},
        {"frames": 3, "t_end": 33.0},
    ],
)
def test_states_between_frames_have_their_error(frames):
    mech, options = model("pendulum"), {"t_end": 3.0, **frames}
    run = pg.simulate(mech, [0.5], **options)
    t = np.linspace(0.0, run.t[-1], 60)[1:-1]
    q, _, error = run.at(t)
    known = pg.simulate(mech, [0.5], t_end=run.t[-1], t_eval=t, rtol=1e-12).q
    assert (np.abs(q - known)[:, 0] < 10 * error).all()
    if len(run.t) > 20:
        assert np.isfinite(error).all()


@pytest.mark.filterwarnings("error")
@pytest.mark.parametrize("method", ["rk4", "radau5"])
def test_frames_that_equal_steps_but_for_rounding_give_an_estimate(method):
    """Frames and knots of a table that differ by rounding are ends of no step between them."""
    scene = pushed([0, 0.3, 0.301, 0.311, 0.312, 1], [0, 0, 30, 30, 0, 0])
    run = pg.simulate(scene, t_end=1.0, frames=21, method=method, step=0.05)
    fine = pg.simulate(scene, t_end=1.0, frames=21, rtol=1e-10)
    off = np.abs(run.q - fine.q).max()
    small = off < 10 * run.error_estimate + 1e-13  # the other run is known to rounding
    assert small or any("corners" in text for text in run.notices)
    assert run.error_estimate < 1.0


# Laws for every method.

OSCILLATOR = slider(q=1.0, stiffness=9.0), lambda t: np.cos(3.0 * t)
DAMPED = (
    slider(v=1.0, stiffness=25.0, damping=2.0),
    lambda t: np.exp(-t) * np.sin(np.sqrt(24.0) * t) / np.sqrt(24.0),
)
HALF = np.sin(1.0)  # of a pendulum let go at 2 rad: sine of half of the angle
MOTIONS: dict[str, Any] = {
    "oscillator": (*OSCILLATOR, 4.0),
    "damped": (*DAMPED, 2.0),
    "pendulum": (
        pg.Model(bodies=[pg.Body(name="a", axes=((0, 1, 0),), com=(0, 0, -1), q=2.0,
                                 inertia=np.zeros((3, 3)))], gravity=(0, 0, -4.0)),
        lambda t: 2.0 * np.arcsin(HALF * ellipj(ellipk(HALF**2) - 2.0 * t, HALF**2)[0]), 3.0,
    ),
    "shaken": (SHAKEN, None, 10.0),
    "tumbling": (TUMBLING.edit("b", v=(1.0, 5.0, 0.1)), None, 2.0),
    "double pendulum": ("double_pendulum", None, 1.0),
    "four-bar": ("four_bar", None, 1.0),
    "chain": (pg.Model.serial(5), None, 0.5),
}  # fmt: skip
WAYS: dict[str, Any] = {
    "default": {}, "dop853": {"rtol": 1e-5, **DOP853}, "dopri5": {"method": "dopri5", "rtol": 1e-6},
    "radau5": {"rtol": 1e-5, **RADAU5}, "dop853 in steps": {"parts": 60, **DOP853},
    "radau5 in steps": {"parts": 100, **RADAU5}, "rk4": {"parts": 400, **RK4},
    "gauss6": {"method": "gauss6", "parts": 60},
    "semi-implicit Euler": {"method": "semi_implicit_euler", "parts": 4000},
}  # fmt: skip


def run_of(what, way, **options):
    """A run of one of MOTIONS by one of WAYS, and its true error at each frame."""
    scene, known, t_end = MOTIONS[what]
    mech = model(scene) if isinstance(scene, str) else pg.Mechanism(scene)
    given = {"frames": 101, "t_end": t_end, **WAYS[way], **options}
    if "parts" in given:
        given["step"] = t_end / given.pop("parts")
    run = pg.simulate(mech, **given)
    if known is None:
        fine = pg.simulate(mech, t_end=t_end, t_eval=run.t, estimate=False, rtol=1e-14, **DOP853)
        exact = fine.q
    else:
        exact = known(run.t)[:, None]
    return run, np.maximum.accumulate(np.maximum(*differences(mech.packed, run.q, exact)))


@pytest.mark.parametrize(("what", "way"), combined(MOTIONS, WAYS))
def test_the_estimate_of_smooth_motion_is_its_error_by_every_method(what, way):
    run, off = run_of(what, way)
    assert (np.diff(run.error_at) >= 0.0).all()
    assert run.error_at.shape == run.t.shape
    assert run.error_estimate == run.error_at[-1]
    rounding = 1e-12 * max(1.0, np.abs(run.q).max())
    if np.isinf(run.error_estimate):
        assert off[-1] > 0.03
        return
    assert off[-1] < 5 * run.error_estimate + rounding
    assert run.error_estimate < 10 * off[-1] + rounding
    late = slice(len(run.t) // 4, None)
    assert (off[late] < 10 * run.error_at[late] + rounding).all()


@pytest.mark.parametrize("start", [0.0, 1e3])
@pytest.mark.parametrize("size", [1e-6, 1.0, 1e3])
def test_an_error_above_one_per_cent_of_the_motion_is_a_notice(size, start):
    """Whatever the motion's size: a quarter of a turn of an oscillator in so many steps."""
    scene = slider(q=size, stiffness=9.0)
    for parts, large in ((4, True), (100, False)):
        span: dict[str, Any] = {"t_start": start, "t_end": start + 0.5, "frames": 2}
        run = pg.simulate(scene, **span, method="semi_implicit_euler", step=0.5 / parts)
        assert (run.relative_error[-1] > 0.01) == large
        assert any("%" in text for text in run.notices) == large
        assert ("%" in run.accuracy) == np.isfinite(run.error_estimate)


def test_vibrations_that_implicit_steps_take_out_are_named():
    """1 kg on a spring of 1e9 N/m swings by 9.8 nm. Steps that resolve it give no warning."""
    for step, t_end, missing in ((1e-2, 1.0, True), (2e-6, 1e-3, False)):
        scene = slider((0, 0, 1), G, stiffness=1e9)
        run = pg.simulate(scene, t_end=t_end, step=step, **RADAU5)
        known = -9.81e-9 * (1 - np.cos(np.sqrt(1e9) * run.t))
        off = np.abs(run.q[:, 0] - known).max()
        assert (off > 10 * run.error_estimate) == missing
        assert any("vibrations" in text for text in run.notices) == missing


def test_a_run_that_an_event_ends_has_an_error_at_each_frame():
    def lowest(t, q, v):
        return q[0]

    vars(lowest)["terminal"] = True
    ways: list[dict[str, Any]] = [{"rtol": 1e-5}, {"step": 0.01, **RK4}, {"step": 0.03, **RADAU5}]
    for options in ways:
        run = pg.simulate(model("pendulum"), [1.0], events=lowest, t_end=9.0, **options)
        assert run.status is pg.Status.STOPPED
        true = true_error(run.mechanism, run, [1.0])
        assert run.error_at.shape == run.t.shape
        assert true / 5 < run.error_estimate < 10 * true


def test_a_run_that_an_event_ends_in_an_instant_has_an_estimate():
    def moves(t, q, v):
        return v[0] + 1e-12

    vars(moves)["terminal"] = True
    body = pg.Body(name="b", joint="prismatic", axes=(0, 0, 1), limits=((-1.0, None),))
    options: dict[str, Any] = {"method": "moreau_jean", "step": 0.005, "events": moves}
    run = pg.simulate(pg.Model(bodies=(body,)), t_end=1.0, **options)
    assert 0.0 < run.t[-1] < 1e-12
    assert run.error_estimate < 1e-12


def test_finished_runs_keep_no_memory():
    """Neither the mechanism nor a module keeps what the finer run recorded."""
    mech = model("double_pendulum")
    options: dict[str, Any] = {"t_end": 0.1, "frames": 20_001, "rtol": 1e-8}
    kept = []

    def held():
        gc.collect()
        return tracemalloc.get_traced_memory()[0]

    pg.simulate(mech, **options)
    tracemalloc.start()
    try:
        for estimate in (False, True):
            before = held()
            for k in range(3):
                pg.simulate(mech, [0.1 * k, 0.2], estimate=estimate, **options)
            kept.append(held() - before)
        found = weakref.ref(mech)
        del mech
        gc.collect()
    finally:
        tracemalloc.stop()
    assert kept[1] < kept[0] + 50_000  # a frame of q alone takes 16 bytes: 320 kB a run
    assert found() is None


def test_errors_are_saved_with_the_run(tmp_path):
    run = pg.simulate(model("double_pendulum"), t_end=30.0, rtol=1e-5, frames=61)
    run.save(tmp_path / "run.npz")
    again = pg.Result.load(tmp_path / "run.npz")
    assert np.array_equal(again.error_at, run.error_at)
    assert again.accuracy == run.accuracy


@pytest.mark.parametrize(("options", "told"), [({"rtol": 1e-3}, True), ({"rtol": 1e-6}, False)])
def test_speeds_are_named_that_are_less_accurate_than_positions(options, told):
    """A stiff spring vibrates by 0.1 mm, at a speed of the size of the mean one."""
    a = pg.Body(name="a", joint="prismatic", axes=["x"], mass=1.0)
    b = pg.Body(name="b", joint="prismatic", axes=["x"], link=(0.5, 0, 0), mass=1.0, v=(1.5,))
    spring = pg.Spring(name="k", body="a", other="b", stiffness=1e8, rest=0.5)
    run = pg.simulate(pg.Model(bodies=[a, b], forces=[spring]), t_end=0.05, **options)
    exact = 0.75 * (1.0 - np.cos(np.sqrt(2e8) * run.t))
    off = np.abs(run["v.a"] - exact).max()
    assert (off > 0.1 * np.abs(run.v).max()) == told
    assert any("error of speeds" in notice for notice in run.notices) == told
