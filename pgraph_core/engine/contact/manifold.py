"""Candidate points of one contact, clipped to a face and thinned to a few that are widely spread.

Each row of `room` is a candidate with its position, its height (the gap) and a tag.
"""

import math

from ...tolerances import COINCIDENT
from ..compiler.elementary import cos, sin
from ..compiler.jit import part, sweep
from ..vec import add_scaled, cross, dot, scale, set_xyz, sub, xyz

MOST = 8  # points that one touch leaves
CROSSING = 1 << 20  # tags from here on: where an edge crosses side k of the reference face


@part
def copy(room, target, source):
    set_xyz(room[target].place, xyz(room[source].place))
    room[target].height = room[source].height
    room[target].tag = room[source].tag


@part
def swap(room, i, j):
    place, height, tag = xyz(room[i].place), room[i].height, room[i].tag
    copy(room, i, j)
    set_xyz(room[j].place, place)
    room[j].height = height
    room[j].tag = tag


@part
def cross_over(room, target, inner, outer, d_inner, d_outer, tag):
    """Write the point where the edge between two candidates intersects the plane between them."""
    t = d_inner / (d_inner - d_outer)
    p = xyz(room[inner].place)
    set_xyz(room[target].place, add_scaled(p, t, sub(xyz(room[outer].place), p)))
    room[target].tag = tag


@sweep
def clip_polygon(room, source, m, target, plane, offset, tag):
    """Clip a polygon, segment or point to plane · x <= offset. Returns its number of corners.

    `plane` is as long as the side that it contains. Corners on the plane are kept and no edge ends
    there twice, so that edges that coincide leave the same corners whatever their rounding. There
    are at most m + 1 corners, which is the maximum for a convex polygon cut by a line, even with
    rounding errors.
    """
    on = COINCIDENT * dot(plane, plane)
    kept = 0
    for k in range(m):
        following = k + 1 if k + 1 < m else 0
        d = dot(plane, xyz(room[source + k].place)) - offset
        d_next = dot(plane, xyz(room[source + following].place)) - offset
        if d <= on and kept <= m:
            copy(room, target + kept, source + k)
            kept += 1
        if kept > m or (m == 2 and k == 1):  # a segment is one side, walked from its first end
            break
        if d < -on and d_next > on:
            cross_over(room, target + kept, source + k, source + following, d, d_next, tag)
            kept += 1
        elif d_next < -on and d > on:
            cross_over(room, target + kept, source + following, source + k, d_next, d, tag + 1)
            kept += 1
    return kept


@sweep
def thin(room, first, m, normal):
    """Move the deepest and the outermost candidates to the front. Returns their number."""
    if m <= MOST:
        return m
    t1, t2 = tangents(normal)
    best = first
    for k in range(first, first + m):
        if room[k].height < room[best].height:
            best = k
    swap(room, first, best)
    kept = 1
    for n in range(MOST - 1):
        angle = 2.0 * math.pi * n / (MOST - 1)
        way = add_scaled(scale(cos(angle), t1), sin(angle), t2)
        best = -1
        far = -math.inf
        for k in range(first, first + m):
            x = dot(way, xyz(room[k].place))
            if x > far:
                best = k
                far = x
        if best >= first + kept:
            swap(room, first + kept, best)
            kept += 1
    return kept


@part
def tangents(n):
    """Return two unit vectors that complete a right-handed frame with the unit vector n."""
    t = (0.0, n[2], -n[1]) if abs(n[0]) < 0.6 else (-n[2], 0.0, n[0])
    t = scale(1.0 / math.sqrt(dot(t, t)), t)
    return t, cross(n, t)
