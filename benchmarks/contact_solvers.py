"""Three ways to solve contact problems recorded from runs: stacks, piles, dominoes, robots.

Each problem is one time step of 1 ms: what unit impulses do to the joints (Y), the velocities of
the rows without impulses, the impulses of the step before. All three are written in NumPy with
full matrices, and know nothing of islands: what counts is how many problems they solve, and in how
many factors. A problem is solved where no row misses its law by more than 1e-8 of the velocities.
"""

from __future__ import annotations

import functools
import time
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any

import numpy as np

from .measure import Effort, Row

MINUTES = 2.0
Array = np.ndarray
Law = Callable[[Array], tuple[Array, Array]]  # impulses, and their slopes
SOLVED = 1e-8
RECORDED = Path(__file__).with_name("contact_problems.npz")
MOST = 30  # factors of one convex problem
FREE, ONE_SIDED, CONTACT = 0, 1, 2  # kinds of blocks: bilateral, a limit, a contact


def rows(effort: Effort) -> Iterator[Row]:
    """A row for each kind of scene and each way."""
    ways: dict[str, Callable[[Problem], tuple[float, int]]] = {
        "Newton in impulses and speeds": newton,
        "sweeps, 200 at most": sweeps,
        "convex cone, then its shift": convex,
    }
    scenes: dict[str, list[Problem]] = {}
    for problem in recorded():
        scenes.setdefault(problem.scene, []).append(problem)
    for scene, problems in scenes.items():
        for name, way in ways.items():
            begin = time.process_time()
            found = [way(p) for p in problems[: effort.pick(len(problems), 1)]]
            seconds = time.process_time() - begin
            missed = np.array([m for m, _ in found])
            yield {
                "scene": scene, "by": name, "problems": len(found),
                "solved": int((missed <= SOLVED).sum()), "worst": float(missed.max()),
                "factors or sweeps": float(np.mean([n for _, n in found])),
                "ms": 1e3 * seconds / len(found),
            }  # fmt: skip


class Problem:
    """λ = P(λ - k u) for blocks of three rows; u = Y z + b, z = Yᵀ λ / d."""

    def __init__(self, scene: str, dinv: Array, y: Array, b: Array, warm: Array, law: Array):
        self.scene, self.dinv, self.y, self.b, self.warm = scene, dinv, y, b, warm
        self.kind, self.friction = law[:, 0].astype(int), law[:, 1] * (law[:, 0] == CONTACT)
        self.rows = np.arange(3) < law[:, 2, None]
        self.size = law[0, 3]  # the largest velocity
        own = np.einsum("ijn,n,ijn->ij", y, dinv, y).max(axis=1)
        self.mobility = np.where(own > 0, own, 1.0)[:, None]

    def speeds(self, lam: Array) -> Array:
        """What impulses do to the joints."""
        return self.dinv * np.einsum("ijn,ij->n", self.y, lam)

    def slip(self, z: Array) -> Array:
        """Velocities of all rows."""
        return self.y @ z + self.b

    def admitted(self, x: Array) -> tuple[Array, Array]:
        """The impulses next to x that the laws admit, and their slopes."""
        out, slope = x * self.rows, np.einsum("ij,jk->ijk", self.rows, np.eye(3))
        open_ = (self.kind > FREE) & (x[:, 0] <= 0)
        pull = np.hypot(x[:, 1], x[:, 2])
        rim = self.friction * np.maximum(x[:, 0], 0)
        slides = (self.kind == CONTACT) & ~open_ & ((pull > rim) | (self.friction == 0))
        way = x[:, 1:] / np.where(pull > 0, pull, 1)[:, None]
        part = np.where(pull > 0, rim / np.where(pull > 0, pull, 1), 0)
        out[slides, 1:] = (rim[:, None] * way)[slides]
        across = np.eye(2) - np.einsum("ij,ik->ijk", way, way)
        slope[slides, 1:, 1:] = (part[:, None, None] * across)[slides]
        slope[slides, 1:, 0] = (self.friction[:, None] * way)[slides]
        out[open_], slope[open_] = 0, 0
        return out, slope

    def missed(self, lam: Array) -> tuple[Array, Array]:
        """By how much every row misses its law, over the velocities; slopes of the laws."""
        found, slope = self.admitted(lam - self.slip(self.speeds(lam)) / self.mobility)
        return (found - lam) * self.mobility / self.size, slope


