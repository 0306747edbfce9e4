"""What unit multipliers do in the joints: wrenches carried along their paths to the ground.

Carried by the articulated factors, they give Y with Ω = J M⁻¹ Jᵀ = Y diag(1/d) Yᵀ, without a mass
matrix ([Featherstone 2008, ch. 8], [Wensing et al. 2012]). Only joints on the paths are stored.
"""

from . import layout as at
from ._jit import part
from .factors import backward3, backward6, forward3, solve3
from .kinematics import base_axes, load_inertia
from .vec import (
    accumulate,
    add_cross,
    add_scaled,
    cross,
    dot,
    load,
    load6,
    mul,
    mul_t,
    scale,
    store,
    store3,
    sub,
)


@part
def pivots(rows, work, dinv):
    """1/d of every degree of freedom: the diagonal between Y and Yᵀ."""
    for k in range(1, rows.shape[0]):
        i = rows[k, at.VI]
        kind = rows[k, at.KIND]
        if kind <= at.TRANSLATE:
            dinv[i] = work[k, at.D]
        elif kind == at.BALL:
            for n in range(3):
                dinv[i + n] = work[k, at.U + n]
        else:
            for n in range(6):
                dinv[i + n] = work[k, at.IA + n * (n + 1) // 2 + n]


@part
def set_wrenches(blocks_i, i, work, place, column, k, side, sign, hold):
    """The block's unit wrenches on row k, at its origin, into one side of `hold`."""
    arm = sub(load(place, i, column), load(work, k, at.X))
    torque = blocks_i[i, at.B_TYPE] == at.T_ALIGN
    for c in range(3):
        d = (0.0, 0.0, 0.0)
        if c < blocks_i[i, at.B_SIZE]:
            d = scale(sign, load(place, i, at.PLACE_D + 3 * c))
        store(hold, side, 6 * c, d if torque else cross(arm, d))
        store(hold, side, 6 * c + 3, (0.0, 0.0, 0.0) if torque else d)


@part
def carry(rows, blocks_i, i, work, space):
    """Y of a block between bodies: two paths towards the ground, one after they have met."""
    y, slots, place, hold = space[0], space[1], space[4], space[8]
    k_a = blocks_i[i, at.B_A]
    k_b = blocks_i[i, at.B_B]
    set_wrenches(blocks_i, i, work, place, at.PLACE_P, k_a, 0, 1.0, hold)
    set_wrenches(blocks_i, i, work, place, at.PLACE_Q, k_b, 1, -1.0, hold)
    slot = 0
    while k_a > 0 or k_b > 0:
        if k_a == k_b:
            for n in range(18):
                hold[0, n] += hold[1, n]
            k_b = 0
        if k_a > k_b:
            slot = past(rows, work, k_a, hold, 0, y, slots, i, slot)
            k_a = 0 if rows[k_a, at.KIND] == at.FREE else rows[k_a, at.PARENT]
        else:
            slot = past(rows, work, k_b, hold, 1, y, slots, i, slot)
            k_b = 0 if rows[k_b, at.KIND] == at.FREE else rows[k_b, at.PARENT]
    slots[i, at.SLOTS] = slot


@part
def past(rows, work, k, hold, side, y, slots, i, slot):
    """Three wrenches past joint k, which keeps its share of each; the next free slot."""
    kind = rows[k, at.KIND]
    j = rows[k, at.VI]
    if kind <= at.TRANSLATE:
        h = load(work, k, at.H)
        u0 = load(work, k, at.U)
        u1 = load(work, k, at.U + 3)
        link = load(work, k, at.L)
        d = work[k, at.D]
        for c in range(3):
            moment = load(hold, side, 6 * c)
            force = load(hold, side, 6 * c + 3)
            share = dot(h, moment) if kind == at.ROTATE else dot(h, force)
            y[i, 3 * slot + c] = share
            moment = add_scaled(moment, -share * d, u0)
            force = add_scaled(force, -share * d, u1)
            store(hold, side, 6 * c, add_cross(moment, link, force))
            store(hold, side, 6 * c + 3, force)
        slots[i, at.SLOT + slot] = j
        return slot + 1
    if kind == at.BALL:
        past_ball(work, k, hold, side, y, i, slot)
        for n in range(3):
            slots[i, at.SLOT + slot + n] = j + n
        return slot + 3
    into_free(work, k, hold, side, y, i, slot)
    for n in range(6):
        slots[i, at.SLOT + slot + n] = j + n
    return slot + 6


@part
def past_ball(work, k, hold, side, y, i, slot):
    """A ball passes a force on, and no moment."""
    _, b, _ = load_inertia(work, k)
    f = load6(work, k, at.U)
    link = load(work, k, at.L)
    for c in range(3):
        moment = load(hold, side, 6 * c)
        force = load(hold, side, 6 * c + 3)
        share = forward3(f, moment)
        for n in range(3):
            y[i, 3 * (slot + n) + c] = share[n]
        force = sub(force, mul_t(b, solve3(f, moment)))
        store(hold, side, 6 * c, cross(link, force))
        store(hold, side, 6 * c + 3, force)


@part
def into_free(work, k, hold, side, y, i, slot):
    """The last joint that feels a wrench: a free one transmits nothing."""
    for r in range(6):
        ir = at.IA + r * (r + 1) // 2
        for c in range(3):
            share = hold[side, 6 * c + r]
            for n in range(r):
                share -= work[k, ir + n] * y[i, 3 * (slot + n) + c]
            y[i, 3 * (slot + r) + c] = share


@part
def carry_coordinates(rows, const, blocks, i, work, space):
    """Y of a coordinate row: unit torques on the joints of its terms, and back on their parents."""
    blocks_i, _, terms_i, terms_f, _, _ = blocks
    y, slots, whole, hold = space[0], space[1], space[7], space[8]
    for n in range(18):
        hold[0, n] = 0.0
    slot = 0
    for k in range(rows.shape[0] - 1, 0, -1):
        first = blocks_i[i, at.B_TERM]
        for n in range(first, first + blocks_i[i, at.B_TERMS]):
            column = terms_i[n, 0] - rows[k, at.VI]
            if 0 <= column < width_of(rows[k, at.KIND]):
                push(rows, const, work, k, column, terms_f[n], whole)
        if not any_of(whole, k):
            continue
        for n in range(6):
            hold[0, n] = whole[k, n]
            whole[k, n] = 0.0
        slot = past(rows, work, k, hold, 0, y, slots, i, slot)
        p = rows[k, at.PARENT]
        if p > 0 and rows[k, at.KIND] != at.FREE:
            accumulate(whole, p, 0, load(hold, 0, 0))
            accumulate(whole, p, 3, load(hold, 0, 3))
    slots[i, at.SLOTS] = slot


@part
def width_of(kind):
    """Degrees of freedom of a row."""
    return 1 if kind <= at.TRANSLATE else 3 if kind == at.BALL else 6


@part
def any_of(whole, k):
    """Whether a wrench reaches row k."""
    found = False
    for n in range(6):
        found = found or whole[k, n] != 0.0
    return found


@part
def push(rows, const, work, k, column, size, whole):
    """Add the wrench pair of a unit joint force in one coordinate of row k, eq. (23)."""
    p = rows[k, at.PARENT]
    kind = rows[k, at.KIND]
    if kind <= at.TRANSLATE:
        x = scale(size, load(work, k, at.H))
        turns = kind == at.ROTATE
    else:
        axes = base_axes(const, work, p, k)
        c = column % 3
        x = scale(size, (axes[c], axes[c + 3], axes[c + 6]))
        turns = column < 3
    if turns:
        accumulate(whole, k, 0, x)
        if p > 0:
            accumulate(whole, p, 0, scale(-1.0, x))
    else:
        accumulate(whole, k, 3, x)
        if p > 0:
            accumulate(whole, p, 0, scale(-1.0, cross(load(work, k, at.L), x)))
            accumulate(whole, p, 3, scale(-1.0, x))


@part
def spread(rows, const, work, step):
    """M⁻¹ Jᵀ λ from diag(1/d) Yᵀ λ, both in `step`: the response of all joints. Overwrites P."""
    store(work, 0, at.P, (0.0, 0.0, 0.0))
    store(work, 0, at.P + 3, (0.0, 0.0, 0.0))
    for k in range(1, rows.shape[0]):
        p = rows[k, at.PARENT]
        i = rows[k, at.VI]
        kind = rows[k, at.KIND]
        alpha = load(work, p, at.P)
        linear = add_cross(load(work, p, at.P + 3), alpha, load(work, k, at.L))
        if kind <= at.TRANSLATE:
            u = dot(load(work, k, at.U), alpha) + dot(load(work, k, at.U + 3), linear)
            x = step[i] - work[k, at.D] * u
            step[i] = x
            if kind == at.ROTATE:
                alpha = add_scaled(alpha, x, load(work, k, at.H))
            else:
                linear = add_scaled(linear, x, load(work, k, at.H))
        elif kind == at.BALL:
            _, b, _ = load_inertia(work, k)
            f = load6(work, k, at.U)
            turned = backward3(f, (step[i], step[i + 1], step[i + 2]))
            turned = sub(turned, solve3(f, mul(b, linear)))
            axes = base_axes(const, work, p, k)
            store3(step, i, mul_t(axes, sub(turned, alpha)))
            alpha = turned
        else:
            for n in range(6):
                work[k, at.U + n] = step[i + n]
            backward6(work, k, at.U)
            axes = base_axes(const, work, p, k)
            store3(step, i, mul_t(axes, sub(load(work, k, at.U), alpha)))
            store3(step, i + 3, mul_t(axes, sub(load(work, k, at.U + 3), linear)))
            alpha = load(work, k, at.U)
            linear = load(work, k, at.U + 3)
        store(work, k, at.P, alpha)
        store(work, k, at.P + 3, linear)
