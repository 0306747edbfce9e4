"""Impulses of one contact with friction: its laws, from sites that stick to levers of no length."""

from __future__ import annotations

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

import pgraph_core as pg
from pgraph_core.contact import impacts
from pgraph_core.simulation.event_scene import EventScene

SMALLEST = (1e-2, 1e-9, 1e-160, 1e-310)  # products of the last ones underflow


def thin_spike(random, lever):
    """Ω at the tip of a spike whose axis carries next to no inertia, `lever` m beside it."""
    inertia = np.diag([1e-2, 1e-2, 1e-12])
    x, y, z = random.normal() * lever, random.normal() * lever, -0.5
    cross = np.array([[0, -z, y], [z, 0, -x], [-y, x, 0]])
    omega = np.eye(3) - cross @ np.linalg.inv(inertia) @ cross
    return (omega + omega.T)[[2, 0, 1]][:, [2, 0, 1]] / 2


@pytest.mark.parametrize("friction", [0.0, 1e-3, 0.3, 2.0])
@pytest.mark.parametrize("lever", SMALLEST)
@pytest.mark.parametrize("slip", SMALLEST)
def test_a_contact_stops_and_friction_opposes_its_slip(friction, lever, slip):
    """Without friction or slip too: 1e-9 of the impulses, whose lever multiplies rounding."""
    random = np.random.default_rng(7)
    for _ in range(5):
        omega = thin_spike(random, lever)
        u = random.normal(size=3) * (1.0, slip, slip)
        u[0] = -abs(u[0])
        solved = impacts.impulses(omega, u, 0, [impacts.ContactRow(0, 3, friction, 0.0)])
        lam, after = solved.impulse, solved.velocity
        rounding = 1e-9 * float((np.abs(omega) @ np.abs(lam)).max())
        assert lam[0] > 0
        assert after[0] == pytest.approx(0.0, abs=rounding)
        assert np.hypot(*lam[1:]) <= friction * lam[0] * (1 + 1e-9)
        left = float(np.hypot(*after[1:]))
        opposed = float(lam[1:] @ after[1:])
        assert opposed == pytest.approx(-friction * lam[0] * left, abs=rounding * lam[0])
        assert solved.gain <= rounding * lam[0]


@pytest.mark.parametrize("way", [(1.0, 0.0), (-1.0, 0.0), (0.0, 1.0), (0.0, -1.0), (0.6, 0.8)])
@pytest.mark.parametrize("friction", [0.05, 0.3, 1.0])
@pytest.mark.parametrize("e", [0.0, 0.5])
def test_the_slip_of_a_rod_in_a_plane_goes_on_ends_or_turns_round(way, friction, e):
    """The one solution of Coulomb's and Newton's laws, by cases, for a rod at many angles."""
    seen = set()
    for angle in np.linspace(0.1, 1.5, 15):
        for slip in (-2.0, -0.1, 0.0, 0.1, 0.5, 2.0):
            x, z = -0.5 * np.cos(angle), -0.5 * np.sin(angle)  # of the end from the middle, 1 kg
            plane = np.eye(2) + 12 * np.array([[x * x, -x * z], [-x * z, z * z]])
            goal = np.array([-2.0 * (1 + e), slip])
            found = {"ends": -np.linalg.solve(plane, goal)}
            if abs(found["ends"][1]) > friction * found["ends"][0]:
                del found["ends"]
            for sign in (1.0, -1.0):
                along = np.array([1.0, -sign * friction])
                rim = -goal[0] / float(plane[0] @ along) * along
                if rim[0] > 0 and sign * float((goal + plane @ rim)[1]) > 0:
                    found["goes on" if sign * slip > 0 else "turns"] = rim
            if len(found) != 1:
                continue  # Painlevé's cases
            ((case, (normal, drag)),) = found.items()
            turned = np.zeros((3, 2))
            turned[0, 0], turned[1:, 1] = 1.0, way
            across = np.diag([0.0, way[1] ** 2, way[0] ** 2])
            across[1, 2] = across[2, 1] = -way[0] * way[1]
            omega, u = turned @ plane @ turned.T + across, turned @ np.array([-2.0, slip])
            row = impacts.ContactRow(0, 3, friction, -2.0 * e)
            solved = impacts.impulses(omega, u, 0, [row])
            wanted = turned @ np.array([normal, drag])
            np.testing.assert_allclose(solved.impulse, wanted, atol=1e-12 * normal, err_msg=case)
            seen.add(case)
    assert "turns" in seen or friction > 0.3


