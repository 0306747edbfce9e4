"""Many candidate points of one touch: clipped to a face, thinned to a few that are spread wide.

Candidates stand in rows of `room`: a place, a height (the gap there) and a tag.
"""

import math

from .. import layout as at
from ..compiler.jit import part, sweep
from ..vec import add_scaled, cross, dot, load, scale, store, sub

MOST = 8  # points that one touch leaves
CROSSING = 1 << 20  # tags from here on: where an edge crosses side k of the reference face


@part
def copy(room, target, source):
    for c in range(at.ROOM):
        room[target, c] = room[source, c]


@part
def swap(room, i, j):
    for c in range(at.ROOM):
        x = room[i, c]
        room[i, c] = room[j, c]
        room[j, c] = x


@part
def cross_over(room, target, inner, outer, d_inner, d_outer, tag):
    """Where the edge from one candidate to another leaves the plane that parts them."""
    t = d_inner / (d_inner - d_outer)
    p = load(room, inner, 0)
    store(room, target, 0, add_scaled(p, t, sub(load(room, outer, 0), p)))
    room[target, at.RO_TAG] = tag


@sweep
def clip_polygon(room, source, m, target, plane, offset, tag):
    """Keep what has plane · x <= offset of a polygon (of a segment or point too); how many.

    At most m + 1, all that a plane can leave of a convex polygon: rounding may not exceed the room.
    """
    kept = 0
    for k in range(m):
        following = k + 1 if k + 1 < m else 0
        d = dot(plane, load(room, source + k, 0)) - offset
        d_next = dot(plane, load(room, source + following, 0)) - offset
        if d <= 0.0 and kept <= m:
            copy(room, target + kept, source + k)
            kept += 1
        if kept > m or (m == 2 and k == 1):  # a segment is one side, walked from its first end
            break
        if d <= 0.0 < d_next:
            cross_over(room, target + kept, source + k, source + following, d, d_next, tag)
            kept += 1
        elif d_next <= 0.0 < d:
            cross_over(room, target + kept, source + following, source + k, d_next, d, tag + 1)
            kept += 1
    return kept


@sweep
def thin(room, first, m, normal):
    """Move the deepest candidate and those that lie farthest out to the front; how many."""
    if m <= MOST:
        return m
    t1, t2 = tangents(normal)
    best = first
    for k in range(first, first + m):
        if room[k, at.RO_HEIGHT] < room[best, at.RO_HEIGHT]:
            best = k
    swap(room, first, best)
    kept = 1
    for n in range(MOST - 1):
        angle = 2.0 * math.pi * n / (MOST - 1)
        way = add_scaled(scale(math.cos(angle), t1), math.sin(angle), t2)
        best = -1
        far = -math.inf
        for k in range(first, first + m):
            x = dot(way, load(room, k, 0))
            if x > far:
                best = k
                far = x
        if best >= first + kept:
            swap(room, first + kept, best)
            kept += 1
    return kept


@part
def tangents(n):
    """Two unit directions that span the plane normal to n."""
    t = cross(n, (1.0, 0.0, 0.0)) if abs(n[0]) < 0.6 else cross(n, (0.0, 1.0, 0.0))
    t = scale(1.0 / math.sqrt(dot(t, t)), t)
    return t, cross(n, t)
