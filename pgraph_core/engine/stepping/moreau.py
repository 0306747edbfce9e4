"""Moreau and Jean's time stepping: smooth forces and impulses in one velocity update.

q_m = q + h/2 v; v⁺ = v + h v'(q_m, v) + M⁻¹ Jᵀ λ with all that touches at q_m; q⁺ = q_m + h/2 v⁺
([Moreau 1988], [Jean 1999]). Impacts need no events, many at once cost no more than one. Dampers
and servos of hinges and sliders are taken at the end of the step, which is stable however stiff
they are: h d + h²/2 k counts as inertia there. What turns freely keeps its energy, however fast
it spins (`tree.spinning`).

A step in which things hit each other is taken in parts, which end where they meet: an impact is a
part without length. What is soft, or slow, is found where the middle of a part finds it.
"""

import math

from ...tolerances import NOTABLE, SOLVED
from .. import layout as at
from ..arrays import (
    ARMATURE,
    BEFORE,
    CALMED,
    DAMPING,
    DINV,
    FACTORED,
    GAINED,
    GIVEN,
    GYRE,
    HARD,
    LAMBDA,
    MISSED,
    REPORT,
    RHS,
    SPEEDS,
    STEP,
    STEPS_DONE,
    STIFFNESS,
    STRAYS,
    SWEEPS_DONE,
    TRIAL,
    ZERO,
    opened_run,
)
from ..compiler.jit import kernel, part, sweep
from ..compiler.masks import both, either, more, most
from ..constraints.blocks import (
    along,
    ends_of,
    first_of,
    joint_of,
    joints_of,
    locate,
    place_a,
    place_b,
    point_b,
    point_velocity,
    residual_velocity,
    span,
    type_of,
    velocities,
)
from ..constraints.constraints import driven_power, number_rows, unit_responses
from ..constraints.paths import spread, unspread
from ..contact.closing import closed_gap, smaller_size, thinner
from ..contact.contacts import (
    ADDING,
    FROZEN,
    SLIDING,
    clear,
    contacts_at,
    keep_point,
    kept_place,
    note,
    note_turn,
    resists_turning,
    set_block,
    set_turn,
    slides_now,
    touching,
)
from ..contact.impulse import solve_impulses
from ..contact.meeting import (
    closed_limit,
    first_meeting,
    hits_at_once,
    limit_arrival,
    limit_gap,
    limit_speeds,
    look_ahead,
    point_meets,
    state_at,
)
from ..contact.newton import gather
from ..contact.passing import keep_poses, note_passages
from ..contact.shapes import DEPTH, place
from ..forces import at_its_limit
from ..motion import call_acceleration, call_contact_forces, follow, opened
from ..records import RIGID
from ..rows import (
    BALL,
    ROTATE,
    TRANSLATE,
    armature_of,
    axis_of,
    kind_of,
    origin_of,
    parent_of,
    set_spin,
    spin_of,
    v_of,
)
from ..tree.kinematics import base_axes, frames, positions
from ..tree.moving import advance
from ..tree.spinning import GYRE_ROWS, keep_gyrating, keep_spinning
from ..vec import (
    add,
    add_scaled,
    add_xyz,
    cross,
    dot,
    finite,
    load,
    load3,
    mul,
    scale,
    set_xyz,
    sub,
    xyz,
)
from .state import STEP as STEP_SIGNATURE
from .state import copied, size_of_state

RECOVER = 0.2  # part of deeper penetration that a step removes
PUSH_SWEEPS = 30
ENOUGH = 1e-3  # share of the penetration to remove below which a sweep is the last
MOST_PARTS = 2000  # limit on the sub-steps of a step, two per located impact
DRIFT = 50.0  # largest drift of a loaded contact whose gap is closed, in tolerated depths
BRIEF = 1e-3  # shortest sub-step whose impulses start the next step, relative to the step
ASK, CUT, REST = 0, 1, 2  # a part: whether something hits in it, until it does, what is left
AHEAD = 1e-3  # distance from a bound of a length that a step's forces cover, relative to it
WEIGHT = 0.1  # penetration tolerance as a fraction of g h^2


