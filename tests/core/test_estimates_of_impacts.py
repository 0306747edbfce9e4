"""Estimates of the errors of runs with impacts, short contacts and steps of several sizes."""

from typing import Any

import numpy as np
import pytest
from scipy.special import gamma

import pgraph_core as pg

from ..nights import combined
from .test_estimates import falling, pushed, slider


@pytest.mark.parametrize("e", [1.0, 0.99])
@pytest.mark.parametrize("speed", [40.3, 4031.0])
def test_errors_of_many_impacts_add_up(speed, e):
    """A slider between two limits: each impact is a little late, by the gap that counts as closed.

    With e < 1 the impacts of a known speed come at known times.
    """
    body: dict[str, Any] = {"v": (speed,), "limits": ((-0.5, 0.5),), "limit_restitution": e}
    run = pg.simulate(slider(**body), t_end=1.0, frames=101)

    def known(t):
        x, v, now = 0.0, speed, 0.0
        while True:
            until = (0.5 - np.sign(v) * x) / abs(v)
            if now + until >= t:
                return x + v * (t - now)
            now, x, v = now + until, 0.5 * np.sign(v), -e * v

    off = np.abs(run.q[:, 0] - [known(t) for t in run.t]).max()
    assert off < 10 * run.error_estimate + 1e-12
    assert run.error_estimate < 10 * off + 1e-9


@pytest.mark.parametrize(("size", "e"), combined([1e-4, 0.1, 10.0], [0.0, 0.3, 0.6]))
def test_what_a_slow_impact_leaves_open_is_in_the_error_of_a_ball_at_rest(size, e):
    scene, options, _ = falling(size, e)
    run = pg.simulate(scene, **{**options, "t_end": 30.0, "frames": 31})
    off = abs(run.q[-1, 0] - size)
    assert off <= run.error_estimate < 10 * off + 1e-2 * size


@pytest.mark.parametrize(("size", "e", "side"), combined([1e-8, 1.0, 1e6], [0.3, 0.5], [1.0, -1.0]))
def test_what_a_slow_impact_leaves_open_at_a_limit_is_in_the_error(size, e, side):
    """A slider falls a third of its limit's coordinate, and its bounces shrink to nothing."""
    bound, height, g = side * size, 0.313 * size, 63.47 * size
    limits = ((bound, None),) if side > 0 else ((None, bound),)
    start = bound + side * height
    body: dict[str, Any] = {"q": (start,), "limits": limits, "limit_restitution": e}
    fall = np.sqrt(2 * height / g)
    run = pg.simulate(slider((0, 0, 1), side * g, **body), t_end=4.409 * fall, frames=101)
    gaps, begin, end, v = np.zeros(101), 0.0, fall, 0.0
    while end - begin > 1e-12 * fall:
        now = (run.t >= begin) & (run.t < end)
        s = run.t[now] - begin
        gaps[now] = (height if begin == 0.0 else 0.0) + v * s - 0.5 * g * s * s
        v = e * (g * (end - begin) - v)
        begin, end = end, end + 2 * v / g
    off = np.abs(side * (run.q[:, 0] - bound) - gaps).max()
    assert off < 10 * run.error_estimate + 1e-8 * size
    assert run.error_estimate < 10 * off + 1e-8 * size


@pytest.mark.parametrize(
    ("at", "method", "rtol"), combined([0.01, 0.5, 0.99], ["dop853", "dopri5"], [1e-4, 1e-6, 1e-8])
)
def test_one_wide_step_beside_short_ones_has_its_error(at, method, rtol):
    """Five corners end short steps, and one step or two take the rest, before or behind them."""
    knots = 0.3 * (at + 1e-3 * np.array([0.0, 0.2, 0.35, 0.39, 0.45, 1.0]))
    scene = pushed(knots, (0.0, 3.0, -2.0, 5.0, 1.0, 0.0), stiffness=9.0, damping=2.0, q=(0.4,))
    options: dict[str, Any] = {"t_end": 0.3, "frames": 101, "method": method}
    run = pg.simulate(scene, rtol=rtol, **options)
    fine = pg.simulate(scene, t_end=0.3, frames=101, method="dop853", rtol=1e-13)
    off = np.abs(run.q - fine.q).max()
    assert off < 10 * run.error_estimate + 1e-14
    assert run.error_estimate < 20 * off + 1e-14


