"""Constraint blocks: where their rows act, and what they leave open in place, speed, acceleration.

A row between bodies is a force along d, or a torque about t, on A at a point p, and its opposite
on B at the same point; a whole point (three rows) acts along the world's axes at both its ends.
With u = v_A(p) - v_B(p) of the two bodies' material points

    g' = d · u                                       g' = t · (ω_A - ω_B)
    g'' = d · (v'_A - v'_B) + d · e + u · (s × d)    g'' = t · (ω'_A - ω'_B) + t' · (ω_A - ω_B)

where e is what p itself moves through the bodies and s what d turns by; each type of block below
says its own. A coordinate row is Σ c q, or Σ c v, that follows a number or a curve over time.
"""

import math

from .. import layout as at
from ..compiler.jit import part
from ..tree.kinematics import linear_velocity
from ..vec import (
    add,
    add_cross,
    add_scaled,
    cross,
    dot,
    load,
    load9,
    mul,
    scale,
    store,
    store3,
    store9,
    sub,
)


@part
def velocities(rows, const, work, v, linear):
    """Velocities of all origins, eq. (5)."""
    for k in range(1, rows.shape[0]):
        before = load(linear, rows[k, at.PARENT], 0)
        store(linear, k, 0, linear_velocity(rows, const, work, v, k, before))


@part
def along_coordinates(kind):
    """Whether a block's row is over coordinates, not between bodies."""
    return kind == at.T_COORD or kind == at.T_VELOCITY or kind == at.T_LIMIT


@part
def direction(table, i, column, r, work, k):
    """Direction r of block i, which is fixed in row k, in world axes."""
    return mul(load9(work, k, at.R), load(table, i, column + 3 * r))


@part
def fixed_point(table, i, column, work, k):
    """A point of block i, which is fixed in row k, in the world."""
    return add(load(work, k, at.X), mul(load9(work, k, at.R), load(table, i, column)))


@part
def lean(e, n):
    """(m, |m|): what is left of the plane's normal n across a disc's axis e."""
    m = add_scaled(n, -dot(n, e), e)
    return m, math.sqrt(dot(m, m))


@part
def to_contact(blocks_i, blocks_f, i, work):
    """ρ: from a rolling body's centre to where it touches the plane."""
    n = direction(blocks_f, i, at.DIR, 0, work, blocks_i[i, at.B_B])
    radius = blocks_f[i, at.VALUE]
    if blocks_i[i, at.B_TYPE] == at.T_SPHERE:
        return scale(-radius, n)
    e = direction(blocks_f, i, at.AIM, 0, work, blocks_i[i, at.B_A])
    m, size = lean(e, n)
    return scale(-radius / size, m)


@part
def locate(blocks, work, place):
    """Where and along what every active block acts; coordinate rows act nowhere."""
    blocks_i, blocks_f, active = blocks.blocks_i, blocks.blocks_f, blocks.active
    for j in range(1, active[0] + 1):
        i = active[j]
        kind = blocks_i[i, at.B_TYPE]
        if along_coordinates(kind):
            continue
        if kind == at.T_CONTACT:
            store(place, i, at.PLACE_P, load(blocks_f, i, at.PA))
            store(place, i, at.PLACE_Q, load(blocks_f, i, at.PA))
            store9(place, i, at.PLACE_D, load9(blocks_f, i, at.DIR))
            continue
        a = blocks_i[i, at.B_A]
        b = blocks_i[i, at.B_B]
        p = fixed_point(blocks_f, i, at.PA, work, a)
        if kind == at.T_SPHERE or kind == at.T_DISC:
            p = add(p, to_contact(blocks_i, blocks_f, i, work))
        store(place, i, at.PLACE_P, p)
        store(place, i, at.PLACE_Q, p)
        if whole_point(blocks_i, i):
            store9(place, i, at.PLACE_D, (1.0, 0.0, 0.0, 0.0, 1.0, 0.0, 0.0, 0.0, 1.0))
            store(place, i, at.PLACE_Q, fixed_point(blocks_f, i, at.PB, work, b))
        elif kind == at.T_DISTANCE:
            apart = sub(p, fixed_point(blocks_f, i, at.PB, work, b))
            size = math.sqrt(dot(apart, apart))
            store(place, i, at.PLACE_D, scale(1.0 / size, apart))
        else:
            for r in range(blocks_i[i, at.B_SIZE]):
                store(place, i, at.PLACE_D + 3 * r, row_direction(blocks_i, blocks_f, i, r, work))


