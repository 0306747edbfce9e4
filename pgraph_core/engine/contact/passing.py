"""Detection and reporting of tunnelling after a step.

The path of the centre of a shape relative to the other shape is assumed to be straight during the
step. A centre that enters and leaves the other shape has passed through it.
"""

import math

from ..arrays import opened
from ..compiler.jit import part, sweep
from ..records import BOX, HEIGHTFIELD, HULL, POINTS, RIGID
from ..vec import add, dot, matrix, mul, mul_t, set_matrix, set_xyz, sub, xyz
from .closing import thickness
from .contacts import contacts_at
from .search import may_collide

CORE = 0.9  # examined core of a shape relative to its extents, since its rim may be grazed
HULL_CORE = 0.4  # examined core of a hull, whose shape its extents do not describe
RADIAN_TRACE = 1 + 2 * math.cos(
    1.0
)  # trace of a rotation of a radian: beyond it, ways are not straight


@sweep
def keep_poses(scene):
    """Store the poses of all shapes at the start of a step."""
    contacts = contacts_at(opened(scene).links.contacts)
    for i in range(contacts.poses.shape[0]):
        set_xyz(contacts.start_poses[i].position, xyz(contacts.poses[i].position))
        set_matrix(contacts.start_poses[i].rotation, matrix(contacts.poses[i].rotation))


@sweep
def note_passages(scene, t):
    """Record the pairs that passed through each other since `keep_poses`, in a step ending at t."""
    contacts = contacts_at(opened(scene).links.contacts)
    may, shapes = contacts.candidates, contacts.geometry.shapes
    for k in range(may.pairs.shape[0]):
        pair = may.pairs[k]
        note_passage(contacts, pair.shape_a, pair.shape_b, pair.pair, t)
    members = may.members
    for m in range(members.shape[0]):
        for k in range(m):
            if may_collide(may, shapes, m, k):
                note_passage(contacts, members[m].shape, members[k].shape, members[m].pair, t)


@part
def note_passage(contacts, i, j, pair, t):
    """Record whether shapes i and j passed through each other."""
    tally = contacts.tally[0]
    if contacts.laws[pair].law == RIGID and (passes(contacts, i, j) or passes(contacts, j, i)):
        if tally.passed == 0:
            tally.passed_pair = pair
            tally.passed_time = t
        tally.passed += 1


@part
def passes(contacts, i, j):
    """Check whether the centre of shape i entered and left shape j."""
    shapes = contacts.geometry.shapes
    kind = shapes[j].kind
    if shapes[i].kind == POINTS or kind == POINTS or kind == HEIGHTFIELD:
        return False
    now, before = contacts.poses, contacts.start_poses
    p = seen_from(before[j], shapes[j], before[i], shapes[i])
    way = sub(seen_from(now[j], shapes[j], now[i], shapes[i]), p)
    if dot(way, way) <= thickness(shapes[j]) ** 2:
        return False
    r, turned = matrix(before[j].rotation), matrix(now[j].rotation)
    trace = 0.0
    for n in range(9):
        trace += r[n] * turned[n]
    half = xyz(shapes[j].half_extents)
    return trace > RADIAN_TRACE and (
        cuts_box(p, way, half) if kind == BOX else cuts_ball(p, way, half, kind == HULL)
    )


@part
def seen_from(pose, shape, other_pose, other):
    """Return the centre of another shape relative to a shape's centre, in its axes."""
    p = add(xyz(other_pose.position), mul(matrix(other_pose.rotation), xyz(other.middle)))
    return sub(mul_t(matrix(pose.rotation), sub(p, xyz(pose.position))), xyz(shape.middle))


@part
def cuts_box(p, way, half):
    """Check whether the segment from p along `way` enters and leaves a box."""
    first, last = -math.inf, math.inf
    for n in range(3):
        wide = CORE * half[n]
        if way[n] == 0.0:
            if abs(p[n]) > wide:
                return False
            continue
        one, two = (-wide - p[n]) / way[n], (wide - p[n]) / way[n]
        first, last = max(first, min(one, two)), min(last, max(one, two))
    return 0.0 < first < last < 1.0


@part
def cuts_ball(p, way, half, is_hull):
    """Check whether the segment from p along `way` enters and leaves an ellipsoid."""
    core = HULL_CORE if is_hull else CORE
    x = (p[0] / (core * half[0]), p[1] / (core * half[1]), p[2] / (core * half[2]))
    d = (way[0] / (core * half[0]), way[1] / (core * half[1]), way[2] / (core * half[2]))
    a, b, c = dot(d, d), dot(x, d), dot(x, x) - 1.0
    root = b * b - a * c
    if not root > 0.0 or not c > 0.0:
        return False
    return b < 0.0 and -b + math.sqrt(root) < a
