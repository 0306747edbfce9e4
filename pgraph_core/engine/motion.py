"""Equations of motion of a scene: v' with drives, loads and constraints, and energies.

Methods call these kernels by address.
"""

import math

from . import layout as at
from .arrays import CONTACTS, CONTACTS_OF_DUALS, OUT, SCENE, TAU, opened, save
from .compiler.address import caller, stored
from .compiler.dual import of_numbers
from .compiler.jit import kernel, part, sweep
from .compiler.kinds import F1, F2, I1, I2, array_of, f8, group, i8, plain, u8, void
from .constraints.blocks import residual, residual_velocity, velocities
from .constraints.constraints import drift, driven_power, impose, located, project, wrenches
from .drives import drive, elastic
from .loads import (
    apply_loads,
    arms_of_loads,
    collect_loads,
    count_of_loads,
    count_of_paths,
    elastic_loads,
    measure_loads,
    tension_of_load,
    torque_of_loads,
)
from .records import PAIR
from .riders import collect_riders, drive_riders, move_riders, place_riders, unload_riders
from .rows import kept_of
from .signals import (
    begin_states,
    follow_signals,
    gives_rates,
    leave_to_loads,
    put_rates,
    take_from_loads,
    take_samples,
)
from .tree.articulated import inboard, inboard_again, joint_acceleration, singular_row
from .tree.kinematics import (
    frames,
    kinetic_and_potential,
    outboard,
    outboard_again,
    positions,
)
from .tree.moving import advance
from .vec import finite

# a user's function takes time and the addresses of q, v and τ; another answer than 0 is a failure
_call_user = caller(i8(f8, u8, u8, u8))

_, contacts_at = stored(CONTACTS, CONTACTS_OF_DUALS)

MEANS = 6  # column of the mean wrenches of constraints in a frame

ACCELERATION = i8(i8, f8, F1, F1, F1, F1, F1)
PROJECTION = i8(i8, f8, F1, F1, i8)
RECORD = i8(i8, i8, f8, F1, F1, F1, F1, i8, OUT)
# of contacts, compiled only for a scene that has some (`touch`): forces, and what is recorded
CONTACT_FORCES = i8(i8, F1, F1, F1)
SETTLE = i8(i8, f8, F1, F1)  # scene, t, q, v: after a step
CONTACT_RECORD = i8(i8, F2, array_of(PAIR), F1)
# of constraints, compiled only for a scene that has some
CONSTRAIN = i8(i8, f8, F1, F1, F1, F1)
call_acceleration = caller(ACCELERATION)
call_constrain = caller(CONSTRAIN)
call_contact_forces = caller(CONTACT_FORCES)
call_contact_record = caller(CONTACT_RECORD)
call_projection = caller(PROJECTION)
call_record = caller(RECORD)
call_settle = caller(SETTLE)


@kernel(void(I1, plain(SCENE)))
def save_scene(buffer, scene):
    """Store a scene's tuple where `opened` finds it."""
    save(buffer, scene)


@part
def torque_of_numbers(user, t, q, v, tau):
    """Add the torques of a user's function to τ, not finite if it fails. Returns the power [W]."""
    address, exchange, answer = user
    for i in range(q.shape[0]):
        exchange[0, i] = q[i]
    for j in range(v.shape[0]):
        exchange[1, j] = v[j]
        exchange[2, j] = 0.0
    places = (exchange[0].ctypes.data, exchange[1].ctypes.data, exchange[2].ctypes.data)
    answer[0] = _call_user(address, (t, places[0], places[1], places[2]))
    power = 0.0
    for j in range(v.shape[0]):
        tau[j] += exchange[2, j] if answer[0] == 0 else math.nan
        power += exchange[2, j] * v[j]
    return power


user_torque = of_numbers(torque_of_numbers)  # no function of a user's takes duals


@part
def follow(data, t, q, v):
    """Evaluate the expressions in a scene, if any acts. Returns False if one is not finite."""
    if data.loads.signals[1].shape[0] + data.loads.signals[2].shape[0] == 0:
        return True
    return follow_signals(data.loads.signals, data.drives, data.loads, t, q, v) == 0


@kernel(i8(i8, f8, F1, F1), later=True)
def signal(scene, t, q, v):
    """Evaluate the expressions in a scene. Returns 0, or -1 if one is not finite."""
    return 0 if follow(opened(scene), t, q, v) else -1


@part
def locate_points(data, q, v):
    """Find positions and velocities of all origins and of points that ride, after `outboard`."""
    positions(data.rows, data.work)
    velocities(data.rows, data.const, data.work, v, data.space.linear)
    place_riders(data.loads.riders, data.work, q)
    move_riders(data.loads.riders, data.work, data.space.linear, q, v)


@sweep
def find_rates(data, t, q, v):
    """Let the loads along paths write the rates of their states into the knots, after `follow`."""
    rows, const, work, linear = data.rows, data.const, data.work, data.space.linear
    frames(rows, const, work, q, v)
    locate_points(data, q, v)
    for i in range(count_of_paths(data.loads)):
        tension_of_load(data.loads, work, linear, q, t, i)


