"""Steady Kalman filters of the linearised motion, from the figures of imperfect outputs."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from itertools import compress
from typing import Any

import numpy as np
from scipy.linalg import LinAlgError, expm, null_space, orth, schur, solve_discrete_are

from ..dynamics import Dynamics, model_of
from ..dynamics.states import Sensors, bodies_over, no_motion
from ..errors import InputError, Problem, Suggests, choices, explained, nearest_name, one_of, shown
from ..model import Imperfect, Model, Output
from ..model.output import OF_CONTACT, OF_LOAD
from ..packing import Array
from ..signals import written
from ..tolerances import NOTABLE
from .balance import differences, differences_in_v
from .linear import Linearisation, linearise, names_of_moves

READ_FORCES = (*OF_LOAD, *OF_CONTACT, "accelerometer")  # kinds that no state determines
PER_QUANTUM = 12  # variance of a uniform error of width 1 is 1/12


@dataclass(frozen=True, eq=False)
class Kalman(Suggests):
    """A steady Kalman filter of x⁺ = A x + B τ + w with samples y = C x + n.

    x are the differences to the state `at`, and y those to the readings `reading` there. At each
    sample, x += K (y - C x), and then x = A x + B τ until the next one. As an array, it is K.
    """

    K: Array  # (n, m)
    covariance: Array  # (n, n) of the error of x after a sample
    predicted: Array  # (n, n) of the error of x before a sample
    A: Array  # (n, n) over the sample time
    B: Array  # (n, nv) of torques held over the sample time
    C: Array  # (m, n)
    Q: Array  # (n, n) covariance of w
    R: Array  # (m, m) covariance of n
    states: tuple[str, ...]  # (n,) names of x: q.cart, v.cart
    outputs: tuple[str, ...]  # (m,) names of y: angle, gyro.x
    at: Array  # (n,) the state about which x is small
    reading: Array  # (m,) of the outputs there
    sample: float  # [s]
    notices: tuple[str, ...] = ()  # warnings

    def __array__(self, dtype: Any = None, copy: bool | None = None) -> Array:
        return np.array(self.K, dtype)


@explained
def kalman(
    model: Model | Dynamics, outputs: str | Sequence[str], /, disturbance: Any, *, q: Any = None
) -> Kalman:
    """Compute the steady Kalman filter for imperfect outputs of the motion about a state at rest.

    It is the dual of `lqr`. The covariance of the samples is density²/sample + quantum²/12. Between
    samples, white torques disturb the motion.

    Parameters
    ----------
    model : Model or Mechanism
        The plant. It needs no drives.
    outputs : str or list of str
        Names of outputs with `imperfect`, which have the same sample time and read positions or
        velocities.
    disturbance : number, (nv,) or dict
        Densities of the white torques [N m/√Hz, N/√Hz], for all joints or by body.
    q : (nq,) array or dict, optional
        Equilibrium configuration. The default is the initial state.

    Returns
    -------
    Kalman
        The gain, the covariances and the matrices.

    Raises
    ------
    InputError
        If an output is not suitable, or if the outputs do not determine the motion.

    Examples
    --------
    >>> noisy = pg.Imperfect(sample=0.01, density=1e-3)
    >>> angle = pg.Output(name="angle", kind="joint_position", at="rod", imperfect=noisy)
    >>> pg.kalman(pg.load("pendulum").add(angle), ["angle"], 0.1, q={"rod": 0.0}).K.shape
    (2, 1)
    """
    model = model_of("kalman", model)
    wanted = _wanted(model, [outputs] if isinstance(outputs, str) else outputs)
    mech = Dynamics(model)
    found = linearise(mech, q, None, None)
    _refuse_moving(found)
    names = [
        *(written("q", label, None) for label in found.coordinates),
        *(written("v", label, None) for label in found.velocities), *found.states,
    ]  # fmt: skip
    sensors = Sensors(mech.packed, model.unchecked_copy({"outputs": tuple(wanted)}))
    C, reading = _slopes(mech, found, sensors)
    given = [o.imperfect for o in wanted for _ in o.reading.parts if o.imperfect is not None]
    parts = [".".join(filter(None, (o.name, part))) for o in wanted for part in o.reading.parts]
    sample = given[0].sample
    R = np.diag([x.density**2 / x.sample + x.quantum**2 / PER_QUANTUM for x in given])
    pushes = found.B * _densities(mech, disturbance)
    A, B, Q = _over(found, pushes, sample)
    try:
        predicted = solve_discrete_are(A.T, C.T, Q, R)
    except (LinAlgError, ValueError):
        raise _without_filter(found, C, pushes, names, parts) from None
    K = np.linalg.solve(C @ predicted @ C.T + R, C @ predicted).T
    left = np.eye(len(A)) - K @ C
    covariance = left @ predicted @ left.T + K @ R @ K.T
    at = np.concatenate((np.zeros(len(A) - len(found.s)), found.s))
    own = [names_of_moves(mech).index(name) for name in found.coordinates]
    at[: len(own)] = _places(mech, found)[own]
    return Kalman(
        K, covariance, predicted, A, B, C, Q, R, tuple(names), tuple(parts), at, reading, sample,
        (*found.notices, *_left_out(wanted)),
    )  # fmt: skip


def _without_filter(
    found: Linearisation, C: Array, pushes: Array, names: Sequence[str], parts: Sequence[str]
) -> InputError:
    """Return the refusal of outputs that leave states undetermined, or of undisturbed states."""
    if any(hidden := _hidden(found.A, C)):
        text = f"do not determine {choices(compress(names, hidden))} from {choices(parts)}: give "
        return InputError(Problem("kalman", "outputs", f"{text}an output that these change"))
    still = [*compress(names, _hidden(found.A.T, pushes.T))] or names
    text = f"must change {choices(still)}, which do not decay: give a torque of their joints"
    return InputError(Problem("kalman", "disturbance", text))


def _hidden(A: Array, C: Array) -> list[bool]:
    """Return which states of x' = A x the readings C x do not show, unless they decay."""
    seen = orth(C.T)
    while (more := orth(np.hstack((seen, A.T @ seen)), NOTABLE)).shape[1] > seen.shape[1]:
        seen = more
    rest: Any = null_space(seen.T)
    tiny = -NOTABLE * np.abs(A).max(initial=0.0)
    parts: Any = schur(rest.T @ A @ rest, "complex", sort=lambda x: x.real > tiny)
    _, turned, count = parts
    return [*(np.abs(rest @ turned[:, :count]).max(axis=1, initial=0.0) > NOTABLE)]


