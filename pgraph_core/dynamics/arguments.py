"""Convert arguments of public functions to the contiguous float64 arrays required by kernels."""

from __future__ import annotations

import ctypes
import functools
import inspect
import math
from collections.abc import Callable, Mapping
from numbers import Integral, Real
from typing import Any, cast

import numpy as np

from ..engine.compiler.address import address_of_function
from ..engine.compiler.jit import made_by_numba
from ..engine.motions import facts
from ..errors import Called, InputError, Problem, choices, nearest_first, shown, to_read
from ..fields import is_number
from ..joints import in_parts, joined
from ..packing import Array
from ..packing.packed import Packed
from ..portable import Unportable, array_of
from .remembering import Calls

NAMELESS = {np.ndarray, list, tuple, str, float, int, bool, type(None)}  # no names in them
MOST_JOINTS = 8  # joints that a message about an array lists
OF_STATES = ("v", "vdot", "tau")  # arguments that may have a row for each of many states


def names_in(value: Any) -> Mapping[str, Any] | None:
    """Return names and values as a mapping, from a dict or a pandas row for example, else None."""
    if isinstance(value, Mapping):
        return value
    if not callable(getattr(value, "keys", None)):
        return None
    named: list[Any] = list(value.keys())
    return {x: value[x] for x in named} if any(isinstance(x, str) for x in named) else None


def numbers_in(given: Any, *shapes: tuple[int, ...]) -> Array | None:
    """Copy numbers into an array, with nan for masked entries.

    None for text, truth values, complex numbers and other objects. Arrays that do not have one of
    the given shapes are not copied.
    """
    try:
        found = array_of(given)
    except (TypeError, ValueError):
        return None
    if found.dtype.kind not in "iuf" and found.size:
        return None
    if shapes and found.shape not in shapes:
        return found
    found = np.array(found, dtype=np.float64, order="C")
    if isinstance(given, np.ma.MaskedArray):
        found[np.ma.getmaskarray(given)] = np.nan
    return found


def numbers(name: str, value: Any, *shape: int, of: Packed | None = None) -> Array:
    """Return an array with this shape, which may contain nan or inf. Raises InputError.

    If it has an entry for each coordinate `of` a model, the error lists the joints in order.
    """
    if type(value) is np.ndarray and value.dtype == np.float64 and value.shape == shape:
        flags = value.flags
        if flags.c_contiguous and flags.writeable:
            return value
    if names_in(value) is not None:
        text = "must be a list of numbers in the order of the coordinates (mech.names), not by "
        raise InputError(Problem(name, "", f"{text}names, got {shown(value)}"))
    array = numbers_in(value, shape)
    if array is None:
        text = f"must be numbers, got {shown(value)}"
        if isinstance(value, tuple) and any(np.ndim(x) for x in value):
            several = ", ".join(type(x).__name__ for x in value)
            text = f"must be one array of numbers, got {len(value)} results ({several}); take one"
            text += f": {name}, *rest = ..."
        raise InputError(Problem(name, "", text))
    if array.shape != shape:
        many = array.shape[1:] == shape and len(array) > 1
        text = "; many states are an array for methods of a Mechanism, a pg.BatchStepper for runs"
        do = text if many else of_joints(of, name) if of is not None else ""
        raise InputError(Problem(name, "", f"must have shape {shape}, got {array.shape}{do}"))
    return array


def of_joints(packed: Packed, name: str) -> str:
    """Return '; the numbers are those of base (6), arm; ...' about q, v, vdot or tau."""
    spans = {x: joint.q if name == "q" else joint.v for x, joint in packed.joints.items()}
    sizes = {x: span.stop - span.start for x, span in spans.items()}
    listed = choices((x if n == 1 else f"{x} ({n})" for x, n in sizes.items()), MOST_JOINTS)
    known = f"; the numbers are those of {listed}; by name: {name}={{{next(iter(sizes), '')!r}: "
    return f"{known}...}}" if sizes else "; no joint of the model moves"