@kernel(void(i8, f8, f8, F1, F1), later=True)
def begin_controls(scene, t, near, q, v):
    """Give the states of controls their first values at t, then take the samples within `near`."""
    data = opened(scene)
    loads = data.loads
    begin_states(loads.signals, t, q, v, False)
    if gives_rates(loads.signals[2]):
        for _ in range(loads.signals[2].shape[0]):
            follow(data, t, q, v)
            leave_to_loads(loads.signals, loads)
            find_rates(data, t, q, v)
            changed = take_from_loads(loads.signals, loads, v)
            begin_states(loads.signals, t, q, v, True)
            if not changed:
                break
    take_samples(loads.signals, t, near, q, v)


@kernel(ACCELERATION, nogil=True)
def acceleration(scene, t, q, v, tau, vdot, flow):
    """Compute v' and the joint forces `tau`. Returns the first row without inertia, or 0.

    If row 0 is `kept`, frames and inertias of the last call are used again.

    `flow` (3,) gets the power put in and dissipated [W], and the solver's iterations.
    """
    data = opened(scene)
    rows, const, drives = data.rows, data.const, data.drives
    work, given, user = data.work, data.given, data.user
    known = follow(data, t, q, v)
    put_in, dissipated = drive(drives, t, q, v, given, tau)
    if not known:
        tau[0] = math.nan
    again = kept_of(work, 0) == 1.0
    if again:
        outboard_again(rows, const, work, v)
    else:
        outboard(rows, const, work, q, v)
    if user.address != 0:  # may use the results of `outboard`
        put_in += user_torque(user, t, q, v, tau)
    data = opened(scene)  # again: what is not needed is not read
    loads, space, links = data.loads, data.space, data.links
    if count_of_loads(loads) > 0:
        locate_points(data, q, v)
        more, lost = apply_loads(loads, work, space.linear, q, t)
        unload_riders(loads.riders, work)
        drive_riders(loads.riders, work, q, tau)
        put_in += more
        dissipated += lost
    if loads.signals[2].shape[0] > 0:
        put_rates(loads.signals, loads, tau)
    flow[0] = put_in
    flow[1] = dissipated
    if links.forces != 0:
        call_contact_forces(links.forces, (scene, v, tau, flow))
    if again:
        inboard_again(rows, const, work, tau)
    else:
        inboard(rows, const, work, tau)
    joint_acceleration(rows, const, work, vdot)
    flow[2] = 0.0
    if opened(scene).blocks.active[0] > 0:
        call_constrain(links.constraints, (scene, t, q, v, vdot, flow))
    return 0


@kernel(CONSTRAIN, nogil=True)
def constrain(scene, t, q, v, vdot, flow):
    """Add the v' of active constraints, their power to flow[0], iterations to flow[2]."""
    data = opened(scene)
    blocks, space = data.blocks, data.space
    flow[2] = impose(scene, t, q, v, vdot)
    flow[0] += driven_power(blocks, space, v)
    return 0


@kernel(i8(i8, i8, f8, F1, F1, F1, F1, F1, F2))
def constrained_dynamics(scene, accelerate, t, q, v, given, flow, vdot, forces):
    """Compute v' and block wrenches. Returns 0, -1 if not finite, or a singular row."""
    data = opened(scene)
    rows, blocks, work, space, kept = data.rows, data.blocks, data.work, data.space, data.given
    for j in range(given.shape[0]):
        kept[j] = given[j]
    tau = space.vectors[TAU, : v.shape[0]]
    call_acceleration(accelerate, (scene, t, q, v, tau, vdot, flow))
    if blocks.active[0] > 0:
        wrenches(rows, blocks, work, space, forces)
    singular = singular_row(rows, work)
    if singular > 0:
        return singular
    return 0 if finite(vdot) else -1


@kernel(PROJECTION, nogil=True)
def projection(scene, t, q, v, rounds):
    """Project q and v onto the active constraints. Returns the iterations, or -1 on failure."""
    return project(scene, t, q, v, rounds)


@kernel(void(i8, f8, F1, F1, F1, F1))
def residuals(scene, t, q, v, gap, speed):
    """Compute g and g' of the active blocks, leaving their positions in the workspace."""
    data = opened(scene)
    outboard(data.rows, data.const, data.work, q, v)
    located(scene, q, v, True)
    residual(data.blocks, data.work, data.space, t, q, gap)
    residual_velocity(data.blocks, data.work, data.space, t, v, speed)


@part
def mean_wrenches(scene, forces, i):
    """Write the mean wrenches of constraints beside those at frame i.

    The first frame of a run has no interval, and a frame that is recorded again keeps its means.
    """
    data = opened(scene)
    known = contacts_at(data.links.contacts).tally[0].elapsed > 0.0
    for n in range(forces.shape[0] if known or i == 0 else 0):
        for c in range(6):
            mean = data.blocks.blocks_f[n, at.MEAN_PULL + c]
            forces[n, MEANS + c] = mean if known else forces[n, c]


