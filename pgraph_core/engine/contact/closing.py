"""Closing speeds of shapes, and thresholds for impacts.

The module has scales of gaps and depths, speeds of shapes, and bounds of closing speeds.
"""

import math

from ...tolerances import COINCIDENT, EPS, NOTABLE
from ..arrays import opened
from ..compiler.jit import part
from ..constraints.blocks import point_velocity
from ..records import POINTS, SPHERE
from ..rows import spin_of
from ..vec import dot, sub, xyz
from .contacts import contacts_at, relative_velocity
from .placing import DEPTH

COORDINATES = 4 * EPS  # rounding of a gap, relative to the coordinates it is the difference of
# multiple of the speed that weight adds in a step, below which impacts are not located
LOCATED_FROM = 4.0
PART = 0.2  # largest unchecked motion per step, relative to half the thickness


@part
def smaller_size(contacts, a, b):
    """Return the size of the smaller of two shapes, the scale for gaps and depths [m].

    b is -1 for the ground. Runs for an error estimate use a smaller value.
    """
    shapes = contacts.geometry.shapes
    size = shapes[a].reach
    if b >= 0:
        size = min(size, shapes[b].reach)
    return contacts.tally[0].fine * (size if size > 0.0 else contacts.tally[0].length)


@part
def closed_gap(contacts, a, b, p):
    """Find the largest gap of two shapes at point p that counts as closed [m]."""
    rounding = COORDINATES * (abs(p[0]) + abs(p[1]) + abs(p[2]))
    return max(COINCIDENT * smaller_size(contacts, a, b), rounding)


@part
def hits(closing, h, size, pull):
    """Check whether a closing speed is an impact to be located in steps of size h."""
    return closing * h > DEPTH * size and closing > LOCATED_FROM * pull * h


@part
def thickness(shape):
    """Return the thickness of a shape [m], 0 for points."""
    if shape.kind == POINTS:
        return 0.0
    half = shape.half_extents
    return min(half[0], min(half[1], half[2]))


@part
def thinner(contacts, a, b):
    """Return half the thickness of the thinner of two shapes [m]. Use b = -1 for the ground.

    Shapes without thickness (points, and balls of radius 0) are ignored. The result is 0 if no
    shape has a thickness.
    """
    shapes = contacts.geometry.shapes
    thin = thickness(shapes[a])
    other = thickness(shapes[b]) if b >= 0 else 0.0
    if thin > 0.0 and other > 0.0:
        return min(thin, other)
    return max(thin, other)


@part
def log_depth(tally, depth, thickness, pair, t):
    """Record the penetration [m] of two shapes relative to their thickness, or of points without
    scaling."""
    tally.penetration = max(tally.penetration, depth)
    share = depth / thickness if thickness > 0.0 else depth
    if share > tally.deepest:
        tally.deepest = share
        tally.deepest_depth = depth
        tally.deepest_pair = pair
        tally.deepest_time = t


@part
def shape_speed(work, linear, shape, pose):
    """Return an upper bound on the speed of a shape's points [m/s]."""
    u, _, turning = motion_of(work, linear, shape, pose)
    return math.sqrt(dot(u, u)) + turning


@part
def point_closing(work, linear, contacts, n):
    """Return the speed at which the gap at contact point n closes [m/s]."""
    return -dot(relative_velocity(contacts, work, linear, n), xyz(contacts.found[n].normal))


@part
def closing_bound(scene, i, j, normal, left):
    """Bound the speed at which any points of two shapes approach along a normal."""
    data = opened(scene)
    contacts = contacts_at(data.links.contacts)
    shapes, poses = contacts.geometry.shapes, contacts.poses
    u, turn, arm = motion_of(data.work, data.space.linear, shapes[i], poses[i])
    if j >= 0:
        w, more, other = motion_of(data.work, data.space.linear, shapes[j], poses[j])
        u = sub(u, w)
        turn = max(turn, more)
        arm += other
    size = math.sqrt(dot(u, u))
    bend = min(1.0, turn * left) * size + 2.0 * contacts.tally[0].pull * left
    slanted = NOTABLE * size  # along a normal that is as far off
    return max(-dot(u, normal), 0.0) + arm + bend + slanted


@part
def motion_of(work, linear, shape, pose):
    """Return a shape's velocity, angular speed and speed of points by turning (0 for a ball)."""
    k = shape.row
    u = point_velocity(work, linear, k, xyz(pose.position))
    w = spin_of(work, k)
    turn = math.sqrt(dot(w, w))
    return u, turn, 0.0 if shape.kind == SPHERE else turn * shape.reach


@part
def curving_bound(scene, i, j):
    """Bound the rate of change of the closing speed between any points of two shapes [m/s²].

    The bound is due to gravity and to the rotation of the points and of the contact normal. j is -1
    for the ground.
    """
    data = opened(scene)
    contacts = contacts_at(data.links.contacts)
    shapes, poses = contacts.geometry.shapes, contacts.poses
    u, turn, arm = motion_of(data.work, data.space.linear, shapes[i], poses[i])
    turning = turn * arm
    if j >= 0:
        w, more, other = motion_of(data.work, data.space.linear, shapes[j], poses[j])
        u = sub(u, w)
        turning += more * other + max(turn, more) * math.sqrt(dot(u, u))
    return turning + 2.0 * contacts.tally[0].pull