def finite(name: str, value: Any, *shape: int, of: Packed | None = None) -> Array:
    """Return an array with this shape and finite entries only, as `numbers`. Raises InputError."""
    array = numbers(name, value, *shape, of=of)
    good = np.isfinite(array)
    if np.count_nonzero(good) < good.size:
        bad = int(np.argmin(good))
        text = f"must be finite; entry {bad} is {array.flat[bad]}"
        raise InputError(Problem(name, "", text))
    return array


def position(packed: Packed, q: Any) -> Array:
    """Return q (nq,), finite and with nonzero quaternions, which need not be normalised.

    Raises InputError.
    """
    q = finite("q", q, packed.nq, of=packed)
    for k, i, _ in packed.quaternions:
        length = math.hypot(*q[i : i + 4].tolist())
        if not 1e-3 < length < 1e3:
            text = f"the quaternion [w, x, y, z] of '{packed.body_of(k)}' at q[{i}] must have "
            raise InputError(Problem("q", "", f"{text}length 1; its length is {length:.6g}"))
    return q


def stretched(packed: Packed, q: Array) -> list[str]:
    """Return a warning for each quaternion in q (nq,) that does not have unit length."""
    found = list[str]()
    for k, i, _ in packed.quaternions:
        length = math.hypot(*q[i : i + 4].tolist())
        if abs(length - 1.0) > 1e-3:
            text = f"the quaternion at q[{i}] has length {length:.6g}, which has no effect"
            found.append(f"at the start '{packed.body_of(k)}': {text}")
    return found


def positions(packed: Packed, q: Array) -> None:
    """Raise InputError if a row of q (n, nq) does not satisfy the checks in `position`."""
    for _, i, _ in packed.quaternions:
        lengths = np.linalg.norm(q[:, i : i + 4], axis=1)
        for row in q[~((lengths > 1e-3) & (lengths < 1e3))]:
            position(packed, row)


def _is_free(joint: Any) -> bool:
    """Check whether a joint takes up all motions of its body, so that it transmits none."""
    return not facts("transmits")[list(joint.kinds)].all()


def fill(mech: Any, state: Array, entries: Mapping[str, Any], kind: str) -> None:
    """Write the values for bodies into q or v."""
    joints = mech.joints
    for name, values in entries.items():
        if name not in joints:
            near = choices(nearest_first(str(name), joints))
            text = f"{name!r} is not a body with a moving joint; choose from {near}"
            body, _, entry = str(name).rpartition(".")
            if body in joints and entry.isdecimal():  # a column of a run
                text = f"{name!r} is one entry of {body!r}, whose numbers are given together: "
                text += f"{kind}={{{body!r}: [...]}}"
                if _is_free(joints[body]):
                    text += f", or some of them: {in_parts(kind, body)}"
            if any(f.name == name for f in mech.model.forces):
                text = f"{name!r} is a force; give inputs={{{name!r}: ...}}"
            raise InputError(Problem(kind, "", text))
        place = getattr(joints[name], "q" if kind == "q" else "v")
        free, label = _is_free(joints[name]), f"{kind}[{name!r}]"
        values, problem = joined(kind, values, state[place].tolist(), free)
        if problem:
            raise InputError(Problem(label, "", problem))
        values = [values] if np.isscalar(values) else values
        state[place] = numbers(label, values, place.stop - place.start)


def by_name(mech: Any, kind: str, given: Any, rest: Array | None = None) -> Any:
    """Return q, v, vdot or tau as numbers if it is given by body name, else unchanged.

    Other joints have their entries of `rest`, by default the initial q, and 0 of v, vdot and tau.
    Raises InputError.
    """
    entries = None if given is None or type(given) is np.ndarray else names_in(given)
    if entries is None:
        return given
    found = (mech.home()[0] if kind == "q" else np.zeros(mech.nv)) if rest is None else rest.copy()
    fill(mech, found, entries, kind)
    return found


def rows_by_name(mech: Any, kind: str, entries: Mapping[str, Any]) -> list[Mapping[str, Any]]:
    """Return the entries of each state, if some joints have a value for each of several states."""
    many = {name: x for name, x in entries.items() if np.ndim(x) > _dimensions(mech, kind, name)}
    if len({len(x) for x in many.values()}) != 1:
        return [entries]
    return [{**entries, **dict(zip(many, each))} for each in zip(*many.values())]


