"""CVODE and IDA of SUNDIALS find the same motions: other methods, other formulations."""

from __future__ import annotations

import numpy as np
import pytest
from sksundae.cvode import CVODE
from sksundae.ida import IDA

import pgraph_core as pg
import pgraph_models

from .test_methods import crank_start, double_pendulum, slider_crank, stiff_pendulum, worst

TIGHT = {"rtol": 1e-11, "atol": 1e-13, "max_num_steps": 100_000}


def by_cvode(mech, q, v, t, method):
    """q (n, nq) by backward differences or Adams' formulas; joints of one motion only."""
    n = mech.nq

    def rates(_, y, yp):
        yp[:n] = y[n:]
        yp[n:] = mech.forward_dynamics(y[:n].copy(), y[n:].copy())

    found = CVODE(rates, method=method, **TIGHT).solve(t, np.concatenate((q, v)))
    assert found.success, found.message
    return found.y[:, :n]


def test_a_double_pendulum_by_adams_formulas():
    mech, q, t = double_pendulum(), np.array([1.5, 0.5]), np.linspace(0.0, 2.0, 21)
    ours = pg.simulate(mech, q, t_end=2.0, t_eval=t, method="dop853", rtol=1e-12)
    assert worst(by_cvode(mech, q, np.zeros(2), t, "Adams"), ours.q) < 1e-8


@pytest.mark.parametrize("k", [1e4, 1e6])
def test_a_stiff_pendulum_by_backward_differences(k):
    mech, q = stiff_pendulum(k)
    t = np.linspace(0.0, 0.5, 11)
    ours = pg.simulate(mech, q, t_end=0.5, t_eval=t, method="radau5", rtol=1e-9)
    assert worst(by_cvode(mech, q, np.zeros(2), t, "BDF")[:, 0], ours.q[:, 0]) < 1e-7


def test_a_loop_as_differential_algebraic_equations():
    """q' = v, M v' + C = τ + Jᵀλ, J v' + J'v = 0: λ as unknowns, no Delassus matrix."""
    mech, q, tau = slider_crank(), crank_start(), np.array([4.0, 0, 0])
    t = np.linspace(0.0, 0.3, 7)

    def rows(q):
        tip = mech.jacobian(q, "rod", point=(0.5, 0, 0))
        return (tip - mech.jacobian(q, "slider"))[3:5]

    def turning(q, v):
        tip = mech.jacobian_bias(q, v, "rod", point=(0.5, 0, 0))
        return (tip - mech.jacobian_bias(q, v, "slider"))[3:5]

    def residual(_, y, yp, out):
        q, v, lam = y[:3].copy(), y[3:6].copy(), y[6:]
        J = rows(q)
        out[:3] = yp[:3] - v
        out[3:6] = mech.mass_matrix(q) @ yp[3:6] + mech.bias_force(q, v) - tau - J.T @ lam
        out[6:] = J @ yp[3:6] + turning(q, v)

    vdot, force = mech.constrained_dynamics(q, np.zeros(3), tau)
    y, yp = np.zeros(8), np.zeros(8)
    y[:3], y[6:], yp[3:6] = q, force["pin"][3:5], vdot
    ida = IDA(residual, algebraic_idx=[6, 7], rtol=1e-9, atol=1e-10, max_num_steps=100_000)
    found = ida.solve(t, y, yp)
    assert found.success, found.message
    ours = pg.simulate(mech, q, t_end=0.3, t_eval=t, method="dop853", rtol=1e-11, tau=tau)
    assert worst(found.y[:, :3], ours.q) < 1e-7
    assert worst(found.y[1:, 6:], ours.constraint_force["pin"][1:, 3:5]) < 1e-5


def test_the_reference_of_a_case_is_theirs_too():
    (case,) = pgraph_models.cases("a01_simple_pendulum")
    mech = pg.Mechanism(case.model)
    found = by_cvode(mech, *mech.home(), case.t, "Adams")
    expected = case.observables[0].reference[:, 0]
    assert worst(np.sin(found[:, 0]), expected) < 1e-8
