"""Outboard sweeps: frames, velocities, and what depends on them, eqs. (5)-(9)."""

from .. import layout as at
from ..compiler.jit import part, sweep
from ..compiler.sines import sine_cosine
from ..vec import (
    about_origin,
    add,
    add_cross,
    add_scaled,
    cross,
    dot,
    load,
    load6,
    load9,
    mat_mul,
    mul,
    mul_t,
    quaternion_matrix,
    rodrigues,
    rotate_sym,
    scale,
    store,
    store9,
    sym_mul,
    transpose,
)


@part
def set_ground(const, work):
    """Row 0: at rest, with the base acceleration -g that puts gravity into C (R7)."""
    for j in range(at.WORK):
        work[0, j] = 0.0
    work[0, at.R] = 1.0
    work[0, at.R + 4] = 1.0
    work[0, at.R + 8] = 1.0
    store(work, 0, at.P + 3, scale(-1.0, load(const, 0, at.GRAVITY)))


@part
def base_axes(const, work, p, k):
    """World axes of the q and v of ball or free row k: its parent body's axes."""
    return mat_mul(load9(work, p, at.R), load9(const, k, at.BASE))


@part
def turned(q, i, r, base):
    """Rotation of a ball's row: r · (base R(q) baseᵀ) for the quaternion at q[i]."""
    turn = quaternion_matrix(q[i], q[i + 1], q[i + 2], q[i + 3])
    return mat_mul(r, mat_mul(mat_mul(base, turn), transpose(base)))


@part
def move(rows, const, work, q, v, k):
    """Frame, velocity and a_k of row k from its parent's; eqs. (5), (9) with R4."""
    p = rows[k, at.PARENT]
    i = rows[k, at.QI]
    j = rows[k, at.VI]
    kind = rows[k, at.KIND]
    r = load9(work, p, at.R)
    w = load(work, p, at.W)
    link = mul(r, load(const, k, at.LINK))
    if kind == at.ROTATE:
        u = load(const, k, at.AXIS)
        h = mul(r, u)
        relative = scale(v[j], h)
        store(work, k, at.H, h)
        store9(work, k, at.R, mat_mul(r, rodrigues(u, work[k, at.UU], work[k, at.UU + 1])))
        store(work, k, at.W, add(w, relative))
        store(work, k, at.A, cross(w, relative))
        store(work, k, at.A + 3, cross(w, cross(w, link)))
    elif kind == at.TRANSLATE:
        h = mul(r, load(const, k, at.AXIS))
        link = add_scaled(link, q[i], h)
        store(work, k, at.H, h)
        store9(work, k, at.R, r)
        store(work, k, at.W, w)
        store(work, k, at.A, (0.0 * w[0], 0.0 * w[1], 0.0 * w[2]))
        slide = scale(2.0 * v[j], h)
        store(work, k, at.A + 3, cross(w, add_cross(slide, w, link)))
    elif kind == at.BALL:
        axes = base_axes(const, work, p, k)
        relative = mul(axes, (v[j], v[j + 1], v[j + 2]))
        store9(work, k, at.R, turned(q, i, r, load9(const, k, at.BASE)))
        store(work, k, at.W, add(w, relative))
        store(work, k, at.A, cross(w, relative))
        store(work, k, at.A + 3, cross(w, cross(w, link)))
    else:
        axes = base_axes(const, work, p, k)
        relative = mul(axes, (v[j], v[j + 1], v[j + 2]))
        slide = scale(2.0, mul(axes, (v[j + 3], v[j + 4], v[j + 5])))
        link = add(link, mul(axes, (q[i], q[i + 1], q[i + 2])))
        store9(work, k, at.R, turned(q, i + 3, r, load9(const, k, at.BASE)))
        store(work, k, at.W, add(w, relative))
        store(work, k, at.A, cross(w, relative))
        store(work, k, at.A + 3, cross(w, add_cross(slide, w, link)))
    store(work, k, at.L, link)


