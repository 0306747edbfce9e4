"""simulate: a run from a mechanism, a state and a method, in chunks of compiled frames."""

from __future__ import annotations

import time
from collections.abc import Callable, Sequence
from importlib.metadata import version
from numbers import Integral, Real
from typing import Any

import numpy as np

from ..contact.sites import Site, sites_of
from ..contact.tables import Tables
from ..errors import InputError, Problem, choices
from ..gait.controller import Controller
from ..integrators import DOP853, DOPRI5, METHODS, RADAU5, RK4, Method, method_of
from ..kernels import layout as at
from ..mechanism import Mechanism
from ..mechanism.mechanism import NO_LOADS
from ..result import Result
from ..schema import Contact, Force
from ..system import Array, Drives, Ints, Loads
from .phased_recording import PhasedRecording
from .recording import Recording, error_estimate
from .stepping import FIXED_RTOL, NO_TIMES, Plan, Tolerance, corners, corners_inside
from .stiffness import fastest_rate
from .switching import changes, ever, with_instants

MOST_STEPS = 1_000_000_000  # a day of computing
LEAST_RTOL = 1e-15  # below it errors of a step are rounding
MOST_CHOSEN = 10_000_000  # steps of a method that chooses them, where nothing else is said
FRAMES = 1000  # recorded where nothing else is asked for: more are seldom looked at
STABILISE = ("project", "baumgarte", None)
VERSION = version("pgraph")
KINKED = 2  # order that is left where tables bend inside steps
MANY = 1e5  # radians of the fastest oscillation in a run: more are not worth resolving
NO_FORCES = ((np.zeros((0, at.DRIVE)), np.zeros((0, 2)), 0), NO_LOADS)
ADAPTIVE = tuple(method.name for method in METHODS.values() if method.adaptive)


