"""Joint-space responses to unit multipliers: wrenches propagated along paths to the ground.

Propagation by the articulated factors gives Y with Ω = J M⁻¹ Jᵀ = Y diag(1/d) Yᵀ, without a mass
matrix ([Featherstone 2008, ch. 8], [Wensing et al. 2012]). Only joints on the paths with a nonzero
share of a wrench are stored.

A wrench without effect on a joint, such as a force on the axis of a hinge, leaves rounding there
unless the axis is a world axis. Points of a mechanism are known to about 1e-16 of their distances
from the origin, and loops are closed to 1e-14 of them. The moment of a unit force about an axis is
therefore set to zero if it is below 1e-13 of the coordinates from which the lever arm is computed.
The same applies to torques and to unit forces along sliders below 1e-13. Otherwise, rounding errors
in a row of zeros would act as a constraint.
"""

from ...tolerances import ROUNDING
from .. import layout as at
from ..compiler.jit import part
from ..compiler.lane import beyond, numbers, store_triple, triple
from ..compiler.masks import any_of
from ..layout import T_ALIGN, T_TURN
from ..linear import backward3, backward6, forward3, forward_free, pivots6, solve3, transposed6
from ..rows import (
    BALL,
    FREE,
    SCREW,
    TRANSLATE,
    axis_of,
    ball_of,
    inertia_of,
    inverse_pivot_of,
    kind_of,
    link_of,
    nv_of,
    origin_of,
    parent_of,
    pitch_of,
    projected_of,
    set_acceleration,
    set_solved,
    solved_of,
    v_of,
)
from ..tree.kinematics import along_axis, base_axes, carried, with_own
from ..vec import (
    accumulate,
    add,
    add_cross,
    add_scaled,
    cross,
    dot,
    load,
    load3,
    mul,
    mul_t,
    scale,
    store,
    store3,
    sub,
)
from .blocks import along, ends_of, place_a, place_b, size_of, terms_of, type_of


@part
def pivots(rows, work, dinv):
    """Compute 1/d for every degree of freedom, the diagonal between Y and Yᵀ."""
    for k in range(1, rows.shape[0]):
        i = v_of(rows, k)
        kind = kind_of(rows, k)
        if kind <= TRANSLATE:
            dinv[i] = inverse_pivot_of(work, k)
        elif kind == BALL:
            for n in range(3):
                dinv[i + n] = ball_of(work, k)[0][n]
        else:
            angular, linear = pivots6(work, k)
            store3(dinv, i, angular)
            store3(dinv, i + 3, linear)


@part
def unit_wrenches(blocks_i, i, work, place, k, sign):
    """Return the block's unit wrenches on row k, at its origin, as (moment, force) triples."""
    arm = sub(place_b(place, i) if sign < 0.0 else place_a(place, i), origin_of(work, k))
    size = size_of(blocks_i, i)
    none = (0.0, 0.0, 0.0)
    a = scale(sign, along(place, i, 0))
    b = scale(sign, along(place, i, 1)) if size > 1 else none
    c = scale(sign, along(place, i, 2)) if size > 2 else none
    d = (triple(a[0], b[0], c[0]), triple(a[1], b[1], c[1]), triple(a[2], b[2], c[2]))
    if torque_block(blocks_i, i):
        return d, no_triples()
    return cross(arm, d), d


@part
def torque_block(blocks_i, i):
    """Check whether a block's multipliers are torques, not forces."""
    return type_of(blocks_i, i) == T_ALIGN or type_of(blocks_i, i) == T_TURN


@part
def taxicab(x):
    """Return |x| + |y| + |z|."""
    return abs(x[0]) + abs(x[1]) + abs(x[2])


@part
def no_triples():
    return (triple(0.0, 0.0, 0.0), triple(0.0, 0.0, 0.0), triple(0.0, 0.0, 0.0))


@part
def meeting(rows, a, b):
    """Find the last row that lies on the paths of both rows to the ground."""
    if b == 0:
        return b
    while a != b:
        if a > b:
            a = parent_of(rows, a)
        else:
            b = parent_of(rows, b)
    return a


