"""Cylinders and ellipsoids against each other and against all other convex shapes.

The signed distance of two convex sets is the largest separation s(n) over unit normals n, where
s(n) is the least n · (a - b) of points a of A and b of B. First, a polytope inside A - B is
expanded towards the origin [van den Bergen 2001] until the error of its closest face is below
`COARSE`. Then n is refined by the normals of flat faces, by normals across one or two straight
edges (such as the side of a cylinder), and by Newton's method on s if both surfaces are curved. The
result with the largest s is used. All separations are computed from exact support points, so the
error of a candidate is only due to its n. Like in `convex`, places are relative to A's origin.
"""

import math
from typing import Any, NamedTuple

from ...tolerances import COINCIDENT, EPS, LONGEST_STEP, NOTABLE, ROUNDING, TINY
from ..compiler.jit import part, sweep
from ..records import CYLINDER, ELLIPSOID
from ..vec import add, add_scaled, cross, dot, matrix, mul, mul_t, scale, set_xyz, sub, xyz
from .convex import (
    edge_at,
    edge_at_right_angle,
    edge_line,
    face_corner,
    facing,
    feature_of,
    lay_out,
    lowest,
)
from .manifold import CROSSING, clip_polygon, copy, swap, tangents, thin
from .placing import put, rim_direction

COARSE = 1e-5  # relative error of the polytope before the exact search
CORNERS = 48  # limit on the corners of the polytope
FACES = 160  # rows for its faces, dead ones too
HORIZON = 96  # rows for the edges around what a new corner sees
HULL_ROOM = CORNERS + FACES + HORIZON
EXPANSIONS = 8
NEWTON_TURNS = 12
NEAR_EDGE = 0.5  # cosine: an edge this near to a right angle with n is tried
CONVERGED = EPS / 2  # rad: the last turn of Newton's method, half the spacing of cosines
CURVELESS = 64 * EPS  # determinant that counts as rounding, relative to the squared curvature
GAIN = 4 * EPS  # gain of separation that counts as rounding, relative to the sizes
PREFER = 4 * ROUNDING  # preference of flat faces over other features, relative to the sizes
FLAT_FACE = NOTABLE  # rad: a face this near to n lies in the contact plane
NEAR_PARALLEL = 1e-4  # rad: two edges this near to parallel touch along a line
NO_OUTLINE = CROSSING - 1  # tag of a point that is on no outline
RIM = 8  # points of a disc's edge
ASKEW = (0.18, 0.24, 0.4)  # offset that prevents flat tetrahedra of shapes at right angles
CURVED = 6  # kind of touch, after those of `convex`


class Core(NamedTuple):
    """A shape without its radius, in coordinates relative to A's origin."""

    kind: Any
    centre: Any
    rotation: Any
    half: Any  # radii of an ellipsoid, or (radius, radius, half length) of a cylinder
    side: Any  # vertices of a shape with corners


@sweep
def core_of(geometry, poses, i, only, origin, room, row):
    """Return shape i as a core, and the next free row."""
    side, row = lay_out(geometry, poses, i, only, origin, room, row)
    shape = geometry.shapes[i]
    centre = sub(xyz(poses[i].position), origin)
    return Core(shape.kind, centre, matrix(poses[i].rotation), xyz(shape.half_extents), side), row


@part
def support(room, core, d):
    """Compute the support point of a core, which is the lowest along d."""
    if core.kind == ELLIPSOID:
        g = mul_t(core.rotation, d)
        q = (core.half[0] ** 2 * g[0], core.half[1] ** 2 * g[1], core.half[2] ** 2 * g[2])
        return add_scaled(core.centre, -1.0 / math.sqrt(dot(g, q)), mul(core.rotation, q))
    if core.kind == CYLINDER:
        g = mul_t(core.rotation, d)
        across = math.sqrt(g[0] * g[0] + g[1] * g[1])
        r = -core.half[0] / across if across > 0.0 else 0.0
        p = (r * g[0], r * g[1], -math.copysign(core.half[2], g[2]))
        return add(core.centre, mul(core.rotation, p))
    _, k = lowest(room, core.side, d)
    return xyz(room[core.side.first + k].place)


