"""Forces on stance feet inside their friction cones, closest to a required wrench.

With A the wrench of unit forces about the centre of mass, and W the load of each foot,

    f ← cone(f + W Aᵀ (A W Aᵀ + T)⁻¹ (goal - A f))

is repeated a few times with one factor, whatever the number of feet. T keeps it regular if feet
cannot provide a torque, such as two feet about the line between them.
"""

import math

from .. import layout as at
from ..compiler.jit import part, sweep
from ..compiler.masks import any_of, chosen, larger, more, smaller
from ..rows import origin_of, rotation_of, spin_of
from ..vec import add, add_cross, add_scaled, cross, dot, load, mul, scale, set_xyz, sub, xyz
from .tables import FEET

SHARE_ROUNDS = 6
LARGEST_LOAD = 4.0  # weights: the largest load of one foot


@part
def centre(rows, const, work, linear):
    """Compute (centre of mass, its velocity) in world axes."""
    none = 0.0 * const[0, at.MASS]
    total = none
    x = (none, none, none)
    u = (none, none, none)
    for k in range(1, rows.shape[0]):
        m = const[k, at.MASS]
        c = mul(rotation_of(work, k), load(const, k, at.COM))
        x = add_scaled(x, m, add(origin_of(work, k), c))
        u = add_scaled(u, m, add_cross(load(linear, k, 0), spin_of(work, k), c))
        total += m
    return scale(1.0 / total, x), scale(1.0 / total, u)


@sweep
def carry(feet, s, goal, com, mat):
    """Add to the feet's forces to meet `goal`, [torque about `com`, force], in heading axes."""
    weigh(feet, s, com, mat)
    factor(mat)
    for _ in range(SHARE_ROUNDS):
        for i in range(6):
            mat[i, 6] = goal[i]
        for f in range(FEET):
            one = xyz(feet[f].force)
            moment = cross(sub(xyz(feet[f].place), com), one)
            for i in range(3):
                mat[i, 6] -= moment[i]
                mat[3 + i, 6] -= one[i]
        substitute(mat)
        turn = (mat[0, 6], mat[1, 6], mat[2, 6])
        push = (mat[3, 6], mat[4, 6], mat[5, 6])
        for f in range(FEET):
            w = feet[f].load
            bears = more(w, 0.0)
            if any_of(bears):
                arm = sub(xyz(feet[f].place), com)
                before = xyz(feet[f].force)
                force = add_scaled(before, w, add(push, cross(turn, arm)))
                set_xyz(feet[f].force, where(bears, in_cone(force, w, s), before))


@part
def where(mask, x, y):
    """Return x where the mask is set, and y elsewhere."""
    return (chosen(mask, x[0], y[0]), chosen(mask, x[1], y[1]), chosen(mask, x[2], y[2]))


@part
def in_cone(force, w, s):
    """Limit a force to sufficient normal load and to the friction cone."""
    up = smaller(LARGEST_LOAD * s.mass * s.gravity * w, larger(s.least_load * w, force[1]))
    side = force[2] * s.lever
    size = math.sqrt(force[0] * force[0] + side * side)
    some = more(size, 0.0)
    k = chosen(some, smaller(s.grip * up / chosen(some, size, 1.0), 1.0), 1.0)
    return (k * force[0], up, k * side)


@sweep
def weigh(feet, s, com, mat):
    """Write A W Aᵀ + T into the lower triangle of `mat`."""
    for i in range(6):
        for j in range(6):
            mat[i, j] = 0.0
        tight = s.tight_torque if i < 3 else s.tight_force
        mat[i, i] = 1.0 / (tight * tight)
    for f in range(FEET):
        w = feet[f].load
        p = sub(xyz(feet[f].place), com)
        x, y, z = p
        size = dot(p, p)
        mat[0, 0] += w * (size - x * x)
        mat[1, 1] += w * (size - y * y)
        mat[2, 2] += w * (size - z * z)
        mat[1, 0] -= w * x * y
        mat[2, 0] -= w * x * z
        mat[2, 1] -= w * y * z
        mat[3, 1] += w * z
        mat[3, 2] -= w * y
        mat[4, 0] -= w * z
        mat[4, 2] += w * x
        mat[5, 0] += w * y
        mat[5, 1] -= w * x
        for i in range(3):
            mat[3 + i, 3 + i] += w
        w *= 1.0 - s.lever  # no hinge feels a force along z where all are parallel to it
        mat[0, 0] -= w * y * y
        mat[1, 0] += w * x * y
        mat[1, 1] -= w * x * x
        mat[5, 0] -= w * y
        mat[5, 1] += w * x
        mat[5, 5] -= w


@sweep
def factor(mat):
    """Compute the Cholesky factor of six columns in place, with the diagonal's inverse."""
    for j in range(6):
        x = mat[j, j]
        for k in range(j):
            x -= mat[j, k] * mat[j, k]
        d = 1.0 / math.sqrt(x)
        mat[j, j] = d
        for i in range(j + 1, 6):
            x = mat[i, j]
            for k in range(j):
                x -= mat[i, k] * mat[j, k]
            mat[i, j] = d * x


@sweep
def substitute(mat):
    """Solve in place for the right-hand side in column 6, by columns to minimise latency."""
    for i in range(6):
        x = mat[i, i] * mat[i, 6]
        mat[i, 6] = x
        for k in range(i + 1, 6):
            mat[k, 6] -= mat[k, i] * x
    for i in range(5, -1, -1):
        x = mat[i, i] * mat[i, 6]
        mat[i, 6] = x
        for k in range(i):
            mat[k, 6] -= mat[i, k] * x
