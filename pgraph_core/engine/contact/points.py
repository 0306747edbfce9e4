"""Contact points and joint limits in event-driven runs: their forces and the ends of their phases.

`observe` computes gaps, rates and forces at one time. `watch` converts them to monitors that become
negative when a phase ends. Times within a step are relative to the start of the step or sub-step.
"""

import math

from ...tolerances import EPS, SOLVED
from .. import layout as at
from ..arrays import EFFECT, LAMBDA, RESIDUAL, RESIDUAL_RATE, RHS, TAU, ZERO, Blocks, Frames, opened
from ..compiler.address import caller
from ..compiler.jit import kernel, part, sweep
from ..compiler.kinds import F1, f8, i8, void
from ..constraints.blocks import (
    first_of,
    locate,
    prescribes,
    residual,
    residual_acceleration,
    residual_velocity,
    size_of,
    slip,
    to_contact,
    velocities,
)
from ..constraints.constraints import (
    along_joint,
    couplings,
    drift,
    driven_power,
    number_rows,
    respond,
    unit_responses,
)
from ..constraints.coordinates import coefficient
from ..motion import RECORD, call_acceleration, call_record
from ..motions import travels
from ..records import STANCE, SWING, WATCHED
from ..rows import kind_of, link_of, origin_of, parent_of
from ..stepping.bracket import BELOW, NOTHING
from ..stepping.minima import cubic_vertex
from ..tree.articulated import inboard
from ..tree.kinematics import accelerate, outboard, positions
from ..vec import add, add_scaled, dot, load, scale, set_xyz, sub, xyz
from .phases import RANK, opened_events, slides, slip_direction, tangential

# scene, t, q, v, v', flow
OBSERVE = i8(i8, f8, F1, F1, F1, F1)
call_observe = caller(OBSERVE)
GAP_ROUNDING = 2 * EPS  # rounding of a gap relative to the coordinates whose difference it is
FORCE_TOLERANCE = RANK  # rounding of contact forces relative to the largest one
NEARLY = 0.02  # plausible error of the cubic relative to the motion of a gap in a step


@kernel(OBSERVE, nogil=True, later=True)
def observe(scene, t, q, v, vdot, flow):
    """Compute gap, rates, force and rounding for every point at (q, v), and v' if one is closed."""
    phased = opened_events(scene)
    data, contact = phased.scene, phased.contact
    rows, const, blocks, work, space = data.rows, data.const, data.blocks, data.work, data.space
    links, points = contact.links, contact.points
    closed = False
    for s in range(points.shape[0]):
        closed = closed or points[s].phase != SWING
        set_xyz(points[s].force, (0.0, 0.0, 0.0))
        points[s].normal_force = 0.0
        points[s].friction_force = 0.0
        points[s].pivot = 1.0
    if closed:
        tau = space.vectors[TAU, : v.shape[0]]
        call_acceleration(links.acceleration, (scene, t, q, v, tau, vdot, flow))
        for s in range(points.shape[0]):
            if points[s].phase != SWING:
                point_force(rows, blocks, work, space, contact, s)
    else:
        outboard(rows, const, work, q, v)
        positions(rows, work)
        velocities(rows, const, work, v, space.linear)
    all_points(rows, const, blocks, work, space, contact, t, q, v)
    return 0


@part
def with_active(blocks, active):
    """Return the same blocks with a different active set."""
    return Blocks(
        blocks.blocks_i,
        blocks.blocks_f,
        blocks.terms_i,
        blocks.terms_f,
        blocks.curves,
        blocks.stations,
        active,
    )


@sweep
def all_points(rows, const, blocks, work, space, contact, t, q, v):
    """Compute gap, rates and rounding for every point, including open ones."""
    points, every = contact.points, contact.every
    blocks_i, blocks_f, terms_i = blocks.blocks_i, blocks.blocks_f, blocks.terms_i
    observed = with_active(blocks, every)
    slots, place, vectors, linear = space.slots, space.place, space.vectors, space.linear
    number_rows(observed, slots)
    locate(observed, work, q, place)
    residual(observed, work, space, t, q, vectors[RESIDUAL])
    residual_velocity(observed, work, space, t, v, vectors[RESIDUAL_RATE])
    for s in range(points.shape[0]):
        i = points[s].slide_block
        r = first_of(slots, i)
        points[s].gap = vectors[RESIDUAL, r]
        points[s].gap_rate = vectors[RESIDUAL_RATE, r]
        if points[s].limit == 1:
            spread = abs(blocks_f[i, at.VALUE])
            first = blocks_i[i, at.B_TERM]
            spread += abs(q[terms_i[first, 1]])
        else:
            p = load(place, i, at.PLACE_P)
            set_xyz(points[s].position, p)
            if points[s].rim == 1:
                set_xyz(points[s].arm, to_contact(blocks_i, blocks_f, i, work)[0])
            u = slip(blocks_i, i, work, linear, place)
            set_xyz(points[s].slip_velocity, tangential(points, s, u))
            normal = xyz(points[s].normal)
            spread = path_length(rows, const, work, blocks_i[i, at.B_A], p, normal)
        points[s].rounding = GAP_ROUNDING * spread


