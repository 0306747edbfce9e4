"""Hill's muscle: a contractile fibre at an angle to a tendon, in kernel form.

All lengths of the fibre are in its optimal length, forces in the largest isometric force, and
speeds in the largest speed of shortening. With the activation a, the length l and speed v of the
fibre, and the pennation angle α, the forces along the tendon are

    (a f_l(l) f_v(v / s) + f_p(l) + β v) cos α = f_t(tendon length / slack length)

[Zajac 1989; Millard et al. 2013, eqs. 1 to 10]. The width l sin α of the muscle is constant, and s
= s0 + s1 a is the speed at which the active force ends. The curves f_l, f_p, f_v and f_t are in
pieces of polynomials, and linear beyond their ends.

The fibre of an elastic tendon is a state. Its speed solves the equation above, whose left side
increases with v. A rigid tendon has its slack length, and the length of the path determines the
fibre.
"""

import math

from ..engine import layout as at
from ..engine.compiler.jit import kernel, part, sweep
from ..engine.compiler.kinds import F2, array_of, f8
from ..engine.compiler.masks import larger
from ..engine.pieces import located, polynomial
from ..engine.records import INTEGER, REAL
from ..tolerances import EPS
from .base import row

COLUMNS = at.PIECE_RATE + 1
ACTIVATION, FIBRE, RATE = range(3)  # columns of the first knot: two states, and l' [1/s]
NEWTON_STEPS = 60  # a speed is found in about six, and in more where a curve is nearly flat
HALVINGS = 64  # halvings of an interval of lengths until its ends are adjacent numbers

ROW = row(
    point_a=(REAL, 3),
    point_b=(REAL, 3),
    f_max=REAL,  # [N]
    l_opt=REAL,  # [m]
    l_slack=REAL,  # [m]
    width=REAL,  # width of the muscle over l_opt
    least=REAL,  # length of the fibre over l_opt
    fastest=REAL,  # speed over l_opt [1/s]
    damping=REAL,  # β
    speed=(REAL, 2),  # s0, s1
    rigid=INTEGER,
    pieces=(INTEGER, 4),  # pieces of f_l, f_p, f_v and f_t, whose knots follow the first
)
ACTIVE, PASSIVE, VELOCITY, TENDON = range(4)


@part
def first_piece(one, curve):
    """Return the knot at which a curve begins."""
    first = one.first_knot + 1
    for n in range(curve):
        first += one.pieces[n] + 1
    return first


@part
def curve_at(one, knots, curve, x):
    """Return (value, slope) of a curve."""
    first, count = first_piece(one, curve), one.pieces[curve]
    i, s, beyond, _ = located(knots, first, count, 1.0, at.PIECE_RATE, x)
    value, slope, _, _ = polynomial(knots, i, s, beyond, at.PIECE_POWERS, 1)
    return value, slope


@part
def along_tendon(one, fibre):
    """Return (length of the fibre along the tendon, cos α)."""
    along = math.sqrt(larger(fibre * fibre - one.width * one.width, 0.0))
    return along, along / fibre


@part
def tendon_force(one, knots, length, along):
    """Return f_t for the length of the path [m]."""
    force, _ = curve_at(one, knots, TENDON, (length - one.l_opt * along) / one.l_slack)
    return force


@sweep
def fibre_speed(one, knots, active, s, rest):
    """Return v with active f_v(v / s) + β v = rest.

    f_v bends downwards for v > 0 and upwards for v < 0, so that Newton's method from 0 does not
    pass the solution.
    """
    v = 0.0 * rest
    for _ in range(NEWTON_STEPS):
        force, slope = curve_at(one, knots, VELOCITY, v / s)
        step = (rest - active * force - one.damping * v) / (active * slope / s + one.damping)
        v += step
        if abs(step) <= 2.0 * EPS * (1.0 + abs(v)):
            break
    return v


