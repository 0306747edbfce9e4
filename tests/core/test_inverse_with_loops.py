"""Inverse dynamics with loops and contacts: what forward dynamics does, backwards."""

from __future__ import annotations

import numpy as np
import pytest
from scipy.optimize import minimize

import pgraph_core as pg
import pgraph_models
from benchmarks import closed_loops
from pgraph_core.analysis import inverse
from pgraph_core.analysis.rows import Rows

WITH_LOOPS = ["four_bar", "slider_crank", "andrews", "bricard", "four_bar_windows", "quadruped"]
NONHOLONOMIC = ["rolling_disc", "skate"]


def moving(name: str) -> tuple[pg.Mechanism, np.ndarray, np.ndarray]:
    mech = pg.Mechanism(pg.Model.load(pgraph_models.path(name)))
    q, _, _ = mech.assemble()
    q, v, _ = mech.assemble(q, np.random.default_rng(0).normal(size=mech.nv))
    return mech, q, v


@pytest.mark.parametrize("name", WITH_LOOPS + NONHOLONOMIC)
def test_torques_come_back_without_the_part_that_the_constraints_take(name):
    mech, q, v = moving(name)
    given = np.random.default_rng(1).normal(size=mech.nv)
    vdot, _ = mech.constrained_dynamics(q, v, given)
    tau = mech.constrained_inverse_dynamics(q, v, vdot)
    J = Rows.of(mech, mech.packed.active, q).J
    taken = np.linalg.lstsq(J.T, given, rcond=1e-9)[0]  # all joints carry: a projection
    np.testing.assert_allclose(tau, given - J.T @ taken, atol=1e-10 * np.abs(given).max())
    again, _ = mech.constrained_dynamics(q, v, tau)
    np.testing.assert_allclose(again, vdot, atol=1e-12 * np.abs(vdot).max())


@pytest.mark.parametrize("name", ["four_bar", "quadruped", "rolling_disc"])
@pytest.mark.filterwarnings("ignore:.*inverse_dynamics")
def test_accelerations_by_differences_are_refused_and_the_advice_makes_them_fit(name):
    """What is advised is the nearest v' in the mass metric: away from it only J moves (Gauss)."""
    mech, q, v = moving(name)
    rng = np.random.default_rng(2)
    right, _ = mech.constrained_dynamics(q, v, rng.normal(size=mech.nv))
    vdot = right + 1e-6 * abs(right).max() * rng.normal(size=mech.nv)
    advice = "mech.constrained_dynamics(q, v, mech.inverse_dynamics(q, v, vdot))[0]"
    with pytest.raises(pg.InputError) as refused:
        mech.constrained_inverse_dynamics(q, v, vdot)
    assert advice in str(refused.value)
    allowed = eval(advice)  # as a reader would
    rows = Rows.of(mech, mech.packed.active, q)
    pushed = mech.mass_matrix(q) @ (allowed - vdot)
    taken = np.linalg.lstsq(rows.J.T, pushed, rcond=1e-9)[0]
    np.testing.assert_allclose(rows.J.T @ taken, pushed, atol=1e-8 * abs(pushed).max())
    tau = mech.constrained_inverse_dynamics(q, v, allowed)
    wanted = mech.constrained_inverse_dynamics(q, v, right)
    np.testing.assert_allclose(tau, wanted, atol=1e-3 * max(abs(wanted).max(), 1.0))


@pytest.mark.parametrize("name", [*WITH_LOOPS, *NONHOLONOMIC])
def test_the_kernel_and_the_null_space_give_the_same_torques(name, monkeypatch):
    """Proximal steps in the joints' torques, and least squares in the mass metric."""
    mech, q, v = moving(name)
    rng = np.random.default_rng(1)
    basis = mech.nv - np.linalg.matrix_rank(Rows.of(mech, mech.packed.active, q).J, tol=1e-8)
    motors = [*mech.joints][:basis]
    weights = rng.uniform(0.5, 2.0, mech.nv)
    found, answered, kernel = {}, [], inverse._at_once

    def by_kernel(*given):
        answered.append(kernel(*given) is not None)
        return kernel(*given)

    for way in (by_kernel, lambda *_: None):
        monkeypatch.setattr(inverse, "_at_once", way)
        given = np.zeros(mech.nv)
        for joint in motors:
            given[mech.joints[joint].v] = 1.0
        vdot, _ = mech.constrained_dynamics(q, v, given)
        both = [
            mech.constrained_inverse_dynamics(q, v, vdot),
            mech.constrained_inverse_dynamics(q, v, vdot, weights=weights),
            mech.constrained_inverse_dynamics(q, v, vdot, actuated=motors),
        ]
        found[way] = np.array(both)
    one, other = found.values()
    assert answered == [True] * 3
    np.testing.assert_allclose(one, other, atol=1e-9 * np.abs(other).max())


