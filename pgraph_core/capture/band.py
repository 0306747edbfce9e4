"""The 95 % band of the joint moments of a motion that was measured by markers.

Measured positions are those of the motion and errors, which the residuals of the tracking show with
their correlation in time. Along axes on which both errors and third differences are independent,
each third derivative is a Gaussian process, whose size and time of correlation make the measured
differences likeliest (Rasmussen and Williams, Gaussian Processes for Machine Learning, 2006, ch.
5). What is then known about the motion passes through the dynamics to first order. Such a band has
the noise that smoothing leaves as well as the motion that it takes (Wahba, J. R. Statist. Soc. B 45
(1983) 133-150), so that it is about the moments of the motion itself, whatever the filter.
"""

from __future__ import annotations

from collections.abc import Callable
from itertools import pairwise
from statistics import NormalDist
from typing import NamedTuple

import numpy as np

from ..analysis.rows import apart
from ..dynamics.many import motions
from ..mechanism import Mechanism
from ..tolerances import PROXIMAL, TINY, step_of_differences
from .filters import Sampled, moved, operators
from .markers import Progress, advanced, tell
from .tracking import Tracking
from .trial import Array

WIDE = NormalDist().inv_cdf(0.975)  # standard errors of a 95 % band
SPLINE = np.array([1, 26, 66, 26, 1]) / 120  # values of a B-spline of degree five at its knots
RANGE = -10, 3  # decades about the mean square of third differences, in which a process is sought
CHUNK = 4_000_000  # numbers at once

Torques = Callable[[Sampled], Array]


def band(
    mech: Mechanism, fit: Tracking, torques: Torques, progress: Progress
) -> tuple[Array, Array]:
    """Return the lower and upper ends (n, nv) of the band of a tracked tree."""
    t = fit.t
    known = _known(mech, fit, progress)
    best = moved(mech, t, advanced(mech, fit.q, -known.error), np.inf, 1)
    slopes = _slopes(mech, torques, best)
    half = WIDE * np.sqrt(_variance(slopes, operators(t, np.inf, 1), known))
    middle = torques(best)
    return middle - half, middle + half


class Known(NamedTuple):
    """The known errors of positions."""

    error: Array  # (n, nv) their mean, by coordinate
    axes: Array  # (nv, nv) rows along which errors are independent on average
    spread: Array  # (n, nv, nv) factors of their covariance in a frame, along these axes
    left: Array  # (nv, n, n) factors of their correlation in time, given the measured positions
    own: Array  # (nv, n, n - 3) factors of what the motion of each coordinate adds


def _known(mech: Mechanism, fit: Tracking, progress: Progress) -> Known:
    """Return the errors that are likeliest, and how well they are known."""
    from scipy.linalg import eigh

    t, nv = fit.t, mech.nv
    n, gap = len(t), np.diff(t)
    h = float(gap.mean())
    speed = np.array([apart(mech, a, b) for a, b in pairwise(fit.q)]) / gap[:, None]
    first, rest = _differences(t)
    jerk = rest @ speed
    F, mean = _alike(mech, fit), fit.covariance.mean(axis=0)
    mean += np.diag(PROXIMAL * np.diag(mean) + PROXIMAL**2)
    to = eigh(jerk.T @ jerk, mean)[1]  # to'mean to = 1
    jerk, error = jerk @ to, np.zeros((n, nv))
    spread = to.T @ fit.covariance @ to
    spread = np.linalg.cholesky(spread + PROXIMAL * np.eye(nv))
    spans = [0.0, *(h * 2**k for k in range(int(np.log2(n / 2)) + 1))]
    least = np.full(nv, np.inf)
    left, own = np.empty((nv, n, n)), np.empty((nv, n, n - 3))
    for k, span in enumerate(spans):
        process = _Process.of(span, h, rest @ first @ F)
        for i in range(nv):
            chance, power = process.likeliest(jerk[:, i])
            if chance < least[i]:
                least[i] = chance
                error[:, i], left[i], own[i] = process.posterior(F, jerk[:, i], power)
        tell(progress, 1 / 2 + (k + 1) / (4 * len(spans)))
    axes = np.linalg.inv(to)
    return Known(error @ axes, axes, spread, left, own)


class _Process(NamedTuple):
    """A process of third differences, and errors of positions seen in its units."""

    share: Array  # (m,) variances of errors along the axes in which both are independent
    axes: Array  # (m, m) these axes, from third differences
    seen: Array  # (m, n) third differences of the errors' factors, along them
    volume: float  # logarithm of the determinant of the process

    @classmethod
    def of(cls, span: float, h: float, errors: Array) -> _Process:
        """Make a process whose correlation is exp(-t² / 2 span²), or none for span 0."""
        from scipy.linalg import cholesky, solve_triangular, toeplitz

        m = len(errors)
        away = np.abs(np.arange(-2, m + 2)) * h
        alike = np.where(away == 0.0, 1 / h, 0.0)
        if span:
            alike = np.exp(-((away / span) ** 2) / 2) / (span * np.sqrt(2 * np.pi))
        C = toeplitz(np.convolve(alike, SPLINE, "valid"))
        root = cholesky(C + PROXIMAL * C[0, 0] * np.eye(m), lower=True)
        seen = solve_triangular(root, errors, lower=True)
        turn, share, along = np.linalg.svd(seen, full_matrices=False)
        axes = solve_triangular(root, np.eye(m), lower=True)
        volume = 2 * float(np.log(np.diag(root)).sum())
        return cls(share**2, turn.T @ axes, share[:, None] * along, volume)

    def likeliest(self, jerk: Array) -> tuple[float, float]:
        """Return minus twice the logarithm of the largest likelihood, and the process's power."""
        from scipy.optimize import minimize_scalar

        along = (self.axes @ jerk) ** 2

        def unlikely(decades: float) -> float:
            spread = self.share + 10**decades
            return self.volume + float((np.log(spread) + along / spread).sum())

        middle = float(np.log10(max(np.mean(jerk**2), TINY)))
        found = minimize_scalar(unlikely, bounds=[middle + x for x in RANGE], method="bounded")  # pyright: ignore
        return float(found.fun), 10 ** float(found.x)

    def posterior(self, F: Array, jerk: Array, power: float) -> tuple[Array, Array, Array]:
        """Return the mean error (n,), and its factors of errors (n, n) and of the process."""
        gain = (F @ self.seen.T) / (self.share + power)
        return gain @ (self.axes @ jerk), F - gain @ self.seen, gain * np.sqrt(power)


