"""Two shapes of any kinds: the routine that fits them."""

import math

from .. import layout as at
from ..compiler.jit import inlined, part, sweep
from ..vec import sub
from .segments import ball_ball, ball_box, ball_segment, segment_segment
from .shapes import label, vertex
from .solids import solid_solid

POINT = 1 << 51  # features of point k of a list of points start at k times this


@part
def is_ball(kind):
    return kind == at.SPHERE or kind == at.POINTS


@part
def capsule_line(geometry, poses, i):
    """(start, way) of a capsule's segment."""
    start = vertex(geometry, poses, i, 0)
    return start, sub(vertex(geometry, poses, i, 1), start)


@inlined
def single_pair(geometry, poses, i, only_a, j, only_b, margin, room, out, n):
    """Append where shapes i and j touch; of a list of points only the one numbered `only`."""
    shapes_i, shapes_f = geometry.shapes_i, geometry.shapes_f
    kind_a = shapes_i[i, at.SH_KIND]
    kind_b = shapes_i[j, at.SH_KIND]
    radius_a = shapes_f[i, at.SH_RADIUS]
    radius_b = shapes_f[j, at.SH_RADIUS]
    if is_ball(kind_a):
        centre = vertex(geometry, poses, i, only_a)
        if is_ball(kind_b):
            other = vertex(geometry, poses, j, only_b)
            return ball_ball(out, n, centre, radius_a, other, radius_b, margin, 0)
        if kind_b == at.CAPSULE:
            start, way = capsule_line(geometry, poses, j)
            other = ball_segment(centre, start, way)
            return ball_ball(out, n, centre, radius_a, other, radius_b, margin, 0)
        if kind_b == at.BOX:
            return ball_box(out, n, centre, radius_a, geometry, poses, j, 1.0, margin, 0)
    elif is_ball(kind_b):
        centre = vertex(geometry, poses, j, only_b)
        if kind_a == at.CAPSULE:
            start, way = capsule_line(geometry, poses, i)
            other = ball_segment(centre, start, way)
            return ball_ball(out, n, other, radius_a, centre, radius_b, margin, 0)
        if kind_a == at.BOX:
            return ball_box(out, n, centre, radius_b, geometry, poses, i, -1.0, margin, 0)
    elif kind_a == at.CAPSULE and kind_b == at.CAPSULE:
        p, d = capsule_line(geometry, poses, i)
        q, e = capsule_line(geometry, poses, j)
        return segment_segment(out, n, p, d, radius_a, q, e, radius_b, margin, 0)
    return solid_solid(geometry, poses, i, only_a, j, only_b, margin, room, out, n)


@part
def points(shapes_i, i):
    """How many parts of a shape are looked at one by one: the points of a list of points."""
    return shapes_i[i, at.SH_VERTICES] if shapes_i[i, at.SH_KIND] == at.POINTS else 1


@sweep
def pair_contacts(geometry, poses, i, j, contact, margin, room, out, n):
    """Append the contact points of shapes i and j within `margin`; the new number."""
    first = n
    for k in range(points(geometry.shapes_i, i)):
        for m in range(points(geometry.shapes_i, j)):
            start = n
            n = single_pair(geometry, poses, i, k, j, m, margin, room, out, n)
            for c in range(start, min(n, out.labels.shape[0])):
                out.labels[c, at.CT_FEATURE] += POINT * (k + m)
    label(out, first, n, i, j, contact)
    return n


@sweep
def pair_gap(geometry, poses, i, j, room, probe):
    """Signed distance of two shapes [m]; `probe` is scratch for the points of one touch."""
    gap = math.inf
    for k in range(points(geometry.shapes_i, i)):
        for m in range(points(geometry.shapes_i, j)):
            n = single_pair(geometry, poses, i, k, j, m, math.inf, room, probe, 0)
            for c in range(n):
                gap = min(gap, probe.points[c, at.CT_GAP])
    return gap
