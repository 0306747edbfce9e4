"""Cables over wheels: tangents, length, forces and the second derivative of the length.

A cable consists of segments, which have one tension each. A segment leads from station to station:
points, and wheels on which it lies. It slides over inner wheels without friction. At its ends it is
fixed to a point, or it grips a wheel and winds on it.

Between two points, the wheels of a segment have parallel axes u. A wheel has the signed radius s,
which is positive if the cable turns about u by the right hand. In the plane normal to u, the span
from a to b has a direction d and the normal n = u × d. It touches the circles at a - s n and b - t
n, so that (b - a) · n = t - s, and its length is l = √(|b - a|² - (t - s)²). The cable on a
cylinder is straight if it is unrolled: with the distance h of its points along u, it is
√(l² + h²) long. A cable that grips a wheel leaves it normal to its axis, wherever it is, as from a
drum with grooves.

A wheel with friction μ divides a cable like one that it grips. If the cable turns by θ on it, the
tensions on both sides have a ratio between e^-μθ and e^μθ [Euler, Eytelwein]. Segments between
which the cable may slip are a chain, whose length is that of all of them with the arcs between.

The angle of n in the body that carries a wheel, minus the wheel's own coordinate, is the angle by
which the cable is wound on it. The coordinate counts turns.
"""

import math

from ..tolerances import TINY
from .compiler.elementary import atan2, exp
from .compiler.jit import part, sweep
from .compiler.masks import chosen, larger, more
from .records import INTEGER, REAL
from .rows import (
    acceleration_of,
    point_acceleration,
    point_of,
    point_velocity,
    rotation_of,
    spin_of,
)
from .vec import add, add_scaled, cross, dot, mul, scale, sub, xyz

# shapes of stations, behind those of obstacles: a point, a wheel over which it slides, a wheel that
# it grips
EYE, WHEEL, GRIP = 4, 5, 6
FULL_TURN = 2.0 * math.pi

# of a wheel, beside the fields of an obstacle: its `radius` is signed, and from its `side`, in the
# home axes of `frame`, the angle of the cable is counted
STATION = {
    "frame": INTEGER,  # the row that carries a wheel
    "coordinate": INTEGER,  # index into q of a wheel's angle
    "gear": REAL,  # 1 or -1: the sense of this angle about the axis
    "wrap": REAL,  # angle about the axis by which the cable turns in the initial state [rad]
    "friction": REAL,  # Coulomb's coefficient on a wheel on which it may slip, or 0
}


@part
def is_round(one):
    return one.shape == WHEEL or one.shape == GRIP


@part
def centre_of(one, work):
    """Return a station's centre, world axes."""
    return point_of(xyz(one.point), work, one.row)


@part
def axis_of_wheel(one, work):
    """Return a wheel's axis, world axes, and zero for a point."""
    return mul(rotation_of(work, one.row), xyz(one.axis))


@part
def end_of_group(vias, first, last):
    """Return the next station behind `first` that is not an inner wheel."""
    end = first + 1
    while end < last and vias[end].shape == WHEEL:
        end += 1
    return end


@part
def wheel_of_group(vias, first):
    """Return the station whose axis is that of a group, a point if the group has no wheel."""
    return first if is_round(vias[first]) else first + 1


@part
def is_flat(vias, first, end):
    """Check whether a group grips a wheel, so that it lies in a plane normal to its axis."""
    return vias[first].shape == GRIP or vias[end].shape == GRIP


@part
def straight(u, s, t, a, b):
    """Return (direction in the plane normal to u, length in it) of the span from the circle with
    signed radius s about a to that with radius t about b."""
    apart = sub(b, a)
    flat = add_scaled(apart, -dot(u, apart), u)
    square, turn = dot(flat, flat), t - s
    length = math.sqrt(larger(square - turn * turn, 0.0) + TINY)
    along = add_scaled(scale(length, flat), -turn, cross(u, flat))
    return scale(1.0 / (square + TINY), along), length


