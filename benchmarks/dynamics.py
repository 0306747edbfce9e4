"""Accelerations: calls from Python, native loops, long chains and deep trees, stance."""

from __future__ import annotations

import time
from collections.abc import Callable

import numpy as np

import pgraph_core as pg
from pgraph_core.dynamics.dynamics import BackEnd
from pgraph_core.engine import layout as at
from pgraph_peers import drake as in_drake
from pgraph_peers import mujoco as in_mujoco
from pgraph_peers import pinocchio as in_pinocchio

from . import native
from .machine import has
from .random_models import State
from .scenes import STEP, Scene, bare, differ, quadruped, scene
from .timing import Case

CHAINS = (10, 30, 100, 300, 1000, 3000, 10000)


def one_call(place: Scene, name: str, *, goals: dict[str, float], pinocchio: bool = True) -> Case:
    """v' of a tree, one call from Python."""
    mech, (_, _, q, v, tau, *_) = pg.Mechanism(place.model), place.state
    found = mech.forward_dynamics(q, v, tau)
    sides: dict[str, Callable[[], object]] = {"pgraph": lambda: mech.forward_dynamics(q, v, tau)}
    agreement = []
    if has("pin") and pinocchio:
        sides["pin.aba"], theirs = in_pinocchio.forward_dynamics(place)
        agreement.append(f"pin {differ(theirs, found, 1e-9, name)}")
    if has("mujoco"):
        import mujoco

        model, data, T = in_mujoco.loaded(place, STEP)
        mujoco.mj_forward(model, data)
        bound = 1e-9 if mech.nb < 100 else 1e-6  # it loses digits along chains
        agreement.append(f"mujoco {differ(T.T @ data.qacc, found, bound, name)}")
        sides["mj_forward"] = lambda: mujoco.mj_forward(model, data)
    if has("drake"):
        sides["drake"], theirs = in_drake.forward_dynamics(place)
        agreement.append(f"drake {differ(theirs, found, 1e-9, name)}")
    return Case(name, sides, agreement=", ".join(agreement), goals=goals)


def native_loop(place: Scene, name: str, number: int = 500, *, compiling: bool = True) -> Case:
    """v' of a tree, `number` times without Python in between."""
    sides: dict[str, Callable[[], object]] = {"pgraph": ours_in_a_loop(place, number)}
    _, _, q, v, tau, *_ = place.state
    found = pg.Mechanism(place.model).forward_dynamics(q, v, tau)
    agreement = []
    if has("mujoco"):
        model, data, T = in_mujoco.loaded(place, STEP)
        loop = native.mujoco_loop(model, data)
        loop(1)
        agreement.append(f"mujoco {differ(T.T @ data.qacc, found, 1e-9, name)}")
        sides["mj_forward"] = lambda: loop(number)
    if has("pin"):
        from . import pinocchio_native

        loaded = pinocchio_native.library(compiling=compiling)
        if not isinstance(loaded, str):
            run, theirs = pinocchio_native.loop(place, loaded)
            agreement.append(f"pin {differ(theirs, found, 1e-9, name)}")
            sides["pinocchio::aba"] = lambda: run(number)
    return Case(name, sides, "call", number, ", ".join(agreement), {"mj_forward": 2.5})


def back_ends(place: Scene) -> Case:
    """The three back ends of `forward_dynamics`, one call from Python each."""
    mech, (_, _, q, v, tau, *_) = pg.Mechanism(place.model), place.state
    name, ours = f"back ends, {place.name}", mech.forward_dynamics(q, v, tau)

    def by(back_end: BackEnd) -> Callable[[], object]:
        return lambda: mech.forward_dynamics(q, v, tau, back_end=back_end)

    others = {"composite": by("composite"), "operators": by("operators")}
    agreement = [f"{other} {differ(call(), ours, 1e-9, name)}" for other, call in others.items()]
    sides = {"pgraph": by("articulated"), **others}
    return Case(name, sides, agreement=", ".join(agreement))


def derivatives(place: Scene) -> Case:
    """∂v'/∂q, ∂v'/∂v, ∂v'/∂τ of a tree of hinges, one call from Python."""
    mech, (_, _, q, v, tau, *_) = pg.Mechanism(place.model), place.state
    name, found = f"derivatives, {place.name}", np.stack(mech.forward_derivatives(q, v, tau))
    sides: dict[str, Callable[[], object]] = {"pgraph": lambda: mech.forward_derivatives(q, v, tau)}
    agreement = ""
    if has("pin"):
        sides["pin.computeABADerivatives"], theirs = in_pinocchio.derivatives(place)
        agreement = f"pin {differ(theirs, found, 1e-9, name)}"
    return Case(name, sides, agreement=agreement)


