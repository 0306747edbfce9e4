"""The equations of motion at one state, and their derivatives."""

from __future__ import annotations

from collections.abc import Callable
from functools import cached_property
from typing import Any, Self

import numpy as np

from ..dynamics import Dynamics
from ..dynamics.arguments import by_name, finite, position
from ..dynamics.scene import NO_CONSTRAINTS, Scene, contact_tables
from ..engine import arrays, motion
from ..engine.compiler.address import address_of_array, buffer, unnamed
from ..engine.compiler.jit import ready
from ..engine.records import CREEP
from ..engine.tree import slopes as kernels
from ..errors import InputError, Problem, shown
from ..forces import LOADS
from ..joints import SIZE
from ..model import Contact, Force
from ..packing import Array, Drives, Ints, Loads
from ..packing.forces import NO_LOADS
from ..tolerances import EPS, NOTABLE, ROUNDING, SOLVED
from .assembly import assemble
from .mobility import complement, judged
from .rows import Rows
from .stops import Stops

SETTLING = 20  # rounds of Newton's method for states of controls


class Balance:
    """The equations of motion for a scene at one state, and their derivatives."""

    touching: Touching | None = None  # contacts, where they act

    def __init__(
        self,
        mech: Dynamics,
        q: Array,
        v: Array,
        scenario: str | None = None,
        also: Ints = NO_CONSTRAINTS,
    ):
        """Set up a separate scene at rest, so that forces acting in runs also act here at t = 0.

        `also` are indices of constraints that hold beside the active ones.
        """
        self.mech, self.q, self.v = mech, q, v
        self.forces, self.active = acting(mech, scenario)
        self.active = np.union1d(self.active, also)
        packed = mech.packed
        for control, _, own in mech.model.states:
            if own.sample:
                text = "is sampled, which is not supported for continuous-time models and "
                text += "equilibria; remove it or its sample time"
                raise InputError(Problem(f"control {shown(control.name)}", "sample", text))
        self.drives = packed.drives(self.forces)
        self.loads = packed.loads(self.forces, states=True)
        self.s = packed.with_states(0.0, q, v)[1][mech.nv :]
        self.scene = Scene(packed, self.drives, self.loads, NO_CONSTRAINTS)
        self.held = Scene(packed, self.drives, self.loads, self.active)
        self.drives = self.scene.drives

    def at(self, q: Array, v: Array) -> Self:
        """Return the same scene at another state."""
        other = object.__new__(type(self))
        for name in ("mech", "forces", "active", "drives", "loads", "scene", "held", "s"):
            setattr(other, name, getattr(self, name))
        other.q, other.v = q, v
        return other

    def with_states(self, s: Array) -> Self:
        """Return the same scene with other states of controls."""
        other = self.at(self.q, self.v)
        other.s, other.touching = s, self.touching
        return other

    def whole(self, q: Array, v: Array) -> tuple[Array, Array]:
        """Return q and v with the control states appended, as the kernels expect them."""
        return whole(q, v, self.s)

    # -- at the state ----------------------------------------------------------------------------

    @cached_property
    def rows(self) -> Rows:
        return Rows.of(self.mech, self.active, self.q, self.v)

    @cached_property
    def M(self) -> Array:
        return self.mech.mass_matrix(self.q)

    @cached_property
    def free(self) -> Array:
        """The motions permitted by all rows as an (nv, n) array, orthonormal in the mass metric."""
        return self.rows.step(complement(judged(self.rows)[0], self.mech.nv))

    @cached_property
    def free_places(self) -> Array:
        """The same as `free`, restricted to rows that constrain positions."""
        groups = [group for group in self.rows.groups if group.holonomic]
        if len(groups) == len(self.rows.groups):
            return self.free
        return self.rows.step(complement(judged(self.rows, groups)[0], self.mech.nv))

    @cached_property
    def size(self) -> float:
        """The extent of the mechanism [m]."""
        apart = float(np.ptp(self.rows.poses[0], axis=0).max(initial=0.0))
        return max(apart, self.rows.length) or 1.0

    @cached_property
    def weights(self) -> Array:
        """The weight carried by each joint (nv,), times the mechanism's size for rotations."""
        packed, topology = self.mech.packed, self.mech.topology
        carried = np.array([b.mass for b in packed.model.bodies])[topology.row]
        for n in range(len(carried), 0, -1):
            if (parent := int(topology.parent[n - 1])) > 0:
                carried[parent - 1] += carried[n - 1]
        found = np.zeros(self.mech.nv)
        for name, joint in self.mech.joints.items():
            found[joint.v] = carried[topology.number(name) - 1]
        gravity = float(np.linalg.norm(packed.model.gravity))
        return found * gravity * np.where(self.rows.turns, self.size, 1.0)

    def torque(self, q: Array, v: Array) -> Array:
        """Compute the torque τ (nv,) from all drives and loads at t = 0."""
        tau = np.zeros(self.mech.nv + len(self.s))
        motion.drive_torque(self.scene.address, *self.whole(q, v), tau)
        tau = tau[: self.mech.nv] + self.load_torque(q, v)
        return tau if self.touching is None else tau + self.touching.torque(q, v)

    def load_torque(self, q: Array, v: Array) -> Array:
        """Return the torque τ (nv,) from springs between bodies and wrenches at t = 0."""
        tau = np.zeros(self.mech.nv + len(self.s))
        if self.loads.number:
            motion.load_torque(self.scene.address, *self.whole(q, v), tau)
        return tau[: self.mech.nv]

    def expressed_torque(self, q: Array, v: Array) -> Array:
        """Return the torque τ (nv,) at t = 0 from drives whose expressions use another state."""
        tau, none = np.zeros(self.mech.nv), NO_LOADS
        motion.signal(self.scene.address, 0.0, *self.whole(q, v))
        here = Scene(self.mech.packed, self.drives, none, NO_CONSTRAINTS)
        motion.drive_torque(here.address, self.q, self.v, tau)
        return tau

    @cached_property
    def pull(self) -> Array:
        """The residual C - τ (nv,) in the equations of motion without v' and λ."""
        return self.mech.bias_force(self.q, self.v) - self.torque(self.q, self.v)

    def gamma(self, q: Array, v: Array) -> Array:
        """The bias γ (m,) in J v' + γ = 0 of the active rows, from the kernel that enforces it."""
        mech, scene, state = self.mech, self.held, self.whole(q, v)
        tau, vdot, flow = np.zeros(len(state[1])), np.zeros(len(state[1])), np.zeros(3)
        motion.acceleration(self.scene.address, 0.0, *state, tau, vdot, flow)
        without = vdot[: mech.nv].copy()
        motion.acceleration(scene.address, 0.0, *state, tau, vdot, flow)
        J = Rows(mech, self.rows.scene, self.rows.held, q, v).J
        return -scene.space.vectors[arrays.RHS, : len(J)] - J @ without

    @cached_property
    def vdot(self) -> Array:
        """The acceleration v' (nv,) with the constraints enforced."""
        still: Any = np.zeros(self.mech.nv)
        if len(self.rows.J):
            gamma = self.gamma(self.q, self.v)
            still = -np.linalg.lstsq(self.rows.J, gamma, rcond=1e-10)[0]
        return still - self.free @ (self.free.T @ (self.pull + self.M @ still))

    @cached_property
    def multipliers(self) -> Array:
        """The minimum-norm multipliers λ (m,)."""
        J: Any = self.rows.J
        return np.linalg.lstsq(J.T, self.M @ self.vdot + self.pull, rcond=1e-10)[0]

    def rates(self, q: Array, v: Array, s: Array) -> Array:
        """Return the rates (nx,) of states s of controls and muscles at t = 0."""
        state = whole(q, v, s)
        tau, rates, flow = np.zeros(len(state[1])), np.zeros(len(state[1])), np.zeros(3)
        motion.acceleration(self.scene.address, 0.0, *state, tau, rates, flow)
        return rates[self.mech.nv :]

    @cached_property
    def unrest(self) -> tuple[Array, Array]:
        """The rates of states of controls (nx,), and the forces left along the free motions."""
        return self.rates(self.q, self.v, self.s), self.free.T @ self.pull

    def settled(self) -> Self:
        """Compute the scene with stationary control states that hold it in place, if there are any.

        Newton's method first makes the rates vanish, then the forces by the states that stay free.
        """
        here = self
        for _ in range(SETTLING if len(self.s) else 0):
            rates, left = here.unrest
            slope = here.rate_slopes_in_states
            step: Any = -np.linalg.lstsq(slope, rates, rcond=NOTABLE)[0]
            _, sizes, right = np.linalg.svd(slope)
            rest = right[int(np.sum(sizes > NOTABLE * sizes.max(initial=0.0))) :].T
            push = -here.free.T @ here.state_slopes
            free: Any = np.linalg.lstsq(push @ rest, -left - push @ step, rcond=NOTABLE)[0]
            step += rest @ free
            here = here.with_states(here.s + step)
            if np.abs(step).max() <= ROUNDING * np.abs(here.s).max():
                break
        return here

    # -- slopes ----------------------------------------------------------------------------------

    @cached_property
    def state_slopes(self) -> Array:
        """The derivative ∂/∂s (nv, nx) of τ."""
        return differences_in_v(self.s, lambda x: self.with_states(x).torque(self.q, self.v))

    @cached_property
    def rate_slopes(self) -> tuple[Array, Array, Array]:
        """The derivatives of the rates of states s of controls in q, v (nx, nv) and s (nx, nx)."""
        q, v, s = self.q, self.v, self.s
        by_q = differences(self.mech, q, lambda x: self.rates(x, v, s))
        by_v = differences_in_v(v, lambda x: self.rates(q, x, s))
        return by_q, by_v, self.rate_slopes_in_states

    @cached_property
    def rate_slopes_in_states(self) -> Array:
        """The derivatives (nx, nx) of the rates of states of controls in these states."""
        return differences_in_v(self.s, lambda x: self.rates(self.q, self.v, x))

    @cached_property
    def force_slopes(self) -> tuple[Array, Array]:
        """Return ∂/∂q and ∂/∂v (nv, nv) of M v' + C - τ at fixed v'."""
        mech, q, v = self.mech, self.q, self.v
        by_q, by_v = torque_slopes(mech, q, v, self.vdot)
        motion.signal(self.scene.address, 0.0, *self.whole(q, v))
        spring, damper = drive_slopes(self.drives, q, v)
        by_q, by_v = by_q - spring, by_v - damper
        if self.loads.number:
            by_q = by_q - differences(mech, q, lambda x: self.load_torque(x, v))
            by_v = by_v - slopes_in_v(self.loads, v, lambda x: self.load_torque(q, x))
        if len(self.loads.signals[1]):
            by_q = by_q - differences(mech, q, lambda x: self.expressed_torque(x, v))
            by_v = by_v - differences_in_v(v, lambda x: self.expressed_torque(q, x))
        if (pushed := self.touching) is not None and pushed.depth:
            by_q = by_q - differences(mech, q, lambda x: pushed.torque(x, v), pushed.steps)
            by_v = by_v - pushed.slopes_in_v(q, v)
        return by_q, by_v

    @cached_property
    def stiffness(self) -> Array:
        """The derivative ∂/∂q (nv, nv) of M v' + C - τ - Jᵀλ at fixed v' and λ."""
        by_q, _ = self.force_slopes
        if not len(self.rows.J):
            return by_q
        return by_q - self._row_slopes(lambda J, _: J.T @ self.multipliers)

    def _row_slopes(self, of: Callable[[Array, Array], Array]) -> Array:
        """Differentiate a function of (J, q) with respect to q."""
        rows = self.rows

        def value(q: Array) -> Array:
            return of(Rows(self.mech, rows.scene, rows.held, q, rows.v).J, q)

        return differences(self.mech, self.q, value)

    @cached_property
    def row_slopes(self) -> tuple[Array, Array, Array]:
        """Return ∂/∂q, ∂/∂v of J v' + γ at fixed v', and ∂/∂q of J v, each (m, nv)."""
        rows, v, vdot = self.rows, self.v, self.vdot
        moving = bool(np.any(v))
        if not moving:
            none = np.zeros((len(rows.J), self.mech.nv))
            return self._row_slopes(lambda J, _: J @ vdot), none, none
        by_q = self._row_slopes(lambda J, q: J @ vdot + self.gamma(q, v))
        axes = np.eye(self.mech.nv)
        swing = [self.gamma(self.q, v + e) - self.gamma(self.q, v - e) for e in axes]
        return by_q, np.array(swing).T / 2, self._row_slopes(lambda J, _: J @ v)


