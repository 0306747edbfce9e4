"""The verdict on one run: from it, a run at half of the step, and the known motion."""

from __future__ import annotations

from dataclasses import dataclass, replace
from enum import StrEnum

import numpy as np

from ..integrators import METHODS
from ..mechanism import Mechanism
from ..packing.system import Array
from ..result import Result, Status
from .errors import joint_errors
from .reference import KnownMotion

NAN = float("nan")
WRONG = 1.0  # rad, or of the length, or of the energies: from there on the motion is another one
NEAR = 0.9  # of the limit of explicit methods: the fastest rate is known to 10 %
LUCK = 10.0  # times the target at half of the step: an error that met the target by accident
SLOPE = 0.3  # least order that counts as convergence


class Verdict(StrEnum):
    """The worth of a run, exactly one a cell. (How a run ended is its `Status`.)"""

    OK = "OK"
    INACCURATE = "INACCURATE"
    UNSTABLE = "UNSTABLE"
    DAMPED = "DAMPED"
    DRIFT = "DRIFT"
    FAILED = "FAILED"
    SLOW = "SLOW"


@dataclass(frozen=True)
class Cell:
    """One value, method and step: how its run compares with the reference.

    Errors are the largest over time of a joint's rotation [rad], or of its translation over the
    mechanism's length; energies are relative to their range in the reference.
    """

    value: float
    method: str
    step: float  # [s]
    status: Verdict
    text: str  # why, and a remedy
    error: float = NAN
    error_half: float = NAN  # at half of the step
    order: float = NAN  # observed, from these two
    step_needed: float = NAN  # to meet the target, from the observed order [s]
    time: float = NAN  # of the failure, or from which the motion grew [s]
    body: str = ""  # the first at fault
    step_limit: float = NAN  # predicted largest stable step [s]
    energy_lost: float = 0.0  # that the model does not dissipate
    energy_gained: float = 0.0
    constraint_drift: float = 0.0  # over the mechanism's length
    evaluations: int = 0  # of the dynamics


@dataclass(frozen=True)
class Evidence:
    """The measurements that a verdict is based on."""

    target: float
    mech: Mechanism
    run: Result  # at the step
    known: KnownMotion
    errors: Array  # (n, elementary motions) of every frame
    growth: Array  # (n,) spurious energy over the range of energies
    cell: Cell  # with the verdict OK


def judged(
    cell: Cell, target: float, mech: Mechanism, whole: Result, half: Result, known: KnownMotion
) -> Cell:
    """`cell` completed from a run at its step and one at half of it."""
    found = evidence(cell, target, mech, whole, half, known)
    for question in (_unstable, _failed, _drifts, _unknown, _damped, _inaccurate):
        answer = question(found)
        if answer is not None:
            return answer
    order = f", order {found.cell.order:.1f}" if np.isfinite(found.cell.order) else ""
    return replace(found.cell, text=f"error {found.cell.error:.1e}{order}")


def evidence(
    cell: Cell, target: float, mech: Mechanism, whole: Result, half: Result, known: KnownMotion
) -> Evidence:
    """Errors, energies and drift over the recorded frames."""
    errors, other = (joint_errors(mech, run.q, known.at(run.t)) for run in (whole, half))
    growth = spurious_energy(whole, known.energy)
    error = float(errors.max(initial=0.0)) if whole.status.ok else NAN
    error_half = float(other.max(initial=0.0)) if half.status.ok else NAN
    order = NAN
    if np.isfinite(error) and error_half > 10 * known.accuracy:
        order = float(np.log2(error / error_half))
    drift = float(whole.constraint_drift[:, 0].max(initial=0.0))
    cell = replace(
        cell,
        error=error,
        error_half=error_half,
        order=order,
        step_limit=step_limit(cell.method, known.rate),
        energy_lost=steady_loss(growth),
        energy_gained=float(growth.max(initial=0.0)),
        constraint_drift=drift / (mech.packed.length or 1.0),
        evaluations=whole.counters["evaluations"],
    )
    return Evidence(target, mech, whole, known, errors, growth, cell)


def step_limit(method: str, rate: float) -> float:
    """The largest step at which an explicit method is stable at a rate [1/s], in s; else NaN."""
    most = METHODS[method].limit
    return most / rate if most > 0.0 and rate > 0.0 else NAN


def spurious_energy(run: Result, scale: float) -> Array:
    """(n,) energy that neither work nor dissipation explains, over `scale` [J]."""
    with np.errstate(over="ignore", invalid="ignore"):
        ledger = run.energy - run.work + run.dissipation
        found = (ledger - ledger[:1]) / (scale or 1.0)
    return np.where(np.isfinite(found), found, np.inf)


