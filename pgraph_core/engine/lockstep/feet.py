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
from ..contact.closing import DEPTH, LOCATED_FROM
from ..contact.coulomb import contact
from ..contact.impulse import FEW_SWEEPS, MOVES_TOGETHER, TOLERANCE
from ..contact.sweeps import FEW_BLOCKS
from ..contact.touches import NEARBY
from ..linear import forward_free
from ..motions import transmits
from ..motions.single import along, size
from ..records import POINTS, SPHERE
from ..rows import (
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
from ..stepping.unilateral import DRIFT, OPENED, PUSH_SWEEPS, RECOVER, SINKING
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
    normal = load(b.lane, 0, of.LANE.normal)
    zero = 0.0 * lane[of.LANE.count]
    closed, margin = zero, zero
    for n in range(ways.shape[0]):
        i, k = ways[n, of.WAY.shape], ways[n, of.WAY.row]
        points[n, of.POINT.found] = zero
        points[n, of.POINT.active] = zero
        if n > 0 and ways[n - 1, of.WAY.shape] == i:
            continue
        r = rotation_of(work, k)
        pose = add(origin_of(work, k), mul(r, load(shapes, i, of.SHAPE.place)))
        store(shapes, i, of.SHAPE.pose, pose)
        closed = larger(closed, closed_gap(b, i, pose))
        u = point_velocity(work, linear, k, pose)
        turn = load(work, k, at.W)
        arm = shapes[i, of.SHAPE.reach] if ways[n, of.WAY.kind] != SPHERE else zero
        moved = h * (math.sqrt(dot(u, u)) + arm * math.sqrt(dot(turn, turn)))
        if ways[n, of.WAY.kind] != POINTS:
            lane[of.LANE.alone] = either(lane[of.LANE.alone], more(moved, shapes[i, of.SHAPE.thin]))
            moved = smaller(moved, shapes[i, of.SHAPE.thin])
        margin = larger(margin, moved)
    drift = larger(DEPTH * lane[of.LANE.length], SINKING * lane[of.LANE.pull] * h * h)
    within = larger(larger(8.0 * closed, DRIFT * drift), margin)
    count = 0
    shape = -1
    close = False
    for n in range(ways.shape[0]):
        i, k = ways[n, of.WAY.shape], ways[n, of.WAY.row]
        pose = load(shapes, i, of.SHAPE.pose)
        above = most(dot(pose, normal) - shapes[i, of.SHAPE.reach], 0.0 + within)
        if i != shape:
            shape = i
            close = any_of(above)
            if close:
                turn = mat_mul(rotation_of(work, k), load9(shapes, i, of.SHAPE.turn))
                store9(shapes, i, of.SHAPE.posed, turn)
        if not close:
            continue
        p = add(
            pose, mul(load9(shapes, i, of.SHAPE.posed), load(b.vertices, ways[n, of.WAY.vertex], 0))
        )
        gap = dot(p, normal) - shapes[i, of.SHAPE.radius]
        found = without(above, more(gap, within))
        if any_of(found):
            count += 1
            near[count] = n
            points[n, of.POINT.found] = found
            points[n, of.POINT.gap] = gap
            store(points, n, of.POINT.on_a, p)
    near[0] = count
    if count > FEW_BLOCKS:
        lane[of.LANE.alone] = lane[of.LANE.lives]
        near[0] = 0
    kept = zero
    for n in range(ways.shape[0]):
        kept = kept + points[n, of.POINT.kept]
    lane[of.LANE.alone] = either(lane[of.LANE.alone], more(kept, NEARBY))
    for m in range(near[0]):
        activate(ways, b, near[1 + m], h)
    for m in range(near[0]):
        n = near[1 + m]
        redundant = more(3.0 + zero, own_joints(ways, near, b, n))
        lane[of.LANE.alone] = either(
            lane[of.LANE.alone], both(points[n, of.POINT.active], redundant)
        )


@part
def own_joints(ways, near, b, n):
    """Count the joints that only point n moves among the active points."""
    zero = 0.0 * b.lane[0, of.LANE.count]
    own = zero
    for s in range(ways[n, of.WAY.joints]):
        shared = zero
        for m in range(near[0]):
            other = near[1 + m]
            for r in range(ways[other, of.WAY.joints]):
                if other != n and joint(ways, other, r) == joint(ways, n, s):
                    shared = either(shared, b.points[other, of.POINT.active])
        own = own + chosen(shared, 0.0, 1.0 + zero)
    return own


@part
def activate(ways, b, n, h):
    """Decide whether point n, whose position is in ON_A, is active and whether it hits."""
    lane, shapes, points = b.lane[0], b.shapes, b.points
    i, k, gap = ways[n, of.WAY.shape], ways[n, of.WAY.row], points[n, of.POINT.gap]
    normal = load(b.lane, 0, of.LANE.normal)
    on_b = add_scaled(load(points, n, of.POINT.on_a), -gap - shapes[i, of.SHAPE.radius], normal)
    on_a = add_scaled(on_b, gap, normal)
    middle = scale(0.5, add(on_a, on_b))
    store(points, n, of.POINT.on_a, on_a)
    store(points, n, of.POINT.on_b, on_b)
    store(points, n, of.POINT.middle, middle)
    closing = -dot(point_velocity(b.work, b.linear, k, middle), normal)
    shut = closed_gap(b, i, on_a)
    hits = both(
        more(closing * h, DEPTH * shapes[i, of.SHAPE.size]),
        more(closing, LOCATED_FROM * lane[of.LANE.pull] * h),
    )
    hits = both(hits, most(gap - 0.5 * h * closing, shut))
    near = 4.0 * shut
    held = both(points[n, of.POINT.kept], more(points[n, of.POINT.value], 0.0))
    drifts = both(more(gap, near), held)
    near = chosen(drifts, DRIFT * tolerated(b, i, h), near)
    points[n, of.POINT.slack] = chosen(drifts, gap / h, 0.0)
    active = both(points[n, of.POINT.found], most(gap, near))
    points[n, of.POINT.active] = active
    lane[of.LANE.alone] = either(lane[of.LANE.alone], both(points[n, of.POINT.found], hits))


@part
def directions(ways, near, b, column):
    """Compute the velocities of the points along the normal and tangents."""
    for m in range(near[0]):
        n = near[1 + m]
        u = point_velocity(
            b.work, b.linear, ways[n, of.WAY.row], load(b.points, n, of.POINT.middle)
        )
        for r in range(3):
            b.points[n, column + r] = dot(load(b.lane, 0, of.LANE.normal + 3 * r), u)


@sweep
def turned(rows, ways, near, b, h):
    """Write h/2 J' v of the points at the mean velocity into TURNED, as `moreau.turned`."""
    x, work, points = b.vectors, b.work, b.points
    set_acceleration(work, 0, (0.0, 0.0, 0.0), (0.0, 0.0, 0.0))
    for j in range(x.shape[1]):
        x[of.VECTOR.zero, j] = 0.0
    accelerate(rows, b.const, work, x[of.VECTOR.mean], x[of.VECTOR.zero])
    normal = load(b.lane, 0, of.LANE.normal)
    for m in range(near[0]):
        n = near[1 + m]
        k, radius = ways[n, of.WAY.row], b.shapes[ways[n, of.WAY.shape], of.SHAPE.radius]
        w = spin_of(work, k)
        rolling = scale(radius, cross(w, normal))
        apart = add(
            point_acceleration(work, k, load(points, n, of.POINT.middle)), cross(w, rolling)
        )
        for r in range(3):
            along = dot(load(b.lane, 0, of.LANE.normal + 3 * r), apart)
            points[n, of.POINT.turned + r] = along * (0.5 * h)


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
    p = load(b.points, n, of.POINT.middle)
    for r in range(3):
        k = ways[n, of.WAY.row]
        reach = taxicab(p) + taxicab(p)
        force = load(b.lane, 0, of.LANE.normal + 3 * r)
        moment = cross(sub(p, origin_of(work, k)), force)
        s = 0
        while k > 0:
            reach = larger(reach, taxicab(origin_of(work, k)) + taxicab(link_of(work, k)))
            if not transmits(kind_of(rows, k)):
                share = forward_free(work, k, moment, force)
                for c in range(6):
                    y[3 * (s + c) + r] = share[c]
                break
            least = ROUNDING * size(rows, work, k, reach, 1.0 + 0.0 * reach)
            one = along(rows, work, k, moment, force)
            one = chosen(most(abs(one), least), 0.0 * one, one)
            y[3 * s + r] = one
            moment, force = past_hinge(work, k, one, moment, force)
            s += 1
            k = parent_of(rows, k)


@part
def joint(ways, n, s):
    return ways[n, of.WAY.joint + s]


@sweep
def own_block(ways, b, n):
    """Compute `sweeps.own_block`."""
    y, own, dinv = b.y[n], b.own[n], b.vectors[of.VECTOR.dinv]
    for c in range(9):
        own[c] = 0.0
    for s in range(ways[n, of.WAY.joints]):
        d = dinv[joint(ways, n, s)]
        z = scale(d, (y[3 * s], y[3 * s + 1], y[3 * s + 2]))
        for r in range(3):
            for c in range(3):
                own[3 * r + c] = own[3 * r + c] + y[3 * s + r] * z[c]


@part
def warm(b, n):
    """Return λ of the last step for an active point."""
    goes_on = both(b.points[n, of.POINT.active], b.points[n, of.POINT.kept])
    for c in range(3):
        b.points[n, of.POINT.lam + c] = chosen(goes_on, b.points[n, of.POINT.value + c], 0.0)
        b.points[n, of.POINT.held + c] = b.points[n, of.POINT.lam + c]


@part
def gather(ways, b, n, row):
    """Return Y z of point n, for a row of `vectors`."""
    y, z = b.y[n], b.vectors[row]
    zero = 0.0 * z[0]
    u = (zero, zero, zero)
    for s in range(ways[n, of.WAY.joints]):
        u = add_scaled(u, z[joint(ways, n, s)], (y[3 * s], y[3 * s + 1], y[3 * s + 2]))
    return u


@part
def velocity(ways, b, n):
    return add_scaled(gather(ways, b, n, of.VECTOR.effect), 1.0, load(b.points, n, of.POINT.target))


@part
def scatter(ways, b, n, change):
    """Add diag(1/d) Yᵀ times a change in λ to STEP."""
    y, w, dinv = b.y[n], b.vectors[of.VECTOR.effect], b.vectors[of.VECTOR.dinv]
    for s in range(ways[n, of.WAY.joints]):
        k = joint(ways, n, s)
        w[k] += dinv[k] * dot((y[3 * s], y[3 * s + 1], y[3 * s + 2]), change)


@sweep
def aim(ways, near, b, again):
    """Run `impulse.aim` and `impulse.is_as_before`. SIZE receives the largest velocity."""
    x, points, lane = b.vectors, b.points, b.lane[0]
    size, carried, change = (
        lane[of.LANE.count] * 0.0,
        lane[of.LANE.count] * 0.0,
        lane[of.LANE.count] * 0.0,
    )
    for m in range(near[0]):
        n = near[1 + m]
        here = points[n, of.POINT.active]
        for c in range(3):
            most_ = larger(abs(points[n, of.POINT.rate + c]), abs(points[n, of.POINT.before + c]))
            size = larger(size, chosen(here, most_, 0.0))
            moved = abs(points[n, of.POINT.rate + c] - points[n, of.POINT.passed + c])
            change = larger(change, chosen(here, moved, 0.0))
            points[n, of.POINT.passed + c] = points[n, of.POINT.rate + c]
        y = b.y[n]
        for s in range(ways[n, of.WAY.joints]):
            column = (y[3 * s], y[3 * s + 1], y[3 * s + 2])
            one = abs(x[of.VECTOR.speeds, joint(ways, n, s)]) * math.sqrt(dot(column, column))
            carried = larger(carried, chosen(here, one, 0.0))
    together = more(carried, MOVES_TOGETHER * size)
    for j in range(x.shape[1]):
        x[of.VECTOR.freed, j] = chosen(together, 0.0 * size, x[of.VECTOR.speeds, j])
    for m in range(near[0]):
        n = near[1 + m]
        pair = ways[n, of.WAY.pair]
        for c in range(3):
            points[n, of.POINT.target + c] = chosen(
                together, points[n, of.POINT.rate + c], points[n, of.POINT.turned + c]
            )
        points[n, of.POINT.target] += b.laws[pair, 1] * smaller(points[n, of.POINT.before], 0.0)
        points[n, of.POINT.target] += points[n, of.POINT.slack]
    lane[of.LANE.size] = size
    lane[of.LANE.stays] = 0.0
    if again:
        lane[of.LANE.stays] = chosen(most(change, EPS * size), 1.0 + 0.0 * size, 0.0)


@sweep
def gauss_seidel(ways, near, b):
    """Run `sweeps.gauss_seidel`. Finished lanes wait for the others."""
    x, points, lane = b.vectors, b.points, b.lane[0]
    for j in range(x.shape[1]):
        x[of.VECTOR.effect, j] = x[of.VECTOR.freed, j]
    for m in range(near[0]):
        n = near[1 + m]
        scatter(ways, b, n, load(points, n, of.POINT.lam))
    size = lane[of.LANE.size]
    touches = 0.0 * size
    for m in range(near[0]):
        n = near[1 + m]
        touches = either(touches, points[n, of.POINT.active])
    open_ = both(
        touches, without(lane[of.LANE.lives], either(lane[of.LANE.alone], lane[of.LANE.stays]))
    )
    lane[of.LANE.alone] = either(lane[of.LANE.alone], both(open_, most(size, 0.0)))
    swept, left = lane[of.LANE.swept], 0.0 * size
    for _ in range(FEW_SWEEPS):
        if not any_of(open_):
            break
        change = 0.0 * size
        for m in range(near[0]):
            n = near[1 + m]
            here = both(open_, points[n, of.POINT.active])
            if not any_of(here):
                continue
            old = load(points, n, of.POINT.lam)
            u, mu = velocity(ways, b, n), b.laws[ways[n, of.WAY.pair], 0]
            new = contact(b.own[n], u, old, mu, here)
            new = (
                chosen(here, new[0], old[0]),
                chosen(here, new[1], old[1]),
                chosen(here, new[2], old[2]),
            )
            step = sub(new, old)
            scatter(ways, b, n, step)
            store(points, n, of.POINT.lam, new)
            for c in range(3):
                change = larger(change, abs(step[c]) * b.own[n, 4 * c])
        swept += chosen(open_, 1.0 + 0.0 * size, 0.0)
        left = chosen(open_, change / size, left)
        open_ = both(open_, more(change, TOLERANCE * size))
    lane[of.LANE.swept] = swept
    lane[of.LANE.open] = larger(lane[of.LANE.open], left)
    lane[of.LANE.alone] = either(lane[of.LANE.alone], both(touches, more(left, TOLERANCE)))


@sweep
def gain_and_miss(ways, near, b):
    """Run `impulse.gained` and `note_missed`. Lanes in which a rebound increases the energy
    continue individually."""
    points, lane, own = b.points, b.lane[0], b.own
    gain, size, bouncing = (
        0.0 * lane[of.LANE.size],
        0.0 * lane[of.LANE.size],
        0.0 * lane[of.LANE.size],
    )
    for m in range(near[0]):
        n = near[1 + m]
        here = points[n, of.POINT.active]
        law = b.laws[ways[n, of.WAY.pair]]
        u = velocity(ways, b, n)
        lam = load(points, n, of.POINT.lam)
        before = load(points, n, of.POINT.before)
        rate = load(points, n, of.POINT.rate)
        back = law[1] * smaller(before[0], 0.0)
        back = back + points[n, of.POINT.slack]
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
        points[n, of.POINT.missed] = chosen(
            moves, abs(lam[0] - larger(lam[0] - u[0] / own[n, 0], 0.0)), 0.0
        )
        mobility = larger(own[n, 4], own[n, 8])
        x, y = lam[1] - u[1] / mobility, lam[2] - u[2] / mobility
        rim = law[0] * larger(lam[0], 0.0)
        pull = math.sqrt(x * x + y * y)
        fit = chosen(more(pull, rim), rim / pull, 1.0)
        x, y = lam[1] - fit * x, lam[2] - fit * y
        points[n, of.POINT.missed + 1] = chosen(more(mobility, 0.0), math.sqrt(x * x + y * y), 0.0)
    lane[of.LANE.gained] = gain
    lane[of.LANE.alone] = either(lane[of.LANE.alone], both(bouncing, more(gain, NOTABLE * size)))


@sweep
def effects(ways, near, b):
    """Write diag(1/d) Yᵀ λ into STEP, and compute the slip speeds of the points."""
    x, points = b.vectors, b.points
    for j in range(x.shape[1]):
        x[of.VECTOR.effect, j] = 0.0
    for m in range(near[0]):
        n = near[1 + m]
        here = points[n, of.POINT.active]
        for c in range(3):
            points[n, of.POINT.lam + c] = chosen(here, points[n, of.POINT.lam + c], 0.0)
        scatter(ways, b, n, load(points, n, of.POINT.lam))
    for m in range(near[0]):
        n = near[1 + m]
        u = gather(ways, b, n, of.VECTOR.effect)
        along, across = points[n, of.POINT.rate + 1] + u[1], points[n, of.POINT.rate + 2] + u[2]
        points[n, of.POINT.slip] = math.sqrt(along * along + across * across)


@sweep
def push_out(rows, ways, near, b, h):
    """Run `unilateral.push_out`, which moves the new state out of deep penetration."""
    x, points, own, dinv = b.vectors, b.points, b.own, b.vectors[of.VECTOR.dinv]
    zero = 0.0 * b.lane[0, of.LANE.count]
    deepest, deep = zero, zero
    for m in range(near[0]):
        n = near[1 + m]
        here, depth = points[n, of.POINT.active], -points[n, of.POINT.gap]
        deepest = larger(deepest, chosen(here, depth, 0.0))
        deep = either(deep, both(here, more(depth, tolerated(b, ways[n, of.WAY.shape], h))))
        points[n, of.POINT.target] = zero  # here the impulse that pushes out
    if not any_of(deep):
        return
    z = x[of.VECTOR.effect]
    for j in range(x.shape[1]):
        z[j] = zero
        x[of.VECTOR.freed, j] = x[of.VECTOR.new_q, j]
    open_ = deep
    for _ in range(PUSH_SWEEPS):
        moved = zero
        for m in range(near[0]):
            n = near[1 + m]
            y, lam = b.y[n], points[n, of.POINT.target]
            here = both(both(open_, points[n, of.POINT.active]), more(own[n, 0], 0.0))
            if not any_of(here):
                continue
            gap = RECOVER * (points[n, of.POINT.gap] + 0.5 * tolerated(b, ways[n, of.WAY.shape], h))
            for s in range(ways[n, of.WAY.joints]):
                gap += y[3 * s] * z[joint(ways, n, s)]
            new = chosen(here, larger(0.0, lam - gap / own[n, 0]), lam)
            for s in range(ways[n, of.WAY.joints]):
                k = joint(ways, n, s)
                z[k] += dinv[k] * y[3 * s] * (new - lam)
            moved = larger(moved, abs(new - lam) * own[n, 0])
            points[n, of.POINT.target] = new
        open_ = both(open_, more(moved, OPENED * RECOVER * deepest))
        if not any_of(open_):
            break
    spread(rows, b.const, b.work, z)
    advance(rows, x[of.VECTOR.new_q], z, 1.0)
    for j in range(x.shape[1]):
        x[of.VECTOR.new_q, j] = chosen(deep, x[of.VECTOR.new_q, j], x[of.VECTOR.freed, j])