@part
def carry(rows, blocks_i, i, work, space):
    """Compute Y of a block between bodies, from A and B to their common row and the ground."""
    y, slots, place = space.y, space.slots, space.place
    a, b = ends_of(blocks_i, i)
    meet = meeting(rows, a, b)
    turns = torque_block(blocks_i, i)
    reach = taxicab(along(place, i, 0))
    if not turns:
        reach = taxicab(place_a(place, i)) + taxicab(place_b(place, i))
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
            moment, force = unit_wrenches(blocks_i, i, work, place, k, 2.0 * leg - 1.0)
        while k > stop:
            if not turns:
                reach = max(reach, taxicab(origin_of(work, k)) + taxicab(link_of(work, k)))
            moment, force, slot = past(rows, work, k, moment, force, reach, y, slots, i, slot)
            k = 0 if kind_of(rows, k) == FREE else parent_of(rows, k)
    slots[i, at.SLOTS] = slot


@part
def past(rows, work, k, moment, force, reach, y, slots, i, slot):
    """Propagate three wrenches past joint k and store the joint's share. Returns the next slot too.

    `reach` is the scale of coordinates in the moments. A joint without a share takes no slot.
    """
    kind = kind_of(rows, k)
    link = link_of(work, k)
    felt = True
    if kind <= TRANSLATE:
        least = ROUNDING * reach
        if kind == TRANSLATE:
            least = ROUNDING + 0.0 * reach
        elif kind == SCREW:
            least = ROUNDING * (reach + abs(pitch_of(work, k)))
        share = beyond(along_axis(work, k, kind, moment, force), least)
        felt = any_number(share)
        store_triple(y, i, 3 * slot, share)
        passed = -inverse_pivot_of(work, k) * share
        u0, u1 = projected_of(work, k)
        force = add_scaled(force, passed, u1)
        moment = add_cross(add_scaled(moment, passed, u0), link, force)
    elif kind == BALL:  # transmits a force, but no moment
        least = ROUNDING * reach
        moment = (beyond(moment[0], least), beyond(moment[1], least), beyond(moment[2], least))
        felt = any_number(moment[0]) or any_number(moment[1]) or any_number(moment[2])
        force = past_ball(work, k, moment, force, y, i, slot)
        moment = cross(link, force)
    else:  # the last joint that feels a wrench
        into_free(work, k, moment, force, y, i, slot)
        moment, force = no_triples(), no_triples()
    width = nv_of(kind) if felt else 0
    for n in range(width):
        slots[i, at.SLOT + slot + n] = v_of(rows, k) + n
    return moment, force, slot + width


@part
def any_number(x):
    """Check whether a number of a triple is nonzero in any lane."""
    a, b, c = numbers(x)
    return any_of(a) or any_of(b) or any_of(c)


@part
def past_ball(work, k, moment, force, y, i, slot):
    """Store the share of a ball joint and return the force behind it."""
    _, b, _ = inertia_of(work, k)
    f, _ = ball_of(work, k)
    share = forward3(f, moment)
    for n in range(3):
        store_triple(y, i, 3 * (slot + n), share[n])
    return sub(force, mul_t(b, solve3(f, moment)))


@part
def into_free(work, k, moment, force, y, i, slot):
    """Store L⁻¹ applied to wrenches on a free row."""
    share = forward_free(work, k, moment, force)
    for n in range(6):
        store_triple(y, i, 3 * (slot + n), share[n])


@part
def carry_coordinates(rows, const, blocks, i, work, space):
    """Compute Y of a coordinate row: unit torques on its terms, reactions on the parents."""
    blocks_i, terms_i, terms_f = blocks.blocks_i, blocks.terms_i, blocks.terms_f
    y, slots, whole = space.y, space.slots, space.carried
    none = (0.0, 0.0, 0.0)
    slot = 0
    for k in range(rows.shape[0] - 1, 0, -1):
        first, end = terms_of(blocks_i, i)
        for n in range(first, end):
            column = terms_i[n, 0] - v_of(rows, k)
            if 0 <= column < nv_of(kind_of(rows, k)):
                push(rows, const, work, k, column, terms_f[n], whole)
        if not reaches(whole, k):
            continue
        moment, force = alone(load(whole, k, 0)), alone(load(whole, k, 3))
        store(whole, k, 0, none)
        store(whole, k, 3, none)
        moment, force, slot = past(rows, work, k, moment, force, 0.0, y, slots, i, slot)
        p = parent_of(rows, k)
        if p > 0 and kind_of(rows, k) != FREE:
            accumulate(whole, p, 0, first_of(moment))
            accumulate(whole, p, 3, first_of(force))
    slots[i, at.SLOTS] = slot


