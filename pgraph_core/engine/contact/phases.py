"""The equations of motion with contact points in phases: swing, sliding, stance.

A stance is three bilateral rows, a limit one. A sliding point has its normal row, and a force
s (n - μ w) on the body with the slip direction w. With B the bilateral rows and the stances, Ω of
all rows and c_j = Ω_·n - μ Ω_·w of sliding point j,

    (C_S - Ω_SB Ω_BB⁺ C_B) s = r_S - Ω_SB Ω_BB⁺ r_B

is the only asymmetric part. A diagonal at or below zero is Painlevé's case.
"""

import math

from ...tolerances import EPS, ROUNDING, SOLVED
from .. import layout as at
from ..arrays import EFFECT, EVENT_SCENE, INTO_CONES, LAMBDA, RHS
from ..compiler.address import stored
from ..compiler.jit import kernel, part, sweep
from ..compiler.kinds import I1, plain, void
from ..constraints.blocks import first_of, locate, residual_acceleration, slip, velocities
from ..constraints.constraints import (
    couplings,
    driven_power,
    number_rows,
    respond,
    unit_responses,
    watch,
)
from ..constraints.proximal import factor_proximal, solve_proximal
from ..motion import ACCELERATION, call_acceleration
from ..records import ACCEPTANCE, SLIP, STANCE
from ..tree.kinematics import positions
from ..vec import add_scaled, dot, load, scale, store3, xyz

_save, opened_events = stored(EVENT_SCENE)

RANK = 64 * ROUNDING  # rounding behind a factor: of singular values and forces, relative
JACOBI_SWEEPS = 30
ORTHOGONAL = 8 * EPS  # cosine of two columns that are at right angles to rounding
SHARES = 200  # projections on cones and back
ON_CONE = 4 * ROUNDING  # tolerance of forces on their cones relative to the largest multiplier
OVER = 1.5  # over-relaxation


@kernel(void(I1, plain(EVENT_SCENE)), later=True)
def save_events(buffer, scene):
    """Store a scene with points for `opened_events`. `opened` returns the scene alone."""
    _save(buffer, scene)


@part
def slides(phase):
    """Check whether a point in this phase slides."""
    return phase in (SLIP, ACCEPTANCE)


@part
def tangential(points, s, u):
    """Return u without its component along the normal at point s."""
    n = xyz(points[s].normal)
    return add_scaled(u, -dot(u, n), n)


@part
def slip_direction(points, s, u):
    """Compute the direction of u, or `slip_direction` if u is zero or after the end of a slide.

    Friction rotates slow slip at the rate μ N w / |u|, which is too fast for an explicit step. The
    direction is therefore averaged with that at the start of the step, with the weight that keeps
    the step stable.
    """
    before = xyz(points[s].slip_direction)
    u = tangential(points, s, u)
    if not dot(u, before) > 0.0:
        return before
    weight = points[s].slip_tolerance
    blend = points[s].blend_speed
    if blend > 0.0:
        left = max(0.0, 1.0 - 0.25 * math.sqrt(dot(u, u)) / blend)
        weight += blend * left * left
    u = add_scaled(u, weight, before)
    return scale(1.0 / math.sqrt(dot(u, u)), u)


@kernel(ACCELERATION, nogil=True, later=True)
def event_acceleration(scene, t, q, v, tau, vdot, flow):
    """Compute `acceleration` with the points of the scene in their current phases."""
    phased = opened_events(scene)
    data, contact = phased.scene, phased.contact
    rows, const, blocks, work, space = data.rows, data.const, data.blocks, data.work, data.space
    links = contact.links
    call_acceleration(links.tree, (links.bare, t, q, v, tau, vdot, flow))
    if blocks.active[0] == 0:
        return 0
    vectors = space.vectors
    positions(rows, work)
    velocities(rows, const, work, v, space.linear)
    m = number_rows(blocks, space.slots)
    locate(blocks, work, q, space.place)
    residual_acceleration(blocks, work, space, t, v, vdot, vectors[RHS])
    for r in range(m):
        vectors[RHS, r] = -vectors[RHS, r]
    unit_responses(rows, const, blocks, work, space)
    couplings(blocks, space)
    flow[2] = 0.0
    flow[1] += solve_points(blocks, work, space, contact, m, flow)
    flow[0] += driven_power(blocks, space, v)
    watch(scene, t, q, v)  # rows of constraints come first: their pivots know nothing of points
    respond(rows, const, blocks, work, space)
    for j in range(vdot.shape[0]):
        vdot[j] += vectors[EFFECT, j]
    return 0


