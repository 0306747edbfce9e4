"""Location of impacts within a time step.

The gap of two convex shapes over a bound of the speed at which it closes is a time in which they
cannot touch: conservative advancement ([Mirtich 1996]). The path is the motion in a step without
impulses of the new contacts, where q moves with v₀ + a τ / 2 for the time τ. The gap of a joint
limit is therefore a parabola, whose first root is the time of impact, even for slow impacts.

For two shapes in contact, other points may touch down within the step. For example, a plate that
has landed on one edge falls onto the opposite edge. Each contact point has its own gap. New contact
points are detected after they have penetrated, and are then traced back in time.
"""

import math

from ...tolerances import COINCIDENT, ROUNDING
from .. import layout as at
from ..arrays import opened
from ..compiler.jit import part, sweep
from ..constraints.blocks import point_velocity, type_of, velocities
from ..constraints.coordinates import total
from ..records import CYLINDER, POINTS, RIGID
from ..tree.kinematics import frames, positions
from ..tree.moving import advance
from ..vec import dot, sub, xyz
from .closing import (
    COORDINATES,
    PART,
    closed_gap,
    closing_bound,
    curving_bound,
    hits,
    point_closing,
    shape_speed,
    smaller_size,
    thickness,
    thinner,
)
from .contacts import contacts_at, middle
from .ground import above, candidate, candidates, normal_of, top
from .pairs import pair_contacts
from .placing import far_apart, place
from .search import may_collide

LIMIT_CLOSED = 1e-10  # gap of a reached limit relative to its range
CROWD = 64  # pairs that may touch: with more, slow impacts are taken where the step finds them
INSTANT_ROUNDS = 200  # limit on iterations of the search for one instant
SUNK = 0.25  # depth that counts as landed at any speed, in half thicknesses of the thinner shape
INSIDE = 2 * SUNK  # depth beyond which a landing is sought earlier: queries are no farther apart
# distance of a time from the end that counts as the end, relative to the sub-step
ARRIVED = 4 * ROUNDING
APART, TOUCHING = 0, 1  # kinds of meetings of two shapes, in `vertex`
CARRIED = -2  # `shape_b` after a soft arrival, no longer followed (-1 is the ground)


@part
def closed_limit(blocks, i):
    """Compute the gap below which limit i counts as closed [rad, m], from its range `at.SIZE`."""
    size, value = blocks.blocks_f[i, at.SIZE], blocks.blocks_f[i, at.VALUE]
    return max(LIMIT_CLOSED * size, COORDINATES * abs(value))


@part
def limit_gap(blocks, i, q):
    """Return the gap of limit i [rad, m]."""
    blocks_i, blocks_f, terms_i, terms_f, _, _, _ = blocks
    return total(blocks_i, terms_i, terms_f, i, 1, q) - blocks_f[i, at.VALUE]


@part
def limit_speeds(blocks, i, v, vdot):
    """Return the rate of limit i's gap, and its change without impulses."""
    blocks_i, _, terms_i, terms_f, _, _, _ = blocks
    rate = total(blocks_i, terms_i, terms_f, i, 0, v)
    return rate, total(blocks_i, terms_i, terms_f, i, 0, vdot)


@part
def is_crowd(contacts):
    """Check whether too many pairs may touch to locate slow impacts one by one.

    A contact between all bodies is always a crowd, because its members are only listed without
    pairs if there are many bodies.
    """
    may = contacts.candidates
    return may.members.shape[0] > 0 or may.on_ground.shape[0] + may.pairs.shape[0] > CROWD