def simulate(
    mech: Mechanism,
    q: Any = None,
    v: Any = None,
    *,
    t_start: float = 0.0,
    t_end: float | None = None,
    method: str | None = None,
    step: float | None = None,
    rtol: float | None = None,
    atol: float = 0.0,
    max_steps: int = MOST_CHOSEN,
    tau: Any = None,
    frames: int | None = None,
    t_eval: Any = None,
    scenario: str | None = None,
    forces: Sequence[Force] = (),
    stabilise: str | None = "project",
    switches: Any = None,
    progress: Callable[[float], Any] | None = None,
    estimate: bool = True,
) -> Result:
    """Run a mechanism from (q, v), its initial state by default, at `t_start` to `t_end` [s].

    `tau` is an array (nv,) or a function f(t, q, v), called at every stage: a Python one, or one
    compiled by `numba.njit`, which costs a hundredth. `frames` is how many evenly spaced states
    are recorded, `t_eval` their times. `scenario` names a run of the model, whose parts the other
    arguments replace; `forces` act beside its own. `stabilise` keeps constraints: "project",
    "baumgarte" or None.
    `switches` are (t, name of a constraint, True or False): it goes on or off then, between two
    steps and without anything being built anew; frames at that time show what is after it.
    `progress(fraction)` is called now and then; a run stops where it returns False. Without
    `estimate` the second run that estimates the error is left out, and the estimate is nan.

    Methods that choose their steps keep the error of each below `rtol` times the mechanism's own
    scales (a radian, its length, its highest speeds) plus `atol`, by default 1e-8 and 0; `step`
    is then the largest one, and `max_steps` ends a run that takes more. With a `step` and no
    `rtol` every step is as wide as it.

    Rigid contacts and joint limits are stepped over by "moreau_jean", the choice of "auto"; "rk4"
    and "semi_implicit_euler" go from event to event of points on the ground (gait phases), and
    always project.

    Raises InputError for arguments that do not fit. A numerical failure is a Status.
    """
    began = time.perf_counter()
    given = mech.model.scenario(scenario) if scenario is not None else None
    if frames is not None and t_eval is not None:
        raise InputError(Problem("simulate", "frames", "give frames or t_eval, not both"))
    t_start = _start_time(t_start)
    t_end = _end_time(t_start, t_end, given.t_end if given else 1.0)
    span = t_end - t_start
    if stabilise not in STABILISE:
        text = f"must be 'project', 'baumgarte' or None; given {stabilise!r}"
        raise InputError(Problem("simulate", "stabilise", text))
    forces = (*mech.model.forces, *(given.forces if given else ()), *forces)
    drives, loads = mech.drives(forces), mech.loads(forces)
    contacts = mech.contacts(touching_contacts(mech, given))
    active, changing = changes(
        mech, given, switches, active_constraints(mech, given), (t_start, t_end)
    )
    if tau is None and given is not None and given.gait is not None:
        tau = Controller(mech, given.gait)
    q0, v0 = initial_state(mech, given, q, v, tau)
    name = method if method is not None else given.method if given else "auto"
    if method is None and rtol is not None and name not in ADAPTIVE:
        name = "auto"  # a tolerance replaces the scenario's method where that takes none
    impulses = contacts is not None and contacts.rigid
    usual = given.step if given else 1e-3
    stepped = usual if step is None and (given is not None or contacts is not None) else step
    chosen, why, rate, looked = _choice(
        mech, (drives, loads), active, (q0, v0), name, contacts, stepped, rtol, span, callable(tau)
    )
    sites: tuple[Site, ...] = ()
    if contacts and impulses and chosen.name != "moreau_jean":
        contacts, sites = _in_phases(mech, contacts)
        why += ", from event to event of contacts and limits"
    tolerance = _tolerance(chosen, span, step, rtol, atol, max_steps)
    if tolerance is None or tolerance.fixed:
        step = wide = _positive("step", usual if step is None else step)
        asked_for = given_times(t_start, t_end, step, frames, t_eval)
    else:
        wide = 0.0
        asked_for = frame_times(t_start, t_end, FRAMES + 1 if frames is None else frames, t_eval)
    times, changing = with_instants(asked_for, changing) if changing else (asked_for, ())
    substeps, width = steps_between(times, wide)
    bends = corners(mech, drives, loads, ever(active, changing), t_start, t_end)
    kinks = NO_TIMES
    if tolerance is not None:
        tolerance = tolerance._replace(corners=bends)
    elif chosen.order > KINKED:
        kinks = corners_inside(bends, times, width)
    gains = np.zeros(2)
    if stabilise == "baumgarte":
        gains = _gains(usual if step is None else step)
    plan = Plan(
        chosen,
        times,
        substeps,
        width,
        drives,
        loads,
        active,
        contacts,
        gains,
        stabilise == "project" or bool(sites),
        tolerance,
        sites,
        changing,
        kinks,
    )
    record = (PhasedRecording if sites else Recording)(mech, plan, q0, v0, tau)
    record.notices += _stiff(plan, rate) + _bent(plan)
    built, busy = time.perf_counter(), time.thread_time()
    record.run(progress)
    stepped, busy = time.perf_counter(), time.thread_time() - busy
    wanted = estimate and record.status.ok
    error = error_estimate(record, q0, v0, progress) if wanted else np.nan
    timing = {
        "build": built - began - looked,
        "stiffness": looked,
        "step": stepped - built,
        "step_processor": busy,  # without what other programs took
        "estimate": time.perf_counter() - stepped,
    }
    header = {
        "version": VERSION,
        "model_hash": mech.model.hash,
        "scenario": scenario,
        "method": chosen.name,
        "why": why,
        "step": _step_of(plan),
        "rtol": None if tolerance is None or tolerance.fixed else tolerance.rtol,
        "t_start": t_start,
        "t_end": t_end,
        "stabilise": stabilise,
    }
    shown = np.isin(times, asked_for) if changing else np.ones(len(times), dtype=bool)
    shown[0] = t_eval is None or len(asked_for) == np.size(t_eval)
    return record.result(error, timing, header, shown)


def _choice(
    mech: Mechanism,
    acting: tuple[Drives, Loads],
    active: Ints,
    start: tuple[Array, Array],
    name: str,
    contacts: Tables | None,
    step: float | None,
    rtol: float | None,
    span: float,
    unknown: bool,
) -> tuple[Method, str, float, float]:
    """(method, why, fastest rate [1/s], time spent on it [s]) for the asked name or "auto".

    The rate is 0 where nothing needs it, or where torques are `unknown`: given by a function.
    """
    impulses, asked = contacts is not None and contacts.rigid, None
    if name != "auto" or impulses:
        known = "moreau_jean" if name == "auto" else name
        asked = method_of(known, impulses=impulses, touching=contacts is not None)
    rate, looking = 0.0, time.perf_counter()
    if not unknown and (asked is None or not asked.implicit):
        rate = fastest_rate(mech, acting, active, *start)
    looked = time.perf_counter() - looking
    if asked is not None:
        impacts = "moreau_jean: the scene has rigid contacts or joint limits"
        return asked, impacts if name == "auto" else f"{name}: as asked", rate, looked
    rest = fastest_rate(mech, NO_FORCES, active, *start) if rate * span > MANY else rate
    return *automatic(step, rtol, rate, rest, span), rate, looked


