"""Constraint blocks: points of action, and residuals of position, velocity and acceleration.

A row between two bodies applies a force along d, or a torque about t, to A at a point p, and the
opposite force or torque to B at the same point. A pin (three rows) acts along the world's axes at
both its ends. With u = v_A(p) - v_B(p) of the two bodies' material points

    g' = d · u                                       g' = t · (ω_A - ω_B)
    g'' = d · (v'_A - v'_B) + d · e + u · (s × d)    g'' = t · (ω'_A - ω'_B) + t' · (ω_A - ω_B)

Here e is the velocity of p relative to the bodies, and s is the angular velocity of d. Both depend
on the type of the block. Coordinate rows are in `coordinates`.
"""

import math

from .. import layout as at
from ..cables import cable_acceleration, cable_length, cable_rate, first_span
from ..compiler.jit import part
from ..compiler.masks import chosen, more
from ..layout import (
    T_ALIGN,
    T_BLADE,
    T_CABLE,
    T_CONTACT,
    T_COORD,
    T_CURVE,
    T_DISTANCE,
    T_FRICTION,
    T_LIMIT,
    T_PIN,
    T_POINT,
    T_RELATION,
    T_ROUND,
    T_SLACK,
    T_SPAN,
    T_TURN,
    T_VELOCITY,
    T_WRAP,
)
from ..rows import (
    acceleration_of,
    number,
    origin_of,
    parent_of,
    point_acceleration,
    point_velocity,
    rotation_of,
    spin_of,
    vector,
)
from ..tree.kinematics import linear_velocity
from ..vec import add, add_cross, add_scaled, cross, dot, load, mul, scale, store, store3, sub
from .coordinates import bending, followed, follower_of, relate, speed_along, total
from .curves import curve_gap, follow_curve, turn_along

# -- columns of a block, of where it acts, and of the joints that it moves ------------------------


type_of, _ = number(at.B_TYPE)
size_of, _ = number(at.B_SIZE)  # number of rows, 1 to 3
value_of, _ = number(at.VALUE)  # length, radius [m], offset [rad, m] or velocity of a block
place_a, set_place_a = vector(at.PLACE_P)  # the point on A at which a block acts
place_b, set_place_b = vector(at.PLACE_Q)  # and on B
first_of, _ = number(at.FIRST)  # first row of an active block among all rows
joints_of, _ = number(at.SLOTS)  # number of joints on a block's paths


@part
def ends_of(blocks_i, i):
    """Return the tree rows of bodies A and B, 0 for the ground."""
    return blocks_i[i, at.B_A], blocks_i[i, at.B_B]


@part
def of_cable(kind):
    """Check whether a block is the length of a part of a cable, a bound on it, or its friction."""
    return kind == T_CABLE or kind == T_SLACK or kind == T_WRAP


@part
def lengthens(kind):
    """Return 1 if positive multipliers of a part of a cable lengthen it, or -1."""
    return 1.0 if kind == T_CABLE else -1.0


@part
def before_in_chain(blocks_i, i):
    """Return the number of blocks before it in the chain of a cable, 0 for other blocks."""
    return blocks_i[i, at.B_CHAIN]


@part
def stations_of(blocks_i, i):
    """Return the first and the last station of a cable."""
    first = blocks_i[i, at.B_STATION]
    return first, first + blocks_i[i, at.B_STATIONS] - 1


@part
def along(place, i, r):
    """Return the direction of row r of a block."""
    return load(place, i, at.PLACE_D + 3 * r)


@part
def set_place(place, i, on_a, on_b):
    set_place_a(place, i, on_a)
    set_place_b(place, i, on_b)


@part
def set_along(place, i, r, d):
    store(place, i, at.PLACE_D + 3 * r, d)


@part
def joint_of(slots, i, s):
    """Return the index into v of joint s on a block's paths."""
    return slots[i, at.SLOT + s]


# -- what blocks ask for --------------------------------------------------------------------------


@part
def velocities(rows, const, work, v, linear):
    """Compute the velocities of all origins, eq. (5)."""
    for k in range(1, rows.shape[0]):
        before = load(linear, parent_of(rows, k), 0)
        store(linear, k, 0, linear_velocity(rows, const, work, v, k, before))


@part
def along_coordinates(kind):
    """Check whether a block constrains coordinates instead of bodies."""
    sums = kind == T_COORD or kind == T_VELOCITY or kind == T_LIMIT or kind == T_FRICTION
    return sums or kind == T_RELATION