@kernel(STEP_SIGNATURE, nogil=True)
def moreau_jean(run, h):
    """One step from Y into CANDIDATE, in parts where things hit within it."""
    this = opened_run(run)
    scene, stages = this.scene, this.stages
    space = opened(scene).space
    tally = contacts_at(opened(scene).links.contacts).tally[0]
    nq, nv = size_of_state(run)
    copied(stages, at.Y, at.CANDIDATE, stages.shape[1])
    q = stages[at.CANDIDATE, :nq]
    v = stages[at.CANDIDATE, nq : nq + nv]
    vdot = stages[at.SLOPE, nq : nq + nv]
    clear(opened(scene).links.contacts)
    for i in range(tally.first_limit, tally.first_limit + tally.limits):
        opened(scene).blocks.blocks_f[i, at.LOCATED] = math.inf
    tally.frozen = ADDING
    t = this.control[0].time
    done = 0.0
    parts = 0
    w = 0.0
    stuck = False
    while True:
        left = h - done
        again = parts < MOST_PARTS and not stuck
        if w > 0.0 and again and hits_at_once(scene, h, q, v, vdot):
            w = 0.0
        elif part_of_step(run, done, h, left, ASK if again else REST):
            start = stages[at.TRIAL]
            state_at(scene, 0.0, q, v, start, vdot, space.vectors[STEP, :nv])
            if parts == 0:
                keep_poses(scene)
            w = first_meeting(scene, h, left, q, v, start, vdot, space.vectors[STEP, :nv])
        else:
            break
        parts += 1
        part_of_step(run, done, h, w, CUT)
        if w == left:
            break
        stuck = w == 0.0 and not changed(stages[at.TRIAL], stages[at.CANDIDATE], nq, nv)
        tally.cuts += 1
        done += w
    if parts == MOST_PARTS:  # the rest was taken at once, as a time step without location
        tally.crowded += 1
        if tally.crowded == 1:
            tally.crowded_time = t + done
    if parts > 0:
        state_at(scene, 0.0, q, v, stages[at.CANDIDATE], vdot, space.vectors[STEP, :nv])
        note_passages(scene, t + h)
    tally.frozen = FROZEN
    return 0.0 if finite(stages[at.CANDIDATE]) else math.inf


@sweep
def changed(before, after, nq, nv):
    """Return whether an impact changed velocities by more than the solver's tolerance.

    One that did not would be met again at once, as where a motion pushes into the ground.
    """
    most = 0.0
    change = 0.0
    for j in range(nq, nq + nv):
        most = max(most, abs(before[j]))
        change = max(change, abs(after[j] - before[j]))
    return change > SOLVED * most


@sweep
def part_of_step(run, done, h, w, mode):
    """A part of width w, from `done` on, of a step of width h: CANDIDATE goes on.

    Asked, it returns whether something may hit within it; CANDIDATE is then as before. A part
    without width is an impact of all that touches. The state before is in TRIAL.
    """
    this = opened_run(run)
    scene, flow, stages = this.scene, this.flow, this.stages
    t = this.control[0].time + done
    nq, nv = size_of_state(run)
    copied(stages, at.CANDIDATE, at.TRIAL, stages.shape[1])
    q = stages[at.CANDIDATE, :nq]
    v = stages[at.CANDIDATE, nq : nq + nv]
    ledger = stages[at.CANDIDATE, nq + nv :]
    before = stages[at.TRIAL, nq : nq + nv]
    tau = stages[at.TORQUE, :nv]
    vdot = stages[at.SLOPE, nq : nq + nv]
    damping = stages[at.ERROR, :nv]
    data = opened(scene)
    rows, const, drives, blocks = data.rows, data.const, data.drives, data.blocks
    work, space, given = data.work, data.space, data.given
    contacts = contacts_at(data.links.contacts)
    active, tally = blocks.active, contacts.tally[0]
    bilateral = active[0]
    active[0] = 0  # constraints come in with the impulses
    advance(rows, q, v, 0.5 * w)
    stiffen(scene, t + 0.5 * w, w, q, v)
    tally.share = w / h
    call_acceleration(this.links.accelerate, (scene, t + 0.5 * w, q, v, tau, vdot, flow))
    this.counters[0].evaluations += 1
    if w > 0.0:
        vectors = space.vectors
        for j in range(nv):
            vectors[ZERO, j] = 0.0
        gyre = vectors[GYRE : GYRE + GYRE_ROWS]
        keep_gyrating(rows, const, work, q, before, w, vectors[ZERO], gyre, vdot)
        keep_spinning(rows, const, work, before, w, vectors[STEP], vdot)
    relax(rows, const, space.vectors, given)
    for j in range(nv):
        damping[j] = space.vectors[DAMPING, j]
    positions(rows, work)
    active[0] = bilateral
    first = bilateral + 1
    if add_unilateral(scene, h, w, h - done, mode, q, v, vdot):
        if contacts.laws.shape[0] > 0:  # take back the forces that were added up
            tally.share = -w / h
            call_contact_forces(data.links.forces, (scene, v, tau, flow))
        active[0] = bilateral
        for i in range(nq):
            q[i] = stages[at.TRIAL, i]
        return True
    ledger[at.WORK_DONE] += w * flow[0]
    ledger[at.DISSIPATED] += w * flow[1]
    if active[0] > 0:
        space.vectors[FACTORED, 2] = 0.0  # Y is no longer that of the last factors
        while True:
            m = number_rows(blocks, space.slots)
            set_velocities(scene, t, w, v, vdot)
            unit_responses(rows, const, blocks, work, space)
            warm_start(scene, first, m)
            solve_impulses(scene, m, first)
            this.counters[0].solver_iterations += steps_of_solver(scene)
            if w == 0.0 or not add_passed(scene, first, w, q, v, vdot):
                break
            turn_rates(rows, const, work, v)
            velocities(rows, const, work, v, space.linear)
        account(scene, w if w > 0.0 else h, ledger)
        if w == 0.0:
            note_chain(scene, first, t)
    else:
        space.vectors[STEP, :nv] = 0.0
    book(scene, first, t + w, h, w == h - done)
    if active[0] > 0:
        spread(rows, const, work, space.vectors[STEP])
    for j in range(nv):
        v[j] += w * vdot[j] + space.vectors[STEP, j]
    book_drives(rows, drives, tau, before, damping, w, v, ledger)
    if bilateral > 0:  # impulses times the mean speed over the part
        work_done = driven_power(blocks, space, before) + driven_power(blocks, space, v)
        ledger[at.WORK_DONE] += 0.5 * work_done
    advance(rows, q, v, 0.5 * w)
    if active[0] >= first and w > 0.0:
        push_out(scene, first, h, q)
    active[0] = bilateral
    return False


