"""Derivatives of impulses, where a run of numbers has found their values.

The laws of the active rows are equations, with u = 0 for sticking rows and λ_t = -μ λ_n u_t / |u_t|
for sliding contacts. By the implicit function theorem, the derivatives of λ solve the linearised
laws, with the right side of duals at the values of λ. If impulses are redundant, some of their
derivatives are set to zero. This does not affect the derivatives of the velocities, except if
redundant contacts slide in different directions. The laws do not determine the velocities in this
case, so that they have no derivatives.
"""

import math

from ...tolerances import NOTABLE, PROXIMAL, SOLVED
from .. import layout as at
from ..arrays import (
    BEFORE,
    DINV,
    EFFECT,
    LAMBDA,
    LAW_MISSES,
    RHS,
    UNIT_EFFECT,
    opened,
)
from ..compiler.dual import WIDTH, parted
from ..compiler.jit import part, sweep
from ..constraints.blocks import (
    before_in_chain,
    first_of,
    joint_of,
    joints_of,
    one_sided,
    size_of,
    slack_of,
    type_of,
)
from ..constraints.constraints import joint_impulses
from ..records import columns
from .impulse import rebound
from .island_rows import gather, rows_of, scatter
from .projections import bounds_of, tension_before

# State of a block according to its law: without impulse, at its bound, held in all rows, held in
# the first row and sliding in the others, held in the first without friction, between two states.
BLOCK_STATE = columns("open", "bound", "held", "sliding", "smooth", "unclear")


@sweep
def law_of(data, i, unilateral, size):
    """Return the state of block i according to its contact law, for velocities of this size.

    A block slides if its slip is larger than the change of velocity that its unused friction can
    cause. One of the two is zero in a solution, and the solver's residual otherwise.
    """
    lam, r = data.space.vectors[LAMBDA], first_of(data.space.slots, i)
    if not unilateral:
        return BLOCK_STATE.held
    if type_of(data.blocks.blocks_i, i) == at.T_WRAP:
        return law_of_wrap(data, i, size)
    if type_of(data.blocks.blocks_i, i) == at.T_FRICTION:
        u = gather(data.space.y, data.space.slots, i, data.space.vectors[EFFECT])
        bound = data.blocks.blocks_f[i, at.AIM]
        slip, spare = abs(data.space.vectors[RHS, r] + u[0]), bound - abs(lam[r])
        if slip > spare * data.space.own[i, 0]:
            return BLOCK_STATE.bound if slip > SOLVED * size else BLOCK_STATE.unclear
        return BLOCK_STATE.held if spare > NOTABLE * bound else BLOCK_STATE.unclear
    if not lam[r] * data.space.own[i, 0] > SOLVED * size:  # not more than what rounding leaves
        return BLOCK_STATE.open
    if size_of(data.blocks.blocks_i, i) == 1:
        return BLOCK_STATE.held
    _, _, slip = slip_of(data, i)
    rim = data.blocks.blocks_f[i, at.FRICTION] * lam[r]
    spare = rim - math.sqrt(lam[r + 1] * lam[r + 1] + lam[r + 2] * lam[r + 2])
    slides = slip > spare * max(data.space.own[i, 4], data.space.own[i, 8])
    if slides and slip > SOLVED * size:
        return BLOCK_STATE.sliding
    if rim == 0.0:
        return BLOCK_STATE.smooth
    return BLOCK_STATE.held if not slides and spare > NOTABLE * rim else BLOCK_STATE.unclear


@sweep
def law_of_wrap(data, i, size):
    """Return the state of the friction of a cable on a wheel, as `law_of`."""
    r, own = first_of(data.space.slots, i), data.space.own[i, 0]
    least, most = bounds_of(data, i)
    if not most * own > SOLVED * size:
        return BLOCK_STATE.open
    u = gather(data.space.y, data.space.slots, i, data.space.vectors[EFFECT])
    lam, slip = data.space.vectors[LAMBDA, r], abs(data.space.vectors[RHS, r] + u[0])
    spare = min(lam - least, most - lam)
    if slip > spare * own:
        return BLOCK_STATE.sliding if slip > SOLVED * size else BLOCK_STATE.unclear
    return BLOCK_STATE.held if spare > NOTABLE * (most - least) else BLOCK_STATE.unclear


@part
def bound_of_wrap(data, numbers, i):
    """Return the bound that the friction of a sliding cable has, relative to the tension before."""
    lam = numbers.space.vectors[LAMBDA, first_of(numbers.space.slots, i)]
    return data.blocks.blocks_f[i, at.WRAP_FALL if lam < 0.0 else at.WRAP_RISE]


@part
def slip_of(data, i):
    """Compute the direction in which a contact slides along its tangents, and its speed."""
    r = first_of(data.space.slots, i)
    u = gather(data.space.y, data.space.slots, i, data.space.vectors[EFFECT])
    x, y = data.space.vectors[RHS, r + 1] + u[1], data.space.vectors[RHS, r + 2] + u[2]
    speed = math.sqrt(x * x + y * y)
    share = 1.0 / speed if speed > 0.0 else 0.0
    return share * x, share * y, speed


