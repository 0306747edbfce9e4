"""A mechanism as SVG: the outline of each piece, lit from above, its shadow, and the ground."""

from __future__ import annotations

import zlib
from typing import Any

import numpy as np

from . import shapes
from .drawing import CODES, OVERSAMPLING
from .notebook import hull, outline

LINES = 14  # lines of the ground on each side of its middle
TOP, BOTTOM = 1.18, 0.72  # factors of a piece's colour at its upper and lower end


def view_svg(drawing: Any, pose: np.ndarray) -> str:
    """The picture of a `Drawing` at the poses (nb, 7)."""
    width, height = drawing.size
    ground, tones = drawing.ground, drawing.tones
    turns = shapes.to_matrix(pose[:, 3:])
    pieces = []
    for look, at, turn in zip(drawing.looks, pose[:, :3], turns):
        for piece in look.pieces:
            corners = at + outline(piece) @ turn.T
            pieces.append((corners, piece.color or look.color, piece.opacity))
    eye = np.array(drawing.camera(pose).eye)
    pieces.sort(key=lambda part: -float(np.linalg.norm(part[0].mean(axis=0) - eye)))
    own = f"p{zlib.crc32(pose.tobytes()):08x}"  # one page may hold several pictures
    named: dict[tuple[int, ...], str] = {}
    drawn, shadows = [], []
    towards, normal = drawing.towards_sun, np.array(ground.normal)
    for corners, color, opacity in pieces:
        name = named.setdefault(color, f"{own}-{len(named)}")
        seen = f' opacity="{opacity:.3g}"' if opacity < 1 else ""
        drawn.append(f'<path d="{_path(drawing, pose, corners)}" fill="url(#{name})"{seen}/>')
        high = (corners - np.array(ground.point)) @ normal
        fallen = corners - np.outer(high / (towards @ normal), towards)
        shadows.append(f'<path d="{_path(drawing, pose, fallen)}"{seen}/>')
    gradients = [
        _gradient(name, [_scaled(color, by) for by in (TOP, 1.0, BOTTOM)])
        for color, name in named.items()
    ]
    horizon = _horizon(drawing, pose)
    stops = [_code(tones.zenith), _code(tones.horizon)]
    haze = (
        f'<linearGradient id="{own}-haze" x2="0" y2="1">'
        f'<stop stop-color="{stops[1]}"/>'
        f'<stop offset=".7" stop-color="{stops[1]}" stop-opacity="0"/></linearGradient>'
    )
    sky = _gradient(f"{own}-sky", stops)
    below = f'<rect y="{horizon:.1f}" width="{width}" height="{max(height - horizon, 0):.1f}"'
    return (
        f'<svg xmlns="http://www.w3.org/2000/svg" width="{width}" height="{height}" '
        f'viewBox="0 0 {width} {height}" role="img"><defs>{sky}{haze}{"".join(gradients)}</defs>'
        f'<rect width="{width}" height="{max(horizon, 0):.1f}" fill="url(#{own}-sky)"/>'
        f'{below} fill="{_code(tones.floor)}"/>'
        f'<path d="{_lines(drawing, pose)}" stroke="{_code(tones.line)}" fill="none"/>'
        f'{below} fill="url(#{own}-haze)"/>'
        f'<g opacity=".22">{"".join(shadows)}</g>'
        f'<g stroke="#000" stroke-opacity=".25" stroke-width=".7" stroke-linejoin="round">'
        f"{''.join(drawn)}</g></svg>"
    )


def _path(drawing: Any, pose: np.ndarray, corners: np.ndarray) -> str:
    points = drawing.on_screen(corners, pose)
    if not np.isfinite(points).all():  # behind the camera
        return ""
    return "M" + "L".join(f"{x:.1f} {y:.1f}" for x, y in hull(points[:, :2])) + "Z"


def _lines(drawing: Any, pose: np.ndarray) -> str:
    """The lines of the ground near the mechanism."""
    ground = drawing.ground
    u, v, origin = np.array(ground.u), np.array(ground.v), np.array(ground.point)
    a, b = u / (u @ u), v / (v @ v)
    middle = pose[:, :3].mean(axis=0) if len(pose) else origin
    at = np.round(((middle - origin) @ u, (middle - origin) @ v))
    found = []
    steps = np.arange(-LINES, LINES + 1)
    for one, other, i in ((a, b, 0), (b, a, 1)):
        for k in steps:
            along = np.outer(at[1 - i] + steps, other)
            points = drawing.on_screen(origin + (at[i] + k) * one + along, pose)
            seen = points[np.isfinite(points[:, 0])]
            if len(seen) > 1:
                (x0, y0), (x1, y1) = seen[0, :2], seen[-1, :2]
                found.append(f"M{x0:.1f} {y0:.1f}L{x1:.1f} {y1:.1f}")
    return "".join(found)


def _horizon(drawing: Any, pose: np.ndarray) -> float:
    """Return the row of the horizon in the picture, from 0 at the top to its height."""
    camera, height = drawing.camera(pose), drawing.size[1]
    normal = np.array(drawing.ground.normal)
    start = np.array(camera.corner) + np.array(camera.right) * drawing.size[0] * OVERSAMPLING / 2
    sinks = np.array(camera.down) @ normal
    row = -(start @ normal) / sinks if sinks else np.inf
    return float(np.clip(row / OVERSAMPLING, 0, height))


def _gradient(name: str, colors: list[str]) -> str:
    stops = "".join(
        f'<stop offset="{k / (len(colors) - 1):g}" stop-color="{color}"/>'
        for k, color in enumerate(colors)
    )
    return f'<linearGradient id="{name}" x2="0" y2="1">{stops}</linearGradient>'


def _scaled(color: tuple[int, ...], by: float) -> str:
    return _rgb(tuple(min(round(by * c), 255) for c in color))


def _rgb(color: tuple[int, ...]) -> str:
    return "#" + "".join(f"{c:02x}" for c in color)


def _code(light: tuple[float, ...]) -> str:
    """The code of a colour in linear light."""
    return _rgb(tuple(int(CODES[round(min(c, 1.0) * (len(CODES) - 1))]) for c in light))
