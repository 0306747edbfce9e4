"""Linearised dynamics, equilibria, inverse kinematics: closed forms and finite differences."""

import numpy as np
import pytest
from numpy.polynomial.laguerre import lagroots
from scipy.linalg import expm

import pgraph_core as pg
from pgraph_core.analysis.rows import Rows, apart

from ..worlds import built_in as load


def test_a_pendulum_with_spring_and_damper():
    m, r, k, c = 2.0, 0.5, 3.0, 0.4
    body = pg.Body(name="p", axes=(0, 1, 0), com=(0, 0, -r), mass=m, inertia=np.zeros((3, 3)),
                   stiffness=k, damping=c)  # fmt: skip
    found = pg.Mechanism(pg.Model(bodies=[body])).linearise()
    inertia = m * r * r
    np.testing.assert_allclose(found.A, [[0, 1], [-(k + m * 9.81 * r) / inertia, -c / inertia]])
    np.testing.assert_allclose(found.B, [[0], [1 / inertia]])
    assert found.coordinates == found.velocities == ("p",)
    expected = np.roots((1, c / inertia, (k + m * 9.81 * r) / inertia))
    np.testing.assert_allclose(np.sort_complex(found.eigenvalues), np.sort_complex(expected))
    assert not found.conservative


@pytest.mark.parametrize("n", [10, pytest.param(1000, marks=pytest.mark.nightly)])
def test_frequencies_of_a_hanging_chain(n):
    """Point masses on rods without mass: the zeros of Laguerre polynomials."""
    point = {"axes": (0, 1, 0), "com": (0, 0, -1.0), "mass": 1.0, "inertia": np.zeros((3, 3))}
    bodies = [pg.Body(name="0", **point)]
    link = {"link": (0, 0, -1.0), **point}
    bodies += [pg.Body(name=f"{k}", parent=f"{k - 1}", **link) for k in range(1, n)]
    found = pg.Mechanism(pg.Model(bodies=bodies)).linearise()
    assert (found.conservative, len(found.frequencies)) == (True, n)
    if n == 10:
        np.testing.assert_allclose(found.frequencies**2 / 9.81, lagroots([0] * n + [1]), rtol=1e-9)
    M = pg.Mechanism(pg.Model(bodies=bodies)).mass_matrix(np.zeros(n))
    weights = np.arange(n, 0, -1) * 9.81  # the weight below each rod: K is diagonal
    upright = np.tril(np.ones((n, n)))  # angles against the vertical
    x = found.modes[:, 0].real
    pull = upright.T @ (weights * (upright @ x))
    inertia = found.frequencies[0] ** 2 * (M @ x)
    np.testing.assert_allclose(pull, inertia, atol=1e-9 * np.abs(pull).max())
    assert found.modes.shape == (n, 2 * n)


@pytest.mark.parametrize("name", ["four_bar", "slider_crank", "andrews", "quadruped"])
def test_with_loops_it_equals_differences_of_the_motion(name):
    """Along trajectories that start a little aside, which the constraints hold."""
    mech = load(name)
    q, _, _ = mech.assemble()
    rng = np.random.default_rng(3)
    q, v, _ = mech.assemble(q, 0.5 * rng.normal(size=mech.nv))
    if name == "quadruped":
        v = np.zeros(mech.nv)
    springs = tuple(f for f in mech.model.forces if f.kind == "spring")
    bare = pg.Mechanism(mech.model.replace(forces=springs))
    found = bare.linearise(q, v)
    index = [bare_index(bare, c) for c in found.coordinates]
    speed = [bare_index(bare, c) for c in found.velocities]
    n, h = len(index), 1e-5

    def rate(x: np.ndarray) -> np.ndarray:
        rows = Rows.of(bare, bare.packed.active, q, v)
        moved = rows.advanced(found.moves @ x[:n])
        at, _, _ = bare.assemble(moved, np.zeros(bare.nv))
        here = rows.at(at)
        for _ in range(4):  # to the constraints, at exactly these independent coordinates
            off = np.concatenate((here.gap, (apart(bare, q, at)[index] - x[:n])))
            J = np.vstack((here.J, np.eye(bare.nv)[index]))
            at = here.advanced(-np.linalg.lstsq(J, off, rcond=1e-10)[0])
            here = rows.at(at)
        J = np.vstack((here.J, np.eye(bare.nv)[speed]))
        wanted = np.concatenate((np.zeros(len(here.J)), v[speed] + x[n:]))
        u = np.linalg.lstsq(J, wanted, rcond=1e-10)[0]
        vdot, _ = bare.constrained_dynamics(at, u)
        return np.concatenate((u[index], vdot[speed]))

    by_difference = np.array([(rate(h * e) - rate(-h * e)) / (2 * h) for e in np.eye(2 * n)]).T
    scale = np.abs(by_difference).max()
    np.testing.assert_allclose(found.A, by_difference, atol=1e-7 * scale)


