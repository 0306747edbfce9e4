"""Impulses of one instant: bilateral rows, limits and contacts with friction in one solve.

With u = Ω λ + b of the rows, b their velocities without impulses, a limit asks 0 ≤ λ ⊥ u ≥ 0,
and a contact (normal first, then two tangents) u_n + e u_n⁻ ⊥ λ_n on Signorini's side and λ_t in
Coulomb's disc of radius μ λ_n against the slip ([Moreau 1988], [Jean 1999]). Solved block by block
in the joints (block Gauss-Seidel on Y), which needs no Ω; where that stalls, or loops are to be
kept with it, by ADMM with one factor of Ω + ρI ([Carpentier et al. 2024]).
"""

import math

from .. import layout as at
from ..arrays import BEFORE, CHANGE, DINV, DUAL, LAMBDA, REPORT, RHS, SPLIT, STEP, opened
from ..compiler.jit import part, sweep
from ..compiler.lane import load_triple, numbers, store_triple, triple
from ..constraints.constraints import couplings
from ..constraints.proximal import (
    eliminate,
    load_factor3,
    solve_factor,
    store_factor3,
    whole_blocks,
)
from ..linear import factor3
from ..vec import add_scaled, dot, load

TOLERANCE = 1e-10  # of the largest velocity among the rows
CROWD = 1e-6  # where there is no fallback: a heap's forces wander more than that anyhow
SWEEPS = 200  # of Gauss-Seidel where there is no fallback
FEW_SWEEPS = 40  # where there is one
SOLID = 1e-10  # relative, squared: what moves less across a contact is taken as fixed
INNER = 8  # rounds between normal and friction of one contact
ROUNDS = 20000  # of ADMM; a stack of four at 1 : 10 each takes thousands in its first steps
DENSE = 150  # rows, above which there is no Ω to fall back on


@sweep
def solve_impulses(scene, m, first):
    """λ of all active rows into LAMBDA, from b in RHS; λ given there is where it starts.

    What they do to the joints goes into STEP; into REPORT sweeps and rounds taken, and the largest
    velocity by which a law is missed, relative to the largest in b. Active blocks from the `first`
    on are unilateral.
    """
    data = opened(scene)
    blocks, space = data.blocks, data.space
    active = blocks.active
    y, slots, own, report = space.y, space.slots, space.own, space.vectors[REPORT]
    for j in range(1, active[0] + 1):
        own_block(y, slots, space.vectors[DINV], active[j], own)
    size = largest_velocity(space.vectors, m)
    report[0] = 0.0
    report[1] = 0.0
    report[2] = 0.0
    if size == 0.0:
        for r in range(m):
            space.vectors[LAMBDA, r] = 0.0
        responses(scene)
        return
    few = m <= DENSE
    whole = few and first > 1
    if not whole:
        sweeps, tolerance = (FEW_SWEEPS, TOLERANCE) if few else (SWEEPS, CROWD)
        report[2] = gauss_seidel(scene, first, size, sweeps, tolerance)
    if whole or (few and report[2] > TOLERANCE):
        couplings(blocks, space)
        report[2] = alternate(scene, m, first, size)
        responses(scene)


@sweep
def largest_velocity(vectors, m):
    """Largest magnitude in b, and in the velocities before."""
    size = 0.0
    for r in range(m):
        size = max(size, abs(vectors[RHS, r]), abs(vectors[BEFORE, r]))
    return size


@part
def own_block(y, slots, dinv, i, own):
    """The block's part of Ω, nine numbers, from its rows of Y."""
    u = triple(0.0, 0.0, 0.0)
    v, w = u, u
    for s in range(slots[i, at.SLOTS]):
        z = dinv[slots[i, at.SLOT + s]] * load_triple(y, i, 3 * s)
        u = u + y[i, 3 * s] * z
        v = v + y[i, 3 * s + 1] * z
        w = w + y[i, 3 * s + 2] * z
    store_triple(own, i, 0, u)
    store_triple(own, i, 3, v)
    store_triple(own, i, 6, w)


@part
def gather(y, slots, i, z):
    """Y z of a block: what joints' responses z give its rows."""
    u = triple(0.0, 0.0, 0.0)
    for s in range(slots[i, at.SLOTS]):
        u = u + z[slots[i, at.SLOT + s]] * load_triple(y, i, 3 * s)
    return numbers(u)


@part
def scatter(y, slots, dinv, i, change, z):
    """z += diag(1/d) Yᵀ of a block's change in λ."""
    for s in range(slots[i, at.SLOTS]):
        k = slots[i, at.SLOT + s]
        z[k] += dinv[k] * dot(load(y, i, 3 * s), change)


