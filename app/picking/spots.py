"""Ray casting from the pointer to bodies, with exact solids if available (pure)."""

from __future__ import annotations

import itertools
import math
from collections.abc import Iterator, Sequence
from typing import NamedTuple

import numpy as np

from pgraph_core.show import shapes
from pgraph_core.show.bodies import Look
from pgraph_core.show.shapes import Piece

from ..pose import poses
from ..scene.marks import looks
from . import GROUND, Spot, State

EVEN = 1e-9  # distance added before weighting, so that weights decide between equal distances
BEHIND = 0.02  # depth behind the picked face, relative to the piece, at which corners count
DIGITS = 12  # decimals that are kept of a metre: what a turn of the body adds is cut off
FINE = 4  # digits of a point that snaps to nothing, in a body of 1 m
Candidate = tuple[np.ndarray, str, float]  # a point in body axes, what it is, its weight
MEANT, SEEN, INSIDE = 0.5, 1.0, 2.0  # weights of distances, small for preferred spots


class Ray(NamedTuple):
    """A ray from the camera through the pointer."""

    origin: np.ndarray  # (3,) [m]
    direction: np.ndarray  # (3,) unit vector
    slack: float  # tangent of the angle within which a point counts as pointed at


class Hit(NamedTuple):
    """The intersection of a ray with a surface, in the axes of the piece or body."""

    far: float  # along the ray [m]
    direction: np.ndarray  # (3,) unit: the normal of a flat face, the axis of a round one
    what: str


def spot(state: State, ray: Ray, joints: bool = False) -> Spot | None:
    """Find the nearest surface point on a ray, or a corner, end or centre of that body nearby.

    With `joints`, joints and tips take precedence over objects in front of them.
    """
    positions, wxyz = poses(state)
    R = shapes.to_matrix(wxyz)
    found: tuple[float, int, Hit] | None = None
    near: list[int] = []
    drawn = looks(state)
    for k, look in enumerate(drawn):
        own = _seen_from(ray, positions[k], R[k])
        if not _in_reach(look, own):
            continue
        near.append(k)
        hit = min((h for p in look.pieces if (h := met(p, own))), default=None, key=_far)
        if hit is not None and (found is None or hit.far < found[0]):
            found = hit.far, k, hit
    if found is None:
        corner = _snapped_beside(state, drawn, near, ray, positions, R, joints)
        return corner or _on_ground(state, ray)
    far, k, hit = found
    own = _seen_from(ray, positions[k], R[k])
    direction = _clean(hit.direction)
    snapped = _snapped(state, drawn[k], k, own, far, joints)
    if snapped is not None:
        return Spot(state.derived.names[k], _clean(snapped[0]), direction, snapped[1])
    point = own.origin + far * own.direction
    decimals = FINE - math.ceil(math.log10(max(state.derived.grain, 1e-9)))
    x, y, z = (round(float(c), decimals) + 0.0 for c in point)
    return Spot(state.derived.names[k], (x, y, z), direction, hit.what)


def _far(hit: Hit) -> float:
    return hit.far


def _seen_from(ray: Ray, position: np.ndarray, R: np.ndarray) -> Ray:
    """Transform a ray into the axes of a body."""
    return Ray(R.T @ (ray.origin - position), R.T @ ray.direction, ray.slack)


def _in_reach(look: Look, ray: Ray) -> bool:
    """Check whether a ray with its tolerance may hit a piece of a body."""
    for piece in look.pieces:
        low, high = shapes.bounds(piece)
        radius = float(np.linalg.norm(high - low)) / 2
        middle = np.asarray(piece.position) + piece.rotation @ ((low + high) / 2)
        arm = middle - ray.origin
        along = float(arm @ ray.direction)
        aside = math.sqrt(max(float(arm @ arm) - along * along, 0.0))
        if along > -radius and aside <= radius + ray.slack * max(along, 0.0):
            return True
    return False


# -- what snaps ------------------------------------------------------------------------------------


def _snapped(
    state: State, look: Look, k: int, ray: Ray, far: float, joints: bool
) -> tuple[np.ndarray, str, float] | None:
    """Find the best snapping candidate on a body within the ray's slack, and its distance."""
    best: tuple[np.ndarray, str, float] | None = None
    size = state.derived.grain
    for point, what, weight in candidates(state, look, k, joints):
        arm = point - ray.origin
        along = float(arm @ ray.direction)
        if along <= 0 or (weight == SEEN and along > far + BEHIND * size):
            continue
        aside = float(np.linalg.norm(arm - along * ray.direction)) / along
        if aside <= ray.slack and (best is None or weight * (aside + EVEN) < best[2]):
            best = point, what, weight * (aside + EVEN)
    return best


