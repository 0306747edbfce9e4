"""Angular velocity over a whole step for free bodies, balls on the ground and trees.

Euler's equations I Ω' + Ω × I Ω = τ are solved by the implicit midpoint rule in the body's axes.
Without a torque, Ωᵀ I Ω and |I Ω| stay constant at any speed, because the rule keeps quadratic
invariants ([Hairer et al. 2006, ch. IV.2]). A body rotates about its own angular velocity, first by
that before the step and then by that after it. Both therefore have the same components in the body
axes at either end as at the midpoint of the step, where the equations are solved.

For trees, the same rule is applied to joint velocities: M (v⁺ - v) = h (τ - C(½ (v + v⁺))), with M
and C at the midpoint of the step. Bodies with rotors therefore conserve |I Ω| and their energy,
like single bodies.
"""

import math

from ...tolerances import EPS, LONGEST_STEP, TINY, VISIBLE
from ..compiler.elementary import sine_cosine
from ..compiler.jit import part, sweep
from ..linear import factor3, solve3
from ..motions import has_attitude, nv_of, transmits, travels
from ..motions.attitude import base_axes
from ..records import columns
from ..rows import (
    acceleration_of,
    armature_of,
    gravity_of,
    kind_of,
    mass_of,
    origin_of,
    parent_of,
    rotation_of,
    set_velocity,
    spin_of,
    v_of,
    velocity_of,
)
from ..vec import (
    about_origin,
    add,
    add_cross,
    add_scaled,
    cross,
    dot,
    load3,
    mul,
    mul_t,
    rodrigues,
    rotate_sym,
    scale,
    store3,
    sub,
    sym_mul,
)
from .articulated import articulated
from .kinematics import accelerate, frames, linear_velocity, positions
from .moving import advance

TURN = LONGEST_STEP / 2  # [rad] rotation in a substep that converges for any inertia
MOST_SUBSTEPS = 400  # limit on substeps, beyond which a body keeps its angular velocity
NEWTON = 30
ENOUGH = 64 * EPS  # relative: a correction, or a gyroscopic torque, that is rounding
# Turn of a body in a step [rad] from which on its tree takes the implicit midpoint rule, which
# keeps the energy. Below it, the explicit one changes it by less than VISIBLE**2 per radian.
GYRATES = 2 * VISIBLE
DIRECTIONS = 8  # directions of a search before it restarts
SEARCHES = 20
# rows of scratch: the tree of every row, whether it gyrates, velocities at the middle, by how much
# they are missed, what does not change of them, C', C' at another place, that place, the
# correction, then directions and what each does
SPIN = columns(
    "tree", "fast", "middle", "miss", "fixed", "bias", "other", "shifted", "correction",
    ways=DIRECTIONS, effects=DIRECTIONS,
)  # fmt: skip


@sweep
def keep_spinning(rows, const, work, v, mean, kick, h, free, vdot):
    """Replace v' of freely rotating bodies with the mean change over the step, a time h apart.

    `v` is that at the step's start, `work` and v' are of its middle, at the velocities `mean`.
    Impulses change v by `kick` more. `free` (nv,) is scratch.
    """
    for j in range(v.shape[0]):
        free[j] = 1.0
    for k in range(1, rows.shape[0]):
        if parent_of(rows, k) > 0:
            free[v_of(rows, parent_of(rows, k))] = 0.0
    for k in range(1, rows.shape[0]):
        j = v_of(rows, k)
        kind = kind_of(rows, k)
        if not has_attitude(kind) or parent_of(rows, k) > 0 or free[j] == 0.0:
            continue
        axes = base_axes(rows, work, k, const)
        r = rotation_of(work, k)
        m, com, central = moved_mass(rows, const, k)
        c = mul(r, com)
        inertia = rotate_sym(r, central)
        if not travels(kind):
            inertia = about_origin(inertia, m, c)
        before, here = mul(axes, load3(v, j)), mul(axes, load3(mean, j))
        pushed = mul(axes, load3(kick, j))
        alpha = add_scaled(mul(axes, load3(vdot, j)), 1.0 / h, pushed)
        after = rate_after(inertia, before, here, alpha, h)
        change = sub(sub(after, before), pushed)
        store3(vdot, j, mul_t(axes, scale(1.0 / h, change)))
        if travels(kind) and dot(com, com) > 0.0:  # the centre of mass moves on
            linear = mul(axes, load3(vdot, j + 3))
            swing = add_cross(cross(alpha, c), here, cross(here, c))
            orbit = sub(
                cross(before, swung(c, -0.5 * h, before)), cross(after, swung(c, 0.5 * h, after))
            )
            linear = add_scaled(add(linear, swing), 1.0 / h, orbit)
            store3(vdot, j + 3, mul_t(axes, linear))


