"""Wrenches and springs between bodies: the dense forms by differences, the tables against them."""

from __future__ import annotations

import numpy as np
import pytest

import pgraph_core as pg
from pgraph_core.dynamics.scene import load_wrenches
from pgraph_core.engine import layout as at
from pgraph_core.packing.forces import loads
from pgraph_core.paper import Operators
from pgraph_core.paper.motion import frames, home_poses
from tests.oracle.loads import load_of

from .trees import moved, random_case, scaled_error

TABLE = pg.VectorTable(t=(0.0, 1.0, 3.0), value=((0, 0, 0), (1, 2, 3), (4, 0, 0)))


def dense(s, f, q, v, t=0.0):
    return load_of(Operators(s.model, s.topology, q, v), f, t)


def forces(s):
    a, b = s.topology.names[-1], s.topology.names[0]
    return (
        pg.Force(name="w", kind="wrench", body=a, torque=(1, -2, 3), force=TABLE, frame="body"),
        pg.Force(name="w2", kind="wrench", body=a, force=(3, 2, 1), point=(0.1, 0.2, -0.3)),
        pg.Force(name="s", kind="spring", body=a, other=b, stiffness=40, damping=3, rest=0.2),
        pg.Force(name="g", kind="spring", body=a, stiffness=40, other_point=(1, 2, 3)),
        pg.Force(
            name="t",
            kind="torsion",
            body=a,
            other=b,
            axis=(1, 2, -1),
            stiffness=9,
            damping=2,
            rest=3,
        ),
        pg.Force(name="t2", kind="torsion", body=a, stiffness=9),
    )


@pytest.mark.parametrize("seed", range(8, 14))
def test_springs_pull_along_the_slope_of_their_energy_and_power_adds_up(seed):
    s = random_case(seed)
    eps = 1e-5
    for f in forces(s):
        load = dense(s, f, s.q, s.v)
        ahead, back = (dense(s, f, moved(s.model, s.q, e * s.v), s.v).energy for e in (eps, -eps))
        balance = load.power - load.dissipated - (ahead - back) / (2 * eps)
        assert load.tau @ s.v == pytest.approx(balance, rel=1e-6, abs=1e-6)


@pytest.mark.parametrize("seed", range(8, 14))
def test_tables_say_what_the_description_says(seed):
    """Energies, directions and points of the packed rows, read off with rotations by row."""
    s = random_case(seed)
    packed = pg.Mechanism(s.model).packed.system
    given = forces(s)
    table, knots = loads(s.model, s.topology, packed, given, home_poses(s.model))
    assert table["kind"].tolist() == [0, 0, 1, 1, 2, 2]
    assert table["knots"].tolist() == [3, 1, 0, 0, 0, 0]
    position, rotation = frames(s.model, s.topology, s.q)

    def pose(number):
        """Origin and rotation of the row that carries a body."""
        if number == 0:
            return np.zeros(3), np.eye(3)
        home = packed.bodies_f[number, at.HOME : at.HOME + 9].reshape(3, 3)
        turn = rotation[number - 1] @ home.T
        return position[number - 1] - turn @ packed.bodies_f[
            number, at.OFFSET : at.OFFSET + 3
        ], turn

    for f, x in zip(given, table):
        a, b = map(s.topology.number, f.pair)
        assert x["row_a"] == packed.bodies_i[a, at.ROW]
        assert x["row_b"] == packed.bodies_i[b, at.ROW]
        (o_a, R_a), (o_b, R_b) = pose(a), pose(b)
        expected = dense(s, f, s.q, s.v, t=2.0)
        if f.kind == "wrench":
            own = knots[x["first_knot"] : x["first_knot"] + x["knots"]]
            wrench = [np.interp(2.0, own[:, 0], column) for column in own.T[1:]]
            turn = R_a if x["in_body"] else np.eye(3)
            op = Operators(s.model, s.topology, s.q, s.v)
            J = op.point_jacobian(
                a, rotation[a - 1].T @ (o_a + R_a @ x["point_a"] - position[a - 1])
            )
            tau = J.T @ np.concatenate((turn @ wrench[:3], turn @ wrench[3:]))
            np.testing.assert_allclose(tau, expected.tau, atol=1e-12)
        elif f.kind == "spring":
            ends = o_a + R_a @ x["point_a"] - o_b - R_b @ x["point_b"]
            stretch = np.linalg.norm(ends) - x["rest"]
            assert x["stiffness"] * stretch**2 / 2 == pytest.approx(expected.energy)
        else:
            h, mine = R_a @ x["axis"], R_a @ x["reference_a"]
            other = R_b @ x["reference_b"]
            angle = np.arctan2(h @ np.cross(other, mine), other @ mine) - x["rest"]
            angle -= 2 * np.pi * np.round(angle / (2 * np.pi))
            assert x["stiffness"] * angle**2 / 2 == pytest.approx(expected.energy)


