"""Impulses at one instant: bilateral rows, limits and frictional contacts in a single solve.

Let u = Ω λ + b be the velocities of the rows, and b those without impulses. A limit requires 0 ≤ λ
⊥ u ≥ 0. A contact (normal first, then two tangents) requires u_n + e u_n⁻ ⊥ λ_n (Signorini) and λ_t
in Coulomb's disc of radius μ λ_n against the slip ([Moreau 1988], [Jean 1999]). Each island is
solved alone (`islands`). If no body has more than one contact, block Gauss-Seidel sweeps on Y are
tried first, since they do not require Ω. Heaps of balls and feet of walkers take a few sweeps. If
impulses are redundant or sweeps stall, Newton's method is used (`newton`).
"""

import math

from ...tolerances import EPS, NOTABLE
from .. import layout as at
from ..arrays import (
    BARRED,
    BEFORE,
    CALMED,
    DINV,
    FREE_SPEEDS,
    GAINED,
    HARD,
    JOINT_SPEEDS,
    LAMBDA,
    LAST_RHS,
    LOOSE,
    MISSED,
    REPORT,
    RHS,
    SPEEDS,
    STEPS_DONE,
    STRAYS,
    TARGET,
    TURNED,
    opened,
)
from ..compiler.jit import part, sweep
from ..constraints.blocks import (
    dry,
    first_of,
    joint_of,
    joints_of,
    one_sided,
    size_of,
    slack_of,
    type_of,
)
from ..constraints.constraints import joint_impulses
from ..vec import dot, load
from .conflicts import barred, ease, strain
from .contacts import contacts_at
from .island_rows import drop_impulses, gather, rows_of, velocity, weigh
from .islands import SIZES, find_islands, order_island, sweeps_suffice
from .loose import note_loose
from .newton import DUE, TOLERANCE, solve_exact, stays
from .sweeps import gauss_seidel, joint_speeds, own_block

# tolerance of large heaps: half of the digits, as forces are not unique
HEAP_TOLERANCE = math.sqrt(EPS)
SWEEPS = 200  # limit on sweeps where a factor would cost more
MOST_SWEEPS = 1000  # further ones where there is no room for a factor and the residual is notable
FEW_SWEEPS = 40  # before Newton's method
MOVES_TOGETHER = 1e3  # least ratio of a body's speed to that of its contacts if both move alike


@sweep
def solve_impulses(scene, h, again, last):
    """Compute λ of all active rows from b in RHS, in a step of h. The result is written to LAMBDA,
    whose previous value is the initial guess. If the same rows are solved `again`, islands with the
    same b as before keep their λ. Only the impulses of the `last` pass are recorded.

    Their effect on the joints is written to EFFECT. REPORT receives the numbers of sweeps and of
    Newton steps, the largest velocity residual of a law, relative to its island and in m/s, the
    kinetic energy added by unilateral impulses [J], the number of islands that were hard, that no
    velocities satisfy, and that did not bounce because they would have gained energy, and a block
    of an impact whose impulses are not unique (`loose`).

    If no velocities satisfy an island, its gaps may close by their tolerated depth in this step.
    """
    data = opened(scene)
    blocks, space = data.blocks, data.space
    islands = contacts_at(data.links.contacts).islands
    active, vectors, report = blocks.active, space.vectors, space.vectors[REPORT]
    for c in range(LOOSE + 1):
        report[c] = report[c] if again and (c == MISSED or (c >= STRAYS and c != GAINED)) else 0.0
    if not again:
        for j in range(1, active[0] + 1):
            i = active[j]
            own_block(space.y, space.slots, vectors[DINV], i, space.own)
            if joints_of(space.slots, i) == 0:
                for c in range(size_of(blocks.blocks_i, i)):
                    vectors[LAMBDA, first_of(space.slots, i) + c] = 0.0
        find_islands(scene)
    count = islands.size[SIZES.islands]
    largest = 0.0
    tally = contacts_at(data.links.contacts).tally[0]
    fine, still = tally.fine, EPS * tally.length / h
    if tally.share == 0.0:
        for n in range(count):
            largest = max(largest, largest_velocity(scene, n))
    for n in range(count):
        aim(scene, n)
        if again and is_as_before(scene, n) and not is_due(scene, n):
            joint_speeds(scene, n)
            report[GAINED] += gained(scene, n)[0]
            note_missed(scene, n)
            continue
        if leaves_alone(scene, n, TOLERANCE * fine * largest):
            drop(scene, n)
            note_missed(scene, n)
            continue
        left, size = solve_island(scene, n, still, last)
        if left == math.inf:
            ease(scene, n)
            aim(scene, n)
            left, size = solve_island(scene, n, still, last)
        note_left(report, left, size)
        gain, size = gained(scene, n)
        if gain > NOTABLE * size and bounces(scene, n):
            report[CALMED] += 1.0
            for j in range(islands.first[n], islands.first[n + 1]):
                blocks.blocks_f[islands.blocks[j], at.BOUNCE] = 0.0
            aim(scene, n)
            left, size = solve_island(scene, n, still, last)
            note_left(report, left, size)
            gain, size = gained(scene, n)
        report[GAINED] += gain
        note_missed(scene, n)
    for r in range(vectors.shape[1]):
        vectors[LAST_RHS, r] = vectors[RHS, r]
    joint_impulses(blocks, space)


