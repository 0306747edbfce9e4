"""The contact solver of time stepping: stacks, islands, mass ratios, grippers, residuals."""

from __future__ import annotations

import numba
import numpy as np
import pytest
from scipy.spatial.transform import Rotation

import pgraph_core as pg
from benchmarks import ordinary, stacks
from pgraph_core.engine.contact.contacts import kept_place
from pgraph_core.engine.records import KEPT, table

G, SIDE = 9.81, 0.2


def cube(name, place, mass=1.0, side=SIDE):
    return pg.Body(
        name=name, joint="free", link=tuple(place), mass=mass,
        inertia=np.eye(3) * mass * side**2 / 6, shape={"kind": "box", "size": (side,) * 3},
    )  # fmt: skip


def stack(count, x=0.0, name="b", top=1.0, side=SIDE):
    masses = [1.0] * (count - 1) + [top]
    return [cube(f"{name}{i}", (x, 0, side * (i + 0.5)), m, side) for i, m in enumerate(masses)]


def run_of(bodies, t_end=0.3, step=1e-3, friction=0.5, **more):
    contacts = (
        pg.Contact(name="floor", body="*", friction=friction),
        pg.Contact(name="heap", body="*", other="*", friction=friction),
    )
    model = pg.Model(bodies=tuple(bodies), contacts=contacts)
    more = {"frames": 4, "estimate": False, "method": "moreau_jean"} | more
    return pg.simulate(model, t_end=t_end, step=step, **more)


def places(run):
    return run.q[-1].reshape(-1, 7)[:, :3]


@pytest.mark.parametrize("count", [2, 5, 12, 20, 30])
def test_stacks_of_equal_boxes_rest(count):
    """They are a solution as they stand: what moves is rounding of 120 contacts."""
    run = run_of(stack(count), t_end=0.5)
    assert not run.notices
    assert abs(run.v[-1]).max() < 1e-12
    assert abs(places(run)).max() < 1e-12
    weights = G * np.arange(count, 0, -1)
    loads = [run.contact_force["floor[b0]"][-1, 5]]
    assert loads[0] == pytest.approx(weights[0], rel=1e-9)


@pytest.mark.parametrize("side", [1e-3, 100.0])
@pytest.mark.parametrize("step", [1e-4, 1e-2])
def test_stacks_rest_at_any_size_and_step(side, step):
    run = run_of(stack(5, side=side), t_end=20 * step, step=step)
    assert not run.notices
    assert abs(run.v[-1]).max() < 1e-10 * max(1.0, G * step / side)


def test_the_order_of_bodies_does_not_matter():
    """Two orders of one stack give the same motion, to the tolerance of the solver."""
    bodies = stack(6)
    turned = [bodies[k] for k in (3, 0, 5, 1, 4, 2)]
    one, other = run_of(bodies), run_of(turned)
    assert abs(one.v[-1]).max() < 1e-12
    assert abs(other.v[-1]).max() < 1e-12


def test_separate_stacks_are_solved_apart():
    """A stack that falls over a hundred metres away changes no bit of one that stands."""
    alone = run_of(stack(4), t_end=0.2)
    crooked = [cube(f"c{k}", (100 + 0.06 * k, 0, SIDE * (k + 0.5))) for k in range(5)]
    both = run_of([*stack(4), *crooked], t_end=0.2)
    nv = alone.v.shape[1]
    assert abs(both.v[-1, nv:]).max() > 0.1
    np.testing.assert_array_equal(both.q[:, : alone.q.shape[1]], alone.q)
    np.testing.assert_array_equal(both.v[:, :nv], alone.v)


@pytest.mark.parametrize("count", [2, 5, 10])
def test_a_million_times_heavier_box_stands_on_light_ones(count):
    run = run_of(stack(count, top=1e6), t_end=0.1)
    assert not run.notices
    assert abs(run.v[-1]).max() < 1e-8
    assert abs(places(run)).max() < 1e-7  # the goal is 1e-4: rounding of 1e6 : 1 creeps
    load = run.contact_force["floor[b0]"][-1, 5]
    assert load == pytest.approx((1e6 + count - 1) * G, rel=1e-7)  # rounding of 1e6 : 1


def gripper(friction, part, kind):
    """An object of 0.5 kg between two pads, pressed by a part of the force that holds it."""
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


