"""Measurements of the quadrupeds' walks: speed, slip, depth, torque, energy, phases on a ladder."""

from __future__ import annotations

from functools import cache
from typing import Any, NamedTuple

import numpy as np

import pgraph_core as pg
import pgraph_models
from pgraph_core.gait.presets import FEET

STEP = 1e-3  # s
RTOL = 1e-8  # of event-driven runs that choose their steps
EVENT_STEPS = (5e-4, 2.5e-4, 1.25e-4)  # s: of event-driven runs
LADDER = (1e-3, 5e-4, 2.5e-4, 1.25e-4)  # s: of time stepping
SWUNG = 0.05  # s: a shorter flight is a bounce
SETTLED = 1.0  # s: before it a run starts from a stand


class Walked(NamedTuple):
    """One walk, as numbers."""

    gait: str
    model: str
    seconds: float
    fell: str  # what the run said of a fall, or ""
    speed: float  # [m/s] mean from SETTLED on
    aside: float  # [m] to the right at the end
    tilt: float  # [deg] largest
    slip: float  # [m] farthest of a foot in one stance
    depth: float  # [m] of the deepest foot
    touches: float  # a stride, of the foot that touches the ground most often
    push: float  # largest force of a foot in a step, over the weight
    torque: dict[str, float]  # [N m] largest asked of legs and spine
    limit: dict[str, float]
    energy: float  # what the ledger missed, of its range
    again: bool  # a second run gave the same bits
    factor: float  # of real time


@cache
def mechanism(name: str) -> pg.Mechanism:
    """A built-in model."""
    return pg.Mechanism(pg.Model.load(pgraph_models.path(name)))


def run_of(name: str, gait: str, t_end: float, **options: object) -> pg.Result:
    """A walk; frames at every step of 1 ms."""
    frames = round(t_end / STEP) + 1
    return pg.simulate(
        mechanism(name), scenario=gait, t_end=t_end, frames=frames, estimate=False,
        **options,  # type: ignore[arg-type]
    )  # fmt: skip


def walked(name: str, gait: str, t_end: float) -> Walked:
    """The numbers of a walk in time stepping."""
    run, twice = run_of(name, gait, t_end), run_of(name, gait, t_end)
    late = run.t >= SETTLED
    up = 1 - 2 * (run.q[late, 4] ** 2 + run.q[late, 6] ** 2)
    torque, limit = torques(run, gait)
    return Walked(
        gait=gait,
        model=name,
        seconds=float(run.t[-1]),
        fell=next((text for text in run.notices if "fell" in text), ""),
        speed=float(run.q[-1, 0] - run.q[late, 0][0]) / float(run.t[-1] - run.t[late][0]),
        aside=float(run.q[-1, 2]),
        tilt=float(np.degrees(np.arccos(np.clip(up.min(), -1, 1)))),
        slip=max(max(slips(run, foot)) for foot in FEET),
        depth=-min(float(run.contact_gap[foot].min()) for foot in FEET),
        touches=touches(run, gait),
        push=max(float(run.contact_normal[foot][late].max()) for foot in FEET) / weight(run),
        torque=torque,
        limit=limit,
        energy=run.energy_drift,
        again=bool(
            np.array_equal(run.q, twice.q)
            and np.array_equal(run.v, twice.v)
            and run.events == twice.events
        ),
        factor=float(run.t[-1]) / min(run.timing["step"], twice.timing["step"]),
    )


def touches(run: pg.Result, gait: str) -> float:
    """How often a stride the foot that does so most often comes onto the ground, after SETTLED."""
    given = run.mechanism.model.scenario(gait).gait
    assert given is not None
    late = run.t >= SETTLED
    downs = [np.diff((run.contact_normal[foot][late] > 0.0).astype(int)) > 0 for foot in FEET]
    return float(max(down.sum() for down in downs) * given.stride / (run.t[-1] - SETTLED))


def weight(run: pg.Result) -> float:
    """Of all bodies [N]."""
    model = run.mechanism.model
    return sum(body.mass for body in model.bodies) * -model.gravity[1]


