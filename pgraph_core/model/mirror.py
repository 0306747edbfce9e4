"""The reflection of a body from left to right, and of its name."""

from __future__ import annotations

import re
from collections.abc import Callable, Sequence
from typing import Any

from ..joints import SIZE, Motion
from .body import Body, Shape
from .curves import Table, VectorTable
from .fields import Quat, Vec3

SIDES = {"left": "right", "right": "left", "l": "r", "r": "l"}
SIDE = re.compile(r"left|right|(?<![a-z])[lr](?![a-z])", re.IGNORECASE)


def other_side(name: str) -> str:
    """The name with left and right, or an l and r that stand alone, swapped."""

    def swapped(found: re.Match[str]) -> str:
        word = found[0]
        new = SIDES[word.lower()]
        return new.upper() if word.isupper() else new.title() if word.istitle() else new

    return SIDE.sub(swapped, name)


class Mirror:
    """A reflection about the plane normal to axis `k` of the parent's frame, through its origin.

    Points, forces and slides are reflected; turns, which are axial vectors, the other way round.
    A body's frame is reflected with its own axis k turned round once more, so that it stays
    right-handed: then every coordinate of a rotation or translation keeps its value.
    """

    def __init__(self, k: int):
        self.sign = tuple(-1.0 if i == k else 1.0 for i in range(3))

    def point(self, x: Sequence[float]) -> Vec3:
        a, b, c = (s * float(e) + 0.0 for s, e in zip(self.sign, x))
        return (a, b, c)

    def axial(self, x: Sequence[float]) -> Vec3:
        a, b, c = (-s * float(e) + 0.0 for s, e in zip(self.sign, x))
        return (a, b, c)

    def quaternion(self, q: Sequence[float]) -> Quat:
        w, *v = q
        return (float(w), *self.axial(v))

    def coordinates(self, field: str, x: Sequence[float], motions: Sequence[Motion]) -> Any:
        """q or v of a joint."""
        found: list[float] = []
        for m in motions:
            part = x[len(found) : len(found) + SIZE[m.kind][field == "v"]]
            match m.kind, field:
                case "ball", "q":
                    found += self.quaternion(part)
                case "ball", _:
                    found += self.axial(part)
                case "free", "q":
                    found += (*self.point(part[:3]), *self.quaternion(part[3:]))
                case "free", _:
                    found += (*self.axial(part[:3]), *self.point(part[3:]))
                case _:
                    found.extend(map(float, part))
        return tuple(found)

    def keeps(self, body: Body, coordinate: int) -> bool:
        """Whether a degree of freedom of a joint has the same value in the reflection."""
        ones = (1.0,) * body.dof
        return self.coordinates("v", ones, body.sequence)[coordinate] == 1.0

    def body(self, body: Body) -> Body:
        """The reflected row, its parent and name as they were."""
        motions = tuple(
            (m.kind, self.axial(m.axis) if m.kind == "rotate" else self.point(m.axis))
            if m.kind in ("rotate", "translate") else (m.kind, m.axis)
            for m in body.sequence
        )  # fmt: skip
        inertia = tuple(
            tuple(a * b * x + 0.0 for b, x in zip(self.sign, row))
            for a, row in zip(self.sign, body.inertia)
        )
        return body.model_copy(update={
            "motions": motions,
            "axes": tuple(axis for kind, axis in motions if kind in ("rotate", "translate")),
            "link": self.point(body.link),
            "rotation": self.quaternion(body.rotation),
            "com": self.point(body.com),
            "inertia": inertia,
            "tip": body.tip and self.point(body.tip),
            "q": self.coordinates("q", body.q, body.sequence),
            "v": self.coordinates("v", body.v, body.sequence),
            "shapes": tuple(map(self.shape, body.shapes)),
        })  # fmt: skip

    def shape(self, shape: Shape) -> Shape:
        """At the reflected place; its solid is symmetric about its own planes, but for a mesh."""
        moved = {
            "position": self.point(shape.position),
            "rotation": self.quaternion(shape.rotation),
        }
        return shape.model_copy(update=moved)

    def value(self, x: Any, reflect: Callable[[Sequence[float]], Vec3]) -> Any:
        """A vector, or a table of vectors over time."""
        if isinstance(x, VectorTable):
            return x.model_copy(update={"value": tuple(map(reflect, x.value))})
        return x if isinstance(x, (int, float, Table)) or x is None else reflect(x)
