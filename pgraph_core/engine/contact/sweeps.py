"""Sweeps over the blocks of an island, each solved exactly with the others fixed.

A sweep (Gauss-Seidel) is a map λ → G(λ) whose fixed point is the solution. A heap can take hundreds
of sweeps. Between two sweeps of a large island, λ therefore becomes the combination of the last few
G(λ) for which the same combination of changes G(λ) - λ is smallest ([Anderson 1965],
[Walker & Ni 2011]). This reduces the number of sweeps.
"""

import math

from ...tolerances import EPS, ROUNDING
from .. import layout as at
from ..arrays import DINV, FREE_SPEEDS, JOINT_SPEEDS, LAMBDA, REPORT, SWEEPS_DONE, opened
from ..compiler.jit import part, sweep
from ..compiler.lane import load_triple, store_triple, triple
from ..constraints.blocks import first_of, joint_of, joints_of, one_sided, size_of, type_of
from ..records import columns
from ..vec import add_scaled, dot, load, store, sub
from .contacts import contacts_at
from .coulomb import contact
from .island_rows import rows_of, velocity
from .islands import NOWHERE
from .projections import bounds_of

COMBINED = 4  # sweeps that are combined
FEW_BLOCKS = 16  # blocks of one tree, as of feet: sweeps of no more converge by themselves
FEWEST = 3  # blocks between several trees of which the same holds
# Where the scratch of an island keeps them: columns of a block behind the nine of Newton's slope.
SWEPT = columns(slope=9, last=3, value=3, changes=3 * COMBINED, values=3 * COMBINED)
NORMAL_ROWS = 2 * COMBINED + 1  # rows behind those of blocks: products of changes, shares, a factor
WORSE = 4.0  # squared growth of changes after which the acceleration starts again


@part
def own_block(y, slots, dinv, i, own):
    """Compute a block's diagonal part of Ω, nine numbers, from its rows of Y."""
    u = triple(0.0, 0.0, 0.0)
    v, w = u, u
    for s in range(joints_of(slots, i)):
        z = dinv[joint_of(slots, i, s)] * load_triple(y, i, 3 * s)
        u = u + y[i, 3 * s] * z
        v = v + y[i, 3 * s + 1] * z
        w = w + y[i, 3 * s + 2] * z
    store_triple(own, i, 0, u)
    store_triple(own, i, 3, v)
    store_triple(own, i, 6, w)


@sweep
def gauss_seidel(scene, n, size, sweeps, tolerance):
    """Sweep over an island until the velocities converge. Returns the last change over `size`."""
    data = opened(scene)
    islands = contacts_at(data.links.contacts).islands
    one = islands.tree[joint_of(data.space.slots, islands.blocks[islands.first[n]], 0)]
    few = FEW_BLOCKS if islands.edge[one] == NOWHERE else FEWEST
    large = islands.first[n + 1] - islands.first[n] > few
    joint_speeds(scene, n)
    least = math.inf
    used = 0
    change = 0.0
    for k in range(sweeps):
        count = min(used + 1, COMBINED) if large else 0
        change, turned_over = sweep_once(scene, n, used % COMBINED, count)
        if not change > tolerance * size:
            break
        if turned_over > WORSE * least:
            used = 0
            least = turned_over
        elif k > 0:
            used += 1
        least = min(least, turned_over)
        if large and used > 0 and k + 1 < sweeps:
            move_on(scene, n, (used - 1) % COMBINED, count)
    return change / size


@sweep
def joint_speeds(scene, n):
    """Write w = w₀ + diag(1/d) Yᵀ λ of island n into JOINT_SPEEDS."""
    data = opened(scene)
    islands = contacts_at(data.links.contacts).islands
    y, slots, vectors = data.space.y, data.space.slots, data.space.vectors
    w, dinv = vectors[JOINT_SPEEDS], vectors[DINV]
    for j in range(islands.first[n], islands.first[n + 1]):
        i = islands.blocks[j]
        for s in range(joints_of(slots, i)):
            w[joint_of(slots, i, s)] = vectors[FREE_SPEEDS, joint_of(slots, i, s)]
    for j in range(islands.first[n], islands.first[n + 1]):
        i = islands.blocks[j]
        size = size_of(data.blocks.blocks_i, i)
        lam = rows_of(vectors[LAMBDA], first_of(slots, i), size)
        for s in range(joints_of(slots, i)):
            k = joint_of(slots, i, s)
            w[k] += dinv[k] * dot(load(y, i, 3 * s), lam)


