"""From two runs and a reference to one verdict."""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import NamedTuple

import numpy as np

from ..integrators import METHODS
from ..mechanism import Mechanism
from ..mechanism.scale import length_of
from ..result import Result, Status
from ..system import Array
from .reference import Reference, misses
from .verdict import NAN, Cell, Verdict

WRONG = 1.0  # rad, or of the length; of the energies: from there on the motion has another course
NEAR = 0.9  # of the limit of explicit methods: the fastest rate is known to 10 %
LUCK = 10.0  # times the target at half of the step: an error that met the target by accident
SLOPE = 0.3  # least order that counts as convergence


class Asked(NamedTuple):
    """What a cell is about."""

    value: float
    method: str
    step: float  # [s]
    target: float


@dataclass(frozen=True)
class Evidence:
    """What a verdict goes by."""

    asked: Asked
    mech: Mechanism
    run: Result  # at the step
    known: Reference
    apart: Array  # (n, rows) misses of every frame
    growth: Array  # (n,) energy from nowhere, of the range of energies
    cell: Cell  # the numbers, as if all were well


def judged(asked: Asked, mech: Mechanism, whole: Result, half: Result, known: Reference) -> Cell:
    """The cell of a run at the step and one at half of it, against what is known."""
    seen = evidence(asked, mech, whole, half, known)
    for question in (_unstable, _failed, _drifts, _unknown, _damped, _inaccurate):
        answer = question(seen)
        if answer is not None:
            return answer
    order = f", order {seen.cell.order:.1f}" if np.isfinite(seen.cell.order) else ""
    return replace(seen.cell, text=f"error {seen.cell.error:.1e}{order}")


def evidence(
    asked: Asked, mech: Mechanism, whole: Result, half: Result, known: Reference
) -> Evidence:
    """Errors, energies and drift of the frames that there are."""
    apart, other = (misses(mech, run.q, known.at(run.t)) for run in (whole, half))
    growth = balance(whole, known.energy)
    error = float(apart.max(initial=0.0)) if whole.status.ok else NAN
    error_half = float(other.max(initial=0.0)) if half.status.ok else NAN
    order = NAN
    if np.isfinite(error) and error_half > 10 * known.accuracy:
        order = float(np.log2(error / error_half))
    cell = Cell(
        *asked[:3],
        Verdict.OK,
        "",
        error=error,
        error_half=error_half,
        order=order,
        step_limit=limit(asked.method, known.rate),
        energy_lost=trend(growth),
        energy_gained=float(growth.max(initial=0.0)),
        constraint_drift=float(whole.constraint_drift[:, 0].max(initial=0.0))
        / (length_of(mech) or 1.0),
        evaluations=whole.counters["evaluations"],
    )
    return Evidence(asked, mech, whole, known, apart, growth, cell)


def limit(method: str, rate: float) -> float:
    """The largest step that an explicit method takes at a rate [s]."""
    most = METHODS[method].limit
    return most / rate if most > 0.0 and rate > 0.0 else NAN


def balance(run: Result, scale: float) -> Array:
    """(n,) energy that came from nowhere, of the range of energies."""
    with np.errstate(over="ignore", invalid="ignore"):
        ledger = run.energy - run.work + run.dissipation
        found = (ledger - ledger[:1]) / (scale or 1.0)
    return np.where(np.isfinite(found), found, np.inf)


def trend(growth: Array) -> float:
    """Energy lost on average in the last third, where each third loses more than the one before."""
    if len(growth) < 3 or not np.isfinite(growth).all():
        return 0.0
    thirds = [float(part.mean()) for part in np.array_split(growth, 3)]
    return max(0.0, -thirds[2]) if thirds[0] > thirds[1] > thirds[2] else 0.0


