"""Impulses of one instant at a few contacts with friction, exactly: Newton's restitution.

With u = Ω λ + u⁻: a contact that pushes (λ_n > 0) leaves with u_n = -e u_n⁻, one that does not with
u_n ≥ -e u_n⁻; λ_t is within μ λ_n where nothing slips, and on that rim against the slip else.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from typing import NamedTuple

import numpy as np

from ..packing.system import Array

SWEEPS = 600
CHANGE = 1e-14  # of the largest impulse: where sweeps end
GUESS = 20  # sweeps between two tries to solve at once for what sticks and slides
FITS = 1e-11  # relative: laws that a guess has to keep
TURNS = 20  # of the directions of slip of a guess
DIRECTIONS = 48  # of slip among which a root is looked for
RANK = 1e-10


class ContactRow(NamedTuple):
    """A contact among the rows of an impact."""

    first: int  # its normal row
    size: int  # 3, or 1 for a limit
    friction: float
    restitution_velocity: float  # e u_n⁻ of a contact that closes, else 0
    held: bool = False  # Painlevé's case: the impulse that ends its slip


class Solution(NamedTuple):
    """Impulses of all rows and the velocities after them."""

    impulse: Array
    velocity: Array
    gain: float  # of kinetic energy [J]
    missed: float  # largest change in the last sweep, relative to the largest impulse


def impulses(omega: Array, u: Array, bilateral: int, rows: Sequence[ContactRow]) -> Solution:
    """λ of all rows; the first `bilateral` ones are held at zero velocity."""
    b = slice(0, bilateral)
    inverse = np.linalg.pinv(omega[b, b], rcond=RANK, hermitian=True)
    reduced = omega - omega[:, b] @ inverse @ omega[b]
    free = u - omega[:, b] @ (inverse @ u[b])
    lam = np.zeros(len(u))
    change = _sweep_all(reduced, free, rows, lam)
    lam[b] = -inverse @ (u[b] + omega[b, bilateral:] @ lam[bilateral:])
    after = u + omega @ lam
    after[b] = 0.0
    return Solution(lam, after, float(lam @ (u + after)) / 2, change)


def _sweep_all(omega: Array, free: Array, rows: Sequence[ContactRow], lam: Array) -> float:
    """Contacts in turn until no impulse changes; the last change, relative to the largest.

    All at once comes first: what is alike on both sides of a mirror then stays alike, where
    contacts in turn would choose a side.
    """
    if len(rows) > 1:
        lam[:] = _at_once(omega, free, rows)
        if any(lam[row.first] > 0 for row in rows) and _guess(omega, free, rows, lam):
            return 0.0
        lam[:] = 0.0
    parts = [slice(r.first, r.first + r.size) for r in rows]
    change = 0.0
    for sweep in range(1, SWEEPS + 1 if len(rows) > 1 else 2):
        change = 0.0
        for row, part in zip(rows, parts):
            own = omega[part, part]
            rest = free[part] + omega[part] @ lam - own @ lam[part]
            new = _one(own, rest, row)
            change = max(change, float(np.abs(new - lam[part]).max()))
            lam[part] = new
        size = float(np.abs(lam).max(initial=0.0))
        if len(rows) == 1 or change <= CHANGE * size:
            return 0.0
        change /= size
        if sweep % GUESS == 0 and _guess(omega, free, rows, lam):
            return 0.0
    return change


def _at_once(omega: Array, free: Array, rows: Sequence[ContactRow]) -> Array:
    """λ with which all contacts that close stick; on the rim where that is outside of the cone."""
    lam = np.zeros(len(free))
    closing = [row for row in rows if row.held or free[row.first] + row.restitution_velocity < 0]
    picked = [row.first + k for row in closing for k in range(row.size)]
    wanted = free.copy()
    for row in closing:
        wanted[row.first] += row.restitution_velocity
    block = omega[np.ix_(picked, picked)]
    lam[picked] = -np.linalg.lstsq(block, wanted[picked], rcond=RANK)[0]
    for row in closing:
        drag, most = lam[row.first + 1 : row.first + row.size], row.friction * lam[row.first]
        if row.size == 1 or row.held or np.linalg.norm(drag) <= most:
            continue
        slip = free[row.first + 1 : row.first + 3]
        speed = float(np.linalg.norm(slip))
        way = slip / speed if speed > 0 else -drag / np.linalg.norm(drag)
        drag[:] = -max(most, 0.0) * way
    return lam


def _guess(omega: Array, free: Array, rows: Sequence[ContactRow], lam: Array) -> bool:
    """Solve at once for what sticks, slides or is open now; into λ where that keeps all laws."""
    pushed = [row for row in rows if lam[row.first] > 0]
    ways = {row.first: _way(row, lam) for row in pushed}
    back = np.zeros(len(free))
    for row in rows:
        back[row.first] = row.restitution_velocity
    size = float(np.abs(free + back).max())
    found: Array = lam
    after: Array = free
    for _ in range(TURNS):
        columns, picked = [], []
        for row in pushed:
            way = ways[row.first]
            for k in range(row.size if way is None else 1):
                column = np.zeros(len(free))
                column[row.first + k] = 1.0
                if way is not None:
                    column[row.first + 1 : row.first + 3] = -row.friction * way
                columns.append(column)
                picked.append(row.first + k)
        act = np.array(columns).T
        solved = np.linalg.lstsq((omega @ act)[picked], -(free + back)[picked], rcond=RANK)[0]
        found = np.asarray(act @ solved, dtype=np.float64)
        after = free + omega @ found
        turned = 0.0
        for first, way in ways.items():
            slip = after[first + 1 : first + 3]
            if way is not None and np.linalg.norm(slip) > FITS * size:
                ways[first] = slip / np.linalg.norm(slip)
                turned = max(turned, float(np.abs(slip / np.linalg.norm(slip) - way).max()))
        if turned <= FITS:
            break
    if not _keeps_laws(after + back, found, rows, ways, size):
        return False
    lam[:] = found
    return True


def _way(row: ContactRow, lam: Array) -> Array | None:
    """Direction in which a pushed contact slides, None where it sticks."""
    if row.size == 1 or row.held:
        return None
    drag = lam[row.first + 1 : row.first + 3]
    pull = float(np.linalg.norm(drag))
    if pull < row.friction * lam[row.first] * (1 - 1e-6) or pull == 0:
        return None
    return -drag / pull


def _keeps_laws(
    after: Array, lam: Array, rows: Sequence[ContactRow], ways: dict[int, Array | None], size: float
) -> bool:
    """Whether velocities, targets added, and impulses fit the laws of all contacts."""
    most = float(np.abs(lam).max(initial=0.0))
    for row in rows:
        n, pushed = row.first, lam[row.first] > 0
        if lam[n] < 0 or after[n] < -FITS * size or (pushed and after[n] > FITS * size):
            return False
        if row.size == 1 or not pushed:
            continue
        way, slip = ways.get(n), after[n + 1 : n + 3]
        if way is None:
            pull = math.hypot(lam[n + 1], lam[n + 2])
            if not row.held and pull > row.friction * lam[n] + FITS * most:
                return False
        elif float(slip @ way) < (1 - FITS) * np.linalg.norm(slip) - FITS * size:
            return False
    return True


def _one(omega: Array, u: Array, row: ContactRow) -> Array:
    """λ of one contact while the others stay, from its velocity without it."""
    none = np.zeros(row.size)
    target = u + np.array([row.restitution_velocity, 0.0, 0.0])[: row.size]
    if (target[0] >= 0 and not row.held) or omega[0, 0] <= 0:
        return none
    if row.size == 1:
        return -target / omega[0, 0]
    stick = -np.linalg.pinv(omega, rcond=RANK, hermitian=True) @ target
    if row.held or math.hypot(stick[1], stick[2]) <= row.friction * stick[0] * (1 + 1e-12):
        return stick if stick[0] > 0 else none
    return _sliding(omega, target, row.friction)


def _sliding(omega: Array, u: Array, mu: float) -> Array:
    """λ on the rim of the cone, against the slip that is left.

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

    start = math.atan2(u[2], u[1])
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
    """Where a function is zero between a and b; None where its signs are alike, or it overflows."""
    if at_a == 0.0:
        return a
    if at_b == 0.0:
        return b
    if (at_a > 0) == (at_b > 0) or not math.isfinite(at_b - at_a):  # a product may underflow
        return None
    from scipy.optimize import brentq

    return float(brentq(function, a, b, xtol=1e-15, rtol=1e-15))  # pyright: ignore
