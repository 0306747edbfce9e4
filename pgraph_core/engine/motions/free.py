"""Free: every velocity relative to the parent row, H = 1.

The inertia against the motion is D = I + a with the armature a, which the model has only if the
parent is at rest. Otherwise the joint transmits only its own force, so the parent feels nothing of
the row's inertia.
"""

from .. import layout as at
from ..compiler.jit import part
from ..compiler.lane import store_triple
from ..linear import (
    add_diagonal6,
    backward6,
    diagonal6,
    factor6,
    forward6,
    forward_free,
    pivots6,
    restore6,
    transposed6,
)
from ..rows import (
    add_bias,
    added_of,
    armature_of,
    bias_of,
    home_base,
    home_link,
    link_of,
    parent_of,
    q_of,
    rotation_of,
    set_added,
    set_coriolis,
    set_link,
    set_rotation,
    set_solved,
    set_spin,
    solved_of,
    spin_of,
    v_of,
)
from ..vec import add, add_cross, add_scaled, cross, dot, load3, mul, mul_t, scale, store3, sub
from .attitude import axis_from, base_axes, turned
from .contract import Motion, straight
from .inertia import vanishes
from .wrenches import no_triples


@part
def place(rows, work, k, const, q):
    i, r = q_of(rows, k), rotation_of(work, parent_of(rows, k))
    axes = base_axes(rows, work, k, const)
    set_rotation(work, k, turned(q, i + 3, r, home_base(const, k)))
    set_link(work, k, add(mul(r, home_link(const, k)), mul(axes, load3(q, i))))


@part
def set_rates(rows, work, k, const, v):
    j, w = v_of(rows, k), spin_of(work, parent_of(rows, k))
    axes = base_axes(rows, work, k, const)
    relative = mul(axes, load3(v, j))
    slide = scale(2.0, mul(axes, load3(v, j + 3)))
    set_spin(work, k, add(w, relative))
    around = add_cross(slide, w, link_of(work, k))
    set_coriolis(work, k, cross(w, relative), cross(w, around))


@part
def column(rows, work, k, const, c):
    axis = axis_from(base_axes(rows, work, k, const), c % 3)
    zero = scale(0.0, axis)
    if c < 3:
        return axis, zero
    return zero, axis


@part
def add_motion(rows, work, k, const, x, alpha, linear):
    j = v_of(rows, k)
    axes = base_axes(rows, work, k, const)
    return add(alpha, mul(axes, load3(x, j))), add(linear, mul(axes, load3(x, j + 3)))


@part
def project(rows, work, k, const, moment, force, out):
    j = v_of(rows, k)
    axes = base_axes(rows, work, k, const)
    store3(out, j, mul_t(axes, moment))
    store3(out, j + 3, mul_t(axes, force))


@part
def condense(rows, work, k, const):
    """Factor the 6x6 inertia D in place. The parent feels nothing of it. Kept: a."""
    set_added(work, k, armature_of(const, k))
    add_diagonal6(work, k, added_of(work, k))
    factor6(work, k)


@part
def relay(rows, work, k, const, tau):
    """Add the joint force to the parent. Kept: τ - p."""
    j, p = v_of(rows, k), parent_of(rows, k)
    axes = base_axes(rows, work, k, const)
    moment, force = mul(axes, load3(tau, j)), mul(axes, load3(tau, j + 3))
    if p > 0:
        add_bias(work, p, add_cross(moment, link_of(work, k), force), force)
    moment_b, force_b = bias_of(work, k)
    set_solved(work, k, sub(moment, moment_b), sub(force, force_b))


@part
def solve(rows, work, k, const, alpha, linear, vdot):
    """Compute v' = D⁻¹ (u + a V'_parent) - V'_parent, and overwrite the solution with V'."""
    angular, along = solved_of(work, k)
    a = added_of(work, k)
    set_solved(work, k, add_scaled(angular, a, alpha), add_scaled(along, a, linear))
    forward6(work, k)
    diagonal6(work, k)
    backward6(work, k)
    return relative_to(rows, work, k, const, alpha, linear, vdot)


@part
def relative_to(rows, work, k, const, alpha, linear, out):
    """Write the solution less (alpha, linear) into `out`, in the axes of v. Returns the former."""
    j = v_of(rows, k)
    axes = base_axes(rows, work, k, const)
    angular, along = solved_of(work, k)
    store3(out, j, mul_t(axes, sub(angular, alpha)))
    store3(out, j + 3, mul_t(axes, sub(along, linear)))
    return angular, along


@part
def is_singular(rows, work, k):
    """Compare the pivots with each other, since the factor stands where the inertia was."""
    a, b = pivots6(work, k)
    angular = 1.0 / a[0] + 1.0 / a[1] + 1.0 / a[2]
    linear = 1.0 / b[0] + 1.0 / b[1] + 1.0 / b[2]
    turns = vanishes(angular, a[0]) or vanishes(angular, a[1]) or vanishes(angular, a[2])
    return turns or vanishes(linear, b[0]) or vanishes(linear, b[1]) or vanishes(linear, b[2])


@part
def diagonal(rows, work, k, dinv):
    angular, linear = pivots6(work, k)
    store3(dinv, v_of(rows, k), angular)
    store3(dinv, v_of(rows, k) + 3, linear)


@part
def restore(rows, work, k):
    restore6(work, k)
    add_diagonal6(work, k, -added_of(work, k))


@part
def past(rows, work, k, moment, force, reach, y, i, slot):
    """Store L⁻¹ applied to the wrenches. No other joint feels them."""
    share = forward_free(work, k, moment, force)
    for n in range(6):
        store_triple(y, i, 3 * (slot + n), share[n])
    return True, no_triples(), no_triples()


@part
def mobility(rows, work, k, moment, force):
    set_solved(work, k, moment, force)
    forward6(work, k)
    diagonal6(work, k)
    backward6(work, k)
    turn, slide = solved_of(work, k)
    return dot(moment, turn) + dot(force, slide), moment, force


@part
def respond(rows, work, k, const, step, alpha, linear):
    j = v_of(rows, k)
    set_solved(work, k, load3(step, j), load3(step, j + 3))
    backward6(work, k)
    return relative_to(rows, work, k, const, alpha, linear, step)


@part
def gather(rows, work, k, const, speeds, alpha, linear):
    j = v_of(rows, k)
    alpha, linear = add_motion(rows, work, k, const, speeds, alpha, linear)
    store3(speeds, j, alpha)
    store3(speeds, j + 3, linear)
    transposed6(work, k, speeds, j)
    return alpha, linear


FREE = Motion(
    number=at.FREE,
    coordinates=7,
    freedoms=6,
    attitude=True,
    angle=False,
    turns=False,
    travels=True,
    bends=False,
    transmits=False,
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
