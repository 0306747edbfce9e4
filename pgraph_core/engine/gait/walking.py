"""The walking controller: torques from (t, q, v) and settings, without memory or look-ahead.

Each foot has a clock. Feet on the ground carry the trunk (`support`): height, pitch, roll, yaw and
speed by virtual springs and dampers about waves of the gait. The foothold is determined by the
speed: it is half a stance ahead of the hip, and further if the body is too fast [Raibert 1986]. The
torques are computed by inverse dynamics for the resulting accelerations, minus Jᵀ times the forces.
"""

import math

from .. import layout as at
from ..compiler import elementary
from ..compiler.address import stored
from ..compiler.elementary import atan2
from ..compiler.jit import kernel, part
from ..compiler.kinds import I1, f8, i8, plain, u8, void
from ..compiler.lane import in_each
from ..compiler.masks import any_of, both, chosen, either, larger, more, smaller, without
from ..constraints.blocks import velocities
from ..rows import axis_of, bias_of, parent_of, set_bias, set_force, v_of
from ..tree.dynamics import newton_euler
from ..tree.kinematics import outboard, positions
from ..vec import (
    add,
    add_cross,
    add_scaled,
    cross,
    dot,
    load,
    load9,
    mul,
    mul_t,
    scale,
    set_xyz,
    sub,
    xyz,
)
from .footsteps import ground, level_at, step_to, swing_foot
from .legs import clamp, stand, swing
from .support import carry, centre
from .tables import (
    FEET,
    FLEXION,
    NOD,
    RISE,
    SURGE,
    SWAY,
    WALK,
    into,
    out_of,
    phase_at,
    smooth,
    speed_at,
    wave,
)

_save, opened_walk = stored(WALK)
asin = in_each(elementary.asin)


@kernel(void(I1, plain(WALK)), later=True)
def save_walk(buffer, walk):
    """Store a controller's tuple where `walking` finds it."""
    _save(buffer, walk)


@part
def trunk(work, linear, legs, s):
    """Return (heading, (roll, yaw, pitch), their rates) from the line between the hip midpoints."""
    hind = legs[2].girdle
    none = 0.0 * s.mass
    d = (none, none, none)
    u = (none, none, none)
    for f in range(FEET):  # the first two are in front
        side = 0.5 if f < 2 else -0.5
        d = add_scaled(d, side, load(work, legs[f].hip, at.X))
        u = add_scaled(u, side, load(linear, legs[f].hip, 0))
    flat = math.sqrt(d[0] * d[0] + d[2] * d[2])
    heading = (d[0] / flat, -d[2] / flat)
    d = into(heading, d)
    u = into(heading, u)
    right = into(heading, mul(load9(work, hind, at.R), (0.0, 0.0, 1.0)))
    w = into(heading, load(work, hind, at.W))
    pitch = atan2(d[1], d[0]) - s.pitch
    nods = (d[0] * u[1] - d[1] * u[0]) / (d[0] * d[0] + d[1] * d[1])
    roll = -asin(smaller(1.0, larger(-1.0, right[1])))
    return heading, (roll, atan2(heading[1], heading[0]), pitch), (w[0], w[1], nods)


@part
def feel(work, linear, legs, s, phase, heading, feet):
    """Compute the positions of the feet, and from their clocks the load that each carries."""
    for f in range(FEET):
        p = phase - legs[f].offset
        p -= math.floor(p)
        duty = legs[f].duty
        k = legs[f].foot
        arm = mul(load9(work, k, at.R), xyz(legs[f].tip))
        u = add_cross(load(linear, k, 0), load(work, k, at.W), arm)
        set_xyz(feet[f].place, into(heading, add(load(work, k, at.X), arm)))
        set_xyz(feet[f].velocity, into(heading, u))
        stands, lifts = more(duty, p), more(1.0, duty)
        near = smooth(smaller(duty - p, p) / (s.ramp * duty))
        feet[f].load = chosen(stands, chosen(lifts, near, 1.0), 0.0)
        feet[f].swing = chosen(stands, -1.0, (p - duty) / chosen(lifts, 1.0 - duty, 1.0))
        up = feet[f].load * legs[f].share * s.mass * s.gravity
        set_xyz(feet[f].force, (0.0, up, 0.0))


