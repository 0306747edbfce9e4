"""Torques of minimum weighted norm that yield v' with the active constraints, in one pass.

τ = r - Jᵀλ with r = M v' + C - passive of the tree, and Σ w τ² is least where J W Jᵀ λ = J W r.
Redundant rows stay at rest in proximal steps λ += (J W Jᵀ + ρ)⁻¹ J W (r - Jᵀλ) ([Carpentier,
Budhiraja and Mansard 2021] for forward dynamics). The torques of joints without a motor are reduced
to zero by the method of multipliers, with a large weight and a shift by the remaining torque.
"""

import math

from ..tolerances import EPS, PROXIMAL, ROUNDING, SOLVED
from .arrays import opened
from .cables import over_spans
from .compiler.jit import kernel, part, sweep
from .compiler.kinds import F1, F2, f8, i8
from .constraints.blocks import (
    along,
    along_coordinates,
    ends_of,
    first_of,
    place_a,
    place_b,
    residual,
    residual_velocity,
    size_of,
    stations_of,
    type_of,
)
from .constraints.constraints import located
from .constraints.coordinates import coefficient, terms_of
from .layout import T_ALIGN, T_CABLE, T_TURN
from .motion import call_acceleration
from .motions import column, nv_of
from .records import columns
from .rows import kind_of, origin_of, parent_of, v_of
from .tree.dynamics import newton_euler
from .tree.kinematics import outboard
from .vec import add, cross, dot, sub

FIXED_POINT_ROUNDS = 12
IDLE = EPS**-0.25  # weight of a joint without a motor, of the largest: the gain of a round
# rows of the workspace
INVERSE = columns("wanted", "torque", "shift", "weight", "row", "again", "flow")


@part
def add_path(data, i, k, p, sign, turned):
    """Add to Jᵀ the effect on block i at p of the degrees of freedom from row k to the ground."""
    rows, const, work, place = data.rows, data.const, data.work, data.space.place
    first, kind = first_of(data.space.slots, i), type_of(data.blocks.blocks_i, i)
    turns = kind == T_ALIGN or kind == T_TURN
    while k > 0:
        arm = sub(p, origin_of(work, k))
        for c in range(nv_of(kind_of(rows, k))):
            spin, speed = column(rows, work, k, const, c)
            if not turns:
                spin = add(speed, cross(spin, arm))
            for r in range(size_of(data.blocks.blocks_i, i)):
                turned[v_of(rows, k) + c, first + r] += sign * dot(along(place, i, r), spin)
        k = parent_of(rows, k)


@part
def add_span(to, vias, work, n, p, q, along):
    """Add to a column of Jᵀ the effect of unit forces that lengthen a span."""
    rows, const, turned, column_of_row = to
    for sign in (-1.0, 1.0):
        k, x = (vias[n - 1].row, p) if sign < 0.0 else (vias[n].row, q)
        while k > 0:
            arm = sub(x, origin_of(work, k))
            for c in range(nv_of(kind_of(rows, k))):
                spin, speed = column(rows, work, k, const, c)
                speed = add(speed, cross(spin, arm))
                turned[v_of(rows, k) + c, column_of_row] += sign * dot(along, speed)
            k = parent_of(rows, k)
    return 0.0


add_spans = over_spans(add_span)


@sweep
def set_jacobian(scene, m, turned):
    """Compute Jᵀ (nv, m) of the active rows, after `located`."""
    data = opened(scene)
    rows, const = data.rows, data.const
    blocks_i, terms_i, active = data.blocks.blocks_i, data.blocks.terms_i, data.blocks.active
    place = data.space.place
    for j in range(turned.shape[0]):
        for r in range(m):
            turned[j, r] = 0.0
    for n in range(1, active[0] + 1):
        i = active[n]
        kind = type_of(blocks_i, i)
        if along_coordinates(kind):
            begin, end = terms_of(blocks_i, i)
            for x in range(begin, end):
                size = coefficient(data.blocks, place, i, x)
                turned[terms_i[x, 0], first_of(data.space.slots, i)] += size
            continue
        if kind == T_CABLE:
            first, last = stations_of(blocks_i, i)
            to = rows, const, turned, first_of(data.space.slots, i)
            add_spans(to, data.blocks.stations, data.work, first, last)
            continue
        a, b = ends_of(blocks_i, i)
        add_path(data, i, a, place_a(place, i), 1.0, turned)
        add_path(data, i, b, place_b(place, i), -1.0, turned)


