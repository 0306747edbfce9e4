"""Contact laws of one island by Newton's method: a convex form of them, then the laws themselves.

Unknown are the speeds w behind the articulated factors, in which inertia is diag(d) and a block's
velocity is u = Y w + g. Impulses follow from w as λ = P(λ₀ - ρ u), P the nearest that the law
admits, and w from the balance

    d (w - w₀) = Σ Yᵀ P(λ₀ - ρ (Y w + g)),

which Newton's method solves with the tangent diag(d) + Σ Yᵀ ρ P' Y. Then λ₀ becomes λ: the method
of multipliers, whose limit fulfils the law whatever the weight ρ > 0, and which among redundant
impulses keeps those of least norm if it starts from such ([Rockafellar 1976]).

Two projections serve. That onto Coulomb's cone makes the balance the gradient of a convex function,
with one minimum that a line search always finds; its sliding contacts part a little, as in
[Anitescu 2006]. [Alart & Curnier 1991] project the normal impulse onto its half line and friction
onto the disc μ λ_n: Coulomb's law itself, with a tangent that is not symmetric, and no promise from
afar. So the first gives the start for the second.
"""

import math

from .. import layout as at
from ..arrays import BEST, CHANGE, DINV, FREE, LAMBDA, RESIDUAL, STEP, TARGET, TRIAL, opened
from ..compiler.jit import part, sweep
from ..compiler.lane import load_triple, numbers, triple
from ..constraints.blocks import first_of, joint_of, joints_of, size_of, type_of
from ..vec import add_scaled, dot, load
from .contacts import contacts_at

CONVEX, EXACT = 0, 1
SHORTEST = 0.02  # part of a step: a shorter one leads nowhere
ARMIJO = 1e-4
SETTLED = 0.1  # of the tolerance: how well the balance is met
ROUNDING = 1e-14  # of the energy
GRAIN = 4e-15  # of the impulses: what is missed by less is rounding
STEPS = 30  # of Newton between two updates of λ₀


@part
def rows_of(x, r, size):
    """Up to three entries of x from r on, zero where a block has fewer."""
    return (x[r], x[r + 1] if size > 1 else 0.0, x[r + 2] if size > 2 else 0.0)


@part
def gather(y, slots, i, z):
    """Y z of a block: what joints' responses z give its rows."""
    u = triple(0.0, 0.0, 0.0)
    for s in range(joints_of(slots, i)):
        u = u + z[joint_of(slots, i, s)] * load_triple(y, i, 3 * s)
    return numbers(u)


@part
def scatter(y, slots, i, change, z):
    """z += Yᵀ of a block's change in λ."""
    for s in range(joints_of(slots, i)):
        z[joint_of(slots, i, s)] += dot(load(y, i, 3 * s), change)


@part
def velocity(data, i, w):
    """u of a block at the speeds w."""
    space = data.space
    n = size_of(data.blocks.blocks_i, i)
    u = gather(space.y, space.slots, i, w)
    return add_scaled(u, 1.0, rows_of(space.vectors[TARGET], first_of(space.slots, i), n))


@part
def bounds_of(blocks_f, i):
    return blocks_f[i, at.FRICTION], blocks_f[i, at.VALUE]


@part
def admitted(exact, kind, size, z, mu, most):
    """(the nearest impulse to z that the law admits, its derivative row by row).

    `mu` and `most` are a block's FRICTION and VALUE: the bounds of a torque about the normal and
    across it.
    """
    if kind == at.T_TURN:
        return turning(z, mu, most)
    if kind != at.T_CONTACT and kind != at.T_LIMIT:
        return z, diagonal(1.0, 1.0 if size > 1 else 0.0, 1.0 if size > 2 else 0.0)
    if size == 1:
        on = 1.0 if z[0] > 0.0 else 0.0
        return (on * z[0], 0.0, 0.0), diagonal(on, 0.0, 0.0)
    pull = math.sqrt(z[1] * z[1] + z[2] * z[2])
    if z[0] > 0.0 and mu > 0.0 and pull <= mu * z[0]:
        return z, diagonal(1.0, 1.0, 1.0)
    x = z[1] / pull if pull > 0.0 else 0.0
    y = z[2] / pull if pull > 0.0 else 0.0
    if exact == EXACT:
        if not z[0] > 0.0:
            return (0.0, 0.0, 0.0), diagonal(0.0, 0.0, 0.0)
        rim = mu * z[0]
        a = rim / pull if pull > 0.0 else 0.0
        slope = (1.0, 0.0, 0.0, mu * x, a * y * y, -a * x * y, mu * y, -a * x * y, a * x * x)
        return (z[0], rim * x, rim * y), slope
    if not z[0] + mu * pull > 0.0:
        return (0.0, 0.0, 0.0), diagonal(0.0, 0.0, 0.0)
    b = 1.0 / (1.0 + mu * mu)
    n = (z[0] + mu * pull) * b
    rim = mu * n
    a = rim / pull if pull > 0.0 else 0.0
    c = mu * mu * b
    across = (c - a) * x * y
    slope = (
        b, b * mu * x, b * mu * y,
        b * mu * x, c * x * x + a * y * y, across,
        b * mu * y, across, c * y * y + a * x * x,
    )  # fmt: skip
    return (n, rim * x, rim * y), slope


