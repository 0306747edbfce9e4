"""Loads on bodies and between pairs: loops over the kinds in `forces`, generated at compile time.

Each kind has a separate table, so that kernels do not check the kind of a row.
"""

from ..forces import LOADS
from .compiler.jit import part, sweep
from .motions import project
from .pushes import onto_body, onto_row
from .riders import drive_riders, free_riders, unload_riders
from .rows import add_bias, bias_of, link_of, parent_of, set_bias
from .vec import add_cross, scale, store

RIDERS = len(LOADS)  # their place in `loads`, which have no names in lanes


def _applying(kind):
    exert = kind.action.onto(onto_row)

    @sweep
    def all_of(own, work, linear, q, t):
        """Apply the loads of one kind. Returns the powers supplied and dissipated [W]."""
        table, knots, vias = own
        put_in = 0.0
        dissipated = 0.0
        for i in range(table.shape[0]):
            more, lost = exert(table[i], knots, vias, work, linear, q, t, work)
            put_in += more
            dissipated += lost
        return put_in, dissipated

    return all_of


def _collecting(kind):
    exert = kind.action.onto(onto_body)

    @sweep
    def all_of(own, bodies_i, bodies_f, work, rows, linear, q, t, external):
        """Add the loads of one kind to `external` (nb, 6), of a tree with this number of rows."""
        table, knots, vias = own
        to = bodies_i, bodies_f, work, rows, external
        for i in range(table.shape[0]):
            exert(table[i], knots, vias, work, linear, q, t, to)

    return all_of


def _storing(kind):
    energy = kind.action.energy

    @sweep
    def all_of(own, work, q):
        """Return the energy of the loads of one kind [J]."""
        table, knots, vias = own
        total = 0.0
        for i in range(table.shape[0]):
            total += energy(table[i], knots, vias, work, q)
        return total

    return all_of


def _measuring(kind):
    tension = kind.action.tension

    @sweep
    def all_of(own, work, linear, q, t, out, first):
        """Write (tension, length, rate) of the loads of one kind from row `first` of `out` on."""
        table, knots, vias = own
        for i in range(table.shape[0]):
            store(out, first + i, 0, tension(table[i], knots, vias, work, linear, q, t))
        return table.shape[0]

    return all_of


# Each chain is a function that calls another one for the kinds that are left.


def _counts(n):
    if n == len(LOADS):
        return part(lambda loads: 0)
    rest = _counts(n + 1)

    @part
    def count(loads):
        return loads[n][0].shape[0] + rest(loads)

    return count


def _paths(n):
    if n == len(LOADS):
        return part(lambda loads: 0)
    rest = _paths(n + 1)
    if LOADS[n].action.tension is None:
        return rest

    @part
    def count(loads):
        return loads[n][0].shape[0] + rest(loads)

    return count


def _puts(n):
    if n == len(LOADS):
        return part(lambda loads, kind, k, column, value: None)
    rest = _puts(n + 1)

    @part
    def chain(loads, kind, k, column, value):
        if kind == n:
            loads[n][1][k, column] = value
        else:
            rest(loads, kind, k, column, value)

    return chain


def _numbers(n):
    if n == len(LOADS):
        return part(lambda loads, kind, k, column: 0.0)
    rest = _numbers(n + 1)

    @part
    def chain(loads, kind, k, column):
        if kind == n:
            return loads[n][1][k, column]
        return rest(loads, kind, k, column)

    return chain


def _applies(n):
    if n == len(LOADS):
        return part(lambda loads, work, linear, q, t: (0.0, 0.0))
    first, rest = _applying(LOADS[n]), _applies(n + 1)

    @part
    def chain(loads, work, linear, q, t):
        put_in, dissipated = first(loads[n], work, linear, q, t)
        more, lost = rest(loads, work, linear, q, t)
        return put_in + more, dissipated + lost

    return chain


def _collects(n):
    if n == len(LOADS):
        return part(lambda loads, bodies_i, bodies_f, work, rows, linear, q, t, external: None)
    first, rest = _collecting(LOADS[n]), _collects(n + 1)

    @part
    def chain(loads, bodies_i, bodies_f, work, rows, linear, q, t, external):
        first(loads[n], bodies_i, bodies_f, work, rows, linear, q, t, external)
        rest(loads, bodies_i, bodies_f, work, rows, linear, q, t, external)

    return chain


