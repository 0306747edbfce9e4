"""Bodies that stand, lie, slide and are held in time stepping: stacks, heaps, grippers."""

import numpy as np
import pytest
from scipy.integrate import solve_ivp
from scipy.spatial.distance import pdist

import pgraph_core as pg

from ..worlds import ball, box, heaped

G, SIDE = 9.81, 0.2


def tower(masses, x=0.0, name="b", side=SIDE):
    return [
        box(f"{name}{i}", (x, 0, side * (i + 0.5)), 3 * (side,), mass=m)
        for i, m in enumerate(masses)
    ]


def run_of(bodies, t_end=0.3, step=1e-3, friction=0.5, **more):
    more = {"frames": 4, "estimate": False, "method": "moreau_jean"} | more
    return pg.simulate(heaped(bodies, friction=friction), t_end=t_end, step=step, **more)


def places(run):
    return run.q[-1].reshape(-1, 7)[:, :3]


@pytest.mark.parametrize(
    ("count", "side", "step"),
    [(2, SIDE, 1e-3), (12, SIDE, 1e-3), (5, 1e-3, 1e-2), (5, 100.0, 1e-4)],
)
def test_stacks_of_equal_boxes_rest(count, side, step):
    """The initial state is the solution, to rounding."""
    run = run_of(tower(count * [1.0], side=side), t_end=100 * step, step=step)
    assert not run.notices
    assert abs(run.v[-1]).max() < 1e-12 * max(1.0, 100 * G * step / side)
    assert abs(places(run)).max() < 1e-12 * max(1.0, side)
    assert run.contact_force["floor[b0]"][-1, 5] == pytest.approx(G * count, rel=1e-9)


@pytest.mark.parametrize("masses", [(1, 1e4), (1e4, 1), (1, 10, 100, 1000), (*9 * (1,), 1e6)])
def test_towers_of_any_mass_ratio_stand(masses):
    """The contacts below a box are redundant, and carry all that is above."""
    run = run_of(tower(masses), t_end=0.1)
    assert not run.notices
    assert abs(run.v[-1]).max() < 1e-8
    assert abs(places(run)).max() < 1e-7
    for i in range(len(masses)):
        name = f"heap[b{i - 1}, b{i}]" if i else "floor[b0]"
        load = abs(run.contact_force[name][-1, 5])
        assert load == pytest.approx(sum(masses[i:]) * G, rel=1e-6)


def even_slide(half, high, mu, speed, spin, seconds):
    """(x, y, angle) of a box on four corners, which carry N = a + b x + c y, of least norm."""
    corners = half * np.array([[1, 1], [-1, 1], [-1, -1], [1, -1]])

    def rates(_t, y):
        turn, speed, spin = y[2], y[3:5], y[5]
        c, d = np.cos(turn), np.sin(turn)
        r = corners @ np.array([[c, d], [-d, c]])
        slip = speed + spin * np.stack([-r[:, 1], r[:, 0]], 1)
        way = -mu * slip / (np.linalg.norm(slip, axis=1)[:, None] + 1e-12)
        pressures = np.c_[np.ones(4), r]
        moments = np.array([np.ones(4), r[:, 1] + high * way[:, 1], -r[:, 0] - high * way[:, 0]])
        normal = pressures @ np.linalg.solve(moments @ pressures, [G, 0, 0])
        f = normal[:, None] * way
        torque = (r[:, 0] * f[:, 1] - r[:, 1] * f[:, 0]).sum()
        return [*speed, spin, *f.sum(axis=0), torque / ((2 * half) ** 2 / 6)]

    start = [0, 0, 0, speed, 0, spin]
    return solve_ivp(rates, (0, seconds), start, rtol=1e-9, atol=1e-11).y[:3, -1]


