"""Runs of duals, which repeat the steps of a run of numbers with its derivatives."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np

from ..dynamics.lifted import laid_out, lifted
from ..engine import layout as at
from ..engine.arrays import CARRIED, FACTORED, RUN_OF_DUALS, SCENE_OF_DUALS, Carried, RunLinks
from ..engine.compiler.address import address_of, address_of_array, buffer
from ..engine.compiler.dual import WIDTH
from ..engine.records import CHOSEN, COUNTERS, STEP_CONTROL, table
from ..errors import InputError, Problem
from ..packing import Array
from .variables import Slope

MOST_ROWS = 3000  # of a run with derivatives: their laws are solved as one dense system
ROUNDS = 50  # projections of the initial state, as in `assembled`


class RunOfDuals:
    """The scene, the stages and the control of a run with up to seven derivatives."""

    def __init__(self, record: Any, start: tuple[Array, Array], slopes: Sequence[Slope]):
        from ..engine.stepping import duals

        steps = record.steps
        scene = record.scene.arrays
        constrain = address_of(duals.constrain_duals) if len(record.scene.active) > 1 else 0
        links = scene.links._replace(constraints=constrain)
        if record.scene.touching is not None:
            from ..engine.stepping import moreau_duals

            links = links._replace(forces=address_of(moreau_duals.forces_of_duals))
        self._scene = lifted(SCENE_OF_DUALS, scene, np.array([slope.scene for slope in slopes]))
        space = self._scene.space._replace(slots=scene.space.slots.copy())
        self._scene = self._scene._replace(links=links, space=space)
        self._scene.space.vectors[FACTORED] = 0.0  # these factors have no derivatives
        self._at_scene = _saved(SCENE_OF_DUALS, self._scene)
        nq, nv = len(steps.q), len(steps.v)
        stages = np.zeros((*steps.stages.shape, WIDTH))
        control = table(STEP_CONTROL, 1)
        control[:] = steps.control_table
        control["fresh"] = control["filled"] = control["guard"] = 0
        control["widths"] = CHOSEN  # not used: steps are given
        project = address_of(duals.projection_of_duals) if constrain else 0
        links = RunLinks(address_of(duals.acceleration_of_duals), project, 0, 0)
        kept = steps.kept
        self._run = kept._replace(
            scene=address_of_array(self._at_scene), links=links, stages=stages,
            real=np.zeros((*kept.real.shape, WIDTH)), control=control,
            counters=table(COUNTERS, 1), flow=np.zeros((3, WIDTH)),
        )  # fmt: skip
        self._at_run = _saved(RUN_OF_DUALS, self._run)
        self.address = address_of_array(self._at_run)
        y = stages[at.Y]
        y[: nq + nv, 0] = np.concatenate(start)
        for k, slope in enumerate(slopes, start=1):
            y[: nq + nv, k] = np.concatenate((slope.q, slope.v))
        if constrain and record.plan.project:
            t = float(record.plan.times[0])
            duals.place_of_duals(self.address, t, ROUNDS)
        y[: nq + nv, 0] = np.concatenate((steps.q, steps.v))
        stages[at.CANDIDATE] = y

    def take(self, k: int, derivatives: Array) -> None:
        """Give the state its derivatives by number k."""
        for row in (at.Y, at.CANDIDATE):
            self._run.stages[row, :, 1 + k] = derivatives

    def derivatives(self, n: int | None) -> Array:
        """(MOST, n) of the first n entries of the state, or of all."""
        return self._run.stages[at.Y, :n, 1:].T.copy()

    def switch(self, t: float, steps: Any, late: Array, before: Any, after: Any) -> None:
        """Project the state onto other constraints at t, whose derivatives are `late`."""
        from ..engine.stepping import duals

        y, n = self._run.stages[at.Y], len(steps.q) + len(steps.v)
        if len(late):
            y[:, 1 : 1 + len(late)] += np.outer(before, late)
        self._scene.space.vectors[FACTORED] = 0.0
        y[:n, 0] = np.concatenate((steps.q, steps.v))
        if self._scene.blocks.active[0]:
            duals.place_of_duals(self.address, t, ROUNDS)
            y[n:, 1:] = np.nan  # of the energy that the impulse takes
        y[:n, 0] = np.concatenate((steps.q, steps.v))
        if len(late):
            y[:, 1 : 1 + len(late)] -= np.outer(after, late)
        self._run.stages[at.CANDIDATE] = y
        self._run.control["fresh"] = self._run.control["filled"] = 0


class Parts:
    """What repeats the parts of steps of time stepping, behind an address."""

    def __init__(self, record: Any, runs: Sequence[RunOfDuals]):
        from ..engine.stepping import moreau_duals

        m = record.scene.space.vectors.shape[1]
        if m > MOST_ROWS:
            text = f"has derivatives up to {MOST_ROWS} rows of limits and constraints; here are {m}"
            raise InputError(Problem("simulate", "wrt", text))
        repeat, part = map(address_of, (moreau_duals.repeat_part, moreau_duals.part_of_duals))
        addresses = np.array([run.address for run in runs])
        self.ended = np.zeros(2)
        order, matrix, right = np.zeros(m, dtype=np.int64), np.zeros((m, m)), np.zeros((m, WIDTH))
        self._kept = Carried(repeat, part, addresses, order, matrix, right, self.ended)
        self._buffer = _saved(CARRIED, self._kept)
        self.address = address_of_array(self._buffer)


def _saved(kind: Any, value: Any) -> Any:
    """A buffer with a lifted tuple."""
    words, out = laid_out(kind, value), buffer()
    out[: len(words)] = words
    return out
