"""Outboard sweeps: frames, velocities and dependent quantities, eqs. (5)-(9)."""

from ..compiler.elementary import FAR, sine_cosine
from ..compiler.jit import part, sweep
from ..compiler.lane import by_lanes, four, numbers_of_four
from ..rows import (
    BALL,
    FREE,
    OWN,
    ROTATE,
    SCREW,
    TRANSLATE,
    acceleration_of,
    armature_of,
    axis_of,
    coriolis_of,
    gravity_of,
    home_axis,
    home_base,
    home_link,
    home_pitch,
    kind_of,
    link_of,
    mass_of,
    origin_of,
    parent_of,
    pitch_of,
    q_of,
    rotation_of,
    set_acceleration,
    set_axis,
    set_bias,
    set_coriolis,
    set_inertia,
    set_link,
    set_origin,
    set_pitch,
    set_rotation,
    set_sine_cosine,
    set_spin,
    sine_cosine_of,
    spin_of,
    v_of,
)
from ..vec import (
    about_origin,
    add,
    add_cross,
    add_scaled,
    cross,
    dot,
    load,
    mat_mul,
    mul,
    mul_t,
    quaternion_matrix,
    rodrigues,
    rotate_sym,
    scale,
    store,
    sym_mul,
    transpose,
)


@part
def set_ground(const, work):
    """Set row 0 at rest, with the base acceleration -g that includes gravity in C (R7)."""
    for j in range(work.shape[1]):
        work[0, j] = 0.0
    set_rotation(work, 0, (1.0, 0.0, 0.0, 0.0, 1.0, 0.0, 0.0, 0.0, 1.0))
    set_acceleration(work, 0, (0.0, 0.0, 0.0), scale(-1.0, gravity_of(const)))


@part
def base_axes(const, work, p, k):
    """Return the world axes for q and v of ball or free row k, which are its parent body's axes."""
    return mat_mul(rotation_of(work, p), home_base(const, k))


@part
def turned(q, i, r, base):
    """Compute the rotation of a ball's row, r · (base R(q) baseᵀ), for the quaternion at q[i]."""
    turn = quaternion_matrix(q[i], q[i + 1], q[i + 2], q[i + 3])
    return mat_mul(r, mat_mul(mat_mul(base, turn), transpose(base)))


@part
def move(rows, const, work, q, v, k):
    """Compute the frame, velocity and a_k of row k from its parent's, eqs. (5), (9) with R4."""
    p = parent_of(rows, k)
    i = q_of(rows, k)
    j = v_of(rows, k)
    kind = kind_of(rows, k)
    r = rotation_of(work, p)
    w = spin_of(work, p)
    link = mul(r, home_link(const, k))
    if kind < TRANSLATE:
        u = home_axis(const, k)
        h = mul(r, u)
        relative = scale(v[j], h)
        around = cross(w, link)
        if kind == SCREW:
            pitch = home_pitch(const, k)
            set_pitch(work, k, pitch)
            slide = scale(pitch, h)
            link = add_scaled(link, q[i], slide)
            around = add_cross(scale(2.0 * v[j], slide), w, link)
        set_axis(work, k, h)
        sine, cosine = sine_cosine_of(work, k)
        set_rotation(work, k, mat_mul(r, rodrigues(u, sine, cosine)))
        set_spin(work, k, add(w, relative))
        set_coriolis(work, k, cross(w, relative), cross(w, around))
    elif kind == TRANSLATE:
        h = mul(r, home_axis(const, k))
        link = add_scaled(link, q[i], h)
        set_axis(work, k, h)
        set_rotation(work, k, r)
        set_spin(work, k, w)
        slide = scale(2.0 * v[j], h)
        set_coriolis(work, k, scale(0.0, w), cross(w, add_cross(slide, w, link)))
    elif kind == BALL:
        axes = base_axes(const, work, p, k)
        relative = mul(axes, (v[j], v[j + 1], v[j + 2]))
        set_rotation(work, k, turned(q, i, r, home_base(const, k)))
        set_spin(work, k, add(w, relative))
        set_coriolis(work, k, cross(w, relative), cross(w, cross(w, link)))
    else:
        axes = base_axes(const, work, p, k)
        relative = mul(axes, (v[j], v[j + 1], v[j + 2]))
        slide = scale(2.0, mul(axes, (v[j + 3], v[j + 4], v[j + 5])))
        link = add(link, mul(axes, (q[i], q[i + 1], q[i + 2])))
        set_rotation(work, k, turned(q, i + 3, r, home_base(const, k)))
        set_spin(work, k, add(w, relative))
        set_coriolis(work, k, cross(w, relative), cross(w, add_cross(slide, w, link)))
    set_link(work, k, link)


