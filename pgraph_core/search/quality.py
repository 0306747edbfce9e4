"""Quality of a fit: how well data determine its numbers, and whether its residuals are noise."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np

from ..errors import choices
from ..tolerances import NAMED, NOTABLE, ROUNDING

Array = np.ndarray
SIGMAS = 4  # standard deviations that noise exceeds in 1 of 16,000 cases


class Linear:
    """The fit as linear least squares near its optimum.

    `jacobian` (n, k) has the derivatives of the residuals over their noise.
    """

    def __init__(self, jacobian: Array, size: Array, widening: float):
        left, values, right = np.linalg.svd(jacobian * size, full_matrices=False)
        # a direction with a standard deviation beyond the bounds, or only rounding as its slope
        open_ = values < max(1.0, ROUNDING * values[0])
        kept = right[~open_] / values[~open_, None] * size
        self.open = right[open_]  # (m, k) directions without data, in parts of `size`
        self.size, self.inverse = size, kept.T @ left[:, ~open_].T  # (k, n)
        self.covariance = widening * (kept.T @ kept)
        self.errors = np.sqrt(np.diag(self.covariance))

    @property
    def weak(self) -> Array:
        """(k,) which numbers the data do not determine: they move farther than their error where
        one number of a direction without data moves by its range."""
        moves = np.abs(self.open) / np.abs(self.open).max(axis=1, keepdims=True, initial=0.0)
        moves = np.where(moves > NOTABLE, moves, 0.0).max(axis=0, initial=0.0)
        return moves * self.size > self.errors

    def moved(self, missed: Sequence[Array], noise: Array) -> Array:
        """Return how far changes of the columns move the numbers (k,)."""
        found = np.concatenate([change / size for change, size in zip(missed, noise)])
        return -self.inverse[:, : len(found)] @ found

    def undetermined(self, names: Sequence[str]) -> list[str]:
        """A sentence for each direction without data."""
        return [_direction(names, direction) for direction in self.open]

    def combinations(self, names: Sequence[str], x: Array) -> dict[str, tuple[float, float]]:
        """Return the combinations of undetermined numbers that the data determine, as text, with
        their values and standard errors.

        Along the directions without data, each number changes with as many others as there are
        directions, its coefficients. If the sum of two terms is zero, their ratio is determined.
        """
        weak = np.flatnonzero(self.weak)
        free = self.open[:, weak] * self.size[weak]
        if not 0 < len(free) < len(weak):
            return {}
        pivots: Any = []
        for row in range(len(free)):  # Gauss and Jordan, with the largest part of a range
            best = np.abs(free[row] / self.size[weak])
            best[pivots] = 0.0
            pivots.append(int(np.argmax(best)))
            free[row] /= free[row, pivots[-1]]
            rest = np.arange(len(free)) != row
            free[rest] -= np.outer(free[rest, pivots[-1]], free[row])
        found = {}
        for k in np.setdiff1d(np.arange(len(weak)), pivots).tolist():
            own = np.zeros(len(names))
            own[weak[k]], own[weak[pivots]] = 1.0, -free[:, k]
            own[np.abs(own * self.size) < NOTABLE * np.abs(own * self.size).max()] = 0.0
            error = math.sqrt(float(own @ self.covariance @ own))
            terms, value = own * x, float(own @ x)
            with_terms = np.flatnonzero(own)
            others = with_terms[with_terms != weak[k]].tolist()
            if len(with_terms) == 2 and abs(value) < SIGMAS * error + NOTABLE * np.abs(terms).max():
                other = others[0]
                text = f"{names[int(weak[k])]} / {names[other]}"
                found[text] = float(x[weak[k]] / x[other]), float(error / abs(x[other]))
            elif len(with_terms) > 1:
                text = names[int(weak[k])]
                for i in others:
                    text += f" {'-' if own[i] < 0 else '+'} {abs(own[i]):.4g} {names[i]}"
                found[text] = value, error
        return found


def _direction(names: Sequence[str], direction: Array) -> str:
    """A sentence on a direction of free numbers, each in its range."""
    large = [i for i in np.argsort(-np.abs(direction)) if abs(direction[i]) > NAMED]
    if len(large) == 1:
        return f"the data do not determine {names[large[0]]}"
    parts = [f"{direction[i] / direction[large[0]]:.2g} {names[i]}" for i in large]
    text = "the data do not determine these, which may change together by parts of their ranges"
    return f"{text}: {', '.join(parts)}"


def not_noise(residuals: Mapping[str, Array], floor: Mapping[str, float]) -> list[str]:
    """Return a sentence about columns whose neighbouring residuals are alike, or [].

    The signs of n residuals of white noise have a correlation of 1 / sqrt(n) to the next ones
    [Durbin and Watson 1950, with signs, which outliers do not affect]. Residuals below the `floor`
    of a column are not looked at.
    """
    found = []
    for name, left in residuals.items():
        sign = np.sign(left)
        alike = float(np.mean(sign[1:] * sign[:-1])) if len(left) > 1 else 0.0
        known = SIGMAS / math.sqrt(max(len(left) - 1, 1))
        if alike > known and math.sqrt(float(np.mean(left**2))) > floor[name]:
            found.append(f"{name} (correlation {alike:.2f} to the next, noise has at most "
                         f"{known:.2f})")  # fmt: skip
    if not found:
        return []
    return [
        f"residuals of {choices(found, 6)} are not noise, so that ± is too small: the model lacks "
        "something, or this is a false minimum; try starts=8"
    ]


def beyond_noise(residuals: Mapping[str, Array], noise: Mapping[str, float]) -> list[str]:
    """Return a sentence about columns whose residuals are larger than their given noise, or []."""
    found = []
    for name, left in residuals.items():
        square = float(np.mean(left**2)) / noise[name] ** 2
        if square > 1.0 + SIGMAS * math.sqrt(2.0 / len(left)):
            found.append(f"{math.sqrt(square):.3g} times the given sigma of {name}")
    if not found:
        return []
    return [f"residuals are {choices(found, 6)}, so that ± is too small"]


def other_start(run: Array, data: Array) -> bool:
    """Check whether a run starts elsewhere than its data, beyond their noise.

    The second differences of the data bound their noise: they contain the curvature as well.
    """
    noise = math.sqrt(float(np.mean(np.diff(data, 2) ** 2)) / 6.0) if len(data) > 2 else 0.0
    return abs(run[0] - data[0]) > SIGMAS * noise + NOTABLE * float(np.abs(data).max())
