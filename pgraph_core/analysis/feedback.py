"""State feedback u = hold - K (x - x*) for the linearised motion, implemented by drive
expressions."""

from __future__ import annotations

import math
from collections import Counter
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, replace
from typing import Any

import numpy as np
from scipy.linalg import LinAlgError, block_diag, solve, solve_continuous_are
from scipy.signal import place_poles as placed

from .. import joints
from ..dynamics import Dynamics, model_of
from ..errors import InputError, Problem, Suggests, explained, nearest_name, shown
from ..forces import Force, Motor, OnJoint
from ..model import Model
from ..packing import Array
from ..signals import written
from ..signals.grammar import LONGEST_EXPRESSION
from ..tolerances import NOTABLE, ROUNDING
from .linear import Linearisation, linearise


@dataclass(frozen=True, eq=False)
class Feedback(Suggests):
    """The gains of the state feedback u = hold - K (x - at), and a model with this feedback.

    As an array, it is K.
    """

    K: Array  # (m, n) [input per rad, m, rad/s, m/s, or unit of a state]
    states: tuple[str, ...]  # (n,) names of x: q.cart, q.pole, v.cart, v.pole, x.sum[1]
    inputs: tuple[str, ...]  # (m,) names of the drives
    at: Array  # (n,) x* [rad, m, rad/s, m/s]
    hold: Array  # (m,) inputs that hold it
    A: Array  # (n, n) x' = A (x - at) + B (u - hold)
    B: Array  # (n, m)
    poles: Array  # (n,) eigenvalues of A - B K [1/s]
    model: Model  # the drives have the feedback as their expressions
    notices: tuple[str, ...] = ()  # warnings, as of `Linearisation`

    def __array__(self, dtype: Any = None, copy: bool | None = None) -> Array:
        return np.array(self.K, dtype)

    def __neg__(self) -> Array:
        return -self.K

    def __matmul__(self, x: Any) -> Array:
        return self.K @ x

    @property
    def drives(self) -> tuple[Force, ...]:
        """The drives with the feedback as their expressions, which `simulate(..., tau=)` takes."""
        return tuple(f for f in self.model.forces if f.name in self.inputs)

    @property
    def positions(self) -> tuple[str, ...]:
        """The names of the coordinates, which are the first states."""
        return tuple(name for name in self.states if name[0] == "q")

    @property
    def stable(self) -> bool:
        """Return True if all poles lie in the left half-plane.

        Double poles are accurate to the square root of rounding, relative to the largest pole.
        """
        rounding = math.sqrt(np.finfo(float).eps) * np.abs(self.poles).max(initial=0.0)
        return bool((self.poles.real < -rounding).all())


@explained
def lqr(
    model: Model | Dynamics,
    Q: Any,
    R: Any = 1.0,
    *,
    inputs: Sequence[str] | None = None,
    states: Sequence[str] | None = None,
    q: Any = None,
) -> Feedback:
    """Compute the state feedback that minimises the integral of x' Q x + u' R u.

    Parameters
    ----------
    model : Model or Mechanism
        The feedback replaces the torque, target, speed or input of each drive. Other fields of the
        drives, such as kp and kd of a servo, are kept.
    Q : number, (n,), (n, n) or dict
        Weights of the states. This can be a scalar for all states, a vector with one weight per
        state, a matrix, or a dictionary by name, in which case all other weights are 0.
    R : number, (m,), (m, m) or dict
        Weights of the inputs, in the same form.
    inputs : list of str, optional
        Names of motors, servos and actuators, or of the bodies whose joints they drive. By default,
        all of them are used. If the model has no inputs, joint torques are used.
    states : list of str, optional
        Bodies whose coordinates are used as states, one per degree of freedom, if constraints
        couple the coordinates. By default, the best conditioned ones are selected.
    q : (nq,) array or dict, optional
        Equilibrium configuration. The default is the initial state.

    Returns
    -------
    Feedback
        Gains, poles, and the model with the feedback.

    Raises
    ------
    InputError
        If the weights have the wrong shape or sign, or if the inputs cannot hold or stabilise the
        state.

    Examples
    --------
    >>> cart = pg.Body(name="cart", joint="prismatic", axes=[(1, 0, 0)])
    >>> pole = pg.Body(name="pole", parent="cart", axes=[(0, 0, 1)], com=(0, 0.5, 0))
    >>> push = pg.Motor(name="push", body="cart")
    >>> model = pg.Model(bodies=[cart, pole], forces=[push], gravity=(0, -9.81, 0))
    >>> pg.lqr(model, {"q.cart": 1.0, "q.pole": 10.0}).stable
    True
    """

    def gains(plant: _Plant) -> Array:
        weights = plant.weights(Q, "Q", plant.states), plant.weights(R, "R", plant.inputs)
        _check_signs(*weights)
        try:
            P = solve_continuous_are(plant.A, plant.B, *weights)
        except (LinAlgError, ValueError) as error:
            text = f"do not lead to a solution of the Riccati equation: {plant.fault() or error}"
            raise InputError(Problem("lqr", "Q, R", text)) from None
        return solve(weights[1], plant.B.T @ P)

    return _closed("lqr", model, inputs, states, q, gains)