@sweep
def stiffen(scene, t, h, q, v):
    """Add the resistance of dampers and springs at the step's end to inertia and torque."""
    data = opened(scene)
    rows, const, drives, space, given = data.rows, data.const, data.drives, data.space, data.given
    vectors = space.vectors
    table = drives.table
    damping = vectors[DAMPING]
    stiffness = vectors[STIFFNESS]
    for j in range(v.shape[0]):  # with a hinge: joints of several coordinates stay as they are
        damping[j] = 0.0
        stiffness[j] = 0.0
    follow(data, t, q, v)
    for n in range(table.shape[0]):
        j = table[n].velocity
        kd = table[n].damping
        if table[n].terms > 0:  # along several coordinates: as it is, too
            continue
        if kd > 0.0 and not at_its_limit(drives, n, t, q, v):
            damping[j] += kd
            if table[n].coordinate >= 0:
                stiffness[j] += table[n].stiffness
    for k in range(1, rows.shape[0]):
        if kind_of(rows, k) <= TRANSLATE:
            j = v_of(rows, k)
            vectors[ARMATURE, j] = armature_of(const, k)
            vectors[GIVEN, j] = given[j]
            damping[j] = h * damping[j] + 0.5 * h * h * stiffness[j]
            const[k, at.ARMATURE] += damping[j]
            given[j] -= 0.5 * h * stiffness[j] * v[j]


@sweep
def relax(rows, const, vectors, given):
    """Undo `stiffen`."""
    for k in range(1, rows.shape[0]):
        if kind_of(rows, k) <= TRANSLATE:
            j = v_of(rows, k)
            const[k, at.ARMATURE] = vectors[ARMATURE, j]
            given[j] = vectors[GIVEN, j]


@part
def book_drives(rows, drives, tau, before, extra, h, v, ledger):
    """Correct the work of the joints' torques by their change over the step."""
    more = 0.0
    for k in range(1, rows.shape[0]):
        if kind_of(rows, k) <= TRANSLATE:
            j = v_of(rows, k)
            change = v[j] - before[j]
            mean = 0.5 * (v[j] + before[j])
            more += (h * tau[j] - extra[j] * change) * mean - h * tau[j] * before[j]
    if drives.table.shape[0] > drives.passive:
        ledger[at.WORK_DONE] += more
    else:
        ledger[at.DISSIPATED] -= more