@pytest.mark.parametrize("name", WITH_LOOPS + NONHOLONOMIC)
def test_free_motion_asks_for_no_torque(name):
    mech, q, v = moving(name)
    vdot, _ = mech.constrained_dynamics(q, v)
    tau = mech.constrained_inverse_dynamics(q, v, vdot)
    assert np.abs(tau).max() < 1e-10 * max(1.0, np.abs(mech.bias_force(q, v)).max())


@pytest.mark.parametrize("robot", closed_loops.ROBOTS, ids=lambda f: f.__name__)
def test_robots_go_forward_and_back_and_linearise_as_differences(robot):
    drawing = robot()
    mech = pg.Mechanism(drawing.model())
    assert max(closed_loops.torques_back(mech, drawing.motors)) < 1e-10
    assert closed_loops.eigenvalues_off(mech) < 1e-7


def test_one_motor_holds_a_four_bar_by_the_slope_of_its_potential_energy():
    mech, q, _ = moving("four_bar")
    mech = pg.Mechanism(mech.model.replace(gravity=(1.0, -5.0, 3.0)))
    rest = np.zeros(mech.nv)
    crank = mech.names[0]
    at = mech.joints[crank].q.start
    held = mech.constrained_inverse_dynamics(q, rest, rest, actuated=[crank])

    def potential(angle: float) -> float:
        moved = q.copy()
        moved[at] = angle
        follow = pg.Motion(name="held", body=crank, q_of_t={"t": [0.0], "value": [angle]})
        placed, _, _ = pg.Mechanism(mech.model.add(follow)).assemble(moved)
        return mech.energy(placed, rest)[1]

    h = 1e-3
    odd = [potential(q[at] + n * h) - potential(q[at] - n * h) for n in (1, 2)]
    np.testing.assert_allclose(held[0], (8 * odd[0] - odd[1]) / (12 * h), rtol=1e-8)
    assert abs(held[0]) > 0.1
    assert np.count_nonzero(held) == 1


def test_redundant_motors_share_by_their_weights():
    mech, q, v = moving("four_bar")
    vdot, _ = mech.constrained_dynamics(q, v, np.array([1.0, -2.0, 0.5]))
    weights = np.array([1.0, 4.0, 0.25])
    tau = mech.constrained_inverse_dynamics(q, v, vdot, weights=weights)
    one = mech.constrained_inverse_dynamics(q, v, vdot, actuated=[mech.names[2]])
    J = Rows.of(mech, mech.packed.active, q).J
    # optimal: the weighted torques are normal to every change that the loop would take
    way = np.linalg.svd(J)[2][: np.linalg.matrix_rank(J)]
    np.testing.assert_allclose(way @ (weights * tau), 0.0, atol=1e-12)
    assert weights @ tau**2 < weights @ one**2
    by_name = dict(zip(mech.names, weights.tolist()))
    named = mech.constrained_inverse_dynamics(q, v, vdot, weights=by_name)
    np.testing.assert_array_equal(named, tau)


def test_what_cannot_be_reached_is_named():
    mech, q, v = moving("four_bar")
    with pytest.raises(pg.InputError, match=mech.model.constraints[0].name):
        mech.constrained_inverse_dynamics(q, v, np.array([1.0, 2.0, 3.0]))
    with pytest.raises(pg.InputError, match=r"misses constraint .*assemble"):
        mech.constrained_inverse_dynamics(q + 0.1, v, v)
    tree = pg.Mechanism(pg.Model.serial(2))
    q, v = tree.home()
    with pytest.raises(pg.InputError, match=r"cannot be reached .*'?1'?"):
        tree.constrained_inverse_dynamics(q, v, np.ones(2), actuated=["2"])
    with pytest.raises(pg.InputError, match="choose from 1, 2"):
        tree.constrained_inverse_dynamics(q, v, v, actuated=["knee"])
    with pytest.raises(pg.InputError, match="numbers > 0"):
        tree.constrained_inverse_dynamics(q, v, v, weights=[1.0, 0.0])


def test_of_a_tree_it_is_inverse_dynamics():
    mech = pg.Mechanism(pg.Model.load(pgraph_models.path("quadruped_hips")))
    rng = np.random.default_rng(2)
    q, (v, vdot) = mech.home()[0], rng.normal(size=(2, mech.nv))
    expected = mech.inverse_dynamics(q, v, vdot)
    found = mech.constrained_inverse_dynamics(q, v, vdot)
    np.testing.assert_allclose(found, expected, atol=1e-11 * np.abs(expected).max())


