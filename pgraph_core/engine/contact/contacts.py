"""Contacts in a scene: contact points as blocks of rows, soft and penalty forces, records."""

import math

from ...tolerances import SOLVED
from .. import layout as at
from ..arrays import CONTACTS, CONTACTS_OF_DUALS, opened
from ..compiler.address import stored
from ..compiler.jit import kernel, part, sweep
from ..compiler.kinds import F1, I1, i8, plain, void
from ..constraints.blocks import velocities
from ..motion import CONTACT_FORCES, CONTACT_RECORD, SETTLE
from ..pushes import apply
from ..records import (
    ACCEPTANCE,
    ADDING,
    FROZEN,
    PENALTY,
    RIGID,
    SLIP,
    SOFT,
    STANCE,
    SWING,
)
from ..rows import kept_of, offset_of, origin_of, rotation_of
from ..signals import follow_frictions
from ..tree.kinematics import outboard, positions
from ..vec import (
    add,
    add_cross,
    add_scaled,
    add_xyz,
    cross,
    dot,
    matrix,
    mul,
    mul_t,
    scale,
    set_xyz,
    store,
    sub,
    xyz,
)
from .manifold import tangents
from .placing import place
from .restitution import elastic_force, factor_tree, loss_of_touch, lost_share
from .search import find_contacts
from .touches import (
    FIND,
    HOLDING,
    endpoints,
    has_touched,
    keep_point,
    keep_touches,
    kept_place,
    middle,
    nearness,
    relative_velocity,
    touching,
)

_save, contacts_at = stored(CONTACTS, CONTACTS_OF_DUALS)

SLIDING = 1e-7  # [m/s] below this slip speed a contact counts as sticking (solver noise)
STILL = 1e-5  # m/s: slip of a rigid contact that is the solver's rounding
CREEPING = 2  # slip that a regularised contact needs to hold, relative to its creep


@kernel(void(I1, plain(CONTACTS)))
def save_contacts(buffer, contacts):
    """Store the contacts of a scene for `contacts_at`."""
    _save(buffer, contacts)


TOUCHES = void(i8, F1, F1)


@kernel(FIND, nogil=True)
def find(scene, margin, placed):
    """Run `contact_points`, called by address."""
    return contact_points(scene, margin, placed)


@sweep
def contact_points(scene, margin, placed):
    """Find contact points within `margin`, after `positions`. Returns their number, at most the
    capacity.

    If `placed` is 1, `place` has computed the poses of the shapes.
    """
    data = opened(scene)
    contacts = contacts_at(data.links.contacts)
    geometry, poses, found = contacts.geometry, contacts.poses, contacts.found
    if placed == 0:
        place(geometry.shapes, data.work, poses)
    n = find_contacts(
        geometry, contacts.ground, contacts.candidates, poses, contacts.search, margin, found
    )
    tally = contacts.tally[0]
    if n > found.shape[0]:
        tally.overflows += 1
        n = found.shape[0]
    tally.found = n
    return n


@part
def surface_motion(contacts, i):
    """Return (velocity at the frame's origin, spin) of shape i's surface past its body, or zero."""
    still = (0.0, 0.0, 0.0)
    if i < 0 or contacts.geometry.shapes[i].moves == 0:
        return still, still
    r, shape = matrix(contacts.poses[i].rotation), contacts.geometry.shapes[i]
    return mul(r, xyz(shape.surface_velocity)), mul(r, xyz(shape.surface_spin))


@part
def surface_velocity(contacts, i, p):
    """Return the velocity of shape i's surface past its body at p, which is zero for the ground."""
    u, spin = surface_motion(contacts, i)
    return add_cross(u, spin, sub(p, xyz(contacts.poses[max(i, 0)].position)))


@part
def surface_slip(contacts, n, p):
    """Return the relative surface velocity of A and B at contact point n."""
    point = contacts.found[n]
    normal = xyz(point.normal)
    mine = surface_velocity(contacts, point.shape_a, p)
    u = sub(mine, surface_velocity(contacts, point.shape_b, p))
    return add_scaled(u, -dot(u, normal), normal)