def whole(q: Array, v: Array, s: Array) -> tuple[Array, Array]:
    """Return q and v followed by the control states s (nx,), as in `Packed.run`."""
    return (np.append(q, np.zeros_like(s)), np.append(v, s)) if len(s) else (q, v)


def acting(mech: Dynamics, scenario: str | None) -> tuple[tuple[Force, ...], Ints]:
    """Return (forces whose lags are over, active constraint indices) for a run of the scenario."""
    model, forces, active = mech.model, mech.model.forces, mech.packed.active
    if scenario is None:
        return tuple(map(_without_lag, forces)), active
    chosen = model.scenario(scenario)
    if chosen.constraints is not None:
        names = [c.name for c in model.constraints]
        active = np.array(sorted(names.index(n) for n in chosen.constraints), dtype=np.int64)
    return tuple(map(_without_lag, (*forces, *chosen.forces))), active


def _without_lag(f: Force) -> Force:
    """Return a force as it acts once the lag of its input, which knows no motion, is over."""
    return f.model_copy(update={"lag": 0.0, "start": None}) if getattr(f, "lag", 0.0) else f


def touching(mech: Dynamics, scenario: str | None) -> tuple[Contact, ...]:
    """Return the contacts that are active in a run of the scenario."""
    chosen = mech.model.scenario(scenario).contacts if scenario is not None else None
    contacts = mech.model.contacts
    return tuple(c for c in contacts if (c.active if chosen is None else c.name in chosen))


