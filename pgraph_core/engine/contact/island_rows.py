"""Impulses, speeds and weights of the blocks of an island."""

from .. import layout as at
from ..arrays import (
    JOINT_SPEEDS,
    LAMBDA,
    TARGET,
    opened,
)
from ..compiler.jit import part, sweep
from ..compiler.lane import (
    four,
    load_four,
    load_triple,
    numbers,
    store_four,
    triple,
)
from ..constraints.blocks import first_of, joint_of, joints_of, size_of, type_of
from ..records import columns
from ..vec import add_scaled, dot, load
from .contacts import contacts_at
from .islands import SIZES
from .sparse import total

# Newton's method in the scratch of an island, columns of a block. `bound`: rows not yet known to be
# independent. `follows`: slope of the law of a row by the λ before it in its chain.
SCRATCH = columns(slope=9, miss=3, rate=9, move=3, start=3, state=1, rests=1, bound=1, follows=1)


@part
def rows_of(x, r, size):
    """Return up to three entries of x starting at r, padded with zeros for smaller blocks."""
    return (x[r], x[r + 1] if size > 1 else 0.0, x[r + 2] if size > 2 else 0.0)


@part
def gather(y, slots, i, z):
    """Return Y z of a block, the effect of the joint responses z on its rows."""
    u = triple(0.0, 0.0, 0.0)
    for s in range(joints_of(slots, i)):
        u = u + z[joint_of(slots, i, s)] * load_triple(y, i, 3 * s)
    return numbers(u)


@part
def scatter(y, slots, i, change, z):
    """Add Yᵀ times the change in a block's λ to z."""
    for s in range(joints_of(slots, i)):
        z[joint_of(slots, i, s)] += dot(load(y, i, 3 * s), change)


@part
def velocity(data, i, w):
    """Return u of a block at the speeds w."""
    space = data.space
    n = size_of(data.blocks.blocks_i, i)
    u = gather(space.y, space.slots, i, w)
    return add_scaled(u, 1.0, rows_of(space.vectors[TARGET], first_of(space.slots, i), n))


@part
def felt(islands, j, z):
    """Return Y z of the j-th block, where z is in the order of the matrix."""
    across, reached = islands.across, islands.reached
    u = four(0.0, 0.0, 0.0, 0.0)
    v, w = u, u
    for e in range(islands.fours[j], islands.fours[j + 1]):
        x = load_four(z, reached[e], 0)
        u = u + x * load_four(across, e, 0)
        v = v + x * load_four(across, e, 4)
        w = w + x * load_four(across, e, 8)
    return total(u), total(v), total(w)


@part
def pull(islands, j, change, z):
    """Add Yᵀ times the change in the j-th block's λ to z, which is in the order of the matrix."""
    across, reached = islands.across, islands.reached
    for e in range(islands.fours[j], islands.fours[j + 1]):
        add_four(z, reached[e], 0, across, e, change)


@sweep
def weigh(scene, n):
    """Write 1/k of each block in island n, for its largest row, and its compliance for s = 1."""
    data = opened(scene)
    own = data.space.own
    islands = contacts_at(data.links.contacts).islands
    for j in range(islands.first[n], islands.first[n + 1]):
        i = islands.blocks[j]
        islands.mobility[i] = max(own[i, 0], max(own[i, 4], own[i, 8]))
        islands.weight[i] = islands.mobility[i]


@sweep
def rescale(scene, n, factor):
    """Multiply the weights from `weigh` by a factor."""
    islands = contacts_at(opened(scene).links.contacts).islands
    for j in range(islands.first[n], islands.first[n + 1]):
        islands.mobility[islands.blocks[j]] *= factor
        islands.weight[islands.blocks[j]] *= factor


@sweep
def share_evenly(scene, n):
    """Give all contact points of island n the same compliance, their mean.

    The sum of the diagonal of a block does not depend on the axes of its rows.
    """
    data = opened(scene)
    own = data.space.own
    islands = contacts_at(data.links.contacts).islands
    total, count = 0.0, 0
    for j in range(islands.first[n], islands.first[n + 1]):
        i = islands.blocks[j]
        islands.weight[i] = own[i, 0] + own[i, 4] + own[i, 8]
        if type_of(data.blocks.blocks_i, i) == at.T_CONTACT:
            total += islands.weight[i]
            count += 1
    for j in range(islands.first[n], islands.first[n + 1]):
        i = islands.blocks[j]
        if type_of(data.blocks.blocks_i, i) == at.T_CONTACT:
            islands.weight[i] = total / count


@sweep
def drop_impulses(scene, n):
    """Set λ of island n to zero."""
    data = opened(scene)
    islands = contacts_at(data.links.contacts).islands
    for j in range(islands.first[n], islands.first[n + 1]):
        i = islands.blocks[j]
        for c in range(size_of(data.blocks.blocks_i, i)):
            data.space.vectors[LAMBDA, first_of(data.space.slots, i) + c] = 0.0


@sweep
def copy_impulses(scene, n, source, target):
    """Copy λ of island n from one row of `vectors` to another."""
    data = opened(scene)
    islands = contacts_at(data.links.contacts).islands
    vectors = data.space.vectors
    for j in range(islands.first[n], islands.first[n + 1]):
        i = islands.blocks[j]
        r = first_of(data.space.slots, i)
        for c in range(size_of(data.blocks.blocks_i, i)):
            vectors[target, r + c] = vectors[source, r + c]


@sweep
def respond(scene, n):
    """Write w = w₀ + Yᵀ λ of island n into `speeds`, and the speeds of joints into JOINT_SPEEDS."""
    data = opened(scene)
    islands = contacts_at(data.links.contacts).islands
    vectors, speeds = data.space.vectors, islands.speeds
    for p in range(fours_of(islands)):
        store_four(speeds, p, 0, load_four(islands.free, p, 0))
    for j in range(islands.first[n], islands.first[n + 1]):
        i = islands.blocks[j]
        r, size = first_of(data.space.slots, i), size_of(data.blocks.blocks_i, i)
        pull(islands, j, rows_of(vectors[LAMBDA], r, size), speeds)
    for p in range(islands.size[SIZES.freedoms]):
        i = islands.freedoms[p]
        if i >= 0:
            vectors[JOINT_SPEEDS, i] = islands.scale[p] * speeds[p >> 2, p & 3]


@part
def fours_of(islands):
    """Return the number of rows of 4 x 4 blocks."""
    return islands.size[SIZES.freedoms] >> 2


@part
def clear(x, rows):
    """Set fours of numbers to zero."""
    for p in range(rows):
        store_four(x, p, 0, four(0.0, 0.0, 0.0, 0.0))


@part
def add_four(x, to, here, across, g, u):
    """Add u · (four columns of Y) to four numbers of x."""
    more = u[0] * load_four(across, g, 0) + u[1] * load_four(across, g, 4)
    more = more + u[2] * load_four(across, g, 8)
    store_four(x, to, here, load_four(x, to, here) + more)
