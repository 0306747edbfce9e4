"""Islands of coupled blocks, determined at every evaluation.

Two blocks belong to the same island if they act on the same tree or on trees that are connected by
other blocks. Islands have no common degrees of freedom, so each is solved separately, with its own
scale and accuracy. The trees of an island are ordered breadth-first from a peripheral node of the
contact graph, so that the matrix of Newton's method has a narrow envelope [George 1971].

The speeds of an island are kept in this order, divided by sqrt(1/d), so that its mass matrix is 1
and the speeds of joints with impulses are w + Yᵀ λ.
"""

import math

from ..arrays import DINV, opened
from ..arrays import FREE as NO_IMPULSES
from ..compiler.jit import part, sweep
from ..compiler.lane import four, store_four
from ..constraints.blocks import joint_of, joints_of, size_of
from ..rows import FREE, kind_of, nv_of, parent_of, v_of
from .contacts import contacts_at

NOWHERE = -1


@sweep
def find_islands(scene):
    """Find the islands of the active blocks. Returns their number.

    The blocks of an island are in `blocks` from `first` on. Blocks without degrees of freedom do
    not belong to an island.
    """
    data = opened(scene)
    blocks, slots = data.blocks, data.space.slots
    islands = contacts_at(data.links.contacts).islands
    active, tree, chief = blocks.active, islands.tree, islands.chief
    number, order, first = islands.number, islands.blocks, islands.first
    plant(data.rows, islands)
    edges = 0
    before, beyond = NOWHERE, NOWHERE
    for j in range(1, active[0] + 1):
        i = active[j]
        one = NOWHERE
        for s in range(joints_of(slots, i)):
            other = tree[joint_of(slots, i, s)]
            if one != NOWHERE and other != one:
                unite(chief, one, other)
                if (one != before or other != beyond) and edges + 2 <= islands.edges.shape[0]:
                    edges = connect(islands, edges, one, other)
                    edges = connect(islands, edges, other, one)
                    before, beyond = one, other
            one = other
    count = 0
    for j in range(1, active[0] + 1):  # islands in the order of their first blocks
        i = active[j]
        if joints_of(slots, i) > 0:
            k = chief_of(chief, tree[joint_of(slots, i, 0)])
            if number[k] == NOWHERE:
                number[k] = count
                first[count] = 0
                count += 1
            first[number[k]] += 1
    total = 0
    for n in range(count):
        size = first[n]
        first[n] = total
        total += size
    for j in range(1, active[0] + 1):
        i = active[j]
        if joints_of(slots, i) > 0:
            n = number[chief_of(chief, tree[joint_of(slots, i, 0)])]
            order[first[n]] = i
            first[n] += 1
    for n in range(count, 0, -1):
        first[n] = first[n - 1]
    first[0] = 0
    return count


@part
def plant(rows, islands):
    """Find the tree of each degree of freedom, and the rows of each tree, last row first."""
    tree, chief = islands.tree, islands.chief
    head, below, root = islands.head, islands.below, islands.root
    for k in range(rows.shape[0]):
        chief[k] = k
        head[k] = NOWHERE
        islands.number[k] = NOWHERE
        islands.edge[k] = NOWHERE
        p = parent_of(rows, k)
        root[k] = k if p == 0 or kind_of(rows, k) == FREE else root[p]
        if k > 0:
            below[k] = head[root[k]]
            head[root[k]] = k
            for c in range(nv_of(kind_of(rows, k))):
                tree[v_of(rows, k) + c] = root[k]


@part
def chief_of(chief, k):
    """Return the representative of all trees united with tree k."""
    while chief[k] != k:
        chief[k] = chief[chief[k]]
        k = chief[k]
    return k


@part
def unite(chief, a, b):
    x = chief_of(chief, a)
    y = chief_of(chief, b)
    chief[max(x, y)] = min(x, y)


@part
def connect(islands, edges, a, b):
    """Record that tree b is adjacent to tree a."""
    islands.edges[edges, 0] = islands.edge[a]
    islands.edges[edges, 1] = b
    islands.edge[a] = edges
    return edges + 1


