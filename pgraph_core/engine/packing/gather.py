"""Columns as they are given -> the table that `pack` takes, checked row by row.

A column has one entry a row (a body's or a motion's), or one for all.
"""

import math

from .. import layout as at
from ..compiler.jit import kernel, part
from ..vec import cross, dot, finite, load, store
from . import pack
from .pack import nq_of, nv_of

# what is wrong with a row, as a place in `columns.COLUMNS`
PARENT, JOINT, MOTION, AXIS, LINK, ROTATION, MASS, COM, INERTIA, PHYSICS = range(10)
Q, V, GRAVITY = PHYSICS + 5, PHYSICS + 6, PHYSICS + 7
NONE = -1
SLACK = 1.5e-9  # half as much again as a Body's: what is refused here, is refused there in words
# kinds of joint, float64 (kinds, 14): number of motions, then kind and axis of each
COUNT, FIRST, STRIDE = 0, 1, 4


@kernel("UniTuple(i8,3)(i8,i8[::1],i8[::1],f8[:,::1])")
def sizes(nb, joint, motion, kinds):
    """Motions, nq and nv of `nb` bodies of the given joints, or of the given motions."""
    if motion.shape[0] > 0:
        nq = 0
        nv = 0
        for m in range(motion.shape[0]):
            nq += nq_of(motion[m])
            nv += nv_of(motion[m])
        return motion.shape[0], nq, nv
    nm = 0
    nq = 0
    nv = 0
    for i in range(nb):
        j = joint[one(joint, i)]
        if 0 <= j < kinds.shape[0]:
            for n in range(int(kinds[j, COUNT])):
                nm += 1
                nq += nq_of(kinds[j, FIRST + STRIDE * n])
                nv += nv_of(kinds[j, FIRST + STRIDE * n])
    return nm, nq, nv


@kernel(
    "UniTuple(i8,3)(i8[::1],i8[::1],i8[::1],i8[::1],f8[:,::1],f8[:,::1],f8[:,::1],f8[::1],"
    "f8[:,::1],f8[:,:,::1],f8[:,::1],f8[::1],f8[::1],f8[::1],f8[:,::1],"
    "i8,i8[::1],f8[:,::1],f8[:,::1],f8[::1])"
)
def gather(
    parent, joint, motion_of, motion, axis, link, rotation, mass,
    com, inertia, physics, q, v, gravity, kinds,
    nq, parent_out, body_out, motion_out, start,
):  # fmt: skip
    """Fill the table; (what is wrong or NONE, its row from 1, whether parents stand above).

    `start` is q (nq,), then v.
    The row is -1 where the column has a wrong shape. Axis, q and v may be empty.
    """
    wrong = _shape(
        parent.shape[0], joint, motion_of, motion, axis, link, rotation, mass, com, inertia,
        physics, q, v, gravity, motion_out.shape[0], nq, start.shape[0] - nq,
    )  # fmt: skip
    if wrong != NONE:
        return wrong, -1, 0
    for n in range(pack.BODY):
        body_out[0, n] = 0.0
    store(body_out, 0, pack.TABLE_GRAVITY, (gravity[0], gravity[1], gravity[2]))
    above = 1
    m = 0
    qi = 0
    vi = 0
    for i in range(1, parent.shape[0] + 1):
        k = i - 1
        if parent[k] < 0 or parent[k] > parent.shape[0]:
            return PARENT, i, above
        if parent[k] >= i:
            above = 0
        parent_out[k] = parent[k]
        wrong = _body(k, link, rotation, mass, com, inertia, body_out)
        if wrong != NONE:
            return wrong, i, above
        begin = m
        if motion.shape[0] > 0:
            while m < motion.shape[0] and motion_of[m] == i:
                if motion[m] < at.ROTATE or motion[m] > at.FREE:
                    return MOTION, i, above
                motion_out[m, pack.KIND] = motion[m]
                store(motion_out, m, pack.AXIS, (0.0, 0.0, 1.0))
                m += 1
        else:
            j = joint[one(joint, k)]
            if j < 0 or j >= kinds.shape[0]:
                return JOINT, i, above
            for n in range(int(kinds[j, COUNT])):
                motion_out[m, pack.KIND] = kinds[j, FIRST + STRIDE * n]
                store(motion_out, m, pack.AXIS, load(kinds, j, FIRST + STRIDE * n + 1))
                m += 1
        body_out[i, pack.MOTIONS] = m - begin
        wrong, q_end, v_end = _joint(
            begin, m, qi, vi, axis, physics, q, v, motion_out, start[:nq], start[nq:]
        )
        if wrong != NONE:
            return wrong, i, above
        qi = q_end
        vi = v_end
    if m < motion.shape[0]:
        return MOTION, 0, above
    return NONE, 0, above