@part
def rigid(const, work, k):
    """Compute M_k and b_k of row k below eq. (12), with inertia about its origin in world axes."""
    r = rotation_of(work, k)
    w = spin_of(work, k)
    m, com, central = mass_of(const, k)
    c = mul(r, com)
    mc = scale(m, c)
    inertia = about_origin(rotate_sym(r, central), m, c)
    zero = 0.0 * m
    coupling = (zero, -mc[2], mc[1], mc[2], zero, -mc[0], -mc[1], mc[0], zero)
    set_inertia(work, k, inertia, coupling, (m, m, m, zero, zero, zero))
    set_bias(work, k, cross(w, sym_mul(inertia, w)), cross(w, cross(w, mc)))


@part
def turn(rows, work, q, k):
    """Sine and cosine of row k, if it turns about an axis."""
    if OWN < kind_of(rows, k) < TRANSLATE:
        sine, cosine = sine_cosine(q[q_of(rows, k)])
        set_sine_cosine(work, k, sine, cosine)


@part
def turn_all(rows, work, q):
    for k in range(1, rows.shape[0]):
        turn(rows, work, q, k)


@part
def near(rows, q, k):
    """True if row k turns about an axis, by an angle that a lane accepts."""
    return OWN < kind_of(rows, k) < TRANSLATE and abs(q[q_of(rows, k)]) < FAR


@part
def turn_by_fours(rows, work, q):
    """Apply `turn_all` with identical bits, four rotations at a time where possible."""
    n = rows.shape[0]
    for k in range(1, n - 3, 4):
        if (
            near(rows, q, k)
            and near(rows, q, k + 1)
            and near(rows, q, k + 2)
            and near(rows, q, k + 3)
        ):
            a, b, c, d = q_of(rows, k), q_of(rows, k + 1), q_of(rows, k + 2), q_of(rows, k + 3)
            sine, cosine = sine_cosine(four(q[a], q[b], q[c], q[d]))
            sines, cosines = numbers_of_four(sine), numbers_of_four(cosine)
            for i in range(4):
                set_sine_cosine(work, k + i, sines[i], cosines[i])
        else:
            for i in range(4):
                turn(rows, work, q, k + i)
    for k in range(n - (n - 1) % 4, n):
        turn(rows, work, q, k)


# sine and cosine of every rotation first: apart, as they need not wait for each other
angles = by_lanes(turn_all, turn_by_fours)


@sweep
def outboard(rows, const, work, q, v):
    """First sweep, root to tips: compute frames, velocities, a, b and rigid inertias."""
    set_ground(const, work)
    angles(rows, work, q)
    for k in range(1, rows.shape[0]):
        move(rows, const, work, q, v, k)
        rigid(const, work, k)


@sweep
def frames(rows, const, work, q, v):
    """Run the first sweep without inertias, preserving the results of the other sweeps."""
    set_ground(const, work)
    angles(rows, work, q)
    for k in range(1, rows.shape[0]):
        move(rows, const, work, q, v, k)


@sweep
def positions(rows, work):
    """Compute the world origins of all rows from the link vectors of `outboard`."""
    for k in range(1, rows.shape[0]):
        p = parent_of(rows, k)
        set_origin(work, k, add(origin_of(work, p), link_of(work, k)))


@part
def carried(work, p, k):
    """Return φ V'_p, the acceleration that row p imparts to the origin of row k."""
    alpha, linear = acceleration_of(work, p)
    return alpha, add_cross(linear, alpha, link_of(work, k))


@part
def with_own(work, k, kind, x, alpha, linear):
    """Return an acceleration plus the contribution x of row k, with one coordinate.

    H of a rotation is (h, 0), of a translation (0, h), of a screw (h, p h) with its pitch p.
    """
    if kind == ROTATE:
        return add_scaled(alpha, x, axis_of(work, k)), linear
    if kind == SCREW:
        more = scale(x, axis_of(work, k))
        return add(alpha, more), add_scaled(linear, pitch_of(work, k), more)
    return alpha, add_scaled(linear, x, axis_of(work, k))