def places(run: pg.Result, foot: str) -> np.ndarray:
    """(n, 3) places of a foot's sole in the world [m]."""
    contact = next(c for c in run.mechanism.model.contacts if c.name == foot)
    pose = run.body_pose[:, run.mechanism.topology.number(contact.body) - 1]
    w, xyz, p = pose[:, 3:4], pose[:, 4:], np.array(contact.points[0])
    turned = p + 2 * (w * np.cross(xyz, p) + np.cross(xyz, np.cross(xyz, p)))
    return pose[:, :3] + turned


def slips(run: pg.Result, foot: str) -> list[float]:
    """How far a foot's sole went while on the ground, stance by stance [m]: the path's length."""
    on = run.phases[foot] != "swing"
    at = places(run, foot)[:, [0, 2]]
    paths = np.linalg.norm(np.diff(at, axis=0), axis=1)
    ends = np.flatnonzero(np.diff(np.concatenate(([False], on, [False])).astype(int)))
    return [float(paths[a + 1 : b - 1].sum()) for a, b in zip(ends[::2], ends[1::2])]


def torques(run: pg.Result, gait: str) -> tuple[dict[str, float], dict[str, float]]:
    """Largest torques of legs and spine at the frames, from the controller itself; and limits."""
    given = run.mechanism.model.scenario(gait).gait
    assert given is not None
    walk = pg.Controller(run.mechanism, given)
    at_work = walk.acting()
    asked = np.abs([at_work.torque(t, q, v) for t, q, v in zip(run.t, run.q, run.v)]).max(axis=0)
    spine = walk.anatomy.spine[:, 1]
    legs = np.setdiff1d(np.arange(6, run.mechanism.nv), spine)
    return (
        {"leg": float(asked[legs].max()), "spine": float(asked[spine].max())},
        {"leg": given.leg_torque, "spine": given.spine_torque},
    )


def touchdowns(run: pg.Result, foot: str) -> np.ndarray:
    """Times at which a foot ends a swing of more than SWUNG [s]."""
    found, left = [], -SWUNG
    for event in run.events:
        if event.contact == foot and event.after == "swing":
            left = event.t
        elif event.contact == foot and event.before == "swing" and event.t - left > SWUNG:
            found.append(event.t)
    return np.array(found)


def apart(run: pg.Result, exact: pg.Result) -> float:
    """Median distance of touchdowns from those of another run [s]; inf where they do not pair."""
    found = []
    for foot in FEET:
        mine, other = touchdowns(run, foot), touchdowns(exact, foot)
        found += np.abs(mine - other).tolist() if len(mine) == len(other) else [np.inf]
    return float(np.median(found))


class Rung(NamedTuple):
    """Time stepping against an event-driven run at one step."""

    step: float
    touchdowns: float  # [s] median distance of touchdown times
    place: float  # [m] largest distance of the trunk
    energy: float  # what the ledger missed, of its range


def ladder(
    name: str, gait: str, t_end: float = 1.5
) -> tuple[list[Rung], list[tuple[float, float]]]:
    """(time stepping at each step against the finest event-driven run, the ledgers of those)."""
    exact = [run_of(name, gait, t_end, method="rk4", step=h) for h in EVENT_STEPS]
    rungs = []
    for h in LADDER:
        run = run_of(name, gait, t_end, method="moreau_jean", step=h)
        far = float(np.linalg.norm(run.q[:, :3] - exact[-1].q[:, :3], axis=1).max())
        rungs.append(Rung(h, apart(run, exact[-1]), far, run.energy_drift))
    return rungs, [(h, run.energy_drift) for h, run in zip(EVENT_STEPS, exact)]


def to_a_tolerance(name: str, gait: str, seconds: float) -> pg.Result:
    """A walk from event to event, at steps chosen by their error."""
    return run_of(name, gait, seconds, method="dop853", rtol=RTOL)


def under_law(law: Any, method: str, setting: dict[str, float]) -> pg.Result:
    """The trot on feet of another contact law."""
    model = pg.underfoot(pg.Model.load(pgraph_models.path("quadruped_hips")), law=law)
    mech = pg.Mechanism(model)
    return pg.simulate(mech, scenario="trot", t_end=1.5, method=method, estimate=False, **setting)
