"""Two shapes of any kinds: the routine that fits them.

`single_pair` is the table of kinds: spheres, points and capsules, and a ball with a box, have
routines of their own (`segments`); everything else is a convex solid with corners (`convex`).
"""

import math

from ..compiler.jit import inlined, part, sweep
from ..records import BOX, CAPSULE, POINTS, SPHERE
from ..vec import sub
from .convex import solid_solid
from .segments import ball_ball, ball_box, ball_segment, segment_segment
from .shapes import label, vertex

POINT = 1 << 51  # features of point k of a list of points start at k times this


@part
def is_ball(kind):
    return kind in (SPHERE, POINTS)


@part
def capsule_line(geometry, poses, i):
    """(start, way) of a capsule's segment."""
    start = vertex(geometry, poses, i, 0)
    return start, sub(vertex(geometry, poses, i, 1), start)


@inlined
def single_pair(geometry, poses, i, only_a, j, only_b, margin, room, out, n):
    """Append where shapes i and j touch; of a list of points only the one numbered `only`."""
    shapes, shapes = geometry.shapes, geometry.shapes
    kind_a = shapes[i].kind
    kind_b = shapes[j].kind
    radius_a = shapes[i].radius
    radius_b = shapes[j].radius
    if is_ball(kind_a):
        centre = vertex(geometry, poses, i, only_a)
        if is_ball(kind_b):
            other = vertex(geometry, poses, j, only_b)
            return ball_ball(out, n, centre, radius_a, other, radius_b, margin, 0)
        if kind_b == CAPSULE:
            start, way = capsule_line(geometry, poses, j)
            other = ball_segment(centre, start, way)
            return ball_ball(out, n, centre, radius_a, other, radius_b, margin, 0)
        if kind_b == BOX:
            return ball_box(out, n, centre, radius_a, geometry, poses, j, 1.0, margin, 0)
    elif is_ball(kind_b):
        centre = vertex(geometry, poses, j, only_b)
        if kind_a == CAPSULE:
            start, way = capsule_line(geometry, poses, i)
            other = ball_segment(centre, start, way)
            return ball_ball(out, n, other, radius_a, centre, radius_b, margin, 0)
        if kind_a == BOX:
            return ball_box(out, n, centre, radius_b, geometry, poses, i, -1.0, margin, 0)
    elif kind_a == CAPSULE and kind_b == CAPSULE:
        p, d = capsule_line(geometry, poses, i)
        q, e = capsule_line(geometry, poses, j)
        return segment_segment(out, n, p, d, radius_a, q, e, radius_b, margin, 0)
    return solid_solid(geometry, poses, i, only_a, j, only_b, margin, room, out, n)


@part
def points(shapes, i):
    """How many parts of a shape are looked at one by one: the points of a list of points."""
    return shapes[i].vertices if shapes[i].kind == POINTS else 1


@sweep
def pair_contacts(geometry, poses, i, j, contact, margin, room, out, n):
    """Append the contact points of shapes i and j within `margin`; the new number."""
    first = n
    for k in range(points(geometry.shapes, i)):
        for m in range(points(geometry.shapes, j)):
            start = n
            n = single_pair(geometry, poses, i, k, j, m, margin, room, out, n)
            for c in range(start, min(n, out.shape[0])):
                out[c].feature += POINT * (k + m)
    label(out, first, n, i, j, contact)
    return n


@sweep
def pair_gap(geometry, poses, i, j, room, probe):
    """Signed distance of two shapes [m]; `probe` is scratch for the points of one touch."""
    gap = math.inf
    for k in range(points(geometry.shapes, i)):
        for m in range(points(geometry.shapes, j)):
            n = single_pair(geometry, poses, i, k, j, m, math.inf, room, probe, 0)
            for c in range(n):
                gap = min(gap, probe[c].gap)
    return gap
