"""A block of instances in lanes: the data of its kernels, and copies from and to a run."""

import math
from typing import Any, NamedTuple

from ...tolerances import COINCIDENT
from .. import layout as at
from ..arrays import opened_run
from ..compiler.elementary import FAR
from ..compiler.jit import part, sweep
from ..compiler.lane import lanes
from ..compiler.masks import larger
from ..contact.closing import COORDINATES, DEPTH, thickness
from ..contact.contacts import FROZEN, contacts_at
from ..contact.manifold import tangents
from ..motion import opened
from ..records import columns
from ..stepping.control.clock import pass_steps
from ..stepping.control.ends import count_steps
from ..stepping.control.error import accept_step
from ..stepping.state import size_of_state
from ..stepping.unilateral import SINKING
from ..vec import xyz


class Block(NamedTuple):
    """Arrays for the kernels of a block of lanes, with the lane as the last axis."""

    const: Any  # (n + 1, CONST) of the bodies
    work: Any  # (n + 1, WORK)
    linear: Any  # (n + 1, 3) velocities of origins
    vectors: Any  # (VECTOR.total, max(nq, nv)) rows are named by VECTOR
    drives: Any  # (nd, DRIVE.total)
    shapes: Any  # (ns, SHAPE.total)
    vertices: Any  # (nv, 3)
    laws: Any  # (contact pairs, 2) friction, restitution
    bodies: Any  # (nb + 1, 3) from the row's origin to the body's
    points: Any  # (points, POINT.total)
    y: Any  # (points, 3 w) what unit impulses do in each joint
    own: Any  # (points, 9)
    pairs: Any  # (contact pairs, PAIR.total)
    wrenches: Any  # (nb + 1, 6)
    lane: Any  # (1, LANE.total) numbers of the lane


# rows of `vectors`: the state, that at the end of the step, given torques and with what stiff
# springs add, drives as inertia and torque, the servos' share of damping, then what impulses do
VECTOR = columns(
    "q", "v", "ledger", "new_q", "new_v", "tau", "vdot", "given", "pushed", "damping", "stiffness",
    "driven", "armature", "effect", "speeds", "freed", "dinv", "move", "done", "mean", "zero",
)  # fmt: skip
# columns of `drives`
DRIVE = columns("stiffness", "damping", "low", "high", "friction", "target", "torque")
# columns of `shapes`
SHAPE = columns(
    place=3, turn=9, reach=1, radius=1, thin=1, size=1, thick=1, pose=3, posed=9,
)  # fmt: skip
# columns of `points`: `kept`, `value` and `slides` are of the last step, `passed` is the rate of
# the pass before
POINT = columns(
    found=1, active=1, gap=1, slack=1, middle=3, on_a=3, on_b=3, before=3, rate=3, target=3, lam=3,
    held=3, missed=2, slip=1, kept=1, value=3, slides=1, turned=3, passed=3,
)  # fmt: skip
# columns of `pairs`: `mean` is that of force and torque
PAIR = columns(force=3, torque=3, gap=1, slip=1, phase=1, mean=6)
# columns of `lane`: `fallen` and `fell` say when a walk fell first, and with the step under way,
# `stays` is 1 where the pass has the rates of that before it
LANE = columns(
    time=1, normal=9, length=1, pull=1, alone=1, put_in=1, lost=1, size=1, open=1, swept=1,
    gained=1, residual=1, largest_depth=1, complementarity=1, cone=1, penetration=1, largest=1,
    worst=1, worst_pair=1, worst_time=1, deepest=1, deepest_pair=1, deepest_time=1,
    deepest_depth=1, count=1, number=1, logged=1, lives=1, origin=1, taken=1, fallen=1, fell=1,
    stays=1, elapsed=1,
)  # fmt: skip
# columns of `ways`: of a point its shape, row, body, contact pair, vertex, feature, joints
WAY = columns("shape", "row", "body", "pair", "vertex", "feature", "kind", "joints", "joint")


@part
def closed_gap(b, i, p):
    """Return `closing.closed_gap` above the ground."""
    return larger(
        COINCIDENT * b.shapes[i, SHAPE.size], COORDINATES * (abs(p[0]) + abs(p[1]) + abs(p[2]))
    )


@part
def tolerated(b, i, h):
    """Return `unilateral.tolerated`."""
    return larger(DEPTH * b.shapes[i, SHAPE.size], SINKING * b.lane[0, LANE.pull] * h * h)


@part
def fits(contacts, data, control):
    """Check whether the instance in the run can be stepped in lanes."""
    good = control.ends.done == 0.0 and control.guard.fired == 0 and control.guard.bound == math.inf
    for k in range(contacts.laws.shape[0]):
        law = contacts.laws[k]
        good = good and law.static_friction == law.friction
    return good