def test_a_torsion_spring_about_a_hinge_sees_its_coordinate():
    model = pg.Model.serial(2).edit("2", rotation=(0.5, 0.5, 0.5, 0.5), q=0.3)
    f = pg.Force(
        name="t", kind="torsion", body="2", other="1", axis=(0, 1, 0), stiffness=2, rest=0.1
    )
    op = Operators(model, pg.Topology.of(model), np.array([0.7, 0.4]))
    np.testing.assert_allclose(load_of(op, f).tau, [0, -2 * (0.4 - 0.1)], atol=1e-15)


def test_a_spring_without_a_length_is_relaxed_at_first():
    model = pg.Model.serial(2).edit("2", q=0.3)
    f = pg.Force(name="s", kind="spring", body="2", other_point=(0, 0, 1), stiffness=2)
    op = Operators(model, pg.Topology.of(model), np.array([0.0, 0.3]))
    assert load_of(op, f).energy == pytest.approx(0.0, abs=1e-30)


@pytest.mark.parametrize("which", range(6))
def test_runs_feel_loads_as_the_dense_forms_say(which):
    """v' of the first frame; and what goes in and out adds up along the run."""
    s = random_case(9)
    force = forces(s)[which]
    model = s.model.replace(forces=(force,))
    run = pg.simulate(pg.Mechanism(model), s.q, 0.2 * s.v, t_end=0.2, method="rk4", step=1e-3)
    op = Operators(model, s.topology, s.q, 0.2 * s.v)
    assert scaled_error(run.vdot[0], op.forward_dynamics(load_of(op, force).tau)) < 1e-9
    assert run.energy_drift < 1e-9  # of order step^4


def passive_torque(s, model):
    """τ of the passive loads of `model`, dense."""
    op = Operators(model, s.topology, s.q, s.v)
    return sum(load_of(op, f).tau for f in forces(s) if f.kind != "wrench")


@pytest.mark.parametrize("seed", range(8, 11))
def test_springs_act_in_every_question_and_wrenches_in_none(seed):
    s = random_case(seed)
    bare = pg.Mechanism(s.model.replace(constraints=()))
    model = bare.model.replace(forces=forces(s))
    mech, state = pg.Mechanism(model), (s.q, s.v)
    tau = passive_torque(s, model)
    expected = bare.forward_dynamics(*state, s.tau + tau)
    for back_end in ("articulated", "composite", "operators"):
        vdot = mech.forward_dynamics(*state, s.tau, back_end=back_end)
        assert scaled_error(vdot, expected) < 1e-12
        given = mech.inverse_dynamics(*state, vdot, back_end=back_end)
        np.testing.assert_allclose(given, s.tau, atol=1e-11)  # of torques of 1e3
    assert scaled_error(mech.constrained_dynamics(*state, s.tau)[0], expected) < 1e-12
    op = Operators(model, s.topology, *state)
    stored = sum(load_of(op, f).energy for f in forces(s))
    assert mech.energy(*state)[1] - bare.energy(*state)[1] == pytest.approx(stored, rel=1e-12)


@pytest.mark.parametrize("seed", range(8, 11))
def test_derivatives_with_springs_between_bodies(seed):
    """Against differences of the dynamics, which 1e-8 is for."""
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
    spring = pg.Force(
        name="f", kind="spring", body="s", other_point=(0, a, 0), point=(0, 0, 0),
        stiffness=k, rest=rest,
    )  # fmt: skip
    mech = pg.Mechanism(pg.Model(bodies=(slide,), forces=(spring,), gravity=(0, 0, 0)))
    slope, _, _ = mech.forward_derivatives(np.array([x]), np.zeros(1))
    r = np.hypot(x, a)
    assert slope[0, 0] == pytest.approx(-k * (1 - rest / r + rest * x * x / r**3), rel=1e-11)


@pytest.mark.parametrize("seed", range(8, 11))
def test_joint_forces_of_a_run_balance_with_its_loads(seed, tmp_path):
    """Hᵀ F of every joint is what its own parts give: nothing but its spring, damper, friction."""
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
            own = pg.Mechanism(model.replace(forces=())).inverse_dynamics(
                one.q[i], one.v[i], one.vdot[i]
            )
            np.testing.assert_allclose(own, tau, atol=1e-9)
            wrench = load_wrenches(
                mech.packed, model.forces, one.t[i : i + 1], one.q[[i]], one.v[[i]]
            )[0]
            motion = mech.body_motion(one.q[i], one.v[i], one.vdot[i], wrench)
            np.testing.assert_allclose(one.joint_force[i], motion.force, atol=1e-12)
            J = np.concatenate([op.point_jacobian(b + 1, np.zeros(3)) for b in range(mech.nb)])
            np.testing.assert_allclose(J.T @ wrench.ravel(), tau, atol=1e-10)
