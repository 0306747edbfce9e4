"""Slopes of τ(q, v, v') of eq. (24) along every freedom, O(n depth), and M⁻¹ of them.

Moving freedom j turns all that it carries about its axis S. Seen from there, row k gains the
velocity ψ = v_j × S and the acceleration s - v_k × ψ with s = v'_j × S + v_j × ψ, and its force
changes by I_k s + B_k ψ with B_k = v_k ×* I_k - I_k v_k × + (I_k v_k) ×̄*. These add up along the
tree, as forces do, and τ_i = S_i · Σ f ([Carpentier & Mansard 2018]; sums over what a row carries
as in [Singh, Russell & Wensing 2022]). Vectors are [angular; linear] in world axes at the first
row's origin; gravity is an acceleration -g of the ground. S is fixed in the parent, so that
S' = v_λ × S; of a free motion the turn is carried by the slide.
"""

from ..compiler.jit import kernel, part, sweep
from ..layout import FREE
from ..rows import (
    gravity_of,
    kind_of,
    mass_of,
    nv_of,
    origin_of,
    parent_of,
    rotation_of,
    v_of,
)
from ..vec import (
    about_origin,
    add,
    add_scaled,
    cross,
    dot,
    load,
    load6,
    load9,
    mul,
    mul_t,
    rotate_sym,
    scale,
    store,
    store9,
    sub,
    sym_mul,
)
from .dynamics import factor, joint_inertia, motion, outer_freedoms
from .kinematics import outboard, positions

# columns of `bodies`: what a row and all that it carries sum up to, and its own motion
MASS, CENTRE, INERTIA, MOMENTUM, SPINNING, FORCE = 0, 1, 4, 10, 13, 22
VELOCITY, ACCELERATION = 28, 34
BODY = 40
# columns of `freedoms`: S, ψ, S″, and ψ + S′, which speeds carry
AXIS, PSI, SECOND, BOTH = 0, 6, 12, 18
FREEDOM = 24


@part
def load66(table, i, column):
    """A spatial vector: (angular, linear)."""
    return load(table, i, column), load(table, i, column + 3)


@part
def store66(table, i, column, x):
    store(table, i, column, x[0])
    store(table, i, column + 3, x[1])


@part
def moved(v, s):
    """v × s of motions."""
    return cross(v[0], s[0]), add(cross(v[0], s[1]), cross(v[1], s[0]))


@part
def pushed(s, f):
    """s ×* f of a motion and a force."""
    return add(cross(s[0], f[0]), cross(s[1], f[1])), cross(s[0], f[1])


@part
def plus(x, y):
    return add(x[0], y[0]), add(x[1], y[1])


@part
def times(s, x):
    return scale(s, x[0]), scale(s, x[1])


@part
def power(x, f):
    return dot(x[0], f[0]) + dot(x[1], f[1])


@part
def inertial(bodies, k, x):
    """I x of the sum of a row and what it carries: [J α + c × a; m a - c × α], c = m centre."""
    c = load(bodies, k, CENTRE)
    angular = add(sym_mul(load6(bodies, k, INERTIA), x[0]), cross(c, x[1]))
    return angular, sub(scale(bodies[k, MASS], x[1]), cross(c, x[0]))


@part
def swept(bodies, k, x):
    """B x of the sum: [K ω; -2 p × ω], p the linear momentum."""
    linear = scale(-2.0, cross(load(bodies, k, MOMENTUM), x[0]))
    return mul(load9(bodies, k, SPINNING), x[0]), linear


@part
def swept_back(bodies, k, x):
    """The angular part of Bᵀ x; the linear one is zero."""
    return add_scaled(
        mul_t(load9(bodies, k, SPINNING), x[0]), 2.0, cross(load(bodies, k, MOMENTUM), x[1])
    )


