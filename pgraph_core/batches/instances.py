"""Instances of a mechanism as rows of two tables, stepped by one prepared run per thread.

A row of `states` contains the data that persists between steps, and a row of `numbers` the values
of the model. A thread copies both into its run, takes the steps and copies the state back, so
results only depend on these two rows. The tables only store values that differ.
"""

from __future__ import annotations

import ctypes
import os
from collections.abc import Callable, Iterator, Sequence
from concurrent.futures import ThreadPoolExecutor
from functools import cache, partial
from itertools import pairwise
from typing import Any

import numpy as np
from numpy.typing import NDArray

from ..engine import layout as at
from ..engine.compiler.address import address_of, address_of_function, unnamed
from ..engine.compiler.elementary import FAR
from ..engine.compiler.jit import JIT
from ..engine.compiler.lane import LANE_WIDTH
from ..engine.motions import facts
from ..engine.stepping import batch as kernels
from ..engine.stepping import run
from ..engine.stepping.control import clock, ends, guard
from ..interrupts import Deferred
from ..packing import Array, Ints, Loads
from ..simulation.loop import Outcome
from ..simulation.stepper import ADDRESSES, Stepper

WORD = 8  # bytes
# speeds of joints times steps between two looks at Ctrl+C: 11 ms of a tree in lanes, 0.15 s of a
# loop or of legs on the ground. A look takes 0.4 ms, so a tenth would cost trees a fifth, and with
# ten times as many Ctrl+C would wait for 1.5 s. It is no time, on which results would depend: each
# part chooses the instances that fit into lanes, which round in another way
WORK_AT_ONCE = 100_000


def state_arrays(stepper: Stepper) -> list[Any]:
    """Return the arrays that steps read before writing, and the step status."""
    record = stepper.recording
    scene, steps = record.scene, record.steps
    found: list[Any] = [steps.stages[at.Y], steps.control_table, steps.counters_table]
    found += [*steps.memory, scene.given, scene.active, scene.blocks.blocks_f]
    found += [record.plan.drives.knots[k] for k in stepper.servos.values()]
    if len(scene.packed.blocks.blocks_i):  # factors are kept from step to step
        found += [*scene.space]
    if scene.touching is not None:
        found += scene.touching.memory
    if record.user is not None:
        found += record.user.memory
    return [a for a in found if a.size]


def number_arrays(stepper: Stepper) -> list[Any]:
    """Return the arrays of the description, including those that remain in the run after a failed
    step."""
    return [a for a in (*stepper.recording.steps.given, *stepper.recording.scene.numbers) if a.size]


def words_of(arrays: Sequence[Array]) -> Ints:
    """Concatenate all arrays as eight-byte words."""
    return np.concatenate([a.reshape(-1).view(np.int64) for a in arrays])


class Place:
    """The position of a run's array within the rows of a table."""

    def __init__(self, arrays: Sequence[Array], wanted: Array):
        before = [a.nbytes for a in arrays]
        number = next(i for i, a in enumerate(arrays) if a is wanted)
        self.offset, self.kind, self.shape = sum(before[:number]), wanted.dtype, wanted.shape

    def of(self, table: Ints) -> Any:
        """Return a view (rows, ...) of the array in every row."""
        strides = (table.strides[0], *np.empty(self.shape, self.kind).strides)
        shape = (len(table), *self.shape)
        return np.ndarray(shape, self.kind, table, self.offset, strides)


class Worker:
    """The run used by one thread to step its instances."""

    def __init__(self, stepper: Stepper, varying: Ints):
        """Create a worker. `varying` gives the places, in words, of the table's numbers."""
        self.stepper = stepper
        self._kept = state_arrays(stepper), number_arrays(stepper)
        own, numbers = self._kept
        sizes = [a.nbytes for a in own]
        places = np.cumsum([0, *sizes[:-1]])
        self.own = np.array([(a.ctypes.data, p, n) for a, p, n in zip(own, places, sizes)])
        self.numbers = _spans(numbers, varying)
        self.run = stepper.recording.steps.address

    def begin(self) -> str:
        """Begin from the run's state, projected onto its constraints. Return an error or ""."""
        record = self.stepper.recording
        record.ended = Outcome()
        return "" if record.begin() else record.ended.message

    def vdot(self) -> Array:
        """Return v' (nv,) at the run's state."""
        self.stepper.recording.look()
        return self.stepper.recording.out.vdot[0, : self.stepper.mech.nv].copy()

    def state(self) -> Ints:
        """Return the run's state as a row."""
        return words_of(self._kept[0])


