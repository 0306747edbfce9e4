"""Triangle rasterisation without a graphics card: a depth buffer, shadows and per-pixel lighting.

Corners on a screen are (x, y, w): x to the right and y down in pixels, and w, the greater the
nearer, which is linear in x and y on a plane: the inverse of the depth for a camera, the distance
towards the sun for its shadows. Depth buffers with linear 1/z: Blinn, "Hyperbolic interpolation",
IEEE Computer Graphics and Applications 12(4), 1992; softened shadows: Reeves, Salesin and Cook,
"Rendering antialiased shadows with depth maps", SIGGRAPH 1987.
"""

from __future__ import annotations

import math
from typing import NamedTuple

from ..engine.compiler.jit import kernel, part
from ..engine.compiler.kinds import F1, F2, f4, f8, group, i4, named, u1, void
from ..engine.vec import add_scaled, dot, load, scale, sub

Vector = tuple[float, float, float]
NO_FACE = -1  # the number of the face if there is none
LINE = 0.008  # half the width of the lines of the ground over a cell
GLOSS, GLEAM = 40.0, 0.18  # exponent and strength of the sun's reflection (Blinn's model)
TAPS = 4  # places each way whose mean softens the edge of a shadow


TRIPLE, I4 = group(*[f8] * 3), i4[:, ::1]


class Camera(NamedTuple):
    """A camera. The ray through pixel (x, y) is corner + x right + y down, with depth 1."""

    eye: Vector
    corner: Vector
    right: Vector
    down: Vector


class Sun(NamedTuple):
    """The sun's direction, and the corner and axes of its shadow map: x, y and w of a point."""

    towards: Vector
    origin: Vector
    x: Vector
    y: Vector
    w: Vector
    texel: float  # [m] edge of a pixel of its screen


class Ground(NamedTuple):
    """A plane with grid lines. u and v give the cell of a point. It fades out at `fade`."""

    point: Vector
    normal: Vector
    u: Vector
    v: Vector
    fade: float


class Tones(NamedTuple):
    """Colours of sky, ground and lights in linear light."""

    sky: Vector
    floor: Vector
    line: Vector
    above: Vector
    below: Vector
    sun: Vector
    fill: Vector
    from_fill: Vector  # direction to it
    shadow: float  # share of the ground's light that is missing in a shadow


@kernel(void(F2, I4, F1, F2, I4), nogil=True, later=True)
def cover(points, faces, opacity, depth, seen):
    """Rasterise faces (m, 3) of screen points (n, 3) into depth and seen (height, width).

    Each pixel contains the largest w of all triangles that cover its centre, and the number of this
    triangle. If the opacity of a triangle is below 1, only this fraction of its pixels is drawn, in
    an ordered pattern of 16 levels (Bayer, IEEE International Conference on Communications 1973).
    """
    height, width = depth.shape
    for face in range(len(faces)):
        ax, ay, aw = load(points, faces[face, 0], 0)
        bx, by, bw = load(points, faces[face, 1], 0)
        cx, cy, cw = load(points, faces[face, 2], 0)
        area = (bx - ax) * (cy - ay) - (by - ay) * (cx - ax)
        if area == 0.0 or not math.isfinite(area):  # not finite: a corner is behind the camera
            continue
        b_x, b_y = (cy - ay) / area, (ax - cx) / area  # slopes of the shares of b and c
        c_x, c_y = (ay - by) / area, (bx - ax) / area
        left = max(math.ceil(min(ax, bx, cx) - 0.5), 0)
        right = min(math.floor(max(ax, bx, cx) - 0.5), width - 1)
        top = max(math.ceil(min(ay, by, cy) - 0.5), 0)
        bottom = min(math.floor(max(ay, by, cy) - 0.5), height - 1)
        for row in range(top, bottom + 1):
            for column in range(left, right + 1):
                x, y = column + 0.5 - ax, row + 0.5 - ay
                b = x * b_x + y * b_y
                c = x * c_x + y * c_y
                if b < 0.0 or c < 0.0 or b + c > 1.0 or opacity[face] < _level(row, column):
                    continue
                w = aw + b * (bw - aw) + c * (cw - aw)
                if w > depth[row, column]:
                    depth[row, column] = w
                    seen[row, column] = face


@part
def _level(row, column):
    """Return the minimum opacity that draws a pixel: 1/32, 3/32, ..., 31/32 in squares of 4 x 4."""
    mixed = row ^ column
    rank = (mixed & 1) * 8 + (row & 1) * 4 + (mixed >> 1 & 1) * 2 + (row >> 1 & 1)
    return (rank + 0.5) / 16.0


@kernel(
    void(
        f4[:, :, ::1], F2, I4, F2, I4, F2, F2, F2, F2,
        named(Camera, *[TRIPLE] * 4), named(Sun, *[TRIPLE] * 5, f8),
        named(Ground, *[TRIPLE] * 4, f8), named(Tones, *[TRIPLE] * 8, f8),
    ),
    nogil=True, later=True,
)  # fmt: skip
def light(picture, depth, seen, points, faces, places, normals, colors, shadows,
          camera, sun, ground, tones):  # fmt: skip
    """Shade bodies, ground and sky into the picture (height, width, 3), in linear light.

    points, faces, depth, seen as `cover` has them, from the camera; shadows: the depths of the
    sun. places and normals (3 m, 3) of the corners of the faces, world axes; colors (m, 3).
    """
    height, width = depth.shape
    above = dot(sub(camera.eye, ground.point), ground.normal)
    for row in range(height):
        for column in range(width):
            x, y = column + 0.5, row + 0.5
            ray = add_scaled(add_scaled(camera.corner, x, camera.right), y, camera.down)
            sinks = -dot(ray, ground.normal)
            far = math.inf  # the ray reaches the ground at eye + far ray, the face at eye + ray / w
            if above > 0.0 and sinks > 0.0:
                far = above / sinks
            face = seen[row, column]
            if face != NO_FACE and far * depth[row, column] >= 1.0:
                place, normal = _on(points, faces, places, normals, face, x, y)
                if dot(normal, ray) > 0.0:
                    normal = scale(-1.0, normal)
                color = _body(
                    load(colors, face, 0), place, normal, ray, shadows, sun, ground.normal, tones
                )
            elif far < math.inf:
                color = _floor(
                    add_scaled(camera.eye, far, ray), far, ray, camera, shadows, sun, ground, tones
                )
            else:
                color = tones.sky
            picture[row, column, 0], picture[row, column, 1], picture[row, column, 2] = color


