"""Many quadrupeds at once next to `mujoco.rollout`: `python -m benchmarks.many`.

Standing on springs, walking, the stance of the paper, and free trees: the same model, step, number
of instances and threads on both sides, elliptic cones, four contact points a robot. Processor time,
the minimum of alternating rounds: disturbances only add. MuJoCo replays torques of the walk; ours
are computed. What each side misses is stated: depth of the feet, and drift of those that stand.
"""

from __future__ import annotations

import sys
import time
from collections.abc import Callable
from importlib import import_module
from typing import Any, NamedTuple

import numpy as np

import pgraph_core as pg
import pgraph_models
from pgraph_peers import mujoco as in_mujoco

from . import dynamics
from .gait_in_mujoco import walked
from .machine import machine

STEP, THREADS, ROUNDS = 1e-3, 2, 5
SOLE = 1e-3  # m: MuJoCo's feet are balls of this radius
STIFF, DAMPED = 800.0, 20.0  # N m/rad, N m s/rad: joints of the quadruped that stands
SETTLE = 300  # steps before the clock starts
STRIDE = 380  # steps of the trot: a round of it has all landings of all feet


class Pair(NamedTuple):
    """The same work on both sides, and what each misses."""

    name: str
    size: int
    steps: int
    ours: Callable[[], object]
    theirs: Callable[[], object]
    goal: float
    missed: str = ""


def standing() -> pg.Model:
    """The quadruped at rest on its joints' springs."""
    model = pg.Model.load(pgraph_models.path("quadruped_hips"))
    mech = pg.Mechanism(model)
    gait = model.scenario("stand").gait
    assert gait is not None
    q, _ = pg.Controller(mech, gait).start()
    for name, joint in mech.joints.items():
        at = q[joint.q]
        if len(at) == len(joint.kinds):  # hinges
            many = len(at)
            model = model.edit(
                name, kind="body", q=at, stiffness=[STIFF] * many, damping=[DAMPED] * many, rest=at
            )
        else:
            model = model.edit(name, kind="body", q=at)
    for contact in model.contacts:
        model = model.edit(contact.name, kind="contact", active=True)
    return model


def compiled(model: pg.Model, springs: bool) -> Any:
    """MuJoCo's model with elliptic cones, and the joints' springs where they are wanted."""
    mujoco: Any = import_module("mujoco")
    found = in_mujoco.walker(model, STEP, SOLE)
    found.opt.cone = mujoco.mjtCone.mjCONE_ELLIPTIC
    if springs:
        mech = pg.Mechanism(model)
        q, _ = mech.home()
        found.qpos_spring[7:] = q[7:]
        found.jnt_stiffness[1:], found.dof_damping[6:] = STIFF, DAMPED
    return found


def rollout(
    model: Any, first: np.ndarray, size: int, steps: int, torques: np.ndarray | None = None
) -> Callable[[], np.ndarray]:
    """Steps of many instances from one full state; (size, steps, state)."""
    mujoco: Any = import_module("mujoco")
    rollouts: Any = import_module("mujoco.rollout")
    pool = rollouts.Rollout(nthread=THREADS)
    data = [mujoco.MjData(model) for _ in range(THREADS)]
    starts = np.repeat(first[None], size, axis=0)
    out = np.empty((size, steps, len(first)))
    options: dict[str, Any] = {"nstep": steps}
    if torques is not None:
        options["control"] = np.repeat(torques[None, :steps], size, axis=0)
        options["control_spec"] = int(mujoco.mjtState.mjSTATE_QFRC_APPLIED)

    def run() -> np.ndarray:
        pool.rollout(model, data, starts, state=out, **options)
        return out

    return run


def stand(size: int, steps: int) -> Pair:
    """Both sides stand at rest before they are timed."""
    mujoco: Any = import_module("mujoco")
    model = standing()
    batch = pg.BatchStepper(model, size, step=STEP, threads=THREADS)
    batch.step(n=SETTLE)
    theirs = compiled(model, springs=True)
    data = mujoco.MjData(theirs)
    data.qpos[:] = pg.Mechanism(model).home()[0]
    data.qpos[:3] += np.array(model.bodies[0].link)
    for _ in range(SETTLE):
        mujoco.mj_step(theirs, data)
    first = np.concatenate(([0.0], data.qpos, data.qvel))
    q, speed = batch.q[0].copy(), np.abs(batch.v[0]).max()
    batch.step(n=steps)
    missed = (
        f"ours: at rest to {speed:.0e}, moves {np.abs(batch.q[0] - q).max():.0e} in the round, "
    )
    missed += f"gap {min(g[0] for g in batch.contact_gap.values()):.0e} m; MuJoCo: "
    run = rollout(theirs, first, size, steps)
    moved = np.abs(run()[0, -1, 1 : 1 + theirs.nq] - data.qpos).max()
    deep = min(float(c.dist) for c in data.contact)
    missed += f"at rest to {np.abs(data.qvel).max():.0e}, moves {moved:.0e}, gap {deep:.0e} m"
    return Pair("standing on springs", size, steps, lambda: batch.step(n=steps), run, 4.0, missed)