@pytest.mark.parametrize(("step", "close"), [(1e-2, 0.05), (1e-3, 5e-3), (1e-4, 5e-4)])
def test_a_box_that_slides_and_spins_is_loaded_evenly(step, close):
    """Four corners are redundant: the forces of least norm carry it, at every step."""
    sled = box(place=(0, 0, 0.05), size=(0.2, 0.2, 0.1), v=(0, 0, 8.0, 1.0, 0, 0))
    run = run_of([sled], t_end=0.3, step=step, friction=0.3)
    place = run.body_pose[-1, 0]
    turn = 2 * np.arctan2(place[6], place[3])
    off = np.array([*place[:2], turn]) - even_slide(0.1, 0.05, 0.3, 1.0, 8.0, 0.3)
    assert abs((off + np.pi) % (2 * np.pi) - np.pi).max() < close
    assert all("spins" in text for text in run.notices)


def test_a_start_with_overlap_is_reported_and_saved(tmp_path):
    run = run_of([box("low", (0, 0, 0.1)), box("high", (0, 0, 0.27))], t_end=0.01)
    assert run.contact_residual[:, 2].max() == pytest.approx(0.03, rel=0.1)
    assert any("'heap[low, high]'" in n and "penetrated" in n for n in run.notices)
    run.save(tmp_path / "run.npz")
    again = pg.Result.load(tmp_path / "run.npz")
    np.testing.assert_array_equal(again.contact_residual, run.contact_residual)


def test_the_order_of_bodies_does_not_matter():
    bodies = tower(6 * [1.0])
    turned = [bodies[k] for k in (3, 0, 5, 1, 4, 2)]
    one, other = run_of(bodies), run_of(turned)
    assert abs(one.v[-1]).max() < 1e-12
    assert abs(other.v[-1]).max() < 1e-12


def test_a_stack_that_falls_far_away_changes_no_bit():
    alone = run_of(tower(4 * [1.0]), t_end=0.2)
    crooked = [box(f"c{k}", (100 + 0.06 * k, 0, SIDE * (k + 0.5))) for k in range(5)]
    both = run_of([*tower(4 * [1.0]), *crooked], t_end=0.2)
    nv = alone.v.shape[1]
    assert abs(both.v[-1, nv:]).max() > 0.1
    np.testing.assert_array_equal(both.q[:, : alone.q.shape[1]], alone.q)
    np.testing.assert_array_equal(both.v[:, :nv], alone.v)


def gripper(friction, part, kind):
    length, mass = 0.05, 0.5
    shapes = {
        "box": {"kind": "box", "size": (length,) * 3},
        "sphere": {"kind": "sphere", "radius": length / 2},
        "cylinder": {"kind": "cylinder", "radius": length / 2, "length": length},
    }
    inertia = np.eye(3) * mass * length**2 / 6
    bodies = [pg.Body(name="o", joint="free", mass=mass, inertia=inertia, shape=shapes[kind])]
    contacts, forces = [], []
    for name, way in (("left", -1), ("right", 1)):
        bodies.append(
            pg.Body(
                name=name, joint="compound", motions=(("translate", (1, 0, 0)),),
                link=(way * (length / 2 + 0.005), 0, 0), mass=0.1, inertia=np.eye(3) * 1e-4,
                shape={"kind": "box", "size": (0.01, 0.04, 0.04)},
            )
        )  # fmt: skip
        contacts.append(pg.Contact(name=name, body="o", other=name, friction=friction))
        push = (-way * part * mass * G / 2 / friction, 0, 0)
        forces.append(pg.Force(name=f"push {name}", kind="wrench", body=name, force=push))
    return pg.Model(bodies=tuple(bodies), contacts=tuple(contacts), forces=tuple(forces))


