"""Wedge: half a box, below the plane from its edge at -x, -z to that at +x, +z."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np

from .contract import Kind, Size
from .hulls import hull
from .solid import Array, Solid

CORNERS = np.array([(-1, -1, -1), (1, -1, -1), (1, 1, -1), (-1, 1, -1), (1, -1, 1), (1, 1, 1)])
TRIANGLES = [(0, 2, 1), (0, 3, 2), (0, 1, 4), (3, 5, 2), (1, 2, 5), (1, 5, 4), (0, 4, 5), (0, 5, 3)]


class Wedge(Kind):
    name = "wedge"
    needs = ("size",)
    edged = True

    def fitted(self, edges: Sequence[float]) -> dict[str, Any]:
        return {"size": tuple(edges)}

    def edges(self, shape: Any) -> Size:
        return shape.size

    def half_turn(self, shape: Any, plane: int) -> int | None:
        return (2, None, 0)[plane]

    def surface(self, shape: Any) -> tuple[Array, Array]:
        return CORNERS * np.array(shape.size) / 2, np.array(TRIANGLES)

    def solids(self, shape: Any) -> tuple[Solid, ...]:
        return (hull(self.surface(shape)[0]),)
