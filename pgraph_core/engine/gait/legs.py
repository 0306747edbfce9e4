"""Inverse kinematics and joint targets for legs with a hip and three hinges about z.

In swing the paw stays parallel to the thigh, as in a pantograph: the foot is then at e^{iθ} (a +
e^{iκ} b) in the leg's plane, with a = thigh + paw, b the middle segment, θ the hip's angle, κ the
knee's, and -κ the paw's. In stance, the foot does not move, and only motions of the leg that
preserve the foot position are controlled towards the same shape.
"""

import math

from ..compiler import elementary
from ..compiler.elementary import atan2, sine_cosine
from ..compiler.jit import part, sweep
from ..compiler.lane import in_each
from ..compiler.masks import chosen, larger, more, most, smaller

STRAIGHT, FOLDED = 0.99, -0.98  # cosine of the knee's bend: no nearer to either
NEARLY_STRAIGHT = 0.02  # m²: below it the leg is nearly straight, and rates are damped
DAMPED = (NEARLY_STRAIGHT / 6) ** 2  # m⁴: rates are at most three times those at NEARLY_STRAIGHT
FASTEST_HINGE, HARDEST_HINGE = 35.0, 900.0  # rad/s, rad/s²: what is asked of a hinge at most
acos = in_each(elementary.acos)


@part
def turned(angle, x, y):
    s, c = sine_cosine(angle)
    return c * x - s * y, s * x + c * y


@part
def clamp(x, bound):
    return smaller(bound, larger(-bound, x))


@part
def reach(legs, f, x, y):
    """Compute the (hip, knee) angles that bring the foot to (x, y) from the hip, or nearest."""
    ax, ay = legs[f].long[0], legs[f].long[1]
    bx, by = legs[f].shank[0], legs[f].shank[1]
    aa = ax * ax + ay * ay
    bb = bx * bx + by * by
    cosine = (x * x + y * y - aa - bb) / (2.0 * math.sqrt(aa * bb))
    bend = acos(smaller(STRAIGHT, larger(FOLDED, cosine)))
    home = atan2(ax * by - ay * bx, ax * bx + ay * by)
    knee = chosen(more(home, 0.0), bend, -bend) - home
    px, py = turned(knee, bx, by)
    px += ax
    py += ay
    return atan2(px * y - py * x, px * x + py * y), knee


@part
def two_rates(place, b, rate):
    """Compute the hip and knee rates that produce a given foot velocity in the leg's plane."""
    x, y = place
    bx, by = b
    area = x * by - y * bx
    over = chosen(more(NEARLY_STRAIGHT, abs(area)), area / (area * area + DAMPED), 1.0 / area)
    return (rate[0] * bx + rate[1] * by) * over, -(rate[0] * x + rate[1] * y) * over


@part
def out_of_spread(spread, x):
    """Transform a vector from the girdle's axes to those of the leg's plane."""
    y, z = turned(-spread, x[1], x[2])
    return (x[0], y, z)


@sweep
def swing(legs, f, place, speed, push, q, v, s):
    """Compute v' of spread, hip, knee and paw for a leg whose foot target is `place`, relative to
    the hip.

    Position, velocity and acceleration are relative to the girdle, in its axes. If the leg has no
    spreading motion, its v' is not used.
    """
    i = legs[f].q_flex
    j = legs[f].v_flex
    kp = s.gain_swing[0]
    kd = s.gain_swing[1]
    y = place[1]
    aside = y
    if legs[f].v_spread >= 0:
        spread = atan2(-place[2], -place[1])
        y = -math.sqrt(place[1] * place[1] + place[2] * place[2])
        speed = out_of_spread(spread, speed)
        push = out_of_spread(spread, push)
        k = legs[f].v_spread
        aside = kp * (spread - q[legs[f].q_spread]) + kd * (speed[2] / y - v[k])
        aside += push[2] / y
    hip, knee = reach(legs, f, place[0], y)
    b = turned(hip + knee, legs[f].shank[0], legs[f].shank[1])
    hip_rate, knee_rate = two_rates((place[0], y), b, (speed[0], speed[1]))
    hip_push, knee_push = two_rates((place[0], y), b, (push[0], push[1]))
    hip_rate = clamp(hip_rate, FASTEST_HINGE)
    knee_rate = clamp(knee_rate, FASTEST_HINGE)
    bent = clamp(knee_push, HARDEST_HINGE)
    return (
        aside,
        kp * (hip - q[i]) + kd * (hip_rate - v[j]) + clamp(hip_push, HARDEST_HINGE),
        kp * (knee - q[i + 1]) + kd * (knee_rate - v[j + 1]) + bent,
        kp * (-knee - q[i + 2]) + kd * (-knee_rate - v[j + 2]) - bent,
    )


@sweep
def stand(legs, f, q, v, s):
    """Compute v' of hip, knee and paw along the null motion, which keeps the foot in place.

    Towards a pantograph's shape.
    """
    i = legs[f].q_flex
    j = legs[f].v_flex
    bend = q[i] + q[i + 1]
    fx, fy = turned(bend + q[i + 2], legs[f].paw[0], legs[f].paw[1])
    kx, ky = turned(bend, legs[f].shank[0], legs[f].shank[1])
    kx += fx
    ky += fy
    hx, hy = turned(q[i], legs[f].thigh[0], legs[f].thigh[1])
    hx += kx
    hy += ky
    hip = kx * fy - ky * fx  # along the cross product of the foot's two rows of J
    knee = fx * hy - fy * hx
    paw = hx * ky - hy * kx
    size = math.sqrt(hip * hip + knee * knee + paw * paw)
    along = knee + paw
    least = 0.05 * size
    enough = chosen(most(0.0, along), least, -least)
    along = chosen(more(least, abs(along)), enough, along)
    pull = -s.gain_paw[0] * (q[i + 1] + q[i + 2]) - s.gain_paw[1] * (v[j + 1] + v[j + 2])
    return pull * hip / along, pull * knee / along, pull * paw / along