@part
def _shape(
    nb, joint, motion_of, motion, axis, link, rotation, mass, com, inertia,
    physics, q, v, gravity, nm, nq, nv,
):  # fmt: skip
    """The first column of a wrong shape, or NONE."""
    if not fits(joint, nb):
        return JOINT
    if motion_of.shape[0] != motion.shape[0]:
        return MOTION
    if not (axis.shape[0] == 0 or fits(axis, nm)) or axis.shape[1] != 3:
        return AXIS
    if not fits(link, nb) or link.shape[1] != 3:
        return LINK
    if not fits(rotation, nb) or rotation.shape[1] != 4:
        return ROTATION
    if not fits(mass, nb):
        return MASS
    if not fits(com, nb) or com.shape[1] != 3:
        return COM
    if not fits(inertia, nb) or inertia.shape[1] != 3 or inertia.shape[2] != 3:
        return INERTIA
    if not fits(physics, nm):
        return PHYSICS
    if not (q.shape[0] == 0 or q.shape[0] == nq):
        return Q
    if not (v.shape[0] == 0 or v.shape[0] == nv):
        return V
    return GRAVITY if gravity.shape[0] != 3 or not finite(gravity) else NONE


@part
def fits(a, n):
    """Whether a column has an entry a row, or one for all."""
    return a.shape[0] == n or a.shape[0] == 1


@part
def one(a, i):
    """Row of a column for i: its own, or the one for all."""
    return i if a.shape[0] > 1 else 0


@part
def _body(k, link, rotation, mass, com, inertia, out):
    """Geometry and mass of body k into row k + 1."""
    i = k + 1
    x = load(link, one(link, k), 0)
    if not finite3(x):
        return LINK
    store(out, i, pack.LINK, x)
    n = one(rotation, k)
    length = math.sqrt(
        rotation[n, 0] * rotation[n, 0]
        + rotation[n, 1] * rotation[n, 1]
        + rotation[n, 2] * rotation[n, 2]
        + rotation[n, 3] * rotation[n, 3]
    )
    if not 0.5 < length < 2.0:
        return ROTATION
    for j in range(4):
        out[i, pack.ROTATION + j] = rotation[n, j] / length
    out[i, pack.MASS] = mass[one(mass, k)]
    if not 0.0 <= out[i, pack.MASS] < math.inf:
        return MASS
    x = load(com, one(com, k), 0)
    if not finite3(x):
        return COM
    store(out, i, pack.COM, x)
    n = one(inertia, k)
    if not is_inertia(inertia, n):
        return INERTIA
    store(out, i, pack.INERTIA, (inertia[n, 0, 0], inertia[n, 1, 1], inertia[n, 2, 2]))
    store(out, i, pack.INERTIA + 3, (inertia[n, 0, 1], inertia[n, 0, 2], inertia[n, 1, 2]))
    return NONE


@part
def finite3(x):
    return abs(x[0]) < math.inf and abs(x[1]) < math.inf and abs(x[2]) < math.inf


