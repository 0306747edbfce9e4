"""Sphere: a radius."""

from __future__ import annotations

import math
from collections.abc import Iterator, Sequence
from typing import Any

import numpy as np

from ..engine.records import SPHERE
from ..errors import needed
from .contract import Element, Form, Geom, Mark, Piece, Primitive, Size, Volume
from .rays import Hit, Ray, ellipsoid_hits
from .round import BALL
from .solid import Array, Solid


def sphere(radius: float) -> Solid:
    """Create a sphere about the shape's origin."""
    return Solid(SPHERE, np.zeros((1, 3)), radius=radius)


class Sphere(Primitive, Geom):
    name = "sphere"
    needs = ("radius",)
    rolls = "sphere"
    attributes = ("radius",)
    geom = 2

    def read(self, data: Any) -> Any:
        """Take MuJoCo's size of a sphere, which is its radius."""
        size = data.get("size")
        if size is None or np.size(size) != 1:
            return data
        return {**data, "radius": np.ravel(size)[0], "size": None}

    def fitted(self, edges: Sequence[float]) -> dict[str, Any]:
        return {"radius": edges[0] / 2}

    def edges(self, shape: Any) -> Size:
        return (2 * shape.radius,) * 3

    def volume(self, shape: Any, unit: str = "m") -> Volume:
        r = shape.radius
        volume = 4 / 3 * math.pi * r**3
        return volume, np.zeros(3), np.diag(volume * 0.4 * r * r * np.ones(3))

    def solids(self, shape: Any) -> tuple[Solid, ...]:
        return (sphere(shape.radius),)

    def urdf(self, shape: Any, drawn: bool) -> Sequence[Element]:
        return (Element("sphere", {"radius": shape.radius}),)

    def mjcf(self, shape: Any) -> tuple[str, Sequence[float]]:
        return "sphere", (shape.radius,)

    def of_mjcf(self, x: float, y: float, z: float) -> dict[str, Any]:
        return {"radius": x}

    def form(self, shape: Any) -> Form:
        return Form("sphere", self.edges(shape))

    def primitive(self, size: Size, taper: float, many: bool) -> Any:
        solid = needed("trimesh").creation.icosphere(subdivisions=2 if many else 3, radius=0.5)
        solid.apply_scale(size)
        return solid

    def outline(self, piece: Piece) -> Array:
        return np.asarray(piece.size) / 2 * BALL

    def marks(self, piece: Piece) -> Iterator[Mark]:
        yield np.zeros(3), "centre", True

    def meetings(self, piece: Piece, ray: Ray) -> Iterator[Hit]:
        return ellipsoid_hits(np.asarray(piece.size) / 2, np.zeros(3), ray)
