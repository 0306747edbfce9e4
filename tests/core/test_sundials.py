"""IDA of SUNDIALS on a loop: another method and another formulation. See also test_peers."""

import numpy as np
from sksundae.ida import IDA

import pgraph_core as pg

from .test_methods import crank_start, slider_crank, worst


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
