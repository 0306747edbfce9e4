"""Impacts: the laws of Signorini, Newton and Coulomb, and no shape that passes another."""

from itertools import product
from typing import Any

import numpy as np
import pytest
from scipy.optimize import brentq, nnls
from scipy.spatial.transform import Rotation

import pgraph_core as pg
from pgraph_core.engine.arrays import LAMBDA
from pgraph_core.simulation.event_scene import EventScene

from ..nights import combined
from ..worlds import ball, box, heaped, on_ground

G = 9.81
INSTANT = 1e-13  # s
WAYS = {
    "stepping": {"method": "moreau_jean", "step": INSTANT},
    "events": {"method": "dopri5", "rtol": 1e-10},
}
QUIET = {"frames": 2, "estimate": False}


def hit(mech, q, v, way):
    run = pg.simulate(mech, q, v, t_end=INSTANT, **QUIET, **WAYS[way])
    assert run.status.ok, run.message
    return run.v[-1]


def scene(bodies, point=(0.0, 0.0, 0.0), **law):
    tip = pg.Contact(name="tip", body=bodies[-1].name, points=(point,), **law)
    model = pg.Model(bodies=bodies, contacts=(tip,), gravity=(0, 0, 0))
    mech = pg.Mechanism(model)
    q, _ = mech.home()
    position, rotation = mech.pose(q, bodies[-1].name)
    height = (position + rotation @ np.array(point))[2]
    return pg.Mechanism(model.edit(bodies[0].name, link=(0.0, 0.0, -height)))


def legs(rng, **law):
    """Five oblique hinges, masses a hundredfold apart."""
    bodies = [
        pg.Body(
            name=f"b{k}", parent=f"b{k - 1}" if k else "ground", axes=rng.normal(size=(1, 3)),
            link=rng.normal(size=3) if k else (0, 0, 0), com=rng.normal(size=3),
            mass=10 ** rng.uniform(-1, 1), inertia=np.diag(rng.uniform(0.5, 0.9, 3)),
        )
        for k in range(5)
    ]  # fmt: skip
    return scene(bodies, (0.2, 0.1, -0.3), **law)


def planar(rng, **law):
    motions = ("translate", (1, 0, 0)), ("translate", (0, 0, 1)), ("rotate", (0, 1, 0))
    return scene(
        [pg.Body(name="b", joint="compound", motions=motions, inertia=0.1 * np.eye(3))],
        tuple(rng.normal(size=3) * (1, 0, 1)), **law,
    )  # fmt: skip


def uneven(rng, **law):
    inertia = np.diag((0.5, 0.5, 10 ** rng.uniform(-3, 0)))
    return scene([pg.Body(name="b", joint="free", inertia=inertia)], rng.normal(size=3), **law)


def assert_laws(mech, q, before, after, mu, slack=1e-8):
    """The impulse acts at the contact, stops it, lies in the cone and opposes the slip."""
    (contact,) = mech.model.contacts
    J = mech.jacobian(q, contact.body, contact.points[0])[3:]
    M = mech.mass_matrix(q)
    taken = M @ (after - before)
    impulse = np.linalg.lstsq(J.T, taken, rcond=1e-12)[0]
    size = np.abs(impulse).max()
    np.testing.assert_allclose(J.T @ impulse, taken, atol=slack * np.abs(taken).max())
    u = J @ after
    fastest = np.abs(J @ before).max() + np.abs(J @ np.linalg.solve(M, J.T) @ impulse).max()
    assert impulse[2] > 0
    assert abs(u[2]) < slack * fastest
    drag, slip = np.hypot(*impulse[:2]), np.hypot(*u[:2])
    assert drag <= mu * impulse[2] + slack * size
    opposed = -mu * impulse[2] * slip
    assert impulse[:2] @ u[:2] == pytest.approx(opposed, abs=slack * size * fastest)
    assert after @ M @ after <= before @ M @ before * (1 + slack)
    return "slips" if slip > slack * fastest else "sticks"


