"""Forward dynamics and its derivatives: calls from Python, native loops, long chains, stance."""

from __future__ import annotations

import ctypes
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any

import numba
import numpy as np

import pgraph_core as pg
from pgraph_core.engine import layout as at
from pgraph_core.engine.compiler.lowering.kinds import OPTIONS
from pgraph_core.engine.tree.dynamics import articulated
from pgraph_peers import drake as in_drake
from pgraph_peers import mujoco as in_mujoco
from pgraph_peers import pinocchio as in_pinocchio

from .machine import has
from .measure import Effort, Row, compared, differ
from .scenes import STEP, Scene, State, binary_tree, scene, standing, tree_of_quadruped

MINUTES = 2.0
PEERS = ("mujoco", "pin", "drake")
CHAINS = (10, 30, 100, 300, 1000, 3000, 10000)
LOOP = 500  # calls in a native loop

Calls = dict[str, Callable[[], object]]


@numba.njit(**OPTIONS)
def loop_of_ours(rows, const, q, v, tau, work, vdot, n):
    """v' of the tree, n times without Python in between."""
    for _ in range(n):
        articulated(rows, const, q, v, tau, work, vdot)


def loop_of_mujoco(model: Any, data: Any) -> Callable[[int], None]:
    """mj_forward of MuJoCo's own library, n times without Python in between."""
    import mujoco

    library = next(Path(mujoco.__file__).parent.glob("libmujoco.*"))
    mj_forward = ctypes.CDLL(str(library)).mj_forward
    mj_forward.argtypes, mj_forward.restype = (ctypes.c_void_p, ctypes.c_void_p), None

    @numba.njit
    def loop(model_address, data_address, n):
        for _ in range(n):
            mj_forward(model_address, data_address)

    return lambda n: loop(model._address, data._address, n)


def rows(effort: Effort) -> Iterator[Row]:
    quadruped = tree_of_quadruped()
    yield from one_call(effort, quadruped)
    yield from native_loop(effort, quadruped)
    yield from derivatives(effort, scene("chain of 10", pg.Model.serial(10)))
    yield from stance_run(effort)
    yield from stance_call(effort)
    n = effort.pick(1000, 50)
    chain = scene(f"chain of {n}", pg.Model.serial(n), 0.2)
    yield from one_call(effort, chain, pinocchio=n < 100)
    yield from one_call(effort, scene(f"tree of {n}", binary_tree(n), 0.2, 4), pinocchio=n < 100)
    yield from chains(effort)


def one_call(effort: Effort, place: Scene, *, pinocchio: bool = True) -> Iterator[Row]:
    """v' of a tree. Pinocchio's data is cubic in the length of a chain: 1000 need over 4 GiB."""
    name = f"forward dynamics, {place.name}"
    mech, (_, _, q, v, tau, *_) = pg.Mechanism(place.model), place.state
    found = mech.forward_dynamics(q, v, tau)
    sides: Calls = {"pgraph": lambda: mech.forward_dynamics(q, v, tau)}
    agrees = []
    if has("pin") and pinocchio:
        sides["pin.aba"], theirs = in_pinocchio.forward_dynamics(place)
        agrees.append(f"pin {differ(theirs, found, 1e-9, name)}")
    if has("mujoco"):
        import mujoco

        model, data, T = in_mujoco.loaded(place, STEP)
        mujoco.mj_forward(model, data)
        bound = 1e-9 if mech.nb < 100 else 1e-6  # it loses digits along chains
        agrees.append(f"mujoco {differ(T.T @ data.qacc, found, bound, name)}")
        sides["mj_forward"] = lambda: mujoco.mj_forward(model, data)
    if has("drake"):
        sides["drake"], theirs = in_drake.forward_dynamics(place)
        agrees.append(f"drake {differ(theirs, found, 1e-9, name)}")
    return compared(effort, name, sides, agrees=", ".join(agrees))


def native_loop(effort: Effort, place: Scene) -> Iterator[Row]:
    """v' of a tree without Python in between."""
    name = f"forward dynamics, {place.name}, native loop"
    sides: Calls = {"pgraph": ours_in_a_loop(place, LOOP)}
    _, _, q, v, tau, *_ = place.state
    agrees = ""
    if has("mujoco"):
        model, data, T = in_mujoco.loaded(place, STEP)
        loop = loop_of_mujoco(model, data)
        loop(1)
        expected = pg.Mechanism(place.model).forward_dynamics(q, v, tau)
        agrees = f"mujoco {differ(T.T @ data.qacc, expected, 1e-9, name)}"
        sides["mj_forward"] = lambda: loop(LOOP)
    return compared(effort, name, sides, per_call=LOOP, agrees=agrees)


