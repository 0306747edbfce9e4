"""The error of a motion against a reference, without unit, over a grid of times."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from ..system import Array
from .seen import Seen


class Errors(NamedTuple):
    """E of one run: 1e-6 is six digits."""

    rms: float  # over all times and observables: the headline
    end: float  # largest at the last time
    most: float  # largest of all

    @classmethod
    def of(cls, e: Array) -> Errors:
        """From the error (n, m) of every observable at every time."""
        if not np.isfinite(e).all():
            return cls(np.inf, np.inf, np.inf)
        largest = float(np.max(e[-1], initial=0.0)), float(np.max(e, initial=0.0))
        return cls(rms(e), *largest)


def rms(e: Array) -> float:
    """Root of the mean square."""
    return float(np.sqrt(np.mean(e * e)))


def differences(found: Seen, reference: Seen, scale: float | Array) -> Array:
    """(n, a + b) e_ij = |y_i - y_ref| / max(|y_ref|, s_i); rotations as angles [rad].

    Vectors count from where the reference has them at first, so that a mechanism far from the
    origin is not measured against its distance.
    """
    gap = np.linalg.norm(found.vectors - reference.vectors, axis=-1)
    moved = np.linalg.norm(reference.vectors - reference.vectors[:1], axis=-1)
    relative = gap / np.maximum(moved, scale)
    return np.concatenate((relative, angles(found.turns, reference.turns)), axis=1)


def angles(p: Array, q: Array) -> Array:
    """Angles between rotations [rad], exact to rounding for small ones: |p - q| = 2 sin(a/4)."""
    apart = np.minimum(np.linalg.norm(p - q, axis=-1), np.linalg.norm(p + q, axis=-1))
    return 4.0 * np.arcsin(np.minimum(apart / 2.0, 1.0))
