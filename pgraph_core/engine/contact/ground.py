"""Shapes against the ground: exact contact points and gaps.

The ground is a plane through the world's origin, and rectangles of it at another height. Raised
parts and the rims of pits are boxes on row 0 (`contact/terrain.py`), which replace the plane.
The floor of a pit is the plane, lower.
"""

import math

from ..compiler.jit import part, sweep
from ..records import CYLINDER, ELLIPSOID, HULL
from ..vec import add_scaled, cross, dot, matrix, mul, mul_t, scale, set_xyz, xyz
from .manifold import thin
from .placing import put, rim_direction, vertex


@part
def normal_of(ground):
    """Return the unit normal of the plane."""
    return xyz(ground.plane[0].normal)


@part
def patch_under(ground, p):
    """Return the index of the last patch of the ground under a point, or -1 if there is none."""
    x = dot(p, xyz(ground.plane[0].x))
    y = dot(p, xyz(ground.plane[0].y))
    found = -1
    for k in range(ground.patches.shape[0]):
        patch = ground.patches[k]
        if patch.x_low <= x <= patch.x_high and patch.y_low <= y <= patch.y_high:
            found = k
    return found


@part
def height(ground, p):
    """Return the height of the ground along the normal under a point [m]."""
    k = patch_under(ground, p)
    return ground.patches[k].height if k >= 0 else 0.0


@part
def is_box(ground, p):
    """Check whether the ground under a point is a box rather than the plane."""
    k = patch_under(ground, p)
    return k >= 0 and ground.patches[k].box == 1


@sweep
def top(ground):
    """Return the maximum height of the ground [m]."""
    found = 0.0
    for k in range(ground.patches.shape[0]):
        found = max(found, ground.patches[k].height)
    return found


@part
def above(ground, p):
    """Return the height of a point above the ground."""
    return dot(p, normal_of(ground)) - height(ground, p)


@part
def rim_point(geometry, ground, poses, i, k):
    """Return point k on a cylinder's rims and its feature.

    The first two are the lowest of either rim, the others are quarter turns from there around the
    lower rim.
    """
    n = normal_of(ground)
    r = matrix(poses[i].rotation)
    axis = (r[2], r[5], r[8])
    tilt = dot(n, axis)
    down = rim_direction(geometry, r, n)
    far = k == 1 if k < 2 else tilt <= 0.0  # the end at +z
    if k == 2 or k == 4:
        down = cross(axis, down)
    if k >= 3:
        down = scale(-1.0, down)
    half = geometry.shapes[i].half_length
    centre = add_scaled(xyz(poses[i].position), half if far else -half, axis)
    feature = k + 3 if k >= 2 and far else k
    return add_scaled(centre, geometry.shapes[i].radius, down), feature


@part
def candidate(geometry, ground, poses, i, k):
    """Compute (position, radius, feature) of the k-th ball that may touch the ground."""
    if geometry.shapes[i].kind == CYLINDER:
        p, feature = rim_point(geometry, ground, poses, i, k)
        return p, 0.0, feature
    if geometry.shapes[i].kind == ELLIPSOID:
        r, half = matrix(poses[i].rotation), xyz(geometry.shapes[i].half_extents)
        g = mul_t(r, normal_of(ground))
        q = (half[0] ** 2 * g[0], half[1] ** 2 * g[1], half[2] ** 2 * g[2])
        lowest = add_scaled(xyz(poses[i].position), -1.0 / math.sqrt(dot(g, q)), mul(r, q))
        return lowest, 0.0, 0
    return vertex(geometry, poses, i, k), geometry.shapes[i].radius, k


@part
def candidates(shapes, i):
    """Count the candidate balls."""
    if shapes[i].kind == CYLINDER:
        return 5
    return 1 if shapes[i].kind == ELLIPSOID else shapes[i].vertices


@sweep
def ground_gap(geometry, ground, poses, i):
    """Return the signed distance between shape i and the ground [m]."""
    gap = math.inf
    for k in range(candidates(geometry.shapes, i)):
        p, radius, _ = candidate(geometry, ground, poses, i, k)
        if not is_box(ground, p):
            gap = min(gap, above(ground, p) - radius)
    return gap


@part
def ground_contacts(geometry, ground, poses, i, margin, room, out, n):
    """Append contacts between shape i and the ground within `margin`. Returns the new number.

    Spheres and ellipsoids have 1 point, and capsules 2. Boxes and lists of points have all their
    vertices, and hulls at most 8. A cylinder has up to 5, the lowest of both rims and a square on
    the lower rim. The feature is the number of the vertex. For a cylinder, features 0 and 1 are the
    lowest points of its ends, and features 2-4 and 5-7 are the remaining corners of the squares.
    """
    shapes = geometry.shapes
    normal = normal_of(ground)
    kind = shapes[i].kind
    found = 0
    for k in range(candidates(shapes, i)):
        p, radius, feature = candidate(geometry, ground, poses, i, k)
        gap = above(ground, p) - radius
        if gap > margin or is_box(ground, p):
            continue
        if kind == HULL:
            set_xyz(room[found].place, p)
            room[found].height = gap
            room[found].tag = k
            found += 1
        else:
            n = put(out, n, add_scaled(p, -gap - radius, normal), normal, gap, feature)
    for k in range(thin(room, 0, found, normal)):
        gap = room[k].height
        on_ground = add_scaled(xyz(room[k].place), -gap, normal)
        n = put(out, n, on_ground, normal, gap, room[k].tag)
    return n
