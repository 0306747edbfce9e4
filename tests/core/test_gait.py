"""The quadrupeds walk: speeds, slips, limits, phases, agreement of the two ways of stepping."""

from __future__ import annotations

import csv
import io
from functools import cache

import numpy as np
import pytest

import pgraph_core as pg
import pgraph_models
from benchmarks import gait_checks
from pgraph_core.rotation import matrix

FEET = ("left_front_foot", "right_front_foot", "left_hind_foot", "right_hind_foot")
TEN_MM = 1e-2  # m a stance: what a foot may slip at a friction of 0.7
DEPTH = 3e-3  # m: half of a step's way at landing, and what is not yet moved out
WALKS = (
    ("quadruped_hips", "trot", 0.5),
    ("quadruped_hips", "crawl", 0.2),
    ("quadruped", "bound", 1.0),
)


@cache
def mechanism(name: str) -> pg.Mechanism:
    return pg.Mechanism(pg.Model.load(pgraph_models.path(name)))


@cache
def short(name: str, scenario: str) -> pg.Result:
    """Three seconds by the ordinary door, frames at every step."""
    return pg.simulate(mechanism(name), scenario=scenario, t_end=3.0, frames=3001, estimate=False)


@pytest.mark.parametrize(("name", "scenario", "speed"), WALKS)
def test_a_walk_goes_on_its_way(name: str, scenario: str, speed: float):
    run = short(name, scenario)
    assert run.status.ok
    assert not run.notices
    late = run.t > 2.0
    assert run.q[-1, 0] - run.q[late, 0][0] > speed * 0.99
    assert abs(run.q[-1, 2]) < 0.05


@pytest.mark.parametrize(("name", "scenario", "speed"), WALKS)
def test_feet_hold_and_torques_keep_their_limits(name: str, scenario: str, speed: float):
    run = short(name, scenario)
    for foot in FEET:
        gap = run.contact_gap[foot]
        assert max(gait_checks.slips(run, foot)) < TEN_MM
        assert gap[np.isfinite(gap)].min() > -DEPTH
    torque, limit = gait_checks.torques(run, scenario)
    assert all(torque[part] <= limit[part] for part in limit)


def test_a_second_run_gives_the_same_bits():
    again = pg.simulate(
        mechanism("quadruped"), scenario="bound", t_end=3.0, frames=3001, estimate=False
    )
    first = short("quadruped", "bound")
    assert np.array_equal(first.q, again.q)
    assert np.array_equal(first.v, again.v)
    assert first.events == again.events


def test_phases_are_those_of_forces():
    """A foot in swing bears nothing; all others push. A flight of one step is a graze."""
    run = short("quadruped_hips", "trot")
    for foot in FEET:
        phase = run.phases[foot]
        push = run.contact_normal[foot]
        assert np.all(push[1:][phase[1:] == "swing"] == 0.0)
        bears = push[1:][phase[1:] != "swing"] > 0.0
        assert bears.mean() > 0.95
        assert {"swing", "stance"} <= set(phase)


def test_events_change_the_phases_at_their_times():
    run = short("quadruped_hips", "trot")
    for event in run.events:
        k = int(np.searchsorted(run.t, event.t - 1e-9))
        assert run.phases[event.contact][k] == event.after
        assert run.phases[event.contact][k - 1] == event.before


def test_csv_has_the_numbers_of_the_run():
    run = short("quadruped_hips", "trot")
    rows = list(csv.DictReader(io.StringIO(run.to_csv())))
    for foot in run.phases:
        assert [row[f"phases.{foot}"] for row in rows] == run.phases[foot].tolist()
        for axis, force in zip("xyz", run.contact_force[foot].T[3:]):
            assert [
                float(row[f"contact_force.{foot}.{axis} [N]"]) for row in rows
            ] == force.tolist()


