"""Swing foot trajectories over the ground sensed by the stance feet, in heading axes.

The controller knows the steps of the ground. Feet land away from their edges and swing over the
steps in between.
"""

from ..compiler.jit import part, sweep
from ..compiler.masks import larger, smaller
from ..vec import add_scaled, scale, sub, xyz
from .tables import FEET, into, out_of, smooth

LIFTED, RELEASED = 0.04, 0.2  # parts of a swing in which the foot only lifts, and is released
SURE = 0.5  # load on the ground relative to a full one above which the slope is known
SPREAD = 1e-3  # m²: feet closer together along x say nothing of a slope
EDGE = 0.06  # least distance of a foot from an edge, relative to the height of the centre of mass
LEVEL = 5e-3  # least height of an edge, relative to the height of the centre of mass
BETWEEN = 6  # places on a foot's way at which it looks for what to swing over


@sweep
def ground(feet, guess):
    """Return (confidence, centre of the loaded feet, slope along x, guess), the ground as sensed by
    the feet.

    `guess` is its height where no foot carries.
    """
    none = 0.0 * guess
    total = none + 1e-9
    middle = (none, none, none)
    for f in range(FEET):
        total += feet[f].load
        middle = add_scaled(middle, feet[f].load, xyz(feet[f].place))
    middle = scale(1.0 / total, middle)
    xx = none + SPREAD
    xy = none
    for f in range(FEET):
        d = sub(xyz(feet[f].place), middle)
        xx += feet[f].load * d[0] * d[0]
        xy += feet[f].load * d[0] * d[1]
    sure = smooth(total / SURE)
    return sure, middle, sure * xy / xx, guess


@part
def level_at(felt, x):
    """Compute the height of the ground at x."""
    sure, middle, slope, guess = felt
    return sure * (middle[1] + slope * (x - middle[0])) + (1.0 - sure) * guess


@part
def cell(edges, x):
    """Return the index of the interval between edges that contains x, or -1 if there is none."""
    low, high = 0, edges.shape[0] - 1
    if high < 1 or not edges[0] <= x < edges[high]:
        return -1
    while high - low > 1:
        k = (low + high) // 2
        if edges[k] <= x:
            low = k
        else:
            high = k
    return low


@part
def raised(terrain, i, j):
    """Return the height of a cell above the ground plane."""
    if 0 <= i < terrain.heights.shape[0] and 0 <= j < terrain.heights.shape[1]:
        return terrain.heights[i, j]
    return 0.0


@part
def height_at(terrain, s, x, z):
    """Compute the height of the known ground, in world axes."""
    steps = raised(terrain, cell(terrain.x, x), cell(terrain.z, z))
    return s.rise_x * x + s.rise_z * z + steps


@part
def within(edges, i, x, low, high):
    """Compute the position nearest to x in interval i, `low` and `high` away from its ends."""
    a, b = edges[i] + low, edges[i + 1] - high
    return 0.5 * (a + b) if a > b else min(max(x, a), b)


@part
def beside_edges(terrain, s, heading, at):
    """Compute the position nearest to (x, z), in heading axes, in its cell off the edges."""
    p = out_of(heading, (at[0], 0.0, at[1]))
    i, j = cell(terrain.x, p[0]), cell(terrain.z, p[2])
    if i < 0 or j < 0:
        return at
    here, level, far = raised(terrain, i, j), LEVEL * s.height, EDGE * s.height
    west = far if abs(raised(terrain, i - 1, j) - here) > level else 0.0
    east = far if abs(raised(terrain, i + 1, j) - here) > level else 0.0
    left = far if abs(raised(terrain, i, j - 1) - here) > level else 0.0
    right = far if abs(raised(terrain, i, j + 1) - here) > level else 0.0
    x, z = within(terrain.x, i, p[0], west, east), within(terrain.z, j, p[2], left, right)
    p = into(heading, (x, 0.0, z))
    return p[0], p[2]


@sweep
def ground_between(terrain, s, heading, leave, land):
    """Compute the heights of the known ground at lift-off and landing, and its maximum along the
    path."""
    top = -1e300
    first = 0.0
    last = 0.0
    for k in range(BETWEEN + 1):
        part_done = k / BETWEEN
        x = leave[0] + part_done * (land[0] - leave[0])
        z = leave[1] + part_done * (land[1] - leave[1])
        p = out_of(heading, (x, 0.0, z))
        last = height_at(terrain, s, p[0], p[2])
        first = last if k == 0 else first
        top = max(top, last)
    return first, last, top


