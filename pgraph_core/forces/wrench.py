"""A force and torque on a body, constant or varying over time."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from functools import reduce
from typing import Any, ClassVar, Literal

import numpy as np

from ..curves import VectorTable
from ..engine.compiler.jit import part
from ..engine.drives import knot_after
from ..engine.records import INTEGER, REAL
from ..engine.rows import point_of, point_velocity, rotation_of, spin_of
from ..engine.vec import add_scaled, dot, load, mul, sub, xyz
from ..fields import Entries3, Vec3, field, maybe_vector
from ..signals import Node
from ..signals.grammar import filled
from ..units import J, M, N
from .base import (
    KIND,
    Array,
    InKnots,
    Load,
    OnBody,
    Places,
    on_pair,
    row,
    tree_of,
    vector_over_time,
)


class Wrench(OnBody):
    """A wrench with `torque` and `force`, applied to `body` at `point`."""

    ABOUT: ClassVar[str] = "a force and a torque on a body"
    SCALES: ClassVar[tuple[str, ...]] = ("torque", "force")
    VARIES: ClassVar[tuple[str, ...]] = SCALES

    kind: Literal["wrench"] = field(KIND, default="wrench")
    torque: Entries3 | VectorTable = field(
        "three numbers or expressions [x, y, z], or a table of them over time [N m]",
        converter=vector_over_time, default=(0.0, 0.0, 0.0), dim=J, role="axial",
    )  # fmt: skip
    force: Entries3 | VectorTable = field(
        "three numbers or expressions [x, y, z], or a table of them over time [N]",
        converter=vector_over_time, default=(0.0, 0.0, 0.0), dim=N, role="vector",
    )  # fmt: skip
    frame: Literal["world", "body"] = field(
        "'world' or 'body': the axes of torque and force",
        default="world", label="Axes of", help="axes in which force and torque are given",
    )  # fmt: skip
    point: Vec3 | None = field(
        "three finite numbers in the axes of `body` [m]; default: its origin",
        converter=maybe_vector, default=None, dim=M, role="point",
        help="in body axes; default: the body origin",
    )  # fmt: skip

    @property
    def _idle(self) -> str:
        return ""  # zeros are what a run or a form fills in

    def _varying(self, at: Places) -> Iterator[InKnots]:
        """Yield the entries that vary, in the axes of the row."""
        turn = at.home(self.body) if self.frame == "body" else np.eye(3)
        for first, value in ((1, self.torque), (4, self.force)):
            if not isinstance(value, VectorTable) and str in map(type, value):
                for k, row in enumerate(turn.tolist(), start=first):
                    yield InKnots(k, _weighted(row, value))


def _weighted(weights: Sequence[float], values: Sequence[float | str]) -> Node:
    """Return the sum of values times weights as a tree."""
    parts = [
        tree_of(x) if by == 1.0 else filled("by*x", by=tree_of(by), x=tree_of(x))
        for by, x in zip(weights, values) if by
    ]  # fmt: skip
    return reduce(lambda total, one: filled("total + one", total=total, one=one), parts)


def _over(t: Array, value: Any) -> Array:
    """Evaluate a vector, or a table of vectors, at times t as an (n, 3) array."""
    if not isinstance(value, VectorTable):
        numbers = [
            0.0 if isinstance(x, str) else x for x in value
        ]  # expressions are evaluated later
        return np.tile(np.array(numbers), (len(t), 1))
    columns = np.array(value.value).T
    return np.stack([np.interp(t, value.t, column) for column in columns], axis=1)


def pack(f: Wrench, one: Any, at: Places) -> Array:
    """Write the point, and return time [s], torque and force at the knots."""
    one["point_a"] = at.in_row(f.body, f.point or (0.0, 0.0, 0.0))
    one["in_body"] = f.frame == "body"
    parts = (f.torque, f.force)
    times = {t for x in parts if isinstance(x, VectorTable) for t in x.t}
    t = np.array(sorted(times) or [0.0])
    turn = at.home(f.body) if f.frame == "body" else np.eye(3)
    return np.hstack((t[:, None], *(_over(t, x) @ turn.T for x in parts)))


@part
def between(knots, first, count, t, column):
    """Interpolate three table columns linearly at time t, constant outside the knots."""
    last = first + count - 1
    if t < knots[first, 0]:
        return load(knots, first, column)
    if not t < knots[last, 0]:
        return load(knots, last, column)
    rate = (count - 1) / (knots[last, 0] - knots[first, 0])
    n = knot_after(knots, first, count, t, rate)
    share = (t - knots[n - 1, 0]) / (knots[n, 0] - knots[n - 1, 0])
    x = load(knots, n - 1, column)
    return add_scaled(x, share, sub(load(knots, n, column), x))


@part
def law(one, knots, work, linear, t):
    """Evaluate the torque and force over time."""
    a = one.row_a
    p = point_of(xyz(one.point_a), work, a)
    torque = between(knots, one.first_knot, one.knots, t, 1)
    force = between(knots, one.first_knot, one.knots, t, 4)
    if one.in_body == 1:
        turn = rotation_of(work, a)
        torque = mul(turn, torque)
        force = mul(turn, force)
    power = dot(torque, spin_of(work, a)) + dot(force, point_velocity(work, linear, a, p))
    return p, torque, force, p, power, 0.0


# knots: time [s], torque, force
LOAD = Load(Wrench, row(in_body=INTEGER, point_a=(REAL, 3)), pack, on_pair(law), columns=7)