@part
def rows_of(x, r, size):
    """Up to three entries of x from r on, zero where a block has fewer."""
    return (x[r], x[r + 1] if size > 1 else 0.0, x[r + 2] if size > 2 else 0.0)


@sweep
def responses(scene):
    """STEP = diag(1/d) Yᵀ λ of the active blocks."""
    data = opened(scene)
    blocks, space = data.blocks, data.space
    blocks_i, active = blocks.blocks_i, blocks.active
    y, slots, vectors = space.y, space.slots, space.vectors
    z = vectors[STEP]
    for k in range(z.shape[0]):
        z[k] = 0.0
    for j in range(1, active[0] + 1):
        i = active[j]
        lam = rows_of(vectors[LAMBDA], slots[i, at.FIRST], blocks_i[i, at.B_SIZE])
        scatter(y, slots, vectors[DINV], i, lam, z)


@sweep
def gauss_seidel(scene, first, size, sweeps, tolerance):
    """Sweeps over the blocks until no velocity changes; the last change over `size`."""
    data = opened(scene)
    blocks, space = data.blocks, data.space
    blocks_i, blocks_f, active = blocks.blocks_i, blocks.blocks_f, blocks.active
    y, slots, vectors, own = space.y, space.slots, space.vectors, space.own
    rhs = vectors[RHS]
    lam = vectors[LAMBDA]
    dinv = vectors[DINV]
    z = vectors[STEP]
    responses(scene)
    change = 0.0
    for taken in range(1, sweeps + 1):
        change = 0.0
        for j in range(1, active[0] + 1):
            i = active[j]
            r = slots[i, at.FIRST]
            n = blocks_i[i, at.B_SIZE]
            u = add_scaled(gather(y, slots, i, z), 1.0, rows_of(rhs, r, n))
            old = rows_of(lam, r, n)
            new = answer(blocks_i, blocks_f, i, own, u, old, vectors[BEFORE, r], j < first)
            step = add_scaled(new, -1.0, old)
            scatter(y, slots, dinv, i, step, z)
            for c in range(n):
                lam[r + c] = new[c]
                change = max(change, abs(step[c]) * own[i, 4 * c])
        vectors[REPORT, 0] = taken
        if not change > tolerance * size:
            break
    return change / size


@part
def answer(blocks_i, blocks_f, i, own, u, old, before, bilateral):
    """λ of one block that fits its law while the others stay; u is the velocity with `old`."""
    if bilateral:
        return held(own, i, u, old)
    back = blocks_f[i, at.BOUNCE] * min(before, 0.0)
    if blocks_i[i, at.B_SIZE] == 1:
        return (pushed(own[i, 0], u[0] + back, old[0]), 0.0, 0.0)
    return contact(own, i, u, old, back, blocks_f[i, at.FRICTION])


@part
def pushed(w, u, old):
    """λ ≥ 0 of one row that ends its approach."""
    return max(0.0, old - u / w) if w > 0.0 else 0.0


@part
def held(own, i, u, old):
    """λ of bilateral rows, one after the other."""
    x = -u[0] / own[i, 0] if own[i, 0] > 0.0 else 0.0
    y = -(u[1] + own[i, 3] * x) / own[i, 4] if own[i, 4] > 0.0 else 0.0
    z = -(u[2] + own[i, 6] * x + own[i, 7] * y) / own[i, 8] if own[i, 8] > 0.0 else 0.0
    return (old[0] + x, old[1] + y, old[2] + z)


@part
def contact(own, i, u, old, back, mu):
    """λ of one contact: what holds it, or normal and friction in turn, each exactly."""
    n = old[0]
    t = (old[1], old[2])
    free_n = u[0] + back - own[i, 0] * n - own[i, 1] * t[0] - own[i, 2] * t[1]
    free_x = u[1] - own[i, 3] * n - own[i, 4] * t[0] - own[i, 5] * t[1]
    free_y = u[2] - own[i, 6] * n - own[i, 7] * t[0] - own[i, 8] * t[1]
    if not own[i, 0] > 0.0:
        return (0.0, 0.0, 0.0)
    hold = stuck(own, i, free_n, free_x, free_y)
    slide = sliding(own, i, free_n, free_x, free_y, mu)
    if hold[0] > 0.0 and math.sqrt(hold[1] ** 2 + hold[2] ** 2) <= mu * hold[0]:
        return slide if 0.0 < slide[0] < hold[0] else hold
    if slide[0] > 0.0:
        return slide
    for _ in range(INNER):
        last = n
        n = max(0.0, -(free_n + own[i, 1] * t[0] + own[i, 2] * t[1]) / own[i, 0])
        held = t
        t = in_disc(
            own[i, 4], own[i, 5], own[i, 8], free_x + own[i, 3] * n, free_y + own[i, 6] * n, mu * n
        )
        moved = abs(n - last) + abs(t[0] - held[0]) + abs(t[1] - held[1])
        if moved <= 1e-15 * n:
            break
    return (n, t[0], t[1])


