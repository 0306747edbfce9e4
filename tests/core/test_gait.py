"""Walks of the quadrupeds: speeds, slips, limits, phases, agreement of methods."""

from functools import cache

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

import pgraph_core as pg
from pgraph_core.result.balance import is_of_balance

from ..worlds import built_in

FEET = ("left_front_foot", "right_front_foot", "left_hind_foot", "right_hind_foot")
SLIP = 1e-2  # m per stance, at a friction of 0.7
DEPTH = 3e-3  # m: half of a step's way at landing, and what is not yet moved out
WALKS = (
    ("quadruped_hips", "trot", 0.5),
    ("quadruped_hips", "crawl", 0.2),
    ("quadruped", "bound", 1.0),
)


mechanism = cache(built_in)


@cache
def walked(name: str, scenario: str, t_end: float = 3.0, **options) -> pg.Result:
    frames = round(1000 * t_end) + 1
    given = {"t_end": t_end, "frames": frames, "estimate": False, **options}
    return pg.simulate(mechanism(name), scenario=scenario, **given)


def slips(run: pg.Result, foot: str) -> list[float]:
    """Length of the path of a foot's sole on the ground in each stance [m]."""
    contact = next(c for c in run.mechanism.model.contacts if c.name == foot)
    pose = run.body_pose[:, run.mechanism.topology.number(contact.body) - 1]
    turns = Rotation.from_quat(pose[:, 3:], scalar_first=True)
    places = (pose[:, :3] + turns.apply(contact.points[0]))[:, [0, 2]]
    paths = np.linalg.norm(np.diff(places, axis=0), axis=1)
    on = np.concatenate(([False], run.phases[foot] != "swing", [False]))
    ends = np.flatnonzero(np.diff(on.astype(int)))
    return [float(paths[a + 1 : b - 1].sum()) for a, b in zip(ends[::2], ends[1::2])]


def touchdowns(run: pg.Result, foot: str) -> np.ndarray:
    found, left = [], -1.0
    for event in (e for e in run.events if e.contact == foot):
        if event.after == "swing":
            left = event.t
        elif event.before == "swing" and event.t - left > 0.05:
            found.append(event.t)
    return np.array(found)


LONG = [(*walk, 10.0 if walk[1] == "bound" else 30.0) for walk in WALKS]
LONG.append(("quadruped_hips", "gallop", 1.2, 30.0))


@pytest.mark.parametrize(
    ("name", "scenario", "speed", "seconds"),
    [(*walk, 3.0) for walk in WALKS] + [pytest.param(*x, marks=pytest.mark.nightly) for x in LONG],
)
def test_a_walk_keeps_its_speed_and_limits(name, scenario, speed, seconds):
    run = walked(name, scenario, seconds)
    assert run.status.ok
    assert not [text for text in run.notices if not is_of_balance(text)]
    assert run.energy_drift < (0.01 if seconds <= 3.0 else 0.05)  # long: bound 0.028, gallop 0.036
    gait = run.mechanism.model.scenario(scenario).gait
    late = run.t > 1.0
    seconds = run.t[-1] - run.t[late][0]
    assert run.q[-1, 0] - run.q[late, 0][0] > speed * 0.99 * seconds
    assert abs(run.q[-1, 2]) < 0.025 * seconds
    for foot in FEET:
        gap = run.contact_gap[foot]
        assert max(slips(run, foot)) < SLIP
        assert gap[np.isfinite(gap)].min() > -DEPTH
        downs = np.sum(np.diff((run.contact_normal[foot][late] > 0.0).astype(int)) > 0)
        assert downs * gait.stride / seconds < 1.5
    walk = pg.Controller(run.mechanism, gait)
    acting, spine = walk.acting(), walk.anatomy.spine[:, 1]
    legs = np.setdiff1d(np.arange(6, run.mechanism.nv), spine)
    asked = np.abs([acting.torque(t, q, v) for t, q, v in zip(run.t, run.q, run.v)]).max(axis=0)
    assert asked[legs].max() <= gait.leg_torque
    assert asked[spine].max() <= gait.spine_torque


def test_phases_are_those_of_forces():
    """A foot in swing bears nothing, and the others push. A flight of one step is a graze."""
    run = walked("quadruped_hips", "trot", 3.0)
    for foot in FEET:
        phase = run.phases[foot]
        push = run.contact_normal[foot]
        assert np.all(push[1:][phase[1:] == "swing"] == 0.0)
        bears = push[1:][phase[1:] != "swing"] > 0.0
        assert bears.mean() > 0.95
        assert {"swing", "stance"} <= set(phase)


def test_time_stepping_and_events_agree_to_the_order_of_the_step():
    exact = walked("quadruped_hips", "trot", 0.8, method="rk4", step=2.5e-4)
    assert exact.energy_drift < 1e-5  # of order 4: 1e-6 at 0.125 ms
    runs = [
        walked("quadruped_hips", "trot", 0.8, step=h, method="moreau_jean") for h in (1e-3, 2.5e-4)
    ]
    late = []
    for run in runs:
        found = [touchdowns(run, foot) - touchdowns(exact, foot) for foot in FEET]
        late.append(np.median(np.abs(np.concatenate(found))))
    assert late[0] < 4e-3
    assert late[1] < 0.5 * late[0]
    far = [np.abs(run.q[-1] - exact.q[-1]).max() for run in runs]
    assert far[1] < 0.5 * far[0]


def test_the_pose_to_start_from_stands_on_its_feet():
    for name in ("quadruped", "quadruped_hips"):
        mech = mechanism(name)
        walk = pg.Controller(mech, pg.gaits()["trot"])
        q, _ = walk.start()
        for contact in (c for c in mech.model.contacts if c.points):
            origin, turn = mech.pose(q, contact.body)
            place = origin + turn @ np.array(contact.points[0])
            assert place[1] == pytest.approx(0.0, abs=1e-12)


def test_standing_torques_hold_the_weight():
    """With the feet held, the torques of the controller at rest accelerate next to nothing."""
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


def test_a_fall_is_reported_and_the_run_goes_on():
    mech = mechanism("quadruped_hips")
    walk = pg.Controller(mech, pg.gaits()["trot"])
    q, v = walk.start()
    v[5] = 3.0
    run = pg.simulate(mech, q, v, scenario="trot", t_end=2.0)
    assert run.status.ok
    assert run.t[-1] == 2.0
    (told,) = [text for text in run.notices if "fell" in text]
    assert "t = " in told


def lying(name: str, scenario: str, degrees: float, seconds: float) -> pg.Result:
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


@pytest.mark.parametrize(
    ("scenario", "aside"), [("trot", 0.3), pytest.param("crawl", -0.2, marks=pytest.mark.nightly)]
)
def test_a_walk_drifts_sideways_at_its_speed(scenario: str, aside: float):
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


def test_footprints_are_those_of_the_run():
    run = walked("quadruped_hips", "trot", 3.0)
    prints = [one for one in pg.footprints(run) if one.end - one.start > 0.1]
    ahead = [one.x for one in prints if one.foot == "left_hind_foot"]
    assert np.all(np.diff(ahead) > 0.0)
    assert np.diff(ahead)[-1] == pytest.approx(0.6 * 0.38, rel=0.1)  # a stride at full speed
    assert all(one.moved < SLIP for one in prints)
