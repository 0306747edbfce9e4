"""Contact search: from shape poses to contact points, normals and gaps.

`find_contacts` gives all contact points, `find_gaps` the signed distances alone, for event
functions. Pairs that a model names are looked at one by one. The members of a contact of every body
with every other are sorted into a grid of cells as wide as the widest of them, so that neighbours
are in neighbouring cells: O(n). Members more than twice as wide as the typical member are compared
with all others.
"""

import math

from ...tolerances import TINY
from ..arrays import CANDIDATES, FOUND, GEOMETRY, GROUND, POSES, SEARCH
from ..compiler.elementary import exp, log
from ..compiler.jit import inlined, kernel, part, sweep
from ..compiler.kinds import F1, array_of, f8, i8, void
from ..records import CANDIDATE, SPHERE
from ..vec import dot, sub, xyz
from .ground import ground_contacts, ground_gap, normal_of, top
from .pairs import pair_contacts, pair_gap
from .placing import bound, far_apart, label
from .segments import ball_ball

LARGE = 2.0  # width of a large shape relative to the geometric mean of the widths
FARTHEST = (1 << 20) - 1  # limit on the cells along an axis, beyond which all are one


@part
def width(bounds, i):
    """Find the longest edge of a shape's bounding box."""
    x = sub(xyz(bounds[i].high), xyz(bounds[i].low))
    return max(max(x[0], x[1]), x[2])


@part
def cell_number(x, origin, inverse):
    """Return the cell index of a coordinate, or 0 for nan."""
    c = (x - origin) * inverse
    if not c > 0.0:
        return 0
    return int(c) if c < FARTHEST else FARTHEST


@part
def bucket(x, y, z, mask):
    return ((x * 73856093) ^ (y * 19349663) ^ (z * 83492791)) & mask


@sweep
def sort_into_cells(members, bounds, cells, buckets):
    """Fill `cells` and `buckets` from the bounding boxes."""
    n = members.shape[0]
    total = 0.0
    for m in range(n):
        total += log(max(width(bounds, members[m].shape), TINY))
    usual = LARGE * exp(total / n)
    cell = TINY
    origin = (math.inf, math.inf, math.inf)
    for m in range(n):
        i = members[m].shape
        large = not width(bounds, i) <= usual
        cells[m].large = 1 if large else 0
        if not large:
            cell = max(cell, width(bounds, i))
            low = xyz(bounds[i].low)
            origin = (min(origin[0], low[0]), min(origin[1], low[1]), min(origin[2], low[2]))
    for k in range(buckets.shape[0]):
        buckets[k] = -1
    for m in range(n):
        if cells[m].large == 0:
            i = members[m].shape
            for c in range(3):
                cells[m].place[c] = cell_number(bounds[i].low[c], origin[c], 1.0 / cell)
            k = bucket(
                cells[m].place[0], cells[m].place[1], cells[m].place[2], buckets.shape[0] - 1
            )
            cells[m].next = buckets[k]
            buckets[k] = m


@part
def overlap(bounds, i, j):
    a, b = bounds[i], bounds[j]
    x = a.low[0] <= b.high[0] and b.low[0] <= a.high[0]
    y = a.low[1] <= b.high[1] and b.low[1] <= a.high[1]
    return x and y and a.low[2] <= b.high[2] and b.low[2] <= a.high[2]


@sweep
def are_apart(apart, a, b):
    """Check whether two bodies are in the table of excluded pairs."""
    low, high = min(a, b), max(a, b)
    first, last = 0, apart.shape[0]
    while first < last:
        k = (first + last) // 2
        if apart[k].low < low or (apart[k].low == low and apart[k].high < high):
            first = k + 1
        else:
            last = k
    return first < apart.shape[0] and apart[first].low == low and apart[first].high == high


@part
def may_collide(candidates, shapes, m, k):
    """Check whether members m and k belong to the same contact and no joint connects them."""
    one, other = candidates.members[m], candidates.members[k]
    i, j = one.shape, other.shape
    if one.pair != other.pair or shapes[i].row == shapes[j].row:
        return False
    return not are_apart(candidates.apart, shapes[i].body, shapes[j].body)


