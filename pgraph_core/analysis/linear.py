"""Small motions about a state in independent coordinates: linearised dynamics and modes.

The control states follow the velocities. If possible, these states are chosen at rest.

With constraints the equations are M a + C - τ = Jᵀλ, J a + γ = 0. Their variation along δq, δv uses
the slopes of inverse dynamics at fixed v' and of Jᵀλ at fixed λ; δλ drops out on the null space of
J. The contributions of constraints and of springs between bodies are computed by sixth-order
differences, with an error of about 1e-11.

The derivatives of the forward dynamics are computed from those of the inverse dynamics and are
exact to rounding: ∂v'/∂x = M⁻¹ (∂τ_passive/∂x - ∂τ/∂x), with τ(q, v, v') of eq. (24).
"""

from __future__ import annotations

from collections.abc import Callable, Iterator
from dataclasses import dataclass, field
from typing import TYPE_CHECKING, Any

import numpy as np
from scipy.linalg import eigh, solve_triangular

from ..curves import Table, VectorTable
from ..dynamics import Dynamics
from ..dynamics.arguments import numbers
from ..engine import motion
from ..engine.records import CREEP
from ..engine.signals import TIME
from ..errors import Suggests, choices
from ..model import Force
from ..packing import Array, Ints
from ..rotation import skew
from ..signals import written
from ..tolerances import DIFFERENCED, EPS, NOTABLE, ROUNDING
from .balance import (
    Balance,
    Touching,
    differences,
    drive_slopes,
    slopes_in_v,
    slopes_of,
    state_of,
    torque_slopes,
    touching,
)

if TYPE_CHECKING:
    from .balance import Balance

NONE = np.zeros(0)


@dataclass(frozen=True, eq=False)
class Linearisation(Suggests):
    """The linear model x' = drift + A x + B δτ for small changes x = (δy, δu, δs) about a state.

    y are independent coordinates of positions (moves along velocities, a rotation vector in a
    ball's axes), u independent velocities, s the states of controls. δτ (nv,) are torques in all
    coordinates.
    """

    A: Array  # (n, n)
    B: Array  # (n, nv)
    coordinates: tuple[str, ...]  # names of y: the body of the joint, with an index if several
    velocities: tuple[str, ...]  # names of u: the same, or fewer if rows bind velocities alone
    eigenvalues: Array  # (n,) complex [1/s], by size
    modes: Array  # (nv, n) the moves of all coordinates that belong to them
    moves: Array  # (nv, len(coordinates)) δq = moves δy
    q: Array  # (nq,) the state
    v: Array  # (nv,)
    conservative: bool  # True if the eigenvalues come from two symmetric problems
    drift: Array  # (n,) x' = drift + A x + B δτ, which is 0 at rest in an equilibrium
    notices: tuple[str, ...] = ()  # warnings
    states: tuple[str, ...] = ()  # names of s: x.speed[1]
    s: Array = field(default_factory=lambda: np.zeros(0))  # (nx,) states of controls

    def __iter__(self) -> Iterator[Array]:
        """Iterate over A and B: `A, B = mech.linearise()`."""
        return iter((self.A, self.B))

    @property
    def frequencies(self) -> Array:
        """Frequencies of the oscillating modes in ascending order [rad/s]. `hertz` has them in Hz.

        They describe the damped oscillation. `damp` has the undamped ones.
        """
        found = self.eigenvalues.imag
        return np.sort(found[found > 0])

    @property
    def hertz(self) -> Array:
        """The `frequencies` in Hz."""
        return self.frequencies / (2.0 * np.pi)

    def damp(self) -> tuple[Array, Array, Array]:
        """Return (natural frequencies [rad/s], damping ratios, eigenvalues [1/s]), each (n,).

        As in `control.damp`, an eigenvalue s has the natural frequency |s| and the damping ratio
        -Re(s) / |s|. The ratio is 0 without damping, 1 without oscillation, and negative for an
        unstable motion.
        """
        return (
            np.abs(self.eigenvalues), -np.cos(np.angle(self.eigenvalues)), self.eigenvalues,
        )  # fmt: skip

    def state_space(self) -> tuple[Array, Array, Array, Array]:
        """Return (A, B, C, D) with all tree coordinates as outputs.

        For `scipy.signal.StateSpace(*...)` and `control.ss(*...)`.
        """
        n = len(self.moves)
        C = np.hstack((self.moves, np.zeros((n, len(self.A) - len(self.coordinates)))))
        return self.A, self.B, C, np.zeros((n, self.B.shape[1]))


