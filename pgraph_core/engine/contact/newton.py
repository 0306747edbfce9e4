"""Contact laws of an island by Newton's method, solved for impulses and speeds simultaneously.

The unknowns are the impulses λ and the transformed velocities w, for which the mass matrix is 1
and the velocity of a block is u = Y w + g (`islands`). A block's law is λ = P(λ - k u), the same
for every k > 0: P projects the normal impulse onto its half line and friction onto the disc μ λ_n
([Alart & Curnier 1991]). P determines whether a block is open, sticking or sliding, where k is its
effective mass. Linearised, with a compliance s that limits the change of λ,

    (1 - (1 - k s) P') Δλ = P - λ - k P' Y Δw,      Δw = Yᵀ Δλ.

Without Δλ that is (1 + Σ Yᵀ R Y) Δw = Yᵀ (...), R = k (1 - (1 - k s) P')⁻¹ P', whose factor
is sparse in the order of the trees. The law of a cable on a wheel with friction also depends on the
tension before it, the sum of the λ before it in its chain: P has the slope p by it, which adds
p (1 - (1 - k s) P')⁻¹ Σ Δλ to its Δλ. The blocks of a chain have the same joints, and so the same
place in the matrix. Sticking blocks have R = 1/s. As s → 0, this is Newton's
method, while a larger s leads to shorter steps ([Levenberg 1944]). If s is proportional to the
square root of the residual, the method is of order 3/2 near the solution ([Fan & Yuan 2005]).

If the impulses are not unique, those with the least norm are computed. A uniform compliance on all
of λ, λ = P(λ - k (u + s λ)), makes them unique. The resulting error is then removed using the same
factorization, as for redundant constraints ([Carpentier et al. 2021]).
"""

import math

from ...tolerances import EPS, NOTABLE, PROXIMAL, ROUNDING, SHARED, SOLVED
from .. import layout as at
from ..arrays import (
    BEST_IMPULSES,
    HELD_IMPULSES,
    IMPULSES_BEFORE,
    LAMBDA,
    TARGET,
    opened,
)
from ..compiler.jit import part, sweep
from ..compiler.lane import (
    four,
    load_four,
    numbers_of_four,
    store_four,
)
from ..constraints.blocks import before_in_chain, first_of, one_sided, size_of, type_of
from ..vec import add_scaled, dot, load, mul, scale, store, sub
from .contacts import contacts_at
from .independence import unique
from .island_rows import (
    SCRATCH,
    add_four,
    clear,
    copy_impulses,
    drop_impulses,
    felt,
    fours_of,
    pull,
    rescale,
    respond,
    rows_of,
    share_evenly,
)
from .projections import admitted, bounds_of, follows, into_cone, on_rim, state_of, turning
from .sparse import factor, substitute, total

TOLERANCE = 1e-10  # residual of a solved island relative to its largest velocity
HIT = 16 * EPS  # rounding of a speed to which that many impulses add up, relative to the largest
CAREFUL = 2e-3  # s over the root of what is missed, relative to what a block meets
TENFOLD = 10.0  # factor of its growth after a failed step, and of its decrease after a good one
MOST_STEPS = 40
STUCK = 3  # steps that do not halve what is missed: enough where it is not notable
ROUNDS = 60  # problems with given friction bounds
# k of the first of these problems over that of the law, and its growth: a heavy body stops only if
# k exceeds its mass over that of the lightest, and slow growth takes more problems to get there.
# Of 1800 steps with mass ratios up to 1e6, all were solved with (128, 4) and (1024, 4), and all
# but one or two with (16, 4), (128, 2) and (128, 8).
FIRM = (128.0, 4.0)
INNER_STEPS = 30  # Newton's steps of one such problem
HALVINGS = 20  # halvings of one such step, until the slope along it is a tenth
CORRECTIONS = 20  # largest number of refinements that remove the compliance
# Impulses that are not of least norm, those of least norm, and those for which the last pass of a
# step chooses
TRANSIENT, LEAST_NORM, DUE = 0.0, 1.0, 2.0
LAWS, BOUNDS, CONES, NORMALS = 0, 1, 2, 3  # sets that `look` projects onto


