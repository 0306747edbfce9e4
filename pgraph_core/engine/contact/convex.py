"""Convex polyhedra against each other and against balls and capsules.

The signed distance of two convex polytopes is the largest separation along the normals of the faces
of their difference A - B: faces of A, faces of B, and products of edges whose arcs cross on the
Gauss map [Gottschalk et al. 1996; Gregorius 2013]. This is exact for penetrating polytopes, and if
the closest features are a face and a vertex or two edges. Else (vertex to edge or vertex) the
nearest pair is searched, pruned by the separation. Since mesh faces are only flat up to rounding,
the wrong one of two almost parallel faces may be selected. All features are searched if no plane
separates the shapes by the distance of the pair. The algorithm is not iterative, so it cannot
stall.

All vertices are relative to the origin of A, so no accuracy is lost far away from the world origin.
"""

import math
from typing import Any, NamedTuple

from ...tolerances import COINCIDENT, ROUNDING
from ..compiler.jit import part, sweep
from ..records import HEIGHTFIELD, POINTS
from ..vec import add, add_scaled, cross, dot, load, matrix, mul, scale, set_xyz, sub, xyz
from .features import (
    CAPSULE_EDGE,
    CORNER,
    EDGES,
    FACE_A,
    FACE_B,
    PARALLEL_EDGES,
    by_any,
    edge_at,
    edge_line,
    face_corner,
    feature_of,
    measure,
    vertex_to_edge,
)
from .manifold import CROSSING, clip_polygon, swap, thin
from .placing import put
from .segments import segment_segment

CERTAIN = 4 * ROUNDING  # error of a distance relative to the sizes: four projections


class Side(NamedTuple):
    """One solid of a pair, laid out in `room`."""

    first: Any  # row of its first vertex
    vertices: Any
    normal: Any  # row of its first face's normal
    face: Any  # its first face, in the tables
    faces: Any
    edge: Any  # its first edge, in the tables
    edges: Any
    ridges: Any  # its first edges, which may be nearest: all, but for a prism of a heightfield


@sweep
def lay_out(geometry, poses, i, only, origin, room, row):
    """Write the vertices and normals of shape i into `room`. Returns the side and the next row.

    For a list of points, only the point `only` is used. For a heightfield, only the prism below the
    triangle `only` is used.
    """
    if geometry.shapes[i].kind == HEIGHTFIELD:
        return lay_out_prism(geometry, poses, i, only, origin, room, row)
    shapes, vertices, normals = geometry.shapes, geometry.vertices, geometry.normals
    r = matrix(poses[i].rotation)
    shift = sub(xyz(poses[i].position), origin)
    first = shapes[i].first_vertex
    count = shapes[i].vertices
    if shapes[i].kind == POINTS:
        first += only
        count = 1
    for k in range(count):
        set_xyz(room[row + k].place, add(shift, mul(r, load(vertices, first + k, 0))))
    face = shapes[i].first_face
    faces = shapes[i].faces
    for k in range(faces):
        set_xyz(room[row + count + k].place, mul(r, load(normals, face + k, 0)))
    edge = shapes[i].first_edge
    edges = shapes[i].edges
    return Side(row, count, row + count, face, faces, edge, edges, edges), row + count + faces


@part
def node(geometry, i, x, y):
    """Return a node of a heightfield as a point in the shape's frame."""
    shape = geometry.shapes[i]
    return load(geometry.vertices, shape.first_vertex + x * shape.columns + y, 0)


@part
def triangle_nodes(geometry, i, triangle):
    """Compute (three nodes (x, y) in order, number of the following sides on the heightfield's
    boundary).

    Sides on the boundary come first. A cell has two triangles, which share its diagonal.
    """
    columns = geometry.shapes[i].columns
    rows = geometry.shapes[i].vertices // columns
    cell, half = triangle // 2, triangle % 2
    x, y = cell // (columns - 1), cell % (columns - 1)
    a, b, c, d = (x, y), (x + 1, y), (x + 1, y + 1), (x, y + 1)
    if half == 0:
        first, second = y == 0, x == rows - 2
        u, v, w = (a, b, c) if first or not second else (b, c, a)
    else:
        first, second = y == columns - 2, x == 0
        u, v, w = (c, d, a) if first or not second else (d, a, c)
    return u, v, w, (1 if first else 0) + (1 if second else 0)


