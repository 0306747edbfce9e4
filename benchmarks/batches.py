"""Many quadrupeds at once, free, standing, walking and in stance, against MuJoCo's rollout."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from typing import Any

import numpy as np

import pgraph_core as pg
from pgraph_peers import mujoco as in_mujoco

from .gaits import SOLE, walked
from .machine import has
from .measure import Effort, Row, compared, differ
from .scenes import STEP, built_in, standing, tree_of_quadruped

MINUTES = 3.0
PEERS = ("mujoco",)
THREADS = 2
STIFF, DAMPED = 800.0, 20.0  # N m/rad, N m s/rad: joints of the quadruped that stands
SETTLE = 300  # steps before the clock starts
STRIDE = 380  # steps of the trot: a round has all landings of all feet
Work = tuple[dict[str, Callable[[], object]], str]  # (sides, what they miss)


def rows(effort: Effort) -> Iterator[Row]:
    """Free trees by the clock on one and two threads, then all work in processor time."""
    size, number = effort.pick((256, 400), (8, 10))
    for threads in (1, 2):
        sides, missed = trees(size, number, threads)
        name = f"free trees, {size} instances, {threads} thread{'s' * (threads > 1)}, by the clock"
        given = {"per_call": size * number, "agrees": missed, "wall": True}
        yield from compared(effort, name, sides, unit="instance-step", **given)
    for make in (stand, walk, stance, trees):
        for size, number in effort.pick(((64, 300), (1024, 40)), ((4, 10),)):
            number = effort.pick(STRIDE, 10) if make is walk else number
            sides, missed = make(size, number)
            name = f"{WORK[make.__name__]}, {size} instances"
            given = {"per_call": size * number, "agrees": missed, "rounds": effort.pick(5, 2)}
            yield from compared(effort, name, sides, unit="instance-step", **given)


def rollout(
    model: Any, first: np.ndarray, size: int, steps: int, torques: np.ndarray | None = None
) -> Callable[[], np.ndarray]:
    """Steps of many instances from one full state; (size, steps, state)."""
    import mujoco
    import mujoco.rollout

    pool = mujoco.rollout.Rollout(nthread=THREADS)
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


def compiled(model: pg.Model) -> Any:
    """MuJoCo's model with elliptic cones."""
    import mujoco

    found = in_mujoco.walker(model, STEP, SOLE)
    found.opt.cone = mujoco.mjtCone.mjCONE_ELLIPTIC
    return found


def stand(size: int, steps: int) -> Work:
    """At rest on the joints' springs."""
    model = built_in("quadruped_hips")
    mech = pg.Mechanism(model)
    gait = model.scenario("stand").gait
    assert gait is not None
    q, _ = pg.Controller(mech, gait).start()
    for name, joint in mech.joints.items():
        at = q[joint.q]
        many = len(at) if len(at) == len(joint.kinds) else 0  # of hinges
        spring = {"stiffness": [STIFF] * many, "damping": [DAMPED] * many, "rest": at}
        model = model.edit(name, kind="body", q=at, **(spring if many else {}))
    for contact in model.contacts:
        model = model.edit(contact.name, kind="contact", active=True)
    batch = pg.BatchStepper(model, size, step=STEP, threads=THREADS)
    batch.step(n=SETTLE)
    q, speed = batch.q[0].copy(), np.abs(batch.v[0]).max()
    batch.step(n=steps)
    missed = f"ours: at rest to {speed:.0e}, moves {np.abs(batch.q[0] - q).max():.0e}"
    sides: dict[str, Callable[[], object]] = {"pgraph": lambda: batch.step(n=steps)}
    if has("mujoco"):
        import mujoco

        theirs = compiled(model)
        home = pg.Mechanism(model).home()[0]
        theirs.qpos_spring[7:] = home[7:]
        theirs.jnt_stiffness[1:], theirs.dof_damping[6:] = STIFF, DAMPED
        data = mujoco.MjData(theirs)
        data.qpos[:] = home
        data.qpos[:3] += np.array(model.bodies[0].link)
        mujoco.mj_step(theirs, data, SETTLE)
        run = rollout(theirs, np.concatenate(([0.0], data.qpos, data.qvel)), size, steps)
        moved = np.abs(run()[0, -1, 1 : 1 + theirs.nq] - data.qpos).max()
        missed += f"; MuJoCo: at rest to {np.abs(data.qvel).max():.0e}, moves {moved:.0e}"
        sides["mujoco.rollout"] = run
    return sides, missed