@pytest.mark.parametrize("way", WAYS)
@pytest.mark.parametrize("kind", [legs, planar, uneven])
def test_the_impulse_of_one_contact_keeps_its_laws(kind, way):
    rng, seen = np.random.default_rng(0), set()
    for n in range(24):
        mu = (0.0, 0.05, 0.3, 2.0)[n % 4]
        mech = kind(rng, friction=mu)
        q, v = mech.home()[0], rng.normal(size=mech.nv)
        tip = mech.model.contacts[0]
        v *= -np.sign((mech.jacobian(q, tip.body, tip.points[0])[5:] @ v)[0])
        seen.add(assert_laws(mech, q, v, hit(mech, q, v, way), mu))
    assert seen == {"slips", "sticks"}


@pytest.mark.parametrize(
    ("lever", "slip"), combined([1e-2, 1e-9, 1e-160, 1e-310], [1e-2, 1e-9, 1e-160, 1e-310])
)
def test_a_spike_with_next_to_no_inertia_about_its_axis_keeps_the_laws(lever, slip):
    """Products of the smallest levers and slips underflow."""
    rng = np.random.default_rng(7)
    for mu in (0.0, 0.3):
        inertia = np.diag([1e-2, 1e-2, 1e-12])
        point = (*(rng.normal(size=2) * lever), -0.5)
        mech = scene([pg.Body(name="b", joint="free", inertia=inertia)], point, friction=mu)
        v = np.array([0, 0, 0, *(rng.normal(size=2) * slip), -1.0])
        after = hit(mech, mech.home()[0], v, "events")
        assert_laws(mech, mech.home()[0], v, after, mu, 1e-7)


def rod_impulse(plane, u, mu, e):
    """(case, (normal, drag)) by Coulomb's and Newton's laws, or None if several solutions fit."""
    goal = np.array([(1 + e) * u[0], u[1]])
    found = {"ends": -np.linalg.solve(plane, goal)}
    if abs(found["ends"][1]) > mu * found["ends"][0]:
        del found["ends"]
    for sign in (1.0, -1.0):
        along = np.array([1.0, -sign * mu])
        rim = -goal[0] / float(plane[0] @ along) * along
        if rim[0] > 0 and sign * float((goal + plane @ rim)[1]) > 0:
            found["goes on" if sign * u[1] > 0 else "turns"] = rim
    return found.popitem() if len(found) == 1 else None  # else Painlevé's cases


@pytest.mark.parametrize(("way", "friction", "e"), combined(WAYS, [0.05, 0.3, 1.0], [0.0, 0.5]))
def test_the_slip_of_a_rod_in_a_plane_goes_on_ends_or_turns(way, friction, e):
    """A free rod of 1 kg at many angles, in planes that are turned about the vertical."""
    seen = set()
    tip = pg.Contact(name="tip", body="rod", points=((-0.5, 0, 0),), friction=friction,
                     restitution=e)  # fmt: skip
    rod = pg.Body(name="rod", joint="free", inertia=np.diag([1e-3, 1 / 12, 1 / 12]))
    mech = pg.Mechanism(pg.Model(bodies=(rod,), contacts=(tip,), gravity=(0, 0, 0)))
    for angle, slip in product(np.linspace(0.1, 1.5, 5), (-0.1, 0.1, 2.0)):
        x, z = -0.5 * np.cos(angle), -0.5 * np.sin(angle)  # of the tip from the middle
        plane = np.eye(2) + 12 * np.array([[x * x, -x * z], [-x * z, z * z]])
        known = rod_impulse(plane, (-2.0, slip), friction, e)
        if known is None:
            continue
        case, impulse = known
        gained = impulse @ (np.array([-2.0, slip]) + plane @ impulse / 2)
        if gained > 0:  # Newton's restitution would raise the energy and is left out
            known = rod_impulse(plane, (-2.0, slip), friction, 0.0)
            case, impulse = known
        yaw = Rotation.from_euler("z", 0.7 + angle)
        turn = yaw * Rotation.from_euler("y", -angle)
        q = np.array([0, 0, -z, *turn.as_quat(scalar_first=True)])
        v = np.array([0, 0, 0, *yaw.apply((slip, 0, -2.0))])
        after = hit(mech, q, v, way)
        np.testing.assert_allclose(
            after[3:] - v[3:], yaw.apply((impulse[1], 0, impulse[0])), atol=1e-9, err_msg=case
        )
        seen.add(case)
    assert "turns" in seen or friction > 0.3


