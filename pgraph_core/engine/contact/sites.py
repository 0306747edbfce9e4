"""What contact points and limits do at one instant: gaps, rates, forces; and impulses on them."""

import math

from numba import types

from .. import layout as at
from ..arrays import F1, Blocks, Frames, opened
from ..compiler.address import caller
from ..compiler.jit import kernel, part, sweep
from ..constraints.blocks import (
    locate,
    residual,
    residual_acceleration,
    residual_velocity,
    slip,
    velocities,
)
from ..constraints.constraints import couplings, drift, number_rows, respond, unit_responses
from ..constraints.proximal import CHANGE, LAMBDA, RHS, STEP, ZERO
from ..motion import RECORD, TAU, call_acceleration, call_record
from ..tree.articulated import inboard
from ..tree.kinematics import accelerate, outboard, positions
from ..vec import add_scaled, dot, load, scale, store, sub
from .phases import (
    opened_phased,
    slides,
    tangential,
)

ROUNDING = 2.0**-51  # of the coordinates that a gap is the difference of

# scene, t, q, v, v', flow
OBSERVE = types.int64(types.int64, types.float64, F1, F1, F1, F1)
call_observe = caller(OBSERVE)


@kernel(OBSERVE, nogil=True, later=True)
def observe(scene, t, q, v, vdot, flow):
    """Gap, rates, force and rounding of every site at (q, v); v' where a site is closed."""
    phased = opened_phased(scene)
    data, sites = phased.scene, phased.sites
    rows, const, blocks, work, space = data.rows, data.const, data.blocks, data.work, data.space
    links, sites_i, sites_f = sites.links, sites.sites_i, sites.sites_f
    closed = False
    for s in range(sites_i.shape[0]):
        closed = closed or sites_i[s, at.S_PHASE] != at.SWING
        for c in range(5):
            sites_f[s, at.S_FORCE + c] = 0.0
        sites_f[s, at.S_PIVOT] = 1.0
    if closed:
        tau = space.vectors[TAU, : v.shape[0]]
        call_acceleration(links.phased, (scene, t, q, v, tau, vdot, flow))
        for s in range(sites_i.shape[0]):
            if sites_i[s, at.S_PHASE] != at.SWING:
                site_force(rows, blocks, work, space, sites, s)
    else:
        outboard(rows, const, work, q, v)
        positions(rows, work)
        velocities(rows, const, work, v, space.linear)
    all_sites(rows, const, blocks, work, space, sites, t, q, v)
    return 0


@part
def with_active(blocks, active):
    """The same blocks, others of them active."""
    return Blocks(
        blocks.blocks_i, blocks.blocks_f, blocks.terms_i, blocks.terms_f, blocks.curves, active
    )


@sweep
def all_sites(rows, const, blocks, work, space, sites, t, q, v):
    """Gap, rates and rounding of every site, open ones too."""
    sites_i, sites_f, every = sites.sites_i, sites.sites_f, sites.every
    blocks_i, blocks_f, terms_i = blocks.blocks_i, blocks.blocks_f, blocks.terms_i
    observed = with_active(blocks, every)
    slots, place, vectors, linear = space.slots, space.place, space.vectors, space.linear
    number_rows(observed, slots)
    locate(observed, work, place)
    residual(observed, work, space, t, q, vectors[CHANGE])
    residual_velocity(observed, work, space, t, v, vectors[RHS])
    for s in range(sites_i.shape[0]):
        i = sites_i[s, at.S_SLIDE]
        r = slots[i, at.FIRST]
        sites_f[s, at.S_DISTANCE] = vectors[CHANGE, r]
        sites_f[s, at.S_RATE] = vectors[RHS, r]
        if sites_i[s, at.S_LIMIT] == 1:
            spread = abs(blocks_f[i, at.VALUE])
            first = blocks_i[i, at.B_TERM]
            spread += abs(q[terms_i[first, 1]])
        else:
            p = load(place, i, at.PLACE_P)
            store(sites_f, s, at.S_PLACE, p)
            u = slip(blocks_i, i, work, linear, place)
            store(sites_f, s, at.S_SLIP_V, tangential(sites_f, s, u))
            normal = load(sites_f, s, at.S_NORMAL)
            spread = path_length(rows, const, work, blocks_i[i, at.B_A], p, normal)
        sites_f[s, at.S_NOISE] = ROUNDING * spread


@part
def path_length(rows, const, work, k, p, n):
    """What a height is summed from: along normal n, from the ground to point p of row k [m]."""
    length = abs(dot(sub(p, load(work, k, at.X)), n))
    while k > 0:
        length += abs(dot(load(work, k, at.L), n))
        if rows[k, at.KIND] == at.TRANSLATE or rows[k, at.KIND] == at.FREE:
            link = load(const, k, at.LINK)  # which a displacement may have been taken from
            length += abs(link[0]) + abs(link[1]) + abs(link[2])
        k = rows[k, at.PARENT]
    return length


