"""A block of instances in lanes: the data of its kernels, and copies from and to a run."""

import math
from typing import Any, NamedTuple

from ...tolerances import COINCIDENT
from .. import layout as at
from ..arrays import opened_run
from ..compiler.elementary import FAR
from ..compiler.jit import part, sweep
from ..compiler.lane import LANE_WIDTH, lanes
from ..compiler.masks import larger
from ..contact.closing import COORDINATES, DEPTH, thickness
from ..contact.contacts import FROZEN, contacts_at
from ..contact.manifold import tangents
from ..motion import opened
from ..stepping.state import size_of_state
from ..stepping.unilateral import WEIGHT
from ..vec import xyz


class Block(NamedTuple):
    """Arrays for the kernels of a block of lanes, with the lane as the last axis."""

    const: Any  # (n + 1, CONST) of the bodies
    work: Any  # (n + 1, WORK)
    linear: Any  # (n + 1, 3) velocities of origins
    vectors: Any  # (VECTORS, max(nq, nv)) rows are named below
    drives: Any  # (nd, DRIVE)
    shapes: Any  # (ns, SHAPE)
    vertices: Any  # (nv, 3)
    laws: Any  # (contact pairs, 2) friction, restitution
    bodies: Any  # (nb + 1, 3) from the row's origin to the body's
    points: Any  # (points, POINT)
    y: Any  # (points, 3 w) what unit impulses do in each joint
    own: Any  # (points, 9)
    pairs: Any  # (contact pairs, PAIR)
    wrenches: Any  # (nb + 1, 6)
    lane: Any  # (1, LANE) numbers of the lane


W = LANE_WIDTH

# Rows of `vectors`
Q, V, LEDGER = 0, 1, 2  # the state
NEW_Q, NEW_V = 3, 4  # at the end of the step
TAU, VDOT, GIVEN, PUSHED = 5, 6, 7, 8  # given torques, and with what stiff springs add
DAMPING, STIFFNESS, ARMATURE = 9, 10, 11
STEP, SPEEDS, FREED, DINV, MOVE, DONE, MEAN, ZERO = 12, 13, 14, 15, 16, 17, 18, 19
VECTORS = 20

# columns of `drives`
D_STIFFNESS, D_DAMPING, D_LOW, D_HIGH, D_FRICTION, D_TARGET, D_TORQUE = range(7)
DRIVE = 7

# columns of `shapes`
S_PLACE, S_TURN, S_REACH, S_RADIUS, S_THIN, S_SIZE, S_THICK, S_POSE, S_POSED = (
    0, 3, 12, 13, 14, 15, 16, 17, 20,
)  # fmt: skip
SHAPE = 29

# columns of `points`
FOUND, ACTIVE, GAP, SLACK, MIDDLE, ON_A, ON_B = 0, 1, 2, 3, 4, 7, 10
BEFORE, RATE, TARGET, LAM, HELD, MISSED, SLIP = 13, 16, 19, 22, 25, 28, 30
KEPT, VALUE, SLIDES = 31, 32, 35  # values of the last step
TURNED, PASSED = 36, 39  # PASSED: RATE of the pass before
POINT = 42

# columns of `pairs`
FORCE, TORQUE, P_GAP, P_SLIP, PHASE = 0, 3, 6, 7, 8
P_MEAN = 9  # 6, of force and torque
PAIR = 15

# columns of `lane`
TIME, NORMAL, LENGTH, PULL, ALONE, PUT_IN, LOST = 0, 1, 10, 11, 12, 13, 14
SIZE, OPEN, SWEPT, GAINED, RESIDUAL, LARGEST_DEPTH, COMPLEMENTARITY, CONE = (
    15, 16, 17, 18, 19, 20, 21, 22,
)  # fmt: skip
PENETRATION, LARGEST, WORST, WORST_PAIR, WORST_TIME, DEEPEST, DEEPEST_PAIR = (
    23, 24, 25, 26, 27, 28, 29,
)  # fmt: skip
DEEPEST_TIME, DEEPEST_DEPTH, COUNT, NUMBER, LOGGED, LIVES = 30, 31, 32, 33, 34, 35
ORIGIN, TAKEN, FALLEN, FELL = 36, 37, 38, 39  # when a walk fell first, and with the step under way
STAYS = 40  # 1 where the pass has the rates of that before it
ELAPSED = 41
LANE = 42

