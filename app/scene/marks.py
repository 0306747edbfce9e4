"""Marks on the bodies, as points and solids in body frames or in world axes (pure)."""

from __future__ import annotations

import itertools
import math
from collections import defaultdict
from collections.abc import Callable, Collection, Iterator, Mapping, Sequence
from typing import Any, NamedTuple

import numpy as np

import pgraph_core as pg
from pgraph_core.fields import GROUND
from pgraph_core.forces import Activated, BetweenPoints, at_state, lines_of
from pgraph_core.forces.obstacles import obstacle_of, turned_by
from pgraph_core.packing.cable_lines import Lying, cable_lines, cables_of
from pgraph_core.result.bodies import body_poses
from pgraph_core.result.cams import cam_record
from pgraph_core.rotation import unit_vector
from pgraph_core.show import bodies, shapes
from pgraph_core.show.bodies import Look
from pgraph_core.show.stage import GRID

from ..constraints.cables import bare
from ..core.state import derive, of_model
from ..pose.solving import shown_coordinate
from . import State

Local = dict[int, np.ndarray]  # number of a body (0: the ground) -> points in its frame [m]
LONGEST = 0.8  # length of the arrow of the usual largest force over the model's size
MOST_VALUES, LEAST_VALUE = 5, 0.02  # forces with a number, the least as a part of the largest
SITE = 0.09  # length of an axis of a site's frame over the body's size
RIM = 0.25  # width of a wheel without a shape over its radius
TURNING = ("revolute", "universal", "ball", "point")  # constraints that fix a point
BRACKET = 0.15  # size of a pivot's bracket on the ground, relative to the body
AT_REST, ACTIVE = np.array((120, 95, 100)), np.array((215, 40, 35))  # colours of muscles
COIL, ROD, MUSCLE = 0.07, 0.025, 0.02  # widths of springs, rods and weak muscles, of the grain
BEAD = 0.06  # diameter of the mark of a via point, of the grain
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
        ("joining", "springs, rods, loads, pivots", _joined(model) or bool(_pivots(model))),
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
    return tuple((what, label) for what, label, there in found if there and model.bodies)


def _joined(model: pg.Model) -> bool:
    forces = (f for s in (model, *model.scenarios) for f in s.forces)
    drawn = any(isinstance(f, (BetweenPoints, pg.Cable, pg.Wrench)) for f in forces)
    return drawn or any(c.kind in ("distance", "rope") for c in model.constraints)


def looks(state: State, before: Sequence[Look] = ()) -> list[Look]:
    """Return the appearance of the bodies by number."""
    d = state.derived
    drawn = [state.model.body(name) for name in d.names]
    colors = [shapes.COATS[shapes.hue_of(branch)] for branch in d.branches]
    return bodies.looks(drawn, d.children, colors, before, "branches" in state.shown)


def axes(state: State) -> Local:
    """Return a line along each joint axis through the body's origin.

    A joint of several motions has all axes but its last in its parent's frame.
    """
    d, half = state.derived, 0.13 * state.derived.grain
    found: dict[int, list[Any]] = defaultdict(list)
    for k, name in enumerate(d.names, 1):
        body = state.model.body(name)
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
    return tracks_of(state.model)


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
        k: np.array([(np.zeros(3), state.model.body(d.names[child - 1]).link) for child in below])
        for k, below in enumerate(d.children)
        if below
    }


def spine(state: State) -> Local:
    """Return `links` with a line to the tip of each leaf body, for large models seen from afar."""
    d, found = state.derived, links(state)
    found.pop(0, None)
    for k, below in enumerate(d.children):
        if k and not below:
            found[k] = np.array([(np.zeros(3), state.model.body(d.names[k - 1]).tip_point)])
    return found


def coms(state: State) -> Local:
    """Centres of mass."""
    names = enumerate(state.derived.names, 1)
    return {k: np.array([state.model.body(name).com]) for k, name in names}


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
    model, number = state.model, state.derived.number
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
        body = state.model.body(name)
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


OPENS = ("springs", "rods", "muscles", "beads")  # marks that open what they show
Part = tuple[str, str]  # "forces" or "constraints", and a name


class Span(NamedTuple):
    """A mark from one point to another."""

    begin: np.ndarray  # (3,) world [m]
    end: np.ndarray  # (3,)
    wide: float  # its width [m]
    of: Part | None = None  # the part that it shows, None for those of scenarios and of several