@sweep
def take_in(run, ways, drives, b, w, all_):
    """Copy the run's instance into lane w, with constants if `all_`. True if it fits."""
    this = opened_run(run)
    data, control = opened(this.scene), this.control[0]
    ends = control.ends
    contacts = contacts_at(data.links.contacts)
    nq, nv = size_of_state(run)
    y, x = this.stages[at.Y], b.vectors
    if all_:
        take_numbers(data, contacts, ways, drives, b, w)
    far = 0.0
    for i in range(nq):
        x[VECTOR.q, i, w] = y[i]
        far = max(far, abs(y[i]))
    for j in range(nv):
        x[VECTOR.v, j, w] = y[nq + j]
        x[VECTOR.given, j, w] = data.given[j]
    x[VECTOR.ledger, 0, w] = y[nq + nv]
    x[VECTOR.ledger, 1, w] = y[nq + nv + 1]
    kept, tally = contacts.kept, contacts.tally[0]
    for n in range(ways.shape[0]):
        b.points[n, POINT.kept, w] = 0.0
        for m in range(tally.kept):
            one = kept[m]
            if one.shape_a == ways[n, WAY.shape] and one.feature == ways[n, WAY.feature]:
                b.points[n, POINT.kept, w] = 1.0
                for c in range(3):
                    b.points[n, POINT.value + c, w] = one.value[c]
                b.points[n, POINT.slides, w] = one.slides
    for k in range(contacts.laws.shape[0]):
        b.pairs[k, PAIR.phase, w] = contacts.pairs[k].phase
        for c in range(3):
            b.pairs[k, PAIR.mean + c, w] = contacts.pairs[k].mean_force[c]
            b.pairs[k, PAIR.mean + 3 + c, w] = contacts.pairs[k].mean_torque[c]
    lane = b.lane[0]
    lane[LANE.origin, w] = ends.origin
    lane[LANE.taken, w] = ends.taken
    lane[LANE.time, w] = ends.origin + ends.taken * control.error.widest + ends.done
    lane[LANE.elapsed, w] = tally.elapsed
    lane[LANE.residual, w] = tally.residual
    lane[LANE.largest_depth, w] = tally.depth
    lane[LANE.complementarity, w] = tally.complementarity
    lane[LANE.cone, w] = tally.cone
    lane[LANE.penetration, w] = tally.penetration
    lane[LANE.largest, w] = tally.force
    lane[LANE.worst, w] = tally.worst
    lane[LANE.worst_pair, w] = tally.worst_pair
    lane[LANE.worst_time, w] = tally.worst_time
    lane[LANE.deepest, w] = tally.deepest
    lane[LANE.deepest_pair, w] = tally.deepest_pair
    lane[LANE.deepest_time, w] = tally.deepest_time
    lane[LANE.deepest_depth, w] = tally.deepest_depth
    lane[LANE.logged, w] = 0.0
    lane[LANE.count, w] = 0.0
    lane[LANE.number, w] = 0.0
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
            b.shapes[i, SHAPE.place + c, w] = shape.position[c]
        for c in range(9):
            b.shapes[i, SHAPE.turn + c, w] = shape.rotation[c]
        thin = thickness(shape)
        size = shape.reach if shape.reach > 0.0 else tally.length
        b.shapes[i, SHAPE.reach, w] = shape.reach
        b.shapes[i, SHAPE.radius, w] = shape.radius
        b.shapes[i, SHAPE.thin, w] = thin
        b.shapes[i, SHAPE.size, w] = size
        b.shapes[i, SHAPE.thick, w] = 2.0 * thin if thin > 0.0 else size
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
        b.lane[0, LANE.normal + c, w] = normal[c]
        b.lane[0, LANE.normal + 3 + c, w] = t[c]
        b.lane[0, LANE.normal + 6 + c, w] = s[c]
    b.lane[0, LANE.length, w] = tally.length
    b.lane[0, LANE.pull, w] = tally.pull


@sweep
def take_drives(data, drives, b, w):
    """Copy the body and drive constants of the instance in the run into lane w."""
    const, table, knots = data.const, data.drives.table, data.drives.knots
    for k in range(const.shape[0]):
        for c in range(const.shape[1]):
            b.const[k, c, w] = const[k, c]
    for n in range(table.shape[0]):
        b.drives[n, DRIVE.stiffness, w] = table[n].stiffness
        b.drives[n, DRIVE.damping, w] = table[n].damping
        b.drives[n, DRIVE.low, w] = table[n].low
        b.drives[n, DRIVE.high, w] = table[n].high
        b.drives[n, DRIVE.friction, w] = table[n].friction
        b.drives[n, DRIVE.target, w] = knots[table[n].first_target, 1] if drives[n, 1] >= 0 else 0.0
        b.drives[n, DRIVE.torque, w] = 0.0
        if drives[n, 2] == 0:
            b.drives[n, DRIVE.torque, w] = knots[table[n].first_torque, 1]


