"""Outboard sweeps: frames, velocities and dependent quantities, eqs. (5)-(9)."""

from ..compiler.elementary import FAR, sine_cosine
from ..compiler.jit import part, sweep
from ..compiler.lane import by_lanes, four, numbers_of_four
from ..motions import add_motion, is_inert, move, nv_of, set_rates, turns
from ..rows import (
    acceleration_of,
    armature_of,
    coriolis_of,
    gravity_of,
    kind_of,
    link_of,
    mass_of,
    origin_of,
    parent_of,
    q_of,
    rotation_of,
    set_acceleration,
    set_bias,
    set_inertia,
    set_origin,
    set_rotation,
    set_sine_cosine,
    spin_of,
    v_of,
)
from ..vec import (
    about_origin,
    add,
    add_cross,
    cross,
    dot,
    load,
    mul,
    mul_t,
    rotate_sym,
    scale,
    store,
    sym_mul,
)


@part
def set_ground(const, work):
    """Set row 0 at rest, with the base acceleration -g that includes gravity in C (R7)."""
    for j in range(work.shape[1]):
        work[0, j] = 0.0
    set_rotation(work, 0, (1.0, 0.0, 0.0, 0.0, 1.0, 0.0, 0.0, 0.0, 1.0))
    set_acceleration(work, 0, (0.0, 0.0, 0.0), scale(-1.0, gravity_of(const)))


@part
def set_rigid(const, work, k):
    """Compute M_k and b_k of row k below eq. (12), with inertia about its origin in world axes."""
    m, mc, inertia = set_gyration(const, work, k)
    zero = 0.0 * m
    coupling = (zero, -mc[2], mc[1], mc[2], zero, -mc[0], -mc[1], mc[0], zero)
    set_inertia(work, k, inertia, coupling, (m, m, m, zero, zero, zero))


@part
def set_gyration(const, work, k):
    """Compute b_k alone. Returns the mass, its moment, and the inertia about the row's origin."""
    r, w = rotation_of(work, k), spin_of(work, k)
    m, com, central = mass_of(const, k)
    c = mul(r, com)
    mc = scale(m, c)
    inertia = about_origin(rotate_sym(r, central), m, c)
    set_bias(work, k, cross(w, sym_mul(inertia, w)), cross(w, cross(w, mc)))
    return m, mc, inertia


@part
def turn(rows, work, q, k):
    """Sine and cosine of row k, if it turns about an axis."""
    if turns(kind_of(rows, k)):
        sine, cosine = sine_cosine(q[q_of(rows, k)])
        set_sine_cosine(work, k, sine, cosine)


@part
def turn_all(rows, work, q):
    for k in range(1, rows.shape[0]):
        turn(rows, work, q, k)


@part
def near(rows, q, k):
    """True if row k turns about an axis, by an angle that a lane accepts."""
    return turns(kind_of(rows, k)) and abs(q[q_of(rows, k)]) < FAR


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
        move(rows, work, k, const, q, v)
        set_rigid(const, work, k)


@sweep
def outboard_again(rows, const, work, v):
    """Run `outboard` with the frames of the last one, for the same q. Inertias stay as they are."""
    set_acceleration(work, 0, (0.0, 0.0, 0.0), scale(-1.0, gravity_of(const)))
    for k in range(1, rows.shape[0]):
        set_rates(rows, work, k, const, v)
        set_gyration(const, work, k)


@sweep
def frames(rows, const, work, q, v):
    """Run the first sweep without inertias, preserving the results of the other sweeps."""
    set_ground(const, work)
    angles(rows, work, q)
    for k in range(1, rows.shape[0]):
        move(rows, work, k, const, q, v)


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


@sweep
def accelerate(rows, const, work, v, vdot):
    """Compute V'_k = φ V'_p + H v' + a_k (8), overwriting the bias, with V'_0 = [0, -g]."""
    for k in range(1, rows.shape[0]):
        alpha, linear = driven(work, parent_of(rows, k), k)
        alpha, linear = add_motion(rows, work, k, const, vdot, alpha, linear)
        set_acceleration(work, k, alpha, linear)


@part
def driven(work, p, k):
    """Return φ V'_p + a_k, the acceleration of row k for v' = 0."""
    alpha, linear = carried(work, p, k)
    a0, a1 = coriolis_of(work, k)
    return add(alpha, a0), add(linear, a1)


@part
def linear_velocity(rows, const, work, v, k, parent_velocity):
    """Compute v_k = v_p + ω_p × l + h ḋ, eq. (5), the velocity of row k's origin."""
    w = spin_of(work, parent_of(rows, k))
    velocity = add_cross(parent_velocity, w, link_of(work, k))
    return add_motion(rows, work, k, const, v, w, velocity)[1]


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
        if not is_inert(kind_of(rows, k)):
            for j in range(v_of(rows, k), v_of(rows, k) + nv_of(kind_of(rows, k))):
                kinetic += 0.5 * armature_of(const, k) * v[j] ** 2
        potential -= m * dot(gravity, add(origin_of(work, k), c))
    return kinetic, potential
