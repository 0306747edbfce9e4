"""Making plans of runs from a mechanism and options.

Apart from the automatic choice of a method, plans only depend on the mechanism and the options.
Mechanisms cache their last plans, so a short run has little overhead.
"""

from __future__ import annotations

import sys
import threading
from dataclasses import fields, replace
from importlib.metadata import version
from itertools import chain
from typing import TYPE_CHECKING, Any, TypeVar

import numpy as np
from numpy.typing import NDArray

from ..dynamics.scene import contact_tables, stepped_tables
from ..dynamics.states import bodies_over
from ..errors import InputError, Problem
from ..fields import EVERY, GROUND, Frozen
from ..forces import BetweenPoints, OnJoint
from ..mechanism import Mechanism
from ..model import Contact, Force, Scenario, Table
from ..packing import Array, Ints, Loads
from ..packing.forces import drives_begun_from, exerts
from ..packing.signals import begun_from, gated
from ..portable import array_of
from ..result.records import Memory
from ..tolerances import EPS, SOLVED
from .choice import STEPPED, event_driven, given_step, method_for
from .conditions import ConditionOf, conditions_of
from .kinks import corners, kinks_of
from .kinks import told as told_of
from .options import (
    FRAMES,
    MOST_CHOSEN,
    Options,
    Tolerance,
    begun,
    driven,
    fixed_step_times,
    frame_times,
    steps_between,
)
from .plan_notices import filled, hard, lost, too_wide
from .rates import Rate
from .remedies import or_by_error
from .run_plan import NO_GAINS, NO_SUBSTEPS, NO_TIMES, Idle, RunPlan, Way
from .sampling import samples_of, with_readings
from .start import controller_of, initial_state, is_controller
from .switches import (
    ever,
    switch_changes,
    switches_of,
    with_instants,
)

if TYPE_CHECKING:
    from ..contact.tables import Tables

T = TypeVar("T")
VERSION = version("pgraph-dynamics")
# kg, m, kg m²: energies are products of four such numbers, and EPS of one is none
LARGEST_NUMBER = (sys.float_info.max * EPS) ** 0.25
KEPT_PLANS = 8  # by a mechanism
KEEPING = threading.Lock()
NO_PLAN = (None, None, None)
MANY_STEPS = 1_000_000  # number of default steps above which a warning is given


def begun_with(plan: RunPlan, states: Array) -> RunPlan:
    """Return the plan of a run with these initial control states (nx,), if any."""
    if not len(states):
        return plan
    return replace(plan, loads=begun_from(plan.loads, states), states=states)


def plan_of(mech: Mechanism, options: Options, tau: Any, q: Any, v: Any) -> RunPlan:
    """Return the plan of a run, which the mechanism caches for later runs with the same options.

    Raises InputError.
    """
    kept: dict[Any, tuple[RunPlan, Any, Any]] = mech.__dict__.setdefault("_plans", {})
    given, parts = {**vars(options)}, []
    for name in ("forces", "switches"):
        if type(given[name]) in (list, tuple) and given[name]:  # hashing parts takes a few steps
            parts.append(tuple(given[name]))
            given[name] = tuple([id(x) if isinstance(x, Frozen) else x for x in parts[-1]])
    key: Any = (*given.values(), *map(type, given.values()), callable(tau), q is None, v is None)
    try:
        plan, state, _ = kept.get(key, NO_PLAN)
    except (TypeError, ValueError):  # an option that cannot be hashed, such as an array
        key, plan, state = None, None, None
    if tau is not None and is_controller(tau):
        key = plan = None
    if plan is not None and (state is None or state == [*map(_bytes, (q, v))]):
        return plan
    plan, rated = _planned(mech, options, tau, q, v)
    if key is not None:  # contains identities of parts, which a list of the caller may let go
        rated = rated and not (q is None and v is None)  # the options tell that state
        keep(kept, key, (plan, [*map(_bytes, (q, v))] if rated else None, (options, parts)))
    return plan


def keep(kept: dict[Any, T], key: Any, value: T) -> T:
    """Cache a value for a plan, keeping at most KEPT_PLANS of them. Threads share the cache."""
    with KEEPING:
        while len(kept) >= KEPT_PLANS:
            kept.pop(next(iter(kept)))
        kept[key] = value
    return value