@sweep
def look(scene, n, soft, onto):
    """Write P - λ of island n's blocks into SCRATCH.miss and P' into SCRATCH.slope, with `soft`
    applied to all of λ.

    P projects onto the LAWS, with BOUNDS onto those with the friction bounds of λ, with CONES onto
    the cones of the contacts that rest, and with NORMALS onto the laws without friction. Return
    (norm of the residual [m/s], its largest entry, the rounding error of that entry, the number of
    blocks whose state has changed since the last evaluation).
    """
    data = opened(scene)
    blocks_i, space = data.blocks.blocks_i, data.space
    islands = contacts_at(data.links.contacts).islands
    slots, vectors, kept = space.slots, space.vectors, islands.slope
    total = 0.0
    most = 0.0
    push = 0.0
    changed = 0
    for j in range(islands.first[n], islands.first[n + 1]):
        i = islands.blocks[j]
        size, kind = size_of(blocks_i, i), type_of(blocks_i, i)
        mobility = islands.mobility[i]
        k = 1.0 / mobility
        lam = rows_of(vectors[LAMBDA], first_of(slots, i), size)
        target = rows_of(vectors[TARGET], first_of(slots, i), size)
        u = add_scaled(target, 1.0, felt(islands, j, islands.speeds))
        u = add_scaled(u, soft * islands.weight[i], lam)
        z = add_scaled(lam, -k, u)
        bounds = (0.0, 0.0) if onto == NORMALS else bounds_of(data, i)
        if onto == BOUNDS and kind == at.T_CONTACT and size > 1:
            p, slope = turning(z, 0.0, math.inf, bounds[0] * max(lam[0], 0.0))
        elif onto == CONES and kept[i, SCRATCH.rests] == 1.0:
            p, slope = into_cone(z, bounds[0])
        else:
            p, slope = admitted(kind, size, z, bounds)
        miss = sub(p, lam)
        depends = kind == at.T_WRAP and (onto == LAWS or onto == CONES)
        kept[i, SCRATCH.follows] = follows(data, i, z[0]) if depends else 0.0
        store(kept, i, SCRATCH.miss, miss)
        for c in range(9):
            kept[i, SCRATCH.slope + c] = slope[c]
        changed += 0 if kept[i, SCRATCH.state] == state_of(slope) else 1
        kept[i, SCRATCH.state] = state_of(slope)
        total += dot(miss, miss) * mobility * mobility
        most = max(most, mobility * max(abs(miss[0]), max(abs(miss[1]), abs(miss[2]))))
        push = max(push, mobility * max(abs(lam[0]), max(abs(lam[1]), abs(lam[2]))))
    return math.sqrt(total), most, HIT * push, changed


@part
def resistance(slope, ks):
    """Compute (1 - (1 - k s) P')⁻¹, row by row."""
    c = ks - 1.0
    a, b, d = 1.0 - slope[0] + ks * slope[0], c * slope[1], c * slope[2]
    e, f, g = c * slope[3], 1.0 - slope[4] + ks * slope[4], c * slope[5]
    p, q, r = c * slope[6], c * slope[7], 1.0 - slope[8] + ks * slope[8]
    x, y, z = f * r - g * q, g * p - e * r, e * q - f * p
    inverse = 1.0 / (a * x + b * y + d * z)
    return (
        inverse * x, inverse * (d * q - b * r), inverse * (b * g - d * f),
        inverse * y, inverse * (a * r - d * p), inverse * (d * e - a * g),
        inverse * z, inverse * (b * p - a * q), inverse * (a * f - b * e),
    )  # fmt: skip