@sweep
def sweep_once(scene, n, slot, count):
    """Sweep once. Returns (largest velocity change, energy of all changes).

    A history slot stores how much the change of λ and the resulting λ differ from those of the
    previous sweep. The following rows receive products of the changes in the first `count` slots
    with the changes of this slot and of the last sweep. If `count` is 0, no history is stored.
    """
    data = opened(scene)
    blocks_i, space = data.blocks.blocks_i, data.space
    islands = contacts_at(data.links.contacts).islands
    y, slots, vectors, own = space.y, space.slots, space.vectors, space.own
    lam, dinv, w = vectors[LAMBDA], vectors[DINV], vectors[JOINT_SPEEDS]
    past = islands.slope
    normal = past[past.shape[0] - NORMAL_ROWS :]
    share = normal[COMBINED]
    largest = 0.0
    energy = 0.0
    for p in range(count):
        normal[slot, p] = 0.0
        share[p] = 0.0
    for j in range(islands.first[n], islands.first[n + 1]):
        i = islands.blocks[j]
        r = first_of(slots, i)
        rows = size_of(blocks_i, i)
        old = rows_of(lam, r, rows)
        u = velocity(data, i, w)
        new = answer(type_of(blocks_i, i), rows, bounds_of(data, i), i, own, u, old)
        step = sub(new, old)
        for s in range(joints_of(slots, i)):
            k = joint_of(slots, i, s)
            w[k] += dinv[k] * dot(load(y, i, 3 * s), step)
        for c in range(rows):
            lam[r + c] = new[c]
            largest = max(largest, abs(step[c]) * own[i, 4 * c])
            energy += step[c] * step[c] * own[i, 4 * c]
        if count == 0:
            continue
        change = sub(step, load(past, i, SWEPT.last))
        store(past, i, SWEPT.changes + 3 * slot, change)
        store(past, i, SWEPT.values + 3 * slot, sub(new, load(past, i, SWEPT.value)))
        store(past, i, SWEPT.last, step)
        store(past, i, SWEPT.value, new)
        size = (own[i, 0], own[i, 4], own[i, 8])
        change, step = times(size, change), times(size, step)
        for p in range(count):
            other = load(past, i, SWEPT.changes + 3 * p)
            normal[slot, p] += dot(other, change)
            share[p] += dot(other, step)
    vectors[REPORT, SWEEPS_DONE] += 1.0
    return largest, energy


@sweep
def move_on(scene, n, slot, count):
    """Replace λ after a sweep by a combination with the last `count` ones, and update w
    accordingly.

    `slot` is the one that this sweep wrote.
    """
    data = opened(scene)
    blocks_i, space = data.blocks.blocks_i, data.space
    islands = contacts_at(data.links.contacts).islands
    y, slots, vectors = space.y, space.slots, space.vectors
    lam, dinv, w = vectors[LAMBDA], vectors[DINV], vectors[JOINT_SPEEDS]
    past = islands.slope
    normal = past[past.shape[0] - NORMAL_ROWS :]
    share = normal[COMBINED]
    for p in range(count):
        normal[p, slot] = normal[slot, p]
    if not combine(normal, count):
        return
    for j in range(islands.first[n], islands.first[n + 1]):
        i = islands.blocks[j]
        r = first_of(slots, i)
        step = (0.0, 0.0, 0.0)
        for p in range(count):
            step = add_scaled(step, -share[p], load(past, i, SWEPT.values + 3 * p))
        for c in range(size_of(blocks_i, i)):
            lam[r + c] += step[c]
        for s in range(joints_of(slots, i)):
            k = joint_of(slots, i, s)
            w[k] += dinv[k] * dot(load(y, i, 3 * s), step)


@sweep
def combine(normal, count):
    """Write the weights of the last `count` sweeps into row COMBINED, the right-hand side."""
    share = normal[COMBINED]
    begin = COMBINED + 1  # first row of the factor
    largest = 0.0
    for p in range(count):
        largest = max(largest, normal[p, p])
    for p in range(count):
        for q in range(count):
            normal[begin + p, q] = normal[p, q]
        normal[begin + p, p] += ROUNDING * largest  # regularisation for equal changes
    for p in range(count):
        pivot = normal[begin + p, p]
        if not pivot > 0.0:
            return False
        for q in range(p + 1, count):
            f = normal[begin + q, p] / pivot
            for c in range(p + 1, count):
                normal[begin + q, c] -= f * normal[begin + p, c]
            share[q] -= f * share[p]
    for p in range(count - 1, -1, -1):
        for c in range(p + 1, count):
            share[p] -= normal[begin + p, c] * share[c]
        share[p] /= normal[begin + p, p]
    return True


