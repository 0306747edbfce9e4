"""The error of a run, estimated from a finer run of the same motion.

The second run uses half the step size, or a tolerance that is 2^p times tighter, with which steps
of a method of order p are half as long. The tolerances for solving equations and locating impacts
are tightened as well. At half the step, the error is 2^p times smaller ([Hairer, Norsett, Wanner
1993, II.4]): the two runs differ by between half of the error and all of it, for any p >= 1. The
difference is the estimate. It does not rely on the order of the method, because the difference is
not divided by 2^p.
"""

from __future__ import annotations

from dataclasses import replace
from typing import TYPE_CHECKING

import numpy as np

from ..dynamics.states import ranges_of_motion, sizes_of_states
from ..engine.compiler.jit import made_by_numba
from ..engine.records import RIGID, SOFT, SWING
from ..errors import InputError, percent
from ..packing import Array
from ..tolerances import EPS, ROUNDING, SOLVED, VISIBLE
from .finer import (
    apart,
    finer_plan,
    forces_apart,
    grazed,
    may_jump,
    no_wider,
    offset_plan,
    shared,
    undecided,
)
from .recorded import Estimate
from .recording import Recording
from .remarks import passed_over, unsure_forces, unsure_speeds
from .remedies import more_accurate
from .run_plan import RunPlan

if TYPE_CHECKING:
    from ..contact.tables import Tables

MOST_HALVINGS = 5  # runs in search of one that divides no step
MORE = 1.25  # least number of steps of a finer run relative to the run
PARTED = 0.3  # rad, or of the motion's size: beyond it, errors no longer add up
BECAUSE = "its error is not estimated, because"
UNKNOWN = (
    f"{BECAUSE} a function gives its torques: give estimate=True to call it again for a second "
    "run, if it remembers nothing, or compare with a run at half the step, or at a tighter rtol"
)
REMEMBERS = (
    f"{BECAUSE} the torque function changes '{{}}' from call to call, and a second run would go on "
    "from there: compare with a run of a new function, at half the step or at a tighter rtol"
)


def error_estimate(record: Recording, asked: bool | None) -> Estimate:
    """Return the error estimate for a completed run.

    `asked` is None if a torque function must not be called again. If there is no estimate, the
    message of the run gives the reason.
    """
    if not record.ended.ok or asked is False:
        return Estimate()
    tau, found = record.tau, Estimate(why=UNKNOWN)
    if asked and (name := "" if record.sampled is None else record.sampled.calls.changed()):
        asked, found = None, Estimate(why=REMEMBERS.format(name))
    if asked or not callable(tau) or hasattr(tau, "acting") or made_by_numba(tau):
        found = _estimated(record, _until_its_end(record) if record.ended.over else record.planned)
    if found.why:
        record.ended.message += f"; {found.why}"
    return found


def _estimated(record: Recording, plan: RunPlan) -> Estimate:
    """Compute the difference from a finer run, where `plan` has the recorded times."""
    n, mech, tables = len(plan.times), record.mech, record.plan.contacts
    if n < 2 or plan.times[-1] == plan.times[0]:
        return Estimate(np.zeros((n, 1 + len(mech.model.states))), np.zeros(n))
    # a finer run in the same scene has its own
    grazes = grazed(record) if record.steps.links.cross else []
    finer = _finer_run(record, plan)
    if isinstance(finer, str):
        return Estimate(why=f"{BECAUSE} a finer run, to compare with, fails: {finer}")
    off = apart(record, finer, n)
    turned, slid, size = ranges_of_motion(mech.packed, record.out.q[:n])
    touched = record.out.pairs.size or record.events or finer.out.pairs.size or finer.events
    forces = forces_apart(record, finer, n) if touched else np.zeros(n)
    record.ended.notices += undecided(record, finer, max(turned, slid), off, grazes)
    if record.carried is not None and finer.carried is not None:
        record.ended.notices += record.carried.unlike(
            finer.carried, plan.times, *shared(record, finer, n)
        )
    ahead = plan.onward() if record.met else plan
    changed = record.steps.ends["change"] > -np.inf  # steps after it begin anywhere
    if ahead.tolerance is None and (changed or may_jump(record, ahead)):
        third = _again(record, offset_plan(finer_plan(plan, n), ahead, 1), carries=False)
        if not isinstance(third, str):
            off = np.maximum(off, apart(record, third, n))
            if touched:
                forces = np.maximum(forces, forces_apart(record, third, n))
    error = off[:, 1:].copy()
    np.maximum(off[:, 0], off[:, 1], out=error[:, 0])
    better = ""
    if tables is not None:
        left = _left_open(record, tables, n)
        if left[0] > error[:, 0].max():
            better = "a start without overlap and within limits"
        np.maximum(error[:, 0], left, out=error[:, 0])
    np.maximum.accumulate(error, out=error)
    rounding = _rounding(record, plan.times)
    error += rounding
    touching = record.scene.touching
    if touching is not None:  # drift due to the contact solver's velocity residuals [rad, m]
        error[1:, 0] += float(touching.tally["strayed"])
    length, x = plan.length, record.out.v[:n, mech.nv :]
    ranges = sizes_of_states(mech.packed, x) if x.size else ()
    known = off <= PARTED * np.array((1.0, max(length, slid) or 1.0, *ranges))
    if not known.all():
        known[:, 1:] &= known[:, :1] & known[:, 1:2]
        error[~np.logical_and.accumulate(known[:, 1:])] = np.inf
    forces[~np.isfinite(error[:, 0])] = np.inf
    if record.plan.tolerance is not None:  # an error within the tolerance is acceptable
        turns = not mech.packed.slides.all()
        size = max(size, record.plan.tolerance.rtol * max(length, float(turns)) / VISIBLE)
    sizes = np.array((size, *ranges))
    # what is rounding no step and no tolerance makes smaller
    sizes = np.maximum(sizes, ROUNDING / (EPS * VISIBLE) * rounding[-1])
    told = _notices(record, plan.times, error, sizes, better)
    if touched and not told:
        told = unsure_forces(record, plan.times, forces)
    elif not told:
        told = unsure_speeds(record, finer, plan.times, shared(record, finer, n), size)
    if record.plan.method.implicit:
        told += passed_over(record, float(error[-1, 0]))
    return Estimate(error, forces, told)