def state_of(
    mech: Dynamics, q: Array | None, v: Array | None, scenario: str | None
) -> tuple[Array, Array]:
    """Return the assembled (q, v) for a call. Defaults to the scenario's initial q at rest."""
    start = mech.home()[0]
    if scenario is not None:
        for name, values in mech.model.scenario(scenario).q.items():
            start[mech.joints[name].q] = values
    if scenario is None:
        q, v = mech._numbers(q=q, v=v)
    q, v = by_name(mech, "q", q, start), by_name(mech, "v", v)
    at = start if q is None else position(mech.packed, q)
    speed = np.zeros(mech.nv) if v is None else finite("v", v, mech.nv, of=mech.packed)
    names = [mech.model.constraints[i].name for i in acting(mech, scenario)[1]]
    if not names:
        return at, speed
    at, speed, _ = assemble(mech, at, speed, names)
    return at, speed


def slopes_of(mech: Dynamics) -> tuple[Any, ...]:
    """Compute the derivative kernel and its workspace, cached with the mechanism once made."""
    if not mech._slopes:
        packed, n, whole = mech.packed, mech.nv, slice(None)
        sprung = len(packed.passive.table) or packed.passive_loads.number
        space = kernels.Slopes(
            *packed.tree, mech._work,
            passive=np.empty((n if sprung else 0, 2 * n)),
            bodies=np.empty((len(packed.rows), kernels.MOTION_SUM.total)),
            freedoms=np.empty((n, kernels.FREEDOM.total)),
            outer=np.empty((2, n), np.int64),
            factor=np.zeros((n + 1, n)),  # stays zero where no body carries the other
        )  # fmt: skip
        kept = buffer()
        kernels.save_slopes(kept, unnamed(space))
        columns = [(whole, slice(k * n, (k + 1) * n)) for k in range(3)]
        kernel, address = ready(kernels.forward_derivatives), address_of_array(kept)
        mech._slopes = kernel, address, (n, 3 * n), *columns, space, kept
    return mech._slopes