def linearise(
    mech: Dynamics, q: Array | None, v: Array | None, scenario: str | None
) -> Linearisation:
    """Compute the linearised dynamics at (q, v). See `Mechanism.linearise`."""
    q, v = state_of(mech, q, v, scenario)
    mech._tree_acceleration(q, v)  # refuses a singular mass matrix by the name of its body
    here = Balance(mech, q, v, scenario)
    forces, near = (here.drives, here.loads), touching(mech, scenario)
    here.touching = Touching(mech, near, forces, (q, v), here.s)
    here = here.settled()
    n, nx = mech.nv, len(here.s)
    chosen_v = _independent(here.free)
    chosen_q = chosen_v
    if here.free_places is not here.free:
        chosen_q = _independent(here.free_places, first=chosen_v)
    by_place, by_speed = _from(here.free_places, chosen_q), _from(here.free, chosen_v)
    force_q, force_v = here.stiffness, here.force_slopes[1]
    along = np.zeros((n, len(chosen_q)))  # δv that δy brings where rows turn
    right = np.zeros((len(here.rows.J), len(chosen_q) + len(chosen_v)))
    if len(here.rows.J):
        row_q, row_v, turned = here.row_slopes
        known = np.vstack((here.rows.J, np.eye(n)[chosen_v]))
        wanted = np.vstack((-turned @ by_place, np.zeros((len(chosen_v), len(chosen_q)))))
        along = np.linalg.lstsq(known, wanted, rcond=1e-10)[0]
        right = -np.hstack((row_q @ by_place + row_v @ along, row_v @ by_speed))
    still = np.linalg.lstsq(here.rows.J, right, rcond=1e-10)[0] if len(right) else np.zeros(
        (n, right.shape[1])
    )  # fmt: skip
    pushed = -np.hstack((force_q @ by_place + force_v @ along, force_v @ by_speed))
    change = still + _answered(here, pushed - here.M @ still)
    respond = _answered(here, np.eye(n))
    speed_of_place = along + _spun(mech, v) @ by_place
    A = np.vstack((np.hstack((speed_of_place, by_speed))[chosen_q], change[chosen_v]))
    B = np.vstack((np.zeros((len(chosen_q), n)), respond[chosen_v], np.zeros((nx, n))))
    if nx:
        rate_q, rate_v, rate_s = here.rate_slopes
        pushing = _answered(here, here.state_slopes)[chosen_v]
        followed = np.hstack((rate_q @ by_place + rate_v @ along, rate_v @ by_speed))
        A = np.block([[A, np.vstack((np.zeros((len(chosen_q), nx)), pushing))], [followed, rate_s]])
    conservative = not nx and _conservative(here, by_place, force_q, force_v)
    if conservative:
        values, shapes = _swinging(here, by_place, force_q)
    else:
        found: Any = np.linalg.eig(A)
        values, vectors = found
        shapes = by_place @ vectors[: len(chosen_q)]
    order = np.lexsort((-values.imag, np.round(np.abs(values), 12)))
    names = names_of_moves(mech)
    drift = np.concatenate((v[chosen_q], here.vdot[chosen_v], here.unrest[0] if nx else ()))
    states = tuple(written("x", c.name, k + 1) for c, k, _ in mech.model.states)
    return Linearisation(
        A, B, tuple(names[i] for i in chosen_q), tuple(names[i] for i in chosen_v),
        values[order], shapes[:, order], by_place, q, v, conservative, drift,
        notices(here, names, states), states, here.s,
    )  # fmt: skip