@part
def note_left(report, left, size):
    """Record the residual of an island over its largest velocity `size`, or that none is small."""
    if left == math.inf:
        report[BARRED] += 1.0
        return
    report[HARD] += 1.0 if left > NOTABLE else 0.0
    report[MISSED] = max(report[MISSED], left)
    report[STRAYS] = max(report[STRAYS], left * size)


@sweep
def is_as_before(scene, n):
    """Check whether b of island n in RHS is that in LAST_RHS, up to rounding."""
    data = opened(scene)
    islands, vectors = contacts_at(data.links.contacts).islands, data.space.vectors
    change = 0.0
    for j in range(islands.first[n], islands.first[n + 1]):
        r = first_of(data.space.slots, islands.blocks[j])
        for c in range(size_of(data.blocks.blocks_i, islands.blocks[j])):
            change = max(change, abs(vectors[RHS, r + c] - vectors[LAST_RHS, r + c]))
    return change <= EPS * largest_velocity(scene, n)


@sweep
def is_due(scene, n):
    """Check whether this pass chooses among the impulses of island n."""
    data = opened(scene)
    islands = contacts_at(data.links.contacts).islands
    found = False
    for j in range(islands.first[n], islands.first[n + 1]):
        i = islands.blocks[j]
        touches = type_of(data.blocks.blocks_i, i) == at.T_CONTACT
        found = found or (touches and data.blocks.blocks_f[i, at.SETTLED] == DUE)
    return found


@sweep
def aim(scene, n):
    """Write joint speeds without impulses into FREE_SPEEDS and the remaining row speeds of island n
    into TARGET.

    TARGET includes bounces and the motion of surfaces past their bodies. It also includes the
    permitted speed at which a contact point closes its gap, or a length reaches its bound
    (`slack_of`). For bodies with a large common velocity, differences of speeds would only contain
    rounding errors. In this case FREE_SPEEDS is zero, and TARGET contains the velocities of the
    rows.
    """
    data = opened(scene)
    blocks_i, blocks_f, space = data.blocks.blocks_i, data.blocks.blocks_f, data.space
    islands = contacts_at(data.links.contacts).islands
    y, slots, vectors = space.y, space.slots, space.vectors
    carried = 0.0
    size = 0.0
    for j in range(islands.first[n], islands.first[n + 1]):
        i = islands.blocks[j]
        r = first_of(slots, i)
        for s in range(joints_of(slots, i)):
            k = joint_of(slots, i, s)
            vectors[FREE_SPEEDS, k] = vectors[SPEEDS, k]
        rate = rows_of(vectors[RHS], r, size_of(blocks_i, i))
        along = gather(y, slots, i, vectors[SPEEDS])
        for c in range(size_of(blocks_i, i)):
            vectors[TARGET, r + c] = rate[c] - along[c]
            size = max(size, abs(rate[c]), abs(vectors[BEFORE, r + c]))
        for s in range(joints_of(slots, i)):
            k = joint_of(slots, i, s)
            x = load(y, i, 3 * s)
            carried = max(carried, abs(vectors[SPEEDS, k]) * math.sqrt(dot(x, x)))
    together = carried > MOVES_TOGETHER * size
    for j in range(islands.first[n], islands.first[n + 1]):
        i = islands.blocks[j]
        r = first_of(slots, i)
        kind = type_of(blocks_i, i)
        unilateral = one_sided(kind)
        for c in range(size_of(blocks_i, i)):
            if together:
                vectors[TARGET, r + c] = vectors[RHS, r + c]
            elif unilateral:
                vectors[TARGET, r + c] = blocks_f[i, at.SURFACE + c] + vectors[TURNED, r + c]
        if together:
            for s in range(joints_of(slots, i)):
                vectors[FREE_SPEEDS, joint_of(slots, i, s)] = 0.0
        if unilateral:
            vectors[TARGET, r] += rebound(data, i, blocks_f[i, at.BOUNCE], vectors[BEFORE, r])
            vectors[TARGET, r] += slack_of(blocks_i, blocks_f, i)


