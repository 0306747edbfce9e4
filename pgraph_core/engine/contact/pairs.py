"""Contacts between two shapes of any kind, dispatched to the appropriate routine.

`single_pair` is the table of kinds: spheres, points and capsules, and a ball with a box, have
routines of their own (`segments`); cylinders and ellipsoids have one for all partners (`curved`);
everything else is a convex solid with corners (`convex`).
"""

import math

from ...tolerances import COINCIDENT
from ..compiler.jit import inlined, part, sweep
from ..records import BOX, CAPSULE, CYLINDER, ELLIPSOID, HEIGHTFIELD, POINTS, SPHERE
from ..vec import dot, matrix, mul_t, scale, set_xyz, sub, xyz
from .convex import node, solid_solid, triangle_nodes
from .curved import curved_pair
from .manifold import MOST, thin
from .placing import DEPTH, label, vertex
from .seams import has, hidden_side, open_face, to_local
from .segments import ball_ball, ball_box, ball_segment, segment_segment

PER_POINT = 1 << 51  # features of point k of a list of points start at k times this


THINNED_ABOVE = 48  # points on a heightfield, above which they are thinned on the way
SAME_NORMAL = 1.0 - COINCIDENT  # cosine
NEW, DROPPED, STAYING = 0, 1, 2


@part
def is_ball(kind):
    return kind in (SPHERE, POINTS)


@part
def is_curved(kind):
    return kind in (CYLINDER, ELLIPSOID)


@part
def capsule_line(geometry, poses, i):
    """Return the (start, direction) of a capsule's segment."""
    start = vertex(geometry, poses, i, 0)
    return start, sub(vertex(geometry, poses, i, 1), start)


@inlined
def single_pair(geometry, poses, i, only_a, j, only_b, margin, room, out, n):
    """Append contacts between shapes i and j. For a list of points, only point `only` is used."""
    shapes = geometry.shapes
    kind_a = shapes[i].kind
    kind_b = shapes[j].kind
    radius_a = shapes[i].radius
    radius_b = shapes[j].radius
    if is_curved(kind_a) or is_curved(kind_b):
        return curved_pair(geometry, poses, i, only_a, j, only_b, margin, room, out, n)
    if is_ball(kind_a):
        centre = vertex(geometry, poses, i, only_a)
        if is_ball(kind_b):
            other = vertex(geometry, poses, j, only_b)
            return ball_ball(out, n, centre, radius_a, other, radius_b, margin)
        if kind_b == CAPSULE:
            start, way = capsule_line(geometry, poses, j)
            other = ball_segment(centre, start, way)
            return ball_ball(out, n, centre, radius_a, other, radius_b, margin)
        if kind_b == BOX:
            return ball_box(out, n, centre, radius_a, geometry, poses, j, 1.0, margin)
    elif is_ball(kind_b):
        centre = vertex(geometry, poses, j, only_b)
        if kind_a == CAPSULE:
            start, way = capsule_line(geometry, poses, i)
            other = ball_segment(centre, start, way)
            return ball_ball(out, n, other, radius_a, centre, radius_b, margin)
        if kind_a == BOX:
            return ball_box(out, n, centre, radius_b, geometry, poses, i, -1.0, margin)
    elif kind_a == CAPSULE and kind_b == CAPSULE:
        p, d = capsule_line(geometry, poses, i)
        q, e = capsule_line(geometry, poses, j)
        return segment_segment(out, n, p, d, radius_a, q, e, radius_b, margin, 0)
    return solid_solid(geometry, poses, i, only_a, j, only_b, margin, room, out, n)


@part
def points(shapes, i):
    """Count the separately examined parts: the points in a list, or else 1."""
    return shapes[i].vertices if shapes[i].kind == POINTS else 1


@part
def cell_range(x, width, count):
    """Compute (first, last) of the `count` cells that cover x[0] to x[1], possibly empty."""
    low = max(x[0] / width, 0.0)
    high = min(x[1] / width, count - 1.0)
    return int(low), int(high) if high >= 0.0 else -1


