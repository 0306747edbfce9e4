"""Islands of coupled blocks, determined at every evaluation.

Two blocks belong to the same island if they act on the same tree or on trees that are connected by
other blocks. Islands have no common degrees of freedom, so each is solved separately, with its own
scale and accuracy. Trees with few neighbours in the contact graph are eliminated first, so that the
factor of the matrix of Newton's method is sparse [George & Liu 1989].

The speeds of an island are kept in this order, divided by sqrt(1/d), so that its mass matrix is 1
and the speeds of joints with impulses are w + Yᵀ λ.
"""

import math

from ..arrays import DINV, opened
from ..arrays import FREE_SPEEDS as NO_IMPULSES
from ..compiler.jit import part, sweep
from ..compiler.lane import four, store_four
from ..constraints.blocks import joint_of, joints_of, size_of
from ..motions import nv_of, transmits
from ..records import columns
from ..rows import kind_of, parent_of, v_of
from .contacts import contacts_at

NOWHERE = -1
# Columns of `graph`. Of a tree: a mark, the number of its neighbours, NOWHERE once eliminated, the
# tree that it is eliminated into, 0: none, the number of those that are eliminated into it and
# itself, and where they end. By numbers: trees in the order they are chosen, and neighbours.
GRAPH = columns("mark", "degree", "parent", "size", "end", "chosen", "near")
# Entries of `size`: freedoms of the ordered island, edges, islands, the ordered island + 1 or 0,
# whether its factor fits, and whether a factor costs little.
SIZES = columns("freedoms", "edges", "islands", "ordered", "fits", "small")
FACTOR_WORK = 3e3  # a factor's work per block above which its steps cost more than sweeps


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
    forget_order(islands)
    plant(data.rows, islands)
    islands.size[SIZES.edges] = 0
    before, beyond = NOWHERE, NOWHERE
    for j in range(1, active[0] + 1):
        i = active[j]
        one = NOWHERE
        for s in range(joints_of(slots, i)):
            other = tree[joint_of(slots, i, s)]
            if one != NOWHERE and other != one:
                unite(chief, one, other)
                if one != before or other != beyond:
                    connect(islands, one, other)
                    connect(islands, other, one)
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
    islands.size[SIZES.islands] = count
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
        root[k] = k if p == 0 or not transmits(kind_of(rows, k)) else root[p]
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
def connect(islands, a, b):
    """Record that tree b is adjacent to tree a, if there is room."""
    edges, n = islands.edges, islands.size[SIZES.edges]
    if n < edges.shape[0]:
        edges[n, 0] = islands.edge[a]
        edges[n, 1] = b
        islands.edge[a] = n
        islands.size[SIZES.edges] += 1


@sweep
def order_island(scene, n):
    """Order the elimination of island n, and write its speeds without impulses in this order.
    Returns (whether a factor fits, whether it costs little).

    The order is kept until another island is ordered, or the islands are found again.
    """
    data = opened(scene)
    islands = contacts_at(data.links.contacts).islands
    size = islands.size
    if size[SIZES.ordered] != n + 1:
        forget_order(islands)
        work, fits = find_order(scene, n)
        size[SIZES.ordered] = n + 1
        size[SIZES.fits] = 1 if fits else 0
        little = fits and work <= FACTOR_WORK * (islands.first[n + 1] - islands.first[n])
        size[SIZES.small] = 1 if little else 0
    for p in range(size[SIZES.freedoms]):
        i = islands.freedoms[p]
        free = data.space.vectors[NO_IMPULSES, i] / islands.scale[p] if i != NOWHERE else 0.0
        islands.free[p >> 2, p & 3] = free
    return size[SIZES.fits] == 1, size[SIZES.small] == 1


