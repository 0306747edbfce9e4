"""Back ends: three ways to the same numbers, through one API (checklist C10)."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

import pgraph_core as pg

from .trees import random_case, scaled_error

seeds = st.integers(0, 2**32 - 1)
ROUNDING = 1e-12  # relative: sums over at most 12 bodies
OTHERS = ("composite", "operators")


@given(seeds)
@settings(max_examples=100)
def test_mass_matrix_bias_and_inverse_dynamics_are_the_same(seed):
    s = random_case(seed)
    mech = pg.Mechanism(s.model)
    for back_end in OTHERS:
        found, expected = (
            (
                mech.mass_matrix(s.q, **choice),
                mech.bias_force(s.q, s.v, **choice),
                mech.inverse_dynamics(s.q, s.v, s.vdot, s.external, **choice),
            )
            for choice in ({"back_end": back_end}, {})
        )
        assert max(map(scaled_error, found, expected)) < ROUNDING


@given(seeds)
@settings(max_examples=100)
def test_forward_dynamics_is_the_same(seed):
    """As closely as the condition of M lets accelerations be known."""
    s = random_case(seed)
    mech = pg.Mechanism(s.model)
    condition = np.linalg.cond(mech.mass_matrix(s.q)) if mech.nv else 1.0
    for external in (None, s.external):
        expected = mech.forward_dynamics(s.q, s.v, s.tau, external)
        for back_end in OTHERS:
            found = mech.forward_dynamics(s.q, s.v, s.tau, external, back_end=back_end)
            assert scaled_error(found, expected) < ROUNDING + 1e-15 * condition


@pytest.mark.parametrize("back_end", OTHERS)
def test_springs_and_dampers_act_in_every_back_end(back_end):
    model = pg.Model.serial(4).edit("2", stiffness=30.0, damping=0.4, rest=0.1, friction=0.2)
    mech = pg.Mechanism(model)
    rng = np.random.default_rng(0)
    q, v, tau = rng.normal(size=(3, 4))
    found = mech.forward_dynamics(q, v, tau, back_end=back_end)
    assert scaled_error(found, mech.forward_dynamics(q, v, tau)) < ROUNDING
    torque = mech.inverse_dynamics(q, v, found, back_end=back_end)
    assert scaled_error(torque, tau) < 1e-11


def test_the_factor_of_a_long_chain_keeps_its_digits():
    """A chain is where M is dense and worst conditioned: 200 links, compared as torques."""
    mech = pg.Mechanism(pg.Model.serial(200))
    rng = np.random.default_rng(1)
    q, v, tau = rng.normal(size=(3, 200)) * 0.3
    vdot = mech.forward_dynamics(q, v, tau, back_end="composite")
    load = abs(mech.mass_matrix(q)) @ abs(vdot)
    assert max(abs(mech.inverse_dynamics(q, v, vdot) - tau) / load) < 1e-14


@pytest.mark.parametrize("back_end", ["articulated", *OTHERS])
def test_every_back_end_names_a_joint_that_moves_no_inertia(back_end):
    still = pg.Body(name="needle", parent="arm", mass=0.0, inertia=np.zeros((3, 3)))
    mech = pg.Mechanism(pg.Model(bodies=(pg.Body(name="arm"), still)))
    with pytest.raises(
        pg.InputError, match=r"body 'needle', inertia: .* give it mass, inertia or armature"
    ):
        mech.forward_dynamics(*mech.home(), back_end=back_end)


@pytest.mark.parametrize("back_end", ["articulated", *OTHERS])
def test_every_back_end_refuses_numbers_that_are_not_finite(back_end):
    mech = pg.Mechanism(pg.Model.serial(2))
    q, v = mech.home()
    with pytest.raises(pg.InputError, match="v: must be finite; entry 1 is nan"):
        mech.forward_dynamics(q, np.array([0.0, np.nan]), back_end=back_end)
    with pytest.raises(pg.InputError, match="q: must have shape"):
        mech.forward_dynamics(q[:1], v, back_end=back_end)


def test_an_unknown_back_end_is_refused_with_the_choices():
    mech = pg.Mechanism(pg.Model.serial(2))
    q, v = mech.home()
    sentence = "back_end: is 'aba'; choose one of articulated, composite, operators"
    for call in (
        lambda: mech.mass_matrix(q, back_end="aba"),
        lambda: mech.bias_force(q, v, back_end="aba"),
        lambda: mech.inverse_dynamics(q, v, v, back_end="aba"),
        lambda: mech.forward_dynamics(q, v, back_end="aba"),
    ):
        with pytest.raises(pg.InputError) as caught:
            call()
        assert str(caught.value) == sentence


# -- wrenches at points and tips -----------------------------------------------------------------


@given(seeds)
@settings(max_examples=50)
def test_wrenches_on_tips_enter_as_j_transposed_f_t(seed):
    """τ = M θ'' + C + Jᵀ F_T, eq. (24), F_T from the tips, and θ'' of eq. (26) with it."""
    s = random_case(seed)
    mech = pg.Mechanism(s.model)
    F_T = np.random.default_rng(seed).normal(0, 3, (len(mech.tips), 6))
    external = mech.external_at_tips(s.q, -F_T)
    load = mech.tip_jacobian(s.q).T @ F_T.reshape(-1)
    tau = mech.mass_matrix(s.q) @ s.vdot + mech.bias_force(s.q, s.v) + load
    assert scaled_error(mech.inverse_dynamics(s.q, s.v, s.vdot, external), tau) < ROUNDING
    condition = np.linalg.cond(mech.mass_matrix(s.q)) if mech.nv else 1.0
    found = mech.forward_dynamics(s.q, s.v, s.tau, external)
    expected = mech.forward_dynamics(s.q, s.v, s.tau - load)
    assert scaled_error(found, expected) < ROUNDING + 1e-15 * condition


@given(seeds)
@settings(max_examples=50)
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
    assert np.array_equal(mech.external_at(q, "3", wrench), mech.external_at_tips(q, wrench[None]))
    assert not mech.external_at(q, "ground", wrench).any()
    with pytest.raises(pg.InputError, match=r"wrench: must have shape \(6,\); given \(3,\)"):
        mech.external_at(q, "3", [1, 2, 3])
    with pytest.raises(pg.InputError, match=r"wrench: must have shape \(1, 6\); given \(6,\)"):
        mech.external_at_tips(q, wrench)