def _check_signs(Q: Array, R: Array) -> None:
    """Raise InputError unless Q and R are symmetric, Q without negative eigenvalues and R with
    positive ones: other goals have no least value.
    """
    for field, W, allowed in (("Q", Q, "at least 0"), ("R", R, "above 0")):
        rounding = ROUNDING * np.abs(W).max(initial=0.0)
        if np.abs(W - W.T).max(initial=0.0) > rounding:
            raise InputError(Problem("lqr", field, f"must be symmetric, got {shown(W.tolist())}"))
        least = float(np.linalg.eigvalsh(W).min(initial=np.inf))
        if least < -rounding or (field == "R" and least <= rounding):
            text = f"must have eigenvalues {allowed}, got one of {least:.6g}"
            raise InputError(Problem("lqr", field, text))


@explained
def place_poles(
    model: Model | Dynamics,
    poles: Any,
    /,
    *,
    inputs: Sequence[str] | None = None,
    states: Sequence[str] | None = None,
    q: Any = None,
) -> Feedback:
    """Compute the state feedback with given poles, using `scipy.signal.place_poles`.

    Parameters
    ----------
    model : Model or Mechanism
        The feedback replaces the torque, target, speed or input of each drive.
    poles : (n,) array
        Poles of the closed loop [1/s]. Complex poles must occur in conjugate pairs.
    inputs, states, q :
        As in `lqr`.

    Returns
    -------
    Feedback
        Gains, poles, and the model with the feedback.

    Raises
    ------
    InputError
        If the number of poles is wrong, SciPy rejects the poles, or the inputs cannot hold the
        state.

    Examples
    --------
        held = pg.place_poles(model, [-2.0, -3.0]).model
    """

    def gains(plant: _Plant) -> Array:
        try:
            wanted = np.atleast_1d(np.asarray(poles, dtype=complex))
        except (TypeError, ValueError):
            wanted = np.empty(0)
        if wanted.shape != (len(plant.states),):
            text = f"needs {len(plant.states)} poles, one per state, got {shown(poles)}"
            raise InputError(Problem("place_poles", "poles", text))
        if text := plant.fault():
            raise InputError(Problem("place_poles", "poles", text))
        try:
            found: Any = placed(plant.A, plant.B, wanted)
            return found.gain_matrix
        except ValueError:  # SciPy refuses these two
            n = len(plant.inputs)
            text = f"must be real or in conjugate pairs, and each at most {n} times, as often as"
            raise InputError(Problem("place_poles", "poles", f"{text} there are inputs")) from None

    return _closed("place_poles", model, inputs, states, q, gains)