def slopes_in_v(loads: Loads, v: Array, of: Callable[[Array], Array]) -> Array:
    """Compute the (nv, nv) load torque derivatives in v, exact except for drags that change
    direction.

    Dampers are linear in v and drags quadratic: central differences have no error of order. Steps
    of the largest speed times the cube root of EPS err least if a drag changes its side.
    """
    if len(loads.signals[1]):
        return differences_in_v(v, of)
    linear = all(kind.linear(table) for kind, (table, *_) in zip(LOADS, loads))
    h = 1.0 if linear else EPS ** (1 / 3) * max(1.0, float(np.abs(v).max(initial=0.0)))
    return np.array([of(v + h * e) - of(v - h * e) for e in np.eye(len(v))]).T / (2 * h)


def torque_slopes(mech: Dynamics, q: Array, v: Array, vdot: Array) -> tuple[Array, Array]:
    """Return ∂τ/∂q and ∂τ/∂v (nv, nv) for τ(q, v, v') in eq. (24), without passive forces."""
    n = mech.nv
    slopes = np.empty((n, 2 * n))
    if n:
        address = slopes_of(mech)[1]
        with mech._lock:
            ready(kernels.torque_slopes)(address, q, v, vdot, slopes)
    return slopes[:, :n], slopes[:, n:]