@pytest.mark.parametrize(
    ("kind", "friction"), [("box", 0.2), ("sphere", 0.5), ("cylinder", 1.0), ("box", 1.0)]
)
def test_a_gripper_holds_with_the_force_that_it_needs(kind, friction):
    """With 1 % more both sides carry the same. With 1 % less the object slips."""
    kept = pg.simulate(gripper(friction, 1.01, kind), t_end=0.5, step=1e-3, estimate=False)
    loads = [kept.contact_force[side][-1, 5] for side in ("left", "right")]
    assert abs(kept.body_pose[-1, 0, 2]) < 1e-9
    assert loads[0] == pytest.approx(loads[1], rel=1e-9)
    assert sum(loads) == pytest.approx(0.5 * G, rel=1e-9)
    lost = pg.simulate(gripper(friction, 0.99, kind), t_end=0.2, step=1e-3, estimate=False)
    slipped = 0.01 * G * 0.2**2 / 2  # one part in a hundred of its weight is not carried
    assert -lost.body_pose[-1, 0, 2] == pytest.approx(slipped, rel=0.02)


def test_boxes_that_slide_keep_coulombs_law_or_are_reported():
    """A stack that is pulled apart: friction in its cone, momentum from the floor alone."""
    bodies = tower(4 * [1.0])
    v = np.zeros(24)
    v[3::6] = (0.0, 0.5, 1.0, 2.0)
    q = np.tile((0.0, 0.0, 0.0, 1.0, 0.0, 0.0, 0.0), 4)
    run = run_of(bodies, t_end=0.1, q=q, v=v, frames=101)
    largest = max(np.linalg.norm(f[:, 3:], axis=1).max() for f in run.contact_force.values())
    missed = run.contact_residual[:, :2].max()
    assert missed < 1e-3 * largest
    if missed > 1e-5 * largest:
        assert any("its law" in notice for notice in run.notices)
    drag = run.contact_force["floor[b0]"][1:, 3:]
    assert np.all(np.hypot(drag[:, 0], drag[:, 1]) <= 0.5 * drag[:, 2] + 1e-3 * largest)
    momentum = run.v[:, 3::6].sum(axis=1)
    impulse = np.concatenate(([0.0], np.cumsum(drag[:, 0]) * 1e-3))
    np.testing.assert_allclose(momentum - momentum[0], impulse, atol=1e-9)


OBLIQUE = tuple(np.array((1.0, 2.0, -0.5)) / np.linalg.norm((1.0, 2.0, -0.5)))


@pytest.mark.parametrize(
    ("axis", "method", "size"), [((0, 0, 1), "rk4", 1.0), (OBLIQUE, "moreau_jean", 1e3)]
)
def test_a_second_hinge_or_rail_on_the_same_axis_changes_nothing(axis, method, size):
    """Rounding of its rows, lengths included, is no constraint."""
    place = size * np.array((0.3, -0.2, 0.7))
    door = pg.Body(
        name="part", axes=axis, link=tuple(place), mass=10.0, com=(0.4 * size, 0.1 * size, 0.0),
        inertia=size**2 * np.diag((1.0, 1.5, 2.0)), limits=((-1.0, 1.0),), v=3.0,
    )  # fmt: skip
    rail = {"joint": "prismatic", "axes": axis, "limits": ((-size, size),), "v": 3.0 * size}
    on = {"body": "part", "axis": axis, "other_axis": axis, "point": tuple(size * np.array(axis))}
    on["other_point"] = tuple(place + size * np.array(axis))
    options = {"method": method, "step": 1e-3, "t_end": 0.4, "estimate": False}
    swings = pg.Model(bodies=[door], gravity=(0.0, 0.0, -size))
    for one, second in ((swings, pg.Revolute), (swings.edit("part", **rail), pg.Prismatic)):
        alone = pg.simulate(one, **options)
        held = pg.simulate(one.add(second(name="second", **on)), **options)
        assert np.ptp(alone.q) > 0.9
        np.testing.assert_allclose(held.q, alone.q, atol=1e-9 * np.ptp(alone.q))
        assert not any("singular" in notice for notice in held.notices)