def _places(mech: Dynamics, found: Linearisation) -> Array:
    """Return the coordinate of each entry of v, or 0 where a joint turns in three directions."""
    place = np.zeros(mech.nv)
    for joint in mech.joints.values():
        if joint.q.stop - joint.q.start == joint.v.stop - joint.v.start:
            place[joint.v] = found.q[joint.q]
    return place


def _wanted(model: Model, names: Sequence[str]) -> list[Output]:
    """Return the outputs of these names. Raises InputError."""
    known, found = {o.name: o for o in model.outputs}, list[Output]()
    for name in names:
        if name not in known:
            text = f"no output is named {shown(name)}; {nearest_name(str(name), known)}"
            raise InputError(Problem("kalman", "outputs", text))
        found.append(known[name])
    if not found:
        raise InputError(Problem("kalman", "outputs", f"must not be empty; {one_of(known)}"))
    for o in found:
        given, where = o.imperfect, f"output '{o.name}'"
        if given is None or not (given.density or given.quantum):
            text = "needs noise for its weight: give imperfect=pg.Imperfect(sample=..., "
            raise InputError(Problem(where, "imperfect", f"{text}density=...), or a quantum"))
        if o.kind in READ_FORCES or o.kind == "rotation":
            text = f"is {o.kind}, which depends on forces or has no small change; give outputs of "
            raise InputError(Problem(where, "kind", f"{text}positions or velocities"))
        first = found[0].imperfect
        if first is not None and given.sample != first.sample:
            text = f"is {given.sample:g} s, and that of '{found[0].name}' is {first.sample:g} s; "
            raise InputError(Problem(where, "imperfect.sample", f"{text}give the same"))
    return found


