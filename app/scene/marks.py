"""Marks on the bodies, as points and solids in body frames or in world axes (pure)."""

from __future__ import annotations

import math
from collections import defaultdict
from collections.abc import Collection, Iterator, Sequence
from typing import Any, NamedTuple

import numpy as np

import pgraph_core as pg
from pgraph_core.fields import GROUND
from pgraph_core.forces import BetweenPoints
from pgraph_core.result.bodies import body_poses
from pgraph_core.result.cams import cam_record
from pgraph_core.show import bodies, shapes
from pgraph_core.show.bodies import Look

from ..core.state import derive, of_model
from . import State
from .ties import forces_of, pivoted, point_of

Local = dict[int, np.ndarray]  # number of a body (0: the ground) -> points in its frame [m]
LONGEST = 0.8  # length of the arrow of the usual largest force over the model's size
MOST_VALUES, LEAST_VALUE = 5, 0.02  # forces with a number, the least as a part of the largest
SITE = 0.09  # length of an axis of a site's frame over the body's size
THIN = 1e-3  # least thickness of a flat ellipsoid, relative to its largest semi-axis


class Placed(NamedTuple):
    """Solids on bodies: each is a scaled unit solid at a pose in its body's frame."""

    owner: np.ndarray  # (n,) numbers of the bodies
    position: np.ndarray  # (n, 3) [m]
    wxyz: np.ndarray  # (n, 4)
    size: np.ndarray  # (n, 3) [m]


class Push(NamedTuple):
    """A force of the run at the displayed time, with its point of action."""

    at: np.ndarray  # (3,) world [m]
    force: np.ndarray  # (3,) world [N]
    bodies: tuple[str, ...]  # names of what it acts between
    of: tuple[str, str]  # ("constraints" or "contacts", name)
    friction: float | None = None  # friction of the ground, None for no cone


def showable(state: State) -> tuple[tuple[str, str], ...]:
    """Return the overlays available in this scene, as names in events and labels."""
    model = state.model
    touching = bool(model.contacts)
    held = bool(model.constraints) or touching or any(s.forces for s in model.scenarios)
    found = [
        ("shapes", "shapes", True),
        ("joining", "springs, rods, loads, pivots", _joined(model) or bool(pivoted(model))),
        (
            "branches",
            "colours of the branches",
            any(s.colour for b in model.bodies for s in b.drawn),
        ),
        ("axes", "joint axes", state.derived.dof > 0),
        (
            "tracks",
            "tracks of curves, profiles of cams",
            any(b.track for b in model.bodies) or bool(model.riding or model.cams),
        ),
        ("links", "link vectors", True),
        ("coms", "centres of mass", True),
        ("inertias", "inertia ellipsoids", any(np.any(b.inertia) for b in model.bodies)),
        ("frames", "body frames", True),
        ("sites", "sites", bool(model.sites)),
        ("names", "names", True),
        (
            "points",
            f"{'contact' if touching else 'constraint'} points",
            touching or any(getattr(c, "point", None) for c in model.constraints),
        ),
        ("forces", "forces", held),
        ("cones", "friction cones", touching and any(_friction(model, c) for c in model.contacts)),
        ("footprints", "footprints", any(len(c.points) == 1 for c in model.contacts)),
        ("follow", "camera follows", any(body.floats for body in model.bodies)),
    ]
    return tuple((what, label) for what, label, there in found if there and model.rows)


def _joined(model: pg.Model) -> bool:
    forces = (f for s in (model, *model.scenarios) for f in s.forces)
    drawn = any(isinstance(f, (BetweenPoints, pg.Cable, pg.Wrench)) for f in forces)
    return drawn or any(c.kind in ("distance", "rope") for c in model.constraints)


def looks(state: State, before: Sequence[Look] = ()) -> list[Look]:
    """Return the appearance of the bodies by number."""
    d = state.derived
    drawn = [state.whole.body(name) for name in d.names]
    graph, row = state.graph, state.row_of
    branches = (graph.branches[graph.number[row(name)] - 1] for name in d.names)
    colors = [shapes.COATS[shapes.hue_of(branch)] for branch in branches]
    return bodies.looks(drawn, d.children, colors, before, "branches" in state.shown)


