"""A motion as every engine gets it: rows, joint actuators, pinned points, a state, times."""

from __future__ import annotations

import time
from typing import Any, NamedTuple

import numpy as np

from pgraph_core import Constraint, Force, Mechanism, Model, Motor, Point, Servo, Table
from pgraph_core.rotation import matrix

from .rows import PLAIN, Array, Row, rows_of, sizes

NO_KNOTS = np.zeros(1)


class Actuator(NamedTuple):
    """A force on one joint coordinate: -kp q - kd v + u(t), u by straight lines between knots."""

    row: int
    q: int  # index into our q
    v: int  # index into our v
    kp: float
    kd: float
    t: Array  # (k,) [s]
    u: Array  # (k,)


class Pin(NamedTuple):
    """A point of a body that is fixed in the world, or at a point of another body."""

    name: str
    row: int
    point: Array  # (3,) in the axes of the row
    other: int  # row, -1 for the world
    place: Array  # (3,) in the axes of the other row, or in the world


class Exported(NamedTuple):
    """A motion as every engine gets it."""

    model: Model
    rows: list[Row]
    q: Array  # initial state, in Pgraph's coordinates
    v: Array
    t: Array  # (n,) from 0
    actuators: tuple[Actuator, ...]
    pins: tuple[Pin, ...]

    @property
    def bends(self) -> Array:
        """The times within the run at which a curve u(t) of an actuator bends."""
        bends = [d.t[(d.t > 0) & (d.t < self.t[-1])] for d in self.actuators]
        return np.unique(np.concatenate((np.zeros(0), *bends)))

    @property
    def knots(self) -> Array:
        """The times at which a run has to stop: those of output, and the bends."""
        found = np.unique(np.concatenate((self.t, self.bends)))
        near = np.diff(found, append=np.inf) > 1e-12 * self.t[-1]
        return np.union1d(found[near], self.t)


class Clocks:
    """Wall and processor time since it was created."""

    def __init__(self) -> None:
        self.began = time.perf_counter(), time.thread_time()

    def read(self) -> tuple[float, float]:
        """(wall, processor) seconds so far."""
        return time.perf_counter() - self.began[0], time.thread_time() - self.began[1]


class Trajectory(NamedTuple):
    """The motion that an engine computed, in Pgraph's coordinates."""

    q: Array  # (n, nq)
    seconds: tuple[float, float]  # time of the steps alone: wall clock, processor
    counters: dict[str, int]


class Refused(Exception):
    """A motion that an engine is not given, with the reason in words."""


def exported(
    mech: Mechanism, q: Array, v: Array, t: Array, scenario: str | None, tau: Any
) -> Exported:
    """The motion for the engines. Raises Refused if it has parts that they are not given."""
    model = mech.model
    given = None if scenario is None else model.scenario(scenario)
    rows = rows_of(model, mech.topology)
    _refuse(mech, given, tau, t)
    forces = (*model.forces, *(given.forces if given else ()))
    actuators = [*(_actuator(mech, force) for force in forces), *_springs(mech)]
    if tau is not None:
        actuators += _constant(mech, rows, np.asarray(tau, dtype=float))
    chosen = None if given is None or given.constraints is None else set(given.constraints)
    active = [c for c in model.constraints if (c.active if chosen is None else c.name in chosen)]
    pins = tuple(_pin(mech, c) for c in active)
    return Exported(model, rows, q, v, t, _merged(actuators), pins)


def _merged(actuators: list[Actuator]) -> tuple[Actuator, ...]:
    """One actuator a coordinate."""
    found: dict[int, Actuator] = {}
    for d in actuators:
        if (e := found.get(d.v)) is not None:
            t = np.union1d(d.t, e.t)
            u = np.interp(t, d.t, d.u) + np.interp(t, e.t, e.u)
            d = Actuator(d.row, d.q, d.v, d.kp + e.kp, d.kd + e.kd, t, u)
        found[d.v] = d
    return tuple(found.values())


def _refuse(mech: Mechanism, given: Any, tau: Any, t: Array) -> None:
    """Raises Refused for parts that no engine is given."""
    model = mech.model
    refuse_contacts(mech, given)
    if callable(tau):
        raise Refused("its torques are a function")
    if t[0] != 0:
        raise Refused("its times do not start at 0")
    for body in model.bodies:
        if any(body.friction):
            raise Refused(f"it has joint friction (body '{body.name}')")


