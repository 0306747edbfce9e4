"""Bilateral constraints: Delassus matrix from articulated factors, rank-safe solve, projection.

λ contains the multipliers of the rows of the active blocks, i.e. forces and torques on `body`
(R10). `space` is defined in `layout`, and the blocks in `blocks`.
"""

from ...tolerances import DIP, EPS, ROUNDING
from .. import layout as at
from ..arrays import (
    CONTACTS,
    CONTACTS_OF_DUALS,
    DINV,
    EFFECT,
    FACTORED,
    FACTORS,
    LAMBDA,
    LEAST,
    MOVED,
    PLACED,
    RESIDUAL,
    RHS,
    ZERO,
    opened,
)
from ..compiler.address import stored
from ..compiler.dual import carries, of_numbers
from ..compiler.jit import part, sweep
from ..compiler.lane import load_triple, numbers, triple
from ..layout import T_ALIGN
from ..motions import bends, is_angle, nv_of
from ..records import FROZEN
from ..rows import axis_of, kind_of, origin_of, slide_of
from ..tree.articulated import inboard
from ..tree.kinematics import frames, outboard, positions
from ..tree.moving import advance
from ..vec import accumulate, cross, dot, largest, scale, store, sub
from .blocks import (
    along,
    along_coordinates,
    ends_of,
    first_of,
    joint_of,
    joints_of,
    locate,
    of_cable,
    place_a,
    point_a,
    prescribes,
    residual,
    residual_acceleration,
    residual_velocity,
    size_of,
    turns_with_speed,
    type_of,
    velocities,
)
from .coordinates import coefficient, speed_along, terms_of
from .paths import carry, carry_cable, carry_coordinates, pivots, spread
from .proximal import along_nulls, factor_proximal, solve_proximal

_, contacts_at = stored(CONTACTS, CONTACTS_OF_DUALS)

NO_GAP = 64 * EPS  # relative to the mechanism's size: rounding
LOOP_CLOSED = 1e-7  # relative to it: a loop with a larger gap after all rounds is open
SMALL_MOVE = 1e-10  # rad, m: below it one factorisation serves position and velocity
NEAR_FACTORS = 1e-4  # largest distance of a state from that of reused factors


@part
def number_rows(blocks, slots):
    """Number the first row of every active block. Returns the number of rows."""
    blocks_i, active = blocks.blocks_i, blocks.active
    m = 0
    for j in range(1, active[0] + 1):
        slots[active[j], at.FIRST] = m
        m += size_of(blocks_i, active[j])
    return m


@part
def unit_responses(rows, const, blocks, work, space):
    """Compute Y for the active blocks from the articulated factors."""
    blocks_i, active = blocks.blocks_i, blocks.active
    pivots(rows, work, space.vectors[DINV])
    for j in range(1, active[0] + 1):
        i = active[j]
        if along_coordinates(type_of(blocks_i, i)):
            carry_coordinates(rows, const, blocks, i, work, space)
        elif of_cable(type_of(blocks_i, i)):
            carry_cable(rows, blocks, i, work, space)
        else:
            carry(rows, blocks_i, i, work, space)


@part
def couplings(blocks, space):
    """Compute Ω for the active blocks from Y."""
    blocks_i, active = blocks.blocks_i, blocks.active
    y, slots, omega = space.y, space.slots, space.omega
    where, dinv = space.where, space.vectors[DINV]
    for j in range(1, active[0] + 1):
        i = active[j]
        count = joints_of(slots, i)
        for s in range(count):
            where[joint_of(slots, i, s)] = s + 1
        for n in range(j, active[0] + 1):
            couple(blocks_i, i, active[n], y, slots, where, dinv, omega)
        for s in range(count):
            where[joint_of(slots, i, s)] = 0


@part
def delassus(rows, const, blocks, work, space, m):
    """Compute Y, Ω and its factor for the active blocks. Returns μ and the null directions."""
    unit_responses(rows, const, blocks, work, space)
    couplings(blocks, space)
    return factor_proximal(space.omega, space.factor, space.nulls, m)


