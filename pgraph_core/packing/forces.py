"""Forces as kernel tables, with the columns defined in `engine/layout.py`.

*Drives* act in joints: springs, dampers, friction, tendons, motors, servos. *Loads* act on bodies
and between two bodies: wrenches, springs, torsion springs, drags.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from operator import is_
from typing import Any

import numpy as np

from .. import joints
from ..engine.records import CREEP, JOINT_FORCE, rows_of, table
from ..engine.signals import DRIVE
from ..fields import OfSums
from ..forces import LOADS, VIA, Load, OnBody, OnJoint
from ..model import Body, Force, Model, Table, Tendon
from ..topology import Topology
from . import Array, Drives, Ints, Loads, System, joint_coordinates
from .placed import Placed
from .riders import NO_RIDERS, Riders
from .signals import NO_SIGNALS, limits_of, values_of_targets


def empty(kind: Load) -> tuple[Any, Array, Any]:
    """Return empty (table, knots, via points) for a kind without loads."""
    return table(kind.row, 0), np.zeros((0, kind.columns)), table(VIA, 0)


NO_LOADS = Loads(*map(empty, LOADS), NO_RIDERS, NO_SIGNALS)


def on_bodies(forces: Sequence[Force]) -> list[OnBody]:
    """Return the forces that act on bodies, not in joints."""
    return [f for f in forces if isinstance(f, OnBody)]


def exerts(f: Force) -> bool:
    """Check whether a force may act in a run. One on bodies that is always zero does not."""
    return not isinstance(f, OnBody) or f._exerts


def loads(
    model: Model,
    topology: Topology,
    packed: System,
    forces: tuple[Force, ...],
    home: tuple[Array, Array],
) -> Loads:
    """Pack the loads in `forces`, given the bodies' poses in the initial state `home`."""
    at = Placed(model, topology, packed, home)
    ours = [[f for f in on_bodies(forces) if type(f) in kind.parts] for kind in LOADS]
    riders = Riders(at, len(packed.rows) + len(model.states))
    tables = [_loads(kind, own, at, riders) for kind, own in zip(LOADS, ours)]
    for rows, _, _ in tables:
        rows["room"] = riders.end
    return Loads(*tables, riders.table(), NO_SIGNALS)


def _loads(
    kind: Load, ours: Sequence[OnBody], at: Placed, riders: Riders
) -> tuple[Any, Array, Any]:
    """Return (table, knots, via points) for all loads of one kind, and add to the riders."""
    parts = [part for f in ours for part in kind.split(f, at)]
    found, (_, none, _) = table(kind.row, len(parts)), empty(kind)
    knots, places = [none], list[tuple[Any, ...]]()
    for one, f in zip(found, parts):
        one["body_a"], one["body_b"] = (at.number(name) for name in f.pair)
        one["row_a"], one["row_b"] = (at.packed.row_of(int(one[x])) for x in ("body_a", "body_b"))
        own = kind.others.get(type(f), kind.pack)(f, one, at)
        own = none if own is None else own
        one["first_knot"], one["knots"] = sum(map(len, knots)), len(own)
        knots.append(own)
        own = riders.carry(f, one, at.vias(f))
        one["first_via"], one["vias"] = len(places), len(own)
        places += own
    return found, np.concatenate(knots), rows_of(VIA, places)


# -- drives --------------------------------------------------------------------------------


LATEST: list[tuple[tuple[Force, ...], Any, Drives]] = []  # the latest arguments and results
KEPT_ANSWERS = 4


