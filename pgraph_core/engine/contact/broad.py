"""Which members of a contact are near each other: a grid of cells, hashed.

Members are put into cells as wide as the widest of them, so that neighbours are in neighbouring
cells; members more than twice as wide as is usual are compared with all instead. O(n).
"""

import math

from .. import layout as at
from ..compiler.jit import inlined, part, sweep
from ..vec import load
from .pairs import pair_contacts
from .segments import ball_ball
from .shapes import bound, far_apart, label

LARGE = 2.0  # times the geometric mean of the widths
FARTHEST = 1048575.0  # cells along an axis; beyond it, all are one


@part
def width(bounds, i):
    """The longest edge of a shape's box."""
    x = max(bounds[i, 3] - bounds[i, 0], bounds[i, 4] - bounds[i, 1])
    return max(x, bounds[i, 5] - bounds[i, 2])


@part
def cell_number(x, origin, inverse):
    """Of a coordinate; anything that is no number is in cell 0."""
    c = (x - origin) * inverse
    if not c > 0.0:
        return 0
    return int(c) if c < FARTHEST else int(FARTHEST)


@part
def bucket(x, y, z, mask):
    return ((x * 73856093) ^ (y * 19349663) ^ (z * 83492791)) & mask


@sweep
def sort_into_cells(members, bounds, cells, buckets):
    """Fill `cells` and `buckets` from the boxes."""
    n = members.shape[0]
    total = 0.0
    for m in range(n):
        total += math.log(max(width(bounds, members[m, 0]), 1e-300))
    usual = LARGE * math.exp(total / n)
    cell = 1e-300
    origin = (math.inf, math.inf, math.inf)
    for m in range(n):
        i = members[m, 0]
        large = not width(bounds, i) <= usual
        cells[m, at.CE_LARGE] = 1 if large else 0
        if not large:
            cell = max(cell, width(bounds, i))
            origin = (
                min(origin[0], bounds[i, 0]),
                min(origin[1], bounds[i, 1]),
                min(origin[2], bounds[i, 2]),
            )
    for k in range(buckets.shape[0]):
        buckets[k] = -1
    for m in range(n):
        if cells[m, at.CE_LARGE] == 0:
            i = members[m, 0]
            for c in range(3):
                cells[m, at.CE_X + c] = cell_number(bounds[i, c], origin[c], 1.0 / cell)
            k = bucket(cells[m, 1], cells[m, 2], cells[m, 3], buckets.shape[0] - 1)
            cells[m, at.CE_NEXT] = buckets[k]
            buckets[k] = m


@part
def overlap(bounds, i, j):
    x = bounds[i, 0] <= bounds[j, 3] and bounds[j, 0] <= bounds[i, 3]
    y = bounds[i, 1] <= bounds[j, 4] and bounds[j, 1] <= bounds[i, 4]
    return x and y and bounds[i, 2] <= bounds[j, 5] and bounds[j, 2] <= bounds[i, 5]


@sweep
def are_apart(apart, a, b):
    """Whether two bodies are in the table of those that may not touch."""
    low, high = min(a, b), max(a, b)
    first, last = 0, apart.shape[0]
    while first < last:
        k = (first + last) // 2
        if apart[k, 0] < low or (apart[k, 0] == low and apart[k, 1] < high):
            first = k + 1
        else:
            last = k
    return first < apart.shape[0] and apart[first, 0] == low and apart[first, 1] == high


@part
def two_spheres(geometry, poses, i, j, margin, out, n):
    """The pair of heaps, without the cost of a call that serves all kinds."""
    a, b = load(poses, i, at.PO_POS), load(poses, j, at.PO_POS)
    return ball_ball(
        out,
        n,
        a,
        geometry.shapes_f[i, at.SH_RADIUS],
        b,
        geometry.shapes_f[j, at.SH_RADIUS],
        margin,
        0,
    )


@inlined
def member_pair(geometry, touch, poses, search, m, k, margin, out, n):
    """Members m and k, if their boxes overlap and they may touch."""
    members, apart = touch.members, touch.apart
    room, bounds = search.room, search.bounds
    i, j = members[m, 0], members[k, 0]
    if not overlap(bounds, i, j) or members[m, 1] != members[k, 1]:
        return n
    shapes_i = geometry.shapes_i
    if far_apart(geometry.shapes_f, poses, i, j, margin):
        return n
    same_row = shapes_i[i, at.SH_ROW] == shapes_i[j, at.SH_ROW]
    if same_row or are_apart(apart, shapes_i[i, at.SH_BODY], shapes_i[j, at.SH_BODY]):
        return n
    if i > j:
        i, j = j, i
    if shapes_i[i, at.SH_KIND] == at.SPHERE and shapes_i[j, at.SH_KIND] == at.SPHERE:
        first = n
        n = two_spheres(geometry, poses, i, j, margin, out, n)
        label(out, first, n, i, j, members[m, 1])
        return n
    return pair_contacts(geometry, poses, i, j, members[m, 1], margin, room, out, n)


@inlined
def member_contacts(geometry, touch, poses, search, margin, out, n):
    """Append the contact points of all members that are within `margin`; the new number."""
    members = touch.members
    bounds, cells, buckets = search.bounds, search.cells, search.buckets
    count = members.shape[0]
    if count < 2:
        return n
    for m in range(count):
        bound(geometry, poses, members[m, 0], 0.5 * margin, bounds)
    sort_into_cells(members, bounds, cells, buckets)
    mask = buckets.shape[0] - 1
    for m in range(count):
        if cells[m, at.CE_LARGE] == 1:
            for k in range(count):
                if k > m or cells[k, at.CE_LARGE] == 0:
                    n = member_pair(geometry, touch, poses, search, m, k, margin, out, n)
            continue
        k = cells[m, at.CE_NEXT]
        x, y, z = cells[m, 1], cells[m, 2], cells[m, 3]
        while k >= 0:
            if cells[k, 1] == x and cells[k, 2] == y and cells[k, 3] == z:
                n = member_pair(geometry, touch, poses, search, m, k, margin, out, n)
            k = cells[k, at.CE_NEXT]
        for d in range(14, 27):  # half of the 26 cells around: the other half looks from there
            u, v, w = x + d // 9 - 1, y + d // 3 % 3 - 1, z + d % 3 - 1
            k = buckets[bucket(u, v, w, mask)]
            while k >= 0:
                if cells[k, 1] == u and cells[k, 2] == v and cells[k, 3] == w:
                    n = member_pair(geometry, touch, poses, search, m, k, margin, out, n)
                k = cells[k, at.CE_NEXT]
    return n