def bare_index(mech, name: str) -> int:
    body, _, k = name.partition("[")
    return mech.joints[body].v.start + (int(k[:-1]) if k else 0)


def test_a_four_bar_swings_with_the_frequency_of_its_energy():
    """One freedom: ω² is V'' over the reduced mass at rest, from values of the energy alone."""
    mech = load("four_bar")
    mech = pg.Mechanism(mech.model.replace(gravity=(3.0, -5.0, -2.0)))
    q = mech.equilibrium()
    found = mech.linearise(q)
    assert (found.conservative, len(found.frequencies)) == (True, 1)
    body = found.coordinates[0]
    at, rest = mech.joints[body].q.start, np.zeros(mech.nv)

    def energy(angle: float) -> float:
        moved = q.copy()
        moved[at] = angle
        hold = pg.Motion(name="hold", body=body, q_of_t={"t": [0.0], "value": [angle]})
        placed, _, _ = pg.Mechanism(mech.model.add(hold)).assemble(moved)
        return mech.energy(placed, rest)[1]

    h = 0.01
    V = [energy(q[at] + k * h) for k in (-3, -2, -1, 0, 1, 2, 3)]
    curvature = np.dot((2, -27, 270, -490, 270, -27, 2), V) / (180 * h * h)
    mass = found.moves[:, 0] @ mech.mass_matrix(q) @ found.moves[:, 0]
    np.testing.assert_allclose(found.frequencies[0] ** 2, curvature / mass, rtol=1e-6)


@pytest.mark.parametrize("law", ["penalty", "soft"])
def test_a_slider_on_a_contact_is_a_spring_with_a_damper(law):
    """Slopes of k d + c d', and of k d^1.5 (1 + c d'), at the depth that carries the weight."""
    m, k, c, g = 2.0, 3000.0, 4.0, 9.81
    deep = m * g / k if law == "penalty" else (m * g / k) ** (2 / 3)
    stiffness = k if law == "penalty" else 1.5 * k * deep**0.5
    damping = c if law == "penalty" else c * m * g
    body = pg.Body(name="b", joint="prismatic", axes=(0, 0, 1), mass=m, q=-deep)
    contact = pg.Contact(name="c", body="b", points=[(0, 0, 0)], law=law, stiffness=k, damping=c)
    mech = pg.Mechanism(pg.Model(bodies=[body], contacts=[contact]))
    found = mech.linearise()
    np.testing.assert_allclose(found.A, [[0, 1], [-stiffness / m, -damping / m]], rtol=1e-7)
    np.testing.assert_allclose(found.drift, 0.0, atol=1e-12)
    assert not found.notices
    off = pg.Mechanism(mech.model.edit("c", active=False)).linearise()
    for free in (mech.linearise(q=[0.1]), off):  # in the air, and switched off
        np.testing.assert_allclose(free.A, [[0, 1], [0, 0]], atol=1e-12)


def test_closed_contacts_and_missing_equilibria_are_reported():
    point = pg.Contact(name="foot", body="b", points=[(0, 0, 0)])
    body = pg.Body(name="b", joint="prismatic", axes=(0, 0, 1), mass=1.0)
    for model, name in (
        (pg.Model(bodies=[body], contacts=[point]), "contact 'foot'"),
        (pg.Model(bodies=[body.copy(update={"limits": (0.0, 1.0)})]), "joint 'b'"),
    ):
        mech = pg.Mechanism(model)
        closed, falls = mech.linearise().notices
        assert name in closed
        assert all(fact in falls for fact in ("'b'", "-9.81"))
        assert len(mech.linearise(q=[0.5]).notices) == 1
    rod = pg.Body(name="arm", axes=(0, 1, 0), com=(0, 0, -1), mass=1.0, inertia=np.zeros((3, 3)))
    arm = pg.Mechanism(pg.Model(bodies=[rod]))
    assert not arm.linearise().notices
    np.testing.assert_allclose(arm.linearise([0.5]).drift, [0, -9.81 * np.sin(0.5)])


def test_rolling_reduces_velocities_only():
    mech = load("rolling_disc")
    found, counts = mech.linearise(), mech.mobility()
    assert (len(found.velocities), len(found.coordinates)) == (counts.dof, counts.positions)
    assert set(found.velocities) <= set(found.coordinates)
    assert found.A.shape == (counts.dof + counts.positions,) * 2


