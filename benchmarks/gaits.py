"""The quadrupeds' walks in numbers, and the time of a trot against MuJoCo's."""

from __future__ import annotations

from collections.abc import Iterator
from functools import cache
from typing import Any

import numba
import numpy as np

import pgraph_core as pg
from pgraph_core.engine.compiler.address import caller
from pgraph_core.engine.compiler.kinds import f8, i8, u8
from pgraph_core.engine.compiler.lowering.kinds import OPTIONS
from pgraph_core.gait.footing import FEET
from pgraph_peers import mujoco as in_mujoco

from .machine import has
from .measure import Disagreement, Effort, Row, compared
from .scenes import STEP, built_in

MINUTES = 1.0
PEERS = ("mujoco",)
WALKS = (
    ("trot", "quadruped_hips", 30.0), ("crawl", "quadruped_hips", 30.0),
    ("gallop", "quadruped_hips", 30.0), ("bound", "quadruped", 10.0),
)  # fmt: skip
SETTLED = 1.0  # s: before it a run starts from a stand
SOLE = 1e-3  # m: MuJoCo's feet are balls of this radius
RECORDED = 3.0  # s of torques for MuJoCo
CALLS = 100  # of the controller in one sample

_call = caller(i8(f8, u8, u8, u8))


@numba.njit(**OPTIONS)
def call_controller(address, q, v, tau, step, n):
    """A controller n times, as runs call it; q, v and tau are addresses."""
    for k in range(n):
        _call(address, (k * step, q, v, tau))


@cache
def mechanism(name: str) -> pg.Mechanism:
    """A built-in model."""
    return pg.Mechanism(built_in(name))


def rows(effort: Effort) -> Iterator[Row]:
    for gait, model, seconds in effort.pick(WALKS, WALKS[:1]):
        yield walk(gait, model, effort.pick(seconds, 1.2))
    for solids in effort.pick((False, True), (False,)):
        yield from trot(effort, solids)


def walk(gait: str, name: str, t_end: float) -> Row:
    """A walk on flat ground by time stepping at 1 ms."""
    mech = mechanism(name)
    frames = round(t_end / STEP) + 1
    run = pg.simulate(mech, scenario=gait, t_end=t_end, frames=frames, estimate=False)
    late = run.t >= SETTLED
    up = 1 - 2 * (run.q[late, 4] ** 2 + run.q[late, 6] ** 2)
    weight = sum(body.mass for body in mech.model.bodies) * -mech.model.gravity[1]
    push = max(float(run.contact_normal[foot][late].max()) for foot in FEET)
    distance, seconds = run.q[-1, 0] - run.q[late, 0][0], run.t[-1] - run.t[late][0]
    return {
        "case": gait,
        "model": name,
        "time [s]": float(run.t[-1]),
        "fell": next((text for text in run.notices if "fell" in text), "no"),
        "speed [m/s]": float(distance / seconds),
        "aside [m]": float(run.q[-1, 2]),
        "tilt [deg]": float(np.degrees(np.arccos(np.clip(up.min(), -1, 1)))),
        "slip [mm]": 1e3 * max(max(slips(run, foot)) for foot in FEET),
        "depth [mm]": -1e3 * min(float(run.contact_gap[foot].min()) for foot in FEET),
        "largest push [weights]": push / weight,
        "energy balance": float(run.energy_drift),
        "times real time": float(run.t[-1]) / run.timing["step_processor"],
    }


def slips(run: pg.Result, foot: str) -> list[float]:
    """The path of a foot's sole on the ground, stance by stance [m]."""
    contact = next(c for c in run.mechanism.model.contacts if c.name == foot)
    pose = run.body_pose[:, run.mechanism.topology.number(contact.body) - 1]
    w, xyz, p = pose[:, 3:4], pose[:, 4:], np.array(contact.points[0])
    sole = pose[:, :3] + p + 2 * (w * np.cross(xyz, p) + np.cross(xyz, np.cross(xyz, p)))
    paths = np.linalg.norm(np.diff(sole[:, [0, 2]], axis=0), axis=1)
    on = run.phases[foot] != "swing"
    ends = np.flatnonzero(np.diff(np.concatenate(([False], on, [False])).astype(int)))
    return [float(paths[a + 1 : b - 1].sum()) for a, b in zip(ends[::2], ends[1::2])]


