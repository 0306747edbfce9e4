"""The numbers that a search found, as data: with standard errors, intervals, JSON and tables."""

from __future__ import annotations

import json
import math
from collections.abc import Mapping
from typing import Any, NamedTuple

import numpy as np

from ..errors import InputError, Problem, Suggests, needed, shown

Array = np.ndarray


class Stopped(Exception):
    """The search was cancelled."""


class Ending(NamedTuple):
    """End of a search from one start."""

    values: dict[str, float]
    objective: float  # its least value; for a fit, the sum of squares over the square of the noise
    converged: bool


class Numbered(Suggests):
    """Values by path with their covariance. Arrays are in the order of `values`."""

    values: Mapping[str, float]
    errors: Mapping[str, float]  # standard errors, nan if not known
    covariance: Array  # (k, k)
    freedom: float  # degrees of freedom of the noise: residuals minus values; inf if it is given

    @property
    def x(self) -> Array:
        """The values as an array (k,)."""
        return np.array([*self.values.values()])

    def intervals(self, level: float = 0.95) -> dict[str, tuple[float, float]]:
        """Compute confidence intervals (low, high) by path, by Student's distribution.

        Parameters
        ----------
        level : float
            Probability that an interval contains the true value, between 0 and 1.

        Raises
        ------
        InputError
            If `level` is not between 0 and 1.
        """
        from scipy.special import stdtrit

        if not 0.0 < level < 1.0:
            text = f"must be between 0 and 1, got {shown(level)}"
            raise InputError(Problem("intervals", "level", text))
        far = float(stdtrit(min(max(self.freedom, 1.0), 1e9), 0.5 + 0.5 * level))
        return {
            path: (value - far * self.errors[path], value + far * self.errors[path])
            for path, value in self.values.items()
        }

    def to_dict(self) -> dict[str, Any]:
        """Return the numbers as a dictionary for JSON, with None for what is not known."""
        names = (*self.values,)
        return {
            "values": plain(self.values),
            "errors": plain(self.errors),
            "intervals": plain(self.intervals()),
            "covariance": dict(
                zip(names, (plain(dict(zip(names, row))) for row in self.covariance))
            ),
        } | {name: plain(getattr(self, name)) for name in self._TOLD}

    _TOLD: tuple[str, ...] = ()  # names of other attributes for JSON

    def to_json(self) -> str:
        """Return `to_dict` as text in JSON."""
        return json.dumps(self.to_dict(), allow_nan=False)

    def to_pandas(self) -> Any:
        """Return a pandas.DataFrame with a row per path: value, error, low and high (95 %)."""
        rows = {
            path: (self.values[path], self.errors[path], *pair)
            for path, pair in self.intervals().items()
        }
        names = ["value", "error", "low", "high"]
        return needed("pandas", "pandas").DataFrame.from_dict(rows, orient="index", columns=names)


def plain(value: Any) -> Any:
    """Return numbers, arrays, tuples and mappings as JSON takes them, with None for nan and inf."""
    if isinstance(value, Mapping):
        return {str(key): plain(each) for key, each in value.items()}
    if hasattr(value, "_asdict"):
        return plain(value._asdict())
    if isinstance(value, np.ndarray):
        return plain(value.tolist())
    if isinstance(value, (list, tuple)):
        return [plain(each) for each in value]
    if isinstance(value, (bool, str, int)) or value is None:
        return value
    number = float(value)
    return number if math.isfinite(number) else None
