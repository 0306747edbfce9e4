"""Contacts between balls and thick segments (spheres, capsules, points), and between ball and box.

A capsule is the set within a radius of a segment, so gaps are distances of segments minus radii.
"""

import math

from ...tolerances import COINCIDENT, ROUNDING
from ..compiler.jit import part, sweep
from ..vec import add, add_scaled, cross, dot, matrix, mul, mul_t, scale, sub, xyz
from .placing import put

PARALLEL = ROUNDING * ROUNDING  # squared sine of lines that cross nowhere and span no plane


@sweep
def ball_ball(out, n, centre_a, radius_a, centre_b, radius_b, margin):
    """Write the contact between two balls, with normal z if their centres coincide."""
    between = sub(centre_a, centre_b)
    distance = math.sqrt(dot(between, between))
    gap = distance - radius_a - radius_b
    if gap > margin:
        return n
    normal = scale(1.0 / distance, between) if distance > 0.0 else (0.0, 0.0, 1.0)
    return put(out, n, add_scaled(centre_b, radius_b, normal), normal, gap, 0)


@part
def along(p, start, way):
    """Compute the parameter t of the point on start + t way nearest to a point, 0 for no length."""
    size = dot(way, way)
    return dot(sub(p, start), way) / size if size > 0.0 else 0.0


@part
def between(x, low, high):
    return min(max(x, low), high)


@sweep
def ball_segment(centre, start, way):
    """Return the point on a segment nearest to a point."""
    return add_scaled(start, between(along(centre, start, way), 0.0, 1.0), way)


@part
def is_over(t, way, slack):
    """Check whether parameter t lies on a segment, within the length `slack`."""
    return abs(t - 0.5) * math.sqrt(dot(way, way)) <= 0.5 * math.sqrt(dot(way, way)) + slack


@part
def end_pair(k, p, d, q, e, slack):
    """Return (point on p + s d, point on q + t e, whether the second is free) for end k of the two.

    Ends 0 and 1 belong to the first segment, and ends 2 and 3 to the second. An end is free if its
    perpendicular foot lies on the other segment. Opposite ends within a distance of `slack` are
    merged, and so are both ends of a segment that is no longer than `slack`.
    """
    if k < 2:
        a = p if k == 0 else add(p, d)
        t = along(a, q, e)
        free = is_over(t, e, slack) and (k == 0 or dot(d, d) > slack * slack)
        return a, add_scaled(q, between(t, 0.0, 1.0), e), free
    b = q if k == 2 else add(q, e)
    s = along(b, p, d)
    free = is_over(s, d, -slack) and (k == 2 or dot(e, e) > slack * slack)
    return add_scaled(p, between(s, 0.0, 1.0), d), b, free


@part
def crossing(p, d, q, e):
    """Compute (s, t) where two lines are nearest, or -1 for both if parallel or a point."""
    r = sub(p, q)
    dd, ee, de = dot(d, d), dot(e, e), dot(d, e)
    n = cross(d, e)
    size = dot(n, n)  # = dd ee - de², without its cancellation
    if size <= PARALLEL * dd * ee:
        return -1.0, -1.0
    dr, er = dot(d, r), dot(e, r)
    return (de * er - dr * ee) / size, (dd * er - de * dr) / size


@part
def apart(d, e, middle):
    """Return a unit direction away from the second of two crossing segments, as `middle`."""
    n = cross(d, e)
    size = dot(n, n)
    if size <= PARALLEL * dot(d, d) * dot(e, e) or size == 0.0:
        along_both = d if dot(d, d) >= dot(e, e) else e
        n = cross(along_both, cross(middle, along_both))
        size = dot(n, n)
        if size <= PARALLEL * dot(along_both, along_both) ** 2 * dot(middle, middle) or size == 0.0:
            x, y, z = abs(along_both[0]), abs(along_both[1]), abs(along_both[2])
            helper = (1.0, 0.0, 0.0) if x <= y and x <= z else (0.0, 1.0, 0.0)
            n = cross(along_both, helper) if x + y + z > 0.0 else (0.0, 0.0, 1.0)
            size = dot(n, n)
    n = scale(1.0 / math.sqrt(size), n)
    return n if dot(n, middle) >= 0.0 else scale(-1.0, n)


@sweep
def segment_segment(out, n, p, d, radius_a, q, e, radius_b, margin, feature):
    """Write up to 5 contact points between segments p + s d and q + t e with radii.

    The points are the closest pair and every end with a perpendicular foot on the other segment.
    Two parallel capsules therefore touch at two points. Features from `feature` on: ends 0 to 3,
    inner pair 4.
    """
    lengths = math.sqrt(dot(d, d)) + math.sqrt(dot(e, e))
    slack = COINCIDENT * lengths
    s, t = crossing(p, d, q, e)
    inner = 0.0 < s < 1.0 and 0.0 < t < 1.0
    best = math.inf
    nearest = 4
    if inner:
        x = sub(add_scaled(p, s, d), add_scaled(q, t, e))
        best = dot(x, x)
    for k in range(4):
        a, b, free = end_pair(k, p, d, q, e, slack)
        x = sub(a, b)
        if dot(x, x) < best:
            best = dot(x, x)
            nearest = k
    if math.sqrt(best) - radius_a - radius_b > margin:
        return n
    middle = sub(add_scaled(p, 0.5, d), add_scaled(q, 0.5, e))
    normal = apart(d, e, middle)
    size = radius_a + radius_b + lengths
    for k in range(5):
        if k == 4:
            a = add_scaled(p, s, d)
            b = add_scaled(q, t, e)
            free = inner
        else:
            a, b, free = end_pair(k, p, d, q, e, slack)
        x = sub(a, b)
        distance = math.sqrt(dot(x, x))
        gap = distance - radius_a - radius_b
        if (free or k == nearest) and gap <= margin:
            way = scale(1.0 / distance, x) if distance > ROUNDING * size else normal
            n = put(out, n, add_scaled(b, radius_b, way), way, gap, feature + k)
    return n


@sweep
def ball_box(out, n, centre, radius, geometry, poses, j, sign, margin):
    """Write the contact between a ball and box j, which is B if `sign` is 1 and A if it is -1."""
    r = matrix(poses[j].rotation)
    origin = xyz(poses[j].position)
    half = xyz(geometry.shapes[j].half_extents)
    c = mul_t(r, sub(centre, origin))
    nearest = (
        between(c[0], -half[0], half[0]),
        between(c[1], -half[1], half[1]),
        between(c[2], -half[2], half[2]),
    )
    x = sub(c, nearest)
    distance = math.sqrt(dot(x, x))
    if distance > 0.0:
        normal = scale(1.0 / distance, x)
    else:
        normal, distance = inside_box(c, half)
        nearest = add_scaled(c, -distance, normal)
    gap = distance - radius
    if gap > margin:
        return n
    normal = mul(r, normal)
    on_box = add(origin, mul(r, nearest))
    if sign > 0.0:
        return put(out, n, on_box, normal, gap, 0)
    return put(out, n, add_scaled(on_box, gap, normal), scale(-1.0, normal), gap, 0)


@part
def inside_box(c, half):
    """Compute (normal of the nearest face, signed distance to it) for a point inside a box."""
    x, y, z = abs(c[0]) - half[0], abs(c[1]) - half[1], abs(c[2]) - half[2]
    if x >= y and x >= z:
        return (math.copysign(1.0, c[0]), 0.0, 0.0), x
    if y >= z:
        return (0.0, math.copysign(1.0, c[1]), 0.0), y
    return (0.0, 0.0, math.copysign(1.0, c[2])), z
