"""Contact between feet and a plane, in lanes: points, unit impulses and sweeps until
convergence.
"""

import math

from ...tolerances import EPS, NOTABLE, ROUNDING
from .. import layout as at
from ..compiler.jit import part, sweep
from ..compiler.masks import any_of, both, chosen, either, larger, more, most, smaller, without
from ..constraints.blocks import point_acceleration, point_velocity
from ..constraints.paths import spread, taxicab
from ..contact.closing import DEPTH, HARD
from ..contact.coulomb import contact
from ..contact.impulse import FEW_SWEEPS, TOGETHER, TOLERANCE
from ..contact.sweeps import SMALL
from ..contact.touches import NEARBY
from ..linear import forward_free
from ..records import POINTS, SPHERE
from ..rows import (
    FREE,
    TRANSLATE,
    axis_of,
    inverse_pivot_of,
    kind_of,
    link_of,
    origin_of,
    parent_of,
    projected_of,
    rotation_of,
    set_acceleration,
    spin_of,
)
from ..stepping.unilateral import DRIFT, ENOUGH, PUSH_SWEEPS, RECOVER, WEIGHT
from ..tree.kinematics import accelerate
from ..tree.moving import advance
from ..vec import (
    add,
    add_cross,
    add_scaled,
    cross,
    dot,
    load,
    load9,
    mat_mul,
    mul,
    scale,
    store,
    store9,
    sub,
)
from . import block as of
from .block import closed_gap, tolerated


@sweep
def find(ways, near, b, h):
    """Find the contact points and the active ones, as in `unilateral.add_unilateral`.

    The points that are close in any lane are written to `near`, after their number.
    """
    lane, work, linear, shapes, points = b.lane[0], b.work, b.linear, b.shapes, b.points
    normal = load(b.lane, 0, of.NORMAL)
    zero = 0.0 * lane[of.COUNT]
    closed, margin = zero, zero
    for n in range(ways.shape[0]):
        i, k = ways[n, of.W_SHAPE], ways[n, of.W_ROW]
        points[n, of.FOUND] = zero
        points[n, of.ACTIVE] = zero
        if n > 0 and ways[n - 1, of.W_SHAPE] == i:
            continue
        r = rotation_of(work, k)
        pose = add(origin_of(work, k), mul(r, load(shapes, i, of.S_PLACE)))
        store(shapes, i, of.S_POSE, pose)
        closed = larger(closed, closed_gap(b, i, pose))
        u = point_velocity(work, linear, k, pose)
        turn = load(work, k, at.W)
        arm = shapes[i, of.S_REACH] if ways[n, of.W_KIND] != SPHERE else zero
        moved = h * (math.sqrt(dot(u, u)) + arm * math.sqrt(dot(turn, turn)))
        if ways[n, of.W_KIND] != POINTS:
            lane[of.ALONE] = either(lane[of.ALONE], more(moved, shapes[i, of.S_THIN]))
            moved = smaller(moved, shapes[i, of.S_THIN])
        margin = larger(margin, moved)
    drift = larger(DEPTH * lane[of.LENGTH], WEIGHT * lane[of.PULL] * h * h)
    within = larger(larger(8.0 * closed, DRIFT * drift), margin)
    count = 0
    shape = -1
    close = False
    for n in range(ways.shape[0]):
        i, k = ways[n, of.W_SHAPE], ways[n, of.W_ROW]
        pose = load(shapes, i, of.S_POSE)
        above = most(dot(pose, normal) - shapes[i, of.S_REACH], 0.0 + within)
        if i != shape:
            shape = i
            close = any_of(above)
            if close:
                turn = mat_mul(rotation_of(work, k), load9(shapes, i, of.S_TURN))
                store9(shapes, i, of.S_POSED, turn)
        if not close:
            continue
        p = add(pose, mul(load9(shapes, i, of.S_POSED), load(b.vertices, ways[n, of.W_VERTEX], 0)))
        gap = dot(p, normal) - shapes[i, of.S_RADIUS]
        found = without(above, more(gap, within))
        if any_of(found):
            count += 1
            near[count] = n
            points[n, of.FOUND] = found
            points[n, of.GAP] = gap
            store(points, n, of.ON_A, p)
    near[0] = count
    if count > SMALL:
        lane[of.ALONE] = lane[of.LIVES]
        near[0] = 0
    kept = zero
    for n in range(ways.shape[0]):
        kept = kept + points[n, of.KEPT]
    lane[of.ALONE] = either(lane[of.ALONE], more(kept, NEARBY))
    for m in range(near[0]):
        activate(ways, b, near[1 + m], h)
    for m in range(near[0]):
        n = near[1 + m]
        redundant = more(3.0 + zero, own_joints(ways, near, b, n))
        lane[of.ALONE] = either(lane[of.ALONE], both(points[n, of.ACTIVE], redundant))


