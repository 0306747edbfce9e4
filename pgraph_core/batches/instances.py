"""Instances of a mechanism as rows of two tables, stepped by one prepared run a thread.

A row of `states` is all that steps read before they write it; a row of `numbers` is what the
description gives. A thread copies both into its run, takes the steps and copies the state back, so
that a result depends on nothing but its two rows. Of the numbers, tables keep those that differ.
"""

from __future__ import annotations

import ctypes
from collections.abc import Callable, Sequence
from concurrent.futures import ThreadPoolExecutor
from functools import cache, partial
from itertools import pairwise
from typing import Any

import numpy as np

from ..engine import layout as at
from ..engine.compiler.address import address_of, address_of_function
from ..engine.stepping import many, run
from ..packing.system import Array, Ints
from ..simulation.loop import Outcome
from ..simulation.stepper import Stepper

WORD = 8  # bytes
BETWEEN = 1_000_000  # steps of instances between two looks at whether the user wants to stop


def state_arrays(stepper: Stepper) -> list[Any]:
    """What steps of this stepper read before they write it, and what tells how they went."""
    record = stepper.recording
    scene, steps = record.scene, record.steps
    found: list[Any] = [steps.stages[at.Y], steps.control_table, steps.counters_table]
    found += [scene.given, scene.active, scene.blocks.blocks_f]
    found += [record.plan.drives.knots[k] for k in stepper.servos.values()]
    if len(scene.packed.blocks.blocks_i):  # factors are kept from step to step
        found += [*scene.space]
    if scene.touching is not None:
        found += scene.touching.memory
    if record.user is not None:
        found += record.user.memory
    return [a for a in found if a.size]


def number_arrays(stepper: Stepper) -> list[Any]:
    """What the description gives, and what a step that fails leaves in the run."""
    return [a for a in (*stepper.recording.steps.given, *stepper.recording.scene.numbers) if a.size]


def words_of(arrays: Sequence[Array]) -> Ints:
    """All arrays, one after the other, as words of eight bytes."""
    return np.concatenate([a.reshape(-1).view(np.int64) for a in arrays])


class Place:
    """Where a table's rows hold one array of the run."""

    def __init__(self, arrays: Sequence[Array], wanted: Array):
        before = [a.nbytes for a in arrays]
        number = next(i for i, a in enumerate(arrays) if a is wanted)
        self.offset, self.kind, self.shape = sum(before[:number]), wanted.dtype, wanted.shape

    def of(self, table: Ints) -> Any:
        """(rows, ...) a view of the array in every row."""
        strides = (table.strides[0], *np.empty(self.shape, self.kind).strides)
        shape = (len(table), *self.shape)
        return np.ndarray(shape, self.kind, table, self.offset, strides)


class Worker:
    """The run that steps the instances of one thread."""

    def __init__(self, stepper: Stepper, varying: Ints):
        """`varying` are the places of the numbers, in words, that the table holds."""
        self.stepper = stepper
        self._kept = state_arrays(stepper), number_arrays(stepper)
        own, numbers = self._kept
        sizes = [a.nbytes for a in own]
        places = np.cumsum([0, *sizes[:-1]])
        self.own = np.array([(a.ctypes.data, p, n) for a, p, n in zip(own, places, sizes)])
        self.numbers = _spans(numbers, varying)
        self.run = stepper.recording.steps.address

    def meet(self) -> str:
        """Move the state in the run onto its constraints; why that cannot be done, or ""."""
        record = self.stepper.recording
        record.ended = Outcome()
        return "" if record.begin() else record.ended.message

    def vdot(self) -> Array:
        """v' (nv,) at the state in the run."""
        self.stepper.recording.look()
        return self.stepper.recording.out.vdot[0].copy()

    def state(self) -> Ints:
        """The state in the run as a row."""
        return words_of(self._kept[0])