@part
def rigid(const, work, k):
    """M_k and b_k of row k below eq. (12): inertia about its origin in world axes."""
    r = load9(work, k, at.R)
    w = load(work, k, at.W)
    m = const[k, at.MASS]
    c = mul(r, load(const, k, at.COM))
    mc = scale(m, c)
    central = load6(const, k, at.INERTIA)
    inertia = about_origin(rotate_sym(r, central), m, c)
    zero = 0.0 * m
    coupling = (zero, -mc[2], mc[1], mc[2], zero, -mc[0], -mc[1], mc[0], zero)
    store_inertia(work, k, inertia, coupling, (m, m, m, zero, zero, zero))
    store(work, k, at.P, cross(w, sym_mul(inertia, w)))
    store(work, k, at.P + 3, cross(w, cross(w, mc)))


@part
def angles(rows, work, q):
    """Sine and cosine of every rotation into UU: apart, as they need not wait for each other."""
    for k in range(1, rows.shape[0]):
        if rows[k, at.KIND] == at.ROTATE:
            sine, cosine = sine_cosine(q[rows[k, at.QI]])
            work[k, at.UU] = sine
            work[k, at.UU + 1] = cosine


@sweep
def outboard(rows, const, work, q, v):
    """First sweep, root to tips: frames, velocities, a, b and rigid inertias of all rows."""
    set_ground(const, work)
    angles(rows, work, q)
    for k in range(1, rows.shape[0]):
        move(rows, const, work, q, v, k)
        rigid(const, work, k)


@sweep
def frames(rows, const, work, q, v):
    """The first sweep without inertias: what the other sweeps have left beside it stays."""
    set_ground(const, work)
    angles(rows, work, q)
    for k in range(1, rows.shape[0]):
        move(rows, const, work, q, v, k)


@part
def store_inertia(work, k, j, b, m):
    """[j b; bᵀ m] as the lower triangle of a 6x6 matrix, row by row."""
    i = at.IA
    work[k, i] = j[0]
    work[k, i + 1] = j[3]
    work[k, i + 2] = j[1]
    work[k, i + 3] = j[4]
    work[k, i + 4] = j[5]
    work[k, i + 5] = j[2]
    work[k, i + 6] = b[0]
    work[k, i + 7] = b[3]
    work[k, i + 8] = b[6]
    work[k, i + 9] = m[0]
    work[k, i + 10] = b[1]
    work[k, i + 11] = b[4]
    work[k, i + 12] = b[7]
    work[k, i + 13] = m[3]
    work[k, i + 14] = m[1]
    work[k, i + 15] = b[2]
    work[k, i + 16] = b[5]
    work[k, i + 17] = b[8]
    work[k, i + 18] = m[4]
    work[k, i + 19] = m[5]
    work[k, i + 20] = m[2]


@part
def load_inertia(work, k):
    """(j, b, m) of the 6x6 inertia [j b; bᵀ m] of row k."""
    i = at.IA
    j = (
        work[k, i],
        work[k, i + 2],
        work[k, i + 5],
        work[k, i + 1],
        work[k, i + 3],
        work[k, i + 4],
    )
    b = (
        work[k, i + 6],
        work[k, i + 10],
        work[k, i + 15],
        work[k, i + 7],
        work[k, i + 11],
        work[k, i + 16],
        work[k, i + 8],
        work[k, i + 12],
        work[k, i + 17],
    )
    m = (
        work[k, i + 9],
        work[k, i + 14],
        work[k, i + 20],
        work[k, i + 13],
        work[k, i + 18],
        work[k, i + 19],
    )
    return j, b, m


@sweep
def positions(rows, work):
    """Origins of all rows in the world, from the link vectors of `outboard`."""
    for k in range(1, rows.shape[0]):
        p = rows[k, at.PARENT]
        store(work, k, at.X, add(load(work, p, at.X), load(work, k, at.L)))


