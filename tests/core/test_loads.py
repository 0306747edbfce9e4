"""Wrenches and springs between bodies: dense forms by differences, kernels against them."""

import numpy as np
import pytest

import pgraph_core as pg
from pgraph_core.dynamics.exerted import load_wrenches
from pgraph_core.paper import Operators
from tests.oracle.loads import load_of

from .trees import moved, random_case, scaled_error

pytestmark = pytest.mark.quick

TABLE = pg.VectorTable(t=(0.0, 1.0, 3.0), value=((0, 0, 0), (1, 2, 3), (4, 0, 0)))


def dense(s, f, q):
    return load_of(Operators(s.model, s.topology, q, s.v), f)


def forces(s):
    a, b = s.topology.names[-1], s.topology.names[0]
    own = {"axis": (1, 2, -1), "stiffness": 9, "damping": 2, "rest": 3}
    return (
        pg.Wrench(name="w", body=a, torque=(1, -2, 3), force=TABLE, frame="body"),
        pg.Wrench(name="w2", body=a, force=(3, 2, 1), point=(0.1, 0.2, -0.3)),
        pg.Spring(name="s", body=a, other=b, stiffness=40, damping=3, rest=0.2),
        pg.Spring(name="g", body=a, stiffness=40, other_point=(1, 2, 3)),
        pg.Torsion(name="t", body=a, other=b, **own),
        pg.Torsion(name="t2", body=a, stiffness=9),
        pg.Spring(name="p", body=a, other=b, stiffness=9, damping=0.7, rest=0.2, via=through(s)),
    )