def drives(model: Model, topology: Topology, packed: System, forces: tuple[Force, ...]) -> Drives:
    """Return rows for joint springs and dampers, and for the tendons, motors and servos in
    `forces`.

    Taken from an earlier answer to the same: models of a sweep share their forces.
    """
    springs = [
        (b.name, b.stiffness, b.damping, b.rest, b.friction) if has_springs(b) else b.name
        for b in model.bodies
    ]
    places = [packed.rows, packed.body_of_row, topology.row]
    places += [packed.q] if any(isinstance(f, Tendon) for f in forces) else []
    asked = springs, [x.tobytes() for x in places]
    same = (
        answer
        for known, other, answer in LATEST
        if len(known) == len(forces) and all(map(is_, known, forces)) and other == asked
    )
    found = next(same, None)
    if found is None:
        found = _drives(model, topology, packed, forces)
        LATEST[:] = [(forces, asked, found), *LATEST[: KEPT_ANSWERS - 1]]
    copies = {name: getattr(found, name).copy() for name in ("table", "knots", "terms")}
    return found._replace(**copies)  # a batch writes into them


def _drives(model: Model, topology: Topology, packed: System, forces: tuple[Force, ...]) -> Drives:
    rows: list[tuple[float, ...]] = []
    knots = Knots()
    terms: list[tuple[float, float, float]] = []
    for number, row in enumerate(topology.row.tolist(), start=1):
        body = model.bodies[row]
        if has_springs(body):
            rows += _springs(body, joint_coordinates(packed, number), knots)
    for f in forces:
        if isinstance(f, Tendon):
            own = terms_of(f, topology, packed)
            rest = length_at(own, packed.q) if f.rest is None and f.stiffness else f.rest or 0.0
            place = _placed(own, f.stiffness != 0, terms)
            spans = *knots.put(rest), *knots.put(0.0)
            law = f.stiffness, f.damping, -np.inf, np.inf, f.friction, CREEP
            rows.append((*place[:2], *law, *spans, *place[2:], *AT_ONCE))
    passive = len(rows)
    for f in forces:
        if isinstance(f, OnJoint):
            _, _, kp, kd = f.law
            target, torque = input_tables(f)
            place = _placed(terms_of(f, topology, packed), kp != 0, terms)
            spans = *knots.put(target), *knots.put(torque)
            follows = AT_ONCE
            if f.has_state:
                follows = _following(knots.own(spans[0] if f.aims else spans[2]), f)
            rows.append((*place[:2], kp, kd, *f.torques, 0.0, CREEP, *spans, *place[2:], *follows))
        elif not isinstance(f, (OnBody, Tendon)):
            raise TypeError(f"a force of kind '{f.kind}' has no row in any table")
    columns = knots.table(), passive, np.array(terms).reshape(-1, 3)
    return Drives(rows_of(JOINT_FORCE, rows), *columns)


def terms_of(part: OfSums, topology: Topology, packed: System) -> list[tuple[int, int, float]]:
    """Return (index into v, index into q or -1, factor) for each coordinate that a part acts on."""
    return [(*joint_coordinates(packed, topology.number(name))[k], x) for name, k, x in part.terms]


def acting_on(drives: Drives, row: Any) -> tuple[Ints, Array]:
    """Return (indices into v, factors) for the coordinates that a row of drives acts on."""
    if not row["terms"]:
        return np.array([row["velocity"]]), np.ones(1)
    own = drives.terms[row["first_term"] : row["first_term"] + row["terms"]]
    return own[:, 0].astype(np.int64), own[:, 2]


def drive_forces(drives: Drives, signals: Any, t: Array, q: Array, v: Array) -> Array:
    """Return the torque or force of each motor, servo and actuator at n states, (n, drives).

    It is that of `engine.drives.drive`: within its limits, and before the gear.
    """
    varying = values_of_targets(signals, DRIVE, t, q, v)
    found = np.empty((len(t), len(drives.table) - drives.passive))
    limits = limits_of(drives.table, signals[0])
    for one, force, limit in zip(drives.table[drives.passive :], found.T, limits[drives.passive :]):
        own, factors = acting_on(drives, one)
        aims, follows = one["coordinate"] >= 0, tuple(one[name] for name in FOLLOWS)
        torque, target = (
            varying[first] if first in varying else acting(drives.knots, first, count, how, t)
            for first, count, how in (
                (int(one["first_torque"]), one["torques"], AT_ONCE if aims else follows),
                (int(one["first_target"]), one["targets"], follows if aims else AT_ONCE),
            )
        )
        force[:] = torque - one["damping"] * (v[:, own] @ factors)
        if aims:
            terms = drives.terms[one["first_term"] :][: one["terms"]]
            at_q = terms[:, 1].astype(np.int64) if len(terms) else [one["coordinate"]]
            force += one["stiffness"] * (target - q[:, at_q] @ factors)
        np.clip(force, *limit, out=force)
    return found