@sweep
def move_on(run, taken, evaluations):
    """Advance the time of a run by the steps of a lane."""
    this = opened_run(run)
    control, counters = this.control[0], this.counters[0]
    clock, ends = control.clock, control.ends
    width = control.error.widest
    start = ends.origin + (ends.taken + taken - 1) * width
    count_steps(ends, taken)
    pass_steps(clock, start, width, ends.origin + ends.taken * width)
    accept_step(control.error)
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
        y[i] = x[VECTOR.q, i, w]
    for j in range(nv):
        y[nq + j] = x[VECTOR.v, j, w]
        contacts.limit_tau[j] = 0.0
    y[nq + nv] = x[VECTOR.ledger, 0, w]
    y[nq + nv + 1] = x[VECTOR.ledger, 1, w]
    move_on(run, taken, taken)
    this.counters[0].solver_iterations += swept
    tally = contacts.tally[0]
    tally.frozen = FROZEN
    tally.share = 1.0
    tally.width = this.control[0].error.widest
    tally.elapsed = lane[LANE.elapsed, w]
    tally.residual = lane[LANE.residual, w]
    tally.depth = lane[LANE.largest_depth, w]
    tally.complementarity = lane[LANE.complementarity, w]
    tally.cone = lane[LANE.cone, w]
    tally.penetration = lane[LANE.penetration, w]
    tally.force = lane[LANE.largest, w]
    tally.worst = lane[LANE.worst, w]
    tally.worst_pair = int(lane[LANE.worst_pair, w])
    tally.worst_time = lane[LANE.worst_time, w]
    tally.deepest = lane[LANE.deepest, w]
    tally.deepest_pair = int(lane[LANE.deepest_pair, w])
    tally.deepest_time = lane[LANE.deepest_time, w]
    tally.deepest_depth = lane[LANE.deepest_depth, w]
    tally.logged += int(lane[LANE.logged, w])
    found, count = 0, 0
    for n in range(ways.shape[0]):
        if b.points[n, POINT.found, w] != 0.0:
            put_found(contacts.found[found], ways, b, n, w)
            found += 1
        if b.points[n, POINT.kept, w] != 0.0:
            one = contacts.kept[count]
            one.shape_a = ways[n, WAY.shape]
            one.shape_b = -1
            one.feature = ways[n, WAY.feature]
            one.slides = int(b.points[n, POINT.slides, w])
            for c in range(3):
                one.value[c] = b.points[n, POINT.value + c, w]
                one.turn[c] = 0.0
            count += 1
    tally.found = found
    tally.kept = count
    for k in range(contacts.laws.shape[0]):
        pair = contacts.pairs[k]
        for c in range(3):
            pair.force[c] = b.pairs[k, PAIR.force + c, w]
            pair.torque[c] = b.pairs[k, PAIR.torque + c, w]
            pair.mean_force[c] = b.pairs[k, PAIR.mean + c, w]
            pair.mean_torque[c] = b.pairs[k, PAIR.mean + 3 + c, w]
        pair.gap = b.pairs[k, PAIR.gap, w]
        pair.slip = b.pairs[k, PAIR.slip, w]
        pair.phase = int(b.pairs[k, PAIR.phase, w])
    for k in range(contacts.wrenches.shape[0]):
        for c in range(3):
            contacts.wrenches[k].torque[c] = b.wrenches[k, c, w]
            contacts.wrenches[k].force[c] = b.wrenches[k, 3 + c, w]


@part
def put_found(one, ways, b, n, w):
    """Write point n of lane w in the format of the contact search."""
    for c in range(3):
        one.point_a[c] = b.points[n, POINT.on_a + c, w]
        one.point_b[c] = b.points[n, POINT.on_b + c, w]
        one.normal[c] = b.lane[0, LANE.normal + c, w]
        if b.points[n, POINT.active, w] != 0.0:
            one.held[c] = b.points[n, POINT.held + c, w]
    one.gap = b.points[n, POINT.gap, w]
    one.feature = ways[n, WAY.feature]
    one.shape_a = ways[n, WAY.shape]
    one.shape_b = -1
    one.pair = ways[n, WAY.pair]


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
