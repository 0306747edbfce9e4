"""Torques of least weighted norm that give v' with the active constraints, in one pass.

τ = r - Jᵀλ with r = M v' + C - passive of the tree, and Σ w τ² is least where J W Jᵀ λ = J W r.
Redundant rows stay at rest in proximal steps λ += (J W Jᵀ + ρ)⁻¹ J W (r - Jᵀλ) ([Carpentier,
Budhiraja and Mansard 2021] for forward dynamics). Where a joint has no motor its torque goes to
zero by the method of multipliers: a large weight, and a shift by what is left.
"""

from numba import types

from .arrays import F1, F2, opened
from .compiler.jit import kernel, sweep
from .constraints.blocks import residual, residual_velocity, velocities
from .constraints.constraints import located
from .motion import call_acceleration
from .tree.dynamics import newton_euler
from .tree.kinematics import outboard

CLOSED = 1e-9  # of the length of the rows, of their speeds: a state that meets its constraints
PROXIMAL = 1e-10  # of the mean diagonal of J W Jᵀ
ROUNDS = 12
SETTLED = 1e-14  # of the largest force: steps that change nothing more
IDLE = 1e4  # weight of a joint without a motor, of the largest weight
UNMOVED = 1e-11  # of the largest force: what such a joint may keep
SAME = 1e-10  # of the largest force: M times what v' differs that the torques give
WANTED, UNIT, SHIFT, WEIGHT, ROW, BASE, AGAIN, FLOW = 0, 1, 2, 3, 4, 5, 6, 7
VECTORS = 8  # rows of the workspace


@sweep
def set_jacobian(scene, q, vectors, m, jac):
    """J (m, nv) of the active rows, column by column: g' of unit speeds, after `located`."""
    data = opened(scene)
    rows, const, blocks, work, space = data.rows, data.const, data.blocks, data.work, data.space
    n = jac.shape[1]
    unit, row, base = vectors[UNIT, :n], vectors[ROW], vectors[BASE]
    for j in range(n):
        unit[j] = 0.0
    for j in range(-1, n):
        if j >= 0:
            unit[j] = 1.0
        outboard(rows, const, work, q, unit)
        velocities(rows, const, work, unit, space.linear)
        residual_velocity(blocks, work, space, 0.0, unit, row)
        for r in range(m):
            if j < 0:
                base[r] = row[r]  # what prescribed motions ask for
            else:
                jac[r, j] = row[r] - base[r]
        if j >= 0:
            unit[j] = 0.0


@sweep
def set_factor(jac, weight, m, gram):
    """Cholesky's factor of J W Jᵀ + ρ in the lower triangle of `gram`; False where it has none."""
    n, trace = jac.shape[1], 0.0
    for r in range(m):
        for s in range(r + 1):
            x = 0.0
            for j in range(n):
                x += jac[r, j] * weight[j] * jac[s, j]
            gram[r, s] = x
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
                gram[r, r] = x**0.5
            else:
                return False
    return True


@sweep
def solve_factor(gram, m, x):
    """(L Lᵀ)⁻¹ x in place."""
    for r in range(m):
        for k in range(r):
            x[r] -= gram[r, k] * x[k]
        x[r] /= gram[r, r]
    for r in range(m - 1, -1, -1):
        x[r] /= gram[r, r]
        for k in range(r):
            x[k] -= gram[r, k] * x[r]


@kernel(
    types.int64(
        types.int64, types.int64, types.float64, F1, F1, F1, F1, F1, F2, F2, F2, F1
    ),
    later=True,
)  # fmt: skip
def least_torques(scene, accelerate, length, q, v, vdot, passive, cost, jac, gram, vectors, tau):
    """τ (nv,) into `tau`; 0, or 1 where a closer look must say what is wrong or undecided.

    `length` [m] is that of rows of angles, `passive` (nv,) what acts besides τ, `cost` (nv,) the
    weights, 0 where a joint has no motor. `jac`, `gram` and `vectors` are workspace.
    """
    data = opened(scene)
    rows, const, blocks, work, space = data.rows, data.const, data.blocks, data.work, data.space
    n = v.shape[0]
    wanted, shift, weight, row = vectors[WANTED], vectors[SHIFT], vectors[WEIGHT], vectors[ROW]
    outboard(rows, const, work, q, v)
    newton_euler(rows, const, v, vdot, work, tau)
    largest = 0.0
    for j in range(n):
        tau[j] -= passive[j]
        wanted[j] = tau[j]
        largest = max(largest, abs(tau[j]), abs(passive[j]))
    outboard(rows, const, work, q, v)
    m = located(scene, v, True)
    residual(blocks, work, space, 0.0, q, row)
    for r in range(m):
        if not abs(row[r]) <= CLOSED * length:
            return 1
    set_jacobian(scene, q, vectors, m, jac)
    base, fast, slip = vectors[BASE], 0.0, 0.0
    for r in range(m):
        x, size = base[r], abs(base[r])
        for j in range(n):
            x += jac[r, j] * v[j]
            size += abs(jac[r, j] * v[j])
        slip, fast = max(slip, abs(x)), max(fast, size)
    if not slip <= CLOSED * fast:
        return 1
    dearest = 0.0
    for j in range(n):
        shift[j] = 0.0
        dearest = max(dearest, cost[j])
    for j in range(n):
        weight[j] = cost[j] if cost[j] > 0.0 else IDLE * dearest
    if not set_factor(jac, weight, m, gram):
        return 1
    for _ in range(ROUNDS):
        for r in range(m):
            x = 0.0
            for j in range(n):
                x += jac[r, j] * (weight[j] * (tau[j] + shift[j]))
            row[r] = x
        solve_factor(gram, m, row)
        changed, idle = 0.0, 0.0
        for j in range(n):
            x = 0.0
            for r in range(m):
                x += jac[r, j] * row[r]
            tau[j] -= x
            changed = max(changed, abs(x))
            if not cost[j] > 0.0:
                shift[j] += tau[j]
                idle = max(idle, abs(tau[j]))
        if changed <= SETTLED * largest and idle <= UNMOVED * largest:
            break
    else:
        return 1
    for j in range(n):
        if not cost[j] > 0.0:
            tau[j] = 0.0
        data.given[j] = tau[j]
    again = vectors[AGAIN, :n]
    call_acceleration(accelerate, (scene, 0.0, q, v, vectors[UNIT, :n], again, vectors[FLOW, :3]))
    outboard(rows, const, work, q, v)
    newton_euler(rows, const, v, again, work, vectors[UNIT, :n])
    apart = 0.0
    for j in range(n):
        apart = max(apart, abs(vectors[UNIT, j] - passive[j] - wanted[j]))
    return 0 if apart <= SAME * largest else 1