@sweep
def lay_out_prism(geometry, poses, i, triangle, origin, room, row):
    """Write a prism as `lay_out` does: top, three sides, bottom. Only outer sides count."""
    shape = geometry.shapes[i]
    r = matrix(poses[i].rotation)
    shift = sub(xyz(poses[i].position), origin)
    u, v, w, borders = triangle_nodes(geometry, i, triangle)
    floor = shape.middle[2] - shape.half_extents[2]
    up = mul(r, (0.0, 0.0, 1.0))
    for k in range(3):
        x, y = (u, v, w)[k]
        p = node(geometry, i, x, y)
        set_xyz(room[row + k].place, add(shift, mul(r, p)))
        set_xyz(room[row + 3 + k].place, add(shift, mul(r, (p[0], p[1], floor))))
    first = row + 6
    a, b, c = xyz(room[row].place), xyz(room[row + 1].place), xyz(room[row + 2].place)
    set_unit(room, first, cross(sub(b, a), sub(c, a)))
    set_unit(room, first + 1, cross(sub(b, a), up))
    set_unit(room, first + 2, cross(sub(c, b), up))
    set_unit(room, first + 3, cross(sub(a, c), up))
    set_unit(room, first + 4, scale(-1.0, up))
    ridges = 9 if borders == 2 else 3
    face, edge = shape.first_face, shape.first_edge
    return Side(row, 6, first, face, 1 + borders, edge, 9, ridges), first + 5


@part
def set_unit(room, row, x):
    set_xyz(room[row].place, scale(1.0 / math.sqrt(dot(x, x)), x))


@part
def lowest(room, a, n):
    """Return (height, vertex) for the lowest vertex of side a along n."""
    low = math.inf
    found = 0
    for k in range(a.vertices):
        h = dot(n, xyz(room[a.first + k].place))
        if h < low:
            low = h
            found = k
    return low, found


@sweep
def face_separation(geometry, room, a, b):
    """Find the largest (separation, face of a, deepest vertex of b) over the faces of a."""
    best = -math.inf
    found = 0
    deepest = 0
    for f in range(a.faces):
        corner, n = face_corner(geometry, room, a, f)
        low, k = lowest(room, b, n)
        low -= dot(n, corner)
        if low > best:
            best = low
            found = f
            deepest = k
    return best, found, deepest


@part
def edge_normals(geometry, room, a, e):
    """Compute the normals of the two faces adjacent to an edge."""
    edges = geometry.edges
    f = xyz(room[a.normal + edges[a.edge + e].left].place)
    return f, xyz(room[a.normal + edges[a.edge + e].right].place)


@part
def arcs_cross(da, f, g, db, h, k):
    """Check whether two edges span a face of A - B, so that arc f, g crosses arc -h, -k."""
    hd = -dot(h, da)
    kd = -dot(k, da)
    fd = dot(f, db)
    gd = dot(g, db)
    return hd * kd < 0.0 and fd * gd < 0.0 and hd * gd > 0.0


