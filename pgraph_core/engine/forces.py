"""Forces other than gravity: springs, dampers, friction and drives of joints; loads on bodies.

What a joint's own parts do is in `drives`, what acts on bodies or between two in `loads`.
"""

import math

from ..tolerances import TINY
from .compiler.elementary import atan2, exp, power
from .compiler.jit import kernel, part, sweep
from .compiler.kinds import f8
from .constraints.blocks import point_velocity
from .records import CREEP, DRAG, SPRING, TORSION, WRENCH
from .rows import add_bias, bias_of, link_of, origin_of, parent_of, rotation_of, set_bias, spin_of
from .tree.kinematics import joint_force
from .vec import add, add_cross, add_scaled, cross, dot, load, matrix, mul, mul_t, scale, sub, xyz


@part
def knot_after(knots, first, count, t, rate):
    """Return the first knot after t in the table, with usually `rate` knots per second."""
    n = first + 1 + int((t - knots[first, 0]) * rate)
    n = min(n, first + count - 1)
    while t < knots[n - 1, 0]:
        n -= 1
    while t >= knots[n, 0]:
        n += 1
    return n


@part
def lookup(knots, first, count, t):
    """Value of a table at time t: straight lines between knots, constant outside them."""
    last = first + count - 1
    if t <= knots[first, 0]:
        return knots[first, 1]
    if not t < knots[last, 0]:
        return knots[last, 1]
    n = knot_after(knots, first, count, t, knots[last, 2]) - 1
    return knots[n, 1] + (t - knots[n, 0]) * knots[n, 2]


@part
def follow(y, u, rise, lags):
    """y of y' = (u + slope s - y) / lag after s = `lags` lag, in which u has risen by `rise`.

    Each form is used where nothing cancels in it: with z = lags, (1 - e^-z) / z = 1 - late, and
    late = (z - 1 + e^-z) / z = z (1/2! - z/3! + ...).
    """
    if lags < 0.5:
        series = 1.0
        for k in range(16, 2, -1):
            series = 1.0 - series * lags / k
        late = 0.5 * lags * series
        return y + (u - y) * lags * (1.0 - late) + rise * late
    left = exp(-lags)
    return u + (y - u) * left + rise * (1.0 - (1.0 - left) / lags)


@kernel(f8(f8, f8, f8, f8), later=True)
def followed(y, u, rise, lags):
    """`follow`, for Python."""
    return follow(y, u, rise, lags)


@part
def piece_of(knots, first, count, t):
    """(the last knot that is not later than t, the slope after it): a table of lines at time t."""
    n = first + count - 1
    if t < knots[n, 0]:
        n = knot_after(knots, first, count, t, knots[n, 2]) - 1
        return n, knots[n, 2]
    return n, 0.0


@part
def acting(one, knots, first, count, t):
    """Return the active value at time t of input u: u, y of y' = (u - y) / lag, or y of y' = u.

    Both integrals are exact. y of y' = u stays within its bounds.
    """
    if one.lag == 0.0 and one.integrates == 0:
        return lookup(knots, first, count, t)
    if t <= knots[first, 0]:
        return knots[first, 3]
    n, slope = piece_of(knots, first, count, t)
    ahead = t - knots[n, 0]
    u = knots[n, 1]
    if one.integrates:  # u keeps its sign between two knots, so the bound is reached once
        y = knots[n, 3] + (u + 0.5 * slope * ahead) * ahead
        return min(max(y, one.least), one.most)
    return follow(knots[n, 3], u, slope * ahead, ahead / one.lag)