def acting(knots: Array, first: int, count: int, follows: Follows, t: Array) -> Array:
    """Return the effective value of an input at times t (n,), as `engine.drives.acting` does."""
    own = knots[first : first + count]
    k = np.maximum(np.searchsorted(own[:, 0], t, side="right") - 1, 0)
    ahead, slope = np.maximum(t - own[k, 0], 0.0), np.where(k + 1 < count, own[k, 2], 0.0)
    if follows == AT_ONCE:
        return own[k, 1] + slope * ahead
    now = zip(own[k, 1].tolist(), slope.tolist(), own[k, 3].tolist(), ahead.tolist())
    return np.array([followed(follows, *each) for each in now])


def length_at(terms: Sequence[tuple[int, int, float]], q: Array) -> float:
    """Return the sum of factor x q."""
    return float(sum(x * q[at_q] for _, at_q, x in terms))


def _placed(
    own: Sequence[tuple[int, int, float]], springs: bool, terms: list[tuple[float, float, float]]
) -> tuple[int, int, int, int]:
    """Return (velocity, coordinate, first term, terms) for a row, and append to `terms`."""
    at_v, at_q, factor = own[0]
    at_q = at_q if springs else -1
    if len(own) == 1 and factor == 1.0:
        return at_v, at_q, 0, 0
    terms += own
    return at_v, at_q, len(terms) - len(own), len(own)


def input_tables(f: OnJoint) -> tuple[float | Table, float | Table]:
    """Return (target, torque) in kernel form, with the law torque + kp (target - q) - kd v.

    The input u adds gain u to the torque, or gain u / kp to the target if it aims. If the input is
    integrated, `torque` is included in the initial value.
    """
    gain, torque, kp, _ = f.law
    u: Any = getattr(f, f.INPUT)
    if not f.aims and str in (type(u), type(torque)):
        return 0.0, 0.0  # their sum comes from the expressions
    u, torque = (0.0 if isinstance(x, str) else x for x in (u, torque))
    if f.integrates:
        u = _parted(u) if isinstance(u, Table) else u
        torque = torque if f.aims else 0.0
    if f.aims:
        return _scaled(u, gain / kp), torque
    if isinstance(torque, Table) and isinstance(u, Table):
        t = np.union1d(torque.t, u.t)
        sums = np.interp(t, torque.t, torque.value) + gain * np.interp(t, u.t, u.value)
        return 0.0, Table(t=t, value=sums)
    if isinstance(u, Table):
        return 0.0, _added(_scaled(u, gain), torque)
    return 0.0, _added(torque, gain * u)


def _added(value: Any, by: Any) -> float | Table:
    if isinstance(value, Table):
        return value.unchecked_copy({"value": tuple(x + by for x in value.value)})
    return value + by


def _scaled(value: float | Table, by: float) -> Any:
    if by == 1.0:
        return value
    if isinstance(value, Table):
        return value.unchecked_copy({"value": tuple(by * x for x in value.value)})
    return by * value


def bends(drives: Drives) -> Array:
    """Return the times in ascending order at which the slope in a drive table changes [s]."""
    table, t = drives.table, drives.knots[:, 0]
    spans = [(table["first_target"], table["targets"]), (table["first_torque"], table["torques"])]
    found = [_times_of_tables(t, *span) for span in spans]
    found += [times_at_bounds(row, drives.knots) for row in table]
    return np.unique(np.concatenate(found))