def ours_in_a_loop(place: Scene, number: int) -> Callable[[], None]:
    """Our kernel on arrays of its own, checked against the public call."""
    mech, (_, _, q, v, tau, *_) = pg.Mechanism(place.model), place.state
    work, vdot = np.zeros((len(mech.packed.system.rows), at.WORK)), np.empty(mech.nv)
    loop_of_ours(*mech.packed.tree, q, v, tau, work, vdot, 1)
    differ(vdot, mech.forward_dynamics(q, v, tau), 1e-12, "our native loop")
    return lambda: loop_of_ours(*mech.packed.tree, q, v, tau, work, vdot, number)


def derivatives(effort: Effort, place: Scene) -> Iterator[Row]:
    """∂v'/∂q, ∂v'/∂v and ∂v'/∂τ of a tree of hinges."""
    mech, (_, _, q, v, tau, *_) = pg.Mechanism(place.model), place.state
    name, found = f"derivatives, {place.name}", np.stack(mech.forward_derivatives(q, v, tau))
    sides: Calls = {"pgraph": lambda: mech.forward_derivatives(q, v, tau)}
    agrees = ""
    if has("pin"):
        sides["pin.computeABADerivatives"], theirs = in_pinocchio.derivatives(place)
        agrees = f"pin {differ(theirs, found, 1e-9, name)}"
    return compared(effort, name, sides, agrees=agrees)


def chains(effort: Effort) -> Iterator[Row]:
    """Our forward dynamics of serial chains, and the exponent of their length in its time."""
    lengths = [n for n in CHAINS if n <= effort.pick(10000, 30)]
    found = []
    for n in lengths:
        number = max(1, 3000 // n)
        loop = ours_in_a_loop(scene(f"chain of {n}", pg.Model.serial(n), 0.2), number)
        sides = {"pgraph": loop}
        found += compared(effort, f"forward dynamics, chain of {n}, loop", sides, per_call=number)
    yield from found
    slope = np.polyfit(np.log(lengths), np.log([row["seconds"] for row in found]), 1)[0]
    yield {"case": "forward dynamics, chains", "exponent of the length": float(slope)}


def stance_call(effort: Effort) -> Iterator[Row]:
    """v' and forces of the quadruped on four feet, one call from Python."""
    state = standing()
    mech, (_, _, q, v, tau, *_) = pg.Mechanism(state.model), state
    peers, agrees = stance_peers(state)
    sides = {"pgraph": lambda: mech.constrained_dynamics(q, v, tau), **peers}
    return compared(effort, "stance, one call from Python", sides, agrees=agrees)


def stance_run(effort: Effort) -> Iterator[Row]:
    """A whole run of the scenario per evaluated acceleration, with its projection and ledgers."""
    state = standing()
    mech = pg.Mechanism(state.model)

    def ours() -> float:
        run = pg.simulate(mech, scenario="stance", frames=2, estimate=False)
        timing = run.timing
        return (timing["build"] + timing["step_processor"]) / run.counters["evaluations"]

    peers, agrees = stance_peers(state)
    if has("mujoco"):
        loop = loop_of_mujoco(*in_mujoco.stance(state))
        peers["mj_forward, native loop"] = lambda: loop(1)
    sides = {"pgraph": ours, **peers}
    given = {"unit": "evaluation", "agrees": agrees, "clocked": {"pgraph"}}
    return compared(effort, "stance, whole run", sides, **given)


def stance_peers(state: State) -> tuple[Calls, str]:
    """The peers' calls, and how far their vertical forces are from ours."""
    _, forces = pg.Mechanism(state.model).constrained_dynamics(state.q, state.v, state.tau)
    vertical = np.array([forces[c.name][4] for c in state.model.constraints])
    sides: Calls = {}
    agrees = []
    if has("pin"):
        sides["pin.constraintDynamics"], force = in_pinocchio.stance(state)
        sides["pin.constraintDynamics"]()
        agrees.append(f"pin {differ(vertical, force()[:, 1], 1e-5, 'stance')}")
    if has("mujoco"):
        import mujoco

        model, data = in_mujoco.stance(state)
        mujoco.mj_forward(model, data)
        soft = abs(np.array(data.efc_force).reshape(-1, 3)[:, 1] - vertical).max()
        agrees.append(f"mujoco's soft feet by {soft:.2g} N")
        sides["mj_forward"] = lambda: mujoco.mj_forward(model, data)
    return sides, ", ".join(agrees)