@sweep
def order_island(scene, n):
    """Order the elimination of island n and its envelope. Returns (cost of a factorisation, whether
    it fits).

    `place` is the position of a freedom, `start` and `last` are as in `envelope`.
    """
    data = opened(scene)
    slots, vectors = data.space.slots, data.space.vectors
    islands = contacts_at(data.links.contacts).islands
    order, first, place = islands.blocks, islands.first, islands.place
    last, start = islands.last, islands.start
    for j in range(first[n], first[n + 1]):
        for s in range(joints_of(slots, order[j])):
            place[joint_of(slots, order[j], s)] = 0
    trees = far_end_first(islands, islands.tree[joint_of(slots, order[first[n]], 0)])
    count = 0
    for t in range(trees):
        k = islands.head[islands.queue[t]]
        while k != NOWHERE:
            for c in range(nv_of(kind_of(data.rows, k))):
                i = v_of(data.rows, k) + c
                if place[i] != NOWHERE:
                    place[i] = count
                    islands.freedoms[count] = i
                    islands.scale[count] = math.sqrt(vectors[DINV, i])
                    last[count] = count
                    count += 1
            k = islands.below[k]
    for j in range(first[n], first[n + 1]):
        i = order[j]
        end = 0
        for s in range(joints_of(slots, i)):
            end = max(end, place[joint_of(slots, i, s)])
        for s in range(joints_of(slots, i)):
            p = place[joint_of(slots, i, s)]
            last[p] = max(last[p], end)
    for p in range(1, count):
        last[p] = max(last[p], last[p - 1])
    rows = (count + 3) >> 2
    start[0] = 0
    work = 0.0
    for p in range(rows):  # blocks of 4 x 4
        last[p] = last[min(4 * p + 3, count - 1)] >> 2
        start[p + 1] = start[p] + last[p] - p + 1
        work += 64.0 * float(last[p] - p) ** 2
    islands.size[0] = count
    store_four(islands.free, rows - 1, 0, four(0.0, 0.0, 0.0, 0.0))
    for p in range(count):
        islands.free[p >> 2, p & 3] = vectors[NO_IMPULSES, islands.freedoms[p]] / islands.scale[p]
    for j in range(first[n], first[n + 1]):
        lay_out(islands, data.space, first[n], j)
    return work, start[rows] <= islands.upper.shape[0]


@part
def far_end_first(islands, begin):
    """Write the trees of an island into `queue`, breadth first from one far from `begin`."""
    found = breadth_first(islands, begin, 1)
    return breadth_first(islands, islands.queue[found - 1], 2)


@part
def breadth_first(islands, begin, mark):
    """Write the trees connected to `begin` into `queue`, marked with `mark`."""
    queue, seen, edges = islands.queue, islands.seen, islands.edges
    queue[0] = begin
    seen[begin] = mark
    found = 1
    at_tree = 0
    while at_tree < found:
        e = islands.edge[queue[at_tree]]
        while e != NOWHERE:
            other = edges[e, 1]
            if seen[other] != mark:
                seen[other] = mark
                queue[found] = other
                found += 1
            e = edges[e, 0]
        at_tree += 1
    return found


@part
def lay_out(islands, space, begin, j):
    """Write the rows of Y of the j-th block to `across`, by fours of columns of the matrix.

    Blocks follow each other, from j = `begin` on. Each column is multiplied by its scale.
    """
    y, slots, place, scale = space.y, space.slots, islands.place, islands.scale
    across, reached, fours = islands.across, islands.reached, islands.fours
    i = islands.blocks[j]
    first = fours[j] if j > begin else 0
    end = first
    for s in range(joints_of(slots, i)):
        p = place[joint_of(slots, i, s)]
        e = first
        while e < end and reached[e] != p >> 2:
            e += 1
        if e == end:
            reached[e] = p >> 2
            for c in range(12):
                across[e, c] = 0.0
            end += 1
        for c in range(3):
            across[e, 4 * c + (p & 3)] = scale[p] * y[i, 3 * s + c]
    fours[j] = first
    fours[j + 1] = end


@part
def forget_order(islands, step):
    """Write the speeds of joints into `step`, and clear the ordering before the next island."""
    for p in range(islands.size[0]):
        step[islands.freedoms[p]] = islands.scale[p] * islands.speeds[p >> 2, p & 3]
        islands.place[islands.freedoms[p]] = NOWHERE
        islands.seen[islands.tree[islands.freedoms[p]]] = 0


@sweep
def unique(scene, n):
    """Check whether each block of island n has at least as many exclusive joints as rows.

    In this case, the impulses are unique, for example for the feet of legs.
    """
    data = opened(scene)
    blocks_i, slots, where = data.blocks.blocks_i, data.space.slots, data.space.where
    islands = contacts_at(data.links.contacts).islands
    order, first = islands.blocks, islands.first
    for j in range(first[n], first[n + 1]):
        for s in range(joints_of(slots, order[j])):
            where[joint_of(slots, order[j], s)] += 1
    found = True
    for j in range(first[n], first[n + 1]):
        i = order[j]
        rows = size_of(blocks_i, i)
        for s in range(joints_of(slots, i)):
            rows -= 1 if where[joint_of(slots, i, s)] == 1 else 0
        found = found and rows <= 0
    for j in range(first[n], first[n + 1]):
        for s in range(joints_of(slots, order[j])):
            where[joint_of(slots, order[j], s)] = 0
    return found
