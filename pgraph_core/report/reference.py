"""What the runs of a study are measured against, and how good that is itself."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from ..cases import Case
from ..cases.observables import Still
from ..errors import InputError, Problem
from ..mechanism import Mechanism
from ..result import Result
from ..system import Array
from .errors import differences, rms
from .ladder import Setting
from .seen import motion_of_bodies, reach
from .task import Progress, Task

GIVEN, MADE = 3.0, 10.0  # errors below so many times the reference's own are not told apart
GOOD = 1e-10  # of a made reference: nothing better is looked for
APART = 1e-4  # two runs further apart than this do not agree
AGREE = 1e-9  # up to where two runs of a chaotic motion count as one
OF_STATES = ("q", "point", "direction", "rotation")  # observables that peers have too
FINEST = {"dop853": (1e-14, 1e-13), "radau5": (1e-13, 1e-12)}


Measure = Callable[[Array], Array]  # (n, m) errors of states q (n, nq) at the reference's times


@dataclass(frozen=True)
class Reference:
    """A motion at given times, and how far it may be off itself."""

    t: Array  # (n,) [s]
    errors: Measure
    accuracy: float  # E of the reference itself
    source: str  # where it comes from, for people
    margin: float = GIVEN

    @property
    def limit(self) -> float:
        """Errors below it say no more than that they are."""
        return self.margin * self.accuracy

    @classmethod
    def of_states(cls, task: Task, t: Array, q: Array, accuracy: float, source: str) -> Reference:
        """States of the mechanism as the reference of its bodies' motion."""
        see, scale = motion_of_bodies(task.mech), reach(task.mech)
        seen = see(q)
        return cls(t, lambda found: differences(see(found), seen, scale), accuracy, source)


def of_case(case: Case) -> Reference:
    """The reference of a case: those of its observables that are of q over time.

    Raises InputError where it has none.
    """
    mech = Mechanism(case.model)
    kept = [seen for seen in case.observables if seen.kind in OF_STATES and seen.frames is None]
    if case.t is None or len(case.t) < 2 or not kept:
        text = "has no motion over time to compare with; choose another case"
        raise InputError(Problem(f"case '{case.name}'", "", text))

    def measured(q: Array) -> Array:
        still = Still(mech, q, np.zeros((len(q), mech.nv)))
        return np.column_stack([seen.errors(still) for seen in kept])

    return Reference(case.t, measured, case.accuracy, f"case {case.name}, {case.how_obtained}")


def given(task: Task, reference: Any) -> Reference:
    """What the caller gave: a Case, a Reference, a Result, or (t, q). Raises InputError."""
    if isinstance(reference, Case):
        return of_case(reference)
    if isinstance(reference, Reference):
        return reference
    if isinstance(reference, Result):
        mine = reference.header.get("method", "a run")
        accuracy = float(np.nan_to_num(reference.error_estimate, nan=0.0))
        return Reference.of_states(task, reference.t, reference.q, accuracy, f"given run, {mine}")
    try:
        t, q = (np.array(part, dtype=float) for part in reference)
    except (TypeError, ValueError):
        t, q = np.zeros(0), np.zeros(0)
    if t.ndim != 1 or len(t) < 2 or q.shape != (len(t), task.mech.nq):
        text = (
            "must be a Result, a Case, a Reference, or (t, q) with two times or more, q of shape "
        )
        text += f"(len(t), {task.mech.nq}); given {type(reference).__name__}"
        raise InputError(Problem("work_precision", "reference", text))
    return Reference.of_states(task, t, q, 0.0, "given states, said to be exact")


def made(
    task: Task, rate: float, step: float, watch: Callable[[], Progress]
) -> tuple[Reference, Task]:
    """(the finest run there is, with its distance to the second finest; what it is of).

    A shorter motion where it is chaotic: up to the horizon where both still agree. `step` is
    the finest one of the ladder. Raises InputError where no method comes to the end.
    """
    best: tuple[float, Array, Array, str] | None = None
    for method, settings in _candidates(task, rate, step):
        pair = _pair(task, method, settings, watch)
        if pair is None:
            continue
        source = f"{method} at {settings[0]} against {settings[1]}"
        apart = Reference.of_states(task, task.t, pair[0], 0.0, source).errors(pair[1])
        if best is None or rms(apart) < best[0]:
            best = rms(apart), pair[0], apart, source
        if best[0] < GOOD or horizon(best[2]) > 1:
            break
    if best is None:
        text = (
            "no method reached the end at its finest setting; give a reference or a shorter t_end"
        )
        raise InputError(Problem("work_precision", "reference", text))
    own, q, apart, source = best
    until = float(task.t[horizon(apart) - 1])
    if own > APART and 0 < until < task.t_end:
        return made(replace(task, t=np.linspace(0.0, until, len(task.t))), rate, step, watch)
    found = Reference.of_states(task, task.t, q, own, source)
    return replace(found, margin=MADE), task


def _pair(
    task: Task, method: str, settings: tuple[Setting, Setting], watch: Callable[[], Progress]
) -> tuple[Array, Array] | None:
    """States of both runs; None where the method cannot take the scene or come to its end."""
    try:
        runs = [task.run(method, setting, watch()) for setting in settings]
    except InputError:
        return None
    return (runs[0].q, runs[1].q) if all(run.status.ok for run in runs) else None


def horizon(apart: Array) -> int:
    """How many times two runs agree from the start."""
    far = np.flatnonzero(apart.max(axis=1) > AGREE)
    return int(far[0]) if len(far) else len(apart)


def _candidates(task: Task, rate: float, step: float) -> list[tuple[str, tuple[Setting, Setting]]]:
    """Methods with their finest setting and the one next to it, the likeliest first."""
    if task.impulses:
        pair = Setting(step=step / 4), Setting(step=step / 2)
        return [("rk4", pair), ("moreau_jean", pair)]
    stiff = rate * task.t_end > 1e5
    names = ("radau5", "dop853") if stiff else ("dop853", "radau5")
    found = []
    for name in names:
        fine, coarse = FINEST[name]
        found.append((name, (Setting(rtol=fine), Setting(rtol=coarse))))
    return found