@part
def turning(z, spinning, rolling):
    """`admitted` of torques: a segment about the normal, a disc across it."""
    spin = min(max(z[0], -spinning), spinning)
    free = 1.0 if spin == z[0] else 0.0
    pull = math.sqrt(z[1] * z[1] + z[2] * z[2])
    if pull <= rolling:
        return (spin, z[1], z[2]), diagonal(free, 1.0, 1.0)
    x, y, a = z[1] / pull, z[2] / pull, rolling / pull
    slope = (free, 0.0, 0.0, 0.0, a * y * y, -a * x * y, 0.0, -a * x * y, a * x * x)
    return (spin, rolling * x, rolling * y), slope


@part
def diagonal(a, b, c):
    return (a, 0.0, 0.0, 0.0, b, 0.0, 0.0, 0.0, c)


@sweep
def balance(scene, n, exact, row):
    """d (w - w₀) - Yᵀ P into RESIDUAL for w in a row of `vectors`; its size, and the energy.

    The size is in the metric of d, what is rounding taken off; the energy [J] is what the convex
    form minimises.
    """
    data = opened(scene)
    blocks_i, blocks_f, space = data.blocks.blocks_i, data.blocks.blocks_f, data.space
    islands = contacts_at(data.links.contacts).islands
    vectors, slots = space.vectors, space.slots
    w, free, dinv = vectors[row], vectors[FREE], vectors[DINV]
    left = vectors[RESIDUAL]
    count = islands.size[0]
    energy = 0.0
    pressed = 0.0
    for p in range(count):
        k = islands.freedoms[p]
        left[k] = (w[k] - free[k]) / dinv[k]
        energy += 0.5 * left[k] * (w[k] - free[k])
    for j in range(islands.first[n], islands.first[n + 1]):
        i = islands.blocks[j]
        size, kind = size_of(blocks_i, i), type_of(blocks_i, i)
        rho = islands.weight[i]
        before = rows_of(vectors[LAMBDA], first_of(slots, i), size)
        z = add_scaled(before, -rho, velocity(data, i, w))
        p, slope = admitted(exact, kind, size, z, blocks_f[i, at.FRICTION], blocks_f[i, at.VALUE])
        for c in range(3):
            islands.pushed[i, c] = p[c]
        for c in range(9):
            islands.slope[i, c] = slope[c]
        if p[0] != 0.0 or p[1] != 0.0 or p[2] != 0.0:
            scatter(space.y, slots, i, (-p[0], -p[1], -p[2]), left)
            energy += (dot(p, z) - 0.5 * dot(p, p)) / rho
            pressed += dot(p, p) * islands.mobility[i]
    norm = 0.0
    for p in range(count):
        k = islands.freedoms[p]
        norm += left[k] * left[k] * dinv[k]
    return max(math.sqrt(norm) - GRAIN * math.sqrt(pressed), 0.0), energy


@sweep
def tangent(scene, n, symmetric):
    """diag(d) + Σ Yᵀ ρ P' Y in the envelope: the upper part by rows, the lower one by columns."""
    data = opened(scene)
    space = data.space
    islands = contacts_at(data.links.contacts).islands
    y, slots, place, start = space.y, space.slots, islands.place, islands.start
    upper, lower, slope = islands.upper, islands.lower, islands.slope
    count = islands.size[0]
    for e in range(start[count]):
        upper[e] = 0.0
    if not symmetric:
        for e in range(start[count]):
            lower[e] = 0.0
    for p in range(count):
        upper[start[p]] = 1.0 / space.vectors[DINV, islands.freedoms[p]]
    for j in range(islands.first[n], islands.first[n + 1]):
        i = islands.blocks[j]
        if slope[i, 0] == 0.0 and slope[i, 4] == 0.0 and slope[i, 8] == 0.0:
            continue
        rho = islands.weight[i]
        first, second, third = load(slope, i, 0), load(slope, i, 3), load(slope, i, 6)
        for s in range(joints_of(slots, i)):
            a = load(y, i, 3 * s)
            x = rho * (a[0] * first[0] + a[1] * second[0] + a[2] * third[0])
            v = rho * (a[0] * first[1] + a[1] * second[1] + a[2] * third[1])
            z = rho * (a[0] * first[2] + a[1] * second[2] + a[2] * third[2])
            p = place[joint_of(slots, i, s)]
            begin = start[p] - p
            for r in range(joints_of(slots, i)):
                q = place[joint_of(slots, i, r)]
                if q >= p:
                    upper[begin + q] += x * y[i, 3 * r] + v * y[i, 3 * r + 1] + z * y[i, 3 * r + 2]
                elif not symmetric:
                    more = x * y[i, 3 * r] + v * y[i, 3 * r + 1] + z * y[i, 3 * r + 2]
                    lower[start[q] - q + p] += more