def trot(effort: Effort, solids: bool) -> Iterator[Row]:
    """Steps of half a stride. Ours include the controller; MuJoCo replays recorded torques."""
    mech = mechanism("quadruped_hips")
    if not solids:  # only the four points may touch
        model = mech.model
        feet = tuple(c for c in model.contacts if c.points)
        scenario = model.scenario("trot").model_copy(
            update={"contacts": tuple(c.name for c in feet)}
        )
        mech = pg.Mechanism(model.replace(contacts=feet, scenarios=(scenario,)))
    gait = mech.model.scenario("trot").gait
    assert gait is not None
    walk, steps = pg.Controller(mech, gait), round(gait.stride / STEP / 2)
    late = round(SETTLED / gait.stride) * gait.stride
    start = pg.simulate(mech, scenario="trot", t_end=late, frames=2, estimate=False)

    def ours() -> float:
        run = pg.simulate(
            mech, start.q[-1], start.v[-1], scenario="trot", t_start=late, frames=2,
            t_end=late + steps * STEP, step=STEP, estimate=False,
        )  # fmt: skip
        return run.timing["step_processor"]

    sides: dict[str, Any] = {"pgraph": ours, "pgraph, controller alone": controller(walk, steps)}
    if has("mujoco"):
        import mujoco.rollout

        theirs = in_mujoco.walker(mech.model, STEP, SOLE)
        first, torques = walked(theirs, mech, walk, round(late / STEP))
        spec, data = mujoco.mjtState.mjSTATE_QFRC_APPLIED, mujoco.MjData(theirs)
        options = {"control": torques[None, :steps], "control_spec": int(spec), "nstep": steps}
        sides["mujoco.rollout"] = lambda: mujoco.rollout.rollout(
            theirs, [data], first[None], **options
        )
    what = "points, boxes and capsules touch" if solids else "four points touch"
    given: dict[str, Any] = {"unit": "step", "per_call": steps, "clocked": {"pgraph"}}
    return compared(effort, f"trot, {what}", sides, rounds=effort.pick(100, 2), **given)


def controller(walk: pg.Controller, number: int) -> Any:
    """Calls of the controller without Python in between."""
    at_work, state = walk.acting(), walk.start()
    at_work.torque(0.0, *state)
    places = [row.ctypes.data for row in at_work.exchange[:3]]
    return lambda: call_controller(at_work.address, *places, STEP, number)


def walked(
    model: Any, mech: pg.Mechanism, walk: pg.Controller, late: int
) -> tuple[np.ndarray, np.ndarray]:
    """(MuJoCo's state after `late` steps, torques of each later one) of its own walk."""
    import mujoco

    data, at_work = mujoco.MjData(model), walk.acting()
    q, v = walk.start()
    origin = np.array(mech.model.bodies[0].link)
    data.qpos[:] = q
    data.qpos[:3] += origin
    first, torques = np.zeros(1 + model.nq + model.nv), np.zeros((round(RECORDED / STEP), mech.nv))
    for k, tau in enumerate(torques):
        if k == late:
            first[1:] = np.concatenate((data.qpos, data.qvel))
        q[:] = data.qpos
        q[:3] -= origin
        mujoco.mj_kinematics(model, data)
        turn = data.xmat[1].reshape(3, 3)
        v[:3], v[3:6], v[6:] = turn @ data.qvel[3:6], data.qvel[:3], data.qvel[6:]
        tau[6:] = at_work.torque(k * STEP, q, v)[6:]
        data.qfrc_applied[:] = tau
        mujoco.mj_step(model, data)
    if data.qpos[1] < 0.4:
        raise Disagreement("the trot falls in MuJoCo, so nothing is timed")
    return first, torques[late:]