@part
def moved_mass(rows, const, k):
    """Return `mass_of`, with the armature of a ball or free motion on the ground.

    The armature a acts as a body without weight at the origin, of mass a and moments a.
    """
    m, com, central = mass_of(const, k)
    a = armature_of(const, k)
    if parent_of(rows, k) > 0 or not has_attitude(kind_of(rows, k)) or not a > 0.0:
        return m, com, central
    whole = about_origin(central, m * a / (m + a), com)
    whole = (whole[0] + a, whole[1] + a, whole[2] + a, whole[3], whole[4], whole[5])
    return m + a, scale(m / (m + a), com), whole


@sweep
def find_gyrating(rows, work, h, scratch):
    """Mark trees of several rows with large rotations in a step. Returns whether there are any."""
    tree, fast = scratch[SPIN.tree], scratch[SPIN.fast]
    found = False
    for k in range(1, rows.shape[0]):
        p = parent_of(rows, k)
        tree[k - 1] = tree[p - 1] if p > 0 else k - 1
        fast[k - 1] = 0.0
    for k in range(1, rows.shape[0]):
        p, w = parent_of(rows, k), spin_of(work, k)
        if p > 0:
            u = spin_of(work, p)
            if max(dot(w, w), dot(u, u)) * h * h > GYRATES * GYRATES:
                fast[int(tree[k - 1])] = 1.0
                found = True
    return found


@part
def gyrates(rows, scratch, k):
    """Check whether row k belongs to a marked tree."""
    return scratch[SPIN.fast, int(scratch[SPIN.tree, k - 1])] > 0.0


@part
def product(a, b, n):
    total = 0.0
    for j in range(n):
        total += a[j] * b[j]
    return total


@sweep
def keep_gyrating(rows, const, work, q, v, mean, kick, h, zero, scratch, vdot):
    """Replace v' of rapidly rotating trees with the mean change over the step, a time h apart.

    `work`, q and v' refer to the midpoint of the step, at the velocities `mean`, and `v` to its
    start. Impulses change v by `kick` more. `zero` (nv,) contains zeros. The velocities at the
    midpoint solve x = v + ½ kick + h/2 (v' + C'(x) - C'(mean)), where C' = -M⁻¹ C, by Newton's
    method with generalised conjugate residuals ([Eisenstat et al. 1983]). C' is quadratic, so
    central differences of C' are exact.
    """
    if not find_gyrating(rows, work, h, scratch):
        return
    x, miss, fixed, bias = (
        scratch[SPIN.middle],
        scratch[SPIN.miss],
        scratch[SPIN.fixed],
        scratch[SPIN.bias],
    )
    n = v.shape[0]
    articulated(rows, const, q, mean, zero, work, bias)
    for j in range(n):
        x[j] = v[j] + 0.5 * kick[j]
        miss[j] = 0.0
        scratch[SPIN.correction, j] = 0.0
    for k in range(1, rows.shape[0]):
        if gyrates(rows, scratch, k):
            for j in range(v_of(rows, k), v_of(rows, k) + nv_of(kind_of(rows, k))):
                x[j] += 0.5 * h * vdot[j]
                fixed[j] = x[j] - 0.5 * h * bias[j]
    for _ in range(SEARCHES):
        articulated(rows, const, q, x[:n], zero, work, bias)
        for k in range(1, rows.shape[0]):
            if gyrates(rows, scratch, k):
                for j in range(v_of(rows, k), v_of(rows, k) + nv_of(kind_of(rows, k))):
                    miss[j] = fixed[j] + 0.5 * h * bias[j] - x[j]
        if not product(miss, miss, n) > ENOUGH * ENOUGH * product(x, x, n):
            break
        search(rows, const, work, q, h, zero, scratch, n)
    for k in range(1, rows.shape[0]):
        if gyrates(rows, scratch, k):
            for j in range(v_of(rows, k), v_of(rows, k) + nv_of(kind_of(rows, k))):
                vdot[j] = (2.0 * (x[j] - v[j]) - kick[j]) / h
    keep_momentum(rows, const, work, q, v, h, scratch, vdot)
    articulated(rows, const, q, mean, zero, work, bias)  # `work` as before


