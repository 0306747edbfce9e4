"""Forward dynamics against mpmath at 50 digits, where rounding is hardest on it."""

from __future__ import annotations

import pytest

import pgraph_core as pg
from benchmarks import fifty_digits
from benchmarks.precision_cases import LONG, SHORT, turned


def error(state):
    """Largest error of θ'', relative to the largest θ''; the oracle's own is checked."""
    model, _, q, v, tau, *_ = state
    expected = fifty_digits.forward_dynamics(model, q, v, tau)
    again = fifty_digits.inverse_dynamics(model, q, v, expected)
    assert max(abs(again - tau)) < 1e-30
    found = pg.Mechanism(model).forward_dynamics(q, v, tau)
    return float(max(abs(found - expected)) / max(abs(expected)))


@pytest.mark.parametrize("seed", [0, 1])
@pytest.mark.parametrize("name", SHORT)
def test_forward_dynamics_to_fifty_digits(name, seed):
    """1e-13, or 10 eps x mass ratio where that is larger; else what was measured, with why."""
    case = SHORT[name]
    assert error(case.state(seed)) < case.bound


@pytest.mark.parametrize("name", SHORT)
def test_no_luck_of_the_axes_is_needed(name):
    """The same with the whole and every body frame turned at random."""
    case = SHORT[name]
    assert error(turned(case.state(0), 1)) < case.turned_bound


@pytest.mark.nightly
@pytest.mark.parametrize("name", LONG)
def test_forward_dynamics_of_a_thousand_bodies_to_fifty_digits(name):
    case = LONG[name]
    assert error(case.state(0)) < case.bound
    assert error(turned(case.state(0), 1)) < case.turned_bound