def test_servos_are_springs_and_scenarios_choose():
    rod = pg.Body(name="p", axes=(0, 0, 1), com=(0.5, 0, 0), mass=1.0)
    servo = pg.Servo(name="s", body="p", kp=7.0, kd=0.3, target=0.2)
    model = pg.Model(bodies=[rod], scenarios=[pg.Scenario(name="held", forces=[servo])])
    mech = pg.Mechanism(model)
    inertia = mech.mass_matrix(np.zeros(1))[0, 0]
    np.testing.assert_allclose(mech.linearise().A, [[0, 1], [0, 0]], atol=1e-12)
    held = mech.linearise(scenario="held").A
    np.testing.assert_allclose(held, [[0, 1], [-7 / inertia, -0.3 / inertia]], atol=1e-12)
    np.testing.assert_allclose(mech.equilibrium(scenario="held"), [0.2], atol=1e-10)
    limited = servo.model_copy(update={"torque_limit": 0.1})
    held = pg.Mechanism(model.replace(forces=[limited], scenarios=[]))
    np.testing.assert_allclose(held.linearise().A, [[0, 1], [0, 0]], atol=1e-12)  # at its limit


def test_a_spinning_top_turns_its_axes_along():
    """A free body that spins: A, with the turning of the rotation vector, against a run."""
    body = pg.Body(name="b", joint="spherical", mass=0.0, inertia=np.diag((1.0, 2.0, 2.5)))
    mech = pg.Mechanism(pg.Model(bodies=[body], gravity=(0, 0, 0)))
    q, v = mech.home()[0], np.array([0.3, 1.0, -0.5])
    A = mech.linearise(q, v).A
    rows, h, t = Rows.of(mech, mech.packed.active, q), 1e-6, 1e-3

    def ends(x):
        model = mech.model.edit("b", q=tuple(rows.advanced(x[:3])), v=tuple(v + x[3:]))
        run = pg.simulate(model, t_end=t, method="rk4", step=t / 4, estimate=False, frames=2)
        return run.q[-1], run.v[-1]

    middle = ends(np.zeros(6))
    moved = [ends(h * e) for e in np.eye(6)]
    flow = np.array([[*apart(mech, middle[0], a), *(b - middle[1])] for a, b in moved]).T / h
    np.testing.assert_allclose(flow, expm(A * t), atol=3e-6)


def test_a_chain_settles_where_its_energy_is_least():
    mech = pg.Mechanism(pg.Model.serial(5))
    np.testing.assert_allclose(np.sin(mech.equilibrium()), [1, 0, 0, 0, 0], atol=1e-9)  # down
    loop = load("slider_crank")
    loop = pg.Mechanism(loop.model.replace(gravity=(1.0, -9.0, 2.0), forces=()))
    q = loop.equilibrium()
    vdot, _ = loop.constrained_dynamics(q, np.zeros(loop.nv))
    assert np.abs(vdot).max() < 1e-8
    falls = pg.Mechanism(pg.Model(bodies=[pg.Body(name="stone", joint="free")]))
    with pytest.raises(pg.InputError, match="'stone'"):
        falls.equilibrium()


ROD = {"mass": 1.0, "com": (0.5, 0, 0), "tip": (1, 0, 0), "axes": (0, 1, 0)}
UPPER, LOWER = pg.Body(name="a", **ROD), pg.Body(name="b", parent="a", link=(1, 0, 0), **ROD)


def test_equilibrium_goes_down_from_anywhere_but_an_equilibrium():
    mech, rest = pg.Mechanism(pg.Model(bodies=[UPPER, LOWER])), np.zeros(2)
    lowest = -9.81 * (0.5 + 1.5)
    for q in [*np.random.default_rng(0).uniform(-np.pi, np.pi, (12, 2)), (-np.pi / 2 + 1e-9, 0)]:
        assert mech.energy(mech.equilibrium(q), rest)[1] == pytest.approx(lowest, rel=1e-12)
    upright = np.array([-np.pi / 2, 0])  # sin is 1, cos is 6e-17: an equilibrium but for rounding
    np.testing.assert_array_equal(mech.equilibrium(upright), upright)


def test_equilibrium_rests_on_limits_and_leaves_them():
    stop = UPPER.model_copy(update={"limits": ((-1.0, 1.0),)})
    mech = pg.Mechanism(pg.Model(bodies=[stop, LOWER]))
    for q in ([0.0, 0.0], [3.0, 0.0], [-1.0, 1.0]):  # inside, outside, on the upper side
        np.testing.assert_allclose(mech.equilibrium(q), [1.0, np.pi / 2 - 1.0], atol=1e-12)