@sweep
def add_unilateral(scene, h, w, left, mode, q, v, vdot):
    """Append limits and rigid contacts that touch to the active blocks.

    Asked, return whether something may hit within this part, of width w, of a step of width h, of
    which `left` was left before.
    """
    look = mode == ASK
    data = opened(scene)
    blocks = data.blocks
    contacts = contacts_at(data.links.contacts)
    blocks_i, active = blocks.blocks_i, blocks.active
    laws, tally = contacts.laws, contacts.tally[0]
    first = tally.first_limit
    for i in range(first - tally.frictions, first):
        if w > 0.0:  # a force without an impulse: it does nothing in an impact
            blocks.blocks_f[i, at.AIM] = w * blocks.blocks_f[i, at.VALUE]
            active[0] += 1
            active[active[0]] = i
    for i in range(first, first + tally.limits):
        if type_of(blocks_i, i) == at.T_SPAN:
            if w > 0.0 and span_reaches(scene, i, w, v):
                active[0] += 1
                active[active[0]] = i
            continue
        if look and limit_arrival(blocks, i, 0.5 * w, h, w, q, v, vdot) < w:
            return True
        if limit_reaches(blocks, i, h, w, left, mode == REST, q, v, vdot):
            active[0] += 1
            active[active[0]] = i
    if laws.shape[0] == 0:
        return False
    velocities(data.rows, data.const, data.work, v, data.space.linear)
    place(contacts.geometry.shapes, data.work, contacts.poses)
    closed, margin, fast = look_ahead(scene, w)
    if look and fast:
        return True
    first = tally.first_contact
    closed = max(closed, DRIFT * max(DEPTH * tally.length, WEIGHT * tally.pull * h * h))
    count = touching(scene, max(closed, margin) if look else closed, 1)
    for n in range(count):
        point = contacts.found[n]
        if look and point_meets(scene, n, h, w):
            return True
        near = 4.0 * closed_gap(contacts, point.shape_a, point.shape_b, xyz(point.point_a))
        slack = 0.0
        if point.gap > near and carried(contacts, n):
            near = DRIFT * tolerated(contacts, n, h)
            slack = point.gap / h
        if w == 0.0 and point.gap > near and lands_together(contacts, n, count):
            near = NOTABLE * smaller_size(contacts, point.shape_a, point.shape_b)
        if laws[point.pair].law == RIGID and point.gap <= near:
            law = laws[point.pair]
            slides = law.static_friction == law.friction
            slides = slides or slides_now(contacts, data.work, data.space.linear, n)
            set_block(contacts, blocks, n, first + n, slides)
            blocks.blocks_f[first + n, at.VALUE] = slack
            active[0] += 1
            active[active[0]] = first + n
            if resists_turning(law):
                set_turn(contacts, blocks, n, tally.first_turn + n)
                active[0] += 1
                active[active[0]] = tally.first_turn + n
    return False


@part
def limit_reaches(blocks, i, h, w, left, rest, q, v, vdot):
    """True if limit i is at hand in a sub-step of width w, from its middle q.

    The joint gets the permitted speed with which it is at the limit at the end of the sub-step. It
    rebounds in an impact, which has no width, or where the `rest` of a step is taken at once. It
    stays where all its rebounds, each `e` times as long as the one before, would be over in the
    time left of the step.
    """
    blocks_f, closed = blocks.blocks_f, closed_limit(blocks, i)
    gap = limit_gap(blocks, i, q)
    rate, change = limit_speeds(blocks, i, v, vdot)
    blocks_f[i, at.AIM] = 0.0
    blocks_f[i, at.BOUNCE] = 0.0
    if w == 0.0:
        e = blocks_f[i, at.REBOUND]
        if gap <= 2.0 * closed:
            blocks_f[i, at.LOCATED] = math.inf
            if 2.0 * e * rate < (1.0 - e) * left * min(change, 0.0):
                blocks_f[i, at.BOUNCE] = e
            return True
        return False
    if rest and limit_arrival(blocks, i, 0.5 * w, h, w, q, v, vdot) < w:
        blocks_f[i, at.BOUNCE] = blocks_f[i, at.REBOUND]
        return True
    if gap - 0.5 * w * rate <= closed and gap <= 2.0 * closed:
        return True
    blocks_f[i, at.AIM] = 2.0 * gap / w
    return gap + 0.5 * w * (rate - w * abs(change)) < 0.0


@sweep
def span_reaches(scene, i, w, v):
    """True if a length may pass its bound within a sub-step of width w, from its middle.

    Its block then gets the permitted speed: to be at the bound at the end of the sub-step, or to
    move along it there. A transverse speed u lengthens it by w² u² / (8 length) in half a sub-step,
    and turns it. So a body that swings on a held length keeps its energy.
    """
    data = opened(scene)
    blocks, work, linear = data.blocks, data.work, data.space.linear
    velocities(data.rows, data.const, work, v, linear)
    a, b = ends_of(blocks.blocks_i, i)
    gap, p, apart, signed = span(blocks.blocks_f, i, work, a, b)
    length = abs(signed)
    if not length > 0.0:
        return False
    q = point_b(blocks.blocks_f, i, work, b)
    u = sub(point_velocity(work, linear, a, p), point_velocity(work, linear, b, q))
    bound = blocks.blocks_f[i, at.VALUE]
    parting = dot(u, apart) / length
    across = math.copysign(max(dot(u, u) - parting * parting, 0.0) / length, bound)
    closing = max(-math.copysign(1.0, bound) * parting, 0.0)
    bent = 0.5 * w * across
    blocks.blocks_f[i, at.AIM] = max(2.0 * gap / w + 0.5 * bent, bent)
    pull = contacts_at(data.links.contacts).tally[0].pull
    return gap <= w * (closing + abs(bent) + w * pull) + AHEAD * abs(bound)