def refuse_contacts(mech: Mechanism, given: Any) -> None:
    """Raises Refused for switches, contacts and joint limits."""
    if given is not None and given.switches:
        raise Refused("it has constraints that switch on and off")
    chosen = None if given is None else given.contacts
    if any(c.active if chosen is None else c.name in chosen for c in mech.model.contacts):
        raise Refused("it has contacts")
    for body in mech.model.bodies:
        if any(pair is not None and any(x is not None for x in pair) for pair in body.limits):
            raise Refused(f"it has joint limits (body '{body.name}')")


def _actuator(mech: Mechanism, force: Force) -> Actuator:
    if not isinstance(force, (Motor, Servo)):
        raise Refused(f"it has force '{force.name}', a {force.kind}")
    if np.isfinite(force.torques).any():
        raise Refused(f"it has force '{force.name}', a {force.kind} with a torque limit")
    if force.gear != 1.0 or force.coefficients or force.lag:
        raise Refused(f"it has force '{force.name}', a {force.kind} with a gear, a sum or a lag")
    servo = isinstance(force, Servo)
    kp, kd = (force.kp, force.kd) if servo else (0.0, 0.0)
    target, torque = _knots(force.target if servo else 0.0), _knots(force.torque)
    t = np.union1d(target[0], torque[0])
    u = kp * np.interp(t, *target) + np.interp(t, *torque)
    return Actuator(*_coordinate(mech, force.body, force.coordinate), kp, kd, t, u)


def _knots(curve: Any) -> tuple[Array, Array]:
    if isinstance(curve, Table):
        return np.array(curve.t), np.array(curve.value)
    return NO_KNOTS, np.full(1, float(curve))


def _springs(mech: Mechanism) -> list[Actuator]:
    """Springs and dampers of joints."""
    found = []
    for name in mech.names:
        body = mech.model.body(name)
        for i, (kp, kd, rest) in enumerate(zip(body.stiffness, body.damping, body.rest)):
            if kp or kd:
                u = np.full(1, kp * rest)
                found.append(Actuator(*_coordinate(mech, name, i), kp, kd, NO_KNOTS, u))
    return found


def _constant(mech: Mechanism, rows: list[Row], tau: Array) -> list[Actuator]:
    """Constant torques."""
    at, found = sizes(rows), []
    for i, row in enumerate(rows):
        for j in range(at.v[i], at.v[i + 1]):
            if tau[j] and row.kind not in PLAIN:
                raise Refused(f"it has torques on a {row.kind} motion (row '{row.name}')")
            if tau[j]:
                found.append(Actuator(i, at.q[i], j, 0.0, 0.0, NO_KNOTS, np.full(1, tau[j])))
    return found


def _coordinate(mech: Mechanism, name: str, motion: int) -> tuple[int, int, int]:
    """(row, index into q, index into v) of a motion of a body's joint."""
    if any(m.kind not in PLAIN for m in mech.model.body(name).sequence):
        raise Refused(f"it has an actuator or spring on a ball or free joint (body '{name}')")
    joint = mech.joints[name]
    return _first_row(mech, name) + motion, joint.q.start + motion, joint.v.start + motion


def _first_row(mech: Mechanism, name: str) -> int:
    before = mech.names[: mech.names.index(name)]
    return sum(max(1, len(mech.model.body(other).sequence)) for other in before)


def _pin(mech: Mechanism, c: Constraint) -> Pin:
    if not isinstance(c, Point):
        raise Refused(f"it has constraint '{c.name}' of kind {c.kind}")
    body, home = mech.model.body(c.body), mech.home()[0]
    point = np.array(body.tip_point if c.point is None else c.point)
    x, R = mech.pose(home, c.body)
    here = _last_row(mech, c.body), matrix(body.rotation) @ point
    if c.other == "ground":
        place = x + R @ point if c.other_point is None else np.array(c.other_point)
        return Pin(c.name, *here, -1, place)
    y, S = mech.pose(home, c.other)
    place = S.T @ (x + R @ point - y) if c.other_point is None else np.array(c.other_point)
    there = matrix(mech.model.body(c.other).rotation) @ place
    return Pin(c.name, *here, _last_row(mech, c.other), there)


def _last_row(mech: Mechanism, name: str) -> int:
    return _first_row(mech, name) + max(1, len(mech.model.body(name).sequence)) - 1
