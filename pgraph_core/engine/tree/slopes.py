"""Derivatives of τ(q, v, v') of eq. (24) in all coordinates, O(n depth), and M⁻¹ times them, O(n²
depth).

A motion of degree of freedom j rotates all descendants about its axis S. Seen from there, row k
gains the velocity ψ = v_j × S and the acceleration s - v_k × ψ with s = v'_j × S + v_j × ψ, and its
force changes by I_k s + B_k ψ with B_k = v_k ×* I_k - I_k v_k × + (I_k v_k) ×̄*. These add up along
the tree like forces, and τ_i = S_i · Σ f ([Carpentier & Mansard 2018], with sums over carried rows
as in [Singh, Russell & Wensing 2022]). Vectors are [angular, linear] in world axes at the first
row's origin. Gravity is modelled as an acceleration of the ground by -g. Most axes S are fixed in
the parent, so S' = v_λ × S. In a free motion, the translation precedes the rotation.

The axis of a curve has slopes D = dS/dq and E = dD/dq in the parent's axes. Its velocity q' adds
D q' to S' and ψ, D q'' + (v_λ × D + E q') q' to s, and the change of S itself D · Σ f to τ.
"""

from typing import Any, NamedTuple

from ..compiler.address import stored
from ..compiler.jit import kernel, part, sweep
from ..compiler.kinds import F1, F2, I1, I2, i8, named, plain, void
from ..motions import bends, column, has_attitude, nv_of, restore
from ..motions import slopes as slopes_of
from ..records import columns
from ..rows import (
    armature_of,
    gravity_of,
    inertia_of,
    kind_of,
    link_of,
    mass_of,
    origin_of,
    parent_of,
    rotation_of,
    v_of,
)
from ..vec import (
    about_origin,
    accumulate,
    add,
    add_cross,
    add_scaled,
    cross,
    dot,
    finite,
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
from .articulated import articulated, singular_row
from .dynamics import outer_freedoms
from .kinematics import outboard, positions

# columns of `bodies`: what a row and all that it carries sum up to, and its own motion
MOTION_SUM = columns(
    mass=1, centre=3, inertia=6, momentum=3, spinning=9, force=6, velocity=6, acceleration=6
)
# columns of `freedoms`: S, ψ, S″, ψ + S′, which speeds carry, and D of a curve
FREEDOM = columns(axis=6, psi=6, second=6, both=6, slope=6)


class Slopes(NamedTuple):
    """A tree and the workspace for its derivatives."""

    rows: Any
    const: Any
    work: Any
    passive: Any  # (nv, 2 nv) slopes of what is in τ of q and v, or empty
    bodies: Any  # (rows, MOTION_SUM.total)
    freedoms: Any  # (nv, FREEDOM.total)
    outer: Any  # (2, nv) the freedom towards the root, and the end of the carried ones
    factor: Any  # (nv + 1, nv) M = Lᵀ D L, with v' as the last row


SLOPES = named(Slopes, I2, F2, F2, F2, F2, F2, I2, F2)
_save, opened_slopes = stored(SLOPES)


@kernel(void(I1, plain(SLOPES)), later=True)
def save_slopes(buffer, slopes):
    """Store a workspace for `opened_slopes`."""
    _save(buffer, slopes)


@part
def load66(table, i, column):
    """Load a spatial vector as (angular, linear)."""
    return load(table, i, column), load(table, i, column + 3)


@part
def store66(table, i, column, x):
    store(table, i, column, x[0])
    store(table, i, column + 3, x[1])


@part
def moved(v, s):
    """Return v × s for motion vectors."""
    return cross(v[0], s[0]), add(cross(v[0], s[1]), cross(v[1], s[0]))


@part
def pushed(s, f):
    """Return s ×* f for a motion and a force vector."""
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
    """Return I x for a row and its subtree, [J α + c × a, m a - c × α] with c = m centre."""
    c = load(bodies, k, MOTION_SUM.centre)
    angular = add(sym_mul(load6(bodies, k, MOTION_SUM.inertia), x[0]), cross(c, x[1]))
    return angular, sub(scale(bodies[k, MOTION_SUM.mass], x[1]), cross(c, x[0]))


@part
def swept(bodies, k, x):
    """Return B x for a row and its subtree, [K ω, -2 p × ω] with the linear momentum p."""
    linear = scale(-2.0, cross(load(bodies, k, MOTION_SUM.momentum), x[0]))
    return mul(load9(bodies, k, MOTION_SUM.spinning), x[0]), linear


@part
def swept_back(bodies, k, x):
    """Return the angular part of Bᵀ x, whose linear part is zero."""
    return add_scaled(
        mul_t(load9(bodies, k, MOTION_SUM.spinning), x[0]),
        2.0,
        cross(load(bodies, k, MOTION_SUM.momentum), x[1]),
    )


@part
def spinning(w, u, j, c):
    """Return K = ω × (2 J - tr J) - 2 c × u × , row by row."""
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


@part
def bent(rows, const, work, q, k, at):
    """Return D and E of a curve for its origin at `at`, where S = [a, x' + at × a] and at' = x'."""
    (turn, bend), (turn_slope, bend_slope) = slopes_of(rows, work, k, const, q)
    a, x = column(rows, work, k, const, 0)
    first = add(add(bend, cross(x, a)), cross(at, turn))
    second = add(
        add(bend_slope, cross(bend, a)), add(scale(2.0, cross(x, turn)), cross(at, turn_slope))
    )
    return (turn, first), (turn_slope, second)


@part
def add_pair(table, i, column, x):
    accumulate(table, i, column, x[0])
    accumulate(table, i, column + 3, x[1])


@sweep
def set_freedoms(rows, const, work, q, v, vdot, bodies, freedoms):
    """Compute the motion vectors of all rows and degrees of freedom, after `positions`."""
    none = (0.0, 0.0, 0.0)
    store66(bodies, 0, MOTION_SUM.velocity, (none, none))
    store66(bodies, 0, MOTION_SUM.acceleration, (none, scale(-1.0, gravity_of(const))))
    here = origin_of(work, 1)
    for k in range(1, rows.shape[0]):
        p, first, size = parent_of(rows, k), v_of(rows, k), nv_of(kind_of(rows, k))
        at = sub(origin_of(work, k), here)
        carrier = load66(bodies, p, MOTION_SUM.velocity)
        rate = load66(bodies, p, MOTION_SUM.acceleration)
        done = size
        while done > 0:  # the slide of a free motion, then its turn
            begin = 3 if done == 6 else 0
            velocity = carrier
            acceleration = rate
            for c in range(begin, done):
                h0, h1 = column(rows, work, k, const, c)
                s = h0, add(h1, cross(at, h0))
                swung = moved(carrier, s)
                velocity = plus(velocity, times(v[first + c], s))
                acceleration = plus(acceleration, times(vdot[first + c], s))
                acceleration = plus(acceleration, times(v[first + c], swung))
                store66(freedoms, first + c, FREEDOM.axis, s)
                store66(freedoms, first + c, FREEDOM.both, swung)
            own = (none, none)
            change = (none, none)
            if bends(kind_of(rows, k)):
                slope, slope_change = bent(rows, const, work, q, k, at)
                rate_here, faster = v[first], vdot[first]
                own = times(rate_here, slope)
                change = plus(moved(carrier, slope), times(rate_here, slope_change))
                change = plus(times(faster, slope), times(rate_here, change))
                acceleration = plus(acceleration, times(rate_here, own))
                add_pair(freedoms, first, FREEDOM.both, own)
                store66(freedoms, first, FREEDOM.slope, slope)
            for c in range(begin, done):
                s = load66(freedoms, first + c, FREEDOM.axis)
                psi = plus(moved(velocity, s), own)
                second = plus(plus(moved(acceleration, s), moved(velocity, psi)), change)
                store66(freedoms, first + c, FREEDOM.psi, psi)
                store66(freedoms, first + c, FREEDOM.second, second)
                store66(
                    freedoms,
                    first + c,
                    FREEDOM.both,
                    plus(psi, load66(freedoms, first + c, FREEDOM.both)),
                )
            carrier = velocity
            rate = acceleration
            done = begin
        store66(bodies, k, MOTION_SUM.velocity, carrier)
        store66(bodies, k, MOTION_SUM.acceleration, rate)


@sweep
def set_sums(rows, const, work, bodies):
    """Compute the inertia, momentum, K and force of every row including its subtree."""
    here = origin_of(work, 1)
    for k in range(rows.shape[0] - 1, 0, -1):
        r = rotation_of(work, k)
        m, com, central = mass_of(const, k)
        centre = add(sub(origin_of(work, k), here), mul(r, com))
        inertia = about_origin(rotate_sym(r, central), m, centre)
        c = scale(m, centre)
        bodies[k, MOTION_SUM.mass] = m
        store(bodies, k, MOTION_SUM.centre, c)
        store(bodies, k, MOTION_SUM.inertia, inertia[:3])
        store(bodies, k, MOTION_SUM.inertia + 3, inertia[3:])
        velocity = load66(bodies, k, MOTION_SUM.velocity)
        momentum = inertial(bodies, k, velocity)
        force = inertial(bodies, k, load66(bodies, k, MOTION_SUM.acceleration))
        store(bodies, k, MOTION_SUM.momentum, momentum[1])
        store9(bodies, k, MOTION_SUM.spinning, spinning(velocity[0], velocity[1], inertia, c))
        store66(bodies, k, MOTION_SUM.force, plus(force, pushed(velocity, momentum)))
    for k in range(rows.shape[0] - 1, 0, -1):
        p = parent_of(rows, k)
        if p > 0:
            for n in range(MOTION_SUM.velocity):
                bodies[p, n] += bodies[k, n]


@sweep
def set_slopes(rows, const, q, v, vdot, work, bodies, freedoms, outer, slopes):
    """Write ∂τ/∂q and ∂τ/∂v into columns 0 to 2 nv - 1 of `slopes`, after `outboard`."""
    n = v.shape[0]
    for i in range(n):
        for c in range(2 * n):
            slopes[i, c] = 0.0
    positions(rows, work)
    set_freedoms(rows, const, work, q, v, vdot, bodies, freedoms)
    set_sums(rows, const, work, bodies)
    for k in range(1, rows.shape[0]):
        kind, first = kind_of(rows, k), v_of(rows, k)
        carried = load66(bodies, k, MOTION_SUM.force)
        for j in range(first, first + nv_of(kind)):
            s = load66(freedoms, j, FREEDOM.axis)
            felt = swept(bodies, k, load66(freedoms, j, FREEDOM.psi))
            felt = plus(felt, inertial(bodies, k, load66(freedoms, j, FREEDOM.second)))
            turned = plus(felt, pushed(s, carried))
            by_speed = swept(bodies, k, s)
            by_speed = plus(by_speed, inertial(bodies, k, load66(freedoms, j, FREEDOM.both)))
            slides = has_attitude(kind) and j >= first + 3
            for i in range(first, first + nv_of(kind)):
                own = load66(freedoms, i, FREEDOM.axis)
                slopes[i, j] = power(own, felt if slides and i < first + 3 else turned)
                slopes[i, n + j] = power(own, by_speed)
            if bends(kind):
                slopes[j, j] += power(load66(freedoms, j, FREEDOM.slope), carried)
            mine = inertial(bodies, k, s)
            back = swept_back(bodies, k, s)
            i = outer[first]
            while i >= 0:
                own = load66(freedoms, i, FREEDOM.axis)
                slopes[i, j] = power(own, turned)
                slopes[i, n + j] = power(own, by_speed)
                psi = load(freedoms, i, FREEDOM.psi)
                slopes[j, i] = power(load66(freedoms, i, FREEDOM.second), mine) + dot(psi, back)
                both = load66(freedoms, i, FREEDOM.both)
                slopes[j, n + i] = power(both, mine) + dot(own[0], back)
                i = outer[i]


@kernel(void(i8, F1, F1, F1, F2), later=True)
def torque_slopes(space, q, v, vdot, slopes):
    """Write ∂τ/∂q into columns 0 to nv - 1 of `slopes` (nv, 2 nv), and ∂τ/∂v into the others."""
    rows, const, work, _, bodies, freedoms, outer, _ = opened_slopes(space)
    outer_freedoms(rows, outer[0])
    outboard(rows, const, work, q, v)
    set_slopes(rows, const, q, v, vdot, work, bodies, freedoms, outer[0], slopes)


# -- M⁻¹ by the factor of M ------------------------------------------------------------------------
# The freedoms that freedom j carries, where column j of L is not zero, lie between j + 1 and
# last[j] - 1.


@sweep
def set_factor(rows, const, work, freedoms, m):
    """Factor M = Lᵀ D L in the lower triangle of `m`. D replaces the unit diagonal of L.

    From the articulated inertias I of `inboard`: D = hᵀ U with U = I h, and the force U / D shifted
    to the freedoms that carry it is their row of L [Rodriguez, Jain & Kreutz-Delgado 1992]. The
    cost is O(n depth), whereas elimination is O(n depth²). `freedoms` is workspace.
    """
    for k in range(1, rows.shape[0]):
        kind, first = kind_of(rows, k), v_of(rows, k)
        restore(rows, work, k)
        j, b, mass = inertia_of(work, k)
        for c in range(nv_of(kind)):
            h = column(rows, work, k, const, c)
            u = add(sym_mul(j, h[0]), mul(b, h[1])), add(mul_t(b, h[0]), sym_mul(mass, h[1]))
            store66(freedoms, first + c, FREEDOM.axis, u)
        for c in range(nv_of(kind) - 1, -1, -1):
            u = load66(freedoms, first + c, FREEDOM.axis)
            pivot = power(column(rows, work, k, const, c), u)
            pivot += armature_of(const, k)
            m[first + c, first + c] = pivot
            u = times(1.0 / pivot, u)
            for d in range(c):  # reduces the inertia of the other freedoms of the row
                a = power(column(rows, work, k, const, d), u)
                m[first + c, first + d] = a
                left = plus(load66(freedoms, first + d, FREEDOM.axis), times(-a * pivot, u))
                store66(freedoms, first + d, FREEDOM.axis, left)
            moment, force = u
            p = k
            while True:
                moment = add_cross(moment, link_of(work, p), force)
                p = parent_of(rows, p)
                if p == 0:
                    break
                for d in range(nv_of(kind_of(rows, p))):
                    h = column(rows, work, p, const, d)
                    m[first + c, v_of(rows, p) + d] = power(h, (moment, force))


@sweep
def last_freedoms(outer, last):
    """Compute the end index of the descendants of each degree of freedom."""
    for i in range(outer.shape[0]):
        last[i] = i + 1
    for i in range(outer.shape[0] - 1, -1, -1):
        if outer[i] >= 0:
            last[outer[i]] = max(last[outer[i]], last[i])


@sweep
def take_four(x, i, a, rows, begin, end):
    """Subtract a · (four rows of x) from x_i in columns `begin` to `end` - 1, in one pass."""
    to, one, two = x[i, begin:end], x[rows[0], begin:end], x[rows[1], begin:end]
    three, four = x[rows[2], begin:end], x[rows[3], begin:end]
    for c in range(end - begin):  # slices from 0: columns of no known sign take no SIMD lanes
        to[c] -= (a[0] * one[c] + a[1] * two[c]) + (a[2] * three[c] + a[3] * four[c])


@sweep
def take_one(x, i, a, row, begin, end):
    """Subtract a times a row of x from x_i in these columns."""
    to, one = x[i, begin:end], x[row, begin:end]
    for c in range(end - begin):
        to[c] -= a * one[c]


@sweep
def carried_in(last, m, x, begin, end, branched):
    """Compute L⁻ᵀ x in place for columns `begin` to `end` - 1.

    If `branched`, row j is zero except for the columns of bodies carried by j.
    """
    for j in range(m.shape[1] - 1, -1, -1):
        i, stop = j + 1, begin + last[j] if branched else end
        while i + 3 < last[j]:
            a = m[i, j], m[i + 1, j], m[i + 2, j], m[i + 3, j]
            take_four(x, j, a, (i, i + 1, i + 2, i + 3), begin, stop)
            i += 4
        while i < last[j]:
            take_one(x, j, m[i, j], i, begin, stop)
            i += 1


@sweep
def carried_out(outer, m, x, begin, end):
    """Compute -L⁻¹ D⁻¹ x in place for columns `begin` to `end` - 1."""
    for i in range(m.shape[1]):
        pivot = -1.0 / m[i, i]
        for c in range(begin, end):
            x[i, c] *= pivot
        take_outer(outer, m, x, i, begin, end)


@sweep
def take_outer(outer, m, x, i, begin, end):
    """Subtract Σ L_ij x_j from x_i over the degrees of freedom j that carry i."""
    j = outer[i]
    while j >= 0:
        j2 = outer[j]
        j3 = outer[j2] if j2 >= 0 else -1
        j4 = outer[j3] if j3 >= 0 else -1
        if j4 < 0:
            break
        a = m[i, j], m[i, j2], m[i, j3], m[i, j4]
        take_four(x, i, a, (j, j2, j3, j4), begin, end)
        j = outer[j4]
    while j >= 0:
        take_one(x, i, m[i, j], j, begin, end)
        j = outer[j]


@sweep
def set_inverse(outer, m, x, first):
    """Write M⁻¹ into the columns of x from `first` on, row by row. M⁻¹ = L⁻¹ D⁻¹ L⁻ᵀ is symmetric.

    Row i is -Σ L_ij (row j) left of the diagonal, and 1/D_i - Σ L_ij (M⁻¹)_ij on the diagonal.
    """
    for i in range(m.shape[1]):
        for c in range(first, first + i):
            x[i, c] = 0.0
        take_outer(outer, m, x, i, first, first + i)
        diagonal = 1.0 / m[i, i]
        j = outer[i]
        while j >= 0:
            diagonal -= m[i, j] * x[i, first + j]
            j = outer[j]
        x[i, first + i] = diagonal
        for c in range(i):
            x[c, first + i] = x[i, first + c]


@kernel(i8(i8, F1, F1, F1, F2), later=True)
def forward_derivatives(space, q, v, tau, slopes):
    """Compute ∂v'/∂q, ∂v'/∂v and M⁻¹ (nv, 3 nv). Returns 0 or the code of `forward_dynamics`."""
    rows, const, work, passive, bodies, freedoms, lists, m = opened_slopes(space)
    n = v.shape[0]
    outer, last, vdot = lists[0], lists[1], m[n]
    articulated(rows, const, q, v, tau, work, vdot)
    singular = singular_row(rows, work)
    if singular > 0:
        return singular
    if not finite(vdot):
        return -1
    outer_freedoms(rows, outer)
    last_freedoms(outer, last)
    set_factor(rows, const, work, freedoms, m)
    set_slopes(rows, const, q, v, vdot, work, bodies, freedoms, outer, slopes)
    sprung = passive.shape[0] > 0  # springs join any two branches
    for i in range(passive.shape[0]):
        for c in range(2 * n):
            slopes[i, c] -= passive[i, c]
    for begin in (0, n):
        carried_in(last, m, slopes, begin, begin + n, not sprung)
        carried_out(outer, m, slopes, begin, begin + n)
    set_inverse(outer, m, slopes, 2 * n)
    return 0
