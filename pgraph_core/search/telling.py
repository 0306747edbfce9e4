"""Lines about a search in progress."""

from __future__ import annotations

import sys
import time
from typing import Any, Protocol

import numpy as np

from ..errors import counted
from ..result import Result
from ..tolerances import NOTABLE
from .goals import Goals

SILENCE = 5  # seconds after which a person wonders whether anything happens


class UnderWay(Protocol):
    """The progress of a search, for messages."""

    best: Any  # the best point so far, with its values, or None
    goals: Goals
    iterations: int
    history: Any  # trials so far


class Teller:
    """A function of each trial that writes a line if the last one is long ago."""

    def __init__(self, search: UnderWay, most: int):
        self.search, self.most = search, most
        self.began = self.last = time.monotonic()

    def __call__(self, trial: Any, _: Result | None) -> None:
        now, best = time.monotonic(), self.search.best
        if now - self.last <= SILENCE or best is None:
            return
        self.last, goals = now, self.search.goals
        told = f"objective {goals.total(best.values):.6g}"
        if goals.names:
            over = goals.over(best.values) / goals.sizes
            worst = int(np.abs(over).argmax())
            name, value = goals.names[worst], best.values[goals.count + worst]
            missed = goals.missed(best.values) > NOTABLE
            told += f", {name} is missed by {abs(over[worst]):.2g} of its size, {value:.6g}"
            told = told if missed else told.partition(",")[0] + ", constraints are met"
        done, runs = max(self.search.iterations, 1), len(self.search.history)
        left = (self.most - done) * (now - self.began) / done
        told += f"; iteration {done} of at most {self.most}, {max(left, 0.0):.0f} s"
        text = f"optimise: {counted(runs, 'run')} in {now - self.began:.0f} s, best: {told}"
        print(text, file=sys.stderr, flush=True)


def reason_of_end(found: Any, most: int) -> str:
    """Return the reason why a search did not converge, as a sentence."""
    if (found.nfev if "nit" not in found else found.nit) >= most:
        return f"not converged after {most} iterations: give a larger most="
    return f"not converged: {found.message}"
