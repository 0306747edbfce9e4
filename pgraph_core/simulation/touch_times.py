"""Derivatives of the times at which soft contacts touch, where steps end.

The force of a touch begins with zero slope, so derivatives do not jump there. But its rate is not
smooth: a step from the touch is accurate for a force that begins with the step, and not for the
derivative by a time within it. So the start of that step moves with the touch, and its end stays
where it is.
"""

from __future__ import annotations

from typing import TYPE_CHECKING, NamedTuple

import numpy as np

from ..engine import layout as at
from ..engine.records import GIVEN, REACHED
from ..packing import Array
from ..tolerances import ROUNDING, step_of_differences

if TYPE_CHECKING:
    from .duals import RunOfDuals
    from .loop import Steps
    from .recording import Recording

BACKWARDS = {0: 25 / 12, 1: -4.0, 2: 3.0, 3: -4 / 3, 4: 1 / 4}  # weights of f(x - k h), for h f'(x)


class Touch(NamedTuple):
    """A touch at the end of a step, and the derivatives of its time."""

    times: list[Array]  # (MOST,) of each run
    rates: Array  # rates of the state at the touch


class Within(NamedTuple):
    """The step that began at a touch, in which frames move with it until they are corrected."""

    times: list[Array]
    begin: float  # [s]
    end: float
    by_start: Array  # change of the state at the end by a later start, of a step of the same width


def touch_of(record: Recording, runs: list[RunOfDuals], rates: Array) -> Touch | None:
    """Return the touch at the end of the last step, or None. `rates` are those of the state."""
    touching = record.scene.touching
    if touching is None or not record.plan.yields or record.events is not None:
        return None
    steps = record.steps
    if steps.error["widths"] == GIVEN:
        rates = change_of_step(steps, 0.0, 1.0)
    near = ROUNDING * float(touching.tally["length"])
    found = [run.touch(rates, near) for run in runs]
    times = [one for one in found if one is not None]
    return Touch(times, rates) if len(times) == len(runs) else None


def begun_at(touch: Touch, record: Recording, rates: Array) -> tuple[Array, Within]:
    """Return the derivative of the state by the start of the last step, and that step.

    `rates` are those of the state at its end. The end of a given step stays, whatever its start,
    and a chosen step has its width, so that its end moves with the start.
    """
    steps = record.steps
    control, by_start = steps.control, change_of_step(steps, 1.0, 0.0)
    stays = control["error"]["widths"] == GIVEN and (
        control["ends"]["done"] == 0.0 or control["ends"]["sided"] == 0
    )
    rates = change_of_step(steps, 0.0, 1.0) if stays else rates
    times = float(control["clock"]["old_time"]), float(control["clock"]["time"])
    return by_start - rates, Within(touch.times, *times, by_start)


def change_of_step(steps: Steps, later: float, wider: float) -> Array:
    """Differentiate the end of the last step by its start and width, along this direction.

    The step is repeated with widths that are not larger, so that nothing touches within it.
    """
    from ..engine.stepping import duals

    kept = steps.kept
    tables = kept.stages, kept.real, kept.pair, steps.control_table, steps.counters_table
    before = [table.copy() for table in tables]
    begin, width = float(steps.clock["old_time"]), float(steps.clock["old_width"])
    if steps.guard["fired"] == REACHED:  # an event has cut it short
        width = float(steps.clock["time"]) - begin
    h, total = step_of_differences(4) * width, np.zeros(kept.stages.shape[1])
    for k, weight in BACKWARDS.items():
        duals.step_beside(steps.address, begin - k * h * later, width - k * h * wider)
        total += weight / h * kept.stages[at.TRIAL]
        for table, old in zip(tables, before):
            table[:] = old
    return total
