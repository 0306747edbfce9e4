"""From columns of numbers to the packed arrays of a mechanism: O(n) in any order of the table.

`gather` checks columns row by row, one entry a row (a body's or a motion's) or one for all, and
makes them the table that `pack` takes; `pack` numbers it depth-first: motions become rows, welds
merge.
"""

import math

from ..tolerances import SOLVED
from . import layout as at
from .compiler.jit import kernel, part
from .compiler.kinds import F1, F2, F3, I1, I2, group, i8
from .rows import (
    FREE,
    ROTATE,
    TRANSLATE,
    home_of,
    mass_of,
    nq_of,
    nv_of,
    offset_of,
    set_body,
    set_gravity,
    set_mass,
    set_motion,
    set_row,
)
from .vec import (
    about_origin,
    add,
    cross,
    dot,
    finite,
    load,
    load6,
    mat_mul,
    mul,
    quaternion_matrix,
    rotate_sym,
    scale,
    store,
    sub,
    transpose,
)

# the table's bodies, float64 (nb + 1, 18), in its order: row 0 holds gravity, the others what
# the first of `Body.records` holds
TABLE_GRAVITY = 0
LINK, ROTATION, MASS, COM, INERTIA, MOTIONS = 0, 3, 7, 8, 11, 17
TABLE_BODY = 18
# the table's motions, float64 (nm, 9), in its order: what the second of `Body.records` holds
KIND, AXIS, ARMATURE, STIFFNESS, DAMPING, REST, FRICTION = 0, 1, 4, 5, 6, 7, 8
TABLE_MOTION = 9

# what is wrong with a row, as a place in `columns.COLUMNS`
(
    NO_PARENT,
    NO_JOINT,
    NO_MOTION,
    NO_AXIS,
    NO_LINK,
    NO_ROTATION,
    NO_MASS,
    NO_COM,
    NO_INERTIA,
    NO_PHYSICS,
) = range(10)
NO_Q, NO_V, NO_GRAVITY = NO_PHYSICS + 5, NO_PHYSICS + 6, NO_PHYSICS + 7
FINE = -1
SLACK = 2 * SOLVED  # twice a Body's: what is refused here, is refused there in words
# kinds of joint, float64 (kinds, 14): number of motions, then kind and axis of each
COUNT, FIRST, STRIDE = 0, 1, 4


# -- numbers --------------------------------------------------------------------------------------


@part
def depth_first(parent, bodies_i):
    """Number the table in pre-order, upper row first. Returns the number of reachable rows.

    `parent[i - 1]` is the row of row i's parent, from 1, 0 = ground. Fills BODY_PARENT and TABLE
    by number, NUMBER, CHILD and NEXT by row of `bodies_i`, which is zero before.
    """
    child, following = bodies_i[:, at.CHILD], bodies_i[:, at.NEXT]
    number, table, before = (
        bodies_i[:, at.NUMBER],
        bodies_i[:, at.TABLE],
        bodies_i[:, at.BODY_PARENT],
    )
    for i in range(parent.shape[0], 0, -1):
        p = parent[i - 1]
        following[i] = child[p]
        child[p] = i
    count = 0
    i = child[0]
    while i > 0:
        count += 1
        number[i] = count
        table[count] = i
        before[count] = number[parent[i - 1]]
        if child[i] > 0:
            i = child[i]
        else:
            while i > 0 and following[i] == 0:
                i = parent[i - 1]
            i = following[i]  # the ground's is 0: done
    return count


@kernel(i8(I2, I1, I1))
def pgraph(bodies_i, path, jdof):
    """Compute Pgraph and jdof of Fig. 4 for depth-first numbers. Returns their length.

    If a body's parent is not the body before it, the walk has returned to the parent. Both arrays
    are (2 nb + 1,).
    """
    parent, freedoms = bodies_i[:, at.BODY_PARENT], bodies_i[:, at.DOF]
    n = 0
    roots = 0
    for b in range(1, bodies_i.shape[0]):
        roots += parent[b] == 0
    if roots > 1:
        path[0] = jdof[0] = 0
        n = 1
    for b in range(1, bodies_i.shape[0]):
        if b > 1 and parent[b] != b - 1:
            path[n] = parent[b]
            jdof[n] = 0
            n += 1
        path[n] = b
        jdof[n] = freedoms[b]
        n += 1
    return n


# -- the packed arrays ----------------------------------------------------------------------------