@part
def one_sided(kind):
    """Check whether a block is unilateral: a contact, a limit, or a bound on a length."""
    return kind == T_CONTACT or kind == T_LIMIT or kind == T_SPAN or kind == T_SLACK


@part
def dry(kind):
    """Check whether a block is bounded friction: of torsion, of a joint, or of a cable."""
    return kind == T_TURN or kind == T_FRICTION or kind == T_WRAP


@part
def slack_of(blocks_i, blocks_f, i):
    """Return the speed at which the gap of a unilateral block may close in this step [m/s]."""
    kind = type_of(blocks_i, i)
    if kind == T_CONTACT:
        return value_of(blocks_f, i)
    bounds = kind == T_SPAN or kind == T_LIMIT or kind == T_SLACK
    return blocks_f[i, at.AIM] if bounds else 0.0


@part
def set_slack(blocks_i, blocks_f, i, speed):
    """Set what `slack_of` returns for a unilateral block."""
    column = at.VALUE if type_of(blocks_i, i) == T_CONTACT else at.AIM
    blocks_f[i, column] = speed


@part
def span(blocks_f, i, work, a, b):
    """Compute (gap to the length bound, point on A, vector to it from B's point, signed length).

    The length is negative if the bound is an upper bound.
    """
    p = point_a(blocks_f, i, work, a)
    apart = sub(p, point_b(blocks_f, i, work, b))
    length = math.sqrt(dot(apart, apart))
    bound = value_of(blocks_f, i)
    signed = chosen(more(0.0, bound), -length, length)
    return signed - bound, p, apart, signed


@part
def direction_a(blocks_f, i, r, work, a):
    """Return direction r of block i, fixed in A, in world axes."""
    return mul(rotation_of(work, a), load(blocks_f, i, at.AIM + 3 * r))


@part
def direction_b(blocks_f, i, r, work, b):
    """Return direction r of block i, fixed in B, in world axes."""
    return mul(rotation_of(work, b), load(blocks_f, i, at.DIR + 3 * r))


@part
def point_a(blocks_f, i, work, a):
    """Return the point of block i fixed in A, in world coordinates."""
    return fixed_point(blocks_f, i, at.PA, work, a)


@part
def point_b(blocks_f, i, work, b):
    """Return the point of block i fixed in B, in world coordinates."""
    return fixed_point(blocks_f, i, at.PB, work, b)


@part
def fixed_point(table, i, column, work, k):
    """Return a point in row i of a table, fixed in row k of the tree, in world coordinates."""
    return add(origin_of(work, k), mul(rotation_of(work, k), load(table, i, column)))


@part
def to_contact(blocks_i, blocks_f, i, work):
    """Compute (ρ, m), the vector from a round body's centre to its contact point on the plane.

    With the semi-axes a_k and the plane's normal n, ρ = -Σ (a_k · n) a_k / m, where m is the
    distance of the centre from the plane, m² = Σ (a_k · n)².
    """
    a, b = ends_of(blocks_i, i)
    n = direction_b(blocks_f, i, 0, work, b)
    rho = (0.0, 0.0, 0.0)
    square = 0.0
    for k in range(3):
        axis = direction_a(blocks_f, i, k, work, a)
        height = dot(axis, n)
        rho = add_scaled(rho, -height, axis)
        square += height * height
    m = math.sqrt(square)
    return scale(1.0 / m, rho), m


