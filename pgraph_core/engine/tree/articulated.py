"""Articulated-body algorithm: forward dynamics in three sweeps, O(n).

[Featherstone 2008, ch. 7], here in world-aligned axes at the bodies' origins, where the paper's
φ is a pure shift and a and b are those of eqs. (9) and (12).
"""

from ..compiler.jit import part, sweep
from ..motions import is_singular, reduce, relay, solve
from ..rows import parent_of, set_acceleration
from .kinematics import driven, outboard


@sweep
def inboard(rows, const, work, tau):
    """Second sweep, tips to root: compute articulated inertias and bias forces."""
    for k in range(rows.shape[0] - 1, 0, -1):
        reduce(rows, work, k, const, tau)


@sweep
def inboard_again(rows, const, work, tau):
    """Run `inboard` with the inertias of the last one, for the same q and armatures."""
    for k in range(rows.shape[0] - 1, 0, -1):
        relay(rows, work, k, const, tau)


@sweep
def joint_acceleration(rows, const, work, vdot):
    """Third sweep, root to tips: compute v' of every row, with V' overwriting the bias."""
    for k in range(1, rows.shape[0]):
        alpha, linear = driven(work, parent_of(rows, k), k)
        alpha, linear = solve(rows, work, k, const, alpha, linear, vdot)
        set_acceleration(work, k, alpha, linear)


@part
def articulated(rows, const, q, v, tau, work, vdot):
    """Compute v' = M⁻¹ (τ - C), eq. (26), in three sweeps."""
    outboard(rows, const, work, q, v)
    inboard(rows, const, work, tau)
    joint_acceleration(rows, const, work, vdot)


@sweep
def singular_row(rows, work):
    """Find the first row, starting from the tips, with no inertia up to rounding, or 0 if there
    is none."""
    for k in range(rows.shape[0] - 1, 0, -1):
        if is_singular(rows, work, k):
            return k
    return 0