@sweep
def accelerate(rows, const, work, v, vdot):
    """V'_k = φ V'_p + H v' + a_k of all rows, eq. (8), into P; V'_0 = [0; -g]."""
    for k in range(1, rows.shape[0]):
        p = rows[k, at.PARENT]
        j = rows[k, at.VI]
        kind = rows[k, at.KIND]
        alpha = load(work, p, at.P)
        linear = add_cross(load(work, p, at.P + 3), alpha, load(work, k, at.L))
        linear = add(linear, load(work, k, at.A + 3))
        alpha = add(alpha, load(work, k, at.A))
        if kind == at.ROTATE:
            alpha = add_scaled(alpha, vdot[j], load(work, k, at.H))
        elif kind == at.TRANSLATE:
            linear = add_scaled(linear, vdot[j], load(work, k, at.H))
        else:
            axes = base_axes(const, work, p, k)
            alpha = add(alpha, mul(axes, (vdot[j], vdot[j + 1], vdot[j + 2])))
            if kind == at.FREE:
                linear = add(linear, mul(axes, (vdot[j + 3], vdot[j + 4], vdot[j + 5])))
        store(work, k, at.P, alpha)
        store(work, k, at.P + 3, linear)


@part
def linear_velocity(rows, const, work, v, k, parent_velocity):
    """v_k = v_p + ω_p × l + h ḋ, eq. (5): of row k's origin from its parent's."""
    p = rows[k, at.PARENT]
    j = rows[k, at.VI]
    kind = rows[k, at.KIND]
    velocity = add_cross(parent_velocity, load(work, p, at.W), load(work, k, at.L))
    if kind == at.TRANSLATE:
        velocity = add_scaled(velocity, v[j], load(work, k, at.H))
    elif kind == at.FREE:
        axes = base_axes(const, work, p, k)
        velocity = add(velocity, mul(axes, (v[j + 3], v[j + 4], v[j + 5])))
    return velocity


@part
def joint_force(rows, const, work, k, force, moment, out):
    """Hᵀ F of row k, eq. (23), into `out` at the row's place in v."""
    j = rows[k, at.VI]
    kind = rows[k, at.KIND]
    if kind == at.ROTATE:
        out[j] = dot(load(work, k, at.H), moment)
    elif kind == at.TRANSLATE:
        out[j] = dot(load(work, k, at.H), force)
    else:
        axes = base_axes(const, work, rows[k, at.PARENT], k)
        x = mul_t(axes, moment)
        out[j] = x[0]
        out[j + 1] = x[1]
        out[j + 2] = x[2]
        if kind == at.FREE:
            x = mul_t(axes, force)
            out[j + 3] = x[0]
            out[j + 4] = x[1]
            out[j + 5] = x[2]


@sweep
def kinetic_and_potential(rows, const, work, v):
    """(T, V) [J] of all bodies after `outboard`, V = -Σ m g · x_c; origins go into X.

    T of a row is taken at its centre of mass: no large terms cancel far from the origin.
    """
    gravity = load(const, 0, at.GRAVITY)
    kinetic = 0.0
    potential = 0.0
    for k in range(1, rows.shape[0]):
        p = rows[k, at.PARENT]
        store(work, k, at.X, add(load(work, p, at.X), load(work, k, at.L)))
        velocity = linear_velocity(rows, const, work, v, k, load(work, p, at.U))
        store(work, k, at.U, velocity)
        r = load9(work, k, at.R)
        c = mul(r, load(const, k, at.COM))
        w = load(work, k, at.W)
        m = const[k, at.MASS]
        at_com = add_cross(velocity, w, c)
        spin = mul_t(r, w)
        central = load6(const, k, at.INERTIA)
        kinetic += 0.5 * (m * dot(at_com, at_com) + dot(spin, sym_mul(central, spin)))
        if rows[k, at.KIND] < at.BALL:
            kinetic += 0.5 * const[k, at.ARMATURE] * v[rows[k, at.VI]] ** 2
        potential -= m * dot(gravity, add(load(work, k, at.X), c))
    return kinetic, potential
