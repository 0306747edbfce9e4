"""The ground as a plane and boxes: its steps, which have side faces, and the floors of pits.

Where steps overlap, the last one counts. So the steps are cut into cells by their own edges, and
cells that are alike are joined to rectangles. One that stands out of the plane is a box. Around
pits the plane itself is boxes, so that its rim has side faces.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from ..engine.arrays import Ground
from ..model import Model
from ..shapes.boxes import box
from ..shapes.solid import Array
from .packed_shapes import Placed, ground


class Terrain(NamedTuple):
    """The ground in kernel layout, and the boxes on it."""

    ground: Ground
    boxes: tuple[Placed, ...]


def terrain_of(model: Model) -> Terrain:
    """Compute the ground plane and its steps, in the plane's own axes (`ground_axes`)."""
    patches, depth = _patches(model)
    found = ground(model.ground_normal, patches)
    plane = found.plane[0]
    axes = np.stack((plane["x"], plane["y"], plane["normal"]), axis=1)
    boxes = []
    for x0, x1, y0, y1, height, stands in patches:
        if stands:
            middle = axes @ np.array(((x0 + x1) / 2, (y0 + y1) / 2, (height - depth) / 2))
            solid = box((x1 - x0, y1 - y0, height + depth))
            boxes.append(Placed(solid, 0, 0, middle.tolist(), axes))
    return Terrain(found, tuple(boxes))


def _patches(model: Model) -> tuple[list[tuple[float, ...]], float]:
    """Return disjoint rectangles (x0, x1, y0, y1, height, 1 for a box) and the box depth."""
    steps = []
    for step in model.ground.steps:
        spans = list(zip(step.low, step.high))
        if model.up == "y":  # x, z in the description are z, x in the plane's own axes
            spans.reverse()
        steps.append((*spans[0], *spans[1], step.height))
    if not steps:
        return [], 0.0
    table = np.array(steps)
    x, y = np.unique(table[:, :2]), np.unique(table[:, 2:4])
    rim = max(x[-1] - x[0], y[-1] - y[0])
    x, y = np.array((x[0] - rim, *x, x[-1] + rim)), np.array((y[0] - rim, *y, y[-1] + rim))
    heights = np.zeros((len(x) - 1, len(y) - 1))
    for x0, x1, y0, y1, height in steps:
        inside_x = (x[:-1] >= x0) & (x[1:] <= x1)
        inside_y = (y[:-1] >= y0) & (y[1:] <= y1)
        heights[np.ix_(inside_x, inside_y)] = height
    # the lowest of every cell and its eight neighbours
    n, m = heights.shape
    wide = np.pad(heights, 1, mode="edge")
    around = [wide[i : i + n, j : j + m] for i in range(3) for j in range(3)]
    boxes = (heights > 0) | (np.min(around, axis=0) < heights)
    found = []
    for i0, i1, j0, j1 in _rectangles(heights, boxes):
        if boxes[i0, j0] or heights[i0, j0] != 0:
            flag = float(boxes[i0, j0])
            found.append((x[i0], x[i1], y[j0], y[j1], heights[i0, j0], flag))
    return found, rim - min(heights.min(), 0.0)


def _rectangles(heights: Array, boxes: Array) -> list[tuple[int, int, int, int]]:
    """Merge similar cells into maximal rectangles (i0, i1, j0, j1)."""
    left = np.ones(heights.shape, bool)
    found = []
    for i, j in np.ndindex(*heights.shape):
        if not left[i, j]:
            continue
        same = (heights == heights[i, j]) & (boxes == boxes[i, j]) & left
        j1 = j + 1
        while j1 < heights.shape[1] and same[i, j1]:
            j1 += 1
        i1 = i + 1
        while i1 < heights.shape[0] and same[i1, j:j1].all():
            i1 += 1
        left[i:i1, j:j1] = False
        found.append((i, i1, j, j1))
    return found
