"""Notices about contacts and limits against which constraints or motions drive bodies."""

from __future__ import annotations

from collections import Counter
from collections.abc import Sequence
from typing import TYPE_CHECKING, Any

import numpy as np

from ..analysis.singular import holding
from ..contact.tables import ContactPair, Tables, pull_of
from ..dynamics.scene import Scene
from ..engine import layout as at
from ..engine.records import SOFT
from ..fields import EVERY, GROUND
from ..mechanism import Mechanism
from ..model import Spring
from ..packing import Array, Ints
from ..packing.forces import acting_on, drive_forces
from ..tolerances import NAMED, SOLVED, VISIBLE
from .clearance import gaps_later
from .fastened import fastened
from .run_plan import Idle, RunPlan

if TYPE_CHECKING:
    from .event_scene import ContactPoint

PAIRS_NAMED = 3  # names in a notice, which more would make too long to read


def limited_bodies(mech: Mechanism, tables: Tables) -> list[str]:
    """Return the name of the body that moves towards each limit."""
    ends = mech.packed.system.body_of_row[tables.limit_blocks[0][:, (at.B_A, at.B_B)]]
    return [mech.topology.names[(int(a) or int(b)) - 1] for a, b in ends]  # the ground is 0


def limits_passed(mech: Mechanism, tables: Tables, active: Ints, t: Array, q: Array) -> list[str]:
    """Return a notice for each limit passed by a coordinate or length at the states q (n, nq)."""
    ints, floats, *_ = tables.limit_blocks
    found, limits = [], tables.coordinate_limits
    springs = (f for f in mech.model.forces if isinstance(f, Spring) for x in (f.low, f.high) if x)
    for name, block, values in zip(tables.limits, ints, floats):
        if block[at.B_TYPE] in (at.T_SLACK, at.T_WRAP):
            continue
        limit = next(limits) if block[at.B_TYPE] != at.T_SPAN else None
        spring: Any = next(springs) if limit is None else None
        k = -1 if limit is not None else mech.path_names.index(spring.name)
        if limit is not None:
            gap = limit.gap(q)
        else:
            gap = np.copysign(mech.path_length(q)[:, k], values[at.VALUE]) - values[at.VALUE]
        passed = np.flatnonzero(gap < -VISIBLE * values[at.SIZE])
        if len(passed):
            i, deepest = int(passed[0]), float(-gap.min())
            if limit is not None:
                way, body = limit.slope(mech.nv), _of(mech, int(limit.at_v[0]))
            else:
                arms, body = mech.moment_arms(q[i])[k], spring.body
                way = -np.copysign(1.0, values[at.VALUE]) * arms
            by = _by(holding(mech, active, float(t[i]), q[i], way), body, f"limit '{name}'")
            text = (
                f"at t = {t[i]:.6g} s limit '{name}' is exceeded by up to {deepest:.3g} rad or m: "
            )
            do = "use a smaller step" if i else "start within the limit"
            found.append(text + (by or do))
    return found


def yielding(
    mech: Mechanism, tables: Tables, k: int, depths: tuple[float, float, float], overlaps: bool
) -> str:
    """Return advice for a soft or penalty contact k that is deeper than its law allows for.

    It starts at the first of the `depths`, and is deepest at the second, a share of the thickness,
    the third. If it never is deeper than at the start, its own depth is that by weight. The energy
    of a depth d grows as d^2.5 or d², and faster than the force.
    """
    law, (began, depth, share) = tables.laws[k], depths
    if overlaps and depth <= began * (1.0 + SOLVED):
        share *= rested(mech, law) / depth
        if share < NAMED:
            return "start without overlap"
    soft = law["law"] == SOFT
    needed = float(law["stiffness"]) * (2.0 * share / NAMED) ** (2.5 if soft else 2.0)
    unit = "N/m^1.5" if soft else "N/m"
    begin = "start without overlap, and " if overlaps else ""
    return f"{begin}give it a stiffness of {needed:.2g} {unit}"


def rested(mech: Mechanism, law: Any) -> float:
    """Return the depth [m] to which the weight of all moving bodies presses a contact.

    All of them may rest on it.
    """
    moves = mech.packed.system.bodies_i[:, at.ROW] > 0
    weight = float(mech.packed.system.bodies_f[moves, at.B_MASS].sum()) * pull_of(mech.model)
    return float(weight / law["stiffness"]) ** (1.0 / power_of(law))