@sweep
def prepare(scene, n, soft, refactor):
    """Write Yᵀ of the blocks' own changes in λ into `change`, and R and the matrix if `refactor`.

    Whether the matrix is symmetric.
    """
    islands = contacts_at(opened(scene).links.contacts).islands
    blocks_i = opened(scene).blocks.blocks_i
    upper, lower, kept, start = islands.upper, islands.lower, islands.slope, islands.start
    rows = fours_of(islands)
    clear(islands.change, rows)
    symmetric = True
    chain, tension = -1, 0.0
    for j in range(islands.first[n], islands.first[n + 1]):
        i = islands.blocks[j]
        k = 1.0 / islands.mobility[i]
        ks = k * soft * islands.weight[i]
        first, second, third = load(kept, i, 0), load(kept, i, 3), load(kept, i, 6)
        slope = (*first, *second, *third)
        symmetric = symmetric and not on_rim(slope) and kept[i, SCRATCH.follows] == 0.0
        inverse = resistance(slope, ks)
        move = mul(inverse, load(kept, i, SCRATCH.miss))
        chain, tension = along_chain(blocks_i, i, chain, tension)
        if kept[i, SCRATCH.follows] != 0.0:
            move = (move[0] + kept[i, SCRATCH.follows] * tension, 0.0, 0.0)
        tension += move[0]
        store(kept, i, SCRATCH.move, move)
        pull(islands, j, move, islands.change)
        if refactor:
            store(kept, i, SCRATCH.rate, scale(k, mul(inverse, (slope[0], slope[3], slope[6]))))
            store(kept, i, SCRATCH.rate + 3, scale(k, mul(inverse, (slope[1], slope[4], slope[7]))))
            store(kept, i, SCRATCH.rate + 6, scale(k, mul(inverse, (slope[2], slope[5], slope[8]))))
    if not refactor:
        return symmetric
    for e in range(start[rows]):
        for c in range(16):
            upper[e, c] = 0.0
    if not symmetric:
        for e in range(start[rows]):
            for c in range(16):
                lower[e, c] = 0.0
    for p in range(rows):
        for c in range(4):
            upper[start[p], 5 * c] = 1.0
    for j in range(islands.first[n], islands.first[n + 1]):
        i = islands.blocks[j]
        if (
            kept[i, SCRATCH.rate] == 0.0
            and kept[i, SCRATCH.rate + 4] == 0.0
            and kept[i, SCRATCH.rate + 8] == 0.0
        ):
            continue
        add_block(islands, j, symmetric)
    for j in range(islands.first[n], islands.first[n + 1]):
        if kept[islands.blocks[j], SCRATCH.follows] != 0.0:
            add_chain(islands, blocks_i, j)
    return symmetric


@part
def along_chain(blocks_i, i, chain, tension):
    """Return (first block of the chain of block i, a sum along this chain, which is zero where it
    begins)."""
    first = i - before_in_chain(blocks_i, i)
    return first, tension if first == chain else 0.0


@sweep
def add_chain(islands, blocks_i, j):
    """Add to the matrix Yᵀ p times the change of the tension before the j-th block by velocities,
    where p is the slope of its law.

    The slope of that tension is Σ -R Y over the blocks before it, of which each that follows has
    the multiple 1 + p of the slope before itself.
    """
    start, column, upper, lower = islands.start, islands.column, islands.upper, islands.lower
    across, reached, i, first = islands.across, islands.reached, islands.blocks[j], islands.fours[j]
    slope, count = islands.slope[i, SCRATCH.follows], before_in_chain(blocks_i, i)
    width = islands.fours[j + 1] - first
    for e in range(width):
        force = numbers_of_four(slope * load_four(across, first + e, 0))
        speed = numbers_of_four(by_speeds(islands, j, count, e))
        to = start[reached[first + e]]
        for f in range(e, width):
            while column[to] != reached[first + f]:
                to += 1
            forces, speeds = (
                slope * load_four(across, first + f, 0),
                by_speeds(islands, j, count, f),
            )
            for c in range(4):
                store_four(upper, to, 4 * c, load_four(upper, to, 4 * c) + force[c] * speeds)
                if f > e:
                    store_four(lower, to, 4 * c, load_four(lower, to, 4 * c) + speed[c] * forces)