RIM = [np.array((np.cos(a), np.sin(a))) for a in np.arange(64) * np.pi / 32]  # of a cone
BOTTOMS = {
    "edge": [(0.1, y, -0.1) for y in (-0.1, 0.1)],
    "face": [(x, y, -0.1) for x in (-0.1, 0.1) for y in (-0.1, 0.1)],
    "rim": [(0.2 * np.cos(a), 0.2 * np.sin(a), -0.1) for a in np.arange(8) * np.pi / 4],
}


@pytest.mark.parametrize(
    ("way", "bottom", "mu", "e"), combined(WAYS, BOTTOMS, [0.0, 0.3, 0.8], [0.0, 0.5])
)
def test_points_that_hit_at_once_stop_or_bounce(way, bottom, mu, e):
    """The impulse is a sum of such as keep the laws at each point, and the energy falls."""
    points = np.array(BOTTOMS[bottom])
    inertia = np.diag([0.02, 0.03, 0.04])
    block = pg.Body(name="block", joint="free", mass=1.0, inertia=inertia)
    floor = pg.Contact(name="c", body="block", points=points, friction=mu, restitution=e)
    mech = pg.Mechanism(pg.Model(bodies=[block], contacts=[floor], gravity=(0, 0, 0)))
    random, q = np.random.default_rng(3), np.array([0, 0, 0.1, 1.0, 0, 0, 0])
    for _ in range(4):
        v = random.normal(size=6)
        v[5] = -2 - abs(v[5])
        after = hit(mech, q, v, way)
        first, last = (x[3:] + np.cross(x[:3], points) for x in (v, after))
        slack = 1e-9 * np.abs(first).max()
        goal = -e * np.minimum(first[:, 2], 0.0)
        kept = (last[:, 2] >= goal - slack).all()
        assert kept or (e > 0 and (last[:, 2] >= -slack).all())
        goal = goal if kept else 0.0 * goal
        push = after[3:] - v[3:]
        moment = inertia @ (after[:3] - v[:3])
        assert np.hypot(*push[:2]) <= mu * push[2] + slack
        assert after[3:] @ after[3:] + after[:3] @ inertia @ after[:3] < (
            v[3:] @ v[3:] + v[:3] @ inertia @ v[:3]
        )
        if bottom == "edge" and way == "events":
            again = hit(mech, q, v, "stepping")
            np.testing.assert_allclose(after, again, atol=1e-9 * np.abs(v).max())
        columns, sticks = [], False
        for point, u in zip(points, last - goal[:, None] * (0, 0, 1)):
            if u[2] < 1e-7:  # only a point that has come to rest, or bounced, may push
                sticks |= np.hypot(*u[:2]) < 1e-6
                drags = RIM if np.hypot(*u[:2]) < 1e-6 else [-u[:2] / np.hypot(*u[:2])]
                forces = [(*(mu * drag), 1.0) for drag in drags]
                columns += [(*np.cross(point, force), *force) for force in forces]
        _, missed = nnls(np.array(columns).T, np.concatenate((moment, push)))
        assert missed < (2e-3 if sticks else 1e-6) * push[2]


FACES = {
    2: [(0.5, 0, -0.05), (-0.5, 0, -0.05)],
    3: [(0.5, 0.2, -0.05), (0.5, -0.2, -0.05), (-0.5, 0.1, -0.05)],
    4: [(x, y, -0.05) for x in (0.5, -0.5) for y in (0.2, -0.2)],
    6: [(x, y, -0.05) for x in (0.5, 0, -0.5) for y in (0.2, -0.2)],
}


LOCATED = {"method": "dop853"}, {"method": "moreau_jean", "step": 1e-5}


def runs_of(mech, q, v, t_end, way):
    return pg.simulate(mech, q, v, t_end=t_end, **QUIET, **way)


def plate(points, com, **law):
    body = pg.Body(name="b", joint="free", inertia=(0.02, 0.09, 0.1), com=(com, 0, 0))
    floor = pg.Contact(name="c", body="b", points=points, **law)
    return pg.Mechanism(pg.Model(bodies=[body], contacts=[floor], gravity=(0, 0, 0)))


