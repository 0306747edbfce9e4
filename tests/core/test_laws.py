"""Laws of mechanics that the mechanism obeys, whatever the tree."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import example, given, settings
from hypothesis import strategies as st

import pgraph_core as pg

from .trees import moved, random_case, scaled_error

pytestmark = pytest.mark.quick

seeds = st.integers(0, 2**32 - 1)
ROUNDING = 1e-12


def mechanism(seed, **options):
    """A random state, and its mechanism."""
    s = random_case(seed, **options)
    return s, pg.Mechanism(s.model)


@given(seeds)
@settings(max_examples=40)
def test_mass_matrix_is_positive_definite_and_gives_the_kinetic_energy(seed):
    s, mech = mechanism(seed)
    M = mech.mass_matrix(s.q)
    assert mech.energy(s.q, s.v)[0] == pytest.approx(s.v @ M @ s.v / 2, rel=1e-12)
    assert scaled_error(M.T, M) < ROUNDING
    assert not mech.nv or np.linalg.eigvalsh(M)[0] > 0


@given(seeds)
@settings(max_examples=40)
def test_torque_is_linear_in_acceleration_with_slope_M(seed):
    s, mech = mechanism(seed)
    M, bias = mech.mass_matrix(s.q), mech.bias_force(s.q, s.v)
    slope = [mech.inverse_dynamics(s.q, s.v, unit) - bias for unit in np.eye(mech.nv)]
    scale = max(1.0, abs(bias).max(initial=0.0))
    assert abs(np.array(slope).reshape(M.shape).T - M).max(initial=0.0) < ROUNDING * scale


@given(seeds)
@settings(max_examples=40)
def test_inverse_dynamics_of_forward_dynamics_is_the_torque(seed):
    s, mech = mechanism(seed)
    vdot = mech.forward_dynamics(s.q, s.v, s.tau, s.external)
    tau = mech.inverse_dynamics(s.q, s.v, vdot, s.external)
    size = abs(mech.mass_matrix(s.q)).max(initial=1.0) * abs(vdot).max(initial=1.0)
    assert abs(tau - s.tau).max(initial=0.0) < ROUNDING * max(100.0, size)


@given(seeds)
@settings(max_examples=40)
@example(3755866)  # v' of 1e7: a fixed step is too long
def test_power_of_the_torques_is_the_rate_of_energy(seed):
    """dE/dt = τ·v along the motion, by central differences."""
    s, mech = mechanism(seed, most=8)
    vdot = mech.forward_dynamics(s.q, s.v, s.tau)
    h = min(1e-4, 1e-2 / abs(vdot).max(initial=1.0))  # v changes little within it

    def energy(t):
        q = moved(s.model, s.q, t * s.v + t * t / 2 * vdot)
        return sum(mech.energy(q, s.v + t * vdot))

    rates = [(energy(h) - energy(-h)) / (2 * h), (energy(h / 2) - energy(-h / 2)) / h]
    rate = (4 * rates[1] - rates[0]) / 3
    scale = 1 + abs(s.tau @ s.v) + abs(s.v) @ abs(mech.mass_matrix(s.q)) @ abs(vdot)
    assert abs(rate - s.tau @ s.v) < 1e-6 * scale


@given(seeds)
@settings(max_examples=40)
def test_jacobian_is_the_derivative_of_a_point(seed):
    s, mech = mechanism(seed, most=8)
    h, name = 1e-6, mech.names[-1]
    point = np.array([0.2, -0.1, 0.4])

    def place(q):
        position, rotation = mech.pose(q, name)
        return position + rotation @ point

    J = mech.jacobian(s.q, name, point)
    for i, step in enumerate(h * np.eye(mech.nv)):
        ahead, back = (place(moved(s.model, s.q, sign * step)) for sign in (1, -1))
        np.testing.assert_allclose((ahead - back) / (2 * h), J[3:, i], rtol=1e-7, atol=1e-8)


def test_free_fall_has_the_acceleration_of_gravity_whatever_the_tree():
    """A free tree without velocity falls as one: no joint moves."""
    rng = np.random.default_rng(1)
    s = random_case(1, kinds=("revolute", "prismatic", "spherical"), most=10)
    root = pg.Body(name="root", joint="free", q=(0, 0, 0, 1, 0, 0, 0), link=rng.normal(size=3))
    bodies = [b.model_copy(update={"parent": "root"}) if b.parent == "ground" else b
              for b in s.model.bodies]  # fmt: skip
    mech = pg.Mechanism(s.model.replace(bodies=(root, *bodies)))
    q = np.concatenate((root.q, s.q))
    vdot = mech.forward_dynamics(q, np.zeros(mech.nv))
    np.testing.assert_allclose(vdot[3:6], s.model.gravity, rtol=1e-12)
    assert abs(np.delete(vdot, [3, 4, 5])).max() < 1e-11