def test_time_stepping_and_events_agree_to_the_order_of_the_step():
    exact = gait_checks.run_of("quadruped_hips", "trot", 0.8, method="rk4", step=2.5e-4)
    assert exact.energy_drift < 1e-5  # of order 4: 1e-6 at 0.125 ms
    runs = [
        gait_checks.run_of("quadruped_hips", "trot", 0.8, step=h, method="moreau_jean")
        for h in (1e-3, 2.5e-4)
    ]
    apart = [gait_checks.apart(run, exact) for run in runs]
    assert apart[0] < 4e-3
    assert apart[1] < 0.5 * apart[0]
    far = [np.abs(run.q[-1] - exact.q[-1]).max() for run in runs]
    assert far[1] < 0.5 * far[0]


def test_the_pose_to_start_from_stands_on_its_feet():
    """Legs' inverse kinematics against the mechanism's own poses."""
    for name in ("quadruped", "quadruped_hips"):
        mech = mechanism(name)
        walk = pg.Controller(mech, pg.gaits()["trot"])
        q, _ = walk.start()
        for contact in (c for c in mech.model.contacts if c.points):
            origin, turn = mech.pose(q, contact.body)
            place = origin + turn @ np.array(contact.points[0])
            assert place[1] == pytest.approx(0.0, abs=1e-12)


def test_standing_torques_hold_the_weight():
    """What the controller asks for at rest, with the feet held, accelerates next to nothing."""
    mech = mechanism("quadruped")
    gait = pg.gaits()["stand"]
    walk = pg.Controller(mech, gait)
    q, v = walk.start()
    held = tuple(c.model_copy(update={"other_point": None}) for c in mech.model.constraints)
    tied = mech.model.replace(constraints=held)
    for body, joint in mech.joints.items():  # a constraint holds a foot where the model stands
        tied = tied.edit(body, q=tuple(q[joint.q].tolist()))
    vdot, force = pg.Mechanism(tied).constrained_dynamics(q, v, walk(0.0, q, v))
    assert np.abs(vdot[:6]).max() < 1.0  # the centre of mass is pulled to the feet's middle
    weight = sum(f[4] for f in force.values())
    assert weight == pytest.approx(33 * 9.81, rel=0.02)


def test_a_fall_is_said_and_the_run_kept():
    mech = mechanism("quadruped_hips")
    walk = pg.Controller(mech, pg.gaits()["trot"])
    q, v = walk.start()
    v[5] = 3.0
    run = pg.simulate(mech, q, v, scenario="trot", t_end=2.0)
    assert run.status.ok
    assert run.t[-1] == 2.0
    (said,) = [text for text in run.notices if "fell" in text]
    assert said.startswith("it fell at t = ")


@pytest.mark.parametrize(("name", "scenario", "speed"), WALKS)
def test_a_foot_is_on_the_ground_once_a_stride(name: str, scenario: str, speed: float):
    """From touching down to lifting off its force is never zero, whatever other feet hit then."""
    run = short(name, scenario)
    assert gait_checks.touches(run, scenario) < 1.5


def lying(name: str, scenario: str, degrees: float, seconds: float) -> pg.Result:
    """A walk that begins on its side, a little above the ground."""
    mech = mechanism(name)
    q, v = pg.Controller(mech, mech.model.scenario(scenario).gait).start()
    half = np.radians(degrees) / 2
    q[1] += 0.2 - mech.poses(q)[0][0][1]
    q[3:7] = np.cos(half), np.sin(half), 0.0, 0.0
    return pg.simulate(mech, q, v, scenario=scenario, t_end=seconds, estimate=False)


def test_after_a_fall_it_lies_on_the_ground():
    run = lying("quadruped", "bound", 90.0, 4.0)
    assert all(gap.min() > -5e-3 for gap in run.contact_gap.values())
    assert sum(push[-1] for push in run.contact_normal.values()) == pytest.approx(
        33 * 9.81, rel=0.05
    )
    assert np.abs(run.v[-1, :6]).max() < 0.1


@pytest.mark.parametrize("degrees", [90.0, -90.0, 150.0])
def test_what_is_drawn_of_a_fallen_dog_is_not_under_the_ground(degrees: float):
    """Trunk, neck, head and legs; paws, ears and tail are only drawn, as docs/gaits.md says."""
    run = lying("quadruped_hips", "trot", degrees, 4.0)
    mech = run.mechanism
    low = 0.0
    for name, pose in zip(mech.names, run.body_pose[-1]):
        if "paw" in name:
            continue
        shapes = [s for s in mech.model.body(name).shapes if s.role == "visual" and s.end_radius]
        for s in shapes[: 2 if name == "pelvis" else 8]:
            half = matrix(s.rotation)[:, 2] * s.length / 2
            for end, radius in ((-half, s.radius), (half, s.end_radius)):
                at = pose[:3] + matrix(pose[3:]) @ (np.asarray(s.position) + end)
                low = min(low, at[1] - radius)
    assert low > -0.05  # what is drawn is rounder than what touches


