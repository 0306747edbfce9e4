"""Contacts as tables for the kernels: shapes, ground, what may touch what, and by which law."""

from __future__ import annotations

from collections.abc import Iterable
from itertools import combinations
from typing import NamedTuple

import numpy as np

from . import solids
from .blocks import radius_of_gyration
from .errors import ModelError, PgraphError, Problem
from .kernels import layout as at
from .meshes import convex_hull
from .rotation import matrix
from .schema import Body, Contact, Model, Shape
from .schema.names import EVERY, GROUND
from .solids import Placed, Solid
from .system import Array, Ints, System, point_in_row
from .topology import Topology

LAWS = ("soft", "penalty", "complementarity")
SINKS = 1e-4  # of the bodies' size: how deep its weight presses what touches, if nothing is given
SPEED = 1.0  # m/s: where a soft contact that gives no damping has its restitution


class Touching(NamedTuple):
    """What the contact kernels take."""

    geometry: tuple[Array, ...]
    ground: Array  # (1 + steps, 9)
    touch: tuple[Ints, Ints, Ints, Ints]  # on_ground, pairs, members, apart
    laws: Array  # (nc, 5) law, friction, restitution, stiffness, damping of the model's contacts


def touching(model: Model, topology: Topology, packed: System, active: Iterable[int]) -> Touching:
    """The tables of the model's contacts, of which those with the indices `active` act.

    Raises ModelError for a mesh that cannot be read or is flat.
    """
    shapes = _Shapes(model, topology, packed)
    on_ground: list[tuple[int, int]] = []
    pairs: list[tuple[int, int, int]] = []
    members: list[tuple[int, int]] = []
    apart = joined(topology, packed)
    for k in active:
        c = model.contacts[k]
        first = shapes.of(c)
        if c.other == GROUND:
            on_ground += [(i, k) for i in first]
        elif c.body == c.other == EVERY:
            members += [(i, k) for i in first]
        else:
            every = EVERY in (c.body, c.other)
            pairs += [
                (i, j, k)
                for i in first
                for j in shapes.of_body(c.other)
                if not every or not shapes.tied(i, j, apart)
            ]
    laws = np.array([law(c, model, topology, packed) for c in model.contacts]).reshape(-1, 5)
    touch = (_table(on_ground, 2), _table(pairs, 3), _table(members, 2), _table(sorted(apart), 2))
    return Touching(solids.packed(shapes.placed), ground_of(model), touch, laws)


def _table(rows: list[tuple[int, ...]], width: int) -> Ints:
    return np.array(rows, dtype=np.int64).reshape(-1, width)


def ground_of(model: Model) -> Array:
    """The plane, and the steps on it in its own axes (`solids.ground_axes`)."""
    patches = []
    for step in model.ground.steps:
        spans = list(zip(step.low, step.high))
        if model.up == "y":  # x, z in the description; z, x in the plane's own axes
            spans.reverse()
        patches.append((*spans[0], *spans[1], step.height))
    return solids.ground(model.ground_normal, patches)


def joined(topology: Topology, packed: System) -> set[tuple[int, int]]:
    """Pairs of bodies, the smaller number first, that a joint ties or that one row carries."""
    found = {(int(p), k) for k, p in enumerate(topology.parent, start=1) if p}
    rows = packed.bodies_i[1:, at.ROW]
    for row in np.unique(rows):
        found |= set(combinations((np.flatnonzero(rows == row) + 1).tolist(), 2))
    return found


def law(c: Contact, model: Model, topology: Topology, packed: System) -> tuple[float, ...]:
    """Law, friction, restitution, stiffness and damping, with what is left out filled in.

    Without a stiffness, the weight of the lightest tree that touches presses it in by 1e-4 of the
    bodies' size; a damping gives the restitution, of a soft contact at 1 m/s.
    """
    friction = model.ground.friction if c.friction is None else c.friction
    restitution = model.ground.restitution if c.restitution is None else c.restitution
    mass = min(_masses(c, topology, packed), default=1.0)
    depth = SINKS * radius_of_gyration(packed)
    weight = mass * (float(np.linalg.norm(model.gravity)) or 9.81)
    soft = c.law == "soft"
    stiffness = weight / depth ** (1.5 if soft else 1.0) if c.stiffness is None else c.stiffness
    if c.damping is not None:
        damping = c.damping
    elif soft:  # e = 1 - 2/3 c v
        damping = 1.5 * (1 - restitution) / SPEED
    else:
        damping = 2 * damping_ratio(restitution) * np.sqrt(stiffness * mass)
    return float(LAWS.index(c.law)), friction, restitution, stiffness, damping