@pytest.mark.parametrize("count", [4, pytest.param(60, marks=pytest.mark.nightly)])
@pytest.mark.parametrize("points", FACES)
def test_an_impact_of_a_face_has_one_answer_for_both_methods_and_all_orders(points, count):
    """A flat face that spins and slips, with friction 0 to 1.2 and restitution 0 to 1."""
    rng, q = np.random.default_rng(points), np.array([0, 0, 0.05 + 1e-5, 1, 0, 0, 0.0])
    for n in range(count):
        law = {"friction": 1.2 * rng.random() * (n % 5 > 0), "restitution": rng.random()}
        law["restitution"] = (0.0, law["restitution"], 1.0)[n % 3]
        com, v = rng.uniform(-0.3, 0.3), np.array([0, 0, 2 * rng.normal(), *rng.normal(size=2), -2])
        orders = [rng.permutation(FACES[points]) for _ in range(3)]
        plates = [plate(order, com, **law) for order in orders]
        runs = [runs_of(mech, q, v, 1e-5, way) for mech, way in product(plates, LOCATED)]
        ends = [run.v[-1] for run in runs]
        np.testing.assert_allclose(ends, np.tile(ends[0], (6, 1)), atol=1e-8 * np.abs(v).max())
        for run in runs:
            assert run.kinetic_energy[-1] <= run.kinetic_energy[0] * (1 + 1e-9)


@pytest.mark.parametrize(("points", "spin", "way"), combined(FACES, [0.0, 2.0], LOCATED))
def test_an_impact_whose_impulses_are_not_unique_is_named(points, spin, way):
    """Points of a face that spins slide in different ways, so that their shares matter."""
    mech = plate(FACES[points], 0.1, friction=0.2, restitution=0.5)
    q, v = np.array([0, 0, 0.05, 1, 0, 0, 0.0]), np.array([0, 0, spin, 0.7, -0.4, -2.0])
    run = runs_of(mech, q, v, 1e-5, way)
    told = [x for x in run.notices if "not unique" in x and "'b'" in x and "contact 'c'" in x]
    assert len(told) == (spin > 0 and points > 3)


@pytest.mark.parametrize("height", [0.0, 3e-5, 2e-3])
@pytest.mark.parametrize("spin", [0.0, 2.0])
def test_impacts_within_a_step_name_impulses_that_are_not_unique(height, spin):
    """Of one box on another, whose faces have shapes: the upper one spins as it lands."""
    box: dict[str, Any] = {"joint": "free", "shape": {"kind": "box", "size": (0.2, 0.3, 0.1)}}
    box |= {"derived": ("inertia",), "mass": 2.0}
    low = pg.Body(name="low", q=(0, 0, 0.05, 1, 0, 0, 0), **box)
    high = pg.Body(name="high", q=(0, 0, 0.15 + height, 1, 0, 0, 0), **box)
    pair = pg.Contact(name="c", body="high", other="low", friction=0.2)
    floor = pg.Contact(name="floor", body="low", friction=0.2)
    model = pg.Model(bodies=[low, high], contacts=[floor, pair])
    v = np.array([0.0] * 6 + [0, 0, spin, 1.5, 0.0, -2.0])
    run = pg.simulate(model, v=v, t_end=2e-3, step=1e-3, method="moreau_jean", **QUIET)
    told = [x for x in run.notices if "in an impact" in x]
    assert len(told) == (spin > 0)
    assert all("'high' and 'low'" in x or "'low' and the ground" in x for x in told)


@pytest.mark.parametrize(
    ("com", "friction", "spin", "slip", "across"),
    [(-0.024, 0.234, 1.644, 0.314, 0.201), (-0.129, 0.499, -1.287, -0.362, 1.005)],
)
def test_points_that_stop_in_an_impact_share_it_in_equal_parts(
    monkeypatch, com, friction, spin, slip, across
):
    """Friction along the line through two points is not unique: the least norm has equal parts."""
    shares = []

    def impact(self, *given):
        found = hits(self, *given)
        shares.append(self.space.vectors[LAMBDA, :6].reshape(2, 3).copy())
        return found

    hits = EventScene.impact
    monkeypatch.setattr(EventScene, "impact", impact)
    model = plate([(0.5, 0, -0.05), (-0.5, 0, -0.05)], com, friction=friction, restitution=0.6)
    start = {"q": (0, 0, 0.0501, 1, 0, 0, 0), "v": (0, 0, spin, slip, across, -2.0)}
    pg.simulate(model, t_end=1e-4, method="dop853", estimate=False, **start)
    (found,) = shares
    sticks = np.hypot(found[:, 1], found[:, 2]) < friction * found[:, 0]
    assert sticks.all()
    assert abs(found[0, 2] - found[1, 2]) < 1e-4 * found[:, 0].max()  # 2e-5 by compliance