@part
def set_block(contacts, blocks, n, i, slides):
    """Write contact point n as block i, with static friction unless it slides."""
    blocks_i, blocks_f = blocks.blocks_i, blocks.blocks_f
    point = contacts.found[n]
    a, b, _, _, pair = endpoints(contacts, n)
    normal = xyz(point.normal)
    t, s = tangents(normal)
    blocks_i[i, at.B_TYPE] = at.T_CONTACT
    blocks_i[i, at.B_A] = a
    blocks_i[i, at.B_B] = b
    blocks_i[i, at.B_SIZE] = 3
    store(blocks_f, i, at.PA, middle(point))
    store(blocks_f, i, at.DIR, normal)
    store(blocks_f, i, at.DIR + 3, t)
    store(blocks_f, i, at.DIR + 6, s)
    law = contacts.laws[pair]
    blocks_f[i, at.FRICTION] = law.friction if slides else law.static_friction
    blocks_f[i, at.BOUNCE] = law.restitution
    slip = surface_slip(contacts, n, middle(point))
    store(blocks_f, i, at.SURFACE, (0.0, dot(t, slip), dot(s, slip)))
    shape = contacts.geometry.shapes[point.shape_a]
    if point.shape_b < 0 and shape.vertices > 0:  # a ball about a vertex, on a plane
        blocks_f[i, at.ROUND] = shape.radius
    else:
        blocks_f[i, at.ROUND] = -1.0


@part
def set_turn(contacts, blocks, n, i):
    """Write the torsional friction at contact point n as block i."""
    set_block(contacts, blocks, n, i, True)
    blocks.blocks_i[i, at.B_TYPE] = at.T_TURN
    blocks.blocks_f[i, at.BOUNCE] = 0.0
    point = contacts.found[n]
    _, mine = surface_motion(contacts, point.shape_a)
    _, other = surface_motion(contacts, point.shape_b)
    turn = dot(sub(mine, other), xyz(point.normal))
    store(blocks.blocks_f, i, at.SURFACE, (turn, 0.0, 0.0))


@part
def resists_turning(law):
    """Check whether a contact has rolling or spinning friction."""
    return law.rolling > 0.0 or law.spinning > 0.0


@part
def slides_now(contacts, work, linear, n):
    """Check whether contact point n slid in the last step, or if it is new and slides now."""
    point = contacts.found[n]
    k = kept_place(point, contacts.kept, contacts.tally[0].kept, n)
    if k >= 0:
        return contacts.kept[k].slides == 1
    u = relative_velocity(contacts, work, linear, n)
    across = add_scaled(u, -dot(u, xyz(point.normal)), xyz(point.normal))
    across = add(across, surface_slip(contacts, n, middle(point)))
    return dot(across, across) > SLIDING * SLIDING


@sweep
def remember_impulses(contacts):
    """Keep the impulses with which the next step starts."""
    tally = contacts.tally[0]
    tally.started = tally.kept
    for k in range(tally.kept):
        contacts.before[k] = contacts.kept[k]


@sweep
def recall_impulses(contacts):
    """Restore the impulses with which the last step started."""
    tally = contacts.tally[0]
    tally.kept = tally.started
    for k in range(tally.started):
        contacts.kept[k] = contacts.before[k]


@sweep
def clear(address):
    """Reset all contact forces at the start of a step or a record."""
    contacts = contacts_at(address)
    limit_tau = contacts.limit_tau
    none = (0.0, 0.0, 0.0)
    for j in range(limit_tau.shape[0]):
        limit_tau[j] = 0.0
    for b in range(contacts.wrenches.shape[0]):
        set_xyz(contacts.wrenches[b].torque, none)
        set_xyz(contacts.wrenches[b].force, none)
    for k in range(contacts.pairs.shape[0]):
        pair = contacts.pairs[k]
        set_xyz(pair.force, none)
        set_xyz(pair.torque, none)
        pair.slip = 0.0
        pair.gap = math.inf
        pair.struck = math.inf