@part
def whole_point(blocks_i, i):
    """Whether block i holds a point in all directions."""
    return blocks_i[i, at.B_TYPE] == at.T_POINT and blocks_i[i, at.B_SIZE] == 3


@part
def turns_with_speed(blocks):
    """Whether rows of an active block turn with velocities of points, as `turning` says."""
    blocks_i, active = blocks.blocks_i, blocks.active
    found = False
    for j in range(1, active[0] + 1):
        i = active[j]
        kind = blocks_i[i, at.B_TYPE]
        still = along_coordinates(kind) or kind == at.T_ALIGN or whole_point(blocks_i, i)
        found = found or not still
    return found


@part
def row_direction(blocks_i, blocks_f, i, r, work):
    """d, or t, of row r of a block whose directions are fixed in its bodies."""
    kind = blocks_i[i, at.B_TYPE]
    if kind == at.T_BLADE:
        return direction(blocks_f, i, at.AIM, r, work, blocks_i[i, at.B_A])
    d = direction(blocks_f, i, at.DIR, r, work, blocks_i[i, at.B_B])
    if kind == at.T_ALIGN:
        return cross(direction(blocks_f, i, at.AIM, r, work, blocks_i[i, at.B_A]), d)
    return d


@part
def followed(blocks_i, blocks_f, curves, i, t, order):
    """What a coordinate row follows, or its first or second derivative in time."""
    count = blocks_i[i, at.B_KNOTS]
    k = blocks_i[i, at.B_CURVE]
    if count == 0:
        return blocks_f[i, at.VALUE] if order == 0 else 0.0
    if count == at.SINE:
        rate = curves[k, 2]
        angle = rate * t + curves[k, 3]
        if order == 0:
            return curves[k, 0] + curves[k, 1] * math.sin(angle)
        if order == 1:
            return curves[k, 1] * rate * math.cos(angle)
        return -curves[k, 1] * rate * rate * math.sin(angle)
    last = k + count - 1
    while k < last and t >= curves[k + 1, 0]:
        k += 1
    s = t - curves[k, 0]
    if s < 0.0:
        return curves[k, 1] if order == 0 else 0.0
    if order == 0:
        return curves[k, 1] + s * (curves[k, 2] + s * (curves[k, 3] + s * curves[k, 4]))
    if order == 1:
        return curves[k, 2] + s * (2.0 * curves[k, 3] + s * 3.0 * curves[k, 4])
    return 2.0 * curves[k, 3] + s * 6.0 * curves[k, 4]


@part
def total(blocks_i, terms_i, terms_f, i, column, x):
    """Σ c x of a coordinate row over entries of q or v."""
    sum_ = 0.0
    first = blocks_i[i, at.B_TERM]
    for n in range(first, first + blocks_i[i, at.B_TERMS]):
        sum_ += terms_f[n] * x[terms_i[n, column]]
    return sum_