@part
def path_length(rows, const, work, k, p, n):
    """Compute the sum of lengths along n from the ground to point p on row k [m]."""
    length = abs(dot(sub(p, origin_of(work, k)), n))
    while k > 0:
        length += abs(dot(link_of(work, k), n))
        if travels(kind_of(rows, k)):
            link = load(const, k, at.LINK)  # a displacement may have been subtracted from it
            length += abs(link[0]) + abs(link[1]) + abs(link[2])
        k = parent_of(rows, k)
    return length


@sweep
def point_force(rows, blocks, work, space, contact, s):
    """Compute the force at a closed point from λ and its components, about the axis for a limit."""
    points = contact.points
    blocks_i = blocks.blocks_i
    slots, place, lam = space.slots, space.place, space.vectors[LAMBDA]
    slid = slides(points[s].phase)
    i = points[s].slide_block if slid else points[s].held_block
    r = first_of(slots, i)
    if points[s].limit == 1:
        points[s].normal_force = lam[r]
        moment, force = along_joint(rows, work, blocks_i[i, at.B_A])
        size = coefficient(blocks, place, i, blocks_i[i, at.B_TERM]) * lam[r]
        set_xyz(points[s].force, scale(size, add(moment, force)))
        return
    force = (0.0, 0.0, 0.0)
    for c in range(3):
        force = add_scaled(force, lam[r + c], load(place, i, at.PLACE_D + 3 * c))
    set_xyz(points[s].force, force)
    points[s].normal_force = dot(force, xyz(points[s].normal))
    drag = tangential(points, s, force)
    points[s].friction_force = math.sqrt(dot(drag, drag))


@kernel(RECORD, nogil=True, later=True)
def event_record(scene, accelerate, t, q, v, flow, ledger, i, out):
    """Run `record`, and also record every point. The drift is for active constraints."""
    phased = opened_events(scene)
    data, contact = phased.scene, phased.contact
    rows, const, work, space = data.rows, data.const, data.work, data.space
    links, points = contact.links, contact.points
    frame = Frames(*out)
    fine = call_record(links.record, (scene, accelerate, t, q, v, flow, ledger, i, out))
    call_observe(links.observe, (scene, t, q, v, frame.vdot[i], flow))
    drift(rows, const, opened(links.held).blocks, work, space, t, q, v, frame.drifts[i])
    for s in range(points.shape[0]):
        kept, point = contact.frames[i, s], points[s]
        kept.phase = point.phase
        set_xyz(kept.force, xyz(point.force))
        set_xyz(kept.position, xyz(point.position))
        set_xyz(kept.slip_velocity, xyz(point.slip_velocity))
        kept.normal_force = point.normal_force
        kept.gap = point.gap
    return fine


@kernel(void(i8, f8, F1, F1, F1, F1), later=True)
def point_accelerations(scene, t, q, v, vdot, flow):
    """Compute the normal and tangential accelerations of every point, including open ones."""
    phased = opened_events(scene)
    data, contact = phased.scene, phased.contact
    rows, const, blocks, work, space = data.rows, data.const, data.blocks, data.work, data.space
    links, points, every = contact.links, contact.points, contact.every
    slots, place, vectors = space.slots, space.place, space.vectors
    tau = vectors[TAU, : v.shape[0]]
    call_acceleration(links.acceleration, (scene, t, q, v, tau, vdot, flow))
    outboard(rows, const, work, q, v)
    accelerate(rows, const, work, v, vdot)
    positions(rows, work)
    velocities(rows, const, work, v, space.linear)
    observed = with_active(blocks, every)
    number_rows(observed, slots)
    locate(observed, work, q, place)
    residual_acceleration(observed, work, space, t, v, vdot, vectors[RESIDUAL])
    for s in range(points.shape[0]):
        i = points[s].slide_block
        r = first_of(slots, i)
        points[s].normal_acceleration = vectors[RESIDUAL, r]
        set_xyz(points[s].tangential_acceleration, (0.0, 0.0, 0.0))
        if points[s].limit == 0:
            a = scale(vectors[RESIDUAL, r + 1], load(place, i, at.PLACE_D + 3))
            a = add_scaled(a, vectors[RESIDUAL, r + 2], load(place, i, at.PLACE_D + 6))
            set_xyz(points[s].tangential_acceleration, a)


@kernel(i8(i8, f8, F1, F1), later=True)
def impulse_rows(scene, t, q, v):
    """Compute Ω and the velocities (in RHS) of the active rows. Returns their number."""
    data = opened(scene)
    rows, const, blocks, work, space = data.rows, data.const, data.blocks, data.work, data.space
    vectors = space.vectors
    for j in range(v.shape[0]):
        vectors[ZERO, j] = 0.0
    outboard(rows, const, work, q, v)
    inboard(rows, const, work, vectors[ZERO])
    positions(rows, work)
    velocities(rows, const, work, v, space.linear)
    m = number_rows(blocks, space.slots)
    locate(blocks, work, q, space.place)
    unit_responses(rows, const, blocks, work, space)
    couplings(blocks, space)
    residual_velocity(blocks, work, space, t, v, vectors[RHS])
    return m