def block(friction: float) -> pg.Mechanism:
    cube = pg.Body(
        name="cube", joint="free", mass=2.0, inertia=np.eye(3) * 0.1, q=(0, 0, 0.5, 1, 0, 0, 0),
        shape={"kind": "box", "size": (1, 1, 1)},
    )  # fmt: skip
    touch = pg.Contact(name="floor", body="cube", friction=friction)
    return pg.Mechanism(pg.Model(bodies=[cube], contacts=[touch]))


def sliding(push: float) -> np.ndarray:
    return np.array([0, 0, 0, push, 0, 0.0])


def test_contacts_give_what_their_cones_hold_and_not_more():
    mech = block(0.5)
    q, v = mech.home()
    along = 0.999 * 0.5 * 9.81 * np.array([np.cos(0.4), np.sin(0.4)])
    vdot = np.array([0, 0, 0, *along, 0])
    tau = mech.constrained_inverse_dynamics(q, v, vdot, actuated=[], contacts=["floor"])
    np.testing.assert_array_equal(tau, 0.0)
    for vdot in (sliding(1.01 * 0.5 * 9.81), np.array([0, 0, 0, 0, 0, -9.82])):
        with pytest.raises(pg.InputError, match="cannot be reached"):
            mech.constrained_inverse_dynamics(q, v, vdot, actuated=[], contacts=["floor"])
    # with a thruster at the joint: what friction does not give, along the motion
    tau = mech.constrained_inverse_dynamics(q, v, sliding(10.0), contacts=["floor"])
    assert np.linalg.norm(tau) < 2.0 * 10.0 - 0.5 * 2.0 * 9.81
    lifted = q + np.array([0, 0, 0.2, 0, 0, 0, 0])
    with pytest.raises(pg.InputError, match="does not touch"):
        mech.constrained_inverse_dynamics(lifted, v, v, contacts=["floor"])


def test_standing_torques_are_the_least_that_the_feet_allow():
    """Against a general optimiser: three hinges carry a load on two feet with friction."""
    up, across, hinge = ("translate", (0, 0, 1)), ("translate", (1, 0, 0)), ("rotate", (0, 1, 0))
    trunk = pg.Body(name="trunk", joint="planar", motions=(across, up, hinge), mass=5.0)
    bodies, feet = [trunk], []
    for side, x in (("left", -0.3), ("right", 0.3)):
        thigh, shin = f"{side} thigh", f"{side} shin"
        part = {"axes": (0, 1, 0), "com": (0, 0, -0.2), "tip": (0, 0, -0.5)}
        bodies += [
            pg.Body(name=thigh, parent="trunk", link=(x, 0, 0), q=(0.6,), mass=1.0, **part),
            pg.Body(name=shin, parent=thigh, link=(0, 0, -0.5), q=(-1.2,), mass=0.5, **part),
        ]
        feet.append(
            pg.Contact(name=f"{side} foot", body=shin, points=((0, 0, -0.5),), friction=0.6)
        )
    model = pg.Model(bodies=bodies, contacts=feet)
    mech = pg.Mechanism(model)
    q, v = mech.home()
    q[1] = 1.0 * np.cos(0.6)
    legs = [name for name in mech.names if name != "trunk"]
    names = [c.name for c in feet]
    tau = mech.constrained_inverse_dynamics(q, v, v, actuated=legs, contacts=names)
    assert np.abs(tau[:3]).max() == 0.0
    J = np.vstack([mech.jacobian(q, f"{s} shin", (0, 0, -0.5))[[3, 5]] for s in ("left", "right")])
    C = mech.bias_force(q, v)

    def torques(f: np.ndarray) -> np.ndarray:
        return C - J.T @ f

    cone = [{"type": "ineq", "fun": lambda f, k=k, s=s: 0.6 * f[2 * k + 1] + s * f[2 * k]}
            for k in (0, 1) for s in (-1, 1)]  # fmt: skip
    base = {"type": "eq", "fun": lambda f: torques(f)[:3]}
    best = minimize(lambda f: torques(f) @ torques(f), np.array([0, 40, 0, 40.0]),
        constraints=[base, *cone], method="SLSQP", options={"ftol": 1e-14})  # fmt: skip
    np.testing.assert_allclose(tau @ tau, best.fun, rtol=1e-6)
    forces = np.linalg.lstsq(J.T, C - tau, rcond=None)
    assert np.abs(J.T @ forces[0] - (C - tau)).max() < 1e-9
    assert (np.abs(forces[0][::2]) <= 0.6 * forces[0][1::2] + 1e-9).all()