@part
def bend(core, n, u, v):
    """Return u · H v, with H the Hessian of max n · x over a core: radii of curvature at n."""
    if core.kind == ELLIPSOID:
        g, x, y = mul_t(core.rotation, n), mul_t(core.rotation, u), mul_t(core.rotation, v)
        s = (core.half[0] ** 2, core.half[1] ** 2, core.half[2] ** 2)
        q = (s[0] * g[0], s[1] * g[1], s[2] * g[2])
        h = math.sqrt(dot(g, q))
        xy = s[0] * x[0] * y[0] + s[1] * x[1] * y[1] + s[2] * x[2] * y[2]
        return (xy - dot(q, x) * dot(q, y) / (h * h)) / h
    if core.kind == CYLINDER:
        g, x, y = mul_t(core.rotation, n), mul_t(core.rotation, u), mul_t(core.rotation, v)
        square = g[0] * g[0] + g[1] * g[1]
        if square == 0.0:
            return 0.0
        turned_x = g[0] * x[1] - g[1] * x[0]
        turned_y = g[0] * y[1] - g[1] * y[0]
        return core.half[0] * turned_x * turned_y / (square * math.sqrt(square))
    return 0.0


@part
def between(room, a, b, n):
    """Return a - b for the two support points that determine the separation along n."""
    return sub(support(room, a, n), support(room, b, scale(-1.0, n)))


@part
def unit(x):
    return scale(1.0 / math.sqrt(dot(x, x)), x)


# -- a polytope inside A - B -----------------------------------------------------------------------
# Corners in `room` from `row` on, then faces (place: outward normal, height: normal · corner, tag:
# its corners or -1), then the horizon.


@part
def corners_of(tag):
    return tag & 255, (tag >> 8) & 255, (tag >> 16) & 255


@part
def corner_at(room, row, k):
    return xyz(room[row + k].place)


@sweep
def put_face(room, row, face, i, j, k):
    """Write a face with corners i, j, k, ordered as seen from outside."""
    p = corner_at(room, row, i)
    n = cross(sub(corner_at(room, row, j), p), sub(corner_at(room, row, k), p))
    size = math.sqrt(dot(n, n))
    n = scale(1.0 / size, n) if size > 0.0 else (0.0, 0.0, 0.0)
    at_face = row + CORNERS + face
    set_xyz(room[at_face].place, n)
    room[at_face].height = dot(n, p)
    room[at_face].tag = (i | (j << 8) | (k << 16)) if size > 0.0 else -1


@part
def nearest_of_triangle(p, q, r):
    """Return the point on a triangle nearest to the origin [Ericson 2005, 5.1.5]."""
    u, v = sub(q, p), sub(r, p)
    d1, d2 = -dot(u, p), -dot(v, p)
    if d1 <= 0.0 and d2 <= 0.0:
        return p
    d3, d4 = -dot(u, q), -dot(v, q)
    if d3 >= 0.0 and d4 <= d3:
        return q
    c = d1 * d4 - d3 * d2
    if c <= 0.0 and d1 >= 0.0 and d3 <= 0.0:
        return add_scaled(p, d1 / (d1 - d3), u)
    d5, d6 = -dot(u, r), -dot(v, r)
    if d6 >= 0.0 and d5 <= d6:
        return r
    b = d5 * d2 - d1 * d6
    if b <= 0.0 and d2 >= 0.0 and d6 <= 0.0:
        return add_scaled(p, d2 / (d2 - d6), v)
    a = d3 * d6 - d5 * d4
    if a <= 0.0 and d4 >= d3 and d5 >= d6:
        return add_scaled(q, (d4 - d3) / ((d4 - d3) + (d5 - d6)), sub(r, q))
    total = 1.0 / (a + b + c)
    return add_scaled(add_scaled(p, b * total, u), c * total, v)


@sweep
def first_corners(room, a, b, row):
    """Find an initial tetrahedron of support points, with its normals facing outwards."""
    way = sub(a.centre, b.centre)
    n = unit(add_scaled(ASKEW, 1.0 / math.sqrt(dot(way, way) + TINY), way))
    set_xyz(room[row].place, between(room, a, b, n))
    set_xyz(room[row + 1].place, between(room, a, b, scale(-1.0, n)))
    edge = sub(corner_at(room, row, 1), corner_at(room, row, 0))
    t, _ = tangents(unit(edge))
    set_farthest(room, a, b, row, 2, t)
    n = cross(edge, sub(corner_at(room, row, 2), corner_at(room, row, 0)))
    set_farthest(room, a, b, row, 3, unit(n))
    up = dot(n, sub(corner_at(room, row, 3), corner_at(room, row, 0))) > 0.0
    j, k = (2, 1) if up else (1, 2)
    put_face(room, row, 0, 0, j, k)
    put_face(room, row, 1, 0, k, 3)
    put_face(room, row, 2, k, j, 3)
    put_face(room, row, 3, j, 0, 3)