@part
def lands_together(contacts, n, count):
    """True if another point between the shapes of point n is closed, so an impact takes both.

    Corners that arrive together do so up to the asymmetry that earlier steps left.
    """
    this = contacts.found[n]
    for m in range(count):
        other = contacts.found[m]
        if other.shape_a == this.shape_a and other.shape_b == this.shape_b:
            near = 4.0 * closed_gap(contacts, other.shape_a, other.shape_b, xyz(other.point_a))
            if other.gap <= near:
                return True
    return False


@part
def carried(contacts, n):
    """True if contact point n pushed in the last step. Standing, rotating bodies drift off."""
    k = kept_place(contacts.found[n], contacts.kept, contacts.tally[0].kept, n)
    return k >= 0 and contacts.kept[k].value[0] > 0.0


@sweep
def set_velocities(scene, t, h, v, vdot):
    """J v into BEFORE and J (v + h v') into RHS, less the given velocities of rows."""
    data = opened(scene)
    rows, const, blocks, work, space = data.rows, data.const, data.blocks, data.work, data.space
    vectors, linear = space.vectors, space.linear
    locate(blocks, work, space.place)
    if contacts_at(data.links.contacts).laws.shape[0] == 0:  # else the search has left them
        velocities(rows, const, work, v, linear)
    residual_velocity(blocks, work, space, t, v, vectors[BEFORE])
    for j in range(v.shape[0]):
        vectors[STEP, j] = v[j] + h * vdot[j]
    turn_rates(rows, const, work, vectors[STEP])
    velocities(rows, const, work, vectors[STEP], linear)
    residual_velocity(blocks, work, space, t + h, vectors[STEP], vectors[RHS])
    for j in range(v.shape[0]):
        vectors[SPEEDS, j] = vectors[STEP, j]
    unspread(rows, const, work, vectors[SPEEDS])


@sweep
def warm_start(scene, first, m):
    """λ of the last step where a contact point or a joint's friction goes on, zero elsewhere.

    A part of a step takes its share of it.
    """
    data = opened(scene)
    blocks, space = data.blocks, data.space
    contacts = contacts_at(data.links.contacts)
    active, slots = blocks.active, space.slots
    lam = space.vectors[LAMBDA]
    for r in range(m):
        lam[r] = 0.0
    begin, room = contacts.tally[0].first_contact, contacts.found.shape[0]
    share = contacts.tally[0].share
    for j in range(first, active[0] + 1):
        n = active[j] - begin
        if type_of(blocks.blocks_i, active[j]) == at.T_FRICTION:
            one = blocks.blocks_f[active[j]]
            lam[first_of(slots, active[j])] = one[at.HELD] * one[at.AIM] / one[at.VALUE]
        elif n >= 0:
            turns = n >= room
            n -= room if turns else 0
            if not turns:
                set_xyz(contacts.found[n].held, (0.0, 0.0, 0.0))
            k = kept_place(contacts.found[n], contacts.kept, contacts.tally[0].kept, n)
            if k >= 0:
                r = first_of(slots, active[j])
                kept = xyz(contacts.kept[k].turn) if turns else xyz(contacts.kept[k].value)
                if not turns:
                    set_xyz(contacts.found[n].held, kept)
                for c in range(3):
                    lam[r + c] = share * kept[c]


@part
def steps_of_solver(scene):
    """Return the number of sweeps and Newton steps of the last solve."""
    report = opened(scene).space.vectors[REPORT]
    return int(report[SWEEPS_DONE] + report[STEPS_DONE])


@sweep
def add_passed(scene, first, w, q, v, vdot):
    """Append limits that impulses of other rows lead beyond; return True if there are any.

    q is the middle of the part of width w, and STEP has the impulses' effect.
    """
    data = opened(scene)
    blocks, work, space = data.blocks, data.work, data.space
    active, tally = blocks.active, contacts_at(data.links.contacts).tally[0]
    if tally.limits == 0:
        return False
    change = space.vectors[TRIAL]
    for j in range(v.shape[0]):
        change[j] = space.vectors[STEP, j]
    spread(data.rows, data.const, work, change)
    for j in range(v.shape[0]):
        change[j] += v[j] + w * vdot[j]
    count = active[0]
    for i in range(tally.first_limit, tally.first_limit + tally.limits):
        if type_of(blocks.blocks_i, i) != at.T_LIMIT:
            continue
        rate, _ = limit_speeds(blocks, i, change, vdot)
        if limit_gap(blocks, i, q) + 0.5 * w * rate < -closed_limit(blocks, i):
            known = False
            for j in range(first, count + 1):
                known = known or active[j] == i
            if not known:
                active[0] += 1
                active[active[0]] = i
    return active[0] > count


