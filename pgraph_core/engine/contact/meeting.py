"""When things meet within a step of time stepping.

The gap of two convex shapes over a bound of the speed at which it closes is a time in which they
cannot touch: conservative advancement ([Mirtich 1996]). Joint limits are gaps too. The path is that
of a step without impulses of what meets: q moves along v₀ + a τ / 2 for the time τ.
"""

import math

from .. import layout as at
from ..arrays import opened
from ..compiler.jit import part, sweep
from ..constraints.blocks import point_velocity, total, velocities
from ..records import POINTS, RIGID, SPHERE
from ..tree.kinematics import outboard, positions
from ..tree.moving import advance
from ..vec import dot, load, sub, xyz
from .contacts import contacts_at, endpoints, middle
from .ground import above, candidate, candidates, normal_of, top
from .pairs import pair_contacts
from .search import are_apart
from .shapes import place

NEAR = 1e-9  # of the size of what touches: a gap that counts as closed
DEPTH = 1e-5  # of the size of what touches: penetration that is tolerated
ROUNDING = 2.0**-50  # of the coordinates that a gap is the difference of
CLOSED = 1e-10  # of the size of a limit's range: a limit this near is reached
HARD = 4.0  # times what weight adds in a step: slower impacts are taken where the step finds them
CROWD = 64  # candidates: in larger scenes slow impacts are taken where the step finds them
SIZE = at.PA  # in the block of a limit, which has no points
ROUNDS = 200  # of the search for one instant
SURE = 1.02  # a bound of a closing speed over its value now


@part
def smaller_size(contacts, a, b):
    """Size of the smaller of two shapes [m]; b is -1 for the ground."""
    shapes = contacts.geometry.shapes
    size = shapes[a].reach
    if b >= 0:
        size = min(size, shapes[b].reach)
    return size if size > 0.0 else contacts.tally[0].length


@part
def closed_gap(contacts, a, b, p):
    """A gap of two shapes at point p that counts as closed [m]."""
    rounding = ROUNDING * (abs(p[0]) + abs(p[1]) + abs(p[2]))
    return max(NEAR * smaller_size(contacts, a, b), rounding)


@part
def closed_limit(blocks, i):
    """A gap of limit i that counts as closed [rad, m]; SIZE of its block is that of its range."""
    size, value = blocks.blocks_f[i, SIZE], blocks.blocks_f[i, at.VALUE]
    return max(CLOSED * size, ROUNDING * abs(value))


@part
def hits(closing, h, size, pull):
    """Whether a closing speed is an impact, in steps of width h, that is worth locating."""
    return closing * h > DEPTH * size and closing > HARD * pull * h


@part
def thickness(shape):
    """How thin a shape is [m]; a point is nothing."""
    if shape.kind == POINTS:
        return 0.0
    half = shape.half_extents
    return min(half[0], min(half[1], half[2]))


@part
def shape_speed(work, linear, shape, pose):
    """Bound of the speed of a shape's points [m/s]."""
    u = point_velocity(work, linear, shape.row, xyz(pose.position))
    turn = load(work, shape.row, at.W)
    arm = 0.0 if shape.kind == SPHERE else shape.reach
    return math.sqrt(dot(u, u)) + arm * math.sqrt(dot(turn, turn))


@part
def is_crowd(contacts):
    """Whether there is so much that may touch that slow impacts are not located one by one."""
    may = contacts.candidates
    return may.on_ground.shape[0] + may.pairs.shape[0] + may.members.shape[0] > CROWD


@sweep
def look_ahead(scene, h):
    """What is closed, how far to look for what may touch [m], whether something is fast.

    After `velocities` of the middle of the step and `place`.
    """
    data = opened(scene)
    contacts = contacts_at(data.links.contacts)
    shapes, poses = contacts.geometry.shapes, contacts.poses
    linear = data.space.linear
    closed = 0.0
    margin = 0.0
    fast = False
    for i in range(shapes.shape[0]):
        closed = max(closed, closed_gap(contacts, i, -1, xyz(poses[i].position)))
        if shapes[i].row > 0:
            moved = h * shape_speed(data.work, linear, shapes[i], poses[i])
            thick = thickness(shapes[i])
            if shapes[i].kind != POINTS and moved > thick:
                fast = True
                moved = thick
            margin = max(margin, moved)
    pairs = contacts.candidates.pairs
    for k in range(pairs.shape[0]):
        a, b = pairs[k].shape_a, pairs[k].shape_b
        if shapes[a].kind == POINTS and not fast:
            moved = h * shape_speed(data.work, linear, shapes[a], poses[a])
            moved += h * shape_speed(data.work, linear, shapes[b], poses[b])
            fast = moved > thickness(shapes[b])
    return 8.0 * closed, 0.0 if is_crowd(contacts) else margin, fast