@part
def add_wrench(wrenches, work, body, row, p, force):
    """Add a force at p to the wrench on a body that a row carries, unless it is the ground."""
    if body > 0:
        add_xyz(wrenches[body].torque, cross(sub(p, origin_of(work, row)), force))
        add_xyz(wrenches[body].force, force)


@sweep
def note(address, work, n, force, slip):
    """Add a force on A at contact point n to the wrenches on its bodies and to its contact pair."""
    contacts = contacts_at(address)
    point, wrenches = contacts.found[n], contacts.wrenches
    a, b, body_a, body_b, k = endpoints(contacts, n)
    p = middle(point)
    add_wrench(wrenches, work, body_a, a, p, force)
    add_wrench(wrenches, work, body_b, b, p, scale(-1.0, force))
    offset = mul(rotation_of(work, a), offset_of(contacts.bodies_f, body_a))
    pair = contacts.pairs[k]
    add_xyz(pair.force, force)
    add_xyz(pair.torque, cross(sub(sub(p, origin_of(work, a)), offset), force))
    pair.gap = min(pair.gap, point.gap)
    pair.slip = max(pair.slip, slip)


@sweep
def note_turn(address, n, torque):
    """Add a torque on A at contact point n to its bodies and to its contact pair."""
    contacts = contacts_at(address)
    _, _, body_a, body_b, k = endpoints(contacts, n)
    add_xyz(contacts.wrenches[body_a].torque, torque)
    if body_b > 0:
        add_xyz(contacts.wrenches[body_b].torque, scale(-1.0, torque))
    add_xyz(contacts.pairs[k].torque, torque)


@kernel(CONTACT_FORCES, nogil=True)
def contact_forces(scene, v, tau, flow):
    """Run `push_contacts`, called by address."""
    return push_contacts(scene, v, tau, flow)


@sweep
def push_contacts(scene, v, tau, flow):
    """Add contact forces to the rows and τ, after `outboard`, the power of moving surfaces to
    flow[0], and the dissipated power to flow[1].

    Soft and penalty contacts push by their depth. If `frozen`, rigid contacts push with the forces
    of the last time step.
    """
    data = opened(scene)
    rows, const, work, space = data.rows, data.const, data.work, data.space
    contacts = contacts_at(data.links.contacts)
    laws, wrenches = contacts.laws, contacts.wrenches
    bodies_i, limit_tau = contacts.bodies_i, contacts.limit_tau
    follow_frictions(data.loads.signals, laws)
    if contacts.tally[0].frozen == FROZEN:
        positions(rows, work)
        for j in range(limit_tau.shape[0]):
            tau[j] += limit_tau[j]
        for b in range(1, wrenches.shape[0]):
            k = bodies_i[b, at.ROW]
            torque, force = xyz(wrenches[b].torque), xyz(wrenches[b].force)
            apply(work, k, origin_of(work, k), torque, force)
        return 0
    soft = False
    for k in range(laws.shape[0]):
        soft = soft or laws[k].law != RIGID
    if not soft:
        return 0
    positions(rows, work)
    velocities(rows, const, work, v, space.linear)
    share = contacts.tally[0].share
    if contacts.tally[0].frozen != ADDING:
        clear(opened(scene).links.contacts)
        share = 1.0
    count = touching(scene, nearness(contacts), 0)
    end, loss = 0, 0.0
    factored = share < 0.0 or kept_of(work, 0) == 1.0  # the same frames have had their factors
    for n in range(count):
        a, b, _, _, pair = endpoints(contacts, n)
        if laws[pair].law != RIGID:
            if n >= end and laws[pair].loss > 0.0:
                if not factored:
                    factor_tree(contacts, rows, const, work, tau)
                    factored = True
                loss, end = loss_of_touch(contacts, rows, n, count)
            p = middle(contacts.found[n])
            past = surface_slip(contacts, n, p)
            u = add(relative_velocity(contacts, work, space.linear, n), past)
            force, slip = compliant_force(contacts, n, laws[pair], u, loss)
            apply(work, a, p, (0.0, 0.0, 0.0), force)
            apply(work, b, p, (0.0, 0.0, 0.0), scale(-1.0, force))
            note(opened(scene).links.contacts, work, n, scale(share, force), slip)
            flow[0] -= dot(force, past)
            flow[1] -= dot(force, u)
    return 0


