"""The choice of `auto`, bad input of runs, and the end of runs that fail."""

import re

import numpy as np
import pytest

import pgraph_core as pg
from pgraph_core.integrators import METHODS

from ..worlds import ball, built_in, on_ground
from .test_cases import DOWN, mass
from .test_methods import double_pendulum, stiff_pendulum


def damper():
    body = pg.Body(name="a", joint="prismatic", mass=1.0, damping=1e7, v=1.0)
    return pg.Mechanism(pg.Model(bodies=(body,)))


@pytest.mark.parametrize(
    ("make", "options", "method", "why"),
    [
        (lambda: built_in("tennis_racket"), {}, "dop853", "tight"),
        (lambda: built_in("tennis_racket"), {"step": 1e-2}, "rk4", "fixed step"),
        (lambda: built_in("tennis_racket"), {"rtol": 1e-4}, "dopri5", "loose"),
        (lambda: built_in("bricard"), {}, "dop853", "tight"),
        (lambda: built_in("bricard"), {"step": 1e-3}, "rk4", "fixed step"),
        (lambda: pg.Model.serial(1000), {"t_end": 0.01}, "dop853", "tight"),
        (lambda: on_ground(ball(place=(0, 0, 0.3))), {}, "moreau_jean", "rigid contacts"),
        (lambda: stiff_pendulum(1e12)[0], {}, "radau5", "1e+06/s"),
        (lambda: stiff_pendulum(1e12)[0], {"step": 1e-2}, "radau5", "1e+06/s"),
        (lambda: stiff_pendulum(1e4)[0], {"step": 1e-3}, "rk4", "fixed step"),
        (damper, {}, "radau5", "radau5"),
    ],
)
def test_auto_chooses_a_method_that_suits_and_gives_the_reason(make, options, method, why):
    run = pg.simulate(make(), frames=11, **({"t_end": 0.2} | options))
    assert run.status.ok, run.message
    assert why in run.header["why"]
    assert run.header["method"] == method
    assert run.counters["steps"] < 3000
    assert run.error_estimate < (1e-2 if method == "moreau_jean" else 1e-3)


@pytest.mark.parametrize("method", ["rk4", "gauss6"])
@pytest.mark.parametrize(
    ("drive", "begins", "facts"),
    [
        ({"stiffness": 3948.0, "damping": 2.0}, "too wide:", ["62.8 rad/s", "0.004 s"]),
        ({"stiffness": 3948.0, "damping": 5000.0}, "stiff:", ["radau5"]),
    ],
)
def test_a_notice_names_the_rate_that_is_too_fast_for_a_step(method, drive, begins, facts):
    """A spring of 10 Hz needs a smaller step, a fast damper a stiff method."""
    slider = pg.Body(name="x", joint="prismatic", axes=(1, 0, 0), mass=1.0, q=0.1, **drive)
    model = pg.Model(bodies=[slider], gravity=(0, 0, 0))
    options = {"t_end": 2.0, "step": 0.05, "method": method, "estimate": False}
    notice = next(n for n in pg.simulate(model, **options).notices if n.startswith(begins))
    assert all(fact in notice for fact in facts)


def excited(k):
    mech, q = stiff_pendulum(k)
    return mech, q + np.array([0.0, 1e-6])


@pytest.mark.parametrize("method", ["rk4", "semi_implicit_euler", "dopri5", "dop853"])
def test_an_explicit_method_that_blows_up_keeps_what_it_has(method):
    mech, q = excited(1e8)
    run = pg.simulate(mech, q, t_end=1.0, method=method, step=5e-3)
    assert run.status is pg.Status.NOT_FINITE
    assert 0 < run.t[-1] < 0.5
    assert np.isfinite(run.q).all()
    assert len(run.q) == len(run.t) == len(run.energy)
    assert all(fact in run.message for fact in ("t = ", "body 'a'", "fastest rate", "radau5"))
    (advised,) = re.findall(r"try a step of (\S+) s", run.message)
    assert float(advised) == pytest.approx(METHODS[method].limit * 0.7e-4, rel=0.6)
    again = pg.simulate(mech, q, t_end=0.1, method=method, step=float(advised), estimate=False)
    assert again.status.ok
    assert any("radau5" in notice for notice in run.notices)


def test_steps_too_wide_for_newtons_method_are_divided_with_a_notice():
    q = np.array([2.5, 1.0])
    run = pg.simulate(double_pendulum(), q, t_end=20.0, method="radau5", step=2.0)
    assert run.status.ok
    assert any("steps of 2 s" in notice for notice in run.notices)


@pytest.mark.parametrize("method", ["dopri5", "dop853", "radau5"])
def test_a_step_below_the_resolution_of_time_ends_the_run(method):
    """A torque that grows without bound towards t = 0.3."""
    mech = pg.Mechanism(pg.Model(bodies=(mass("a"),), **DOWN))

    def torque(t, q, v):
        return np.array([1.0 / max(0.3 - t, 0.0) ** 2 if t < 0.3 else np.nan])

    run = pg.simulate(mech, t_end=1.0, method=method, rtol=1e-6, tau=torque, max_steps=20_000)
    assert not run.status.ok
    assert 0.29 < run.t[-1] <= 0.3 + 1e-12
    assert np.isfinite(run.q).all()
    assert "body 'a'" in run.message


def test_too_many_steps_are_named():
    run = pg.simulate(excited(1e8)[0], excited(1e8)[1], t_end=1.0, method="dop853", max_steps=100)
    assert run.status is pg.Status.TOO_MANY_STEPS
    assert run.counters["steps"] + run.counters["rejected_steps"] == 100
    assert all(fact in run.message for fact in ("max_steps", "rtol", "radau5"))
