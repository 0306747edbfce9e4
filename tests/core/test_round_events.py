"""Event-driven contact of ellipsoids, cylinders and hulls with the ground.

The reference integrates the equations of one rigid body on a plane by SciPy. With the contact point
at ρ from the centre of mass, n · (v + ω × ρ) = 0, and v + ω × ρ = 0 where it sticks.
"""

import numpy as np
import pytest
from scipy.integrate import solve_ivp
from scipy.spatial.transform import Rotation

import pgraph_core as pg

from ..nights import at_night

UP = np.array((0.0, 0.0, 1.0))
G = 9.81


def skew(a):
    return np.array(((0, -a[2], a[1]), (a[2], 0, -a[0]), (-a[1], a[0], 0)))


class Reference:
    """A body of 1 kg that touches the plane with an ellipsoid or disc about a point."""

    def __init__(self, radii, inertia, friction, centre=(0.0, 0.0, 0.0)):
        self.square, self.inertia = np.square(radii), np.asarray(inertia)
        self.friction, self.centre = friction, np.asarray(centre)

    def arm(self, turn, spin):
        """Return (ρ, ρ') in world axes."""
        n, rate = turn.T @ UP, -np.cross(turn.T @ spin, turn.T @ UP)
        m = np.sqrt(n @ (self.square * n))
        low = -self.square * n / m
        moved = -self.square * rate / m - low * (n @ (self.square * rate)) / m**2
        return turn @ (low + self.centre), turn @ moved + np.cross(spin, turn @ (low + self.centre))

    def rates(self, _, y):
        turn, v, spin = y[3:12].reshape(3, 3), y[12:15], y[15:18]
        rho, rho_rate = self.arm(turn, spin)
        inertia = turn @ self.inertia @ turn.T
        gyro = np.cross(spin, inertia @ spin)
        arms = skew(rho)
        mobility = np.eye(3) - arms @ np.linalg.solve(inertia, arms)  # of the point, per newton
        free = np.cross(np.linalg.solve(inertia, -gyro), rho) + np.cross(spin, rho_rate) - G * UP
        slip = v + np.cross(spin, rho)
        slip -= (slip @ UP) * UP
        if self.friction is None:
            force = np.linalg.solve(mobility, -free)
        else:
            way = UP - self.friction * slip / np.linalg.norm(slip)
            force = way * -(free @ UP) / (UP @ mobility @ way)
        alpha = np.linalg.solve(inertia, np.cross(rho, force) - gyro)
        return np.concatenate((v, (skew(spin) @ turn).ravel(), force - G * UP, alpha))

    def start(self, turn, spin, v):
        """Return the position (3,), rotation (9,), velocity (3,) and spin (3,) in one array."""
        rho, _ = self.arm(turn, spin)
        v = -np.cross(spin, rho) if v is None else v - np.cross(spin, rho) @ UP * UP
        return np.concatenate((-(rho @ UP) * UP, turn.ravel(), v, spin))

    def end(self, first, t_end):
        """Return the same at the end of a motion from the start `first`."""
        return solve_ivp(self.rates, (0, t_end), first, "DOP853", rtol=1e-12, atol=1e-13).y[:, -1]


def moved(reference, shape, turn, spin, v, t_end, **settings):
    """Return (run, the start that the reference has in common with it)."""
    first = reference.start(turn, np.asarray(spin), v)
    x, y, z, w = Rotation.from_matrix(turn).as_quat()
    body = pg.Body(
        name="body",
        joint="free",
        inertia=reference.inertia.tolist(),
        q=(*first[:3], w, x, y, z),
        v=(*spin, *first[12:15]),
        shape=shape,
    )
    friction = 50.0 if reference.friction is None else reference.friction
    floor = pg.Contact(name="floor", body="body", friction=friction)
    run = pg.simulate(pg.Model(bodies=[body], contacts=[floor]), t_end=t_end, frames=3, **settings)
    return run, first


def compared(reference, shape, turn, spin, v, t_end, **settings):
    """Return (run, largest difference from the reference at the end)."""
    run, first = moved(reference, shape, turn, spin, v, t_end, **settings)
    q, moving = run.q[-1], run.v[-1]
    turned = Rotation.from_quat((*q[4:7], q[3])).as_matrix()
    found = np.concatenate((q[:3], turned.ravel(), moving[3:], moving[:3]))
    return run, float(np.abs(found - reference.end(first, t_end)).max())


def turned(*angles):
    return Rotation.from_euler("zyx", angles, degrees=True).as_matrix()


def celt(degrees=9.0):
    """Return a reference for an ellipsoid whose principal axes of inertia are turned about z."""
    turn = turned(degrees, 0, 0)
    return Reference((0.2, 0.03, 0.02), turn @ np.diag((8e-4, 1.1e-2, 1.15e-2)) @ turn.T, None)


@pytest.mark.parametrize(
    ("method", "spin"), [("dopri5", -3.0), ("dop853", 3.0), *at_night(("dop853", -6.0))]
)
def test_a_rattleback_agrees_with_the_reference(method, spin):
    shape = pg.Shape(kind="ellipsoid", radii=(0.2, 0.03, 0.02))
    run, error = compared(
        celt(), shape, np.eye(3), (0.02, 0.01, spin), None, 1.0, method=method, rtol=1e-10
    )
    assert run.status is pg.Status.DONE
    assert error < 1e-6


