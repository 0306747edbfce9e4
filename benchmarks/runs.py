"""Steps of one instance and of many, against mujoco.rollout."""

from __future__ import annotations

import time
from collections.abc import Callable

import numpy as np

import pgraph_core as pg
import pgraph_models
from pgraph_peers import exudyn as in_exudyn
from pgraph_peers import mujoco as in_mujoco

from .machine import has
from .scenes import STEP, Scene, differ, scene
from .timing import Case

GOAL_STEP, GOAL_BATCH = 2.5, 12.0
GOAL_CALL, GOAL_ESTIMATE = 2.0, 1.3  # of whole calls, without and with our error estimate
CALM = 0.3  # of the random angles: slow enough that errors stay small
PIECE = 20  # steps
CALLS = 40  # of forward_dynamics, which one step by `simulate` may cost
METHOD = "semi_implicit_euler"
METHODS = {"semi_implicit_euler": "semi-implicit Euler step", "rk4": "RK4 step"}


def steps(place: Scene, method: str, number: int, *, goal: bool = True) -> Case:
    """Steps under gravity inside one run, of which only the end is recorded.

    Ours is what `simulate` takes to build and to step; the error estimate that it makes besides
    has no counterpart.
    """
    name = f"{METHODS[method]}, {place.name}"
    mech, q, v = pg.Mechanism(place.model), place.state.q, place.state.v

    def run(n: int) -> pg.Result:
        return pg.simulate(mech, q, v, t_end=n * STEP, method=method, step=STEP, frames=2)

    def ours() -> float:
        timing = run(number).timing
        return timing["build"] + timing["step"]

    sides: dict[str, Callable[[], object]] = {"pgraph": ours}
    agreement = []
    if has("mujoco"):
        sides["mujoco.rollout"], _ = in_mujoco.rollout(place, STEP, method, number)
        _, change = in_mujoco.rollout(place, STEP, method, 20)
        agreement.append(f"mujoco {differ(run(20).q[-1] - q, change()[0], 1e-5, name)}")
    if has("exudyn") and method == "rk4":
        sides["exudyn RK44"], _ = in_exudyn.rk4_steps(place, STEP, number)
        _, change = in_exudyn.rk4_steps(place, STEP, 20)
        theirs = change()
        found = (run(20).q[-1] - q)[-len(theirs) :]
        agreement.append(f"exudyn {differ(theirs, found, 1e-9, name)}")
    return Case(
        name,
        sides,
        "step",
        number,
        ", ".join(agreement),
        {"mujoco.rollout": GOAL_STEP} if goal else {},
        frozenset({"pgraph"}),
    )


def long_steps(place: Scene, number: int) -> Case:
    """RK4 steps of a mechanism on which Exudyn takes seconds for one."""
    name = f"{METHODS['rk4']}, {place.name}"
    mech, q, v = pg.Mechanism(place.model), place.state.q, place.state.v

    def run(n: int) -> pg.Result:
        return pg.simulate(mech, q, v, t_end=n * STEP, method="rk4", step=STEP, frames=2)

    sides: dict[str, Callable[[], object]] = {"pgraph": lambda: run(number).timing["step"]}
    agreement = ""
    if has("exudyn"):
        one, change = in_exudyn.rk4_steps(place, STEP, 1)
        bound = 1e-6  # of its dense mass matrix, whose condition grows with the cube of the length
        agreement = f"exudyn {differ(change(), run(1).q[-1] - q, bound, name)}"

        def theirs() -> float:
            begin = time.perf_counter()
            one()
            return number * (time.perf_counter() - begin)

        sides["exudyn RK44"] = theirs
    return Case(name, sides, "step", number, agreement, clocked=frozenset(sides))