@sweep
def point_meets(scene, n, h, left):
    """Whether contact point n, in the middle of a part of a step, hits within that part.

    The step is h wide, its part `left`. After `velocities`.
    """
    data = opened(scene)
    contacts = contacts_at(data.links.contacts)
    point = contacts.found[n]
    if contacts.laws[point.pair].law != RIGID:
        return False
    closing = point_closing(data.work, data.space.linear, contacts, n)
    size = smaller_size(contacts, point.shape_a, point.shape_b)
    if not hits(closing, h, size, contacts.tally[0].pull):
        return False
    return point.gap - 0.5 * left * closing <= closed_gap(
        contacts, point.shape_a, point.shape_b, xyz(point.point_a)
    )


@part
def point_closing(work, linear, contacts, n):
    """Speed at which the gap of contact point n closes [m/s]."""
    a, b, _, _, _ = endpoints(contacts, n)
    p = middle(contacts.found[n])
    u = sub(point_velocity(work, linear, a, p), point_velocity(work, linear, b, p))
    return -dot(u, xyz(contacts.found[n].normal))


@sweep
def limit_meets(blocks, i, h, left, q, v, vdot):
    """Whether limit i, in the middle of a part of a step, is hit within that part."""
    closing = -total(blocks.blocks_i, blocks.terms_i, blocks.terms_f, i, 0, v)
    pull = abs(total(blocks.blocks_i, blocks.terms_i, blocks.terms_f, i, 0, vdot))
    if not hits(closing, h, blocks.blocks_f[i, SIZE], pull):
        return False
    gap = total(blocks.blocks_i, blocks.terms_i, blocks.terms_f, i, 1, q)
    gap -= blocks.blocks_f[i, at.VALUE]
    return gap - 0.5 * left * closing <= closed_limit(blocks, i)


# -- the first meeting --------------------------------------------------------------------------


@sweep
def state_at(scene, tau, q, v, start, vdot, speed):
    """q and the scene's shapes a time τ on from the state `start`."""
    data = opened(scene)
    contacts = contacts_at(data.links.contacts)
    for i in range(q.shape[0]):
        q[i] = start[i]
    for j in range(v.shape[0]):
        speed[j] = start[q.shape[0] + j] + 0.5 * tau * vdot[j]
    advance(data.rows, q, speed, tau)
    for j in range(v.shape[0]):
        speed[j] = start[q.shape[0] + j] + tau * vdot[j]
    outboard(data.rows, data.const, data.work, q, speed)
    positions(data.rows, data.work)
    velocities(data.rows, data.const, data.work, speed, data.space.linear)
    place(contacts.geometry.shapes, data.work, contacts.poses)


@sweep
def first_meeting(scene, h, left, q, v, start, vdot, speed):
    """Time until things that are apart first touch [s]; 0 where some do, and hit; else `left`.

    From the state `start`, where q is again after it.
    """
    contacts = contacts_at(opened(scene).links.contacts)
    meetings = contacts.meetings
    state_at(scene, 0.0, q, v, start, vdot, speed)
    count = list_meetings(scene, h, left, q, v, vdot)
    found = left
    if count < 0:
        found = 0.0
    elif count > 0:
        tau = 0.0
        before = 0.0
        for _ in range(ROUNDS):
            step = left - tau
            arrived = False
            beyond = False
            for n in range(count):
                gap, rate, closed = gap_of(scene, meetings[n], q, v, vdot, left - tau)
                beyond = beyond or gap < -closed
                arrived = arrived or gap <= closed
                if rate > 0.0:
                    step = min(step, (gap - 0.5 * closed) / rate)
            if beyond:
                tau = 0.5 * (before + tau)
            elif arrived:
                found = tau
                break
            else:
                before = tau
                tau += step
                if tau >= left * (1.0 - 1e-12):
                    break
            state_at(scene, tau, q, v, start, vdot, speed)
    for i in range(q.shape[0]):
        q[i] = start[i]
    return found