@kernel(RECORD, nogil=True)
def record(scene, accelerate, t, q, v, flow, ledger, i, out):
    """Record state, v', wrenches, energies, ledger and residuals. Returns False if not finite."""
    data = opened(scene)
    rows, const, drives, loads = data.rows, data.const, data.drives, data.loads
    blocks, work, space = data.blocks, data.work, data.space
    qs, vs, vdots, forces, energies, drifts, pushes, touches, missed = out
    tau = space.vectors[TAU, : v.shape[0]]
    call_acceleration(accelerate, (scene, t, q, v, tau, vdots[i], flow))
    for n in range(q.shape[0]):
        qs[i, n] = q[n]
    for n in range(v.shape[0]):
        vs[i, n] = v[n]
    if blocks.active[0] > 0:
        wrenches(rows, blocks, work, space, forces[i])
        drift(rows, const, blocks, work, space, t, q, v, drifts[i])
    if forces.shape[2] > MEANS:
        mean_wrenches(scene, forces[i], i)
    if data.links.contacts != 0:
        call_contact_record(data.links.record, (scene, pushes[i], touches[i], missed[i]))
    kinetic, potential = kinetic_and_potential(rows, const, work, space.linear, v)
    place_riders(loads.riders, work, q)
    energies[i, 0] = kinetic
    energies[i, 1] = potential + elastic(drives, q) + elastic_loads(loads, work, q)
    energies[i, 2] = ledger[at.WORK_DONE]
    energies[i, 3] = ledger[at.DISSIPATED]
    return 1 if finite(vdots[i]) and finite(energies[i]) else 0


@kernel(group(*[f8] * 2)(i8, F1, F1))
def energy(scene, q, v):
    """Compute the (kinetic, potential) energy, including springs [J]."""
    return energies(scene, q, v)


@sweep
def energies(scene, q, v):
    """`energy`, for kernels."""
    data = opened(scene)
    rows, const, drives, loads, work = data.rows, data.const, data.drives, data.loads, data.work
    outboard(rows, const, work, q, v)
    kinetic, potential = kinetic_and_potential(rows, const, work, data.space.linear, v)
    place_riders(loads.riders, work, q)
    return kinetic, potential + elastic(drives, q) + elastic_loads(loads, work, q)


@kernel(void(i8, I2, F2, f8, F1, F1, F2))
def load_wrenches(scene, bodies_i, bodies_f, t, q, v, external):
    """Add the loads to `external` (nb, 6)."""
    data = opened(scene)
    loads, work, count = data.loads, data.work, data.rows.shape[0]
    follow(data, t, q, v)
    outboard(data.rows, data.const, work, q, v)
    locate_points(data, q, v)
    collect_loads(loads, bodies_i, bodies_f, work, count, data.space.linear, q, t, external)
    collect_riders(loads.riders, bodies_i, bodies_f, work, count, external)


@kernel(void(i8, F1, F1, F1))
def drive_torque(scene, q, v, tau):
    """Compute τ of springs, dampers, motors, servos and given torques at t = 0."""
    data = opened(scene)
    drives, given = data.drives, data.given
    follow(data, 0.0, q, v)
    drive(drives, 0.0, q, v, given, tau)


@kernel(void(i8, f8, F1, F1, F2))
def load_tensions(scene, t, q, v, out):
    """Write (tension, length, rate) of all loads along paths into `out` (n, 3), by kinds."""
    data = opened(scene)
    work, space = data.work, data.space
    follow(data, t, q, v)
    outboard(data.rows, data.const, work, q, v)
    locate_points(data, q, v)
    measure_loads(data.loads, work, space.linear, q, t, out, 0)


@kernel(void(i8, F1, F1, F1, F2), later=True)
def path_arms(scene, q, still, lengths, arms):
    """Compute the lengths of all loads along paths (n,) and their moment arms -dL/dq (n, nv).

    `still` (nv,) are zeros.
    """
    data = opened(scene)
    outboard(data.rows, data.const, data.work, q, still)
    positions(data.rows, data.work)
    place_riders(data.loads.riders, data.work, q)
    arms_of_loads(data.rows, data.const, data.loads, data.work, q, lengths, arms, 0)


@kernel(void(i8, F1, F1, F1))
def load_torque(scene, q, v, tau):
    """Compute τ of the loads on bodies at t = 0: Hᵀ φᵀ F, eqs. (12), (23)."""
    data = opened(scene)
    rows, const, loads, work, space = data.rows, data.const, data.loads, data.work, data.space
    follow(data, 0.0, q, v)
    outboard(rows, const, work, q, v)
    locate_points(data, q, v)
    torque_of_loads(rows, const, loads, work, space.linear, q, tau)


@kernel(void(I2, F1, F1, f8))
def move(rows, q, v, h):
    """Move q along v for the time h."""
    advance(rows, q, v, h)