def automatic(
    step: float | None, rtol: float | None, rate: float, rest: float, t_end: float
) -> tuple[Method, str]:
    """The method that suits, and why; `rate` is the fastest one, `rest` that without springs."""
    if step is not None and rtol is None:
        if rate * step > RK4.limit:
            return (
                RADAU5,
                f"radau5: the fastest rate, {rate:.3g}/s, times the step is too much for rk4",
            )
        return RK4, "rk4: the most accurate of the methods for smooth motion at a fixed step"
    if rate * t_end > MANY and rate > 30.0 * rest:
        return (
            RADAU5,
            f"radau5: springs or dampers make rates of {rate:.3g}/s, the rest {rest:.3g}/s",
        )
    if rtol is not None and rtol > 1e-5:
        return DOPRI5, "dopri5: smooth motion, to a loose tolerance"
    return DOP853, "dop853: smooth motion, to a tight tolerance, at steps of its own choice"


def _stiff(plan: Plan, rate: float) -> list[str]:
    """A notice where given steps are too wide for an explicit method."""
    step = _step_of(plan)
    limit = plan.method.limit
    if step is None or limit == 0.0 or rate * step <= limit:
        return []
    x = rate * step
    return [f"stiff: lambda*dt = {x:.3g}, explicit limit dt < {limit / rate:.3g} s, try radau5"]


def _bent(plan: Plan) -> list[str]:
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


def _tolerance(
    chosen: Method, t_end: float, step: Any, rtol: Any, atol: Any, max_steps: Any
) -> Tolerance | None:
    """How `chosen` chooses its steps; None where they are given. Raises InputError."""
    if rtol is not None and not chosen.adaptive:
        text = f"{chosen.name} takes a step, not a tolerance; for one choose {choices(ADAPTIVE)}"
        raise InputError(Problem("simulate", "rtol", text))
    if rtol is not None:
        rtol = _positive("rtol", rtol, unit="")
        if not LEAST_RTOL <= rtol <= 0.1:
            text = f"must lie within {LEAST_RTOL:g}, rounding, and 0.1; given {rtol:g}"
            raise InputError(Problem("simulate", "rtol", text))
    if atol != 0.0:
        atol = _positive("atol", atol, unit="")
    if not isinstance(max_steps, Integral) or isinstance(max_steps, bool) or max_steps < 1:
        text = f"must be a whole number >= 1; given {max_steps!r}"
        raise InputError(Problem("simulate", "max_steps", text))
    if not chosen.adaptive:
        return None
    widest = t_end if step is None else _positive("step", step)
    fixed = step is not None and rtol is None
    usual = FIXED_RTOL if fixed else 1e-8
    return Tolerance(
        usual if rtol is None else rtol, float(atol), widest, int(max_steps), np.zeros(0), fixed
    )


def _step_of(plan: Plan) -> float | None:
    """Width of the steps [s]; None where the method chooses them."""
    if plan.tolerance is None:
        return float(np.max(plan.width, initial=0.0))
    return plan.tolerance.widest if plan.tolerance.fixed else None


def schedule(
    t_start: float, t_end: float, step: float, frames: Any, t_eval: Any
) -> tuple[Array, Ints, Array]:
    """(times, substeps, width): when to record, and how many steps of what width in between."""
    times = given_times(t_start, t_end, step, frames, t_eval)
    return times, *steps_between(times, step)


def given_times(t_start: float, t_end: float, step: float, frames: Any, t_eval: Any) -> Array:
    """When to record a run whose steps are given: at most FRAMES times where nothing is said.

    It begins at `t_start`; where `t_eval` does not, the first frame is not for the caller.
    """
    span = t_end - t_start
    if span / step > MOST_STEPS:
        text = f"{step:g} s makes {span / step:.3g} steps; give {span / MOST_STEPS:g} s or more"
        raise InputError(Problem("simulate", "step", text))
    if frames is None:
        steps = max(int(np.ceil(span / step - 1e-9)), 1)
        frames = steps // -(-steps // FRAMES) + 1 if t_eval is None else None
    return frame_times(t_start, t_end, frames, t_eval)