@part
def couple(blocks_i, i, n, y, slots, where, dinv, omega):
    """Compute the block of Ω between blocks i and n from the joints on both paths."""
    u = triple(0.0, 0.0, 0.0)
    v, w = u, u
    for s in range(joints_of(slots, n)):
        k = joint_of(slots, n, s)
        mine = max(where[k] - 1, 0)
        other = (dinv[k] if where[k] > 0 else 0.0) * load_triple(y, n, 3 * s)  # no branch is missed
        u = u + y[i, 3 * mine] * other
        v = v + y[i, 3 * mine + 1] * other
        w = w + y[i, 3 * mine + 2] * other
    a, b, c = numbers(u), numbers(v), numbers(w)
    r = first_of(slots, i)
    q = first_of(slots, n)
    rows = size_of(blocks_i, i)
    columns = size_of(blocks_i, n)
    if rows == 3 and columns == 3:
        store(omega, r, q, a)
        store(omega, r + 1, q, b)
        store(omega, r + 2, q, c)
        store(omega, q, r, (a[0], b[0], c[0]))
        store(omega, q + 1, r, (a[1], b[1], c[1]))
        store(omega, q + 2, r, (a[2], b[2], c[2]))
        return
    whole = (a[0], a[1], a[2], b[0], b[1], b[2], c[0], c[1], c[2])
    for x in range(rows):
        for z in range(columns):
            omega[r + x, q + z] = whole[3 * x + z]
            omega[q + z, r + x] = whole[3 * x + z]


@part
def joint_impulses(blocks, space):
    """Compute diag(1/d) Yᵀ λ of the active blocks and store it in EFFECT."""
    blocks_i, active = blocks.blocks_i, blocks.active
    y, slots, vectors = space.y, space.slots, space.vectors
    lam = vectors[LAMBDA]
    dinv = vectors[DINV]
    step = vectors[EFFECT]
    for k in range(dinv.shape[0]):
        step[k] = 0.0
    for j in range(1, active[0] + 1):
        i = active[j]
        r = first_of(slots, i)
        size = size_of(blocks_i, i)
        x = lam[r]
        z = lam[r + 1] if size > 1 else 0.0
        w = lam[r + 2] if size > 2 else 0.0
        for s in range(joints_of(slots, i)):
            k = joint_of(slots, i, s)
            total = x * y[i, 3 * s] + z * y[i, 3 * s + 1] + w * y[i, 3 * s + 2]
            step[k] += total * dinv[k]


@part
def respond(rows, const, blocks, work, space):
    """Compute M⁻¹ Jᵀ λ and store it in EFFECT."""
    joint_impulses(blocks, space)
    spread(rows, const, work, space.vectors[EFFECT])


@sweep
def located(scene, q, v, moving):
    """Compute origins and positions of the active blocks from the frames. Returns the rows.

    If `moving` is True, velocities of body origins are also computed.
    """
    data = opened(scene)
    rows, const, blocks, work, space = data.rows, data.const, data.blocks, data.work, data.space
    positions(rows, work)
    if moving:
        velocities(rows, const, work, v, space.linear)
    locate(blocks, work, q, space.place)
    return number_rows(blocks, space.slots)


@sweep
def gaps(scene, t, q, row):
    """Compute g of the active blocks in a row of `vectors`, after `located`."""
    data = opened(scene)
    blocks, work, space = data.blocks, data.work, data.space
    residual(blocks, work, space, t, q, space.vectors[row])


@sweep
def speeds(scene, t, v, row):
    """Compute g' of the active blocks in a row of `vectors`, after `located`."""
    data = opened(scene)
    blocks, work, space = data.blocks, data.work, data.space
    residual_velocity(blocks, work, space, t, v, space.vectors[row])