@part
def changed_law(data, i, law, effect, own, before):
    """Compute the change of the residual of block i if λ changes by `own` in the block itself and
    by `before` in those before it in its chain, with this `effect` on the speeds of all joints.
    """
    u = gather(data.space.y, data.space.slots, i, effect)
    if law != BLOCK_STATE.sliding:
        return u
    if type_of(data.blocks.blocks_i, i) == at.T_WRAP:
        return (own[0] - bound_of_wrap(data, data, i) * before, 0.0, 0.0)
    friction = data.blocks.blocks_f[i, at.FRICTION]
    x, y, speed = slip_of(data, i)
    turning = friction * data.space.vectors[LAMBDA, first_of(data.space.slots, i)] / speed
    across = turning * (x * u[2] - y * u[1])
    more = friction * own[0]
    return (u[0], own[1] + more * x - across * y, own[2] + more * y + across * x)


@part
def unknowns(law, size):
    """Count the impulses of a block that are determined by its law."""
    if law == BLOCK_STATE.open or law == BLOCK_STATE.bound:
        return 0
    return 1 if law == BLOCK_STATE.smooth else size


@sweep
def largest_of(data, m):
    """Find the largest velocity of m rows before or without impulses."""
    size = 0.0
    for r in range(m):
        here = max(abs(data.space.vectors[RHS, r]), abs(data.space.vectors[BEFORE, r]))
        size = max(size, here)
    return size


@sweep
def linearise_laws(data, carried, first, size):
    """Write the slopes of all laws by the unknown impulses into `matrix`.

    Returns the number of unknowns, and whether a contact law has no derivative.
    """
    blocks_i, active, slots = data.blocks.blocks_i, data.blocks.active, data.space.slots
    y, vectors, order, matrix = data.space.y, data.space.vectors, carried.order, carried.matrix
    effect, dinv = vectors[UNIT_EFFECT], vectors[DINV]
    count = 0
    unclear = False
    for j in range(1, active[0] + 1):
        i = active[j]
        law = law_of(data, i, j >= first, size)
        unclear = unclear or law == BLOCK_STATE.unclear
        for c in range(unknowns(law, size_of(blocks_i, i))):
            for k in range(dinv.shape[0]):
                effect[k] = 0.0
            for s in range(joints_of(slots, i)):
                k = joint_of(slots, i, s)
                effect[k] = dinv[k] * y[i, 3 * s + c]
            order[count] = first_of(slots, i) + c
            unit = (1.0 if c == 0 else 0.0, 1.0 if c == 1 else 0.0, 1.0 if c == 2 else 0.0)
            row = 0
            for n in range(1, active[0] + 1):
                law = law_of(data, active[n], n >= first, size)
                own = unit if n == j else (0.0, 0.0, 0.0)
                chained = 0 < active[n] - i <= before_in_chain(blocks_i, active[n])
                before = 1.0 if chained else 0.0
                u = changed_law(data, active[n], law, effect, own, before)
                for d in range(unknowns(law, size_of(blocks_i, active[n]))):
                    matrix[row, count] = u[d]
                    row += 1
            count += 1
    return count, unclear


@sweep
def miss_laws(scene, data, first, size):
    """Write by how much duals miss the laws into LAW_MISSES, in the order of the unknowns."""
    own = opened(scene)
    blocks, space = own.blocks, own.space
    blocks_i, blocks_f, active, slots = blocks.blocks_i, blocks.blocks_f, blocks.active, space.slots
    vectors = space.vectors
    missed = vectors[LAW_MISSES]
    row = 0
    for j in range(1, active[0] + 1):
        i = active[j]
        law = law_of(data, i, j >= first, size)
        count = unknowns(law, size_of(blocks_i, i))
        r = first_of(slots, i)
        u = gather(space.y, slots, i, vectors[EFFECT])
        for c in range(count):
            missed[row + c] = vectors[RHS, r + c] + u[c]
        if one_sided(type_of(blocks_i, i)) and count > 0:
            missed[row] += rebound(data, i, blocks_f[i, at.BOUNCE], vectors[BEFORE, r])
            missed[row] += slack_of(blocks_i, blocks_f, i)
        if law == BLOCK_STATE.sliding and type_of(blocks_i, i) == at.T_WRAP:
            bound = bound_of_wrap(own, data, i) * tension_before(own, i)
            missed[row] = vectors[LAMBDA, r] - bound
        elif law == BLOCK_STATE.sliding:
            x, y, _ = slip_of(own, i)
            rim = blocks_f[i, at.FRICTION] * vectors[LAMBDA, r]
            missed[row + 1] = vectors[LAMBDA, r + 1] + rim * x
            missed[row + 2] = vectors[LAMBDA, r + 2] + rim * y
        row += count