@part
def spinning(w, u, j, c):
    """K = ω × (2 J - tr J) - 2 c × u × , row by row."""
    trace = j[0] + j[1] + j[2]
    a = (2.0 * j[0] - trace, 2.0 * j[3], 2.0 * j[4])
    b = (2.0 * j[3], 2.0 * j[1] - trace, 2.0 * j[5])
    d = (2.0 * j[4], 2.0 * j[5], 2.0 * j[2] - trace)
    x, y, z = cross(w, a), cross(w, b), cross(w, d)  # columns, for 2 J - tr J is symmetric
    # c × (u × e) = u (c · e) - e (c · u) for each axis e
    along = dot(c, u)
    return (
        x[0] - 2.0 * (u[0] * c[0] - along), y[0] - 2.0 * u[0] * c[1], z[0] - 2.0 * u[0] * c[2],
        x[1] - 2.0 * u[1] * c[0], y[1] - 2.0 * (u[1] * c[1] - along), z[1] - 2.0 * u[1] * c[2],
        x[2] - 2.0 * u[2] * c[0], y[2] - 2.0 * u[2] * c[1], z[2] - 2.0 * (u[2] * c[2] - along),
    )  # fmt: skip


@sweep
def set_freedoms(rows, const, work, v, vdot, bodies, freedoms):
    """Motions of all rows and freedoms, after `positions`."""
    none = (0.0, 0.0, 0.0)
    store66(bodies, 0, VELOCITY, (none, none))
    store66(bodies, 0, ACCELERATION, (none, scale(-1.0, gravity_of(const))))
    here = origin_of(work, 1)
    for k in range(1, rows.shape[0]):
        p, first, size = parent_of(rows, k), v_of(rows, k), nv_of(kind_of(rows, k))
        at = sub(origin_of(work, k), here)
        carrier = load66(bodies, p, VELOCITY)
        rate = load66(bodies, p, ACCELERATION)
        done = size
        while done > 0:  # the slide of a free motion, then its turn
            begin = 3 if done == 6 else 0
            velocity = carrier
            acceleration = rate
            for c in range(begin, done):
                h0, h1 = motion(rows, const, work, k, c)
                s = h0, add(h1, cross(at, h0))
                swung = moved(carrier, s)
                velocity = plus(velocity, times(v[first + c], s))
                acceleration = plus(acceleration, times(vdot[first + c], s))
                acceleration = plus(acceleration, times(v[first + c], swung))
                store66(freedoms, first + c, AXIS, s)
                store66(freedoms, first + c, BOTH, swung)
            for c in range(begin, done):
                s = load66(freedoms, first + c, AXIS)
                psi = moved(velocity, s)
                second = plus(moved(acceleration, s), moved(velocity, psi))
                store66(freedoms, first + c, PSI, psi)
                store66(freedoms, first + c, SECOND, second)
                store66(freedoms, first + c, BOTH, plus(psi, load66(freedoms, first + c, BOTH)))
            carrier = velocity
            rate = acceleration
            done = begin
        store66(bodies, k, VELOCITY, carrier)
        store66(bodies, k, ACCELERATION, rate)


@sweep
def set_sums(rows, const, work, bodies):
    """Inertia, momentum, K and force of every row with all that it carries."""
    here = origin_of(work, 1)
    for k in range(rows.shape[0] - 1, 0, -1):
        r = rotation_of(work, k)
        m, com, central = mass_of(const, k)
        centre = add(sub(origin_of(work, k), here), mul(r, com))
        inertia = about_origin(rotate_sym(r, central), m, centre)
        c = scale(m, centre)
        bodies[k, MASS] = m
        store(bodies, k, CENTRE, c)
        store(bodies, k, INERTIA, inertia[:3])
        store(bodies, k, INERTIA + 3, inertia[3:])
        velocity = load66(bodies, k, VELOCITY)
        momentum = inertial(bodies, k, velocity)
        force = inertial(bodies, k, load66(bodies, k, ACCELERATION))
        store(bodies, k, MOMENTUM, momentum[1])
        store9(bodies, k, SPINNING, spinning(velocity[0], velocity[1], inertia, c))
        store66(bodies, k, FORCE, plus(force, pushed(velocity, momentum)))
    for k in range(rows.shape[0] - 1, 0, -1):
        p = parent_of(rows, k)
        if p > 0:
            for n in range(VELOCITY):
                bodies[p, n] += bodies[k, n]


