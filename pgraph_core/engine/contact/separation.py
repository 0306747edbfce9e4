"""Along which direction two convex solids are farthest apart: faces and pairs of edges.

The candidates are the normals of the faces of A - B: faces of A, faces of B, and products of
edges whose arcs cross on the Gauss map [Gottschalk et al. 1996; Gregorius 2013].

All vertices are taken relative to A's origin: far away from the world's nothing is lost.
A *side* is one solid in `room`: (first vertex row, vertices, first normal row, first face, faces,
first edge, edges).
"""

import math

from .. import layout as at
from ..compiler.jit import part, sweep
from ..vec import add, cross, dot, load, load9, mul, scale, store, sub

PARALLEL = 1e-20  # squared sine: edges closer to parallel span no face that the others do not


@sweep
def lay_out(geometry, poses, i, only, origin, room, row):
    """Vertices and normals of shape i into `room`; the side, and the next free row.

    Of a list of points only point `only` counts.
    """
    shapes_i, vertices, normals = geometry.shapes_i, geometry.vertices, geometry.normals
    r = load9(poses, i, at.PO_ROT)
    shift = sub(load(poses, i, at.PO_POS), origin)
    first = shapes_i[i, at.SH_VERTEX]
    count = shapes_i[i, at.SH_VERTICES]
    if shapes_i[i, at.SH_KIND] == at.POINTS:
        first += only
        count = 1
    for k in range(count):
        store(room, row + k, 0, add(shift, mul(r, load(vertices, first + k, 0))))
    face = shapes_i[i, at.SH_FACE]
    faces = shapes_i[i, at.SH_FACES]
    for k in range(faces):
        store(room, row + count + k, 0, mul(r, load(normals, face + k, 0)))
    edge = shapes_i[i, at.SH_EDGE]
    side = (row, count, row + count, face, faces, edge, shapes_i[i, at.SH_EDGES])
    return side, row + count + faces


@part
def face_corner(geometry, room, a, face):
    """The first vertex of a face, and its normal."""
    faces, rings = geometry.faces, geometry.rings
    corner = load(room, a[0] + rings[faces[a[3] + face, 0]], 0)
    return corner, load(room, a[2] + face, 0)


@part
def lowest(room, a, n):
    """(height, vertex) of side a that is lowest along n."""
    low = math.inf
    found = 0
    for k in range(a[1]):
        h = dot(n, load(room, a[0] + k, 0))
        if h < low:
            low = h
            found = k
    return low, found


@sweep
def face_separation(geometry, room, a, b):
    """(separation, face of a, deepest vertex of b): the largest over a's faces."""
    best = -math.inf
    found = 0
    deepest = 0
    for f in range(a[4]):
        corner, n = face_corner(geometry, room, a, f)
        low, k = lowest(room, b, n)
        low -= dot(n, corner)
        if low > best:
            best = low
            found = f
            deepest = k
    return best, found, deepest


@part
def edge_line(geometry, room, a, e):
    """(start, way) of an edge."""
    edges = geometry.edges
    start = load(room, a[0] + edges[a[5] + e, 0], 0)
    return start, sub(load(room, a[0] + edges[a[5] + e, 1], 0), start)


@part
def edge_normals(geometry, room, a, e):
    """Normals of the two faces beside an edge."""
    edges = geometry.edges
    f = load(room, a[2] + edges[a[5] + e, 2], 0)
    return f, load(room, a[2] + edges[a[5] + e, 3], 0)


@part
def arcs_cross(da, f, g, db, h, k):
    """Whether two edges span a face of A - B: the arc f, g crosses the arc -h, -k."""
    hd = -dot(h, da)
    kd = -dot(k, da)
    fd = dot(f, db)
    gd = dot(g, db)
    return hd * kd < 0.0 and fd * gd < 0.0 and hd * gd > 0.0


@sweep
def edge_separation(geometry, room, a, b, least):
    """(separation, edge of a, edge of b, direction from a to b), edge -1 if none exceeds `least`.

    The separation is that of all vertices, so it holds whatever rounding did to the direction.
    """
    best = least
    found_a = -1
    found_b = -1
    way = (0.0, 0.0, 0.0)
    for i in range(a[6]):
        p, da = edge_line(geometry, room, a, i)
        for j in range(b[6]):
            q, db = edge_line(geometry, room, b, j)
            if a[4] == 0:  # the one edge of a capsule: its normals are a whole circle
                h, k = edge_normals(geometry, room, b, j)
                if not dot(h, da) * dot(k, da) < 0.0:
                    continue
                outward = scale(-1.0, add(h, k))
            elif b[4] == 0:
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
            if size <= PARALLEL * dot(da, da) * dot(db, db):
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
