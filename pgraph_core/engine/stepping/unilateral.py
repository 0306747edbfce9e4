"""Limits, contacts and friction in a sub-step, and the removal of penetration."""

import math

from ...tolerances import NOTABLE, TOUCHING
from .. import layout as at
from ..arrays import BEFORE, DINV, EFFECT, LAMBDA, PUSH, SPEEDS_AFTER, TARGET
from ..cables import cable_length, changes_at, over_spans
from ..compiler.jit import part, sweep
from ..constraints.blocks import (
    ends_of,
    first_of,
    joint_of,
    joints_of,
    one_sided,
    point_b,
    point_velocity,
    span,
    stations_of,
    type_of,
    velocities,
)
from ..constraints.paths import spread
from ..contact.closing import closed_gap, smaller_size
from ..contact.contacts import (
    contacts_at,
    kept_place,
    resists_turning,
    set_block,
    set_turn,
    slides_now,
    touching,
)
from ..contact.islands import find_islands
from ..contact.meeting import (
    ARRIVED,
    closed_limit,
    limit_arrival,
    limit_gap,
    limit_speeds,
    look_ahead,
    point_meets,
)
from ..contact.placing import DEPTH, place
from ..motion import opened
from ..records import RIGID
from ..tree.kinematics import frames, positions
from ..tree.moving import advance
from ..vec import dot, sub, xyz

RECOVER = 0.2  # part of deeper penetration that a step removes
PUSH_SWEEPS = 30
OPENED = 1e-3  # share of the penetration to remove below which a sweep is the last
DRIFT = 50.0  # largest drift of a loaded contact whose gap is closed, in tolerated depths
# a part: whether something hits in it, until it does, what is left, and until then without a look
ASK, CUT, REMAINDER, TAKE = 0, 1, 2, 3
SINKING = 0.1  # penetration tolerance as a fraction of g h^2


@sweep
def add_unilateral(scene, h, w, left, mode, q, v, vdot):
    """Append limits and touching rigid contacts to the active blocks.

    If requested, return whether an impact may occur within this sub-step of width w, in a step of
    width h of which `left` remained before. If constraints are active, the way to a limit that
    rebounds depends on their impulses (`limit_on_the_way`), so it is only appended if closed.
    """
    look = mode == ASK
    data = opened(scene)
    blocks = data.blocks
    follows = blocks.active[0] > 0 and w > 0.0 and mode != REMAINDER
    contacts = contacts_at(data.links.contacts)
    blocks_i, active = blocks.blocks_i, blocks.active
    laws, tally = contacts.laws, contacts.tally[0]
    first = tally.first_limit
    for i in range(first - tally.frictions, first):
        if w > 0.0:  # a force without an impulse: it does nothing in an impact
            blocks.blocks_f[i, at.AIM] = w * blocks.blocks_f[i, at.VALUE]
            append(active, i)
    for i in range(first, first + tally.limits):
        if type_of(blocks_i, i) == at.T_SPAN:
            if w > 0.0 and span_reaches(scene, i, h, w, v):
                append(active, i)
            continue
        if type_of(blocks_i, i) == at.T_SLACK:
            if w > 0.0 and segment_reaches(scene, i, h, w, q, v):
                append(active, i)
                append_chain(scene, i)
            continue
        if type_of(blocks_i, i) == at.T_WRAP:
            continue
        led = follows and blocks.blocks_f[i, at.REBOUND] > 0.0
        if look:
            arrival = limit_arrival(blocks, i, 0.5 * w, h, w, q, v, vdot)
            if arrival == 0.0 or (arrival < w and not led):
                return True
        reaches = limit_reaches(blocks, i, h, w, left, mode == REMAINDER, q, v, vdot)
        if reaches and not (led and blocks.blocks_f[i, at.AIM] != 0.0):
            append(active, i)
    if laws.shape[0] == 0:
        return False
    velocities(data.rows, data.const, data.work, v, data.space.linear)
    place(contacts.geometry.shapes, data.work, contacts.poses)
    closed, margin, fast = look_ahead(scene, w)
    if look and fast:
        return True
    first = tally.first_contact
    closed = max(closed, DRIFT * max(DEPTH * tally.length, SINKING * tally.pull * h * h))
    tally.margin = max(closed, margin) if look else closed
    count = touching(scene, tally.margin, 1)
    for n in range(count):
        point = contacts.found[n]
        if look and point_meets(scene, n, h, w):
            return True
        near = 4.0 * closed_gap(contacts, point.shape_a, point.shape_b, xyz(point.point_a))
        slack = 0.0
        if point.gap > near and carried(contacts, n):
            near = DRIFT * tolerated(contacts, n, h)
            slack = point.gap / h
        if w == 0.0 and point.gap > near:
            near = max(near, together(contacts, n, count, h))
        if laws[point.pair].law == RIGID and point.gap <= near:
            law = laws[point.pair]
            slides = law.static_friction == law.friction
            slides = slides or slides_now(contacts, data.work, data.space.linear, n)
            set_block(contacts, blocks, n, first + n, slides)
            blocks.blocks_f[first + n, at.VALUE] = slack
            blocks.blocks_f[first + n, at.ROOM] = (point.gap + tolerated(contacts, n, h)) / h
            append(active, first + n)
            if resists_turning(law):
                set_turn(contacts, blocks, n, tally.first_turn + n)
                append(active, tally.first_turn + n)
    return False


