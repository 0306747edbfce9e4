"""The paper's operators: structure, and the laws that tie them together."""

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

import pgraph_core as pg
from pgraph_core.paper import Operators, home_poses, kernel_operator_of_pgraph, phi
from pgraph_core.paper import propagation_operator as propagation

from .trees import moved, random_case, scaled_error

pytestmark = pytest.mark.quick

seeds = st.integers(0, 2**32 - 1)
ROUNDING = 1e-12  # relative: sums over paths of at most 12 bodies


def random_operators(seed, **options):
    s = random_case(seed, **options)
    return s, Operators(s.model, s.topology, s.q, s.v)


def pattern(matrix):
    nb = matrix.shape[0] // 6
    return abs(matrix.toarray()).reshape(nb, 6, nb, 6).sum(axis=(1, 3)) > 0


def test_fig_1_adjacency_and_kernel_operator():
    model = pg.Model.serial(7).edit("4", parent="2").edit("5", parent="3").edit("6", parent="2")
    topology = pg.Topology.of(model)
    op = Operators(model, topology, np.zeros(7))
    S = topology.adjacency().toarray()
    children = [(2, 1), (3, 2), (4, 2), (5, 3), (6, 2), (7, 6)]  # eq. (3)
    assert sorted(zip(*np.nonzero(S))) == sorted((k - 1, j - 1) for k, j in children)
    assert np.array_equal(pattern(op.eps_phi), S > 0)  # eq. (15)


@given(seeds)
@settings(max_examples=40)
def test_kernel_operator_is_the_weighted_adjacency(seed):
    """Eq. (15), and made from Pgraph alone as in fig. 6."""
    s, op = random_operators(seed)
    found = kernel_operator_of_pgraph(s.topology.pgraph, op.link)
    assert np.array_equal(found.toarray(), op.eps_phi.toarray())
    S = s.topology.adjacency().toarray()
    assert np.array_equal(pattern(op.eps_phi), S > 0)
    assert not np.linalg.matrix_power(S, s.topology.nb).any()
    assert np.array_equal(np.flatnonzero(~S.any(axis=0)) + 1, s.topology.tips)
    for k, j in zip(*np.nonzero(S)):
        block = op.eps_phi.toarray()[6 * k : 6 * k + 6, 6 * j : 6 * j + 6]
        assert np.array_equal(block, phi(op.link[k]))


@given(seeds)
@settings(max_examples=40)
def test_propagation_operator_inverts_one_minus_kernel_operator(seed):
    s, op = random_operators(seed)
    one = np.eye(6 * s.topology.nb)
    assert scaled_error((one - op.eps_phi.toarray()) @ op.Phi.toarray(), one) < ROUNDING
    ancestors = np.linalg.inv(np.eye(s.topology.nb) - s.topology.adjacency().toarray()) > 0.5
    assert np.array_equal(pattern(op.Phi), ancestors)


def test_propagation_operator_of_a_long_chain_is_the_sum_of_links():
    link = np.tile([0.1, -0.2, 0.3], (200, 1))
    Phi = propagation(np.arange(200), link)
    found = Phi[-6:, :6].toarray()
    assert scaled_error(found, phi(link[1:].sum(axis=0))) < ROUNDING


@given(seeds)
@settings(max_examples=20)
def test_velocity_and_acceleration_are_derivatives_of_the_poses(seed):
    """Eqs. (17), (21) with a of R4 hold for every joint kind, by central differences of 1e-4 s."""
    (s, op), h = random_operators(seed, most=6), 1e-4
    q_end = [moved(s.model, s.q, step * s.v + step**2 / 2 * s.vdot) for step in (-h, h)]
    ends = zip(q_end, (s.v - h * s.vdot, s.v + h * s.vdot))
    before, after = (Operators(s.model, s.topology, q, v) for q, v in ends)
    V = op.V.reshape(-1, 6)
    assert scaled_error((after.position - before.position) / (2 * h), V[:, 3:]) < 1e-5
    turned = (after.rotation - before.rotation) / (2 * h) @ op.rotation.transpose(0, 2, 1)
    omega = np.stack((turned[:, 2, 1], turned[:, 0, 2], turned[:, 1, 0]), axis=1)
    assert scaled_error(omega, V[:, :3]) < 1e-5
    assert scaled_error((after.V - before.V) / (2 * h), op.acceleration(s.vdot)) < 1e-5


@given(seeds)
@settings(max_examples=12)
def test_jacobian_is_the_derivative_of_the_tips(seed):
    (s, op), h = random_operators(seed, most=8), 1e-6
    J = op.jacobian
    tips = s.topology.tips

    def places(q):
        at = Operators(s.model, s.topology, q)
        return [at.point_position(k, at.bodies[k - 1].tip_point) for k in tips]

    for i, step in enumerate(h * np.eye(op.nv)):
        ahead, back = places(moved(s.model, s.q, step)), places(moved(s.model, s.q, -step))
        for n in range(len(tips)):
            found = (ahead[n] - back[n]) / (2 * h)
            np.testing.assert_allclose(found, J[6 * n + 3 : 6 * n + 6, i], atol=1e-8, rtol=1e-7)


@given(seeds)
@settings(max_examples=40)
def test_inverse_dynamics_is_linear_in_the_acceleration(seed):
    """Eq. (24): τ = M θ'' + C, and external forces enter by Jᵀ."""
    s, op = random_operators(seed)
    tau = op.mass_matrix @ s.vdot + op.bias_force
    pull = (op.Phi @ op.H).T @ s.external.reshape(-1)
    assert scaled_error(op.inverse_dynamics(s.vdot), tau) < ROUNDING
    assert scaled_error(op.inverse_dynamics(s.vdot, s.external), tau - pull) < ROUNDING


def test_root_force_carries_the_weight_of_a_body_at_rest():
    body = pg.Body(name="a", dof=0, mass=2.0, com=(0.3, 0, 0))
    model = pg.Model(bodies=(body,))
    op = Operators(model, pg.Topology.of(model), np.zeros(0))
    np.testing.assert_allclose(op.joint_force(np.zeros(0)), [0, -0.3 * 19.62, 0, 0, 0, 19.62])


def test_home_poses_are_those_of_the_initial_state():
    body = pg.Body(name="a", q=(np.pi / 2,), link=(1, 0, 0))
    arm = pg.Body(name="b", parent="a", link=(2, 0, 0))
    position, rotation = home_poses(pg.Model(bodies=(body, arm)))
    np.testing.assert_allclose(position, [[1, 0, 0], [1, 2, 0]], atol=1e-15)
    np.testing.assert_allclose(rotation[1] @ [1, 0, 0], [0, 1, 0], atol=1e-15)