# columns of `ways`: of a point its shape, row, body, contact pair, vertex, feature, joints
W_SHAPE, W_ROW, W_BODY, W_PAIR, W_VERTEX, W_FEATURE, W_KIND, W_JOINTS, W_JOINT = range(9)


@part
def closed_gap(b, i, p):
    """Return `closing.closed_gap` above the ground."""
    return larger(
        COINCIDENT * b.shapes[i, S_SIZE], COORDINATES * (abs(p[0]) + abs(p[1]) + abs(p[2]))
    )


@part
def tolerated(b, i, h):
    """Return `unilateral.tolerated`."""
    return larger(DEPTH * b.shapes[i, S_SIZE], WEIGHT * b.lane[0, PULL] * h * h)


@part
def fits(contacts, data, control):
    """Check whether the instance in the run can be stepped in lanes."""
    good = control.done == 0.0 and control.fired == 0 and control.bound == math.inf
    for k in range(contacts.laws.shape[0]):
        law = contacts.laws[k]
        good = good and law.static_friction == law.friction
    return good


@sweep
def take_in(run, ways, drives, b, w, all_):
    """Copy the run's instance into lane w, with constants if `all_`. True if it fits."""
    this = opened_run(run)
    data, control = opened(this.scene), this.control[0]
    contacts = contacts_at(data.links.contacts)
    nq, nv = size_of_state(run)
    y, x = this.stages[at.Y], b.vectors
    if all_:
        take_numbers(data, contacts, ways, drives, b, w)
    far = 0.0
    for i in range(nq):
        x[Q, i, w] = y[i]
        far = max(far, abs(y[i]))
    for j in range(nv):
        x[V, j, w] = y[nq + j]
        x[GIVEN, j, w] = data.given[j]
    x[LEDGER, 0, w] = y[nq + nv]
    x[LEDGER, 1, w] = y[nq + nv + 1]
    kept, tally = contacts.kept, contacts.tally[0]
    for n in range(ways.shape[0]):
        b.points[n, KEPT, w] = 0.0
        for m in range(tally.kept):
            one = kept[m]
            if one.shape_a == ways[n, W_SHAPE] and one.feature == ways[n, W_FEATURE]:
                b.points[n, KEPT, w] = 1.0
                for c in range(3):
                    b.points[n, VALUE + c, w] = one.value[c]
                b.points[n, SLIDES, w] = one.slides
    for k in range(contacts.laws.shape[0]):
        b.pairs[k, PHASE, w] = contacts.pairs[k].phase
        for c in range(3):
            b.pairs[k, P_MEAN + c, w] = contacts.pairs[k].mean_force[c]
            b.pairs[k, P_MEAN + 3 + c, w] = contacts.pairs[k].mean_torque[c]
    lane = b.lane[0]
    lane[ORIGIN, w] = control.origin
    lane[TAKEN, w] = control.taken
    lane[TIME, w] = control.origin + control.taken * control.widest + control.done
    lane[ELAPSED, w] = tally.elapsed
    lane[RESIDUAL, w] = tally.residual
    lane[LARGEST_DEPTH, w] = tally.depth
    lane[COMPLEMENTARITY, w] = tally.complementarity
    lane[CONE, w] = tally.cone
    lane[PENETRATION, w] = tally.penetration
    lane[LARGEST, w] = tally.force
    lane[WORST, w] = tally.worst
    lane[WORST_PAIR, w] = tally.worst_pair
    lane[WORST_TIME, w] = tally.worst_time
    lane[DEEPEST, w] = tally.deepest
    lane[DEEPEST_PAIR, w] = tally.deepest_pair
    lane[DEEPEST_TIME, w] = tally.deepest_time
    lane[DEEPEST_DEPTH, w] = tally.deepest_depth
    lane[LOGGED, w] = 0.0
    lane[COUNT, w] = 0.0
    lane[NUMBER, w] = 0.0
    return far < FAR and fits(contacts, data, control)