@sweep
def impulses_of_duals(scene, numbers, carried, first, m):
    """Compute the dual λ from RHS and BEFORE, and its effect on the joints in EFFECT.

    Returns whether a law has no slope, between sticking and sliding, and whether the laws leave
    velocities undetermined.
    """
    own, data = opened(scene), opened(numbers)
    vectors, given = own.space.vectors, data.space.vectors[LAMBDA]
    for r in range(m):
        vectors[LAMBDA, r] = given[r]
    size = largest_of(data, m)
    for j in range(first, own.blocks.active[0] + 1):
        i = own.blocks.active[j]
        if law_of(data, i, True, size) == BLOCK_STATE.bound:
            r, bound = first_of(own.space.slots, i), own.blocks.blocks_f[i, at.AIM]
            vectors[LAMBDA, r] = bound if given[r] > 0.0 else -bound
    joint_impulses(own.blocks, own.space)
    count, unclear = linearise_laws(data, carried, first, size)
    miss_laws(scene, data, first, size)
    missed, impulses = parted(vectors[LAW_MISSES]), parted(vectors[LAMBDA])
    right, order = carried.right, carried.order
    for row in range(count):
        for k in range(1, WIDTH):
            right[row, k] = -missed[row, k]
    rank = solve_ranked(carried.matrix, right, order, count)
    loose = undetermined(data, carried, rank, count, m)
    for row in range(count):
        for k in range(1, WIDTH):
            impulses[order[row], k] += right[row, k]
    joint_impulses(own.blocks, own.space)
    return unclear, loose


@sweep
def undetermined(data, carried, rank, count, m):
    """Check whether impulses that the laws leave undetermined change velocities.

    The change of velocities by a combination of these impulses is compared with the changes by its
    parts, as energies. Values below PROXIMAL count as zero, as for the pivots of `solve_ranked`,
    which must be called first.
    """
    blocks, space = data.blocks, data.space
    slots, own, effect, dinv = (
        space.slots,
        space.own,
        space.vectors[UNIT_EFFECT],
        space.vectors[DINV],
    )
    matrix, scale, order = carried.matrix, carried.right, carried.order
    for n in range(rank, count):
        change = matrix[rank]  # change of λ by rows: the elimination needs the lines above only
        for r in range(m):
            change[r] = 0.0
        change[order[n]] = scale[n, 0]
        for r in range(rank - 1, -1, -1):
            x = matrix[r, n]
            for c in range(r + 1, rank):
                x += matrix[r, c] * change[order[c]] / scale[c, 0]
            change[order[r]] = -scale[r, 0] * x / matrix[r, r]
        for k in range(dinv.shape[0]):
            effect[k] = 0.0
        apart = 0.0
        for j in range(1, blocks.active[0] + 1):
            i = blocks.active[j]
            lam = rows_of(change, first_of(slots, i), size_of(blocks.blocks_i, i))
            scatter(space.y, slots, i, lam, effect)
            for c in range(3):
                apart += lam[c] * lam[c] * own[i, 4 * c]
        energy = 0.0
        for k in range(dinv.shape[0]):
            energy += dinv[k] * effect[k] * effect[k]
        if energy > PROXIMAL * apart:
            return True
    return False


@sweep
def solve_ranked(a, b, order, n):
    """Solve a x = b for columns 1 to WIDTH - 1 of b, in place, by elimination with full pivoting.

    Rows and columns are scaled by their diagonals, in column 0. `order` is permuted like x.
    Undetermined components are zero. Returns the rank.
    """
    for r in range(n):
        b[r, 0] = 1.0 / math.sqrt(abs(a[r, r])) if a[r, r] != 0.0 else 1.0
    for r in range(n):
        for c in range(n):
            a[r, c] *= b[r, 0] * b[c, 0]
        for k in range(1, WIDTH):
            b[r, k] *= b[r, 0]
    rank = n
    for p in range(n):
        best, row, column = 0.0, p, p
        for r in range(p, n):
            for c in range(p, n):
                if abs(a[r, c]) > best:
                    best, row, column = abs(a[r, c]), r, c
        if not best > PROXIMAL:
            rank = p
            break
        if row != p:
            for c in range(n):
                a[p, c], a[row, c] = a[row, c], a[p, c]
            for k in range(1, WIDTH):
                b[p, k], b[row, k] = b[row, k], b[p, k]
        if column != p:
            for r in range(n):
                a[r, p], a[r, column] = a[r, column], a[r, p]
            order[p], order[column] = order[column], order[p]
            b[p, 0], b[column, 0] = b[column, 0], b[p, 0]
        for r in range(p + 1, n):
            x = a[r, p] / a[p, p]
            if x != 0.0:
                for c in range(p + 1, n):
                    a[r, c] -= x * a[p, c]
                for k in range(1, WIDTH):
                    b[r, k] -= x * b[p, k]
    for r in range(n - 1, -1, -1):
        for k in range(1, WIDTH):
            x = b[r, k]
            for c in range(r + 1, rank):
                x -= a[r, c] * b[c, k]
            b[r, k] = x / a[r, r] if r < rank else 0.0
    for r in range(n):
        for k in range(1, WIDTH):
            b[r, k] *= b[r, 0]
    return rank
