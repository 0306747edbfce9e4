"""Springs, dampers, friction, joint drives, and tables that depend on time."""

import math

from .compiler.elementary import exp, power
from .compiler.jit import kernel, part, sweep
from .compiler.kinds import f8


@part
def knot_after(knots, first, count, t, rate):
    """Find the first knot after t in a table with typically `rate` knots per second."""
    n = first + 1 + int((t - knots[first, 0]) * rate)
    n = min(n, first + count - 1)
    while t < knots[n - 1, 0]:
        n -= 1
    while t >= knots[n, 0]:
        n += 1
    return n


@part
def lookup(knots, first, count, t):
    """Compute the value of a table at time t: linear between knots, constant outside them.

    At a knot, the interval after it is used, because a step that starts at the knot follows this
    interval.
    """
    last = first + count - 1
    if t < knots[first, 0]:
        return knots[first, 1]
    if not t < knots[last, 0]:
        return knots[last, 1]
    n = knot_after(knots, first, count, t, knots[last, 2]) - 1
    return knots[n, 1] + (t - knots[n, 0]) * knots[n, 2]


@part
def follow(y, u, rise, lags):
    """Return y of y' = (u + slope s - y) / lag after s = `lags` lag, during which u has risen by
    `rise`.

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
    """Compute (last knot not later than t, slope after it) of a piecewise linear table."""
    n = first + count - 1
    if t < knots[n, 0]:
        n = knot_after(knots, first, count, t, knots[n, 2]) - 1
        return n, knots[n, 2]
    return n, 0.0


@part
def acting(one, knots, first, count, t):
    """Compute the effective value of input u at time t: u, y of y' = (u - y) / lag, or y of y' = u.

    Both integrals are exact. y of y' = u stays within its bounds.
    """
    if one.lag == 0.0 and one.integrates == 0:
        return lookup(knots, first, count, t)
    if t < knots[first, 0]:
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
    """Compute the time step from t that resolves inputs with a lag [s], or infinity without such
    inputs.

    The remaining fraction of the input is x exp(-s / lag). A step w of a method of order p has
    an error of x (w / lag)^(p + 1), which must not exceed the error of half a lag at x = 1.
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
    """Return the torque that a motor or servo adds, which is the input if it has no target."""
    if one.coordinate < 0:
        return acting(one, knots, one.first_torque, one.torques, t)
    return lookup(knots, one.first_torque, one.torques, t)


@part
def along_terms(table, terms, n, column, x):
    """Compute the sum of coefficient * x over the coordinates of drive n. Here x is v if `column`
    is 0, and q if it is 1."""
    first = table[n].first_term
    total = terms[first, 2] * x[int(terms[first, column])]
    for i in range(first + 1, first + table[n].terms):
        total += terms[i, 2] * x[int(terms[i, column])]
    return total


@part
def stretch_of(table, terms, n, q):
    """Return the stretch of drive n, which is its coordinate or the sum of its terms."""
    if table[n].terms > 0:
        return along_terms(table, terms, n, 1, q)
    return q[table[n].coordinate]


@part
def speed_of(table, terms, n, v):
    """Return the rate of `stretch_of`."""
    if table[n].terms > 0:
        return along_terms(table, terms, n, 0, v)
    return v[table[n].velocity]


@part
def at_its_limit(drives, n, t, q, v):
    """Check whether motor or servo n is at its minimum or maximum torque."""
    table, knots, _, terms = drives
    torque = -table[n].damping * speed_of(table, terms, n, v)
    if table[n].coordinate >= 0:
        target = acting(table[n], knots, table[n].first_target, table[n].targets, t)
        torque += table[n].stiffness * (target - stretch_of(table, terms, n, q))
    torque += own_torque(table[n], knots, t)
    return torque < table[n].low or torque > table[n].high


@sweep
def drive(drives, t, q, v, given, tau):
    """Compute the joint torques τ of all drives and the given torques. Returns (power supplied,
    dissipated) [W]."""
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
            drag += friction * speed / math.sqrt(speed * speed + table[n].creep * table[n].creep)
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
    """Compute the elastic energy of the joint springs [J]."""
    table, knots, passive, terms = drives
    energy = 0.0
    for n in range(passive):
        i = table[n].coordinate
        if i >= 0:
            stretch = stretch_of(table, terms, n, q) - knots[table[n].first_target, 1]
            energy += 0.5 * table[n].stiffness * stretch * stretch
    return energy