@part
def impose(scene, t, q, v, vdot):
    """Add M⁻¹ Jᵀ λ to v' such that J v' + J' v = 0, eqs. (27)-(29). λ remains in `vectors`.

    The scene's gains (2,) are Baumgarte's 2α and α², zero without it.
    """
    data = opened(scene)
    rows, const, blocks = data.rows, data.const, data.blocks
    work, space, gains = data.work, data.space, data.gains
    vectors = space.vectors
    m = located(scene, q, v, gains[0] > 0.0 or turns_with_speed(blocks))
    rhs = vectors[RHS]
    residual_acceleration(blocks, work, space, t, v, vdot, rhs)
    if gains[0] > 0.0:
        other = vectors[RESIDUAL]
        speeds(scene, t, v, RESIDUAL)
        for r in range(m):
            rhs[r] += gains[0] * other[r]
        gaps(scene, t, q, RESIDUAL)
        for r in range(m):
            rhs[r] += gains[1] * other[r]
    for r in range(m):
        rhs[r] = -rhs[r]
    mu, count = delassus(rows, const, blocks, work, space, m)
    watch(scene, t, q, v)
    remember(vectors, q, mu, count)
    iterations = solve_proximal(space.omega, space.factor, space.nulls, mu, count, vectors, m, 0.0)
    respond(rows, const, blocks, work, space)
    for j in range(vdot.shape[0]):
        vdot[j] += vectors[EFFECT, j]
    return iterations


@part
def driven_power(blocks, space, v):
    """Return λ Σ c v of the rows that prescribe motions, which is their power [W]."""
    active = blocks.active
    power = 0.0
    for j in range(1, active[0] + 1):
        i = active[j]
        if prescribes(blocks, i):
            lam = space.vectors[LAMBDA, first_of(space.slots, i)]
            power += lam * speed_along(blocks, space.place, i, v)
    return power


@part
def remember(vectors, q, mu, count):
    """Store the state of the current factors for `settle`."""
    for i in range(q.shape[0]):
        vectors[PLACED, i] = q[i]
    vectors[FACTORED, FACTORS.mu] = mu
    vectors[FACTORED, FACTORS.nulls] = count
    vectors[FACTORED, FACTORS.known] = 1.0


@part
def drift(rows, const, blocks, work, space, t, q, v, out):
    """Compute the largest |g| and |g'| of the active blocks in out (2,), after `outboard`."""
    vectors = space.vectors
    positions(rows, work)
    velocities(rows, const, work, v, space.linear)
    m = number_rows(blocks, space.slots)
    locate(blocks, work, q, space.place)
    residual(blocks, work, space, t, q, vectors[RESIDUAL])
    out[0] = largest(vectors[RESIDUAL], m)
    residual_velocity(blocks, work, space, t, v, vectors[RESIDUAL])
    out[1] = largest(vectors[RESIDUAL], m)


@part
def wrenches(rows, blocks, work, space, out):
    """Compute the wrenches of the active blocks on `body` in world axes at PA, 0 for other blocks.

    The wrench of a coordinate row acts on the first body of its terms, at its origin.
    """
    for i in range(out.shape[0]):
        store(out, i, 0, (0.0, 0.0, 0.0))
        store(out, i, 3, (0.0, 0.0, 0.0))
    add_wrenches(rows, blocks, work, space, blocks.active[0], out, 0)


@part
def along_joint(rows, work, k):
    """Return (moment, force) that act on row k as a unit along its coordinate.

    About the axis for an angle, and otherwise along it. The axis of a curve has any length.
    """
    h = axis_of(work, k)
    none = scale(0.0, h)
    if not bends(kind_of(rows, k)):
        return (h, none) if is_angle(kind_of(rows, k)) else (none, h)
    slide = slide_of(work, k)
    turn, way = dot(h, h), dot(slide, slide)
    if turn > 0.0 and (is_angle(kind_of(rows, k)) or way == 0.0):
        return scale(1.0 / turn, h), none
    return none, scale(1.0 / way if way > 0.0 else 0.0, slide)


