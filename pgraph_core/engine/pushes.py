"""Wrenches at points onto rows of the tree and onto bodies."""

from .compiler.jit import part
from .rows import add_bias, carrier_of, offset_of, origin_of, rotation_of
from .vec import accumulate, add, add_cross, mul, scale, sub


@part
def apply(work, k, p, torque, force):
    """Subtract a wrench at p on row k from the bias force P, unless k is the ground."""
    if k > 0:
        arm = sub(p, origin_of(work, k))
        add_bias(work, k, scale(-1.0, add_cross(torque, arm, force)), scale(-1.0, force))


@part
def onto_row(work, k, body, p, torque, force):
    """Subtract a wrench at p from the bias force of row k."""
    apply(work, k, p, torque, force)


@part
def onto_body(to, k, b, p, torque, force):
    """Add a wrench at p to the wrench on body b at its origin, or to a row behind the tree."""
    bodies_i, bodies_f, work, rows, external = to
    if k >= rows:
        apply(work, k, p, torque, force)
    elif b > 0:
        k = carrier_of(bodies_i, b)
        origin = add(origin_of(work, k), mul(rotation_of(work, k), offset_of(bodies_f, b)))
        accumulate(external, b - 1, 0, add_cross(torque, sub(p, origin), force))
        accumulate(external, b - 1, 3, force)