def _stores(n):
    if n == len(LOADS):
        return part(lambda loads, work, q: 0.0)
    rest = _stores(n + 1)
    if LOADS[n].action.energy is None:
        return rest
    first = _storing(LOADS[n])

    @part
    def chain(loads, work, q):
        return first(loads[n], work, q) + rest(loads, work, q)

    return chain


def _measures(n):
    if n == len(LOADS):
        return part(lambda loads, work, linear, q, t, out, begin: None)
    rest = _measures(n + 1)
    if LOADS[n].action.tension is None:
        return rest
    first = _measuring(LOADS[n])

    @part
    def chain(loads, work, linear, q, t, out, begin):
        count = first(loads[n], work, linear, q, t, out, begin)
        rest(loads, work, linear, q, t, out, begin + count)

    return chain


def _tension_at(n):
    if n == len(LOADS):
        return part(lambda loads, work, linear, q, t, i: 0.0 * t)
    rest = _tension_at(n + 1)
    tension = LOADS[n].action.tension
    if tension is None:
        return rest

    @part
    def chain(loads, work, linear, q, t, i):
        table, knots, vias = loads[n]
        if i < table.shape[0]:
            return tension(table[i], knots, vias, work, linear, q, t)[0]
        return rest(loads, work, linear, q, t, i - table.shape[0])

    return chain


# number of loads of all kinds
count_of_loads = _counts(0)
# number of those along paths
count_of_paths = _paths(0)
# a number into a knot of loads of one kind, which is counted from 0
put_in_knots = _puts(0)
# the number there
number_in_knots = _numbers(0)
# all loads onto the rows, after `positions` and `velocities`; powers in and dissipated [W]
apply_loads = _applies(0)
# all loads added to `external` (nb, 6), after `positions` and `velocities`
collect_loads = _collects(0)
# (tension, length, rate) of all loads along paths into rows of `out`, kind after kind [N, m, m/s],
# after `positions` and `velocities`
measure_loads = _measures(0)
# the tension in row i of them [N]
tension_of_load = _tension_at(0)
# energy of the springs between bodies [J], after `positions`
elastic_loads = _stores(0)


@part
def unbiased(rows, work):
    """Set the bias forces of all rows to zero."""
    for k in range(rows.shape[0]):
        set_bias(work, k, (0.0, 0.0, 0.0), (0.0, 0.0, 0.0))


@part
def carry_bias(rows, const, work, tau):
    """Compute τ = Hᵀ φᵀ F of the forces F = -P on the rows, eqs. (12), (23). P is used up."""
    for k in range(rows.shape[0] - 1, 0, -1):
        moment, force = bias_of(work, k)
        project(rows, work, k, const, scale(-1.0, moment), scale(-1.0, force), tau)
        p = parent_of(rows, k)
        add_bias(work, p, add_cross(moment, link_of(work, k), force), force)


def _arms(n):
    if n == len(LOADS):
        return part(lambda rows, const, loads, work, q, lengths, arms, begin: None)
    rest = _arms(n + 1)
    if LOADS[n].action.unit is None:
        return rest
    pulled = LOADS[n].action.unit(onto_row)

    @sweep
    def chain(rows, const, loads, work, q, lengths, arms, begin):
        table, _, vias = loads[n]
        for i in range(table.shape[0]):
            unbiased(rows, work)
            free_riders(loads[RIDERS], work)
            lengths[begin + i] = pulled(table[i], vias, work, work)
            unload_riders(loads[RIDERS], work)
            carry_bias(rows, const, work, arms[begin + i])
            drive_riders(loads[RIDERS], work, q, arms[begin + i])
        rest(rows, const, loads, work, q, lengths, arms, begin + table.shape[0])

    return chain


# length of all loads along paths [m], and -dL/dq: the generalised forces of a tension of 1 N, from
# row `begin` of `lengths` (n,) and `arms` (n, nv) on, kind after kind, after `place_riders`
arms_of_loads = _arms(0)


@sweep
def torque_of_loads(rows, const, loads, work, linear, q, tau):
    """Compute τ = Hᵀ φᵀ F of all loads at t = 0, eqs. (12), (23), after `move_riders`.

    P is used up.
    """
    unbiased(rows, work)
    apply_loads(loads, work, linear, q, 0.0)
    unload_riders(loads[RIDERS], work)
    carry_bias(rows, const, work, tau)
    drive_riders(loads[RIDERS], work, q, tau)
