"""Runs of duals: the state of a run with up to seven derivatives."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any, NamedTuple

import numpy as np

from ..analysis.assembly import ASSEMBLY_ROUNDS
from ..dynamics.lifted import flat, laid_out, lifted
from ..engine import arrays
from ..engine import layout as at
from ..engine.arrays import (
    CARRIED,
    CONTACTS_OF_DUALS,
    DESCRIBED,
    FACTORED,
    RUN_OF_DUALS,
    SCENE_OF_DUALS,
    RunLinks,
)
from ..engine.compiler.address import address_of, address_of_array, buffer
from ..engine.compiler.dual import WIDTH
from ..engine.records import CONTACT, COUNTERS, table
from ..engine.stepping.control.clock import forget
from ..errors import InputError, Problem
from ..packing import Array
from ..tolerances import NOTABLE
from .recording import Recording
from .variables import Slope

MOST_ROWS = 3000  # limit for derivatives, whose laws form one dense system
GAP = (CONTACT.fields or {})["gap"][1] // 8  # word of a contact point


State = tuple[Array, Array]  # q and v, with the states of controls


class Part(NamedTuple):
    """A sub-step of time stepping."""

    width: float  # [s]
    start: Array  # q and v
    times: Array  # derivatives (MOST - 1,) of the time of its end, if it stays of no width
    rates: Array  # rates of the state at its end


class RunOfDuals:
    """The scene, the stages and the control of a run with up to seven derivatives."""

    def __init__(
        self, record: Recording, acting: Any, start: tuple[Array, Array], slopes: Sequence[Slope]
    ):
        """`acting` is the scene of the recording, or one in which more parts act."""
        from ..engine.stepping import duals

        steps, own, self._acting = record.steps, record.scene.arrays, acting
        blocks = acting.arrays.blocks._replace(active=own.blocks.active)
        scene = acting.arrays._replace(blocks=blocks, given=own.given, links=own.links)
        constrain = address_of(duals.constrain_duals) if len(record.scene.active) > 1 else 0
        links = scene.links._replace(constraints=constrain)
        given = np.array([slope.scene for slope in slopes])
        if record.scene.touching is not None:
            from ..engine.stepping import moreau_duals

            self._contacts = contacts_of_duals(record.scene.touching, acting.touching, given)
            self._at_contacts = _saved(CONTACTS_OF_DUALS, self._contacts)
            links = links._replace(
                contacts=address_of_array(self._at_contacts),
                find=address_of(moreau_duals.find_of_duals),
                forces=address_of(moreau_duals.forces_of_duals),
            )
        self._scene = lifted(SCENE_OF_DUALS, scene, given)
        space = self._scene.space._replace(slots=scene.space.slots.copy())
        self._scene = self._scene._replace(links=links, space=space)
        self._scene.space.vectors[FACTORED] = 0.0  # these factors have no derivatives
        self._at_scene = _saved(SCENE_OF_DUALS, self._scene)
        nq, nv = len(steps.q), len(steps.v)
        stages = np.zeros((*steps.stages.shape, WIDTH))
        project = address_of(duals.projection_of_duals) if constrain else 0
        links = RunLinks(address_of(duals.acceleration_of_duals), project, 0, 0)
        kept = steps.kept
        self._run = kept._replace(
            scene=address_of_array(self._at_scene), links=links, stages=stages,
            real=np.zeros((*kept.real.shape, WIDTH)), control=steps.control_of_duals(),
            counters=table(COUNTERS, 1), flow=np.zeros((3, WIDTH)),
        )  # fmt: skip
        self._at_run = _saved(RUN_OF_DUALS, self._run)
        self.address = address_of_array(self._at_run)
        y = stages[at.Y]
        y[: nq + nv, 0] = np.concatenate(start)
        for k, slope in enumerate(slopes, start=1):
            y[: nq + nv, k] = np.concatenate((slope.q, slope.v))
        self.strayed = False  # whether the start is another than that of the primal run
        if constrain and record.plan.project:
            t = float(record.plan.times[0])
            duals.place_of_duals(self.address, t, ASSEMBLY_ROUNDS)
            apart = np.abs(y[: record.mech.nq, 0] - steps.q[: record.mech.nq])
            self.strayed = bool((apart > NOTABLE).any())
        y[: nq + nv, 0] = np.concatenate((steps.q, steps.v))
        stages[at.CANDIDATE] = y

    def take(self, k: int, derivatives: Array) -> None:
        """Set the derivatives of the state by parameter k."""
        for row in (at.Y, at.CANDIDATE):
            self._run.stages[row, :, 1 + k] = derivatives

    def derivatives(self, n: int | None) -> Array:
        """(MOST, n) of the first n entries of the state, or of all."""
        return self._run.stages[at.Y, :n, 1:].T.copy()

    @property
    def last_part(self) -> Part:
        """The last sub-step of a step of time stepping that ended at an event."""
        from ..engine.stepping.duals_within import TIMES

        stages = self._run.stages
        start, width = stages[at.PART_START], stages[at.PART_TIMES, TIMES.taken]
        moved = stages[at.LAST_WIDTH, 0]
        times = -width[1:-1] / (moved - width)[1:-1]  # at which its width stays zero
        return Part(width[0], start[:-2, 0].copy(), times, start[:, 1].copy())

    @property
    def code(self) -> Array:
        """The program of the expressions, (2 n, columns, WIDTH)."""
        return self._scene.loads.signals[0]

    def margin(self, t: float, a: int, b: int) -> Array:
        """Return the derivatives (MOST,) of the difference of two values of the program at t."""
        from ..engine.stepping import duals

        duals.see_duals(self.address, t)
        return self.code[a, 0, 1:] - self.code[b, 0, 1:]

    def touch(self, ahead: Array, near: float) -> Array | None:
        """Return the derivatives (MOST,) of the time at which a gap of the state became zero.

        `ahead` is the rate of the state, and gaps below `near` [m] are zero. The derivatives are
        the mean of those of several gaps, and None without a gap.
        """
        y = self._run.stages[at.Y]
        kept, here = y.copy(), self._gaps(near)
        y[:, 1:] += ahead[:, None]
        rate = self._gaps(near)[:, 1] - here[:, 1]
        y[:] = kept
        closes = (np.abs(here[:, 0]) <= near) & (rate < 0.0)
        if not closes.any():
            return None
        return -(here[closes, 1:] / rate[closes, None]).mean(axis=0)

    def _gaps(self, margin: float) -> Array:
        """Return the gaps of the state below this one, with their derivatives, (n, WIDTH)."""
        from ..engine.stepping import duals

        return self._contacts.found[: duals.find_duals(self.address, margin), GAP].copy()

    def shift(self, derivatives: Array) -> None:
        """Add to the derivatives of the state."""
        self._run.stages[at.Y, :, 1:] += derivatives
        self._run.stages[at.CANDIDATE] = self._run.stages[at.Y]
        forget(self._run.control["clock"])

    def switch(
        self, t: float, old: State, new: State, late: Array, before: Any, after: Any
    ) -> None:
        """Project the state `old` onto other constraints at t, whose derivatives are `late`.

        The primal run is in the state `new` after that. As there, the impulse changes the old
        velocities at the new positions.
        """
        from ..engine.stepping import duals

        y, nq, n = self._run.stages[at.Y], len(new[0]), len(new[0]) + len(new[1])
        if len(late):
            y[:, 1 : 1 + len(late)] += np.outer(before, late)
        if self._scene.blocks.active[0]:
            y[:n, 0] = np.concatenate(old)
            v = y[nq:n].copy()
            for _ in range(2):  # the first time for the positions
                y[nq:n] = v
                self._scene.space.vectors[FACTORED] = 0.0
                duals.place_of_duals(self.address, t, ASSEMBLY_ROUNDS)
            y[n:, 1:] = np.nan  # derivative of the energy lost in the impulse
        y[:n, 0] = np.concatenate(new)
        if len(late):
            y[:, 1 : 1 + len(late)] -= np.outer(after, late)
        self._scene.space.vectors[FACTORED] = 0.0
        self._run.stages[at.CANDIDATE] = y
        forget(self._run.control["clock"])


def contacts_of_duals(space: Any, acting: Any, slopes: Array) -> Any:
    """Return the contacts of a scene with derivatives, the last of the `slopes`, (k, words).

    Their description is that of the scene `acting`. The buffers of the solver are shared.
    """
    from ..engine.contact.contacts import ADDING

    words = len(flat(DESCRIBED, acting.described).words)
    described = lifted(DESCRIBED, acting.described, slopes[:, slopes.shape[1] - words :])
    tally = space.tally_table.copy()
    tally["frozen"] = ADDING  # forces of the last step do not act within a step
    given = space.contacts._replace(tally=tally)
    none = np.zeros((0, len(flat(CONTACTS_OF_DUALS, given).words)))
    found = lifted(CONTACTS_OF_DUALS, given, none)
    return found._replace(**dict(zip(("geometry", "ground", "laws"), described)))


class Parts:
    """The function that repeats the sub-steps of time stepping, behind an address."""

    def __init__(self, record: Recording, runs: Sequence[RunOfDuals]):
        from ..engine.stepping import moreau_duals

        m = record.scene.space.vectors.shape[1]
        if m > MOST_ROWS:
            text = f"has derivatives up to {MOST_ROWS} rows of limits and constraints; here are {m}"
            raise InputError(Problem("simulate", "wrt", text))
        repeat, part = map(address_of, (moreau_duals.repeat_part, moreau_duals.part_of_duals))
        addresses = np.array([run.address for run in runs])
        self.ended = np.zeros(2)
        order, matrix, right = np.zeros(m, dtype=np.int64), np.zeros((m, m)), np.zeros((m, WIDTH))
        self._kept = arrays.Carried(repeat, part, addresses, order, matrix, right, self.ended)
        self._buffer = _saved(CARRIED, self._kept)
        self.address = address_of_array(self._buffer)


def _saved(kind: Any, value: Any) -> Any:
    """A buffer with a lifted tuple."""
    words, out = laid_out(kind, value), buffer()
    out[: len(words)] = words
    return out