@part
def stuck(own, i, free_n, free_x, free_y):
    """λ that leaves a contact at rest; none where a direction cannot move."""
    w = 1.0 / own[i, 0]
    p = w * own[i, 3]
    q = w * own[i, 6]
    a = own[i, 4] - p * own[i, 1]
    b = own[i, 5] - p * own[i, 2]
    c = own[i, 8] - q * own[i, 2]
    det = a * c - b * b
    if not det > SOLID * (own[i, 4] + own[i, 8]) ** 2:
        return (0.0, 0.0, 0.0)
    x = free_x - p * free_n
    y = free_y - q * free_n
    d = 1.0 / det
    t = (d * (b * y - c * x), d * (b * x - a * y))
    return (-w * (free_n + own[i, 1] * t[0] + own[i, 2] * t[1]), t[0], t[1])


@part
def sliding(own, i, free_n, free_x, free_y, mu):
    """λ with which a contact slides on; none where it would stop.

    Where a body leans into its slip and friction is large, finding the normal and the friction
    impulse in turn goes round in a cycle, and the contact might also be stopped at once: the
    smaller of two impulses is the regular one.
    """
    x, y = free_x, free_y
    size = math.sqrt(x * x + y * y)
    if not (size > 0.0 and free_n < 0.0):
        return (0.0, 0.0, 0.0)
    start_x, start_y = x / size, y / size
    way_x, way_y = start_x, start_y
    for _ in range(INNER):
        pull = own[i, 0] - mu * (own[i, 1] * way_x + own[i, 2] * way_y)
        if not pull > 0.0:
            return (0.0, 0.0, 0.0)
        n = -free_n / pull
        drag = mu * n
        x = free_x + own[i, 3] * n - drag * (own[i, 4] * way_x + own[i, 5] * way_y)
        y = free_y + own[i, 6] * n - drag * (own[i, 7] * way_x + own[i, 8] * way_y)
        size = math.sqrt(x * x + y * y)
        if not x * start_x + y * start_y > 0.0:
            return (0.0, 0.0, 0.0)
        turned = abs(x / size - way_x) + abs(y / size - way_y)
        way_x, way_y = x / size, y / size
        if turned <= 1e-14:
            return (n, -drag * way_x, -drag * way_y)
    return (0.0, 0.0, 0.0)


@part
def in_disc(a, b, c, x, y, radius):
    """Least ½ tᵀ[a b; b c]t + (x, y)·t in a disc: no slip inside, against the slip on its rim."""
    pull = math.sqrt(x * x + y * y)
    if not (radius > 0.0 and pull > 0.0 and a + c > 0.0):
        return (0.0, 0.0)
    slack = 1e-12 * (a + c)  # a direction in which nothing can move
    a += slack
    c += slack
    det = a * c - b * b
    t = ((b * y - c * x) / det, (b * x - a * y) / det)
    if t[0] * t[0] + t[1] * t[1] <= radius * radius:
        return t
    s = max(0.0, pull / radius - max(a, c) - abs(b))  # below the root: Newton goes up to it
    for _ in range(30):
        p = a + s
        q = c + s
        det = p * q - b * b
        tx = (b * y - q * x) / det
        ty = (b * x - p * y) / det
        size = math.sqrt(tx * tx + ty * ty)
        slope = (tx * (q * tx - b * ty) + ty * (p * ty - b * tx)) / det
        step = (size / radius - 1.0) * size * size / slope
        s += step
        if abs(step) <= 1e-15 * (s + a + c):
            break
    p = a + s
    q = c + s
    det = p * q - b * b
    tx = (b * y - q * x) / det
    ty = (b * x - p * y) / det
    fit = radius / math.sqrt(tx * tx + ty * ty)
    return (tx * fit, ty * fit)