@part
def add_wrenches(rows, blocks, work, space, count, out, column):
    """Add the wrenches of the first `count` active blocks to `out`, from `column` on."""
    blocks_i, blocks_f = blocks.blocks_i, blocks.blocks_f
    active = blocks.active
    slots, place, vectors = space.slots, space.place, space.vectors
    for j in range(1, count + 1):
        i = active[j]
        kind = type_of(blocks_i, i)
        a = ends_of(blocks_i, i)[0]
        if along_coordinates(kind):
            if nv_of(kind_of(rows, a)) == 1:
                moment, force = along_joint(rows, work, a)
                x = vectors[LAMBDA, first_of(slots, i)]
                share = coefficient(blocks, place, i, terms_of(blocks_i, i)[0])
                accumulate(out, i, column, scale(share, scale(x, moment)))
                accumulate(out, i, column + 3, scale(share, scale(x, force)))
            continue
        arm = sub(place_a(place, i), point_a(blocks_f, i, work, a))
        for r in range(size_of(blocks_i, i)):
            d = along(place, i, r)
            x = scale(vectors[LAMBDA, first_of(slots, i) + r], d)
            accumulate(out, i, column, x if kind == T_ALIGN else cross(arm, x))
            if kind != T_ALIGN:
                accumulate(out, i, column + 3, x)


@part
def extent(rows, blocks, work):
    """Compute the size of the mechanism's coordinates [m], the scale for rounding in positions."""
    blocks_f = blocks.blocks_f
    x, y, z = 0.0, 0.0, 0.0
    for k in range(1, rows.shape[0]):
        p = origin_of(work, k)
        x, y, z = max(x, abs(p[0])), max(y, abs(p[1])), max(z, abs(p[2]))
    size = max(x, max(y, z))
    for i in range(blocks_f.shape[0]):
        for n in range(6):
            size = max(size, abs(blocks_f[i, n]))
    return size


@sweep
def settle(scene, t, q, v):
    """Project with the factors of the last acceleration. Returns False, without moving, if too far
    off.

    The relative error of a correction is the distance `moved` from the state of the factors. The
    correction is negligible at the end of a step, because the last stage was close and the gap is
    small. Derivatives have no rounding that hides a gap, so they are always corrected.
    """
    data = opened(scene)
    rows, const, blocks, work, space = data.rows, data.const, data.blocks, data.work, data.space
    vectors, nulls = space.vectors, space.nulls
    mu, count = vectors[FACTORED, FACTORS.mu], int(vectors[FACTORED, FACTORS.nulls])
    known = vectors[FACTORED, FACTORS.known]
    vectors[FACTORED, FACTORS.known] = 0.0
    moved = 0.0
    for i in range(q.shape[0]):
        moved = max(moved, abs(q[i] - vectors[PLACED, i]))
    if known == 0.0 or not moved < NEAR_FACTORS:
        return False
    frames(rows, const, work, q, v)
    m = located(scene, q, v, True)
    rounding = NO_GAP * extent(rows, blocks, work)
    enough = 0.0 if carries(q) else rounding
    speeds(scene, t, v, RHS)
    missed = along_nulls(nulls, count, vectors[RHS], m)
    correct(scene, mu, count, m, enough)
    change = vectors[MOVED]
    for j in range(v.shape[0]):
        change[j] = vectors[EFFECT, j]
    missed = max(missed, moved * largest(change, v.shape[0]))
    gaps(scene, t, q, RHS)
    open_gap = carries(q) or largest(vectors[RHS], m) > rounding
    if open_gap:
        missed = max(missed, along_nulls(nulls, count, vectors[RHS], m))
        correct(scene, mu, count, m, enough)
        step = largest(vectors[EFFECT], v.shape[0])
        missed = max(missed, moved * step)
        if not step < SMALL_MOVE:
            return False
    if not missed <= rounding:
        return False
    for j in range(v.shape[0]):
        v[j] += change[j]
    if open_gap:
        advance(rows, q, vectors[EFFECT], 1.0)
    return True


@sweep
def pulls_of_numbers(scene, t, q, v, tau):
    """Add the impulses that project velocities to those of the last time step."""
    data = opened(scene)
    blocks, contacts = data.blocks, data.links.contacts
    if contacts != 0 and contacts_at(contacts).tally[0].frozen == FROZEN:
        count = blocks.active[0]
        add_wrenches(data.rows, blocks, data.work, data.space, count, blocks.blocks_f, at.PULL)
    return 0.0


note_pulls = of_numbers(pulls_of_numbers)  # forces of constraints have no derivatives