def ours_in_a_loop(place: Scene, number: int) -> Callable[[], None]:
    """Our kernel on workspaces of its own, checked against the public call."""
    mech, (_, _, q, v, tau, *_) = pg.Mechanism(place.model), place.state
    work, vdot = np.zeros((len(mech.packed.system.rows), at.WORK)), np.empty(mech.nv)
    native.forward_dynamics(*mech.packed.tree, q, v, tau, work, vdot, 1)
    differ(vdot, mech.forward_dynamics(q, v, tau), 1e-12, "our native loop")
    return lambda: native.forward_dynamics(*mech.packed.tree, q, v, tau, work, vdot, number)


def chains(longest: int) -> Case:
    """Our forward dynamics of serial chains in a native loop; every side clocks one call."""

    def clocked(n: int) -> Callable[[], float]:
        number = max(1, 3000 // n)
        loop = ours_in_a_loop(scene(f"chain of {n}", pg.Model.serial(n), 0.2), number)

        def seconds() -> float:
            begin = time.perf_counter()
            loop()
            return (time.perf_counter() - begin) / number

        return seconds

    sides = {f"n = {n}": clocked(n) for n in CHAINS if n <= longest}
    return Case("forward dynamics, chains", sides, clocked=frozenset(sides))


def stance_call() -> Case:
    """v' and forces of the quadruped on four feet, one call from Python."""
    state = standing()
    mech, (_, _, q, v, tau, *_) = pg.Mechanism(state.model), state
    ours = {"pgraph": lambda: mech.constrained_dynamics(q, v, tau)}
    peers, agreement = stance_peers(state)
    return Case("stance, one call from Python", ours | peers, agreement=agreement)


def stance_run() -> Case:
    """A whole run of the scenario, per acceleration evaluation: projection and ledgers included.

    Two frames are recorded; building the run counts, the error estimate does not.
    """
    state = standing()
    mech = pg.Mechanism(state.model)

    def ours() -> float:
        run = pg.simulate(mech, scenario="stance", frames=2)
        return (run.timing["build"] + run.timing["step"]) / run.counters["evaluations"]

    drift = pg.simulate(mech, scenario="stance").constraint_drift[:, 0].max()
    peers, agreement = stance_peers(state)
    if has("mujoco"):
        loop = native.mujoco_loop(*in_mujoco.stance(state))
        peers["mj_forward, native loop"] = lambda: loop(1)
    goals = {"pin.constraintDynamics": 2.0, "mj_forward": 2.0}
    return Case(
        "stance, whole run",
        {"pgraph": ours, **peers},
        "evaluation",
        agreement=f"{agreement}; feet drift {drift:.0e} m",
        goals=goals,
        clocked=frozenset({"pgraph"}),
    )


def standing() -> State:
    """The quadruped at rest under the torques of the scenario 'stand'."""
    model = quadruped()
    mech = pg.Mechanism(model)
    q, v = mech.home()
    tau = np.zeros(mech.nv)
    for force in model.scenario("stand").forces:
        tau[mech.names.index(force.body) + 5] = force.torque
    return State(model, mech.topology, q, v, tau, v, np.zeros((mech.nb, 6)))


def stance_peers(state: State) -> tuple[dict[str, Callable[[], object]], str]:
    """The peers' calls, and how far their vertical forces are from ours."""
    _, forces = pg.Mechanism(state.model).constrained_dynamics(state.q, state.v, state.tau)
    vertical = np.array([forces[c.name][4] for c in state.model.constraints])
    sides: dict[str, Callable[[], object]] = {}
    agreement = []
    if has("pin"):
        call, force = in_pinocchio.stance(state)
        call()
        theirs = force()[:, 1]
        agreement.append(f"pin {differ(vertical, theirs, 1e-5, 'stance')}")
        sides["pin.constraintDynamics"] = call
    if has("mujoco"):
        import mujoco

        model, data = in_mujoco.stance(state)
        mujoco.mj_forward(model, data)
        soft = abs(np.array(data.efc_force).reshape(-1, 3)[:, 1] - vertical).max()
        agreement.append(f"mujoco's soft feet by {soft:.2g} N")
        sides["mj_forward"] = lambda: mujoco.mj_forward(model, data)
    return sides, ", ".join(agreement)


def quadruped_tree() -> Scene:
    """The quadruped without its feet on the ground."""
    return scene("quadruped", bare(quadruped()))
