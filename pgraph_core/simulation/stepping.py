"""What takes a run on: steps of given width, or steps chosen by their error."""

from __future__ import annotations

from typing import Any, Protocol

from ..mechanism import Mechanism
from ..system import Array
from .chosen_steps import ChosenSteps
from .given_steps import GivenSteps
from .run_plan import RunPlan


class Stepping(Protocol):
    """The state of a run, and what takes it on."""

    q: Array
    v: Array
    times: Array  # of frames; where a run fails, its last frame gets another time
    cursor: Any  # records.CURSOR
    counters: Any  # records.COUNTERS
    failure: Array  # (2,) time and row, where it failed
    ledger: Array  # (2,) work and dissipation so far [J]
    stop: int  # frames until which it goes on

    def advance(self, scene: int, budget: int, out: tuple[Array, ...]) -> int:
        """At most `budget` steps and frames on; the kernel's status code."""
        ...

    def fraction(self) -> float:
        """How much of the run is done, 0 to 1."""
        ...

    def restart(self) -> None:
        """Go on from a state, or with equations, that have just changed; the last frame anew."""
        ...

    def notices(self) -> list[str]:
        """What a person should know of the steps taken."""
        ...


def stepping(mech: Mechanism, plan: RunPlan, q: Array, v: Array) -> Stepping:
    """What the plan's method needs."""
    return (GivenSteps if plan.tolerance is None else ChosenSteps)(mech, plan, q, v)