@pytest.mark.parametrize(
    ("scale", "method", "rtol"),
    combined([1e-3, 1.0, 1e3], ["dop853", "dopri5"], [1e-4, 1e-6, 1e-8]),
)
def test_steps_that_halve_the_rest_are_not_repeated(scale, method, rtol):
    """An interval after the last corner, of any length, is taken in one step, two or more."""
    mass, w = 2.0, 0.7 / scale
    given: dict[str, Any] = {"stiffness": mass * w * w, "damping": 0.8 * mass * w, "q": (0.4,)}
    knots, values = scale * np.array([0.0, 0.22, 0.39]), mass * w * w * np.array([1.0, -1.2, 0.9])
    body = pg.Body(name="a", joint="prismatic", mass=mass, inertia=np.zeros((3, 3)), **given)
    motor = pg.Motor(name="m", body="a", torque=pg.Table(t=knots.tolist(), value=values.tolist()))
    mech = pg.Mechanism(pg.Model(bodies=[body], forces=[motor], gravity=(0, 0, 0)))
    for t_end in scale * np.geomspace(0.45, 6.0, 25):
        run = pg.simulate(mech, t_end=t_end, frames=101, method=method, rtol=rtol)
        fine = pg.simulate(mech, t_end=t_end, frames=101, method="dop853", rtol=1e-13)
        off = np.abs(run.q - fine.q).max()
        assert 0.2 * off - 1e-13 < run.error_estimate < 10 * off + 1e-13, t_end


@pytest.mark.parametrize("rtol", [1e-2, 1e-3, 1e-4, 1e-6])
def test_steps_after_an_impact_are_not_repeated(rtol):
    """A mass on a spring bounces off its limit. The rest of the run is a step or two."""
    for bound in np.linspace(0.3, 0.8, 9):
        limit: dict[str, Any] = {"limits": ((None, bound),), "limit_restitution": (0.9,)}
        body = pg.Body(name="m", joint="prismatic", stiffness=(1.0,), v=(1.0,), **limit)
        mech = pg.Mechanism(pg.Model(bodies=(body,), gravity=(0, 0, 0)))
        run = pg.simulate(mech, t_end=1.9, frames=101, method="dop853", rtol=rtol)
        met = np.arcsin(bound)
        back = bound * np.cos(run.t - met) - 0.9 * np.cos(met) * np.sin(run.t - met)
        error = np.abs(run.q[:, 0] - np.where(run.t < met, np.sin(run.t), back)).max()
        assert error < 10.0 * run.error_estimate + 1e-13


@pytest.mark.parametrize(("heavy", "gap"), combined([0.05, 20.0], [2.0, 20.0]))
def test_a_finer_run_is_finer_within_a_short_contact(heavy, gap):
    """Two soft balls meet without losses, by Hertz's law. The run meets them in a few steps."""
    line: dict[str, Any] = {"joint": "prismatic", "axes": ((1, 0, 0),), "inertia": np.zeros((3, 3))}
    line["shape"] = {"kind": "sphere", "radius": 1.0}
    one = pg.Body(name="a", v=(1.0,), **line)
    two = pg.Body(name="b", mass=heavy, link=(2.0 + gap, 0, 0), **line)
    for depth in np.geomspace(2e-3, 5e-2, 10):
        stiffness = 1.25 * heavy / (1.0 + heavy) / depth**2.5
        law: dict[str, Any] = {"law": "soft", "damping": 0.0, "stiffness": stiffness}
        pair = pg.Contact(name="c", body="a", other="b", **law)
        model = pg.Model(bodies=(one, two), contacts=(pair,), gravity=(0, 0, 0))
        run = pg.simulate(model, t_end=3 * gap, frames=101, method="dop853", rtol=7e-4)
        lasts = 2.0 * depth * np.sqrt(np.pi) * gamma(1.4) / gamma(0.9)
        ahead = gap - lasts  # of b, at the end: they part as fast as they met
        ends = np.array((3 * gap - heavy * ahead, 3 * gap + ahead)) / (1.0 + heavy)
        error = np.abs(run.q[-1] - ends).max()
        assert 0.2 * error < run.error_estimate < 10.0 * error