def block_on(points):
    """Ω of a block of 1 kg at points of its bottom: rows normal, x, y of each."""
    inverse = np.linalg.inv(np.diag([0.02, 0.03, 0.04]))
    rows = []
    for x, y, z in points:
        arm = np.array([[0, -z, y], [z, 0, -x], [-y, x, 0]])
        rows.append(np.hstack((-arm, np.eye(3)))[[2, 0, 1]])
    jacobian = np.vstack(rows)
    mass = np.block([[inverse, np.zeros((3, 3))], [np.zeros((3, 3)), np.eye(3)]])
    return jacobian, jacobian @ mass @ jacobian.T


BOTTOMS = {
    "edge": [(0.1, y, -0.1) for y in (-0.1, 0.1)],
    "face": [(x, y, -0.1) for x in (-0.1, 0.1) for y in (-0.1, 0.1)],
    "rim": [(0.2 * np.cos(a), 0.2 * np.sin(a), -0.1) for a in np.arange(8) * np.pi / 4],
}


@pytest.mark.parametrize("bottom", BOTTOMS)
@pytest.mark.parametrize("friction", [0.0, 0.3, 0.8])
@pytest.mark.parametrize("restitution", [0.0, 0.5])
def test_several_points_stop_or_bounce_and_friction_opposes_each_slip(
    bottom, friction, restitution
):
    """1e-11 of the largest velocity or impulse: where Newton's method has arrived."""
    random = np.random.default_rng(3)
    jacobian, omega = block_on(BOTTOMS[bottom])
    for _ in range(10):
        motion = random.normal(size=6)
        motion[5] = -2 - abs(motion[5])
        u = jacobian @ motion
        firsts = range(0, len(u), 3)
        backs = [restitution * min(u[n], 0.0) for n in firsts]
        rows = [impacts.ContactRow(n, 3, friction, back) for n, back in zip(firsts, backs)]
        solved = impacts.impulses(omega, u, 0, rows)
        lam, after = solved.impulse, solved.velocity
        most, fastest = np.abs(lam).max(), np.abs(u).max()
        assert after == pytest.approx(u + omega @ lam, abs=1e-12 * fastest)
        for n, back in zip(firsts, backs):
            left, slip, drag = after[n] + back, after[n + 1 : n + 3], lam[n + 1 : n + 3]
            assert min(lam[n] / most, left / fastest) >= -1e-11
            assert abs(lam[n] * left) <= 1e-11 * most * fastest
            rim = friction * lam[n]
            assert np.hypot(*drag) <= rim + 1e-11 * most
            assert drag @ slip == pytest.approx(-rim * np.hypot(*slip), abs=1e-11 * most * fastest)


def test_a_box_that_lands_on_a_face_does_not_feel_how_the_scene_is_turned():
    """When the face slaps down two corners rest to rounding, whose sign chose a solution before."""
    tilt = Rotation.from_rotvec(0.3 * np.array([1, 2, 0.5]) / np.linalg.norm([1, 2, 0.5]))
    inertia = np.diag([0.05, 0.1, 0.13]) / 12
    ends = []
    for angle in (0.0, 0.2, 0.3):
        yaw = Rotation.from_rotvec([0, 0, angle])
        q = (0, 0, 0.3, *(yaw * tilt).as_quat()[[3, 0, 1, 2]])
        v = (0, 0, 0, *yaw.apply([1, 0.5, 0]))
        shape = {"kind": "box", "size": (0.3, 0.2, 0.1)}
        box = pg.Body(name="box", joint="free", q=q, v=v, mass=1, inertia=inertia, shape=shape)
        model = pg.Model(bodies=[box], contacts=[pg.Contact(name="c", body="box", friction=0.5)])
        run = pg.simulate(model, t_end=0.4, rtol=1e-8, method="dop853", frames=2, estimate=False)
        ends.append(yaw.inv().apply(run.q[-1, :3].copy()))
    np.testing.assert_allclose(ends, np.tile(ends[0], (3, 1)), atol=1e-7)


