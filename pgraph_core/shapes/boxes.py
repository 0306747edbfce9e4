"""Box: three edge lengths."""

from __future__ import annotations

import itertools
from collections.abc import Iterator, Sequence
from functools import lru_cache
from typing import Any

import numpy as np

from ..engine.records import BOX
from ..errors import needed
from .contract import Element, Form, Geom, Mark, Piece, Primitive, Size, Volume
from .rays import Hit, Ray, box_hits
from .solid import Solid

KEPT = 1024  # boxes of different sizes
NAMES = ("corner", "middle of an edge", "centre of a face", "centre")


def box(size: Sequence[float]) -> Solid:
    """Return a box with the given edge lengths along x, y and z. Equal ones are the same."""
    x, y, z = size
    return _box(float(x), float(y), float(z))


@lru_cache(KEPT)
def _box(*size: float) -> Solid:
    corners = np.array([(x, y, z) for x in (-1, 1) for y in (-1, 1) for z in (-1, 1)])
    rings = ((0, 1, 3, 2), (4, 6, 7, 5), (0, 4, 5, 1), (2, 3, 7, 6), (0, 2, 6, 4), (1, 5, 7, 3))
    return Solid(BOX, corners * np.asarray(size, float) / 2, rings)


class Box(Primitive, Geom):
    name = "box"
    needs = ("size",)
    attributes = ("size",)
    geom = 6
    edged = True

    def fitted(self, edges: Sequence[float]) -> dict[str, Any]:
        return {"size": tuple(edges)}

    def edges(self, shape: Any) -> Size:
        return shape.size

    def volume(self, shape: Any, unit: str = "m") -> Volume:
        x, y, z = shape.size
        volume = x * y * z
        moments = volume / 12 * np.array((y * y + z * z, x * x + z * z, x * x + y * y))
        return volume, np.zeros(3), np.diag(moments)

    def solids(self, shape: Any) -> tuple[Solid, ...]:
        return (box(shape.size),)

    def urdf(self, shape: Any, drawn: bool) -> Sequence[Element]:
        return (Element("box", {"size": shape.size}),)

    def mjcf(self, shape: Any) -> tuple[str, Sequence[float]]:
        return "box", tuple(x / 2 for x in shape.size)

    def of_mjcf(self, x: float, y: float, z: float) -> dict[str, Any]:
        return {"size": (2 * x, 2 * y, 2 * z)}

    def form(self, shape: Any) -> Form:
        return Form("box", shape.size)

    def primitive(self, size: Size, taper: float, many: bool) -> Any:
        return needed("trimesh").creation.box(extents=size)

    def marks(self, piece: Piece) -> Iterator[Mark]:
        for signs in itertools.product((-1, 0, 1), repeat=3):
            zeros = signs.count(0)
            yield np.asarray(piece.size) / 2 * signs, NAMES[zeros], zeros == 3

    def meetings(self, piece: Piece, ray: Ray) -> Iterator[Hit]:
        return box_hits(np.asarray(piece.size) / 2, ray)