ON = {"name": "f", "body": "a"}
LOADS = [
    (pg.Motor(**ON, torque=3.0), np.pi / 2 + np.arcsin(3.0 / (9.81 * 0.5))),
    (pg.Wrench(**ON, torque=(0, 3.0, 0)), None),
    (pg.Wrench(**ON, force=(9.81, 0, 0), point=(0.5, 0, 0)), np.pi / 4),
    (pg.Wrench(**ON, force=(0, 0, 3.0), frame="body", point=(0.5, 0, 0)), None),
]


@pytest.mark.parametrize(("force", "least"), LOADS)
def test_equilibrium_balances_motors_and_wrenches(force, least):
    mech = pg.Mechanism(pg.Model(bodies=[UPPER], forces=[force]))
    for start in (-2.0, 0.0, 1.4, 2.5):
        q = mech.equilibrium([start])
        if least is not None:
            assert np.cos(q[0] - least) == pytest.approx(1.0, abs=1e-12)
        run = pg.simulate(mech, q=q, t_end=1.0)
        assert np.abs(run.q - q).max() < 1e-6  # stable: rounding does not grow


def test_inverse_kinematics_meets_several_targets_within_limits():
    model = pg.Model.serial(6)
    axes = np.eye(3)[[1, 2, 1, 0, 1, 2]].tolist()
    edits = {f"{k + 1}": {"axes": axis, "limits": (-2.0, 2.0)} for k, axis in enumerate(axes)}
    mech = pg.Mechanism(model.edit_all(edits))
    rng = np.random.default_rng(0)
    for _ in range(3):
        aim = rng.uniform(-1.2, 1.2, 6)
        place, turn = mech.pose(aim, "6")
        q = mech.inverse_kinematics({"6": (place, turn)})
        found = mech.pose(q, "6")
        np.testing.assert_allclose(found[0], place, atol=1e-8)
        np.testing.assert_allclose(found[1], turn, atol=1e-7)
        assert (np.abs(q) <= 2.0 + 1e-12).all()
    elbow = mech.pose(aim, "3")[0]
    tip = mech.pose(aim, "6")[0] + mech.pose(aim, "6")[1] @ (0.2, 0, 0)
    q = mech.inverse_kinematics({"3": elbow, "6": {"place": tip, "point": (0.2, 0, 0)}})
    np.testing.assert_allclose(mech.pose(q, "3")[0], elbow, atol=1e-8)
    far, singular = {"6": (5.0, 0.0, 0.0)}, {"6": ((0, 0, 0), np.ones((3, 3)))}
    for target, words in ((far, "'6'"), (singular, "quaternion"), ({"7": (0, 0, 0)}, "'7'")):
        with pytest.raises(pg.PgraphError, match=words):
            mech.inverse_kinematics(target)


def test_inverse_kinematics_keeps_loops_closed():
    mech = load("four_bar")
    q, _, _ = mech.assemble()
    target = mech.pose(mech.assemble(q + np.array([0.3, 0, 0]))[0], mech.names[1])[0]
    found = mech.inverse_kinematics({mech.names[1]: target})
    np.testing.assert_allclose(mech.pose(found, mech.names[1])[0], target, atol=1e-8)
    assert mech.assemble(found)[2].moved < 1e-8


def test_an_equilibrium_has_lags_behind_it_and_forces_over_time_are_named():
    rod = pg.Body(name="rod", axes=(0, 1, 0), mass=1.2, com=(0.3, 0, 0), inertia=(0.05, 0.06, 0.02))
    servo = pg.Servo(name="s", body="rod", kp=50, target=1.0, lag=0.1, start=0.0)
    model = pg.Model(bodies=[rod], forces=[servo])
    lagging, direct = (pg.Mechanism(m) for m in (model, model.edit("s", lag=0.0, start=None)))
    np.testing.assert_array_equal(lagging.equilibrium(), direct.equilibrium())
    run = pg.simulate(lagging, direct.equilibrium(), t_end=20.0, tau=lambda t, q, v: -2.0 * v)
    np.testing.assert_allclose(run.q[-1], direct.equilibrium(), atol=1e-6)
    for torque in (pg.Table(t=(0, 1), value=(1, 3)), "=1 + 2*t"):
        driven = pg.Mechanism(pg.Model(bodies=[rod], forces=[pg.Motor(body="rod", torque=torque)]))
        assert driven.linearise(driven.equilibrium()).notices


@pytest.mark.parametrize("n", [1, 8])
def test_an_equilibrium_that_rounding_alone_disturbs_gets_no_notice(n):
    mech = pg.Mechanism(pg.Model.serial(n))
    assert not mech.linearise(mech.equilibrium()).notices
    assert mech.linearise(mech.equilibrium() + 1e-5).notices
