"""Exact impulses at one instant for a few contacts with friction, using Newton's restitution.

With u = Ω λ + u⁻: a contact that pushes (λ_n > 0) leaves with u_n = -e u_n⁻, one that does not with
u_n ≥ -e u_n⁻; λ_t is within μ λ_n if nothing slips, and on that rim against the slip else.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from typing import NamedTuple

import numpy as np

from ..packing import Array
from ..tolerances import ROUNDING, SOLVED

STEPS, HALVINGS = 40, 12  # limits on steps of Newton's method, and on halvings of a step
ROUNDS, SWEEPS = 30, 20  # rounds of contacts in turn before it, sweeps in each
DIRECTIONS = 48  # slip directions between which a root is bracketed


class ContactRow(NamedTuple):
    """A contact point of an impact: its rows and its laws."""

    first: int  # its normal row
    size: int  # 3, or 1 for a limit
    friction: float
    restitution_velocity: float  # e u_n⁻ of a contact that closes, else 0
    held: bool = False  # Painlevé's case: the impulse that ends its slip


class Solution(NamedTuple):
    """Impulses for all rows and the resulting velocities."""

    impulse: Array
    velocity: Array
    gain: float  # gain of kinetic energy [J]
    missed: float  # residual of the laws relative to the largest velocity


def impulses(omega: Array, u: Array, bilateral: int, rows: Sequence[ContactRow]) -> Solution:
    """Return λ for all rows. The velocity of the first `bilateral` rows is constrained to zero."""
    b = slice(0, bilateral)
    inverse = np.linalg.pinv(omega[b, b], rcond=ROUNDING, hermitian=True)
    reduced = omega - omega[:, b] @ inverse @ omega[b]
    free = u - omega[:, b] @ (inverse @ u[b])
    lam = np.zeros(len(u))
    missed = _solve(reduced, free, rows, lam)
    lam[b] = -inverse @ (u[b] + omega[b, bilateral:] @ lam[bilateral:])
    after = u + omega @ lam
    after[b] = 0.0
    return Solution(lam, after, float(lam @ (u + after)) / 2, missed)


def _solve(omega: Array, free: Array, rows: Sequence[ContactRow], lam: Array) -> float:
    """Solve for λ at all contacts. Return the residual relative to the largest velocity.

    Newton's method starts from all contacts at once, so that symmetric scenes stay symmetric. If
    Newton's method fails, the contact modes (stick, slide, open) are determined one contact at a
    time, and Newton's method continues from the result.
    """
    parts = [slice(row.first, row.first + row.size) for row in rows]
    if len(rows) == 1:
        lam[parts[0]] = _one(omega[parts[0], parts[0]], free[parts[0]], rows[0])
        return 0.0
    starts = _at_once(omega, free, rows), np.zeros(len(free))
    tries = [_newton(omega, free, rows, start) for start in starts[:1]]
    if tries[0][1] > SOLVED:
        tries.append(_newton(omega, free, rows, starts[1]))
    found, left = min(tries, key=lambda each: each[1])
    turns = starts[1]
    for _ in range(ROUNDS if left > SOLVED else 0):
        for _ in range(SWEEPS):
            for row, part in zip(rows, parts):
                own = omega[part, part]
                turns[part] = _one(own, free[part] + omega[part] @ turns - own @ turns[part], row)
        turns, missed = _newton(omega, free, rows, turns)
        if missed < left:
            found, left = turns.copy(), missed
        if left <= SOLVED:
            break
    lam[:] = found
    return left


def _at_once(omega: Array, free: Array, rows: Sequence[ContactRow]) -> Array:
    """Return λ with all closing contacts sticking, moved to the cone's rim if outside it.

    A contact at rest counts as closing. Otherwise rounding would choose between solutions.
    """
    lam = np.zeros(len(free))
    slow = SOLVED * float(np.abs(free).max(initial=0.0))
    closing = [row for row in rows if row.held or free[row.first] + row.restitution_velocity < slow]
    picked = [row.first + k for row in closing for k in range(row.size)]
    wanted = free.copy()
    for row in closing:
        wanted[row.first] += row.restitution_velocity
    block = omega[np.ix_(picked, picked)]
    lam[picked] = -np.linalg.lstsq(block, wanted[picked], rcond=ROUNDING)[0]
    for row in closing:
        drag, most = lam[row.first + 1 : row.first + row.size], row.friction * lam[row.first]
        if row.size == 1 or row.held or np.linalg.norm(drag) <= most:
            continue
        slip = free[row.first + 1 : row.first + 3]
        speed = float(np.linalg.norm(slip))
        way = slip / speed if speed > 0 else -drag / np.linalg.norm(drag)
        drag[:] = -max(most, 0.0) * way
    return lam


def _newton(
    omega: Array, free: Array, rows: Sequence[ContactRow], start: Array
) -> tuple[Array, float]:
    """Compute (λ, residual relative to the largest velocity) from damped Newton steps.

    The contact laws are the same as in `engine/contact/newton.py`. They are formulated as
    projections onto the admissible set of λ ([Alart, Curnier 1991]). Impulses are scaled by the
    mobility of their contact, so the result does not depend on the scale of masses.
    """
    scale = np.ones(len(free))
    for row in rows:
        own = omega[row.first, row.first]
        scale[row.first : row.first + row.size] = 1.0 / math.sqrt(own) if own > 0 else 1.0
    omega, free, lam = scale[:, None] * omega * scale, scale * free, start / scale
    back = np.zeros(len(free))
    for row in rows:
        back[row.first] = scale[row.first] * row.restitution_velocity
    size = float(np.abs(free).max(initial=0.0) + np.abs(back).max(initial=0.0))
    if size == 0.0:
        return np.zeros(len(free)), 0.0
    missed, slope = _laws(omega, free + back, rows, lam)
    left = float(np.linalg.norm(missed))
    for _ in range(STEPS):
        if left <= ROUNDING * size or not np.isfinite(slope).all():
            break
        step = np.linalg.lstsq(slope, -missed, rcond=ROUNDING)[0]
        for _ in range(HALVINGS):
            new = lam + step
            found = _laws(omega, free + back, rows, new)
            after = float(np.linalg.norm(found[0]))
            if after < left:
                break
            step = 0.5 * step
        else:
            break
        lam, (missed, slope), left = new, found, after
    return scale * lam, left / size


def _laws(omega: Array, free: Array, rows: Sequence[ContactRow], lam: Array) -> tuple[Array, Array]:
    """Compute (velocity residuals of the contact laws at λ, their derivatives in λ).

    `free` are the velocities without impulses, those that bounces ask for taken off.
    """
    after, eye = free + omega @ lam, np.eye(len(lam))
    missed, slope = after.copy(), omega.copy()  # start with the residuals of held rows
    for row in rows:
        n, t = row.first, slice(row.first + 1, row.first + 3)
        own = omega[n, n]
        if row.held:
            continue
        if own * lam[n] - after[n] <= 0:  # open
            missed[n], slope[n] = own * lam[n], own * eye[n]
        if row.size == 1:
            continue
        most = _most_mobile(omega[t, t])
        most = most if most > SOLVED * own else own  # impulses do not change a slip that is driven
        pull = most * lam[t] - after[t]
        size, rim = math.hypot(*pull), most * row.friction * max(lam[n], 0.0)
        if size > rim:  # sliding
            way = pull / size
            missed[t] = most * lam[t] - rim * way
            turned = (np.eye(2) - np.outer(way, way)) * (rim / size)
            slope[t] = most * eye[t] - turned @ (most * eye[t] - omega[t])
            if lam[n] > 0:
                slope[t] -= most * row.friction * np.outer(way, eye[n])
    return missed, slope


def _most_mobile(omega: Array) -> float:
    """Compute the larger eigenvalue of a contact's tangential block. The value does not depend on
    the basis."""
    (a, b), (_, c) = omega.tolist()
    return 0.5 * (a + c + math.hypot(a - c, 2.0 * b))


def _one(omega: Array, u: Array, row: ContactRow) -> Array:
    """Solve for λ at one contact with the others fixed, given its velocity without λ."""
    none = np.zeros(row.size)
    target = u + np.array([row.restitution_velocity, 0.0, 0.0])[: row.size]
    if (target[0] >= 0 and not row.held) or omega[0, 0] <= 0:
        return none
    if row.size == 1:
        return -target / omega[0, 0]
    stick = -np.linalg.pinv(omega, rcond=ROUNDING, hermitian=True) @ target
    slip = np.linalg.norm(target + omega @ stick)  # left if the bodies are driven
    sticks = slip <= SOLVED * np.linalg.norm(target)
    rim = row.friction * stick[0] * (1 + ROUNDING)
    if row.held or (sticks and math.hypot(stick[1], stick[2]) <= rim):
        return stick if stick[0] > 0 else none
    return _sliding(omega, target, row.friction)


def _sliding(omega: Array, u: Array, mu: float) -> Array:
    """Return λ on the rim of the cone, opposing the remaining slip.

    Slip towards d leaves u - u_n Ω a / p with a = n - μ d and p = Ω_n a > 0; times p, what of it
    lies across d has no poles.
    """
    if mu == 0.0:
        return np.array([-u[0] / omega[0, 0], 0.0, 0.0])

    def across(angle: float) -> float:
        d = np.array([math.cos(angle), math.sin(angle)])
        along = np.array([1.0, *(-mu * d)])
        left = float(omega[0] @ along) * u[1:] - u[0] * (omega[1:] @ along)
        return float(d[0] * left[1] - d[1] * left[0])

    # In a plane the slip goes on or turns round: these two are in the middle of what is searched.
    start = math.atan2(u[2], u[1]) + math.pi / DIRECTIONS
    angles = (start + np.linspace(-math.pi, math.pi, DIRECTIONS + 1)).tolist()
    values = [across(a) for a in angles]
    best, most = np.zeros(3), -math.inf
    for a, c, at_a, at_c in zip(angles, angles[1:], values, values[1:]):
        angle = _root(across, a, c, at_a, at_c)
        if angle is None:
            continue
        d = np.array([0.0, math.cos(angle), math.sin(angle)])
        along = np.array([1.0, 0.0, 0.0]) - mu * d
        pull = float(omega[0] @ along)
        if not pull > 0:
            continue
        lam = -u[0] / pull * along
        slip = float(d @ (u + omega @ lam))
        if lam[0] < math.inf and slip > most:
            best, most = lam, slip
    return best


def _root(
    function: Callable[[float], float], a: float, b: float, at_a: float, at_b: float
) -> float | None:
    """Return the zero of a function between a and b, or None for equal signs or overflow."""
    if at_a == 0.0:
        return a
    if at_b == 0.0:
        return b
    if (at_a > 0) == (at_b > 0) or not math.isfinite(at_b - at_a):  # a product may underflow
        return None
    from scipy.optimize import brentq

    return float(brentq(function, a, b, xtol=1e-15, rtol=1e-15))  # pyright: ignore