@kernel(i8(I1, F2, F2, F1, I2, F2, I2, F2, F1))
def pack(parent, body, motion, start, rows, const, bodies_i, bodies_f, home):
    """Number a valid table and fill the System.

    `parent` (nb,) holds rows of the table from 1, 0 = ground; `start` is q, then v in its order,
    `home` by number. Returns how many motions have a spring, a damper or friction, or -1 where
    parents close a cycle.
    """
    clear(const)
    clear(bodies_i)
    if depth_first(parent, bodies_i) < parent.shape[0]:
        return -1
    nq = _places(body, motion, bodies_i)
    _ground(body, rows, const, bodies_i, bodies_f)
    k = 0
    qi = 0
    vi = 0
    springs = 0
    table, parents, carrier = (
        bodies_i[:, at.TABLE],
        bodies_i[:, at.BODY_PARENT],
        bodies_i[:, at.ROW],
    )
    freedoms, own_rows = bodies_i[:, at.DOF], bodies_i[:, at.OWN_ROWS]
    first_motion, first_q, first_v = places(bodies_i)
    for b in range(1, bodies_i.shape[0]):
        i = table[b]
        p = parents[b]
        base = home_of(bodies_f, p)
        turned = _turned(base, body, i)
        link = add(offset_of(bodies_f, p), mul(base, load(body, i, LINK)))
        row = carrier[p]
        q_end = qi
        v_end = vi
        first = first_motion[i]
        motions = int(body[i, MOTIONS])
        for m in range(first, first + motions):
            k += 1
            kind = int(motion[m, KIND])
            set_row(rows, k, row, kind, q_end, v_end)
            q_end += nq_of(kind)
            v_end += nv_of(kind)
            set_motion(
                const, k, mul(turned, load(motion, m, AXIS)), link, base, motion[m, ARMATURE]
            )
            springs += has_spring(motion, m)
            link = (0.0, 0.0, 0.0)
            row = k
        carrier[b] = row
        freedoms[b] = v_end - vi
        own_rows[b] = motions
        copy(start, first_q[i], home, qi, q_end)
        copy(start, nq + first_v[i], home, nq + vi, nq + v_end)
        qi = q_end
        vi = v_end
        mass = body[i, MASS]
        com = mul(turned, load(body, i, COM))
        inertia = rotate_sym(turned, load6(body, i, INERTIA))
        set_body(bodies_f, b, link, turned, mass, com, inertia)
        if motions > 0:
            set_mass(const, row, mass, add(link, com), inertia)
        elif row > 0:
            merge(const, row, mass, add(link, com), inertia)
    return springs


@part
def clear(a):
    for i in range(a.shape[0]):
        for j in range(a.shape[1]):
            a[i, j] = 0


@part
def _ground(body, rows, const, bodies_i, bodies_f):
    """Fill row 0 of every array. The ground's mass has no effect."""
    for n in range(rows.shape[1]):
        rows[0, n] = 0
    none = (0.0, 0.0, 0.0)
    upright = (1.0, 0.0, 0.0, 0.0, 1.0, 0.0, 0.0, 0.0, 1.0)
    set_body(bodies_f, 0, none, upright, 0.0, none, (0.0, 0.0, 0.0, 0.0, 0.0, 0.0))
    bodies_i[0, at.OWN_ROWS] = 1
    set_gravity(const, load(body, 0, TABLE_GRAVITY))


@part
def _turned(base, body, i):
    """Return the home orientation of row i's body, quickly if it has no rotation."""
    w = body[i, ROTATION]
    x, y, z = load(body, i, ROTATION + 1)
    if w == 1.0 and x == 0.0 and y == 0.0 and z == 0.0:
        return base
    return orthonormal(mat_mul(base, quaternion_matrix(w, x, y, z)))


@part
def places(bodies_i):
    """First motion, q and v of each row's joint, in the table's order."""
    return bodies_i[:, at.FIRST_MOTION], bodies_i[:, at.FIRST_Q], bodies_i[:, at.FIRST_V]


@part
def _places(body, motion, bodies_i):
    """Compute the first motion and coordinate of each row in the table's order. Returns nq."""
    first_motion, first_q, first_v = places(bodies_i)
    m = 0
    qi = 0
    vi = 0
    for i in range(1, bodies_i.shape[0]):
        first_motion[i] = m
        first_q[i] = qi
        first_v[i] = vi
        for _ in range(int(body[i, MOTIONS])):
            kind = int(motion[m, KIND])
            qi += nq_of(kind)
            vi += nv_of(kind)
            m += 1
    return qi


@part
def has_spring(motion, m):
    """1 where the motion has a spring, a damper or friction, else 0."""
    return (
        1
        if motion[m, STIFFNESS] != 0.0 or motion[m, DAMPING] != 0.0 or motion[m, FRICTION] != 0.0
        else 0
    )