@pytest.mark.parametrize("kind", ["box", "sphere", "cylinder"])
@pytest.mark.parametrize("friction", [0.2, 0.5, 1.0])
def test_a_gripper_holds_with_the_force_that_it_needs(friction, kind):
    """1 % above it the object stays, and both sides carry the same; 1 % below it slips."""
    kept = pg.simulate(gripper(friction, 1.01, kind), t_end=1.0, step=1e-3, estimate=False)
    loads = [kept.contact_force[side][-1, 5] for side in ("left", "right")]
    assert abs(kept.body_pose[-1, 0, 2]) < 1e-9
    assert loads[0] == pytest.approx(loads[1], rel=1e-9)
    assert sum(loads) == pytest.approx(0.5 * G, rel=1e-9)
    lost = pg.simulate(gripper(friction, 0.99, kind), t_end=0.2, step=1e-3, estimate=False)
    slipped = 0.01 * G * 0.2**2 / 2  # one part in a hundred of its weight is not carried
    assert -lost.body_pose[-1, 0, 2] == pytest.approx(slipped, rel=0.02)


@pytest.mark.parametrize(("step", "close"), [(1e-2, 0.05), (1e-3, 5e-3), (1e-4, 5e-4)])
def test_a_box_that_slides_and_spins_is_loaded_evenly(step, close):
    """Four corners are redundant: those of least norm carry it, at every step, the same way."""
    verdict, off, _, said = ordinary.judged(ordinary.sliding, ordinary.Variant("", step=step))
    assert verdict == "right"
    assert off < close
    assert not said


def test_a_kicked_stack_meets_its_laws():
    verdict, _, _, said = ordinary.judged(ordinary.kicked, ordinary.VARIANTS[0])
    assert verdict == "right"
    assert not said


def test_boxes_that_slide_keep_coulombs_law_or_are_told():
    """A stack that is pulled apart: friction stays in its cone, and what is missed has a notice."""
    bodies = stack(4)
    v = np.zeros(24)
    v[3::6] = (0.0, 0.5, 1.0, 2.0)
    q = np.tile((0.0, 0.0, 0.0, 1.0, 0.0, 0.0, 0.0), 4)
    run = run_of(bodies, t_end=0.1, q=q, v=v, frames=101)
    largest = max(np.linalg.norm(f[:, 3:], axis=1).max() for f in run.contact_force.values())
    missed = run.contact_residual[:, :2].max()
    assert missed < 1e-3 * largest
    if missed > 1e-5 * largest:
        assert any("missed its law" in notice for notice in run.notices)
    drag = run.contact_force["floor[b0]"][1:, 3:]
    assert np.all(np.hypot(drag[:, 0], drag[:, 1]) <= 0.5 * drag[:, 2] + 1e-3 * largest)
    momentum = run.v[:, 3::6].sum(axis=1)
    impulse = np.concatenate(([0.0], np.cumsum(drag[:, 0]) * 1e-3))
    np.testing.assert_allclose(momentum - momentum[0], impulse, atol=1e-9)


def test_a_start_with_overlap_is_told():
    bodies = [cube("low", (0, 0, 0.1)), cube("high", (0, 0, 0.27))]
    run = run_of(bodies, t_end=0.01)
    assert run.contact_residual[:, 2].max() == pytest.approx(0.03, rel=0.1)
    assert any("'heap[low, high]'" in n and "penetrated" in n for n in run.notices)


def test_the_residual_is_saved(tmp_path):
    run = run_of(stack(2), t_end=0.01)
    run.save(tmp_path / "run.npz")
    again = pg.Result.load(tmp_path / "run.npz")
    np.testing.assert_array_equal(again.contact_residual, run.contact_residual)
    assert run.contact_residual.shape == (4, 3)


def test_a_heap_of_balls_meets_its_laws():
    """27 balls fall from a grid: in every step, impacts included, the sweeps reach the laws."""
    places = np.indices((3, 3, 3)).reshape(3, -1).T
    places = places + np.random.default_rng(0).uniform(-0.02, 0.02, (27, 3))
    shape = {"kind": "sphere", "radius": 0.5}
    balls = [
        pg.Body(name=f"s{k}", joint="free", link=p, inertia=np.eye(3) * 0.1, shape=shape)
        for k, p in enumerate((1.01 * places + (0, 0, 0.525)).tolist())
    ]
    run = run_of(balls, t_end=1.0)
    assert not any("stopped before it was exact" in n for n in run.notices)
    force = max(abs(f).max() for f in run.contact_force.values())
    assert run.contact_residual[:, :2].max() < 1e-6 * force


def test_small_islands_of_several_balls_take_few_sweeps():
    """27 balls fall apart into islands of 4 to 16 contacts, whose sweeps are combined as well.

    91 sweeps and steps of Newton's method a time step; 200 without.
    """
    _, run = stacks.ours(stacks.heap(stacks.grid(27, apart=1.06)), 0.5)
    assert run.counters["solver_iterations"] < 120 * run.counters["steps"]


