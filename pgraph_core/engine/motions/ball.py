"""Ball: a rotation about a point fixed in the parent row, H = (1, 0).

The joint transmits its own torque and a force, so the parent feels the inertia m - bᵀ j⁻¹ b alone.
"""

from ...tolerances import ROUNDING
from .. import layout as at
from ..compiler.jit import part
from ..compiler.lane import beyond, store_triple
from ..linear import backward3, factor3, forward3, solve3
from ..rows import (
    add_bias,
    ball_of,
    bias_of,
    coriolis_of,
    home_base,
    home_link,
    inertia_of,
    link_of,
    parent_of,
    q_of,
    rotation_of,
    set_ball_left,
    set_coriolis,
    set_factor,
    set_link,
    set_rotation,
    set_spin,
    spin_of,
    traces_of,
    v_of,
)
from ..vec import (
    add,
    add_cross,
    columns_of,
    cross,
    dot,
    load3,
    mul,
    mul_t,
    scale,
    store3,
    sub,
    sym_mul,
)
from .attitude import axis_from, base_axes, turned
from .contract import Motion, straight
from .inertia import add_inertia_to, vanishes
from .wrenches import any_number


@part
def place(rows, work, k, const, q):
    r = rotation_of(work, parent_of(rows, k))
    set_rotation(work, k, turned(q, q_of(rows, k), r, home_base(const, k)))
    set_link(work, k, mul(r, home_link(const, k)))


@part
def set_rates(rows, work, k, const, v):
    w = spin_of(work, parent_of(rows, k))
    relative = mul(base_axes(rows, work, k, const), load3(v, v_of(rows, k)))
    set_spin(work, k, add(w, relative))
    set_coriolis(work, k, cross(w, relative), cross(w, cross(w, link_of(work, k))))


@part
def column(rows, work, k, const, c):
    axis = axis_from(base_axes(rows, work, k, const), c)
    return axis, scale(0.0, axis)


@part
def add_motion(rows, work, k, const, x, alpha, linear):
    axes = base_axes(rows, work, k, const)
    return add(alpha, mul(axes, load3(x, v_of(rows, k)))), linear


@part
def project(rows, work, k, const, moment, force, out):
    store3(out, v_of(rows, k), mul_t(base_axes(rows, work, k, const), moment))


@part
def condense(rows, work, k, const):
    """Add the inertia m - bᵀ j⁻¹ b to the parent. Kept: the factor of j."""
    j, b, m = inertia_of(work, k)
    f = factor3(j)
    set_factor(work, k, f)
    p = parent_of(rows, k)
    if p == 0:
        return
    c0, c1, c2 = columns_of(b)
    x0, x1, x2 = solve3(f, c0), solve3(f, c1), solve3(f, c2)
    m = (
        m[0] - dot(c0, x0),
        m[1] - dot(c1, x1),
        m[2] - dot(c2, x2),
        m[3] - dot(c0, x1),
        m[4] - dot(c0, x2),
        m[5] - dot(c1, x2),
    )
    zero = 0.0 * m[0]
    none = (zero, zero, zero, zero, zero, zero)
    coupling = (zero, zero, zero, zero, zero, zero, zero, zero, zero)
    add_inertia_to(work, p, link_of(work, k), none, coupling, m)


@part
def relay(rows, work, k, const, tau):
    """Add the joint torque, and the force of the rest, to the parent. Kept: τ - p."""
    _, b, m = inertia_of(work, k)
    moment, force = bias_of(work, k)
    torque = mul(base_axes(rows, work, k, const), load3(tau, v_of(rows, k)))
    left = sub(torque, moment)
    set_ball_left(work, k, left)
    p = parent_of(rows, k)
    if p == 0:
        return
    # the joint's angular acceleration takes up what its torque does not
    f, _ = ball_of(work, k)
    a = coriolis_of(work, k)[1]
    turn = solve3(f, sub(left, mul(b, a)))
    force = add(force, add(sym_mul(m, a), mul_t(b, turn)))
    add_bias(work, p, add_cross(torque, link_of(work, k), force), force)


@part
def solve(rows, work, k, const, alpha, linear, vdot):
    """Compute v' = j⁻¹ (u - b V'_linear) less the parent's angular acceleration."""
    _, b, _ = inertia_of(work, k)
    f, left = ball_of(work, k)
    total = solve3(f, sub(left, mul(b, linear)))
    store3(vdot, v_of(rows, k), mul_t(base_axes(rows, work, k, const), sub(total, alpha)))
    return total, linear


@part
def is_singular(rows, work, k):
    f, _ = ball_of(work, k)
    angular, _ = traces_of(work, k)
    return vanishes(angular, f[0]) or vanishes(angular, f[1]) or vanishes(angular, f[2])


@part
def diagonal(rows, work, k, dinv):
    f, _ = ball_of(work, k)
    store3(dinv, v_of(rows, k), (f[0], f[1], f[2]))


@part
def restore(rows, work, k):
    """Do nothing, since the inertia stays where it is."""


@part
def past(rows, work, k, moment, force, reach, y, i, slot):
    least = ROUNDING * reach
    moment = (beyond(moment[0], least), beyond(moment[1], least), beyond(moment[2], least))
    felt = any_number(moment[0]) or any_number(moment[1]) or any_number(moment[2])
    _, b, _ = inertia_of(work, k)
    f, _ = ball_of(work, k)
    share = forward3(f, moment)
    for n in range(3):
        store_triple(y, i, 3 * (slot + n), share[n])
    force = sub(force, mul_t(b, solve3(f, moment)))
    return felt, cross(link_of(work, k), force), force


@part
def mobility(rows, work, k, moment, force):
    f, _ = ball_of(work, k)
    _, b, _ = inertia_of(work, k)
    turn = solve3(f, moment)
    taken = dot(moment, turn)
    force = sub(force, mul_t(b, turn))
    return taken, cross(link_of(work, k), force), force


@part
def respond(rows, work, k, const, step, alpha, linear):
    i = v_of(rows, k)
    _, b, _ = inertia_of(work, k)
    f, _ = ball_of(work, k)
    turned_by = sub(backward3(f, load3(step, i)), solve3(f, mul(b, linear)))
    store3(step, i, mul_t(base_axes(rows, work, k, const), sub(turned_by, alpha)))
    return turned_by, linear


@part
def gather(rows, work, k, const, speeds, alpha, linear):
    i = v_of(rows, k)
    _, b, _ = inertia_of(work, k)
    f, _ = ball_of(work, k)
    alpha = add(mul(base_axes(rows, work, k, const), load3(speeds, i)), alpha)
    x = add(alpha, solve3(f, mul(b, linear)))
    store3(speeds, i, (x[0] + f[3] * x[1] + f[4] * x[2], x[1] + f[5] * x[2], x[2]))
    return alpha, linear


BALL = Motion(
    number=at.BALL,
    coordinates=4,
    freedoms=3,
    attitude=True,
    angle=False,
    turns=False,
    travels=False,
    bends=False,
    transmits=True,
    inert=False,
    place=place,
    set_rates=set_rates,
    column=column,
    slopes=straight,
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