@part
def locate(blocks, work, q, place):
    """Compute positions and directions of the active blocks, and the functions of relations."""
    blocks_i, blocks_f, active = blocks.blocks_i, blocks.blocks_f, blocks.active
    for j in range(1, active[0] + 1):
        i = active[j]
        kind = type_of(blocks_i, i)
        if kind == T_RELATION:
            relate(blocks, i, q, place)
        if along_coordinates(kind):
            continue
        if of_cable(kind):
            first, last = stations_of(blocks_i, i)
            p, ahead = first_span(blocks.stations, work, first, last)
            set_place(place, i, p, p)
            set_along(place, i, 0, scale(-lengthens(kind), ahead))
            continue
        if kind == T_CONTACT or kind == T_TURN:
            p = load(blocks_f, i, at.PA)
            set_place(place, i, p, p)
            for r in range(3):
                set_along(place, i, r, load(blocks_f, i, at.DIR + 3 * r))
            continue
        a, b = ends_of(blocks_i, i)
        p = point_a(blocks_f, i, work, a)
        if kind == T_ROUND:
            p = add(p, to_contact(blocks_i, blocks_f, i, work)[0])
        set_place(place, i, p, p)
        if kind == T_PIN:
            set_place(place, i, p, point_b(blocks_f, i, work, b))
            set_along(place, i, 0, (1.0, 0.0, 0.0))
            set_along(place, i, 1, (0.0, 1.0, 0.0))
            set_along(place, i, 2, (0.0, 0.0, 1.0))
        elif kind == T_CURVE:
            follow_curve(blocks, i, work, p, place)
        elif kind == T_DISTANCE:
            apart = sub(p, point_b(blocks_f, i, work, b))
            size = math.sqrt(dot(apart, apart))
            set_along(place, i, 0, scale(1.0 / size, apart))
        elif kind == T_SPAN:
            _, _, apart, signed = span(blocks_f, i, work, a, b)
            share = chosen(more(signed * signed, 0.0), 1.0 / signed, 0.0)
            set_along(place, i, 0, scale(share, apart))
        else:
            for r in range(size_of(blocks_i, i)):
                set_along(place, i, r, row_direction(blocks_i, blocks_f, i, r, work))


@part
def turns_with_speed(blocks):
    """Check whether any active block has rows that rotate with point velocities, see `turning`."""
    blocks_i, active = blocks.blocks_i, blocks.active
    found = False
    for j in range(1, active[0] + 1):
        i = active[j]
        kind = type_of(blocks_i, i)
        still = along_coordinates(kind) or kind == T_ALIGN or kind == T_PIN
        found = found or not still
    return found


@part
def row_direction(blocks_i, blocks_f, i, r, work):
    """Return d, or t, for row r of a block whose directions are fixed in its bodies."""
    kind = type_of(blocks_i, i)
    if kind == T_BLADE:
        return direction_a(blocks_f, i, r, work, ends_of(blocks_i, i)[0])
    d = direction_b(blocks_f, i, r, work, ends_of(blocks_i, i)[1])
    if kind == T_ALIGN:
        return cross(direction_a(blocks_f, i, r, work, ends_of(blocks_i, i)[0]), d)
    return d


@part
def prescribes(blocks, i):
    """Check whether a block prescribes a motion, so that its forces do work."""
    kind, follows = type_of(blocks.blocks_i, i), blocks.blocks_i[i, at.B_KNOTS] != 0
    runs = kind == T_VELOCITY and (follows or value_of(blocks.blocks_f, i) != 0.0)
    return runs or (kind == T_COORD and follows)


@part
def residual(blocks, work, space, t, q, out):
    """Compute g of the active blocks [m, rad] after `locate`, zero for velocity constraints."""
    blocks_i, blocks_f, terms_i, terms_f, curves, stations, active = blocks
    place, slots = space.place, space.slots
    for j in range(1, active[0] + 1):
        i = active[j]
        kind = type_of(blocks_i, i)
        at_r = first_of(slots, i)
        a, b = ends_of(blocks_i, i)
        for r in range(size_of(blocks_i, i)):
            out[at_r + r] = 0.0
        if kind == T_POINT or kind == T_PIN or kind == T_ROUND:
            apart = sub(place_a(place, i), point_b(blocks_f, i, work, b))
            for r in range(1 if kind == T_ROUND else size_of(blocks_i, i)):
                out[at_r + r] = dot(along(place, i, r), apart)
        elif kind == T_CURVE:
            apart = curve_gap(blocks, i, work, place_a(place, i))
            for r in range(size_of(blocks_i, i)):
                out[at_r + r] = dot(along(place, i, r), apart)
        elif kind == T_ALIGN:
            for r in range(size_of(blocks_i, i)):
                aim = direction_a(blocks_f, i, r, work, a)
                out[at_r + r] = dot(aim, direction_b(blocks_f, i, r, work, b))
        elif kind == T_DISTANCE:
            apart = sub(place_a(place, i), point_b(blocks_f, i, work, b))
            out[at_r] = math.sqrt(dot(apart, apart)) - value_of(blocks_f, i)
        elif kind == T_CABLE:
            first, last = stations_of(blocks_i, i)
            out[at_r] = cable_length(stations, work, q, first, last) - value_of(blocks_f, i)
        elif kind == T_COORD or kind == T_LIMIT:
            out[at_r] = total(blocks_i, terms_i, terms_f, i, 1, q)
            out[at_r] -= followed(blocks_i, blocks_f, curves, i, t, 0)
        elif kind == T_RELATION:
            out[at_r] = q[follower_of(blocks, i, 1)] - place[i, at.PLACE_VALUE]