@part
def unbalanced(one, knots, a, length, fibre):
    """Return by how much the fibre at rest pulls more than the tendon."""
    along, cosine = along_tendon(one, fibre)
    active, _ = curve_at(one, knots, ACTIVE, fibre)
    passive, _ = curve_at(one, knots, PASSIVE, fibre)
    at_rest, _ = curve_at(one, knots, VELOCITY, 0.0 * fibre)
    return cosine * (a * active * at_rest + passive) - tendon_force(one, knots, length, along)


@sweep
def fibre_at_rest(one, knots, a, length):
    """Return the length of a fibre at rest in equilibrium with its tendon."""
    slack = larger((length - one.l_slack) / one.l_opt, 0.0)
    low, high = one.least, larger(math.sqrt(slack * slack + one.width * one.width), one.least)
    for _ in range(HALVINGS):
        middle = 0.5 * (low + high)
        if unbalanced(one, knots, a, length, middle) > 0.0:
            high = middle
        else:
            low = middle
    return 0.5 * (low + high)


@kernel(f8(array_of(ROW), F2, f8, f8), later=True)
def equilibrium(table, knots, a, length):
    """`fibre_at_rest` of the first muscle in a table."""
    return fibre_at_rest(table[0], knots, a, length)


@part
def pull_of_rigid(one, knots, a, length, rate):
    """Return the tension of a muscle whose tendon is rigid, and write l and l'."""
    along = (length - one.l_slack) / one.l_opt
    buckled = along < 0.0
    along = larger(along, math.sqrt(larger(one.least * one.least - one.width * one.width, 0.0)))
    fibre = math.sqrt(along * along + one.width * one.width)
    change = rate / one.l_opt * along / fibre
    knots[one.first_knot, FIBRE] = fibre
    knots[one.first_knot, RATE] = change
    if buckled:
        return 0.0 * length
    v = change / one.fastest
    active, _ = curve_at(one, knots, ACTIVE, fibre)
    passive, _ = curve_at(one, knots, PASSIVE, fibre)
    faster, _ = curve_at(one, knots, VELOCITY, v / (one.speed[0] + one.speed[1] * a))
    force = a * active * faster + passive + one.damping * v
    return one.f_max * larger(force, 0.0) * along / fibre


@kernel(f8(array_of(ROW), F2, f8, f8, f8), later=True)
def tension_of_rigid(table, knots, a, length, rate):
    """`pull_of_rigid` of the first muscle in a table."""
    return pull_of_rigid(table[0], knots, a, length, rate)


@part
def pull_of_elastic(one, knots, a, length):
    """Return the tension of the tendon, and write l'."""
    fibre = knots[one.first_knot, FIBRE]
    if fibre != fibre:  # a run begins in equilibrium
        fibre = fibre_at_rest(one, knots, a, length)
        knots[one.first_knot, FIBRE] = fibre
    short = fibre <= one.least
    fibre = larger(fibre, one.least)
    along, cosine = along_tendon(one, fibre)
    force = tendon_force(one, knots, length, along)
    active, _ = curve_at(one, knots, ACTIVE, fibre)
    passive, _ = curve_at(one, knots, PASSIVE, fibre)
    s = one.speed[0] + one.speed[1] * a
    change = one.fastest * fibre_speed(one, knots, a * active, s, force / cosine - passive)
    if short:
        change = larger(change, 0.0)
    knots[one.first_knot, RATE] = change
    return one.f_max * force


@part
def pull(one, knots, length, rate, t):
    """Compute the tension, whose power is put into the motion."""
    a = knots[one.first_knot, ACTIVATION]
    if one.rigid:
        tension = pull_of_rigid(one, knots, a, length, rate)
    else:
        tension = pull_of_elastic(one, knots, a, length)
    return tension, -tension * rate, 0.0 * tension


@part
def energy(one, knots, length):
    """Return no energy: that of the springs in a muscle is counted as work."""
    return 0.0 * length