@sweep
def field_contacts(geometry, poses, i, j, margin, room, out, n):
    """Append contacts between shape i and heightfield j within `margin`.

    A contact at an edge that a neighbour's surface covers is dropped, because the neighbour has the
    true one.
    """
    first = n
    field = geometry.shapes[j]
    r = matrix(poses[j].rotation)
    centre = mul_t(r, sub(xyz(poses[i].position), xyz(poses[j].position)))
    far = geometry.shapes[i].reach + margin
    columns = field.columns
    rows = field.vertices // columns
    half = xyz(field.half_extents)
    x_width, y_width = 2.0 * half[0] / (rows - 1), 2.0 * half[1] / (columns - 1)
    x_place, y_place = centre[0] + half[0], centre[1] + half[1]
    x_first, x_last = cell_range((x_place - far, x_place + far), x_width, rows - 1)
    y_first, y_last = cell_range((y_place - far, y_place + far), y_width, columns - 1)
    for x in range(x_first, x_last + 1):
        for y in range(y_first, y_last + 1):
            peak = max(
                max(node(geometry, j, x, y)[2], node(geometry, j, x + 1, y)[2]),
                max(node(geometry, j, x, y + 1)[2], node(geometry, j, x + 1, y + 1)[2]),
            )
            if centre[2] - far > peak:
                continue
            for half_cell in range(2):
                triangle = 2 * (x * (columns - 1) + y) + half_cell
                for k in range(points(geometry.shapes, i)):
                    start = n
                    n = single_pair(geometry, poses, i, k, j, triangle, margin, room, out, n)
                    n = without_covered(geometry, poses, i, j, triangle, out, start, n)
                    if hidden_side(geometry, poses, i, j, out, start, n) > 0:
                        n = start
                    for c in range(start, min(n, out.shape[0])):
                        out[c].feature += PER_POINT * (k + triangle)
                    if n - first > THINNED_ABOVE:
                        n = fewer(out, first, n, room)
    return fewer(out, first, n, room)


@sweep
def fewer(out, first, n, room):
    """Thin the points from `first` to n that share a normal. Returns the new n."""
    if n > out.shape[0] or n - first <= MOST:
        return n
    for c in range(first, n):
        out[c].pair = NEW
    for start in range(first, n):
        if out[start].pair != NEW:
            continue
        normal = xyz(out[start].normal)
        count = 0
        for c in range(start, n):
            if out[c].pair == NEW and dot(normal, xyz(out[c].normal)) > SAME_NORMAL:
                set_xyz(room[count].place, xyz(out[c].point_b))
                room[count].height = out[c].gap
                room[count].tag = c
                out[c].pair = DROPPED
                count += 1
        for k in range(thin(room, 0, count, normal)):
            out[int(room[k].tag)].pair = STAYING
    end = first
    for c in range(first, n):
        if out[c].pair == STAYING:
            if end < c:
                out[end] = out[c]
            end += 1
    return end


@sweep
def without_covered(geometry, poses, i, j, triangle, out, start, n):
    """Drop points, starting at `start`, that a neighbour of their triangle covers. Returns n.

    The inner sides of a triangle do not separate it from shape i, so that its points may lie beside
    the shape.
    """
    if n > out.shape[0]:
        return n
    size = geometry.shapes[i].reach
    r = matrix(poses[j].rotation)
    origin = xyz(poses[j].position)
    kept = start
    for c in range(start, n):
        p = mul_t(r, sub(xyz(out[c].point_b), origin))
        beside = out[c].gap <= DEPTH * size
        beside = beside and not has(geometry, i, to_local(poses, i, xyz(out[c].point_a)), size)
        if not (beside or is_covered(geometry, j, triangle, p, mul_t(r, xyz(out[c].normal)))):
            if kept < c:
                out[kept] = out[c]
            kept += 1
    return kept