@part
def residual(blocks, work, space, t, q, out):
    """g of the active blocks [m, rad], after `locate`; zero where only a velocity is bound."""
    blocks_i, blocks_f, terms_i, terms_f, curves, active = blocks
    place, slots = space.place, space.slots
    for j in range(1, active[0] + 1):
        i = active[j]
        kind = blocks_i[i, at.B_TYPE]
        at_r = slots[i, at.FIRST]
        a = blocks_i[i, at.B_A]
        b = blocks_i[i, at.B_B]
        for r in range(blocks_i[i, at.B_SIZE]):
            out[at_r + r] = 0.0
        if kind == at.T_POINT or kind == at.T_SPHERE or kind == at.T_DISC:
            apart = sub(load(place, i, at.PLACE_P), fixed_point(blocks_f, i, at.PB, work, b))
            for r in range(blocks_i[i, at.B_SIZE] if kind == at.T_POINT else 1):
                out[at_r + r] = dot(load(place, i, at.PLACE_D + 3 * r), apart)
        elif kind == at.T_ALIGN:
            for r in range(blocks_i[i, at.B_SIZE]):
                aim = direction(blocks_f, i, at.AIM, r, work, a)
                out[at_r + r] = dot(aim, direction(blocks_f, i, at.DIR, r, work, b))
        elif kind == at.T_DISTANCE:
            apart = sub(load(place, i, at.PLACE_P), fixed_point(blocks_f, i, at.PB, work, b))
            out[at_r] = math.sqrt(dot(apart, apart)) - blocks_f[i, at.VALUE]
        elif kind == at.T_COORD or kind == at.T_LIMIT:
            out[at_r] = total(blocks_i, terms_i, terms_f, i, 1, q)
            out[at_r] -= followed(blocks_i, blocks_f, curves, i, t, 0)


@part
def point_velocity(work, linear, k, p):
    """Velocity of the material point of row k that is at p."""
    return add_cross(load(linear, k, 0), load(work, k, at.W), sub(p, load(work, k, at.X)))


@part
def slip(blocks_i, i, work, linear, place):
    """u of a force block: velocity of A's point against B's."""
    mine = point_velocity(work, linear, blocks_i[i, at.B_A], load(place, i, at.PLACE_P))
    return sub(mine, point_velocity(work, linear, blocks_i[i, at.B_B], load(place, i, at.PLACE_Q)))


@part
def residual_velocity(blocks, work, space, t, v, out):
    """g' = J v of the active blocks, less what they follow, after `locate` and `velocities`."""
    blocks_i, blocks_f, terms_i, terms_f, curves, active = blocks
    place, slots, linear = space.place, space.slots, space.linear
    for j in range(1, active[0] + 1):
        i = active[j]
        kind = blocks_i[i, at.B_TYPE]
        at_r = slots[i, at.FIRST]
        a = blocks_i[i, at.B_A]
        b = blocks_i[i, at.B_B]
        if along_coordinates(kind):
            order = 0 if kind == at.T_VELOCITY else 1
            out[at_r] = total(blocks_i, terms_i, terms_f, i, 0, v)
            out[at_r] -= followed(blocks_i, blocks_f, curves, i, t, order)
            continue
        if kind == at.T_ALIGN:
            u = sub(load(work, a, at.W), load(work, b, at.W))
        else:
            u = slip(blocks_i, i, work, linear, place)
        for r in range(blocks_i[i, at.B_SIZE]):
            out[at_r + r] = dot(load(place, i, at.PLACE_D + 3 * r), u)


@part
def point_acceleration(work, k, p):
    """V' of row k, left in P by the sweeps, taken to its material point at p (R6)."""
    r = sub(p, load(work, k, at.X))
    w = load(work, k, at.W)
    linear = add_cross(load(work, k, at.P + 3), load(work, k, at.P), r)
    return add(linear, cross(w, cross(w, r)))


@part
def rolled(blocks_i, blocks_f, i, work):
    """ρ' of a rolling block: how its contact point moves from the centre's place."""
    a = blocks_i[i, at.B_A]
    b = blocks_i[i, at.B_B]
    n = direction(blocks_f, i, at.DIR, 0, work, b)
    n_dot = cross(load(work, b, at.W), n)
    radius = blocks_f[i, at.VALUE]
    if blocks_i[i, at.B_TYPE] == at.T_SPHERE:
        return scale(-radius, n_dot)
    e = direction(blocks_f, i, at.AIM, 0, work, a)
    e_dot = cross(load(work, a, at.W), e)
    m, size = lean(e, n)
    m_dot = add_scaled(n_dot, -dot(n_dot, e) - dot(n, e_dot), e)
    m_dot = add_scaled(m_dot, -dot(n, e), e_dot)
    m_dot = add_scaled(m_dot, -dot(m, m_dot) / (size * size), m)
    return scale(-radius / size, m_dot)