@sweep
def look_ahead(scene, h):
    """Compute the closed gap, the search distance [m], and whether a shape is passed in one step.

    Called after `velocities` at the middle of the step and `place`.
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


@part
def approach(scene, i, j, left):
    """Bound the approach of two shapes within the time `left` [m], with j = -1 for the ground."""
    data = opened(scene)
    contacts = contacts_at(data.links.contacts)
    shapes, poses = contacts.geometry.shapes, contacts.poses
    speed = shape_speed(data.work, data.space.linear, shapes[i], poses[i])
    if j >= 0:
        speed += shape_speed(data.work, data.space.linear, shapes[j], poses[j])
    return left * (speed + 2.0 * contacts.tally[0].pull * left)


@part
def outruns(scene, i, j, left):
    """Check whether two shapes may move by their thickness in `left`. Use j = -1 for the ground."""
    shapes = contacts_at(opened(scene).links.contacts).geometry.shapes
    thick = thickness(shapes[i]) + (thickness(shapes[j]) if j >= 0 else 0.0)
    return approach(scene, i, j, left) > thick


@sweep
def point_meets(scene, n, h, left):
    """Check whether contact point n, at the middle of a sub-step, hits within it.

    The step is h wide, the sub-step `left`. Called after `velocities`.
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
    if is_crowd(contacts) and not outruns(scene, point.shape_a, point.shape_b, left):
        return False
    return point.gap - 0.5 * left * closing <= closed_gap(
        contacts, point.shape_a, point.shape_b, xyz(point.point_a)
    )


@part
def limit_arrival(blocks, i, back, h, left, q, v, vdot):
    """Compute the time until limit i is hit [s]: 0 if now, infinite if not within `left`.

    Along the path of `state_at`, the gap of a coordinate is a parabola. The parabola starts a time
    `back` before q, which was reached at the velocity v. A closed limit is hit immediately if its
    speed would violate the tolerance within a step of size h. If a limit was already located in
    this step, it is located again once its gap has halved, because impulses of other rows may
    change the path.
    """
    closed = closed_limit(blocks, i)
    rate, change = limit_speeds(blocks, i, v, vdot)
    gap = limit_gap(blocks, i, q) - back * rate
    rise = 0.5 * rate * rate / -change if rate > 0.0 and change < 0.0 else 0.0
    if gap + rise <= closed:
        return 0.0 if -rate * h > closed else math.inf
    way = gap - 0.5 * closed
    square = rate * rate - 2.0 * change * way
    falls = rate < 0.0 or change < 0.0
    if not (square >= 0.0 and falls and gap <= 0.5 * blocks.blocks_f[i, at.LOCATED]):
        return math.inf
    root = math.sqrt(square)
    time = 2.0 * way / (root - rate) if rate < 0.0 else (rate + root) / -change
    return time if time <= left else math.inf


@sweep
def first_limit(scene, h, left, q, v, vdot):
    """Return (time until a limit is hit, at most `left` [s], its block or -1)."""
    blocks = opened(scene).blocks
    tally = contacts_at(opened(scene).links.contacts).tally[0]
    found = -1
    for i in range(tally.first_limit, tally.first_limit + tally.limits):
        if type_of(blocks.blocks_i, i) == at.T_LIMIT:
            time = limit_arrival(blocks, i, 0.0, h, left, q, v, vdot)
            if time < left or time == 0.0:
                left, found = time, i
    return left, found


# -- the first meeting --------------------------------------------------------------------------


@sweep
def state_at(scene, tau, q, v, start, vdot, speed):
    """Compute q and the scene's shapes at a time τ after the state `start`."""
    data = opened(scene)
    for i in range(q.shape[0]):
        q[i] = start[i]
    for j in range(v.shape[0]):
        speed[j] = start[q.shape[0] + j] + 0.5 * tau * vdot[j]
    advance(data.rows, q, speed, tau)
    for j in range(v.shape[0]):
        speed[j] = start[q.shape[0] + j] + tau * vdot[j]
    place_shapes(scene, q, speed)


@sweep
def place_shapes(scene, q, v):
    """Compute body frames, body velocities and the scene's shapes at (q, v)."""
    data = opened(scene)
    contacts = contacts_at(data.links.contacts)
    frames(data.rows, data.const, data.work, q, v)
    positions(data.rows, data.work)
    velocities(data.rows, data.const, data.work, v, data.space.linear)
    place(contacts.geometry.shapes, data.work, contacts.poses)