@dataclass(frozen=True, eq=False)
class _Plant:
    """The motion about a state, with named inputs and named states."""

    call: str
    A: Array
    B: Array
    states: tuple[str, ...]
    inputs: tuple[str, ...]
    driven: tuple[str, ...]  # the body of each input

    def weights(self, given: Any, field: str, names: tuple[str, ...]) -> Array:
        """Return the weight matrix. Raises InputError.

        An input may be named by its body if it is the only one.
        """
        n = len(names)
        if isinstance(given, Mapping):
            alone = dict(zip(self.driven, names)) if len({*self.driven}) == n else {}
            given = {
                name if name in names else alone.get(name, name): x for name, x in given.items()
            }
            unknown = [name for name in given if name not in names]
            if unknown:
                text = (
                    f"no such name as {shown(unknown[0])}; {nearest_name(str(unknown[0]), names)}"
                )
                raise InputError(Problem(self.call, field, text))
            given = [given.get(name, 0.0) for name in names]
        try:
            found = np.asarray(given, dtype=float)
        except (TypeError, ValueError):
            found = np.full(1, np.nan)
        if found.ndim < 2 and found.shape in ((), (n,)):
            found = np.diag(np.broadcast_to(found, n))
        if found.shape != (n, n) or not np.isfinite(found).all():
            text = f"must be a number, {n} numbers or {n} x {n} numbers, of {', '.join(names)}"
            raise InputError(Problem(self.call, field, f"{text}, got {shown(given)}"))
        return found

    def fault(self) -> str:
        """Return the unstable motion that no input affects, or ""."""
        values, left = np.linalg.eig(self.A.T)
        for value, row in zip(values, left.T):
            reach = np.abs(row @ self.B).max() / max(np.abs(self.B).max(), 1e-300)
            if value.real >= 0 and reach < NOTABLE * np.abs(row).max():
                most = self.states[int(np.argmax(np.abs(row)))]
                return f"the inputs do not control '{most}' with the pole {value:.3g}/s"
        return ""


def _closed(
    call: str,
    given: Model | Dynamics,
    inputs: Any,
    states: Any,
    q: Any,
    gains: Callable[[_Plant], Array],
) -> Feedback:
    """Build the feedback about a state at rest, using the gains returned by `gains`.

    A model without drives gets a motor for each degree of freedom that `inputs` names, or for all.
    """
    model, names = model_of(call, given), [inputs] if isinstance(inputs, str) else inputs
    if not any(isinstance(f, OnJoint) for f in model.forces):
        for label, body, k, _ in _degrees(Dynamics(model)):
            if names is None or not {label, body}.isdisjoint(names):
                model = model.add(Motor(name=f"{label} motor", body=body, coordinate=k))
    drives = _drives(call, model, names)
    model = _with_inputs(model, drives, [0.0] * len(drives))
    plain = Dynamics(model)
    loose = linearise(plain, q, None, None)
    B = np.array([loose.B @ _pushes(plain, f) for f in drives]).T
    hold: Any = np.linalg.lstsq(B, -loose.drift, rcond=None)[0]
    mech = Dynamics(_with_inputs(model, drives, hold.tolist()))
    found = _chosen(call, mech, linearise(mech, q, None, None), states)
    names, places = _names(call, mech, found)
    at = np.concatenate((found.q[places], np.zeros(len(found.velocities)), found.s))
    B = np.array([found.B @ _pushes(mech, f) for f in drives]).T
    missed = found.drift
    if np.abs(missed).max(initial=0.0) > NOTABLE * np.abs(found.A).max():
        k = int(np.argmax(np.abs(missed)))
        text = (
            f"no input can hold this state: {names[k]} would change at {missed[k]:.3g}/s; give a "
        )
        raise InputError(Problem(call, "q", f"{text}q that mech.equilibrium(q) returns"))
    plant = _Plant(call, found.A, B, names, *zip(*((f.name, f.body) for f in drives)))
    K = np.atleast_2d(gains(plant))
    texts = [_text(names, at, row, float(u)) for row, u in zip(K, hold)]
    if (longest := max(map(len, texts))) > LONGEST_EXPRESSION:
        text = f"the feedback of {len(names)} states has {longest} characters, and an expression "
        text += f"at most {LONGEST_EXPRESSION}; choose fewer states"
        raise InputError(Problem(call, "states", text))
    model = _with_inputs(model, drives, texts)
    poles: Any = np.linalg.eigvals(found.A - B @ K)
    poles = poles[np.lexsort((-poles.imag, poles.real))]
    return Feedback(K, names, plant.inputs, at, hold, found.A, B, poles, model, found.notices)


def _with_inputs(model: Model, drives: Sequence[OnJoint], values: Sequence[Any]) -> Model:
    for f, value in zip(drives, values):
        model = model.edit(f.name, kind="force", **{f.INPUT: value})
    return model