def axes(state: State) -> Local:
    """Return a line along each joint axis through the body's origin.

    A joint of several motions has all axes but its last in its parent's frame.
    """
    d, half = state.derived, 0.13 * state.derived.grain
    found: dict[int, list[Any]] = defaultdict(list)
    for k, name in enumerate(d.names, 1):
        body = state.whole.body(name)
        for i, axis in enumerate(body.axes):
            a = half / math.hypot(*axis) * np.asarray(axis)
            if i == len(body.axes) - 1:
                found[k].append((-a, a))
            else:
                turned = shapes.to_matrix(np.asarray(body.rotation))
                at, a = np.asarray(body.link), turned @ a
                found[d.parent[k - 1]].append((at - a, at + a))
    return {k: np.array(lines) for k, lines in found.items()}


def tracks(state: State) -> Local:
    """Return the lines of `tracks_of` the model, which are found once."""
    return tracks_of(state.whole)


@of_model
def tracks_of(model: pg.Model) -> Local:
    """Return lines along the tracks of curves, in the frames of the parents, along the curves of
    constraints, in those of their second bodies, and those of cams and their followers."""
    d = derive(model)
    found: dict[int, list[np.ndarray]] = defaultdict(list)
    for k, name in enumerate(d.names, 1):
        body = model.body(name)
        if body.track and body.sequence[0].track:
            turned = shapes.to_matrix(np.asarray(body.rotation))
            points = np.asarray(body.link) + body.track.line() @ turned.T
            found[d.parent[k - 1]].append(np.stack((points[:-1], points[1:]), axis=1))
    for c in model.riding:
        points = c.curve.line()
        k = 1 + d.names.index(c.other) if c.other != GROUND else 0
        found[k].append(np.stack((points[:-1], points[1:]), axis=1))
    for c in model.cams:
        for name, points in ((c.other, c.profile(model)), (c.body, c.face(model))):
            lines = np.stack((points, np.roll(points, -1, axis=0)), axis=1)
            found[d.number[name]].append(lines)
    return {k: np.concatenate(lines) for k, lines in found.items()}


def links(state: State) -> Local:
    """Return lines from each body's origin to the points where its children are attached."""
    d = state.derived
    return {
        k: np.array([(np.zeros(3), state.whole.body(d.names[child - 1]).link) for child in below])
        for k, below in enumerate(d.children)
        if below
    }


def spine(state: State) -> Local:
    """Return `links` with a line to the tip of each leaf body, for large models seen from afar."""
    d, found = state.derived, links(state)
    found.pop(0, None)
    for k, below in enumerate(d.children):
        if k and not below:
            found[k] = np.array([(np.zeros(3), state.whole.body(d.names[k - 1]).tip_point)])
    return found


def coms(state: State) -> Local:
    """Centres of mass."""
    names = enumerate(state.derived.names, 1)
    return {k: np.array([state.whole.body(name).com]) for k, name in names}


def frames(state: State) -> Local:
    """Return three lines from each body's origin along its axes."""
    triad = np.stack((np.zeros((3, 3)), 0.11 * state.derived.grain * np.eye(3)), axis=1)
    return dict.fromkeys(range(1, len(state.derived.names) + 1), triad)


def sites(state: State) -> Local:
    """Return the axes of each site as three lines."""
    found: dict[int, list[Any]] = defaultdict(list)
    for site in state.model.sites:
        at, R = np.asarray(site.point), shapes.to_matrix(np.asarray(site.rotation))
        found[state.derived.number.get(site.body, 0)] += [
            (at, at + SITE * state.derived.grain * axis) for axis in R.T
        ]
    return {k: np.array(lines) for k, lines in found.items()}


def points(state: State) -> Local:
    """Return the points of contacts and constraints on their bodies."""
    found: dict[int, list[Any]] = defaultdict(list)
    model, number = state.whole, state.derived.number
    for contact in model.contacts:
        if contact.body in number:
            found[number[contact.body]] += contact.points
    for c in model.constraints:
        for name, field in zip(c.pair, ("point", "other_point")):
            if (point := getattr(c, field, None)) is not None:
                found[number.get(name, 0)].append(point)
    return {k: np.array(at) for k, at in found.items() if at}


