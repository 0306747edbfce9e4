"""From columns of numbers to the packed arrays: motions become rows, welds merge."""

from . import layout as at
from ._jit import kernel, part
from .vec import (
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

# bodies as they come, float64 (nb, 18): the order of `Body.record`
LINK, ROTATION, MASS, COM, INERTIA, MOTIONS = 0, 3, 7, 8, 11, 17
BODY = 18
# motions as they come, float64 (nm, 8): the order of `Body.motion_record`
KIND, AXIS, ARMATURE = 0, 1, 4


@kernel(
    "void(f8[:,::1],f8[:,::1],i8[::1],i8[::1],i8[::1],f8[::1],i8[:,::1],f8[:,::1],i8[:,::1],f8[:,::1])"
)
def pack(body, motion, order, parent, first, gravity, rows, const, bodies_i, bodies_f):
    """Fill rows, const, bodies_i and bodies_f (all zero at first).

    `order[b]` is the table row of body b + 1, `parent[b]` its parent's number, `first[r]` the
    first motion of table row r.
    """
    store(const, 0, at.GRAVITY, (gravity[0], gravity[1], gravity[2]))
    store9(bodies_f, 0, at.HOME, (1.0, 0.0, 0.0, 0.0, 1.0, 0.0, 0.0, 0.0, 1.0))
    k = 0
    qi = 0
    vi = 0
    for b in range(1, order.shape[0] + 1):
        i = order[b - 1]
        p = parent[b - 1]
        base = load9(bodies_f, p, at.HOME)
        turn = quaternion_matrix(
            body[i, ROTATION], body[i, ROTATION + 1], body[i, ROTATION + 2], body[i, ROTATION + 3]
        )
        home = orthonormal(mat_mul(base, turn))
        link = add(load(bodies_f, p, at.OFFSET), mul(base, load(body, i, LINK)))
        row = bodies_i[p, at.ROW]
        for n in range(int(body[i, MOTIONS])):
            k += 1
            m = first[i] + n
            kind = int(motion[m, KIND])
            rows[k, at.PARENT] = row
            rows[k, at.KIND] = kind
            rows[k, at.QI] = qi
            rows[k, at.VI] = vi
            qi += 1 if kind <= at.TRANSLATE else 4 if kind == at.BALL else 7
            vi += 1 if kind <= at.TRANSLATE else 3 if kind == at.BALL else 6
            store(const, k, at.AXIS, mul(home, load(motion, m, AXIS)))
            store(const, k, at.LINK, link)
            store9(const, k, at.BASE, base)
            const[k, at.ARMATURE] = motion[m, ARMATURE]
            link = (0.0, 0.0, 0.0)
            row = k
        bodies_i[b, at.ROW] = row
        bodies_i[b, at.BODY_PARENT] = p
        store(bodies_f, b, at.OFFSET, link)
        store9(bodies_f, b, at.HOME, home)
        com = mul(home, load(body, i, COM))
        inertia = rotate_sym(
            home,
            load6(body, i, INERTIA),
        )
        bodies_f[b, at.B_MASS] = body[i, MASS]
        store(bodies_f, b, at.B_COM, com)
        for n in range(6):
            bodies_f[b, at.B_INERTIA + n] = inertia[n]
        if row > 0:
            merge(const, row, body[i, MASS], add(link, com), inertia)


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