@sweep
def account(scene, lasts, ledger):
    """Record the impulses' loss in the ledger, and the solver's report in the tally.

    A velocity that misses a law lasts until the next solve, for the time `lasts`.
    """
    data = opened(scene)
    tally = contacts_at(data.links.contacts).tally[0]
    report = data.space.vectors[REPORT]
    ledger[at.DISSIPATED] -= report[GAINED]
    tally.residual = max(tally.residual, report[MISSED])
    tally.strayed += lasts * report[STRAYS]
    if report[HARD] > 0.0:
        tally.fallbacks += 1
    if report[CALMED] > 0.0:
        tally.calmed += 1


@sweep
def note_chain(scene, first, t):
    """Count an impact at time t in which a body that rebounds is pushed by several others at once.

    Newton's law then gives another end than impacts one after the other, as with gaps in between.
    """
    data = opened(scene)
    blocks, space = data.blocks, data.space
    tally = contacts_at(data.links.contacts).tally[0]
    active, slots, vectors = blocks.active, space.slots, space.vectors
    found = False
    for j in range(first, active[0] + 1):
        i = active[j]
        hit = blocks.blocks_f[i, at.BOUNCE] * vectors[BEFORE, first_of(slots, i)]
        if type_of(blocks.blocks_i, i) == at.T_CONTACT and hit < -SLIDING:
            for n in range(first, active[0] + 1):
                found = found or (
                    type_of(blocks.blocks_i, active[n]) == at.T_CONTACT
                    and vectors[LAMBDA, first_of(slots, active[n])] > 0.0
                    and meet_at_a_body(blocks.blocks_i, i, active[n])
                )
    if found:
        tally.chains += 1
        if tally.chains == 1:
            tally.chain_time = t


@part
def meet_at_a_body(blocks_i, i, n):
    """True if two contacts share one body that moves, but not both."""
    a, b = ends_of(blocks_i, i)
    c, d = ends_of(blocks_i, n)
    shared = (a > 0 and (a == c or a == d)) or (b > 0 and (b == c or b == d))
    same = (a == c and b == d) or (a == d and b == c)
    return shared and not same


