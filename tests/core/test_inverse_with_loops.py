"""Inverse dynamics with loops and contacts."""

import numpy as np
import pytest

import pgraph_core as pg
import pgraph_models
from pgraph_core.analysis import inverse
from pgraph_core.analysis.rows import Rows

from ..nights import combined
from ..worlds import built_in

pytestmark = pytest.mark.quick

NAMES = ["four_bar", "slider_crank", "andrews", "bricard", "four_bar_windows", "quadruped"]
NAMES += ["rolling_disc", "skate", "geared"]


def geared() -> pg.Model:
    hinge = {"axes": (0, 1, 0), "com": (0.1, 0, 0.05), "inertia": 0.01 * np.eye(3)}
    bodies = []
    for name, x in (("left", -0.1), ("right", 0.1)):
        bodies.append(pg.Body(name=name, link=(x, 0, 0), **hinge))
        bodies.append(pg.Body(name=f"{name} tip", parent=name, link=(0.2, 0, 0), **hinge))
    gear = pg.Gear(name="gear", body="right", other="left", ratio=-1.0)
    return pg.Model(bodies=bodies, constraints=(gear,))


def moving(name: str) -> tuple[pg.Mechanism, np.ndarray, np.ndarray]:
    mech = pg.Mechanism(geared() if name == "geared" else pg.Model.load(pgraph_models.path(name)))
    q, _, _ = mech.assemble()
    q, v, _ = mech.assemble(q, np.random.default_rng(0).normal(size=mech.nv))
    return mech, q, v


@pytest.mark.parametrize(("name", "way"), combined(NAMES, ["in one step", "by the null space"]))
def test_torques_come_back_without_the_part_that_the_constraints_take(name, way, monkeypatch):
    """Motors may be in all joints, with weights, or in a few. Free motion needs no torque."""
    if way == "by the null space":
        monkeypatch.setattr(inverse, "_at_once", lambda *_: None)
    mech, q, v = moving(name)
    rng = np.random.default_rng(1)
    given, weights = rng.normal(size=mech.nv), rng.uniform(0.5, 2.0, mech.nv)
    J = Rows.of(mech, mech.packed.active, q).J
    vdot, _ = mech.constrained_dynamics(q, v, given)
    for w, scale in ((np.ones(mech.nv), {}), (weights, {"weights": weights})):
        tau = mech.constrained_inverse_dynamics(q, v, vdot, **scale)
        taken = np.linalg.lstsq((J * w**0.5).T, w**0.5 * given, rcond=1e-9)[0]
        nearest = given - J.T @ taken
        np.testing.assert_allclose(tau, nearest, atol=1e-9 * np.abs(given).max())
        again, _ = mech.constrained_dynamics(q, v, tau)
        np.testing.assert_allclose(again, vdot, atol=1e-9 * np.abs(vdot).max())
    if mech.nv == len(mech.names):
        named = dict(zip(mech.names, weights.tolist()))
        found = mech.constrained_inverse_dynamics(q, v, vdot, weights=named)
        np.testing.assert_array_equal(found, tau)
    motors = [*mech.joints][: mech.nv - np.linalg.matrix_rank(J, tol=1e-8)]
    driven = np.zeros(mech.nv)
    for joint in motors:
        driven[mech.joints[joint].v] = 1.0
    vdot, _ = mech.constrained_dynamics(q, v, driven)
    tau = mech.constrained_inverse_dynamics(q, v, vdot, actuated=motors)
    assert not tau[driven == 0.0].any()
    assert tau @ tau <= driven @ driven * (1 + 1e-9)
    again, _ = mech.constrained_dynamics(q, v, tau)
    np.testing.assert_allclose(again, vdot, atol=1e-8 * np.abs(vdot).max())
    vdot, _ = mech.constrained_dynamics(q, v)
    tau = mech.constrained_inverse_dynamics(q, v, vdot)
    assert np.abs(tau).max() < 1e-9 * max(1.0, np.abs(mech.bias_force(q, v)).max())


@pytest.mark.parametrize("name", ["four_bar", "quadruped", "rolling_disc"])
@pytest.mark.filterwarnings("ignore:constrained_inverse_dynamics gives")
def test_accelerations_that_the_constraints_exclude_are_refused(name):
    """The nearest v' in the mass metric is advised: J alone moves it (Gauss)."""
    mech, q, v = moving(name)
    rng = np.random.default_rng(2)
    right, _ = mech.constrained_dynamics(q, v, rng.normal(size=mech.nv))
    vdot = right + 1e-6 * abs(right).max() * rng.normal(size=mech.nv)
    with pytest.raises(pg.InputError, match="nearest=True"):
        mech.constrained_inverse_dynamics(q, v, vdot)
    tau = mech.constrained_inverse_dynamics(q, v, vdot, nearest=True)  # without a warning
    allowed, _ = mech.constrained_dynamics(q, v, tau)
    J = Rows.of(mech, mech.packed.active, q).J
    pushed = mech.mass_matrix(q) @ (allowed - vdot)
    taken = np.linalg.lstsq(J.T, pushed, rcond=1e-9)[0]
    np.testing.assert_allclose(J.T @ taken, pushed, atol=1e-8 * abs(pushed).max())
    wanted = mech.constrained_inverse_dynamics(q, v, right)
    np.testing.assert_allclose(tau, wanted, atol=1e-3 * max(abs(wanted).max(), 1.0))