def _left_out(outputs: Sequence[Output]) -> list[str]:
    """Return notices about imperfections that the filter does not know."""
    found = list[str]()
    for o in outputs:
        given: Imperfect | None = o.imperfect
        each = ("latency", "bias", "walk", "offset") if given is not None else ()
        if names := [name for name in each if getattr(given, name)]:
            text = f"output '{o.name}': the filter does not know its {choices(names)}, so its "
            found.append(f"{text}errors are larger than their covariance")
    return found


def _refuse_moving(found: Linearisation) -> None:
    """Raise InputError if the state is no equilibrium, or has more places than speeds."""
    if len(found.coordinates) != len(found.velocities):
        text = "has rows that bind velocities alone, such as rolling, which have no filter here"
        raise InputError(Problem("kalman", "model", text))
    if np.abs(found.drift).max(initial=0.0) > NOTABLE * np.abs(found.A).max(initial=0.0):
        text = f"is not an equilibrium: it would change at {np.abs(found.drift).max():.3g}/s; give "
        raise InputError(Problem("kalman", "q", f"{text}a q that mech.equilibrium(q) returns"))


def _slopes(mech: Dynamics, found: Linearisation, sensors: Sensors) -> tuple[Array, Array]:
    """Return (derivatives (m, n) of the outputs in the state, their values (m,))."""
    none = np.zeros((1, mech.nb, 6))

    def read(q: Array, v: Array) -> Array:
        q, v = q[None].copy(), v[None].copy()
        still = np.zeros_like(v)
        motion = no_motion(1)
        if sensors.moves:
            motion = bodies_over(mech.packed.system, q, v, still, none)
        return sensors.read(q, v, motion, np.zeros(0))[0]

    q, v = found.q[: mech.nq], found.v[: mech.nv]
    in_q = differences(mech, q, lambda x: read(x, v)) @ found.moves
    in_v = differences_in_v(v, lambda x: read(q, x)) @ found.moves
    return np.hstack((in_q, in_v, np.zeros((len(in_q), len(found.s))))), read(q, v)


def _densities(mech: Dynamics, given: Any) -> Array:
    """Return the densities of torques (nv,). Raises InputError."""
    found = np.zeros(mech.nv)
    where = Problem("kalman", "disturbance", "")
    if isinstance(given, Mapping):
        for name, x in given.items():
            if name not in mech.joints:
                text = f"no joint is named {shown(name)}; {nearest_name(str(name), mech.joints)}"
                raise InputError(Problem(where.where, where.field, text))
            found[mech.joints[name].v] = _numbers(x)
    else:
        numbers = _numbers(given)
        if numbers.shape not in ((), (mech.nv,)):
            numbers = np.full(1, np.nan)
        found[:] = numbers
    if not (np.isfinite(found).all() and (found >= 0.0).all() and found.any()):
        text = f"must be a number >= 0, {mech.nv} numbers or numbers by body, not all 0, "
        raise InputError(Problem(where.where, where.field, f"{text}got {shown(given)}"))
    return found


def _numbers(given: Any) -> Array:
    try:
        return np.asarray(given, dtype=float)
    except (TypeError, ValueError):
        return np.array(np.nan)


def _over(found: Linearisation, pushes: Array, h: float) -> tuple[Array, Array, Array]:
    """Return (A, B, Q) over the time h, with white noise through `pushes` [Van Loan 1978]."""
    n = len(found.A)
    both = np.block([[-found.A, pushes @ pushes.T], [np.zeros((n, n)), found.A.T]])
    blocks: Any = expm(both * h)
    A = blocks[n:, n:].T
    Q = A @ blocks[:n, n:]
    nv = found.B.shape[1]
    held: Any = expm(h * np.block([[found.A, found.B], [np.zeros((nv, n + nv))]]))
    return A, held[:n, n:], 0.5 * (Q + Q.T)