@sweep
def set_farthest(room, a, b, row, k, n):
    """Set corner k to the support point along n or -n that is farther from corner 0."""
    p = corner_at(room, row, 0)
    x = between(room, a, b, n)
    y = between(room, a, b, scale(-1.0, n))
    set_xyz(room[row + k].place, x if dot(n, sub(p, x)) > dot(n, sub(y, p)) else y)


@sweep
def nearest_face(room, row, faces, certain):
    """Compute (separation, n) for the point on the polytope's faces that is nearest to the origin.

    A place nearer than `certain` [m] has no direction worth having.
    """
    best, deepest = math.inf, -math.inf
    way, below = (0.0, 0.0, 1.0), (0.0, 0.0, 1.0)
    for f in range(faces):
        one = room[row + CORNERS + f]
        if one.tag < 0:
            continue
        n = scale(-1.0, xyz(one.place))
        height = -one.height
        if height > deepest:
            deepest, below = height, n
        if height > 0.0:
            i, j, k = corners_of(one.tag)
            p = corner_at(room, row, i)
            x = nearest_of_triangle(p, corner_at(room, row, j), corner_at(room, row, k))
            size = math.sqrt(dot(x, x))
            if size < best:
                best = size
                way = scale(1.0 / size, x) if size > max(height * (1.0 + 1e-6), certain) else n
    return (best, way) if best < math.inf else (deepest, below)


@sweep
def grow(room, row, corners, faces, x, certain):
    """Add a corner. Returns the number of face rows, or -1 if it is inside or the buffer is full.

    Faces that are below it by at most `certain` [m] stay.
    """
    set_xyz(room[row + corners].place, x)
    edges = row + CORNERS + FACES
    count = 0
    for f in range(faces):
        one = room[row + CORNERS + f]
        if one.tag < 0 or not dot(xyz(one.place), x) - one.height > certain:
            continue
        i, j, k = corners_of(one.tag)
        one.tag = -1
        for side in range(3):
            u, v = ((i, j), (j, k), (k, i))[side]
            twin = -1
            for e in range(count):
                if room[edges + e].tag == (v | (u << 8)):
                    twin = e
            if twin >= 0:
                count -= 1
                room[edges + twin].tag = room[edges + count].tag
            elif count < HORIZON:
                room[edges + count].tag = u | (v << 8)
                count += 1
    free = 0
    for e in range(count):
        while free < faces and room[row + CORNERS + free].tag >= 0:
            free += 1
        if free >= FACES:
            return -1
        put_face(room, row, free, room[edges + e].tag & 255, room[edges + e].tag >> 8, corners)
        faces = max(faces, free + 1)
        free += 1
    return faces if count > 0 else -1


@sweep
def coarse_normal(room, a, b, row, size):
    """Compute (upper bound on the signed distance, n) to about `COARSE` relative to the size."""
    first_corners(room, a, b, row)
    faces = 4
    best = -math.inf
    found = (0.0, 0.0, 1.0)
    most = math.inf
    for corners in range(4, CORNERS):
        most, n = nearest_face(room, row, faces, COINCIDENT * size)
        x = between(room, a, b, n)
        s = dot(n, x)
        if s > best:
            best, found = s, n
        if most - s <= COARSE * size:
            break
        faces = grow(room, row, corners, faces, x, COINCIDENT * size)
        if faces < 0:
            break
    return best, found


# -- the exact normal ------------------------------------------------------------------------------


@part
def flat_near(geometry, room, core, n):
    """Compute the outward normal of a core's flat face nearest to -n, and the cosine."""
    if core.kind == CYLINDER:
        r = core.rotation
        axis = (r[2], r[5], r[8])
        c = dot(axis, n)
        return scale(-math.copysign(1.0, c), axis), abs(c)
    best, found = -math.inf, (0.0, 0.0, 1.0)
    for f in range(core.side.faces):
        _, face = face_corner(geometry, room, core.side, f)
        c = -dot(face, n)
        if c > best:
            best, found = c, face
    return found, best