@part
def turned(u, before, after, near):
    """Return the angle about u between directions, of all its values the nearest to `near`."""
    angle = atan2(dot(u, cross(before, after)), dot(before, after))
    return angle + FULL_TURN * math.floor((near - angle) / FULL_TURN + 0.5)


@sweep
def measured_group(vias, work, first, end):
    """Return (axis, length in the plane, way along the axis) of a group of stations."""
    u = axis_of_wheel(vias[wheel_of_group(vias, first)], work)
    begin = a = centre_of(vias[first], work)
    s, before, length = vias[first].radius, a, 0.0
    for n in range(first + 1, end + 1):
        b, t = centre_of(vias[n], work), vias[n].radius
        d, way = straight(u, s, t, a, b)
        if n > first + 1:
            length += s * turned(u, before, d, vias[n - 1].wrap)
        length += way
        a, s, before = b, t, d
    slides = 0.0 if is_flat(vias, first, end) else 1.0
    return u, length, slides * dot(u, sub(a, begin))


@sweep
def wound_by(vias, work, q, n, u, d):
    """Return the signed length by which a cable turns on wheel n that it grips, seen from the body
    that carries the wheel, minus that by which the wheel turns."""
    one = vias[n]
    ahead = mul(rotation_of(work, one.frame), xyz(one.side))
    normal = cross(u, d)
    angle = atan2(dot(cross(u, ahead), normal), dot(ahead, normal))
    return one.radius * (angle - one.gear * q[one.coordinate])


@sweep
def turned_on(vias, work, n):
    """Return the angle about its axis by which a cable turns on the inner wheel n."""
    u = axis_of_wheel(vias[n], work)
    a, b, c = (
        centre_of(vias[n - 1], work), centre_of(vias[n], work), centre_of(vias[n + 1], work),
    )  # fmt: skip
    before, _ = straight(u, vias[n - 1].radius, vias[n].radius, a, b)
    after, _ = straight(u, vias[n].radius, vias[n + 1].radius, b, c)
    return turned(u, before, after, vias[n].wrap)


@sweep
def hold_of(vias, work, n):
    """Return μθ of the inner wheel n, the logarithm of the largest ratio of tensions."""
    angle = turned_on(vias, work, n)
    return vias[n].friction * larger(chosen(more(vias[n].radius, 0.0), angle, -angle), 0.0)


@sweep
def changes_at(vias, work, n):
    """Return the least and the largest change of the tension at the inner wheel n, relative to the
    tension before it."""
    hold = hold_of(vias, work, n)
    return exp(-hold) - 1.0, exp(hold) - 1.0


@sweep
def cable_length(vias, work, q, first, last):
    """Return the length of the chain between two stations, with what is wound on its wheels."""
    total = 0.0
    begin = first
    while begin < last:
        end = end_of_group(vias, begin, last)
        u, length, rise = measured_group(vias, work, begin, end)
        total += math.sqrt(length * length + rise * rise + TINY)
        if end < last and vias[end].shape == GRIP:
            total += vias[end].radius * turned_on(vias, work, end)
        begin = end
    if vias[first].shape == GRIP:
        u = axis_of_wheel(vias[first], work)
        a, b = centre_of(vias[first], work), centre_of(vias[first + 1], work)
        d, _ = straight(u, vias[first].radius, vias[first + 1].radius, a, b)
        total += wound_by(vias, work, q, first, u, d)
    if vias[last].shape == GRIP:
        u = axis_of_wheel(vias[last], work)
        a, b = centre_of(vias[last - 1], work), centre_of(vias[last], work)
        d, _ = straight(u, vias[last - 1].radius, vias[last].radius, a, b)
        total -= wound_by(vias, work, q, last, u, d)
    return total