@inlined
def member_pair(geometry, candidates, poses, search, m, k, margin, out, n):
    """Append the contact points of members m and k within `margin`. Returns the new number."""
    shapes, members = geometry.shapes, candidates.members
    i, j, pair = members[m].shape, members[k].shape, members[m].pair
    if not overlap(search.bounds, i, j) or far_apart(shapes, poses, i, j, margin):
        return n
    if not may_collide(candidates, shapes, m, k):
        return n
    if i > j:
        i, j = j, i
    if shapes[i].kind == SPHERE and shapes[j].kind == SPHERE:  # without the cost of other kinds
        first, a, b = n, xyz(poses[i].position), xyz(poses[j].position)
        n = ball_ball(out, n, a, shapes[i].radius, b, shapes[j].radius, margin)
        label(out, first, n, i, j, pair)
        return n
    return pair_contacts(geometry, poses, i, j, pair, margin, search.room, out, n)


@inlined
def member_contacts(geometry, candidates, poses, search, margin, out, n):
    """Append the contact points between all members within `margin`. Returns the new number."""
    members = candidates.members
    bounds, cells, buckets = search.bounds, search.cells, search.buckets
    count = members.shape[0]
    if count < 2:
        return n
    for m in range(count):
        bound(geometry, poses, members[m].shape, 0.5 * margin, bounds)
    sort_into_cells(members, bounds, cells, buckets)
    mask = buckets.shape[0] - 1
    for m in range(count):
        if cells[m].large == 1:
            for k in range(count):
                if k > m or cells[k].large == 0:
                    n = member_pair(geometry, candidates, poses, search, m, k, margin, out, n)
            continue
        k = cells[m].next
        x, y, z = cells[m].place[0], cells[m].place[1], cells[m].place[2]
        while k >= 0:
            if cells[k].place[0] == x and cells[k].place[1] == y and cells[k].place[2] == z:
                n = member_pair(geometry, candidates, poses, search, m, k, margin, out, n)
            k = cells[k].next
        for d in range(14, 27):  # half of the 26 cells around: the other half looks from there
            u, v, w = x + d // 9 - 1, y + d // 3 % 3 - 1, z + d % 3 - 1
            k = buckets[bucket(u, v, w, mask)]
            while k >= 0:
                if cells[k].place[0] == u and cells[k].place[1] == v and cells[k].place[2] == w:
                    n = member_pair(geometry, candidates, poses, search, m, k, margin, out, n)
                k = cells[k].next
    return n


@part
def find_contacts(geometry, ground, candidates, poses, search, margin, out):
    """Find all contact points between the candidates within `margin` [m]. Returns their number.

    Points beyond the capacity of `out` are counted but not written. In this case, enlarge `out` and
    call the function again. The order is ground, pairs, members. `poses` come from `place`.
    """
    on_ground, pairs = candidates.on_ground, candidates.pairs
    shapes = geometry.shapes
    room = search.room
    n = 0
    highest = top(ground) + margin if on_ground.shape[0] > 0 else 0.0
    for k in range(on_ground.shape[0]):
        i = on_ground[k].shape
        altitude = dot(xyz(poses[i].position), normal_of(ground))
        if altitude - shapes[i].reach <= highest:
            first = n
            n = ground_contacts(geometry, ground, poses, i, margin, room, out, n)
            label(out, first, n, i, -1, on_ground[k].pair)
    for k in range(pairs.shape[0]):
        i, j, pair = pairs[k].shape_a, pairs[k].shape_b, pairs[k].pair
        if not far_apart(shapes, poses, i, j, margin):
            n = pair_contacts(geometry, poses, i, j, pair, margin, room, out, n)
    return member_contacts(geometry, candidates, poses, search, margin, out, n)


@sweep
def find_gaps(geometry, ground, candidates, poses, room, probe, gaps):
    """Compute the signed distances [m] of shapes to the ground, then of pairs, excluding members.

    `probe` is scratch for the contact points of one candidate.
    """
    on_ground, pairs = candidates.on_ground, candidates.pairs
    count = on_ground.shape[0]
    for k in range(count):
        gaps[k] = ground_gap(geometry, ground, poses, on_ground[k].shape)
    for k in range(pairs.shape[0]):
        gaps[count + k] = pair_gap(geometry, poses, pairs[k].shape_a, pairs[k].shape_b, room, probe)


@kernel(i8(GEOMETRY, GROUND, CANDIDATES, POSES, SEARCH, f8, FOUND))
def contacts(geometry, ground, candidates, poses, search, margin, out):
    """Run `find_contacts`, for tests and benchmarks."""
    return find_contacts(geometry, ground, candidates, poses, search, margin, out)


@kernel(void(GEOMETRY, GROUND, CANDIDATES, POSES, array_of(CANDIDATE), FOUND, F1))
def gaps(geometry, ground, candidates, poses, room, probe, found):
    """Run `find_gaps`, for tests."""
    find_gaps(geometry, ground, candidates, poses, room, probe, found)