@sweep
def note_missed(scene, n):
    """Write the complementarity and friction cone residuals of island n [N s] into `pushed`.

    Normal impulses are compared with the values that stop or release them, and friction with the
    disc μ λ_n.
    """
    data = opened(scene)
    blocks_i, blocks_f, space = data.blocks.blocks_i, data.blocks.blocks_f, data.space
    islands = contacts_at(data.links.contacts).islands
    slots, vectors, own = space.slots, space.vectors, space.own
    for j in range(islands.first[n], islands.first[n + 1]):
        i = islands.blocks[j]
        kind, size = type_of(blocks_i, i), size_of(blocks_i, i)
        islands.pushed[i, 0] = 0.0
        islands.pushed[i, 1] = 0.0
        if one_sided(kind):
            lam = rows_of(vectors[LAMBDA], first_of(slots, i), size)
            u = velocity(data, i, vectors[JOINT_SPEEDS])
            if own[i, 0] > 0.0:
                islands.pushed[i, 0] = abs(lam[0] - max(lam[0] - u[0] / own[i, 0], 0.0))
            mobility = max(own[i, 4], own[i, 8])
            if size == 3 and mobility > 0.0:
                x, y = lam[1] - u[1] / mobility, lam[2] - u[2] / mobility
                rim = blocks_f[i, at.FRICTION] * max(lam[0], 0.0)
                pull = math.sqrt(x * x + y * y)
                fit = rim / pull if pull > rim else 1.0
                islands.pushed[i, 1] = math.sqrt((lam[1] - fit * x) ** 2 + (lam[2] - fit * y) ** 2)


@sweep
def solve_island(scene, n, still, last):
    """Solve for λ of one island, and write the resulting speeds w into JOINT_SPEEDS.

    A velocity of at most `still` moves nothing by more than the rounding of its position in a step.
    Returns (residual over the largest velocity of the island, or infinity if no velocities satisfy
    its rows, this velocity).
    """
    report = opened(scene).space.vectors[REPORT]
    size = largest_velocity(scene, n)
    if size <= still:
        drop(scene, n)
        return 0.0, size
    contacts = contacts_at(opened(scene).links.contacts)
    fine, tally = contacts.tally[0].fine, contacts.tally[0]
    weigh(scene, n)
    room, small = order_island(scene, n)
    tolerance = fine * (TOLERANCE if small else HEAP_TOLERANCE)
    alone = sweeps_suffice(scene, n)
    left = math.inf if alone else stays(scene, n, size)
    solved = left < math.inf
    if not solved and (alone or not small):
        left = gauss_seidel(scene, n, size, FEW_SWEEPS if small else SWEEPS, tolerance)
    if not solved and room and left > (tolerance if small else NOTABLE):
        left, taken = solve_exact(scene, n, size, last)
        report[STEPS_DONE] += taken
    elif left > NOTABLE:
        left = gauss_seidel(scene, n, size, MOST_SWEEPS, NOTABLE)
    doubted = room and (left > NOTABLE or strain(scene, n) > NOTABLE * size)
    if doubted and barred(scene, n, size):
        left = math.inf
    if small and not alone and left <= NOTABLE and tally.share == 0.0 and tally.loose == 0:
        note_loose(scene, n, size)
    return left, size