@sweep
def lag_width(drives, t, order):
    """Return the step from t that resolves inputs with a lag [s], infinite without them.

    Of the input's size, x exp(-s / lag) remains to be followed. A step w of a method of order p
    integrates it with an error of x (w / lag)^(p + 1), which is no larger than that of half a lag
    at x = 1.
    """
    table, knots = drives.table, drives.knots
    width = math.inf
    for n in range(drives.passive, table.shape[0]):
        one = table[n]
        if not one.lag > 0.0:
            continue
        first, count = one.first_torque, one.torques
        if one.coordinate >= 0:
            first, count = one.first_target, one.targets
        now = max(t, knots[first, 0])
        k, slope = piece_of(knots, first, count, now)
        behind = slope * one.lag
        missing = knots[k, 3] - knots[k, 1] + behind
        size = abs(knots[k, 1]) + abs(knots[k, 3]) + abs(missing)
        rest = abs(missing) * exp(-(now - knots[k, 0]) / one.lag)
        if rest > 0.0:
            width = min(width, 0.5 * one.lag * power(size / rest, 1.0 / (order + 1)))
    return width


@part
def own_torque(one, knots, t):
    """Return the torque that a motor or servo adds, which is the input without a target."""
    if one.coordinate < 0:
        return acting(one, knots, one.first_torque, one.torques, t)
    return lookup(knots, one.first_torque, one.torques, t)


@part
def along_terms(table, terms, n, column, x):
    """Return Σ coefficient x of the coordinates of drive n, x = v (`column` 0) or q (1)."""
    first = table[n].first_term
    total = terms[first, 2] * x[int(terms[first, column])]
    for i in range(first + 1, first + table[n].terms):
        total += terms[i, 2] * x[int(terms[i, column])]
    return total


@part
def stretch_of(table, terms, n, q):
    """Return the stretch of drive n: its coordinate, or the sum of its terms."""
    if table[n].terms > 0:
        return along_terms(table, terms, n, 1, q)
    return q[table[n].coordinate]


@part
def speed_of(table, terms, n, v):
    """The rate of `stretch_of`."""
    if table[n].terms > 0:
        return along_terms(table, terms, n, 0, v)
    return v[table[n].velocity]


@part
def at_its_limit(drives, n, t, q, v):
    """True if motor or servo n is at its least or largest torque."""
    table, knots, _, terms = drives
    torque = -table[n].damping * speed_of(table, terms, n, v)
    if table[n].coordinate >= 0:
        target = acting(table[n], knots, table[n].first_target, table[n].targets, t)
        torque += table[n].stiffness * (target - stretch_of(table, terms, n, q))
    torque += own_torque(table[n], knots, t)
    return torque < table[n].low or torque > table[n].high


@sweep
def drive(drives, t, q, v, given, tau):
    """Compute τ of all drives and given torques. Returns (power put in, dissipated) [W]."""
    table, knots, passive, terms = drives
    put_in = 0.0
    dissipated = 0.0
    for j in range(tau.shape[0]):
        tau[j] = 0.0
    for j in range(given.shape[0]):  # empty where no torques are given
        tau[j] = given[j]
        put_in += given[j] * v[j]
    for n in range(table.shape[0]):
        j = table[n].velocity
        i = table[n].coordinate
        kd = table[n].damping
        speed = speed_of(table, terms, n, v)
        drag = kd * speed
        friction = table[n].friction
        if friction > 0.0:
            drag += friction * speed / math.sqrt(speed * speed + CREEP * CREEP)
        torque = -drag
        if i >= 0:
            target = acting(table[n], knots, table[n].first_target, table[n].targets, t)
            torque += table[n].stiffness * (target - stretch_of(table, terms, n, q))
        if n < passive:
            dissipated += drag * speed
        else:
            torque += own_torque(table[n], knots, t)
            torque = min(max(torque, table[n].low), table[n].high)
            put_in += torque * speed
        if table[n].terms == 0:
            tau[j] += torque
            continue
        first = table[n].first_term
        for m in range(first, first + table[n].terms):
            tau[int(terms[m, 0])] += terms[m, 2] * torque
    return put_in, dissipated