def with_contacts(plan: RunPlan) -> RunPlan:
    """Return the plan with contacts and limits active from the start. Raises InputError."""
    if plan.way is not None and plan.way.refused is not None:
        raise plan.way.refused
    return plan.touching


def _bytes(x: Any) -> bytes | None:
    try:
        return None if x is None else np.asarray(array_of(x), dtype=float).tobytes()
    except (TypeError, ValueError):
        return None  # refused where it is used


def _planned(mech: Mechanism, o: Options, tau: Any, q: Any, v: Any) -> tuple[RunPlan, bool]:
    """Return (plan, whether its method was chosen for the state). Raises InputError."""
    given = mech.model.scenario(o.scenario) if o.scenario is not None else None
    o = o.over(given)
    extra = o.checked_forces(mech)
    _check_sizes(mech)
    span = o.span(given)
    tau = controller_of(mech, given) if tau is None else tau
    start = initial_state(mech, given, q, v, tau, span[0])
    declared = contact_tables(mech.packed, touching_contacts(mech, given))
    contacts, rated = declared, declared is not None and _left_open(declared)
    if contacts is not None and rated:
        contacts = at_start_speed(mech, contacts, start)
    bare = _what_acts(mech, o, given, span, extra, contacts)
    bare = replace(bare, start=start, tau=tau if is_controller(tau) else None)
    acts, length = (bare.drives, bare.loads), span[1] - span[0]
    with_states = mech.packed.with_states(span[0], *start, bare.loads.signals)
    rate = Rate(mech, acts, bare.active, with_states, length)
    plan = _on_a_way(mech, replace(bare, contacts=contacts), rate, o, span)
    if declared is not None and _may_wait(plan, declared, o.method):
        way = Way(**{one.name: getattr(plan, one.name) for one in fields(Way)})
        bare = _on_a_way(mech, bare, rate, o, span)
        if not bare.method.time_stepping:  # the same method takes them from the start
            plan = replace(bare, way=way, declared=declared)
    elif plan.refused is not None:
        raise plan.refused
    if q is None or v is None:  # for other runs by this plan
        plan = replace(plan, start=initial_state(mech, given, None, None, tau, span[0]))
    header = {
        "version": VERSION,
        "model_hash": "",  # by the result: it takes as long as a short run
        "scenario": o.scenario,
        **plan.headed,
        "t_start": span[0],
        "t_end": span[1],
        "stabilise": o.stabilise,
        "forces": [(*span, f.model_dump(mode="json", exclude_none=True)) for f in extra],
        "inputs": {name: x.model_dump() if isinstance(x, Table) else x for name, x in o.inputs},
    }
    edits = (f"after the edit of the model: {text}" for text in mech.model.told)
    notices = (*lost(mech.model.lost), *edits, *mech.model.doubts)
    plan = replace(plan, header=header, notices=notices, idle=_idle(mech, given))
    forces = _forces(mech, o, given, span[0], extra)
    if plan.method.order > 1 and (plan.yields or mech.packed.bend(forces)):
        plan = replace(plan, loads=_loads(mech, forces, plan.conditions, True, plan.yields))
    return plan, rated or rate.found is not None


def varied(mech: Mechanism, o: Options, plan: RunPlan, tau: Any, q: Any, v: Any) -> RunPlan:
    """A plan with the forces and the initial state of another mechanism of the same structure."""
    given = mech.model.scenario(o.scenario) if o.scenario is not None else None
    begin, contacts = o.span(given)[0], plan.contacts
    forces = _forces(mech, o, given, begin, o.checked_forces(mech))
    drives = mech.packed.drives(forces)
    bent = plan.method.order > 1
    loads = _loads(mech, forces, plan.conditions, bent, bent and plan.yields)
    start = initial_state(mech, given, q, v, tau, begin)
    start = mech.packed.with_states(begin, *start, loads.signals)
    if contacts is not None:
        contacts = contact_tables(mech.packed, touching_contacts(mech, given))
        contacts = stepped_tables(mech.packed, contacts, drives)
    acting = tuple(filter(exerts, forces))
    plan = replace(
        plan, drives=drives, loads=loads, wrapped=_wrapped(forces), ranged=gated(forces),
        start=start, contacts=contacts, acting=acting,
    )  # fmt: skip
    return _with_memory(plan)


