"""Rows with one degree of freedom: what follows from the only column of H.

The inertia against the motion is a number, D = Hᵀ U + armature with U = I H
([Featherstone 2008, sec. 7.3]). Responses to wrenches follow from U and 1 / D, as described in
`constraints.paths`.
"""

import math

from ...tolerances import ROUNDING
from ..compiler.jit import part
from ..compiler.lane import beyond, store_triple
from ..rows import (
    add_bias,
    armature_of,
    bias_of,
    coriolis_of,
    inertia_of,
    inverse_pivot_of,
    left_of,
    link_of,
    parent_of,
    projected_of,
    set_inverse_pivot,
    set_left,
    set_projected,
    traces_of,
    v_of,
)
from ..vec import add, add_cross, add_outer, add_outer9, add_scaled, dot, mul, mul_t, scale, sym_mul
from .contract import Motion, question
from .curve import CURVE, WIRE
from .hinge import HINGE
from .inertia import add_inertia_to, vanishes
from .screw import SCREW
from .slider import SLIDER
from .state import STATE
from .wrenches import any_number

SINGLES = (HINGE, SCREW, SLIDER, CURVE, WIRE, STATE)


def _asked(name):
    """Return a function of (rows, work, k, ...) that asks the kind of a row with one freedom."""
    return question({one.number: getattr(one, name) for one in SINGLES})


_column, along, size, _through = (_asked(x) for x in ("column", "along", "size", "through"))
_unit_wrench, _add_motion = _asked("unit_wrench"), _asked("add_motion")


@part
def column(rows, work, k, const, c):
    return _column(rows, work, k)


@part
def unit_wrench(rows, work, k, const, c):
    return _unit_wrench(rows, work, k)


@part
def add_motion(rows, work, k, const, x, alpha, linear):
    return _add_motion(rows, work, k, x[v_of(rows, k)], alpha, linear)


@part
def project(rows, work, k, const, moment, force, out):
    out[v_of(rows, k)] = along(rows, work, k, moment, force)


@part
def condense(rows, work, k, const):
    """Add the inertia I - U Uᵀ / D to the parent [Featherstone 2008, eq. (7.23)]. Kept: U, 1 / D.

    I has the blocks j, b, bᵀ, m.
    """
    j, b, m = inertia_of(work, k)
    u0, u1, against = _through(rows, work, k, j, b, m)
    d = 1.0 / (against + armature_of(const, k))
    set_projected(work, k, u0, u1)
    set_inverse_pivot(work, k, d)
    p = parent_of(rows, k)
    if p == 0:
        return
    x0, x1 = scale(-d, u0), scale(-d, u1)
    j, b, m = add_outer(j, x0, u0), add_outer9(b, x0, u1), add_outer(m, x1, u1)
    add_inertia_to(work, p, link_of(work, k), j, b, m)


@part
def relay(rows, work, k, const, tau):
    """Add the force p + I a + U u' / D to the parent, with u' = τ - Hᵀ p - Uᵀ a.

    [Featherstone 2008, eq. (7.24)], with the bias p = (moment, force). Kept: τ - Hᵀ p.
    """
    j, b, m = inertia_of(work, k)
    moment, force = bias_of(work, k)
    left = tau[v_of(rows, k)] - along(rows, work, k, moment, force)
    set_left(work, k, left)
    p = parent_of(rows, k)
    if p == 0:
        return
    u0, u1 = projected_of(work, k)
    a0, a1 = coriolis_of(work, k)
    s = inverse_pivot_of(work, k) * (left - dot(u0, a0) - dot(u1, a1))
    moment = add_scaled(add(add(moment, sym_mul(j, a0)), mul(b, a1)), s, u0)
    force = add_scaled(add(add(force, mul_t(b, a0)), sym_mul(m, a1)), s, u1)
    add_bias(work, p, add_cross(moment, link_of(work, k), force), force)


@part
def solve(rows, work, k, const, alpha, linear, vdot):
    u0, u1 = projected_of(work, k)
    rate = inverse_pivot_of(work, k) * (left_of(work, k) - dot(u0, alpha) - dot(u1, linear))
    vdot[v_of(rows, k)] = rate
    return _add_motion(rows, work, k, rate, alpha, linear)


@part
def is_singular(rows, work, k):
    angular, linear = traces_of(work, k)
    root = size(rows, work, k, math.sqrt(angular), math.sqrt(linear))
    return vanishes(root * root, inverse_pivot_of(work, k))


@part
def diagonal(rows, work, k, dinv):
    dinv[v_of(rows, k)] = inverse_pivot_of(work, k)


@part
def restore(rows, work, k):
    """Do nothing, since the inertia stays where it is."""


@part
def past(rows, work, k, moment, force, reach, y, i, slot):
    least = ROUNDING * size(rows, work, k, reach, 1.0 + 0.0 * reach)
    share = beyond(along(rows, work, k, moment, force), least)
    store_triple(y, i, 3 * slot, share)
    passed = -inverse_pivot_of(work, k) * share
    u0, u1 = projected_of(work, k)
    force = add_scaled(force, passed, u1)
    moment = add_cross(add_scaled(moment, passed, u0), link_of(work, k), force)
    return any_number(share), moment, force


@part
def mobility(rows, work, k, moment, force):
    share = along(rows, work, k, moment, force)
    passed = inverse_pivot_of(work, k) * share
    u0, u1 = projected_of(work, k)
    force = add_scaled(force, -passed, u1)
    moment = add_cross(add_scaled(moment, -passed, u0), link_of(work, k), force)
    return passed * share, moment, force


@part
def respond(rows, work, k, const, step, alpha, linear):
    i = v_of(rows, k)
    u0, u1 = projected_of(work, k)
    x = step[i] - inverse_pivot_of(work, k) * (dot(u0, alpha) + dot(u1, linear))
    step[i] = x
    return _add_motion(rows, work, k, x, alpha, linear)


@part
def gather(rows, work, k, const, speeds, alpha, linear):
    i = v_of(rows, k)
    u0, u1 = projected_of(work, k)
    x = speeds[i]
    speeds[i] = x + inverse_pivot_of(work, k) * (dot(u0, alpha) + dot(u1, linear))
    return _add_motion(rows, work, k, x, alpha, linear)


MOTIONS_OF_ONE = tuple(
    Motion(
        number=one.number,
        coordinates=1,
        freedoms=1,
        attitude=False,
        angle=one.angle,
        turns=one.turns,
        travels=one.travels,
        bends=one.bends,
        transmits=True,
        inert=one.inert,
        place=one.place,
        set_rates=one.set_rates,
        column=column,
        unit_wrench=unit_wrench,
        slopes=one.slopes,
        add_motion=add_motion,
        project=project,
        condense=condense,
        relay=relay,
        solve=solve,
        is_singular=is_singular,
        diagonal=diagonal,
        restore=restore,
        past=past,
        mobility=mobility,
        respond=respond,
        gather=gather,
    )
    for one in SINGLES
)
