"""Ball: a rotation about a point fixed in the parent row, H = (1, 0).

The inertia against the motion is D = j + a with the armature a. Without armature, the joint
transmits its own torque and a force alone, so the parent feels the inertia m - bᵀ j⁻¹ b.
"""

from ...tolerances import ROUNDING
from .. import layout as at
from ..compiler.jit import part
from ..compiler.lane import beyond, store_triple
from ..linear import backward3, factor3, forward3, solve3
from ..rows import (
    add_bias,
    added_of,
    armature_of,
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
    set_added,
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
    add_scaled,
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
    transpose,
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
    """Add the inertia I - U D⁻¹ Uᵀ = [a D⁻¹ j, a D⁻¹ b; ., m - bᵀ D⁻¹ b] with U = (j, bᵀ) to the
    parent [Featherstone 2008, eq. (7.23)]. Kept: the factor of D, and a."""
    j, b, m = inertia_of(work, k)
    a = armature_of(const, k)
    f = factor3((j[0] + a, j[1] + a, j[2] + a, j[3], j[4], j[5]))
    set_factor(work, k, f)
    set_added(work, k, a)
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
    y0, y1, y2 = (
        solve3(f, (j[0], j[3], j[4])),
        solve3(f, (j[3], j[1], j[5])),
        solve3(f, (j[4], j[5], j[2])),
    )
    j = (a * y0[0], a * y1[1], a * y2[2], a * y1[0], a * y2[0], a * y2[1])
    b = transpose(scale(a, x0) + scale(a, x1) + scale(a, x2))
    add_inertia_to(work, p, link_of(work, k), j, b, m)


@part
def relay(rows, work, k, const, tau):
    """Add the joint torque less what turns the armature, and the force of the rest, to the parent.
    Kept: τ - p."""
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
    a0, a1 = coriolis_of(work, k)
    turn = turned_by(work, k, left, a0, a1)
    torque = add_scaled(torque, -added_of(work, k), sub(turn, a0))
    force = add(force, add(sym_mul(m, a1), mul_t(b, turn)))
    add_bias(work, p, add_cross(torque, link_of(work, k), force), force)


@part
def turned_by(work, k, left, alpha, linear):
    """Return the angular acceleration D⁻¹ (u + a α - b V'_linear) for that of the parent, α."""
    _, b, _ = inertia_of(work, k)
    f, _ = ball_of(work, k)
    return solve3(f, sub(add_scaled(left, added_of(work, k), alpha), mul(b, linear)))


@part
def solve(rows, work, k, const, alpha, linear, vdot):
    """Compute v', the angular acceleration less that of the parent."""
    total = turned_by(work, k, ball_of(work, k)[1], alpha, linear)
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
    turn = solve3(f, moment)
    force = sub(force, mul_t(b, turn))
    moment = add_cross(scale(added_of(work, k), turn), link_of(work, k), force)
    return felt, moment, force


@part
def mobility(rows, work, k, moment, force):
    f, _ = ball_of(work, k)
    _, b, _ = inertia_of(work, k)
    turn = solve3(f, moment)
    taken = dot(moment, turn)
    force = sub(force, mul_t(b, turn))
    moment = add_cross(scale(added_of(work, k), turn), link_of(work, k), force)
    return taken, moment, force


@part
def respond(rows, work, k, const, step, alpha, linear):
    i = v_of(rows, k)
    _, b, _ = inertia_of(work, k)
    f, _ = ball_of(work, k)
    carried = add_scaled(mul(b, linear), -added_of(work, k), alpha)
    total = sub(backward3(f, load3(step, i)), solve3(f, carried))
    store3(step, i, mul_t(base_axes(rows, work, k, const), sub(total, alpha)))
    return total, linear


@part
def gather(rows, work, k, const, speeds, alpha, linear):
    i = v_of(rows, k)
    _, b, _ = inertia_of(work, k)
    f, _ = ball_of(work, k)
    carried = add_scaled(mul(b, linear), -added_of(work, k), alpha)
    alpha = add(mul(base_axes(rows, work, k, const), load3(speeds, i)), alpha)
    x = add(alpha, solve3(f, carried))
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
    unit_wrench=column,
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