@sweep
def factor(upper, lower, start, last, count, symmetric):
    """L U in place, without pivoting; whether all pivots are positive.

    Of a symmetric matrix L is U over the pivots, and is not stored.
    """
    for p in range(count):
        s = start[p]
        if not upper[s] > 0.0:
            return False
        inverse = 1.0 / upper[s]
        width = last[p] - p
        if not symmetric:
            for k in range(1, width + 1):
                lower[s + k] *= inverse
        for k in range(1, width + 1):
            t = start[p + k] - k
            f = upper[s + k] * inverse if symmetric else lower[s + k]
            if f != 0.0:
                for c in range(k, width + 1):
                    upper[t + c] -= f * upper[s + c]
            f = upper[s + k]
            if not symmetric and f != 0.0:
                for c in range(k + 1, width + 1):
                    lower[t + c] -= f * lower[s + c]
    return True


@sweep
def substitute(upper, lower, start, last, count, symmetric, x):
    """Solve for x in its place, after `factor`."""
    for p in range(count):
        s = start[p]
        f = x[p] / upper[s] if symmetric else x[p]
        if f != 0.0:
            for k in range(1, last[p] - p + 1):
                x[p + k] -= (upper[s + k] if symmetric else lower[s + k]) * f
    for p in range(count - 1, -1, -1):
        s = start[p]
        y = x[p]
        for k in range(1, last[p] - p + 1):
            y -= upper[s + k] * x[p + k]
        x[p] = y / upper[s]


@part
def slides(scene, n):
    """Whether the tangent of the exact laws is not symmetric: some contact is on its rim."""
    data = opened(scene)
    islands = contacts_at(data.links.contacts).islands
    found = False
    for j in range(islands.first[n], islands.first[n + 1]):
        i = islands.blocks[j]
        found = found or islands.slope[i, 3] != islands.slope[i, 1]
        found = found or islands.slope[i, 6] != islands.slope[i, 2]
    return found


@sweep
def newton(scene, n, exact, enough):
    """Speeds in STEP that balance the impulses P(λ₀ - ρ u); (steps taken, whether they do).

    `enough` is the size of what may be left.
    """
    data = opened(scene)
    islands = contacts_at(data.links.contacts).islands
    vectors = data.space.vectors
    w, trial, change = vectors[STEP], vectors[TRIAL], vectors[CHANGE]
    upper, lower, start, last = islands.upper, islands.lower, islands.start, islands.last
    count = islands.size[0]
    left, energy = balance(scene, n, exact, STEP)
    for taken in range(1, STEPS + 1):
        symmetric = exact == CONVEX or not slides(scene, n)
        tangent(scene, n, symmetric)
        if not factor(upper, lower, start, last, count, symmetric):
            return taken, False
        descent = 0.0
        for p in range(count):
            change[p] = -vectors[RESIDUAL, islands.freedoms[p]]
        substitute(upper, lower, start, last, count, symmetric, change)
        for p in range(count):
            descent -= vectors[RESIDUAL, islands.freedoms[p]] * change[p]
        part_of_it = 1.0
        while True:
            for p in range(count):
                k = islands.freedoms[p]
                trial[k] = w[k] + part_of_it * change[p]
            new_left, new_energy = balance(scene, n, exact, TRIAL)
            fits = new_left <= (1.0 - ARMIJO * part_of_it) * left
            if exact == CONVEX:
                drop = ARMIJO * part_of_it * descent - ROUNDING * abs(energy)
                fits = new_energy <= energy - drop
            if fits or new_left <= enough or part_of_it < SHORTEST:
                break
            part_of_it *= 0.5
        if exact == EXACT and not fits and not new_left <= enough:
            balance(scene, n, exact, STEP)
            return taken, False
        for p in range(count):
            k = islands.freedoms[p]
            w[k] = trial[k]
        left = new_left
        energy = new_energy
        if left <= enough or (exact == CONVEX and descent <= ROUNDING * abs(energy)):
            return taken, True
    return STEPS, False