def test_a_box_that_lands_on_a_face_does_not_feel_how_the_scene_is_turned():
    """Two corners rest when the face slaps down. Rounding must not choose a solution."""
    tilt = Rotation.from_rotvec(0.3 * np.array([1, 2, 0.5]) / np.linalg.norm([1, 2, 0.5]))
    ends = []
    for angle in (0.0, 0.2, 0.3):
        yaw = Rotation.from_rotvec([0, 0, angle])
        q = (0, 0, 0.3, *(yaw * tilt).as_quat()[[3, 0, 1, 2]])
        v = (0, 0, 0, *yaw.apply([1, 0.5, 0]))
        model = on_ground(box("b", (0, 0, 0), (0.3, 0.2, 0.1), q=q, v=v), friction=0.5)
        run = pg.simulate(model, t_end=0.4, rtol=1e-8, method="dop853", **QUIET)
        ends.append(yaw.inv().apply(run.q[-1, :3].copy()))
    np.testing.assert_allclose(ends, np.tile(ends[0], (3, 1)), atol=1e-7)


@pytest.mark.parametrize("turn", [1, 3, 4])
def test_a_rod_that_leaves_a_tilted_plane_at_once_hits_it_once(turn):
    """Its end rests for an instant, then rotation lifts it: rounding is no second impact."""
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
    run = pg.simulate(model, t_end=0.06, step=1e-3, method="rk4", **QUIET)
    assert run.status.ok
    assert run.counters["impacts"] == 1


@pytest.mark.parametrize("speed", [1.0, 1000.0])
@pytest.mark.parametrize(("radius", "wall"), [(1e-3, 1e-3), (0.01, 0.005), (0.1, 1e-3)])
def test_a_ball_turns_at_a_wall_however_thin_and_fast(speed, radius, wall):
    bodies = (
        ball("ball", (0, 0, 0), radius, v=(0, 0, 0, speed, 0, 0)),
        box("plate", (0.3 + radius + 0.5 * wall, 0, 0), (wall, 2.0, 2.0), joint="weld"),
    )
    hit = pg.Contact(name="hit", body="ball", other="plate", restitution=0.5)
    model = pg.Model(bodies=bodies, gravity=(0, 0, 0), contacts=(hit,))
    run = pg.simulate(model, t_end=0.45 / speed, step=1e-3, method="moreau_jean", estimate=False)
    assert run.v[-1, 3] == pytest.approx(-0.5 * speed, rel=1e-12)
    assert run.q[-1, 0] == pytest.approx(0.3 - 0.5 * 0.15, abs=1e-9)


WEDGE = """v -.01 -.01 -.001\nv -.01 .01 -.001\nv .01 -.01 -.001\nv .01 .01 -.001
v -.01 0 .002\nv .01 0 .002
f 1 2 4\nf 1 4 3\nf 1 5 2\nf 3 4 6\nf 2 5 6\nf 2 6 4\nf 1 3 6\nf 1 6 5\n"""
BULLETS = {
    "plate": {"kind": "box", "size": (1e-3, 0.02, 0.02)},
    "capsule": {"kind": "capsule", "radius": 1e-3, "length": 0.02},
    "cylinder": {"kind": "cylinder", "radius": 0.02 / 6, "length": 0.02},
    "ellipsoid": {"kind": "ellipsoid", "radii": (0.01, 0.02 / 6, 0.005)},
    "mesh": {"kind": "mesh", "file": "", "hull": "convex"},
}


@pytest.mark.parametrize("kind", BULLETS)
def test_a_tilted_bullet_stays_before_a_thin_wall(kind, tmp_path):
    """At 300 m/s, and however few frames are recorded."""
    shape = dict(BULLETS[kind])
    if kind == "mesh":
        shape["file"] = str(tmp_path / "wedge.obj")
        (tmp_path / "wedge.obj").write_text(WEDGE)
    bullet = pg.Body(
        name="bullet", joint="free", q=(-0.413, 0, 0, np.cos(0.15), 0, np.sin(0.15), 0),
        v=(0, 0, 0, 300.0, 0, 0), mass=0.1, shape=shape, derived=("inertia",),
    )  # fmt: skip
    wall = box("wall", (5e-4, 0, 0), (1e-3, 4.0, 4.0), joint="weld")
    contact = pg.Contact(name="hit", body="bullet", other="wall", friction=0.3)
    model = pg.Model(bodies=(bullet, wall), gravity=(0, 0, 0), contacts=(contact,))
    run = pg.simulate(model, t_end=2 * 0.413 / 300.0, frames=4, estimate=False)
    assert (run["bullet"][:, 0] < 2.5e-4).all()
    assert run.kinetic_energy.max() <= 1.01 * run.kinetic_energy[0]
    assert run.kinetic_energy[-1] < 0.9 * run.kinetic_energy[0]