def _spans(arrays: Sequence[Array], varying: Ints) -> Ints:
    """(address, place in a row, bytes) of the varying words of the arrays, neighbours together."""
    found: list[tuple[int, int, int]] = []
    first = 0
    for a in arrays:
        words = a.nbytes // WORD
        begin, end = np.searchsorted(varying, (first, first + words)).tolist()
        chosen = varying[begin:end] - first
        breaks = np.flatnonzero(np.diff(chosen) > 1) + 1
        for part in np.split(np.arange(begin, end), breaks) if len(chosen) else ():
            address = a.ctypes.data + WORD * int(varying[part[0]] - first)
            found.append((address, WORD * int(part[0]), WORD * len(part)))
        first += words
    return np.array(found, dtype=np.int64).reshape(-1, 3)


class Instances:
    """The tables of all instances, and the workers that step them."""

    def __init__(self, starts: Ints, numbers: Ints, kind: Ints, workers: Sequence[Worker]):
        """`starts` (kinds, words) are initial states, `numbers` (kinds, words) what varies."""
        self.starts, self.numbers, self.kind, self.workers = starts, numbers, kind, workers
        self.states, self.codes = starts[kind], np.full(len(kind), at.RUNNING)
        size = len(kind)
        arrays = state_arrays(workers[0].stepper)
        record = workers[0].stepper.recording
        steps, scene = record.steps, record.scene
        nq, nv = len(steps.q), len(steps.v)
        y = Place(arrays, arrays[0]).of(self.states)
        self.q, self.v = y[:, :nq], y[:, nq : nq + nv]
        self.ledger = y[:, nq + nv :]  # work done and dissipation [J]
        self.control = Place(arrays, steps.control_table).of(self.states)[:, 0]
        self.given = Place(arrays, scene.given).of(self.states) if nv else np.zeros((size, 0))
        knots, servos = record.plan.drives.knots, workers[0].stepper.servos
        first = next((i for i, a in enumerate(arrays) if a.base is knots), 0)
        self.targets = {
            name: Place(arrays, arrays[first + i]).of(self.states)[:, 1]
            for i, name in enumerate(servos)
        }
        self.pairs = None
        if scene.touching is not None and scene.touching.pairs.size:
            self.pairs = Place(arrays, scene.touching.pairs).of(self.states)

    def step(self, n: int) -> None:
        """n steps of all instances that run; `given` acts."""
        self.control["fresh"][self.codes == at.RUNNING] = 0
        most = max(BETWEEN // len(self.codes), 1)
        while n > 0:
            self.spread(partial(self._part, min(n, most)), len(self.codes))
            n -= most

    def accelerations(self) -> Array:
        """v' (m, nv) at the states."""
        return np.array([self.into_worker(i).vdot() for i in range(len(self.kind))])

    def spread(self, work: Callable[[int, int, int], object], count: int) -> None:
        """`work(part, begin, end)` of `count` things in as many parts as there are workers."""
        parts = min(len(self.workers), count)
        edges = np.linspace(0, count, parts + 1).astype(int).tolist()
        spans = [(i, *span) for i, span in enumerate(pairwise(edges))]
        if parts == 1:
            work(*spans[0])
            return
        for done in [pool(parts).submit(work, *span) for span in spans]:
            done.result()

    def _part(self, n: int, number: int, *span: int) -> None:
        worker = self.workers[number]
        tables = np.array([(a.ctypes.data, a.strides[0]) for a in (self.states, self.numbers)])
        many.step_instances(
            worker.run, address_of(run.advance_run), COPY, worker.own, worker.numbers, tables,
            self.kind, self.codes, n, *span,
        )  # fmt: skip

    def relink(self) -> None:
        """Addresses of another process are none of this one."""
        here = self.workers[0].stepper.recording.steps.control
        for name in ("guard", "approach"):
            self.control[name] = here[name]

    def into_worker(self, i: int) -> Worker:
        """The first worker, with instance i in its run."""
        worker = self.workers[0]
        code, self.codes[i] = self.codes[i], at.RUNNING
        self._part(0, 0, i, i + 1)
        self.codes[i] = code
        return worker


@cache
def pool(threads: int) -> ThreadPoolExecutor:
    """Threads kept between batches: starting them costs as much as a small one."""
    return ThreadPoolExecutor(threads)


COPY = address_of_function(ctypes.memmove)