@part
def gap_of(scene, meeting, q, v, vdot, left):
    """(gap, bound of its closing speed from now on, gap that is closed) of two things."""
    data = opened(scene)
    if meeting.shape_a < 0:
        gap, rate = limit_gap(data.blocks, meeting.vertex, q, v, vdot, left)
        return gap, rate, closed_limit(data.blocks, meeting.vertex)
    contacts = contacts_at(data.links.contacts)
    if meeting.shape_b < 0:
        gap, p = ground_point(contacts, meeting.shape_a, meeting.vertex)
        normal = normal_of(contacts.ground)
    else:
        gap, p, normal = nearest(contacts, meeting.shape_a, meeting.shape_b, meeting.pair)
    rate = closing_bound(scene, meeting.shape_a, meeting.shape_b, normal, left)
    return gap, rate, closed_gap(contacts, meeting.shape_a, meeting.shape_b, p)


@part
def limit_gap(blocks, i, q, v, vdot, left):
    """(gap, bound of the speed at which it closes within the time left) of limit i."""
    gap = total(blocks.blocks_i, blocks.terms_i, blocks.terms_f, i, 1, q)
    now = -total(blocks.blocks_i, blocks.terms_i, blocks.terms_f, i, 0, v)
    change = total(blocks.blocks_i, blocks.terms_i, blocks.terms_f, i, 0, vdot)
    return gap - blocks.blocks_f[i, at.VALUE], SURE * max(now, 0.0) + left * abs(change)


@part
def ground_point(contacts, i, k):
    """(gap, place) of the k-th part of shape i that may touch the ground."""
    p, radius, _ = candidate(contacts.geometry, contacts.ground, contacts.poses, i, k)
    return above(contacts.ground, p) - radius, p


@sweep
def nearest(contacts, i, j, pair):
    """(gap, place, normal) where two shapes are nearest."""
    found = contacts.found
    n = pair_contacts(
        contacts.geometry, contacts.poses, i, j, pair, math.inf, contacts.search.room, found, 0
    )
    best = math.inf
    p = (0.0, 0.0, 0.0)
    normal = (0.0, 0.0, 1.0)
    for k in range(min(n, found.shape[0])):
        if found[k].gap < best:
            best = found[k].gap
            p = xyz(found[k].point_a)
            normal = xyz(found[k].normal)
    return best, p, normal


@part
def closing_bound(scene, i, j, normal, left):
    """Bound of the speed at which any points of two shapes come together along a normal."""
    data = opened(scene)
    contacts = contacts_at(data.links.contacts)
    shapes, poses = contacts.geometry.shapes, contacts.poses
    u, turn, arm = motion_of(data.work, data.space.linear, shapes[i], poses[i])
    if j >= 0:
        w, more, other = motion_of(data.work, data.space.linear, shapes[j], poses[j])
        u = sub(u, w)
        turn = max(turn, more)
        arm += other
    size = math.sqrt(dot(u, u))
    bend = min(1.0, turn * left) * size + 2.0 * contacts.tally[0].pull * left
    return SURE * max(-dot(u, normal), 0.0) + arm + bend + 1e-6 * size


@part
def motion_of(work, linear, shape, pose):
    """(velocity, speed of turning, speed of points by it) of a shape; a ball's turning is none."""
    k = shape.row
    u = point_velocity(work, linear, k, xyz(pose.position))
    w = load(work, k, at.W)
    turn = math.sqrt(dot(w, w))
    return u, turn, 0.0 if shape.kind == SPHERE else turn * shape.reach


@part
def put_meeting(meetings, n, a, b, vertex, pair):
    """Write meeting n; n + 1. What does not fit is counted."""
    if n < meetings.shape[0]:
        meetings[n].shape_a = a
        meetings[n].shape_b = b
        meetings[n].vertex = vertex
        meetings[n].pair = pair
    return n + 1