def over_spans(use):
    """Return the function that adds up `use` over the spans of a segment.

    `use(to, vias, work, n, p, q, along)` gets the number of the station behind a span, its first
    and last point, and the unit vector from one to the other, world axes.
    """

    @sweep
    def all_spans(to, vias, work, first, last):
        total = 0.0
        begin = first
        while begin < last:
            end = end_of_group(vias, begin, last)
            u, length, rise = measured_group(vias, work, begin, end)
            whole = math.sqrt(length * length + rise * rise + TINY)
            ahead, up = length / whole, rise / whole
            a, s = centre_of(vias[begin], work), vias[begin].radius
            before = a
            known = end if vias[begin].shape == GRIP else begin
            height = dot(u, centre_of(vias[known], work))
            slope = rise / (length + TINY)
            for n in range(begin + 1, end + 1):
                b, t = centre_of(vias[n], work), vias[n].radius
                d, way = straight(u, s, t, a, b)
                if n > begin + 1:
                    height += slope * s * turned(u, before, d, vias[n - 1].wrap)
                normal = cross(u, d)
                p = add_scaled(add_scaled(a, -s, normal), height - dot(u, a), u)
                height += slope * way
                q = add_scaled(add_scaled(b, -t, normal), height - dot(u, b), u)
                total += use(to, vias, work, n, p, q, add_scaled(scale(ahead, d), up, u))
                a, s, before = b, t, d
            begin = end
        return total

    return all_spans


@part
def closing(linear, vias, work, n, p, q, along):
    """Return the rate of a span from its material points."""
    v = point_velocity(work, linear, vias[n - 1].row, p)
    return dot(along, sub(point_velocity(work, linear, vias[n].row, q), v))


# (linear, vias, work, first, last): the rate of the length of a segment
cable_rate = over_spans(closing)


@sweep
def first_span(vias, work, first, last):
    """Return (first point of a segment, unit vector along it there), world axes."""
    end = end_of_group(vias, first, last)
    u, length, rise = measured_group(vias, work, first, end)
    whole = math.sqrt(length * length + rise * rise + TINY)
    a, b = centre_of(vias[first], work), centre_of(vias[first + 1], work)
    s = vias[first].radius
    d, _ = straight(u, s, vias[first + 1].radius, a, b)
    known = end if vias[first].shape == GRIP else first
    height = dot(u, sub(centre_of(vias[known], work), a))
    p = add_scaled(add_scaled(a, -s, cross(u, d)), height, u)
    return p, add_scaled(scale(length / whole, d), rise / whole, u)


# -- second derivatives: numbers and vectors with two derivatives in time --------------------------


@part
def plus(x, y):
    return x[0] + y[0], x[1] + y[1], x[2] + y[2]


@part
def minus(x, y):
    return x[0] - y[0], x[1] - y[1], x[2] - y[2]


@part
def times(x, y):
    return x[0] * y[0], x[1] * y[0] + x[0] * y[1], x[2] * y[0] + 2.0 * x[1] * y[1] + x[0] * y[2]


@part
def by(x, y):
    """Return the number x times the vector y."""
    second = add_scaled(scale(x[2], y[0]), 2.0 * x[1], y[1])
    return (
        scale(x[0], y[0]),
        add_scaled(scale(x[1], y[0]), x[0], y[1]),
        add_scaled(second, x[0], y[2]),
    )


@part
def apart_from(x, y):
    return sub(x[0], y[0]), sub(x[1], y[1]), sub(x[2], y[2])


@part
def along_each(x, y):
    """Return the scalar product of two vectors."""
    second = dot(x[2], y[0]) + 2.0 * dot(x[1], y[1]) + dot(x[0], y[2])
    return dot(x[0], y[0]), dot(x[1], y[0]) + dot(x[0], y[1]), second


@part
def across_each(x, y):
    """Return the vector product of two vectors."""
    second = add_scaled(cross(x[2], y[0]), 2.0, cross(x[1], y[1]))
    first = add(cross(x[1], y[0]), cross(x[0], y[1]))
    return cross(x[0], y[0]), first, add(second, cross(x[0], y[2]))


@part
def root(x):
    r = math.sqrt(larger(x[0], 0.0) + TINY)
    rate = 0.5 * x[1] / r
    return r, rate, (0.5 * x[2] - rate * rate) / r


@part
def inverse(x):
    r = 1.0 / (x[0] + TINY)
    rate = -x[1] * r * r
    return r, rate, -(x[2] * r + 2.0 * x[1] * rate) * r