@part
def find_order(scene, n):
    """Order the freedoms of island n and lay out its rows. Returns (cost of a factorisation,
    whether it fits).

    `place` is the position of a freedom, `start` and `column` are as in `sparse`.
    """
    data = opened(scene)
    slots, vectors = data.space.slots, data.space.vectors
    islands = contacts_at(data.links.contacts).islands
    order, first, place = islands.blocks, islands.first, islands.place
    for j in range(first[n], first[n + 1]):
        for s in range(joints_of(slots, order[j])):
            place[joint_of(slots, order[j], s)] = 0
    trees = order_trees(islands, islands.tree[joint_of(slots, order[first[n]], 0)])
    count = 0
    for turn in range(trees):
        t = islands.queue[turn]
        if islands.graph[t, GRAPH.size] == 1:
            count = whole_fours(islands, count)
        k = islands.head[t]
        while k != NOWHERE:
            for c in range(nv_of(kind_of(data.rows, k))):
                i = v_of(data.rows, k) + c
                if place[i] != NOWHERE:
                    place[i] = count
                    islands.freedoms[count] = i
                    islands.scale[count] = math.sqrt(vectors[DINV, i])
                    count += 1
            k = islands.below[k]
    count = whole_fours(islands, count)
    islands.size[SIZES.freedoms] = count
    for j in range(first[n], first[n + 1]):
        lay_out(islands, data.space, first[n], j)
    return find_fill(islands, count >> 2, first[n], first[n + 1])


@part
def whole_fours(islands, count):
    """Fill up the last four of freedoms, so that trees which are not connected share none."""
    while count & 3:
        islands.freedoms[count] = NOWHERE
        count += 1
    return count


@part
def order_trees(islands, begin):
    """Write the trees connected to `begin` into `queue` in the order of elimination. Returns their
    number.

    Trees with few neighbours are chosen first. Each then comes behind those that are eliminated
    into it.
    """
    queue, graph = islands.queue, islands.graph
    trees = breadth_first(islands, begin)
    chosen, left, least = 0, trees, 0
    while left > 0:
        limit, least, kept = least, islands.size[SIZES.edges], 0
        for n in range(trees - 1, trees - 1 - left, -1):
            t = queue[n]
            if graph[t, GRAPH.degree] > limit:
                least = min(least, graph[t, GRAPH.degree])
                queue[trees - 1 - kept] = t
                kept += 1
            else:
                eliminate(islands, t)
                graph[chosen, GRAPH.chosen] = t
                chosen += 1
        left = kept
    graph[0, GRAPH.end] = trees
    for n in range(trees - 1, -1, -1):
        t = graph[n, GRAPH.chosen]
        parent = graph[t, GRAPH.parent]
        graph[t, GRAPH.end] = graph[parent, GRAPH.end] - 1
        graph[parent, GRAPH.end] -= graph[t, GRAPH.size]
        queue[graph[t, GRAPH.end]] = t
    return trees


@part
def breadth_first(islands, begin):
    """Write the trees connected to `begin` into `queue`. Returns their number."""
    queue, graph, edges = islands.queue, islands.graph, islands.edges
    queue[0] = begin
    graph[begin, GRAPH.size] = 1
    found = 1
    n = 0
    while n < found:
        t = queue[n]
        graph[t, GRAPH.parent], graph[t, GRAPH.degree] = 0, 0
        e = islands.edge[t]
        while e != NOWHERE:
            other = edges[e, 1]
            graph[t, GRAPH.degree] += 1
            if graph[other, GRAPH.size] == 0:
                graph[other, GRAPH.size] = 1
                queue[found] = other
                found += 1
            e = edges[e, 0]
        n += 1
    return found


@part
def eliminate(islands, t):
    """Connect all remaining neighbours of tree t, and update their number of neighbours."""
    graph, edges = islands.graph, islands.edges
    graph[0, GRAPH.mark] += 1
    near = 0
    e = islands.edge[t]
    while e != NOWHERE:
        other = edges[e, 1]
        if graph[other, GRAPH.degree] == NOWHERE:
            if graph[other, GRAPH.parent] == 0:
                graph[other, GRAPH.parent] = t
                graph[t, GRAPH.size] += graph[other, GRAPH.size]
        elif graph[other, GRAPH.mark] != graph[0, GRAPH.mark]:
            graph[other, GRAPH.mark] = graph[0, GRAPH.mark]
            graph[near, GRAPH.near] = other
            near += 1
        e = edges[e, 0]
    graph[t, GRAPH.degree] = NOWHERE
    for k in range(near):
        a = graph[k, GRAPH.near]
        graph[0, GRAPH.mark] += 1
        graph[a, GRAPH.mark] = graph[0, GRAPH.mark]
        graph[a, GRAPH.degree] = 0
        e = islands.edge[a]
        while e != NOWHERE:
            other = edges[e, 1]
            if (
                graph[other, GRAPH.degree] != NOWHERE
                and graph[other, GRAPH.mark] != graph[0, GRAPH.mark]
            ):
                graph[other, GRAPH.mark] = graph[0, GRAPH.mark]
                graph[a, GRAPH.degree] += 1
            e = edges[e, 0]
        for m in range(near):
            other = graph[m, GRAPH.near]
            if graph[other, GRAPH.mark] != graph[0, GRAPH.mark]:
                connect(islands, a, other)
                graph[a, GRAPH.degree] += 1