@sweep
def search(rows, const, work, q, h, zero, scratch, n):
    """Correct the midpoint velocities for their residual, to first order.

    Directions are stored such that their effects are orthonormal.
    """
    x, miss, correction = scratch[SPIN.middle], scratch[SPIN.miss], scratch[SPIN.correction]
    for j in range(n):
        correction[j] = 0.0
    least = ENOUGH * product(miss, miss, n)  # the next search squares what is left
    for m in range(DIRECTIONS):
        way, effect = scratch[SPIN.ways + m], scratch[SPIN.effects + m]
        for j in range(n):
            way[j] = miss[j]
        derivative(rows, const, work, q, h, zero, scratch, way, effect, n)
        for i in range(m):
            share = product(scratch[SPIN.effects + i], effect, n)
            for j in range(n):
                effect[j] -= share * scratch[SPIN.effects + i, j]
                way[j] -= share * scratch[SPIN.ways + i, j]
        size = math.sqrt(product(effect, effect, n))
        if not size > 0.0:
            break
        for j in range(n):
            effect[j] /= size
            way[j] /= size
        share = product(effect, miss, n)
        for j in range(n):
            correction[j] += share * way[j]
            miss[j] -= share * effect[j]
        if not product(miss, miss, n) > least:
            break
    for j in range(n):
        x[j] += correction[j]


@sweep
def derivative(rows, const, work, q, h, zero, scratch, way, effect, n):
    """Compute the change of x - h/2 C'(x) along a direction, at the midpoint velocities."""
    place, x = scratch[SPIN.shifted], scratch[SPIN.middle]
    for j in range(n):
        place[j] = x[j] + way[j]
        effect[j] = 0.0
    articulated(rows, const, q, place[:n], zero, work, scratch[SPIN.bias])
    for j in range(n):
        place[j] = x[j] - way[j]
    articulated(rows, const, q, place[:n], zero, work, scratch[SPIN.other])
    for k in range(1, rows.shape[0]):
        if gyrates(rows, scratch, k):
            for j in range(v_of(rows, k), v_of(rows, k) + nv_of(kind_of(rows, k))):
                effect[j] = way[j] - 0.25 * h * (scratch[SPIN.bias, j] - scratch[SPIN.other, j])


# -- momentum of trees that float ------------------------------------------------------------------


@sweep
def keep_momentum(rows, const, work, q, v, h, scratch, vdot):
    """Enforce momentum balance over the step, under external forces, on floating trees that gyrate.

    The midpoint rule gives the change of momentum for the positions at the midpoint, which differ
    from those at the end. A rigid motion of the whole tree compensates for the difference. The
    rotation is computed by Newton's method, since it also rotates the existing momentum.
    """
    place, middle = scratch[SPIN.shifted], scratch[SPIN.middle]
    for k in range(1, rows.shape[0]):
        if transmits(kind_of(rows, k)) or parent_of(rows, k) > 0 or not gyrates(rows, scratch, k):
            continue
        tree = scratch[SPIN.tree, k - 1]
        for j in range(v.shape[0]):
            middle[j] = v[j] + 0.5 * h * vdot[j]
        frames(rows, const, work, q, middle)
        positions(rows, work)
        fixed = origin_of(work, k)
        accelerate(rows, const, work, middle, vdot)
        torque, force = forces_of(rows, const, work, scratch[SPIN.tree], tree, fixed)
        for i in range(q.shape[0]):
            place[i] = q[i]
        advance(rows, place[: q.shape[0]], v, -0.5 * h)
        spin, push, _, _ = momentum_of(rows, const, work, place, v, scratch[SPIN.tree], tree, fixed)
        spin, push = add_scaled(spin, h, torque), add_scaled(push, h, force)
        aim = fixed, spin, push
        for _ in range(NEWTON):
            if not correct_momentum(rows, const, work, q, v, h, scratch, vdot, k, aim):
                break