def power_of(law: Any) -> float:
    """Return the exponent of the depth in the force of a soft or penalty contact."""
    return 1.5 if law["law"] == SOFT else 1.0


def gaps_at_start(mech: Mechanism, tables: Tables, frames: tuple[Array, Array, Array]) -> Array:
    """Return the gaps of the pairs (n,) in the first frame [m].

    The run records the deepest places of its first step. Those of pairs of all bodies are taken.
    """
    _, q, gap = frames
    found = gaps_later(mech, tables, q[:1], {})
    start = np.array([found[pair.name][0] for pair in tables.touches])
    return np.where(np.isfinite(start), start, gap[0, : len(start)])


def pressed(mech: Mechanism, tables: Tables, frames: tuple[Array, Array, Array]) -> list[str]:
    """Return a notice for each soft or penalty contact that starts far deeper than weight presses
    it.
    """
    if not tables.compliant:
        return []
    found, gap = [], gaps_at_start(mech, tables, frames)
    for row, pair, x in zip(tables.laws, tables.touches, gap.tolist()):
        if pair.contact.law == "complementarity" or not x < 0.0:
            continue
        usual = rested(mech, row)
        times = (-x / usual) ** power_of(row) if usual > 0.0 else 0.0
        if VISIBLE * times > 1.0:
            found.append(
                f"contact '{pair.name}' starts {-x:.3g} m deep, but its static depth is "
                f"{usual:.2g} m: the force is {times:.2g} times the weight, which throws bodies "
                "apart and needs many steps; start without overlap"
            )
    return found


def bounced(mech: Mechanism, tables: Tables, active: Ints) -> list[str]:
    """Return a notice if a compliant contact only approximates the requested restitution.

    Contacts are considered individually, and constraints between trees are ignored.
    """
    compliant = [
        pair for pair in tables.touches
        if pair.contact.law != "complementarity"
        and pair.contact.damping is None and pair.contact.restitution
    ]  # fmt: skip
    if not compliant:
        return []
    parents = {b.name: b.parent for b in mech.model.bodies}

    def root(name: str) -> str:
        while parents.get(name, GROUND) != GROUND:
            name = parents[name]
        return name

    rows = [mech.model.constraints[i] for i in active.tolist()]
    held = {root(n) for c in rows for n in (c.body, getattr(c, "other", GROUND)) if n != GROUND}
    touches = Counter(
        name for pair in compliant for name in pair[1:3] if name not in (GROUND, EVERY)
    )
    names = mech.names
    parts = Counter(names[n - 1] for n in tables.geometry.shapes["body"] if n > 0)
    for pair in compliant:
        ours = [name for name in pair[1:3] if name in touches]
        tied = ours or ([*parents] if held else [])
        why = next((f"'{n}' is held by constraints" for n in tied if root(n) in held), "")
        count = next(((n, touches[n]) for n in ours if touches[n] > 1), None)
        why = why or (f"'{count[0]}' has {count[1]} compliant contacts" if count else "")
        why = why or next((f"'{n}' has {parts[n]} shapes" for n in ours if parts[n] > 1), "")
        if why:
            return [
                f"contact '{pair.contact.name}': {why}, so that its restitution is about "
                f"{pair.contact.restitution:g}, at any speed; by law 'complementarity' it is exact"
            ]
    return []


def sunk_through(mech: Mechanism, idle: Idle, start: Array, end: Array) -> list[str]:
    """Return a notice about bodies below the ground whose contacts with it are not active.

    `start` and `end` (nq,) are the first position and the last.
    """
    last, first = (mech.poses(q).position @ idle.normal for q in (end, start))
    rows = ((mech.topology.number(body) - 1, body) for body in idle.contact_of)
    below = {body: idle.contact_of[body] for k, body in rows if last[k] < 0.0 < first[k]}
    if not below:
        return []
    contacts, bodies = list(dict.fromkeys(below.values())), list(below)
    more = f" and {len(bodies) - PAIRS_NAMED} more" if len(bodies) > PAIRS_NAMED else ""
    scenarios = [s.name for s in mech.model.scenarios if set(contacts) & set(s.contacts or ())]
    by_scenario = f", or choose scenario={scenarios[0]!r}" if scenarios else ""
    return [
        f"{_named(bodies[:PAIRS_NAMED])}{more} went through the ground: contact "
        f"{_named(contacts[:PAIRS_NAMED])} does not act here; make it active{by_scenario}"
    ]