def _answered(here: Balance, force: Any) -> Any:
    """Compute the accelerations v' due to forces (nv, k) while the constraint rows remain
    satisfied."""
    if len(here.rows.J):
        return here.free @ (here.free.T @ force)
    return np.linalg.solve(here.M, force)


def _conservative(here: Balance, by_place: Array, force_q: Array, force_v: Array) -> bool:
    """Return True for a state at rest without dissipation, time-dependent elements or velocity
    constraints."""
    if np.any(here.v) or np.any(force_v) or by_place.shape[1] != here.free.shape[1]:
        return False
    K = by_place.T @ force_q @ by_place
    return bool(np.abs(K - K.T).max(initial=0.0) <= DIFFERENCED * np.abs(K).max(initial=0.0))


def _swinging(here: Balance, by_place: Array, force_q: Array) -> tuple[Any, Any]:
    """Return eigenvalues ±iω, or ±s of unstable motions, and modes, from symmetric problems."""
    K, M = by_place.T @ force_q @ by_place, by_place.T @ here.M @ by_place
    inverse: Any = np.linalg.inv(M) if len(here.rows.J) else flexibility(here.mech, here.q)
    found, shapes = squares(M, K, inverse)
    root = np.sqrt(found.astype(complex))
    values = np.concatenate((1j * root, -1j * root))
    return values, by_place @ np.hstack((shapes, shapes))


def _independent(free: Array, first: Ints | None = None) -> Ints:
    """Choose independent coordinates that describe the motions `free` (nv, n), ascending."""
    from scipy.linalg import qr

    n = free.shape[1]
    pivoted: Any = qr
    if n == len(free):
        return np.arange(n, dtype=np.int64)
    if first is None or not len(first):
        order = pivoted(free.T, pivoting=True, mode="r")
        return np.sort(order[-1][:n]).astype(np.int64)
    known = np.linalg.svd(free[first])[2]
    left = free @ known[len(first) :].T
    left[first] = 0.0
    order = pivoted(left.T, pivoting=True, mode="r")
    return np.sort(np.concatenate((first, order[-1][: n - len(first)]))).astype(np.int64)


def _from(free: Array, chosen: Ints) -> Array:
    """Return the motions (nv, n) produced by the chosen coordinates."""
    if free.shape[1] == len(free):
        return np.eye(len(free))
    moves: Any = np.linalg.solve(free[chosen].T, free.T).T
    moves[chosen] = np.eye(len(chosen))
    return moves


def _spun(mech: Dynamics, v: Array) -> Array:
    """Compute the (nv, nv) change in the ball joints' rotation vectors, δθ' = δω + ω × δθ."""
    found = np.zeros((mech.nv, mech.nv))
    for _, _, j in mech.packed.quaternions:
        found[j : j + 3, j : j + 3] = skew(v[j : j + 3])
    return found


def names_of_moves(mech: Dynamics) -> list[str]:
    names: list[str] = []
    for body, joint in mech.joints.items():
        count = joint.v.stop - joint.v.start
        names += [body] if count == 1 else [f"{body}[{k}]" for k in range(count)]
    return names


def frequencies(mech: Dynamics, q: Array) -> Array:
    """Return the small-motion frequencies about q (nv,) [rad/s], ascending, with 0 if unstable."""
    rest = np.zeros(mech.nv)
    stiffness, mass = -force_slopes(mech, q, rest, rest)[0], mech.mass_matrix(q)
    return np.sqrt(np.maximum(squares(mass, stiffness, flexibility(mech, q))[0], 0.0))