@sweep
def book(scene, first, t, h, last):
    """Keep the impulses for the next step, and as forces on bodies and in touches.

    By how much they miss their laws is noted for the frame and for the run; `t` is their time. A
    part that is not the last of its step only adds points to those that are kept: it may be so
    short that what carries does not push in it.
    """
    data = opened(scene)
    blocks, work, space = data.blocks, data.work, data.space
    contacts = contacts_at(data.links.contacts)
    active, slots = blocks.active, space.slots
    lam = space.vectors[LAMBDA]
    found, kept, tally = contacts.found, contacts.kept, contacts.tally[0]
    pairs, limit_tau = contacts.pairs, contacts.limit_tau
    begin = tally.first_contact
    missed = contacts.islands.pushed
    whole = 1.0 / tally.share if tally.share > BRIEF else 1.0
    count = 0
    for j in range(first, active[0] + 1):
        n = active[j] - begin
        r = first_of(slots, active[j])
        if n < 0 and type_of(blocks.blocks_i, active[j]) == at.T_SPAN:
            force = scale(lam[r] / h, along(space.place, active[j], 0))
            pull = math.copysign(lam[r] / h, blocks.blocks_f[active[j], at.VALUE])
            note_span(scene, active[j], force)
            pairs[pairs.shape[0] + n].force[0] += pull
            log_missed(tally, missed[active[j], 0] / h, 0.0, abs(pull), pairs.shape[0] + n, t)
            continue
        if n < 0:
            term = blocks.blocks_i[active[j], at.B_TERM]
            torque = blocks.terms_f[term] * lam[r] / h  # on the first joint that it bounds
            for i in range(term, term + blocks.blocks_i[active[j], at.B_TERMS]):
                limit_tau[blocks.terms_i[i, 0]] += blocks.terms_f[i] * lam[r] / h
            if type_of(blocks.blocks_i, active[j]) == at.T_FRICTION:
                one = blocks.blocks_f[active[j]]
                one[at.HELD] = lam[r] * one[at.VALUE] / one[at.AIM]
                continue
            pairs[pairs.shape[0] + n].force[0] += torque
            log_missed(tally, missed[active[j], 0] / h, 0.0, abs(torque), pairs.shape[0] + n, t)
            continue
        force = (0.0, 0.0, 0.0)
        for c in range(3):
            d = load(blocks.blocks_f, active[j], at.DIR + 3 * c)
            force = add_scaled(force, lam[r + c] / h, d)
        if n >= found.shape[0]:  # belongs to the previous contact point
            if last:
                set_xyz(kept[count - 1].turn, scale(whole, (lam[r], lam[r + 1], lam[r + 2])))
            note_turn(opened(scene).links.contacts, n - found.shape[0], force)
            continue
        size = math.sqrt(lam[r] ** 2 + lam[r + 1] ** 2 + lam[r + 2] ** 2) / h
        pair = found[n].pair
        log_missed(tally, missed[active[j], 0] / h, missed[active[j], 1] / h, size, pair, t)
        log_depth(
            tally,
            -found[n].gap,
            thickness_at(contacts, n),
            pair,
            t,
        )
        u = gather(space.y, slots, active[j], space.vectors[STEP])
        x, z = space.vectors[RHS, r + 1] + u[1], space.vectors[RHS, r + 2] + u[2]
        slip = math.sqrt(x * x + z * z)
        place_in = count
        if not last:
            new = lam[r] > 0.0 and tally.share > 0.0
            new = new and kept_place(found[n], kept, tally.kept, n) < 0
            place_in = tally.kept if new and tally.kept < kept.shape[0] else -1
        if place_in >= 0:
            push = scale(whole, (lam[r], lam[r + 1], lam[r + 2]))
            if tally.share < BRIEF and found[n].held[0] > 0.0:  # continues as before an impact
                push = xyz(found[n].held)
            keep_point(kept[place_in], found[n], push)
            push, mu = load3(lam, r), blocks.blocks_f[active[j], at.FRICTION]
            kept[place_in].slides = int(goes_on_sliding(push, mu, space.vectors[RHS, r], slip))
            if last:
                count += 1
            else:
                tally.kept += 1
        note(opened(scene).links.contacts, work, n, force, slip)
    if last:
        tally.kept = count


@sweep
def note_span(scene, i, force):
    """Add what the bound of a length exerts, `force` on A, to the wrenches of its two bodies."""
    data = opened(scene)
    work, place = data.work, data.space.place
    wrenches = contacts_at(data.links.contacts).wrenches
    a, b = ends_of(data.blocks.blocks_i, i)
    body_a = data.blocks.blocks_i[i, at.B_BODY_A]
    body_b = data.blocks.blocks_i[i, at.B_BODY_B]
    torque = cross(sub(place_a(place, i), origin_of(work, a)), force)
    add_xyz(wrenches[body_a].torque, torque)
    add_xyz(wrenches[body_a].force, force)
    if body_b > 0:
        torque = cross(sub(place_b(place, i), origin_of(work, b)), force)
        add_xyz(wrenches[body_b].torque, scale(-1.0, torque))
        add_xyz(wrenches[body_b].force, scale(-1.0, force))


@part
def goes_on_sliding(lam, mu, closing, slip):
    """Return 1 if a point slides fast, or slips with the full friction of its cone, else 0.

    `closing` is its normal velocity without impulses.
    """
    pull = math.sqrt(lam[1] * lam[1] + lam[2] * lam[2])
    moves = more(slip, SOLVED * abs(closing))  # some points of a patch may be full
    full = both(more(lam[0], 0.0), most((1.0 - SOLVED) * (mu * lam[0]), pull))
    return either(more(slip, SLIDING), both(moves, full))


@part
def log_missed(tally, complementarity, cone, force, pair, t):
    """Note by how much one contact misses its laws [N], and its force."""
    tally.complementarity = max(tally.complementarity, complementarity)
    tally.cone = max(tally.cone, cone)
    tally.force = max(tally.force, force)
    most = max(complementarity, cone)
    if most > tally.worst:
        tally.worst = most
        tally.worst_pair = pair
        tally.worst_time = t


@part
def log_depth(tally, depth, thickness, pair, t):
    """Record the penetration of two shapes of some thickness [m], of points the depth itself."""
    tally.penetration = max(tally.penetration, depth)
    share = depth / thickness if thickness > 0.0 else depth
    if share > tally.deepest:
        tally.deepest = share
        tally.deepest_depth = depth
        tally.deepest_pair = pair
        tally.deepest_time = t


