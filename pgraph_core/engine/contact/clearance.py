"""Clearance between candidate shapes, and a check whether a step may have used it up.

Runs ignore contacts and limits until bodies come close, and ignore conditions on coordinates until
the coordinates are near their bounds. Assuming that no speed more than doubles, no contact is
possible before a known time, and steps before this time are not checked. After it,
`watch_clearance` checks each step. A step that moves everything by less than the clearance cannot
have touched anything. Otherwise the clearance is recomputed at the end of the step, and then within
it by conservative advancement on the dense output ([Mirtich 1996]).
"""

import math

from ...tolerances import COINCIDENT
from .. import layout as at
from ..arrays import GUARD, guard_at, opened_run, save_guard_tuple
from ..compiler.jit import kernel, part, sweep
from ..compiler.kinds import F2, I1, i8, plain, read, void
from ..motion import opened
from ..motions import bends, column, is_angle, numbers_of, travels
from ..records import CONTACT_AHEAD, HEIGHTFIELD
from ..rows import kind_of, origin_of, parent_of, q_of, v_of
from ..stepping.control.clock import jump_to
from ..stepping.control.guard import ask_once, fire, rest_until
from ..stepping.explicit import dense_output
from ..stepping.run import LOOK_BACK
from ..stepping.state import copied, size_of_state
from ..tree.kinematics import outboard, positions
from ..vec import dot, sub, xyz
from .placing import place, vertex
from .seams import boundary, to_local
from .search import find_contacts, find_gaps, may_collide

LOOK_AHEAD = 32.0  # steps' motion: how far a search looks at least
FARTHER = 4.0  # range of the next search, relative to the clearance
PATH = 1.25  # length of a path over what its ends say
CLOSE = 0.02  # distance that counts as near, relative to a step's motion
LOOKS = 24  # along one step
LASTING = 0.9  # share of the clearance that the rest of a run may use
FASTER = 2.0  # growth of speeds that a skipped check permits
REST_RANGE = 4 * COINCIDENT  # search distance from bodies at rest, relative to the reach of shapes


@kernel(void(I1, plain(GUARD)), later=True)
def save_guard(buffer, guard):
    """Store a guard where `guard_at` finds it."""
    save_guard_tuple(buffer, guard)


@part
def fastest(stages, j, count):
    """Compute the norm of `count` entries of v from j on, the larger of the last step's ends."""
    before, now = 0.0, 0.0
    for n in range(j, j + count):
        before += stages[at.Y_OLD, n] ** 2
        now += stages[at.Y, n] ** 2
    return math.sqrt(max(before, now))


@part
def path_of(stages, i, j, h):
    """Return a bound on the distance of coordinate i, with velocity entry j, over the last step."""
    speed = max(abs(stages[at.Y_OLD, j]), abs(stages[at.Y, j]))
    return max(abs(stages[at.Y, i] - stages[at.Y_OLD, i]), h * speed)


@part
def per_unit(kind, reach):
    """Return a bound on the motion of shapes for a unit of a coordinate [m/rad, 1]."""
    if is_angle(kind) or bends(kind):
        return reach
    return 1.0 if reach > 0.0 else 0.0


@part
def path_lengths(rows, stages, nq, h, reach):
    """Return bounds on the motion of any shape [m] and any coordinate [rad, m] over the last step.

    `reach` contains the reach of the shapes that each row carries.
    """
    moved = 0.0
    turn = 0.0
    for k in range(1, rows.shape[0]):
        i, j, kind = q_of(rows, k), nq + v_of(rows, k), kind_of(rows, k)
        first, count = numbers_of(kind)
        if first == 0:
            path = path_of(stages, i, j, h)
            turn = max(turn, path)
            moved += path * per_unit(kind, reach[k])
        elif reach[k] > 0.0:
            moved += h * fastest(stages, j, first) * reach[k]
            moved += h * fastest(stages, j + first, count)
    return PATH * moved, PATH * turn


@sweep
def limits_near(run, guard):
    """Check whether a coordinate may have reached a limit in the last step, and the clearance.

    Events are checked if a coordinate may have reached the bound of a condition.
    """
    data = opened_run(run)
    control, stages, limits = data.control[0], data.stages, guard.limits
    nq, _ = size_of_state(run)
    free = math.inf
    for n in range(limits.shape[0]):
        i, sign, value = limits[n].coordinate, limits[n].sign, limits[n].value
        before, now = sign * stages[at.Y_OLD, i] - value, sign * stages[at.Y, i] - value
        path = PATH * path_of(stages, i, nq + limits[n].velocity, control.clock.old_width)
        if limits[n].event >= 0 and now < 0.0:
            before, now = -before, -now
        if now <= 0.0 or min(now, before) <= path - abs(now - before):
            if limits[n].event < 0:
                return True
            ask_once(control.guard)
            now = 0.0
        free = min(free, now)
    guard.state[0].free_turn = free
    return False


