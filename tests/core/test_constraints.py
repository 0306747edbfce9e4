"""Constrained dynamics: rank-safe, against dense algebra and closed forms."""

import warnings

import numpy as np
import pytest
from hypothesis import assume, given, settings
from hypothesis import strategies as st

import pgraph_core as pg
import pgraph_models
from pgraph_core.paper import Operators
from tests.oracle import constrained
from tests.oracle.constrained import constrained_dynamics, delassus

from ..worlds import built_in
from .trees import moved, random_case, scaled_error

pytestmark = pytest.mark.quick

FEET = ("left_front_paw", "right_front_paw", "left_hind_paw", "right_hind_paw")
WEIGHT = 323.73  # N, of 33 kg


@pytest.fixture(scope="module")
def quadruped():
    return pg.Model.load(pgraph_models.path("quadruped"))


def operators_at(model, q, v):
    return Operators(model, pg.Topology.of(model), q, v)


def rows_at(op):
    return constrained.constraint_rows(op, constrained.active_constraints(op))


def quadruped_state(model, seed):
    rng = np.random.default_rng(seed)
    q, v = pg.Mechanism(model).home()
    q = moved(model, q, 0.2 * rng.normal(size=len(v)))
    op = operators_at(model, q, v)
    J, _ = rows_at(op)
    v = rng.normal(size=len(v))
    return q, v - np.linalg.pinv(J, rcond=1e-10) @ (J @ v), 20 * rng.normal(size=len(v))


@pytest.mark.parametrize("seed", range(4))
def test_four_feet_equal_the_dense_pseudo_inverse(quadruped, seed):
    """Rank 11 of twelve rows (R12): forces to rounding over the proximal term, 1e-16 / 1e-9."""
    q, v, tau = quadruped_state(quadruped, seed)
    vdot, force = pg.Mechanism(quadruped).constrained_dynamics(q, v, tau)
    op = operators_at(quadruped, q, v)
    expected, forces = constrained_dynamics(op, tau)
    assert scaled_error(vdot, expected) < 1e-9
    assert set(force) == set(FEET)
    for name in FEET:
        assert scaled_error(force[name], forces[name]) < 1e-6
    J, drift = rows_at(op)
    assert np.linalg.matrix_rank(delassus(op, J), tol=1e-9) == 11
    lam = np.concatenate([force[c.name][3:] for c in quadruped.constraints])
    load = op.inverse_dynamics(vdot) - tau
    assert abs(load - J.T @ lam).max() < 1e-12 * max(abs(lam).max(), abs(load).max())
    assert abs(J @ vdot + drift).max() < 1e-12 * abs(vdot).max() + 1e-10 * abs(drift).max()


@pytest.mark.parametrize("seed", range(2))
def test_velocities_that_contradict_the_feet_give_a_compromise(quadruped, seed):
    q, _, tau = quadruped_state(quadruped, seed)
    v = np.random.default_rng(seed).normal(size=len(tau))
    vdot, force = pg.Mechanism(quadruped).constrained_dynamics(q, v, tau)
    expected, forces = constrained_dynamics(operators_at(quadruped, q, v), tau)
    assert scaled_error(vdot, expected) < 1e-4
    for name in FEET:
        assert scaled_error(force[name], forces[name]) < 1e-3


def test_standing_feet_carry_the_weight_though_the_rows_are_redundant(quadruped):
    mech = pg.Mechanism(quadruped)
    q, v = mech.home()
    op = operators_at(quadruped, q, v)
    J, _ = rows_at(op)
    assert np.linalg.matrix_rank(delassus(op, J), tol=1e-9) == 10  # of 12
    hold = {force.body: force.torque for force in quadruped.scenario("stand").forces}
    names = pg.Topology.of(quadruped).names
    tau = [0.0] * 5 + [hold.get(name, 0.0) for name in names]  # the free trunk has six
    vdot, force = mech.constrained_dynamics(q, v, np.array(tau))
    assert abs(vdot).max() < 1e-4  # the torques are rounded in the file
    vertical = {name: force[name][4] for name in FEET}
    assert sum(vertical.values()) == pytest.approx(WEIGHT, abs=1e-3)
    for name in FEET:
        assert vertical[name] == pytest.approx(77.47 if "front" in name else 84.39, abs=0.01)
        assert not force[name][:3].any()


def test_forces_are_those_of_least_norm(quadruped):
    """A row given twice shares its force equally."""
    feet = quadruped.constraints
    once = quadruped.replace(scenarios=())
    twice = pg.Mechanism(once.add(feet[0].model_copy(update={"name": "twin"})))
    once = pg.Mechanism(once)
    q, v = once.home()
    tau = np.random.default_rng(0).normal(size=len(v))
    vdot, _ = once.constrained_dynamics(q, v, tau)
    again, force = twice.constrained_dynamics(q, v, tau)
    assert scaled_error(again, vdot) < 1e-9
    np.testing.assert_allclose(force["twin"], force[feet[0].name], atol=1e-5)


def with_random_constraints(s, rng):
    names = [*s.topology.names, "ground"]
    constraints = []
    for i in range(int(rng.integers(1, 4))):
        body, other = rng.choice(len(names) - 1), rng.choice(len(names))
        ends = {"body": names[body], "other": names[-1 if body == other else other]}
        ends["point"] = tuple(rng.normal(size=3))
        if rng.random() < 0.7:
            ends["other_point"] = tuple(rng.normal(size=3))
        constraints.append(pg.Constraint(name=f"c{i}", **ends))
    return s.model.replace(constraints=tuple(constraints))