@part
def own_joints(ways, near, b, n):
    """Count the joints that only point n moves among the active points."""
    zero = 0.0 * b.lane[0, of.COUNT]
    own = zero
    for s in range(ways[n, of.W_JOINTS]):
        shared = zero
        for m in range(near[0]):
            other = near[1 + m]
            for r in range(ways[other, of.W_JOINTS]):
                if other != n and joint(ways, other, r) == joint(ways, n, s):
                    shared = either(shared, b.points[other, of.ACTIVE])
        own = own + chosen(shared, 0.0, 1.0 + zero)
    return own


@part
def activate(ways, b, n, h):
    """Decide whether point n, whose position is in ON_A, is active and whether it hits."""
    lane, shapes, points = b.lane[0], b.shapes, b.points
    i, k, gap = ways[n, of.W_SHAPE], ways[n, of.W_ROW], points[n, of.GAP]
    normal = load(b.lane, 0, of.NORMAL)
    on_b = add_scaled(load(points, n, of.ON_A), -gap - shapes[i, of.S_RADIUS], normal)
    on_a = add_scaled(on_b, gap, normal)
    middle = scale(0.5, add(on_a, on_b))
    store(points, n, of.ON_A, on_a)
    store(points, n, of.ON_B, on_b)
    store(points, n, of.MIDDLE, middle)
    closing = -dot(point_velocity(b.work, b.linear, k, middle), normal)
    shut = closed_gap(b, i, on_a)
    hits = both(
        more(closing * h, DEPTH * shapes[i, of.S_SIZE]), more(closing, HARD * lane[of.PULL] * h)
    )
    hits = both(hits, most(gap - 0.5 * h * closing, shut))
    near = 4.0 * shut
    held = both(points[n, of.KEPT], more(points[n, of.VALUE], 0.0))
    drifts = both(more(gap, near), held)
    near = chosen(drifts, DRIFT * tolerated(b, i, h), near)
    points[n, of.SLACK] = chosen(drifts, gap / h, 0.0)
    active = both(points[n, of.FOUND], most(gap, near))
    points[n, of.ACTIVE] = active
    lane[of.ALONE] = either(lane[of.ALONE], both(points[n, of.FOUND], hits))


@part
def directions(ways, near, b, column):
    """Compute the velocities of the points along the normal and tangents."""
    for m in range(near[0]):
        n = near[1 + m]
        u = point_velocity(b.work, b.linear, ways[n, of.W_ROW], load(b.points, n, of.MIDDLE))
        for r in range(3):
            b.points[n, column + r] = dot(load(b.lane, 0, of.NORMAL + 3 * r), u)


@sweep
def turned(rows, ways, near, b, h):
    """Write h/2 J' v of the points at the mean velocity into TURNED, as `moreau.turned`."""
    x, work, points = b.vectors, b.work, b.points
    set_acceleration(work, 0, (0.0, 0.0, 0.0), (0.0, 0.0, 0.0))
    for j in range(x.shape[1]):
        x[of.ZERO, j] = 0.0
    accelerate(rows, b.const, work, x[of.MEAN], x[of.ZERO])
    normal = load(b.lane, 0, of.NORMAL)
    for m in range(near[0]):
        n = near[1 + m]
        k, radius = ways[n, of.W_ROW], b.shapes[ways[n, of.W_SHAPE], of.S_RADIUS]
        w = spin_of(work, k)
        rolling = scale(radius, cross(w, normal))
        apart = add(point_acceleration(work, k, load(points, n, of.MIDDLE)), cross(w, rolling))
        for r in range(3):
            along = dot(load(b.lane, 0, of.NORMAL + 3 * r), apart)
            points[n, of.TURNED + r] = along * (0.5 * h)


