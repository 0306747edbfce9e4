"""Contacts of a scene: found points as blocks of rows, soft and penalty forces, records."""

import math

from numba import types

from .. import layout as at
from ..arrays import CONTACTS, I1, opened
from ..compiler.address import caller, plain, stored
from ..compiler.jit import kernel, part, sweep
from ..constraints.blocks import point_velocity, velocities
from ..forces import apply
from ..motion import CONTACT_FORCES, CONTACT_RECORD
from ..stepping.run import SETTLE
from ..tree.kinematics import outboard, positions
from ..vec import (
    accumulate,
    add,
    add_scaled,
    cross,
    dot,
    load,
    load9,
    mul,
    scale,
    store,
    sub,
)
from .collision import find_contacts
from .shapes import place

_save, contacts_at = stored(CONTACTS)

STILL = 1e-5  # m/s: slip of a rigid contact that is the solver's rounding
CREEPING = 2.0 * at.CREEP  # m/s: slip that a regularised contact needs to hold


@kernel(types.void(I1, plain(CONTACTS)))
def save_contacts(buffer, contacts):
    """Keep a scene's contacts where `contacts_at` finds them."""
    _save(buffer, contacts)


FIND = types.int64(types.int64, types.float64)
_call_find = caller(FIND)


@kernel(FIND, nogil=True)
def find(scene, margin):
    """Contact points within `margin`, after `positions`; how many, no more than there is room."""
    data = opened(scene)
    contacts = contacts_at(data.links.contacts)
    geometry, poses, found = contacts.geometry, contacts.poses, contacts.found
    place(geometry.shapes_i, geometry.shapes_f, data.work, poses)
    n = find_contacts(
        geometry, contacts.ground, contacts.candidates, poses, contacts.search, margin, found
    )
    if n > found.points.shape[0]:
        contacts.tally[at.N_MISSED] += 1
        n = found.points.shape[0]
    contacts.tally[at.N_FOUND] = n
    return n


@part
def touching(scene, margin):
    """`find`, called by address: shapes are compiled once."""
    return _call_find(opened(scene).links.find, (scene, margin))


@part
def ends(contacts, n):
    """(row of A, row of B, body A, body B, law) of contact point n; 0 is the ground."""
    found_i = contacts.found.labels
    shapes_i = contacts.geometry.shapes_i
    a = found_i[n, at.CT_SHAPE_A]
    b = found_i[n, at.CT_SHAPE_B]
    row_b = shapes_i[b, at.SH_ROW] if b >= 0 else 0
    body_b = shapes_i[b, at.SH_BODY] if b >= 0 else 0
    return shapes_i[a, at.SH_ROW], row_b, shapes_i[a, at.SH_BODY], body_b, found_i[n, at.CT_CONTACT]


@part
def middle(found_f, n):
    """Where contact point n acts: half way between the two surfaces."""
    return scale(0.5, add(load(found_f, n, at.CT_A), load(found_f, n, at.CT_B)))


@part
def tangents(n):
    """Two unit vectors that make a right-handed frame with the unit vector n."""
    t = (0.0, n[2], -n[1]) if abs(n[0]) < 0.6 else (-n[2], 0.0, n[0])
    t = scale(1.0 / math.sqrt(dot(t, t)), t)
    return t, cross(n, t)


@part
def set_block(contacts, blocks, n, i):
    """Contact point n as block i."""
    blocks_i, blocks_f = blocks.blocks_i, blocks.blocks_f
    found_f = contacts.found.points
    a, b, _, _, law = ends(contacts, n)
    normal = load(found_f, n, at.CT_NORMAL)
    t, s = tangents(normal)
    blocks_i[i, at.B_TYPE] = at.T_CONTACT
    blocks_i[i, at.B_A] = a
    blocks_i[i, at.B_B] = b
    blocks_i[i, at.B_SIZE] = 3
    store(blocks_f, i, at.PA, middle(found_f, n))
    store(blocks_f, i, at.DIR, normal)
    store(blocks_f, i, at.DIR + 3, t)
    store(blocks_f, i, at.DIR + 6, s)
    blocks_f[i, at.FRICTION] = contacts.laws[law, at.LW_FRICTION]
    blocks_f[i, at.BOUNCE] = contacts.laws[law, at.LW_BOUNCE]


@part
def kept_place(contacts, n, start):
    """Where the last step's entry of contact point n is, looked for from `start` on; -1: nowhere.

    Points come in the same order step after step, so that the search is short.
    """
    found_i, kept_i, tally = contacts.found.labels, contacts.kept_i, contacts.tally
    count = tally[at.N_KEPT]
    for m in range(min(count, 64)):
        k = start + m
        if k >= count:
            k -= count
        if (
            kept_i[k, 0] == found_i[n, at.CT_SHAPE_A]
            and kept_i[k, 1] == found_i[n, at.CT_SHAPE_B]
            and kept_i[k, 2] == found_i[n, at.CT_FEATURE]
        ):
            return k
    return -1