def _spans(arrays: Sequence[Array], varying: Ints) -> Ints:
    """Compute (address, offset in a row, bytes) of the varying words, adjacent ones merged."""
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
    """The tables for all instances, and the workers that step them."""

    together = 1  # instances that one worker steps in any case

    def __init__(self, starts: Ints, numbers: Ints, kind: Ints, workers: Sequence[Worker]):
        """Create instances from initial states `starts` and `numbers`, each (kinds, words)."""
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
        self.memory = self.codes, self.kind, self.states
        self.pairs = None
        if scene.touching is not None and scene.touching.pairs.size:
            self.pairs = Place(arrays, scene.touching.pairs).of(self.states)
            self._elapsed = Place(arrays, scene.touching.tally_table).of(self.states)["elapsed"]

    def step(self, n: int) -> None:
        """Take n steps of all running instances with the `given` torques."""
        clock.forget_slopes(self.control["clock"], self.codes == at.RUNNING)
        if self.pairs is not None:
            self._elapsed[self.codes == at.RUNNING] = 0.0
        self.in_parts(n, lambda part: self.spread(partial(self._part, part), len(self.codes)))

    def in_parts(self, n: int, take: Callable[[int], None]) -> None:
        """Take n steps in parts, which all instances have taken before Ctrl+C ends the call."""
        most = max(WORK_AT_ONCE // max(len(self.codes) * self.v.shape[1], 1), 1)
        while n > 0:
            with Deferred():
                take(min(n, most))
            n -= most

    def trace(self, n: int) -> Array:
        """Return the states after each of n steps as an (n, instances, nq + nv) array."""
        states = np.empty((n, len(self.codes), self.q.shape[1] + self.v.shape[1]))
        for state in states:
            self.step(1)
            np.concatenate((self.q, self.v), axis=1, out=state)
        return states

    def accelerations(self) -> Array:
        """Return v' (m, nv) at the states."""
        return np.array([self.into_worker(i).vdot() for i in range(len(self.kind))])

    def spread(self, work: Callable[[int, int, int], object], count: int) -> None:
        """Run `work(part, begin, end)` on `count` items, in as many parts as there are workers."""
        blocks = -(-count // self.together)
        parts = min(len(self.workers), blocks)
        edges = np.linspace(0, blocks, parts + 1).astype(int) * self.together
        spans = [(i, *span) for i, span in enumerate(pairwise(np.minimum(edges, count).tolist()))]
        if parts == 1:
            work(*spans[0])
            return
        for done in [pool(parts).submit(work, *span) for span in spans]:
            done.result()

    def _part(self, n: int, number: int, *span: int) -> None:
        worker = self.workers[number]
        kernels.step_instances(
            worker.run, address_of(run.advance_run), COPY, worker.own, worker.numbers,
            self._tables(), self.kind, self.codes, n, *span,
        )  # fmt: skip

    def _tables(self) -> Ints:
        """Return the addresses of the two tables and their row lengths [bytes]."""
        return np.array([(a.ctypes.data, a.strides[0]) for a in (self.states, self.numbers)])

    def relink(self) -> None:
        """Replace data from another process: addresses, and bounds for the next steps."""
        here = self.workers[0].stepper.recording.steps.guard
        guard.set_addresses(self.control["guard"], {name: here[name] for name in ADDRESSES})
        for i in np.flatnonzero(self.codes == at.RUNNING).tolist() if here["approach"] else ():
            record = self.into_worker(i).stepper.recording
            record.bound()
            guard.set_bounds(self.control["guard"], i, record.steps.guard["bound"])

    def into_worker(self, i: int) -> Worker:
        """Load instance i into the run of the first worker, and return that worker."""
        worker = self.workers[0]
        code, self.codes[i] = self.codes[i], at.RUNNING
        self._part(0, 0, i, i + 1)
        self.codes[i] = code
        worker.stepper.look_again()
        return worker


@cache
def pool(threads: int) -> ThreadPoolExecutor:
    """Create a thread pool kept between batches: starting one costs as much as a small batch."""
    return ThreadPoolExecutor(threads)


if hasattr(os, "register_at_fork"):  # threads do not live on in a forked child
    os.register_at_fork(after_in_child=pool.cache_clear)


def _copied(*given: Any) -> None:
    """Call C's memmove for kernels that run as Python, which may pass NumPy numbers."""
    ctypes.memmove(*map(int, given))


COPY = address_of_function(ctypes.memmove if JIT else _copied)


def fits_lanes(stepper: Stepper, varying: Ints) -> bool:
    """Return True for trees that only differ in their bodies and have no servos with limits."""
    scene = stepper.recording.scene
    branches = len(scene.active) > 1 or scene.touching is not None or scene.user is not None
    branches |= len(scene.loads.signals[0]) > 0
    bounded = any(
        np.isfinite(row["low"]) or np.isfinite(row["high"]) or row["terms"]
        for row in _servo_rows(stepper).values()
    )
    if not (JIT and stepper.recording.plan.method.plain) or bounded or branches:
        return False
    _, places = _const_places(stepper)
    always = sum(a.size for a in stepper.recording.steps.given)
    return bool(np.isin(varying[varying >= always], places).all())


def _servo_rows(stepper: Stepper) -> dict[str, Any]:
    """Return {name: row in the drive table} for the servos with an adjustable target."""
    drives = stepper.recording.plan.drives
    rows = {int(row["first_target"]): row for row in drives.table[drives.passive :]}
    return {name: rows[knot] for name, knot in stepper.servos.items()}


def _const_places(stepper: Stepper) -> tuple[int, Ints]:
    """Return (first word of the kernel constants in a row of numbers, all body words)."""
    scene, first, starts, found = stepper.recording.scene, 0, [], []
    const, bodies = scene.packed.const, scene.packed.system.bodies_f
    for a in number_arrays(stepper):
        words = a.nbytes // WORD
        if a.shape == const.shape and np.shares_memory(a, const):
            starts.append(first)
        if a is bodies or starts[-1:] == [first]:
            found.append(np.arange(first, first + words))
        first += words
    return starts[0], np.concatenate(found)


class TreeLanes(Instances):
    """Instances stepped in lanes, equal to their own runs up to rounding."""

    def prepare(self, varying: Ints) -> None:
        """Store the positions of the body constants in the table of numbers."""
        stepper = self.workers[0].stepper
        first, _ = _const_places(stepper)
        const = stepper.recording.scene.packed.const
        inside = (varying >= first) & (varying < first + const.size)
        self._columns, self._words = np.flatnonzero(inside), varying[inside] - first
        self._const: tuple[Ints, Array] | None = None
        self._shared = const.copy()
        rows = stepper.mech.packed.rows[1:]
        self._angles = rows[facts("angle")[rows[:, at.KIND]], at.QI]
        plan = stepper.recording.plan
        self._timed = len(plan.drives.table) > plan.drives.passive or plan.loads.wrench[1].size > 0
        self._corners, lags = plan.corners, plan.drives.table["lag"]
        self._cut = bool(np.any((lags > 0.0) & (lags < 2.0 * (plan.step or 0.0))))

    def step(self, n: int) -> None:
        """Take n steps of all running instances with the `given` torques."""
        self.in_parts(n, self._take)

    def _take(self, n: int) -> None:
        for i in self._in_lanes(n, None).tolist():
            clock.forget_slopes(self.control["clock"], i)
            self._part(n, 0, i, i + 1)

    def trace(self, n: int) -> Array:
        """Compute `Instances.trace` in a single call."""
        states = np.empty((n, len(self.codes), self.q.shape[1] + self.v.shape[1]))
        states[:] = np.concatenate((self.q, self.v), axis=1)
        for i in self._in_lanes(n, states).tolist():
            for state in states:
                clock.forget_slopes(self.control["clock"], i)
                self._part(1, 0, i, i + 1)
                state[i] = np.concatenate((self.q[i], self.v[i]))
        return states

    def _in_lanes(self, n: int, states: Array | None) -> Ints:
        """Take n steps in lanes and store them in `states`. Return the instances without a fit."""
        running = np.flatnonzero(self.codes == at.RUNNING)
        late = max(self._corners[-1:].tolist(), default=-np.inf)
        if self._cut or (self.control["clock"]["time"][running] < late).any():
            return running  # lanes take whole steps, and tables or lags end some
        left = [self._advance(which, n, states) for which in self._at_one_time(running)]
        return np.concatenate((running[:0], *left))

    def _fit(self, q: Array, v: Array) -> NDArray[np.bool_]:
        """Return a mask of the states that lanes accept: finite, with angles within FAR."""
        width = float(self.control["error"]["widest"][0])
        if abs(q).max(initial=0.0) < FAR and abs(v).max(initial=0.0) * width < FAR:
            return np.ones(len(q), dtype=bool)
        far = np.any(~(abs(q[:, self._angles]) < FAR), axis=1)  # also of nan
        far |= np.any(~(abs(v * width) < FAR), axis=1)
        return ~(far | np.any(~np.isfinite(q), axis=1))

    def _advance(self, which: Ints, n: int, states: Array | None) -> Ints:
        """Take n steps in lanes and store them in `states`. Return the instances to run alone."""
        plan, control = self.workers[0].stepper.recording.plan, self.control
        # of the dissipation nobody asks
        works = self._timed or self.given[which].any()
        parts = self.q, self.v, self.ledger if works else self.ledger[:, :0]
        method, size = plan.method, sum(x.shape[1] for x in parts)
        *state, given = map(to_lanes, (*(x[which] for x in parts), self._pushed(which)))
        first, width = which[0], float(control["error"]["widest"][0])
        times = [float(control["clock"]["time"][first])]
        if states is not None:  # those of one step after the other
            taken = control["ends"]["taken"][first] + np.arange(n)
            times += (control["ends"]["origin"][first] + taken * width).tolist()[1:]
        acts = (*self._acts(which, plan.drives, plan.loads), method.tableau[:3])
        stages = at.STAGE + method.evaluations, size, LANE_WIDTH

        def work(t: float, begin: int, end: int, space: Array) -> None:
            room, count = np.zeros(stages), n // len(times)
            kernels.run_in_lanes(*acts, t, width, count, *state, given, space, room, begin, end)

        for k, t in enumerate(times):
            self._in_blocks(partial(work, t), len(given))
            if states is not None:
                parted = [from_lanes(x, len(which)) for x in state[:2]]
                states[k, which] = np.concatenate(parted, axis=1)
        new = [from_lanes(x, len(which)) for x in state]
        good = self._fit(*new[:2]) & np.isfinite(new[2]).all(axis=1)
        good &= self._fit(self.q[which], self.v[which])
        taken = which[good]
        for own, found in zip(parts, new):
            own[taken] = found[good]
        ends.add_steps(control["ends"], taken, n)
        now = control["ends"]["origin"] + control["ends"]["taken"] * control["error"]["widest"]
        clock.set_times(control["clock"], taken, now[taken])
        return which[~good]

    def accelerations(self) -> Array:
        """Return v' (m, nv) at the states, with all forces."""
        found, fit = np.empty(self.v.shape), self._fit(self.q, self.v)
        for which in self._at_one_time(np.flatnonzero(fit)):
            found[which] = self._accelerations(which)
        for i in np.flatnonzero(~fit).tolist():
            found[i] = self.into_worker(i).vdot()
        return found

    def _accelerations(self, which: Ints) -> Array:
        plan = self.workers[0].stepper.recording.plan
        q, v, given = map(to_lanes, (self.q[which], self.v[which], self._pushed(which)))
        out, t = np.empty_like(v), float(self.control["clock"]["time"][which[0]])
        acts = self._acts(which, plan.drives, plan.loads)

        def work(begin: int, end: int, space: Array) -> None:
            tau = np.empty_like(v[0])
            kernels.forward_in_lanes(*acts, t, q, v, given, space, tau, out, begin, end)

        self._in_blocks(work, len(q))
        return from_lanes(out, len(which))

    def torques(self, vdot: Array) -> Array:
        """Return the τ (m, nv) that produces v' (m, nv) in addition to passive forces."""
        packed = self.workers[0].stepper.mech.packed
        q, v, rates = (to_lanes(x) for x in (self.q, self.v, vdot))
        acts = self._acts(np.arange(len(self.kind)), packed.passive, packed.passive_loads)
        out, none = np.empty_like(v), np.zeros((0, LANE_WIDTH))

        def work(begin: int, end: int, space: Array) -> None:
            passive = np.empty_like(v[0])
            kernels.inverse_in_lanes(*acts, q, v, rates, space, passive, none, out, begin, end)

        self._in_blocks(work, len(q))
        found = from_lanes(out, len(self.kind))
        for i in np.flatnonzero(~self._fit(self.q, self.v)).tolist():
            mech = self.into_worker(i).stepper.mech
            found[i] = mech.inverse_dynamics(self.q[i], self.v[i], vdot[i])
        return found

    def _pushed(self, which: Ints) -> Array:
        """Return the given torques (m, nv), corrected for the different targets of servos."""
        given, stepper = self.given[which], self.workers[0].stepper
        for name, row in _servo_rows(stepper).items():
            target = stepper.recording.plan.drives.knots[row["first_target"], 1]
            given[:, row["velocity"]] += row["stiffness"] * (self.targets[name][which] - target)
        return given

    def _at_one_time(self, which: Ints) -> Iterator[Ints]:
        """Yield the instances in groups with equal time if the forces depend on time."""
        times = self.control["clock"]["time"][which] if self._timed else np.zeros(len(which))
        for t in np.unique(times):
            yield which[times == t]

    def _acts(self, which: Ints, drives: Any, loads: Loads) -> tuple[Any, ...]:
        """Return rows, constants, drives and loads of the instances in the layout used by lane
        kernels.

        If there are no loads, the kernels for loads are not compiled.
        """
        some = unnamed(loads) if loads.number else None
        rows = self.workers[0].stepper.mech.packed.rows
        return rows, self._constants(self.kind[which]), unnamed(drives), some

    def _constants(self, kind: Ints) -> Array:
        """Return the constants: one set for all instances, or one set for each instance, as
        (blocks, rows, columns, W)."""
        if not len(self._columns):
            return self._shared
        if self._const is None or not np.array_equal(self._const[0], kind):
            each = np.repeat(self._shared.reshape(1, -1), len(self.numbers), axis=0)
            each[:, self._words] = self.numbers[:, self._columns].view(np.float64)
            self._const = kind, to_lanes(each[kind].reshape(-1, *self._shared.shape))
        return self._const[1]

    def _in_blocks(self, work: Callable[[int, int, Array], None], count: int) -> None:
        """Run `work(begin, end, workspace)` on `count` lane blocks across the threads."""
        packed, plan = self.workers[0].stepper.mech.packed, self.workers[0].stepper.recording.plan
        rows = max(len(packed.rows), packed.passive_loads.rows, plan.loads.rows)
        shape = rows, at.WORK, LANE_WIDTH
        self.spread(lambda _, begin, end: work(begin, end, np.zeros(shape)), count)


def to_lanes(array: Array) -> Array:
    """Reshape (m, ...) to (blocks, ..., W), repeating the last instance as padding."""
    blocks = -(-len(array) // LANE_WIDTH)
    missing = blocks * LANE_WIDTH - len(array)
    if missing:
        array = np.concatenate((array, *[array[-1:]] * missing))
    shaped = array.reshape(blocks, LANE_WIDTH, *array.shape[1:])
    return shaped.transpose(0, *range(2, shaped.ndim), 1).copy()


def from_lanes(blocks: Array, size: int) -> Array:
    """Reshape (blocks, ..., W) to (size, ...)."""
    moved = blocks.transpose(0, blocks.ndim - 1, *range(1, blocks.ndim - 1))  # moveaxis is slow
    return moved.reshape(len(blocks) * LANE_WIDTH, *moved.shape[2:])[:size].copy()