@part
def by_speeds(islands, j, count, e):
    """Return four columns, the e-th ones, of the slope of the impulse of the tension before the
    j-th block, with `count` blocks before it in its chain, by speeds, times -1."""
    total = four(0.0, 0.0, 0.0, 0.0)
    for m in range(max(j - count, 0), j):
        i = islands.blocks[m]
        if i < islands.blocks[j] - count:  # those before it that move nothing are not in the island
            continue
        rate = islands.slope[i, SCRATCH.rate]
        total = total + islands.slope[i, SCRATCH.follows] * total
        total = total + rate * load_four(islands.across, islands.fours[m] + e, 0)
    return total


@sweep
def add_block(islands, j, symmetric):
    """Add Yᵀ R Y of the j-th block to the matrix."""
    start, column, upper, lower = islands.start, islands.column, islands.upper, islands.lower
    across, reached, i = islands.across, islands.reached, islands.blocks[j]
    r0, r1 = load(islands.slope, i, SCRATCH.rate), load(islands.slope, i, SCRATCH.rate + 3)
    r2 = load(islands.slope, i, SCRATCH.rate + 6)
    first, end = islands.fours[j], islands.fours[j + 1]
    for e in range(first, end):
        u = columns(across, e, r0, r1, r2)
        v = u
        if not symmetric:
            t0, t1, t2 = (r0[0], r1[0], r2[0]), (r0[1], r1[1], r2[1]), (r0[2], r1[2], r2[2])
            v = columns(across, e, t0, t1, t2)
        to = start[reached[e]]
        for f in range(e, end):
            while column[to] != reached[f]:
                to += 1
            for c in range(4):
                add_four(upper, to, 4 * c, across, f, (u[0][c], u[1][c], u[2][c]))
                if f > e and not symmetric:
                    add_four(lower, to, 4 * c, across, f, (v[0][c], v[1][c], v[2][c]))


@part
def columns(across, e, a, b, c):
    """Return a · Y, b · Y and c · Y of four columns."""
    x, y, z = load_four(across, e, 0), load_four(across, e, 4), load_four(across, e, 8)
    return (
        numbers_of_four(a[0] * x + a[1] * y + a[2] * z),
        numbers_of_four(b[0] * x + b[1] * y + b[2] * z),
        numbers_of_four(c[0] * x + c[1] * y + c[2] * z),
    )


@sweep
def direction(scene, n, soft, refactor, held):
    """Compute the Newton updates of λ and w, and store them in SCRATCH.move and `change`. Returns
    whether there is a factor.

    If `held`, w has moved along `path`, but λ does not include that move.
    """
    islands = contacts_at(opened(scene).links.contacts).islands
    upper, lower, start, column = islands.upper, islands.lower, islands.start, islands.column
    change, kept, rows = islands.change, islands.slope, fours_of(islands)
    blocks_i, chain, tension = opened(scene).blocks.blocks_i, -1, 0.0
    symmetric = prepare(scene, n, soft, refactor)
    if held:
        for p in range(rows):
            store_four(change, p, 0, load_four(change, p, 0) - load_four(islands.path, p, 0))
    if refactor and not factor(upper, lower, start, column, rows, symmetric):
        return False
    substitute(upper, lower, start, column, rows, change)
    for j in range(islands.first[n], islands.first[n + 1]):
        i = islands.blocks[j]
        u = felt(islands, j, change)
        move = load(kept, i, SCRATCH.move)
        before = move[0]
        for c in range(3):
            move = add_scaled(move, -u[c], load(kept, i, SCRATCH.rate + 3 * c))
        chain, tension = along_chain(blocks_i, i, chain, tension)
        if kept[i, SCRATCH.follows] != 0.0:
            move = (move[0] + kept[i, SCRATCH.follows] * tension, 0.0, 0.0)
        tension += move[0] - before
        store(kept, i, SCRATCH.move, move)
    return True