def walk(size: int, steps: int) -> Pair:
    """A trot; MuJoCo begins each round where its own walk was, at the same part of a stride."""
    mech = pg.Mechanism(pg.Model.load(pgraph_models.path("quadruped_hips")))
    gait = mech.model.scenario("trot").gait
    assert gait is not None
    late = round(gait.stride / STEP)
    model = compiled(mech.model, springs=False)
    first, torques = walked(model, mech, pg.Controller(mech, gait), late)
    batch = pg.BatchStepper(mech, size, step=STEP, threads=THREADS, scenario="trot")
    batch.step(n=late)
    saved = batch.save()

    def ours() -> None:
        batch.restore(saved)
        batch.step(n=steps)

    ours()
    deep = min(g.min() for g in batch.contact_gap.values())
    missed = f"ours: deepest foot {deep:.0e} m at the end, {int(batch.ok.sum())} of {size} go on"
    return Pair(
        "walking", size, steps, ours, rollout(model, first, size, steps, torques), 3.0, missed
    )


def stance(size: int, steps: int) -> Pair:
    """The paper's stance: 12 rows of constraints, RK4 on both sides, torques that hold it."""
    mujoco: Any = import_module("mujoco")
    state = dynamics.standing()
    batch = pg.BatchStepper(
        state.model, size, step=STEP, threads=THREADS, method="rk4", tau=state.tau
    )
    saved = batch.save()

    def ours() -> None:
        batch.restore(saved)
        batch.step(n=steps)

    theirs, data = in_mujoco.stance(state, in_mujoco.SOFT, STEP, rk4=True)
    theirs.opt.tolerance, theirs.opt.iterations = 1e-8, 100  # its defaults
    torques = np.repeat(data.qfrc_applied[None], steps, axis=0)
    first = np.concatenate(([0.0], data.qpos, data.qvel))
    ours()
    held = pg.simulate(state.model, batch.q[0], batch.v[0], t_end=STEP, step=STEP, method="rk4")
    run = rollout(theirs, first, size, steps, torques)
    data.qpos[:] = run()[0, -1, 1 : 1 + theirs.nq]
    mujoco.mj_forward(theirs, data)
    missed = f"ours: constraints to {held.constraint_drift[0, 0]:.0e} m at the end; "
    missed += f"MuJoCo: to {np.abs(data.efc_pos).max():.0e} m"
    return Pair("stance, 12 rows", size, steps, ours, run, 6.0, missed)


def trees(size: int, steps: int) -> Pair:
    """The quadruped without contacts or constraints."""
    place: Any = dynamics.quadruped_tree()
    slow = place._replace(state=place.state._replace(v=0.2 * place.state.v))
    batch = pg.BatchStepper(
        place.model, size, step=STEP, threads=THREADS, method="semi_implicit_euler"
    )
    batch.reset(slow.state.q, slow.state.v)
    saved = batch.save()

    def ours() -> None:
        batch.restore(saved)
        batch.step(n=steps)

    theirs, _ = in_mujoco.rollout(slow, STEP, "semi_implicit_euler", steps, size, THREADS)
    return Pair("free trees", size, steps, ours, theirs, 12.0)


def measured(pair: Pair, rounds: int = ROUNDS) -> tuple[float, float]:
    """Processor time an instance and step of ours and of theirs [s]."""
    found: list[list[float]] = [[], []]
    for _ in range(rounds):
        for side, call in enumerate((pair.ours, pair.theirs)):
            begin = time.process_time()
            call()
            found[side].append(time.process_time() - begin)
    ours, theirs = (min(x) / (pair.size * pair.steps) for x in found)
    return ours, theirs


def main() -> None:
    """A row for each comparison."""
    only = sys.argv[1:]
    print(machine())
    print("| work | instances | ours [us] | MuJoCo [us] | ratio | goal | missed |")
    print("|---|---|---|---|---|---|---|")
    for make in (stand, walk, stance, trees):
        for size, steps in ((64, 300), (1024, 40)):
            if only and make.__name__ not in only:
                continue
            pair = make(size, STRIDE if make is walk else steps)
            ours, theirs = measured(pair)
            print(
                f"| {pair.name} | {size} | {1e6 * ours:.2f} | {1e6 * theirs:.2f} | "
                f"{theirs / ours:.2f} | {pair.goal:g} | {pair.missed} |",
                flush=True,
            )


if __name__ == "__main__":
    main()
