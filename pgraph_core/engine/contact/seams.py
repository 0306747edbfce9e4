"""Seams in solids built from several shapes. Nothing catches where they are flat.

Shapes fixed to the same row form one solid, their union. It only exerts forces along normals in the
limiting normal cone of the union at the contact point [Mordukhovich 2006, 1.1]. Since the pair
routines process one convex shape of the union at a time, they also return normals of edges and side
faces that are covered by a neighbour. Such a normal is hidden: near the contact point, the part of
the shape that touches the contact plane is inside neighbours that extend beyond the plane. A
contact whose points are all hidden is replaced by the contact of an open face.
"""

import math

from ...tolerances import COINCIDENT
from ..compiler.jit import part, sweep
from ..records import BOX, CAPSULE, CYLINDER, ELLIPSOID, HEIGHTFIELD, HULL, POINTS
from ..vec import add, add_scaled, cross, dot, load, matrix, mul, mul_t, scale, sub, xyz
from .cores import core_of
from .curved import round_by, touch_points
from .features import face_corner
from .manifold import tangents
from .placing import DEPTH, vertex
from .polytope import between


@part
def to_local(poses, i, p):
    return mul_t(matrix(poses[i].rotation), sub(p, xyz(poses[i].position)))


@part
def is_solid(kind):
    """Check whether a kind of shape is bounded by faces."""
    return kind in (BOX, HULL)


@sweep
def extent(geometry, i, n):
    """Compute the maximum of n · x over a shape, in its frame [m]."""
    shape = geometry.shapes[i]
    half = xyz(shape.half_extents)
    if shape.kind == CYLINDER:
        return half[0] * math.sqrt(n[0] * n[0] + n[1] * n[1]) + half[2] * abs(n[2])
    if shape.kind == ELLIPSOID:
        x, y, z = half[0] * n[0], half[1] * n[1], half[2] * n[2]
        return math.sqrt(x * x + y * y + z * z)
    found = -math.inf
    for k in range(shape.first_vertex, shape.first_vertex + shape.vertices):
        found = max(found, dot(n, load(geometry.vertices, k, 0)))
    return found + shape.radius


# -- the boundary of a neighbour -------------------------------------------------------------------


@part
def boundaries(geometry, i):
    """Count the planes that bound a shape near a point on it."""
    kind = geometry.shapes[i].kind
    if is_solid(kind):
        return geometry.shapes[i].faces
    return 3 if kind == CYLINDER else 6 if kind == HEIGHTFIELD else 1


@sweep
def boundary(geometry, i, k, x):
    """Compute (outward normal, offset n · y) of plane k, which bounds shape i near point x.

    All of them are in the shape's frame. A round surface is bounded by its tangent plane at x.
    """
    shape = geometry.shapes[i]
    kind = shape.kind
    half = xyz(shape.half_extents)
    if is_solid(kind):
        n = load(geometry.normals, shape.first_face + k, 0)
        ring = geometry.rings[geometry.faces[shape.first_face + k].first]
        return n, dot(n, load(geometry.vertices, shape.first_vertex + ring, 0))
    if kind == HEIGHTFIELD:
        return boundary_of_field(geometry, i, k, x)
    if kind == CYLINDER and k > 0:
        return (0.0, 0.0, 1.0 if k == 1 else -1.0), half[2]
    if kind == CYLINDER:
        n = (x[0], x[1], 0.0)
    elif kind == CAPSULE:
        n = (x[0], x[1], x[2] - min(max(x[2], -shape.half_length), shape.half_length))
    elif kind == ELLIPSOID:
        n = (x[0] / half[0] ** 2, x[1] / half[1] ** 2, x[2] / half[2] ** 2)
    else:
        n = x
    size = math.sqrt(dot(n, n))
    n = scale(1.0 / size, n) if size > 0.0 else (1.0, 0.0, 0.0)
    return n, extent(geometry, i, n)


