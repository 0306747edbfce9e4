"""A polytope inside the difference A - B of two cores, and its face nearest to the origin."""

import math

from ...tolerances import COINCIDENT, TINY
from ..compiler.jit import part, sweep
from ..vec import add_scaled, cross, dot, scale, set_xyz, sub, xyz
from .cores import support
from .manifold import tangents

COARSE = 1e-5  # relative error of the polytope before the exact search
CORNERS = 48  # limit on the corners of the polytope
FACES = 160  # rows for its faces, dead ones too
HORIZON = 96  # rows for the edges around what a new corner sees
ASKEW = (0.18, 0.24, 0.4)  # offset that prevents flat tetrahedra of shapes at right angles


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


@part
def between(room, a, b, n):
    """Return a - b for the two support points that determine the separation along n."""
    return sub(support(room, a, n), support(room, b, scale(-1.0, n)))


@part
def unit(x):
    return scale(1.0 / math.sqrt(dot(x, x)), x)
