"""What unit multipliers do in the joints: wrenches carried along their paths to the ground.

Carried by the articulated factors, they give Y with Ω = J M⁻¹ Jᵀ = Y diag(1/d) Yᵀ, without a mass
matrix ([Featherstone 2008, ch. 8], [Wensing et al. 2012]). Only joints on the paths are stored.
"""

from .. import layout as at
from ..compiler.jit import part
from ..compiler.triple import numbers, store_triple, triple
from ..tree.factors import backward3, backward6, forward3, solve3
from ..tree.kinematics import base_axes, load_inertia
from ..vec import (
    accumulate,
    add,
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
def unit_wrenches(blocks_i, i, work, place, column, k, sign):
    """The block's unit wrenches on row k, at its origin: (moment, force), of triples."""
    arm = sub(load(place, i, column), load(work, k, at.X))
    size = blocks_i[i, at.B_SIZE]
    none = (0.0, 0.0, 0.0)
    a = scale(sign, load(place, i, at.PLACE_D))
    b = scale(sign, load(place, i, at.PLACE_D + 3)) if size > 1 else none
    c = scale(sign, load(place, i, at.PLACE_D + 6)) if size > 2 else none
    d = (triple(a[0], b[0], c[0]), triple(a[1], b[1], c[1]), triple(a[2], b[2], c[2]))
    if blocks_i[i, at.B_TYPE] == at.T_ALIGN:
        return d, no_triples()
    return cross(arm, d), d


@part
def no_triples():
    return (triple(0.0, 0.0, 0.0), triple(0.0, 0.0, 0.0), triple(0.0, 0.0, 0.0))


@part
def meeting(rows, a, b):
    """The last row that is on the paths of both rows to the ground."""
    if b == 0:
        return b
    while a != b:
        if a > b:
            a = rows[a, at.PARENT]
        else:
            b = rows[b, at.PARENT]
    return a


@part
def carry(rows, blocks_i, i, work, space):
    """Y of a block between bodies: from B and from A to where they meet, and on from there."""
    y, slots, place = space.y, space.slots, space.place
    a = blocks_i[i, at.B_A]
    b = blocks_i[i, at.B_B]
    meet = meeting(rows, a, b)
    moment, force = no_triples(), no_triples()
    moment_b, force_b = moment, force
    slot = 0
    for leg in range(3):
        k = meet
        if leg == 0:
            k = b
        elif leg == 1:
            k = a
        stop = 0 if leg == 2 else meet
        if leg == 2:
            moment, force = add(moment_b, moment), add(force_b, force)
        elif k > 0:
            moment_b, force_b = moment, force
            column = at.PLACE_Q if leg == 0 else at.PLACE_P
            moment, force = unit_wrenches(blocks_i, i, work, place, column, k, 2.0 * leg - 1.0)
        while k > stop:
            moment, force, slot = past(rows, work, k, moment, force, y, slots, i, slot)
            k = 0 if rows[k, at.KIND] == at.FREE else rows[k, at.PARENT]
    slots[i, at.SLOTS] = slot


@part
def past(rows, work, k, moment, force, y, slots, i, slot):
    """(three wrenches past joint k, the next free slot); the joint keeps its share of each."""
    kind = rows[k, at.KIND]
    width = width_of(kind)
    for n in range(width):
        slots[i, at.SLOT + slot + n] = rows[k, at.VI] + n
    link = load(work, k, at.L)
    if kind <= at.TRANSLATE:
        h = load(work, k, at.H)
        share = dot(h, moment) if kind == at.ROTATE else dot(h, force)
        store_triple(y, i, 3 * slot, share)
        passed = -work[k, at.D] * share
        force = add_scaled(force, passed, load(work, k, at.U + 3))
        moment = add_cross(add_scaled(moment, passed, load(work, k, at.U)), link, force)
    elif kind == at.BALL:  # it passes a force on, and no moment
        force = past_ball(work, k, moment, force, y, i, slot)
        moment = cross(link, force)
    else:  # the last joint that feels a wrench
        into_free(work, k, moment, force, y, i, slot)
        moment, force = no_triples(), no_triples()
    return moment, force, slot + width


@part
def past_ball(work, k, moment, force, y, i, slot):
    """The force behind a ball."""
    _, b, _ = load_inertia(work, k)
    f = load6(work, k, at.U)
    share = forward3(f, moment)
    for n in range(3):
        store_triple(y, i, 3 * (slot + n), share[n])
    return sub(force, mul_t(b, solve3(f, moment)))


@part
def into_free(work, k, moment, force, y, i, slot):
    """L⁻¹ of wrenches on a free row."""
    a = at.IA
    y0, y1, y2 = moment
    y3, y4, y5 = force
    y1 -= work[k, a + 1] * y0
    y2 -= work[k, a + 3] * y0 + work[k, a + 4] * y1
    y3 -= work[k, a + 6] * y0 + work[k, a + 7] * y1 + work[k, a + 8] * y2
    y4 -= work[k, a + 10] * y0 + work[k, a + 11] * y1 + work[k, a + 12] * y2
    y4 -= work[k, a + 13] * y3
    y5 -= work[k, a + 15] * y0 + work[k, a + 16] * y1 + work[k, a + 17] * y2
    y5 -= work[k, a + 18] * y3 + work[k, a + 19] * y4
    share = (y0, y1, y2, y3, y4, y5)
    for n in range(6):
        store_triple(y, i, 3 * (slot + n), share[n])


@part
def carry_coordinates(rows, const, blocks, i, work, space):
    """Y of a coordinate row: unit torques on the joints of its terms, and back on their parents."""
    blocks_i, terms_i, terms_f = blocks.blocks_i, blocks.terms_i, blocks.terms_f
    y, slots, whole = space.y, space.slots, space.carried
    none = (0.0, 0.0, 0.0)
    slot = 0
    for k in range(rows.shape[0] - 1, 0, -1):
        first = blocks_i[i, at.B_TERM]
        for n in range(first, first + blocks_i[i, at.B_TERMS]):
            column = terms_i[n, 0] - rows[k, at.VI]
            if 0 <= column < width_of(rows[k, at.KIND]):
                push(rows, const, work, k, column, terms_f[n], whole)
        if not any_of(whole, k):
            continue
        moment, force = alone(load(whole, k, 0)), alone(load(whole, k, 3))
        store(whole, k, 0, none)
        store(whole, k, 3, none)
        moment, force, slot = past(rows, work, k, moment, force, y, slots, i, slot)
        p = rows[k, at.PARENT]
        if p > 0 and rows[k, at.KIND] != at.FREE:
            accumulate(whole, p, 0, first_of(moment))
            accumulate(whole, p, 3, first_of(force))
    slots[i, at.SLOTS] = slot


@part
def alone(x):
    """A vector as the first of three."""
    return (triple(x[0], 0.0, 0.0), triple(x[1], 0.0, 0.0), triple(x[2], 0.0, 0.0))


@part
def first_of(x):
    """The first of three vectors."""
    return (numbers(x[0])[0], numbers(x[1])[0], numbers(x[2])[0])


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