@part
def thickness_at(contacts, n):
    """Return the thickness of the thinner shape at contact point n, or the shapes' size [m]."""
    a, b = contacts.found[n].shape_a, contacts.found[n].shape_b
    thick = 2.0 * thinner(contacts, a, b)
    return thick if thick > 0.0 else smaller_size(contacts, a, b)


@part
def tolerated(contacts, n, h):
    """Depth of contact point n that is left as it is [m]."""
    size = smaller_size(contacts, contacts.found[n].shape_a, contacts.found[n].shape_b)
    return max(DEPTH * size, WEIGHT * contacts.tally[0].pull * h * h)


@sweep
def push_out(scene, first, h, q):
    """Move q out of deeper penetration along the normals, in the mass metric."""
    data = opened(scene)
    rows, const, blocks, work, space = data.rows, data.const, data.blocks, data.work, data.space
    contacts = contacts_at(data.links.contacts)
    active = blocks.active
    y, slots, vectors, own = space.y, space.slots, space.vectors, space.own
    lam = vectors[LAMBDA]
    dinv = vectors[DINV]
    z = vectors[STEP]
    found, tally = contacts.found, contacts.tally[0]
    begin, room = tally.first_contact, contacts.found.shape[0]
    deepest = 0.0
    deep = False
    for j in range(first, active[0] + 1):
        n = active[j] - begin
        if 0 <= n < room:
            deepest = max(deepest, -found[n].gap)
            deep = deep or -found[n].gap > tolerated(contacts, n, h)
    tally.depth = max(tally.depth, deepest)
    beyond = limits_beyond(scene, first, q)
    if not (deep or beyond > 0.0):
        return
    deepest = max(deepest, beyond)
    for k in range(z.shape[0]):
        z[k] = 0.0
    for j in range(first, active[0] + 1):
        lam[first_of(slots, active[j])] = 0.0
    for _ in range(PUSH_SWEEPS):
        moved = 0.0
        for j in range(first, active[0] + 1):
            i = active[j]
            n = i - begin
            if n >= room or not own[i, 0] > 0.0 or type_of(blocks.blocks_i, i) == at.T_FRICTION:
                continue
            if n < 0:
                gap = RECOVER * blocks.blocks_f[i, at.AIM]
            else:
                gap = RECOVER * (found[n].gap + 0.5 * tolerated(contacts, n, h))
            r = first_of(slots, i)
            for s in range(joints_of(slots, i)):
                gap += y[i, 3 * s] * z[joint_of(slots, i, s)]
            new = max(lam[r] - gap / own[i, 0], 0.0)
            for s in range(joints_of(slots, i)):
                k = joint_of(slots, i, s)
                z[k] += dinv[k] * y[i, 3 * s] * (new - lam[r])
            moved = max(moved, abs(new - lam[r]) * own[i, 0])
            lam[r] = new
        if not moved > ENOUGH * RECOVER * deepest:
            break
    spread(rows, const, work, z)
    advance(rows, q, z, 1.0)


@sweep
def limits_beyond(scene, first, q):
    """Write the gaps of limits at q into AIM, and return the largest excess."""
    data = opened(scene)
    blocks, vectors = data.blocks, data.space.vectors
    blocks_i, blocks_f, active = blocks.blocks_i, blocks.blocks_f, blocks.active
    beyond = 0.0
    moved = False
    for j in range(first, active[0] + 1):
        i = active[j]
        kind = type_of(blocks_i, i)
        if kind == at.T_LIMIT:
            gap = limit_gap(blocks, i, q)
            blocks_f[i, at.AIM] = gap
            if -gap > 4.0 * closed_limit(blocks, i):
                beyond = max(beyond, -gap)
        elif kind == at.T_SPAN:
            if not moved:
                frames(data.rows, data.const, data.work, q, vectors[STEP])
                positions(data.rows, data.work)
                moved = True
            a, b = ends_of(blocks_i, i)
            gap, _, _, _ = span(blocks_f, i, data.work, a, b)
            blocks_f[i, at.AIM] = gap
            beyond = max(beyond, -gap)
    return beyond


@sweep
def turn_rates(rows, const, work, v):
    """Angular velocities of all rows for other joint velocities, frames unchanged."""
    for k in range(1, rows.shape[0]):
        p = parent_of(rows, k)
        j = v_of(rows, k)
        w = spin_of(work, p)
        kind = kind_of(rows, k)
        if kind == ROTATE:
            w = add_scaled(w, v[j], axis_of(work, k))
        elif kind >= BALL:
            axes = base_axes(const, work, p, k)
            w = add(w, mul(axes, (v[j], v[j + 1], v[j + 2])))
        set_spin(work, k, w)