@part
def is_inertia(a, n):
    """Symmetric, and tr(I)/2 - I positive semidefinite: the triangle inequality, and all else."""
    size = 0.0
    for i in range(3):
        for j in range(3):
            if not abs(a[n, i, j]) < math.inf:
                return False
            size = max(size, abs(a[n, i, j]))
    slack = SLACK * size
    xy = a[n, 0, 1]
    xz = a[n, 0, 2]
    yz = a[n, 1, 2]
    if max(abs(xy - a[n, 1, 0]), abs(xz - a[n, 2, 0]), abs(yz - a[n, 2, 1])) > slack:
        return False
    if size == 0.0:
        return True
    half = 0.5 * (a[n, 0, 0] + a[n, 1, 1] + a[n, 2, 2] + slack)
    xx = half - a[n, 0, 0]  # pivots of Cholesky's method
    yy = half - a[n, 1, 1] - xy * xy / xx
    zy = -yz - xy * xz / xx
    return xx > 0.0 and yy > 0.0 and half - a[n, 2, 2] - xz * xz / xx - zy * zy / yy > 0.0


@part
def _joint(begin, end, qi, vi, axis, physics, q, v, motion, q_out, v_out):
    """Axes, physics and coordinates of one joint: (what is wrong or NONE, next q, next v)."""
    first_v = vi
    for m in range(begin, end):
        kind = int(motion[m, pack.KIND])
        if kind == at.FREE and end - begin > 1:
            return MOTION, qi, vi
        if kind <= at.TRANSLATE and not _axis(m, axis, motion):
            return AXIS, qi, vi
        if m > begin and kind <= at.TRANSLATE and motion[m - 1, pack.KIND] == kind:
            turned = cross(load(motion, m - 1, pack.AXIS), load(motion, m, pack.AXIS))
            if not dot(turned, turned) > 1e-18:
                return AXIS, qi, vi
        wrong = _physics(m, kind, physics, motion)
        if wrong != NONE:
            return wrong, qi, vi
        for _ in range(nv_of(kind)):
            v_out[vi] = v[vi] if v.shape[0] > 0 else 0.0
            if not abs(v_out[vi]) < math.inf:
                return V, qi, vi
            vi += 1
        size = nq_of(kind)
        for n in range(size):
            home = 1.0 if size > 1 and n == size - 4 else 0.0
            q_out[qi + n] = q[qi + n] if q.shape[0] > 0 else home
            if not abs(q_out[qi + n]) < math.inf:
                return Q, qi, vi
        qi += size
        if size > 1 and not _is_unit(q_out, qi - 4):
            return Q, qi, vi
    return (MOTION if vi - first_v > 6 else NONE), qi, vi


@part
def _axis(m, axis, motion):
    """The unit axis of motion m, whether there is one."""
    if axis.shape[0] > 0:
        store(motion, m, pack.AXIS, load(axis, one(axis, m), 0))
    x = load(motion, m, pack.AXIS)
    length = math.sqrt(dot(x, x))
    if not 1e-9 < length < 1e9:
        return False
    store(motion, m, pack.AXIS, (x[0] / length, x[1] / length, x[2] / length))
    return True


@part
def _physics(m, kind, physics, motion):
    """Armature, stiffness, damping, rest and friction of motion m."""
    n = one(physics, m)
    for j in range(5):
        x = physics[n, j]
        column = pack.ARMATURE + j
        motion[m, column] = x
        if not abs(x) < math.inf or (x < 0.0 and column != pack.REST):
            return PHYSICS + j
        if x != 0.0 and kind > at.TRANSLATE and column != pack.DAMPING:
            return PHYSICS + j
    return NONE


@part
def _is_unit(q, i):
    """Whether a quaternion has length 1, to 1e-3."""
    square = q[i] * q[i] + q[i + 1] * q[i + 1] + q[i + 2] * q[i + 2] + q[i + 3] * q[i + 3]
    return abs(math.sqrt(square) - 1.0) <= 1e-3