def _named(names: list[str]) -> str:
    """Join names as 'a', 'b' and 'c'."""
    quoted = [f"'{name}'" for name in names]
    return " and ".join(filter(None, (", ".join(quoted[:-1]), quoted[-1])))


def driven_into(
    mech: Mechanism, tables: Tables, active: Ints, k: int, frames: tuple[Array, Array, Array],
    when: float,
) -> str:  # fmt: skip
    """Return the constraint that drives the bodies of pair k into each other, or "" if there is
    none.

    Bodies in contact between them are included.
    """
    t, q, gap = frames
    i = min(int(np.searchsorted(t, when)), len(t) - 1)
    pairs = [p if EVERY not in p[1:3] else None for p in tables.touches]
    pair, when = pairs[k], float(t[i])
    if text := fastened(mech, active, tables.touches[k]):
        return text
    if pair is None:
        return ""
    rigid = pair.contact.law == "complementarity"
    normal = np.array(mech.model.ground_normal)
    if pair.other != GROUND:
        apart = mech.pose(q[i], pair.body)[0] - mech.pose(q[i], pair.other)[0]
        size = float(np.linalg.norm(apart))
        normal = apart / size if size else normal
    way = normal @ _parting(mech, pair, q[i])
    if alone := holding(mech, active, when, q[i], way):
        return _by(alone, pair.body, f"contact '{pair.name}'", rigid)
    began = int(np.flatnonzero(np.append(True, gap[:i, k] > 0.0))[-1])
    closed = gap[began : i + 1].min(axis=0) <= 0.0  # pressed points rebound between frames
    others = [p for n, p in enumerate(pairs) if p and n != k and closed[n]]
    rows = [row for other in others for row in _parting(mech, other, q[i])]
    by = holding(mech, active, when, q[i], way, rows) if rows else []
    names = " and ".join(f"'{p.name}'" for p in [pair, *others][:PAIRS_NAMED])
    return _by(by, pair.body, f"contacts {names}", rigid)


def overpowering(
    mech: Mechanism, scene: Scene, plan: RunPlan, frames: tuple[Array, Array, Array]
) -> str:
    """Return the drive that moves a touching body by a thickness within a step, or "".

    Contacts are searched as far as the velocity at the start of a step leads. The frames (t, q, v)
    include the states of controls.
    """
    drives, (t, q, v), nv = scene.drives, frames, mech.nv
    if plan.contacts is None or drives.passive == len(drives.table):
        return ""
    width, thick = float(plan.width.max(initial=0.0)), _thinner(mech, plan.contacts)
    least = min((x for *_, x in thick), default=np.inf)
    fastest = int(np.abs(v[:, :nv]).sum(axis=1).argmax())
    if not np.abs(v[fastest]).max() * width * max(1.0, mech.packed.length) > least:
        return ""
    forces = np.abs(drive_forces(drives, scene.loads.signals, t, q, v)).T
    for name, one, force in zip(plan.driving, drives.table[drives.passive :], forces):
        i, (own, factors), pushed = int(force.argmax()), acting_on(drives, one), np.zeros(nv)
        pushed[own] = force[i] * width**2 * factors
        moved = np.linalg.solve(mech.mass_matrix(q[i, : mech.nq]), pushed)
        for pair, body, thickness in thick:
            far = float(np.linalg.norm(mech.jacobian(q[i, : mech.nq], body)[3:] @ moved))
            slopes = mech.jacobian(q[fastest, : mech.nq], body)[3:]
            went = width * float(np.linalg.norm(slopes @ v[fastest, :nv]))
            if thickness < min(far, went) < np.inf:
                slides = mech.packed.slides[own[0]]
                kind, unit = ("force", "N") if slides else ("torque", "N m")
                share = thickness / far
                return (
                    f"at t = {t[i]:.6g} s '{name}' moves '{body}' by {far:.3g} m within a step of "
                    f"{width:.3g} s, more than the thickness of what touches in contact "
                    f"'{pair.name}' ({thickness:.3g} m), which cannot stop it: limit the {kind} of "
                    f"'{name}' to {0.5 * force[i] * share:.2g} {unit}, or use a step of "
                    f"{0.5 * width * np.sqrt(share):.2g} s"
                )
    return ""


