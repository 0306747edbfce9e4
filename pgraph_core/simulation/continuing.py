"""Runs that go on from other runs, with all that these kept from step to step.

Besides the state (t, q, v) and the states of controls, a run keeps the states of drives with a lag
or an integral, the active constraints and where they hold bodies, the conditions that have switched
them, and the impulses and stretched friction springs of contacts. A result contains them as they
are at its end, in `Memory`.
"""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import numpy as np

from ..engine import layout as at
from ..errors import InputError, Problem, choices, shown
from ..mechanism import Mechanism
from ..packing.forces import states_of_drives
from ..result import Result
from ..result.records import Memory
from .conditions import ConditionOf
from .start import kept_parts

if TYPE_CHECKING:
    from .running import Running

TOUCHES = ("found", "kept", "anchors")  # records of contact points, which the tally counts
COUNTS = ("found", "kept", "anchored", "frozen")  # fields of the tally
NOW = ("wrenches", "pairs", "limit_tau")  # forces of the last step
TAU = "tau"  # beginning of the names of a controller's arrays


def left_by(record: Running) -> Memory:
    """Return what a run keeps at its present time beside its state."""
    plan, scene, model = record.plan, record.scene, record.mech.packed.model
    t, switching = float(record.steps.clock["time"]), record.switching
    found: dict[str, Any] = {"t": np.array([t])}
    if plan.driving:
        found |= states_of_drives(plan.driving, scene.drives, t)
    if model.constraints:
        active = record.active.tolist()
        rows = [scene.blocks.blocks_f[_rows(scene, i)] for i in active]
        found["active"] = _words(model.constraints[i].name for i in active)
        found["places"] = np.vstack((np.zeros((0, at.BLOCK_F)), *rows))
        found["acted"] = _words(_word(record, plan.conditions[i]) for i in sorted(switching.acted))
        found["switched"] = _words(model.constraints[i].name for i in switching.since)
        found["switched_at"] = np.array([*switching.since.values()], dtype=float)
    if scene.touching is not None:
        kept, tally = scene.touching.contacts, scene.touching.tally
        found["touches"] = _touches(record)
        found["counts"] = np.array([int(tally[name]) for name in COUNTS])
        for name, count in zip(TOUCHES, COUNTS):
            found[name] = getattr(kept, name)[: int(tally[count])].copy()
        found |= {name: getattr(kept, name).copy() for name in NOW}
        found["held"] = _frictions(scene).copy()
    if record.user is not None:
        found |= {f"{TAU}{k}": array.copy() for k, array in enumerate(record.user.memory)}
    return Memory(found)


def recall(record: Running, memory: Memory) -> bool:
    """Let a run that begins keep what the run before it has kept. Returns whether contacts did."""
    scene, names = record.scene, [c.name for c in record.mech.model.constraints]
    row = 0
    for name in memory.get("active", ()):
        if name in names and len(scene.blocks.blocks_f):
            own = _rows(scene, names.index(name))
            count = own.stop - own.start
            scene.blocks.blocks_f[own] = memory["places"][row : row + count]
            row += count
    acted = set(memory.get("acted", ()))
    conditions = enumerate(record.plan.conditions)
    record.switching.acted |= {i for i, c in conditions if _word(record, c) in acted}
    times = zip(memory.get("switched", ()), memory.get("switched_at", ()))
    record.switching.since |= {names.index(name): float(t) for name, t in times if name in names}
    if record.user is not None:
        for k, array in enumerate(record.user.memory):
            given = memory.get(f"{TAU}{k}")
            if given is not None and given.shape == array.shape:
                array[...] = given
    if scene.touching is None or "touches" not in memory:
        return False
    (before, *theirs), (method, *own) = memory["touches"].tolist(), _touches(record).tolist()
    if theirs != own:
        return False
    kept, tally = scene.touching.contacts, scene.touching.tally
    if before != method:  # friction springs are those of any method
        tally["anchored"] = memory["counts"][COUNTS.index("anchored")]
        kept.anchors[: len(memory["anchors"])] = memory["anchors"]
        return False
    for name, value in zip(COUNTS, memory["counts"].tolist()):
        tally[name] = value
    for name in TOUCHES:
        getattr(kept, name)[: len(memory[name])] = memory[name]
    for name in NOW:
        getattr(kept, name)[...] = memory[name]
    _frictions(scene)[...] = memory["held"]
    return True


def _rows(scene: Any, i: int) -> slice:
    """Return the blocks of a constraint."""
    return slice(int(scene.blocks.first[i]), int(scene.blocks.first[i + 1]))


def _frictions(scene: Any) -> Any:
    """Return the forces of joint friction in the last step, as a view."""
    tally = scene.touching.tally
    last = int(tally["first_limit"])
    return scene.blocks.blocks_f[last - int(tally["frictions"]) : last, at.HELD]


def _touches(record: Running) -> Any:
    """Return what contacts of other runs must have in common with those of this one."""
    tables = record.plan.contacts
    own = [] if tables is None else [*(touch.name for touch in tables.touches), *tables.limits]
    return _words([record.plan.method.name, *own])


def _word(record: Running, one: ConditionOf) -> str:
    """Return a word for a condition that is the same in other runs."""
    name = record.mech.model.constraints[one.constraint].name
    return f"{name} {'on' if one.active else 'off'} when {one.when}"


def _words(words: Any) -> Any:
    return np.array([*words], dtype=np.str_)


# -- arguments ------------------------------------------------------------------------------------


def state_of(mech: Mechanism, run: Any, call: str, given: dict[str, Any]) -> tuple[Any, ...]:
    """Return (q, v, states, t, memory) at the end of a run, with which another begins.

    `given` contains the arguments that the run replaces. Raises InputError.
    """
    if not isinstance(run, Result):
        text = f"must be a run, such as pg.simulate returns, got {shown(run)}"
        raise InputError(Problem(call, "start", text))
    if twice := [name for name, value in given.items() if value is not None]:
        text = f"gives the state and the time at which the run begins; leave out {choices(twice)}"
        raise InputError(Problem(call, "start", text))
    if not len(run.t):
        raise InputError(Problem(call, "start", "has no frame to go on from"))
    if run.mechanism.joints != mech.joints:
        text = "has other joints than this model; give q={body: value}, v and t_start instead"
        raise InputError(Problem(call, "start", text))
    t = float(run.t[-1])
    if not run.status.ok:
        text = f"ended early ({run.message}), so it has no end to go on from; begin at an earlier "
        text += "frame k with q=run.q[k], v=run.v[k], t_start=run.t[k]"
        raise InputError(Problem(call, "start", text))
    memory = run.memory if run.memory is not None and run.memory["t"][0] == t else None
    if memory is None and (lost := [*kept_parts(mech, run.header.get("scenario"), ())]):
        text = f"does not contain {choices(lost)}, for example because it comes from an older file;"
        text += " run it again with this version"
        raise InputError(Problem(call, "start", text))
    return run.q[-1], run.v[-1], run.states[-1] if run.states.size else None, t, memory
