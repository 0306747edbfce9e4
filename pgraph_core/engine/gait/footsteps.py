"""Where swinging feet go: the ground as the others feel it, and steps along it, heading axes."""

from ..compiler.jit import part, sweep
from ..vec import add_scaled, scale, sub, xyz
from .heading import smooth

FREED, FREE = 0.04, 0.2  # a swing's part in which the foot only lifts; in which it is let go
SURE = 0.5  # of a full load: with more on the ground its slope is known
SPREAD = 1e-3  # m²: feet closer together along x say nothing of a slope


@sweep
def ground(feet, guess):
    """(sure, middle of the feet that carry, slope along x, guess): the ground as they feel it.

    `guess` is its height where no foot carries.
    """
    total = 1e-9
    middle = (0.0, 0.0, 0.0)
    for f in range(feet.shape[0]):
        total += feet[f].load
        middle = add_scaled(middle, feet[f].load, xyz(feet[f].place))
    middle = scale(1.0 / total, middle)
    xx = SPREAD
    xy = 0.0
    for f in range(feet.shape[0]):
        d = sub(xyz(feet[f].place), middle)
        xx += feet[f].load * d[0] * d[0]
        xy += feet[f].load * d[0] * d[1]
    sure = smooth(total / SURE)
    return sure, middle, sure * xy / xx, guess


@part
def level_at(felt, x):
    """Height of the ground at x."""
    sure, middle, slope, guess = felt
    return sure * (middle[1] + slope * (x - middle[0])) + (1.0 - sure) * guess


@sweep
def step_to(legs, f, s, z, speed, hip, hip_u, u, roll):
    """(where a foot leaves, where it is to land), level, from what the hip does; heading axes."""
    half = 0.5 * legs[f].duty * s.stride
    whole = (1.0 - legs[f].duty) * s.stride
    x = hip[0] + legs[f].ahead
    y = hip[2] + legs[f].side * s.width
    behind = half + whole * z
    ahead = half + whole * (1.0 - z)
    leave = (x - hip_u[0] * behind, y - hip_u[2] * behind)
    more = s.place_drift * (u[2] - s.drift) + s.place_roll * roll
    land = (x + hip_u[0] * ahead + s.place_speed * (u[0] - speed), y + hip_u[2] * ahead + more)
    return leave, land


@part
def lift(s, z, whole):
    """(height over the ground, rate, acceleration) of a swinging foot: up, and down to land."""
    zz = z * (1.0 - z)
    odd = 1.0 - 2.0 * z
    c = s.clearance
    fall = s.landing * whole
    y = 64.0 * c * zz * zz * zz - fall * z * z * z * z * (z - 1.0)
    y1 = 192.0 * c * zz * zz * odd - fall * z * z * z * (5.0 * z - 4.0)
    y2 = 384.0 * c * zz * (odd * odd - zz) - fall * z * z * (20.0 * z - 12.0)
    return y, y1 / whole, y2 / (whole * whole)


@sweep
def swing_foot(feet, f, legs, s, felt, leave, land):
    """(place, velocity, acceleration) of a swinging foot, heading axes."""
    z = feet[f].swing
    whole = (1.0 - legs[f].duty) * s.stride
    m = z * z * z * (10.0 + z * (6.0 * z - 15.0))
    m1 = 30.0 * z * z * (1.0 - z) * (1.0 - z) / whole
    m2 = 60.0 * z * (1.0 - z) * (1.0 - 2.0 * z) / (whole * whole)
    dx = land[0] - leave[0]
    dz = land[1] - leave[1]
    x = leave[0] + m * dx
    y, y1, y2 = lift(s, z, whole)
    y += level_at(felt, x)
    free = smooth((z - FREED) / FREE)
    foot = xyz(feet[f].place)
    place = (foot[0] + free * (x - foot[0]), y, foot[2] + free * (leave[1] + m * dz - foot[2]))
    return place, (m1 * dx, y1 + felt[2] * m1 * dx, m1 * dz), (m2 * dx, y2, m2 * dz)