@part
def edge_near(geometry, room, core, n):
    """Return the direction of the straight edge at the lowest point along n, and its cosine.

    If there are several edges, the result is the edge closest to perpendicular to n. The cosine is
    1 without any.
    """
    if core.kind == CYLINDER:
        r = core.rotation
        axis = (r[2], r[5], r[8])
        return axis, abs(dot(axis, n))
    if core.side.edges == 0:
        return n, 1.0
    _, k = lowest(room, core.side, n)
    return edge_at_right_angle(geometry, room, core.side, k, n)


@sweep
def along_edge(room, a, b, n, e):
    """Find the n across direction e with the largest separation by Newton's method."""
    n = unit(add_scaled(n, -dot(n, e), e))
    for _ in range(NEWTON_TURNS):
        u = cross(e, n)
        w = between(room, a, b, n)
        stiff = bend(a, n, u, u) + bend(b, n, u, u) + dot(n, w)
        if not stiff > 0.0:
            break
        turn = min(max(dot(u, w) / stiff, -LONGEST_STEP), LONGEST_STEP)
        n = unit(add_scaled(n, turn, u))
        if abs(turn) < CONVERGED:
            break
    return n


@sweep
def freely(room, a, b, n):
    """Refine n by Newton's method to maximise the separation of two curved surfaces."""
    for _ in range(NEWTON_TURNS):
        t, u = tangents(n)
        w = between(room, a, b, n)
        s = dot(n, w)
        xx = bend(a, n, t, t) + bend(b, n, t, t) + s
        xy = bend(a, n, t, u) + bend(b, n, t, u)
        yy = bend(a, n, u, u) + bend(b, n, u, u) + s
        det = xx * yy - xy * xy
        if not (det > CURVELESS * (xx + yy) ** 2 and xx + yy > 0.0):
            break
        x, y = dot(t, w), dot(u, w)
        p, q = (yy * x - xy * y) / det, (xx * y - xy * x) / det
        turn = math.sqrt(p * p + q * q)
        shorter = LONGEST_STEP / turn if turn > LONGEST_STEP else 1.0
        n = unit(add_scaled(add_scaled(n, shorter * p, t), shorter * q, u))
        if turn < CONVERGED:
            break
    return n


@sweep
def better(room, a, b, n, best, found, allowance):
    """Return the candidate n if its separation exceeds the best one less an allowance."""
    s = dot(n, between(room, a, b, n))
    return (s, n) if s > best - allowance else (best, found)


@sweep
def exact_normal(geometry, room, a, b, n, size):
    """Refine n locally. Returns (signed distance, n)."""
    best = dot(n, between(room, a, b, n))
    gain, prefer = -GAIN * size, PREFER * size
    for _ in range(EXPANSIONS):
        before, start = best, n
        best, n = better(room, a, b, freely(room, a, b, start), best, n, gain)
        edge_a, cos_a = edge_near(geometry, room, a, start)
        edge_b, cos_b = edge_near(geometry, room, b, scale(-1.0, start))
        if cos_a < NEAR_EDGE:
            best, n = better(room, a, b, along_edge(room, a, b, start, edge_a), best, n, gain)
        if cos_b < NEAR_EDGE:
            best, n = better(room, a, b, along_edge(room, a, b, start, edge_b), best, n, gain)
        both = cross(edge_a, edge_b)
        square = dot(both, both)
        if cos_a < NEAR_EDGE and cos_b < NEAR_EDGE and square > NEAR_PARALLEL * NEAR_PARALLEL:
            both = scale(math.copysign(1.0 / math.sqrt(square), dot(both, start)), both)
            best, n = better(room, a, b, both, best, n, prefer)
        # Faces far from n too: where what is flat just touches, the polytope may stop far away.
        flat_a, _ = flat_near(geometry, room, a, start)
        best, n = better(room, a, b, scale(-1.0, flat_a), best, n, prefer)
        flat_b, _ = flat_near(geometry, room, b, scale(-1.0, start))
        best, n = better(room, a, b, flat_b, best, n, prefer)
        if not best > before - gain:
            break
    return best, n


# -- contact points --------------------------------------------------------------------------------