@part
def angle_of(y, x, value):
    """Return the angle with the tangent y / x, whose value is known."""
    area = minus(times(x, (y[1], y[2], 0.0)), times(y, (x[1], x[2], 0.0)))
    square = plus(times(x, x), times(y, y))
    share = 1.0 / (square[0] + TINY)
    rate = area[0] * share
    return value, rate, (area[1] - rate * square[1]) * share


@part
def moving_centre(one, work, linear):
    """Return a station's centre with its velocity and acceleration."""
    p = centre_of(one, work)
    v = point_velocity(work, linear, one.row, p)
    return p, v, point_acceleration(work, one.row, p)


@part
def moving_vector(work, k, x):
    """Return a vector that is fixed in row k, with its derivatives."""
    w = spin_of(work, k)
    rate = cross(w, x)
    return x, rate, add(cross(acceleration_of(work, k)[0], x), cross(w, rate))


@part
def moving_span(u, s, t, a, b):
    """Return `straight` with derivatives."""
    apart = apart_from(b, a)
    flat = apart_from(apart, by(along_each(u, apart), u))
    square, turn = along_each(flat, flat), t - s
    length = root((square[0] - turn * turn, square[1], square[2]))
    constant = (turn, 0.0, 0.0)
    ahead = apart_from(by(length, flat), by(constant, across_each(u, flat)))
    return by(inverse(square), ahead), length


@sweep
def moving_group(vias, work, linear, first, end):
    """Return the length of a group with derivatives."""
    k = wheel_of_group(vias, first)
    u = moving_vector(work, vias[k].row, axis_of_wheel(vias[k], work))
    begin = a = moving_centre(vias[first], work, linear)
    none = scale(0.0, a[0])
    s, before, length = vias[first].radius, a, none
    for n in range(first + 1, end + 1):
        b, t = moving_centre(vias[n], work, linear), vias[n].radius
        d, way = moving_span(u, s, t, a, b)
        if n > first + 1:
            value = turned(u[0], before[0], d[0], vias[n - 1].wrap)
            sine = along_each(u, across_each(before, d))
            angle = angle_of(sine, along_each(before, d), value)
            length = plus(length, times((s, 0.0, 0.0), angle))
        length = plus(length, way)
        a, s, before = b, t, d
    rise = none if is_flat(vias, first, end) else along_each(u, apart_from(a, begin))
    return root(plus(times(length, length), times(rise, rise)))


@sweep
def winding_acceleration(vias, work, linear, n, first):
    """Return the second derivative of `wound_by` at the wheel n, of the span behind `first`."""
    one = vias[n]
    u = moving_vector(work, one.row, axis_of_wheel(one, work))
    a = moving_centre(vias[first], work, linear)
    b = moving_centre(vias[first + 1], work, linear)
    d, _ = moving_span(u, vias[first].radius, vias[first + 1].radius, a, b)
    normal = across_each(u, d)
    side = mul(rotation_of(work, one.frame), xyz(one.side))
    ahead = moving_vector(work, one.frame, side)
    sine = along_each(across_each(u, ahead), normal)
    angle = angle_of(sine, along_each(ahead, normal), 0.0)
    spin = sub(spin_of(work, one.row), spin_of(work, one.frame))
    faster = sub(acceleration_of(work, one.row)[0], acceleration_of(work, one.frame)[0])
    return one.radius * (angle[2] - dot(u[0], faster) - dot(u[1], spin))


@sweep
def cable_acceleration(vias, work, linear, first, last):
    """Return the second derivative of `cable_length`, from V' of the sweeps."""
    total = 0.0
    begin = first
    while begin < last:
        end = end_of_group(vias, begin, last)
        total += moving_group(vias, work, linear, begin, end)[2]
        if end < last and vias[end].shape == GRIP:
            total += winding_acceleration(vias, work, linear, end, end)
            total -= winding_acceleration(vias, work, linear, end, end - 1)
        begin = end
    if vias[first].shape == GRIP:
        total += winding_acceleration(vias, work, linear, first, first)
    if vias[last].shape == GRIP:
        total -= winding_acceleration(vias, work, linear, last, last - 1)
    return total