@sweep
def set_factor(turned, weight, m, gram):
    """Factor J W Jᵀ + ρ in the lower triangle of `gram`. Returns False if it is singular."""
    trace = 0.0
    for r in range(m):
        for s in range(m):
            gram[r, s] = 0.0
    for j in range(turned.shape[0]):
        for r in range(m):
            x = weight[j] * turned[j, r]
            if x != 0.0:
                for s in range(r + 1):
                    gram[r, s] += x * turned[j, s]
    for r in range(m):
        trace += gram[r, r]
    for r in range(m):
        gram[r, r] += PROXIMAL * trace / m
    for r in range(m):
        for s in range(r + 1):
            x = gram[r, s]
            for k in range(s):
                x -= gram[r, k] * gram[s, k]
            if s < r:
                gram[r, s] = x / gram[s, s]
            elif x > 0.0:
                gram[r, r] = math.sqrt(x)
            else:
                return False
    return True


@sweep
def solve_factor(gram, m, x):
    """Compute (L Lᵀ)⁻¹ x in place."""
    for r in range(m):
        for k in range(r):
            x[r] -= gram[r, k] * x[k]
        x[r] /= gram[r, r]
    for r in range(m - 1, -1, -1):
        x[r] /= gram[r, r]
        for k in range(r):
            x[k] -= gram[r, k] * x[r]


@kernel(
    i8(
        i8, i8, f8, F1, F1, F1, F1, F1, F2, F2, F2, F1
    ),
    later=True,
)  # fmt: skip
def least_torques(scene, accelerate, length, q, v, vdot, passive, cost, turned, gram, vectors, tau):
    """Compute τ (nv,). Returns 0, or 1 if the input is bad or rows may be redundant.

    `length` [m] multiplies rows of angles, `passive` (nv,) are the passive forces, `cost` (nv,) the
    weights, 0 for joints without a motor. `turned`, `gram` and `vectors` are workspace.
    """
    data = opened(scene)
    rows, const, blocks, work, space = data.rows, data.const, data.blocks, data.work, data.space
    n = v.shape[0]
    wanted, shift, weight, row = (
        vectors[INVERSE.wanted],
        vectors[INVERSE.shift],
        vectors[INVERSE.weight],
        vectors[INVERSE.row],
    )
    outboard(rows, const, work, q, v)
    newton_euler(rows, const, v, vdot, work, tau)
    largest = 0.0
    for j in range(n):
        tau[j] -= passive[j]
        wanted[j] = tau[j]
        largest = max(largest, abs(tau[j]), abs(passive[j]))
    outboard(rows, const, work, q, v)
    m = located(scene, q, v, True)
    residual(blocks, work, space, 0.0, q, row)
    for r in range(m):
        if not abs(row[r]) <= SOLVED * length:
            return 1
    set_jacobian(scene, m, turned)
    residual_velocity(blocks, work, space, 0.0, v, row)
    fast = 0.0
    for r in range(m):
        size = 0.0
        for j in range(n):
            size += abs(turned[j, r] * v[j])
        fast = max(fast, size)
    for r in range(m):
        if not abs(row[r]) <= SOLVED * fast:
            return 1
    dearest = 0.0
    for j in range(n):
        shift[j] = 0.0
        dearest = max(dearest, cost[j])
    for j in range(n):
        weight[j] = cost[j] if cost[j] > 0.0 else IDLE * dearest
    if not set_factor(turned, weight, m, gram):
        return 1
    for _ in range(FIXED_POINT_ROUNDS):
        for r in range(m):
            row[r] = 0.0
        for j in range(n):
            x = weight[j] * (tau[j] + shift[j])
            for r in range(m):
                row[r] += turned[j, r] * x
        solve_factor(gram, m, row)
        changed, idle = 0.0, 0.0
        for j in range(n):
            x = 0.0
            for r in range(m):
                x += turned[j, r] * row[r]
            tau[j] -= x
            changed = max(changed, abs(x))
            if not cost[j] > 0.0:
                shift[j] += tau[j]
                idle = max(idle, abs(tau[j]))
        if changed <= ROUNDING * largest and idle <= ROUNDING * largest:
            break
    else:
        return 1
    for j in range(n):
        if not cost[j] > 0.0:
            tau[j] = 0.0
        data.given[j] = tau[j]
    again = vectors[INVERSE.again, :n]
    call_acceleration(
        accelerate,
        (scene, 0.0, q, v, vectors[INVERSE.torque, :n], again, vectors[INVERSE.flow, :3]),
    )
    outboard(rows, const, work, q, v)
    newton_euler(rows, const, v, again, work, vectors[INVERSE.torque, :n])
    apart = 0.0
    for j in range(n):
        apart = max(apart, abs(vectors[INVERSE.torque, j] - passive[j] - wanted[j]))
    return 0 if apart <= SOLVED * largest else 1
