"""The initial state and the torques of a run, given by the call and the scenario."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from typing import TYPE_CHECKING, Any

import numpy as np

from ..dynamics.arguments import (
    by_name,
    fill,
    finite,
    names_in,
    of_joints,
    of_state,
    position,
    rows_by_name,
    stretched,
)
from ..dynamics.ways import there
from ..errors import InputError, Problem, choices, nearest_first, shown
from ..forces import BetweenPoints, Force, OnJoint, legs_of
from ..mechanism import Mechanism
from ..model import Control, Scenario
from ..packing import Array
from ..portable import array_of
from ..tolerances import ROUNDING
from .options import Options

if TYPE_CHECKING:
    from ..gait.controller import Controller


def controller_of(mech: Mechanism, given: Scenario | None) -> Controller | None:
    """Return the controller of a scenario's gait, or None if it has no gait."""
    if given is None or given.gait is None:
        return None
    from ..gait.controller import Controller

    return Controller(mech, given.gait)


def is_controller(tau: Any) -> bool:
    """Check whether `tau` is a gait controller, which has a start and a clock."""
    return hasattr(tau, "ticks") and hasattr(tau, "start")


def initial_state(
    mech: Mechanism, given: Scenario | None, q: Any, v: Any, tau: Any = None, t: float = 0.0
) -> tuple[Array, Array]:
    """Return the initial state from the arguments, or the scenario, a gait or the model."""
    tau = controller_of(mech, given) if tau is None else tau
    known = q is not None and v is not None
    q0, v0 = tau.start() if is_controller(tau) and not known else mech.home()
    if given is not None:
        for state, entries, kind in ((q0, given.q, "q"), (v0, given.v, "v")):
            fill(mech, state, entries, kind)
    return with_state(mech, (q0, v0), q, v, t)


def by_names(
    mech: Mechanism, scenario: str | None, q: Any, v: Any, tau: Any = None
) -> tuple[Any, Any]:
    """Return (q, v), converting {body: value or values} to an array based on the initial state.

    Raises InputError for names without a joint that moves, for other counts of values, and for
    lists in which the order of the numbers is not the order of the bodies.
    """
    if isinstance(q, (int, float)):
        text = f"must be {mech.nq} numbers in a list, got {q}; a duration is t_end={q}"
        raise InputError(Problem("simulate", "q", text))
    if isinstance(q, tuple) and len(q) == 2 != mech.nq:  # SciPy's order of arguments
        text = f"must be {mech.nq} numbers, got {shown(q)}; times are given by t_span={shown(q)}"
        raise InputError(Problem("simulate", "q", text))
    if max(getattr(q, "ndim", 1), getattr(v, "ndim", 1)) == 2:
        text = (
            "has a row for each of several runs: runs = pg.simulate_batch(model, q, v, t_end=...)"
        )
        name = "q" if getattr(q, "ndim", 1) == 2 else "v"
        raise InputError(Problem("simulate", name, f"{text}; a pg.BatchStepper steps them at once"))
    _in_order(mech, q=q, v=v)
    named = [names_in(x) if x is not None else None for x in (q, v)]
    if named == [None, None]:
        return q, v
    given = mech.model.scenario(scenario) if scenario is not None else None
    q0, v0 = initial_state(mech, given, None, None, tau)
    start = q0[: mech.nq], v0[: mech.nv]  # without the states of controls
    return by_name(mech, "q", q, start[0]), by_name(mech, "v", v, start[1])


def rows_of(mech: Mechanism, q: Any, v: Any) -> list[tuple[Any, Any]]:
    """Return (q, v) of each run, from an array with a row for each or one row for all.

    Raises InputError.
    """
    many = {"q": (q, mech.nq), "v": (v, mech.nv)}
    rows: dict[str, Any] = {}
    for name, (given, width) in many.items():
        if given is None:
            continue
        if (entries := names_in(given)) is not None:
            rows[name] = rows_by_name(mech, name, entries)
            continue
        array = array_of(given)
        array = array[None] if array.ndim == 1 else array
        if array.ndim != 2 or array.shape[1] != width:
            text = f"must have a row of {width} numbers for each run, got {array.shape}"
            text += of_joints(mech.packed, name)
            raise InputError(Problem("simulate_batch", name, text))
        rows[name] = array
    number = max(map(len, rows.values()), default=1)
    for name, found in rows.items():
        if len(found) not in (1, number):
            text = f"must have {number} rows, as the other, or one for all, got {len(found)}"
            raise InputError(Problem("simulate_batch", name, text))
    of = lambda name, i: rows[name][i % len(rows[name])] if name in rows else None  # noqa: E731
    return [(of("q", i), of("v", i)) for i in range(number)]


