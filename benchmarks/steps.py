"""Time steps and whole calls of `simulate` against MuJoCo's rollout and Exudyn."""

from __future__ import annotations

import time
from collections.abc import Callable, Iterator
from typing import Any

import pgraph_core as pg
from pgraph_peers import exudyn as in_exudyn
from pgraph_peers import mujoco as in_mujoco

from .machine import has
from .measure import Effort, Row, compared, differ
from .scenes import STEP, Scene, binary_tree, built_in, scene, tree_of_quadruped

MINUTES = 2.0
PEERS = ("mujoco", "exudyn")
EULER = "semi_implicit_euler"
TITLES = {EULER: "semi-implicit Euler step", "rk4": "RK4 step"}
CALM = 0.3  # of random angles: slow enough that errors stay small
PIECE = 20  # steps of a walk
CALLS = 40  # of forward_dynamics


def rows(effort: Effort) -> Iterator[Row]:
    number = effort.pick(2000, 20)
    for method in TITLES:
        yield from steps(effort, tree_of_quadruped(0.2), method, number)
    n = effort.pick(1023, 50)
    tree = scene(f"tree of {n}", binary_tree(n), 0.2, seed=4)
    yield from steps(effort, tree, EULER, effort.pick(200, 20))
    n = effort.pick(1000, 20)
    yield from long_steps(effort, scene(f"chain of {n}", pg.Model.serial(n), 0.2), 20)
    number = effort.pick(500, 20)
    for words in ("", ", with the estimate", ", with the estimate, chaotic"):
        yield from whole_call(effort, number, words)
    yield from one_step(effort)
    for place in (scene("chain of 20", pg.Model.serial(20), 0.2), tree_of_quadruped(0.2)):
        yield from short_calls(effort, place)
    yield from walking(effort)


def steps(effort: Effort, place: Scene, method: str, number: int) -> Iterator[Row]:
    """Steps under gravity inside one run of which only the end is recorded."""
    name = f"{TITLES[method]}, {place.name}"
    mech, q, v = pg.Mechanism(place.model), place.state.q, place.state.v

    def run(n: int) -> pg.Result:
        return pg.simulate(
            mech, q, v, t_end=n * STEP, method=method, step=STEP, frames=2, estimate=False
        )

    def ours() -> float:
        timing = run(number).timing
        return timing["build"] + timing["step_processor"]

    sides: dict[str, Callable[[], object]] = {"pgraph": ours}
    agrees = []
    if has("mujoco"):
        sides["mujoco.rollout"], _ = in_mujoco.rollout(place, STEP, method, number)
        _, change = in_mujoco.rollout(place, STEP, method, 20)
        agrees.append(f"mujoco {differ(run(20).q[-1] - q, change()[0], 1e-5, name)}")
    if has("exudyn") and method == "rk4":
        sides["exudyn RK44"], _ = in_exudyn.rk4_steps(place, STEP, number)
        _, change = in_exudyn.rk4_steps(place, STEP, 20)
        theirs = change()
        found = (run(20).q[-1] - q)[-len(theirs) :]
        agrees.append(f"exudyn {differ(theirs, found, 1e-9, name)}")
    given = {"unit": "step", "per_call": number, "agrees": ", ".join(agrees)}
    return compared(effort, name, sides, clocked={"pgraph"}, **given)


def long_steps(effort: Effort, place: Scene, number: int) -> Iterator[Row]:
    """RK4 steps of a chain on which Exudyn takes seconds for one."""
    name = f"{TITLES['rk4']}, {place.name}"
    mech, q, v = pg.Mechanism(place.model), place.state.q, place.state.v

    def run(n: int) -> pg.Result:
        return pg.simulate(mech, q, v, t_end=n * STEP, method="rk4", step=STEP, frames=2)

    sides: dict[str, Callable[[], object]] = {"pgraph": lambda: run(number).timing["step"]}
    agrees = ""
    if has("exudyn"):
        one, change = in_exudyn.rk4_steps(place, STEP, 1)
        bound = 1e-6  # of its dense mass matrix, whose condition grows with the cube of the length
        agrees = f"exudyn {differ(change(), run(1).q[-1] - q, bound, name)}"

        def theirs() -> float:
            begin = time.process_time()
            one()
            return number * (time.process_time() - begin)

        sides["exudyn RK44"] = theirs
    given = {"unit": "step", "per_call": number, "agrees": agrees, "rounds": effort.pick(5, 2)}
    return compared(effort, name, sides, clocked=set(sides), **given)