@part
def turning(blocks_i, blocks_f, i, work, linear, p, u, d):
    """(e, s) of a force block but a whole point, which has none; d is its first direction."""
    kind = blocks_i[i, at.B_TYPE]
    a = blocks_i[i, at.B_A]
    b = blocks_i[i, at.B_B]
    w_a = load(work, a, at.W)
    w_b = load(work, b, at.W)
    none = (0.0, 0.0, 0.0)
    if kind == at.T_POINT:
        return none, scale(2.0, w_b)
    if kind == at.T_BLADE:
        return none, add(w_a, w_b)
    if kind == at.T_DISTANCE:
        apart = sub(p, fixed_point(blocks_f, i, at.PB, work, b))
        speed = add_cross(u, w_b, apart)
        d_dot = add_scaled(speed, -dot(d, speed), d)
        return scale(dot(d_dot, u) / math.sqrt(dot(apart, apart)), d), w_b
    centre = fixed_point(blocks_f, i, at.PA, work, a)
    moved = add(point_velocity(work, linear, a, centre), rolled(blocks_i, blocks_f, i, work))
    e = cross(w_a, sub(moved, point_velocity(work, linear, a, p)))
    return sub(e, cross(w_b, sub(moved, point_velocity(work, linear, b, p)))), w_b


@part
def residual_acceleration(blocks, work, space, t, vdot, out):
    """g'' = J v' + J' v of the active blocks; gravity's offset cancels between two bodies."""
    blocks_i, blocks_f, terms_i, terms_f, curves, active = blocks
    place, slots, linear = space.place, space.slots, space.linear
    for j in range(1, active[0] + 1):
        i = active[j]
        kind = blocks_i[i, at.B_TYPE]
        at_r = slots[i, at.FIRST]
        a = blocks_i[i, at.B_A]
        b = blocks_i[i, at.B_B]
        if along_coordinates(kind):
            order = 2 if kind == at.T_COORD else 1
            out[at_r] = total(blocks_i, terms_i, terms_f, i, 0, vdot)
            out[at_r] -= followed(blocks_i, blocks_f, curves, i, t, order)
        elif kind == at.T_ALIGN:
            align_acceleration(blocks_i, blocks_f, i, work, place, out, at_r)
        elif whole_point(blocks_i, i):
            mine = point_acceleration(work, a, load(place, i, at.PLACE_P))
            store3(out, at_r, sub(mine, point_acceleration(work, b, load(place, i, at.PLACE_Q))))
        else:
            p = load(place, i, at.PLACE_P)
            d = load(place, i, at.PLACE_D)
            u = slip(blocks_i, i, work, linear, place)
            e, s = turning(blocks_i, blocks_f, i, work, linear, p, u, d)
            other = load(place, i, at.PLACE_Q)
            apart = sub(point_acceleration(work, a, p), point_acceleration(work, b, other))
            apart = add(apart, e)
            for r in range(blocks_i[i, at.B_SIZE]):
                d = load(place, i, at.PLACE_D + 3 * r)
                out[at_r + r] = dot(d, apart) + dot(u, cross(s, d))


@part
def align_acceleration(blocks_i, blocks_f, i, work, place, out, at_r):
    """g'' of rows a · b: t = a × b turns with both bodies."""
    k = blocks_i[i, at.B_A]
    n = blocks_i[i, at.B_B]
    w_a = load(work, k, at.W)
    w_b = load(work, n, at.W)
    u = sub(w_a, w_b)
    apart = sub(load(work, k, at.P), load(work, n, at.P))
    for r in range(blocks_i[i, at.B_SIZE]):
        a = direction(blocks_f, i, at.AIM, r, work, k)
        b = direction(blocks_f, i, at.DIR, r, work, n)
        t_dot = add(cross(cross(w_a, a), b), cross(a, cross(w_b, b)))
        out[at_r + r] = dot(load(place, i, at.PLACE_D + 3 * r), apart) + dot(t_dot, u)