def test_a_plank_that_tips_over_lies_flat_on_a_thin_slab():
    """Its upper end moves more than its thickness per step."""
    tilt = 0.1
    out, up = np.sin(tilt), np.cos(tilt)
    middle = (0.5 * out - 5e-4 * up, 0.0, 0.5 * up + 5e-4 * out)
    slab = box("slab", (0, 0, -5e-4), (4, 2, 1e-3), joint="weld")
    q = (*middle, np.cos(tilt / 2), 0, np.sin(tilt / 2), 0)
    plank = box("plank", (0, 0, 0), (1e-3, 0.5, 1.0), q=q)
    foot = pg.Contact(name="foot", body="plank", other="slab", friction=1.0)
    model = pg.Model(bodies=(plank, slab), contacts=(foot,))
    run = pg.simulate(model, t_end=2.0, step=1e-3, frames=3, estimate=False)
    assert run["plank"][-1, 2] == pytest.approx(5e-4, abs=1e-5)


def rebounds(masses, x, u, width, e, t_end):
    t, x, u = 0.0, x.copy(), u.copy()
    while True:
        closing = u[:-1] - u[1:]
        gap = np.maximum(np.diff(x) - width, 0.0)
        times = np.where(closing > 1e-12, gap / np.where(closing > 1e-12, closing, 1.0), np.inf)
        k = int(np.argmin(times))
        if t + times[k] > t_end:
            return x + u * (t_end - t), u
        x, t = x + u * times[k], t + times[k]
        a, b = masses[k], masses[k + 1]
        p = (1 + e) * closing[k] * a * b / (a + b)
        u[k] -= p / a
        u[k + 1] += p / b


@pytest.mark.parametrize(("count", "e"), [(3, 0.9), (5, 1.0), (4, 0.5), (3, 0.0)])
def test_a_chain_of_balls_hits_in_turn(count, e):
    """Several impacts within one step follow each other: momentum and Newton's law."""
    masses, places = 1.0 + np.arange(count), 0.201 * np.arange(count)
    bodies = tuple(
        pg.Body(name=f"b{k}", joint="prismatic", axes=((1, 0, 0),), link=(places[k], 0, 0),
                mass=masses[k], shape={"kind": "sphere", "radius": 0.1})
        for k in range(count)
    )  # fmt: skip
    contacts = tuple(
        pg.Contact(name=f"c{k}", body=f"b{k}", other=f"b{k + 1}", restitution=e)
        for k in range(count - 1)
    )
    mech = pg.Mechanism(pg.Model(bodies=bodies, gravity=(0, 0, 0), contacts=contacts))
    speeds = np.eye(count)[0]
    run = pg.simulate(mech, np.zeros(count), speeds, t_end=0.2, step=1e-2, method="moreau_jean")
    x, u = rebounds(masses, places, speeds, 0.2, e, 0.2)
    np.testing.assert_allclose(run.q[-1], x - places, atol=1e-9)
    np.testing.assert_allclose(run.v[-1], u, atol=1e-9)


def test_an_impact_in_the_last_step_happens():
    fall = np.sqrt(2 / G)
    end = fall + 2e-4
    model = on_ground(ball(place=(0, 0, 1.1)), restitution=0.5)
    run = pg.simulate(model, t_end=end, step=end / 452, method="moreau_jean")
    assert run.v[-1, 5] == pytest.approx(0.5 * G * fall - G * 2e-4, abs=1e-6)