def _snapped_beside(
    state: State, drawn: Sequence[Look], near: Sequence[int], ray: Ray, positions: np.ndarray,
    R: np.ndarray, joints: bool,
) -> Spot | None:  # fmt: skip
    """Find the best snapping point for a ray that passes just outside a body."""
    best: tuple[np.ndarray, str, float, int] | None = None
    for k in near:
        own = _seen_from(ray, positions[k], R[k])
        found = _snapped(state, drawn[k], k, own, math.inf, joints)
        if found is not None and (best is None or found[2] < best[2]):
            best = (*found, k)
    if best is None:
        return None
    return Spot(state.derived.names[best[3]], _clean(best[0]), None, best[1])


def candidates(state: State, look: Look, k: int, joints: bool) -> Iterator[Candidate]:
    """Yield corners, midpoints, ends and centres of pieces, then joints, tip and centre of mass."""
    body, joint = look.body, MEANT if joints else INSIDE
    for piece in look.pieces:
        for point, what, inside in _of_piece(piece):
            place = np.asarray(piece.position) + piece.rotation @ point
            yield place, what, INSIDE if inside else SEEN
    yield np.zeros(3), "origin", joint
    for link, child in zip(look.links, state.derived.children[k + 1]):
        yield np.asarray(link), f"joint of {state.derived.names[child - 1]}", joint
    yield np.asarray(body.tip_point), "tip", joint
    for site in state.model.sites:
        if site.body == body.name:
            yield np.asarray(site.point), f"site {site.name}", MEANT
    yield np.asarray(body.com), "centre of mass", INSIDE


def _of_piece(piece: Piece) -> Iterator[tuple[np.ndarray, str, bool]]:
    """Yield points in the piece's axes, with a description and whether they are inside."""
    half = np.asarray(piece.size) / 2
    match piece.kind:
        case "box":
            names = ("corner", "middle of an edge", "centre of a face", "centre")
            for signs in itertools.product((-1, 0, 1), repeat=3):
                zeros = signs.count(0)
                yield half * signs, names[zeros], zeros == 3
        case "sphere":
            yield np.zeros(3), "centre", True
        case "cylinder":
            for z in (-half[2], half[2]):
                yield np.array((0.0, 0.0, z)), "centre of an end", False
            yield np.zeros(3), "centre", True
        case "capsule":
            for z, radius in _balls(piece):
                yield np.array((0.0, 0.0, z)), "centre of a cap", True
                yield np.array((0.0, 0.0, z + math.copysign(radius, z))), "end", False
            yield np.zeros(3), "centre", True
        case "mesh":
            low, high = shapes.bounds(piece)
            yield (low + high) / 2, "centre", True


def _balls(piece: Piece) -> tuple[tuple[float, float], tuple[float, float]]:
    """Return the (height, radius) of the two end spheres whose convex hull is the capsule."""
    near, tall = piece.size[0] / 2, piece.size[2]
    far = near * piece.taper
    return (near - tall / 2, near), (tall / 2 - far, far)


def _clean(v: np.ndarray) -> tuple[float, float, float]:
    x, y, z = (round(float(c), DIGITS) + 0.0 for c in v)
    return x, y, z


# -- where a ray meets a solid ---------------------------------------------------------------------


def met(piece: Piece, ray: Ray) -> Hit | None:
    """Find the first intersection of a ray with a piece, in the axes of its body."""
    own = _seen_from(ray, np.asarray(piece.position), piece.rotation)
    hit = min(_meetings(piece, own), default=None, key=_far)
    if hit is None:
        return None
    return hit._replace(direction=piece.rotation @ hit.direction)


def _meetings(piece: Piece, ray: Ray) -> Iterator[Hit]:
    """Yield surface points of a piece in front of the camera, in the axes of the piece."""
    half = np.asarray(piece.size) / 2
    near, far = half[0], half[0] * piece.taper
    match piece.kind:
        case "box":
            yield from _box(half, ray)
        case "sphere":
            yield from _ellipsoid(half, np.zeros(3), ray)
        case "cylinder":
            yield from _frustum((-half[2], near), (half[2], far), ray)
            for z, radius in ((-half[2], near), (half[2], far)):
                yield from _disc(z, radius, ray)
        case "capsule":
            (z0, r0), (z1, r1) = _balls(piece)
            for z, radius in ((z0, r0), (z1, r1)):
                yield from _ellipsoid(np.full(3, radius), np.array((0.0, 0.0, z)), ray)
            touch = math.asin(max(-1.0, min(1.0, (r0 - r1) / max(z1 - z0, 1e-12))))
            s, c = math.sin(touch), math.cos(touch)
            yield from _frustum((z0 + r0 * s, r0 * c), (z1 + r1 * s, r1 * c), ray)
        case _:
            yield from _triangles(piece, ray)