class Joining(NamedTuple):
    """Springs and rods between two points, as unit solids along z from one point to the other."""

    ends: np.ndarray  # (n, 2, 3) world [m]
    at: np.ndarray  # (n, 3) their middles, world [m]
    wxyz: np.ndarray  # (n, 4)
    size: np.ndarray  # (n, 3) [m]
    of: tuple[Part | None, ...] = ()  # (n,) the part that each shows
    colors: np.ndarray | None = None  # (n, 3) from 0 to 255, if they differ

    def only(self, part: Part | None) -> Joining:
        """Return the marks that show one part."""
        its = np.array([part is not None and one == part for one in self.of], bool)
        ends, at, wxyz, size = (x[its] for x in self[:4])
        colors = None if self.colors is None else self.colors[its]
        return Joining(ends, at, wxyz, size, (part,) * len(at), colors)

    def names(self) -> list[tuple[str, str, int]]:
        """Return (list of the model, name, number of marks) of the parts in their order."""
        runs = itertools.groupby(part or ("", "") for part in self.of)
        return [(of, name, len(list(its))) for (of, name), its in runs]

    def hit(self, origin: np.ndarray, direction: np.ndarray) -> bool:
        """Check whether a ray from a point in a unit direction hits one of them."""
        a, way = self.ends[:, 0] - origin, self.ends[:, 1] - self.ends[:, 0]
        ahead, along = (
            a @ direction,
            way @ direction,
        )  # coordinates along the ray and along each line
        square = (way**2).sum(axis=1) - along**2
        s = np.divide(ahead * along - (a * way).sum(axis=1), square, where=square > 0.0,
                      out=np.zeros(len(a)))  # fmt: skip
        near = a + np.clip(s, 0.0, 1.0)[:, None] * way
        far = near @ direction
        gap = np.linalg.norm(near - far[:, None] * direction, axis=1)
        return bool(np.any((gap <= 0.5 * self.size[:, 0]) & (far > 0.0)))


def activations(state: State) -> dict[str, float]:
    """Return the activation of each muscle at the displayed time, or its excitation without a run.

    An excitation that varies counts as none.
    """
    if state.run is None:
        muscles = [f for f in state.model.forces if isinstance(f, Activated)]
        given = {f.name: getattr(f, f.INPUT) for f in muscles}
        return {name: u if isinstance(u, float) else 0.0 for name, u in given.items()}
    result = state.run.result
    frame = min(int(np.searchsorted(result.t, state.playback.time)), len(result.t) - 1)
    own = zip(result.model.states, result.states[frame].tolist())
    return {f.name: a for (f, k, _), a in own if isinstance(f, Activated) and k == 0}


def forces_of(state: State) -> tuple[pg.Force, ...]:
    """Return the forces of the model and of the chosen scenario."""
    wanted = state.request.scenario if state.run is None else state.run.request.scenario
    chosen = (s.forces for s in state.model.scenarios if s.name == wanted)
    return (*state.model.forces, *(force for some in chosen for force in some))