def damping_ratio(restitution: float) -> float:
    """Of a linear spring and damper that gives this restitution; 1 where nothing comes back."""
    if restitution <= 0:
        return 1.0
    rate = -np.log(restitution)
    return float(rate / np.hypot(np.pi, rate))


def _masses(c: Contact, topology: Topology, packed: System) -> list[float]:
    """Masses of the trees of the bodies that a contact names, of all where it names every one."""
    parent, mass = topology.parent.tolist(), packed.bodies_f[1:, at.B_MASS].tolist()
    root = list(range(topology.nb + 1))
    total = [0.0] * (topology.nb + 1)
    for k, p in enumerate(parent, start=1):
        root[k] = root[p] if p else k
        total[root[k]] += mass[k - 1]
    names = {c.body, c.other} - {GROUND, EVERY}
    numbers = map(topology.number, names) if names else range(1, topology.nb + 1)
    return [total[root[k]] for k in numbers if total[root[k]] > 0]


class _Shapes:
    """The shapes that contacts ask for, each packed once."""

    def __init__(self, model: Model, topology: Topology, packed: System):
        self.model, self.topology, self.packed = model, topology, packed
        self.placed: list[Placed] = []
        self._of: dict[str, int] = {}

    def of(self, c: Contact) -> list[int]:
        """Shapes on the contact's first side: its points, or those of its body or bodies."""
        if not c.points:
            return self.of_body(c.body)
        number = self.topology.number(c.body)
        places = [point_in_row(self.packed, number, point) for point in c.points]
        return [self._add(solids.points(places), number, np.zeros(3), np.eye(3))]

    def of_body(self, name: str) -> list[int]:
        """The shape of a body, or of every body that has one."""
        bodies = self.model.bodies if name == EVERY else (self.model.body(name),)
        return [self._body(body, body.shape) for body in bodies if body.shape is not None]

    def tied(self, i: int, j: int, apart: set[tuple[int, int]]) -> bool:
        """Whether two shapes are on one body, or on two that a joint ties."""
        a, b = sorted((self.placed[i].body, self.placed[j].body))
        return a == b or (a, b) in apart

    def _body(self, body: Body, shape: Shape) -> int:
        if body.name not in self._of:
            number = self.topology.number(body.name)
            home = self.packed.bodies_f[number, at.HOME : at.HOME + 9].reshape(3, 3)
            place = point_in_row(self.packed, number, shape.position)
            turn = home @ matrix(shape.rotation)
            self._of[body.name] = self._add(_solid(body.name, shape), number, place, turn)
        return self._of[body.name]

    def _add(self, solid: Solid, number: int, position: Array, rotation: Array) -> int:
        row = int(self.packed.bodies_i[number, at.ROW])
        self.placed.append(Placed(solid, row, number, position.tolist(), rotation))
        return len(self.placed) - 1


def _solid(name: str, shape: Shape) -> Solid:
    """A body's shape as the kernels see it. Raises ModelError naming the body."""
    match shape.kind:
        case "box":
            return solids.box(shape.size or (0.0, 0.0, 0.0))
        case "sphere":
            return solids.sphere(shape.radius or 0.0)
        case "capsule":
            return solids.capsule(shape.radius or 0.0, shape.length or 0.0)
        case "cylinder":
            return solids.cylinder(shape.radius or 0.0, shape.length or 0.0)
    try:
        return convex_hull(shape.file or "", shape.scale)
    except PgraphError as error:
        problems = [Problem(f"body '{name}'", "shape", str(p)) for p in error.problems]
        raise ModelError(problems) from None