@sweep
def solve_points(blocks, work, space, contact, m, flow):
    """Compute λ of all active rows, with sliding blocks last. Returns the friction power [W]."""
    points, columns, small = contact.points, contact.columns, contact.small
    slots, omega, factor = space.slots, space.omega, space.factor
    vectors, nulls = space.vectors, space.nulls
    lam = vectors[LAMBDA]
    held, k, count = m, 0, 0
    for s in range(points.shape[0]):
        if slides(points[s].phase):
            held = min(held, first_of(slots, points[s].slide_block))
            k += 1
    for r in range(m):
        columns[k, r] = vectors[RHS, r]
    if k > 0:
        slide_columns(blocks, work, space, contact, k, m)
    for r in range(m):
        lam[r] = 0.0
    if held > 0:
        mu, count = factor_proximal(omega, factor, nulls, held)
        for j in range(k + 1):
            for r in range(held):
                vectors[RHS, r] = columns[j, r]
            flow[2] += solve_proximal(omega, factor, nulls, mu, count, vectors, held, 0.0)
            for r in range(held):
                columns[k + 1 + j, r] = lam[r]
    if k == 0:
        if held > 0 and count > 0:
            share_out(space, contact, count, held)
        return 0.0
    reduce_slides(contact, held, k)
    if k == 1:
        small[2, 0] = small[1, 0] / small[0, 0] if small[0, 0] != 0.0 else 0.0
    else:
        solve_small(small, k)
    power = share_slides(blocks, space, contact, held, k, work)
    if count > 0:
        share_out(space, contact, count, held)
    return power


@sweep
def share_out(space, contact, count, held):
    """Move λ of stances along null directions of Ω into their cones, where possible.

    The forces of redundant supports are not unique. The solution of least norm may violate a cone
    even if other solutions do not. Projections onto the cones alternate with corrections along the
    null directions.
    """
    points = contact.points
    slots, place, vectors, nulls = space.slots, space.place, space.vectors, space.nulls
    lam = vectors[LAMBDA]
    change = vectors[INTO_CONES]
    for _ in range(SHARES):
        worst = 0.0
        size = 0.0
        for r in range(held):
            change[r] = 0.0
            size = max(size, abs(lam[r]))
        for s in range(points.shape[0]):
            if points[s].phase == STANCE:
                i = points[s].held_block
                r = first_of(slots, i)
                if points[s].limit == 1:
                    step = (max(0.0, -lam[r]), 0.0, 0.0)
                    change[r] = step[0]
                else:
                    step = into_cone(points, s, place, i, lam, r)
                    store3(change, r, step)
                worst = max(worst, dot(step, step))
        if not worst > (ON_CONE * size) ** 2:
            return
        for n in range(count):
            along = 0.0
            for r in range(held):
                along += nulls[n, r] * change[r]
            for r in range(held):
                lam[r] += OVER * along * nulls[n, r]


@part
def into_cone(points, s, place, i, lam, r):
    """Compute the difference between λ of a stance and the nearest force just inside its cone."""
    mu = points[s].friction * (1.0 - SOLVED)  # projections end inside the cone
    normal = xyz(points[s].normal)
    n = (
        dot(normal, load(place, i, at.PLACE_D)),
        dot(normal, load(place, i, at.PLACE_D + 3)),
        dot(normal, load(place, i, at.PLACE_D + 6)),
    )
    x = (lam[r], lam[r + 1], lam[r + 2])
    push = dot(n, x)
    drag = add_scaled(x, -push, n)
    size = math.sqrt(dot(drag, drag))
    if size <= mu * push:
        return (0.0, 0.0, 0.0)
    best = max(0.0, (push + mu * size) / (1.0 + mu * mu))
    target = scale(best, n)
    if size > 0.0:
        target = add_scaled(target, mu * best / size, drag)
    return add_scaled(target, -1.0, x)


@sweep
def slide_columns(blocks, work, space, contact, k, m):
    """Write c_j and Ω_·n of each sliding point into `columns`: the factors overwrite Ω."""
    points, columns = contact.points, contact.columns
    slots, omega, place = space.slots, space.omega, space.place
    j = 0
    for s in range(points.shape[0]):
        if not slides(points[s].phase):
            continue
        i = points[s].slide_block
        d = slip_direction(points, s, slip(blocks.blocks_i, i, work, space.linear, place))
        x = points[s].friction * dot(d, load(place, i, at.PLACE_D + 3))
        y = points[s].friction * dot(d, load(place, i, at.PLACE_D + 6))
        n = first_of(slots, i)
        for r in range(m):
            columns[j, r] = omega[r, n] - x * omega[r, n + 1] - y * omega[r, n + 2]
            columns[2 * k + 2 + j, r] = omega[r, n]
        points[s].compliance = 0.5 * (omega[n + 1, n + 1] + omega[n + 2, n + 2])
        j += 1


