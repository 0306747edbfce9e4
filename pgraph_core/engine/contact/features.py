"""Features of convex solids, and the separation of two solids by pairs of them."""

import math

from ...tolerances import COINCIDENT
from ..compiler.jit import part, sweep
from ..vec import add_scaled, cross, dot, scale, sub, xyz

FACE_A, FACE_B, EDGES, CORNER, CAPSULE_EDGE = 1, 2, 3, 4, 5  # kinds of touch
# squared sine: edges closer to parallel span no face that the others do not
PARALLEL_EDGES = COINCIDENT * COINCIDENT


@sweep
def measure(room, a, n):
    """Compute the heights of all vertices along n. Returns the lowest and the highest."""
    low = math.inf
    high = -math.inf
    for k in range(a.first, a.first + a.vertices):
        h = dot(n, xyz(room[k].place))
        room[k].height = h
        low = min(low, h)
        high = max(high, h)
    return low, high


@sweep
def vertex_to_edge(geometry, room, a, b, way, base, best):
    """Compute (distance, vertex of a, edge of b, position on it from 0 to 1) below `best`, or edge
    -1.

    `base` is the extreme height of b along `way` on the side of a. Vertices beyond the best
    distance cannot be the closest ones, so few pairs need to be checked.
    """
    edges = geometry.edges
    found_v, found_e, place = -1, -1, 0.0
    for k in range(a.vertices):
        below = way * (base - room[a.first + k].height)
        if below >= best:
            continue
        x = xyz(room[a.first + k].place)
        for e in range(b.ridges):
            h0 = room[b.first + edges[b.edge + e].start].height
            h1 = room[b.first + edges[b.edge + e].end].height
            further = min(way * (h0 - base), way * (h1 - base))
            if below + further >= best:
                continue
            p, d = edge_line(geometry, room, b, e)
            size = dot(d, d)
            t = dot(sub(x, p), d) / size if size > 0.0 else 0.0
            t = min(max(t, 0.0), 1.0)
            apart = sub(x, add_scaled(p, t, d))
            distance = math.sqrt(dot(apart, apart))
            if distance < best:
                best = distance
                found_v, found_e, place = k, e, t
    return best, found_v, found_e, place


@sweep
def edge_at(geometry, room, b, v, d, parallel):
    """Find the edge at vertex v of b that is most parallel to d, or else most perpendicular."""
    edges = geometry.edges
    best = -math.inf
    found = 0
    for e in range(b.edges):
        if edges[b.edge + e].start == v or edges[b.edge + e].end == v:
            _, way = edge_line(geometry, room, b, e)
            x = dot(way, d) ** 2 / dot(way, way)
            x = x if parallel else -x
            if x > best:
                best = x
                found = e
    return found


@part
def edge_at_right_angle(geometry, room, b, v, n):
    """Compute the unit direction of the edge at v most perpendicular to n, and its cosine to n."""
    _, way = edge_line(geometry, room, b, edge_at(geometry, room, b, v, n, False))
    way = scale(1.0 / math.sqrt(dot(way, way)), way)
    return way, abs(dot(way, n))


@part
def is_over(geometry, room, b, f, n, x):
    """Check whether a point lies in the prism above a face with normal n."""
    rings, face = geometry.rings, geometry.faces[b.face + f]
    inside = True
    for k in range(face.corners):
        after = k + 1 if k + 1 < face.corners else 0
        u = xyz(room[b.first + rings[face.first + k]].place)
        w = xyz(room[b.first + rings[face.first + after]].place)
        inside = inside and dot(cross(sub(w, u), sub(x, u)), n) >= 0.0
    return inside


@sweep
def vertex_to_face(geometry, room, a, b, way, base, best):
    """Compute (distance, vertex of a, face of b below it) under `best`, or face -1 if none."""
    found_v, found_f = -1, -1
    for k in range(a.vertices):
        if way * (base - room[a.first + k].height) >= best:
            continue
        x = xyz(room[a.first + k].place)
        for f in range(b.faces):
            corner, n = face_corner(geometry, room, b, f)
            height = dot(n, sub(x, corner))
            if 0.0 < height < best and is_over(geometry, room, b, f, n, x):
                best = height
                found_v, found_f = k, f
    return best, found_v, found_f


@sweep
def edge_to_edge(geometry, room, a, b, best):
    """Compute (distance, edge of a, edge of b, from a to b, on b) under `best`, or edge -1."""
    edges = geometry.edges
    found_a, found_b, between, on_b = -1, -1, (0.0, 0.0, 0.0), (0.0, 0.0, 0.0)
    for i in range(a.ridges):
        p, da = edge_line(geometry, room, a, i)
        start = room[a.first + edges[a.edge + i].start].height
        high = max(start, room[a.first + edges[a.edge + i].end].height)
        for j in range(b.ridges):
            start = room[b.first + edges[b.edge + j].start].height
            if min(start, room[b.first + edges[b.edge + j].end].height) - high >= best:
                continue
            q, db = edge_line(geometry, room, b, j)
            across, r = cross(da, db), sub(q, p)
            size = dot(across, across)
            if size <= PARALLEL_EDGES * dot(da, da) * dot(db, db):
                continue
            s, t = dot(cross(r, db), across) / size, dot(cross(r, da), across) / size
            if min(s, t) < 0.0 or max(s, t) > 1.0:
                continue
            there = add_scaled(q, t, db)
            apart = sub(there, add_scaled(p, s, da))
            distance = math.sqrt(dot(apart, apart))
            if distance < best:
                best, between, on_b = distance, apart, there
                found_a, found_b = i, j
    return best, found_a, found_b, between, on_b


@sweep
def by_any(geometry, room, a, b, low_b, high_a, known):
    """Compute the nearest (distance, from a to b, position on b, feature) of all pairs, or else
    `known`.

    Heights are measured from a to b; `low_b` and `high_a` are the extreme ones.
    """
    best, nearest, on_b, feature = known
    closer, i, j, between, there = edge_to_edge(geometry, room, a, b, best)
    if i >= 0:
        nearest, on_b, feature = scale(1.0 / closer, between), there, feature_of(EDGES, i, j)
    best = closer
    closer, v, f = vertex_to_face(geometry, room, a, b, 1.0, low_b, best)
    if f >= 0:
        _, n = face_corner(geometry, room, b, f)
        nearest, feature = scale(-1.0, n), feature_of(FACE_B, f, v)
        on_b = add_scaled(xyz(room[a.first + v].place), -closer, n)
    best = closer
    closer, v, f = vertex_to_face(geometry, room, b, a, -1.0, high_a, best)
    if f >= 0:
        _, nearest = face_corner(geometry, room, a, f)
        on_b, feature = xyz(room[b.first + v].place), feature_of(FACE_A, f, v)
    return closer, nearest, on_b, feature


@part
def face_corner(geometry, room, a, face):
    """Compute the first vertex of a face and the face normal."""
    faces, rings = geometry.faces, geometry.rings
    corner = xyz(room[a.first + rings[faces[a.face + face].first]].place)
    return corner, xyz(room[a.normal + face].place)


@part
def edge_line(geometry, room, a, e):
    """Compute the (start, direction) of an edge."""
    edges = geometry.edges
    start = xyz(room[a.first + edges[a.edge + e].start].place)
    return start, sub(xyz(room[a.first + edges[a.edge + e].end].place), start)


@part
def feature_of(kind, x, y):
    """Encode a pair of features as a number: kind of contact, two indices, three free bits."""
    return (kind << 48) | (x << 26) | (y << 3)