def times_at_bounds(row: Any, knots: Array) -> Array:
    """Return the times between two knots at which an input, or its integral, reaches a bound [s].

    There are none if the motion counts. The times are the zeros of u s + slope s^2 / 2 = c for an
    integral, and of slope s = c for an input, where c is the distance to the bound.
    """
    # constants alone limit the effect, whatever the motion
    alone = row["coordinate"] < 0 and row["damping"] == 0.0 and row["lag"] == 0.0
    if not (row["integrates"] or (alone and np.isfinite([row["low"], row["high"]]).any())):
        return np.zeros(0)
    of = ("first_target", "targets") if row["coordinate"] >= 0 else ("first_torque", "torques")
    first, count = int(row[of[0]]), int(row[of[1]])
    found = list[float]()
    for n, (t, u, slope, y) in enumerate(knots[first : first + count].tolist(), start=1):
        slope, end = (slope, float(knots[first + n, 0])) if n < count else (0.0, np.inf)
        for name in ("least", "most") if row["integrates"] else ("low", "high"):
            c, rate = float(row[name]) - (y if row["integrates"] else u), slope
            if row["integrates"]:
                root = u * u + 2.0 * slope * c
                rate = 0.5 * (u + np.copysign(np.sqrt(root), u)) if root >= 0.0 else 0.0
            if np.isfinite(c) and rate != 0.0 and 0.0 < c / rate < end - t:
                found.append(t + c / rate)
    return np.array(found)


def bends_of_loads(loads: Loads) -> Array:
    """Return the times in ascending order at which the slope in a wrench table changes [s]."""
    table, knots, _ = loads.wrench
    return _times_of_tables(knots[:, 0], table["first_knot"], table["knots"])


def _times_of_tables(t: Array, first: Any, count: Any) -> Array:
    """Return the times in all tables with more than one entry."""
    parts = zip(first[count > 1].tolist(), count[count > 1].tolist())
    return np.concatenate([t[:0], *(t[i : i + n] for i, n in parts)])


def has_springs(body: Body) -> bool:
    """Check whether a joint has a spring, a damper or friction."""
    return any(body.stiffness) or any(body.damping) or any(body.friction)


def _springs(body: Any, at_vq: list[tuple[int, int]], knots: Knots) -> list[tuple[float, ...]]:
    """Return one row per degree of freedom for a joint with a spring, a damper or friction."""
    found: list[tuple[float, ...]] = []
    start = 0
    columns = (body.stiffness, body.damping, body.rest, body.friction)
    for m, k, d, rest, friction in zip(body.sequence, *columns):
        size = joints.SIZE[m.kind][1]
        for at_v, at_q in at_vq[start : start + size]:
            none = knots.put(0.0)
            place = (at_v, at_q if k else -1)
            law = k, d, -np.inf, np.inf, friction, CREEP
            found.append((*place, *law, *knots.put(rest), *none, 0, 0, *AT_ONCE))
        start += size
    return found


class Knots:
    """Concatenated drive tables, with columns for time, value, next slope and active value."""

    def __init__(self) -> None:
        self._parts: dict[int, Array] = {}  # by their first row
        self._count = 0

    def put(self, value: float | Table) -> tuple[int, int]:
        """Append a constant or a table. Return (first knot, number of knots)."""
        first = self._count
        constant = isinstance(value, float | int)
        part = np.array([[0.0, value, 0.0, value]]) if constant else value.lines
        self._parts[first] = part
        self._count += len(part)
        return first, len(part)

    def own(self, first: int) -> Array:
        """Return a writable (n, 4) copy of the table that starts at this row."""
        self._parts[first] = self._parts[first].copy()
        return self._parts[first]

    def table(self) -> Array:
        """(all knots, 4)."""
        return np.concatenate([np.zeros((0, 4)), *self._parts.values()])