def ellipsoids(state: State) -> Placed:
    """Return the equivalent ellipsoid of each body's mass and inertia, about its mass centre."""
    owner, size, turned, at = [], [], [], []
    for k, name in enumerate(state.derived.names, 1):
        body = state.whole.body(name)
        moments, R = np.linalg.eigh(np.asarray(body.inertia))
        if body.mass <= 0 or moments[2] <= 0:
            continue
        squares = 2.5 / body.mass * (moments.sum() - 2 * moments)  # 5/2m (I2 + I3 - I1)
        half = np.sqrt(np.maximum(squares, 0.0))
        owner.append(k)
        size.append(2 * np.maximum(half, THIN * half.max()))
        turned.append(R * np.sign(np.linalg.det(R)))
        at.append(body.com)
    wxyz = shapes.to_wxyz(np.array(turned).reshape(-1, 3, 3))
    return Placed(np.array(owner, int), np.reshape(at, (-1, 3)), wxyz, np.reshape(size, (-1, 3)))


def world(local: Local, positions: np.ndarray, R: np.ndarray) -> np.ndarray:
    """Return all points in world axes, in the order of `local`."""
    placed = [p if k == 0 else positions[k - 1] + p @ R[k - 1].T for k, p in local.items()]
    return np.concatenate(placed) if placed else np.zeros((0, 3))


def placed(solids: Placed, positions: np.ndarray, wxyz: np.ndarray) -> tuple[np.ndarray, ...]:
    """Return the positions (n, 3) and orientations (n, 4) of solids in world axes."""
    k = solids.owner - 1
    R = shapes.to_matrix(wxyz)[k]
    at = positions[k] + np.einsum("nij,nj->ni", R, solids.position)
    return at, shapes.times(wxyz[k], solids.wxyz)


# -- what joins bodies -------------------------------------------------------------------------


def loads(state: State, positions: np.ndarray, R: np.ndarray) -> np.ndarray:
    """Return arrows (n, 2, 3) for the applied forces, the largest half as long as the model."""
    found = []
    for f in forces_of(state):
        if not isinstance(f, pg.Wrench) or f.body not in state.derived.number:
            continue
        k = state.derived.number[f.body]
        force = _now(f.force, state.playback.time)
        turned = R[k - 1] @ force if f.frame == "body" else force
        at = point_of(k, f.point or (0.0, 0.0, 0.0), positions, R)
        found.append((at, turned))
    wrenches = [f for f in forces_of(state) if isinstance(f, pg.Wrench)]
    largest = max((_largest(f.force) for f in wrenches), default=0.0)
    if largest == 0.0:
        return np.zeros((0, 2, 3))
    metres = LONGEST * state.derived.size / largest
    return np.array([(at - metres * force, at) for at, force in found]).reshape(-1, 2, 3)


def _now(value: Any, time: float) -> np.ndarray:
    """Return a vector, interpolated at a time if it is a table."""
    if not hasattr(value, "t"):
        return np.asarray(_numbers(value), float)
    table = np.asarray(value.value, float)
    return np.array([np.interp(time, value.t, column) for column in table.T])


def _numbers(value: Any) -> list[float]:
    """Return a vector with its expressions, which only a run evaluates, replaced by zero."""
    return [0.0 if isinstance(x, str) else x for x in value]


def _largest(value: Any) -> float:
    table = np.asarray(value.value if hasattr(value, "t") else _numbers(value), float)
    return float(np.linalg.norm(np.atleast_2d(table), axis=1).max())


# -- forces ------------------------------------------------------------------------------------