def _dimensions(mech: Any, kind: str, name: Any) -> int:
    """Return the dimensions of the value of a joint in one state, 2 without such a joint."""
    if name not in mech.joints:
        return 2
    place = mech.joints[name].q if kind == "q" else mech.joints[name].v
    return int(place.stop > place.start + 1)


def named_in(given: Mapping[str, Any]) -> dict[str, Mapping[str, Any]]:
    """Return the arguments q, v, vdot and tau that are given by body name."""
    found = {k: names_in(x) for k, x in given.items() if k in ("q", *OF_STATES)}
    return {k: x for k, x in found.items() if x is not None}


def for_each_state(method: Called) -> Called:
    """Let a method of a state q (nq,) take many states q (n, nq), and give a row of results each.

    The arguments v, vdot and tau have a row for each state, or are the same for all. Each may be a
    dictionary by body name.
    """
    names = list(inspect.signature(method).parameters)[2:]

    @functools.wraps(method)
    def call(self: Any, q: Any, *args: Any, **named: Any) -> Any:
        if not NAMELESS.issuperset(map(type, (q, *args, *named.values()))):
            given = {**dict(zip(names, args)), **named, "q": q}
            if by_name := named_in(given):
                return call(self, **{**given, **self._by_names(by_name, given)})
        after_q = args[0] if args and names[0] in OF_STATES else None
        if isinstance(q, str) or isinstance(after_q, str):
            field, given = ("q", q) if isinstance(q, str) else (names[0], after_q)
            text = f"must be numbers, got {shown(given)}; it takes (q, {', '.join(names)})"
            raise InputError(Problem(f"Mechanism.{method.__name__}", field, text))
        if getattr(q, "ndim", 1) != 2 or not hasattr(q, "__array__") or not len(q):
            return method(self, q, *args, **named)
        states, given = np.asarray(q), {**dict(zip(names, args)), **named}
        shapes = {k: getattr(given.get(k), "shape", ()) for k in OF_STATES}
        rows = [k for k, shape in shapes.items() if shape[:-1] == states.shape[:1]]
        found: list[Any] = []
        for i, state in enumerate(states):
            own = {k: np.asarray(given[k])[i] for k in rows}
            found.append(method(self, state, **{**given, **own}))
        return _stacked(found)

    return cast("Called", call)


def _stacked(results: list[Any]) -> Any:
    """Return results for many states as arrays with a row for each state."""
    first = results[0]
    if isinstance(first, dict):
        return {name: _stacked([each[name] for each in results]) for name in first}
    if isinstance(first, tuple):
        columns = map(_stacked, map(list, zip(*results)))
        return type(first)(*columns) if hasattr(first, "_fields") else tuple(columns)
    return np.array(results)


def whole_number(call: str, field: str, value: Any, least: int, most: float = math.inf) -> int:
    """Return an integer within these bounds. Raises InputError, which names the call."""
    if not is_number(value, Integral) or not least <= int(value) <= most:
        text = f"must be a whole number >= {least}"
        text += "" if most == math.inf else f" and <= {most}"
        raise InputError(Problem(call, field, f"{text}, got {shown(value)}"))
    return int(value)


def wrong_type(where: str, field: str, wanted: str, value: Any, more: str = "") -> InputError:
    """Return the error for an argument with the wrong type, with a hint for model paths."""
    text = f"must be {wanted}, got {shown(value)}"
    text += to_read(value) if "pg.Model" in wanted else ""
    return InputError(Problem(where, field, text + more))


STATE = {  # names of parameters, by what they mean
    "t": "t", "time": "t", "q": "q", "qpos": "q", "v": "v", "qd": "v", "dq": "v", "qdot": "v",
}  # fmt: skip