@sweep
def leaves_alone(scene, n, slack):
    """Check whether an impact in another island does not affect island n, with no residual above
    `slack` [m/s].

    The velocities of bodies at rest are rounding errors, so convergence relative to them is
    impossible.
    """
    data = opened(scene)
    blocks_i, vectors = data.blocks.blocks_i, data.space.vectors
    islands = contacts_at(data.links.contacts).islands
    alone = slack > 0.0
    for j in range(islands.first[n], islands.first[n + 1]):
        i = islands.blocks[j]
        r, kind = first_of(data.space.slots, i), type_of(blocks_i, i)
        if one_sided(kind):
            alone = alone and vectors[RHS, r] >= -slack
        elif kind != at.T_TURN:
            for c in range(size_of(blocks_i, i)):
                alone = alone and abs(vectors[RHS, r + c]) <= slack
    return alone


@sweep
def drop(scene, n):
    """Set the impulses of island n to zero."""
    drop_impulses(scene, n)
    joint_speeds(scene, n)


@sweep
def largest_velocity(scene, n):
    """Find the largest velocity of island n's rows, without impulses or before the impact."""
    data = opened(scene)
    islands = contacts_at(data.links.contacts).islands
    vectors = data.space.vectors
    size = 0.0
    for j in range(islands.first[n], islands.first[n + 1]):
        i = islands.blocks[j]
        r = first_of(data.space.slots, i)
        for c in range(size_of(data.blocks.blocks_i, i)):
            size = max(size, abs(vectors[RHS, r + c]), abs(vectors[BEFORE, r + c]))
    return size


# -- energy ---------------------------------------------------------------------------------------


@part
def gain_of(vectors, r, after, aimed):
    """Return the energy that the impulse of row r adds [J], λ (u⁻ + u⁺) / 2.

    `after` is u⁺ plus what its law aims at.
    """
    return vectors[LAMBDA, r] * (0.5 * (vectors[BEFORE, r] + after - aimed))


@part
def rebound(data, i, restitution, before):
    """Return by how much a restitution lets gap i close after a speed `before`, negative if it must
    open.

    In an impact, a gap that opens by less than its tolerated depth in a step belongs to a point at
    rest, with the error of the step. It follows the same law as a gap that closes. The speeds of
    the corners of a face are then those of a plane after the impact, as before it. Otherwise one of
    them would be without an impulse, depending on this error.
    """
    strikes = contacts_at(data.links.contacts).tally[0].share == 0.0
    rests = max(data.blocks.blocks_f[i, at.ROOM], 0.0) if strikes else 0.0
    return restitution * min(before, rests)


@sweep
def gained(scene, n):
    """Compute (energy added by island n's unilateral impulses [J], energy that they exchange).

    An impulse λ adds λ (u⁻ + u⁺) / 2. Here u⁺ contains neither the bounce nor the slack of TARGET.
    """
    data = opened(scene)
    blocks_i, blocks_f, space = data.blocks.blocks_i, data.blocks.blocks_f, data.space
    islands = contacts_at(data.links.contacts).islands
    slots, vectors = space.slots, space.vectors
    gain = 0.0
    size = 0.0
    for j in range(islands.first[n], islands.first[n + 1]):
        i = islands.blocks[j]
        kind = type_of(blocks_i, i)
        if one_sided(kind) or dry(kind):
            r = first_of(slots, i)
            after = velocity(data, i, vectors[JOINT_SPEEDS])
            back = rebound(data, i, blocks_f[i, at.BOUNCE], vectors[BEFORE, r])
            back += slack_of(blocks_i, blocks_f, i)
            for c in range(size_of(blocks_i, i)):
                gain += gain_of(vectors, r + c, after[c], back if c == 0 else 0.0)
                lam = vectors[LAMBDA, r + c]
                size += abs(lam) * max(abs(vectors[RHS, r + c]), abs(vectors[BEFORE, r + c]))
    return gain, size


@part
def bounces(scene, n):
    """Check whether a contact in island n bounces despite the forces of the step."""
    data = opened(scene)
    blocks, space = data.blocks, data.space
    islands = contacts_at(data.links.contacts).islands
    vectors = space.vectors
    found = False
    for j in range(islands.first[n], islands.first[n + 1]):
        i = islands.blocks[j]
        r = first_of(space.slots, i)
        pressed = abs(vectors[RHS, r] - vectors[BEFORE, r])
        bouncing = blocks.blocks_f[i, at.BOUNCE] > 0.0
        found = found or (bouncing and -vectors[BEFORE, r] > 4.0 * pressed)
    return found
