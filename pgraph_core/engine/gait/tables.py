"""Tables, axes and clock of the walking controller, and the tuple of all its data.

Heading axes: x where the trunk points, level; y up; z to the right: world axes turned about y.
"""

from __future__ import annotations

import math
from typing import Any, NamedTuple

from ..compiler.elementary import sine_cosine
from ..compiler.jit import part, sweep
from ..compiler.kinds import F1, F2, I2, array_of, named
from ..compiler.masks import any_of, either, larger, smaller
from ..records import INTEGER, REAL, record

GAIT_SETTINGS = record(  # settings that may change between steps
    clock_time=REAL,  # [s]
    clock_phase=REAL,  # part of a stride done at `clock_time`
    stride=REAL,  # [s]
    speed_from=REAL,  # a ramp from `speed_time` on [m/s]
    speed_to=REAL,  # [m/s]
    speed_time=REAL,  # [s]
    speed_rate=REAL,  # [m/s²]
    drift=REAL,  # speed to the right [m/s]
    heading=REAL,  # at `turn_time` [rad]
    turn_rate=REAL,  # [rad/s]
    turn_time=REAL,  # [s]
    height=REAL,  # height of the centre of mass over the ground under it [m]
    clearance=REAL,  # clearance of a swinging foot [m]
    landing=REAL,  # its speed down at the end [m/s]
    ramp=REAL,  # part of a stance over which its load comes, and goes
    width=REAL,  # distance of feet outside of their hips [m]
    grip=REAL,  # friction that forces may ask for
    least_load=REAL,  # least load of a foot on the ground [N]
    mass=REAL,  # mass of all bodies [kg]
    inertia=(REAL, 3),  # about their centre of mass [kg m²]
    gravity=REAL,  # down [m/s²]
    pitch=REAL,  # pitch of the trunk at home [rad]
    gain_speed=REAL,  # [1/s]
    gain_drift=REAL,  # [1/s]
    gain_sway=REAL,  # towards the middle of the feet, across [1/s²]
    gain_surge=REAL,  # the same, ahead [1/s²]
    gain_height=(REAL, 2),  # gains of position and rate, like all below [1/s², 1/s]
    gain_roll=(REAL, 2),
    gain_pitch=(REAL, 2),
    gain_yaw=(REAL, 2),
    gain_swing=(REAL, 2),
    gain_spine=(REAL, 2),
    gain_paw=(REAL, 2),
    place_speed=REAL,  # touchdown ahead of an error in speed [s]
    place_drift=REAL,  # the same, across [s]
    place_roll=REAL,  # touchdown across, by roll [m]
    tight_torque=REAL,  # weight of the trunk's torque
    tight_force=REAL,
    lever=REAL,  # 1 if hips spread, so that feet push sideways, 0 if all hinges are parallel
    limp=REAL,  # rate at which all joints are slowed down after a fall [1/s]
    low=REAL,  # a fall: lower than this part of `height`
    upright=REAL,  # or more tilted than this cosine
    rise_x=REAL,  # slope of the plane of the ground along x
    rise_z=REAL,  # and along z
)

LEG = record(  # home axes, where the paw moves parallel to the thigh in swing
    girdle=INTEGER,  # row of the trunk's body
    hip=INTEGER,  # row
    foot=INTEGER,  # row
    q_spread=INTEGER,  # the spreading motion in q
    v_spread=INTEGER,  # and in v, -1: none
    q_flex=INTEGER,  # the first of three hinges about z
    v_flex=INTEGER,
    offset=REAL,  # touchdown as a part of the stride
    duty=REAL,  # part of the stride on the ground
    side=REAL,  # -1 left, 1 right
    ahead=REAL,  # touchdown ahead of the hip at rest [m]
    long=(REAL, 2),  # thigh + paw [m]
    shank=(REAL, 2),  # [m]
    thigh=(REAL, 2),  # [m]
    paw=(REAL, 2),  # [m]
    tip=(REAL, 3),  # tip of the foot's row [m]
    share=REAL,  # share of the weight at full load
)

FOOT = record(  # heading axes
    place=(REAL, 3),  # [m]
    velocity=(REAL, 3),  # [m/s]
    force=(REAL, 3),  # on the foot [N]
    load=REAL,  # part of its stance's full load, 0 to 1
    swing=REAL,  # part of the swing done, -1 in stance
)


class Terrain(NamedTuple):
    """Heights of the ground's steps above its plane. Cell [i, j] begins at x[i] and z[j]."""

    x: Any  # (n + 1,) edges [m], empty if the ground is a plane
    z: Any  # (m + 1,)
    heights: Any  # (n, m)


class Walk(NamedTuple):
    """A walking controller."""

    rows: Any
    const: Any
    work: Any
    linear: Any
    legs: Any  # records of LEG, front legs first
    settings: Any  # one GAIT_SETTINGS
    waves: Any
    feet: Any  # records of FOOT
    matrix: Any  # (6, 7)
    q: Any
    v: Any
    tau: Any
    vdot: Any
    limit: Any  # (nv,)
    spine: Any
    fallen: Any  # (1,) time of the first fall [s], -1 for none
    terrain: Any  # a Terrain, None in lanes
    theirs: Any  # workspace of the calling run after `outboard`, empty without a run


WALK = named(
    Walk, I2, F2, F2, F2, array_of(LEG), array_of(GAIT_SETTINGS), F2, array_of(FOOT), F2,
    *[F1] * 5, I2, F1, named(Terrain, F1, F1, F2), F2,
)  # fmt: skip


# waves (5, 8), each a1, b1, a2, b2, ...: Σ a cos(2π k phase) + b sin(2π k phase)
RISE, NOD, SWAY, SURGE, FLEXION = 0, 1, 2, 3, 4  # waves of height, pitch, place, place, spine
HARMONICS = 4
FEET = 4


@part
def into(heading, x):
    """Rotate world axes to heading axes, with `heading` = (cosine, sine) of the angle about y."""
    c, s = heading
    return (c * x[0] - s * x[2], x[1], s * x[0] + c * x[2])


@part
def out_of(heading, x):
    """Rotate heading axes to world axes."""
    c, s = heading
    return (c * x[0] + s * x[2], x[1], c * x[2] - s * x[0])


@part
def smooth(x):
    """Return a smooth step: 0 below 0, 1 above 1, with zero slope at both."""
    x = smaller(1.0, larger(0.0, x))
    return x * x * (3.0 - 2.0 * x)


@sweep
def wave(waves, i, s, phase):
    """Compute (value, rate, acceleration) of wave i."""
    rate = 2.0 * math.pi / s.stride
    x = phase - phase
    x1 = x
    x2 = x
    for k in range(HARMONICS):
        a, b = waves[i, 2 * k], waves[i, 2 * k + 1]
        if not any_of(either(a, b)):
            continue
        n, c = sine_cosine(2.0 * math.pi * (k + 1) * phase)
        w = rate * (k + 1)
        x += a * c + b * n
        x1 += w * (b * c - a * n)
        x2 -= w * w * (a * c + b * n)
    return x, x1, x2


@part
def speed_at(s, t):
    """Compute the desired forward speed [m/s], which follows a ramp."""
    most = s.speed_rate * larger(0.0, t - s.speed_time)
    return s.speed_from + smaller(most, larger(-most, s.speed_to - s.speed_from))


@part
def phase_at(s, t):
    return s.clock_phase + (t - s.clock_time) / s.stride