def steps_between(times: Array, step: float) -> tuple[Ints, Array]:
    """(substeps, width) between recorded times: how many steps, of what width."""
    if step == 0.0:  # the method chooses them
        return np.zeros(0, dtype=np.int64), np.zeros(0)
    apart = np.diff(times)
    substeps = np.maximum(np.ceil(apart / step - 1e-9), 1).astype(np.int64)
    return substeps, apart / substeps


def frame_times(t_start: float, t_end: float, frames: Any, t_eval: Any) -> Array:
    """When to record: `frames` times evenly from `t_start` to `t_end`, or those of `t_eval`."""
    if t_eval is not None:
        return _grid(t_eval, t_start, t_end)
    if not isinstance(frames, Integral) or isinstance(frames, bool) or frames < 2:
        text = f"must be a whole number >= 2; given {frames!r}"
        raise InputError(Problem("simulate", "frames", text))
    return np.linspace(t_start, t_end, int(frames))


def _grid(t_eval: Any, t_start: float, t_end: float) -> Array:
    try:
        times = np.array(t_eval, dtype=float)
    except (TypeError, ValueError):
        times = np.array(np.nan)
    if times.ndim != 1 or len(times) == 0 or not np.isfinite(times).all():
        raise InputError(Problem("simulate", "t_eval", "must be a list of finite times [s]"))
    if np.any(np.diff(times) <= 0) or times[0] < t_start or times[-1] > t_end + 1e-12 * abs(t_end):
        text = f"must ascend within {t_start:g} to t_end = {t_end:g} s"
        raise InputError(Problem("simulate", "t_eval", text))
    return times if times[0] == t_start else np.concatenate(([t_start], times))


def _start_time(value: Any) -> float:
    number = float(value) if isinstance(value, Real) and not isinstance(value, bool) else np.nan
    if not np.isfinite(number):
        text = f"must be a finite number [s]; given {value!r}"
        raise InputError(Problem("simulate", "t_start", text))
    return number


def _end_time(t_start: float, value: Any, duration: float) -> float:
    """The end of a run: as given, else `duration` after the start. Raises InputError."""
    if t_start == 0.0:
        return _positive("t_end", duration if value is None else value)
    number = t_start + duration if value is None else _start_time(value)
    if not number > t_start:
        text = f"must be a finite number > t_start = {t_start:g} [s]; given {value!r}"
        raise InputError(Problem("simulate", "t_end", text))
    return number


def _positive(field: str, value: Any, *, unit: str = " [s]") -> float:
    number = float(value) if isinstance(value, Real) and not isinstance(value, bool) else np.nan
    if not 0 < number < np.inf:
        text = f"must be a finite number > 0{unit}; given {value!r}"
        raise InputError(Problem("simulate", field, text))
    return number


def _gains(step: float) -> Array:
    """Baumgarte's 2α and α² with α = 0.1/h: stable for every method here, gone in 10 steps."""
    alpha = 0.1 / step
    return np.array([2 * alpha, alpha * alpha])


def active_constraints(mech: Mechanism, given: Any) -> Ints:
    if given is None or given.constraints is None:
        return mech.active
    wanted = set(given.constraints)
    return np.array(
        [i for i, c in enumerate(mech.model.constraints) if c.name in wanted], dtype=np.int64
    )


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


def touching_contacts(mech: Mechanism, given: Any) -> tuple[Contact, ...]:
    """The contacts that act."""
    if given is None or given.contacts is None:
        return tuple(c for c in mech.model.contacts if c.active)
    return tuple(c for c in mech.model.contacts if c.name in given.contacts)


def initial_state(
    mech: Mechanism, given: Any, q: Any, v: Any, tau: Any = None
) -> tuple[Array, Array]:
    """Initial state: the arguments, else the scenario's, else a gait's, else the model's."""
    if tau is None and given is not None and given.gait is not None:
        tau = Controller(mech, given.gait)
    known = q is not None and v is not None
    q0, v0 = tau.start() if isinstance(tau, Controller) and not known else mech.home()
    if given is not None:
        for state, entries, column in ((q0, given.q, at.QI), (v0, given.v, at.VI)):
            for name, values in entries.items():
                number = mech.topology.number(name)
                row = int(np.flatnonzero(mech.system.body_of_row == number)[0])
                first = mech.system.rows[row, column]
                state[first : first + len(values)] = values
    q0 = q0 if q is None else mech.position(q).copy()
    v0 = v0 if v is None else mech.finite("v", v, mech.nv).copy()
    return q0, v0