@sweep
def edge_separation(geometry, room, a, b, least):
    """Compute (separation, edge of a, edge of b, direction from a to b), with edge -1 if none
    exceeds `least`.

    The separation is computed from all vertices, so it is valid regardless of rounding errors in
    the direction.
    """
    best = least
    found_a = -1
    found_b = -1
    way = (0.0, 0.0, 0.0)
    for i in range(a.ridges):
        p, da = edge_line(geometry, room, a, i)
        for j in range(b.ridges):
            q, db = edge_line(geometry, room, b, j)
            if a.faces == 0:  # the one edge of a capsule: its normals are a whole circle
                h, k = edge_normals(geometry, room, b, j)
                if not dot(h, da) * dot(k, da) < 0.0:
                    continue
                outward = scale(-1.0, add(h, k))
            elif b.faces == 0:
                f, g = edge_normals(geometry, room, a, i)
                if not dot(f, db) * dot(g, db) < 0.0:
                    continue
                outward = add(f, g)
            else:
                f, g = edge_normals(geometry, room, a, i)
                h, k = edge_normals(geometry, room, b, j)
                if not arcs_cross(da, f, g, db, h, k):
                    continue
                outward = add(f, g)
            n = cross(da, db)
            size = dot(n, n)
            if size <= PARALLEL_EDGES * dot(da, da) * dot(db, db):
                continue
            n = scale(math.copysign(1.0 / math.sqrt(size), dot(n, outward)), n)
            if dot(n, sub(q, p)) <= best:
                continue
            low_b, _ = lowest(room, b, n)
            low_a, _ = lowest(room, a, scale(-1.0, n))
            if low_b + low_a > best:
                best = low_b + low_a
                found_a = i
                found_b = j
                way = n
    return best, found_a, found_b, way


@sweep
def facing(geometry, room, b, deepest, n):
    """Compute the face at the deepest vertex of b that is most perpendicular to n, or -1 without
    faces.

    The result is one of the two faces at the edge with the smallest component along n, so that an
    edge lying across a face is assigned to this face.
    """
    if b.faces == 0:
        return -1
    edges = geometry.edges
    flattest = math.inf
    found = 0
    for e in range(b.edges):
        start = edges[b.edge + e].start == deepest
        if not start and edges[b.edge + e].end != deepest:
            continue
        _, d = edge_line(geometry, room, b, e)
        rise = (1.0 if start else -1.0) * dot(n, d) / math.sqrt(dot(d, d))
        if rise < flattest:
            flattest = rise
            found = e
    f, g = edge_normals(geometry, room, b, found)
    return edges[b.edge + found].left if dot(f, n) <= dot(g, n) else edges[b.edge + found].right


@sweep
def clipped(geometry, room, row, a, face, b, deepest):
    """Compute (first row, number, smallest height) of b's facing face clipped to the sides of a's
    face.

    Heights are relative to the face of a. Segments and points are treated as faces.
    """
    faces, rings = geometry.faces, geometry.rings
    corner, n = face_corner(geometry, room, a, face)
    other = facing(geometry, room, b, deepest, n)
    start = faces[b.face + other].first if other >= 0 else 0
    m = faces[b.face + other].corners if other >= 0 else b.vertices
    ring = faces[a.face + face].first
    count = faces[a.face + face].corners
    spare = row + m + count
    for k in range(m):
        v = rings[start + k] if other >= 0 else k
        set_xyz(room[row + k].place, xyz(room[b.first + v].place))
        room[row + k].tag = v
    u = xyz(room[a.first + rings[ring + count - 1]].place)
    for k in range(count):
        v = xyz(room[a.first + rings[ring + k]].place)
        outward = cross(sub(v, u), n)
        m = clip_polygon(room, row, m, spare, outward, dot(outward, u), CROSSING + 2 * k)
        row, spare = spare, row
        u = v
    low = math.inf
    for k in range(row, row + m):
        room[k].height = dot(n, sub(xyz(room[k].place), corner))
        low = min(low, room[k].height)
    return row, m, low


@sweep
def face_contacts(geometry, room, row, m, a, face, radii, kind, origin, margin, out, n):
    """Write the thinned clipped points above a's face, with the `radii` of the shapes."""
    radius, other_radius = radii
    _, normal = face_corner(geometry, room, a, face)
    kept = 0
    for k in range(m):
        if room[row + k].height - radius - other_radius <= margin:
            swap(room, row + kept, row + k)
            kept += 1
    for k in range(row, row + thin(room, row, kept, normal)):
        p = add(origin, xyz(room[k].place))
        height = room[k].height
        gap = height - radius - other_radius
        feature = feature_of(kind, face, int(room[k].tag))
        if kind == FACE_A:
            on_b = add_scaled(p, -other_radius, normal)
            n = put(out, n, on_b, scale(-1.0, normal), gap, feature)
        else:
            n = put(out, n, add_scaled(p, radius - height, normal), normal, gap, feature)
    return n