@sweep
def correct_momentum(rows, const, work, q, v, h, scratch, vdot, k, aim):
    """Correct v' of free row k for the momentum of its tree. Returns whether the change was
    notable.

    `aim` is (a fixed point, angular momentum about it, linear momentum).
    """
    fixed, spin, push = aim
    place, after = scratch[SPIN.shifted], scratch[SPIN.correction]
    for j in range(v.shape[0]):
        after[j] = v[j] + h * vdot[j]
    for i in range(q.shape[0]):
        place[i] = q[i]
    advance(rows, place[: q.shape[0]], after, 0.5 * h)
    now, pushed, body, inertia = momentum_of(
        rows, const, work, place, after, scratch[SPIN.tree], scratch[SPIN.tree, k - 1], fixed
    )
    m, mc = body
    c = scale(1.0 / m, mc)
    force = sub(push, pushed)
    torque = sub(sub(spin, now), cross(c, force))
    own = sub(now, cross(c, pushed))  # about the centre of mass
    central = about_origin(inertia, -m, c)
    x = add_cross(sym_mul(central, (1.0, 0.0, 0.0)), (0.5 * h, 0.0, 0.0), own)
    y = add_cross(sym_mul(central, (0.0, 1.0, 0.0)), (0.0, 0.5 * h, 0.0), own)
    z = add_cross(sym_mul(central, (0.0, 0.0, 1.0)), (0.0, 0.0, 0.5 * h), own)
    yz = cross(y, z)
    size = 1.0 / dot(x, yz)
    turn = scale(size, (dot(torque, yz), dot(torque, cross(z, x)), dot(torque, cross(x, y))))
    arm = sub(sub(origin_of(work, k), fixed), c)
    move = add_cross(scale(1.0 / m, force), turn, arm)
    axes = base_axes(rows, work, k, const)
    j = v_of(rows, k)
    store3(vdot, j, add_scaled(load3(vdot, j), 1.0 / h, mul_t(axes, turn)))
    store3(vdot, j + 3, add_scaled(load3(vdot, j + 3), 1.0 / h, mul_t(axes, move)))
    changed = dot(turn, turn) + dot(move, move)
    return changed > ENOUGH * ENOUGH * product(after, after, v.shape[0])


@sweep
def momentum_of(rows, const, work, q, v, trees, tree, fixed):
    """Compute the angular and linear momentum of a tree at (q, v), and its inertia.

    (angular, linear, (mass, mass times its centre from the point), inertia about the point).
    """
    frames(rows, const, work, q, v)
    positions(rows, work)
    none = (0.0, 0.0, 0.0)
    spin, push, first, total = none, none, none, 0.0
    inertia = (0.0, 0.0, 0.0, 0.0, 0.0, 0.0)
    set_velocity(work, 0, none)
    for k in range(1, rows.shape[0]):
        if trees[k - 1] != tree:
            continue
        speed = linear_velocity(rows, const, work, v, k, velocity_of(work, parent_of(rows, k)))
        set_velocity(work, k, speed)
        r, w = rotation_of(work, k), spin_of(work, k)
        m, com, central = moved_mass(rows, const, k)
        c = mul(r, com)
        p = scale(m, add_cross(speed, w, c))
        own = rotate_sym(r, central)
        arm = sub(add(origin_of(work, k), c), fixed)
        spin = add(add_cross(spin, arm, p), sym_mul(own, w))
        push = add(push, p)
        first = add_scaled(first, m, arm)
        total += m
        own = about_origin(own, m, arm)
        inertia = (
            inertia[0] + own[0], inertia[1] + own[1], inertia[2] + own[2],
            inertia[3] + own[3], inertia[4] + own[4], inertia[5] + own[5],
        )  # fmt: skip
    return spin, push, (total, first), inertia