@part
def append(active, i):
    """Append block i to the active blocks."""
    active[0] += 1
    active[active[0]] = i


@part
def append_chain(scene, i):
    """Append the friction on wheels of the chain of a cable that begins with block i."""
    blocks = opened(scene).blocks
    n = i + 1
    while n < blocks.blocks_i.shape[0] and blocks.blocks_i[n, at.B_CHAIN] == n - i:
        set_wrap(scene, n)
        append(blocks.active, n)
        n += 1


@sweep
def set_wrap(scene, i):
    """Write the bounds of the friction of a cable on a wheel."""
    data = opened(scene)
    blocks = data.blocks
    wheel = stations_of(blocks.blocks_i, i)[0]
    fall, rise = changes_at(blocks.stations, data.work, wheel)
    blocks.blocks_f[i, at.WRAP_FALL], blocks.blocks_f[i, at.WRAP_RISE] = fall, rise


@part
def limit_reaches(blocks, i, h, w, left, rest, q, v, vdot):
    """Check whether limit i may be reached in a sub-step of width w, from its midpoint q.

    The permitted speed of the joint is the speed at which it reaches the limit at the end of the
    sub-step. The joint rebounds in an impact, which has zero width, or if the `rest` of a step is
    computed at once. The joint remains at the limit if all rebounds, each `e` times as long as the
    previous one, would end within the step.
    """
    blocks_f, closed = blocks.blocks_f, closed_limit(blocks, i)
    gap = limit_gap(blocks, i, q)
    rate, change = limit_speeds(blocks, i, v, vdot)
    blocks_f[i, at.AIM] = 0.0
    blocks_f[i, at.BOUNCE] = 0.0
    blocks_f[i, at.ROOM] = (gap + DEPTH * blocks_f[i, at.SIZE]) / h
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


@part
def rebounds(blocks, i):
    """Check whether block i is a limit with restitution."""
    return type_of(blocks.blocks_i, i) == at.T_LIMIT and blocks.blocks_f[i, at.REBOUND] > 0.0


@sweep
def limit_on_the_way(scene, first, h, w, q, v, vdot):
    """Check whether a limit that rebounds is hit before the end of a part of width w of a step of
    width h, from its middle q, on the way with all impulses, whose effect is in EFFECT."""
    data = opened(scene)
    blocks, work, change = data.blocks, data.work, data.space.vectors[SPEEDS_AFTER]
    active, tally = blocks.active, contacts_at(data.links.contacts).tally[0]
    found = False
    for i in range(tally.first_limit, tally.first_limit + tally.limits):
        found = found or rebounds(blocks, i)
    if not found:
        return False
    for j in range(v.shape[0]):
        change[j] = data.space.vectors[EFFECT, j]
    spread(data.rows, data.const, work, change)
    for j in range(v.shape[0]):
        change[j] = vdot[j] + change[j] / w
    found = False
    for i in range(tally.first_limit, tally.first_limit + tally.limits):
        if rebounds(blocks, i):
            known = False
            for j in range(first, active[0] + 1):
                known = known or active[j] == i
            arrival = limit_arrival(blocks, i, 0.5 * w, h, w, q, v, change)
            found = found or (not known and arrival < w * (1.0 - ARRIVED))
    return found


@sweep
def keep_resting(scene, first):
    """Let unilateral blocks rebound from their speeds before constraints were switched, in TARGET,
    and not from those that this has given them, in BEFORE.

    What rested does not rebound. Newton's restitution acts on the speed before an impact.
    """
    data = opened(scene)
    blocks, slots, vectors = data.blocks, data.space.slots, data.space.vectors
    for j in range(first, blocks.active[0] + 1):
        i = blocks.active[j]
        if one_sided(type_of(blocks.blocks_i, i)):
            r = first_of(slots, i)
            old, now = -vectors[TARGET, r], -vectors[BEFORE, r]
            if not old > max(blocks.blocks_f[i, at.ROOM], 0.0):
                blocks.blocks_f[i, at.BOUNCE] = 0.0
            elif now > old:
                blocks.blocks_f[i, at.BOUNCE] *= old / now


