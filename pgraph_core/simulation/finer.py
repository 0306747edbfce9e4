"""Finer runs for the error estimate, and differences between runs.

The error due to a jump of a force within a step depends on the time between the start of the step
and the jump. A run with half the step size would make the same error if the jump followed a common
end of steps, so its steps are shifted. However, both errors are equal for one time within the step.
A third run with the original step size, shifted by a third of a step, excludes this case: forces
act from the start, the middle or the end of a step, and these times never coincide in all runs.

Adaptive methods divide the remaining time before an end into one or two equal steps, so a finer run
that ends a step in the middle of an interval might repeat the same steps. The golden section does
not coincide with any equal division of the interval. Such a step also follows each event that ends
a step in both runs, such as an impact or the change of a comparison.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from dataclasses import replace
from typing import TYPE_CHECKING, NamedTuple

import numpy as np

from ..dynamics.scene import contact_tables
from ..dynamics.states import differences
from ..engine.signals import AT_MOST, HELD_FROM, LESS, NEAREST, SIDE, WHEN, values
from ..engine.stepping.widths import GOLDEN
from ..model.expressions import expressions_of
from ..packing import Array, Ints
from ..tolerances import EPS, SOLVED
from .event_record import pushes
from .failures import readers
from .means import means_between
from .options import MOST_CHOSEN, Tolerance
from .plan import NO_PLAN
from .recording import Recording
from .remedies import more_accurate
from .run_plan import RunPlan

if TYPE_CHECKING:
    from ..contact.limits import Limit
    from .monitors import Watch

FIRST = 0.125 ** np.arange(3.0)  # ends of steps after a shared one, relative to a first step
FINER_PLAN = "_finer"  # attribute of a plan with its finer one, and what that was made for
LIMITS = "_limits"  # attribute of a plan with its limits on coordinates
MOST_FINER = 32  # steps for one of the run, where two are expected
STRETCH = 4  # steps between times shared with the run of half the step: the last bounces' length


def finer_plan(plan: RunPlan, steps: int, divided: bool = False) -> RunPlan:
    """Return the plan with half the step size or a tighter tolerance, given the number of steps
    taken.

    If adaptive steps end at frames or corners of tables, the finer steps end between them. Instead
    of given steps that were `divided`, a method that can chooses its steps.
    """
    kept, key = plan.__dict__, (steps, divided)
    if kept.get(FINER_PLAN, NO_PLAN)[0] != key:  # runs with given steps ask again and again
        kept[FINER_PLAN] = key, _finer_plan(plan, steps, divided)
    return kept[FINER_PLAN][1]


def _finer_plan(plan: RunPlan, steps: int, divided: bool) -> RunPlan:
    given = plan.tolerance
    if given is None and divided and plan.method.adaptive:
        given = Tolerance(SOLVED, 0.0, 0.5 * float(plan.width.max()), MOST_CHOSEN)
    way = None if plan.way is None else finer_plan(plan.onward(), steps, divided)
    table = plan.drives.table.copy()
    cables, *of_cables = plan.loads.cable
    cables = cables.copy()
    for own in (table, cables):
        own["creep"] *= 0.5
    if (contacts := plan.contacts) is not None and contacts.compliant:
        contacts = contacts._replace(laws=contacts.laws.copy())
        contacts.laws["creep"] *= 0.5
    drives = plan.drives._replace(table=table)
    loads = plan.loads._replace(cable=(cables, *of_cables))
    plan = replace(
        plan, parts=2 * plan.parts, way=way, drives=drives, loads=loads, contacts=contacts
    )
    if given is None:
        return plan
    ends_run = plan.times[[0, -1]][: 2 * len(plan.corners)]
    frames = ends_run if len(plan.method.tableau.dense) else plan.times  # frames that end steps
    ends = np.union1d(plan.corners, frames)
    wide = np.diff(ends) > SOLVED * float(np.ptp(plan.times)) / steps
    between = ends[1:][wide] - GOLDEN * np.diff(ends)[wide]
    ahead, after = ends[:-1][~wide], ends[1:][~wide]  # one time, but for rounding
    same = np.append(ahead[np.isin(after, frames)], after[np.isin(ahead, frames)])
    rtol = min(max(given.rtol / plan.method.gain, 100.0 * EPS), given.rtol)
    atol = given.atol * rtol / given.rtol
    most = MOST_FINER * (steps + len(plan.times))
    finer = given._replace(most=most, rtol=rtol, atol=atol)
    corners = np.union1d(np.setdiff1d(plan.corners, same), between)
    return replace(plan, tolerance=finer, corners=corners)


def no_wider(plan: RunPlan, widest: float) -> RunPlan:
    """Return the plan with this maximum step size [s]."""
    given = plan.tolerance
    assert given is not None
    return replace(plan, tolerance=given._replace(widest=min(given.widest, widest)))


def may_jump(record: Recording, plan: RunPlan) -> bool:
    """Check whether forces may have jumped within steps.

    This is possible for joint friction and torque functions, and for soft and penalty contacts if
    steps do not end at their touches. With time stepping, forces of contacts and limits jump if any
    of them were active.
    """
    touching = record.scene.touching
    yields = plan.contacts is not None and plan.contacts.compliant
    if yields and not (plan.yields and record.steps.links.cross):
        return True
    pushed = touching is not None and touching.tally["force"] > 0.0
    return pushed or record.user is not None or bool((plan.drives.table["friction"] > 0.0).any())


def offset_plan(finer: RunPlan, plan: RunPlan, parts: int) -> RunPlan:
    """Compute the finer plan with each step of `plan` in `parts`, offset by a third of a part.

    The plan records the times at which steps of both runs end. These are after STRETCH steps or at
    a frame, or after √n of n steps for equal steps, whose differences at a jump persist.
    """
    frames = np.append(0.0, np.cumsum(plan.substeps))  # [steps of the plan]
    stretch = STRETCH if parts > 1 else int(np.sqrt(frames[-1]))
    steps = np.append(0, np.cumsum(plan.substeps))
    keep = np.searchsorted(steps, np.arange(0, steps[-1], stretch))
    switched = np.searchsorted(plan.times, plan.stops)
    shared = frames[np.union1d(np.append(keep, len(steps) - 1), switched)]
    near = shared[:-1, None] + FIRST / (3.0 * parts)
    ends = np.unique(np.concatenate((shared, *near.T, near[:, 0] + (np.diff(shared) - 1.0))))
    substeps = np.maximum(np.rint(np.diff(ends)), 1.0).astype(np.int64)
    times = np.interp(ends, frames, plan.times)
    width = np.diff(times) / substeps
    given = {"times": times, "substeps": substeps, "width": width, "shown": None}
    acts = {"drives": finer.drives, "contacts": (finer.way or finer).contacts}
    offset = replace(plan, parts=parts, **acts, **given)
    if finer.way is None:
        return offset
    if finer.tolerance is None:
        finer = replace(finer, substeps=substeps, width=width, parts=parts)
    return replace(finer, times=times, way=offset, shown=None)


def shared(record: Recording, finer: Recording, n: int) -> tuple[Ints, Ints]:
    """Return the frames (k,) of two runs at their common times, among n times of the first."""
    t, theirs = record.steps.times[:n], finer.steps.times[: finer.steps.recorded]
    if np.array_equal(t, theirs):
        return (every := np.arange(n)), every
    _, i, j = np.intersect1d(t, theirs, assume_unique=True, return_indices=True)
    return i, j


def apart(record: Recording, finer: Recording, n: int) -> Array:
    """Find the largest angle [rad], the largest distance [m] and the differences of states of
    controls between two runs (n, 2 + nx), at n times of the first.

    For times that only the first run recorded, the difference at the next common time is returned.
    """
    i, j = shared(record, finer, n)
    nv, ours, theirs = record.mech.nv, record.out, finer.out
    off = np.empty((len(i), 2 + ours.v.shape[1] - nv))
    off[:, 0], off[:, 1] = differences(record.mech.packed, ours.q[i], theirs.q[j])
    np.abs(ours.v[i, nv:] - theirs.v[j, nv:], out=off[:, 2:])
    if len(i) == n:
        return off
    return off[np.minimum(np.searchsorted(i, np.arange(n)), len(i) - 1)]


def forces_apart(record: Recording, finer: Recording, n: int) -> Array:
    """Find the largest difference (n,) of contact and limit forces between two runs [N, N m], at n
    times of the first.

    With time stepping, forces are means between the times that both runs recorded.
    """
    i, j = shared(record, finer, n)
    off = _means_apart(record, finer, i, j)
    if record.events is not None or finer.events is not None:  # one may have touched nothing
        given = (record.events, i), (finer.events, j)
        found = [0.0 if events is None else pushes(events.scene, rows) for events, rows in given]
        off = np.maximum(off, np.linalg.norm(found[0] - found[1], axis=2).max(axis=1))
    return off[np.minimum(np.searchsorted(i, np.arange(n)), len(i) - 1)]


def _means_apart(record: Recording, finer: Recording, i: Ints, j: Ints) -> Array:
    """Find the largest difference (k,) of forces in `pairs`, at frames i and j of the runs."""
    runs, known = (record, finer), [x.out.pairs for x in (record, finer) if x.out.pairs.size]
    if not known:
        return np.zeros(len(i))
    none = (known[0].shape[1], 3)  # shape of the forces if a run touches nothing
    found = [
        x.out.pairs["mean_force"] if x.out.pairs.size else np.zeros((x.steps.recorded, *none))
        for x in runs
    ]
    if any(x.plan.method.time_stepping for x in runs):
        times = record.steps.times, finer.steps.times
        found = [means_between(*given) for given in zip(times, found, (i, j))]
        for force in found:
            force[0] = 0.0  # the start is an instant, in steps of different width
    else:
        found = [force[k] for force, k in zip(found, (i, j))]
    return np.linalg.norm(found[0] - found[1], axis=2).max(axis=1)


# -- events that a finer run has and the run has not -----------------------------------------------


class Approach(NamedTuple):
    """An event that almost happened."""

    name: str
    value: float
    t: float  # [s]
    watched: Callable[[float, Array, Array], float]  # function of (t, q, v), zero at the event
    before: str = ""  # a remedy that may suffice


def undecided(
    record: Recording, other: Recording, moved: float, off: Array, grazes: Sequence[Approach]
) -> tuple[str, ...]:
    """Return a notice for each limit, event and comparison that a run misses by less than its
    error.

    `moved` is the largest change of a joint at a frame, `off` the result of `apart`, and `grazes`
    that of `grazed` before the other run.
    """
    limited = record.mech.packed.model.limited
    approaches = [*(_limits(record, moved, off) if limited else ()), *grazes]
    if record.watch is not None:
        approaches += _events(record, record.watch)
    if not approaches:
        return ()
    i, j = shared(record, other, record.steps.recorded)
    t, found = record.steps.times[i], []
    for near in approaches if len(t) > 1 else ():
        k = int(np.clip(np.searchsorted(t, near.t), 1, len(t) - 1))
        error = 2.0 * max(  # method of order 1: twice the difference to half the step
            abs(
                near.watched(float(t[n]), record.out.q[i[n]], record.out.v[i[n]])
                - near.watched(float(t[n]), other.out.q[j[n]], other.out.v[j[n]])
            )
            for n in (k - 1, k)
        )
        if near.value < error:
            found.append(
                f"at t = {near.t:.6g} s the motion comes within {near.value:.2g} of {near.name}, "
                f"and the error there is about {error:.2g}, so it is not decided whether it "
                f"occurs; {near.before}give {more_accurate(record.plan)}"
            )
    return tuple(found)


def _events(record: Recording, watch: Watch) -> list[Approach]:
    """Return how close switch conditions and user events came to triggering."""
    from ..engine.contact import points

    monitors = watch.monitors
    watched = record.steps.watched[:, record.steps.watched.shape[1] - len(monitors) :]
    nearest, when = watched[[points.WATCHED.nearest, points.WATCHED.when]].tolist()
    found = []
    for number, (m, x, t) in enumerate(zip(monitors, nearest, when, strict=True)):
        if not math.isfinite(x):
            continue
        if number < watch.waiting:
            before = "if it has acted before, give the condition once=True, or a threshold that "
            before += "the motion has left; else "
            found.append(Approach(f"the condition '{m.name}'", x, t, m, before))
        else:
            found.append(Approach(f"event '{m.name}'", x, t, m))
    return found


def grazed(record: Recording) -> list[Approach]:
    """Return how close the motion came to thresholds from which it may have turned back."""
    code, found = record.scene.loads.signals[0].copy(), list[Approach]()
    code[1::2, SIDE] = 0.0
    for i in (
        2 * np.flatnonzero(np.isin(code[::2, 0], (HELD_FROM + LESS, HELD_FROM + AT_MOST)))
    ).tolist():
        value, t = code[i, [NEAREST, WHEN]].tolist()
        if 0.0 < value < math.inf and (read := readers(record, i)):  # 0: it stays there

            def margin(t: float, q: Array, v: Array, i: int = i) -> float:
                values(code, t, q, v)
                left, right = code[2 * code[i, 1:3].astype(int) + 1, 0]
                return float(left - right)

            name = f"a threshold in the expression of '{read[0].name}'"
            if not any(expressions_of(read[0])):
                name = f"the range of a point of '{read[0].name}'"
            found.append(Approach(name, value, t, margin))
    return found


def _limits(record: Recording, moved: float, off: Array) -> list[Approach]:
    """Return how close coordinates came to limits that they approached without reaching.

    Limits that neither run can reach are ignored.
    """
    plan, n = record.planned, record.steps.recorded
    if LIMITS not in plan.__dict__:  # runs of this plan ask again and again
        tables = plan.contacts if plan.declared is None else plan.declared
        if tables is None:
            tables = contact_tables(record.mech.packed, ())
        plan.__dict__[LIMITS] = () if tables is None else tuple(tables.coordinate_limits)
    limits: tuple[Limit, ...] = plan.__dict__[LIMITS]
    if not limits or n < 2:
        return []
    out, t, found = record.out, record.steps.times[:n], list[Approach]()
    between = float((t[1:] - t[:-1]).max()) * float(np.abs(out.v[:n]).max())
    within = moved + between + 2.0 * float(off[:, :2].max())
    for limit in limits:
        if limit.gap(out.q[0]) > within * sum(map(abs, limit.weights.tolist())):
            continue
        rates, curves = (x[:n, limit.at_v] @ limit.weights for x in (out.v, out.vdot))
        value, when = _least(t, limit.gap(out.q[:n]), rates, curves)
        if math.isfinite(value):
            watched = lambda _t, q, _v, limit=limit: float(limit.gap(q))  # noqa: E731
            found.append(Approach(f"limit '{limit.name}'", value, when, watched))
    return found


@np.errstate(all="ignore")  # huge numbers, of which nothing is known
def _least(t: Array, gap: Array, rate: Array, curve: Array) -> tuple[float, float]:
    """Compute (minimum gap where its rate passes zero, time [s]), using cubics between frame times.

    If the change of the rate is inconsistent with the accelerations, an impact has occurred. If
    polynomials of third and fifth degree differ by more than the gap, the gap is unknown.
    """
    h, fall, rise = np.diff(t), rate[:-1], rate[1:]
    unexplained = np.abs(rise - fall - 0.5 * h * (curve[:-1] + curve[1:]))
    turns = np.flatnonzero((fall < 0.0) & (rise > 0.0) & (2.0 * unexplained < rise - fall))
    h, up = h[turns], np.diff(gap)[turns]
    a, b = h * fall[turns], h * rise[turns]
    square, cube = 3.0 * up - 2.0 * a - b, a + b - 2.0 * up
    x = -a / (square + np.sqrt(np.maximum(square * square - 3.0 * cube * a, 0.0)))
    least = gap[turns] + x * (a + x * (square + x * cube))
    bends = (
        h * h * curve[turns] - 2.0 * square,
        h * h * curve[turns + 1] - 2.0 * square - 6.0 * cube,
    )
    more = 0.5 * (x * (1.0 - x)) ** 2 * ((1.0 - x) * bends[0] + x * bends[1])
    least = np.abs(least + more)
    known = np.flatnonzero(np.abs(more) < least)
    if not len(known):
        return np.inf, np.nan
    k = known[np.argmin(least[known])]
    return float(least[k]), float(t[turns[k]] + x[k] * h[k])
