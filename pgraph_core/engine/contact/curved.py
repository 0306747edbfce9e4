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

from ...tolerances import EPS, LONGEST_STEP, NOTABLE, ROUNDING
from ..compiler.jit import part, sweep
from ..records import CYLINDER, ELLIPSOID
from ..vec import add, add_scaled, cross, dot, mul, mul_t, scale, set_xyz, sub, xyz
from .convex import facing, lowest
from .cores import core_of, support
from .features import edge_at, edge_at_right_angle, edge_line, face_corner, feature_of
from .manifold import CROSSING, clip_polygon, copy, swap, tangents, thin
from .placing import put, rim_direction
from .polytope import COARSE, CORNERS, FACES, HORIZON, between, coarse_normal, corner_at, unit

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
CURVED = 6  # kind of touch, after those of `convex`


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


# -- a polytope inside A - B -----------------------------------------------------------------------
# Corners in `room` from `row` on, then faces (place: outward normal, height: normal · corner, tag:
# its corners or -1), then the horizon.


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