@part
def along_axis(work, k, kind, moment, force):
    """Return Hᵀ F of row k, of one coordinate, eq. (23)."""
    if kind == ROTATE:
        return dot(axis_of(work, k), moment)
    if kind == SCREW:
        return dot(axis_of(work, k), add_scaled(moment, pitch_of(work, k), force))
    return dot(axis_of(work, k), force)


@sweep
def accelerate(rows, const, work, v, vdot):
    """Compute V'_k = φ V'_p + H v' + a_k (8), overwriting the bias, with V'_0 = [0, -g]."""
    for k in range(1, rows.shape[0]):
        p = parent_of(rows, k)
        j = v_of(rows, k)
        kind = kind_of(rows, k)
        alpha, linear = carried(work, p, k)
        a0, a1 = coriolis_of(work, k)
        linear = add(linear, a1)
        alpha = add(alpha, a0)
        if kind <= TRANSLATE:
            alpha, linear = with_own(work, k, kind, vdot[j], alpha, linear)
        else:
            axes = base_axes(const, work, p, k)
            alpha = add(alpha, mul(axes, (vdot[j], vdot[j + 1], vdot[j + 2])))
            if kind == FREE:
                linear = add(linear, mul(axes, (vdot[j + 3], vdot[j + 4], vdot[j + 5])))
        set_acceleration(work, k, alpha, linear)


@part
def linear_velocity(rows, const, work, v, k, parent_velocity):
    """Compute v_k = v_p + ω_p × l + h ḋ, eq. (5), the velocity of row k's origin."""
    p = parent_of(rows, k)
    j = v_of(rows, k)
    kind = kind_of(rows, k)
    velocity = add_cross(parent_velocity, spin_of(work, p), link_of(work, k))
    if kind == TRANSLATE:
        velocity = add_scaled(velocity, v[j], axis_of(work, k))
    elif kind == SCREW:
        velocity = add_scaled(velocity, pitch_of(work, k) * v[j], axis_of(work, k))
    elif kind == FREE:
        axes = base_axes(const, work, p, k)
        velocity = add(velocity, mul(axes, (v[j + 3], v[j + 4], v[j + 5])))
    return velocity


@part
def joint_force(rows, const, work, k, force, moment, out):
    """Write Hᵀ F of row k, eq. (23), into `out` at the row's index in v."""
    j = v_of(rows, k)
    kind = kind_of(rows, k)
    if kind <= TRANSLATE:
        out[j] = along_axis(work, k, kind, moment, force)
    else:
        axes = base_axes(const, work, parent_of(rows, k), k)
        x = mul_t(axes, moment)
        out[j] = x[0]
        out[j + 1] = x[1]
        out[j + 2] = x[2]
        if kind == FREE:
            x = mul_t(axes, force)
            out[j + 3] = x[0]
            out[j + 4] = x[1]
            out[j + 5] = x[2]


@sweep
def kinetic_and_potential(rows, const, work, linear, v):
    """Compute (T, V) [J] of all bodies after `outboard`, V = -Σ m g · x_c.

    Writes origins to X and their velocities to `linear`, so that the factors in `work` stay usable
    for a later projection. The kinetic energy T of a row is computed at its centre of mass to avoid
    the cancellation of large terms far from the origin.
    """
    gravity = gravity_of(const)
    kinetic = 0.0
    potential = 0.0
    for k in range(1, rows.shape[0]):
        p = parent_of(rows, k)
        set_origin(work, k, add(origin_of(work, p), link_of(work, k)))
        velocity = linear_velocity(rows, const, work, v, k, load(linear, p, 0))
        store(linear, k, 0, velocity)
        r = rotation_of(work, k)
        m, com, central = mass_of(const, k)
        c = mul(r, com)
        w = spin_of(work, k)
        at_com = add_cross(velocity, w, c)
        spin = mul_t(r, w)
        kinetic += 0.5 * (m * dot(at_com, at_com) + dot(spin, sym_mul(central, spin)))
        if OWN < kind_of(rows, k) < BALL:
            kinetic += 0.5 * armature_of(const, k) * v[v_of(rows, k)] ** 2
        potential -= m * dot(gravity, add(origin_of(work, k), c))
    return kinetic, potential