@sweep
def reduce_slides(contact, held, k):
    """Write the k equations of sliding contact: the matrix in rows of `small`, then r."""
    points, columns, small = contact.points, contact.columns, contact.small
    i = 0
    n = held
    for s in range(points.shape[0]):
        if not slides(points[s].phase):
            continue
        n = held + 3 * i
        for j in range(k + 1):
            x = columns[j, n]
            for r in range(held):
                x -= columns[2 * k + 2 + i, r] * columns[k + 1 + j, r]
            if j < k:
                small[i, j] = x
            else:
                small[k, i] = x
        points[s].pivot = small[i, i] / columns[2 * k + 2 + i, n]
        i += 1


@sweep
def solve_small(small, k):
    """Write the minimum-norm solution of S s = r into row 2 k of `small` by one-sided Jacobi
    rotations.

    S is in rows 0 to k - 1, and r in row k. The rows from 2 k + 1 on are scratch. S is singular for
    a box that slides on four corners. The forces of minimum norm are those of a soft ground.
    """
    base = 2 * k + 1  # V, row by row
    for i in range(k):
        for j in range(k):
            small[base + i, j] = 1.0 if i == j else 0.0
    for _ in range(JACOBI_SWEEPS):
        turned = 0
        for p in range(k - 1):
            for q in range(p + 1, k):
                turned += rotate_columns(small, base, p, q, k)
        if turned == 0:
            break
    largest = 0.0
    for j in range(k):
        largest = max(largest, column_dot(small, j, j, k))
    for i in range(k):
        small[2 * k, i] = 0.0
    for j in range(k):
        size = column_dot(small, j, j, k)
        if size > RANK * RANK * largest:
            x = 0.0
            for i in range(k):
                x += small[i, j] * small[k, i]
            for i in range(k):
                small[2 * k, i] += small[base + i, j] * x / size


@part
def column_dot(small, p, q, k):
    """Compute the inner product of columns p and q."""
    total = 0.0
    for i in range(k):
        total += small[i, p] * small[i, q]
    return total


@sweep
def rotate_columns(small, base, p, q, k):
    """Make columns p and q of S V orthogonal. Returns 0 if they already were."""
    a = column_dot(small, p, p, k)
    b = column_dot(small, q, q, k)
    c = column_dot(small, p, q, k)
    if not abs(c) > ORTHOGONAL * math.sqrt(a * b):
        return 0
    zeta = (b - a) / (2.0 * c)
    t = 1.0 / (abs(zeta) + math.sqrt(1.0 + zeta * zeta))
    if zeta < 0.0:
        t = -t
    cosine = 1.0 / math.sqrt(1.0 + t * t)
    sine = cosine * t
    for i in range(k):
        x = small[i, p]
        small[i, p] = cosine * x - sine * small[i, q]
        small[i, q] = sine * x + cosine * small[i, q]
        x = small[base + i, p]
        small[base + i, p] = cosine * x - sine * small[base + i, q]
        small[base + i, q] = sine * x + cosine * small[base + i, q]
    return 1


@sweep
def share_slides(blocks, space, contact, held, k, work):
    """Compute λ of all rows from the sliding forces s. Returns the friction power."""
    points, columns, small = contact.points, contact.columns, contact.small
    slots, place, lam = space.slots, space.place, space.vectors[LAMBDA]
    power = 0.0
    j = 0
    for r in range(held):
        lam[r] = columns[2 * k + 1, r]
    for s in range(points.shape[0]):
        if not slides(points[s].phase):
            continue
        i = points[s].slide_block
        size = small[2 * k, j]
        for r in range(held):
            lam[r] -= size * columns[k + 1 + j, r]
        u = slip(blocks.blocks_i, i, work, space.linear, place)
        d = slip_direction(points, s, u)
        drag = size * points[s].friction
        n = first_of(slots, i)
        lam[n] = size
        lam[n + 1] = -drag * dot(d, load(place, i, at.PLACE_D + 3))
        lam[n + 2] = -drag * dot(d, load(place, i, at.PLACE_D + 6))
        power += drag * dot(d, u)
        j += 1
    return power
