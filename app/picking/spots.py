"""Ray casting from the pointer to bodies, with exact solids if available (pure)."""

from __future__ import annotations

import math
from collections.abc import Iterator, Sequence

import numpy as np

from pgraph_core.shapes import picture_of
from pgraph_core.shapes.contract import Piece
from pgraph_core.shapes.rays import Hit, Ray
from pgraph_core.show import shapes
from pgraph_core.show.bodies import Look

from ..pose import poses
from ..scene.marks import looks
from . import GROUND, Spot, State

EVEN = 1e-9  # distance added before weighting, so that weights decide between equal distances
BEHIND = 0.02  # depth behind the picked face, relative to the piece, at which corners count
DIGITS = 12  # decimals that are kept of a metre: what a turn of the body adds is cut off
FINE = 4  # digits of a point that snaps to nothing, in a body of 1 m
Candidate = tuple[np.ndarray, str, float]  # a point in body axes, what it is, its weight
MEANT, SEEN, INSIDE = 0.5, 1.0, 2.0  # weights of distances, small for preferred spots


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
        own = ray.seen_from(positions[k], R[k])
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
    own = ray.seen_from(positions[k], R[k])
    direction = _clean(hit.direction)
    snapped = _snapped(state, drawn[k], k, own, far, joints)
    if snapped is not None:
        return Spot(state.derived.names[k], _clean(snapped[0]), direction, snapped[1], True)
    point = own.origin + far * own.direction
    decimals = FINE - math.ceil(math.log10(max(state.derived.grain, 1e-9)))
    x, y, z = (round(float(c), decimals) + 0.0 for c in point)
    return Spot(state.derived.names[k], (x, y, z), direction, hit.what)


def _far(hit: Hit) -> float:
    return hit.far


def _in_reach(look: Look, ray: Ray) -> bool:
    """Check whether a ray with its tolerance may hit a piece of a body."""
    for piece in look.pieces:
        low, high = picture_of(piece).bounds(piece)
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
        own = ray.seen_from(positions[k], R[k])
        found = _snapped(state, drawn[k], k, own, math.inf, joints)
        if found is not None and (best is None or found[2] < best[2]):
            best = (*found, k)
    if best is None:
        return None
    return Spot(state.derived.names[best[3]], _clean(best[0]), None, best[1], True)


def candidates(state: State, look: Look, k: int, joints: bool) -> Iterator[Candidate]:
    """Yield corners, midpoints, ends and centres of pieces, then joints, tip and centre of mass."""
    body, joint = look.body, MEANT if joints else INSIDE
    for piece in look.pieces:
        for point, what, inside in picture_of(piece).marks(piece):
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


def _clean(v: np.ndarray) -> tuple[float, float, float]:
    x, y, z = (round(float(c), DIGITS) + 0.0 for c in v)
    return x, y, z


# -- where a ray meets a solid ---------------------------------------------------------------------


def met(piece: Piece, ray: Ray) -> Hit | None:
    """Find the first intersection of a ray with a piece, in the axes of its body."""
    own = ray.seen_from(np.asarray(piece.position), piece.rotation)
    hit = min(picture_of(piece).meetings(piece, own), default=None, key=_far)
    if hit is None:
        return None
    return hit._replace(direction=piece.rotation @ hit.direction)


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