def _with_memory(plan: RunPlan) -> RunPlan:
    """Return the plan with the states of drives that the run before it has kept."""
    if plan.memory is None:
        return plan
    return replace(plan, drives=drives_begun_from(plan.driving, plan.drives, plan.memory))


def _may_wait(plan: RunPlan, declared: Tables, asked: str | None) -> bool:
    """Check whether contacts and limits can be ignored until bodies come close to each other.

    Contacts must be included if the requested method or other elements require them.
    """
    wanted = plan.tau is not None or declared.tendons
    return not (wanted or (plan.method.time_stepping and plan.method.name == asked))


def _on_a_way(
    mech: Mechanism, plan: RunPlan, rate: Rate, o: Options, span: tuple[float, float]
) -> RunPlan:
    """Compute the plan with its method and times, and notices about their fit to forces."""
    asked, duration = o.step or o.usual, span[1] - span[0]
    o = o.changed(step=given_step(mech, plan, o))
    plan, o = _with_method(mech, plan, rate, o)
    plan = _with_times(mech, plan, o, span)
    plan = replace(plan, too_wide=too_wide(plan, rate))
    told = [*hard(mech, plan), *filled(plan), *told_of(plan.kinks)]
    if asked and plan.step is not None and asked > duration * (1 + SOLVED):
        told.append(
            f"step: {asked:g} s is longer than the run, which takes one step of {duration:g} s; "
            "give at most that"
        )
    if not asked and plan.step is not None and (count := int(plan.substeps.sum())) > MANY_STEPS:
        text = f"the default step of {plan.step:.3g} s makes {count:.3g} steps of this run; give a "
        told.append(f"{text}larger step={or_by_error(plan)}")
    return replace(plan, told=tuple(told))


def _what_acts(
    mech: Mechanism,
    o: Options,
    given: Scenario | None,
    span: tuple[float, float],
    extra: tuple[Force, ...],
    contacts: Tables | None,
) -> RunPlan:
    """Create a plan with forces and constraints, but without a method and times.

    Conditions of switches may require `contacts`.
    """
    forces = _forces(mech, o, given, span[0], extra)
    now = active_constraints(mech, given, o.memory)
    switches = switches_of(mech, given, o.switches, span, o.memory is not None)
    active, changes = switch_changes(mech, switches, now, span)
    conditions = conditions_of(mech, switches, contacts, forces)
    plan = RunPlan(
        drives=mech.packed.drives(forces), loads=_loads(mech, forces, conditions), active=active,
        acting=tuple(filter(exerts, forces)), memory=o.memory,
        driving=tuple(f.name for f in forces if isinstance(f, OnJoint)),
        varying=tuple(f for f in forces if f._varies and exerts(f)) + mech.model.rubbing,
        changes=changes, conditions=conditions, ever=ever(active, changes, conditions),
        wrapped=_wrapped(forces), ranged=gated(forces), length=mech.packed.length,
    )  # fmt: skip
    return _with_memory(plan)


def _wrapped(forces: tuple[Force, ...]) -> tuple[BetweenPoints, ...]:
    """Return the forces along paths past obstacles."""
    paths = (f for f in forces if isinstance(f, BetweenPoints))
    return tuple(f for f in paths if any(via.is_obstacle for via in f.via))


def _forces(
    mech: Mechanism, o: Options, given: Scenario | None, begin: float, extra: tuple[Force, ...]
) -> tuple[Force, ...]:
    """Return all forces of a run."""
    forces = (*mech.model.forces, *(given.forces if given else ()), *extra)
    if o.inputs:
        forces = driven(forces, o.inputs, "simulate", begin)
    return begun(forces, begin)


def _loads(
    mech: Mechanism,
    forces: tuple[Force, ...],
    conditions: tuple[ConditionOf, ...],
    bent: bool = False,
    yields: bool = False,
) -> Loads:
    """Return the forces of a run as loads, with the comparisons of its conditions and bends, and
    the gaps of contacts that yield."""
    watched = [text for c in conditions if (text := c.when.holds)]
    exerted = tuple(filter(exerts, forces))
    return mech.packed.loads(exerted, states=True, watched=watched, bent=bent, touching=yields)


