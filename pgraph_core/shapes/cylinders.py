"""Cylinder along z: a radius and a length, and a radius at the far end if it tapers."""

from __future__ import annotations

import math
from collections.abc import Iterator, Sequence
from functools import cached_property
from typing import Any

import numpy as np

from ..engine.records import CYLINDER
from ..errors import needed
from .contract import Element, Form, Geom, Mark, Piece, Primitive, Size, Volume, around
from .hulls import hull
from .rays import Hit, Ray, cone_hits, disc_hits
from .round import RING, Segment, far_radius, revolved, turned
from .solid import Array, Solid

SIDES = 48  # sides of a cone, which deviates from round by 0.2 % of its radius


class Round(Solid):
    """A solid cylinder, whose rims are discs."""

    @cached_property
    def reach(self) -> float:
        return float(np.hypot(self.radius, self.half))

    @property
    def rounds(self) -> tuple[Array, Array]:
        ends = np.array(((0.0, 0.0, -self.half), (0.0, 0.0, self.half)))
        return ends, np.tile(np.diag((self.radius, self.radius, 0.0)), (2, 1, 1))


def cylinder(radius: float, length: float) -> Solid:
    """Create a cylinder along z."""
    radii = (radius, radius, length / 2)
    return Round(CYLINDER, np.zeros((0, 3)), radius=radius, half=length / 2, radii=radii)


def frustum(radius: float, end: float, length: float) -> Solid:
    """Return a truncated or complete cone along z with SIDES sides.

    Its edges are on the round surface, so sides and rims miss it by `radius` (1 - cos(π / SIDES)).
    """
    angles = np.arange(SIDES) * 2 * np.pi / SIDES
    ring = np.column_stack((np.cos(angles), np.sin(angles), np.zeros(SIDES)))
    near = radius * ring - (0.0, 0.0, length / 2)
    far = end * ring[: SIDES if end else 1] + (0.0, 0.0, length / 2)
    return hull(np.concatenate((near, far)))


class Cylinder(Primitive, Geom):
    name = "cylinder"
    needs = ("radius", "length")
    may = ("end_radius",)
    rolls = "disc"
    attributes = ("radius", "length")
    geom = 5

    def fitted(self, edges: Sequence[float]) -> dict[str, Any]:
        return {"radius": edges[0] / 2, "length": edges[2]}

    def edges(self, shape: Any) -> Size:
        return 2 * shape.radius, 2 * shape.radius, shape.length

    def half_turn(self, shape: Any, plane: int) -> int | None:
        return 0 if plane == 2 and shape.end_radius is not None else None

    def corners(self, shape: Any) -> Array:
        r = max(shape.radius, shape.end_radius or 0.0)
        return around(np.array((2 * r, 2 * r, shape.length)) / 2)

    def volume(self, shape: Any, unit: str = "m") -> Volume:
        r, h = shape.radius, shape.length
        if shape.end_radius is not None:
            return turned([profile(shape)])
        volume = math.pi * r * r * h
        across = volume * (h * h / 12 + r * r / 4)
        return volume, np.zeros(3), np.diag((across, across, volume * r * r / 2))

    def solids(self, shape: Any) -> tuple[Solid, ...]:
        if shape.end_radius is None:
            return (cylinder(shape.radius, shape.length),)
        return (frustum(shape.radius, shape.end_radius, shape.length),)

    def urdf(self, shape: Any, drawn: bool) -> Sequence[Element]:
        if shape.end_radius is not None and not drawn:
            return ()
        return (Element("cylinder", {"radius": shape.radius, "length": shape.length}),)

    def mjcf(self, shape: Any) -> tuple[str, Sequence[float]] | None:
        if shape.end_radius is not None and shape.role != "visual":
            return None
        return "cylinder", (shape.radius, shape.length / 2)

    def of_mjcf(self, x: float, y: float, z: float) -> dict[str, Any]:
        return {"radius": x, "length": 2 * y}

    def form(self, shape: Any) -> Form:
        return Form("cylinder", self.edges(shape), taper=far_radius(shape) / shape.radius)

    def primitive(self, size: Size, taper: float, many: bool) -> Any:
        r, z = size[0] / 2, size[2]
        if taper == 1.0:
            trimesh = needed("trimesh")
            return trimesh.creation.cylinder(radius=r, height=z, sections=24 if many else 48)
        return revolved(
            np.array((0.0, r, r * taper, 0.0)), np.array((-1.0, -1.0, 1.0, 1.0)) * z / 2
        )

    def outline(self, piece: Piece) -> Array:
        x, y, z = piece.size
        ends = ((-z / 2, 1.0), (z / 2, piece.taper))
        return np.concatenate([RING * (x * f, y * f, 0) + (0, 0, end) for end, f in ends])

    def marks(self, piece: Piece) -> Iterator[Mark]:
        half = piece.size[2] / 2
        for z in (-half, half):
            yield np.array((0.0, 0.0, z)), "centre of an end", False
        yield np.zeros(3), "centre", True

    def meetings(self, piece: Piece, ray: Ray) -> Iterator[Hit]:
        r, half = piece.size[0] / 2, piece.size[2] / 2
        ends = (-half, r), (half, r * piece.taper)
        yield from cone_hits(*ends, ray)
        for z, radius in ends:
            yield from disc_hits(z, radius, ray)


def profile(shape: Any) -> Segment:
    """Return the profile of a cylinder that tapers."""
    r, low, high = shape.radius, -shape.length / 2, shape.length / 2
    slope = (far_radius(shape) - r) * 1.0 / (high - low)
    start = r - slope * low
    return low, high, start * start, 2 * start * slope, slope * slope