@kernel(void(i8, F1, F1), later=True)
def add_impulses(scene, v, ledger):
    """Add M⁻¹ Jᵀ λ of the active rows to v, and their energy to the ledger.

    λ is in LAMBDA, and Ω and the velocities before it are those of `impulse_rows`. The impulses of
    rows that prescribe a motion do work, λ times the mean of J v, and the others dissipate.
    """
    data = opened(scene)
    rows, const, blocks, work, space = data.rows, data.const, data.blocks, data.work, data.space
    lam, m = space.vectors[LAMBDA], number_rows(blocks, space.slots)
    ledger[at.WORK_DONE] += 0.5 * driven_power(blocks, space, v)
    for j in range(1, blocks.active[0] + 1):
        i = blocks.active[j]
        if prescribes(blocks, i):
            continue
        first = first_of(space.slots, i)
        for r in range(first, first + size_of(blocks.blocks_i, i)):
            mean = space.vectors[RHS, r]
            for c in range(m):
                mean += 0.5 * space.omega[r, c] * lam[c]
            ledger[at.DISSIPATED] -= lam[r] * mean
    respond(rows, const, blocks, work, space)
    for j in range(v.shape[0]):
        v[j] += space.vectors[EFFECT, j]
    ledger[at.WORK_DONE] += 0.5 * driven_power(blocks, space, v)


@sweep
def watch(contact, row, w):
    """Fill row `row` of `watched` at a time w after the start of the step, from its points."""
    points, watched = contact.points, contact.watched
    largest = 0.0
    for s in range(points.shape[0]):
        push = points[s].normal_force
        largest = max(largest, abs(push), points[s].friction_force)
    slack = FORCE_TOLERANCE * largest
    for s in range(points.shape[0]):
        phase = points[s].phase
        fresh = points[s].fresh > 0
        mu = points[s].friction
        a = points[s].normal_force + slack
        b = NOTHING
        c = NOTHING
        if phase == SWING:
            a = points[s].gap if points[s].gap != 0.0 else -BELOW
            if fresh:
                a = points[s].gap - points[s].start
                if points[s].fresh == 1:
                    a += points[s].rounding
                a = a / w if w > 0.0 else max(points[s].gap_rate, 0.0)
        elif phase == STANCE:
            if points[s].limit == 0:
                b = mu * points[s].normal_force - points[s].friction_force + slack
        else:
            c = points[s].pivot + SOLVED
            if mu > 0.0:
                b = dot(xyz(points[s].slip_velocity), xyz(points[s].slip_direction))
                if fresh:
                    b += points[s].slip_tolerance - points[s].start
                    b = b / w if w > 0.0 else NOTHING
        if phase != SWING and points[s].rim == 1:
            start_arm = xyz(points[s].start_arm)
            c = min(c, dot(xyz(points[s].arm), start_arm) / dot(start_arm, start_arm))
        watched[row, 3 * s] = a
        watched[row, 3 * s + 1] = b
        watched[row, 3 * s + 2] = c


@sweep
def start(contact, h):
    """Store the start of a step for phases that begin with it, and the limit on slow slip."""
    points = contact.points
    rate = 0.0
    for s in range(points.shape[0]):
        if slides(points[s].phase):
            rate += points[s].friction_force * points[s].compliance
    for s in range(points.shape[0]):
        points[s].start = points[s].gap
        points[s].start_rate = points[s].gap_rate
        set_xyz(points[s].start_arm, xyz(points[s].arm))
        if slides(points[s].phase):
            slip_v = xyz(points[s].slip_velocity)
            along = dot(slip_v, xyz(points[s].slip_direction))
            points[s].start = along
            if along > 10.0 * points[s].slip_tolerance:
                points[s].fresh = 0
            points[s].blend_speed = 0.5 * h * rate
    watch(contact, WATCHED.start, 0.0)


@kernel(void(i8, f8), later=True)
def begin(scene, h):
    """Begin a step from the last observation of the points, with `h` as in `start`."""
    start(opened_events(scene).contact, h)


@sweep
def accepted(contact):
    """Switch points that have left the ground or slide notably to plain monitoring after a step."""
    points = contact.points
    for s in range(points.shape[0]):
        if slides(points[s].phase):
            u = xyz(points[s].slip_velocity)
            if dot(u, u) > (10.0 * points[s].slip_tolerance) ** 2:
                set_xyz(points[s].slip_direction, slip_direction(points, s, u))
                points[s].fresh = 0
        elif points[s].gap > 2.0 * points[s].rounding:
            points[s].fresh = 0


@sweep
def dip_of_gap(contact, s, h):
    """Compute the time in the step at which the gap at point s may dip below zero, or else h.

    The cubic through gaps and rates at both ends decides. A minimum just above zero counts too.
    """
    points = contact.points
    a = h * points[s].start_rate
    b = h * points[s].gap_rate
    if points[s].phase != SWING or not (a < 0.0 < b):
        return h
    before = points[s].start
    x, least = cubic_vertex(points[s].gap - before, a, b)
    return x * h if 0.0 < x < 1.0 and before + least < NEARLY * (b - a) else h