@part
def alone(x):
    """Return a vector as the first of three."""
    return (triple(x[0], 0.0, 0.0), triple(x[1], 0.0, 0.0), triple(x[2], 0.0, 0.0))


@part
def first_of(x):
    """Return the first of three vectors."""
    return (numbers(x[0])[0], numbers(x[1])[0], numbers(x[2])[0])


@part
def reaches(whole, k):
    """Check whether a wrench acts on row k in any instance."""
    found = False
    for n in range(6):
        found = found or any_of(whole[k, n])
    return found


@part
def push(rows, const, work, k, column, size, whole):
    """Add the wrench pair for a unit joint force in one coordinate of row k, eq. (23)."""
    p = parent_of(rows, k)
    kind = kind_of(rows, k)
    if kind <= TRANSLATE:
        x = scale(size, axis_of(work, k))
        turns = kind < TRANSLATE
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
            accumulate(whole, p, 0, scale(-1.0, cross(link_of(work, k), x)))
            accumulate(whole, p, 3, scale(-1.0, x))


@part
def unspread(rows, const, work, speeds):
    """Invert `spread` in place: compute diag(1/d) Yᵀ λ whose response is `speeds`."""
    set_acceleration(work, 0, (0.0, 0.0, 0.0), (0.0, 0.0, 0.0))
    for k in range(1, rows.shape[0]):
        p = parent_of(rows, k)
        i = v_of(rows, k)
        kind = kind_of(rows, k)
        alpha, linear = carried(work, p, k)
        if kind <= TRANSLATE:
            u0, u1 = projected_of(work, k)
            x = speeds[i]
            speeds[i] = x + inverse_pivot_of(work, k) * (dot(u0, alpha) + dot(u1, linear))
            alpha, linear = with_own(work, k, kind, x, alpha, linear)
        elif kind == BALL:
            _, b, _ = inertia_of(work, k)
            f, _ = ball_of(work, k)
            axes = base_axes(const, work, p, k)
            alpha = add(mul(axes, load3(speeds, i)), alpha)
            x = add(alpha, solve3(f, mul(b, linear)))
            store3(speeds, i, (x[0] + f[3] * x[1] + f[4] * x[2], x[1] + f[5] * x[2], x[2]))
        else:
            axes = base_axes(const, work, p, k)
            alpha = add(mul(axes, load3(speeds, i)), alpha)
            linear = add(mul(axes, load3(speeds, i + 3)), linear)
            store3(speeds, i, alpha)
            store3(speeds, i + 3, linear)
            transposed6(work, k, speeds, i)
        set_acceleration(work, k, alpha, linear)


@part
def spread(rows, const, work, step):
    """Compute M⁻¹ Jᵀ λ, the response of all joints, from diag(1/d) Yᵀ λ in `step`, into V'."""
    set_acceleration(work, 0, (0.0, 0.0, 0.0), (0.0, 0.0, 0.0))
    for k in range(1, rows.shape[0]):
        p = parent_of(rows, k)
        i = v_of(rows, k)
        kind = kind_of(rows, k)
        alpha, linear = carried(work, p, k)
        if kind <= TRANSLATE:
            u0, u1 = projected_of(work, k)
            u = dot(u0, alpha) + dot(u1, linear)
            x = step[i] - inverse_pivot_of(work, k) * u
            step[i] = x
            alpha, linear = with_own(work, k, kind, x, alpha, linear)
        elif kind == BALL:
            _, b, _ = inertia_of(work, k)
            f, _ = ball_of(work, k)
            turned = backward3(f, (step[i], step[i + 1], step[i + 2]))
            turned = sub(turned, solve3(f, mul(b, linear)))
            axes = base_axes(const, work, p, k)
            store3(step, i, mul_t(axes, sub(turned, alpha)))
            alpha = turned
        else:
            set_solved(work, k, load3(step, i), load3(step, i + 3))
            backward6(work, k)
            axes = base_axes(const, work, p, k)
            angular, along = solved_of(work, k)
            store3(step, i, mul_t(axes, sub(angular, alpha)))
            store3(step, i + 3, mul_t(axes, sub(along, linear)))
            alpha, linear = angular, along
        set_acceleration(work, k, alpha, linear)