def of_state(function: Callable[..., Any]) -> Callable[[float, Array, Array], Any]:
    """Convert a function of time or state to a function of (t, q, v).

    Arguments named t, q and v (or qd, dq, qdot) are passed by name. Otherwise they are passed by
    position, as (t, q, v), or as (t, x) with x = [q, v] as in SciPy.
    """
    try:
        parameters = inspect.signature(function)
    except ValueError:
        return function  # a builtin function
    needed = [x.name for x in parameters.parameters.values() if x.default is x.empty]
    meant = [STATE.get(name, "") for name in needed]
    if set(meant) <= {"t", "q", "v"} and len(meant) == len(set(meant)) and meant != ["t", "q", "v"]:
        place = ["tqv".index(name) for name in meant]
        return lambda *state: function(*(state[i] for i in place))
    if not _takes(parameters, 3) and _takes(parameters, 2):
        return lambda t, q, v: function(t, np.concatenate((q, v)))
    return function


def _takes(parameters: inspect.Signature, count: int) -> bool:
    try:
        parameters.bind(*range(count))
    except TypeError:
        return False
    return True


def has_state(function: Any) -> bool:
    """Check whether a torque function has a state of its own, which its method restart() resets."""
    return callable(getattr(function, "restart", None))


# -- torques from a user's function ----------------------------------------------------------------


def answer_of(
    function: Callable[[float, Array, Array], Any], t: float, q: Array, v: Array
) -> Array:
    """Call a torque function and return its answer (nv,), which may not be finite.

    Raises InputError if the function raises or its answer does not fit.
    """
    try:
        given = function(t, q, v)
    except Exception as error:
        text = f"the function raised {type(error).__name__}: {error} (at t = {t:.6g} s)"
        text += "; it is called as f(t, q, v)" * isinstance(error, TypeError)
        raise InputError(Problem("simulate", "tau", text)) from error
    try:
        found = array_of(given)
    except (TypeError, ValueError):  # lists of unequal length
        found = np.array(None)
    if v.shape == (1,) and not found.shape:
        found = found.reshape(1)
    if found.dtype.kind in "fiu" and found.shape != v.shape:
        text = f"the function returned shape {found.shape}; it must return {v.shape}"
        raise InputError(Problem("simulate", "tau", f"{text}, a torque for each of v"))
    if found.dtype.kind not in "fiu":
        text = f"the function returned {shown(given)} at t = {t:.6g} s; it must return "
        text += f"{len(v)} numbers, a torque for each of v"
        raise InputError(Problem("simulate", "tau", text))
    return found


_Address = ctypes.CFUNCTYPE(
    ctypes.c_int64, ctypes.c_double, ctypes.c_uint64, ctypes.c_uint64, ctypes.c_uint64
)


class UserTorque(Unportable):
    """A torque function f(t, q, v) -> τ (nv,), in Python or compiled by `numba.njit`.

    A compiled one costs tens of nanoseconds a call, a Python one some microseconds.
    """

    def __init__(self, function: Callable[[float, Array, Array], Any], nq: int, nv: int, room: int):
        """Wrap the function without calling it, for states of at most `room` numbers.

        Raises InputError if numba cannot compile it.
        """
        self.function, self.calls = of_state(function), Calls(function)
        self.exchange = np.zeros((5, max(room, 1)))
        self.answer = np.zeros(1, dtype=np.int64)
        self.error: BaseException | None = None
        self._q, self._v = self.exchange[0, :nq], self.exchange[1, :nv]
        self._tau = self.exchange[2, :nv]
        self._bad = self.exchange[3, :1]  # time of the last answer that was not finite [s]
        self._bad[:] = -np.inf
        if made_by_numba(function):
            self._called: Any = _compiled(function, nq, nv, max(room, 1))
            self.interpreted = False
            self.address = int(self._called.address)
        else:
            self._called = _Address(self._call)
            self.address = address_of_function(self._called)

    interpreted = True  # by Python, not compiled
    most: Array | None = None  # (nv,) the largest |τ| of all calls, if it is kept

    @property
    def memory(self) -> list[Array]:
        """The arrays that calls read before writing."""
        return []

    @property
    def numbers(self) -> list[Array]:
        """The arrays of the description that are read by calls."""
        return []

    def keep_most(self) -> None:
        """Keep the largest torques of all calls as `most`."""
        self.most = self.exchange[4, : len(self._v)]

    def join(self, packed: Packed, work: Array) -> None:
        """Join a run whose kernels keep body data in `work`. It is not used here."""

    def notices(self) -> list[str]:
        """Return warnings about the torques in the run."""
        return []

    def trouble(self, t: float) -> str:
        """Return the reason why calls produced no torques at time t [s] or later, or ""."""
        nv, answer, bad = len(self._tau), int(self.answer[0]), float(self._bad[0])
        if answer and not self.interpreted:
            return f"the compiled function tau returned {answer - 1} torques, and {nv} are needed"
        if bad < t:
            return ""
        raised = "" if self.interpreted else "raised an error, or "
        return f"the function tau {raised}returned torques that are not finite, at t = {bad:.6g} s"

    def _call(self, t: float, *_: int) -> int:
        try:
            self._tau[:] = self._checked(t)
        except BaseException as error:  # none may pass through compiled steps
            self.error = error
            return 1
        return 0

    def _checked(self, t: float) -> Array:
        """Call the function on copies and return its result. A non-finite result ends the run.

        Raises InputError if the function raises or does not fit.
        """
        found = answer_of(self.function, t, self._q.copy(), self._v.copy())
        if not np.isfinite(found).all():
            self._bad[0] = t
        if self.most is not None:
            np.fmax(self.most, np.abs(found), out=self.most)
        self.calls.note(t, self._q, self._v, found)
        return found