@sweep
def outline(geometry, room, core, d, row):
    """Write the feature of a core facing against d, starting at `row`: face, rim, edge or point.

    Returns (number of points, cosine between -d and the normal of a face).
    """
    if core.kind == ELLIPSOID:
        set_point(room, row, support(room, core, d), 0)
        return 1, 0.0
    if core.kind == CYLINDER:
        return outline_of_cylinder(geometry, room, core, d, row)
    side = core.side
    _, k = lowest(room, side, d)
    if side.faces == 0:
        for v in range(side.vertices):
            set_point(room, row + v, xyz(room[side.first + v].place), v)
        return side.vertices, 0.0
    face = facing(geometry, room, side, k, d)
    first = geometry.faces[side.face + face].first
    count = geometry.faces[side.face + face].corners
    for c in range(count):
        v = geometry.rings[first + c]
        set_point(room, row + c, xyz(room[side.first + v].place), v)
    _, normal = face_corner(geometry, room, side, face)
    return count, -dot(normal, d)


@part
def set_point(room, row, place, tag):
    set_xyz(room[row].place, place)
    room[row].tag = tag


@sweep
def straight_edge(geometry, room, core, n, row):
    """Write the ends of the edge found by `edge_near`, starting at `row`. Returns direction,
    cosine."""
    direction, c = edge_near(geometry, room, core, n)
    if c > FLAT_FACE:
        return direction, c
    if core.kind == CYLINDER:
        middle = support(room, core, n)
        middle = add_scaled(middle, -dot(sub(middle, core.centre), direction), direction)
        half = core.half[2]
        set_point(room, row, add_scaled(middle, -half, direction), 0)
        set_point(room, row + 1, add_scaled(middle, half, direction), 1)
        return direction, c
    _, k = lowest(room, core.side, n)
    e = edge_at(geometry, room, core.side, k, n, False)
    start, way = edge_line(geometry, room, core.side, e)
    set_point(room, row, start, 0)
    set_point(room, row + 1, add(start, way), 1)
    return direction, c


@sweep
def outline_of_cylinder(geometry, room, core, d, row):
    """Write the rim of the end face opposite to d, or the line along the side of the cylinder."""
    g = mul_t(core.rotation, d)
    across = math.sqrt(g[0] * g[0] + g[1] * g[1])
    x, y, _ = mul_t(core.rotation, rim_direction(geometry, core.rotation, d))
    radius, half = core.half[0], core.half[2]
    r = core.rotation
    if abs(g[2]) < across:
        for k in range(2):
            p = (radius * x, radius * y, half if k == 1 else -half)
            set_point(room, row + k, add(core.centre, mul(r, p)), k)
        return 2, 0.0
    z = -math.copysign(half, g[2])
    turn = -math.copysign(1.0, g[2])  # around as seen from outside
    for k in range(RIM):
        c, s = OCTAGON[k]
        s *= turn
        p = (radius * (c * x - s * y), radius * (s * x + c * y), z)
        set_point(room, row + k, add(core.centre, mul(r, p)), k + (RIM if z > 0.0 else 0))
    return RIM, abs(g[2])


DIAGONAL = math.sqrt(0.5)
OCTAGON = (
    (1.0, 0.0), (DIAGONAL, DIAGONAL), (0.0, 1.0), (-DIAGONAL, DIAGONAL),
    (-1.0, 0.0), (-DIAGONAL, -DIAGONAL), (0.0, -1.0), (DIAGONAL, -DIAGONAL),
)  # fmt: skip


@sweep
def clip_to(room, first, count, n, row, m, spare):
    """Clip the m points starting at `row` to the sides of the face starting at `first`.

    n is the face's outward normal. Returns (row, number).
    """
    u = corner_at(room, first, count - 1)
    for k in range(count):
        v = corner_at(room, first, k)
        outward = cross(sub(v, u), n)
        m = clip_polygon(room, row, m, spare, outward, dot(outward, u), CROSSING + 2 * k)
        row, spare = spare, row
        u = v
    return row, m


@sweep
def clip_to_edge(room, first, row, m, spare):
    """Clip the m points starting at `row` to the extent of an edge. Returns (row, number)."""
    u, v = corner_at(room, first, 0), corner_at(room, first, 1)
    way = sub(v, u)
    m = clip_polygon(room, row, m, spare, way, dot(way, v), CROSSING)
    m = clip_polygon(room, spare, m, row, scale(-1.0, way), -dot(way, u), CROSSING + 2)
    return row, m