@part
def times(x, y):
    """Compute the element-wise product."""
    return x[0] * y[0], x[1] * y[1], x[2] * y[2]


@part
def answer(kind, rows, bounds, i, own, u, old):
    """Return λ of a block for fixed λ of the others, where u is the velocity for `old`."""
    if kind == at.T_TURN:
        return turned(own, i, u, old, bounds)
    if kind == at.T_FRICTION or kind == at.T_WRAP:
        free = old[0] - u[0] / own[i, 0] if own[i, 0] > 0.0 else 0.0
        least, most = (-bounds[0], bounds[0]) if kind == at.T_FRICTION else bounds
        return (min(max(free, least), most), 0.0, 0.0)
    if not one_sided(kind):
        return held(own, i, u, old)
    if rows == 1:
        return (pushed(own[i, 0], u[0], old[0]), 0.0, 0.0)
    return contact(own[i], u, old, bounds[0], 1.0)


@part
def turned(own, i, u, old, bounds):
    """Return λ for torques within bounds: about the normal, then across it."""
    if not (own[i, 0] > 0.0 and own[i, 4] + own[i, 8] > 0.0):
        return (0.0, 0.0, 0.0)
    spin = min(max(old[0] - u[0] / own[i, 0], -bounds[0]), bounds[0])
    x = u[1] + own[i, 3] * (spin - old[0]) - own[i, 4] * old[1] - own[i, 5] * old[2]
    y = u[2] + own[i, 6] * (spin - old[0]) - own[i, 5] * old[1] - own[i, 8] * old[2]
    roll = in_disc(own[i, 4], own[i, 5], own[i, 8], x, y, bounds[1])
    return (spin, roll[0], roll[1])


@part
def pushed(w, u, old):
    """Return λ ≥ 0 for a single row that stops its approach."""
    return max(0.0, old - u / w) if w > 0.0 else 0.0


@part
def held(own, i, u, old):
    """Return λ for bilateral rows, one after the other."""
    x = -u[0] / own[i, 0] if own[i, 0] > 0.0 else 0.0
    y = -(u[1] + own[i, 3] * x) / own[i, 4] if own[i, 4] > 0.0 else 0.0
    z = -(u[2] + own[i, 6] * x + own[i, 7] * y) / own[i, 8] if own[i, 8] > 0.0 else 0.0
    return (old[0] + x, old[1] + y, old[2] + z)


@part
def in_disc(a, b, c, x, y, radius):
    """Minimise ½ tᵀ[a b, b c]t + (x, y)·t in a disc. There is no slip inside the disc, and t
    opposes the slip on its boundary."""
    pull = math.sqrt(x * x + y * y)
    if not (radius > 0.0 and pull > 0.0 and a + c > 0.0):
        return (0.0, 0.0)
    slack = ROUNDING * (a + c)  # a direction in which nothing can move
    a += slack
    c += slack
    det = a * c - b * b
    t = ((b * y - c * x) / det, (b * x - a * y) / det)
    if t[0] * t[0] + t[1] * t[1] <= radius * radius:
        return t
    s = max(0.0, pull / radius - max(a, c) - abs(b))  # below the root: Newton goes up to it
    for _ in range(30):
        _, _, step = rim_step(a, b, c, s, x, y, radius)
        s += step
        if abs(step) <= 4.0 * EPS * (s + a + c):
            break
    tx, ty, _ = rim_step(a, b, c, s, x, y, radius)
    fit = radius / math.sqrt(tx * tx + ty * ty)
    return (tx * fit, ty * fit)


@part
def rim_step(a, b, c, s, x, y, radius):
    """Return t = -[a+s b, b c+s]⁻¹ (x, y), and the Newton step in s towards |t| = radius."""
    p = a + s
    q = c + s
    det = p * q - b * b
    tx = (b * y - q * x) / det
    ty = (b * x - p * y) / det
    size = math.sqrt(tx * tx + ty * ty)
    slope = (tx * (q * tx - b * ty) + ty * (p * ty - b * tx)) / det
    return tx, ty, (size / radius - 1.0) * size * size / slope
