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

from .. import layout as at
from ..cables import over_spans
from ..compiler.jit import part
from ..compiler.lane import numbers, triple
from ..compiler.masks import any_of
from ..layout import T_ALIGN, T_TURN
from ..motions import diagonal, feeling, gather, nv_of, past, respond, unit_wrench
from ..motions.wrenches import no_triples
from ..rows import (
    kind_of,
    link_of,
    origin_of,
    parent_of,
    set_acceleration,
    v_of,
)
from ..tree.kinematics import carried
from ..vec import (
    accumulate,
    add,
    add_cross,
    cross,
    load,
    scale,
    store,
    sub,
)
from .blocks import (
    along,
    before_in_chain,
    ends_of,
    joint_of,
    joints_of,
    lengthens,
    place_a,
    place_b,
    size_of,
    stations_of,
    type_of,
)
from .coordinates import coefficient, terms_of


@part
def pivots(rows, work, dinv):
    """Compute 1/d for every degree of freedom, the diagonal between Y and Yᵀ."""
    for k in range(1, rows.shape[0]):
        diagonal(rows, work, k, dinv)


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
            moment, force, slot = past_joint(rows, work, k, moment, force, reach, y, slots, i, slot)
            k = feeling(rows, k)
    slots[i, at.SLOTS] = slot


@part
def past_joint(rows, work, k, moment, force, reach, y, slots, i, slot):
    """Propagate three wrenches past joint k and store the joint's share. Returns the next slot too.

    `reach` is the scale of coordinates in the moments. A joint without a share takes no slot.
    """
    felt, moment, force = past(rows, work, k, moment, force, reach, y, i, slot)
    width = nv_of(kind_of(rows, k)) if felt else 0
    for n in range(width):
        slots[i, at.SLOT + slot + n] = v_of(rows, k) + n
    return moment, force, slot + width


@part
def carry_coordinates(rows, const, blocks, i, work, space):
    """Compute Y of a coordinate row: unit torques on its terms, reactions on the parents."""
    blocks_i, terms_i = blocks.blocks_i, blocks.terms_i
    y, slots, whole = space.y, space.slots, space.carried
    slot = 0
    for k in range(rows.shape[0] - 1, 0, -1):
        first, end = terms_of(blocks_i, i)
        for n in range(first, end):
            column = terms_i[n, 0] - v_of(rows, k)
            if 0 <= column < nv_of(kind_of(rows, k)):
                size = coefficient(blocks, space.place, i, n)
                push(rows, const, work, k, column, size, whole)
        if reaches(whole, k):
            slot = hand_on(rows, work, k, whole, 0.0, y, slots, i, slot)
    slots[i, at.SLOTS] = slot


@part
def hand_on(rows, work, k, whole, reach, y, slots, i, slot):
    """Propagate the wrench on row k past its joint. Returns the next slot."""
    none = (0.0, 0.0, 0.0)
    moment, force = alone(load(whole, k, 0)), alone(load(whole, k, 3))
    store(whole, k, 0, none)
    store(whole, k, 3, none)
    moment, force, slot = past_joint(rows, work, k, moment, force, reach, y, slots, i, slot)
    p = feeling(rows, k)
    if p > 0:
        accumulate(whole, p, 0, first_of(moment))
        accumulate(whole, p, 3, first_of(force))
    return slot


@part
def pull_apart(to, vias, work, n, p, q, along):
    """Add unit forces that lengthen a span, or shorten it. Returns the size of its places."""
    whole, sign = to
    a, b = vias[n - 1].row, vias[n].row
    if a > 0:
        force = scale(-sign, along)
        accumulate(whole, a, 0, cross(sub(p, origin_of(work, a)), force))
        accumulate(whole, a, 3, force)
    if b > 0:
        force = scale(sign, along)
        accumulate(whole, b, 0, cross(sub(q, origin_of(work, b)), force))
        accumulate(whole, b, 3, force)
    return taxicab(p) + taxicab(q)


pull_on_spans = over_spans(pull_apart)


@part
def carry_cable(rows, blocks, i, work, space):
    """Compute Y of a segment of a cable, from the bodies of all its stations to the ground."""
    y, slots, whole = space.y, space.slots, space.carried
    first, last = stations_of(blocks.blocks_i, i)
    sign = lengthens(type_of(blocks.blocks_i, i))
    reach = pull_on_spans((whole, sign), blocks.stations, work, first, last)
    slot = 0
    for k in range(rows.shape[0] - 1, 0, -1):
        if reaches(whole, k):
            reach = max(reach, taxicab(origin_of(work, k)) + taxicab(link_of(work, k)))
            slot = hand_on(rows, work, k, whole, reach, y, slots, i, slot)
    slots[i, at.SLOTS] = slot
    for n in range(before_in_chain(blocks.blocks_i, i)):
        add_joints(space, i - 1 - n, i)
        add_joints(space, i, i - 1 - n)


@part
def add_joints(space, i, other):
    """Add the joints of another block to block i, which does not move them, unless it moves none.

    Blocks whose laws depend on each other have the same joints.
    """
    y, slots = space.y, space.slots
    for s in range(joints_of(slots, other) if joints_of(slots, i) > 0 else 0):
        count, known = joints_of(slots, i), False
        for own in range(count):
            known = known or joint_of(slots, i, own) == joint_of(slots, other, s)
        if not known:
            slots[i, at.SLOT + count] = joint_of(slots, other, s)
            store(y, i, 3 * count, (0.0, 0.0, 0.0))
            slots[i, at.SLOTS] = count + 1


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
def push(rows, const, work, k, c, size, whole):
    """Add the wrench pair for a unit joint force in one coordinate of row k, eq. (23)."""
    p = parent_of(rows, k)
    w0, w1 = unit_wrench(rows, work, k, const, c)
    moment, force = scale(size, w0), scale(size, w1)
    accumulate(whole, k, 0, moment)
    accumulate(whole, k, 3, force)
    if p > 0:
        accumulate(whole, p, 0, scale(-1.0, add_cross(moment, link_of(work, k), force)))
        accumulate(whole, p, 3, scale(-1.0, force))


@part
def unspread(rows, const, work, speeds):
    """Invert `spread` in place: compute diag(1/d) Yᵀ λ whose response is `speeds`."""
    set_acceleration(work, 0, (0.0, 0.0, 0.0), (0.0, 0.0, 0.0))
    for k in range(1, rows.shape[0]):
        alpha, linear = carried(work, parent_of(rows, k), k)
        alpha, linear = gather(rows, work, k, const, speeds, alpha, linear)
        set_acceleration(work, k, alpha, linear)


@part
def spread(rows, const, work, step):
    """Compute M⁻¹ Jᵀ λ, the response of all joints, from diag(1/d) Yᵀ λ in `step`, into V'."""
    set_acceleration(work, 0, (0.0, 0.0, 0.0), (0.0, 0.0, 0.0))
    for k in range(1, rows.shape[0]):
        alpha, linear = carried(work, parent_of(rows, k), k)
        alpha, linear = respond(rows, work, k, const, step, alpha, linear)
        set_acceleration(work, k, alpha, linear)