def squares(mass: Array, stiffness: Array, flexibility: Array) -> tuple[Array, Array]:
    """Solve M x'' + K x = 0, and return (ω², mode shapes) in ascending order of ω². The columns of
    `shapes` (n, n) are the modes.

    The slow half is computed from K⁻¹M and the fast half from M⁻¹K. M⁻¹ is given by `flexibility`,
    using the articulated-body algorithm. Each half is accurate to 1e-12 for a chain of 1000 bodies.
    A single problem would lose six digits of the other half. An indefinite stiffness has negative
    ω².
    """
    stiffness = _symmetric(stiffness)
    try:
        root = np.linalg.cholesky(stiffness)
    except np.linalg.LinAlgError:
        values, shapes = eigh(stiffness, mass)
        return values, shapes
    inverse, slow = eigh(mass, stiffness)
    squared = 1.0 / inverse[::-1]
    fast_squared, fast = eigh(_symmetric(root.T @ flexibility @ root))
    half = int(np.searchsorted(squared, np.sqrt(squared[0] * squared[-1]))) if len(squared) else 0
    shapes = np.hstack((slow[:, ::-1][:, :half], solve_triangular(root.T, fast[:, half:])))
    return np.concatenate((squared[:half], fast_squared[half:])), shapes


def flexibility(mech: Dynamics, q: Array) -> Array:
    """Compute M⁻¹ (nv, nv) column by column."""
    rest = np.zeros(mech.nv)
    still = mech._tree_acceleration(q, rest)
    return _symmetric(
        np.array([mech._tree_acceleration(q, rest, axis) - still for axis in np.eye(mech.nv)])
    )


def _symmetric(a: Array) -> Array:
    return 0.5 * (a + a.T)


def forward_derivatives(
    mech: Dynamics, q: Array, v: Array, tau: Array | None
) -> tuple[Array, Array, Array]:
    """Compute ∂v'/∂q, ∂v'/∂v and ∂v'/∂τ = M⁻¹, including springs and dampers. Raises InputError."""
    mech.forward_dynamics(q, v, tau)  # checks the arguments and warns about ignored parts
    q, v = mech._state(q, v)
    given = mech._rest if tau is None else numbers("tau", tau, mech.nv, of=mech.packed)
    kernel, address, shape, by_q, by_v, by_tau, space, _ = slopes_of(mech)
    found, passive = np.empty(shape), None
    if len(space.passive):
        given, passive = mech._passive(q, v, given), np.hstack(passive_slopes(mech, q, v))
    with mech._lock:
        if passive is not None:
            space.passive[:] = passive
        if mech.nv:
            kernel(address, q, v, given, found)
    return found[by_q], found[by_v], found[by_tau]


def force_slopes(mech: Dynamics, q: Array, v: Array, tau: Array) -> tuple[Array, Array]:
    """Return M ∂v'/∂q and M ∂v'/∂v. At rest, they are minus the stiffness and damping."""
    by_q, by_v = torque_slopes(mech, q, v, mech._tree_acceleration(q, v, tau))
    spring, damper = passive_slopes(mech, q, v)
    return spring - by_q, damper - by_v


def passive_slopes(mech: Dynamics, q: Array, v: Array) -> tuple[Array, Array]:
    """Differentiate the torque from joint and body springs and dampers with respect to q and v."""
    by_q, by_v = drive_slopes(mech.packed.passive, q, v)
    if mech.packed.passive_loads.number:
        by_v = by_v + slopes_in_v(mech.packed.passive_loads, v, lambda x: mech._load_torque(q, x))
        by_q = by_q + differences(mech, q, lambda x: mech._load_torque(x, v))
    return by_q, by_v


# -- warnings --------------------------------------------------------------------------------------


