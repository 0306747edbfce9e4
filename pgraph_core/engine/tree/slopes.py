"""Slopes of τ(q, v, v') of eq. (24) along every freedom, exact to rounding, over lanes.

Kinetic energy is quadratic in where a joint's motion has brought what it carries: along one turn
τ is a trigonometric polynomial of degree two, along one slide a polynomial of degree two, and so it
is in v. A few values far apart then give the slope without any error of truncation.
"""

import math

from ..compiler.elementary import cos, sin
from ..compiler.jit import kernel, part, sweep
from ..compiler.lane import lanes
from ..rows import BALL, TRANSLATE, home_link, kind_of, mass_of, nv_of, q_of, v_of
from ..vec import add_scaled, cross
from .dynamics import newton_euler
from .kinematics import outboard

# Of f with sin θ and sin 2θ as its odd part, f'(0) is (3 (f(a) - f(-a)) - (f(b) - f(-b))) / (2 √3).
TURNS = (math.pi / 3, -math.pi / 3, 2 * math.pi / 3, -2 * math.pi / 3)
WEIGHTS = (0.5 * math.sqrt(3), -0.5 * math.sqrt(3), -0.5 / math.sqrt(3), 0.5 / math.sqrt(3))


@part
def reach(const):
    """The largest link or centre of mass [m], 1 where there is none: how far slides are tried."""
    length = 0.0
    for k in range(1, const.shape[0]):
        for n in range(3):
            length = max(length, abs(home_link(const, k)[n]), abs(mass_of(const, k)[1][n]))
    return length if length > 0.0 else 1.0


@part
def largest_speed(v):
    """The largest speed, at least 1: how far speeds are tried."""
    speed = 1.0
    for j in range(v.shape[0]):
        speed = max(speed, abs(v[j]))
    return speed


@part
def turn(q, i, w, axis, angle):
    """The quaternion at row i of instance w turned about an axis of its parent."""
    c = cos(0.5 * angle)
    s = sin(0.5 * angle)
    e = (s if axis == 0 else 0.0, s if axis == 1 else 0.0, s if axis == 2 else 0.0)
    real = q[i, w]
    u = (q[i + 1, w], q[i + 2, w], q[i + 3, w])
    new = add_scaled(add_scaled(cross(e, u), c, u), real, e)
    q[i, w] = c * real - (e[0] * u[0] + e[1] * u[1] + e[2] * u[2])
    for n in range(3):
        q[i + 1 + n, w] = new[n]


@part
def shift(rows, q, k, c, w, distance):
    """Instance w moved along freedom c of row k."""
    i = q_of(rows, k)
    kind = kind_of(rows, k)
    if kind <= TRANSLATE:
        q[i, w] += distance
    elif kind == BALL:
        turn(q, i, w, c, distance)
    elif c < 3:
        turn(q, i + 3, w, c, distance)
    else:
        q[i + c - 3, w] += distance


@sweep
def collect(rows, const, space, target, weight, count, slopes):
    """τ of all instances, and what the first `count` of them add to the slopes."""
    work, qs, vs, vdots, taus = space
    tau = lanes(taus)
    outboard(rows, const, lanes(work), lanes(qs), lanes(vs))
    newton_euler(rows, const, lanes(vs), lanes(vdots), lanes(work), tau)
    for w in range(count):
        for i in range(taus.shape[0]):
            slopes[target[w], i] += weight[w] * taus[i, w]


@kernel(None)
def torque_slopes(rows, const, q, v, vdot, space, target, weight, slopes):
    """∂τ/∂q into rows 0 to nv - 1 of `slopes` (2 nv, nv; zero at first), ∂τ/∂v into the others.

    `space`: work (n + 1, 64, W), q (nq, W), then v, v' and τ (nv, W); `target` and `weight` (W,).
    """
    work, qs, vs, vdots, taus = space
    length = reach(const)
    speed = largest_speed(v)
    nv = v.shape[0]
    for w in range(target.shape[0]):
        for j in range(nv):
            vdots[j, w] = vdot[j]
        restore(qs, vs, q, v, w)
    w = 0
    for k in range(1, rows.shape[0]):
        kind = kind_of(rows, k)
        for c in range(nv_of(kind)):
            j = v_of(rows, k) + c
            slides = kind == TRANSLATE or c > 2
            for n in range(6):
                if slides and 1 < n < 4:
                    continue
                restore(qs, vs, q, v, w)
                sign = 1.0 if n % 2 == 0 else -1.0
                if n > 3:
                    vs[j, w] += sign * speed
                    weight[w] = 0.5 * sign / speed
                    target[w] = nv + j
                else:
                    shift(rows, qs, k, c, w, sign * length if slides else TURNS[n])
                    weight[w] = 0.5 * sign / length if slides else WEIGHTS[n]
                    target[w] = j
                w += 1
                if w == target.shape[0]:
                    collect(rows, const, space, target, weight, w, slopes)
                    w = 0
    collect(rows, const, space, target, weight, w, slopes)


@part
def restore(qs, vs, q, v, w):
    """The state that slopes are wanted at, as instance w."""
    for i in range(q.shape[0]):
        qs[i, w] = q[i]
    for j in range(v.shape[0]):
        vs[j, w] = v[j]