@part
def compliant_force(contacts, n, law, u, loss):
    """Compute (force on A, slip speed) for a soft or penalty contact.

    u is the velocity of A's surface relative to that of B. `loss` is the result of `loss_of_touch`,
    for contacts without a given damping.
    """
    point = contacts.found[n]
    normal = xyz(point.normal)
    depth = max(-point.gap, 0.0)
    speed = -dot(u, normal)
    slide = add_scaled(u, speed, normal)
    slide = add_scaled(slide, -dot(slide, normal), normal)  # once more: what rounding has left
    slip_squared = dot(slide, slide)  # unlike the slip, it has derivatives where it is zero
    slip = math.sqrt(slip_squared)
    c = loss if law.law == PENALTY and law.loss > 0.0 else law.damping
    mu = law.friction
    if law.law == SOFT:
        more = lost_share(law, speed, loss) if law.loss > 0.0 else c * speed
        size = max(elastic_force(law, depth) * (1.0 + more), 0.0)
        creep = max(law.creep, SOLVED * abs(speed))
        drag = mu * size / math.sqrt(slip_squared + creep * creep)
        return add_scaled(scale(size, normal), -drag, slide), slip
    acts = depth > 0.0
    if contacts.tally[0].frozen == HOLDING:
        acts = has_touched(contacts, n)
    size = max(elastic_force(law, depth) + c * speed, 0.0) if acts else 0.0
    stretch = (0.0, 0.0, 0.0)
    at_k = kept_place(point, contacts.anchors, contacts.tally[0].anchored, n)
    if at_k >= 0:
        stretch = stretched(contacts, point, contacts.anchors[at_k])
    pull = add_scaled(scale(-law.stiffness, stretch), -c, slide)
    total = math.sqrt(dot(pull, pull))
    if total > mu * size:
        pull = scale(mu * size / total, pull)
    return add_scaled(pull, size, normal), slip


@part
def stretched(contacts, point, anchor):
    """Return the tangential displacement between the sticking points of A and B."""
    normal = xyz(point.normal)
    on_a = carried_by(contacts, point.shape_a, xyz(anchor.value))
    apart = sub(on_a, carried_by(contacts, point.shape_b, xyz(anchor.turn)))
    return add_scaled(apart, -dot(apart, normal), normal)


@part
def carried_by(contacts, shape, x):
    """Return the world position of a point on a shape or on the ground."""
    if shape < 0:
        return x
    pose = contacts.poses[shape]
    return add(xyz(pose.position), mul(matrix(pose.rotation), x))


@part
def fixed_to(contacts, shape, x):
    """Transform a point from world axes to a shape's axes."""
    if shape < 0:
        return x
    pose = contacts.poses[shape]
    return mul_t(matrix(pose.rotation), sub(x, xyz(pose.position)))


@kernel(SETTLE, nogil=True)
def settle_contacts(scene, t, q, v):
    """Update the contact history and the contact phases after a step that ends at t."""
    address = opened(scene).links.contacts
    laws = contacts_at(address).laws
    sticks = False
    for k in range(laws.shape[0]):
        sticks = sticks or laws[k].law == PENALTY
    if sticks:
        keep_anchors(scene, q, v)
    elif contacts_at(address).tally[0].frozen == HOLDING:
        keep_touches(contacts_at(address))
    log_phases(address, t)
    return 0