def joinings(state: State, positions: np.ndarray, R: np.ndarray) -> dict[str, Joining]:
    """Return springs, rods (distance constraints), brackets of pivots on the ground, beads at the
    via points of paths, and their obstacles: balls, and drums half as long as they are wide. Wheels
    of cables that no shape shows are flat drums.
    """
    model, number, grain = state.model, {GROUND: 0, **state.derived.number}, state.derived.grain
    found: dict[str, list[Span]] = {
        kind: [] for kind in ("springs", "rods", "muscles", "beads", "balls", "drums")
    }
    excited, active = activations(state), list[float]()
    strongest = max((f.strength for f in forces_of(state) if isinstance(f, Activated)), default=1.0)
    vias: dict[tuple[Any, ...], tuple[pg.Via, Part | None]] = {}
    wheels: dict[tuple[Any, ...], np.ndarray] = {}  # (body, centre, radius): axis
    at, turn = _places(number, positions, R)

    def lead(kind: str, line: Any, wide: float, of: Part | None) -> int:
        spans = [Span(a, b, wide, of) for a, b in itertools.pairwise(line)]
        found[kind] += spans
        return len(spans)

    own = {id(f) for f in model.forces}
    for f in forces_of(state):
        if not isinstance(f, BetweenPoints) or any(n not in number for n in (*f.pair, *f.touches)):
            continue
        of = ("forces", f.name) if id(f) in own else None
        f = at_state(f, model.body(f.body), shown_coordinate(state))
        for line, bent in lines_of(f, model.body(f.body), at, turn):
            if isinstance(f, Activated):
                wide = MUSCLE * grain * (1.0 + 2.0 * math.sqrt(f.strength / strongest))
                active += lead("muscles", line, wide, of) * [excited.get(f.name, 0.0)]
            elif bent:
                lead("rods", line, ROD * grain, of)
            else:
                lead("springs", line, COIL * grain, of)
        for via in f.via:
            key = via.body, via.point, via.radius, via.axis, via.radii, via.rotation
            vias[key] = via, of if vias.get(key, (via, of))[1] == of else None
    for c in model.constraints:
        if isinstance(c, pg.Distance) and c.active:
            ends = at(c.body, model.point_of(c)), at(c.other, c.other_point)
            lead("rods", ends, ROD * grain, ("constraints", c.name))
    for cable in _cables(model):
        of = ("forces" if isinstance(cable.part, pg.Force) else "constraints", cable.part.name)
        for line in cable_lines(cable, at, turn):
            lead("rods", line, ROD * grain, of)
        for wheel, axis in bare(model, cable.part.through):
            wheels[wheel.body, wheel.point, wheel.radius] = turn(wheel.body) @ axis
    for via, of in vias.values():
        if via.radii is not None:
            continue
        centre, half = at(via.body, via.point), via.radius or 0.5 * BEAD * grain
        if via.axis is not None:
            half = 0.5 * half * turn(via.body) @ unit_vector(via.axis)
            found["drums"].append(Span(centre - half, centre + half, 2 * (via.radius or 0.0)))
        else:
            up = np.array([0.0, 0.0, half])
            kind = "balls" if via.radius else "beads"
            found[kind].append(Span(centre - up, centre + up, 2 * half, of))
    for (name, point, radius), axis in wheels.items():
        centre, half = at(name, point), 0.5 * RIM * radius * axis
        found["drums"].append(Span(centre - half, centre + half, 2 * radius))
    drawn = {kind: _between(spans) for kind, spans in found.items()}
    eggs = [(via, of) for via, of in vias.values() if via.radii is not None]
    drawn["balls"] = _with_ellipsoids(drawn["balls"], eggs, at, turn)
    a = np.clip(np.array(active), 0.0, 1.0)[:, None]
    drawn["muscles"] = drawn["muscles"]._replace(
        colors=((1.0 - a) * AT_REST + a * ACTIVE).round() if active else None
    )
    return drawn | {"pivots": pivots(state)}


def _with_ellipsoids(
    balls: Joining, eggs: Sequence[tuple[pg.Via, Part | None]], at: Any, turn: Any
) -> Joining:
    """Return balls and ellipsoids, which are balls of three widths."""
    if not eggs:
        return balls
    turns = [turned_by(obstacle_of(via), turn(via.body))["axes"].reshape(3, 3) for via, _ in eggs]
    size = 2.0 * np.array([via.radii for via, _ in eggs])
    middle = np.array([at(via.body, via.point) for via, _ in eggs])
    up = 0.5 * size[:, 2, None] * np.array(turns)[:, :, 2]
    own = (
        np.stack((middle - up, middle + up), axis=1),
        middle,
        shapes.to_wxyz(np.array(turns)),
        size,
    )
    ends, middles, wxyz, sizes = (np.concatenate(pair) for pair in zip(balls[:4], own))
    return Joining(ends, middles, wxyz, sizes, (*balls.of, *(of for _, of in eggs)))


@of_model
def _cables(model: pg.Model) -> tuple[Lying, ...]:
    return cables_of(pg.Mechanism(model).packed)


def _turns(body: pg.Body) -> bool:
    """Check whether the joint of a body lets it turn about a point."""
    return bool(body.sequence) and not any(m.facts.travels for m in body.sequence)


def _pivots(model: pg.Model) -> list[pg.Body | pg.Constraint]:
    """Return the joints and constraints that fix a point of a body to the ground and let it rotate.

    The feet of free bodies are excluded, because they stand on the ground without a bearing.
    """
    joints = [b for b in model.bodies if b.parent == GROUND and _turns(b)]
    if any(b.floats for b in model.bodies):
        return [*joints]
    held = [c for c in model.constraints if c.kind in TURNING and c.pair[1] == GROUND]
    return [*joints, *(c for c in held if c.active)]