@part
def copy(x, first, y, begin, end):
    """y[begin:end] from x[first:]."""
    for n in range(end - begin):
        y[begin + n] = x[first + n]


@part
def orthonormal(r):
    """r (3 - rᵀr) / 2: what rounding has bent is straight again, or long chains would add it up."""
    s = mat_mul(transpose(r), r)
    return mat_mul(
        r,
        (
            1.5 - 0.5 * s[0],
            -0.5 * s[1],
            -0.5 * s[2],
            -0.5 * s[3],
            1.5 - 0.5 * s[4],
            -0.5 * s[5],
            -0.5 * s[6],
            -0.5 * s[7],
            1.5 - 0.5 * s[8],
        ),
    )


@part
def merge(const, k, mass, com, inertia):
    """Add a rigid body to row k: mass, centre of mass, inertia about the common centre."""
    m, c, own = mass_of(const, k)
    share = mass / (m + mass) if mass > 0.0 else 0.0
    apart = sub(com, c)
    extra = about_origin(inertia, (1.0 - share) * mass, apart)
    total = add(own[:3], extra[:3]) + add(own[3:], extra[3:])
    set_mass(const, k, m + mass, add(c, scale(share, apart)), total)


# -- the table from columns -----------------------------------------------------------------------


@kernel(group(*[i8] * 3)(i8, I1, I1, F2))
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
    group(*[i8] * 3)(I1, I1, I1, I1, F2, F2, F2, F1, F2, F3, F2, F1, F1, F1, F2, i8, I1, F2, F2, F1)
)
def gather(
    parent, joint, motion_of, motion, axis, link, rotation, mass,
    com, inertia, physics, q, v, gravity, kinds,
    nq, parent_out, body_out, motion_out, start,
):  # fmt: skip
    """Fill the table. Returns (fault or FINE, its row from 1, True if parents stand above).

    `start` is q (nq,), then v. The row is -1 if the column has a wrong shape. Axis, q and v may be
    empty.
    """
    wrong = _shape(
        parent.shape[0], joint, motion_of, motion, axis, link, rotation, mass, com, inertia,
        physics, q, v, gravity, motion_out.shape[0], nq, start.shape[0] - nq,
    )  # fmt: skip
    if wrong != FINE:
        return wrong, -1, 0
    for n in range(TABLE_BODY):
        body_out[0, n] = 0.0
    store(body_out, 0, TABLE_GRAVITY, (gravity[0], gravity[1], gravity[2]))
    above = 1
    m = 0
    qi = 0
    vi = 0
    for i in range(1, parent.shape[0] + 1):
        k = i - 1
        if parent[k] < 0 or parent[k] > parent.shape[0]:
            return NO_PARENT, i, above
        if parent[k] >= i:
            above = 0
        parent_out[k] = parent[k]
        wrong = _body(k, link, rotation, mass, com, inertia, body_out)
        if wrong != FINE:
            return wrong, i, above
        begin = m
        if motion.shape[0] > 0:
            while m < motion.shape[0] and motion_of[m] == i:
                if motion[m] < ROTATE or motion[m] > FREE:
                    return NO_MOTION, i, above
                motion_out[m, KIND] = motion[m]
                store(motion_out, m, AXIS, (0.0, 0.0, 1.0))
                m += 1
        else:
            j = joint[one(joint, k)]
            if j < 0 or j >= kinds.shape[0]:
                return NO_JOINT, i, above
            for n in range(int(kinds[j, COUNT])):
                motion_out[m, KIND] = kinds[j, FIRST + STRIDE * n]
                store(motion_out, m, AXIS, load(kinds, j, FIRST + STRIDE * n + 1))
                m += 1
        body_out[i, MOTIONS] = m - begin
        wrong, q_end, v_end = _joint(
            begin, m, qi, vi, axis, physics, q, v, motion_out, start[:nq], start[nq:]
        )
        if wrong != FINE:
            return wrong, i, above
        qi = q_end
        vi = v_end
    if m < motion.shape[0]:
        return NO_MOTION, 0, above
    return FINE, 0, above


