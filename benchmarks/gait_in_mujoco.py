"""The trot in MuJoCo: the same model, torques of the same compiled controller, its own contacts.

With four points that touch the ground, and with the boxes and capsules of all bodies.
"""

from __future__ import annotations

import time
from typing import Any

import numpy as np

import pgraph_core as pg
from pgraph_peers import mujoco as in_mujoco

from . import native
from .gait_checks import SETTLED, STEP, mechanism

SECONDS, ROUNDS = 3.0, 300
CALLS = 100  # of the controller in one sample
SOLE = 1e-3  # m: MuJoCo's feet are balls of this radius


def walked(
    model: Any, mech: pg.Mechanism, walk: pg.Controller, late: int
) -> tuple[Any, np.ndarray]:
    """(state after `late` steps, torques of each later one) of a walk under the controller."""
    import mujoco

    data, at_work = mujoco.MjData(model), walk.acting()
    q, v = walk.start()
    origin = np.array(mech.model.bodies[0].link)
    data.qpos[:] = q
    data.qpos[:3] += origin
    first, torques = np.zeros(1 + model.nq + model.nv), np.zeros((round(SECONDS / STEP), mech.nv))
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
        raise SystemExit("the trot falls in MuJoCo; nothing is timed")
    return first, torques[late:]


def scene(solids: bool) -> pg.Mechanism:
    """The quadruped that trots on four points; with `solids` the rest of it may touch too."""
    mech = mechanism("quadruped_hips")
    if solids:
        return mech
    model = mech.model
    feet = tuple(c for c in model.contacts if c.points)
    trot = model.scenario("trot").model_copy(update={"contacts": tuple(c.name for c in feet)})
    return pg.Mechanism(model.replace(contacts=feet, scenarios=(trot,)))


def times(solids: bool = False) -> dict[str, float]:
    """Seconds a step over half a stride, the minimum of interleaved rounds: disturbances only add.

    Ours includes the controller; MuJoCo replays recorded torques.
    """
    import mujoco.rollout

    mech = scene(solids)
    gait = mech.model.scenario("trot").gait
    assert gait is not None
    model = in_mujoco.walker(mech.model, STEP, SOLE)
    late, steps = round(SETTLED / gait.stride) * gait.stride, round(gait.stride / STEP / 2)
    first, torques = walked(model, mech, pg.Controller(mech, gait), round(late / STEP))
    start = pg.simulate(mech, scenario="trot", t_end=late, frames=2, estimate=False)
    spec, data = mujoco.mjtState.mjSTATE_QFRC_APPLIED, mujoco.MjData(model)
    options = {"control": torques[None, :steps], "control_spec": int(spec), "nstep": steps}
    found: dict[str, list[float]] = {"pgraph": [], "mujoco": []}
    for _ in range(ROUNDS):
        run = pg.simulate(
            mech, start.q[-1], start.v[-1], scenario="trot", t_start=late, frames=2,
            t_end=late + steps * STEP, step=STEP, estimate=False,
        )  # fmt: skip
        found["pgraph"].append(run.timing["step"] / steps)
        begin = time.perf_counter()
        mujoco.rollout.rollout(model, [data], first[None], **options)
        found["mujoco"].append((time.perf_counter() - begin) / steps)
    return {side: min(seconds) for side, seconds in found.items()}


def controller_call() -> float:
    """Seconds of one call of the controller alone, the minimum of many rounds."""
    mech = mechanism("quadruped_hips")
    gait = mech.model.scenario("trot").gait
    assert gait is not None
    walk = pg.Controller(mech, gait)
    at_work, state = walk.acting(), walk.start()
    at_work.torque(0.0, *state)
    places = [row.ctypes.data for row in at_work.exchange[:3]]
    spent = []
    for _ in range(ROUNDS):
        begin = time.perf_counter()
        native.torques(at_work.address, *places, STEP, CALLS)
        spent.append((time.perf_counter() - begin) / CALLS)
    return min(spent)


if __name__ == "__main__":
    call = controller_call()
    for solids in (False, True):
        found = times(solids)
        ratio = (found["mujoco"] + call) / found["pgraph"]
        what = "all shapes" if solids else "four points"
        said = {side: f"{1e6 * seconds:.2f} us" for side, seconds in found.items()}
        print(f"{what}: {said}, controller {1e6 * call:.2f} us: {ratio:.2f} times")
