"""Absurd arguments of runs: a sentence names the argument, and what was computed is kept."""

from typing import Any

import numpy as np
import pytest
from numba import njit

import pgraph_core as pg

from ..nights import combined
from ..refusals import assert_problems, refusal

MODEL = pg.Model.serial(2)
FIXED = ("rk4", "semi_implicit_euler", "radau5", "gauss6", "dop853")


@pytest.mark.parametrize("method", FIXED)
@pytest.mark.parametrize("factor", [1.001, 10.0, 1e9])
@pytest.mark.parametrize("t_start", [0.0, 5.0])
def test_a_step_longer_than_the_run_is_named(method, factor, t_start):
    """The run takes one step; the equations of implicit ones may have no solution then."""
    span = 0.02
    options: dict[str, Any] = {"t_start": t_start, "t_end": t_start + span, "estimate": False}
    run = pg.simulate(MODEL, method=method, step=factor * span, **options)
    (told,) = [text for text in run.notices if text.startswith("step: ")]
    assert f"{factor * span:g} s" in told
    assert f"{span:g} s" in told
    assert run.status.ok
    assert len(run.t) == 2
    just = pg.simulate(MODEL, method=method, step=span, **options)
    assert np.abs(just.q - run.q).max() < 1e-14  # 5.02 - 5 is 0.02 but for rounding
    assert not any(text.startswith("step: ") for text in just.notices)


def test_the_step_of_a_scenario_may_be_too_long_too():
    long = pg.Scenario(name="long", t_end=0.1, step=1.0)
    run = pg.simulate(MODEL.replace(scenarios=(long,)), scenario="long")
    assert any(text.startswith("step: 1 s") for text in run.notices)
    widest = pg.simulate(MODEL, t_end=0.1, step=10.0, rtol=1e-8)  # a bound of chosen steps
    assert not widest.notices


@pytest.mark.parametrize(
    ("rtol", "text"),
    [(0, "0"), (0.0, "0.0"), (1, "1"), (1.0, "1"), (-1e-6, "-1e-06"), (1e-17, "1e-17"),
     (np.nan, "nan"), (np.inf, "inf"), (True, "True"), ("1e-6", "'1e-6'")],
)  # fmt: skip
@pytest.mark.parametrize("method", ["auto", "dop853", "radau5"])
def test_a_tolerance_of_nothing_or_of_all_is_refused(rtol, text, method):
    error = refusal(lambda: pg.simulate(MODEL, t_end=0.1, rtol=rtol, method=method), pg.InputError)
    assert_problems(error.problems, [("simulate, rtol", f"got {text}")])


TWICE = ((0.0, 1.0, 1.0, 2.0), (0.0, 0.0), (0.0, 2.0, 1.0))


@pytest.mark.parametrize("times", TWICE)
@pytest.mark.parametrize(
    "part",
    [
        lambda table: pg.Motor(name="a", body="1", torque=table),
        lambda table: pg.Servo(name="a", body="1", kp=1.0, target=table),
        lambda table: pg.Motion(name="a", body="1", q_of_t=table),
        lambda table: pg.simulate(
            MODEL.add(pg.Motor(name="a", body="1")), t_end=0.1, inputs={"a": table}
        ),
    ],
)
def test_tables_with_equal_times_are_refused(part, times):
    table = {"t": times, "value": tuple(range(len(times)))}
    (problem,) = refusal(lambda: part(table), pg.PgraphError).problems
    assert "ascend" in problem.text
    assert str(list(times)) in problem.text


def test_times_that_differ_by_rounding_are_two():
    table = {"t": (0.0, 0.05, np.nextafter(0.05, 1.0), 0.1), "value": (0.0, 1.0, 2.0, 0.0)}
    run = pg.simulate(MODEL.add(pg.Motor(name="a", body="1", torque=table)), t_end=0.1)
    assert run.status.ok
    assert np.isfinite(run.error_estimate)


def python(bad):
    return lambda t, q, v: np.array([0.1, bad if t > 0.05 else 0.1])


def compiled(bad):
    return njit(lambda t, q, v: np.array([0.1, bad if t > 0.05 else 0.1]))


LIMITED = MODEL.edit("2", limits=(-0.01, 0.01))
WAYS = ("auto", "dopri5", *FIXED)
WITHOUT_LIMITS = ("gauss6", "radau5")  # methods that take none
FAILING = [(MODEL, method) for method in WAYS] + [
    (LIMITED, method) for method in WAYS if method not in WITHOUT_LIMITS
]


@pytest.mark.parametrize(
    ("failing", "bad", "made"), combined(FAILING, [np.nan, np.inf], [python, compiled])
)
def test_a_torque_that_stops_being_finite_ends_the_run_there(failing, bad, made):
    model, method = failing
    chosen = method in ("auto", "dopri5", "dop853", "radau5")
    step: dict[str, Any] = {} if chosen else {"step": 1e-3}
    good = pg.simulate(model, t_end=0.05, frames=51, method=method, tau=python(0.1), **step)
    run = pg.simulate(model, t_end=0.1, frames=101, method=method, tau=made(bad), **step)
    assert not run.status.ok
    assert "tau" in run.message
    assert "finite" in run.message
    assert 0.048 < run.t[-1] <= 0.051
    assert np.isfinite(run.q).all()
    n = min(len(run.t) - 1, len(good.t))
    assert np.abs(run.q[:n] - good.q[:n]).max() < 1e-6


@pytest.mark.parametrize("made", [python, compiled])
def test_a_torque_that_is_not_finite_for_a_moment_is_not_blamed_later(made):
    """A run by an adaptive method survives what a narrower step does not meet."""
    run = pg.simulate(MODEL, t_end=0.1, tau=made(0.1), max_steps=1)
    assert not run.status.ok
    assert "tau" not in run.message


def test_a_stepper_whose_torque_stops_being_finite_says_so():
    stepper = pg.Stepper(MODEL, step=1e-2, tau=python(np.nan))
    while stepper.status.ok or stepper.status is pg.Status.DONE:
        stepper.step()
    assert "tau" in stepper.message
    assert 0.04 < stepper.t < 0.07
    assert np.isfinite(stepper.q).all()


@pytest.mark.parametrize("options", [
    {"frames": 10**9}, {"frames": 1e9}, {"t_eval": np.broadcast_to(1.0, (10**9,))},
    {"step": 1e-10}, {"max_steps": 0},
])  # fmt: skip
def test_absurd_numbers_of_frames_and_steps_are_refused_at_once(options):
    (name,) = options
    (problem,) = refusal(lambda: pg.simulate(MODEL, t_end=1.0, **options), pg.InputError).problems
    assert (problem.where, problem.field) == ("simulate", name)
    assert any(sign in problem.text for sign in ("at most", "or more", "whole number"))
