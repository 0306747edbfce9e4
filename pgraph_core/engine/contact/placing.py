"""Shapes in the world: poses, bounding boxes and the layout of a contact point."""

import math

from ...tolerances import ROUNDING
from ..compiler.jit import part, sweep
from ..records import CAPSULE, SPHERE
from ..rows import origin_of, rotation_of
from ..vec import (
    add,
    add_scaled,
    dot,
    load,
    mat_mul,
    matrix,
    mul,
    scale,
    set_matrix,
    set_xyz,
    sub,
    xyz,
)

DEPTH = 1e-5  # tolerated penetration, relative to the size of the bodies


@sweep
def place(shapes, work, poses):
    """Compute the poses of all shapes from the rows that carry them, after `positions`."""
    for i in range(shapes.shape[0]):
        k = shapes[i].row
        r = rotation_of(work, k)
        set_xyz(poses[i].position, add(origin_of(work, k), mul(r, xyz(shapes[i].position))))
        set_matrix(poses[i].rotation, mat_mul(r, matrix(shapes[i].rotation)))


@part
def vertex(geometry, poses, i, k):
    """Return vertex k of shape i in world coordinates."""
    local = load(geometry.vertices, geometry.shapes[i].first_vertex + k, 0)
    return add(xyz(poses[i].position), mul(matrix(poses[i].rotation), local))


@part
def rim_direction(geometry, r, n):
    """Compute the unit direction from a cylinder's axis to a point on its rim.

    The rim is in contact with a plane with normal n. A few points of a disc support less than the
    disc, except in the direction in which it would tip. The cylinder tips in the direction in which
    it leans. If it is flat within the tolerated depth, it tips in the direction of its weight.
    """
    axis = (r[2], r[5], r[8])
    lean = add_scaled(scale(dot(n, axis), axis), -1.0, n)
    size = math.sqrt(dot(lean, lean))
    pull = xyz(geometry.down)
    pull = add_scaled(pull, -dot(pull, axis), axis)
    lean = add_scaled(lean, max(DEPTH - size, 0.0), pull)
    size = math.sqrt(dot(lean, lean))
    return scale(1.0 / size, lean) if size > ROUNDING else (r[0], r[3], r[6])


@part
def half_extent(r, half, n):
    """Return half the extent of a rotated box along world axis n."""
    return abs(r[3 * n]) * half[0] + abs(r[3 * n + 1]) * half[1] + abs(r[3 * n + 2]) * half[2]


@sweep
def bound(geometry, poses, i, slack, bounds):
    """Compute the bounding box of shape i in world axes, enlarged by `slack` on every side."""
    shapes = geometry.shapes
    r = matrix(poses[i].rotation)
    middle = add(xyz(poses[i].position), mul(r, xyz(shapes[i].middle)))
    radius = shapes[i].radius
    half = xyz(shapes[i].half_extents)
    kind = geometry.shapes[i].kind
    if kind == SPHERE:
        half = (0.0, 0.0, 0.0)
    elif kind == CAPSULE:
        half = (0.0, 0.0, shapes[i].half_length)
    else:
        radius = 0.0
    for n in range(3):
        wide = half_extent(r, half, n) + radius + slack
        bounds[i].low[n] = middle[n] - wide
        bounds[i].high[n] = middle[n] + wide


@part
def far_apart(shapes, poses, i, j, margin):
    """Check whether two shapes' bounding balls are more than `margin` apart, or not finite."""
    x = sub(xyz(poses[i].position), xyz(poses[j].position))
    near = shapes[i].reach + shapes[j].reach + margin
    return not dot(x, x) <= near * near


@sweep
def put(out, n, on_b, normal, gap, feature):
    """Write contact point n and return n + 1. Points beyond the capacity are only counted."""
    if n < out.shape[0]:
        set_xyz(out[n].point_a, add_scaled(on_b, gap, normal))
        set_xyz(out[n].point_b, on_b)
        set_xyz(out[n].normal, normal)
        out[n].gap = gap
        out[n].feature = feature
    return n + 1


@sweep
def label(out, first, n, i, j, pair):
    """Label contact points `first` to n with their shapes and pair."""
    for k in range(first, min(n, out.shape[0])):
        out[k].shape_a = i
        out[k].shape_b = j
        out[k].pair = pair