def _rounding(record: Recording, t: Array) -> Array:
    """Compute the effect of rounding in positions and times on q and states (n, 1 + nx), which both
    runs share.

    A corner of a table that comes late by EPS t changes the speed by that times the acceleration.
    """
    out, nq, nv, n = record.out, record.mech.nq, record.mech.nv, len(t)
    later, speeds = t - t[0], np.abs(out.v[:n]).max(axis=0)
    later *= float(record.steps.error["steepest"])
    far, fastest = np.abs(out.q[:n, :nq]).max(initial=0.0), speeds[:nv].max(initial=0.0)
    rates = np.zeros((n, 1 + len(speeds) - nv))
    rates[:, 0] = later + fastest
    rates[:, 1:] = np.abs(out.vdot[:n, nv:]).max(axis=0)
    return EPS * ((far, *speeds[nv:]) + max(abs(float(t[0])), abs(float(t[-1]))) * rates)


def _left_open(record: Recording, tables: Tables, n: int) -> Array:
    """Compute the gap or depth (n,) of rigid contacts and limits that are closed [m, rad].

    In time stepping, a slow impact may leave a gap, which is a residual of the contact law. A
    penetration is included in every phase, and so is a gap smaller than the tolerated penetration.
    """
    pairs = record.out.pairs[:n]
    if not pairs.size:
        return np.zeros(n)
    from ..engine.contact.closing import DEPTH

    rigid = np.flatnonzero(tables.laws["law"] == RIGID)
    gap, closed = pairs["gap"][:, rigid], pairs["phase"][:, rigid] > SWING
    found = np.where(closed | (gap < DEPTH * record.plan.length), np.abs(gap), 0.0)
    beyond = [-limit.gap(record.out.q[:n]) for limit in tables.coordinate_limits]
    return np.maximum(found.max(axis=1, initial=0.0), np.max(beyond, axis=0, initial=0.0))


def _notices(
    record: Recording, t: Array, error: Array, sizes: Array, better: str
) -> tuple[str, ...]:
    """Return messages about errors (n, 1 + nx) that are large or unknown before the end of the run.

    `better` makes that of the motion smaller, if it is not smaller steps. Control states that do
    not affect any force are checked separately.
    """
    words = "the error", " rad or m", "the motion"
    found = _told(record, t, error[:, 0], sizes[0], words, better)
    if found and (tables := record.plan.contacts) is not None:
        soft = tables.laws["law"] == SOFT
        if (tables.laws["friction"][soft] > 0.0).any():
            found[0] += "; where soft contacts should stick, use the law 'complementarity'"
    states = record.mech.model.states if error.shape[1] > 1 else ()
    for (control, k, _), own, size in zip(states, error[:, 1:].T, sizes[1:]):
        what = f"control '{control.name}': the error of its state x.{control.name}[{k + 1}]"
        same = np.array_equal(np.isfinite(own), np.isfinite(error[:, 0]))
        until = np.isfinite(own) if same else slice(None)  # not covered by the notice on the motion
        found += _told(record, t[until], own[until], size, (what, "", "its range"))
    return tuple(found)