def _with_method(mech: Mechanism, plan: RunPlan, rate: Rate, o: Options) -> tuple[RunPlan, Options]:
    """Return (plan with its method, options for that method).

    If the requested method does not support the contacts, "moreau_jean" is used, and the plan
    contains the reason.
    """
    refused, contacts, points = None, plan.contacts, plan.contact_points
    try:
        method, why = method_for(rate, plan, o)
        if contacts is not None and plan.impulses and not method.time_stepping:
            contacts, points = event_driven(mech, contacts, plan.loads)
            why = f"{why}, from event to event of contacts and limits"
    except InputError as problem:
        if not plan.impulses:
            raise
        refused, o = problem, o.changed(rtol=None, atol=0.0, method=STEPPED)
        method, why = method_for(rate, plan, o)
    if method.time_stepping:
        contacts = stepped_tables(mech.packed, contacts, plan.drives)
    plan = replace(
        plan, method=method, contacts=contacts, contact_points=points, refused=refused, why=why,
        project=o.stabilise == "project" or bool(points),
    )  # fmt: skip
    return plan, o


def _with_times(mech: Mechanism, plan: RunPlan, o: Options, span: tuple[float, float]) -> RunPlan:
    """Return the plan with its recorded times, and its steps or tolerance."""
    changes, tolerance = plan.changes, o.tolerance(plan.method, span[1] - span[0])
    width, asked = _times(o, tolerance, span)
    if o.frames is None and o.t_eval is None and mech.model.outputs:
        asked = with_readings(mech.model.outputs, asked, width)
    times, samples = asked, samples_of(o.sample, width, span)
    if changes or len(samples):
        times, changes, samples = with_instants(times, changes, samples)
    substeps, widths = steps_between(times, width) if width else (NO_SUBSTEPS, NO_TIMES)
    if o.max_steps != MOST_CHOSEN and (count := int(substeps.sum())) > o.max_steps:
        text = f"the run has {count} steps of {width:.3g} s; use {count} or more, or omit it"
        raise InputError(Problem("simulate", "max_steps", text))
    _refuse_fast_samples(mech, width, span)
    ends = corners(mech, plan.drives, plan.loads, plan.ever, span[0])
    kinks = kinks_of(mech, plan.ever, *span)
    ends = np.union1d(ends, [kink.t for kink in kinks]) if kinks else ends
    if tolerance is not None and plan.tau is not None:
        ends = np.union1d(ends, plan.tau.ticks(*span))
    return replace(
        plan, times=times, substeps=substeps, width=widths, tolerance=tolerance, changes=changes,
        corners=ends, gains=_gains(o), shown=_shown(times, o, asked),
        kinks=tuple(kinks), samples=samples,
    )  # fmt: skip


def _refuse_fast_samples(mech: Mechanism, width: float, span: tuple[float, float]) -> None:
    """Raise InputError for a control whose samples are closer than the steps of a run, or than
    rounding of its times, which moves each of two samples by 4 EPS t.
    """
    least = 8.0 * EPS * max(map(abs, span))
    for control in mech.model.controls:
        apart = min((own.sample for own in control.own if own.sample), default=np.inf)
        if apart <= least:
            text = f"{apart:g} s is below the resolution of times up to {max(map(abs, span)):g} s; "
            text += f"give more than {least:.1g} s, or leave it out for a value at all times"
            raise InputError(Problem(f"control '{control.name}'", "sample", text))
        if apart < width * (1.0 - SOLVED):
            text = f"{apart:g} s is below the step of the run, {width:g} s; give step={apart:g} "
            text += "or less, or a longer time between samples"
            raise InputError(Problem(f"control '{control.name}'", "sample", text))


def _check_sizes(mech: Mechanism) -> None:
    """Raise InputError for a body whose products of mass and length would overflow."""
    for name in mech.names:
        body = mech.model.body(name)
        inertia = chain.from_iterable(body.inertia)
        sizes = (body.mass, *body.com, *body.link, *body.tip_point, *inertia)
        if (largest := max(map(abs, sizes))) > LARGEST_NUMBER:
            text = f"has a mass, length or inertia of {largest:.3g}, whose products "
            text += f"overflow; keep them below {LARGEST_NUMBER:.0e}, in other units"
            raise InputError(Problem(f"body '{name}'", "", text))