OBLIQUE = tuple(np.array((1.0, 2.0, -0.5)) / np.linalg.norm((1.0, 2.0, -0.5)))


@pytest.mark.parametrize("axis", [(0, 0, 1), OBLIQUE])
@pytest.mark.parametrize("method", ["moreau_jean", "rk4"])
@pytest.mark.parametrize("size", [1.0, 1e3])
def test_a_second_hinge_or_rail_on_the_same_axis_changes_nothing(axis, method, size):
    """No impulse at it moves anything: rounding of its rows, lengths included, is no constraint."""
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


def test_a_four_bar_in_an_oblique_plane_moves_as_in_that_of_two_axes():
    """Its closing hinge has three rows too many, none of them along an axis of the world."""
    crank, rocker, base = np.array((0.2, 0.3, 0)), np.array((0.5, -0.6, 0)), np.array((1.0, 0, 0))
    coupler, runs = base - crank - rocker, []
    for turn in (Rotation.identity(), Rotation.from_rotvec((0.7, -0.4, 1.1))):
        axis, inertia = tuple(turn.apply((0, 0, 1))), turn.as_matrix() @ np.diag((2, 3, 4))
        links, at = [], np.zeros(3)
        for name, link in (("crank", crank), ("coupler", coupler), ("rocker", rocker)):
            links.append(
                pg.Body(
                    name=name, parent=links[-1].name if links else "ground", axes=axis, mass=1.0,
                    link=tuple(turn.apply(at)), com=tuple(turn.apply(link / 2)),
                    inertia=1e-2 * inertia @ turn.as_matrix().T, tip=tuple(turn.apply(link)),
                )
            )  # fmt: skip
            at = link
        close = pg.Revolute(
            name="close", body="rocker", point=tuple(turn.apply(rocker)), axis=axis,
            other_point=tuple(turn.apply(base)), other_axis=axis,
        )  # fmt: skip
        gravity = tuple(turn.apply((3.0, -9.0, 4.0)))
        model = pg.Model(bodies=links, constraints=[close], gravity=gravity)
        model = model.edit("crank", limits=((-9.0, 0.8),))
        runs.append(pg.simulate(model, t_end=0.5, step=1e-3, method="moreau_jean", estimate=False))
    assert np.ptp(runs[0].q[:, 0]) > 1.0
    np.testing.assert_allclose(runs[1].q, runs[0].q, atol=1e-9)


def test_what_is_fixed_to_the_ground_has_no_inertia_that_matters():
    """A pendulum of 1 mm with a ball welded to it hits a wall: rotation rows are as large as it."""
    size, inertia, ends = 1e-3, 1e-6 * np.diag((0.03, 0.02, 0.04)), []
    for of_wall in (1e-8, 1.0):
        pendulum = pg.Body(
            name="p", axes=(0, 1, 0), mass=2, com=(0.4 * size, 0, 0), inertia=inertia
        )
        ball = pg.Body(
            name="b", joint="free", link=(0.5 * size, 0.1 * size, 0), mass=1, inertia=inertia,
            shape={"kind": "sphere", "radius": 0.05 * size},
        )  # fmt: skip
        wall = pg.Body(
            name="wall", joint="weld", link=(0.3 * size, 0, -0.45 * size),
            inertia=of_wall * np.eye(3), shape={"kind": "box", "size": (2e-3, 2e-3, 2e-4)},
        )  # fmt: skip
        weld = pg.Weld(name="w", body="b", other="p", point=(0, 0, 0))
        hit = pg.Contact(name="c", body="b", other="wall", friction=0.3, restitution=0.4)
        model = pg.Model(bodies=[pendulum, ball, wall], constraints=[weld], contacts=[hit])
        step = 1e-3 * size**0.5
        ends.append(pg.simulate(model, t_end=500 * step, step=step, estimate=False)["p"][-1])
    assert ends[0] == ends[1] == pytest.approx(0.6296, abs=1e-3)