def newton(p: Problem) -> tuple[float, int]:
    """As the engine (`engine/contact/newton.py`) with whole steps; (what is missed, factors)."""
    lam, taken = _converged(p, p.warm, 2e-3)
    best = abs(p.missed(lam)[0]).max()
    held, firm, growth = 0 * p.warm, 128.0, 4.0
    for _ in range(60):
        if best <= SOLVED:
            break
        bound = p.friction * np.maximum(held[:, 0], 0)
        law = functools.partial(_in_disc, p, bound=bound)
        _, new, more = _proximal(p, law, p.speeds(held), held, firm / p.mobility, 0 * held)
        taken += more
        if more == MOST:
            firm, growth = firm / 4, np.sqrt(growth)
            continue
        held = new
        lam, more = _converged(p, held, 2e-3 / firm)
        best, taken = min(best, abs(p.missed(lam)[0]).max()), taken + more
        firm *= growth
    return float(best), taken


def _converged(p: Problem, lam: Array, careful: float) -> tuple[Array, int]:
    """The best impulses of 40 steps, and how many were taken."""
    care, taken = careful, 0
    missed, slope = p.missed(lam)
    left = best = abs(missed).max()
    first, kept = max(float(np.linalg.norm(missed)), 1e-6), lam
    while taken < 40 and best > SOLVED:
        taken += 1
        soft = min(max(care * np.sqrt(left), 1e-10), 1.0)
        new = lam + _direction(p, missed * p.size / p.mobility, slope, soft)
        found = p.missed(new)
        now = abs(found[0]).max()
        if now < best:
            best, kept = now, new
        if float(np.linalg.norm(found[0])) <= first or soft == 1.0:
            lam, (missed, slope), left = new, found, now
            care = max(care / 10, careful)
        else:
            care *= 10
    return kept, taken


def _direction(p: Problem, miss: Array, slope: Array, soft: float) -> Array:
    """Newton's change of λ, with a compliance `soft` relative to what blocks meet."""
    within = np.eye(3) - (1 - soft) * slope
    move = np.linalg.solve(within, miss[..., None])[..., 0]
    rate = np.linalg.solve(within, slope) / p.mobility[..., None]
    matrix = np.diag(1 / p.dinv) + np.tensordot(p.y, rate @ p.y, axes=([0, 1], [0, 1]))
    change = np.linalg.solve(matrix, np.einsum("ijn,ij->n", p.y, move))
    return move - np.einsum("ijk,ik->ij", rate, p.y @ change)


def sweeps(p: Problem, most: int = 200) -> tuple[float, int]:
    """Projected Gauss-Seidel, block after block; (what is missed, sweeps)."""
    lam, taken = p.warm.copy(), 0
    z = p.speeds(lam)
    while abs(p.missed(lam)[0]).max() > SOLVED and taken < most:
        taken += 1
        for i in range(len(lam)):
            x = lam[i] - (p.y[i] @ z + p.b[i]) / p.mobility[i]
            new = x * p.rows[i]
            if p.kind[i] > FREE:
                new[0] = max(new[0], 0.0)
            if p.kind[i] == CONTACT:
                rim, pull = p.friction[i] * new[0], np.hypot(x[1], x[2])
                new[1:] = x[1:] * (rim / pull if pull > rim else 1.0)
            z += p.dinv * ((new - lam[i]) @ p.y[i])
            lam[i] = new
    return float(abs(p.missed(lam)[0]).max()), taken


def convex(p: Problem, rounds: int = 20) -> tuple[float, int]:
    """A convex problem for a given shift μ |slip| of the normal velocity, then the next shift.

    The convex problem, of projections onto friction's cone, is solved by Newton's method with a
    line search (as in SAP [Castro et al. 2022]); (what is missed, factors).
    """
    lam, taken, weight = p.warm.copy(), 0, 1e2
    z = p.speeds(lam)
    best = abs(p.missed(lam)[0]).max()
    for _ in range(rounds):
        if best <= SOLVED:
            break
        shift = np.zeros_like(lam)
        slip = p.slip(z)
        shift[:, 0] = p.friction * np.hypot(slip[:, 1], slip[:, 2])
        law = functools.partial(_in_cone, p)
        z, lam, more = _proximal(p, law, z, lam, weight / p.mobility, shift)
        taken += more
        best = min(best, abs(p.missed(lam)[0]).max())
        weight = min(10 * weight, 1e8)
    return float(best), taken


