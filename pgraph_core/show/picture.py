"""A small picture of a model as SVG text: its pieces as flat shapes, the far ones first."""

from __future__ import annotations

from collections.abc import Sequence
from itertools import product
from typing import Any

import numpy as np

from . import bodies, camera, shapes
from .stage import GRID

WIDTH, HEIGHT = 132, 88
ROUND = 20  # points around a ball or a rim
MOST = 400  # pieces that are drawn: the nearest bodies of a large model


def picture(model: Any, parent: tuple[int, ...], names: tuple[str, ...],
            positions: np.ndarray, R: np.ndarray) -> str:  # fmt: skip
    """`model` at the given poses (nb, 3), (nb, 3, 3), bodies in the order of `names`."""
    return pictures(model, parent, names, [(positions, R)])[0]


def pictures(model: Any, parent: tuple[int, ...], names: tuple[str, ...],
             poses: Sequence[tuple[np.ndarray, np.ndarray]]) -> list[str]:  # fmt: skip
    """`model` at each of these poses, all at one scale and about one point."""
    children, colors = shapes.children_of(parent), shapes.branch_colors(parent)
    looks = bodies.looks([model.body(name) for name in names], children, colors)
    up = np.array(GRID[model.up][1])
    way = camera.towards(model.up, "start")
    right, above = camera.frame(up, way)
    view = np.stack((right, above, way))
    every = [_parts(looks, view, *pose) for pose in poses]
    points = [flat for drawn in every for _, flat, _ in drawn]
    if not points:
        return [_svg("") for _ in every]
    low, high = np.concatenate(points).min(0), np.concatenate(points).max(0)
    scale = 0.88 * min(WIDTH / max(high[0] - low[0], 1e-9), HEIGHT / max(high[1] - low[1], 1e-9))
    middle = (low + high) / 2
    found = []
    for drawn in every:
        drawn = sorted(drawn, key=lambda part: part[0])[-MOST:]
        found.append(_svg("".join(_shape(flat, c, middle, scale) for _, flat, c in drawn)))
    return found


def _parts(
    looks: Sequence[bodies.Look], view: np.ndarray, positions: np.ndarray, R: np.ndarray
) -> list[tuple[float, np.ndarray, shapes.Color]]:
    """(how near, corners in the picture, colour) of each piece."""
    drawn: list[tuple[float, np.ndarray, shapes.Color]] = []
    for look, at, turn in zip(looks, positions, R):
        for piece in look.pieces[:MOST]:
            corners = at + _outline(piece) @ turn.T
            flat = corners @ view.T
            drawn.append((float(flat[:, 2].mean()), flat[:, :2], piece.color or look.color))
    return drawn


def _svg(inside: str) -> str:
    box = f'viewBox="0 0 {WIDTH} {HEIGHT}" width="{WIDTH}" height="{HEIGHT}"'
    return f'<svg xmlns="http://www.w3.org/2000/svg" {box} aria-hidden="true">{inside}</svg>'


def _shape(flat: np.ndarray, color: shapes.Color, middle: np.ndarray, scale: float) -> str:
    """The convex outline of points, lit from above."""
    at = (flat - middle) * scale
    at = np.column_stack((WIDTH / 2 + at[:, 0], HEIGHT / 2 - at[:, 1]))
    corners = " ".join(f"{x:.1f},{y:.1f}" for x, y in _hull(at))
    edge = tuple(int(0.72 * c) for c in color)
    return (
        f'<polygon points="{corners}" fill="rgb{color}" stroke="rgb{edge}" stroke-width="0.7"'
        f' stroke-linejoin="round"/>'
    )


def _outline(piece: shapes.Piece) -> np.ndarray:
    """(n, 3) points in body axes whose convex hull is the piece, or its box."""
    x, y, z = piece.size
    angles = np.linspace(0, 2 * np.pi, ROUND, endpoint=False)
    ring = np.column_stack((np.cos(angles), np.sin(angles), 0 * angles)) / 2
    if piece.kind in ("sphere", "capsule"):
        near, far = x / 2, x / 2 * piece.taper
        ball = np.concatenate([np.roll(ring * 2, k, axis=1) for k in range(3)])
        ends = (0.0,) if piece.kind == "sphere" else (near - z / 2, z / 2 - far)
        local = [r * ball + (0, 0, end) for end, r in zip(ends, (near, far))]
    elif piece.kind == "cylinder":
        local = [ring * (x * f, y * f, 0) + (0, 0, end) for end, f in
                 ((-z / 2, 1.0), (z / 2, piece.taper))]  # fmt: skip
    else:
        local = [np.array([*product((-0.5, 0.5), repeat=3)]) * piece.size]
    return piece.position + np.concatenate(local) @ piece.rotation.T


def _hull(points: np.ndarray) -> list[tuple[float, float]]:
    """The convex hull of points (n, 2), by Andrew's monotone chain."""
    ordered = sorted({(round(x, 2), round(y, 2)) for x, y in points.tolist()})
    halves = []
    for sweep in (ordered, ordered[::-1]):
        half: list[tuple[float, float]] = []
        for p in sweep:
            while len(half) > 1 and _turns(half[-2], half[-1], p) <= 0:
                half.pop()
            half.append(p)
        halves.append(half[:-1])
    return halves[0] + halves[1]


def _turns(a: tuple[float, float], b: tuple[float, float], c: tuple[float, float]) -> float:
    return (b[0] - a[0]) * (c[1] - a[1]) - (b[1] - a[1]) * (c[0] - a[0])
