"""Ellipsoid: three half axes. It is drawn as a scaled sphere."""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import Any

import numpy as np

from ..engine.records import ELLIPSOID
from .contract import Form, Geom, Size, Sized, Volume
from .solid import Solid


def ellipsoid(radii: Sequence[float]) -> Solid:
    """Create an ellipsoid with the given semi-axes along x, y and z."""
    x, y, z = radii
    return Solid(ELLIPSOID, np.zeros((0, 3)), radii=(x, y, z))


class Ellipsoid(Sized, Geom):
    name = "ellipsoid"
    needs = ("radii",)
    geom = 4
    edged = True

    def fitted(self, edges: Sequence[float]) -> dict[str, Any]:
        return {"radii": tuple(x / 2 for x in edges)}

    def edges(self, shape: Any) -> Size:
        x, y, z = (2 * x for x in shape.radii)
        return x, y, z

    def volume(self, shape: Any, unit: str = "m") -> Volume:
        x, y, z = shape.radii
        volume = 4 / 3 * math.pi * x * y * z
        moments = volume / 5 * np.array((y * y + z * z, x * x + z * z, x * x + y * y))
        return volume, np.zeros(3), np.diag(moments)

    def solids(self, shape: Any) -> tuple[Solid, ...]:
        return (ellipsoid(shape.radii),)

    def mjcf(self, shape: Any) -> tuple[str, Sequence[float]]:
        return "ellipsoid", shape.radii

    def of_mjcf(self, x: float, y: float, z: float) -> dict[str, Any]:
        return {"radii": (x, y, z)}

    def form(self, shape: Any) -> Form:
        return Form("sphere", self.edges(shape))