@sweep
def start_from_here(scene, n):
    """Copy λ of island n into SCRATCH.start."""
    data = opened(scene)
    islands = contacts_at(data.links.contacts).islands
    slots = data.space.slots
    for j in range(islands.first[n], islands.first[n + 1]):
        i = islands.blocks[j]
        size = size_of(data.blocks.blocks_i, i)
        lam = rows_of(data.space.vectors[LAMBDA], first_of(slots, i), size)
        store(islands.slope, i, SCRATCH.start, lam)


@sweep
def go(scene, n, part_of_it):
    """Move λ of island n by a fraction of SCRATCH.move, and update w accordingly."""
    data = opened(scene)
    islands = contacts_at(data.links.contacts).islands
    kept, lam = islands.slope, data.space.vectors[LAMBDA]
    for j in range(islands.first[n], islands.first[n + 1]):
        i = islands.blocks[j]
        r = first_of(data.space.slots, i)
        for c in range(size_of(data.blocks.blocks_i, i)):
            lam[r + c] = kept[i, SCRATCH.start + c] + part_of_it * kept[i, SCRATCH.move + c]
    respond(scene, n)


@sweep
def stays(scene, n, size):
    """Return the residual of λ of the last step over `size`, or infinity if it does not solve
    island n to rounding.

    They must be of least norm. After `weigh`.
    """
    data = opened(scene)
    islands = contacts_at(data.links.contacts).islands
    for j in range(islands.first[n], islands.first[n + 1]):
        i = islands.blocks[j]
        touches = type_of(data.blocks.blocks_i, i) == at.T_CONTACT
        if touches and data.blocks.blocks_f[i, at.SETTLED] != LEAST_NORM:
            return math.inf
    respond(scene, n)
    _, left, noise, _ = look(scene, n, 0.0, LAWS)
    return left / size if left <= ROUNDING * size + noise else math.inf


@sweep
def solve_exact(scene, n, size, last):
    """Solve the contact laws of island n. Returns (residual over `size`, number of steps).

    It starts from λ. If this does not converge, problems with given friction bounds are solved
    first (`hold`). If no contact state has changed in the `last` pass, or in an impact, the
    impulses of least norm are computed next. If a contact state changes within a pass, the impulses
    are only transient, and the impulses of least norm usually lead to another change. Earlier
    passes leave the choice to the last one, which sees it in the contacts of the island. Impulses
    of independent rows leave no choice.
    """
    left, taken, same, soft = converge(scene, n, size, CAREFUL)
    if left > NOTABLE:
        left, more = hold(scene, n, size, left)
        taken += more
    elif left <= TOLERANCE and unique(scene, n):
        note_settled(scene, n, LEAST_NORM)
        left, _ = refine(scene, n, size, (LAWS, soft), taken == 0)
        return left / size, taken
    strikes = contacts_at(opened(scene).links.contacts).tally[0].share == 0.0
    settle = same or strikes or left > TOLERANCE
    chosen = LEAST_NORM if settle else TRANSIENT
    touches = note_settled(scene, n, chosen if last else DUE)
    if not settle or (touches and not last):
        return left, taken
    copy_impulses(scene, n, LAMBDA, IMPULSES_BEFORE)
    again, noise = least_norm(scene, n, size)
    if not again <= max(left, TOLERANCE, noise):
        copy_impulses(scene, n, IMPULSES_BEFORE, LAMBDA)
        respond(scene, n)
        again = left
    return again, taken + 1