@sweep
def step_to(legs, f, s, z, speed, hip, hip_u, u, roll):
    """Return a foot's lift-off and landing from its hip's motion, level, in heading axes."""
    half = 0.5 * legs[f].duty * s.stride
    whole = (1.0 - legs[f].duty) * s.stride
    x = hip[0] + legs[f].ahead
    y = hip[2] + legs[f].side * s.width
    behind = half + whole * z
    ahead = half + whole * (1.0 - z)
    leave = (x - hip_u[0] * behind, y - hip_u[2] * behind)
    more = s.place_drift * (u[2] - s.drift) + s.place_roll * roll
    land = (x + hip_u[0] * ahead + s.place_speed * (u[0] - speed), y + hip_u[2] * ahead + more)
    return leave, land


@part
def lift(s, z, whole, clearance):
    """Compute (height above ground, rate, acceleration) of a swing foot: up, then down to land."""
    zz = z * (1.0 - z)
    odd = 1.0 - 2.0 * z
    c = clearance
    fall = s.landing * whole
    y = 64.0 * c * zz * zz * zz - fall * z * z * z * z * (z - 1.0)
    y1 = 192.0 * c * zz * zz * odd - fall * z * z * z * (5.0 * z - 4.0)
    y2 = 384.0 * c * zz * (odd * odd - zz) - fall * z * z * (20.0 * z - 12.0)
    return y, y1 / whole, y2 / (whole * whole)


@part
def eased(z):
    """Compute (progress, rate, acceleration) at fraction z of a rest-to-rest motion."""
    z = smaller(1.0, larger(0.0, z))
    m = z * z * z * (10.0 + z * (6.0 * z - 15.0))
    return m, 30.0 * z * z * (1.0 - z) * (1.0 - z), 60.0 * z * (1.0 - z) * (1.0 - 2.0 * z)


@part
def over_felt(s, z, whole, felt, m, m1, leave, land):
    """Compute (height, rate, acceleration) of a swing foot above ground that others sense."""
    y, y1, y2 = lift(s, z, whole, s.clearance)
    y += level_at(felt, leave[0] + m * (land[0] - leave[0]))
    y1 += felt[2] * m1 * (land[0] - leave[0])
    return y, y1, y2


@part
def over_steps(s, z, whole, between, low, free):
    """Compute the lift above known ground (`ground_between`) from the foot's height `low`."""
    first, last, top = between
    y, y1, y2 = lift(s, z, whole, s.clearance + max(top - 0.5 * (first + last), 0.0))
    up, up1, up2 = eased(2.0 * z if last > first else 2.0 * z - 1.0)  # up first, down last
    y += first + up * (last - first)
    y = low + free * (y - low)
    y1 += 2.0 * up1 * (last - first) / whole
    y2 += 4.0 * up2 * (last - first) / (whole * whole)
    return y, y1, y2


@sweep
def swing_foot(feet, f, legs, s, terrain, heading, felt, leave, land):
    """Compute (position, velocity, acceleration) of a swing foot in heading axes.

    Lanes have no terrain.
    """
    z = feet[f].swing
    whole = (1.0 - legs[f].duty) * s.stride
    foot = xyz(feet[f].place)
    free = smooth((z - LIFTED) / RELEASED)
    m, m1, m2 = eased(z)
    m1 /= whole
    m2 /= whole * whole
    if terrain is None or terrain.x.shape[0] == 0:
        y, y1, y2 = over_felt(s, z, whole, felt, m, m1, leave, land)
    else:
        leave = beside_edges(terrain, s, heading, leave)
        land = beside_edges(terrain, s, heading, land)
        between = ground_between(terrain, s, heading, leave, land)
        y, y1, y2 = over_steps(s, z, whole, between, foot[1], free)
    dx = land[0] - leave[0]
    dz = land[1] - leave[1]
    x = foot[0] + free * (leave[0] + m * dx - foot[0])
    across = foot[2] + free * (leave[1] + m * dz - foot[2])
    return (x, y, across), (m1 * dx, y1, m1 * dz), (m2 * dx, y2, m2 * dz)