@sweep
def add_passed(scene, first, w, q, v, vdot):
    """Append limits that impulses on other rows would violate. Returns True if there are any.

    q is the middle of the part of width w, and EFFECT has the impulses' effect.
    """
    data = opened(scene)
    blocks, work, space = data.blocks, data.work, data.space
    active, tally = blocks.active, contacts_at(data.links.contacts).tally[0]
    if tally.limits == 0:
        return False
    change = space.vectors[SPEEDS_AFTER]
    for j in range(v.shape[0]):
        change[j] = space.vectors[EFFECT, j]
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
                append(active, i)
    return active[0] > count


@sweep
def span_reaches(scene, i, h, w, v):
    """Check whether a length may exceed its bound within a sub-step of width w, from its midpoint,
    of a step of width h.

    The permitted speed of its block is then set such that it reaches the bound at the end of the
    sub-step, or moves along it. A transverse speed u lengthens it by w² u² / (8 length) in half a
    sub-step, and turns it. A body that swings at a fixed length therefore conserves its energy.
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
    blocks.blocks_f[i, at.ROOM] = (gap + DEPTH * abs(bound)) / h
    parting = dot(u, apart) / length
    across = math.copysign(max(dot(u, u) - parting * parting, 0.0) / length, bound)
    closing = max(-math.copysign(1.0, bound) * parting, 0.0)
    bent = 0.5 * w * across
    blocks.blocks_f[i, at.AIM] = max(2.0 * gap / w + 0.5 * bent, bent)
    pull = contacts_at(data.links.contacts).tally[0].pull
    return gap <= w * (closing + abs(bent) + w * pull) + TOUCHING * abs(bound)


@part
def hurrying(linear, vias, work, n, p, q, along):
    """Return the relative speed of the two ends of a span."""
    u = point_velocity(work, linear, vias[n - 1].row, p)
    u = sub(point_velocity(work, linear, vias[n].row, q), u)
    return math.sqrt(dot(u, u))


fastest = over_spans(hurrying)


@sweep
def segment_reaches(scene, i, h, w, q, v):
    """Check whether a segment of a cable may become taut within a sub-step of width w, from its
    midpoint, of a step of width h.

    Its permitted speed is that at which it is taut at the end of the sub-step. The turning of its
    spans is in the target of its row.
    """
    data = opened(scene)
    blocks, work, linear = data.blocks, data.work, data.space.linear
    velocities(data.rows, data.const, work, v, linear)
    first, last = stations_of(blocks.blocks_i, i)
    longest = blocks.blocks_f[i, at.VALUE]
    gap = longest - cable_length(blocks.stations, work, q, first, last)
    blocks.blocks_f[i, at.ROOM] = (gap + DEPTH * abs(longest)) / h
    blocks.blocks_f[i, at.AIM] = max(2.0 * gap / w, 0.0)
    fast = fastest(linear, blocks.stations, work, first, last)
    pull = contacts_at(data.links.contacts).tally[0].pull
    return gap <= w * (fast + w * pull) + TOUCHING * abs(longest)


@part
def together(contacts, n, count, h):
    """Return the largest gap at which point n shares an impact of closed points between its shapes.

    The arrival times of corners may differ by the asymmetry due to earlier steps. If their shapes
    rest on other corners, this is as large as the tolerated depth of these. A finer run then takes
    corners together that are farther apart: if the order of their impacts is not certain and
    affects the motion, the runs differ.
    """
    this = contacts.found[n]
    hit, rests = False, False
    for m in range(count):
        other = contacts.found[m]
        if other.shape_a == this.shape_a and other.shape_b == this.shape_b:
            near = 4.0 * closed_gap(contacts, other.shape_a, other.shape_b, xyz(other.point_a))
            hit = hit or other.gap <= near
            rests = rests or carried(contacts, m)
    if hit and rests:
        return tolerated(contacts, n, h) / contacts.tally[0].fine ** 3
    return NOTABLE * smaller_size(contacts, this.shape_a, this.shape_b) if hit else 0.0


@part
def carried(contacts, n):
    """Check whether contact point n carried load in the last step.

    Rotation may since have moved it off the surface.
    """
    k = kept_place(contacts.found[n], contacts.kept, contacts.tally[0].kept, n)
    return k >= 0 and contacts.kept[k].value[0] > 0.0


@part
def tolerated(contacts, n, h):
    """Compute the depth of contact point n that is tolerated [m]."""
    size = smaller_size(contacts, contacts.found[n].shape_a, contacts.found[n].shape_b)
    return max(DEPTH * size, SINKING * contacts.tally[0].pull * h * h)


@sweep
def push_out(scene, first, h, q):
    """Reduce deep penetration by moving q along the normals, in the mass metric, separately for
    each island. Returns whether there was any. The move is in PUSH.
    """
    data = opened(scene)
    blocks, space = data.blocks, data.space
    contacts = contacts_at(data.links.contacts)
    active, found, tally = blocks.active, contacts.found, contacts.tally[0]
    begin, room = tally.first_contact, found.shape[0]
    deep = limits_beyond(scene, first, q) > 0.0
    for j in range(first, active[0] + 1):
        n = active[j] - begin
        if 0 <= n < room:
            tally.depth = max(tally.depth, -found[n].gap)
            deep = deep or -found[n].gap > tolerated(contacts, n, h)
            blocks.blocks_f[active[j], at.AIM] = found[n].gap + 0.5 * tolerated(contacts, n, h)
    if not deep:
        return False
    z = space.vectors[PUSH]
    for k in range(z.shape[0]):
        z[k] = 0.0
    for n in range(find_islands(scene)):
        deepest = depth_to_remove(scene, n, h)
        if deepest > 0.0:
            separate(scene, n, RECOVER * deepest)
    spread(data.rows, data.const, data.work, z)
    advance(data.rows, q, z, 1.0)
    return True


@part
def depth_to_remove(scene, n, h):
    """Find the largest penetration in island n [m, rad], or zero if all of it is tolerated."""
    data = opened(scene)
    blocks, contacts = data.blocks, contacts_at(data.links.contacts)
    islands, begin = contacts.islands, contacts.tally[0].first_contact
    deepest = 0.0
    deep = False
    for j in range(islands.first[n], islands.first[n + 1]):
        i = islands.blocks[j]
        kind = type_of(blocks.blocks_i, i)
        if kind == at.T_CONTACT:
            depth = -contacts.found[i - begin].gap
            deep = deep or depth > tolerated(contacts, i - begin, h)
            deepest = max(deepest, depth)
        elif one_sided(kind):
            depth = -blocks.blocks_f[i, at.AIM]
            deep = deep or depth > (4.0 * closed_limit(blocks, i) if kind == at.T_LIMIT else 0.0)
            deepest = max(deepest, depth)
    return deepest if deep else 0.0


@sweep
def separate(scene, n, way):
    """Add the motion that opens the gaps in AIM of island n to PUSH, with an accuracy of OPENED
    times `way` [m]."""
    data = opened(scene)
    blocks, space = data.blocks, data.space
    islands = contacts_at(data.links.contacts).islands
    y, slots, own = space.y, space.slots, space.own
    lam, dinv, z = space.vectors[LAMBDA], space.vectors[DINV], space.vectors[PUSH]
    for j in range(islands.first[n], islands.first[n + 1]):
        lam[first_of(slots, islands.blocks[j])] = 0.0
    for _ in range(PUSH_SWEEPS):
        moved = 0.0
        for j in range(islands.first[n], islands.first[n + 1]):
            i = islands.blocks[j]
            if not own[i, 0] > 0.0 or not one_sided(type_of(blocks.blocks_i, i)):
                continue
            r = first_of(slots, i)
            gap = RECOVER * blocks.blocks_f[i, at.AIM]
            for s in range(joints_of(slots, i)):
                gap += y[i, 3 * s] * z[joint_of(slots, i, s)]
            new = max(lam[r] - gap / own[i, 0], 0.0)
            if new == lam[r]:
                continue
            for s in range(joints_of(slots, i)):
                k = joint_of(slots, i, s)
                z[k] += dinv[k] * y[i, 3 * s] * (new - lam[r])
            moved = max(moved, abs(new - lam[r]) * own[i, 0])
            lam[r] = new
        if not moved > OPENED * way:
            break


@sweep
def limits_beyond(scene, first, q):
    """Write the gaps of limits at q into AIM. Returns the largest excess."""
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
        elif (kind == at.T_SPAN or kind == at.T_SLACK) and not moved:
            frames(data.rows, data.const, data.work, q, vectors[EFFECT])
            positions(data.rows, data.work)
            moved = True
        if kind == at.T_SPAN:
            a, b = ends_of(blocks_i, i)
            gap, _, _, _ = span(blocks_f, i, data.work, a, b)
            blocks_f[i, at.AIM] = gap
            beyond = max(beyond, -gap)
        elif kind == at.T_SLACK:
            first_of_all, last = stations_of(blocks_i, i)
            length = cable_length(blocks.stations, data.work, q, first_of_all, last)
            blocks_f[i, at.AIM] = blocks_f[i, at.VALUE] - length
            beyond = max(beyond, -blocks_f[i, at.AIM])
    return beyond