@sweep
def alternate(scene, m, first, size):
    """ADMM on Ω, all rows at once; what is left of the laws over `size`."""
    space = opened(scene).space
    omega, vectors = space.omega, space.vectors
    x = vectors[LAMBDA]
    y = vectors[DUAL]
    z = vectors[SPLIT]
    trace = 0.0
    for r in range(m):
        trace += omega[r, r]
        z[r] = x[r]
        y[r] = vectors[RHS, r]
        for c in range(m):
            y[r] += omega[r, c] * x[c]
    rho = 0.1 * trace / m
    eta = 1e-9 * trace / m
    shifted_factor(omega, space.factor, rho + eta, m)
    left = math.inf
    look = 8
    for taken in range(1, ROUNDS + 1):
        target(scene, first, m)
        for r in range(m):
            vectors[CHANGE, r] = eta * x[r] + rho * z[r] + y[r] - vectors[CHANGE, r]
        for r in range(m, whole_blocks(m)):
            vectors[CHANGE, r] = 0.0
        solve_factor(space.factor, vectors[CHANGE], m)
        for r in range(m):
            x[r] = vectors[CHANGE, r]
            vectors[STEP, r] = z[r]
            z[r] = x[r] - y[r] / rho
        onto_cones(scene, first)
        primal = 0.0
        dual = 0.0
        for r in range(m):
            y[r] -= rho * (x[r] - z[r])
            primal = max(primal, abs(x[r] - z[r]) * omega[r, r])
            dual = max(dual, rho * abs(z[r] - vectors[STEP, r]))
        left = max(primal, dual) / size
        vectors[REPORT, 1] = taken
        if left <= TOLERANCE:
            break
        if taken == look:  # ever more seldom, or ρ may swing for ever
            look = taken + taken // 2
            factor = math.sqrt((primal + 1e-300) / (dual + 1e-300))
            if factor > 5.0 or factor < 0.2:
                rho *= min(max(factor, 0.05), 20.0)
                shifted_factor(omega, space.factor, rho + eta, m)
    for r in range(m):
        x[r] = z[r]
    return left


@sweep
def target(scene, first, m):
    """b with the bounce of normals, and with μ |u_t| that makes Coulomb's cone its own dual's."""
    data = opened(scene)
    blocks, space = data.blocks, data.space
    blocks_i, blocks_f, active = blocks.blocks_i, blocks.blocks_f, blocks.active
    slots, vectors = space.slots, space.vectors
    out = vectors[CHANGE]
    for r in range(m):
        out[r] = vectors[RHS, r]
    for j in range(first, active[0] + 1):
        i = active[j]
        r = slots[i, at.FIRST]
        out[r] += blocks_f[i, at.BOUNCE] * min(vectors[BEFORE, r], 0.0)
        if blocks_i[i, at.B_SIZE] == 3:
            slip = math.sqrt(vectors[DUAL, r + 1] ** 2 + vectors[DUAL, r + 2] ** 2)
            out[r] += blocks_f[i, at.FRICTION] * slip


@sweep
def onto_cones(scene, first):
    """Nearest SPLIT that every unilateral law admits."""
    data = opened(scene)
    blocks, space = data.blocks, data.space
    blocks_i, blocks_f, active = blocks.blocks_i, blocks.blocks_f, blocks.active
    slots, z = space.slots, space.vectors[SPLIT]
    for j in range(first, active[0] + 1):
        i = active[j]
        r = slots[i, at.FIRST]
        if blocks_i[i, at.B_SIZE] == 1:
            z[r] = max(z[r], 0.0)
            continue
        mu = blocks_f[i, at.FRICTION]
        n = z[r]
        t = math.sqrt(z[r + 1] ** 2 + z[r + 2] ** 2)
        if t <= mu * n:
            continue
        n = max((n + mu * t) / (1.0 + mu * mu), 0.0)
        shrink = mu * n / t if t > 0.0 else 0.0
        z[r] = n
        z[r + 1] *= shrink
        z[r + 2] *= shrink


@sweep
def shifted_factor(omega, factor, shift, m):
    """The factor of Ω + shift I as `solve_factor` takes it."""
    end = whole_blocks(m)
    for r in range(end):
        for c in range(end):
            factor[r, c] = omega[r, c] if r < m and c < m else 0.0
        factor[r, r] += shift if r < m else 1.0
    for i in range(0, end, 3):
        f = factor3(load_factor3(factor, i))
        store_factor3(factor, i, f)
        for j in range(i + 3, end, 3):
            eliminate(factor, f, i, j, end)


@sweep
def gained(scene, first):
    """(kinetic energy that the unilateral impulses add [J], the sum of what they turn over).

    After `responses`.
    """
    data = opened(scene)
    blocks, space = data.blocks, data.space
    blocks_i, active = blocks.blocks_i, blocks.active
    y, slots, vectors = space.y, space.slots, space.vectors
    gain = 0.0
    size = 0.0
    for j in range(first, active[0] + 1):
        i = active[j]
        r = slots[i, at.FIRST]
        after = gather(y, slots, i, vectors[STEP])
        for c in range(blocks_i[i, at.B_SIZE]):
            mean = 0.5 * (vectors[BEFORE, r + c] + vectors[RHS, r + c] + after[c])
            lam = vectors[LAMBDA, r + c]
            gain += lam * mean
            size += abs(lam) * max(abs(vectors[RHS, r + c]), abs(vectors[BEFORE, r + c]))
    return gain, size