@part
def wanted(s, waves, phase, t, felt, angles, rates, com, u):
    """Compute the feet's desired wrench in heading axes: torque about the centre of mass, force."""
    sure, middle, slope, _ = felt
    rise, rise_u, rise_a = wave(waves, RISE, s, phase)
    nod, nod_u, nod_a = wave(waves, NOD, s, phase)
    sway, sway_u, sway_a = wave(waves, SWAY, s, phase)
    surge, surge_u, surge_a = wave(waves, SURGE, s, phase)
    up = s.gain_height[0] * (s.height + level_at(felt, com[0]) + rise - com[1])
    up += s.gain_height[1] * (rise_u + slope * u[0] - u[1]) + rise_a
    ahead = s.gain_speed * (speed_at(s, t) + surge_u - u[0]) + surge_a
    ahead += s.gain_surge * sure * (surge + middle[0] - com[0])
    right = s.gain_drift * (s.drift + sway_u - u[2]) + sway_a
    right += s.gain_sway * sure * (sway + middle[2] - com[2])
    off = s.heading + s.turn_rate * (t - s.turn_time) - angles[1]
    off -= 2.0 * math.pi * math.floor(off / (2.0 * math.pi) + 0.5)
    roll = -s.gain_roll[0] * angles[0] - s.gain_roll[1] * rates[0]
    yaw = s.gain_yaw[0] * off + s.gain_yaw[1] * (s.turn_rate - rates[1])
    pitch = s.gain_pitch[0] * (slope + nod - angles[2])
    pitch += s.gain_pitch[1] * (nod_u - rates[2]) + nod_a
    m, inertia = s.mass, s.inertia
    return (
        inertia[0] * roll, inertia[1] * yaw, inertia[2] * pitch,
        m * ahead, m * (s.gravity + up), m * right,
    )  # fmt: skip


@part
def base_acceleration(work, feet, s, heading, com, vdot):
    """Compute the root's acceleration due to foot forces in world axes, also written to `vdot`."""
    none = 0.0 * s.mass
    force = (none, none, none)
    moment = (none, none, none)
    for f in range(FEET):
        one = xyz(feet[f].force)
        force = add(force, one)
        moment = add(moment, cross(sub(xyz(feet[f].place), com), one))
    inertia = s.inertia
    alpha = (moment[0] / inertia[0], moment[1] / inertia[1], moment[2] / inertia[2])
    linear = add(scale(1.0 / s.mass, force), (0.0, -s.gravity, 0.0))
    arm = sub(into(heading, load(work, 1, at.X)), com)
    linear = out_of(heading, add_cross(linear, alpha, arm))
    alpha = out_of(heading, alpha)
    for n in range(3):
        vdot[n] = alpha[n]
        vdot[3 + n] = linear[n]
    return alpha, linear


@part
def swing_leg(walk, work, t, f, heading, u, roll, felt, base):
    """Return v' of a swing leg from its foot target relative to its girdle."""
    linear, legs, s, feet = walk.linear, walk.legs, walk.settings[0], walk.feet
    g = legs[f].girdle
    hip = load(work, legs[f].hip, at.X)
    hip_u = load(linear, legs[f].hip, 0)
    places = step_to(
        legs, f, s, feet[f].swing, speed_at(s, t), into(heading, hip), into(heading, hip_u),
        u, roll,
    )  # fmt: skip
    place, speed, push = swing_foot(
        feet, f, legs, s, walk.terrain, heading, felt, places[0], places[1]
    )
    arm = sub(out_of(heading, place), hip)
    alpha, linear_a = base
    hip_a = add_cross(linear_a, alpha, sub(hip, load(work, 1, at.X)))
    rate = sub(sub(out_of(heading, speed), hip_u), cross(load(work, g, at.W), arm))
    push = sub(sub(out_of(heading, push), hip_a), cross(alpha, arm))
    r = load9(work, g, at.R)
    return swing(legs, f, mul_t(r, arm), mul_t(r, rate), mul_t(r, push), walk.q, walk.v, s)


@part
def legs_and_spine(walk, work, t, phase, heading, u, roll, felt, base):
    """Compute v' of all hinges."""
    legs, s, waves, feet = walk.legs, walk.settings[0], walk.waves, walk.feet
    q, v, vdot, spine = walk.q, walk.v, walk.vdot, walk.spine
    bend, bend_u, bend_a = wave(waves, FLEXION, s, phase)
    for n in range(spine.shape[0]):
        i, j = spine[n, 0], spine[n, 1]
        vdot[j] = s.gain_spine[0] * (bend - q[i])
        vdot[j] += s.gain_spine[1] * (bend_u - v[j]) + bend_a
    for f in range(FEET):
        j = legs[f].v_flex
        stands = more(0.0, feet[f].swing)
        swings = without(1.0, stands)
        if legs[f].v_spread >= 0:
            vdot[legs[f].v_spread] = 0.0
        if any_of(stands):
            held = stand(legs, f, q, v, s)
            for n in range(3):
                vdot[j + n] = held[n]
        if any_of(swings):
            moved = swing_leg(walk, work, t, f, heading, u, roll, felt, base)
            for n in range(3):
                vdot[j + n] = chosen(swings, moved[1 + n], vdot[j + n])
            if legs[f].v_spread >= 0:
                vdot[legs[f].v_spread] = chosen(swings, moved[0], 0.0)


