"""From what a run is asked for to its plan."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from ..contact.sites import Site, sites_of
from ..contact.tables import Tables
from ..errors import InputError, Problem
from ..mechanism import Mechanism
from ..system import Array
from .acting import Acting, ticks
from .arguments import Asked, positive, tolerance_of
from .choice import Choice, chosen
from .corners import corners, corners_inside
from .run_plan import NO_TIMES, RunPlan, Tolerance
from .switching import ever, with_instants
from .times import FRAMES, frame_times, given_times, steps_between

RESOLVED = 0.25  # steps times the rate of penalty contacts where no step is given
KINKED = 2  # order that is left where tables bend inside steps


class Planned(NamedTuple):
    """The plan of a run, and how it came about."""

    plan: RunPlan
    choice: Choice
    shown: NDArray[np.bool_]  # of the frames: those asked for
    notices: list[str]


def planned(mech: Mechanism, acts: Acting, asked: Asked) -> Planned:
    """The plan of what acts, stepped and recorded as asked. Raises InputError."""
    asked = _with_contacts(acts, asked)
    named = asked.usual if asked.step is None and (asked.given or acts.impulses) else asked.step
    length = asked.span[1] - asked.span[0]
    choice = chosen(mech, acts, asked.method, named, asked.rtol, length)
    contacts, sites = acts.contacts, ()
    if contacts and acts.impulses and choice.method.name != "moreau_jean":
        contacts, sites = _in_phases(mech, contacts)
        choice = choice._replace(why=f"{choice.why}, from event to event of contacts and limits")
    tolerance = tolerance_of(choice.method, length, asked)
    step, asked_for = _frames(asked, tolerance)
    changes = acts.changes
    times, changes = with_instants(asked_for, changes) if changes else (asked_for, ())
    substeps, width = steps_between(times, step)
    bends = corners(mech, acts.drives, acts.loads, ever(acts.active, changes), *asked.span)
    kinks = NO_TIMES
    if tolerance is not None:
        tolerance = tolerance._replace(corners=np.union1d(bends, ticks(acts.tau, asked.span)))
    elif choice.method.order > KINKED:
        kinks = corners_inside(bends, times, width)
    plan = RunPlan(
        choice.method,
        times,
        substeps,
        width,
        acts.drives,
        acts.loads,
        acts.active,
        contacts,
        _gains(asked),
        asked.stabilise == "project" or bool(sites),
        tolerance,
        sites,
        changes,
        kinks,
    )
    notices = _stiff(plan, choice.rate) + _bent(plan) + _hard(plan)
    return Planned(plan, choice, _shown(plan, asked, asked_for), notices)


def _with_contacts(acts: Acting, asked: Asked) -> Asked:
    """With the step that penalty contacts take, where neither step nor scenario gives one."""
    contacts, said = acts.contacts, asked.given or asked.step is not None or asked.rtol is not None
    if said or contacts is None or not contacts.remembers or acts.impulses:
        return asked
    return asked._replace(step=min(asked.usual, RESOLVED / contacts.rate))


def _frames(asked: Asked, tolerance: Tolerance | None) -> tuple[float, Array]:
    """(width of steps [s], 0 where the method chooses them; times to record)."""
    if tolerance is None or tolerance.fixed:
        step = positive("step", asked.usual if asked.step is None else asked.step)
        return step, given_times(*asked.span, step, asked.frames, asked.t_eval)
    frames = FRAMES + 1 if asked.frames is None else asked.frames
    return 0.0, frame_times(*asked.span, frames, asked.t_eval)


def _shown(plan: RunPlan, asked: Asked, asked_for: Array) -> NDArray[np.bool_]:
    """The frames that were asked for, and not only there for a change or for the start."""
    whole = np.ones(len(plan.times), dtype=bool)
    shown = np.isin(plan.times, asked_for) if plan.changes else whole
    shown[0] = asked.t_eval is None or len(asked_for) == np.size(asked.t_eval)
    return shown


def _gains(asked: Asked) -> Array:
    """Baumgarte's 2α and α² with α = 0.1/h: stable for every method here, gone in 10 steps."""
    if asked.stabilise != "baumgarte":
        return np.zeros(2)
    alpha = 0.1 / float(asked.usual if asked.step is None else asked.step)
    return np.array([2 * alpha, alpha * alpha])


def _in_phases(mech: Mechanism, contacts: Tables) -> tuple[Tables | None, tuple[Site, ...]]:
    """(soft contacts, sites of rigid contacts and limits) of an event-driven run."""
    if contacts.remembers:
        text = "a penalty contact remembers where it sticks, and a step to an event is taken again"
        text += "; give the contacts law 'soft' or 'complementarity', or use method 'moreau_jean'"
        raise InputError(Problem("simulate", "method", text))
    sites = sites_of(mech.model, mech.topology, mech.system, contacts)
    soft = tuple(t.contact for t in contacts.touches if t.contact.law == "soft")
    rest = mech.contacts(tuple(dict.fromkeys(soft)))
    if rest is None or not rest.touches:
        return None, sites
    none = tuple(array[:0] for array in rest.limit_blocks)
    return rest._replace(limits=(), limit_blocks=none), sites


def _stiff(plan: RunPlan, rate: float) -> list[str]:
    """A notice where given steps are too wide for an explicit method."""
    step = plan.step
    limit = plan.method.limit
    if step is None or limit == 0.0 or rate * step <= limit:
        return []
    x = rate * step
    return [f"stiff: lambda*dt = {x:.3g}, explicit limit dt < {limit / rate:.3g} s, try radau5"]


def _hard(plan: RunPlan) -> list[str]:
    """A notice where given steps are too wide for the stiffness or friction of contacts."""
    rate = plan.contacts.rate if plan.contacts is not None else 0.0
    if plan.step is None or plan.method.implicit or rate * plan.step <= 1.0:
        return []
    return [
        f"soft or penalty contacts make rates of about {rate:.3g}/s, which steps of "
        f"{plan.step:.3g} s do not resolve: give {RESOLVED / rate:.2g} s or less, or a smaller "
        "stiffness"
    ]


def _bent(plan: RunPlan) -> list[str]:
    """A notice where tables bend inside given steps, which takes the method's order."""
    count = len(plan.kinks)
    if count == 0:
        return []
    step = float(np.max(plan.width))
    lie = "1 corner of tables lies" if count == 1 else f"{count} corners of tables lie"
    return [
        f"{lie} inside steps of {step:.4g} s: the error there shrinks as the step's square only; "
        f"choose a step that divides the times of knots, or an adaptive method such as dopri5"
    ]