def pivots(state: State) -> Joining:
    """Create a bracket along the axis of each ground pivot, opposite to the body."""
    d, model = state.derived, state.model
    up, R = np.array(GRID[model.up][1]), shapes.to_matrix(d.wxyz)
    ends, turns = [], []
    for pivot in _pivots(model):
        body = pivot if isinstance(pivot, pg.Body) else model.body(pivot.pair[0])
        k = d.number[body.name] - 1
        at, axes = d.positions[k], body.axes
        if not isinstance(pivot, pg.Body):
            fixed, axis = getattr(pivot, "other_point", None), getattr(pivot, "axis", None)
            point = at + R[k] @ np.asarray(model.point_of(pivot))
            at, axes = point if fixed is None else np.asarray(fixed), axis and (axis,)
        z = up if (d.positions[k] + R[k] @ np.asarray(body.com) - at) @ up >= 0.0 else -up
        y = np.cross(z, np.cross(R[k] @ axes[-1], z)) if axes else np.zeros(3)
        if np.linalg.norm(y) < 1e-6:  # rotates about the vertical, or about any axis
            y = np.roll(up, 1)
        y = y / np.linalg.norm(y)
        ends.append((at - BRACKET * d.grain * z, at))
        turns.append(np.column_stack((np.cross(y, z), y, z)))
    between, size = np.reshape(ends, (-1, 2, 3)), BRACKET * d.grain
    wxyz = shapes.to_wxyz(np.reshape(turns, (-1, 3, 3)))
    return Joining(between, between.mean(axis=1), wxyz, np.full((len(ends), 3), size))


def _between(spans: Sequence[Span]) -> Joining:
    """Return solids along spans."""
    between = np.array([(one.begin, one.end) for one in spans]).reshape(-1, 2, 3)
    a, b = between.transpose(1, 0, 2)
    length = np.maximum(np.linalg.norm(b - a, axis=1), 1e-9)
    width = np.array([one.wide for one in spans])
    size = np.stack((width, width, length), axis=1)
    turned, of = _turned((b - a) / length[:, None]), tuple(one.of for one in spans)
    return Joining(between, (a + b) / 2, turned, size, of)


def _turned(ways: np.ndarray) -> np.ndarray:
    """Return the shortest rotations (n, 4) of z to unit vectors (n, 3), and none to zero."""
    x, y, z = ways.T
    w = np.where(z > 0.0, 1.0 + z, (x * x + y * y) / np.maximum(1.0 - z, 1.0))
    q = np.stack((w, -y, x, np.zeros_like(w)), axis=1)
    q[~ways.any(axis=1), 0] = 1.0
    q[~q.any(axis=1), 1] = 1.0  # to -z
    return q / np.linalg.norm(q, axis=1)[:, None]


def _places(
    number: Mapping[str, int], positions: np.ndarray, R: np.ndarray
) -> tuple[Callable[[str, Any], np.ndarray], Callable[[str], np.ndarray]]:
    """Return functions of a body's name: a point of it in world axes, and its orientation."""
    return (
        lambda name, point: _at(number[name], point, positions, R),
        lambda name: np.eye(3) if number[name] == 0 else R[number[name] - 1],
    )


def _at(number: int, point: Any, positions: np.ndarray, R: np.ndarray) -> np.ndarray:
    """Return a point of a body or the ground in world axes."""
    if number == 0:
        return np.asarray(point, float)
    return positions[number - 1] + R[number - 1] @ np.asarray(point)


def loads(state: State, positions: np.ndarray, R: np.ndarray) -> np.ndarray:
    """Return arrows (n, 2, 3) for the applied forces, the largest half as long as the model."""
    found = []
    for f in forces_of(state):
        if not isinstance(f, pg.Wrench) or f.body not in state.derived.number:
            continue
        k = state.derived.number[f.body]
        force = _now(f.force, state.playback.time)
        turned = R[k - 1] @ force if f.frame == "body" else force
        at = _at(k, f.point or (0.0, 0.0, 0.0), positions, R)
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
    result, d, model = state.run.result, state.derived, state.model
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
        weight = 9.81 * sum(body.mass for body in state.model.bodies)
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