@sweep
def take_numbers(data, contacts, ways, drives, b, w):
    """Copy the description of the run's instance into lane w."""
    take_drives(data, drives, b, w)
    shapes, vertices = contacts.geometry.shapes, contacts.geometry.vertices
    tally, plane = contacts.tally[0], contacts.ground.plane[0]
    for i in range(shapes.shape[0]):
        shape = shapes[i]
        for c in range(3):
            b.shapes[i, S_PLACE + c, w] = shape.position[c]
        for c in range(9):
            b.shapes[i, S_TURN + c, w] = shape.rotation[c]
        thin = thickness(shape)
        size = shape.reach if shape.reach > 0.0 else tally.length
        b.shapes[i, S_REACH, w] = shape.reach
        b.shapes[i, S_RADIUS, w] = shape.radius
        b.shapes[i, S_THIN, w] = thin
        b.shapes[i, S_SIZE, w] = size
        b.shapes[i, S_THICK, w] = 2.0 * thin if thin > 0.0 else size
    for i in range(vertices.shape[0]):
        for c in range(3):
            b.vertices[i, c, w] = vertices[i, c]
    for k in range(contacts.laws.shape[0]):
        b.laws[k, 0, w] = contacts.laws[k].friction
        b.laws[k, 1, w] = contacts.laws[k].restitution
    for k in range(contacts.bodies_f.shape[0]):
        for c in range(3):
            b.bodies[k, c, w] = contacts.bodies_f[k, at.OFFSET + c]
    normal = xyz(plane.normal)
    t, s = tangents(normal)
    for c in range(3):
        b.lane[0, NORMAL + c, w] = normal[c]
        b.lane[0, NORMAL + 3 + c, w] = t[c]
        b.lane[0, NORMAL + 6 + c, w] = s[c]
    b.lane[0, LENGTH, w] = tally.length
    b.lane[0, PULL, w] = tally.pull


@sweep
def take_drives(data, drives, b, w):
    """Copy the body and drive constants of the instance in the run into lane w."""
    const, table, knots = data.const, data.drives.table, data.drives.knots
    for k in range(const.shape[0]):
        for c in range(const.shape[1]):
            b.const[k, c, w] = const[k, c]
    for n in range(table.shape[0]):
        b.drives[n, D_STIFFNESS, w] = table[n].stiffness
        b.drives[n, D_DAMPING, w] = table[n].damping
        b.drives[n, D_LOW, w] = table[n].low
        b.drives[n, D_HIGH, w] = table[n].high
        b.drives[n, D_FRICTION, w] = table[n].friction
        b.drives[n, D_TARGET, w] = knots[table[n].first_target, 1] if drives[n, 1] >= 0 else 0.0
        b.drives[n, D_TORQUE, w] = 0.0
        if drives[n, 2] == 0:
            b.drives[n, D_TORQUE, w] = knots[table[n].first_torque, 1]


@sweep
def move_on(run, taken, evaluations):
    """Advance the time of a run by the steps of a lane."""
    this = opened_run(run)
    control, counters = this.control[0], this.counters[0]
    width = control.widest
    control.old_time = control.origin + (control.taken + taken - 1) * width + control.done
    control.taken += taken
    control.left -= taken
    control.time = control.origin + control.taken * width
    control.old_width = width
    control.filled = 0
    control.rejected = 0
    control.fresh = 0
    control.clip = math.inf
    counters.steps += taken
    counters.evaluations += evaluations


