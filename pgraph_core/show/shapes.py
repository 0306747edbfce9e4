"""The drawn shape of a body: simple pieces in its frame, also as a trimesh mesh.

Bodies and shapes are any objects with the fields of `pg.Body` and `pg.Shape`.
"""

from __future__ import annotations

import itertools
import math
from collections.abc import Sequence
from dataclasses import replace
from typing import Any

import numpy as np

from ..errors import needed
from ..rotation import frame_of
from ..shapes import PICTURES, kind_of, picture_of
from ..shapes.contract import Color, Piece
from ..shapes.meshes import fault_of

# of the trunk and of one branch after the other; the style of the light theme has the same. None is
# blue: that is the colour of what is selected
HUES: tuple[Color, ...] = (
    (91, 107, 134), (194, 86, 12), (11, 114, 133), (147, 51, 168), (47, 122, 31), (190, 38, 92),
    (122, 104, 0),
)  # fmt: skip
PAINTS: tuple[Color, ...] = (
    (205, 208, 214), (217, 131, 74), (78, 156, 176), (168, 104, 187), (104, 164, 92),
    (214, 104, 140), (176, 158, 60),
)  # fmt: skip
COAT, RUBBER, TINT = (
    (218, 220, 224),
    (108, 114, 125),
    0.75,
)  # colours of bodies, and the share of the paint
LUMA = (0.299, 0.587, 0.114)  # weights of red, green and blue (ITU-R BT.601)
LARGEST = float(np.finfo(float).max ** 0.5) / 10  # [m] squares of it can be added
STAND_IN: Color = (214, 51, 132)  # magenta, which no branch has
# radii: of a joint relative to the length of its link, of the rod and of the bob at a mass centre
# relative to the joint; least radius [m]
SLENDER, ROD, BOB, THINNEST = 0.11, 0.65, 1.3, 0.004
PROUD = 1.4  # radius of a joint relative to that of a slender shape
CREASE = math.radians(30)  # more than between the facets of round solids, less than at corners
SHORTEST = 10 * THINNEST  # [m] a shorter link is drawn as a box, as large as which a model is shown


def pieces(body: Any, links: Sequence[Sequence[float]]) -> tuple[Piece, ...]:
    """Return the body's own shapes, or slender links from its origin to its children, tip or com.

    Meshes that cannot be read are replaced by half-transparent links in the colour `STAND_IN`.
    """
    seen = [shape for shape in body.drawn if shape.opacity]
    own = tuple(_own(shape) for shape in seen if not _missing(shape))
    if len(own) < len(seen):
        rods = _links(body, links)
        return own + tuple(replace(rod, color=STAND_IN, opacity=0.5) for rod in rods)
    if not body.shapes:
        return _with_bob(body, _links(body, links))
    return own if any(piece.color or piece.file for piece in own) else (*own, *_pin(body, own))


def _missing(shape: Any) -> bool:
    """Check whether a shape is a mesh whose file cannot be read."""
    return bool(shape.file) and bool(fault_of(shape.file))


def _links(body: Any, links: Sequence[Sequence[float]]) -> tuple[Piece, ...]:
    """Return slender links from a body's origin to its children, tip or com."""
    ends = [np.asarray(link) for link in links] or [np.asarray(body.tip_point)]
    longest = max(float(np.linalg.norm(end)) for end in ends)
    if longest < SHORTEST:
        ends = [2 * np.asarray(body.com)]
        longest = float(np.linalg.norm(ends[0]))
    if longest < SHORTEST:
        edge = 0.4 * max(body.mass, 0.1) ** (1 / 3) * 0.2
        return (Piece("box", (edge, edge, edge), (0.0, 0.0, 0.0), np.eye(3)),)
    radius = max(SLENDER * longest, THINNEST)
    long = [end for end in ends if np.linalg.norm(end) > radius / 2]
    return (*(_rod(end, max(ROD * radius, THINNEST)) for end in long), *_hub(body, radius))


