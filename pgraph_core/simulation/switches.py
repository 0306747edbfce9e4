"""Constraints that are switched on and off in a run, at times or by conditions."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from itertools import groupby
from typing import Any, NamedTuple

import numpy as np

from ..analysis.assembly import ASSEMBLY_ROUNDS
from ..dynamics.scene import Scene
from ..dynamics.states import differences
from ..engine import layout as at
from ..engine import motion
from ..engine.arrays import LAMBDA, RHS
from ..errors import InputError, ModelError, Problem, refusal, shown
from ..mechanism import Mechanism
from ..model import Scenario, Switch, When
from ..model.checks import switch_problems
from ..packing import Array, Ints
from ..packing.constraints import values_of
from ..tolerances import NEARBY, ROUNDING, SOLVED
from .conditions import ConditionOf


class Change(NamedTuple):
    """The constraints switched at one instant."""

    t: float  # [s]
    active: Ints  # constraints from then on
    on: Ints  # those of them that were off
    off: Ints  # those that are off now and were on


def switch_changes(
    mech: Mechanism, every: Sequence[Switch], active: Ints, span: tuple[float, float]
) -> tuple[Ints, tuple[Change, ...]]:
    """Return (constraints active at the start, later changes) for a run over `span`."""
    switches = [s for s in every if s.t is not None]
    if not switches:
        return active, ()
    waits = len(switches) < len(every)  # others wait for conditions: what is active is not known
    numbers = {c.name: i for i, c in enumerate(mech.model.constraints)}
    now, found = set(active.tolist()), []
    for t, together in groupby(sorted(switches, key=_time), key=_time):
        before, group = set(now), list(together)
        for s in group:
            (now.add if s.active else now.discard)(numbers[s.constraint])
        if t <= span[0]:
            active = _ints(now)
        elif t < span[1] and (waits or now != before):
            on, off = now - before, before - now
            if waits:
                on = {numbers[s.constraint] for s in group if s.active}
                off = {numbers[s.constraint] for s in group if not s.active}
            found.append(Change(t, _ints(now), _ints(on), _ints(off)))
    return active, tuple(found)


def switches_of(
    mech: Mechanism, given: Scenario | None, asked: Any, span: tuple[float, float], goes_on: bool
) -> Sequence[Switch]:
    """Return the switches of a run: the requested ones or the scenario's. Raises InputError.

    Those before the start of a run that goes on have acted.
    """
    begin = -np.inf if goes_on else span[0]
    found = given.switches if given else ()
    if asked is not None:
        found = _read(mech, asked, (begin, span[1]))
    return [s for s in found if not (goes_on and s.t is not None and s.t < span[0])]


def _time(s: Switch) -> float:
    return float(s.t or 0.0)


def switched_by(active: set[int], on: Sequence[int], off: Sequence[int], t: float) -> Change:
    """Compute the change at t relative to the currently active constraints."""
    after = (active | set(on)) - set(off)
    return Change(t, _ints(after), _ints(after - active), _ints(active - after))


def _ints(numbers: set[int]) -> Ints:
    return np.array(sorted(numbers), dtype=np.int64)


def _read(mech: Mechanism, asked: Any, span: tuple[float, float]) -> list[Switch]:
    """Read the argument of `simulate`: Switches, their fields, or (t, constraint, active)."""
    found: list[Switch] = []
    items = asked if isinstance(asked, (list, tuple)) else (asked,)
    for item in items:
        if not isinstance(item, Switch):
            fields = item
            if isinstance(item, (list, tuple)) and len(item) == 3:
                first = "when" if isinstance(item[0], (dict, When)) else "t"
                fields = dict(zip((first, "constraint", "active"), item))
            if not isinstance(fields, Mapping):
                text = "must hold (t, name of a constraint, True or False), or "
                text += f"pg.Switch(constraint=..., active=..., t=...), got {shown(item)}"
                raise refusal("simulate", "switches", text)
            try:
                item = Switch(**{str(name): x for name, x in fields.items()})
            except ModelError as error:
                p = error.problems[0]
                raise refusal("simulate", "switches", f"of {item}, {p.field} {p.text}") from None
        found.append(item)
    for text in switch_problems(found, [c.name for c in mech.model.constraints]):
        raise refusal("simulate", "switches", text)
    for s in found:
        if s.t is not None and not span[0] <= s.t < span[1]:
            text = f"'{s.constraint}' is switched at t = {s.t:g} s, outside the run: give a time "
            text += f"from {span[0]:g} s to before {span[1]:g} s"
            text += "; simulate(model, start=run) goes on after the switches of a run"
            raise refusal("simulate", "switches", text)
    return found


def with_instants(
    times: Array, found: Sequence[Change], samples: Array
) -> tuple[Array, tuple[Change, ...], Array]:
    """Compute the times of frames, changes and samples, which are at frames within rounding."""
    near = ROUNDING * max(float(np.abs(times).max()), 1e-300)

    def at_frame(t: float) -> float:
        k = int(np.searchsorted(times, t))
        nearest = min(times[max(k - 1, 0) : k + 1].tolist(), key=lambda x: abs(x - t))
        return nearest if abs(nearest - t) <= near else t

    end = float(times[-1])
    taken = np.unique([at_frame(t) for t in samples.tolist()])
    taken = taken[taken < end]
    times = np.union1d(times, taken)
    moved = tuple(change._replace(t=at_frame(change.t)) for change in found if change.t < end)
    return np.union1d(times, [change.t for change in moved]), moved, taken


def ever(active: Ints, found: Sequence[Change], waiting: Sequence[ConditionOf] = ()) -> Ints:
    """Return all constraints that are active at some time, or may be."""
    if not found and not waiting:
        return active
    later = [c.constraint for c in waiting if c.active]
    parts = [active, *(change.on for change in found), np.array(later, dtype=np.int64)]
    return np.unique(np.concatenate(parts)).astype(np.int64)


# -- in a run ------------------------------------------------------------------------------------


def hold_here(scene: Scene, change: Change, q: Array) -> None:
    """Fill in points and orientations left unspecified by newly active constraints."""
    if not len(change.on):
        return
    packed = scene.packed
    poses = packed.poses(q)
    for i in change.on.tolist():
        c = packed.model.constraints[i]
        try:
            values = values_of(c, packed.model, packed.topology, packed.system, poses)
        except ModelError as error:
            raise InputError(error.problems) from None
        first = int(scene.blocks.first[i])
        if scene.blocks.blocks_i[first, at.B_TYPE] == at.T_CURVE:
            continue  # the curve stays, and so does what the block knows of its point
        scene.blocks.blocks_f[first : first + len(values)] = values


def closed(
    mech: Mechanism, scene: Scene, change: Change, q: Array, v: Array, ledger: Array
) -> float:
    """Move q onto the active constraints, and change v by their impulses. Returns the change in q.

    The change is the largest of a joint [rad, m]. The energy of the impulses is added to `ledger`.
    Raises InputError if the constraints cannot be met.
    """
    if scene.active[0] == 0:
        return 0.0
    names = " and ".join(f"'{scene.blocks.names[i]}'" for i in change.on.tolist())
    where = f"constraint {names}"
    old, given = q.copy(), v.copy()
    fastest = float(np.max(np.abs(v), initial=0.0))
    rounds = motion.projection(scene.held, change.t, q, v, ASSEMBLY_ROUNDS)
    moved = float(np.max(np.abs(q - old), initial=0.0))
    turned, slid = differences(mech.packed, old[None], q[None])
    near = turned[0] <= NEARBY and slid[0] <= NEARBY * (mech.packed.length or 1.0)
    if rounds < 0 or not near:
        text = f"is violated when switched on, at t = {change.t:g} s: a joint would jump "
        text += f"by {moved:.3g}; switch it in a position that satisfies it, or omit other_point"
        raise InputError(Problem(where, "", text))
    from ..engine.contact.points import add_impulses, impulse_rows

    m = impulse_rows(scene.held, change.t, q, given)
    before, omega = scene.space.vectors[RHS, :m].copy(), scene.space.omega[:m, :m]
    inverse = np.linalg.pinv(omega, rcond=ROUNDING, hermitian=True)
    scene.space.vectors[LAMBDA, :m] = -inverse @ before
    add_impulses(scene.held, given, ledger)
    v[:] = given
    left = float(np.max(np.abs(before + omega @ scene.space.vectors[LAMBDA, :m]), initial=0.0))
    if left > SOLVED * max(fastest, float(np.max(np.abs(v), initial=0.0))):
        text = f"requires velocities at t = {change.t:g} s that conflict with other constraints by "
        raise InputError(Problem(where, "", f"{text}{left:.3g}; switch one of them off"))
    return moved
