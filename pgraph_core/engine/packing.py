"""Conversion of a body table to the packed arrays of a mechanism, O(n) in any row order.

`pack` numbers the table so that parents precede children. Motions become rows, and welds merge.
"""

from . import layout as at
from .compiler.jit import kernel, part
from .compiler.kinds import F1, F2, I1, I2, i8
from .motions import nq_of, nv_of
from .records import columns
from .rows import (
    home_of,
    mass_of,
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
# `packing/packed.py` writes
TABLE_GRAVITY = 0
TABLE_BODY = columns(link=3, rotation=4, mass=1, com=3, inertia=6, motions=1)
# the table's motions, float64 (nm, 10), in its order
TABLE_MOTION = columns(
    kind=1, axis=3, armature=1, stiffness=1, damping=1, rest=1, friction=1, pitch=1, track=1
)


# -- numbers --------------------------------------------------------------------------------------


@part
def canonical(parent, bodies_i):
    """Number the table from the top. A row above its parent waits for it and comes next.

    `parent[i - 1]` is the row of row i's parent, from 1, 0 = ground. Fills BODY_PARENT and TABLE
    by number, NUMBER, CHILD and NEXT by row of `bodies_i`, which is zero before.
    """
    child, following = bodies_i[:, at.CHILD], bodies_i[:, at.NEXT]
    number, table, before = (
        bodies_i[:, at.BODY_NUMBER],
        bodies_i[:, at.TABLE],
        bodies_i[:, at.BODY_PARENT],
    )
    for i in range(parent.shape[0], 0, -1):
        p = parent[i - 1]
        following[i] = child[p]
        child[p] = i
    count = 0
    for row in range(1, parent.shape[0] + 1):
        p = parent[row - 1]
        i = row if p == 0 or number[p] > 0 else 0  # else it waits
        i = i if number[row] == 0 else 0
        while i > 0:
            count += 1
            number[i] = count
            table[count] = i
            before[count] = number[parent[i - 1]]
            if 0 < child[i] < row:
                i = child[i]
            else:
                while i != row and not 0 < following[i] < row:
                    i = parent[i - 1]
                i = following[i] if i != row else 0


# -- the packed arrays ----------------------------------------------------------------------------


@kernel(i8(I1, F2, F2, F1, F2, I2, F2, I2, F2, F1))
def pack(parent, body, motion, start, tracks, rows, const, bodies_i, bodies_f, home):
    """Number a valid table and fill the System.

    `parent` (nb,) holds rows of the table from 1, 0 = ground; `start` is q, then v in its order,
    and `tracks` (nt, 32) the rows of its tracks; `home` is by number. Returns how many motions have
    a spring, a damper or friction.
    """
    clear(const)
    clear(bodies_i)
    canonical(parent, bodies_i)
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
    track = motion.shape[0] + 1
    for b in range(1, bodies_i.shape[0]):
        i = table[b]
        p = parents[b]
        base = home_of(bodies_f, p)
        turned = _turned(base, body, i)
        link = add(offset_of(bodies_f, p), mul(base, load(body, i, TABLE_BODY.link)))
        row = carrier[p]
        q_end = qi
        v_end = vi
        first = first_motion[i]
        motions = int(body[i, TABLE_BODY.motions])
        for m in range(first, first + motions):
            k += 1
            kind = int(motion[m, TABLE_MOTION.kind])
            count = int(motion[m, TABLE_MOTION.track])
            set_row(rows, k, row, kind, q_end, v_end, track, count)
            copy_track(tracks, bodies_i[i, at.FIRST_TRACK], count, turned, const, track)
            track += count
            q_end += nq_of(kind)
            v_end += nv_of(kind)
            axis = mul(turned, load(motion, m, TABLE_MOTION.axis))
            set_motion(
                const,
                k,
                axis,
                link,
                base,
                motion[m, TABLE_MOTION.armature],
                motion[m, TABLE_MOTION.pitch],
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
        mass = body[i, TABLE_BODY.mass]
        com = mul(turned, load(body, i, TABLE_BODY.com))
        inertia = rotate_sym(turned, load6(body, i, TABLE_BODY.inertia))
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
    """Return the home orientation of row i's body, with a shortcut if it has no rotation."""
    w = body[i, TABLE_BODY.rotation]
    x, y, z = load(body, i, TABLE_BODY.rotation + 1)
    if w == 1.0 and x == 0.0 and y == 0.0 and z == 0.0:
        return base
    return orthonormal(mat_mul(base, quaternion_matrix(w, x, y, z)))


@part
def places(bodies_i):
    """Return the first motion, q and v of each row's joint, in table order."""
    return bodies_i[:, at.FIRST_MOTION], bodies_i[:, at.FIRST_Q], bodies_i[:, at.FIRST_V]


@part
def _places(body, motion, bodies_i):
    """Compute the first motion and coordinate of each row in table order. Returns nq."""
    first_motion, first_q, first_v = places(bodies_i)
    m = 0
    qi = 0
    vi = 0
    track = 0
    for i in range(1, bodies_i.shape[0]):
        first_motion[i] = m
        first_q[i] = qi
        first_v[i] = vi
        bodies_i[i, at.FIRST_TRACK] = track
        for _ in range(int(body[i, TABLE_BODY.motions])):
            kind = int(motion[m, TABLE_MOTION.kind])
            qi += nq_of(kind)
            vi += nv_of(kind)
            track += int(motion[m, TABLE_MOTION.track])
            m += 1
    return qi


@part
def copy_track(tracks, first, count, turned, const, track):
    """Copy the track of a joint from the axes of its body into home axes."""
    for n in range(0, count, 2):
        const[track + n, at.TRACK_AT] = tracks[first + n, at.TRACK_AT]
        const[track + n, at.TRACK_RATE] = tracks[first + n, at.TRACK_RATE]
    for n in range(0, count - 1, 2):
        i, j = first + n, track + n
        for power in range(8):
            c, d = at.TRACK_PLACE + 3 * power, at.TRACK_TURN + 4 * power
            store(const, j, c, mul(turned, load(tracks, i, c)))
            const[j + 1, d] = tracks[i + 1, d]
            store(const, j + 1, d + 1, mul(turned, load(tracks, i + 1, d + 1)))


@part
def has_spring(motion, m):
    """Return 1 if the motion has a spring, a damper or friction, or else 0."""
    return (
        1
        if motion[m, TABLE_MOTION.stiffness] != 0.0
        or motion[m, TABLE_MOTION.damping] != 0.0
        or motion[m, TABLE_MOTION.friction] != 0.0
        else 0
    )


@part
def copy(x, first, y, begin, end):
    """y[begin:end] from x[first:]."""
    for n in range(end - begin):
        y[begin + n] = x[first + n]


@part
def orthonormal(r):
    """Return r (3 - rᵀr) / 2, which corrects rounding before it accumulates along long chains."""
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
    """Add a rigid body to row k: mass, centre of mass, and inertia about the common centre."""
    m, c, own = mass_of(const, k)
    share = mass / (m + mass) if mass > 0.0 else 0.0
    apart = sub(com, c)
    extra = about_origin(inertia, (1.0 - share) * mass, apart)
    total = add(own[:3], extra[:3]) + add(own[3:], extra[3:])
    set_mass(const, k, m + mass, add(c, scale(share, apart)), total)