def _hub(body: Any, radius: float) -> tuple[Piece, ...]:
    """Return the joint of a body: a pin along its axis, a sleeve or a ball."""
    if not body.sequence:
        return ()
    motion, edge = body.sequence[-1], 2 * radius
    along, solid, long = np.eye(3), "sphere", edge
    if motion.facts.directed:
        along = frame_of(np.asarray(motion.axis) / np.linalg.norm(motion.axis))
        solid, long = ("cylinder", edge) if motion.facts.turns else ("box", 2 * edge)
    color = None if body.floats else RUBBER
    return (Piece(solid, (edge, edge, long), (0.0, 0.0, 0.0), along, color=color),)


def _pin(body: Any, own: Sequence[Piece]) -> tuple[Piece, ...]:
    """Return the joint of a body with plain shapes that are as slender as links, or nothing."""
    sizes = np.array([piece.size for piece in own])
    if not own or body.floats or sizes.min() > 2 * SLENDER * sizes.max():
        return ()
    return _hub(body, float(PROUD * sizes.min() / 2))


def _with_bob(body: Any, rods: tuple[Piece, ...]) -> tuple[Piece, ...]:
    """Return rods, including a rod with a bob to a centre of mass outside the other rods."""
    com = np.asarray(body.com)
    inside = (np.abs(p.rotation.T @ (com - p.position)) <= np.array(p.size) / 2 for p in rods)
    if not body.mass or any(map(np.all, inside)):
        return rods
    far = float(np.linalg.norm(com))
    edge = 2 * BOB * max(SLENDER * far, THINNEST)
    bob = Piece("sphere", (edge, edge, edge), body.com, np.eye(3))
    return (*rods, _rod(com, max(ROD * SLENDER * far / 2, THINNEST)), bob)


def _rod(end: np.ndarray, radius: float) -> Piece:
    """Create a capsule from the origin to `end`, with the caps included in its length."""
    length = float(np.linalg.norm(end))
    width = min(2 * radius, length)
    x, y, z = (float(c) / 2 for c in end)
    return Piece("capsule", (width, width, length), (x, y, z), frame_of(end / length))


def _own(shape: Any) -> Piece:
    form = kind_of(shape).form(shape)
    rotation = to_matrix(np.asarray(shape.rotation))
    color = None
    if shape.colour is not None:
        r, g, b = (round(255 * c) for c in shape.colour)
        color = (r, g, b)
    x, y, z = (np.asarray(shape.position) + form.offset * rotation[:, 2]).tolist()
    place, opacity = (x, y, z), shape.opacity
    return Piece(form.kind, form.size, place, rotation, form.file, color, opacity, form.taper)


def mesh(parts: Sequence[Piece]) -> Any:
    """Return the pieces as one trimesh.Trimesh in body axes."""
    solids = [_solid(part) for part in parts]
    return needed("trimesh").util.concatenate(solids)


def creased(solid: Any) -> Any:
    """Return a trimesh whose faces share no vertices across edges sharper than CREASE, so that
    renderers shade boxes and the ends of cylinders flat."""
    return needed("trimesh").graph.smooth_shade(solid, angle=CREASE, facet_minarea=None)


def unit(kind: str, file: str = "", taper: float = 1.0) -> Any:
    """Return a trimesh that is bounded by the unit cube and scaled to draw batched bodies.

    Meshes are not scaled to unit size. Round solids have a quarter of the faces of a single body,
    because there are many of them and each is small in the view.
    """
    tall = PICTURES[kind].tall
    piece = Piece(kind, (1.0, 1.0, tall), (0.0, 0.0, 0.0), np.eye(3), file, taper=taper)
    solid = PICTURES[kind].drawn(piece, many=True)
    solid.apply_scale([1.0, 1.0, 1.0 / tall])
    return solid


def _solid(part: Piece) -> Any:
    solid = picture_of(part).drawn(part)
    placed = np.eye(4)
    placed[:3, :3], placed[:3, 3] = part.rotation, part.position
    solid.apply_transform(placed)
    return solid