@part
def past_hinge(work, k, share, moment, force):
    """Transmit a wrench across joint k, which absorbs `share` of it."""
    passed = -inverse_pivot_of(work, k) * share
    u0, u1 = projected_of(work, k)
    force = add_scaled(force, passed, u1)
    return add_cross(add_scaled(moment, passed, u0), link_of(work, k), force), force


@sweep
def carry(rows, ways, b, n):
    """Compute Y of point n as in `paths.carry`, over the joints on its path."""
    work, y = b.work, b.y[n]
    p = load(b.points, n, of.MIDDLE)
    for r in range(3):
        k = ways[n, of.W_ROW]
        reach = taxicab(p) + taxicab(p)
        force = load(b.lane, 0, of.NORMAL + 3 * r)
        moment = cross(sub(p, origin_of(work, k)), force)
        s = 0
        while k > 0:
            reach = larger(reach, taxicab(origin_of(work, k)) + taxicab(link_of(work, k)))
            kind = kind_of(rows, k)
            if kind == FREE:
                share = forward_free(work, k, moment, force)
                for c in range(6):
                    y[3 * (s + c) + r] = share[c]
                break
            least = ROUNDING * reach
            one = dot(axis_of(work, k), moment)
            if kind == TRANSLATE:
                least = ROUNDING + 0.0 * reach
                one = dot(axis_of(work, k), force)
            one = chosen(most(abs(one), least), 0.0 * one, one)
            y[3 * s + r] = one
            moment, force = past_hinge(work, k, one, moment, force)
            s += 1
            k = parent_of(rows, k)


@part
def joint(ways, n, s):
    return ways[n, of.W_JOINT + s]


@sweep
def own_block(ways, b, n):
    """Compute `sweeps.own_block`."""
    y, own, dinv = b.y[n], b.own[n], b.vectors[of.DINV]
    for c in range(9):
        own[c] = 0.0
    for s in range(ways[n, of.W_JOINTS]):
        d = dinv[joint(ways, n, s)]
        z = scale(d, (y[3 * s], y[3 * s + 1], y[3 * s + 2]))
        for r in range(3):
            for c in range(3):
                own[3 * r + c] = own[3 * r + c] + y[3 * s + r] * z[c]


@part
def warm(b, n):
    """Return λ of the last step for an active point."""
    goes_on = both(b.points[n, of.ACTIVE], b.points[n, of.KEPT])
    for c in range(3):
        b.points[n, of.LAM + c] = chosen(goes_on, b.points[n, of.VALUE + c], 0.0)
        b.points[n, of.HELD + c] = b.points[n, of.LAM + c]


@part
def gather(ways, b, n, row):
    """Return Y z of point n, for a row of `vectors`."""
    y, z = b.y[n], b.vectors[row]
    zero = 0.0 * z[0]
    u = (zero, zero, zero)
    for s in range(ways[n, of.W_JOINTS]):
        u = add_scaled(u, z[joint(ways, n, s)], (y[3 * s], y[3 * s + 1], y[3 * s + 2]))
    return u


@part
def velocity(ways, b, n):
    return add_scaled(gather(ways, b, n, of.STEP), 1.0, load(b.points, n, of.TARGET))


@part
def scatter(ways, b, n, change):
    """Add diag(1/d) Yᵀ times a change in λ to STEP."""
    y, w, dinv = b.y[n], b.vectors[of.STEP], b.vectors[of.DINV]
    for s in range(ways[n, of.W_JOINTS]):
        k = joint(ways, n, s)
        w[k] += dinv[k] * dot((y[3 * s], y[3 * s + 1], y[3 * s + 2]), change)