@sweep
def forces_of(rows, const, work, trees, tree, fixed):
    """Return the (torque about a fixed point, force) that act on a tree, after `accelerate`."""
    torque, force = (0.0, 0.0, 0.0), (0.0, 0.0, 0.0)
    for k in range(1, rows.shape[0]):
        if trees[k - 1] != tree:
            continue
        r, w = rotation_of(work, k), spin_of(work, k)
        m, com, central = moved_mass(rows, const, k)
        c = mul(r, com)
        alpha, linear = acceleration_of(work, k)
        linear = add(linear, gravity_of(const))
        linear = add_cross(add_cross(linear, alpha, c), w, cross(w, c))
        own = rotate_sym(r, central)
        arm = sub(add(origin_of(work, k), c), fixed)
        torque = add_cross(torque, arm, scale(m, linear))
        torque = add(torque, add_cross(sym_mul(own, alpha), w, sym_mul(own, w)))
        force = add_scaled(force, m, linear)
    return torque, force


@part
def swung(c, h, w):
    """Return c rotated at the rate w for the time h."""
    rate = math.sqrt(dot(w, w) + TINY)
    sine, cosine = sine_cosine(h * rate)
    return mul(rodrigues(scale(1.0 / rate, w), sine, cosine), c)


@part
def rate_after(inertia, before, here, alpha, h):
    """Compute the angular velocity after a step of size h, from its initial value and the explicit
    ω' [1/s²] at the angular velocity `here`.

    In substeps of at most TURN. If there are too many, or if they fail, the gyroscopic torque is
    omitted, which also conserves the energy.
    """
    momentum = sym_mul(inertia, here)
    gyroscopic = cross(here, momentum)
    small = ENOUGH * ENOUGH * dot(here, here) * dot(momentum, momentum)
    after = add_scaled(before, h, alpha)
    if not dot(gyroscopic, gyroscopic) > small:
        return after
    pushed = add(alpha, solve3(factor3(inertia), gyroscopic))  # by τ alone
    most = math.sqrt(max(dot(before, before), dot(after, after)))
    after = add_scaled(before, h, pushed)
    most = max(most, math.sqrt(dot(after, after)))
    if not h * most < TURN * MOST_SUBSTEPS:
        return after
    count = 1 + int(h * most / TURN)
    width = h / count
    torque = scale(width * width, sym_mul(inertia, pushed))
    turn = scale(width, before)
    for _ in range(count):
        middle, found = middle_turn(inertia, turn, torque)
        if not found:
            return after
        turn = sub(add(middle, middle), turn)
    return scale(1.0 / width, turn)


@part
def middle_turn(inertia, turn, torque):
    """Solve 2 I (θ - θ₀) + θ × I θ = h² τ for θ by Newton's method. Returns (θ, success)."""
    theta = turn
    for _ in range(NEWTON):
        momentum = sym_mul(inertia, theta)
        gap = add_cross(
            sub(scale(2.0, sym_mul(inertia, sub(theta, turn))), torque), theta, momentum
        )
        x = column(inertia, theta, momentum, (1.0, 0.0, 0.0))
        y = column(inertia, theta, momentum, (0.0, 1.0, 0.0))
        z = column(inertia, theta, momentum, (0.0, 0.0, 1.0))
        yz = cross(y, z)
        size = 1.0 / dot(x, yz)
        step = scale(size, (dot(gap, yz), dot(gap, cross(z, x)), dot(gap, cross(x, y))))
        theta = sub(theta, step)
        if dot(step, step) <= ENOUGH * ENOUGH * dot(theta, theta):
            return theta, True
    return theta, False


@part
def column(inertia, theta, momentum, e):
    """Return the slope of the midpoint residual along a unit e: 2 I e + θ × I e + e × I θ."""
    along = sym_mul(inertia, e)
    return add(add_cross(scale(2.0, along), theta, along), cross(e, momentum))