def drive_slopes(drives: Drives, q: Array, v: Array) -> tuple[Array, Array]:
    """Compute (nv, nv) derivatives of springs, servos and motors in q, and dampers and friction in
    v.

    The slope is evaluated at t = 0. It is zero for a drive at its limit.
    """
    spring, damper = np.zeros((len(v), len(v))), np.zeros((len(v), len(v)))
    for one in drives.table:
        terms = drives.terms[one["first_term"] : one["first_term"] + one["terms"]]
        if not len(terms):
            terms = np.array([(one["velocity"], one["coordinate"], 1.0)])
        at_v, at_q = terms[:, 0].astype(int), terms[:, 1].astype(int)
        rate, springs = float(terms[:, 2] @ v[at_v]), one["coordinate"] >= 0
        friction = one["friction"] * CREEP**2 / (rate**2 + CREEP**2) ** 1.5
        if np.isfinite(one["low"]) or np.isfinite(one["high"]):
            target, torque = (_first(drives, one[key]) for key in ("first_target", "first_torque"))
            apart = target - float(terms[:, 2] @ q[at_q]) if springs else 0.0
            asked = torque + one["stiffness"] * apart - one["damping"] * rate
            if not one["low"] < asked < one["high"]:
                continue
        both = np.ix_(at_v, at_v), np.outer(terms[:, 2], terms[:, 2])
        np.add.at(damper, both[0], -(one["damping"] + friction) * both[1])
        np.add.at(spring, both[0], -(one["stiffness"] if springs else 0.0) * both[1])
    return spring, damper


def _first(drives: Drives, knot: int) -> float:
    return float(drives.knots[knot, 3])


STEPS = (1e-2, 1e-3, 1e-4)  # rad, m: a short spring bends within less than a long one
FOURTH, SIXTH = np.array([8.0, -1.0, 0.0]) / 12, np.array([45.0, -9.0, 1.0]) / 60


def differences(
    mech: Dynamics, q: Array, of: Callable[[Array], Array], steps: tuple[float, ...] = STEPS
) -> Array:
    """Return the (k, nv) derivatives of a (k,) function in q, to about 1e-11 of the largest."""
    along = [lambda h, e=e: of(_moved(mech, q, e, h)) for e in np.eye(mech.nv)]
    return np.array([_slope(one, steps) for one in along]).T


def differences_in_v(v: Array, of: Callable[[Array], Array]) -> Array:
    """Return the (k, nv) derivatives of a (k,) function in v, to about 1e-11 of the largest."""
    if not len(v):
        return np.zeros((len(of(v)), 0))
    return np.array([_slope(lambda h, e=e: of(v + h * e), STEPS) for e in np.eye(len(v))]).T


def _slope(of: Callable[[float], Array], steps: tuple[float, ...]) -> Array:
    """Differentiate a function at 0, using the step at which orders four and six agree best.

    A step that leaves the domain of the function is used only if all of them do.
    """
    found: list[tuple[float, Array]] = []
    for h in steps:
        odd = [of(n * h) - of(-n * h) for n in (1, 2, 3)]
        fourth, sixth = FOURTH @ odd / h, SIXTH @ odd / h
        with np.errstate(invalid="ignore"):
            apart = float(np.max(np.abs(sixth - fourth), initial=0.0))
        found.append((apart if np.isfinite(apart) else np.inf, sixth))
    return min(found, key=lambda pair: pair[0])[1]


def _moved(mech: Dynamics, q: Array, e: Array, distance: float) -> Array:
    moved = q.copy()
    motion.move(mech.packed.rows, moved, e, distance)
    return moved


# -- contacts and joint limits about a state: soft and penalty forces, and closed contacts ---------


DEPTHS = (0.1, 1e-2, 1e-3)  # steps of finite differences relative to the least depth