@sweep
def aim(ways, near, b, again):
    """Run `impulse.aim` and `impulse.is_as_before`. SIZE receives the largest velocity."""
    x, points, lane = b.vectors, b.points, b.lane[0]
    size, carried, change = lane[of.COUNT] * 0.0, lane[of.COUNT] * 0.0, lane[of.COUNT] * 0.0
    for m in range(near[0]):
        n = near[1 + m]
        here = points[n, of.ACTIVE]
        for c in range(3):
            most_ = larger(abs(points[n, of.RATE + c]), abs(points[n, of.BEFORE + c]))
            size = larger(size, chosen(here, most_, 0.0))
            moved = abs(points[n, of.RATE + c] - points[n, of.PASSED + c])
            change = larger(change, chosen(here, moved, 0.0))
            points[n, of.PASSED + c] = points[n, of.RATE + c]
        y = b.y[n]
        for s in range(ways[n, of.W_JOINTS]):
            column = (y[3 * s], y[3 * s + 1], y[3 * s + 2])
            one = abs(x[of.SPEEDS, joint(ways, n, s)]) * math.sqrt(dot(column, column))
            carried = larger(carried, chosen(here, one, 0.0))
    together = more(carried, TOGETHER * size)
    for j in range(x.shape[1]):
        x[of.FREED, j] = chosen(together, 0.0 * size, x[of.SPEEDS, j])
    for m in range(near[0]):
        n = near[1 + m]
        pair = ways[n, of.W_PAIR]
        for c in range(3):
            points[n, of.TARGET + c] = chosen(
                together, points[n, of.RATE + c], points[n, of.TURNED + c]
            )
        points[n, of.TARGET] += b.laws[pair, 1] * smaller(points[n, of.BEFORE], 0.0)
        points[n, of.TARGET] += points[n, of.SLACK]
    lane[of.SIZE] = size
    lane[of.STAYS] = 0.0
    if again:
        lane[of.STAYS] = chosen(most(change, EPS * size), 1.0 + 0.0 * size, 0.0)


@sweep
def gauss_seidel(ways, near, b):
    """Run `sweeps.gauss_seidel`. Finished lanes wait for the others."""
    x, points, lane = b.vectors, b.points, b.lane[0]
    for j in range(x.shape[1]):
        x[of.STEP, j] = x[of.FREED, j]
    for m in range(near[0]):
        n = near[1 + m]
        scatter(ways, b, n, load(points, n, of.LAM))
    size = lane[of.SIZE]
    touches = 0.0 * size
    for m in range(near[0]):
        n = near[1 + m]
        touches = either(touches, points[n, of.ACTIVE])
    open_ = both(touches, without(lane[of.LIVES], either(lane[of.ALONE], lane[of.STAYS])))
    lane[of.ALONE] = either(lane[of.ALONE], both(open_, most(size, 0.0)))
    swept, left = lane[of.SWEPT], 0.0 * size
    for _ in range(FEW_SWEEPS):
        if not any_of(open_):
            break
        change = 0.0 * size
        for m in range(near[0]):
            n = near[1 + m]
            here = both(open_, points[n, of.ACTIVE])
            if not any_of(here):
                continue
            old = load(points, n, of.LAM)
            u, mu = velocity(ways, b, n), b.laws[ways[n, of.W_PAIR], 0]
            new = contact(b.own[n], u, old, mu, here)
            new = (
                chosen(here, new[0], old[0]),
                chosen(here, new[1], old[1]),
                chosen(here, new[2], old[2]),
            )
            step = sub(new, old)
            scatter(ways, b, n, step)
            store(points, n, of.LAM, new)
            for c in range(3):
                change = larger(change, abs(step[c]) * b.own[n, 4 * c])
        swept += chosen(open_, 1.0 + 0.0 * size, 0.0)
        left = chosen(open_, change / size, left)
        open_ = both(open_, more(change, TOLERANCE * size))
    lane[of.SWEPT] = swept
    lane[of.OPEN] = larger(lane[of.OPEN], left)
    lane[of.ALONE] = either(lane[of.ALONE], both(touches, more(left, TOLERANCE)))