@sweep
def note_settled(scene, n, settled):
    """Store whether the impulses of island n are of least norm. Returns whether it has contacts."""
    data = opened(scene)
    islands = contacts_at(data.links.contacts).islands
    touches = False
    for j in range(islands.first[n], islands.first[n + 1]):
        i = islands.blocks[j]
        if type_of(data.blocks.blocks_i, i) == at.T_CONTACT:
            data.blocks.blocks_f[i, at.SETTLED] = settled
            touches = True
    return touches


@sweep
def converge(scene, n, size, careful):
    """Take Newton steps from λ on until no row misses its law by more than TOLERANCE or rounding.

    A step is taken back if more is missed after it than at the start, and more than NOTABLE. More
    may be missed than before the step: steps that change contact states often miss more before
    they lead on ([Grippo et al. 1986] have bounds of this kind). A step after which TENFOLD² times
    as much is missed ends where it first changes a state (`unchanged`). Contact points at the
    friction limit may exchange impulses indefinitely, so that NOTABLE is enough if steps no longer
    help. `careful` is the least s over the root of what is missed. Return (residual divided by
    `size`, number of steps, True if no contact state has changed, s of the last factor).
    """
    respond(scene, n)
    first, left, noise, _ = look(scene, n, 0.0, LAWS)
    best, before = left, first
    copy_impulses(scene, n, LAMBDA, BEST_IMPULSES)
    care, stuck = careful, 0
    taken = 0
    same, soft = True, PROXIMAL
    while taken < MOST_STEPS and best > max(TOLERANCE * size, noise):
        if stuck >= STUCK and best <= NOTABLE * size:
            break
        taken += 1
        soft = min(max(care * math.sqrt(left / size), PROXIMAL), 1.0)
        start_from_here(scene, n)
        if not direction(scene, n, soft, True, False):
            break
        go(scene, n, 1.0)
        norm, now, noise, changed = look(scene, n, 0.0, LAWS)
        same = same and changed == 0
        whole = norm <= max(TENFOLD * TENFOLD * before, NOTABLE * size)
        if not whole:
            go(scene, n, 0.0)
            go(scene, n, min((1.0 + NOTABLE) * unchanged(scene, n), 1.0))
            norm, now, noise, _ = look(scene, n, 0.0, LAWS)
        stuck = 0 if now < 0.5 * best else stuck + 1
        if now < best:
            best = now
            copy_impulses(scene, n, LAMBDA, BEST_IMPULSES)
        if norm <= max(first, NOTABLE * size) or soft == 1.0:
            left, before = now, norm
            care = max(care / TENFOLD, careful) if whole else care
        else:
            care *= TENFOLD
            go(scene, n, 0.0)
            look(scene, n, 0.0, LAWS)
    copy_impulses(scene, n, BEST_IMPULSES, LAMBDA)
    respond(scene, n)
    return best / size, taken, same, soft


@sweep
def unchanged(scene, n):
    """Compute the part of SCRATCH.move and `change` after which the first contact opens, or slides.

    In a chain of bodies that touch at several points, impulses that hardly move any of them are
    large. Many contacts would open in such a step, but the first one that opens ends the chain.
    """
    data = opened(scene)
    blocks_i, space = data.blocks.blocks_i, data.space
    islands = contacts_at(data.links.contacts).islands
    kept, reach = islands.slope, math.inf
    for j in range(islands.first[n], islands.first[n + 1]):
        i = islands.blocks[j]
        if not one_sided(type_of(blocks_i, i)):
            continue
        k, mu = 1.0 / islands.mobility[i], bounds_of(data, i)[0]
        target = rows_of(space.vectors[TARGET], first_of(space.slots, i), size_of(blocks_i, i))
        u = add_scaled(target, 1.0, felt(islands, j, islands.speeds))
        x = add_scaled(load(kept, i, SCRATCH.start), -k, u)
        move = add_scaled(load(kept, i, SCRATCH.move), -k, felt(islands, j, islands.change))
        if x[0] > 0.0 and move[0] < 0.0:
            reach = min(reach, -x[0] / move[0])
        room = mu * mu * x[0] * x[0] - x[1] * x[1] - x[2] * x[2]
        if size_of(blocks_i, i) == 1 or not x[0] > 0.0 or room < 0.0:
            continue
        half = x[1] * move[1] + x[2] * move[2] - mu * mu * x[0] * move[0]
        turn = move[1] * move[1] + move[2] * move[2] - mu * mu * move[0] * move[0]
        half += math.sqrt(max(half * half + turn * room, 0.0))
        if half > 0.0:
            reach = min(reach, room / half)
    return reach


