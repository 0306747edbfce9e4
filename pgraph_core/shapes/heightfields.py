"""Heightfield: heights on the nodes of a rectangle, and a solid below them."""

from __future__ import annotations

from collections.abc import Sequence
from functools import cached_property
from typing import Any

import numpy as np

from ..engine.records import HEIGHTFIELD
from .contract import Piece, Size, Surface
from .solid import Array, Solid

# as from `Solid.edges_between`, those around the top first
_PRISM_EDGES = np.array(
    [(k, (k + 1) % 3, 1 + k, 0) for k in range(3)]
    + [(3 + k, 3 + (k + 1) % 3, 4, 1 + k) for k in range(3)]
    + [(k, 3 + k, (k + 2) % 3 + 1, 1 + k) for k in range(3)]
)


class Field(Solid):
    """A solid of prisms, one below each triangle."""

    @cached_property
    def normals(self) -> Array:
        return np.zeros((len(self.rings), 3))  # each of its prisms has its own

    @cached_property
    def reach(self) -> float:
        half, middle = self.box
        return float(np.linalg.norm(half + abs(middle)))

    @property
    def rounds(self) -> None:
        return None


def heightfield(size: Sequence[float], heights: Any) -> Solid:
    """Create a heightfield on a rectangle about the origin, with heights[i][j] along x and y."""
    heights = np.asarray(heights, float)
    places = [np.linspace(-w / 2, w / 2, n) for w, n in zip(size, heights.shape)]
    grid = np.meshgrid(*places, indexing="ij")
    nodes = np.stack((*grid, heights), axis=-1).reshape(-1, 3)
    sides = [(k, 3 + k, 3 + (k + 1) % 3, (k + 1) % 3) for k in range(3)]
    rings = ((0, 1, 2), *sides, (5, 4, 3))
    columns, depth = heights.shape[1], float(size[2])
    return Field(HEIGHTFIELD, nodes, rings, _PRISM_EDGES, columns=columns, depth=depth)


class Heightfield(Surface):
    name = "heightfield"
    needs = ("size", "heights")
    cells = ("size",)
    elsewhere = "a heightfield comes with a model file, or from Python"

    def problems(self, shape: Any) -> list[str]:
        lengths = {len(row) for row in shape.heights or ()}
        if shape.heights is None or (
            len(lengths) == 1 and len(shape.heights) >= 2 and min(lengths) >= 2
        ):
            return []
        found = " and ".join(map(str, sorted(lengths)[:3])) or "0"
        text = "heights must be at least two rows of at least two numbers, equally long"
        return [f"{text}, without holes, got {len(shape.heights)} rows of {found}"]

    def half_turn(self, shape: Any, plane: int) -> int | None:
        return 1 if plane == 2 else None  # z is mirrored by half a turn about y and a mirror of x

    def mirrored(self, shape: Any, plane: int) -> dict[str, Any]:
        if plane == 1:
            return {"heights": tuple(row[::-1] for row in shape.heights)}
        return {"heights": shape.heights[::-1]}

    def edges(self, shape: Any) -> Size:
        x, y, depth = shape.size
        return x, y, depth + float(np.ptp(shape.heights))

    def bounds(self, piece: Piece) -> Array:
        heights, (x, y, depth) = np.array(piece.file.heights), piece.file.size
        low, high = (x / 2, y / 2, depth - heights.min()), (x / 2, y / 2, heights.max())
        return np.array((np.negative(low), high))

    def surface(self, shape: Any) -> tuple[Array, Array]:
        """Return its closed surface.

        The vertices of the top come first, row by row. The two triangles of a cell share the
        diagonal from its smallest x and y to its largest.
        """
        heights = np.array(shape.heights)
        nx, ny = heights.shape
        x, y, depth = shape.size
        places = np.meshgrid(
            np.linspace(-x / 2, x / 2, nx), np.linspace(-y / 2, y / 2, ny), indexing="ij"
        )
        top = np.stack((*places, heights), axis=-1).reshape(-1, 3)
        floor = top.copy()
        floor[:, 2] = heights.min() - depth
        number = np.arange(nx * ny).reshape(nx, ny)
        a, b, c, d = number[:-1, :-1], number[1:, :-1], number[1:, 1:], number[:-1, 1:]
        faces = [np.stack((a, b, c), -1).reshape(-1, 3), np.stack((a, c, d), -1).reshape(-1, 3)]
        below = nx * ny
        faces += [below + face[:, ::-1] for face in faces]
        rim = np.concatenate((number[:, 0], number[-1, 1:], number[-2::-1, -1], number[0, -2:0:-1]))
        after = np.roll(rim, -1)
        faces += [np.stack((rim, below + rim, below + after), -1)]
        faces += [np.stack((rim, below + after, after), -1)]
        return np.concatenate((top, floor)), np.concatenate(faces)

    def solids(self, shape: Any) -> tuple[Solid, ...]:
        return (heightfield(shape.size, shape.heights),)