@sweep
def gain_and_miss(ways, near, b):
    """Run `impulse.gained` and `note_missed`. Lanes in which a rebound increases the energy
    continue individually."""
    points, lane, own = b.points, b.lane[0], b.own
    gain, size, bouncing = 0.0 * lane[of.SIZE], 0.0 * lane[of.SIZE], 0.0 * lane[of.SIZE]
    for m in range(near[0]):
        n = near[1 + m]
        here = points[n, of.ACTIVE]
        law = b.laws[ways[n, of.W_PAIR]]
        u = velocity(ways, b, n)
        lam = load(points, n, of.LAM)
        before = load(points, n, of.BEFORE)
        rate = load(points, n, of.RATE)
        back = law[1] * smaller(before[0], 0.0)
        back = back + points[n, of.SLACK]
        for c in range(3):
            mean = before[c] + u[c]
            if c == 0:
                mean = before[c] + u[c] - back
            gain += chosen(here, lam[c] * (0.5 * mean), 0.0)
            size += chosen(here, abs(lam[c]) * larger(abs(rate[c]), abs(before[c])), 0.0)
        pressed = abs(rate[0] - before[0])
        bouncing = either(
            bouncing, both(here, both(more(law[1], 0.0), more(-before[0], 4.0 * pressed)))
        )
        moves = more(own[n, 0], 0.0)
        points[n, of.MISSED] = chosen(
            moves, abs(lam[0] - larger(lam[0] - u[0] / own[n, 0], 0.0)), 0.0
        )
        mobility = larger(own[n, 4], own[n, 8])
        x, y = lam[1] - u[1] / mobility, lam[2] - u[2] / mobility
        rim = law[0] * larger(lam[0], 0.0)
        pull = math.sqrt(x * x + y * y)
        fit = chosen(more(pull, rim), rim / pull, 1.0)
        x, y = lam[1] - fit * x, lam[2] - fit * y
        points[n, of.MISSED + 1] = chosen(more(mobility, 0.0), math.sqrt(x * x + y * y), 0.0)
    lane[of.GAINED] = gain
    lane[of.ALONE] = either(lane[of.ALONE], both(bouncing, more(gain, NOTABLE * size)))


@sweep
def effects(ways, near, b):
    """Write diag(1/d) Yᵀ λ into STEP, and compute the slip speeds of the points."""
    x, points = b.vectors, b.points
    for j in range(x.shape[1]):
        x[of.STEP, j] = 0.0
    for m in range(near[0]):
        n = near[1 + m]
        here = points[n, of.ACTIVE]
        for c in range(3):
            points[n, of.LAM + c] = chosen(here, points[n, of.LAM + c], 0.0)
        scatter(ways, b, n, load(points, n, of.LAM))
    for m in range(near[0]):
        n = near[1 + m]
        u = gather(ways, b, n, of.STEP)
        along, across = points[n, of.RATE + 1] + u[1], points[n, of.RATE + 2] + u[2]
        points[n, of.SLIP] = math.sqrt(along * along + across * across)


@sweep
def push_out(rows, ways, near, b, h):
    """Run `unilateral.push_out`, which moves the new state out of deep penetration."""
    x, points, own, dinv = b.vectors, b.points, b.own, b.vectors[of.DINV]
    zero = 0.0 * b.lane[0, of.COUNT]
    deepest, deep = zero, zero
    for m in range(near[0]):
        n = near[1 + m]
        here, depth = points[n, of.ACTIVE], -points[n, of.GAP]
        deepest = larger(deepest, chosen(here, depth, 0.0))
        deep = either(deep, both(here, more(depth, tolerated(b, ways[n, of.W_SHAPE], h))))
        points[n, of.TARGET] = zero  # here the impulse that pushes out
    if not any_of(deep):
        return
    z = x[of.STEP]
    for j in range(x.shape[1]):
        z[j] = zero
        x[of.FREED, j] = x[of.NEW_Q, j]
    open_ = deep
    for _ in range(PUSH_SWEEPS):
        moved = zero
        for m in range(near[0]):
            n = near[1 + m]
            y, lam = b.y[n], points[n, of.TARGET]
            here = both(both(open_, points[n, of.ACTIVE]), more(own[n, 0], 0.0))
            if not any_of(here):
                continue
            gap = RECOVER * (points[n, of.GAP] + 0.5 * tolerated(b, ways[n, of.W_SHAPE], h))
            for s in range(ways[n, of.W_JOINTS]):
                gap += y[3 * s] * z[joint(ways, n, s)]
            new = chosen(here, larger(0.0, lam - gap / own[n, 0]), lam)
            for s in range(ways[n, of.W_JOINTS]):
                k = joint(ways, n, s)
                z[k] += dinv[k] * y[3 * s] * (new - lam)
            moved = larger(moved, abs(new - lam) * own[n, 0])
            points[n, of.TARGET] = new
        open_ = both(open_, more(moved, ENOUGH * RECOVER * deepest))
        if not any_of(open_):
            break
    spread(rows, b.const, b.work, z)
    advance(rows, x[of.NEW_Q], z, 1.0)
    for j in range(x.shape[1]):
        x[of.NEW_Q, j] = chosen(deep, x[of.NEW_Q, j], x[of.FREED, j])
