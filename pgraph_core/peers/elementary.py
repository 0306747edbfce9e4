"""A model as elementary rows, one motion each: the common ground of all builders of peers.

Rows are aligned with the parent body's axes at q = 0; the constant rotation of a body enters
after its last motion. Peers then read the same quaternions as we do.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from ..model import Body, Model
from ..rotation import matrix
from ..topology import Topology

PLACEHOLDER = "none"  # kind of the row of a welded body


class Row(NamedTuple):
    """One motion; the last row of a body carries its mass and is named after it."""

    name: str
    parent: int  # index of the parent row, -1 for the world
    turn: np.ndarray  # (3, 3) constant rotation from the parent row to this one
    shift: np.ndarray  # (3,) constant shift, in the parent row's axes
    kind: str
    axis: np.ndarray
    armature: float
    body: Body | None  # where the row is a body's last


def rows_of(model: Model, topology: Topology) -> list[Row]:
    """All rows in number order."""
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
            added = armature if kind in ("rotate", "translate") else 0.0
            label = name if final else f"{name}.{i}"
            rows.append(Row(label, at, turn, shift, kind, unit, added, body if final else None))
            at, turn, shift = len(rows) - 1, np.eye(3), np.zeros(3)
        last[name] = (at, home)
    return rows


def inertia_of(body: Body) -> tuple[float, np.ndarray, np.ndarray]:
    """Mass, centre of mass and central inertia in the axes of the body's last row."""
    home = matrix(body.rotation)
    return body.mass, home @ body.com, home @ np.array(body.inertia) @ home.T


class Sizes(NamedTuple):
    """Where each row's coordinates begin in our q and v."""

    q: list[int]
    v: list[int]


def sizes(rows: list[Row]) -> Sizes:
    """First indices into q and v, by row."""
    nq = {"rotate": 1, "translate": 1, "ball": 4, "free": 7, PLACEHOLDER: 0}
    nv = {"rotate": 1, "translate": 1, "ball": 3, "free": 6, PLACEHOLDER: 0}
    q = np.cumsum([0, *(nq[row.kind] for row in rows)])
    v = np.cumsum([0, *(nv[row.kind] for row in rows)])
    return Sizes([int(x) for x in q], [int(x) for x in v])