@part
def slip(blocks_i, i, work, linear, place):
    """Return u for a force block: the velocity of A's point relative to B's."""
    mine = point_velocity(work, linear, ends_of(blocks_i, i)[0], place_a(place, i))
    return sub(mine, point_velocity(work, linear, ends_of(blocks_i, i)[1], place_b(place, i)))


@part
def residual_velocity(blocks, work, space, t, v, out):
    """Compute g' = J v less the prescribed rates, after `locate` and `velocities`.

    For contacts, this is the relative velocity of the surfaces, which may move relative to their
    bodies.
    """
    blocks_i, blocks_f, _, _, curves, stations, active = blocks
    place, slots, linear = space.place, space.slots, space.linear
    for j in range(1, active[0] + 1):
        i = active[j]
        kind = type_of(blocks_i, i)
        at_r = first_of(slots, i)
        a, b = ends_of(blocks_i, i)
        if along_coordinates(kind):
            order = 0 if kind == T_VELOCITY else 1
            out[at_r] = speed_along(blocks, place, i, v)
            if kind != T_RELATION:
                out[at_r] -= followed(blocks_i, blocks_f, curves, i, t, order)
            continue
        if of_cable(kind):
            first, last = stations_of(blocks_i, i)
            out[at_r] = lengthens(kind) * cable_rate(linear, stations, work, first, last)
            continue
        if kind == T_ALIGN or kind == T_TURN:
            u = sub(spin_of(work, a), spin_of(work, b))
        else:
            u = slip(blocks_i, i, work, linear, place)
        for r in range(size_of(blocks_i, i)):
            out[at_r + r] = dot(along(place, i, r), u)
            if kind == T_CONTACT or kind == T_TURN:
                out[at_r + r] += blocks_f[i, at.SURFACE + r]


@part
def rolled(blocks_i, blocks_f, i, work):
    """Compute ρ' of a round body, where ρ is the result of `to_contact`.

    With x = (ω_B - ω_A) × n, the velocity of n relative to A, this is
    ω_A × ρ + ((ρ · x) ρ - Σ (a_k · x) a_k) / m.
    """
    a, b = ends_of(blocks_i, i)
    n = direction_b(blocks_f, i, 0, work, b)
    rho, m = to_contact(blocks_i, blocks_f, i, work)
    x = cross(sub(spin_of(work, b), spin_of(work, a)), n)
    moved = scale(dot(rho, x), rho)
    for k in range(3):
        axis = direction_a(blocks_f, i, k, work, a)
        moved = add_scaled(moved, -dot(axis, x), axis)
    return add_scaled(cross(spin_of(work, a), rho), 1.0 / m, moved)


@part
def turning(blocks_i, blocks_f, i, work, linear, place, p, u, d):
    """Compute (e, s) for a force block with first direction d, except for `T_PIN`.

    The contact point of A moves by e more than the difference of V' of the two bodies at it, and
    the directions turn with s.
    """
    kind = type_of(blocks_i, i)
    a, b = ends_of(blocks_i, i)
    w_a = spin_of(work, a)
    w_b = spin_of(work, b)
    none = (0.0, 0.0, 0.0)
    if kind == T_POINT:
        return none, scale(2.0, w_b)
    if kind == T_CURVE:
        return none, add_scaled(turn_along(place, i, u), 2.0, w_b)
    if kind == T_BLADE:
        return none, add(w_a, w_b)
    if kind == T_CONTACT:  # a point of a ball of A stays above the same point of a plane of B
        rolling = scale(blocks_f[i, at.ROUND], cross(sub(w_a, w_b), d))
        return sub(cross(w_a, rolling), cross(w_b, add(rolling, u))), w_b
    if kind == T_DISTANCE:
        apart = sub(p, point_b(blocks_f, i, work, b))
        speed = add_cross(u, w_b, apart)
        d_dot = add_scaled(speed, -dot(d, speed), d)
        return scale(dot(d_dot, u) / math.sqrt(dot(apart, apart)), d), w_b
    centre = point_a(blocks_f, i, work, a)
    moved = add(point_velocity(work, linear, a, centre), rolled(blocks_i, blocks_f, i, work))
    e = cross(w_a, sub(moved, point_velocity(work, linear, a, p)))
    return sub(e, cross(w_b, sub(moved, point_velocity(work, linear, b, p)))), w_b