def batch(place: Scene, threads: int, size: int, number: int) -> Case:
    """Steps of many instances that start alike, on some threads, from prepared batches.

    MuJoCo writes every state into memory that it is given.
    """
    name = f"batch of the {place.name}, {threads} thread{'s' if threads > 1 else ''}"
    mech = pg.Mechanism(place.model)
    q, v = place.state.q, place.state.v
    many = pg.BatchStepper(mech, size, step=STEP, method=METHOD, threads=threads)

    def run() -> np.ndarray:
        many.reset(q, v)
        many.step(n=number)
        return many.q

    sides: dict[str, Callable[[], object]] = {"pgraph": run}
    agreement = ""
    if has("mujoco"):
        rollout = in_mujoco.rollout(place, STEP, "semi_implicit_euler", number, size, threads)
        sides["mujoco.rollout"], change = rollout
        agreement = f"mujoco {differ(run() - q, change(), 1e-5, name)}"
    goals = {"mujoco.rollout": GOAL_BATCH}
    return Case(name, sides, "instance-step", size * number, agreement, goals)


def whole_call(*, estimate: bool, chaotic: bool = False, number: int = 500) -> Case:
    """A whole call of `simulate` on a chain of 20, compared with one of `mujoco.rollout`.

    Both mechanisms are built; the error estimate has no counterpart. It takes finer runs where the
    motion is `chaotic`: the chain starts at random angles then, at a third of them otherwise.
    """
    place = scene("chain of 20", pg.Model.serial(20), 0.2)
    if not chaotic:
        place = place._replace(state=place.state._replace(q=CALM * place.state.q))
    name = f"whole call of {number} steps{', with the estimate' if estimate else ''}"
    name += ", chaotic" if chaotic else ""
    mech, q, v = pg.Mechanism(place.model), place.state.q, place.state.v
    options = {"t_end": number * STEP, "step": STEP, "method": "semi_implicit_euler", "frames": 2}

    def run() -> pg.Result:
        return pg.simulate(mech, q, v, estimate=estimate, **options)

    sides: dict[str, Callable[[], object]] = {"pgraph": run}
    agreement = ""
    if has("mujoco"):
        sides["mujoco.rollout"], change = in_mujoco.rollout(place, STEP, METHOD, number)
        agreement = f"mujoco {differ(run().q[-1] - q, change()[0], 1e-5, name)}"
    goals = {} if chaotic else {"mujoco.rollout": GOAL_ESTIMATE if estimate else GOAL_CALL}
    return Case(name, sides, agreement=agreement, goals=goals)


def one_step() -> Case:
    """One step by `simulate`, compared with the calls of `forward_dynamics` it may cost."""
    place = scene("chain of 20", pg.Model.serial(20), 0.2)
    mech, q, v, tau = pg.Mechanism(place.model), place.state.q, place.state.v, place.state.tau
    options = {"t_end": STEP, "step": STEP, "method": "semi_implicit_euler", "frames": 2}

    def calls() -> None:
        for _ in range(CALLS):
            mech.forward_dynamics(q, v, tau)

    sides: dict[str, Callable[[], object]] = {
        f"{CALLS} calls of forward_dynamics": calls,
        "pgraph": lambda: pg.simulate(mech, q, v, **options),
    }
    return Case(f"one step by simulate, {place.name}", sides, at_most={"pgraph": 1.0})


def walking() -> Case:
    """20 steps of a walk one by one, and as a piece of a walk, compared with 20 steps at once."""
    model = pg.Model.load(pgraph_models.path("quadruped_hips"))
    mech = pg.Mechanism(model)
    stepper = pg.Stepper(mech, scenario="trot")
    walk = pg.Walk(mech, "trot")
    stepper.step(n=1000)
    walk.step(1.0)

    def one_by_one() -> None:
        for _ in range(PIECE):
            stepper.step()

    sides: dict[str, Callable[[], object]] = {
        "20 steps at once": lambda: stepper.step(n=PIECE),
        "pgraph, one by one": one_by_one,
        "pgraph, Walk.step": lambda: walk.step(PIECE * STEP),
    }
    return Case("20 steps of 1 ms of a walk", sides, at_most={"pgraph, one by one": 1.5})