@kernel(None)
def torque_slopes(rows, const, q, v, vdot, work, bodies, freedoms, slopes):
    """∂τ/∂q into columns 0 to nv - 1 of `slopes` (nv, 3 nv), ∂τ/∂v into the next nv.

    `bodies` (rows, 40) and `freedoms` (nv, 24) are workspace.
    """
    n = v.shape[0]
    for i in range(n):
        for c in range(2 * n):
            slopes[i, c] = 0.0
    outboard(rows, const, work, q, v)
    positions(rows, work)
    set_freedoms(rows, const, work, v, vdot, bodies, freedoms)
    set_sums(rows, const, work, bodies)
    for k in range(1, rows.shape[0]):
        kind, first = kind_of(rows, k), v_of(rows, k)
        carried = load66(bodies, k, FORCE)
        for j in range(first, first + nv_of(kind)):
            s = load66(freedoms, j, AXIS)
            felt = swept(bodies, k, load66(freedoms, j, PSI))
            felt = plus(felt, inertial(bodies, k, load66(freedoms, j, SECOND)))
            turned = plus(felt, pushed(s, carried))
            by_speed = swept(bodies, k, s)
            by_speed = plus(by_speed, inertial(bodies, k, load66(freedoms, j, BOTH)))
            slides = kind == FREE and j >= first + 3
            for i in range(first, first + nv_of(kind)):
                own = load66(freedoms, i, AXIS)
                slopes[i, j] = power(own, felt if slides and i < first + 3 else turned)
                slopes[i, n + j] = power(own, by_speed)
            mine = inertial(bodies, k, s)
            back = swept_back(bodies, k, s)
            p = parent_of(rows, k)
            while p > 0:
                for i in range(v_of(rows, p), v_of(rows, p) + nv_of(kind_of(rows, p))):
                    own = load66(freedoms, i, AXIS)
                    slopes[i, j] = power(own, turned)
                    slopes[i, n + j] = power(own, by_speed)
                    psi = load(freedoms, i, PSI)
                    slopes[j, i] = power(load66(freedoms, i, SECOND), mine) + dot(psi, back)
                    both = load66(freedoms, i, BOTH)
                    slopes[j, n + i] = power(both, mine) + dot(own[0], back)
                p = parent_of(rows, p)


@kernel(None)
def accelerations_of(rows, const, work, outer, m, right):
    """M⁻¹ [-a, -b, 1] in place of `right` = [a, b, anything] (nv, 3 nv), after `torque_slopes`.

    `outer` (nv,) and `m` (nv, nv) are workspace.
    """
    size = right.shape[0]
    for i in range(size):
        for c in range(2 * size):
            right[i, c] = -right[i, c]
        for c in range(size):
            right[i, 2 * size + c] = 1.0 if c == i else 0.0
            m[i, c] = 0.0
    joint_inertia(rows, const, work, m)
    outer_freedoms(rows, outer)
    factor(outer, m)
    n, columns = right.shape
    for i in range(n - 1, -1, -1):
        j = outer[i]
        while j >= 0:
            for c in range(columns):
                right[j, c] -= m[i, j] * right[i, c]
            j = outer[j]
    for i in range(n):
        pivot = 1.0 / m[i, i]
        for c in range(columns):
            right[i, c] *= pivot
        j = outer[i]
        while j >= 0:
            for c in range(columns):
                right[i, c] -= m[i, j] * right[j, c]
            j = outer[j]