@sweep
def list_meetings(scene, h, left, q, v, vdot):
    """List what is apart and may touch within `left`; how many, or -1 where something hits now."""
    data = opened(scene)
    blocks, work, linear = data.blocks, data.work, data.space.linear
    contacts = contacts_at(data.links.contacts)
    tally, meetings = contacts.tally[0], contacts.meetings
    shapes, poses, may = contacts.geometry.shapes, contacts.poses, contacts.candidates
    crowd = is_crowd(contacts)
    n = 0
    for i in range(tally.first_limit, tally.first_limit + tally.limits):
        gap, rate = limit_gap(blocks, i, q, v, vdot, left)
        if gap > closed_limit(blocks, i):
            if gap <= rate * left:
                n = put_meeting(meetings, n, -1, -1, i, -1)
        elif limit_meets(blocks, i, h, 0.0, q, v, vdot):
            return -1
    for k in range(may.on_ground.shape[0]):
        i, pair = may.on_ground[k].shape, may.on_ground[k].pair
        moved = left * (shape_speed(work, linear, shapes[i], poses[i]) + 2.0 * tally.pull * left)
        altitude = dot(xyz(poses[i].position), normal_of(contacts.ground)) - shapes[i].reach
        if (
            contacts.laws[pair].law != RIGID
            or altitude > top(contacts.ground) + moved
            or (crowd and moved <= thickness(shapes[i]))
        ):
            continue
        for c in range(candidates(shapes, i)):
            gap, p = ground_point(contacts, i, c)
            if gap > closed_gap(contacts, i, -1, p):
                if gap <= moved:
                    n = put_meeting(meetings, n, i, -1, c, pair)
            elif hits_now(scene, i, -1, p, normal_of(contacts.ground), h):
                return -1
    for k in range(may.pairs.shape[0]):
        if n >= 0:
            i, j, pair = may.pairs[k].shape_a, may.pairs[k].shape_b, may.pairs[k].pair
            n = list_pair(scene, i, j, pair, h, left, crowd, n)
    members = may.members
    for m in range(members.shape[0]):
        for k in range(m):
            i, j = members[m].shape, members[k].shape
            same = members[m].pair != members[k].pair or shapes[i].row == shapes[j].row
            if n >= 0 and not same and not are_apart(may.apart, shapes[i].body, shapes[j].body):
                n = list_pair(scene, min(i, j), max(i, j), members[m].pair, h, left, crowd, n)
    if n > meetings.shape[0]:
        tally.overflows += 1
        n = meetings.shape[0]
    return n


@sweep
def list_pair(scene, i, j, pair, h, left, crowd, n):
    """List two shapes if they are apart and may touch within `left`; -1 where they hit now."""
    data = opened(scene)
    contacts = contacts_at(data.links.contacts)
    shapes, poses, meetings = contacts.geometry.shapes, contacts.poses, contacts.meetings
    if contacts.laws[pair].law != RIGID:
        return n
    moved = left * shape_speed(data.work, data.space.linear, shapes[i], poses[i])
    moved += left * shape_speed(data.work, data.space.linear, shapes[j], poses[j])
    moved += 2.0 * contacts.tally[0].pull * left * left
    apart = sub(xyz(poses[i].position), xyz(poses[j].position))
    reach = shapes[i].reach + shapes[j].reach + moved
    if not dot(apart, apart) <= reach * reach:
        return n
    if crowd and moved <= thickness(shapes[i]) + thickness(shapes[j]):
        return n
    gap, p, _ = nearest(contacts, i, j, pair)
    closed = closed_gap(contacts, i, j, p)
    if gap > closed:
        return put_meeting(meetings, n, i, j, 0, pair) if gap <= moved else n
    count = pair_contacts(
        contacts.geometry, poses, i, j, pair, closed, contacts.search.room, contacts.found, 0
    )
    for k in range(min(count, contacts.found.shape[0])):
        point = contacts.found[k]
        if hits_now(scene, i, j, middle(point), xyz(point.normal), h):
            return -1
    return n


@part
def hits_now(scene, i, j, p, normal, h):
    """Whether two shapes that touch at p hit each other there."""
    data = opened(scene)
    contacts = contacts_at(data.links.contacts)
    shapes, linear = contacts.geometry.shapes, data.space.linear
    u = point_velocity(data.work, linear, shapes[i].row, p)
    if j >= 0:
        u = sub(u, point_velocity(data.work, linear, shapes[j].row, p))
    return hits(-dot(u, normal), h, smaller_size(contacts, i, j), contacts.tally[0].pull)
