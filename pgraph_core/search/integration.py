"""The integration error of the runs of a search, from finer runs at its optimum.

A search takes many runs with derivatives, so their steps should not be finer than necessary. At its
optimum, runs without derivatives by quarters of the step give the error of each column. The curves
are corrected by it, and the search goes on from there with the same steps: its derivatives need not
be more exact than the steps of a Newton method must be.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from typing import Any, NamedTuple

import numpy as np

from ..result import Result
from ..tolerances import ROUNDING
from .free import Numbers

Array = np.ndarray
LEVELS = 3  # finer runs, which together take 84 times the steps: about as many as the search
QUARTER = 4  # the error of a method of order p >= 1 is at most a third of the last difference then
TIGHTER = 100  # ratio of tolerances, for which steps of a method of order up to 8 are halved


class Finer(NamedTuple):
    """Finer runs at a point of a search."""

    runs: list[Result]
    shift: list[Array]  # finest minus given run, by column
    left: list[Array]  # about the error of the finest, with its sign
    level: int

    @property
    def said(self) -> str:
        """The argument of `simulate` of the finest run."""
        header = self.runs[0].header
        name = "step" if header["rtol"] is None else "rtol"
        return f"{name}={header[name]:.2g}"


def finer_runs(
    numbers: Numbers, x: Array, runs: Sequence[Result], read: Callable[[Sequence[Result]], Any],
    enough: Callable[[list[Array]], bool], start: int = 1,
) -> Finer | str:  # fmt: skip
    """Refine the runs at x from the level `start` on, until the remaining error is small enough.

    `read` returns the columns of runs. Returns the reason if a finer run fails.
    """
    first = before = read(runs)
    found: Finer | None = None
    for level in range(start, LEVELS + 1):
        failed = numbers.failed
        finer = numbers.runs(x, False, [finer_options(run, level) for run in runs])
        why, numbers.failed = numbers.failed, failed
        if finer is None:
            return found or why
        now = read(finer)
        left = [(b - a) / (QUARTER - 1) for a, b in zip(before, now)]
        found = Finer(finer, [b - a for a, b in zip(first, now)], left, level)
        if enough(left):
            break
        before = now
    assert found is not None
    return found


def finer_options(run: Result, level: int) -> dict[str, Any]:
    """Return the arguments of `simulate` of a finer run."""
    header = run.header
    if header["rtol"] is not None:
        return {"rtol": max(header["rtol"] / TIGHTER**level, ROUNDING)}
    return {"step": header["step"] / QUARTER**level}


def gives_steps(numbers: Numbers) -> bool:
    """Check whether the caller or a scenario has chosen the accuracy of the runs."""
    for case in numbers.cases:
        name = case.options.get("scenario")
        scenario = None if name is None else numbers.model.scenario(name)
        if {"step", "rtol"} & {*case.options} or (scenario is not None and scenario.step):
            return True
    return False