def coil(turns: int = 9, wire: float = 0.07) -> Any:
    """Create a trimesh of a helical spring along z in the unit cube, to stretch along z."""
    around, along = 8, 14 * turns
    t = np.linspace(0.0, 1.0, along)
    ends = np.clip(np.minimum(t, 1 - t) / 0.06, 0.0, 1.0)  # both ends lie on the axis
    r, angle = (0.5 - wire) * ends, 2 * np.pi * turns * t
    middle = np.column_stack((r * np.cos(angle), r * np.sin(angle), t - 0.5))
    out = np.column_stack((np.cos(angle), np.sin(angle), 0 * t))
    phi = np.linspace(0, 2 * np.pi, around, endpoint=False)
    ring = out[:, None] * np.cos(phi)[:, None] + np.array((0, 0, 1 / turns)) * np.sin(phi)[:, None]
    vertices = (middle[:, None] + wire * ring).reshape(-1, 3)
    k, j = np.meshgrid(np.arange(along - 1), np.arange(around), indexing="ij")
    a, b = k * around + j, k * around + (j + 1) % around
    faces = np.concatenate([
        np.stack((a, b, a + around), -1).reshape(-1, 3),
        np.stack((b, b + around, a + around), -1).reshape(-1, 3),
    ])  # fmt: skip
    return needed("trimesh").Trimesh(vertices, faces, process=False)


def bracket() -> Any:
    """Return a trimesh of a pivot's hatched support in the unit cube, its tip at z = 1/2."""
    trimesh = needed("trimesh")
    profile = [(-0.1, 0.5), (0.1, 0.5), (0.36, -0.22), (-0.36, -0.22)]  # x, z
    wedge = np.array([(x, y, z) for y in (-0.2, 0.2) for x, z in profile])
    parts = [trimesh.convex.convex_hull(wedge), trimesh.creation.box(extents=(1.0, 0.6, 0.08))]
    parts[1].apply_translation((0.0, 0.0, -0.22))
    for x in np.linspace(-0.34, 0.42, 4):  # the hatching of drawings, below the plate
        bar = trimesh.creation.box(extents=(0.045, 0.6, 0.3))
        bar.apply_transform(trimesh.transformations.rotation_matrix(0.62, (0.0, 1.0, 0.0)))
        bar.apply_translation((x, 0.0, -0.36))
        parts.append(bar)
    solid = trimesh.util.concatenate(parts)
    solid.vertices = np.clip(solid.vertices, -0.5, 0.5)
    return solid


def cone() -> Any:
    """Return a trimesh that widens from the origin to the unit square at height 1."""
    solid = needed("trimesh").creation.cone(radius=0.5, height=1.0, sections=32)
    solid.apply_transform(np.diag([1.0, -1.0, -1.0, 1.0]))  # the apex is above: turned about x
    solid.apply_translation((0.0, 0.0, 1.0))
    return solid


def unreadable(bodies: Sequence[Any]) -> tuple[str, ...]:
    """Return a sentence for each mesh that cannot be read and is drawn as links instead."""
    files = {shape.file for b in bodies for shape in b.shapes if shape.file}
    return tuple(filter(None, map(fault_of, sorted(files))))


def reach(
    bodies: Sequence[Any], positions: np.ndarray, rotations: np.ndarray,
) -> tuple[np.ndarray, float]:  # fmt: skip
    """Return the centre of the model in its home configuration, and its extent from there [m]."""
    points = [np.asarray(p) for p in positions]
    for body, p, R in zip(bodies, positions, rotations):
        points += [p + R @ np.asarray(body.tip_point), p + R @ np.asarray(body.com)]
    if not points:
        return np.zeros(3), 1.0
    halves = np.clip(np.nan_to_num(points), -LARGEST, LARGEST) / 2
    low, high = np.min(halves, axis=0), np.max(halves, axis=0)
    return low + high, diagonal(halves)


def diagonal(points: np.ndarray) -> float:
    """Return the diagonal of the box around points (n, 3) [m], at least SHORTEST."""
    return max(float(np.linalg.norm(np.ptp(points, axis=0))), SHORTEST)