@sweep
def weigh(scene, n, size):
    """ρ of island n: `size` times what would stop a contact alone."""
    data = opened(scene)
    islands = contacts_at(data.links.contacts).islands
    own = data.space.own
    for j in range(islands.first[n], islands.first[n + 1]):
        i = islands.blocks[j]
        islands.mobility[i] = max(own[i, 0], max(own[i, 4], own[i, 8]))
        islands.weight[i] = size / islands.mobility[i]


@sweep
def take(scene, n):
    """λ₀ becomes the impulses of the last balance."""
    data = opened(scene)
    islands = contacts_at(data.links.contacts).islands
    lam = data.space.vectors[LAMBDA]
    for j in range(islands.first[n], islands.first[n + 1]):
        i = islands.blocks[j]
        r = first_of(data.space.slots, i)
        for c in range(size_of(data.blocks.blocks_i, i)):
            lam[r + c] = islands.pushed[i, c]


@sweep
def copy_impulses(scene, n, source, target):
    """λ of island n from one row of `vectors` to another."""
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
    """w = w₀ + diag(1/d) Yᵀ λ of island n into STEP."""
    data = opened(scene)
    islands = contacts_at(data.links.contacts).islands
    blocks_i, space = data.blocks.blocks_i, data.space
    slots, vectors = space.slots, space.vectors
    w, dinv = vectors[STEP], vectors[DINV]
    for j in range(islands.first[n], islands.first[n + 1]):
        i = islands.blocks[j]
        for s in range(joints_of(slots, i)):
            k = joint_of(slots, i, s)
            w[k] = vectors[FREE, k]
    for j in range(islands.first[n], islands.first[n + 1]):
        i = islands.blocks[j]
        lam = rows_of(vectors[LAMBDA], first_of(slots, i), size_of(blocks_i, i))
        for s in range(joints_of(slots, i)):
            k = joint_of(slots, i, s)
            w[k] += dinv[k] * dot(load(space.y, i, 3 * s), lam)


@sweep
def missed(scene, n, exact):
    """Largest velocity by which λ misses its law, after `respond`; blocks on their own."""
    data = opened(scene)
    islands = contacts_at(data.links.contacts).islands
    blocks_i, blocks_f, space = data.blocks.blocks_i, data.blocks.blocks_f, data.space
    slots, vectors, own = space.slots, space.vectors, space.own
    most = 0.0
    for j in range(islands.first[n], islands.first[n + 1]):
        i = islands.blocks[j]
        size, kind = size_of(blocks_i, i), type_of(blocks_i, i)
        lam = rows_of(vectors[LAMBDA], first_of(slots, i), size)
        mobility = max(own[i, 0], max(own[i, 4], own[i, 8]))
        z = add_scaled(lam, -1.0 / mobility, velocity(data, i, vectors[STEP]))
        p, _ = admitted(exact, kind, size, z, blocks_f[i, at.FRICTION], blocks_f[i, at.VALUE])
        grain = GRAIN * math.sqrt(dot(lam, lam))
        for c in range(size):
            most = max(most, mobility * (abs(lam[c] - p[c]) - grain))
    return most


BEGIN, GROWTH, HEAVIEST = 1e4, 10.0, 1e12  # weights ρ of the convex form
HELPS = 0.5  # a round of a large weight that leaves more of what was missed is the last
LARGE = 1e6
CLOSE = 1e-8  # of the velocities: where the exact laws take over


@sweep
def solve_convex(scene, n, size, unit, most):
    """λ of the convex form, from λ, to CLOSE of `size`; Newton's steps, about `most`.

    `unit` is the size of the balance that goes with a velocity of `size`.
    """
    weight = BEGIN
    steps = 0
    respond(scene, n)
    best = missed(scene, n, CONVEX)
    copy_impulses(scene, n, LAMBDA, BEST)
    while steps < most and best > CLOSE * size:
        weigh(scene, n, weight)
        taken, _ = newton(scene, n, CONVEX, SETTLED * CLOSE * unit)
        steps += taken
        take(scene, n)
        respond(scene, n)
        left = missed(scene, n, CONVEX)
        helped = left <= HELPS * best
        if left < best:
            best = left
            copy_impulses(scene, n, LAMBDA, BEST)
        if weight >= LARGE and not helped:
            break
        weight = min(GROWTH * weight, HEAVIEST)
    copy_impulses(scene, n, BEST, LAMBDA)
    respond(scene, n)
    return steps