def whole_call(effort: Effort, number: int, words: str) -> Iterator[Row]:
    """A call of `simulate` on a chain of 20. The error estimate has no counterpart.

    It takes a finer run where the motion is chaotic: there the chain starts at random angles.
    """
    place = scene("chain of 20", pg.Model.serial(20), 0.2)
    state: Any = place.state
    if "chaotic" not in words:
        place = place._replace(state=state._replace(q=CALM * state.q))
    name = f"whole call of {number} steps{words}"
    mech, q, v = pg.Mechanism(place.model), place.state.q, place.state.v
    options = {"t_end": number * STEP, "step": STEP, "method": EULER, "frames": 2}

    def run() -> pg.Result:
        return pg.simulate(mech, q, v, estimate="estimate" in words, **options)

    sides: dict[str, Callable[[], object]] = {"pgraph": run}
    agrees = ""
    if has("mujoco"):
        sides["mujoco.rollout"], change = in_mujoco.rollout(place, STEP, EULER, number)
        agrees = f"mujoco {differ(run().q[-1] - q, change()[0], 1e-5, name)}"
    return compared(effort, name, sides, agrees=agrees)


def one_step(effort: Effort) -> Iterator[Row]:
    """One step by `simulate`, compared with calls of `forward_dynamics`."""
    place = scene("chain of 20", pg.Model.serial(20), 0.2)
    mech, q, v, tau = pg.Mechanism(place.model), place.state.q, place.state.v, place.state.tau
    options = {"t_end": STEP, "step": STEP, "method": EULER, "frames": 2}

    def calls() -> None:
        for _ in range(CALLS):
            mech.forward_dynamics(q, v, tau)

    ours = {"pgraph": lambda: pg.simulate(mech, q, v, **options)}
    sides = {f"{CALLS} calls of forward_dynamics": calls, **ours}
    return compared(effort, f"one step by simulate, {place.name}", sides)


def short_calls(effort: Effort, place: Scene) -> Iterator[Row]:
    """An episode of 20 steps from the initial state, by a Stepper and by `simulate`."""
    name = f"{PIECE} steps from the start, {place.name}"
    mech, q, v = pg.Mechanism(place.model), place.state.q, place.state.v
    options = {"t_end": PIECE * STEP, "step": STEP, "method": EULER, "frames": 2}
    stepper = pg.Stepper(mech, step=STEP, method=EULER, q=q, v=v)

    def episode() -> None:
        stepper.reset(q, v)
        stepper.step(n=PIECE)

    sides: dict[str, Callable[[], object]] = {
        "pgraph, Stepper": episode,
        "pgraph, its reset alone": lambda: stepper.reset(q, v),
        "pgraph, simulate": lambda: pg.simulate(mech, q, v, estimate=False, **options),
        "pgraph, simulate with the estimate": lambda: pg.simulate(mech, q, v, **options),
    }
    agrees = ""
    if has("mujoco"):
        sides["mujoco.rollout"], change = in_mujoco.rollout(place, STEP, EULER, PIECE)
        episode()
        agrees = f"mujoco {differ(stepper.q - q, change()[0], 1e-5, name)}"
    yield from compared(effort, name, sides, agrees=agrees)


def walking(effort: Effort) -> Iterator[Row]:
    """20 steps of a walk one by one, and as a piece of a walk, compared with 20 steps at once."""
    mech = pg.Mechanism(built_in("quadruped_hips"))
    stepper, walk = pg.Stepper(mech, scenario="trot"), pg.Walk(mech, "trot")
    stepper.step(n=effort.pick(1000, 10))
    walk.step(effort.pick(1.0, 0.01))

    def one_by_one() -> None:
        for _ in range(PIECE):
            stepper.step()

    sides: dict[str, Callable[[], object]] = {
        f"{PIECE} steps at once": lambda: stepper.step(n=PIECE),
        "pgraph, one by one": one_by_one,
        "pgraph, Walk.step": lambda: walk.step(PIECE * STEP),
    }
    return compared(effort, f"{PIECE} steps of 1 ms of a walk", sides)