def given_states(mech: Mechanism, states: Any) -> Array:
    """Return the given states of controls (nx,), nan for those that are not given.

    Raises InputError for unknown controls and other counts of values.
    """
    own = [control.name for control, _, _ in mech.model.states]
    entries = names_in(states)
    if entries is None:
        return finite("states", states, len(own))
    found = np.full(len(own), np.nan)
    for name, values in entries.items():
        places = [i for i, known in enumerate(own) if known == name]
        if not places:
            do = f"choose from {choices(nearest_first(str(name), own))}" if own else "it has none"
            raise InputError(Problem("states", "", f"no control of the model is {name!r}; {do}"))
        values = [values] if np.isscalar(values) else values
        found[places] = finite(f"states['{name}']", values, len(places))
    return found


def notices_of_start(mech: Mechanism, o: Options, given: tuple[Any, ...], at: Array) -> list[str]:
    """Return notices about the start of a run at the position `at`, with the arguments `given`:
    q, v and the states of controls."""
    (q, v, states), model = given, mech.packed.model
    found = stretched(mech.packed, at) if q is not None else []
    if model.linked:
        found += placed_twice(mech, at)
    own = model.scenario(o.scenario).forces if o.scenario is not None else ()
    if forces := (*model.forces, *own, *o.forces):
        found += directionless(mech, forces, at)
    later = states is not None or (o.t_start != 0.0 and (q is not None or v is not None))
    return found + begun_anew(mech, o) if later and o.memory is None else found


def unread(model: Any) -> list[str]:
    """Return a notice about sensors with latency in a run that goes on, whose first samples are of
    the time before it.
    """
    late = [o.name for o in model.outputs if o.imperfect is not None and o.imperfect.latency]
    if not late:
        return []
    text = f"the first samples of {choices(late)} are of the time before this run, and take its "
    return [text + "first value; pg.joined has those of both runs"]


def kept_parts(mech: Mechanism, scenario: str | None, extra: Sequence[Force]) -> Iterator[str]:
    """Yield the parts of a model that remember more than a state."""
    given = mech.model.scenario(scenario) if scenario is not None else None
    for f in (*mech.model.forces, *(given.forces if given else ()), *extra):
        if isinstance(f, OnJoint) and f.has_state:
            yield f"the state of '{f.name}'"
    for contact in mech.model.contacts:
        if contact.law == "penalty":
            yield f"the friction springs of '{contact.name}'"
    switched = {s.constraint for s in (given.switches if given else ())}
    for c in mech.model.constraints:
        if not c.active or c.name in switched:
            yield f"the switches of '{c.name}'"


def begun_anew(mech: Mechanism, o: Options) -> list[str]:
    """Return a notice about what a run that begins later has not kept from a run before it."""
    parts = [*kept_parts(mech, o.scenario, o.forces)]
    if not parts:
        return []
    text = f"the run begins at t = {float(o.t_start):g} s without what a run before it has kept: "
    return [f"{text}{choices(parts)}; simulate(model, start=run) goes on with all of it"]


def refuse_interval(q: Any, v: Any, t_end: float | None) -> None:
    """Raise InputError if q and v look like the interval and the state of SciPy's solve_ivp."""
    unended = isinstance(q, tuple) and v is not None and t_end is None
    if unended and len(q) == 2 and q[0] == 0 < q[1]:
        span = f"({q[0]:g}, {q[1]:g})"
        text = f"{span} is a time span or two positions: write t_span={span} and q=..., v=..., or "
        text += f"for positions the list {shown([*q])}"
        raise InputError(Problem("simulate", "q", text))


def placed_twice(mech: Mechanism, q: Array) -> list[str]:
    """Return a notice for each free body whose position is given by both its link and q (nq,)."""
    found: list[str] = []
    for body in mech.packed.model.linked:
        place = q[mech.joints[body.name].q][:3]
        if np.abs(place - body.link).max() <= ROUNDING * np.abs(body.link).max():
            text = f"the place {shown(body.link)} is given by its link and again by q, which "
            found.append(f"'{body.name}': {text}adds to it; leave one of them out")
    return found


def directionless(mech: Mechanism, forces: Sequence[Force], q: Array) -> list[str]:
    """Return a notice for each spring and strut with a span whose ends coincide at the start.

    A spring without a rest length does not need a direction, because its force is proportional to
    the distance vector.
    """
    found: list[str] = []
    for f in forces:
        if isinstance(f, BetweenPoints) and _coincide(mech, f, q[: mech.nq]):
            rest = getattr(f, "rest", np.inf)
            if f.via:
                text = (
                    "two points of its path coincide at the start, so their span has no direction"
                )
            elif rest != 0.0 and not (rest is None and _coincide(mech, f, mech.home()[0])):
                text = "its ends coincide at the start, so it has no direction and exerts no force"
            else:
                continue
            found.append(f"{f.kind} '{f.name}': {text}; move one of them")
    return found


