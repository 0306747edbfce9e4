"""Rows that say nothing new, named from what the solver of a run finds: at next to no cost."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from ..engine import layout as at
from ..engine.constraints.proximal import FACTORED
from ..rotation import Array

if TYPE_CHECKING:
    from ..mechanism.scene import Scene

UPRIGHT = 1 - 1e-6  # cosine between a direction and an axis that it is named after
LISTED = 4
SHARE = 1e-6  # of the largest: an entry of a null direction that is not rounding


def redundancy(scene: Scene) -> str:
    """A sentence on the redundant rows of the last factors; "" where there are none.

    A null direction of Ω is a combination of rows that says nothing: the last row of it that is
    not the last of another is called redundant, as in `mobility`.
    """
    count = int(scene.space.vectors[FACTORED, 1])
    blocks = sum(end - first for _, first, end in scene.spans)
    if count == 0 or blocks != scene.active[0]:  # contacts are among them: others than in a moment
        return ""
    rows = _rows(scene)
    chosen = named(scene, standing_for(scene.space.nulls[:count, : len(rows)]))
    more = f" and {len(chosen) - LISTED} more" if len(chosen) > LISTED else ""
    are = "row is" if len(rows) == 1 else "rows is" if len(chosen) == 1 else "rows are"
    return (
        f"{len(chosen)} of {len(rows)} constraint {are} redundant at the start: "
        f"{', '.join(chosen[:LISTED])}{more}; the forces are those of least norm"
    )


def named(scene: Scene, rows: list[int]) -> list[str]:
    """Rows of the active constraints by direction, as they were located last."""
    every = _rows(scene)
    return [_name(scene, every[r]) for r in rows]


def standing_for(nulls: Array, share: float = SHARE) -> list[int]:
    """Columns that stand for the null directions, from the last one on; ascending.

    Entries below `share` of the largest are none.
    """
    left, found = nulls.copy(), []
    for column in range(left.shape[1] - 1, -1, -1):
        if not len(left):
            break
        pivot = int(np.abs(left[:, column]).argmax())
        if abs(left[pivot, column]) > share:
            found.append(column)
            row = left[pivot] / left[pivot, column]
            left = left - left[:, column, None] * row
            left = left[np.arange(len(left)) != pivot]
    return found[::-1]


def _rows(scene: Scene) -> list[tuple[str, int, int]]:
    """(constraint, block, row of the block) of all rows in turn."""
    sizes = scene.blocks.blocks_i[:, at.B_SIZE].tolist()
    return [
        (name, i, r)
        for name, first, end in scene.spans
        for i in range(first, end)
        for r in range(sizes[i])
    ]


def _name(scene: Scene, row: tuple[str, int, int]) -> str:
    constraint, i, r = row
    d = scene.space.place[i, at.PLACE_D + 3 * r : at.PLACE_D + 3 * r + 3]
    return f"{_direction(int(scene.blocks.blocks_i[i, at.B_TYPE]), d)} of constraint '{constraint}'"


def _direction(kind: int, d: Array) -> str:
    if kind in (at.T_COORD, at.T_VELOCITY):
        return "coordinate"
    what = "rotation about" if kind == at.T_ALIGN else "translation along"
    size = float(np.linalg.norm(d))
    along = np.abs(d) / (size or 1.0)
    if along.max() > UPRIGHT:
        return f"{what} {'xyz'[int(along.argmax())]}"
    x, y, z = d / size if size and d[np.abs(d).argmax()] > 0 else -d / (size or 1.0)
    return f"{what} ({x + 0.0:.3g}, {y + 0.0:.3g}, {z + 0.0:.3g})"