def branches(parent: Sequence[int]) -> tuple[int, ...]:
    """Return the branch of each body: 0 if it carries several tips, else 1, 2, ... by tip."""
    n = len(parent)
    tips = [0] * (n + 1)
    for k in range(n, 0, -1):
        tips[k] = max(tips[k], 1)
        tips[parent[k - 1]] += tips[k]
    found, met = [0] * (n + 1), itertools.count(1)
    for k, p in enumerate(parent, 1):
        if tips[k] == 1:
            found[k] = found[p] if p > 0 and tips[p] == 1 else next(met)
    return tuple(found[1:])


def hue_of(branch: int) -> int:
    """Return the hue index of a branch, which is 0 for the trunk."""
    return 1 + (branch - 1) % (len(HUES) - 1) if branch else 0


def branch_colors(parent: Sequence[int]) -> tuple[Color, ...]:
    """Return the colour of each body, a light base colour tinted with its branch's hue."""
    return tuple(COATS[hue_of(k)] for k in branches(parent))


def shade(color: Color | None) -> Color | None:
    """Return the dark or light base of a shape's own colour, or None to use its branch's."""
    if color is None:
        return None
    light = sum(w * c for w, c in zip(LUMA, color)) / 255
    return RUBBER if light < 0.46 else COAT if light > 0.8 else None


def _tinted(paint: Color) -> Color:
    """Blend the base colour with a fraction TINT of a paint colour, in linear light."""
    r, g, b = (((1 - TINT) * c**2.2 + TINT * h**2.2) ** (1 / 2.2) for c, h in zip(COAT, paint))
    return round(r), round(g), round(b)


COATS = tuple(map(_tinted, PAINTS))


def to_matrix(wxyz: np.ndarray) -> np.ndarray:
    """Convert quaternions (..., 4) to rotation matrices (..., 3, 3)."""
    w, x, y, z = np.moveaxis(wxyz / np.linalg.norm(wxyz, axis=-1, keepdims=True), -1, 0)
    rows = (
        (1 - 2 * (y * y + z * z), 2 * (x * y - w * z), 2 * (x * z + w * y)),
        (2 * (x * y + w * z), 1 - 2 * (x * x + z * z), 2 * (y * z - w * x)),
        (2 * (x * z - w * y), 2 * (y * z + w * x), 1 - 2 * (x * x + y * y)),
    )
    return np.stack([np.stack(row, axis=-1) for row in rows], axis=-2)


def to_wxyz(R: np.ndarray) -> np.ndarray:
    """Convert rotation matrices (n, 3, 3) to quaternions (n, 4), with w >= 0."""
    from scipy.spatial.transform import Rotation

    if len(R) == 0:
        return np.zeros((0, 4))
    xyzw = Rotation.from_matrix(R).as_quat()
    wxyz = np.concatenate((xyzw[:, 3:], xyzw[:, :3]), axis=1)
    return wxyz * np.where(wxyz[:, :1] < 0, -1.0, 1.0)


def spaced(size: float) -> float:
    """Return a round grid spacing (1, 2 or 5 times a power of ten) for a model of this size [m]."""
    power = 10.0 ** math.floor(math.log10(size))
    return next(f * power for f in (1.0, 2.0, 5.0, 10.0) if f * power >= size / 2)


def times(a: np.ndarray, b: np.ndarray) -> np.ndarray:
    """Return the products a b of quaternions (n, 4), which apply b first and then a."""
    w1, x1, y1, z1 = np.moveaxis(a, -1, 0)
    w2, x2, y2, z2 = np.moveaxis(b, -1, 0)
    return np.stack(
        (
            w1 * w2 - x1 * x2 - y1 * y2 - z1 * z2,
            w1 * x2 + x1 * w2 + y1 * z2 - z1 * y2,
            w1 * y2 - x1 * z2 + y1 * w2 + z1 * x2,
            w1 * z2 + x1 * y2 - y1 * x2 + z1 * w2,
        ),
        axis=-1,
    )