class Touching:
    """The closed contacts at the state (q, v) at which a run starts."""

    def __init__(
        self,
        mech: Dynamics,
        contacts: tuple[Contact, ...],
        forces: tuple[Drives, Loads],
        state: tuple[Array, Array],
        own: Array,
    ):
        """Find the closed contacts among active `contacts` and limits, under active `forces`.

        `own` (nx,) are the states of controls, on which no contact force depends.
        """
        self.mech, (q, v), self.own = mech, state, own
        self.shut: list[str] = []  # names of closed rigid contacts and limits, for sentences
        self.depth = 0.0  # least depth of a soft or penalty contact [m], 0 if none pushes
        self.overlaps: dict[str, float] = {}  # the largest depth of each contact that overlaps [m]
        self._limits(q)
        tables = contact_tables(mech.packed, contacts) if contacts else None
        if tables is None or not tables.touches:
            return
        from ..engine.contact import contacts as kernels  # compiled only if something touches

        self.scenes = [
            Scene(mech.packed, *forces, NO_CONSTRAINTS, contacts=with_contacts)
            for with_contacts in (None, tables)
        ]
        address, none = self.scenes[1].address, np.zeros(0)
        touching = self.scenes[1].touching
        assert touching is not None
        motion.residuals(address, 0.0, *self._whole(q, v), none, none)  # places the bodies
        reach = SOLVED * max(1.0, mech.packed.length)
        depths = []
        for one in touching.found[: kernels.find(address, reach, 0)]:
            contact = tables.touches[int(one["pair"])].contact
            if (depth := -float(one["gap"])) > reach:
                name = contact.name
                self.overlaps[name] = max(depth, self.overlaps.get(name, 0.0))
            if contact.law == "complementarity":
                if one["gap"] <= reach and (name := f"contact '{contact.name}'") not in self.shut:
                    self.shut.append(name)
            elif one["gap"] < 0:
                depths.append(-float(one["gap"]))
        self.depth = min(depths, default=0.0)
        kernels.settle_contacts(address, 0.0, *self._whole(q, v))  # friction holds where it is

    def _whole(self, q: Array, v: Array) -> tuple[Array, Array]:
        return np.append(q, np.zeros_like(self.own)), np.append(v, self.own)

    def _limits(self, q: Array) -> None:
        for name, joint in self.mech.joints.items():
            at, body = joint.q.start, self.mech.model.body(name)
            for (kind, _), pair in zip(body.motions, body.limits):
                low, high = pair or (None, None)
                below = low is not None and q[at] <= low + SOLVED
                if below or (high is not None and q[at] >= high - SOLVED):
                    self.shut.append(f"the limit of joint '{name}'")
                at += SIZE[kind][0]
        stops = Stops(self.mech)
        self.shut += [stops.all[n].label for n in stops.reached(q)]

    def torque(self, q: Array, v: Array) -> Array:
        """Return τ (nv,) of soft and penalty contacts, computed as M times their part of v'."""
        if not self.depth:
            return np.zeros(self.mech.nv)
        found = []
        for scene in self.scenes:
            state = self._whole(q, v)
            vdot, tau, flow = np.zeros_like(state[1]), np.zeros_like(state[1]), np.zeros(3)
            motion.acceleration(scene.address, 0.0, *state, tau, vdot, flow)
            found.append(vdot[: self.mech.nv])
        return self.mech.mass_matrix(q) @ (found[1] - found[0])

    @property
    def steps(self) -> tuple[float, ...]:
        """Return finite-difference steps in q [rad, m] that preserve contact."""
        return tuple(share * self.depth / max(1.0, self.mech.packed.length) for share in DEPTHS)

    def slopes_in_v(self, q: Array, v: Array) -> Array:
        """Compute the (nv, nv) derivatives of `torque` in v, by fourth-order differences.

        Their best step is EPS^(1/5) of the slip at which regularised friction bends.
        """
        h = EPS ** (1 / 5) * CREEP / max(1.0, self.mech.packed.length)

        def odd(step: Array) -> Array:
            return self.torque(q, v + step) - self.torque(q, v - step)

        found = [8 * odd(h * e) - odd(2 * h * e) for e in np.eye(self.mech.nv)]
        return np.array(found).T / (12 * h)