def test_the_inertia_of_a_body_fixed_to_the_ground_does_not_matter():
    """A pendulum of 1 mm with a ball welded to it hits a wall."""
    size, inertia, ends = 1e-3, 1e-6 * np.diag((0.03, 0.02, 0.04)), []
    for of_wall in (1e-8, 1.0):
        own = {"mass": 2, "com": (0.4 * size, 0, 0), "inertia": inertia}
        pendulum = pg.Body(name="p", axes=(0, 1, 0), **own)
        load = ball("b", (0.5 * size, 0.1 * size, 0), 0.05 * size, mass=1, inertia=inertia)
        heavy = {"joint": "weld", "derived": (), "inertia": of_wall * np.eye(3)}
        wall = box("wall", (0.3 * size, 0, -0.45 * size), (2e-3, 2e-3, 2e-4), **heavy)
        weld = pg.Weld(name="w", body="b", other="p", point=(0, 0, 0))
        hit = pg.Contact(name="c", body="b", other="wall", friction=0.3, restitution=0.4)
        model = pg.Model(bodies=[pendulum, load, wall], constraints=[weld], contacts=[hit])
        step = 1e-3 * size**0.5
        ends.append(pg.simulate(model, t_end=500 * step, step=step, estimate=False)["p"][-1])
    assert ends[0] == ends[1] == pytest.approx(0.6296, abs=1e-3)


@pytest.mark.parametrize(("heavier", "friction"), [(1e4, 0.5), (1e6, 0.4)])
def test_a_heavy_box_slides_on_a_light_one(heavier, friction):
    """It stops after v² / (2 μ g), and the light box, with more friction below, stays."""
    low = box("low", (0, 0, 0.05), (0.3, 0.3, 0.1))
    high = box("high", (0.02, 0.01, 0.2), mass=heavier)
    model = heaped([low, high], friction=0.3).edit("floor", friction=friction)
    model = model.edit("high", v=(0, 0, 0, 0.5, 0.2, 0))
    run = pg.simulate(model, t_end=0.3, step=1e-3, method="moreau_jean", estimate=False)
    assert np.abs(run["low"] - run["low"][0]).max() < 1e-6
    slid = np.linalg.norm(run["high"][-1, :2] - run["high"][0, :2])
    assert slid == pytest.approx((0.5**2 + 0.2**2) / (2 * 0.3 * G), rel=1e-3)


HEAPS = [
    pytest.param(24, 3, 1.5),
    pytest.param(60, 4, 1.5, marks=pytest.mark.nightly),  # more take hours: see docs/limits.md
]


@pytest.mark.parametrize(("count", "side", "t_end"), HEAPS)
def test_spheres_fall_into_a_heap_between_walls(count, side, t_end):
    """They come to rest without sinking in, and floor and walls carry all of them."""
    r = 0.05
    half = 2.1 * r * side / 2
    rng = np.random.default_rng(1)
    grid = [np.array((k % side, k // side % side, k // side**2)) for k in range(count)]
    balls = [
        ball(f"s{k}", 2.1 * r * (p + 0.5) - (half, half, 0) + 0.04 * r * rng.normal(size=3), r)
        for k, p in enumerate(grid)
    ]
    far, height = half + 0.05, 3.0 * r * count / side**2
    walls = [
        box(f"w{k}", (*(far * np.array(way)), height / 2), joint="weld",
            size=(0.1 if way[0] else 3 * far, 0.1 if way[1] else 3 * far, height))
        for k, way in enumerate(((1, 0), (-1, 0), (0, 1), (0, -1)))
    ]  # fmt: skip
    run = run_of([*balls, *walls], t_end, 2e-3, frames=3, method="auto")
    assert run.status.ok
    centres = run.body_pose[-1, :count, :3]
    assert 2 * r - pdist(centres).min() < 1e-3 * r
    assert r - centres[:, 2].min() < 1e-3 * r
    fallen = count * G * height / 4
    assert run.kinetic_energy[-1] < 1e-4 * fallen
    assert run.contacts.wrench[-1, :count, 5].sum() == pytest.approx(count * G, rel=0.02)
