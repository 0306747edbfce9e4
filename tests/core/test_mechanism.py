"""The kernels against the paper's operators, and laws that every tree obeys."""

import sys
from concurrent.futures import ThreadPoolExecutor

import numpy as np
import pytest
from hypothesis import example, given, settings
from hypothesis import strategies as st

import pgraph_core as pg
from pgraph_core.paper import Operators

from .trees import moved, random_case, scaled_error, with_joints

pytestmark = pytest.mark.quick

seeds = st.integers(0, 2**32 - 1)
ROUNDING = 1e-12  # relative: sums over at most 12 bodies


def both(seed, **options):
    s = random_case(seed, **options)
    return s, pg.Mechanism(s.model), Operators(s.model, s.topology, s.q, s.v)


@given(seeds)
@settings(max_examples=60)
def test_inverse_dynamics_equals_eqs_22_to_25(seed):
    s, mech, op = both(seed)
    assert scaled_error(mech.mass_matrix(s.q), op.mass_matrix) < ROUNDING
    assert scaled_error(mech.bias_force(s.q, s.v), op.bias_force) < ROUNDING
    found = mech.inverse_dynamics(s.q, s.v, s.vdot, s.external)
    assert scaled_error(found, op.inverse_dynamics(s.vdot, s.external)) < ROUNDING


@given(seeds)
@settings(max_examples=60)
def test_forward_dynamics_equals_eq_26(seed):
    """Compared as torques, and as accelerations as closely as M's condition lets them be known."""
    s, mech, op = both(seed)
    for external in (None, s.external):
        found = mech.forward_dynamics(s.q, s.v, s.tau, external)
        expected = op.forward_dynamics(s.tau, external)
        condition = np.linalg.cond(op.mass_matrix) if op.nv else 1.0
        assert scaled_error(found, expected) < ROUNDING + 1e-15 * condition
        tau = op.inverse_dynamics(found, external)
        assert abs(tau - s.tau).max(initial=0.0) < ROUNDING * load(op, found, external)


def load(op, vdot, external):
    """The largest force that is summed up in τ, times the longest path: the scale of rounding."""
    force = abs(op.joint_force(vdot, external)).max(initial=1.0)
    reach = 1 + abs(op.position).max(initial=1.0)
    return max(1.0, force * reach, abs(op.mass_matrix).max() * abs(vdot).max(initial=0.0))


@given(seeds)
@settings(max_examples=30)
def test_poses_and_jacobians_equal_eq_20(seed):
    s, mech, op = both(seed)
    assert scaled_error(mech.tip_jacobian(s.q), op.jacobian) < ROUNDING
    point = np.array([0.3, -0.2, 0.5])
    for k, name in enumerate(mech.names, start=1):
        assert scaled_error(mech.jacobian(s.q, name, point), op.point_jacobian(k, point)) < ROUNDING
        position, rotation = mech.pose(s.q, name)
        assert scaled_error(position, op.position[k - 1]) < ROUNDING
        assert scaled_error(rotation, op.rotation[k - 1]) < ROUNDING


@given(seeds)
@settings(max_examples=20)
def test_operators_of_a_mechanism_are_the_paper_s(seed):
    s, mech, op = both(seed)
    assert np.array_equal(mech.adjacency().toarray(), s.topology.adjacency().toarray())
    assert np.array_equal(mech.kernel_operator(s.q).toarray(), op.eps_phi.toarray())
    assert np.array_equal(mech.propagation_operator(s.q).toarray(), op.Phi.toarray())


@given(seeds)
@settings(max_examples=20)
def test_springs_and_dampers_of_joints_act_in_forward_and_inverse_dynamics(seed):
    s = random_case(seed, kinds=("revolute", "prismatic", "cylindrical", "universal"))
    rng = np.random.default_rng(seed)
    nv = len(s.v)
    stiffness, damping, rest = rng.uniform(0, 9, (3, nv))
    model = with_joints(s, stiffness=stiffness, damping=damping, rest=rest)
    spring = stiffness * (rest - s.q) - damping * s.v
    op, mech = Operators(s.model, s.topology, s.q, s.v), pg.Mechanism(model)
    expected = op.forward_dynamics(s.tau + spring)
    found = mech.forward_dynamics(s.q, s.v, s.tau)
    assert scaled_error(found, expected) < ROUNDING + 1e-15 * np.linalg.cond(op.mass_matrix)
    expected = op.inverse_dynamics(s.vdot) - spring
    assert scaled_error(mech.inverse_dynamics(s.q, s.v, s.vdot), expected) < ROUNDING
    assert scaled_error(mech.bias_force(s.q, s.v), op.bias_force) < ROUNDING