def through(s):
    """Points on a body in the middle, on the ground, and on the first body."""
    names = s.topology.names
    places = (
        (names[len(names) // 2], (0.3, 0.1, -0.2)),
        ("ground", (1, 2, 3)),
        (names[0], (1, 0, 1)),
    )
    return [{"body": name, "point": point} for name, point in places]


@pytest.mark.parametrize("seed", range(8, 11))
def test_springs_pull_along_the_slope_of_their_energy_and_power_adds_up(seed):
    s = random_case(seed)
    eps = 1e-5
    for f in forces(s):
        load = dense(s, f, s.q)
        ahead, back = (dense(s, f, moved(s.model, s.q, e * s.v)).energy for e in (eps, -eps))
        balance = load.power - load.dissipated - (ahead - back) / (2 * eps)
        assert load.tau @ s.v == pytest.approx(balance, rel=1e-6, abs=1e-6)


def test_torsion_springs_measure_hinges_and_springs_are_relaxed_at_home():
    turned = pg.Model.serial(2).edit("2", rotation=(0.5, 0.5, 0.5, 0.5), q=0.3)
    torsion = pg.Torsion(name="t", body="2", other="1", axis=(0, 1, 0), stiffness=2, rest=0.1)
    op = Operators(turned, pg.Topology.of(turned), np.array([0.7, 0.4]))
    np.testing.assert_allclose(load_of(op, torsion).tau, [0, -2 * (0.4 - 0.1)], atol=1e-15)
    model = pg.Model.serial(2).edit("2", q=0.3)
    spring = pg.Spring(name="s", body="2", other_point=(0, 0, 1), stiffness=2)
    op = Operators(model, pg.Topology.of(model), np.array([0.0, 0.3]))
    assert load_of(op, spring).energy == pytest.approx(0.0, abs=1e-30)


@pytest.mark.parametrize("which", range(7))
def test_the_first_acceleration_of_a_run_is_that_of_the_dense_load(which):
    s = random_case(9)
    force = forces(s)[which]
    model = s.model.replace(forces=(force,))
    op = Operators(model, s.topology, s.q, 0.2 * s.v)
    for t in (0.0, 2.0):
        times = {"t_start": t, "t_end": t + 0.2, "method": "rk4", "step": 1e-3}
        run = pg.simulate(pg.Mechanism(model), s.q, 0.2 * s.v, estimate=False, **times)
        assert scaled_error(run.vdot[0], op.forward_dynamics(load_of(op, force, t).tau)) < 1e-9
        assert run.energy_drift < 1e-9  # of order step^4


@pytest.mark.parametrize("seed", range(8, 11))
def test_springs_act_in_all_dynamics_and_wrenches_in_runs_only(seed):
    s = random_case(seed)
    bare = pg.Mechanism(s.model.replace(constraints=()))
    model = bare.model.replace(forces=forces(s))
    mech, state = pg.Mechanism(model), (s.q, s.v)
    op = Operators(model, s.topology, *state)
    tau = sum(load_of(op, f).tau for f in forces(s) if f.kind != "wrench")
    expected = bare.forward_dynamics(*state, s.tau + tau)
    vdot = mech.forward_dynamics(*state, s.tau)
    assert scaled_error(vdot, expected) < 1e-12
    np.testing.assert_allclose(mech.inverse_dynamics(*state, vdot), s.tau, atol=1e-11)  # of 1e3
    assert scaled_error(mech.constrained_dynamics(*state, s.tau)[0], expected) < 1e-12
    stored = sum(load_of(op, f).energy for f in forces(s))
    assert mech.energy(*state)[1] - bare.energy(*state)[1] == pytest.approx(stored, rel=1e-12)


@pytest.mark.parametrize("seed", [8, 9])
def test_derivatives_with_springs_between_bodies(seed):
    s = random_case(seed)
    mech = pg.Mechanism(s.model.replace(forces=forces(s)))
    by_q, by_v, _ = mech.forward_derivatives(s.q, s.v, s.tau)
    eps = 1e-5

    def at(e, f):
        return mech.forward_dynamics(moved(s.model, s.q, e), s.v + f, s.tau) / (2 * eps)

    axes, zero = eps * np.eye(mech.nv), np.zeros(mech.nv)
    assert scaled_error(by_q.T, np.array([at(e, zero) - at(-e, zero) for e in axes])) < 1e-8
    assert scaled_error(by_v.T, np.array([at(zero, e) - at(zero, -e) for e in axes])) < 1e-8


@pytest.mark.parametrize("length", [1.0, 0.1, 0.01])
def test_slopes_of_a_spring_are_good_to_1e_11(length):
    """A slide across a spring: τ = -k (1 - rest / √(x² + a²)) x and its slope, in closed form."""
    a, k, rest, x = length, 50.0, 0.7 * length, 0.4 * length
    slide = pg.Body(name="s", joint="prismatic", axes=((1, 0, 0),), mass=1)
    ends = {"point": (0, 0, 0), "other_point": (0, a, 0)}
    spring = pg.Spring(name="f", body="s", stiffness=k, rest=rest, **ends)
    mech = pg.Mechanism(pg.Model(bodies=(slide,), forces=(spring,), gravity=(0, 0, 0)))
    slope, _, _ = mech.forward_derivatives(np.array([x]), np.zeros(1))
    r = np.hypot(x, a)
    assert slope[0, 0] == pytest.approx(-k * (1 - rest / r + rest * x * x / r**3), rel=1e-11)


@pytest.mark.parametrize("seed", [8, 10])
def test_joint_forces_of_a_run_balance_with_its_loads(seed, tmp_path):
    s = random_case(seed)
    model = s.model.replace(constraints=(), forces=forces(s))
    run = pg.simulate(pg.Mechanism(model), s.q, 0.2 * s.v, t_end=2e-3, step=1e-3, method="rk4")
    file = tmp_path / "run.npz"
    run.save(file)
    for one in (run, pg.Result.load(file)):
        mech = one.mechanism
        for i, t in enumerate(one.t):
            op = Operators(model, s.topology, one.q[i], one.v[i])
            tau = sum(load_of(op, f, t).tau for f in forces(s))
            bare = pg.Mechanism(model.replace(forces=()))
            own = bare.inverse_dynamics(one.q[i], one.v[i], one.vdot[i])
            np.testing.assert_allclose(own, tau, atol=1e-9)
            state = one.t[[i]], one.q[[i]], one.v[[i]]
            wrench = load_wrenches(mech.packed, model.forces, *state)[0]
            motion = mech.body_motion(one.q[i], one.v[i], one.vdot[i], wrench)
            np.testing.assert_allclose(one.joint_force[i], motion.force, atol=1e-12)
            J = np.concatenate([op.point_jacobian(b + 1, np.zeros(3)) for b in range(mech.nb)])
            np.testing.assert_allclose(J.T @ wrench.ravel(), tau, atol=1e-10)