@part
def node_of_cell(geometry, i, x, k):
    """Return corner k of the heightfield cell under or nearest to a point in its frame."""
    shape = geometry.shapes[i]
    columns = shape.columns
    rows = shape.vertices // columns
    u = (x[0] / shape.half_extents[0] + 1.0) * 0.5 * (rows - 1)
    v = (x[1] / shape.half_extents[1] + 1.0) * 0.5 * (columns - 1)
    r = int(min(max(u, 0.0), rows - 2.0)) + k // 2
    c = int(min(max(v, 0.0), columns - 2.0)) + k % 2
    return load(geometry.vertices, shape.first_vertex + r * columns + c, 0)


@part
def boundary_of_field(geometry, i, k, x):
    """Return `boundary` for the faces of a cell: its triangle, four sides and the bottom."""
    shape = geometry.shapes[i]
    half = xyz(shape.half_extents)
    if k == 5:
        return (0.0, 0.0, -1.0), half[2] - shape.middle[2]
    if k > 0:
        sign = 1.0 if k > 2 else -1.0
        return (sign, 0.0, 0.0) if k % 2 == 1 else (0.0, sign, 0.0), half[0 if k % 2 == 1 else 1]
    a, c = node_of_cell(geometry, i, x, 0), node_of_cell(geometry, i, x, 3)
    below = (x[0] - a[0]) * (c[1] - a[1]) > (x[1] - a[1]) * (c[0] - a[0])
    b = node_of_cell(geometry, i, x, 2 if below else 1)
    n = cross(sub(b, a), sub(c, a))
    n = scale((1.0 if below else -1.0) / math.sqrt(dot(n, n)), n)
    return n, dot(n, a)


@sweep
def has(geometry, k, x, size):
    """Check whether point x, in the frame of shape k, is inside the shape."""
    shape = geometry.shapes[k]
    deep = DEPTH * size
    for c in range(3):
        if abs(x[c] - shape.middle[c]) > shape.half_extents[c] + deep:
            return False
    for c in range(boundaries(geometry, k)):
        m, offset = boundary(geometry, k, c, x)
        if dot(m, x) - offset > deep:
            return False
    return True


@sweep
def reaches_beyond(geometry, poses, k, p, n, size):
    """Check whether p is in shape k and k extends beyond the plane through p with normal n."""
    x = to_local(poses, k, p)
    if not has(geometry, k, x, size):
        return False
    local = mul_t(matrix(poses[k].rotation), n)
    level = dot(local, x) + COINCIDENT * size
    if geometry.shapes[k].kind != HEIGHTFIELD:
        return extent(geometry, k, local) > level
    beyond = False
    for c in range(4):
        beyond = beyond or dot(local, node_of_cell(geometry, k, x, c)) > level
    return beyond


@sweep
def holds(geometry, poses, k, p, g, size):
    """Check whether shape k, which contains point p, also contains the start of the path to g."""
    x, y = to_local(poses, k, p), to_local(poses, k, g)
    deep = DEPTH * size
    for c in range(boundaries(geometry, k)):
        m, offset = boundary(geometry, k, c, x)
        if dot(m, x) - offset > -deep and dot(m, y) - offset > deep:
            return False
    return True


# -- what leans against a contact plane ------------------------------------------------------------


@part
def leaning(geometry, i):
    """Count the points that `lean` yields."""
    kind = geometry.shapes[i].kind
    if is_solid(kind):
        return geometry.shapes[i].vertices
    return 8 if kind == HEIGHTFIELD else 4


@sweep
def lean(geometry, poses, i, k, p, n, size):
    """Compute (position, whether it counts) for corner k of shape i's feature against the plane at
    p.

    The points are the vertices in the plane with normal n, or points near p in this plane for a
    round surface.
    """
    shape = geometry.shapes[i]
    kind = shape.kind
    if is_solid(kind):
        g = vertex(geometry, poses, i, k)
        return g, dot(n, sub(g, p)) > -COINCIDENT * size
    r = matrix(poses[i].rotation)
    if kind == HEIGHTFIELD:
        x = node_of_cell(geometry, i, to_local(poses, i, p), k % 4)
        if k > 3:
            x = (x[0], x[1], shape.middle[2] - shape.half_extents[2])
        g = add(xyz(poses[i].position), mul(r, x))
        return g, dot(n, sub(g, p)) > -COINCIDENT * size
    sign = shape.reach if k % 2 == 0 else -shape.reach
    t, u = tangents(n)
    if kind == CYLINDER:
        axis = (r[2], r[5], r[8])
        around = cross(axis, n)
        square = dot(around, around)
        if square > COINCIDENT:
            t = scale(1.0 / math.sqrt(square), around)
        if square > COINCIDENT and k > 1:  # the ends of a line along its side
            x = to_local(poses, i, p)
            along = math.copysign(shape.half_length, sign) - x[2]
            return add_scaled(p, along, axis), abs(along * dot(axis, n)) < COINCIDENT * size
    return add_scaled(p, sign, t if k < 2 else u), True