def test_a_welded_load_is_the_same_as_one_rigid_body():
    """Two half rods welded end to end, turned a quarter, swing as one rod of twice the length."""
    thin = ((1e-4, 0, 0), (0, 0.01, 0), (0, 0, 0.01))
    half = pg.Body(name="a", axes=((0, 1, 0),), com=(0.25, 0, 0), inertia=thin)
    turned = (np.sqrt(0.5), 0, 0, np.sqrt(0.5))
    load = pg.Body(  # whose x lies along y of the rod, so it is 0.25 m further along the rod
        name="b", parent="a", dof=0, link=(0.5, 0, 0), rotation=turned, com=(0, -0.25, 0),
        inertia=((0.01, 0, 0), (0, 1e-4, 0), (0, 0, 0.01)),
    )  # fmt: skip
    inertia = 2 * np.array(thin) + 2 * 0.25**2 * np.diag([0, 1, 1])
    whole = pg.Body(name="a", axes=((0, 1, 0),), mass=2.0, com=(0.5, 0, 0), inertia=inertia)
    two, one = (pg.Mechanism(pg.Model(bodies=b)) for b in ((half, load), (whole,)))
    assert (two.nb, two.nv) == (2, 1)
    q, v = np.array([0.3]), np.array([2.0])
    for name, state in (
        ("mass_matrix", (q,)),
        ("bias_force", (q, v)),
        ("forward_dynamics", (q, v)),
    ):
        found, expected = (getattr(mech, name)(*state) for mech in (two, one))
        assert found == pytest.approx(expected, rel=1e-14)


def test_a_later_call_does_not_change_an_earlier_answer():
    s, mech, _ = both(3)
    answers = [mech.mass_matrix(s.q), mech.forward_dynamics(s.q, s.v), mech.tip_jacobian(s.q)]
    copies = [answer.copy() for answer in answers]
    mech.mass_matrix(mech.home()[0])
    mech.forward_dynamics(s.q, 2 * s.v)
    mech.tip_jacobian(mech.home()[0])
    assert all(np.array_equal(a, b) for a, b in zip(answers, copies))


def test_threads_may_share_a_mechanism_and_its_edits():
    """Springs and given torques pass through one workspace: no call may see another's numbers."""
    mech = pg.Mechanism(pg.Model.serial(6).edit("1", stiffness=(3.0,), damping=(0.1,)))
    mechs = [mech, mech.edit(mech.names[2], mass=2.0)]
    rng = np.random.default_rng(0)
    states = [(mechs[i % 2], *rng.normal(size=(3, mech.nv))) for i in range(40)]

    def answers(state):
        m, q, v, tau = state
        return [
            *(m.forward_dynamics(q, v, tau), m.inverse_dynamics(q, v, tau)),
            *(m.mass_matrix(q), m.jacobian(q, m.names[-1]), m.constrained_dynamics(q, v, tau)[0]),
        ]

    alone = [answers(state) for state in states]
    interval = sys.getswitchinterval()
    sys.setswitchinterval(1e-6)
    try:
        with ThreadPoolExecutor(4) as pool:
            for mine, found in zip(100 * alone, pool.map(answers, 100 * states)):
                assert all(map(np.array_equal, mine, found))
    finally:
        sys.setswitchinterval(interval)


@given(seeds)
@settings(max_examples=40)
def test_mass_matrix_is_positive_definite_and_gives_the_kinetic_energy(seed):
    s = random_case(seed)
    mech = pg.Mechanism(s.model)
    M = mech.mass_matrix(s.q)
    assert mech.energy(s.q, s.v)[0] == pytest.approx(s.v @ M @ s.v / 2, rel=1e-12)
    assert scaled_error(M.T, M) < 1e-12
    assert not mech.nv or np.linalg.eigvalsh(M)[0] > 0


@given(seeds)
@settings(max_examples=40)
@example(3755866)  # v' of 1e7: a fixed step is too long
def test_power_of_the_torques_is_the_rate_of_energy(seed):
    """dE/dt = τ·v along the motion, by central differences."""
    s = random_case(seed, most=8)
    mech = pg.Mechanism(s.model)
    vdot = mech.forward_dynamics(s.q, s.v, s.tau)
    h = min(1e-4, 1e-2 / abs(vdot).max(initial=1.0))  # v changes little within it

    def energy(t):
        q = moved(s.model, s.q, t * s.v + t * t / 2 * vdot)
        return sum(mech.energy(q, s.v + t * vdot))

    rates = [(energy(h) - energy(-h)) / (2 * h), (energy(h / 2) - energy(-h / 2)) / h]
    rate = (4 * rates[1] - rates[0]) / 3
    scale = 1 + abs(s.tau @ s.v) + abs(s.v) @ abs(mech.mass_matrix(s.q)) @ abs(vdot)
    assert abs(rate - s.tau @ s.v) < 1e-6 * scale


def test_free_fall_has_the_acceleration_of_gravity_whatever_the_tree():
    """A free tree without velocity falls as one: no joint moves."""
    rng = np.random.default_rng(1)
    s = random_case(1, kinds=("revolute", "prismatic", "spherical"), most=10)
    root = pg.Body(name="root", joint="free", q=(0, 0, 0, 1, 0, 0, 0), link=rng.normal(size=3))
    model = s.model.replace(bodies=(root, *s.model.bodies))
    hung = {b.name: {"parent": "root"} for b in s.model.bodies if b.parent == "ground"}
    mech = pg.Mechanism(model.edit_all(hung))
    vdot = mech.forward_dynamics(np.concatenate((root.q, s.q)), np.zeros(mech.nv))
    np.testing.assert_allclose(vdot[3:6], s.model.gravity, rtol=1e-12)
    assert abs(np.delete(vdot, [3, 4, 5])).max() < 1e-11
