"""Independent blocks of an island, whose impulses are unique.

A block with at least as many exclusive joints as rows is independent of all others. Without it,
others have more exclusive joints. If all blocks of an island can be removed in this way, its rows
are independent. The friction of the joints of a chain is an example, from its tip to its base. An
island with more rows than joints, such as a box on four points, has no independent rows.
"""

from ...tolerances import NOTABLE
from ..arrays import DINV, opened
from ..compiler.jit import part, sweep
from ..constraints.blocks import joint_of, joints_of, size_of
from ..vec import add_scaled, cross, dot, load
from .contacts import contacts_at
from .island_rows import SCRATCH


@sweep
def unique(scene, n):
    """Check whether the rows of island n are independent, so that its impulses are unique."""
    data = opened(scene)
    slots, where = data.space.slots, data.space.where
    islands = contacts_at(data.links.contacts).islands
    kept, first, end = islands.slope, islands.first[n], islands.first[n + 1]
    rows, joints = 0, 0
    for j in range(first, end):
        i = islands.blocks[j]
        kept[i, SCRATCH.bound] = 1.0
        rows += size_of(data.blocks.blocks_i, i)
        joints += count(slots, where, i, 1)
    left, before = end - first, end - first if rows > joints else 0
    while left != before and left > 0:
        before = left
        for j in range(end - 1, first - 1, -1):
            i = islands.blocks[j]
            if kept[i, SCRATCH.bound] == 1.0 and independent(data, i):
                kept[i, SCRATCH.bound] = 0.0
                count(slots, where, i, -1)
                left -= 1
    for j in range(first, end):
        for s in range(joints_of(slots, islands.blocks[j])):
            where[joint_of(slots, islands.blocks[j], s)] = 0
    return left == 0


@part
def count(slots, where, i, change):
    """Change the number of blocks at each joint of block i. Return how many joints had none."""
    new = 0
    for s in range(joints_of(slots, i)):
        k = joint_of(slots, i, s)
        if where[k] == 0:
            new += 1
        where[k] += change
    return new


@part
def independent(data, i):
    """Check whether block i has as many independent changes of its exclusive joints as rows."""
    space = data.space
    slots, vectors, size = space.slots, space.vectors, size_of(data.blocks.blocks_i, i)
    a, b, c = (0.0, 0.0, 0.0), (0.0, 0.0, 0.0), (0.0, 0.0, 0.0)
    for s in range(joints_of(slots, i)):
        k = joint_of(slots, i, s)
        if space.where[k] == 1:
            y = load(space.y, i, 3 * s)
            a = add_scaled(a, vectors[DINV, k] * y[0], y)
            b = add_scaled(b, vectors[DINV, k] * y[1], y)
            c = add_scaled(c, vectors[DINV, k] * y[2], y)
    own = space.own
    if size == 1:
        return a[0] > NOTABLE * own[i, 0]
    if size == 2:
        return a[0] * b[1] - a[1] * b[0] > NOTABLE * own[i, 0] * own[i, 4]
    return dot(a, cross(b, c)) > NOTABLE * own[i, 0] * own[i, 4] * own[i, 8]