def _differences(t: Array) -> tuple[Array, Array]:
    """Return matrices of first differences over time, and of second ones of these."""

    def step(at: Array) -> Array:
        eye = np.eye(len(at) + 1)
        return (eye[1:] - eye[:-1]) / at[:, None]

    middle = (t[1:] + t[:-1]) / 2
    return step(np.diff(t)), step((middle[2:] - middle[:-2]) / 2) @ step(np.diff(middle))


def _alike(mech: Mechanism, fit: Tracking) -> Array:
    """Return a factor of the correlation (n, n) of errors in two frames, by all residuals.

    Marks that sit at wrong places of their bodies are wrong alike in all frames. What is left
    depends on the distance in time alone, is stationary, and fades over half of the trial, as most
    of what long distances show is chance (Parzen, Technometrics 3 (1961) 167-190).
    """
    seen, n = np.isfinite(fit.offset[..., 0]), len(fit.offset)
    weight = np.where(seen, fit.weights, 0.0)[..., None]
    off = np.where(seen[..., None], fit.offset, 0.0)
    none, sites = np.zeros((n, mech.nv)), {s.name: s for s in mech.model.sites}
    turn = motions(mech.packed, fit.q, none, none).turn
    for i, name in enumerate(fit.markers):
        if (b := mech.topology.number(sites[name].body) - 1) >= 0:
            off[:, i] = (off[:, i, None] @ turn[:, b])[:, 0]
    stays = (weight * off).sum(axis=0) / np.maximum(weight.sum(axis=0), TINY)
    rest = np.sqrt(weight) * (off - stays)
    found = np.array([(rest[lag:] * rest[: n - lag]).sum() for lag in range(n)])
    whole = float((weight * off**2).sum())
    if not whole:
        return np.eye(n)
    x = 2 * np.arange(n) / n
    fading = np.where(x < 1 / 2, 1 - 6 * x**2 + 6 * x**3, 2 * np.maximum(1 - x, 0) ** 3)
    alike = (fading * found / whole)[np.abs(np.subtract.outer(np.arange(n), np.arange(n)))]
    sizes, ways = np.linalg.eigh(alike + 1 - found[0] / whole)
    return ways * np.sqrt(np.maximum(sizes, 0.0))


def _slopes(mech: Mechanism, torques: Torques, sampled: Sampled) -> tuple[Array, Array, Array]:
    """Return ∂τ/∂q, ∂τ/∂v and M (n, nv, nv) by central differences, in displacements along v."""
    q, v, a = sampled
    n, nv = len(q), mech.nv
    h = step_of_differences(2)
    each = np.repeat(np.eye(nv), n, axis=0)  # (nv n, nv)
    far = [np.tile(x, (nv, 1)) for x in (q, v, a)]

    def by(change: Callable[[float], Sampled]) -> Array:
        ends = [torques(change(side)) for side in (h, -h)]
        return ((ends[0] - ends[1]) / (2 * h)).reshape(nv, n, nv).transpose(1, 2, 0)

    return (
        by(lambda s: Sampled(advanced(mech, far[0], s * each), far[1], far[2])),
        by(lambda s: Sampled(far[0], far[1] + s * each, far[2])),
        by(lambda s: Sampled(far[0], far[1], far[2] + s / h * each)) * h,
    )


def _variance(slopes: tuple[Array, Array, Array], by: Sampled, known: Known) -> Array:
    """Return the variances (n, nv) of torques.

    Errors pass through derivatives by time, and through the dynamics at each frame.
    """
    n, nv = known.error.shape
    slopes = tuple(g @ known.axes.T for g in slopes)  # pyright: ignore
    found = np.zeros((n, nv))
    some = max(CHUNK // (nv * nv * n), 1)
    for k in (slice(a, a + some) for a in range(0, n, some)):
        moves = np.zeros((len(found[k]), nv, nv, n))
        for i in range(nv):
            left, own = (
                np.sum([g[k, :, i, None] * (d[k] @ x[i])[:, None] for g, d in zip(slopes, by)], 0)
                for x in (known.left, known.own)
            )
            found[k] += (own**2).sum(axis=2)
            moves += known.spread[k, None, i, :, None] * left[:, :, None]
        found[k] += (moves**2).sum(axis=(2, 3))
    return found
