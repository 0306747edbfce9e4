"""Marks of connections in world axes: springs, rods, muscles, cables, obstacles, pivots (pure)."""

from __future__ import annotations

import itertools
import math
from collections.abc import Callable, Mapping, Sequence
from typing import Any, NamedTuple

import numpy as np

import pgraph_core as pg
from pgraph_core.fields import GROUND
from pgraph_core.forces import Activated, BetweenPoints, at_state, lines_of
from pgraph_core.forces.obstacles import obstacle_of, turned_by
from pgraph_core.packing.cable_lines import Lying, cable_lines, cables_of
from pgraph_core.rotation import unit_vector
from pgraph_core.show import shapes
from pgraph_core.show.stage import GRID

from ..constraints.cables import bare
from ..core.state import of_model
from ..pose.solving import shown_coordinate
from . import State

RIM = 0.25  # width of a wheel without a shape over its radius
TURNING = ("revolute", "universal", "ball", "point")  # constraints that fix a point
BRACKET = 0.15  # size of a pivot's bracket on the ground, relative to the body
AT_REST, ACTIVE = np.array((120, 95, 100)), np.array((215, 40, 35))  # colours of muscles
COIL, ROD, MUSCLE = 0.07, 0.025, 0.02  # widths of springs, rods and weak muscles, of the grain
BEAD = 0.06  # diameter of the mark of a via point, of the grain
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
    model, number, grain = state.whole, {GROUND: 0, **state.derived.number}, state.derived.grain
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


def pivoted(model: pg.Model) -> list[pg.Body | pg.Constraint]:
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
    d, model = state.derived, state.whole
    up, R = np.array(GRID[model.up][1]), shapes.to_matrix(d.wxyz)
    ends, turns = [], []
    for pivot in pivoted(model):
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
        lambda name, point: point_of(number[name], point, positions, R),
        lambda name: np.eye(3) if number[name] == 0 else R[number[name] - 1],
    )


def point_of(number: int, point: Any, positions: np.ndarray, R: np.ndarray) -> np.ndarray:
    """Return a point of a body or the ground in world axes."""
    if number == 0:
        return np.asarray(point, float)
    return positions[number - 1] + R[number - 1] @ np.asarray(point)