@sweep
def hits_at_once(scene, h, q, v, vdot):
    """Check whether there is an impact at (q, v), such as at the end of a sub-step."""
    place_shapes(scene, q, v)
    _, limit = first_limit(scene, h, 0.0, q, v, vdot)
    return limit >= 0 or list_meetings(scene, h, 0.0) < 0


@sweep
def first_meeting(scene, h, left, q, v, start, vdot, speed):
    """Compute the time until the next landing [s], 0 if there is an impact now, or `left` if there
    is none.

    The time is also less than `left` if rotations make the path unknown beyond it. The
    scene's shapes are in the state `start`, to which q is restored afterwards.
    """
    blocks = opened(scene).blocks
    meetings = contacts_at(opened(scene).links.contacts).meetings
    left, limit = first_limit(scene, h, left, q, v, vdot)
    hit = left
    found = left
    count = list_meetings(scene, h, left) if left > 0.0 else -1
    if count < 0:
        found = 0.0
    elif count > 0:
        tau = 0.0
        before = 0.0
        for n in range(count):
            if meetings[n].shape_b >= 0 and meetings[n].vertex == TOUCHING:
                left = min(left, straight(scene, meetings[n].shape_a, meetings[n].shape_b))
        found = left
        for _ in range(INSTANT_ROUNDS):
            step = left - tau
            arrived = False
            beyond = False
            for n in range(count):
                if meetings[n].shape_b == CARRIED:
                    continue
                if meetings[n].shape_b < 0:
                    ahead, landed, inside = next_ground(scene, meetings[n], h, left - tau)
                else:
                    ahead, landed, inside = next_landing(scene, meetings[n], h, tau, left)
                step = min(step, ahead)
                arrived = arrived or landed
                beyond = beyond or inside
            if beyond and tau - before > COINCIDENT * left:
                tau = 0.5 * (before + tau)
            elif arrived or beyond:
                found = tau
                break
            elif tau == left:
                break
            else:
                before = tau
                tau += step
                if tau >= left * (1.0 - ARRIVED):
                    tau = left
            state_at(scene, tau, q, v, start, vdot, speed)
        else:
            found = before
    for i in range(q.shape[0]):
        q[i] = start[i]
    if limit >= 0 and found == hit:
        blocks.blocks_f[limit, at.LOCATED] = limit_gap(blocks, limit, q)
    return found


@part
def time_to_close(way, closing, curving):
    """Compute the time in which a gap shrinks by `way`, from its closing speed and its bound."""
    speed = max(closing, 0.0)
    root = speed + math.sqrt(speed * speed + 2.0 * curving * way)
    return 2.0 * way / root if root > 0.0 else math.inf


@part
def next_ground(scene, meeting, h, left):
    """Return `next_landing` for one feature of a shape above the ground.

    Slow impacts are handled at the midpoint of the step, for example of a standing foot that has
    drifted off, because its motion without impulses is not meaningful. Separating features are
    included, because the features on the rim of a cylinder swap positions while it tips over. Other
    points that cannot become fast in the remaining time are ignored.
    """
    data = opened(scene)
    contacts = contacts_at(data.links.contacts)
    i, normal = meeting.shape_a, normal_of(contacts.ground)
    gap, p = ground_point(contacts, i, meeting.vertex)
    u = point_velocity(data.work, data.space.linear, contacts.geometry.shapes[i].row, p)
    closing = -dot(u, normal)
    closed = closed_gap(contacts, i, -1, p)
    size, pull = smaller_size(contacts, i, -1), contacts.tally[0].pull
    if gap > closed:
        curving = curving_bound(scene, i, -1)
        fastest = max(closing, 0.0) + curving * left
        if contacts.geometry.shapes[i].kind != CYLINDER and not hits(fastest, h, size, pull):
            meeting.shape_b = CARRIED
            return math.inf, False, False
        return time_to_close(gap - 0.5 * closed, closing, curving), False, False
    if hits(closing, h, size, pull):
        return math.inf, True, gap < -closed
    if closing >= 0.0:
        meeting.shape_b = CARRIED
    return math.inf, False, False


