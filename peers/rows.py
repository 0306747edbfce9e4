"""A model as elementary rows, one motion each: the input of every builder.

Rows are aligned with the parent body's axes at q = 0; the constant rotation of a body enters
after its last motion. The engines then use the same quaternions as Pgraph.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import NamedTuple, Protocol

import numpy as np

from pgraph_core import Body, Model, Topology
from pgraph_core.joints import SIZE
from pgraph_core.rotation import matrix

Array = np.ndarray
PLAIN = ("rotate", "translate")  # motions of one coordinate
PLACEHOLDER = "none"  # kind of the row of a welded body


class Row(NamedTuple):
    """One motion. The last row of a body carries its mass and its name."""

    name: str
    parent: int  # index of the parent row, -1 for the world
    turn: Array  # (3, 3) constant rotation from the parent row to this one
    shift: Array  # (3,) constant shift, in the parent row's axes
    kind: str
    axis: Array
    armature: float
    body: Body | None  # if the row is the last of a body


class State(Protocol):
    """A model with a state, in number order."""

    @property
    def model(self) -> Model: ...
    @property
    def topology(self) -> Topology: ...
    @property
    def q(self) -> Array: ...
    @property
    def v(self) -> Array: ...
    @property
    def tau(self) -> Array: ...


class Scene(NamedTuple):
    """A model with a state, and its rows."""

    name: str
    state: State
    rows: list[Row]

    @property
    def model(self) -> Model:
        """The description."""
        return self.state.model


def rows_of(model: Model, topology: Topology | None = None) -> list[Row]:
    """All rows in number order."""
    topology = topology or Topology.of(model)
    rows: list[Row] = []
    last = {"ground": (-1, np.eye(3))}
    for name in topology.names:
        body = model.body(name)
        at, turn = last[body.parent]
        shift, home = turn @ body.link, matrix(body.rotation)
        motions = list(body.motions) or [(PLACEHOLDER, (0, 0, 1))]
        armatures = list(body.armature) or [0.0]
        for i, ((kind, axis), armature) in enumerate(zip(motions, armatures)):
            final = i == len(motions) - 1
            unit = home @ axis / np.linalg.norm(axis)
            label = name if final else f"{name}.{i}"
            rows.append(Row(label, at, turn, shift, kind, unit, armature, body if final else None))
            at, turn, shift = len(rows) - 1, np.eye(3), np.zeros(3)
        last[name] = (at, home)
    return rows


def inertia_of(body: Body) -> tuple[float, Array, Array]:
    """Mass, centre of mass and central inertia in the axes of the body's last row."""
    home = matrix(body.rotation)
    return body.mass, home @ body.com, home @ np.array(body.inertia) @ home.T


class Sizes(NamedTuple):
    """The first index of each row's coordinates in Pgraph's q and v."""

    q: list[int]
    v: list[int]


def sizes(rows: Sequence[Row]) -> Sizes:
    """First indices into q and v, by row."""
    known = {**SIZE, PLACEHOLDER: (0, 0)}
    q, v = (np.cumsum([0, *(known[row.kind][i] for row in rows)]) for i in (0, 1))
    return Sizes([int(x) for x in q], [int(x) for x in v])


class Walk(NamedTuple):
    """Rows, and the coordinates of Pgraph, in the depth-first order of other engines."""

    rows: list[int]
    q: Array
    v: Array


def walk(rows: Sequence[Row]) -> Walk:
    """The order in which engines number what is built from the rows."""
    children: dict[int, list[int]] = {}
    for i, row in enumerate(rows):
        children.setdefault(row.parent, []).append(i)
    order, left = [], children.get(-1, [])[::-1]
    while left:
        order.append(left.pop())
        left.extend(reversed(children.get(order[-1], [])))
    q, v = (
        np.array([k for i in order for k in range(at[i], at[i + 1])], np.int64)
        for at in sizes(rows)
    )
    return Walk(order, q, v)
