"""Advice about the steps of explicit methods, which the fastest rate of the motion limits.

In many motions the rate grows. It is evaluated along the motion, and if a run has left the motion
because its steps were too large, along a run that chooses its steps.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import replace
from typing import NamedTuple

import numpy as np

from ..errors import InputError
from ..integrators import RADAU5
from ..packing import Array
from ..result import Status
from ..tolerances import VISIBLE
from .compliance import fastest_contact
from .options import Tolerance
from .plan import NO_SUBSTEPS, NO_TIMES
from .rates import FAST, MARGIN, STIFF, Rate, advised_step, resolving_step
from .remedies import by_error, or_by_error
from .running import Running

RATED_STATES = 129  # number of states of a motion at which its fastest rate is evaluated
PILOT_STEPS = 4000  # limit on a run that chooses its steps: a tenth of a second or so


class Advice(NamedTuple):
    """The step for a motion and method."""

    step: float  # [s], infinite if no rate limits it
    widest: float  # the same without contacts [s]
    rate: float  # the fastest [1/s]
    at: Rate  # the state at which it occurs
    diverged: float  # time at which a run that chooses its steps ends early [s], or nan


def advice(record: Running, *, left: bool = False) -> Advice:
    """Return the advised step for the motion of a run, which is stored with the run.

    `left` states that the run has left the motion, so that its states say nothing about the motion.
    """
    found: Advice | None = vars(record).get("_advice")
    if found is None:
        found = vars(record)["_advice"] = _advice(record, left)
    return found


def _advice(record: Running, left: bool) -> Advice:
    plan, diverged = record.plan, float("nan")
    span = float(plan.times[-1] - plan.times[0])
    forces, active = (plan.drives, plan.loads), record.active
    stepped = plan.method.time_stepping
    pilot = None if stepped or not record.whole else _pilot(record)
    along = () if left else _recorded(record)
    if pilot is not None:
        along, diverged = pilot
    states = [record.began, *along]
    best, fastest = None, -1.0
    for q, v in states:
        here = Rate(record.mech, forces, active, (q.copy(), v.copy()), span)
        rate = here.explicit() if stepped else here.exact()
        if rate > fastest:
            best, fastest = here, rate
    assert best is not None, "a run has a first state"
    contacts = 0.0
    if plan.contacts is not None:
        contacts = fastest_contact(record.mech, plan.contacts, record.began[0])
    widest = advised_step(plan.method, fastest)
    if plan.method.by_old_velocity:
        widest = best.steady(widest)
    return Advice(min(widest, resolving_step(contacts)), widest, fastest, best, diverged)


def _recorded(record: Running) -> Iterator[tuple[Array, Array]]:
    """Yield some of the recorded states."""
    n = record.steps.recorded
    for i in np.unique(np.linspace(0, n - 1, RATED_STATES).astype(int)) if n else ():
        yield record.out.q[i], record.out.v[i]


def _pilot(record: Running) -> tuple[list[tuple[Array, Array]], float] | None:
    """Return states of the same motion by adaptive steps, and the time at which they end early.

    They are implicit: explicit steps leave errors in the fastest modes of a stiff motion, and the
    rate there may differ by far from that of the motion. Return None if adaptive steps cannot
    follow the motion.
    """
    plan, nothing = record.plan, float("nan")
    held = plan.stops or plan.conditions or plan.impulses or plan.contact_points
    if held or record.user is not None or record.scene.remembers:
        return None
    span = plan.times[0], plan.times[-1]
    given = Tolerance(VISIBLE / 10.0, 0.0, float(span[1] - span[0]), PILOT_STEPS)
    own = replace(
        plan, method=RADAU5, tolerance=given, times=np.linspace(*span, RATED_STATES), parts=1,
        substeps=NO_SUBSTEPS, width=NO_TIMES, shown=None, way=None, told=(), notices=(),
    )  # fmt: skip
    try:
        pilot = record.repeated(own)
    except InputError:
        return None
    early = pilot.ended.status in (Status.NOT_FINITE, Status.STEP_TOO_SMALL)
    end = float(pilot.steps.times[pilot.steps.recorded - 1]) if early else nothing
    return [*_recorded(pilot)], end


def for_failed(record: Running) -> str:
    """Return what to do about a run with fixed steps that stopped being finite."""
    plan = record.plan
    step = float(plan.step or 0.0)
    grows = "the motion itself may grow without bound, or forces may jump there"
    if plan.method.stable or plan.method.limit == 0.0:
        return grows
    found = advice(record, left=True)
    if np.isfinite(found.diverged):
        return f"{grows}: adaptive steps end at t = {found.diverged:.6g} s"
    if not found.step < step:
        fixed = plan.contacts is not None or not record.whole  # contacts, or a stepper
        other = "" if fixed else by_error(plan)
        return f"{grows}; try {other}" if other else grows
    cause = f"the fastest rate of the motion is {found.rate:.3g}/s"
    if found.widest < MARGIN * advised_step(plan.method, found.rate):
        return (
            f"{cause}, and it swings by forces of velocities, which {plan.method.name} makes grow: "
            f"try a step of {found.step:.2g} s{or_by_error(plan)}"
        )
    return f"{cause}: try a step of {found.step:.2g} s, less stiffness and damping, or radau5"


def too_wide(record: Running) -> Iterator[str]:
    """Yield a notice about fixed steps that are too large, for the fastest rate that they met."""
    plan, step = record.plan, float(record.plan.step or 0.0)
    (_, widest, rate, at, _), method = advice(record), plan.method
    if rate * step <= method.limit:  # the rate of the plan is within 10 %
        return
    if method.time_stepping:
        yield f"{STIFF} lambda*dt = {rate * step:.3g}; give steps below {widest:.2g} s"
        return
    if not at.swings():
        do = "" if method.stable else f", stable for dt < {widest:.2g} s"
        yield f"{STIFF} lambda*dt = {rate * step:.3g}{do}; try radau5"
        return
    good = min(resolving_step(rate, min(method.order, 4)), widest)
    do = "give " if method.stable else f"{method.name} requires less than {widest:.2g} s, and "
    yield (
        f"{FAST} steps of {step:.3g} s do not resolve the fastest oscillation, of {rate:.3g} "
        f"rad/s: {do}{good:.2g} s or less for good accuracy; use such a "
        f"step{or_by_error(plan)}. If the oscillation is not of interest, try radau5, which steps "
        "over it"
    )