@sweep
def log_phases(address, t):
    """Log the pairs and limits whose phase has changed, based on forces and slips in the step."""
    contacts = contacts_at(address)
    laws, changes, tally = contacts.laws, contacts.changes, contacts.tally[0]
    for k in range(contacts.pairs.shape[0]):
        pair = contacts.pairs[k]
        force = xyz(pair.force)
        rigid = k >= laws.shape[0] or laws[k].law == RIGID  # limits come last
        still = STILL if rigid else CREEPING * laws[k].creep
        before = pair.phase
        if not dot(force, force) > 0.0:
            now = SWING
        elif pair.slip <= still:
            now = STANCE
        else:
            now = ACCEPTANCE if before in (SWING, ACCEPTANCE) else SLIP
        if now != before:
            when = t
            if rigid and before >= 0:
                when = pair.ended if now == SWING else t
                when = min(pair.struck, t) if before == SWING else when
            pair.phase = now
            n = tally.logged
            if n < changes.shape[0]:
                changes[n].time = t
                changes[n].when = when
                changes[n].pair = k
                changes[n].phase = now
            tally.logged = n + 1


@kernel(TOUCHES, nogil=True, later=True)
def begin_touches(scene, q, v):
    """Keep the contact points of a state in which a run begins, with anchors of a run before."""
    keep_anchors(scene, q, v)


@sweep
def keep_anchors(scene, q, v):
    """Update the anchors for penalty friction.

    An anchor slides if its force exceeds the friction.
    """
    data = opened(scene)
    rows, const, work, space = data.rows, data.const, data.work, data.space
    contacts = contacts_at(data.links.contacts)
    outboard(rows, const, work, q, v)
    positions(rows, work)
    velocities(rows, const, work, v, space.linear)
    laws, anchors, found = contacts.laws, contacts.anchors, contacts.found
    tally = contacts.tally[0]
    count = touching(scene, nearness(contacts), 0)
    for n in range(count):  # the new points of A and B wait in `held` and `point_b`
        point = found[n]
        law = laws[point.pair]
        p = middle(point)
        anchor = p
        at_k = kept_place(point, anchors, tally.anchored, n)
        if at_k >= 0 and law.law == PENALTY:
            stretch = stretched(contacts, point, anchors[at_k])
            u = relative_velocity(contacts, work, space.linear, n)
            force, _ = compliant_force(contacts, n, law, u, 0.0)
            most = law.friction * max(dot(force, xyz(point.normal)), 0.0) / law.stiffness
            size = math.sqrt(dot(stretch, stretch))
            if size > most:
                stretch = scale(most / size, stretch)
            anchor = sub(p, stretch)
        set_xyz(point.held, fixed_to(contacts, point.shape_a, p))
        set_xyz(point.point_b, fixed_to(contacts, point.shape_b, anchor))
    for n in range(count):
        keep_point(anchors[n], found[n], xyz(found[n].held))
        set_xyz(anchors[n].turn, xyz(found[n].point_b))
    tally.anchored = count


@kernel(CONTACT_RECORD, nogil=True)
def record_contacts(scene, wrenches, pairs, missed):
    """Record contact wrenches on bodies (nb, 6) at their origins, and the contact pairs.

    Also record the residuals since the last record: complementarity, cone, penetration.
    """
    data = opened(scene)
    work = data.work
    contacts = contacts_at(data.links.contacts)
    bodies_i, bodies_f = contacts.bodies_i, contacts.bodies_f
    tally = contacts.tally[0]
    for b in range(1, contacts.wrenches.shape[0]):
        k = bodies_i[b, at.ROW]
        offset = mul(rotation_of(work, k), offset_of(bodies_f, b))
        wrench = contacts.wrenches[b]
        force = xyz(wrench.force)
        store(wrenches, b - 1, 0, sub(xyz(wrench.torque), cross(offset, force)))
        store(wrenches, b - 1, 3, force)
    for k in range(pairs.shape[0]):
        if tally.frozen != FROZEN:
            set_xyz(contacts.pairs[k].mean_force, xyz(contacts.pairs[k].force))
            set_xyz(contacts.pairs[k].mean_torque, xyz(contacts.pairs[k].torque))
        pairs[k] = contacts.pairs[k]
        tally.penetration = max(tally.penetration, -pairs[k].gap)
    missed[0] = tally.complementarity
    missed[1] = tally.cone
    missed[2] = tally.penetration
    tally.complementarity = 0.0
    tally.cone = 0.0
    tally.penetration = 0.0
    return 0