@part
def ground_point(contacts, i, k):
    """Return (gap, position) for the k-th part of shape i that may touch the ground."""
    p, radius, _ = candidate(contacts.geometry, contacts.ground, contacts.poses, i, k)
    return above(contacts.ground, p) - radius, p


@sweep
def nearest(contacts, i, j, pair):
    """Return (gap, position, normal) at the closest points of two shapes."""
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
def straight(scene, i, j):
    """Compute the time in which paths of touching shapes curve little for their thickness [s]."""
    contacts = contacts_at(opened(scene).links.contacts)
    thin, curving = thinner(contacts, i, j), curving_bound(scene, i, j)
    return math.sqrt(PART * thin / curving) if thin * curving > 0.0 else math.inf


@sweep
def next_landing(scene, meeting, h, tau, left):
    """Compute (time without a landing, whether one occurs now, whether it is already inside).

    If the two shapes touched at the start, a time τ ago, the closing speed of new contact points is
    limited by rotation and gravity, and they land when they penetrate.
    """
    data = opened(scene)
    contacts = contacts_at(data.links.contacts)
    found, pull = contacts.found, contacts.tally[0].pull
    i, j = meeting.shape_a, meeting.shape_b
    size, thin = smaller_size(contacts, i, j), thinner(contacts, i, j)
    curving = curving_bound(scene, i, j)
    count = pair_contacts(
        contacts.geometry, contacts.poses, i, j, meeting.pair, math.inf, contacts.search.room,
        found, 0,
    )  # fmt: skip
    touches = meeting.vertex == TOUCHING
    ahead = math.inf
    landed = False
    inside = False
    rate = 0.0
    least = math.inf
    for k in range(min(count, found.shape[0])):
        gap, closing = found[k].gap, point_closing(data.work, data.space.linear, contacts, k)
        closed = closed_gap(contacts, i, j, xyz(found[k].point_a))
        least = min(least, gap)
        rate = max(rate, closing_bound(scene, i, j, xyz(found[k].normal), left - tau))
        if gap > closed:
            ahead = min(ahead, time_to_close(gap - 0.5 * closed, closing, curving))
        elif not touches or hits(closing - curving * tau, h, size, pull):
            landed = True
            inside = inside or gap < -closed
        elif gap < -SUNK * thin and hits(closing, h, size, pull):
            landed = True
            inside = inside or gap < -INSIDE * thin
    if rate > 0.0 and thin > 0.0:  # not yet a point of the contact
        ahead = min(ahead, (max(least, 0.0) + INSIDE * thin) / rate)
    return ahead, landed, inside


@part
def put_meeting(meetings, n, a, b, vertex, pair):
    """Write meeting n and return n + 1. Meetings beyond the buffer's capacity are only counted."""
    if n < meetings.shape[0]:
        meetings[n].shape_a = a
        meetings[n].shape_b = b
        meetings[n].vertex = vertex
        meetings[n].pair = pair
    return n + 1