@part
def residual_acceleration(blocks, work, space, t, v, vdot, out):
    """Compute g'' = J v' + J' v for the active blocks. Gravity's offset cancels."""
    blocks_i, blocks_f, _, _, curves, stations, active = blocks
    place, slots, linear = space.place, space.slots, space.linear
    for j in range(1, active[0] + 1):
        i = active[j]
        kind = type_of(blocks_i, i)
        at_r = first_of(slots, i)
        a, b = ends_of(blocks_i, i)
        if along_coordinates(kind):
            order = 2 if kind == T_COORD else 1
            out[at_r] = speed_along(blocks, place, i, vdot)
            if kind == T_RELATION:
                out[at_r] -= bending(blocks, place, i, v)
            else:
                out[at_r] -= followed(blocks_i, blocks_f, curves, i, t, order)
        elif kind == T_CABLE:
            first, last = stations_of(blocks_i, i)
            out[at_r] = cable_acceleration(stations, work, linear, first, last)
        else:
            block_acceleration(blocks_i, blocks_f, i, work, linear, place, out, at_r)


@part
def turning_acceleration(blocks, work, space, v, out):
    """Compute J' v of the active blocks, after `accelerate` with v' = 0 and no gravity.

    Zero for a bound on a length, whose permitted speed includes it, and for a contact point whose
    way along its shapes is not known.
    """
    blocks_i, blocks_f, active = blocks.blocks_i, blocks.blocks_f, blocks.active
    for j in range(1, active[0] + 1):
        i = active[j]
        kind = type_of(blocks_i, i)
        at_r = first_of(space.slots, i)
        still = along_coordinates(kind) or kind == T_TURN or kind == T_SPAN
        still = still or (kind == T_CONTACT and blocks_f[i, at.ROUND] < 0.0)
        if kind == T_RELATION:
            out[at_r] = -bending(blocks, space.place, i, v)
        elif of_cable(kind):
            first, last = stations_of(blocks_i, i)
            rate = cable_acceleration(blocks.stations, work, space.linear, first, last)
            out[at_r] = lengthens(kind) * rate
        elif still:
            for r in range(size_of(blocks_i, i)):
                out[at_r + r] = 0.0
        else:
            block_acceleration(blocks_i, blocks_f, i, work, space.linear, space.place, out, at_r)


@part
def block_acceleration(blocks_i, blocks_f, i, work, linear, place, out, at_r):
    """Compute g'' of a block between bodies from row `at_r` of `out` on."""
    kind = type_of(blocks_i, i)
    a, b = ends_of(blocks_i, i)
    if kind == T_ALIGN:
        align_acceleration(blocks_i, blocks_f, i, work, place, out, at_r)
        return
    if kind == T_PIN:
        mine = point_acceleration(work, a, place_a(place, i))
        store3(out, at_r, sub(mine, point_acceleration(work, b, place_b(place, i))))
        return
    p = place_a(place, i)
    d = along(place, i, 0)
    u = slip(blocks_i, i, work, linear, place)
    e, s = turning(blocks_i, blocks_f, i, work, linear, place, p, u, d)
    other = place_b(place, i)
    apart = sub(point_acceleration(work, a, p), point_acceleration(work, b, other))
    apart = add(apart, e)
    for r in range(size_of(blocks_i, i)):
        d = along(place, i, r)
        out[at_r + r] = dot(d, apart) + dot(u, cross(s, d))


@part
def align_acceleration(blocks_i, blocks_f, i, work, place, out, at_r):
    """Compute g'' for rows a · b, where t = a × b rotates with both bodies."""
    k, n = ends_of(blocks_i, i)
    w_a = spin_of(work, k)
    w_b = spin_of(work, n)
    u = sub(w_a, w_b)
    apart = sub(acceleration_of(work, k)[0], acceleration_of(work, n)[0])
    for r in range(size_of(blocks_i, i)):
        a = direction_a(blocks_f, i, r, work, k)
        b = direction_b(blocks_f, i, r, work, n)
        t_dot = add(cross(cross(w_a, a), b), cross(a, cross(w_b, b)))
        out[at_r + r] = dot(along(place, i, r), apart) + dot(t_dot, u)
