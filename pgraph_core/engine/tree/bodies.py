"""Poses, velocities, accelerations and joint forces of all bodies, including welded ones."""

from .. import layout as at
from ..compiler.jit import kernel, part, sweep
from ..compiler.kinds import F1, F2, F3, I2, read, void
from ..rows import (
    acceleration_of,
    body_mass_of,
    carrier_of,
    gravity_of,
    home_of,
    offset_of,
    origin_of,
    parent_of,
    rotation_of,
    set_velocity,
    spin_of,
    velocity_of,
)
from ..vec import (
    about_origin,
    add,
    add_cross,
    cross,
    load,
    mat_mul,
    mul,
    rotate_sym,
    scale,
    store,
    store9,
    sub,
    sym_mul,
)
from .kinematics import accelerate, linear_velocity, outboard, positions

TREE = I2, F2, I2, F2


@kernel(void(*TREE, read(F1), read(F1), F2, F2, F2))
def poses(rows, const, bodies_i, bodies_f, q, v, work, position, rotation):
    """Compute the origins (nb, 3) and rotations (nb, 9) of all bodies for `v` = 0."""
    outboard(rows, const, work, q, v)
    positions(rows, work)
    for b in range(1, bodies_i.shape[0]):
        place(work, bodies_i, bodies_f, b, position, rotation)


@part
def place(work, bodies_i, bodies_f, b, position, rotation):
    """Return the origin and rotation of body b."""
    k = carrier_of(bodies_i, b)
    r = rotation_of(work, k)
    store(position, b - 1, 0, add(origin_of(work, k), mul(r, offset_of(bodies_f, b))))
    store9(rotation, b - 1, 0, mat_mul(r, home_of(bodies_f, b)))


@kernel(void(*TREE, *[read(F2)] * 3, read(F3), F2, *[F3] * 5), nogil=True)
def motion_and_forces(
    rows,
    const,
    bodies_i,
    bodies_f,
    qs,
    vs,
    vdots,
    external,
    work,
    position,
    rotation,
    velocity,
    acceleration,
    force,
):
    """Compute poses, velocities, accelerations (6,) and joint forces (6,) of bodies over all
    frames.

    Everything in world axes at the bodies' origins; `external` are the wrenches on the bodies.
    """
    for i in range(qs.shape[0]):
        outboard(rows, const, work, qs[i], vs[i])
        positions(rows, work)
        for k in range(1, rows.shape[0]):
            before = velocity_of(work, parent_of(rows, k))
            set_velocity(work, k, linear_velocity(rows, const, work, vs[i], k, before))
        accelerate(rows, const, work, vs[i], vdots[i])
        for b in range(1, bodies_i.shape[0]):
            place(work, bodies_i, bodies_f, b, position[i], rotation[i])
            move_body(work, bodies_i, bodies_f, b, velocity[i], acceleration[i])
            load_body(work, bodies_i, bodies_f, b, acceleration[i], external[i], force[i])
        gather(bodies_i, position[i], force[i])
        gravity = gravity_of(const)
        for b in range(acceleration.shape[1]):  # base acceleration -g taken off again (R7)
            store(acceleration[i], b, 3, add(load(acceleration[i], b, 3), gravity))


@part
def move_body(work, bodies_i, bodies_f, b, velocity, acceleration):
    """Compute V and V' of body b, given V and V' of its row."""
    k = carrier_of(bodies_i, b)
    offset = mul(rotation_of(work, k), offset_of(bodies_f, b))
    w = spin_of(work, k)
    alpha, linear = acceleration_of(work, k)
    store(velocity, b - 1, 0, w)
    store(velocity, b - 1, 3, add_cross(velocity_of(work, k), w, offset))
    linear = add_cross(linear, alpha, offset)
    store(acceleration, b - 1, 0, alpha)
    store(acceleration, b - 1, 3, add(linear, cross(w, cross(w, offset))))


@part
def load_body(work, bodies_i, bodies_f, b, acceleration, external, force):
    """Return M V' + b - external for body b, eq. (12), the load on its joint and its children."""
    k = carrier_of(bodies_i, b)
    r = rotation_of(work, k)
    w = spin_of(work, k)
    m, com, central = body_mass_of(bodies_f, b)
    c = mul(r, com)
    inertia = about_origin(rotate_sym(r, central), m, c)
    alpha = load(acceleration, b - 1, 0)
    linear = load(acceleration, b - 1, 3)
    mc = scale(m, c)
    moment = add_cross(add_cross(sym_mul(inertia, alpha), mc, linear), w, sym_mul(inertia, w))
    pull = add(add_cross(scale(m, linear), alpha, mc), cross(w, cross(w, mc)))
    store(force, b - 1, 0, sub(moment, load(external, b - 1, 0)))
    store(force, b - 1, 3, sub(pull, load(external, b - 1, 3)))


@sweep
def gather(bodies_i, position, force):
    """Accumulate F_p += φᵀ F, eq. (12), tips to root: the full force in every joint (B18)."""
    for b in range(bodies_i.shape[0] - 1, 0, -1):
        p = bodies_i[b, at.BODY_PARENT]
        if p > 0:
            link = sub(load(position, b - 1, 0), load(position, p - 1, 0))
            pull = load(force, b - 1, 3)
            moment = add_cross(load(force, b - 1, 0), link, pull)
            store(force, p - 1, 0, add(load(force, p - 1, 0), moment))
            store(force, p - 1, 3, add(load(force, p - 1, 3), pull))