@sweep
def list_meetings(scene, h, left):
    """List pairs that may touch within `left`. Returns their number, or -1 if two hit now."""
    contacts = contacts_at(opened(scene).links.contacts)
    tally, meetings = contacts.tally[0], contacts.meetings
    shapes, poses, may = contacts.geometry.shapes, contacts.poses, contacts.candidates
    crowd = is_crowd(contacts)
    n = 0
    for k in range(may.on_ground.shape[0]):
        i, pair = may.on_ground[k].shape, may.on_ground[k].pair
        moved = approach(scene, i, -1, left)
        altitude = dot(xyz(poses[i].position), normal_of(contacts.ground)) - shapes[i].reach
        if (
            contacts.laws[pair].law != RIGID
            or altitude > top(contacts.ground) + moved
            or (crowd and not outruns(scene, i, -1, left))
        ):
            continue
        before, closed = n, False
        for c in range(candidates(shapes, i)):
            gap, p = ground_point(contacts, i, c)
            if gap > closed_gap(contacts, i, -1, p):
                if gap <= moved:
                    n = put_meeting(meetings, n, i, -1, c, pair)
            elif hits_now(scene, i, -1, p, normal_of(contacts.ground), h):
                return -1
            else:
                closed = True
        if closed and n > before and shapes[i].kind == CYLINDER:  # parts change places: all of them
            n = before
            for c in range(candidates(shapes, i)):
                n = put_meeting(meetings, n, i, -1, c, pair)
    for k in range(may.pairs.shape[0]):
        if n >= 0:
            i, j, pair = may.pairs[k].shape_a, may.pairs[k].shape_b, may.pairs[k].pair
            n = list_pair(scene, i, j, pair, h, left, crowd, n)
    members = may.members
    for m in range(members.shape[0]):
        i = members[m].shape
        if crowd and not outruns(scene, i, -1, left):
            continue
        for k in range(members.shape[0]):
            j = members[k].shape
            twice = k > m and (not crowd or outruns(scene, j, -1, left))
            if n >= 0 and not twice and may_collide(may, shapes, m, k):
                n = list_pair(scene, min(i, j), max(i, j), members[m].pair, h, left, crowd, n)
    if n > meetings.shape[0]:
        tally.overflows += 1
        n = meetings.shape[0]
    return n


@sweep
def list_pair(scene, i, j, pair, h, left, crowd, n):
    """List two separate shapes if they may touch within `left`. Returns -1 if they hit now."""
    data = opened(scene)
    contacts = contacts_at(data.links.contacts)
    shapes, poses, meetings = contacts.geometry.shapes, contacts.poses, contacts.meetings
    if contacts.laws[pair].law != RIGID:
        return n
    moved = approach(scene, i, j, left)
    if far_apart(shapes, poses, i, j, moved):
        return n
    if crowd and not outruns(scene, i, j, left):
        return n
    gap, p, _ = nearest(contacts, i, j, pair)
    closed = closed_gap(contacts, i, j, p)
    if gap > closed:
        return put_meeting(meetings, n, i, j, APART, pair) if gap <= moved else n
    count = pair_contacts(
        contacts.geometry, poses, i, j, pair, closed, contacts.search.room, contacts.found, 0
    )
    for k in range(min(count, contacts.found.shape[0])):
        point = contacts.found[k]
        if hits_now(scene, i, j, middle(point), xyz(point.normal), h):
            return -1
    return (
        put_meeting(meetings, n, i, j, TOUCHING, pair) if may_land(scene, i, j, pair, left) else n
    )


@sweep
def may_land(scene, i, j, pair, left):
    """Check whether other points of two touching shapes may land within `left`."""
    data = opened(scene)
    contacts = contacts_at(data.links.contacts)
    found = contacts.found
    count = pair_contacts(
        contacts.geometry, contacts.poses, i, j, pair, math.inf, contacts.search.room, found, 0
    )
    may = False
    for k in range(min(count, found.shape[0])):
        moved = left * closing_bound(scene, i, j, xyz(found[k].normal), left)
        open_ = found[k].gap > closed_gap(contacts, i, j, xyz(found[k].point_a))
        may = may or moved > INSIDE * thinner(contacts, i, j) or (open_ and found[k].gap <= moved)
    return may


@part
def hits_now(scene, i, j, p, normal, h):
    """Check whether two shapes that touch at p collide at this point."""
    data = opened(scene)
    contacts = contacts_at(data.links.contacts)
    shapes, linear = contacts.geometry.shapes, data.space.linear
    u = point_velocity(data.work, linear, shapes[i].row, p)
    if j >= 0:
        u = sub(u, point_velocity(data.work, linear, shapes[j].row, p))
    return hits(-dot(u, normal), h, smaller_size(contacts, i, j), contacts.tally[0].pull)