def _box(half: np.ndarray, ray: Ray) -> Iterator[Hit]:
    with np.errstate(divide="ignore", invalid="ignore"):
        a, b = (-half - ray.origin) / ray.direction, (half - ray.origin) / ray.direction
    enters = np.where(np.isnan(a) | np.isnan(b), -np.inf, np.minimum(a, b))
    leaves = np.where(np.isnan(a) | np.isnan(b), np.inf, np.maximum(a, b))
    if 0 < (far := float(enters.max())) <= leaves.min():
        k = int(enters.argmax())
        yield Hit(far, -math.copysign(1.0, ray.direction[k]) * np.eye(3)[k], "flat face")


def _ellipsoid(half: np.ndarray, middle: np.ndarray, ray: Ray) -> Iterator[Hit]:
    o, d = (ray.origin - middle) / half, ray.direction / half
    for far in _roots(float(d @ d), float(o @ d), float(o @ o) - 1.0):
        normal = (o + far * d) / half
        yield Hit(far, normal / np.linalg.norm(normal), "round face")


def _frustum(
    low: tuple[float, float], high: tuple[float, float], ray: Ray
) -> Iterator[Hit]:  # fmt: skip
    """Yield hits on a conical side between two (height, radius) pairs, and the cone's axis."""
    (z0, r0), (z1, r1) = low, high
    if z1 - z0 < 1e-12:
        return
    k = (r1 - r0) / (z1 - z0)
    (x, y, z), (dx, dy, dz) = ray.origin, ray.direction
    r = r0 + k * (z - z0)
    a, b, c = dx * dx + dy * dy - (k * dz) ** 2, x * dx + y * dy - k * dz * r, x * x + y * y - r * r
    for far in _roots(a, b, c):
        if z0 <= z + far * dz <= z1:
            yield Hit(far, np.array((0.0, 0.0, 1.0)), "round face")


def _disc(z: float, radius: float, ray: Ray) -> Iterator[Hit]:
    if ray.direction[2] == 0:
        return
    far = float((z - ray.origin[2]) / ray.direction[2])
    x, y, _ = ray.origin + far * ray.direction
    if far > 0 and x * x + y * y <= radius * radius:
        yield Hit(far, np.array((0.0, 0.0, math.copysign(1.0, z))), "flat face")


def _roots(a: float, b: float, c: float) -> list[float]:
    """Return the positive roots t of a t² + 2 b t + c = 0."""
    if abs(a) < 1e-300:
        return []
    root = b * b - a * c
    if root < 0:
        return []
    return [t for sign in (-1, 1) if (t := (-b + sign * math.sqrt(root)) / a) > 0]


def _triangles(piece: Piece, ray: Ray) -> Iterator[Hit]:
    """Intersect by Möller and Trumbore, *Fast, minimum storage ray/triangle intersection*."""
    solid = shapes.mesh((piece,))
    place, R = np.asarray(piece.position), piece.rotation
    corners = (np.asarray(solid.vertices) - place) @ R
    p, q, r = (corners[np.asarray(solid.faces)[:, k]] for k in range(3))
    across = np.cross(ray.direction, r - p)
    det = np.einsum("ij,ij->i", q - p, across)
    with np.errstate(divide="ignore", invalid="ignore"):
        s = ray.origin - p
        u = np.einsum("ij,ij->i", s, across) / det
        back = np.cross(s, q - p)
        v = back @ ray.direction / det
        t = np.einsum("ij,ij->i", r - p, back) / det
        inside = (np.abs(det) > 1e-15) & (u >= 0) & (v >= 0) & (u + v <= 1) & (t > 0)
    for i in np.flatnonzero(inside):
        normal = np.cross(q[i] - p[i], r[i] - p[i])
        yield Hit(float(t[i]), normal / np.linalg.norm(normal), "face")


def _on_ground(state: State, ray: Ray) -> Spot | None:
    """Return the intersection of a ray with the ground plane, if something can touch the ground."""
    normal = np.asarray(state.model.ground_normal)
    down = float(ray.direction @ normal)
    if down >= 0 or state.derived.low > 0:
        return None
    point = ray.origin - ray.direction * float(ray.origin @ normal) / down
    decimals = FINE - math.ceil(math.log10(max(state.derived.size, 1e-9)))
    x, y, z = (round(float(c), decimals) + 0.0 for c in point)
    return Spot(GROUND, (x, y, z), _clean(normal), "ground")