@pytest.mark.parametrize("bottom", ["corner", "edge"])
def test_time_stepping_finds_the_same_velocities(bottom):
    """1e-9 of the largest: its solver ends at 1e-10. One impact, before anything has moved."""
    points = [(0.1, 0.1, -0.1)] if bottom == "corner" else BOTTOMS["edge"]
    block = pg.Body(name="block", joint="free", mass=1.0, inertia=np.diag([0.02, 0.03, 0.04]))
    floor = pg.Contact(name="c", body="block", points=points, friction=0.3, restitution=0.5)
    mech = pg.Mechanism(pg.Model(bodies=[block], contacts=[floor], gravity=(0, 0, 0)))
    random, q = np.random.default_rng(5), np.array([0, 0, 0.1, 1.0, 0, 0, 0])
    for _ in range(5):
        v = random.normal(size=6)
        v[5] = -3 - abs(v[5])
        given = {"t_end": 1e-13, "frames": 2, "estimate": False}
        located = pg.simulate(mech, q, v, method="dopri5", rtol=1e-10, **given)
        stepped = pg.simulate(mech, q, v, method="moreau_jean", step=1e-13, **given)
        assert located.counters["impacts"] == 1
        assert stepped.v[-1] == pytest.approx(located.v[-1], abs=1e-9 * np.abs(v).max())


def test_a_spinning_spike_lands_and_its_energy_is_balanced():
    """A frictionless tip beside the axis by less than can be squared: products underflow."""
    spike = pg.Body(
        name="spike",
        joint="free",
        mass=1.0,
        com=(0.0, 0.0, 0.0),
        inertia=((1e-2, 0.0, 0.0), (0.0, 1e-2, 0.0), (0.0, 0.0, 1e-12)),
        q=(0.0, 0.0, 0.51, 1.0, 0.0, 0.0, 0.0),
        v=(0.0, 0.0, 300.0, 1e-180, 2e-170, 0.0),
    )
    for friction in (0.0, 0.5):
        tip = pg.Contact(
            name="tip",
            body="spike",
            law="complementarity",
            friction=friction,
            points=((1e-200, 0.0, -0.5),),
        )
        model = pg.Model(bodies=(spike,), contacts=(tip,))
        run = pg.simulate(pg.Mechanism(model), t_end=0.06, method="rk4", estimate=False)
        assert run.status.ok, run.message
        assert run.counters["impacts"] > 0
        assert run.energy_drift < 1e-9


def test_an_impact_of_numbers_that_overflowed_is_a_status(monkeypatch):
    """A run that has lost its numbers says so, and keeps what was before."""
    broken = np.full((3, 3), np.nan), np.full(3, np.nan)
    monkeypatch.setattr(EventScene, "impact", lambda *_: broken)
    ball = pg.Body(name="ball", joint="free", q=(0.0, 0.0, 0.1, 1.0, 0.0, 0.0, 0.0))
    floor = pg.Contact(name="floor", body="ball", law="complementarity", points=((0, 0, 0),))
    mech = pg.Mechanism(pg.Model(bodies=(ball,), contacts=(floor,)))
    run = pg.simulate(mech, t_end=0.2, method="rk4", step=1e-3)
    assert run.status is pg.Status.NOT_FINITE
    assert "in the impact at t = 0.142" in run.message
    assert run.t[-1] > 0.14


@pytest.mark.parametrize("turn", [1, 3, 4])
def test_a_rod_that_leaves_a_tilted_plane_at_once_hits_it_once(turn):
    """Without bounce its end rests for an instant, then rotation lifts it: rounding is no hit."""
    random = np.random.default_rng(turn)
    up = np.array([*random.uniform(-0.6, 0.6, 2), 1.0])
    up /= np.linalg.norm(up)
    tilt = Rotation.align_vectors([up], [[0, 0, 1]])[0]
    to_world = tilt * Rotation.from_rotvec([0, 0, random.uniform(0, 6)])
    lean = to_world * Rotation.from_rotvec([0, -np.pi / 4, 0])
    q = (*((0.5 * np.sin(np.pi / 4) + 0.05) * up), *lean.as_quat()[[3, 0, 1, 2]])
    v = (0, 0, 0, *to_world.apply([0.5, 0.0, -1.0]))
    rod = pg.Body(name="rod", joint="free", q=q, v=v, mass=1, inertia=np.diag([1e-3, 1, 1]) / 12)
    ends = pg.Contact(name="c", body="rod", points=[(-0.5, 0, 0), (0.5, 0, 0)], friction=0.6)
    ground = pg.Ground(slope=float(np.arccos(up[2])), uphill=(-up[0], -up[1], 0.0))
    model = pg.Model(bodies=[rod], contacts=[ends], gravity=(0, 0, 0), ground=ground)
    run = pg.simulate(model, t_end=0.06, step=1e-3, method="rk4", frames=2, estimate=False)
    assert run.status.ok
    assert run.counters["impacts"] == 1