@sweep
def put_out(run, ways, b, w, taken, swept):
    """Copy lane w back into the run after the steps taken since `take_in`."""
    this = opened_run(run)
    contacts = contacts_at(opened(this.scene).links.contacts)
    nq, nv = size_of_state(run)
    y, x, lane = this.stages[at.Y], b.vectors, b.lane[0]
    for i in range(nq):
        y[i] = x[Q, i, w]
    for j in range(nv):
        y[nq + j] = x[V, j, w]
        contacts.limit_tau[j] = 0.0
    y[nq + nv] = x[LEDGER, 0, w]
    y[nq + nv + 1] = x[LEDGER, 1, w]
    move_on(run, taken, taken)
    this.counters[0].solver_iterations += swept
    tally = contacts.tally[0]
    tally.frozen = FROZEN
    tally.share = 1.0
    tally.width = this.control[0].widest
    tally.elapsed = lane[ELAPSED, w]
    tally.residual = lane[RESIDUAL, w]
    tally.depth = lane[LARGEST_DEPTH, w]
    tally.complementarity = lane[COMPLEMENTARITY, w]
    tally.cone = lane[CONE, w]
    tally.penetration = lane[PENETRATION, w]
    tally.force = lane[LARGEST, w]
    tally.worst = lane[WORST, w]
    tally.worst_pair = int(lane[WORST_PAIR, w])
    tally.worst_time = lane[WORST_TIME, w]
    tally.deepest = lane[DEEPEST, w]
    tally.deepest_pair = int(lane[DEEPEST_PAIR, w])
    tally.deepest_time = lane[DEEPEST_TIME, w]
    tally.deepest_depth = lane[DEEPEST_DEPTH, w]
    tally.logged += int(lane[LOGGED, w])
    found, count = 0, 0
    for n in range(ways.shape[0]):
        if b.points[n, FOUND, w] != 0.0:
            put_found(contacts.found[found], ways, b, n, w)
            found += 1
        if b.points[n, KEPT, w] != 0.0:
            one = contacts.kept[count]
            one.shape_a = ways[n, W_SHAPE]
            one.shape_b = -1
            one.feature = ways[n, W_FEATURE]
            one.slides = int(b.points[n, SLIDES, w])
            for c in range(3):
                one.value[c] = b.points[n, VALUE + c, w]
                one.turn[c] = 0.0
            count += 1
    tally.found = found
    tally.kept = count
    for k in range(contacts.laws.shape[0]):
        pair = contacts.pairs[k]
        for c in range(3):
            pair.force[c] = b.pairs[k, FORCE + c, w]
            pair.torque[c] = b.pairs[k, TORQUE + c, w]
            pair.mean_force[c] = b.pairs[k, P_MEAN + c, w]
            pair.mean_torque[c] = b.pairs[k, P_MEAN + 3 + c, w]
        pair.gap = b.pairs[k, P_GAP, w]
        pair.slip = b.pairs[k, P_SLIP, w]
        pair.phase = int(b.pairs[k, PHASE, w])
    for k in range(contacts.wrenches.shape[0]):
        for c in range(3):
            contacts.wrenches[k].torque[c] = b.wrenches[k, c, w]
            contacts.wrenches[k].force[c] = b.wrenches[k, 3 + c, w]


@part
def put_found(one, ways, b, n, w):
    """Write point n of lane w in the format of the contact search."""
    for c in range(3):
        one.point_a[c] = b.points[n, ON_A + c, w]
        one.point_b[c] = b.points[n, ON_B + c, w]
        one.normal[c] = b.lane[0, NORMAL + c, w]
        if b.points[n, ACTIVE, w] != 0.0:
            one.held[c] = b.points[n, HELD + c, w]
    one.gap = b.points[n, GAP, w]
    one.feature = ways[n, W_FEATURE]
    one.shape_a = ways[n, W_SHAPE]
    one.shape_b = -1
    one.pair = ways[n, W_PAIR]


@part
def in_lanes(b):
    """Return the arrays as arrays of lanes."""
    return Block(
        lanes(b[0]), lanes(b[1]), lanes(b[2]), lanes(b[3]), lanes(b[4]), lanes(b[5]), lanes(b[6]),
        lanes(b[7]), lanes(b[8]), lanes(b[9]), lanes(b[10]), lanes(b[11]), lanes(b[12]),
        lanes(b[13]), lanes(b[14]),
    )  # fmt: skip


@part
def named_block(b):
    """Return the arrays as arrays of numbers, with the lane last."""
    return Block(
        b[0], b[1], b[2], b[3], b[4], b[5], b[6], b[7], b[8], b[9], b[10], b[11], b[12], b[13],
        b[14],
    )  # fmt: skip