def _thinner(mech: Mechanism, tables: Tables) -> list[tuple[ContactPair, str, float]]:
    """Return (pair, body, thickness of the thinner shape [m]) for the bodies of rigid contacts."""
    shapes, found = tables.geometry.shapes, []
    thick = 2.0 * shapes["half_extents"].min(axis=1)
    for pair in tables.touches:
        names = [name for name in pair[1:3] if name not in (GROUND, EVERY)]
        own = thick[np.isin(shapes["body"], [mech.topology.number(name) for name in names])]
        least = float(own[own > 0.0].min(initial=np.inf))
        if pair.contact.law == "complementarity" and least < np.inf:
            found += [(pair, name, least) for name in names]
    return found


def _parting(mech: Mechanism, pair: ContactPair, q: Array) -> Array:
    """Return the Jacobian of the relative motion of a pair's two bodies, (3, nv) in world axes."""
    way = mech.jacobian(q, pair.body)[3:]
    return way if pair.other == GROUND else way - mech.jacobian(q, pair.other)[3:]


def contradicted(
    mech: Mechanism, active: Ints, points: Sequence[ContactPoint], t: float, q: Array
) -> str:
    """Return a message about closed points and limits that constraints drive bodies against."""
    found: dict[str, str] = {}
    for p in points:
        if p.limit is not None:
            way, what = p.limit.slope(mech.nv), f"limit '{p.name}'"
        else:
            normal = np.array(mech.model.ground_normal)
            way = mech.jacobian(q, p.body, p.point)[3:].T @ normal
            what = f"the ground (contact '{p.pair}')"
        if names := holding(mech, active, t, q, way):
            found[what] = _by(names, p.body, what)
    return "; ".join(list(found.values())[:PAIRS_NAMED])


def pressed_between(mech: Mechanism, active: Ints, scene: Scene, tables: Tables) -> str:
    """Return a message about the constraints, contacts and limits that no velocities satisfy."""
    assert scene.touching is not None
    push, tally, found = scene.touching.conflict, scene.touching.tally, scene.touching.found
    first, begin = int(tally["first_limit"]), int(tally["first_contact"])
    most = float(push[first : begin + len(found)].max())
    limits = push[first : first + len(tables.limits)] > NAMED * most
    points = found[push[begin : begin + len(found)] > NAMED * most]
    for k in np.unique(points["pair"]).tolist():
        if text := fastened(mech, active, tables.touches[k]):
            return text
    bodies = np.where(points["shape_b"] < 0, 0, tables.geometry.shapes["body"][points["shape_b"]])
    ends = zip(tables.geometry.shapes["body"][points["shape_a"]].tolist(), bodies.tolist())
    places = [GROUND, *mech.topology.names]
    held = {name: float(push[a:b].max(initial=0.0)) for name, a, b in scene.spans}
    names = [name for name, x in held.items() if x > NAMED * max(held.values())]
    driven = [c.body for c in mech.model.constraints if c.name in names]
    touched: dict[tuple[str, str], str] = {}
    for (a, b), k in zip(ends, points["pair"].tolist()):
        pair = places[b], places[a]
        pair = pair if pair[0] in driven and pair[1] not in driven else pair[::-1]
        touched.setdefault(pair, tables.touches[k].name)
    rows = sorted(touched.items(), key=lambda one: one[0][0] not in driven)
    texts = [
        f"'{a}' against {'the ground' if b == GROUND else repr(b)} (contact '{name}')"
        for (a, b), name in rows
    ]
    stops = zip(limited_bodies(mech, tables), tables.limits, limits)
    texts += [f"'{body}' against limit '{name}'" for body, name, at_it in stops if at_it]
    return _conflict(names, " and ".join(texts[:PAIRS_NAMED]))


def _of(mech: Mechanism, v: int) -> str:
    """Return the body whose joint has this degree of freedom."""
    return next(name for name, joint in mech.joints.items() if joint.v.start <= v < joint.v.stop)


def _by(names: Sequence[str], body: str, what: str, rigid: bool = True) -> str:
    return _conflict(names, f"'{body}' against {what}", rigid) if names else ""


def _conflict(names: Sequence[str], what: str, rigid: bool = True) -> str:
    drive = "constraint {} drives" if len(names) == 1 else "constraints {} drive"
    named = " and ".join(f"'{name}'" for name in names[:PAIRS_NAMED])
    why = "and neither can yield" if rigid else "which cannot stop it"
    return (
        f"{drive.format(named)} {what}, {why}: end the motion earlier, or use a servo with a "
        "torque_limit"
    )