@sweep
def elastic(drives, q):
    """Energy of the joints' springs [J]."""
    table, knots, passive, terms = drives
    energy = 0.0
    for n in range(passive):
        i = table[n].coordinate
        if i >= 0:
            stretch = stretch_of(table, terms, n, q) - knots[table[n].first_target, 1]
            energy += 0.5 * table[n].stiffness * stretch * stretch
    return energy


@part
def apply(work, k, p, torque, force):
    """A wrench at p on row k, off the bias force P; the ground takes any."""
    if k > 0:
        arm = sub(p, origin_of(work, k))
        add_bias(work, k, scale(-1.0, add_cross(torque, arm, force)), scale(-1.0, force))


@part
def point_of(local, work, k):
    """A point that is fixed in row k, in the world."""
    return add(origin_of(work, k), mul(rotation_of(work, k), local))


@part
def between(knots, first, count, t, column):
    """Three columns of a table at time t: straight lines between knots, constant outside them."""
    last = first + count - 1
    if t <= knots[first, 0]:
        return load(knots, first, column)
    if not t < knots[last, 0]:
        return load(knots, last, column)
    rate = (count - 1) / (knots[last, 0] - knots[first, 0])
    n = knot_after(knots, first, count, t, rate)
    share = (t - knots[n - 1, 0]) / (knots[n, 0] - knots[n - 1, 0])
    x = load(knots, n - 1, column)
    return add_scaled(x, share, sub(load(knots, n, column), x))


@part
def load_of(loads, i, work, linear, t):
    """(torque, force) on A at p, the point `end` of B that takes the opposite, powers [W]."""
    knots = loads.knots
    spring = loads.table[i]
    a = spring.row_a
    b = spring.row_b
    none = (0.0, 0.0, 0.0)
    p = point_of(xyz(spring.point_a), work, a)
    if spring.kind == WRENCH:
        first = spring.first_knot
        torque = between(knots, first, spring.knots, t, 1)
        force = between(knots, first, spring.knots, t, 4)
        if spring.in_body == 1:
            r = rotation_of(work, a)
            torque = mul(r, torque)
            force = mul(r, force)
        put_in = dot(torque, spin_of(work, a))
        put_in += dot(force, point_velocity(work, linear, a, p))
        return p, torque, force, p, put_in, 0.0
    if spring.kind == SPRING:
        end = point_of(xyz(spring.point_b), work, b)
        d, length = along(p, end)
        u = sub(point_velocity(work, linear, a, p), point_velocity(work, linear, b, end))
        speed = dot(d, u)
        damping = spring.damping * speed
        pull = spring.stiffness * (length - spring.rest) + damping
        return p, none, scale(-pull, d), end, 0.0, damping * speed
    if spring.kind == DRAG:
        turn = rotation_of(work, a)
        speed = point_velocity(work, linear, a, p)
        torque, force = drag_of(spring, turn, spin_of(work, a), speed)
        lost = -dot(torque, spin_of(work, a)) - dot(force, speed)
        return p, torque, force, p, 0.0, lost
    angle, axis = twist(spring, work, a, b)
    rate = dot(axis, sub(spin_of(work, a), spin_of(work, b)))
    damping = spring.damping * rate
    torque = scale(-spring.stiffness * angle - damping, axis)
    return p, torque, none, p, 0.0, damping * rate


@part
def drag_of(one, turn, spin, speed):
    """(torque, force) of a fluid on a box that turns at `spin` and whose middle has `speed`.

    Stokes's drag of a ball of the mean edge, and the pressure on the faces, as MuJoCo's fluid
    model by inertia boxes has them.
    """
    x, y, z = xyz(one.box)
    mean = (x + y + z) / 3.0
    axes = matrix(one.axes)
    u = mul_t(axes, mul_t(turn, speed))
    w = mul_t(axes, mul_t(turn, spin))
    viscous = -3.0 * math.pi * mean * one.viscosity
    swirl = -math.pi * mean * mean * mean * one.viscosity
    press = -0.5 * one.density
    churn = -one.density / 64.0
    x4, y4, z4 = x * x * x * x, y * y * y * y, z * z * z * z
    force = (
        (viscous + press * y * z * math.sqrt(u[0] * u[0])) * u[0],
        (viscous + press * z * x * math.sqrt(u[1] * u[1])) * u[1],
        (viscous + press * x * y * math.sqrt(u[2] * u[2])) * u[2],
    )
    torque = (
        (swirl + churn * x * (y4 + z4) * math.sqrt(w[0] * w[0])) * w[0],
        (swirl + churn * y * (z4 + x4) * math.sqrt(w[1] * w[1])) * w[1],
        (swirl + churn * z * (x4 + y4) * math.sqrt(w[2] * w[2])) * w[2],
    )
    return mul(turn, mul(axes, torque)), mul(turn, mul(axes, force))


