"""Bounds on the next step that prevent bodies from passing through each other.

Soft and penalty contacts push only where they are evaluated, so a step that leaps over an overlap
of two shapes never has a force. It ends where the shapes meet. The next step leads into them by a
small part of the depth of the impact. Later steps are bounded by a fraction of the size of the
thinner shape, and fixed steps by the stiffness. Points that may dip under the ground and rise again
within a step bound it by the rotation of their body.
"""

import math

from .. import layout as at
from ..arrays import opened_run
from ..compiler.elementary import power
from ..compiler.jit import kernel, part, sweep
from ..constraints.blocks import point_velocity, velocities
from ..motion import opened
from ..records import CHOSEN, DEEP, PENALTY, POINTS, RIGID, SWING
from ..rows import spin_of
from ..stepping.control.guard import bound_width
from ..stepping.run import BOUND
from ..stepping.state import size_of_state
from ..tree.kinematics import outboard, positions
from ..vec import dot, sub, xyz
from .closing import PART, closing_bound, log_depth, shape_speed, thickness
from .contacts import contacts_at
from .ground import candidates, normal_of, top
from .meeting import ground_point, nearest
from .phases import opened_events
from .placing import far_apart, place
from .search import may_collide

TURN_IN_AIR = 0.5  # rad: how far a body may turn in a step with points in the air
WITHIN = 0.05  # given steps inside a hard contact, relative to its own time
LEAD = 0.01  # first given step into an impact, relative to its depth
PRESSED = 10.0  # force of a contact that is not at rest, relative to the weight


@kernel(BOUND, nogil=True, later=True)
def bound_step(run, row):
    """Store the maximum step size from the positions in Y, at the velocities in `row`, in
    `bound`."""
    data = opened_run(run)
    control, stages = data.control[0], data.stages
    clock, error, guard = control.clock, control.error, control.guard
    nq, nv = size_of_state(run)
    q, v = stages[at.Y, :nq], stages[row, nq : nq + nv]
    scene = opened(data.scene)
    outboard(scene.rows, scene.const, scene.work, q, v)
    positions(scene.rows, scene.work)
    velocities(scene.rows, scene.const, scene.work, v, scene.space.linear)
    bound = math.inf
    if data.watched.shape[1] > data.signs.shape[0]:
        bound = turn_bound(opened_events(data.scene), scene.work)
    if scene.links.contacts != 0:
        width = error.widest if error.widest > 0.0 else clock.span
        given = error.widths != CHOSEN
        if not given and clock.width > 0.0:
            width = min(width, clock.width)
        steps = (width, given, 0.0 if given else error.rtol, clock.time)
        bound = min(bound, contact_bound(data.scene, steps))
    bound_width(guard, bound)


@sweep
def turn_bound(phased, work):
    """Compute the time in which bodies with airborne points turn by at most TURN_IN_AIR [s]."""
    points, blocks = phased.contact.points, phased.scene.blocks
    fastest = 0.0
    for s in range(points.shape[0]):
        if points[s].phase == SWING and points[s].turns == 1:
            turn = spin_of(work, blocks.blocks_i[points[s].slide_block, at.B_A])
            fastest = max(fastest, math.sqrt(dot(turn, turn)))
    return TURN_IN_AIR / fastest if fastest > 0.0 else math.inf


@sweep
def contact_bound(scene, steps):
    """Compute the time in which no soft or penalty contact can be skipped [s].

    `steps`: their width [s], whether they are given, their tolerance if not, and the time [s].
    Fixed steps do not adapt to forces, so they are also bounded during contact.
    """
    width = steps[0]
    data = opened(scene)
    contacts = contacts_at(data.links.contacts)
    shapes, poses, may = contacts.geometry.shapes, contacts.poses, contacts.candidates
    place(shapes, data.work, poses)
    bound = math.inf
    fastest = 0.0
    for i in range(shapes.shape[0]):
        fastest = max(fastest, shape_speed(data.work, data.space.linear, shapes[i], poses[i]))
    for k in range(may.on_ground.shape[0]):
        i, pair = may.on_ground[k].shape, may.on_ground[k].pair
        altitude = dot(xyz(poses[i].position), normal_of(contacts.ground)) - shapes[i].reach
        if contacts.laws[pair].law != RIGID and altitude <= top(contacts.ground) + fastest * width:
            bound = min(bound, ground_bound(scene, i, pair, steps))
    for k in range(may.pairs.shape[0]):
        i, j = may.pairs[k].shape_a, may.pairs[k].shape_b
        bound = min(bound, pair_bound(scene, i, j, may.pairs[k].pair, steps))
    members = may.members
    for m in range(members.shape[0]):
        i = members[m].shape
        if contacts.laws[members[m].pair].law == RIGID or fastest * width <= PART * thickness(
            shapes[i]
        ):
            continue
        for k in range(members.shape[0]):
            j = members[k].shape
            if may_collide(may, shapes, m, k):
                one = pair_bound(scene, min(i, j), max(i, j), members[m].pair, steps)
                bound = min(bound, one)
    return bound