@sweep
def clear(address):
    """No contact pushes: at the start of a step, or of a record."""
    contacts = contacts_at(address)
    pushes, touches, limit_tau = contacts.pushes, contacts.touches, contacts.limit_tau
    for j in range(limit_tau.shape[0]):
        limit_tau[j] = 0.0
    for b in range(pushes.shape[0]):
        store(pushes, b, 0, (0.0, 0.0, 0.0))
        store(pushes, b, 3, (0.0, 0.0, 0.0))
    for k in range(touches.shape[0]):
        for n in range(at.TOUCH):
            touches[k, n] = 0.0
        touches[k, at.TO_GAP] = math.inf


@sweep
def note(address, work, n, force, slip):
    """Book a force on A at contact point n: on its bodies, and in its touch."""
    contacts = contacts_at(address)
    found_f, pushes, touches = contacts.found.points, contacts.pushes, contacts.touches
    bodies_f = contacts.bodies_f
    a, b, body_a, body_b, law = ends(contacts, n)
    p = middle(found_f, n)
    arm = sub(p, load(work, a, at.X))
    accumulate(pushes, body_a, 0, cross(arm, force))
    accumulate(pushes, body_a, 3, force)
    if body_b > 0:
        accumulate(pushes, body_b, 0, scale(-1.0, cross(sub(p, load(work, b, at.X)), force)))
        accumulate(pushes, body_b, 3, scale(-1.0, force))
    offset = mul(load9(work, a, at.R), load(bodies_f, body_a, at.OFFSET))
    accumulate(touches, law, at.TO_FORCE, force)
    accumulate(touches, law, at.TO_TORQUE, cross(sub(arm, offset), force))
    touches[law, at.TO_GAP] = min(touches[law, at.TO_GAP], found_f[n, at.CT_GAP])
    touches[law, at.TO_SLIP] = max(touches[law, at.TO_SLIP], slip)


@kernel(CONTACT_FORCES, nogil=True)
def contact_forces(scene, v, tau, flow):
    """Forces of contacts onto the rows and τ, after `outboard`; power lost to flow[1].

    Soft and penalty contacts push by how deep they are; rigid ones by what the last step of a
    time-stepping method found, where that is asked for (FROZEN).
    """
    data = opened(scene)
    rows, const, work, space = data.rows, data.const, data.work, data.space
    contacts = contacts_at(data.links.contacts)
    laws, pushes, tally = contacts.laws, contacts.pushes, contacts.tally
    bodies_i, limit_tau = contacts.bodies_i, contacts.limit_tau
    if tally[at.FROZEN] == 1:
        positions(rows, work)
        for j in range(limit_tau.shape[0]):
            tau[j] += limit_tau[j]
        for b in range(1, pushes.shape[0]):
            k = bodies_i[b, at.ROW]
            apply(work, k, load(work, k, at.X), load(pushes, b, 0), load(pushes, b, 3))
        return 0
    soft = False
    for k in range(laws.shape[0]):
        soft = soft or laws[k, at.LW_LAW] != at.RIGID
    if not soft:
        return 0
    positions(rows, work)
    velocities(rows, const, work, v, space.linear)
    clear(opened(scene).links.contacts)
    for n in range(touching(scene, 0.0)):
        a, b, _, _, law = ends(contacts, n)
        if laws[law, at.LW_LAW] != at.RIGID:
            p = middle(contacts.found.points, n)
            u = sub(
                point_velocity(work, space.linear, a, p), point_velocity(work, space.linear, b, p)
            )
            force, slip = push_back(contacts, n, law, u)
            apply(work, a, p, (0.0, 0.0, 0.0), force)
            apply(work, b, p, (0.0, 0.0, 0.0), scale(-1.0, force))
            note(opened(scene).links.contacts, work, n, force, slip)
            flow[1] -= dot(force, u)
    return 0


@part
def push_back(contacts, n, law, u):
    """(force on A, slip speed) of a soft or penalty contact that closes with velocity u."""
    laws, found_f = contacts.laws, contacts.found.points
    normal = load(found_f, n, at.CT_NORMAL)
    depth = max(-found_f[n, at.CT_GAP], 0.0)
    speed = -dot(u, normal)
    slide = add_scaled(u, speed, normal)
    slip = math.sqrt(dot(slide, slide))
    k = laws[law, at.LW_STIFF]
    c = laws[law, at.LW_DAMP]
    mu = laws[law, at.LW_FRICTION]
    if laws[law, at.LW_LAW] == at.SOFT:
        size = max(k * depth * math.sqrt(depth) * (1.0 + c * speed), 0.0)
        drag = mu * size / math.sqrt(slip * slip + at.CREEP * at.CREEP)
        return add_scaled(scale(size, normal), -drag, slide), slip
    size = max(k * depth + c * speed, 0.0) if depth > 0.0 else 0.0
    stretch = (0.0, 0.0, 0.0)
    at_k = kept_place(contacts, n, n)
    if at_k >= 0:
        stretch = sub(middle(found_f, n), load(contacts.kept, at_k, 0))
        stretch = add_scaled(stretch, -dot(stretch, normal), normal)
    pull = add_scaled(scale(-k, stretch), -c, slide)
    total = math.sqrt(dot(pull, pull))
    if total > mu * size:
        pull = scale(mu * size / total, pull)
    return add_scaled(pull, size, normal), slip