def walk(size: int, steps: int) -> Work:
    """A trot; MuJoCo replays torques of its own walk from the same part of a stride."""
    mech = pg.Mechanism(built_in("quadruped_hips"))
    gait = mech.model.scenario("trot").gait
    assert gait is not None
    late = round(gait.stride / STEP)
    batch = pg.BatchStepper(mech, size, step=STEP, threads=THREADS, scenario="trot")
    batch.step(n=late)
    ours = _again(batch, steps)
    ours()
    deep = min(g.min() for g in batch.contact_gap.values())
    missed = f"ours: deepest foot {deep:.0e} m, {int(batch.ok.sum())} of {size} go on"
    sides: dict[str, Callable[[], object]] = {"pgraph": ours}
    if has("mujoco"):
        theirs = compiled(mech.model)
        first, torques = walked(theirs, mech, pg.Controller(mech, gait), late)
        sides["mujoco.rollout"] = rollout(theirs, first, size, steps, torques)
    return sides, missed


def stance(size: int, steps: int) -> Work:
    """The paper's stance: 12 rows of constraints, RK4, torques that hold it."""
    state = standing()
    given = {"step": STEP, "threads": THREADS, "method": "rk4", "tau": state.tau}
    batch = pg.BatchStepper(state.model, size, **given)
    ours = _again(batch, steps)
    ours()
    held = pg.simulate(state.model, batch.q[0], batch.v[0], t_end=STEP, step=STEP, method="rk4")
    missed = f"ours: constraints to {held.constraint_drift[0, 0]:.0e} m"
    sides: dict[str, Callable[[], object]] = {"pgraph": ours}
    if has("mujoco"):
        import mujoco

        theirs, data = in_mujoco.stance(state, in_mujoco.SOFT, STEP, rk4=True)
        theirs.opt.tolerance, theirs.opt.iterations = 1e-8, 100  # its defaults
        torques = np.repeat(data.qfrc_applied[None], steps, axis=0)
        first = np.concatenate(([0.0], data.qpos, data.qvel))
        run = rollout(theirs, first, size, steps, torques)
        data.qpos[:] = run()[0, -1, 1 : 1 + theirs.nq]
        mujoco.mj_forward(theirs, data)
        missed += f"; MuJoCo: to {np.abs(data.efc_pos).max():.0e} m"
        sides["mujoco.rollout"] = run
    return sides, missed


def trees(size: int, steps: int, threads: int = THREADS) -> Work:
    """The quadruped without contacts or constraints."""
    place = tree_of_quadruped(0.2)
    q, v, method = place.state.q, place.state.v, "semi_implicit_euler"
    batch = pg.BatchStepper(place.model, size, step=STEP, threads=threads, method=method)

    def ours() -> np.ndarray:
        batch.reset(q, v)
        batch.step(n=steps)
        return batch.q

    sides: dict[str, Callable[[], object]] = {"pgraph": ours}
    missed = ""
    if has("mujoco"):
        given = place, STEP, method, steps, size, threads
        sides["mujoco.rollout"], change = in_mujoco.rollout(*given)
        missed = f"mujoco {differ(ours() - q, change(), 1e-5, 'free trees')}"
    return sides, missed


WORK = {
    "stand": "standing on springs", "walk": "walking", "stance": "stance, 12 rows",
    "trees": "free trees",
}  # fmt: skip


def _again(batch: pg.BatchStepper, steps: int) -> Callable[[], None]:
    """The same steps from the same state."""
    saved = batch.save()

    def call() -> None:
        batch.restore(saved)
        batch.step(n=steps)

    return call