@part
def project(scene, t, q, v, rounds):
    """Project q and v onto the constraints in the mass metric. Returns the rounds, or -1 on
    failure.

    Both corrections use the same factorisation, which is updated while the positions change
    significantly. Near a singular position, rounding errors cause large corrections, so a gap
    within rounding is treated as zero. The derivatives of q are always corrected once, followed by
    the derivatives of v.
    """
    least = 2 if carries(q) else 1
    if settle(scene, t, q, v):
        return 1
    data = opened(scene)
    rows, const, blocks, work, space = data.rows, data.const, data.blocks, data.work, data.space
    vectors = space.vectors
    zero = vectors[ZERO]
    for j in range(v.shape[0]):
        zero[j] = 0.0
    m = 0
    gap = 0.0
    size = 1.0
    taken = 0
    for taken in range(1, rounds + 1):
        outboard(rows, const, work, q, v)
        inboard(rows, const, work, zero)
        m = located(scene, q, v, True)
        mu, count = delassus(rows, const, blocks, work, space, m)
        speeds(scene, t, v, RHS)
        correct(scene, mu, count, m, 0.0)
        for j in range(v.shape[0]):
            v[j] += vectors[EFFECT, j]
        note_pulls(scene, t, q, v, zero)
        gaps(scene, t, q, RHS)
        gap = largest(vectors[RHS], m)
        size = extent(rows, blocks, work)
        if gap <= NO_GAP * size and taken >= least:
            return taken
        correct(scene, mu, count, m, 0.0)
        advance(rows, q, vectors[EFFECT], 1.0)
        if largest(vectors[EFFECT], v.shape[0]) < SMALL_MOVE and taken >= least:
            break
    if gap <= LOOP_CLOSED * size:
        return taken
    frames(rows, const, work, q, v)  # beside a mechanism that is a point every gap is large
    located(scene, q, v, False)
    gaps(scene, t, q, RHS)
    return taken if largest(vectors[RHS], m) <= LOOP_CLOSED * gap else -1


@sweep
def correct(scene, mu, count, m, enough):
    """Compute -M⁻¹ Jᵀ Ω⁺ RHS in EFFECT, to within `enough` of RHS."""
    data = opened(scene)
    rows, const, blocks, work, space = data.rows, data.const, data.blocks, data.work, data.space
    vectors = space.vectors
    for r in range(m):
        vectors[RHS, r] = -vectors[RHS, r]
    solve_proximal(space.omega, space.factor, space.nulls, mu, count, vectors, m, enough)
    respond(rows, const, blocks, work, space)


# -- dips of pivots during a run: where constraints are nearly dependent --------------------------
# The pivots of Ω's factor are what each row adds to those before it. One that falls far below its
# largest so far marks a position at or beside which the row says nothing new; a row that never says
# anything has no dip. What dips only because rows take each other's place is sorted out afterwards.

STAGES = 4  # dips within this multiple of the distance of evaluations are one


@sweep
def watch(scene, t, q, v):
    """Count dips after a factorisation and keep the deepest position of the first ones."""
    space = opened(scene).space
    factor, dips, least, now = space.factor, space.dips, space.vectors[LEAST], space.watch[0]
    deepest = DIP
    gap = abs(t - now.time)
    if gap > ROUNDING * abs(t):
        now.apart = gap
        now.time = t
    for r in range(now.rows):
        x = factor[r, r]
        if 0.0 < x < least[r]:
            least[r] = x
        elif x > deepest * least[r]:
            deepest = x / least[r]
    if deepest <= DIP:
        now.inside = 0
        return
    if now.inside == 0:
        now.inside = 1
        last = min(now.count, dips.shape[0]) - 1
        if last < 0 or abs(t - dips[last].time) > STAGES * now.apart:
            now.count += 1
    n = now.count - 1
    if n < dips.shape[0] and deepest > dips[n].depth:
        dips[n].depth = deepest
        dips[n].time = t
        dips[n].apart = now.apart
        nq = q.shape[0]
        for i in range(nq):
            space.dip_states[n, i] = q[i]
        for j in range(v.shape[0]):
            space.dip_states[n, nq + j] = v[j]