@sweep
def pose(run, guard, row):
    """Place the shapes at their poses in the state in `row`."""
    data = opened_run(run)
    scene = opened(data.scene)
    rows, work, stages = scene.rows, scene.work, data.stages
    nq, nv = size_of_state(run)
    outboard(rows, scene.const, work, stages[row, :nq], stages[row, nq : nq + nv])
    positions(rows, work)
    place(guard.geometry.shapes, work, guard.poses)


@sweep
def clearance(guard, ahead):
    """Compute the motion until a gap equals the margin, at most `ahead` [m], after `pose`."""
    may, found, margin = guard.candidates, guard.found, guard.state[0].margin
    n = find_contacts(
        guard.geometry, guard.ground, may, guard.poses, guard.search, ahead + margin, found
    )
    between = may.pairs.shape[0] + may.members.shape[0] > 0
    if between and any_sunk(guard):
        return 0.0
    free = 0.5 * ahead if between else ahead
    for c in range(min(n, found.shape[0])):
        gap = found[c].gap - margin
        free = min(free, gap if found[c].shape_b < 0 else 0.5 * gap)
    return free if n <= found.shape[0] else 0.0


@sweep
def any_sunk(guard):
    """Check whether a shape reaches under a heightfield, where contact points are found only near
    the surface."""
    shapes, may = guard.geometry.shapes, guard.candidates
    for n in range(may.pairs.shape[0]):
        i, j = may.pairs[n].shape_a, may.pairs[n].shape_b
        if is_sunk(guard, i, j) or is_sunk(guard, j, i):
            return True
    for m in range(may.members.shape[0]):
        if shapes[may.members[m].shape].kind == HEIGHTFIELD:
            for k in range(may.members.shape[0]):
                sunk = is_sunk(guard, may.members[k].shape, may.members[m].shape)
                if sunk and may_collide(may, shapes, m, k):
                    return True
    return False


@sweep
def is_sunk(guard, i, j):
    """Check whether a corner of shape i, or the ball around its centre that is inside it, is under
    the surface of shape j, a heightfield."""
    shape, field, poses = guard.geometry.shapes[i], guard.geometry.shapes[j], guard.poses
    if field.kind != HEIGHTFIELD:
        return False
    half = xyz(shape.half_extents)
    x, inner = to_local(poses, j, xyz(poses[i].position)), min(half[0], min(half[1], half[2]))
    sunk = is_under(guard.geometry, j, (x[0], x[1], x[2] - inner))
    for k in range(shape.vertices):
        x = to_local(poses, j, vertex(guard.geometry, poses, i, k))
        sunk = sunk or is_under(guard.geometry, j, (x[0], x[1], x[2] - shape.radius))
    return sunk


@part
def is_under(geometry, j, x):
    """Check whether x, in the frame of heightfield j, is under its surface, at any depth."""
    field = geometry.shapes[j]
    for c in range(2):
        if abs(x[c] - field.middle[c]) > field.half_extents[c]:
            return False
    normal, level = boundary(geometry, j, 0, x)
    return dot(normal, x) < level


@sweep
def find_reach(run, guard, free):
    """Compute the reach of carried shapes from each row's origin, after calling `pose` [m].

    The reach is measured along the chain of origins. Its lengths are not changed by rotations, and
    changed by at most `free` by translations.
    """
    scene = opened(opened_run(run).scene)
    rows, work, reach = scene.rows, scene.work, guard.reach
    shapes, poses = guard.geometry.shapes, guard.poses
    for k in range(rows.shape[0]):
        reach[k] = 0.0
    for i in range(shapes.shape[0]):
        k = shapes[i].row
        way = sub(xyz(poses[i].position), origin_of(work, k))
        arm = math.sqrt(dot(way, way)) + shapes[i].reach
        while k > 0:
            kind = kind_of(rows, k)
            turn, slide = column(rows, work, k, scene.const, 0)
            here = arm * math.sqrt(dot(turn, turn)) if bends(kind) else arm
            if is_angle(kind) or bends(kind):
                here += math.sqrt(dot(slide, slide))
            reach[k] = max(reach[k], here)
            p = parent_of(rows, k)
            way = sub(origin_of(work, k), origin_of(work, p))
            arm += math.sqrt(dot(way, way))
            if travels(kind):
                arm += free
            k = p


@sweep
def may_touch(run, guard, moved):
    """Check whether a contact may have occurred in the last step, and the present clearance.

    `pose` must have been called at the end of the step.
    """
    data = opened_run(run)
    state = guard.state[0]
    widest = widest_reach(guard.reach)
    ahead = max(LOOK_AHEAD * moved, state.ahead, REST_RANGE * widest)
    free = clearance(guard, ahead)
    if free > moved or moved == 0.0:
        state.ahead = FARTHER * free
        find_reach(run, guard, free)
        state.free = free
        return not free > 0.0
    if data.tableau.dense.shape[0] == 0:
        return True
    share = 0.0
    pose(run, guard, at.Y_OLD)
    free = clearance(guard, LOOK_AHEAD * moved)
    for _ in range(LOOKS):
        if not free > CLOSE * moved:
            return True
        share += 0.9 * free / moved
        if share >= 1.0:
            pose(run, guard, at.Y)
            free = clearance(guard, LOOK_AHEAD * moved)
            find_reach(run, guard, free)
            state.free = free
            return not free > CLOSE * moved
        dense_output(run, share)
        pose(run, guard, at.TRIAL)
        free = clearance(guard, LOOK_AHEAD * moved)
    return True