@pytest.mark.parametrize(("size", "e", "high"), combined([1e-9, 1e6], [0.0, 0.5, 1.0], [3.0, None]))
def test_limits_of_all_sizes_are_hit_when_they_must(size, e, high):
    """A slider falls on its stop and bounces: no threshold has a unit."""
    body = pg.Body(
        name="b", joint="prismatic", axes=((0, 0, 1),), q=(size,), inertia=np.zeros((3, 3)),
        limits=((0.0, high and high * size),), limit_restitution=(e,),
    )  # fmt: skip
    run = pg.simulate(pg.Model(bodies=(body,), gravity=(0, 0, -G * size)), t_end=1.0, frames=101)
    fall = np.sqrt(2 / G)
    after = run.t - fall
    rise = np.where(after < 2 * e * fall, e * G * fall * after - 0.5 * G * after**2, np.nan)
    rise = np.where(after < 0, 1 - 0.5 * G * run.t**2, rise)
    rise = np.zeros(101) if e == 0.0 else rise
    known = np.isfinite(rise) & ((e > 0.0) | (after > 0))
    assert known.sum() > 40
    assert np.abs(run.q[known, 0] / size - rise[known]).max() < 1e-9


@pytest.mark.parametrize(
    ("tilt", "restitution", "step"), combined([1e-5, 3e-4, 2e-3], [0.3, 0.5], [1e-3, 1e-4])
)
def test_corners_that_land_in_turn_are_hit_in_turn(tilt, restitution, step):
    """A plate that lands nearly flat, against an event-driven run."""
    up = 0.1 * np.cos(tilt) + 0.5 * np.sin(tilt) + 0.2
    q = (0, 0, up, np.cos(tilt / 2), 0, np.sin(tilt / 2), 0)
    plate = box(place=(0, 0, 0), size=(1, 1, 0.2), q=q)
    model = on_ground(plate, friction=0.0, restitution=restitution)
    t_end = (0.4 / 9.81) ** 0.5 + 0.12
    exact = pg.simulate(model, t_end=t_end, method="dop853", estimate=False)
    run = pg.simulate(model, t_end=t_end, step=step)
    error = abs(2 * run["b"][-1, 5] - 2 * exact["b"][-1, 5])
    assert error < max(1e-9, 3 * run.error_estimate)
    assert run.error_estimate < 3e-4


def test_corners_that_land_together_keep_a_mirror_symmetry():
    """A ball falls on a plank on a roller, whose end hits the floor with two corners."""
    quarter = (np.sqrt(0.5), np.sqrt(0.5), 0, 0)
    bodies = [
        pg.Body(
            name="roller", joint="free", q=(0, 0, 0.1, *quarter), mass=2.0,
            inertia=np.diag((0.0317, 0.0317, 0.01)),
            shape={"kind": "cylinder", "radius": 0.1, "length": 0.4},
        ),
        box("plank", (0.02, 0, 0.215), (1.0, 0.2, 0.03)),
        ball("ball", (0.4, 0, 0.55), 0.05, mass=0.5),
    ]  # fmt: skip
    model = heaped(bodies, friction=0.8, restitution=0.3)
    run = pg.simulate(model, t_end=0.45, step=1e-3, method="moreau_jean", estimate=False)
    turned = run.v[:, 6:9]
    assert np.abs(turned[:, 1]).max() > 1.0
    assert np.abs(run["plank"][:, 1]).max() < 1e-6
    assert np.abs(turned[:, [0, 2]]).max() < 1e-3  # 6 rad/s where one corner is hit first


@pytest.mark.parametrize("rtol", [1e-4, 1e-6, 1e-9])
@pytest.mark.parametrize("speed", [0.0, 2.0])
def test_a_flat_impact_misses_no_force(rtol, speed):
    """Rounding of 1e-31 rad/s^2 in a box that does not turn was called a pulse that was missed."""
    shape = {"kind": "box", "size": (0.4, 0.3, 0.2)}
    box = pg.Body(
        name="box", joint="free", mass=2, link=(0, 0, 0.2), v=(0, 0, speed, 0, 0, 0), shape=shape,
        derived=("inertia",),
    )  # fmt: skip
    floor = pg.Contact(name="floor", body="box", friction=0.5, restitution=0.5)
    run = pg.simulate(pg.Model(bodies=[box], contacts=[floor]), t_end=0.2, rtol=rtol)
    assert run.notices == ()


