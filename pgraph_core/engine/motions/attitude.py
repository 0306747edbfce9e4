"""Attitudes: unit quaternions in q, with angular velocities in the axes of the parent body."""

from ..compiler.jit import part
from ..rows import home_base, parent_of, rotation_of
from ..vec import mat_mul, quaternion_matrix, transpose


@part
def base_axes(rows, work, k, const):
    """Return the world axes for q and v of ball or free row k, which are its parent body's axes."""
    return mat_mul(rotation_of(work, parent_of(rows, k)), home_base(const, k))


@part
def turned(q, i, r, base):
    """Compute the rotation of a ball's row, r · (base R(q) baseᵀ), for the quaternion at q[i]."""
    turn = quaternion_matrix(q[i], q[i + 1], q[i + 2], q[i + 3])
    return mat_mul(r, mat_mul(mat_mul(base, turn), transpose(base)))


@part
def axis_from(axes, c):
    """Return column c of a matrix."""
    return axes[c], axes[c + 3], axes[c + 6]