@part
def take_off_forces(rows, work, legs, feet, heading, tau, walks):
    """Subtract Jᵀ f of the foot forces from τ where `walks`."""
    for f in range(FEET):
        bears = both(walks, more(feet[f].load, 0.0))
        if any_of(bears):
            force = out_of(heading, xyz(feet[f].force))
            place = out_of(heading, xyz(feet[f].place))
            k = legs[f].foot
            while k > 1:
                j = v_of(rows, k)
                moment = cross(sub(place, load(work, k, at.X)), force)
                tau[j] = chosen(bears, tau[j] - dot(axis_of(work, k), moment), tau[j])
                k = parent_of(rows, k)


@part
def has_fallen(work, s, com, level):
    """Check whether the trunk is too low or too tilted to continue."""
    upright = work[1, at.R + 4]
    return either(more(s.low * s.height, com[1] - level), more(s.upright, upright))


@part
def copied_bias(work, out):
    """Copy b of all rows, since `newton_euler` overwrites it and a run still needs it."""
    for k in range(1, work.shape[0]):
        moment, force = bias_of(work, k)
        set_bias(out, k, moment, force)


@part
def slow_down(v, vdot, s, lies):
    """Set v' such that all joints decelerate at the same rate if the walker has fallen."""
    for j in range(v.shape[0]):
        slow = -s.limp * v[j] if j >= 6 else 0.0 * s.limp
        vdot[j] = chosen(lies, -s.gravity if j == 4 else slow, vdot[j])


@part
def torques(rows, const, work, mine, v, vdot, tau):
    """Compute τ by inverse dynamics, restoring `work` afterwards."""
    copied_bias(work, mine)
    newton_euler(rows, const, v, vdot, work, tau)
    copied_bias(mine, work)
    none = (0.0, 0.0, 0.0)
    set_force(work, 0, none, none)  # clears the accumulated forces of the root


@part
def falls(walk, work, t, com, level):
    """Check whether the walker has fallen. Stores the time of the first fall."""
    lies = has_fallen(work, walk.settings[0], com, level)
    first = both(lies, more(0.0, walk.fallen[0]))
    walk.fallen[0] = chosen(first, t, walk.fallen[0])
    return lies


@part
def control(walk, work, t):
    """Compute τ for one walk or for several lanes, from the frames in `work`. Joints brake after
    a fall."""
    rows, const, mine, linear, legs = walk.rows, walk.const, walk.work, walk.linear, walk.legs
    s, waves, feet, mat = walk.settings[0], walk.waves, walk.feet, walk.matrix
    v, tau, vdot, limit = walk.v, walk.tau, walk.vdot, walk.limit
    positions(rows, work)
    velocities(rows, const, work, v, linear)
    com, u = centre(rows, const, work, linear)
    heading, angles, rates = trunk(work, linear, legs, s)
    com, u = into(heading, com), into(heading, u)
    phase = phase_at(s, t)
    feel(work, linear, legs, s, phase, heading, feet)
    felt = ground(feet, com[1] - s.height - wave(waves, RISE, s, phase)[0])
    lies = falls(walk, work, t, com, level_at(felt, com[0]))
    walks = without(1.0, lies)
    if any_of(walks):
        carry(feet, s, wanted(s, waves, phase, t, felt, angles, rates, com, u), com, mat)
        base = base_acceleration(work, feet, s, heading, com, vdot)
        legs_and_spine(walk, work, t, phase, heading, u, angles[0], felt, base)
    if any_of(lies):
        slow_down(v, vdot, s, lies)
    torques(rows, const, work, mine, v, vdot, tau)
    take_off_forces(rows, work, legs, feet, heading, tau, walks)
    for j in range(6):
        tau[j] = 0.0
    for j in range(6, tau.shape[0]):
        tau[j] = clamp(tau[j], limit[j])


@kernel(i8(f8, u8, u8, u8), later=True)
def walking(t, q_place, v_place, tau_place):
    """Compute τ at (t, q, v) with the tuple at `tau_place`. Returns 0."""
    walk = opened_walk(tau_place + (tau_place - v_place))
    theirs = walk.theirs
    work = theirs if theirs.shape[0] > 0 else walk.work
    if theirs.shape[0] == 0:
        outboard(walk.rows, walk.const, work, walk.q, walk.v)
    control(walk, work, t)
    return 0
