"""Constraints that go on and off during a run: when, which, and what of them starts anew."""

from __future__ import annotations

from collections.abc import Sequence
from itertools import groupby
from typing import Any, NamedTuple

import numpy as np

from ..errors import InputError, ModelError, Problem
from ..mechanism import Mechanism
from ..model import Scenario, Switch
from ..model.checks import switch_problems
from ..system import Array, Ints

SAME = 1e-12  # of the run: times this near are one


class Change(NamedTuple):
    """What is switched at one instant."""

    t: float  # [s]
    active: Ints  # constraints from then on
    on: Ints  # of them those that were off
    off: Ints  # those that are off now and were on


def changes(
    mech: Mechanism, given: Scenario | None, asked: Any, active: Ints, span: tuple[float, float]
) -> tuple[Ints, tuple[Change, ...]]:
    """(constraints at the start, what changes later) of a run over `span`.

    Those `asked` for replace a scenario's. Raises InputError.
    """
    switches = _read(mech, asked, span) if asked is not None else given.switches if given else ()
    if not switches:
        return active, ()
    numbers = {c.name: i for i, c in enumerate(mech.model.constraints)}
    now, found = set(active.tolist()), []
    for t, group in groupby(sorted(switches, key=lambda s: s.t), key=lambda s: s.t):
        before = set(now)
        for s in group:
            (now.add if s.active else now.discard)(numbers[s.constraint])
        if t <= span[0]:
            active = _ints(now)
        elif t < span[1] and now != before:
            found.append(Change(t, _ints(now), _ints(now - before), _ints(before - now)))
    return active, tuple(found)


def _ints(numbers: set[int]) -> Ints:
    return np.array(sorted(numbers), dtype=np.int64)


def _read(mech: Mechanism, asked: Any, span: tuple[float, float]) -> list[Switch]:
    """The argument of `simulate`: Switches, or (t, constraint, active) each."""
    found: list[Switch] = []
    items = asked if isinstance(asked, (list, tuple)) else (asked,)
    for item in items:
        if not isinstance(item, Switch):
            if not isinstance(item, (list, tuple)) or len(item) != 3:
                raise _refused(f"must hold (t, name of a constraint, True or False); given {item}")
            try:
                item = Switch(**dict(zip(("t", "constraint", "active"), item)))
            except ModelError as error:
                p = error.problems[0]
                raise _refused(f"of {item}, {p.field} {p.text}") from None
        found.append(item)
    for text in switch_problems(found, [c.name for c in mech.model.constraints]):
        raise _refused(text)
    for s in found:
        if not span[0] <= s.t < span[1]:
            text = f"'{s.constraint}' is switched at t = {s.t:g} s, outside the run: give a time "
            raise _refused(f"{text}from {span[0]:g} s to before {span[1]:g} s")
    return found


def _refused(text: str) -> InputError:
    return InputError(Problem("simulate", "switches", text))


def with_instants(times: Array, found: Sequence[Change]) -> tuple[Array, tuple[Change, ...]]:
    """Times of frames with those of changes among them; changes at a frame get its time."""
    moved: list[Change] = []
    near = SAME * max(float(np.abs(times).max()), 1e-300)
    for change in found:
        if change.t < times[-1]:
            at = float(times[np.abs(times - change.t).argmin()])
            moved.append(change._replace(t=at) if abs(at - change.t) <= near else change)
    return np.union1d(times, [change.t for change in moved]), tuple(moved)


def ever(active: Ints, found: Sequence[Change]) -> Ints:
    """All constraints that are active at some time."""
    if not found:
        return active
    return np.unique(np.concatenate([active, *(change.on for change in found)])).astype(np.int64)