@sweep
def ground_bound(scene, i, pair, steps):
    """Return `contact_bound` for one shape over the ground."""
    data = opened(scene)
    contacts = contacts_at(data.links.contacts)
    shapes = contacts.geometry.shapes
    normal = normal_of(contacts.ground)
    size = shapes[i].reach if shapes[i].reach > 0.0 else contacts.tally[0].length
    thick, bound = 2.0 * thickness(shapes[i]), math.inf
    for c in range(candidates(shapes, i)):
        gap, p = ground_point(contacts, i, c)
        rate = closing_bound(scene, i, -1, normal, 0.0)
        u = point_velocity(data.work, data.space.linear, shapes[i].row, p)
        rates = (rate, -dot(u, normal))
        log_depth(contacts.tally[0], -gap, DEEP * (thick if thick > 0.0 else size), pair, steps[3])
        bound = min(bound, one_bound(contacts, pair, gap, rates, size, steps))
    return bound


@sweep
def pair_bound(scene, i, j, pair, steps):
    """Return `contact_bound` for two shapes."""
    data = opened(scene)
    contacts = contacts_at(data.links.contacts)
    shapes, poses = contacts.geometry.shapes, contacts.poses
    if contacts.laws[pair].law == RIGID:
        return math.inf
    moved = steps[0] * shape_speed(data.work, data.space.linear, shapes[i], poses[i])
    moved += steps[0] * shape_speed(data.work, data.space.linear, shapes[j], poses[j])
    thin = thickness(shapes[j])
    if shapes[i].kind != POINTS:
        thin = min(thin, thickness(shapes[i]))
    if far_apart(shapes, poses, i, j, moved):
        return math.inf
    gap, p, normal = nearest(contacts, i, j, pair)
    log_depth(contacts.tally[0], -gap, DEEP * 2.0 * thin, pair, steps[3])
    u = point_velocity(data.work, data.space.linear, shapes[i].row, p)
    u = sub(u, point_velocity(data.work, data.space.linear, shapes[j].row, p))
    rates = (closing_bound(scene, i, j, normal, 0.0), -dot(u, normal))
    return one_bound(contacts, pair, gap, rates, thin, steps)


@part
def one_bound(contacts, pair, gap, rates, thin, steps):
    """Compute the time until a gap leads a part of `thin` into a shape, or a step into an impact
    [s].

    `rates`: how fast the gap closes at most, and at the nearest point [m/s].
    """
    law = contacts.laws[pair]
    rate, closing = rates
    width, given, rtol, _ = steps
    bound = math.inf
    ahead = max(gap, 0.0)
    if rate * width > PART * thin:
        bound = (ahead + PART * thin) / rate
    speed = rate if given or gap > 0.0 else closing
    if given and gap <= 0.0:
        speed = max(rate, -closing)  # shapes leave as fast as they come
    if speed > 0.0:
        lead = contacts.tally[0].fine * lead_of(law, speed, rtol)
        if speed * width > lead and (given or gap > -lead):
            # Stages far inside may fling each other out, and DOP853 does not weigh all of them: the
            # step would see no force. And a jump of the force would count for the whole step.
            bound = min(bound, ahead / speed if ahead > lead else (ahead + lead) / speed)
    elif not given and gap < 0.0 and closing < 0.0:
        pushed = leaving_speed(law, -gap)
        away = math.sqrt(closing * closing + pushed * pushed)  # at most, when it leaves
        leaves = away * away > -2.0 * contacts.tally[0].pull * gap
        if leaves and -gap > rtol * impact_depth(law, away):
            bound = min(bound, -gap / away)
    if given and gap < 0.0:
        depth = -gap
        push = law.stiffness * depth
        slope = law.stiffness
        loss = law.damping + law.loss * math.sqrt(law.stiffness * law.mass)
        if law.law != PENALTY:
            push *= math.sqrt(depth)
            slope *= 1.5 * math.sqrt(depth)
            loss = law.damping * push
            if law.loss > 0.0:
                loss = law.loss * math.sqrt(1.25 * law.mass * push / depth)
        if push > PRESSED * law.mass * contacts.tally[0].pull or speed * width > PART * depth:
            own = math.sqrt(slope / law.mass) + loss / law.mass
            bound = min(bound, WITHIN * contacts.tally[0].fine / own)
    return bound


@part
def lead_of(law, speed, rtol):
    """Compute the motion of a step across a contact boundary [m] whose error is below `rtol`.

    The energy of a depth d is a share (d / D)^2.5 of the impact's, D its depth; (d / D)^2 for a
    penalty. Given steps have no tolerance.
    """
    share = LEAD
    if rtol > 0.0:
        share = min(LEAD, math.sqrt(rtol) if law.law == PENALTY else power(rtol, 0.4))
    return share * impact_depth(law, speed)


@part
def leaving_speed(law, depth):
    """Compute the speed at which a contact point at rest at some depth parts, lossless [m/s]."""
    slope = law.stiffness if law.law == PENALTY else 0.8 * law.stiffness * math.sqrt(depth)
    return depth * math.sqrt(slope / law.mass)


@part
def impact_depth(law, speed):
    """Compute the depth of a lossless impact at this speed [m]."""
    energy = law.mass * speed * speed
    if law.law == PENALTY:
        return math.sqrt(energy / law.stiffness)
    return power(1.25 * energy / law.stiffness, 0.4)
