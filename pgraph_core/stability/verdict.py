"""The seven verdicts on a cell of the map, and the cell itself."""

from __future__ import annotations

from dataclasses import dataclass
from enum import StrEnum

NAN = float("nan")


class Verdict(StrEnum):
    """What a run was worth; exactly one a cell. (How a run ended is its `Status`.)"""

    OK = "OK"
    INACCURATE = "INACCURATE"
    UNSTABLE = "UNSTABLE"
    DAMPED = "DAMPED"
    DRIFT = "DRIFT"
    FAILED = "FAILED"
    SLOW = "SLOW"


MEANING = {
    Verdict.OK: "as accurate as asked for",
    Verdict.INACCURATE: "bounded, but not as accurate as asked for",
    Verdict.UNSTABLE: "the method makes the motion grow",
    Verdict.DAMPED: "the method takes energy that the model keeps",
    Verdict.DRIFT: "constraints are left",
    Verdict.FAILED: "the run ended early, or was refused",
    Verdict.SLOW: "more steps than the budget has",
}
LETTER = dict(zip(Verdict, ".iUdDFs"))  # of the text map


@dataclass(frozen=True)
class Cell:
    """One value, method and step: how its run compares with the reference.

    Errors are the largest over time of a joint's turn [rad], or of its slide over the mechanism's
    length; energies are relative to their range in the reference.
    """

    value: float
    method: str
    step: float  # [s]
    status: Verdict
    text: str  # why, and what would do
    error: float = NAN
    error_half: float = NAN  # at half of the step
    order: float = NAN  # observed, from these two
    step_needed: float = NAN  # that would meet the target, from the observed order [s]
    time: float = NAN  # of the failure, or from when on the motion grew [s]
    body: str = ""  # the first at fault
    step_limit: float = NAN  # predicted largest stable step [s]
    energy_lost: float = 0.0  # that the model does not dissipate
    energy_gained: float = 0.0
    constraint_drift: float = 0.0  # of the mechanism's length
    evaluations: int = 0  # of the dynamics