@part
def is_covered(geometry, j, triangle, p, normal):
    """Check whether p is beside its triangle, or the surface rises around the leaning shape.

    The leaning feature is an edge or a corner of the triangle, and the adjacent triangles rise
    above the plane through it.
    """
    u, v, w, borders = triangle_nodes(geometry, j, triangle)
    field = geometry.shapes[j]
    columns = field.columns
    rows = field.vertices // columns
    size = field.half_extents[0] / rows + field.half_extents[1] / columns
    level = -math.inf
    for k in range(3):
        x, y = (u, v, w)[k]
        level = max(level, dot(normal, node(geometry, j, x, y)))
    level += COINCIDENT * size
    leaning = 0
    for k in range(3):
        one, two, three = ((u, v, w), (v, w, u), (w, u, v))[k]
        a, b = node(geometry, j, one[0], one[1]), node(geometry, j, two[0], two[1])
        away = (b[1] - a[1], a[0] - b[0])
        beside = away[0] * (p[0] - a[0]) + away[1] * (p[1] - a[1])
        if k >= borders and beside > COINCIDENT * size * size:
            return True
        if dot(normal, a) > level - 2.0 * COINCIDENT * size:
            leaning += 1
    if leaning == 3:
        return False
    for k in range(3):
        one, two, three = ((u, v, w), (v, w, u), (w, u, v))[k]
        a, b = node(geometry, j, one[0], one[1]), node(geometry, j, two[0], two[1])
        leans = dot(normal, a) > level - 2.0 * COINCIDENT * size
        if leaning == 2 and leans and dot(normal, b) > level - 2.0 * COINCIDENT * size:
            x, y = one[0] + two[0] - three[0], one[1] + two[1] - three[1]
            if rises(geometry, j, x, y, normal, level):
                return True
        if leaning == 1 and leans:
            for c in range(6):
                x, y = ((1, 0), (1, 1), (0, 1), (-1, 0), (-1, -1), (0, -1))[c]
                if rises(geometry, j, one[0] + x, one[1] + y, normal, level):
                    return True
    return False


@part
def rises(geometry, j, x, y, normal, level):
    """Check whether a heightfield has a node (x, y) above a given level along a normal."""
    field = geometry.shapes[j]
    columns = field.columns
    if not (0 <= x < field.vertices // columns and 0 <= y < columns):
        return False
    return dot(normal, node(geometry, j, x, y)) > level


@sweep
def turn(out, first, n):
    """Swap the roles of the two shapes in the points from `first` to n."""
    for c in range(first, min(n, out.shape[0])):
        p = xyz(out[c].point_a)
        set_xyz(out[c].point_a, xyz(out[c].point_b))
        set_xyz(out[c].point_b, p)
        set_xyz(out[c].normal, scale(-1.0, xyz(out[c].normal)))


@sweep
def pair_contacts(geometry, poses, i, j, contact, margin, room, out, n):
    """Append the contact points between shapes i and j within `margin`. Returns the new number."""
    first = n
    if geometry.shapes[j].kind == HEIGHTFIELD:
        n = field_contacts(geometry, poses, i, j, margin, room, out, n)
        label(out, first, n, i, j, contact)
        return n
    if geometry.shapes[i].kind == HEIGHTFIELD:
        n = field_contacts(geometry, poses, j, i, margin, room, out, n)
        turn(out, first, n)
        label(out, first, n, i, j, contact)
        return n
    for k in range(points(geometry.shapes, i)):
        for m in range(points(geometry.shapes, j)):
            start = n
            n = single_pair(geometry, poses, i, k, j, m, margin, room, out, n)
            side = hidden_side(geometry, poses, i, j, out, start, n)
            if side > 0:
                n = open_face(geometry, poses, i, k, j, m, side, margin, room, out, start)
            for c in range(start, min(n, out.shape[0])):
                out[c].feature += PER_POINT * (k + m)
    label(out, first, n, i, j, contact)
    return n


@sweep
def pair_gap(geometry, poses, i, j, room, probe):
    """Compute the signed distance of two shapes [m], with `probe` as scratch for points."""
    gap = math.inf
    if geometry.shapes[i].kind == HEIGHTFIELD:
        i, j = j, i
    if geometry.shapes[j].kind == HEIGHTFIELD:
        apart = sub(xyz(poses[i].position), xyz(poses[j].position))
        far = math.sqrt(dot(apart, apart)) + geometry.shapes[i].reach + geometry.shapes[j].reach
        near = max(geometry.shapes[i].reach, COINCIDENT * far)
        while gap == math.inf and near < 2.0 * far:  # no gap is larger than `far`
            n = field_contacts(geometry, poses, i, j, near, room, probe, 0)
            for c in range(min(n, probe.shape[0])):
                gap = min(gap, probe[c].gap)
            near *= 2.0
        return gap
    for k in range(points(geometry.shapes, i)):
        for m in range(points(geometry.shapes, j)):
            n = single_pair(geometry, poses, i, k, j, m, math.inf, room, probe, 0)
            for c in range(n):
                gap = min(gap, probe[c].gap)
    return gap