@part
def _shape(
    nb, joint, motion_of, motion, axis, link, rotation, mass, com, inertia,
    physics, q, v, gravity, nm, nq, nv,
):  # fmt: skip
    """The first column of a wrong shape, or FINE."""
    if not fits(joint, nb):
        return NO_JOINT
    if motion_of.shape[0] != motion.shape[0]:
        return NO_MOTION
    if not (axis.shape[0] == 0 or fits(axis, nm)) or axis.shape[1] != 3:
        return NO_AXIS
    if not fits(link, nb) or link.shape[1] != 3:
        return NO_LINK
    if not fits(rotation, nb) or rotation.shape[1] != 4:
        return NO_ROTATION
    if not fits(mass, nb):
        return NO_MASS
    if not fits(com, nb) or com.shape[1] != 3:
        return NO_COM
    if not fits(inertia, nb) or inertia.shape[1] != 3 or inertia.shape[2] != 3:
        return NO_INERTIA
    if not fits(physics, nm):
        return NO_PHYSICS
    if not (q.shape[0] == 0 or q.shape[0] == nq):
        return NO_Q
    if not (v.shape[0] == 0 or v.shape[0] == nv):
        return NO_V
    return NO_GRAVITY if gravity.shape[0] != 3 or not finite(gravity) else FINE


@part
def fits(a, n):
    """True if a column has one entry per row, or one for all."""
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
        return NO_LINK
    store(out, i, LINK, x)
    n = one(rotation, k)
    length = math.sqrt(
        rotation[n, 0] * rotation[n, 0]
        + rotation[n, 1] * rotation[n, 1]
        + rotation[n, 2] * rotation[n, 2]
        + rotation[n, 3] * rotation[n, 3]
    )
    if not 0.5 < length < 2.0:
        return NO_ROTATION
    for j in range(4):
        out[i, ROTATION + j] = rotation[n, j] / length
    out[i, MASS] = mass[one(mass, k)]
    if not 0.0 <= out[i, MASS] < math.inf:
        return NO_MASS
    x = load(com, one(com, k), 0)
    if not finite3(x):
        return NO_COM
    store(out, i, COM, x)
    n = one(inertia, k)
    if not is_inertia(inertia, n):
        return NO_INERTIA
    store(out, i, INERTIA, (inertia[n, 0, 0], inertia[n, 1, 1], inertia[n, 2, 2]))
    store(out, i, INERTIA + 3, (inertia[n, 0, 1], inertia[n, 0, 2], inertia[n, 1, 2]))
    return FINE


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
    """Axes, physics and coordinates of one joint: (what is wrong or FINE, next q, next v)."""
    first_v = vi
    for m in range(begin, end):
        kind = int(motion[m, KIND])
        if kind == FREE and end - begin > 1:
            return NO_MOTION, qi, vi
        if kind <= TRANSLATE and not _axis(m, axis, motion):
            return NO_AXIS, qi, vi
        if m > begin and kind <= TRANSLATE and motion[m - 1, KIND] == kind:
            turned = cross(load(motion, m - 1, AXIS), load(motion, m, AXIS))
            if not dot(turned, turned) > 1e-18:
                return NO_AXIS, qi, vi
        wrong = _physics(m, kind, physics, motion)
        if wrong != FINE:
            return wrong, qi, vi
        for _ in range(nv_of(kind)):
            v_out[vi] = v[vi] if v.shape[0] > 0 else 0.0
            if not abs(v_out[vi]) < math.inf:
                return NO_V, qi, vi
            vi += 1
        size = nq_of(kind)
        for n in range(size):
            home = 1.0 if size > 1 and n == size - 4 else 0.0
            q_out[qi + n] = q[qi + n] if q.shape[0] > 0 else home
            if not abs(q_out[qi + n]) < math.inf:
                return NO_Q, qi, vi
        qi += size
        if size > 1 and not _is_unit(q_out, qi - 4):
            return NO_Q, qi, vi
    return (NO_MOTION if vi - first_v > 6 else FINE), qi, vi


@part
def _axis(m, axis, motion):
    """The unit axis of motion m, whether there is one."""
    if axis.shape[0] > 0:
        store(motion, m, AXIS, load(axis, one(axis, m), 0))
    x = load(motion, m, AXIS)
    length = math.sqrt(dot(x, x))
    if not 1e-9 < length < 1e9:
        return False
    store(motion, m, AXIS, (x[0] / length, x[1] / length, x[2] / length))
    return True


@part
def _physics(m, kind, physics, motion):
    """Armature, stiffness, damping, rest and friction of motion m."""
    n = one(physics, m)
    for j in range(5):
        x = physics[n, j]
        column = ARMATURE + j
        motion[m, column] = x
        if not abs(x) < math.inf or (x < 0.0 and column != REST):
            return NO_PHYSICS + j
        if x != 0.0 and kind > TRANSLATE and column != DAMPING:
            return NO_PHYSICS + j
    return FINE


@part
def _is_unit(q, i):
    """True if a quaternion has length 1 to 1e-3."""
    square = q[i] * q[i] + q[i + 1] * q[i + 1] + q[i + 2] * q[i + 2] + q[i + 3] * q[i + 3]
    return abs(math.sqrt(square) - 1.0) <= 1e-3