@kernel(LOOK_BACK, nogil=True, later=True)
def watch_clearance(run):
    """Return to the start of the last step and stop there if a contact may have occurred in it.

    Operations that are rarely needed are done by `look_again`, which opens the guard itself.
    """
    data = opened_run(run)
    control, stages = data.control[0], data.stages
    clock = control.clock
    guard = guard_at(control.guard.address)
    state, rows = guard.state[0], opened(data.scene).rows
    if control.guard.next_check == -math.inf:  # another run
        forget(guard)
    moved, turn = path_lengths(rows, stages, control.nq, clock.old_width, guard.reach)
    quiet = max(clock.old_time - state.since, 0.0)
    state.free -= quiet * state.rate + moved
    state.free_turn -= quiet * PATH * control.guard.slow + turn
    state.since = clock.time
    if not (state.free > 0.0 and state.free_turn > 0.0):
        look_again(run)
    if control.guard.fired == 0:
        left = data.times[clock.last - 1] - clock.time
        set_clock(control, state, rows, stages, guard.reach, left)


@part
def forget(guard):
    """Reset the clearance of all pairs."""
    state = guard.state[0]
    state.free = 0.0 if guard.geometry.shapes.shape[0] > 0 else math.inf
    state.free_turn, state.ahead, state.since, state.rate = 0.0, 0.0, 0.0, 0.0
    for k in range(guard.reach.shape[0]):
        guard.reach[k] = 0.0


@part
def set_clock(control, state, rows, stages, reach, left):
    """Set the time until which no contact is possible if no coordinate exceeds twice the present
    maximum speed.

    If larger, the speed that would cause a contact within the remaining time is used.
    """
    slow = 0.0
    for j in range(control.nq, control.nq + control.nv):
        slow = max(slow, FASTER * abs(stages[at.Y, j]))
    rate = 0.0
    for k in range(1, rows.shape[0]):
        kind = kind_of(rows, k)
        if reach[k] > 0.0:
            first, count = numbers_of(kind)
            rate += math.sqrt(first) * reach[k] + math.sqrt(count) * per_unit(kind, reach[k])
    way = state.free_turn
    if rate > 0.0:
        way = min(way, state.free / rate)
    if left > 0.0 and way < math.inf:
        slow = max(slow, LASTING * way / (PATH * left))
    state.rate = PATH * slow * rate
    least = math.inf
    if state.rate > 0.0:
        least = state.free / state.rate
    if slow > 0.0:
        least = min(least, state.free_turn / (PATH * slow))
    rest_until(control.guard, control.clock.time + least, slow)


@sweep
def look_again(run):
    """Recompute the clearance after a step. Return to its start if a contact may have been."""
    data = opened_run(run)
    control, stages = data.control[0], data.stages
    clock = control.clock
    guard = guard_at(control.guard.address)
    state = guard.state[0]
    near = not state.free_turn > 0.0 and limits_near(run, guard)
    if not near and guard.geometry.shapes.shape[0] > 0 and not state.free > 0.0:
        pose(run, guard, at.Y)
        if widest_reach(guard.reach) == 0.0:  # the first step
            find_reach(run, guard, 0.0)
            state.ahead = widest_reach(guard.reach)
        rows = opened(data.scene).rows
        moved, _ = path_lengths(rows, stages, control.nq, clock.old_width, guard.reach)
        near = may_touch(run, guard, moved)
    if near:
        copied(stages, at.Y_OLD, at.Y, stages.shape[1])
        jump_to(clock, clock.old_time)
        fire(control.guard, CONTACT_AHEAD)


@part
def widest_reach(reach):
    widest = 0.0
    for k in range(reach.shape[0]):
        widest = max(widest, reach[k])
    return widest


@kernel(void(i8, i8, read(F2), F2), later=True)
def frame_gaps(scene, address, q, gaps):
    """Compute the smallest gap of each contact pair at the states q (n, nq), as (n, contact pairs)
    [m].

    If a contact acts between all bodies, the gaps between its members are not updated.
    """
    data, guard = opened(scene), guard_at(address)
    rows, const, work = data.rows, data.const, data.work
    may, count = guard.candidates, guard.candidates.on_ground.shape[0]
    for f in range(q.shape[0]):
        outboard(rows, const, work, q[f], data.given)
        positions(rows, work)
        place(guard.geometry.shapes, work, guard.poses)
        found = guard.gaps
        find_gaps(
            guard.geometry, guard.ground, may, guard.poses, guard.search.room, guard.found, found
        )
        for n in range(count + may.pairs.shape[0]):
            pair = may.on_ground[n].pair if n < count else may.pairs[n - count].pair
            gaps[f, pair] = min(gaps[f, pair], found[n])