@sweep
def by_face(geometry, room, row, a, found, b, radii, kind, origin, size, margin, out, n):
    """Write contact points at a separating face of a. Returns -1 if other features are nearest."""
    separation, face, deepest = found
    row, m, low = clipped(geometry, room, row, a, face, b, deepest)
    if low > separation + CERTAIN * size:
        if separation > 0.0:
            return -1
        # The faces are parallel within the tolerance of a tie, and the deepest vertex of b lies
        # beside the face of a. Where the faces overlap, b touches there and not at this vertex.
        if m == 0:
            m = 1
            set_xyz(room[row].place, xyz(room[b.first + deepest].place))
            room[row].height = separation
            room[row].tag = deepest
    return face_contacts(geometry, room, row, m, a, face, radii, kind, origin, margin, out, n)


@sweep
def by_faces(geometry, room, row, a, b, found, least, below, radii, origin, size, margin, out, n):
    """Try `by_face` for the face of a, then b, if its separation is in `least` to `below`."""
    by_a, by_b = found
    written = -1
    if least <= by_a[0] < below:
        written = by_face(
            geometry, room, row, a, by_a, b, radii, FACE_A, origin, size, margin, out, n
        )
    if written < 0 and least <= by_b[0] < below:
        turned = (radii[1], radii[0])
        written = by_face(
            geometry, room, row, b, by_b, a, turned, FACE_B, origin, size, margin, out, n
        )
    return written


@sweep
def by_edges(geometry, room, a, found, b, radii, origin, margin, out, n):
    """Write the contact point between two edges. Returns -1 if their interiors are not nearest."""
    separation, i, j, way = found
    p, da = edge_line(geometry, room, a, i)
    q, db = edge_line(geometry, room, b, j)
    feature = feature_of(EDGES, i, j)
    across = cross(da, db)
    r = sub(q, p)
    s = dot(cross(r, db), across) / dot(across, across)
    t = dot(cross(r, da), across) / dot(across, across)
    if separation > 0.0:
        if min(s, t) < -CERTAIN or max(s, t) > 1.0 + CERTAIN:
            return -1
        if a.faces == 0 or b.faces == 0:
            feature = feature_of(CAPSULE_EDGE, i, j)
            return ends_of_capsule(p, da, radii, q, db, origin, margin, feature, out, n)
    gap = separation - radii[0] - radii[1]
    if gap > margin:
        return n
    on_b = add(origin, add_scaled(add_scaled(q, min(max(t, 0.0), 1.0), db), -radii[1], way))
    return put(out, n, on_b, scale(-1.0, way), gap, feature)


@sweep
def ends_of_capsule(p, da, radii, q, db, origin, margin, feature, out, n):
    """Write the contact points of a capsule along an edge, treating both as segments."""
    start = add(origin, p)
    other = add(origin, q)
    return segment_segment(out, n, start, da, radii[0], other, db, radii[1], margin, feature)