def acting(tau: Any, nq: int, nv: int, room: int) -> UserTorque | None:
    """Return the function called for `tau` by compiled runs, or None for an array.

    A controller provides its own compiled function, with a workspace for each run. Raises
    InputError for a function with a state of its own, since steps call a function several times.
    """
    if hasattr(tau, "acting"):
        return tau.acting(room)
    if has_state(tau):
        text = "has a state of its own, so it is called at samples alone: give simulate the time "
        text += "between them, sample=0.01 for example, or call it in a loop of a Stepper, "
        raise InputError(Problem("simulate", "tau", f"{text}st.step(tau=f(st.t, st.q, st.v))"))
    return UserTorque(tau, nq, nv, room) if callable(tau) else None


def _compiled(function: Any, nq: int, nv: int, behind: int) -> Any:
    """Wrap the function in C's calling convention.

    It returns 0, or 1 and the number of torques if this number is not nv. If the function raises, τ
    is not finite, because numba continues after errors. The row after τ begins with the time of the
    last result that was not finite, and the next one has the largest torques.
    """
    # a user's function that is compiled has brought numba
    from numba import carray, cfunc, types  # pyright: ignore[reportPrivateImportUsage]
    from numba.core.errors import NumbaError

    pointer = types.CPointer(types.float64)

    def called(t: float, q: Any, v: Any, tau: Any) -> int:
        out = carray(tau, (2 * behind + nv,))
        for j in range(nv):
            out[j] = np.nan
        last, out[behind] = out[behind], t
        given = function(t, carray(q, (nq,)), carray(v, (nv,)))
        if given.shape[0] != nv:
            return 1 + given.shape[0]
        finite = True
        for j in range(nv):
            out[j] = given[j]
            finite = finite and np.isfinite(out[j])
            if abs(out[j]) > out[2 * behind + j]:
                out[2 * behind + j] = abs(out[j])
        if finite:
            out[behind] = last
        return 0

    try:
        return cfunc(types.int64(types.float64, pointer, pointer, pointer))(called)
    except NumbaError as error:
        lines = [line.strip(" -") for line in str(error).splitlines() if line.strip()]
        reasons = [line for line in lines if not line.startswith("Failed in")] or lines
        text = f"numba cannot compile the function for (t, q, v): {reasons[0]}"
        raise InputError(Problem("simulate", "tau", text)) from None


def refuse_as_torques(tau: Any, call: str) -> None:
    """Raise InputError if `step` receives a function or a count in place of torques."""
    text = ""
    if callable(tau):
        text = f"must be numbers; a function of (t, q, v) goes to pg.{call}(..., tau=function)"
    elif isinstance(tau, Integral):
        text = f"are torques, an array; for {tau} steps write step(n={tau})"
    elif isinstance(tau, Real):
        text = f"are torques, an array, got {tau}; the length of a step is pg.{call}(..., step="
        text += f"{tau}), and step(n=10) takes ten"
    if text:
        raise InputError(Problem(f"{call}.step", "tau", text))