def _told(
    record: Recording, t: Array, error: Array, size: float, words: tuple[str, str, str],
    better: str = "",
) -> list[str]:  # fmt: skip
    """Return a message about an error (n,) that is large or unknown before the end of the run.

    `better` makes it smaller, if it is not smaller steps.
    """
    known, (what, unit, whole) = int(np.isfinite(error).sum()), words
    if known < len(t):
        digits = _digits(t)
        until = (
            f". Until t = {t[known - 1]:.{digits}g} s it is about {error[known - 1]:.2g}{unit}"
            if known > 1  # at the start, which both share, the error is none
            else ""
        )
        return [
            f"{what} is not known from t = {t[known]:.{digits}g} s on, where a finer run "
            f"diverges{until}. This time can be extended by "
            f"{better or more_accurate(record.plan)}, but is always limited for chaotic motion"
        ]
    if len(t) < 2 or error[-1] <= VISIBLE * size:
        return []
    first = t[int((error > VISIBLE * size).argmax())]
    return [
        f"{what} is about {error[-1]:.2g}{unit}, {percent(error[-1] / size)} of {whole}, and "
        f"above 1 % from t = {first:.{_digits(t)}g} s on; use "
        f"{better or more_accurate(record.plan)}"
    ]


def _digits(t: Array) -> int:
    """Count the digits required to distinguish the times."""
    return 4 + max(int(np.log10(np.abs(t).max() / np.ptp(t))), 0)


def _finer_run(record: Recording, plan: RunPlan) -> Recording | str:
    """Return a run with at least MORE times the steps, or the reason why there is none.

    If a tighter tolerance is not sufficient, the maximum step size is set to half of the mean step
    size.
    """
    steps, given = int(record.steps.counters["steps"]), plan.tolerance
    finer = finer_plan(plan, steps)
    if record.steps.divided:
        found = _undivided(record, finer)
        if not isinstance(found, str) or not plan.method.adaptive:
            return found
        finer = finer_plan(plan, steps, divided=True)
    ahead = plan.onward() if record.met else plan
    halved = ahead.tolerance is None and (ahead.impulses or may_jump(record, ahead))
    plans = (offset_plan(finer, ahead, 2**k) for k in range(1, 5)) if halved else (finer,)
    enough = MORE * record.steps.counters["evaluations"]
    first: Recording | str = ""
    half = finer
    for half in plans:  # the run may have divided its own steps, as where bodies that touch turn
        first = _again(record, half)
        if isinstance(first, str) or first.steps.counters["evaluations"] >= enough:
            break
    if given is None:
        return first
    if not isinstance(first, str) and first.steps.counters["steps"] >= MORE * steps:
        return first
    tight = plan if isinstance(first, str) else half
    second = _again(record, no_wider(tight, 0.5 * float(np.ptp(plan.times)) / steps))
    return first if isinstance(second, str) else second


def _undivided(record: Recording, finer: RunPlan) -> Recording | str:
    """Return a run with steps of at most half the size of those of a run that has divided steps.

    Where smaller steps are solved, the run has divided its own ones at most to that size.
    """
    solved = False
    for k in range(MOST_HALVINGS):
        other = _again(record, replace(finer, parts=finer.parts * 2**k))
        if isinstance(other, str) or solved:
            return other
        solved = other.steps.divided == 0
    return "steps of a sixteenth of the size are divided, too"


def _again(record: Recording, plan: RunPlan, carries: bool = True) -> Recording | str:
    """Return a run of the same motion with this plan, or the reason why it failed.

    If `carries` is given, derivatives are computed too.
    """
    try:
        other = Recording(record.mech, plan, *record.began, record.tau, coarser=record)
        other.progress = progress = record.progress
        if carries and record.carried is not None:
            other.carried = record.carried.finer()
        if other.begin():
            other.advance_to_end(progress and (lambda _: progress(1.0)))
        other.leave()
    except InputError as refused:  # contacts that come near may not fit the method
        return str(refused)
    return other if other.ended.ok else other.ended.message


def _until_its_end(record: Recording) -> RunPlan:
    """Compute the plan of a run that an event has ended, with its recorded times."""
    plan, n = record.planned, record.steps.recorded
    times, changes = record.steps.times[:n].copy(), plan.changes
    changes = tuple(change for change in changes if n and change.t < times[-1])
    plan = replace(plan, samples=plan.samples[plan.samples < times[-1:]])
    if plan.tolerance is not None or n < 2:
        return replace(plan, times=times, changes=changes)
    spans, substeps = np.diff(times), plan.substeps[: n - 1].copy()
    substeps[-1] = max(np.ceil(spans[-1] / plan.width[n - 2] - SOLVED), 1)
    return replace(plan, times=times, changes=changes, substeps=substeps, width=spans / substeps)