@sweep
def curved_pair(geometry, poses, i, only_a, j, only_b, margin, room, out, n):
    """Append contacts within `margin` of two shapes, one a cylinder or an ellipsoid."""
    shapes = geometry.shapes
    origin = xyz(poses[i].position)
    a, row = core_of(geometry, poses, i, only_a, origin, room, 0)
    b, row = core_of(geometry, poses, j, only_b, origin, room, row)
    size = shapes[i].reach + shapes[j].reach
    radius_a, radius_b = round_by(shapes, i), round_by(shapes, j)
    limit = margin + radius_a + radius_b
    coarse, normal = coarse_normal(room, a, b, row, size)
    if not coarse <= limit + 10.0 * COARSE * size:
        return n
    s, normal = exact_normal(geometry, room, a, b, normal, size)
    if not s <= limit:
        return n
    radii = (radius_a, radius_b)
    touch = radii, s, normal, True
    return touch_points(geometry, room, row, a, b, touch, origin, size, margin, out, n)


@part
def round_by(shapes, i):
    """Return the radius that is added to a core."""
    solid = shapes[i].faces > 0 or shapes[i].kind in (CYLINDER, ELLIPSOID)
    return 0.0 if solid else shapes[i].radius


@sweep
def touch_points(geometry, room, row, a, b, touch, origin, size, margin, out, count):
    """Write the contact points of two cores with separation s along n, from B to A.

    `touch` is (radii of both, s, n, whether the deepest point counts where it is beside the face
    that others are clipped to). If a flat face lies in the contact plane, the opposite shape is
    clipped to it. If two edges are parallel, one is clipped to the other. Otherwise, there is a
    single point.
    """
    radii, s, n, whole = touch
    back = scale(-1.0, n)
    radius_a, radius_b = radii
    many_a, cos_a = outline(geometry, room, a, n, row)
    first_b = row + many_a
    many_b, cos_b = outline(geometry, room, b, back, first_b)
    low = first_b + many_b  # first row of the clipped points, followed by scratch
    spare = low + many_a + many_b
    flat = 1.0 - 0.5 * FLAT_FACE * FLAT_FACE
    is_flat_a, is_flat_b = many_a > 2 and cos_a >= flat, many_b > 2 and cos_b >= flat
    of_a = is_flat_b and (a.kind == CYLINDER or not is_flat_a)  # a rim has no exact sides
    x, one = support(room, a, n), support(room, b, back)  # the case of a single point
    m = 0
    if is_flat_a or is_flat_b:
        m = many_a if of_a else many_b
        for k in range(m):
            copy(room, low + k, (row if of_a else first_b) + k)
        if of_a:
            one = add_scaled(x, -s, n)
            low, m = clip_to(room, first_b, many_b, n, low, m, spare)
        else:
            low, m = clip_to(room, row, many_a, back, low, m, spare)
    else:
        edge_a, cos_a = straight_edge(geometry, room, a, n, row)
        edge_b, cos_b = straight_edge(geometry, room, b, back, low)
        straight_a, straight_b = cos_a <= FLAT_FACE, cos_b <= FLAT_FACE
        across = cross(edge_a, edge_b)
        square = dot(across, across)
        if straight_a and straight_b and square < NEAR_PARALLEL * NEAR_PARALLEL:
            low, m = clip_to_edge(room, row, low, 2, spare)
        elif straight_a and straight_b:
            q = corner_at(room, low, 0)
            along = dot(cross(sub(q, corner_at(room, row, 0)), edge_a), across) / square
            one = add_scaled(q, along, edge_b)
        elif straight_b:
            one = add_scaled(x, -s, n)
    kept, deepest = 0, math.inf
    for k in range(low, low + m):
        p = corner_at(room, k, 0)
        room[k].height = dot(n, sub(p, one)) if of_a else s - dot(n, sub(p, one))
        deepest = min(deepest, room[k].height)
        if room[k].height - radius_a - radius_b <= margin:
            swap(room, low + kept, k)
            kept += 1
    if whole and (
        kept == 0 or deepest > s + PREFER * size
    ):  # the deepest lies beside what was clipped
        set_point(room, low + kept, x if of_a else one, NO_OUTLINE)
        room[low + kept].height = s
        kept += 1
    for k in range(low, low + thin(room, low, kept, n)):
        gap = room[k].height - radius_a - radius_b
        p = add_scaled(corner_at(room, k, 0), -room[k].height if of_a else 0.0, n)
        place = add(origin, add_scaled(p, radius_b, n))
        count = put(out, count, place, n, gap, feature_of(CURVED, 1, int(room[k].tag)))
    return count
