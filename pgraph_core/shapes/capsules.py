"""Capsule along z: a radius and a length without its caps, and a radius at the far end if drawn."""

from __future__ import annotations

import math
from collections.abc import Iterator, Sequence
from typing import Any

import numpy as np

from ..engine.records import CAPSULE
from ..errors import needed
from .contract import Element, Form, Geom, Mark, Piece, Primitive, Size, Volume, around
from .rays import Hit, Ray, cone_hits, ellipsoid_hits
from .round import BALL, Segment, far_radius, revolved, turned
from .solid import Array, Solid


def capsule(radius: float, length: float) -> Solid:
    """Create a capsule along z, with `length` excluding the caps."""
    ends = np.array(((0.0, 0.0, -length / 2), (0.0, 0.0, length / 2)))
    return Solid(CAPSULE, ends, (), np.array(((0, 1, -1, -1),)), radius, length / 2)


class Capsule(Primitive, Geom):
    name = "capsule"
    needs = ("radius", "length")
    may = ("end_radius",)
    attributes = ("radius", "length")
    geom = 3
    tall = 2.0

    def problems(self, shape: Any) -> list[str]:
        if shape.end_radius is None:
            return []
        if shape.role != "visual":
            text = "a capsule that tapers is only drawn; give role 'visual'"
            return [f"{text}, got end_radius {shape.end_radius:g}"]
        if shape.radius is not None and shape.length is not None:
            gap = abs(shape.end_radius - shape.radius)
            if gap >= shape.length:
                text = f"a capsule's length must be above the difference of its radii, {gap:g} m"
                return [f"{text}, got {shape.length:g}"]
        return []

    def optional(self, shape: Any) -> tuple[str, ...]:
        return self.may if shape.role == "visual" else ()

    def fitted(self, edges: Sequence[float]) -> dict[str, Any]:
        x, _, z = edges
        return {"radius": x / 2, "length": z - x if z > x else x / 2}

    def edges(self, shape: Any) -> Size:
        d = 2 * shape.radius
        return d, d, shape.length + d

    def half_turn(self, shape: Any, plane: int) -> int | None:
        return 0 if plane == 2 and shape.end_radius is not None else None

    def corners(self, shape: Any) -> Array:
        r = max(shape.radius, shape.end_radius or 0.0)
        return around(np.array((2 * r, 2 * r, shape.length + 2 * r)) / 2)

    def volume(self, shape: Any, unit: str = "m") -> Volume:
        r, h = shape.radius, shape.length
        if shape.end_radius is not None:
            return turned(profile(shape))
        middle, caps = math.pi * r * r * h, 4 / 3 * math.pi * r**3
        about = caps * 0.4 * r * r + middle * r * r / 2
        across = middle * (h * h / 12 + r * r / 4)
        # a cap's centre is 3r/8 beyond the end of the cylinder
        across += caps * (0.4 * r * r + h * h / 4 + 3 * h * r / 8)
        return middle + caps, np.zeros(3), np.diag((across, across, about))

    def solids(self, shape: Any) -> tuple[Solid, ...]:
        return (capsule(shape.radius, shape.length),)

    def urdf(self, shape: Any, drawn: bool) -> Sequence[Element]:
        r, h = shape.radius, shape.length
        ends = [Element("sphere", {"radius": r}, z) for z in (-h / 2, h / 2)]
        return (Element("cylinder", {"radius": r, "length": h}), *ends)

    def mjcf(self, shape: Any) -> tuple[str, Sequence[float]]:
        return "capsule", (shape.radius, shape.length / 2)

    def of_mjcf(self, x: float, y: float, z: float) -> dict[str, Any]:
        return {"radius": x, "length": 2 * y}

    def form(self, shape: Any) -> Form:
        r, end = shape.radius, far_radius(shape)
        size = (2 * r, 2 * r, shape.length + (r + end))
        return Form("capsule", size, taper=end / r, offset=(end - r) / 2)

    def primitive(self, size: Size, taper: float, many: bool) -> Any:
        r, z = size[0] / 2, size[2]
        if taper == 1.0:
            count = (10, 16) if many else (16, 24)
            trimesh = needed("trimesh")
            height = max(z - size[0], 0.0)
            solid = trimesh.creation.capsule(radius=r, height=height, count=count)
            solid.apply_translation(-solid.bounds.mean(axis=0))
            return solid
        far = r * taper
        length = max(z - r - far, abs(r - far) + 1e-9)
        touch = math.asin((r - far) / length)  # angle at which the cone touches the balls
        below, above = np.linspace(-np.pi / 2, touch, 9), np.linspace(touch, np.pi / 2, 9)
        radii = np.concatenate((r * np.cos(below), far * np.cos(above)))
        places = np.concatenate((r * np.sin(below), length + far * np.sin(above)))
        return revolved(radii, places - (length + far - r) / 2)

    def outline(self, piece: Piece) -> Array:
        return np.concatenate([r * BALL + (0, 0, z) for z, r in balls(piece)])

    def marks(self, piece: Piece) -> Iterator[Mark]:
        for z, radius in balls(piece):
            yield np.array((0.0, 0.0, z)), "centre of a cap", True
            yield np.array((0.0, 0.0, z + math.copysign(radius, z))), "end", False
        yield np.zeros(3), "centre", True

    def meetings(self, piece: Piece, ray: Ray) -> Iterator[Hit]:
        (z0, r0), (z1, r1) = balls(piece)
        for z, radius in ((z0, r0), (z1, r1)):
            yield from ellipsoid_hits(np.full(3, radius), np.array((0.0, 0.0, z)), ray)
        touch = math.asin(max(-1.0, min(1.0, (r0 - r1) / max(z1 - z0, 1e-12))))
        s, c = math.sin(touch), math.cos(touch)
        yield from cone_hits((z0 + r0 * s, r0 * c), (z1 + r1 * s, r1 * c), ray)


def balls(piece: Piece) -> tuple[tuple[float, float], tuple[float, float]]:
    """Return the (height, radius) of the two end spheres whose convex hull is the capsule."""
    near, tall = piece.size[0] / 2, piece.size[2]
    far = near * piece.taper
    return (near - tall / 2, near), (tall / 2 - far, far)


def profile(shape: Any) -> list[Segment]:
    """Return the profile of a capsule that tapers: both caps, and the cone between them."""
    r, h, end = shape.radius, shape.length, far_radius(shape)
    low, high = -h / 2, h / 2
    # the cone touches both balls along circles: its sine is the difference of the radii over h
    sine = (r - end) / h
    cosine = math.sqrt(1 - sine * sine)
    first, last = low + r * sine, high + end * sine
    slope = (end - r) * cosine / (last - first)
    start = r * cosine - slope * first
    return [
        (low - r, first, r * r - low * low, 2 * low, -1.0),
        (last, high + end, end * end - high * high, 2 * high, -1.0),
        (first, last, start * start, 2 * start * slope, slope * slope),
    ]