@pytest.mark.nightly
def test_a_rattleback_reverses_its_spin_in_one_sense_only():
    shape = pg.Shape(kind="ellipsoid", radii=(0.2, 0.03, 0.02))
    given = (shape, np.eye(3))
    spins = {}
    for spin in (-3.0, 3.0):
        run, _ = moved(celt(), *given, (0.02, 0.0, spin), None, 5.0, method="dop853", rtol=1e-9)
        spins[spin] = run.v[-1, 2]
    assert spins[-3.0] * spins[3.0] > 0


@pytest.mark.parametrize("scale", [1e-2, 1.0])
def test_a_sliding_ellipsoid_agrees_with_the_reference(scale):
    radii = scale * np.array((0.3, 0.2, 0.1))
    inertia = scale**2 * np.diag((0.01, 0.02, 0.025))
    speed = np.sqrt(scale)
    run, error = compared(
        Reference(radii, inertia, 0.2),
        pg.Shape(kind="ellipsoid", radii=tuple(radii)),
        turned(20, 10, 5),
        (1.0 / speed, 2.0 / speed, 3.0 / speed),
        np.array((3.0, 1.0, 0.0)) * speed,
        0.3 * speed,
        method="dop853",
        rtol=1e-10,
    )
    assert {e.after for e in run.events} <= {"slip"}
    assert error < 1e-7 / speed


@pytest.mark.parametrize("tilt", [40.0, *at_night(10.0, 70.0)])
def test_a_rolling_coin_agrees_with_the_reference(tilt):
    radius, length = 0.1, 0.01
    across, along = radius**2 / 4 + length**2 / 12, radius**2 / 2
    reference = Reference(
        (radius, radius, 0.0), np.diag((across, across, along)), None, (0, 0, -length / 2)
    )
    shape = pg.Shape(kind="cylinder", radius=radius, length=length)
    run, error = compared(
        reference,
        shape,
        turned(0, tilt, 0),
        (0.5, 0.3, 4.0),
        None,
        0.4,
        method="dop853",
        rtol=1e-10,
    )
    assert run.status is pg.Status.DONE
    assert error < 1e-6


def test_a_cylinder_rolls_on_both_rims():
    """A lying cylinder keeps its speed, and slides until it rolls at 2/3 of it."""
    roller = pg.Body(
        name="roller", joint="free", q=(0, 0, 0.1, np.sqrt(0.5), np.sqrt(0.5), 0, 0),
        v=(0, 0, 0, 3, 0, 0),
        shape=pg.Shape(kind="cylinder", radius=0.1, length=0.4), derived=("inertia",),
    )  # fmt: skip
    floor = pg.Contact(name="floor", body="roller", friction=0.3)
    run = pg.simulate(
        pg.Model(bodies=[roller], contacts=[floor]), t_end=1.0, method="dop853", rtol=1e-9
    )
    assert run.v[-1, 3] == pytest.approx(2.0, abs=1e-8)
    (start,) = {e.t for e in run.events if e.after == "stance"}
    assert start == pytest.approx(1.0 / (0.3 * G), abs=1e-8)


def test_a_standing_cylinder_is_refused_with_a_way_out():
    can = pg.Body(
        name="can",
        joint="free",
        q=(0, 0, 0.2, 1, 0, 0, 0),
        shape=pg.Shape(kind="cylinder", radius=0.1, length=0.4),
        inertia=(0.1, 0.1, 0.1),
    )
    model = pg.Model(bodies=[can], contacts=[pg.Contact(name="floor", body="can")])
    run = pg.simulate(model, t_end=1.0, method="dop853", rtol=1e-8)
    assert run.status is pg.Status.CHATTER
    assert "floor" in run.message
    assert "moreau_jean" in run.message


def test_a_cylinder_that_falls_flat_stops_the_run():
    turn = Rotation.from_euler("y", 30, degrees=True).as_quat()
    height = 0.2 * np.cos(np.radians(30)) + 0.1 * np.sin(np.radians(30))
    can = pg.Body(
        name="can", joint="free", q=(0, 0, height, turn[3], *turn[:3]), inertia=(0.1, 0.1, 0.1),
        shape=pg.Shape(kind="cylinder", radius=0.3, length=0.1),
    )  # fmt: skip
    model = pg.Model(
        bodies=[can], contacts=[pg.Contact(name="floor", body="can", friction=2.0, restitution=0.0)]
    )
    run = pg.simulate(model, t_end=3.0, method="dop853", rtol=1e-8)
    assert run.status is pg.Status.CHATTER
    assert "floor" in run.message
    assert "flat" in run.message


def test_the_hull_of_a_box_moves_as_the_box(tmp_path):
    import trimesh

    size = (0.3, 0.2, 0.1)
    file = tmp_path / "box.obj"
    trimesh.creation.box(size).export(file)
    runs = []
    for shape in (pg.Shape(kind="box", size=size), pg.Shape(kind="mesh", file=str(file))):
        body = pg.Body(
            name="body", joint="free", q=(0, 0, 0.4, 0.7, 0.5, 0.5, 0.1), v=(1, 2, 3, 1, 0, 0),
            inertia=(0.01, 0.02, 0.025), shape=shape,
        )  # fmt: skip
        floor = pg.Contact(name="floor", body="body", friction=0.3, restitution=0.4)
        model = pg.Model(bodies=[body], contacts=[floor])
        runs.append(pg.simulate(model, t_end=0.6, method="dop853", rtol=1e-9))
    assert len(runs[0].events) > 2
    assert np.abs(runs[0].q - runs[1].q).max() < 1e-7
