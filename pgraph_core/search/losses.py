"""Robust losses of a fit, and how they widen its covariance."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np

Array = np.ndarray
# loss -> ρ' and ρ'' over the squared residual z in units of its noise, as in SciPy
LOSSES: dict[str, Callable[[Array], tuple[Array, Array]]] = {
    "linear": lambda z: (np.ones_like(z), np.zeros_like(z)),
    "soft_l1": lambda z: ((1 + z) ** -0.5, -0.5 * (1 + z) ** -1.5),
    "huber": lambda z: (
        np.where(z <= 1, 1.0, np.maximum(z, 1) ** -0.5),
        np.where(z <= 1, 0.0, -0.5 * np.maximum(z, 1) ** -1.5),
    ),
    "cauchy": lambda z: (1 / (1 + z), -1 / (1 + z) ** 2),
    "arctan": lambda z: (1 / (1 + z**2), -2 * z / (1 + z**2) ** 2),
}


def widening(missed: Array, loss: str) -> float:
    """Covariance of a robust fit relative to least squares with the same noise.

    It is mean(ψ²) / mean(ψ')² [Huber, Robust Statistics, 1981, 7.6].
    """
    z = missed**2
    first, second = LOSSES[loss](z)
    slope = float(np.mean(first + 2.0 * z * second))
    return float(np.mean(z * first**2)) / slope**2 if loss != "linear" and slope > 0.0 else 1.0