@sweep
def hold(scene, n, size, left):
    """Solve problems with given friction bounds, and converge from the solution of each.

    Newton's method for the law itself may cycle. If friction pushes a sliding contact further into
    the ground, no normal impulse stops it while it slides (a jam). Newton's method then alternates
    between an open and a closed contact, although there is a larger impulse at which it sticks.
    With given bounds, a convex function is minimised, which Newton's method with a line search
    solves from any start. The bounds are those of the previous solution, at first zero
    ([Haslinger et al. 1996]), and increase until a jammed contact sticks. k increases as well, so
    that heavy bodies are stopped, and more slowly each time that rounding prevents a solution. As
    a heavy body meets 1/k of what a light one does, s decreases with 1/k. Return (residual divided
    by `size`, number of steps). λ is the best one that was found.
    """
    copy_impulses(scene, n, LAMBDA, IMPULSES_BEFORE)
    drop_impulses(scene, n)
    best, taken, firm, growth = left, 0, FIRM[0], FIRM[1]
    for _ in range(ROUNDS):
        copy_impulses(scene, n, LAMBDA, HELD_IMPULSES)
        rescale(scene, n, 1.0 / firm)
        more, solved = solve_held(scene, n, size)
        rescale(scene, n, firm)
        taken += more
        if not solved:
            copy_impulses(scene, n, HELD_IMPULSES, LAMBDA)
            firm /= FIRM[1]
            growth = math.sqrt(growth)
            continue
        copy_impulses(scene, n, LAMBDA, HELD_IMPULSES)
        left, more, _, _ = converge(scene, n, size, CAREFUL / firm)
        taken += more
        if left < best:
            best = left
            copy_impulses(scene, n, LAMBDA, IMPULSES_BEFORE)
        if best <= NOTABLE:
            break
        copy_impulses(scene, n, HELD_IMPULSES, LAMBDA)
        firm *= growth
    copy_impulses(scene, n, IMPULSES_BEFORE, LAMBDA)
    respond(scene, n)
    return best, taken


@sweep
def solve_held(scene, n, size):
    """Replace λ by λ' = P(λ - k u) with the friction bounds of λ, where u is that of λ'.

    This is a step of the proximal method ([Rockafellar 1976]): w minimises the kinetic energy plus
    |P|²/2k. Returns (number of Newton steps, whether they converged).
    """
    islands = contacts_at(opened(scene).links.contacts).islands
    kept = islands.slope
    rows = fours_of(islands)
    clear(islands.path, rows)
    respond(scene, n)
    look(scene, n, 0.0, BOUNDS)
    taken, solved = 0, False
    while taken < INNER_STEPS:
        taken += 1
        if not direction(scene, n, 1.0, True, True):
            break
        rise, fastest = along(scene, n)
        enough = abs(rise) / TENFOLD
        low, high, part_of_it, moved = 0.0, 1.0, 1.0, 0.0
        for _ in range(HALVINGS):
            for p in range(rows):
                more = (part_of_it - moved) * load_four(islands.change, p, 0)
                store_four(islands.path, p, 0, load_four(islands.path, p, 0) + more)
                store_four(islands.speeds, p, 0, load_four(islands.speeds, p, 0) + more)
            moved = part_of_it
            look(scene, n, 0.0, BOUNDS)
            rise, _ = along(scene, n)
            if abs(rise) <= enough or (rise < 0.0 and part_of_it == 1.0):
                break
            if rise < 0.0:
                low = part_of_it
            else:
                high = part_of_it
            part_of_it = 0.5 * (low + high)
        if fastest <= SOLVED * size:
            solved = True
            break
    start_from_here(scene, n)
    for j in range(islands.first[n], islands.first[n + 1]):
        i = islands.blocks[j]
        store(kept, i, SCRATCH.move, load(kept, i, SCRATCH.miss))
    go(scene, n, 1.0)
    return taken, solved


