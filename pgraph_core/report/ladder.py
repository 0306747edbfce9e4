"""The settings that a method is run at: steps halved again and again, or tolerances."""

from __future__ import annotations

from collections.abc import Iterable
from numbers import Real
from typing import Any, NamedTuple

import numpy as np

from ..errors import InputError, Problem
from ..integrators import Method
from ..simulation.options import LEAST_RTOL

HALVINGS = 8
TOLERANCES = tuple(10.0**-k for k in range(2, 13))
MOST = 64  # settings of one method


class Setting(NamedTuple):
    """How one run is made: one of both is given."""

    step: float | None = None  # [s]
    rtol: float | None = None

    def __str__(self) -> str:
        if self.step is not None:
            return f"step {self.step:.4g} s"
        return f"rtol {self.rtol:.0e}"

    @property
    def options(self) -> dict[str, float]:
        """As `simulate` takes them."""
        return {k: v for k, v in self._asdict().items() if v is not None}


def first_step(spacing: float, rate: float) -> float:
    """The widest step [s]: a whole part of a frame, short enough for the fastest rate [1/s].

    A stiff scene is left stiff: below a hundredth of a frame the ladder does not begin.
    """
    parts = min(max(1.0, np.ceil(spacing * rate)), 100.0)
    return spacing / float(parts)


def halved(widest: float) -> tuple[float, ...]:
    """h0 2^-k, k = 0 .. 8."""
    return tuple(widest * 0.5**k for k in range(HALVINGS + 1))


def settings(
    method: Method, steps: tuple[float, ...], tolerances: tuple[float, ...], *, fixed: bool
) -> tuple[Setting, ...]:
    """What `method` is run at; `fixed` gives steps to those that could choose them."""
    if method.adaptive and not fixed:
        return tuple(Setting(rtol=rtol) for rtol in tolerances)
    return tuple(Setting(step=step) for step in steps)


def numbers(field: str, given: Any, *, least: float, most: float) -> tuple[float, ...]:
    """What was given as steps or tolerances, largest first. Raises InputError."""
    values = (
        tuple(given) if isinstance(given, Iterable) and not isinstance(given, str) else (given,)
    )
    if len(values) > MOST:
        text = f"are {len(values)} settings of each method; give {MOST} at most"
        raise InputError(Problem("work_precision", field, text))
    right = all(
        isinstance(x, Real) and not isinstance(x, bool) and least <= float(x) <= most
        for x in values
    )
    if not values or not right:
        text = f"must be one number or more, each within {least:g} and {most:g}; given {given!r}"
        raise InputError(Problem("work_precision", field, text))
    return tuple(sorted({float(x) for x in values}, reverse=True))


def ladder(
    steps: Any, tolerances: Any, spacing: float, rate: float, t_end: float
) -> tuple[tuple[float, ...], tuple[float, ...]]:
    """(steps, tolerances) as given, or the usual ones. Raises InputError."""
    found = halved(first_step(spacing, rate))
    if steps is not None:
        found = numbers("steps", steps, least=t_end / 1e8, most=t_end)
    usual = TOLERANCES
    if tolerances is not None:
        usual = numbers("tolerances", tolerances, least=LEAST_RTOL, most=0.1)
    return found, usual