@part
def find_fill(islands, rows, begin, end):
    """Find the blocks of the factor from blocks `begin` to `end`. Returns (cost, whether it fits).

    A row has the columns of the blocks that begin there, and of the rows that are eliminated into
    it, which are those whose first other column it is.
    """
    start, column, waiting, after = islands.start, islands.column, islands.waiting, islands.after
    fours = islands.fours
    for p in range(rows):
        waiting[p] = NOWHERE
    for j in range(begin, end):
        p = islands.reached[fours[j]]
        after[rows + j - begin] = waiting[p]
        waiting[p] = rows + j - begin
    work = 0.0
    start[0] = 0
    for p in range(rows):
        first = start[p]
        column[first] = p
        stop = first + 1
        k = waiting[p]
        while k != NOWHERE:
            if k < rows:
                for e in range(start[k] + 1, start[k + 1]):
                    stop = insert(column, stop, column[e])
            else:
                j = begin + k - rows
                for e in range(fours[j], fours[j + 1]):
                    stop = insert(column, stop, islands.reached[e])
            k = after[k]
        if stop + rows > column.shape[0]:
            return math.inf, False
        start[p + 1] = stop
        work += 64.0 * float(stop - first - 1) ** 2
        if stop > first + 1:
            after[p] = waiting[column[first + 1]]
            waiting[column[first + 1]] = p
    return work, True


@part
def insert(column, end, c):
    """Insert c into the ascending numbers before `end`, at least one of which is not larger, unless
    it is there. Returns the new end."""
    k = end
    while column[k - 1] > c:
        k -= 1
    if column[k - 1] == c:
        return end
    for m in range(end, k, -1):
        column[m] = column[m - 1]
    column[k] = c
    return end + 1


@part
def lay_out(islands, space, begin, j):
    """Write the rows of Y of the j-th block to `across`, by fours of columns of the matrix.

    Blocks follow each other, from j = `begin` on. Each column is multiplied by its scale.
    """
    y, slots, place, scale = space.y, space.slots, islands.place, islands.scale
    across, reached, fours = islands.across, islands.reached, islands.fours
    i = islands.blocks[j]
    first = fours[j] if j > begin else 0
    fours[j] = first
    reached[first] = place[joint_of(slots, i, 0)] >> 2
    for s in range(joints_of(slots, i)):
        reached[first] = min(reached[first], place[joint_of(slots, i, s)] >> 2)
    end = first + 1
    for s in range(joints_of(slots, i)):
        end = insert(reached, end, place[joint_of(slots, i, s)] >> 2)
    fours[j + 1] = end
    for e in range(first, end):
        for c in range(0, 12, 4):
            store_four(across, e, c, four(0.0, 0.0, 0.0, 0.0))
    e = first
    for s in range(joints_of(slots, i)):
        p = place[joint_of(slots, i, s)]
        if reached[e] != p >> 2:
            e = first
            while reached[e] != p >> 2:
                e += 1
        for c in range(3):
            across[e, 4 * c + (p & 3)] = scale[p] * y[i, 3 * s + c]


@part
def forget_order(islands):
    """Clear the ordering, if there is one."""
    if islands.size[SIZES.ordered] == 0:
        return
    islands.size[SIZES.ordered] = 0
    for p in range(islands.size[SIZES.freedoms]):
        i = islands.freedoms[p]
        if i != NOWHERE:
            islands.place[i] = NOWHERE
            islands.graph[islands.tree[i], GRAPH.size] = 0


@sweep
def sweeps_suffice(scene, n):
    """Check whether each block of island n has at least as many exclusive joints as rows.

    Few sweeps then solve it, for example for the feet of legs.
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