def test_it_steps_on_known_kerbs_and_not_into_them():
    steps = [pg.Step(low=(x, -9), high=(x + 0.8, 9), height=0.05) for x in (0.5, 2.1)]
    mech = pg.Mechanism(pg.underfoot(mechanism("quadruped_hips").model, steps=steps))
    run = pg.simulate(mech, scenario="trot", t_end=6.0, estimate=False)
    assert not run.notices
    assert run.q[-1, 0] > 2.9
    edges = np.array([x for step in steps for x in (step.low[0], step.high[0])])
    away = [np.abs(print_.x - edges).min() for print_ in pg.footprints(run)]
    assert np.mean(np.array(away) < 0.01) < 0.05
    assert all(run.contact_gap[foot].min() > -DEPTH for foot in FEET)


@pytest.mark.parametrize(("scenario", "aside"), [("trot", 0.3), ("crawl", -0.2)])
def test_it_goes_as_fast_to_the_side_as_it_is_asked_to(scenario: str, aside: float):
    mech = mechanism("quadruped_hips")
    walk = pg.Controller(mech, mech.model.scenario(scenario).gait.edit(drift=aside))
    run = pg.simulate(mech, scenario=scenario, tau=walk, t_end=10.0, estimate=False)
    late = run.t > 4.0
    assert not run.notices
    assert (run.q[-1, 2] - run.q[late, 2][0]) / 6.0 == pytest.approx(aside, rel=0.2)


def test_hips_that_do_not_spread_do_not_go_to_the_side():
    mech = mechanism("quadruped")
    with pytest.raises(pg.InputError) as refused:
        pg.Controller(mech, mech.model.scenario("bound").gait.edit(drift=0.3))
    assert refused.value.problems[0].field == "drift"


@pytest.mark.nightly
@pytest.mark.parametrize(
    ("name", "scenario", "seconds", "speed"),
    [
        ("quadruped_hips", "trot", 30.0, 0.5),
        ("quadruped_hips", "crawl", 30.0, 0.2),
        ("quadruped_hips", "gallop", 30.0, 1.2),
        ("quadruped", "bound", 10.0, 1.0),
    ],
)
def test_long_walks(name: str, scenario: str, seconds: float, speed: float):
    found = gait_checks.walked(name, scenario, seconds)
    assert not found.fell
    assert found.speed > speed
    assert found.slip < TEN_MM
    assert found.depth < DEPTH
    assert found.again
    assert all(found.torque[part] <= found.limit[part] for part in found.limit)


@pytest.mark.nightly
@pytest.mark.parametrize(("name", "gait"), [("quadruped_hips", "trot"), ("quadruped", "bound")])
def test_ledgers_and_phases_on_a_ladder(name: str, gait: str):
    rungs, ledgers = gait_checks.ladder(name, gait)
    assert ledgers[-1][1] < 1e-6
    assert rungs[-1].touchdowns < 0.5 * rungs[0].touchdowns


def test_footprints_are_those_of_the_run():
    run = short("quadruped_hips", "trot")
    prints = [one for one in pg.footprints(run) if one.end - one.start > 0.1]
    ahead = [one.x for one in prints if one.foot == "left_hind_foot"]
    assert np.all(np.diff(ahead) > 0.0)
    assert np.diff(ahead)[-1] == pytest.approx(0.6 * 0.38, rel=0.1)  # a stride at full speed
    assert all(one.moved < TEN_MM for one in prints)
    rows = list(csv.DictReader(io.StringIO(pg.footprints_csv(run))))
    every = pg.footprints(run)
    assert [float(row["x [m]"]) for row in rows] == [one.x for one in every]
    assert [float(row["push [N]"]) for row in rows] == [one.push for one in every]