@part
def _on(points, faces, places, normals, face, x, y):
    """Return the position and unit normal of the face at a pixel, corrected for perspective."""
    ax, ay, aw = load(points, faces[face, 0], 0)
    bx, by, bw = load(points, faces[face, 1], 0)
    cx, cy, cw = load(points, faces[face, 2], 0)
    area = (bx - ax) * (cy - ay) - (by - ay) * (cx - ax)
    b = ((x - ax) * (cy - ay) - (y - ay) * (cx - ax)) / area
    c = ((bx - ax) * (y - ay) - (by - ay) * (x - ax)) / area
    a, b, c = (1.0 - b - c) * aw, b * bw, c * cw
    a, b, c = a / (a + b + c), b / (a + b + c), c / (a + b + c)
    k = 3 * face
    place = add_scaled(
        add_scaled(scale(a, load(places, k, 0)), b, load(places, k + 1, 0)),
        c,
        load(places, k + 2, 0),
    )
    normal = add_scaled(
        add_scaled(scale(a, load(normals, k, 0)), b, load(normals, k + 1, 0)),
        c,
        load(normals, k + 2, 0),
    )
    return place, scale(1.0 / (math.sqrt(dot(normal, normal)) + 1e-300), normal)


@part
def _body(color, place, normal, ray, shadows, sun, up, tones):
    """Return the light reflected by a face from the surroundings, the sun and the fill light."""
    to_sun = dot(normal, sun.towards)
    bright = 0.0
    if to_sun > 0.0:  # moved off the face, so that it does not shade itself
        bright = to_sun * _sunny(shadows, sun, add_scaled(place, 2.5 * sun.texel, normal), 0.8)
    half = sub(sun.towards, scale(1.0 / math.sqrt(dot(ray, ray)), ray))
    glance = max(dot(half, normal), 0.0) / math.sqrt(dot(half, half))
    gleam = GLEAM * bright * glance**GLOSS
    around = _mixed(tones.below, tones.above, 0.5 + 0.5 * dot(normal, up))
    filled = max(dot(normal, tones.from_fill), 0.0)
    total = add_scaled(add_scaled(around, bright, tones.sun), filled, tones.fill)
    r, g, b = total
    return r * color[0] + gleam, g * color[1] + gleam, b * color[2] + gleam


@part
def _floor(place, far, ray, camera, shadows, sun, ground, tones):
    """Return the ground colour, with lines at least a pixel wide, shadows and distance haze."""
    across = sub(place, ground.point)
    u, v = dot(across, ground.u), dot(across, ground.v)
    length = math.sqrt(dot(ray, ray))
    slant = max(-dot(ray, ground.normal) / length, 0.02)
    pixel = far * math.sqrt(dot(camera.right, camera.right) * dot(ground.u, ground.u)) / slant
    half = max(LINE, pixel)
    line = max(1.0 - abs(u - round(u)) / half, 1.0 - abs(v - round(v)) / half, 0.0) * LINE / half
    bright = 1.0 - tones.shadow * (1.0 - _sunny(shadows, sun, place, 1.6))
    haze = 1.0 - math.exp(-((far * length / ground.fade) ** 2))
    floor = _mixed(tones.floor, tones.line, min(2.0 * line, 1.0))
    return _mixed(scale(bright, floor), tones.sky, haze)


@part
def _sunny(shadows, sun, place, spread):
    """Return the fraction of sunlight at a point, 0 to 1, averaged over the shadow map."""
    off = sub(place, sun.origin)
    x, y, w = dot(off, sun.x), dot(off, sun.y), dot(off, sun.w) + sun.texel
    if not (0.0 <= x < shadows.shape[1] and 0.0 <= y < shadows.shape[0]):
        return 1.0
    total = 0.0
    for i in range(TAPS):
        for j in range(TAPS):
            column = math.floor(x + spread * (j - 0.5 * (TAPS - 1)))
            row = math.floor(y + spread * (i - 0.5 * (TAPS - 1)))
            within = 0 <= row < shadows.shape[0] and 0 <= column < shadows.shape[1]
            total += 0.0 if within and shadows[row, column] > w else 1.0
    return total / TAPS**2


@part
def _mixed(x, y, share):
    return add_scaled(scale(1.0 - share, x), share, y)


@kernel(void(f4[:, :, ::1], u1[::1], u1[:, :, ::1]), nogil=True, later=True)
def developed(picture, codes, shown):
    """Average blocks of pixels into bytes. `codes` maps linear light 0 to 1 to bytes."""
    height, width, _ = shown.shape
    n = picture.shape[0] // height
    finest = len(codes) - 1
    for row in range(height):
        for column in range(width):
            for i in range(3):
                total = 0.0
                for r in range(n):
                    for c in range(n):
                        total += min(picture[n * row + r, n * column + c, i], 1.0)
                shown[row, column, i] = codes[int(finest * total / (n * n) + 0.5)]