@kernel(SETTLE, nogil=True)
def settle_contacts(scene, t, q, v):
    """After a step that ends at t: what contacts remember of it, and changes of their phases."""
    address = opened(scene).links.contacts
    laws = contacts_at(address)[6]
    sticks = False
    for k in range(laws.shape[0]):
        sticks = sticks or laws[k, at.LW_LAW] == at.PENALTY
    if sticks:
        keep_anchors(scene, q, v)
    log_phases(address, t)
    return 0


@sweep
def log_phases(address, t):
    """Changes of the touches' phases, from the forces and slips of the last step."""
    contacts = contacts_at(address)
    laws, touches, tally, stages, changes = (
        contacts.laws, contacts.touches, contacts.tally, contacts.stages, contacts.changes,
    )  # fmt: skip
    for k in range(laws.shape[0]):
        force = load(touches, k, at.TO_FORCE)
        still = STILL if laws[k, at.LW_LAW] == at.RIGID else CREEPING
        before = stages[k]
        if not dot(force, force) > 0.0:
            now = at.SWING
        elif touches[k, at.TO_SLIP] <= still:
            now = at.STANCE
        else:
            now = at.ACCEPTANCE if before == at.SWING or before == at.ACCEPTANCE else at.SLIP
        if now != before:
            stages[k] = now
            n = tally[at.N_LOGGED]
            if n < changes.shape[0]:
                changes[n, at.CH_TIME] = t
                changes[n, at.CH_TOUCH] = k
                changes[n, at.CH_PHASE] = now
            tally[at.N_LOGGED] = n + 1


@sweep
def keep_anchors(scene, q, v):
    """Where penalty friction sticks; an anchor that slid follows on the rim."""
    data = opened(scene)
    rows, const, work, space = data.rows, data.const, data.work, data.space
    contacts = contacts_at(data.links.contacts)
    outboard(rows, const, work, q, v)
    positions(rows, work)
    velocities(rows, const, work, v, space.linear)
    laws, kept, kept_i, tally = contacts.laws, contacts.kept, contacts.kept_i, contacts.tally
    found_f, found_i = contacts.found
    count = touching(scene, 0.0)
    fresh = contacts.found.points
    for n in range(count):  # new anchors wait in the columns of the points on B
        a, b, _, _, law = ends(contacts, n)
        p = middle(found_f, n)
        anchor = p
        at_k = kept_place(contacts, n, n)
        if at_k >= 0 and laws[law, at.LW_LAW] == at.PENALTY:
            normal = load(found_f, n, at.CT_NORMAL)
            stretch = sub(p, load(kept, at_k, 0))
            stretch = add_scaled(stretch, -dot(stretch, normal), normal)
            u = sub(
                point_velocity(work, space.linear, a, p), point_velocity(work, space.linear, b, p)
            )
            force, _ = push_back(contacts, n, law, u)
            most = laws[law, at.LW_FRICTION] * max(dot(force, normal), 0.0) / laws[law, at.LW_STIFF]
            size = math.sqrt(dot(stretch, stretch))
            if size > most:
                stretch = scale(most / size, stretch)
            anchor = sub(p, stretch)
        store(fresh, n, at.CT_B, anchor)
    for n in range(count):
        store(kept, n, 0, load(fresh, n, at.CT_B))
        kept_i[n, 0] = found_i[n, at.CT_SHAPE_A]
        kept_i[n, 1] = found_i[n, at.CT_SHAPE_B]
        kept_i[n, 2] = found_i[n, at.CT_FEATURE]
    tally[at.N_KEPT] = count


@kernel(CONTACT_RECORD, nogil=True)
def record_contacts(scene, wrenches, touches):
    """What contacts do to bodies (nb, 6), about their origins, and touches (nt, 8)."""
    data = opened(scene)
    work = data.work
    contacts = contacts_at(data.links.contacts)
    pushes, bodies_i, bodies_f = contacts.pushes, contacts.bodies_i, contacts.bodies_f
    for b in range(1, pushes.shape[0]):
        k = bodies_i[b, at.ROW]
        offset = mul(load9(work, k, at.R), load(bodies_f, b, at.OFFSET))
        force = load(pushes, b, 3)
        store(wrenches, b - 1, 0, sub(load(pushes, b, 0), cross(offset, force)))
        store(wrenches, b - 1, 3, force)
    for k in range(touches.shape[0]):
        for n in range(at.TOUCH):
            touches[k, n] = contacts.touches[k, n]
    return 0