def steady_loss(growth: Array) -> float:
    """Mean energy lost in the last third if each third loses more than the one before; else 0."""
    if len(growth) < 3 or not np.isfinite(growth).all():
        return 0.0
    thirds = [float(part.mean()) for part in np.array_split(growth, 3)]
    return max(0.0, -thirds[2]) if thirds[0] > thirds[1] > thirds[2] else 0.0


def _unstable(found: Evidence) -> Cell | None:
    """The motion grows, by spurious energy or beyond the stability limit of the method."""
    run, cell = found.run, found.cell
    beyond = cell.step > NEAR * cell.step_limit
    missed = not cell.error <= found.target and cell.energy_gained > found.target
    sudden = not cell.order < METHODS[cell.method].order + 1  # an error of order shrinks with it
    grown = found.growth > WRONG
    burst = run.status is Status.NOT_FINITE
    if not (burst or grown.any() or (beyond and missed and sudden)):
        return None
    bad = np.flatnonzero(grown | (found.errors.max(axis=1, initial=0.0) > WRONG))
    first = int(bad[0]) if len(bad) else len(run.t) - 1
    body, time = found.mech.packed.body_of(_first_row(found, first)), float(run.t[first])
    text = f"grows from t = {time:.3g} s on (step {time / cell.step:.0f}), body '{body}' first"
    if np.isfinite(cell.step_limit):
        text += f"; rate times step is {found.known.rate * cell.step:.3g}, "
        text += f"the predicted limit a step of {cell.step_limit:.3g} s"
    return replace(cell, status=Verdict.UNSTABLE, text=text, time=time, body=body)


def _first_row(found: Evidence, frame: int) -> int:
    """The row with the largest error, or acceleration if only the start is there."""
    if found.errors[frame].max(initial=0.0) > 0.0:
        return int(np.argmax(found.errors[frame])) + 1
    return found.mech.packed.row_of_velocity(int(np.argmax(np.abs(found.run.vdot[frame]))))


def _failed(found: Evidence) -> Cell | None:
    """The run ended early; its message has the cause, the body and the time."""
    if found.run.status.ok:
        return None
    many = found.run.status is Status.TOO_MANY_STEPS
    time = float(found.run.t[-1]) if len(found.run.t) else 0.0
    status = Verdict.SLOW if many else Verdict.FAILED
    return replace(found.cell, status=status, text=found.run.message, time=time)


def _drifts(found: Evidence) -> Cell | None:
    if not found.cell.constraint_drift > found.target:
        return None
    time = float(found.run.t[int(np.argmax(found.run.constraint_drift[:, 0]))])
    text = f"constraints drift by {found.cell.constraint_drift:.1e} of the length at t = "
    text += f"{time:.3g} s; use stabilise='project'"
    return replace(found.cell, status=Verdict.DRIFT, text=text, time=time)


def _unknown(found: Evidence) -> Cell | None:
    """The motion itself is not known to the target, so no run can be called right."""
    known = found.known
    if known.accuracy < found.target:
        return None
    text = f"cannot be judged: the motion is known to {known.accuracy:.1e} only ({known.source})"
    return replace(found.cell, status=Verdict.INACCURATE, text=text)


def _damped(found: Evidence) -> Cell | None:
    """The loss explains the error: an amplitude shrinks by half of the energy's part."""
    lost, error = found.cell.energy_lost, found.cell.error
    if not (lost > found.target and lost > error / 2):
        return None
    text = f"{lost:.1e} of the energy is lost, which the model conserves; error {error:.1e}"
    return _with_needed(found, Verdict.DAMPED, text, max(lost, error))


def _inaccurate(found: Evidence) -> Cell | None:
    error, half, target = found.cell.error, found.cell.error_half, found.target
    if error <= target and half <= LUCK * target:
        return None
    text = f"error {error:.1e}"
    if error <= target:
        text += f" by accident: {half:.1e} at half of the step"
    return _with_needed(found, Verdict.INACCURATE, text, error)


def _with_needed(found: Evidence, status: Verdict, text: str, excess: float) -> Cell:
    """The cell, with the step at which `excess` meets the target by the observed order."""
    cell = found.cell
    if not cell.order > SLOPE:
        text += "; it does not shrink with the step"
        return replace(cell, status=status, text=text)
    order = min(cell.order, METHODS[cell.method].order + 0.5)
    step = cell.step * min((found.target / excess) ** (1.0 / order), 1.0)
    text += f"; use a step of {step:.2g} s (order {cell.order:.1f})"
    return replace(cell, status=status, text=text, step_needed=step)
