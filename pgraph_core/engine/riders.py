"""Points of paths that ride: they move in their body with coordinates, or count in a range of one.

A rider has a row of the workspace behind those of the tree, so that paths read it as a point at the
origin of a row. It is placed at c + Σ d f(q) in the axes of its body, with the velocity of this
place and R d f'(q) q' of each shift. What pulls at it acts on its body there, and with the force
F · R d f'(q) on the coordinate, so that the power of a tension is that of the rate of the length.

While it does not count, it lies at the point before or behind it in its path, with which its span
has no length and no direction.
"""

from . import layout as at
from .compiler.jit import part, sweep
from .compiler.masks import both, chosen, most
from .pieces import located, polynomial
from .pushes import apply, onto_body
from .records import INTEGER, REAL, record
from .rows import (
    bias_of,
    counts_of,
    origin_of,
    point_of,
    point_velocity,
    rotation_of,
    set_bias,
    set_counts,
    set_origin,
)
from .vec import add, add_scaled, dot, mul, scale, store, xyz

NEVER = -1  # the gate of a rider that is judged by the coordinate: no run holds its side
RIDER = record(
    row=INTEGER,  # its row of the workspace
    carrier=INTEGER,  # the row that carries it, and the body
    body=INTEGER,
    first_shift=INTEGER,
    shifts=INTEGER,
    gate=INTEGER,  # index into q of the coordinate in whose range it counts, or -1
    gate_v=INTEGER,  # index into v of its speed
    away=INTEGER,  # the row, the body and the point where it is while it does not count
    away_body=INTEGER,
    point=(REAL, 3),  # home axes of the row
    away_point=(REAL, 3),
    low=REAL,  # the range [rad, m]
    high=REAL,
)
SHIFT = record(
    coordinate=INTEGER,  # index into q
    velocity=INTEGER,  # index into v
    first=INTEGER,  # rows of its function in `curves`
    rows=INTEGER,
    along=(REAL, 3),  # home axes of the row of its rider
)
COLUMN = 0  # column of `gates`: the share of a point that counts in a run, or NEVER


@part
def shift_at(one, curves, q):
    """Return f and f' of a shift [m, m/rad]."""
    i, s, beyond, periods = located(
        curves, one.first, one.rows - 1, 1.0, at.PIECE_RATE, q[one.coordinate]
    )
    value, slope, _, _ = polynomial(curves, i, s, beyond, at.PIECE_POWERS, 1)
    rise = curves[one.first + one.rows - 1, at.PIECE_POWERS] - curves[one.first, at.PIECE_POWERS]
    return value + periods * rise, slope


@part
def counting(one, gates, n, q):
    """Return the share of rider n that counts, 0 or 1 if no run holds it."""
    x = q[one.gate]
    held = gates[n, COLUMN] + 0.0 * x
    judged = chosen(both(most(one.low, x), most(x, one.high)), 1.0, 0.0)
    return chosen(most(0.0, held), held, judged)


@part
def mixed(share, a, b):
    return add(scale(share, a), scale(1.0 - share, b))


@sweep
def place_riders(riders, work, q):
    """Place all riders, and free them of forces, after `positions`."""
    table, shifts, curves, gates = riders
    for n in range(table.shape[0]):
        one = table[n]
        none = scale(0.0, origin_of(work, one.carrier))  # zeros of the kind in `work`
        x = add(none, xyz(one.point))
        for m in range(one.first_shift, one.first_shift + one.shifts):
            value, _ = shift_at(shifts[m], curves, q)
            x = add_scaled(x, value, xyz(shifts[m].along))
        p = point_of(x, work, one.carrier)
        if one.gate >= 0:
            share = counting(one, gates, n, q)
            set_counts(work, one.row, share)
            p = mixed(share, p, point_of(xyz(one.away_point), work, one.away))
        set_origin(work, one.row, p)
    free_riders(riders, work)


@sweep
def free_riders(riders, work):
    """Take the forces off all riders."""
    table, _, _, _ = riders
    for n in range(table.shape[0]):
        set_bias(work, table[n].row, (0.0, 0.0, 0.0), (0.0, 0.0, 0.0))


@sweep
def move_riders(riders, work, linear, q, v):
    """Write the velocities of all riders, after `place_riders` and `velocities`."""
    table, shifts, curves, _ = riders
    for n in range(table.shape[0]):
        one = table[n]
        k, p = one.row, origin_of(work, one.row)
        u = point_velocity(work, linear, one.carrier, p)
        for m in range(one.first_shift, one.first_shift + one.shifts):
            _, slope = shift_at(shifts[m], curves, q)
            along = mul(rotation_of(work, one.carrier), xyz(shifts[m].along))
            u = add_scaled(u, slope * v[shifts[m].velocity], along)
        if one.gate >= 0:
            u = mixed(counts_of(work, k), u, point_velocity(work, linear, one.away, p))
        store(linear, k, 0, u)


@part
def pulls_on(one, work):
    """Return the forces of a rider on its body, and on that where it lies while it does not
    count."""
    _, bias = bias_of(work, one.row)
    force = scale(-1.0, bias)
    if one.gate < 0:
        return force, scale(0.0, force)
    share = counts_of(work, one.row)
    return scale(share, force), scale(1.0 - share, force)


@sweep
def unload_riders(riders, work):
    """Pass the forces of all riders on to the rows that carry them."""
    table, _, _, _ = riders
    none = (0.0, 0.0, 0.0)
    for n in range(table.shape[0] - 1, -1, -1):
        one = table[n]
        p, (own, other) = origin_of(work, one.row), pulls_on(one, work)
        apply(work, one.carrier, p, none, own)
        if one.gate >= 0:
            apply(work, one.away, p, none, other)


@sweep
def drive_riders(riders, work, q, tau):
    """Add to τ what the forces of all riders do along their coordinates, after `unload_riders`."""
    table, shifts, curves, _ = riders
    for n in range(table.shape[0]):
        one = table[n]
        own, _ = pulls_on(one, work)
        for m in range(one.first_shift, one.first_shift + one.shifts):
            _, slope = shift_at(shifts[m], curves, q)
            along = mul(rotation_of(work, one.carrier), xyz(shifts[m].along))
            tau[shifts[m].velocity] += slope * dot(along, own)


@sweep
def collect_riders(riders, bodies_i, bodies_f, work, rows, external):
    """Add the forces of all riders to the wrenches on the bodies that carry them, `external` (nb,
    6), of a tree with this number of rows."""
    table, _, _, _ = riders
    to, none = (bodies_i, bodies_f, work, rows, external), (0.0, 0.0, 0.0)
    for n in range(table.shape[0] - 1, -1, -1):
        one = table[n]
        p, (own, other) = origin_of(work, one.row), pulls_on(one, work)
        onto_body(to, one.carrier, one.body, p, none, own)
        if one.gate >= 0:
            onto_body(to, one.away, one.away_body, p, none, other)