@pytest.mark.parametrize(("heavier", "friction"), [(1e4, 0.5), (1e6, 0.4)])
def test_a_heavy_box_slides_on_a_light_one(heavier, friction):
    """It stops after v² / (2 μ g), and what carries it, and has more friction below, stays."""
    low = pg.Body(
        name="low", joint="free", link=(0, 0, 0.05), mass=1.0, inertia=np.diag((2, 2, 3.6)) / 240,
        shape={"kind": "box", "size": (0.3, 0.3, 0.1)},
    )  # fmt: skip
    high = cube("high", (0.02, 0.01, 0.2), mass=heavier)
    contacts = [
        pg.Contact(name="floor", body="*", friction=friction),
        pg.Contact(name="heap", body="*", other="*", friction=0.3),
    ]
    model = pg.Model(bodies=[low, high], contacts=contacts).edit("high", v=(0, 0, 0, 0.5, 0.2, 0))
    run = pg.simulate(model, t_end=0.3, step=1e-3, method="moreau_jean", estimate=False)
    assert np.abs(run["low"] - run["low"][0]).max() < 1e-6
    slid = np.linalg.norm(run["high"][-1, :2] - run["high"][0, :2])
    assert slid == pytest.approx((0.5**2 + 0.2**2) / (2 * 0.3 * G), rel=1e-3)


def test_corners_that_land_together_keep_a_mirror_symmetry():
    """A ball falls on a plank on a roller; the end of the plank hits the floor with two corners."""
    quarter = (np.sqrt(0.5), np.sqrt(0.5), 0, 0)
    bodies = [
        pg.Body(
            name="roller", joint="free", q=(0, 0, 0.1, *quarter), mass=2.0,
            inertia=np.diag((0.0317, 0.0317, 0.01)),
            shape={"kind": "cylinder", "radius": 0.1, "length": 0.4},
        ),
        pg.Body(
            name="plank", joint="free", link=(0.02, 0, 0.215), mass=1.0,
            inertia=np.diag((0.0034, 0.0834, 0.0867)),
            shape={"kind": "box", "size": (1.0, 0.2, 0.03)},
        ),
        pg.Body(
            name="ball", joint="free", link=(0.4, 0, 0.55), mass=0.5, inertia=5e-4 * np.eye(3),
            shape={"kind": "sphere", "radius": 0.05},
        ),
    ]  # fmt: skip
    law = {"friction": 0.8, "restitution": 0.3}
    contacts = [
        pg.Contact(name="floor", body="*", **law),
        pg.Contact(name="heap", body="*", other="*", **law),
    ]
    model = pg.Model(bodies=bodies, contacts=contacts)
    run = pg.simulate(model, t_end=0.45, step=1e-3, method="moreau_jean", estimate=False)
    turned = run.v[:, 6:9]
    assert np.abs(turned[:, 1]).max() > 1.0
    assert np.abs(run["plank"][:, 1]).max() < 1e-6
    assert np.abs(turned[:, [0, 2]]).max() < 1e-3  # 6 rad/s where one corner is hit first


def test_what_a_point_kept_is_found_from_any_place():
    """A scene with fewer points than the step before asks from beyond the end of what was kept."""
    kept = table(KEPT, 3)
    kept["shape_a"], kept["shape_b"], kept["feature"] = [4, 4, 5], [9, 9, 9], [0, 1, 0]
    look = numba.njit(lambda point, kept, start: kept_place(point, kept, 3, start))
    for start in range(8):
        for k in range(3):
            assert look(kept[k], kept, start) == k
        other = kept[0].copy()
        other["feature"] = 7
        assert look(other, kept, start) == -1


def test_what_a_point_kept_is_found_where_others_came_or_went():
    """In a heap of 200 entries, points are 40 places before or behind their entry."""
    kept = table(KEPT, 200)
    kept["shape_a"] = np.arange(200)
    look = numba.njit(lambda point, kept, start: kept_place(point, kept, 200, start))
    for k in (0, 70, 130, 199):
        for away in (-40, -1, 0, 1, 40):
            assert look(kept[k], kept, max(k + away, 0)) == k


def test_slow_things_of_a_crowd_take_a_step_once():
    """100 balls that fall onto each other: forces are evaluated once a step; a fast one is seen."""
    balls = stacks.grid(100, apart=1.06)
    falling = pg.Mechanism(stacks.heap(balls))
    run = pg.simulate(falling, t_end=0.1, step=1e-3, frames=2, method="moreau_jean", estimate=False)
    assert run.counters["evaluations"] <= run.counters["steps"] + run.counters["steps"] // 50 + 2
    plate = stacks.box("plate", (0, 0, 40.0), 1e3).model_copy(
        update={"shape": pg.Shape(kind="box", size=(20.0, 20.0, 0.01))}
    )
    shot = stacks.ball("shot", (0, 0, 50.0), radius=0.05)
    mech = pg.Mechanism(stacks.heap([*balls, plate, shot]))
    q, v = mech.home()
    v[mech.joints["shot"].v] = (0, 0, 0, 0, 0, -1000.0)
    run = pg.simulate(mech, q, v, t_end=0.02, step=1e-3, frames=3, method="moreau_jean")
    place = run.body_pose[-1, -2:, 2]
    assert place[1] > place[0]