def pushes(state: State, positions: np.ndarray, R: np.ndarray) -> list[Push]:
    """Return the constraint and contact forces of the run at the displayed time."""
    if state.run is None:
        return []
    result, d, model = state.run.result, state.derived, state.whole
    frame = min(int(np.searchsorted(result.t, state.playback.time)), len(result.t) - 1)
    found = []
    for c in model.constraints:
        if c.name in result.constraint_force and isinstance(c, pg.Cam):
            now = slice(frame, frame + 1)  # a live run grows
            pose, force = body_poses(result, now), result.constraint_force[c.name][now]
            cam = cam_record(c, result.mechanism, result.q[now], pose, force)
            of = "constraints", c.name
            found.append(Push(cam.point[0], cam.force[0], tuple(c.touches), of))
        elif c.name in result.constraint_force:
            k = d.number[c.body] - 1
            own = (x.point for x in c._places if x.body == c.body)  # points of a rope
            at = positions[k] + R[k] @ np.asarray(next(own, model.point_of(c)))
            force = np.asarray(result.constraint_force[c.name][frame, 3:])
            found.append(Push(at, force, tuple(c.touches), ("constraints", c.name)))
    normal = np.asarray(model.ground_normal)
    for contact, (body, *others), wrench in _touches(state):
        origin = positions[d.number[body] - 1]
        on_ground = contact.other == "ground"
        at = _place(wrench[frame], origin, normal if on_ground else None)
        friction = _friction(model, contact) if on_ground else None
        of = "contacts", contact.name
        found.append(Push(at, wrench[frame, 3:], (body, *others), of, friction))
    return found


def _touches(state: State) -> Iterator[tuple[pg.Contact, tuple[str, ...], np.ndarray]]:
    """Return contacts, touching bodies, and wrenches (n, 6) about the origin of the first body."""
    assert state.run is not None
    for key, wrench in state.run.result.contact_force.items():
        for contact in state.model.contacts:
            if key != contact.name and not key.startswith(f"{contact.name}["):
                continue
            inside = key[len(contact.name) + 1 : -1].split(", ")
            body = inside[0] if contact.body == "*" else contact.body
            other = inside[-1] if contact.other == "*" else contact.other
            if body in state.derived.number:
                yield contact, (body, other), np.asarray(wrench)


def _place(wrench: np.ndarray, origin: np.ndarray, normal: np.ndarray | None) -> np.ndarray:
    """Return the point on the line of action of a wrench about `origin`, on the ground if given."""
    torque, force = wrench[:3], wrench[3:]
    square = float(force @ force)
    if square == 0.0:
        return origin
    at = origin + np.cross(force, torque) / square
    if normal is None or abs(steep := float(force @ normal)) < 1e-3 * square**0.5:
        return at
    return at - force * float(at @ normal) / steep


def _friction(model: pg.Model, contact: pg.Contact) -> float:
    return contact.frictions(model.ground).kinetic


def scale(state: State) -> float:
    """Return the arrow length per newton: the run's usual maximum is half the model's length."""
    if state.run is None:
        return 0.0
    largest = state.run.usual_force
    if state.live is not None:  # a live run has no fixed largest force
        weight = 9.81 * sum(body.mass for body in state.whole.bodies)
        largest = max(largest, weight)
    return LONGEST * state.derived.size / largest if 0 < largest < np.inf else 0.0


def arrows(found: list[Push], per_newton: float) -> np.ndarray:
    """Return arrows (n, 2, 3) from the points of action of nonzero forces."""
    drawn = [(push.at, per_newton * push.force) for push in found if push.force.any()]
    return np.array([(at, at + arrow) for at, arrow in drawn]).reshape(-1, 2, 3)


def values(state: State, found: list[Push], selected: Collection[str]) -> list[list[Any]]:
    """Return the forces on the selected bodies, or the largest forces, as [x, y, z of head, text,
    part, name]."""
    found = [push for push in found if push.force.any()]
    own = [push for push in found if not set(selected).isdisjoint(push.bodies)]
    found, most = (own, len(own)) if own else (found, MOST_VALUES)
    metres = scale(state)
    sized = sorted(((float(np.linalg.norm(p.force)), p) for p in found), key=lambda one: -one[0])
    least = LEAST_VALUE * sized[0][0] if sized else 0.0
    return [
        [*(round(float(x), 5) for x in push.at + metres * push.force), f"{size:.3g} N", *push.of]
        for size, push in sized[:most]
        if size > least
    ]


def cones(found: list[Push], per_newton: float, normal: np.ndarray) -> tuple[np.ndarray, ...]:
    """Return apexes (n, 3) and sizes (n, 3) of the friction cones at ground contacts."""
    there = [push for push in found if push.friction and push.force @ normal > 0]
    tall = np.array([max(per_newton * float(push.force @ normal), 1e-9) for push in there])
    wide = 2 * tall * np.array([push.friction for push in there])
    at = np.array([push.at for push in there]).reshape(-1, 3)
    return at, np.stack((wide, wide, tall), axis=-1)