def _proximal(p: Problem, law: Law, z: Array, base: Array, k: Array, shift: Array):
    """The speeds z and λ = law(base - k (u + shift)), by Newton's method; with factors."""
    taken = 0
    for _ in range(MOST):
        lam, slope = law(base - k * (p.slip(z) + shift))
        force = z / p.dinv - np.einsum("ijn,ij->n", p.y, lam)
        rate = slope * k[..., None]
        matrix = np.diag(1 / p.dinv) + np.tensordot(p.y, rate @ p.y, axes=([0, 1], [0, 1]))
        step = -np.linalg.solve(matrix, force)
        taken += 1
        low, high, part = 0.0, 1.0, 1.0
        for _ in range(20):  # until the slope along the step is a tenth
            at = z + part * step
            lam, _ = law(base - k * (p.slip(at) + shift))
            rise = (at / p.dinv) @ step - np.einsum("ijn,ij,n->", p.y, lam, step)
            if abs(rise) <= -0.1 * force @ step or (rise < 0 and part == 1.0):
                break
            low, high = (low, part) if rise > 0 else (part, high)
            part = 0.5 * (low + high)
        z = z + part * step
        if abs(p.y @ step).max() <= 1e-9 * p.size:
            break
    return z, law(base - k * (p.slip(z) + shift))[0], taken


def _in_disc(p: Problem, x: Array, bound: Array) -> tuple[Array, Array]:
    """The nearest impulses with friction in discs of given radii, and their slopes."""
    out, slope = x * p.rows, np.einsum("ij,jk->ijk", p.rows, np.eye(3))
    open_ = (p.kind > FREE) & (x[:, 0] <= 0)
    out[open_, 0], slope[open_, 0] = 0, 0
    pull = np.hypot(x[:, 1], x[:, 2])
    slides = (p.kind == CONTACT) & (pull >= bound)
    way = x[:, 1:] / np.where(pull > 0, pull, 1)[:, None]
    out[slides, 1:] = (bound[:, None] * way)[slides]
    across = np.eye(2) - np.einsum("ij,ik->ijk", way, way)
    part = np.where(pull > 0, bound / np.where(pull > 0, pull, 1), 0)
    slope[slides, 1:, 1:] = (part[:, None, None] * across)[slides]
    return out, slope


def _in_cone(p: Problem, x: Array) -> tuple[Array, Array]:
    """The nearest impulses in friction's cone, and their slopes."""
    out, slope = p.admitted(x)
    mu, n, pull = p.friction, x[:, 0], np.hypot(x[:, 1], x[:, 2])
    contact = p.kind == CONTACT
    none, inside = contact & (mu * pull <= -n), contact & (pull <= mu * n)
    rim = contact & ~none & ~inside
    out[inside], slope[inside] = x[inside], np.eye(3)
    way = np.c_[np.ones(len(x)), mu[:, None] * x[:, 1:] / np.where(pull > 0, pull, 1)[:, None]]
    way /= np.linalg.norm(way, axis=1)[:, None]
    along = np.einsum("ij,ij->i", way, x)
    out[rim] = (along[:, None] * way)[rim]
    slope[rim] = np.einsum("ij,ik->ijk", way, way)[rim]
    turn = mu * along / np.sqrt(1 + mu**2) / np.where(pull > 0, pull, 1)
    side = x[:, 1:] / np.where(pull > 0, pull, 1)[:, None]
    across = np.eye(2) - np.einsum("ij,ik->ijk", side, side)
    slope[rim, 1:, 1:] += (turn[:, None, None] * across)[rim]
    out[none], slope[none] = 0, 0
    return out, slope


def recorded() -> Iterator[Problem]:
    """The problems, from where they are kept flat."""
    kept: dict[str, Any] = dict(np.load(RECORDED))
    block = entry = freedom = 0
    sizes = (kept[x] for x in ("scene", "blocks", "entries", "freedoms"))
    for scene, blocks, entries, freedoms in zip(*sizes):
        law, span = kept["law"][block : block + blocks], slice(entry, entry + entries)
        y = np.zeros((blocks, 3, freedoms))
        y[kept["block"][span], :, kept["joint"][span]] = kept["y"][span]
        dinv = kept["dinv"][freedom : freedom + freedoms]
        b, warm = (kept[x][block : block + blocks].astype(float) for x in ("b", "warm"))
        yield Problem(str(scene), dinv.astype(float), y, b, warm, law.astype(float))
        block, entry, freedom = block + blocks, entry + entries, freedom + freedoms