@sweep
def is_hidden(geometry, poses, i, p, n, size):
    """Check whether neighbours of shape i hide its surface with normal n at point p."""
    shape, neighbours = geometry.shapes[i], geometry.neighbours
    first, last = shape.first_neighbour, shape.first_neighbour + shape.neighbours
    beyond = False
    for m in range(first, last):
        beyond = beyond or reaches_beyond(geometry, poses, neighbours[m], p, n, size)
    if not beyond or shape.kind == POINTS:
        return False
    for c in range(leaning(geometry, i)):
        g, counts = lean(geometry, poses, i, c, p, n, size)
        if not counts:
            continue
        held = False
        for m in range(first, last):
            k = neighbours[m]
            if not held and reaches_beyond(geometry, poses, k, p, n, size):
                held = holds(geometry, poses, k, p, g, size)
        if not held:
            return False
    return True


@sweep
def hidden_side(geometry, poses, i, j, out, first, n):
    """Return which of two shapes hides all contact points from `first` to n: 0 for none, 1 for i, 2
    for j.

    A point whose gap exceeds the tolerated depth is a distance, not a contact, so it is ignored. A
    point beside its shape, for example of a rim that extends beyond a face, is ignored as well.
    """
    size = min(geometry.shapes[i].reach, geometry.shapes[j].reach)
    of_a, of_b = geometry.shapes[i].neighbours > 0, geometry.shapes[j].neighbours > 0
    near = False
    for c in range(first, min(n, out.shape[0])):
        point = out[c]
        if not (of_a or of_b) or point.gap > DEPTH * size:
            continue
        near = True
        p, q, normal = xyz(point.point_a), xyz(point.point_b), xyz(point.normal)
        if of_b and has(geometry, j, to_local(poses, j, q), size):
            of_b = is_hidden(geometry, poses, j, q, normal, size)
        if of_a and has(geometry, i, to_local(poses, i, p), size):
            of_a = is_hidden(geometry, poses, i, p, scale(-1.0, normal), size)
    if not near:
        return 0
    return 2 if of_b else 1 if of_a else 0


@sweep
def open_face(geometry, poses, i, only_a, j, only_b, side, margin, room, out, n):
    """Append contacts between shapes i and j along a face of one of them that is not hidden.

    `side` is 1 for the faces of i, and 2 for those of j. The face with the largest separation is
    used if the shapes overlap below it.
    """
    shapes = geometry.shapes
    origin = xyz(poses[i].position)
    a, row = core_of(geometry, poses, i, only_a, origin, room, 0)
    b, row = core_of(geometry, poses, j, only_b, origin, room, row)
    own = b if side == 2 else a
    radii = round_by(shapes, i), round_by(shapes, j)
    faces = 2 if own.kind == CYLINDER else own.side.faces
    below = math.inf
    for _ in range(faces):
        s, normal = -math.inf, (0.0, 0.0, 1.0)
        for f in range(faces):
            if own.kind == CYLINDER:
                outward = mul(own.rotation, (0.0, 0.0, 1.0 if f == 0 else -1.0))
            else:
                _, outward = face_corner(geometry, room, own.side, f)
            way = outward if side == 2 else scale(-1.0, outward)
            separation = dot(way, between(room, a, b, way))
            if s < separation < below:
                s, normal = separation, way
        if not s > -math.inf or s - radii[0] - radii[1] > margin:
            return n
        touch = radii, s, normal, False
        size = shapes[i].reach + shapes[j].reach
        end = touch_points(geometry, room, row, a, b, touch, origin, size, margin, out, n)
        if end == n or hidden_side(geometry, poses, i, j, out, n, end) == 0:
            return end
        below = s
    return n
