"""Sweep points stepped together: one batch advances many runs at once.

Each instance of a batch has the bits of its own run, so that the table does not depend on it.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from ..batches.batch_stepper import BatchStepper
from ..batches.instances import IN_LANES
from ..errors import PgraphError
from ..mechanism import Mechanism
from ..model import Model
from ..result import Result
from ..simulation.options import Options
from ..simulation.plan import plan_of
from .metrics import OF_RUN, WAYS, Metric, column_of, words

Array = np.ndarray
OPTIONS = ("scenario", "method", "step", "stabilise", "forces")  # options that a batch takes too
ALSO = ("t_end", "frames", "t_eval", "estimate")  # options that decide what a run records
SAME_RUN = ("bodies", "constraints", "contacts", "forces", "gravity", "ground")  # no times or steps
PIECE = 1000  # steps of all instances that are kept at once


class Exact(BatchStepper):
    """A batch whose instances match their individual runs bit for bit."""

    _same_bits = True


@dataclass(frozen=True)
class Together:
    """The plan for a batch that advances all runs of a sweep together."""

    options: Mapping[str, Any]  # options of the batch
    frames: Array  # (n,) steps from the start to each recorded state
    columns: Mapping[str, int]  # column in (q, v) of each metric, -1 for the whole run
    constants: Mapping[str, float]  # metrics that are the same for all

    @classmethod
    def of(
        cls, model: Model, groups: Sequence[str], metrics: Mapping[str, Metric | str],
        options: Mapping[str, Any], run: Result,
    ) -> Together | None:  # fmt: skip
        """Return the plan, or None unless all metrics use coordinates only and the step size is
        fixed.

        `model` is the model of the first point, and `run` its run or the beginning of it.
        """
        named = all(isinstance(metric, str) for metric in metrics.values())
        known = {*OPTIONS, *ALSO}.issuperset(options) and not options.get("estimate")
        if not named or not known or not set(SAME_RUN).issuperset(groups):
            return None
        given = {name: x for name, x in options.items() if name in OPTIONS or x is not None}
        asked = Options(**{**given, "estimate": False})
        plan = plan_of(Mechanism(model), asked, None, None, None)
        chosen = plan.tolerance is not None or len(set(plan.width.tolist())) != 1
        chosen = chosen or plan.method.name not in IN_LANES
        if (plan.substeps > 1).any():  # frames may miss oscillations, of which a single run tells
            return None
        later = plan.changes or plan.conditions or plan.contact_points or plan.way is not None
        asked_for = plan.header["why"].endswith("as asked")
        if chosen or later or plan.tau is not None or not asked_for:
            return None
        frames = np.concatenate(([0], np.cumsum(plan.substeps)))
        constants = {"t_end": float(plan.times[-1]), "steps": float(frames[-1])}
        if plan.shown is not None:
            frames = frames[plan.shown]
        columns = dict[str, int]()
        for metric in map(str, metrics.values()):
            if metric in OF_RUN and metric not in constants:
                return None
            place = -1 if metric in constants else _place(run, column_of(run, words(metric)[1]))
            if place is None:
                return None
            columns[metric] = place
        batch = {name: given[name] for name in OPTIONS if name in given}
        batch |= {"method": plan.method.name, "step": float(plan.width[0])}
        return cls(batch, frames, columns, constants)

    def measured(
        self, model: Model, paths: Sequence[Any], points: Array, metrics: Sequence[str]
    ) -> tuple[Array, Array]:
        """Return values of shape (points, metrics), and flags (points,) for runs that reached the
        end.

        Raises PgraphError if a point is invalid, or if the points differ in structure.
        """
        batch = Exact(model, len(points), set=dict(zip(paths, points.T)), threads=1, **self.options)
        wanted = [self.columns[metric] for metric in metrics]
        places = sorted({place for place in wanted if place >= 0})
        final = all(place < 0 or words(m)[0] == "final" for m, place in zip(metrics, wanted))
        found = self._last(batch, places) if final else self._all(batch, places)
        values = np.empty((len(points), len(metrics)))
        for m, (metric, place) in enumerate(zip(metrics, wanted)):
            if place < 0:
                values[:, m] = self.constants[metric]
                continue
            way, k = WAYS[words(metric)[0]], places.index(place)
            t = float(self.options["step"]) * self.frames[-len(found) :]
            values[:, m] = [way(t, found[:, i, k]) for i in range(len(points))]
        return values, batch.ok

    def _last(self, batch: BatchStepper, places: list[int]) -> Array:
        batch.step(n=int(self.frames[-1]))
        return np.concatenate((batch.q, batch.v), axis=1)[None, :, places]

    def _all(self, batch: BatchStepper, places: list[int]) -> Array:
        """(frames, instances, places)."""
        found = np.empty((len(self.frames), batch.size, len(places)))
        found[self.frames == 0] = np.concatenate((batch.q, batch.v), axis=1)[:, places]
        for begin in range(0, int(self.frames[-1]), PIECE):
            n = min(PIECE, int(self.frames[-1]) - begin)
            states = batch.trace(n=n)[:, :, places]
            inside = (self.frames > begin) & (self.frames <= begin + n)
            found[inside] = states[self.frames[inside] - begin - 1]
        return found


def _place(run: Result, column: Array) -> int | None:
    """Return the index of a column in (q, v), or None if it is another column."""
    for states, first in ((run.q, 0), (run.v, run.q.shape[1])):
        if np.shares_memory(states, column):
            return first + (column.ctypes.data - states.ctypes.data) // states.itemsize
    return None


def together(
    model: Model, groups: Sequence[str], metrics: Mapping[str, Metric | str],
    options: Mapping[str, Any], run: Result,
) -> Together | None:  # fmt: skip
    """Return `Together.of`, or None if the first point cannot run."""
    try:
        return Together.of(model, groups, metrics, options, run)
    except PgraphError:
        return None
