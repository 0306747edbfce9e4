"""Kernels against the paper's operators, and wrenches at points and tips."""

import numpy as np
from hypothesis import given, settings
from hypothesis import strategies as st

import pgraph_core as pg
from pgraph_core.paper import Operators

from .trees import random_case, scaled_error

seeds = st.integers(0, 2**32 - 1)
ROUNDING = 1e-12  # relative: sums over at most 12 bodies


def known(mech, q):
    return ROUNDING + 1e-15 * (np.linalg.cond(mech.mass_matrix(q)) if mech.nv else 1.0)


@given(seeds)
@settings(max_examples=30)
def test_kernels_and_operators_give_the_same_dynamics(seed):
    s = random_case(seed)
    mech, op = pg.Mechanism(s.model), Operators(s.model, s.topology, s.q, s.v)
    found = (
        mech.mass_matrix(s.q), mech.bias_force(s.q, s.v),
        mech.inverse_dynamics(s.q, s.v, s.vdot, s.external),
    )  # fmt: skip
    expected = op.mass_matrix, op.bias_force, op.inverse_dynamics(s.vdot, s.external)
    assert max(map(scaled_error, found, expected)) < ROUNDING
    for external in (None, s.external):
        found = mech.forward_dynamics(s.q, s.v, s.tau, external)
        assert scaled_error(op.forward_dynamics(s.tau, external), found) < known(mech, s.q)


def test_long_chains_keep_their_digits():
    """A chain of 200 links, where M is dense and worst conditioned, compared as torques."""
    model = pg.Model.serial(200).edit("2", stiffness=30.0, damping=0.4, rest=0.1, friction=0.2)
    mech = pg.Mechanism(model)
    q, v, tau = np.random.default_rng(1).normal(size=(3, 200)) * 0.3
    vdot = mech.forward_dynamics(q, v, tau)
    load = abs(mech.mass_matrix(q)) @ abs(vdot)
    assert max(abs(mech.inverse_dynamics(q, v, vdot) - tau) / load) < 1e-13


@given(seeds)
@settings(max_examples=20)
def test_wrenches_on_tips_enter_as_j_transposed_f_t(seed):
    """τ = M θ'' + C + Jᵀ F_T, eq. (24), F_T from the tips, and θ'' of eq. (26) with it."""
    s = random_case(seed)
    mech = pg.Mechanism(s.model)
    F_T = np.random.default_rng(seed).normal(0, 3, (len(mech.tips), 6))
    tips = zip((mech.names[k - 1] for k in mech.tips), F_T)
    external = sum(mech.external_at(s.q, name, -wrench) for name, wrench in tips)
    load = mech.tip_jacobian(s.q).T @ F_T.reshape(-1)
    tau = mech.mass_matrix(s.q) @ s.vdot + mech.bias_force(s.q, s.v) + load
    assert scaled_error(mech.inverse_dynamics(s.q, s.v, s.vdot, external), tau) < ROUNDING
    found = mech.forward_dynamics(s.q, s.v, s.tau, external)
    expected = mech.forward_dynamics(s.q, s.v, s.tau - load)
    assert scaled_error(found, expected) < known(mech, s.q)


@given(seeds)
@settings(max_examples=20)
def test_a_wrench_at_a_point_works_through_the_jacobian_of_the_point(seed):
    s = random_case(seed)
    mech = pg.Mechanism(s.model)
    rng = np.random.default_rng(seed)
    name, wrench, point = str(rng.choice(mech.names)), rng.normal(size=6), rng.normal(size=3)
    external = mech.external_at(s.q, name, wrench, point)
    expected = mech.bias_force(s.q, s.v) - mech.jacobian(s.q, name, point).T @ wrench
    found = mech.inverse_dynamics(s.q, s.v, 0 * s.v, external)
    assert scaled_error(found, expected) < ROUNDING


def test_a_wrench_without_a_point_acts_at_the_tip():
    mech = pg.Mechanism(pg.Model.serial(3))
    q, _ = mech.home()
    wrench = np.arange(6.0)
    at_tip = mech.external_at(q, "3", wrench, mech.model.body("3").tip_point)
    assert np.array_equal(mech.external_at(q, "3", wrench), at_tip)
    assert not mech.external_at(q, "ground", wrench).any()