@pytest.mark.parametrize(
    ("tilt", "spin", "fall", "height"),
    [(-0.03, 5.0, 0.71, 0.108), (-0.03, 5.0, 0.8, 0.1085)],
)
def test_a_cylinder_that_tips_over_its_flat_lands_on_the_other_side(tilt, spin, fall, height):
    """Its rim's lowest point changes sides within the step; the impulse is Newton's."""
    radius, half, step = 0.2, 0.1, 1e-2
    shape = {"kind": "cylinder", "radius": radius, "length": 2 * half}
    body = pg.Body(name="c", joint="free", derived=("inertia",), shape=shape)
    floor = pg.Contact(name="floor", body="c", friction=0.0, restitution=1.0)
    q = (0, 0, height, np.cos(tilt / 2), 0, np.sin(tilt / 2), 0)
    run = pg.simulate(
        pg.Model(bodies=[body], contacts=[floor]), q=q, v=(0, spin, 0, 0, 0, -fall), t_end=step,
        step=step, method="moreau_jean", **QUIET,
    )  # fmt: skip

    def lowest(t):
        angle = tilt + spin * t
        way = radius * abs(np.sin(angle)) + half * np.cos(angle)
        return height - fall * t - 0.5 * G * t * t - way

    flat = -tilt / spin
    landed = brentq(lowest, flat, step)
    assert lowest(0.0) > 0.0
    assert lowest(flat) > 0.0
    angle = tilt + spin * landed
    arm, inertia = radius * np.cos(angle) - half * np.sin(angle), (3 * radius**2 + 4 * half**2) / 12
    push = 2 * (fall + G * landed + spin * arm) / (1 + arm**2 / inertia)
    np.testing.assert_allclose(
        run.v[-1], [0, spin - push * arm / inertia, 0, 0, 0, push - fall - G * step], atol=1e-6
    )


@pytest.mark.parametrize(
    ("places", "size", "named"),
    [
        ((-0.4, 0.4), None, False),
        ((-0.4, 0.1, 0.4), None, True),
        ((-0.4, 0.4), (0.02, 0.4, 0.2), True),
    ],
)
def test_an_impact_on_several_bodies_names_shares_that_are_not_unique(places, size, named):
    """A bar on three balls, of which one could be left out, and a plate on two rails."""
    shape = {"kind": "box", "size": size} if size else {"kind": "sphere", "radius": 0.1}
    low = [
        pg.Body(name=f"low {n}", axes=(0, 0, 1), link=(x, 0, 0), inertia=np.eye(3), shape=shape)
        for n, x in enumerate(places)
    ]
    high = pg.Body(
        name="high", joint="free", q=(0, 0, 0.15 + 1e-5, 1, 0, 0, 0), v=(0, 0, 0, 0, 0, -2.0),
        derived=("inertia",), shape={"kind": "box", "size": (1.0, 0.6 if size else 0.1, 0.1)},
    )  # fmt: skip
    pairs = [pg.Contact(name=b.name, body="high", other=b.name, friction=0.0) for b in low]
    model = pg.Model(bodies=[high, *low], contacts=pairs, gravity=(0, 0, 0))
    run = pg.simulate(model, t_end=2e-3, step=1e-3, method="moreau_jean", **QUIET)
    told = [x for x in run.notices if "in an impact" in x and "not unique" in x]
    assert len(told) == named


@pytest.mark.parametrize(("apart", "told"), [(3e-10, True), (1e-3, False)])
def test_impacts_in_turn_at_one_time_are_told(apart, told):
    """A foot lands and bounces into the stop below its load, which is so far from it then."""
    speed = -(0.1 - apart) / np.sqrt(2 * 0.5 / G)
    foot = pg.Body(name="foot", joint="prismatic", axes=((0, 0, 1),), mass=1.0, q=(0.5,))
    load = pg.Body(
        name="load", parent="foot", joint="prismatic", axes=((0, 0, 1),), mass=2.0, q=(0.1,),
        v=(speed,), limits=((0.0, 1.0),), limit_restitution=(0.2,),
    )  # fmt: skip
    floor = pg.Contact(name="floor", body="foot", points=((0, 0, 0),), restitution=0.4)
    model = pg.Model(bodies=[foot, load], contacts=[floor])
    run = pg.simulate(model, t_end=0.4, method="dop853", rtol=1e-9, estimate=False)
    assert any("in turn" in text and "load" in text for text in run.notices) == told