@sweep
def site_force(rows, blocks, work, space, sites, s):
    """Force on the body at a closed site from λ, and its parts; a limit's is about its axis."""
    sites_i, sites_f = sites.sites_i, sites.sites_f
    blocks_i, terms_f = blocks.blocks_i, blocks.terms_f
    slots, place, lam = space.slots, space.place, space.vectors[LAMBDA]
    slid = slides(sites_i[s, at.S_PHASE])
    i = sites_i[s, at.S_SLIDE if slid else at.S_STANCE]
    r = slots[i, at.FIRST]
    if sites_i[s, at.S_LIMIT] == 1:
        sites_f[s, at.S_PUSH] = lam[r]
        axis = load(work, blocks_i[i, at.B_A], at.H)
        store(sites_f, s, at.S_FORCE, scale(terms_f[blocks_i[i, at.B_TERM]] * lam[r], axis))
        return
    force = (0.0, 0.0, 0.0)
    for c in range(3):
        force = add_scaled(force, lam[r + c], load(place, i, at.PLACE_D + 3 * c))
    store(sites_f, s, at.S_FORCE, force)
    sites_f[s, at.S_PUSH] = dot(force, load(sites_f, s, at.S_NORMAL))
    drag = tangential(sites_f, s, force)
    sites_f[s, at.S_DRAG] = math.sqrt(dot(drag, drag))


@kernel(RECORD, nogil=True, later=True)
def phased_record(scene, accelerate, t, q, v, flow, ledger, i, out):
    """As `record`, and what every site does; drift is that of what is held."""
    phased = opened_phased(scene)
    data, sites = phased.scene, phased.sites
    rows, const, work, space = data.rows, data.const, data.work, data.space
    links, sites_i, sites_f = sites.links, sites.sites_i, sites.sites_f
    phases, frames = sites.phases, sites.frames
    frame = Frames(*out)
    fine = call_record(links.record, (scene, accelerate, t, q, v, flow, ledger, i, out))
    call_observe(links.observe, (scene, t, q, v, frame.vdot[i], flow))
    drift(rows, const, opened(links.held).blocks, work, space, t, q, v, frame.drifts[i])
    for s in range(sites_i.shape[0]):
        phases[i, s] = sites_i[s, at.S_PHASE]
        for c in range(3):
            frames[i, s, at.F_FORCE + c] = sites_f[s, at.S_FORCE + c]
            frames[i, s, at.F_PLACE + c] = sites_f[s, at.S_PLACE + c]
            frames[i, s, at.F_SLIP + c] = sites_f[s, at.S_SLIP_V + c]
        frames[i, s, at.F_PUSH] = sites_f[s, at.S_PUSH]
        frames[i, s, at.F_GAP] = sites_f[s, at.S_DISTANCE]
    return fine


@kernel("void(i8,f8,f8[::1],f8[::1],f8[::1],f8[::1])", later=True)
def site_accelerations(scene, t, q, v, vdot, flow):
    """Normal and tangential acceleration of every site, open ones too, into S_ACC_N, S_ACC_T."""
    phased = opened_phased(scene)
    data, sites = phased.scene, phased.sites
    rows, const, blocks, work, space = data.rows, data.const, data.blocks, data.work, data.space
    links, sites_i, sites_f, every = sites.links, sites.sites_i, sites.sites_f, sites.every
    slots, place, vectors = space.slots, space.place, space.vectors
    tau = vectors[TAU, : v.shape[0]]
    call_acceleration(links.phased, (scene, t, q, v, tau, vdot, flow))
    outboard(rows, const, work, q, v)
    accelerate(rows, const, work, v, vdot)
    positions(rows, work)
    velocities(rows, const, work, v, space.linear)
    observed = with_active(blocks, every)
    number_rows(observed, slots)
    locate(observed, work, place)
    residual_acceleration(observed, work, space, t, vdot, vectors[RHS])
    for s in range(sites_i.shape[0]):
        i = sites_i[s, at.S_SLIDE]
        r = slots[i, at.FIRST]
        sites_f[s, at.S_ACC_N] = vectors[RHS, r]
        sites_f[s, at.S_ACC_T] = 0.0
        if sites_i[s, at.S_LIMIT] == 0:
            a = scale(vectors[RHS, r + 1], load(place, i, at.PLACE_D + 3))
            a = add_scaled(a, vectors[RHS, r + 2], load(place, i, at.PLACE_D + 6))
            store(sites_f, s, at.S_ACC_T, a)


@kernel("i8(i8,f8,f8[::1],f8[::1])", later=True)
def impulse_rows(scene, t, q, v):
    """Ω and velocities (in RHS) of the active rows of a scene, for impulses; their number."""
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
    locate(blocks, work, space.place)
    unit_responses(rows, const, blocks, work, space)
    couplings(blocks, space)
    residual_velocity(blocks, work, space, t, v, vectors[RHS])
    return m


@kernel("void(i8,f8[::1])", later=True)
def add_impulses(scene, v):
    """v += M⁻¹ Jᵀ λ of the active rows, after `impulse_rows`, λ in LAMBDA."""
    data = opened(scene)
    rows, const, blocks, work, space = data.rows, data.const, data.blocks, data.work, data.space
    respond(rows, const, blocks, work, space)
    for j in range(v.shape[0]):
        v[j] += space.vectors[STEP, j]