def _coincide(mech: Mechanism, f: BetweenPoints, q: Array) -> bool:
    """Check whether the length of one of a force's spans is not more than rounding."""

    def at(name: str, point: Any) -> Array:
        place, turn = mech.pose(q, name)
        return place + turn @ np.asarray(point)

    f = there(mech.packed, f, q)
    legs = legs_of(f, mech.model.body(f.body))
    ends = ((at(*one), at(*two)) for one, past, two in legs if not past)
    return any(
        np.abs(a - b).max() <= ROUNDING * max(np.abs(a).max(), np.abs(b).max()) for a, b in ends
    )


def torques_or_drives(
    mech: Mechanism, forces: Sequence[Force], tau: Any
) -> tuple[Mechanism, Sequence[Force], Any]:
    """Return the mechanism, the forces and the torques of a run with `tau`.

    Drives passed as torques, such as a servo or those of a feedback, are forces. Those with a name
    of the model replace the model's own. Raises InputError.
    """
    given = getattr(tau, "drives", tau)
    given = given if isinstance(given, (list, tuple)) else (given,)
    if not given or not all(isinstance(x, Force) for x in given):
        return mech, forces, torques_by_names(mech, tau)
    own = {f.name: f for f in mech.model.forces}
    new = {f.name: f for f in given}
    if not own.keys().isdisjoint(new):
        kept = tuple(new.get(name, f) for name, f in own.items())
        mech = Mechanism(mech.model.replace(forces=kept))
    return mech, (*forces, *(f for f in given if f.name not in own)), None


def torques_by_names(mech: Mechanism, tau: Any) -> Any:
    """Return `tau`, converting {body: value or values} to an array with zeros elsewhere.

    Raises InputError.
    """
    _in_order(mech, tau=tau)
    entries = None if callable(tau) else names_in(tau)
    given = entries.values() if entries else tau if isinstance(tau, (list, tuple)) else ()
    if any(map(callable, given)):
        return _of_functions(mech, tau)
    if isinstance(tau, Control):
        raise InputError(Problem("simulate", "tau", _of_control(mech, tau)))
    return by_name(mech, "tau", tau) if entries is not None else tau


def _of_functions(mech: Mechanism, tau: Any) -> Any:
    """Return a function of (t, q, v) for torques that include functions."""
    named = names_in(tau)
    given: dict[Any, Any] = dict(named if named is not None else enumerate(tau))
    given = {name: of_state(x) if callable(x) else x for name, x in given.items()}

    def torques(t: float, q: Array, v: Array) -> Array:
        now = {name: x(t, q, v) if callable(x) else x for name, x in given.items()}
        if named is None:
            return finite("tau", list(now.values()), mech.nv, of=mech.packed)
        found = np.zeros(mech.nv)
        fill(mech, found, now, "tau")
        return found

    return torques


def _of_control(mech: Mechanism, control: Control) -> str:
    """Return the code that a user would write to apply a control."""
    body = next(iter(mech.joints), "arm")
    return (
        f"a {type(control).__name__} has a value and acts on no joint; to apply it to '{body}': "
        f"model = model.add(control).add(pg.Motor(body={body!r}, torque='=x.{control.name}'))"
    )


def _in_order(mech: Mechanism, **given: Any) -> None:
    """Refuse lists if the model numbers its joints in another order than its bodies."""
    typed = [name for name, value in given.items() if isinstance(value, (list, tuple)) and value]
    if not typed:
        return
    listed = [body.name for body in mech.model.bodies if body.name in mech.joints]
    numbered = list(mech.joints)
    if listed != numbered:
        what = f"a list counts joints as they are numbered, {', '.join(numbered[:6])}"
        more = ", ..." if len(numbered) > 6 else ""
        reason = f"{what}{more}, and this model lists its bodies otherwise"
        cure = "give {body: value}, or a numpy array to use that order"
        raise InputError(Problem("state", typed[0], f"{reason}; {cure}"))


def with_state(
    mech: Mechanism, start: tuple[Array, Array], q: Any, v: Any, t: float
) -> tuple[Array, Array]:
    """Return copies of the given q and v, or of those in `start` if they are None.

    The control states at time t follow those of the bodies.
    """
    if q is not None:
        q = position(mech.packed, by_name(mech, "q", q, start[0][: mech.nq]))
    if v is not None:
        v = by_name(mech, "v", v, start[1][: mech.nv])
        v = finite("v", v, mech.nv, of=mech.packed)
    q, v = start[0] if q is None else q, start[1] if v is None else v
    return mech.packed.with_states(t, q.copy(), v.copy())