@sweep
def by_corner(geometry, room, a, b, way, radii, origin, size, margin, out, n):
    """Write contact points for a vertex nearest to an edge or vertex, with `way` from a to b."""
    low_b, _ = measure(room, b, way)
    _, high_a = measure(room, a, way)
    best, v, e, t = vertex_to_edge(geometry, room, a, b, 1.0, low_b, math.inf)
    of_a = True
    best_b, v_b, e_b, t_b = vertex_to_edge(geometry, room, b, a, -1.0, high_a, best)
    if e_b >= 0:
        best, v, e, t, of_a = best_b, v_b, e_b, t_b, False
    p, d = edge_line(geometry, room, b if of_a else a, e)
    on_edge = add_scaled(p, t, d)
    vertex = xyz(room[(a.first if of_a else b.first) + v].place)
    on_b = on_edge if of_a else vertex
    if best > COINCIDENT * size:
        way = scale(1.0 / best, sub(on_b, vertex if of_a else on_edge))
    feature = feature_of(CORNER, v, e) if of_a else feature_of(CORNER, 1 << 20 | e, v)
    low_b, _ = measure(room, b, way)
    _, high_a = measure(room, a, way)
    corner = True
    if low_b - high_a < best - COINCIDENT * size:
        closer, way, on_b, feature = by_any(
            geometry, room, a, b, low_b, high_a, (best, way, on_b, feature)
        )
        corner = closer == best
        best = closer
    if best - radii[0] - radii[1] > margin:
        return n
    if corner and a.faces == 0 and a.vertices == 2:
        p, d = edge_line(geometry, room, a, 0)
        edge = e if of_a else edge_at(geometry, room, b, v, d, True)
        q, db = edge_line(geometry, room, b, edge)
        feature = feature_of(CAPSULE_EDGE, 0, edge)
        return ends_of_capsule(p, d, radii, q, db, origin, margin, feature, out, n)
    if corner and b.faces == 0 and b.vertices == 2:
        q, d = edge_line(geometry, room, b, 0)
        edge = edge_at(geometry, room, a, v, d, True) if of_a else e
        p, da = edge_line(geometry, room, a, edge)
        feature = feature_of(CAPSULE_EDGE, edge, 0)
        return ends_of_capsule(p, da, radii, q, d, origin, margin, feature, out, n)
    on_b = add(origin, add_scaled(on_b, -radii[1], way))
    return put(out, n, on_b, scale(-1.0, way), best - radii[0] - radii[1], feature)


@sweep
def solid_solid(geometry, poses, i, only_a, j, only_b, margin, room, out, n):
    """Append contact points within `margin` between two shapes, at least one of which has faces."""
    shapes = geometry.shapes
    origin = xyz(poses[i].position)
    a, row = lay_out(geometry, poses, i, only_a, origin, room, 0)
    b, row = lay_out(geometry, poses, j, only_b, origin, room, row)
    radius_a = shapes[i].radius if a.faces == 0 else 0.0
    radius_b = shapes[j].radius if b.faces == 0 else 0.0
    radii = (radius_a, radius_b)
    reach_a, reach_b = shapes[i].reach, shapes[j].reach
    size = reach_a + reach_b
    prefer = COINCIDENT * min(reach_a, reach_b) + CERTAIN * size
    limit = margin + radius_a + radius_b
    by_a = face_separation(geometry, room, a, b)
    if by_a[0] > limit:
        return n
    by_b = face_separation(geometry, room, b, a)
    if by_b[0] > limit:
        return n
    faces = max(by_a[0], by_b[0])
    least = faces + prefer if faces <= 0.0 else faces - CERTAIN * size
    crossed = edge_separation(geometry, room, a, b, least)
    edges = crossed[0] if crossed[1] >= 0 else -math.inf
    best = max(faces, edges)
    if best > limit or best == -math.inf:  # numbers that have overflowed
        return n
    tied = best - prefer if best <= 0.0 else best - CERTAIN * size
    found = by_a, by_b
    written = by_faces(
        geometry, room, row, a, b, found, tied, math.inf, radii, origin, size, margin, out, n
    )
    if written < 0 and edges >= tied:
        written = by_edges(geometry, room, a, crossed, b, radii, origin, margin, out, n)
    if written < 0:
        almost = best - COINCIDENT * size
        written = by_faces(
            geometry, room, row, a, b, found, almost, tied, radii, origin, size, margin, out, n
        )
    if written >= 0:
        return written
    if edges >= faces:
        way = crossed[3]
    elif by_a[0] >= by_b[0]:
        _, way = face_corner(geometry, room, a, by_a[1])
    else:
        _, way = face_corner(geometry, room, b, by_b[1])
        way = scale(-1.0, way)
    return by_corner(geometry, room, a, b, way, radii, origin, size, margin, out, n)