@sweep
def along(scene, n):
    """Compute (slope of what `solve_held` minimises, largest velocity change) along `change`."""
    islands = contacts_at(opened(scene).links.contacts).islands
    rise, fastest = 0.0, 0.0
    for p in range(fours_of(islands)):
        rise += total(load_four(islands.path, p, 0) * load_four(islands.change, p, 0))
    for j in range(islands.first[n], islands.first[n + 1]):
        i = islands.blocks[j]
        u = felt(islands, j, islands.change)
        rise -= dot(load(islands.slope, i, SCRATCH.miss), u)
        fastest = max(fastest, max(abs(u[0]), max(abs(u[1]), abs(u[2]))))
    return rise, fastest


@sweep
def least_norm(scene, n, size):
    """Continue to the minimum-norm λ with the same effect.

    Where a contact rests, all impulses within its cone are admitted, so that the problem is convex
    and has one solution. Returns (residual over `size`, its rounding over `size`).
    """
    share_evenly(scene, n)
    note_resting(scene, n, size)
    _, left, noise, _ = look(scene, n, SHARED, CONES)
    for _ in range(MOST_STEPS):
        before = left
        start_from_here(scene, n)
        if not direction(scene, n, SHARED, True, False):
            return math.inf, 0.0
        go(scene, n, 1.0)
        _, left, noise, changed = look(scene, n, SHARED, CONES)
        if left <= max(ROUNDING * size, noise) or (changed == 0 and not left < before):
            break
    refine(scene, n, size, (CONES, SHARED), False)
    _, left, noise, _ = look(scene, n, 0.0, LAWS)
    return left / size, noise / size


@sweep
def refine(scene, n, size, factored, refactor):
    """Remove what the compliance s of a factor has left of the residual, up to rounding.

    `factored` are the set that is projected onto, and s. Return (the residual, its rounding).
    """
    onto, soft = factored
    _, left, noise, _ = look(scene, n, 0.0, onto)
    for _ in range(CORRECTIONS):
        if left <= max(ROUNDING * size, noise):
            break
        before = left
        start_from_here(scene, n)
        if not direction(scene, n, soft, refactor, False):
            break
        refactor = False
        go(scene, n, 1.0)
        _, left, noise, _ = look(scene, n, 0.0, onto)
        if not left < before:
            go(scene, n, 0.0)
            left = before
            break
    return left, noise


@sweep
def note_resting(scene, n, size):
    """Store for each contact of island n whether it does not slide."""
    data = opened(scene)
    blocks_i, slots, targets = data.blocks.blocks_i, data.space.slots, data.space.vectors[TARGET]
    islands = contacts_at(data.links.contacts).islands
    for j in range(islands.first[n], islands.first[n + 1]):
        i = islands.blocks[j]
        target = rows_of(targets, first_of(slots, i), size_of(blocks_i, i))
        u = add_scaled(target, 1.0, felt(islands, j, islands.speeds))
        rests = max(abs(u[1]), abs(u[2])) <= TOLERANCE * size
        rests = rests and type_of(blocks_i, i) == at.T_CONTACT
        islands.slope[i, SCRATCH.rests] = 1.0 if rests else 0.0