Follows = tuple[Any, ...]  # lag, whether the integral acts, its bounds
FOLLOWS = ("lag", "integrates", "least", "most")  # their fields in a row of drives
STATE_OF = "state of "  # beginning of the names of drives' states
AT_ONCE: Follows = (0.0, 0, -np.inf, np.inf)


def _following(knots: Array, f: OnJoint) -> Follows:
    """Write the active value at each knot into the last column. Return the response."""
    gain, torque, kp, _ = f.law
    scale, shift = (
        (gain / kp, 0.0) if f.aims else (gain, torque if isinstance(torque, float) else 0.0)
    )
    least, most = sorted(shift + scale * x if scale else shift for x in f.states)
    follows = f.lag, int(f.integrates), least, most
    begin = 0.0 if f.integrates else None
    begin = begin if f.start is None else f.start
    y = float(knots[0, 1]) if begin is None else shift + scale * begin
    _follow(knots, follows, y)
    return follows


def _follow(knots: Array, follows: Follows, y: float) -> None:
    """Write the active value at each knot into the last column, y at the first."""
    for n, (t, u, slope, _) in enumerate(knots.tolist()):
        knots[n, 3] = y
        if n + 1 < len(knots):
            y = followed(follows, u, slope, y, float(knots[n + 1, 0]) - t)


def followed(follows: Follows, u: float, slope: float, y: float, ahead: float) -> float:
    """Return the active value at a time `ahead` after y, for an input u + slope t."""
    lag, integrates, least, most = follows
    if integrates:
        return min(max(y + (u + 0.5 * slope * ahead) * ahead, least), most)
    from ..engine.drives import followed as of_lag

    return float(of_lag(y, u, slope * ahead, ahead / lag))


def states_of_drives(names: Sequence[str], drives: Drives, t: float) -> dict[str, Array]:
    """Return {drive: (1,)} of the states of lags and integrals at time t, by the packed law."""
    found = dict[str, Array]()
    for name, row in zip(names, drives.table[drives.passive :]):
        if (knots := _own_knots(row, drives.knots)) is not None:
            n = max(int(np.searchsorted(knots[:, 0], t, side="right")) - 1, 0)
            last = n + 1 == len(knots)
            start, u, slope, y = knots[n].tolist()
            ahead = max(t - start, 0.0)
            follows = tuple(row[list(FOLLOWS)].item())
            found[STATE_OF + name] = np.array(
                [followed(follows, u, 0.0 if last else slope, y, ahead)]
            )
    return found


def drives_begun_from(names: Sequence[str], drives: Drives, states: Mapping[str, Array]) -> Drives:
    """Return the drives with these states of lags and integrals, as of `states_of_drives`."""
    drives = drives._replace(knots=drives.knots.copy())
    for name, row in zip(names, drives.table[drives.passive :]):
        knots, y = _own_knots(row, drives.knots), states.get(STATE_OF + name)
        if knots is not None and y is not None:
            _follow(knots, tuple(row[list(FOLLOWS)].item()), float(y[0]))
    return drives


def _own_knots(row: Any, knots: Array) -> Array | None:
    """Return the input of a drive with a lag or an integral as a view, or None."""
    if not (row["lag"] > 0.0 or row["integrates"]):
        return None
    of = ("first_target", "targets") if row["coordinate"] >= 0 else ("first_torque", "torques")
    first, count = int(row[of[0]]), int(row[of[1]])
    return knots[first : first + count]


def _parted(u: Table) -> Table:
    """Insert a knot wherever the input crosses zero, so that its sign is constant between knots."""
    t, x = np.array(u.t), np.array(u.value)
    k = np.flatnonzero(x[:-1] * x[1:] < 0)
    zero = t[k] + (t[k + 1] - t[k]) * x[k] / (x[k] - x[k + 1])
    return Table(t=np.insert(t, k + 1, zero), value=np.insert(x, k + 1, 0.0)) if len(k) else u