def _unstable(seen: Evidence) -> Cell | None:
    """Grown beyond what the motion is, by energy from nowhere or beyond the method's limit."""
    asked, run, cell = seen.asked, seen.run, seen.cell
    beyond = asked.step > NEAR * cell.step_limit
    missed = not cell.error <= asked.target and cell.energy_gained > asked.target
    sudden = not cell.order < METHODS[asked.method].order + 1  # an error of order shrinks with it
    grown = seen.growth > WRONG
    burst = run.status is Status.NOT_FINITE
    if not (burst or grown.any() or (beyond and missed and sudden)):
        return None
    bad = np.flatnonzero(grown | (seen.apart.max(axis=1, initial=0.0) > WRONG))
    first = int(bad[0]) if len(bad) else len(run.t) - 1
    body, time = seen.mech.body_of(_first_row(seen, first)), float(run.t[first])
    text = f"grows from t = {time:.3g} s on (step {time / asked.step:.0f}), body '{body}' first"
    if np.isfinite(cell.step_limit):
        text += f"; rate times step is {seen.known.rate * asked.step:.3g}, "
        text += f"the predicted limit a step of {cell.step_limit:.3g} s"
    return replace(cell, status=Verdict.UNSTABLE, text=text, time=time, body=body)


def _first_row(seen: Evidence, frame: int) -> int:
    """The row that is farthest off, or that is pulled most where only the start is there."""
    if seen.apart[frame].max(initial=0.0) > 0.0:
        return int(np.argmax(seen.apart[frame])) + 1
    return seen.mech.row_of_velocity(int(np.argmax(np.abs(seen.run.vdot[frame]))))


def _failed(seen: Evidence) -> Cell | None:
    """Ended early: what the run says of it has the cause, the body and the time."""
    if seen.run.status.ok:
        return None
    many = seen.run.status is Status.TOO_MANY_STEPS
    time = float(seen.run.t[-1]) if len(seen.run.t) else 0.0
    status = Verdict.SLOW if many else Verdict.FAILED
    return replace(seen.cell, status=status, text=seen.run.message, time=time)


def _drifts(seen: Evidence) -> Cell | None:
    if not seen.cell.constraint_drift > seen.asked.target:
        return None
    time = float(seen.run.t[int(np.argmax(seen.run.constraint_drift[:, 0]))])
    text = f"constraints are left by {seen.cell.constraint_drift:.1e} of the length at t = "
    text += f"{time:.3g} s; use stabilise='project'"
    return replace(seen.cell, status=Verdict.DRIFT, text=text, time=time)


def _unknown(seen: Evidence) -> Cell | None:
    """Where the motion itself is not known as well as is asked for, nothing can be called right."""
    known = seen.known
    if known.accuracy < seen.asked.target:
        return None
    text = f"not to be judged: the motion is known to {known.accuracy:.1e} only ({known.how})"
    return replace(seen.cell, status=Verdict.INACCURATE, text=text)


def _damped(seen: Evidence) -> Cell | None:
    """Where the loss explains the error: an amplitude shrinks by half of it."""
    lost, error = seen.cell.energy_lost, seen.cell.error
    if not (lost > seen.asked.target and lost > error / 2):
        return None
    text = f"{lost:.1e} of the energy is lost that the model keeps, error {error:.1e}"
    return _with_needed(seen, Verdict.DAMPED, text, max(lost, error))


def _inaccurate(seen: Evidence) -> Cell | None:
    error, half, target = seen.cell.error, seen.cell.error_half, seen.asked.target
    if error <= target and half <= LUCK * target:
        return None
    text = f"error {error:.1e}"
    if error <= target:
        text += f" by accident: {half:.1e} at half of the step"
    return _with_needed(seen, Verdict.INACCURATE, text, error)


def _with_needed(seen: Evidence, status: Verdict, text: str, excess: float) -> Cell:
    """The cell, with the step that brings `excess` to the target by the observed order."""
    cell, asked = seen.cell, seen.asked
    if not cell.order > SLOPE:
        text += "; it does not shrink with the step here"
        return replace(cell, status=status, text=text)
    order = min(cell.order, METHODS[asked.method].order + 0.5)
    step = asked.step * min((asked.target / excess) ** (1.0 / order), 1.0)
    text += f"; a step of {step:.2g} s would do (order {cell.order:.1f})"
    return replace(cell, status=status, text=text, step_needed=step)