def _chosen(call: str, mech: Dynamics, found: Linearisation, wanted: Any) -> Linearisation:
    """Express the same motion in other coordinates. Raises InputError."""
    if wanted is None:
        return found
    names = [label for label, *_ in _degrees(mech)]  # names used by `linearise`
    for name in wanted:
        if name not in names:
            text = f"no coordinate is named {shown(name)}; {nearest_name(str(name), names)}"
            raise InputError(Problem(call, "states", text))
    T = found.moves[[names.index(name) for name in wanted]]
    n = len(found.coordinates)
    if len(found.velocities) != n or len(T) != n or np.linalg.matrix_rank(T) < n:
        text = f"must be {n} coordinates that the others follow, such as "
        text += f"{', '.join(found.coordinates)}, got {shown(list(wanted))}"
        raise InputError(Problem(call, "states", text))
    both: Any = block_diag(T, T, np.eye(len(found.states)))
    return replace(
        found, A=both @ np.linalg.solve(both.T, found.A.T).T, B=both @ found.B,
        drift=both @ found.drift, coordinates=tuple(wanted), velocities=tuple(wanted),
    )  # fmt: skip


def _degrees(mech: Dynamics) -> list[tuple[str, str, int, bool]]:
    """Return (label, body, index within the joint, whether the joint has several degrees of
    freedom) for each entry of v."""
    found = list[tuple[str, str, int, bool]]()
    for name, joint in mech.joints.items():
        count = joint.v.stop - joint.v.start
        several = count > 1
        labels = [f"{name}[{k}]" if several else name for k in range(count)]
        found += [(label, name, k, several) for k, label in enumerate(labels)]
    return found


def _drives(call: str, model: Model, names: Sequence[str] | None) -> list[OnJoint]:
    """Return drives by their names. The only drive of a body may be named by its body."""
    drives = [f for f in model.forces if isinstance(f, OnJoint)]
    bodies = Counter(f.body for f in drives)
    known = {f.body: f for f in drives if bodies[f.body] == 1} | {f.name: f for f in drives}
    wanted = [f.name for f in drives] if names is None else list(names)
    for name in wanted:
        if name not in known:
            text = f"no motor, servo, actuator or joint is named {shown(name)}; "
            near = known or [body.name for body in model.bodies]
            raise InputError(Problem(call, "inputs", text + nearest_name(str(name), near)))
    if not wanted:
        text = "needs a motor, servo or actuator; add one with model.add(pg.Motor(...))"
        raise InputError(Problem(call, "inputs", text))
    late = [name for name in wanted if known[name].has_state]
    if late:
        text = f"'{late[0]}' has a lag or an integral of its own, through which no feedback acts; "
        raise InputError(Problem(call, "inputs", f"{text}name the other drives"))
    return [known[name] for name in wanted]


def _pushes(mech: Dynamics, f: OnJoint) -> Array:
    """Compute the torques (nv,) produced by a unit input to a drive."""
    found = np.zeros(mech.nv)
    for body, k, factor in f.terms:
        found[mech.joints[body].v.start + k] += f.law.gain * factor
    return found


def _names(call: str, mech: Dynamics, found: Linearisation) -> tuple[tuple[str, ...], list[int]]:
    """Return (state names as used in expressions, indices in q). Raises InputError."""
    parts = {label: (name, k, several) for label, name, k, several in _degrees(mech)}
    names, places = list[str](), list[int]()
    for label in found.coordinates:
        name, k, several = parts[label]
        place = joints.places(mech.model.body(name).sequence)[k]
        if place is None:
            text = f"'{name}' is a ball joint, which has no single angle; use hinges"
            raise InputError(Problem(call, "model", text))
        names.append(written("q", name, k if several else None))
        places.append(mech.joints[name].q.start + place)
    for label in found.velocities:
        name, k, several = parts[label]
        names.append(written("v", name, k if several else None))
    return (*names, *found.states), places


def _text(names: Sequence[str], at: Array, gains: Array, hold: float) -> str:
    """Return the expression hold - K (x - x*) as text."""
    parts = [f"{hold!r}"] if hold else []
    for name, x, k in zip(names, at.tolist(), gains.tolist()):
        if k:
            away = f"({name} - {x!r})" if x > 0 else f"({name} + {-x!r})" if x < 0 else name
            parts.append(f"{-k!r}*{away}")
    return "=" + " + ".join(parts or ["0*t"]).replace("+ -", "- ")