# -- forces, contacts, constraints and state ----------------------------------------------------


def active_constraints(
    mech: Mechanism, given: Scenario | None, memory: Memory | None = None
) -> Ints:
    """Return the indices of the constraints activated by a scenario, or the model's active ones.

    A run that goes on has those of the run before it.
    """
    if memory is not None and "active" in memory:
        wanted = set(memory["active"])
    elif given is None or given.constraints is None:
        return mech.packed.active
    else:
        wanted = set(given.constraints)
    return np.array(
        [i for i, c in enumerate(mech.model.constraints) if c.name in wanted], dtype=np.int64
    )


def touching_contacts(mech: Mechanism, given: Scenario | None) -> tuple[Contact, ...]:
    """Return the active contacts."""
    if given is None or given.contacts is None:
        return tuple(c for c in mech.model.contacts if c.active)
    return tuple(c for c in mech.model.contacts if c.name in given.contacts)


def _idle(mech: Mechanism, given: Scenario | None) -> Idle | None:
    """Return the inactive ground contacts of bodies that have no active ones."""
    act = touching_contacts(mech, given)
    rest = [c for c in mech.model.contacts if c not in act and c.other == GROUND]
    held = {c.body for c in act if c.other == GROUND}
    if EVERY in held:
        return None
    touching = [b.name for b in mech.model.bodies if b.touching]
    contact_of: dict[str, str] = {}
    for c in rest:
        for body in touching if c.body == EVERY else [c.body]:
            if body not in held:
                contact_of.setdefault(body, c.name)
    if not contact_of:
        return None
    numbers = np.array([mech.topology.number(name) for name in contact_of], dtype=np.int64)
    system, normal = mech.packed.system, np.array(mech.model.ground_normal)
    return Idle(contact_of, numbers, normal, (system.bodies_i, system.bodies_f))


def _left_open(contacts: Tables) -> bool:
    """Check whether a soft or penalty contact has no given stiffness or damping."""
    laws = (t.contact for t in contacts.touches if t.contact.law != "complementarity")
    return any(c.stiffness is None or c.damping is None for c in laws)


def at_start_speed(mech: Mechanism, contacts: Tables, start: tuple[Array, Array]) -> Tables:
    """Compute the tables for a run from this state, with open parameters set for its speed."""
    from ..contact.tables import at_speed

    if not np.any(start[1]):
        return contacts
    q, v, still = start[0][None], start[1][None], np.zeros((1, mech.nv))
    motion = bodies_over(mech.packed.system, q, v, still, np.zeros((1, mech.nb, 6)))
    spin, velocity = motion.velocity[0, :, :3], motion.velocity[0, :, 3:]
    reach, shapes = np.zeros(mech.nb + 1), contacts.geometry.shapes
    np.maximum.at(reach, shapes["body"], shapes["reach"])
    speeds = np.linalg.norm(velocity, axis=1) + np.linalg.norm(spin, axis=1) * reach[1:]
    return at_speed(contacts, mech.packed, speeds)


# -- how it is stepped ---------------------------------------------------------------------------


def _times(
    o: Options, tolerance: Tolerance | None, span: tuple[float, float]
) -> tuple[float, Array]:
    """Return the fixed step size [s], or 0 for adaptive steps, and the recorded times."""
    if tolerance is None:
        return o.width, fixed_step_times(*span, o.width, o.frames, o.t_eval)
    frames = FRAMES + 1 if o.frames is None else o.frames
    return 0.0, frame_times(*span, frames, o.t_eval)


def _shown(times: Array, o: Options, asked: Array) -> NDArray[np.bool_] | None:
    """Return a mask of the requested frames, which omits frames added for changes or the start."""
    first = o.t_eval is None or len(asked) == np.size(o.t_eval)
    if first and len(times) == len(asked):
        return None
    shown = np.isin(times, asked)
    shown[0] = first
    return shown


def _gains(o: Options) -> Array:
    """Return Baumgarte's 2α and α² with α = 0.1/h, stable for all methods, gone in 10 steps."""
    if o.stabilise != "baumgarte":
        return NO_GAINS
    alpha = 0.1 / o.width
    return np.array([2 * alpha, alpha * alpha])
