"""From columns of numbers to the packed arrays: motions become rows, welds merge."""

from .. import layout as at
from ..compiler.jit import kernel, part
from ..vec import (
    about_origin,
    add,
    load,
    load6,
    load9,
    mat_mul,
    mul,
    quaternion_matrix,
    rotate_sym,
    scale,
    store,
    store9,
    sub,
    transpose,
)
from .numbering import depth_first

# the table's bodies, float64 (nb + 1, 18), in its order: row 0 holds gravity, the others what
# the first of `Body.records` holds
TABLE_GRAVITY = 0
LINK, ROTATION, MASS, COM, INERTIA, MOTIONS = 0, 3, 7, 8, 11, 17
BODY = 18
# the table's motions, float64 (nm, 9), in its order: what the second of `Body.records` holds
KIND, AXIS, ARMATURE, STIFFNESS, DAMPING, REST, FRICTION = 0, 1, 4, 5, 6, 7, 8
MOTION = 9


@kernel("i8(i8[::1],f8[:,::1],f8[:,::1],f8[::1],i8[:,::1],f8[:,::1],i8[:,::1],f8[:,::1],f8[::1])")
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
    for b in range(1, bodies_i.shape[0]):
        i = bodies_i[b, at.TABLE]
        p = bodies_i[b, at.BODY_PARENT]
        base = load9(bodies_f, p, at.HOME)
        turned = _turned(base, body, i)
        link = add(load(bodies_f, p, at.OFFSET), mul(base, load(body, i, LINK)))
        row = bodies_i[p, at.ROW]
        q_end = qi
        v_end = vi
        first = bodies_i[i, at.FIRST_MOTION]
        motions = int(body[i, MOTIONS])
        for m in range(first, first + motions):
            k += 1
            kind = int(motion[m, KIND])
            rows[k, at.PARENT] = row
            rows[k, at.KIND] = kind
            rows[k, at.QI] = q_end
            rows[k, at.VI] = v_end
            q_end += nq_of(kind)
            v_end += nv_of(kind)
            store(const, k, at.AXIS, mul(turned, load(motion, m, AXIS)))
            store(const, k, at.LINK, link)
            store9(const, k, at.BASE, base)
            const[k, at.ARMATURE] = motion[m, ARMATURE]
            springs += has_spring(motion, m)
            link = (0.0, 0.0, 0.0)
            row = k
        bodies_i[b, at.ROW] = row
        bodies_i[b, at.DOF] = v_end - vi
        bodies_i[b, at.OWN_ROWS] = motions
        copy(start, bodies_i[i, at.FIRST_Q], home, qi, q_end)
        copy(start, nq + bodies_i[i, at.FIRST_V], home, nq + vi, nq + v_end)
        qi = q_end
        vi = v_end
        store(bodies_f, b, at.OFFSET, link)
        store9(bodies_f, b, at.HOME, turned)
        _load_mass(body, i, turned, bodies_f, b)
        com = add(link, load(bodies_f, b, at.B_COM))
        inertia = load6(bodies_f, b, at.B_INERTIA)
        if motions > 0:
            const[row, at.MASS] = body[i, MASS]
            store(const, row, at.COM, com)
            store(const, row, at.INERTIA, inertia[:3])
            store(const, row, at.INERTIA + 3, inertia[3:])
        elif row > 0:
            merge(const, row, body[i, MASS], com, inertia)
    return springs


@part
def clear(a):
    for i in range(a.shape[0]):
        for j in range(a.shape[1]):
            a[i, j] = 0


@part
def _ground(body, rows, const, bodies_i, bodies_f):
    """Row 0 of every array; the ground has no mass that counts."""
    for n in range(rows.shape[1]):
        rows[0, n] = 0
    for n in range(bodies_f.shape[1]):
        bodies_f[0, n] = 0.0
    store9(bodies_f, 0, at.HOME, (1.0, 0.0, 0.0, 0.0, 1.0, 0.0, 0.0, 0.0, 1.0))
    bodies_i[0, at.OWN_ROWS] = 1
    store(const, 0, at.GRAVITY, load(body, 0, TABLE_GRAVITY))


@part
def _turned(base, body, i):
    """Home orientation of row i's body; most rows have no rotation of their own."""
    w = body[i, ROTATION]
    x, y, z = load(body, i, ROTATION + 1)
    if w == 1.0 and x == 0.0 and y == 0.0 and z == 0.0:
        return base
    return orthonormal(mat_mul(base, quaternion_matrix(w, x, y, z)))


@part
def _load_mass(body, i, home, bodies_f, b):
    """Mass, centre of mass and inertia of row i into body b, home axes."""
    inertia = rotate_sym(home, load6(body, i, INERTIA))
    bodies_f[b, at.B_MASS] = body[i, MASS]
    store(bodies_f, b, at.B_COM, mul(home, load(body, i, COM)))
    for n in range(6):
        bodies_f[b, at.B_INERTIA + n] = inertia[n]


@part
def _places(body, motion, bodies_i):
    """Where each row's motions and coordinates begin in the table's order; nq."""
    m = 0
    qi = 0
    vi = 0
    for i in range(1, bodies_i.shape[0]):
        bodies_i[i, at.FIRST_MOTION] = m
        bodies_i[i, at.FIRST_Q] = qi
        bodies_i[i, at.FIRST_V] = vi
        for _ in range(int(body[i, MOTIONS])):
            kind = int(motion[m, KIND])
            qi += nq_of(kind)
            vi += nv_of(kind)
            m += 1
    return qi


@part
def nq_of(kind):
    return 1 if kind <= at.TRANSLATE else 4 if kind == at.BALL else 7


@part
def nv_of(kind):
    return 1 if kind <= at.TRANSLATE else 3 if kind == at.BALL else 6


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
    m = const[k, at.MASS]
    share = mass / (m + mass) if mass > 0.0 else 0.0
    c = load(const, k, at.COM)
    apart = sub(com, c)
    extra = about_origin(inertia, (1.0 - share) * mass, apart)
    for n in range(6):
        const[k, at.INERTIA + n] += extra[n]
    const[k, at.MASS] = m + mass
    store(const, k, at.COM, add(c, scale(share, apart)))
