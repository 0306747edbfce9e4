"""Smoothing of a whole trial: all frames are fitted at once, with a penalty on the jerk.

min Σ w |x(q) - x̂|² + λ Σ |s q'''|², where rotations count with the span s of the markers. λ is
given, or the least of the generalised cross-validation N RSS / (N - tr S)² (Craven and Wahba,
Numerische Mathematik 31 (1979) 377-403), whose trace is estimated by random signs (Hutchinson).
"""

from __future__ import annotations

from itertools import pairwise
from typing import Any

import numpy as np

from ..analysis.rows import apart
from ..errors import refusal
from ..tolerances import PROXIMAL, SOLVED
from .filters import LEAST, moved
from .markers import Markers
from .trial import Array

PROBES = 32  # random signs for a trace
STEPS = 60  # Gauss-Newton steps at most
SLOW, FAST = 1 / 4, 1 / 3  # range of cut-offs: [Hz], and share of the rate of frames


def smoothed(problem: Markers, q: Array, smooth: float | bool) -> tuple[Array, Array, Array, float]:
    """Return q (n, nq), v and v' (n, nv) of the smoothed motion, and λ. Raises InputError."""
    t = problem.trial.t
    if len(t) < LEAST:
        text = f"needs a trial of {LEAST} frames or more, got {len(t)}"
        raise refusal("track", "smooth", text)
    weight = _chosen(problem, q) if smooth is True else float(smooth)
    for _ in range(STEPS):
        _, g, H, _ = problem.normal(q, np.arange(len(q)))
        P = problem.free(q, g)
        jerk, slope = _jerk(problem, q)
        step = _solve(P, H, slope, weight, -(g.ravel() + weight * (slope.T @ jerk)))
        step = step.reshape(g.shape)
        q = problem.moved(q, step)
        if np.abs(step / problem.scale).max() <= SOLVED:
            break
    _, v, vdot = moved(problem.mech, t, q, np.inf, 1)
    return q, v, vdot, weight


def _jerk(problem: Markers, q: Array) -> tuple[Array, Any]:
    """Return s q''' ((n - 3) nv,), and its sparse derivatives by displacements (n nv,)."""
    from scipy import sparse

    mech, t = problem.mech, problem.trial.t
    n, nv = len(t), mech.nv
    gap = np.diff(t)
    speed = np.array([apart(mech, a, b) for a, b in pairwise(q)]) / gap[:, None]
    after, before = (np.tile(np.eye(nv), (n - 1, 1, 1)) for _ in range(2))
    for _, _, j in mech.packed.quaternions:
        turn = speed[:, j : j + 3] * gap[:, None]
        after[:, j : j + 3, j : j + 3] = _log_slope(turn)
        before[:, j : j + 3, j : j + 3] = _log_slope(-turn)
    rows = np.arange(n - 1)

    def blocks(values: Array, columns: Array) -> Any:
        values = values / gap[:, None, None]
        shape = (n - 1) * nv, n * nv
        return sparse.bsr_array((values, columns, np.arange(n)), shape=shape).tocsr()

    def differences(by: Array) -> Any:
        m = len(by)
        return sparse.eye_array(m, m + 1, k=1).multiply(by[:, None]).tocsr() - (
            sparse.eye_array(m, m + 1).multiply(by[:, None]).tocsr()
        )

    rate = blocks(after, rows + 1) - blocks(before, rows)
    middle = (t[1:] + t[:-1]) / 2
    slopes = differences(1 / np.diff(middle))
    over = (middle[2:] - middle[:-2]) / 2
    bends = differences(1 / over)
    length = np.where(problem.scale == 1.0, problem.size, 1.0)
    third = sparse.kron(bends @ slopes, sparse.diags_array(length)).tocsr()
    return third @ speed.ravel(), third @ rate


def _log_slope(turn: Array) -> Array:
    """Return the derivatives (n, 3, 3) of log(exp(d) exp(turn)) by d at 0."""
    angle = np.linalg.norm(turn, axis=1)[:, None, None]
    cross = np.zeros((len(turn), 3, 3))
    for i, j, k in ((0, 1, 2), (1, 2, 0), (2, 0, 1)):
        cross[:, i, j], cross[:, j, i] = -turn[:, k], turn[:, k]
    half = np.maximum(angle / 2, SOLVED)
    factor = np.where(angle > 1 / 100, (1 - half / np.tan(half)) / (4 * half**2), 1 / 12)
    return np.eye(3) - cross / 2 + factor * (cross @ cross)


def _solve(P: Array, H: Array, slope: Any, weight: float, right: Array) -> Array:
    """Solve (P (H + λ J'J) P + ...) x = P right for x (n nv,) or several columns, banded."""
    from scipy import sparse
    from scipy.linalg import solveh_banded

    n, nv, _ = H.shape
    project = sparse.block_diag(P, format="csr")
    width = np.maximum(np.einsum("nii->ni", H).mean(axis=0), PROXIMAL)
    root = np.sqrt(width)
    rest = (np.eye(nv) - P) * root * root[:, None] + PROXIMAL * np.diag(width)
    inner = sparse.block_diag(H, format="csr") + weight * (slope.T @ slope)
    A = (project @ inner @ project + sparse.block_diag(rest)).tocoo()
    lower = A.row >= A.col
    band = np.zeros((4 * nv, n * nv))
    np.add.at(band, (A.row[lower] - A.col[lower], A.col[lower]), A.data[lower])
    return project @ solveh_banded(band, project @ right, lower=True)


def _chosen(problem: Markers, q: Array) -> float:
    """Return λ by generalised cross-validation of the problem that is linear about q."""
    from scipy.optimize import minimize_scalar

    cost, g, H, _ = problem.normal(q, np.arange(len(q)))
    P = problem.free(q, g)
    jerk, slope = _jerk(problem, q)
    t = problem.trial.t
    rate = (len(t) - 1) / float(t[-1] - t[0])
    count = 3 * int(np.isfinite(problem.place[..., 0]).sum())
    signs = np.random.default_rng(0).choice([-1.0, 1.0], size=(g.size, PROBES))
    moved_by = (H @ signs.reshape(*g.shape, PROBES)).reshape(g.size, PROBES)
    stiff = np.einsum("nii->i", H).mean() / len(H) / problem.size**2
    ends = [np.log10(stiff / (2 * np.pi * f) ** 6) for f in (FAST * rate, SLOW)]

    def score(exponent: float) -> float:
        weight = 10.0**exponent
        right = np.column_stack((-(g.ravel() + weight * (slope.T @ jerk)), moved_by))
        found = _solve(P, H, slope, weight, right)
        step = found[:, 0].reshape(g.shape)
        trace = float((signs * found[:, 1:]).sum()) / PROBES
        left = cost.sum() + 2 * (g * step).sum() + np.einsum("ni,nij,nj->", step, H, step)
        return float(np.log(max(left, PROXIMAL**2)) - 2 * np.log(count - trace))

    best: Any = minimize_scalar(score, bounds=ends, method="bounded")
    return 10.0 ** float(best.x)