def test_unreachable_accelerations_are_refused():
    mech, q, v = moving("four_bar")
    loop = mech.model.constraints[0].name
    tree = pg.Mechanism(pg.Model.serial(2))
    q2, rest = tree.home()
    one = np.ones(2)
    for mechanism, place, speed, vdot, options, key in (
        (mech, q, v, np.array([1.0, 2.0, 3.0]), {}, loop),
        (mech, q + 0.1, v, v, {}, "assemble"),
        (tree, q2, rest, one, {"actuated": ["2"]}, "torques of 2.*joints of 1"),
        (tree, q2, rest, rest, {"actuated": ["knee"]}, "1, 2"),
        (tree, q2, rest, rest, {"weights": [1.0, 0.0]}, "> 0"),
    ):
        with pytest.raises(pg.InputError, match=key):
            mechanism.constrained_inverse_dynamics(place, speed, vdot, **options)


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


def test_without_constraints_it_is_inverse_dynamics():
    mech = built_in("quadruped_hips")
    rng = np.random.default_rng(2)
    q, (v, vdot) = mech.home()[0], rng.normal(size=(2, mech.nv))
    expected = mech.inverse_dynamics(q, v, vdot)
    found = mech.constrained_inverse_dynamics(q, v, vdot)
    np.testing.assert_allclose(found, expected, atol=1e-11 * np.abs(expected).max())


@pytest.mark.parametrize(
    ("lengths", "start", "size"),
    combined([(0.2, 0.5, 0.4, 0.55), (0.1, 0.35, 0.3, 0.4)], [0.0, 2.0], [1e-3, 100.0]),
)
def test_joints_given_by_name_keep_the_loop_on_the_branch_of_the_initial_position(
    lengths, start, size
):
    """Over a turn of the crank, the angle at the coupler keeps its sign (law of cosines)."""
    a, b, c, d = (size * x for x in lengths)
    hinge = {"axes": (0, 1, 0), "mass": 1.0, "inertia": (1.0, 1.0, 1.0)}
    bodies = (
        pg.Body(name="crank", q=(start,), **hinge),
        pg.Body(name="coupler", parent="crank", link=(a, 0, 0), **hinge),
        pg.Body(name="rocker", link=(d, 0, 0), **hinge),
    )
    pin = pg.Point(
        name="pin", body="coupler", point=(b, 0, 0), other="rocker", other_point=(c, 0, 0)
    )
    mech = pg.Mechanism(pg.Model(bodies=bodies, constraints=(pin,)))
    sides = []
    for crank in np.linspace(-4.0, 4.0, 5):
        q, _, report = mech.assemble({"crank": crank})
        assert q[0] == pytest.approx(crank, abs=1e-9)
        assert report.moved > 0.1
        sides.append(np.sign(np.sin(q[0] + q[1] - q[2])))
    assert len({*sides}) == 1
    low = np.arccos((d**2 + c**2 - (a + b) ** 2) / (2 * c * d))  # the rocker's dead end
    with pytest.raises(pg.InputError, match=r"rocker|pin"):
        mech.assemble({"rocker": np.pi - low - 0.1})


def test_a_loop_closed_on_another_branch_says_so():
    """Two circuits of a double rocker: none leads from one to the other."""
    hinge = {"axes": (0, 1, 0), "mass": 1.0, "inertia": (1.0, 1.0, 1.0)}
    bodies = (
        pg.Body(name="left", q=(-1.2,), **hinge),
        pg.Body(name="coupler", parent="left", link=(0.5, 0, 0), q=(1.0,), **hinge),
        pg.Body(name="right", link=(0.55, 0, 0), q=(-1.5,), **hinge),
    )
    pin = pg.Point(
        name="pin", body="coupler", point=(0.2, 0, 0), other="right", other_point=(0.4, 0, 0)
    )
    mech = pg.Mechanism(pg.Model(bodies=bodies, constraints=(pin,)))
    q, _, _ = mech.assemble()
    with pytest.warns(UserWarning, match="branch"):
        mirrored, _, _ = mech.assemble({"left": -q[0]})
    assert mirrored[0] == pytest.approx(-q[0])
