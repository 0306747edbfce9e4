"""The designs of a sweep: which points it takes of the values along each path."""

from __future__ import annotations

import itertools
import math
from collections.abc import Mapping
from typing import Any

import numpy as np

from ..errors import InputError, Problem, choices, shown

Array = np.ndarray
SAMPLES = ("grid", "latin", "sobol", "random")
MOST_POINTS = 10_000_000


def points_of(values: Mapping[str, Any], samples: str, n: int | None, seed: int) -> Array:
    """The points of a design, shape (points, paths).

    "grid": every combination of the values given for each path. "latin", "sobol" and "random": `n`
    points, each path given as (low, high) or as a frozen distribution of `scipy.stats`.
    Raises InputError.
    """
    if samples not in SAMPLES:
        raise _refused("samples", f"must be one of {choices(SAMPLES)}; given {shown(samples)}")
    if samples == "grid":
        lists = [_listed(path, given) for path, given in values.items()]
        count = math.prod(map(len, lists))
        if count > MOST_POINTS:
            raise _refused("set", f"has {count} points; {MOST_POINTS} at most")
        return np.array(list(itertools.product(*lists)), dtype=float)
    if isinstance(n, bool) or not isinstance(n, int) or not 1 <= n <= MOST_POINTS:
        raise _refused("n", f"must be the number of points, 1 to {MOST_POINTS}; given {shown(n)}")
    units = _unit_points(samples, len(values), n, seed)
    columns = [_stretched(path, given, u) for (path, given), u in zip(values.items(), units.T)]
    return np.stack(columns, axis=1)


def _unit_points(samples: str, dimensions: int, n: int, seed: int) -> Array:
    """(n, dimensions) numbers within (0, 1)."""
    from scipy.stats import qmc

    if samples == "latin":
        points = qmc.LatinHypercube(dimensions, rng=seed).random(n)
    elif samples == "sobol":
        points = qmc.Sobol(dimensions, rng=seed).random_base2(max(n - 1, 0).bit_length())[:n]
    else:
        points = np.random.default_rng(seed).random((n, dimensions))
    return np.clip(points, np.finfo(float).tiny, 1.0 - np.finfo(float).epsneg)


def _stretched(path: str, given: Any, unit: Array) -> Array:
    if hasattr(given, "ppf"):
        return np.asarray(given.ppf(unit), dtype=float)
    pair = _listed(path, given)
    if len(pair) != 2 or not pair[0] < pair[1]:
        text = f"must be (low, high) or a distribution of scipy.stats; given {shown(given)}"
        raise _refused(path, text)
    return pair[0] + (pair[1] - pair[0]) * unit


def _listed(path: str, given: Any) -> Array:
    try:
        values = np.asarray(given, dtype=float)
    except (TypeError, ValueError):
        values = np.empty((0, 0))
    if values.ndim == 0:
        values = values[None]
    if values.ndim != 1 or not len(values):
        raise _refused(path, f"must be a list of numbers, not empty; given {shown(given)}")
    if not np.isfinite(values).all():
        raise _refused(path, f"must be finite numbers; given {shown(given)}")
    return values


def _refused(what: str, text: str) -> InputError:
    return InputError(Problem("sweep", what, text))