def notices(here: Balance, names: list[str], states: tuple[str, ...]) -> tuple[str, ...]:
    """Return warnings about forces without a slope and about a state that is not an equilibrium."""
    found: list[str] = []
    joints = here.mech.joints
    if here.touching is not None and here.touching.shut:
        shut = choices(here.touching.shut, 6)
        text = f"{shut}: ignored, because a rigid contact has no stiffness; law 'soft' or "
        found.append(f"{text}'penalty' gives a contact one, a constraint of kind 'motion' a limit")
    at_rest = {name: np.abs(here.v[j.v]).max(initial=0.0) < CREEP for name, j in joints.items()}
    if rubs := [b.name for b in here.mech.model.bodies if any(b.friction) and at_rest[b.name]]:
        text = f"{choices(rubs, 6)}: joint friction has no derivative at rest; it is "
        found.append(f"{text}replaced by a damper, as below a speed of {CREEP:g} in a run")
    if len(here.loads.signals[1]) and (bent := _bent(here, names)):
        text = "a force has a corner or a jump at this state, so its derivative is not unique"
        found.append(f"{bent}: {text}")
    timed = ["expressions"] if (here.loads.signals[0][::2, 0] == TIME).any() else []
    timed += [f"'{f.name}'" for f in here.forces if _is_timed(f)]
    if timed:
        found.append(f"time-dependent, evaluated at t = 0: {', '.join(timed)}")
    vdot = here.vdot
    forces = np.abs(here.M) @ np.abs(vdot)
    whole, load = here.torque(here.q, here.v), here.load_torque(here.q, here.v)
    size = here.weights + np.abs(whole - load) + np.abs(load)
    if not np.any(here.v) and forces.max(initial=0.0) > NOTABLE * size.max(initial=1e-300):
        k = int(np.argmax(np.abs(vdot)))
        text = f"no equilibrium: v' of '{names[k]}' is {vdot[k]:.3g}, and `drift` is x' there; "
        found.append(f"{text}the eigenvalues refer to motion near a state that is not stationary")
    rates, size = (np.abs(x) for x in (here.unrest[0], here.s)) if states else (NONE, NONE)
    if not np.any(here.v) and (rates > NOTABLE * np.maximum(size, 1.0)).any():
        k = int(np.argmax(rates))
        text = f"no equilibrium: {states[k]} changes at {here.unrest[0][k]:.3g}/s, and `drift` is "
        found.append(f"{text}x' there")
    return tuple(found)


def _is_timed(f: Force) -> bool:
    """Check whether a force follows a table over time, or integrates its input over time."""
    given = (getattr(f, name) for name in type(f).model_fields)
    tables = any(isinstance(x, (Table, VectorTable)) for x in given)
    return tables or getattr(f, "integrates", False)


def _bent(here: Balance, names: list[str]) -> str:
    """Return the coordinates along which the forces of expressions have a corner or a jump, or "".

    f(h) + f(-h) - 2 f(0) is of order h^2 for a smooth force, of a lower one at a corner or jump.
    """
    rows = here.mech.packed.rows

    def placed(e: Array, h: float) -> Array:
        moved = here.q.copy()
        motion.move(rows, moved, e, h)
        return here.torque(moved, here.v)

    found = []
    for name, e in zip(names, np.eye(len(here.v))):
        along: tuple[Callable[[float], Array], ...] = (
            lambda h, e=e: placed(e, h), lambda h, e=e: here.torque(here.q, here.v + h * e),
        )  # fmt: skip
        if any(map(_is_bent, along)):
            found.append(name)
    return choices(found, 6) if found else ""


def _is_bent(of: Callable[[float], Array]) -> bool:
    """Check whether a function has a corner or a jump at 0."""
    step = EPS**0.25  # balances rounding and curvature in a second difference
    values = [(of(h), of(-h)) for h in (10.0 * step, step)]
    here = of(0.0)
    far, near = (np.abs(a + b - 2.0 * here).max(initial=0.0) for a, b in values)
    size = max(np.abs(x).max(initial=0.0) for pair in (*values, (here,)) for x in pair)
    return bool(near > 0.05 * far and near > ROUNDING * size)  # the order is at most 1.3