@sweep
def apply_loads(loads, work, linear, t):
    """All loads onto the rows, after `positions` and `velocities`; powers in and dissipated [W]."""
    table = loads.table
    put_in = 0.0
    dissipated = 0.0
    for i in range(table.shape[0]):
        p, torque, force, end, more, lost = load_of(loads, i, work, linear, t)
        apply(work, table[i].row_a, p, torque, force)
        apply(work, table[i].row_b, end, scale(-1.0, torque), scale(-1.0, force))
        put_in += more
        dissipated += lost
    return put_in, dissipated


@sweep
def torque_of_loads(rows, const, loads, work, linear, tau):
    """τ = Hᵀ φᵀ F of all loads at t = 0, eqs. (12), (23), after `positions` and `velocities`.

    P is used up.
    """
    for k in range(rows.shape[0]):
        set_bias(work, k, (0.0, 0.0, 0.0), (0.0, 0.0, 0.0))
    apply_loads(loads, work, linear, 0.0)
    for k in range(rows.shape[0] - 1, 0, -1):
        moment, force = bias_of(work, k)
        joint_force(rows, const, work, k, scale(-1.0, force), scale(-1.0, moment), tau)
        p = parent_of(rows, k)
        add_bias(work, p, add_cross(moment, link_of(work, k), force), force)


@part
def along(p, end):
    """(unit vector from `end` to p, distance)."""
    apart = sub(p, end)
    length = math.sqrt(dot(apart, apart) + TINY)
    return scale(1.0 / length, apart), length


@part
def twist(spring, work, a, b):
    """(angle of A from its rest about its axis, the angle's gradient), angle within ±π.

    The angle leads from B's reference to A's, seen along the axis. Its gradient is the axis
    while both share it; elsewhere it makes the torque the slope of ½ k angle².
    """
    turn_a = rotation_of(work, a)
    h = mul(turn_a, xyz(spring.axis))
    mine = mul(turn_a, xyz(spring.reference_a))
    other = mul(rotation_of(work, b), xyz(spring.reference_b))
    n = cross(other, mine)
    y = dot(h, n)
    x = dot(other, mine)
    angle = atan2(y, x) - spring.rest
    angle -= 2.0 * math.pi * math.floor(angle / (2.0 * math.pi) + 0.5)
    across = add(add(cross(h, n), scale(x, h)), scale(-dot(h, mine), other))
    slope = scale(1.0 / (x * x + y * y), add_scaled(scale(x, across), y, n))
    return angle, slope


@sweep
def elastic_loads(loads, work):
    """Energy of springs between bodies [J], after `positions`."""
    table = loads.table
    energy = 0.0
    for i in range(table.shape[0]):
        a = table[i].row_a
        b = table[i].row_b
        if table[i].kind == SPRING:
            p = point_of(xyz(table[i].point_a), work, a)
            _, length = along(p, point_of(xyz(table[i].point_b), work, b))
            energy += 0.5 * table[i].stiffness * (length - table[i].rest) ** 2
        elif table[i].kind == TORSION:
            angle, _ = twist(table[i], work, a, b)
            energy += 0.5 * table[i].stiffness * angle * angle
    return energy