@given(st.integers(0, 2**32 - 1))
@settings(max_examples=60)
def test_points_of_any_tree_equal_the_dense_pseudo_inverse(seed):
    """The trees have all joint kinds, welded bodies and several roots, with a clear rank of Ω."""
    s = random_case(seed, most=8)
    model = with_random_constraints(s, np.random.default_rng(seed))
    op = operators_at(model, s.q, s.v)
    J, _ = rows_at(op)
    v = s.v - np.linalg.pinv(J, rcond=1e-10) @ (J @ s.v)  # so that the rows do not contradict
    op = operators_at(model, s.q, v)
    sizes = np.linalg.svd(delassus(op, J))[1] if op.nv else np.zeros(1)
    assume(sizes[0] > 1e-6)
    assume(not any(1e-13 < x < 1e-4 for x in sizes / sizes[0]))
    vdot, force = pg.Mechanism(model).constrained_dynamics(s.q, v, s.tau)
    expected, forces = constrained_dynamics(op, s.tau)
    M = pg.Mechanism(model).mass_matrix(s.q)
    lost = np.finfo(float).eps * np.linalg.cond(M)  # what the dense oracle may lose
    assert scaled_error(vdot, expected) < max(1e-8, lost)
    for name in forces:
        assert scaled_error(force[name], forces[name]) < max(1e-6, lost)


L, M_CRANK, M_COUPLER, G = 0.5, 0.8, 1.7, 9.81


def parallelogram():
    """Return two equal cranks and a coupler, closed at the second crank's end."""
    crank = {"axes": (0, 1, 0), "mass": M_CRANK, "com": (0, 0, -L / 2)}
    slim = M_CRANK * L**2 / 12 * np.diag([1, 1, 1e-6])
    coupler = pg.Body(
        name="b", parent="a", axes=(0, 1, 0), link=(0, 0, -L), mass=M_COUPLER, com=(0.4, 0, 0),
        inertia=np.diag([1e-9, 0.1, 0.1]),
    )  # fmt: skip
    first = pg.Body(name="a", inertia=slim, **crank)
    second = pg.Body(name="c", link=(1.0, 0.0, 0.0), inertia=slim, **crank)
    ends = {"point": (1.0, 0, 0), "other_point": (0, 0, -L)}
    loop = pg.Constraint(name="loop", body="b", other="c", **ends)
    return pg.Model(bodies=(first, coupler, second), constraints=(loop,))


@pytest.mark.parametrize(("angle", "speed"), [(0.4, 0.0), (0.7, 3.0), (-1.2, -2.0)])
def test_a_parallelogram_linkage_moves_as_its_closed_form(angle, speed):
    """The coupler does not turn: (2/3 m l² + m_c l²) θ'' = -(m + m_c) g l sin θ."""
    mech = pg.Mechanism(parallelogram())
    signs = np.array([1.0, -1.0, 1.0])
    vdot, force = mech.constrained_dynamics(angle * signs, speed * signs)
    inertia = 2 / 3 * M_CRANK * L**2 + M_COUPLER * L**2
    expected = -(M_CRANK + M_COUPLER) * G * L * np.sin(angle) / inertia
    np.testing.assert_allclose(vdot, expected * signs, rtol=1e-11)
    op = operators_at(mech.model, angle * signs, speed * signs)
    _, forces = constrained_dynamics(op)
    np.testing.assert_allclose(force["loop"], forces["loop"], rtol=1e-9, atol=1e-9)


def test_omitted_points_and_inactive_constraints():
    model = parallelogram()
    q, v = np.array([0.3, -0.3, 0.3]), np.array([1.0, -1.0, 1.0])
    implied = pg.Mechanism(model.edit("loop", other_point=None)).constrained_dynamics(q, v)[0]
    expected, _ = pg.Mechanism(model).constrained_dynamics(q, v)
    np.testing.assert_allclose(implied, expected, rtol=1e-12)
    mech = pg.Mechanism(model.edit("loop", active=False))
    vdot, force = mech.constrained_dynamics(q, v)
    assert force == {}
    np.testing.assert_allclose(vdot, mech.forward_dynamics(q, v), rtol=1e-14)


def test_dynamics_of_the_tree_warn_once_that_constraints_are_left_out():
    """The first of each call warns at the line that made it. Our own calls never do."""
    mech = built_in("four_bar")
    q, v = mech.home()
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        mech.linearise()
        vdot, _ = mech.constrained_dynamics(q, v)
        mech.constrained_inverse_dynamics(q, v, vdot, actuated=[mech.names[0]])
        pg.simulate(mech, t_end=0.01)
    with pytest.warns(UserWarning, match=r"'loop'.*constrained_dynamics\(") as warned:
        tree = mech.forward_dynamics(q, v)
    with pytest.warns(UserWarning, match=r"'loop'.*constrained_inverse_dynamics\(") as of_inverse:
        mech.inverse_dynamics(q, v, vdot)
    assert [w.filename for w in (*warned, *of_inverse)] == 2 * [__file__]
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        mech.inverse_dynamics(q, v, vdot)
        mech.forward_dynamics(q, v)
        free = pg.Mechanism(mech.model.edit("loop", active=False))
        np.testing.assert_array_equal(free.forward_dynamics(q, v), tree)
    with pytest.warns(UserWarning, match=r"constrained_inverse_dynamics\("):
        pg.Mechanism(mech.model).inverse_dynamics(q, v, vdot)
