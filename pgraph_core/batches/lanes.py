"""Free trees side by side in SIMD lanes: the steps of `Instances` where no instance branches."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from typing import Any

import numpy as np

from ..engine import layout as at
from ..engine.compiler.address import unnamed
from ..engine.compiler.lane import LANE_WIDTH
from ..engine.stepping import batch as kernels
from ..packing.system import Array, Ints, Loads
from ..simulation.stepper import Stepper
from .instances import Instances, number_arrays

METHODS = ("rk4", "semi_implicit_euler")


def fits_lanes(stepper: Stepper, varying: Ints) -> bool:
    """Whether these are trees that differ in bodies alone, without servos and functions."""
    scene = stepper.recording.scene
    branches = len(scene.active) > 1 or scene.touching is not None or scene.user is not None
    if stepper.method not in METHODS or stepper.servos or branches:
        return False
    _, places = _const_places(stepper)
    always = sum(a.size for a in stepper.recording.steps.given)
    return bool(np.isin(varying[varying >= always], places).all())


def _const_places(stepper: Stepper) -> tuple[int, Ints]:
    """(first word of the kernels' constants in a row of numbers, all words of constants)."""
    scene, first, found = stepper.recording.scene, 0, []
    const = scene.packed.const
    for a in number_arrays(stepper):
        if a.shape == const.shape and np.shares_memory(a, const):
            found.append(first)
        first += a.nbytes // 8
    return found[0], np.concatenate([np.arange(n, n + const.size) for n in found])


class TreeLanes(Instances):
    """Instances whose steps are taken in lanes, equal to their own to rounding."""

    def prepare(self, varying: Ints) -> None:
        """Keep where the table of numbers has the constants of bodies."""
        stepper = self.workers[0].stepper
        first, _ = _const_places(stepper)
        const = stepper.recording.scene.packed.const
        inside = (varying >= first) & (varying < first + const.size)
        self._columns, self._words = np.flatnonzero(inside), varying[inside] - first
        self._const: tuple[Ints, Array] | None = None
        self._shared = const.copy()
        plan = stepper.recording.plan
        self._timed = len(plan.drives.table) > plan.drives.passive or len(plan.loads.knots) > 0

    def step(self, n: int) -> None:
        """n steps of all instances that run; `given` acts."""
        for which in self._at_one_time(np.flatnonzero(self.codes == at.RUNNING)):
            self._advance(which, n)

    def _advance(self, which: Ints, n: int) -> None:
        plan, control = self.workers[0].stepper.recording.plan, self.control
        # of the dissipation nobody asks
        works = self._timed or self.given[which].any()
        parts = self.q, self.v, self.ledger if works else self.ledger[:, :0]
        method, size = plan.method, sum(x.shape[1] for x in parts)
        *state, given = (to_lanes(x[which]) for x in (*parts, self.given))
        clock = float(control["time"][which[0]]), float(control["widest"][0]), n
        acts = (*self._acts(which, plan.drives, plan.loads), method.tableau[:3], *clock)

        def work(begin: int, end: int, space: Array) -> None:
            stages = np.zeros((at.STAGE + method.evaluations, size, LANE_WIDTH))
            kernels.run(*acts, *state, given, space, stages, begin, end)

        self._in_blocks(work, len(given))
        new = [from_lanes(x, len(which)) for x in state]
        good = np.isfinite(np.concatenate(new, axis=1)).all(axis=1)
        taken, lost = which[good], which[~good]
        for own, found in zip(parts, new):
            own[taken] = found[good]
        control["taken"][taken] += n
        now = control["origin"] + control["taken"] * control["widest"]
        control["time"][taken] = now[taken]
        control["failed"][lost], control["fastest"][lost] = control["time"][lost], 1
        self.codes[lost] = at.NOT_FINITE

    def accelerations(self) -> Array:
        """v' (m, nv) at the states, with all forces."""
        found = np.empty(self.v.shape)
        for which in self._at_one_time(np.arange(len(self.kind))):
            found[which] = self._accelerations(which)
        return found

    def _accelerations(self, which: Ints) -> Array:
        plan = self.workers[0].stepper.recording.plan
        q, v, given = (to_lanes(x[which]) for x in (self.q, self.v, self.given))
        out, t = np.empty_like(v), float(self.control["time"][which[0]])
        acts = self._acts(which, plan.drives, plan.loads)

        def work(begin: int, end: int, space: Array) -> None:
            tau = np.empty_like(v[0])
            kernels.forward_dynamics(*acts, t, q, v, given, space, tau, out, begin, end)

        self._in_blocks(work, len(q))
        return from_lanes(out, len(which))

    def torques(self, vdot: Array) -> Array:
        """τ (m, nv) that gives v' (m, nv) at the states, in addition to passive forces."""
        packed = self.workers[0].stepper.mech.packed
        q, v, rates = (to_lanes(x) for x in (self.q, self.v, vdot))
        acts = self._acts(np.arange(len(self.kind)), packed.passive, packed.passive_loads)
        out, none = np.empty_like(v), np.zeros((0, LANE_WIDTH))

        def work(begin: int, end: int, space: Array) -> None:
            passive = np.empty_like(v[0])
            kernels.inverse_dynamics(*acts, q, v, rates, space, passive, none, out, begin, end)

        self._in_blocks(work, len(q))
        return from_lanes(out, len(self.kind))

    def _at_one_time(self, which: Ints) -> Iterator[Ints]:
        """The instances in groups of one time, where forces depend on it."""
        times = self.control["time"][which] if self._timed else np.zeros(len(which))
        for t in np.unique(times):
            yield which[times == t]

    def _acts(self, which: Ints, drives: Any, loads: Loads) -> tuple[Any, ...]:
        """Rows, constants, drives and loads of instances, as kernels of lanes take them.

        Where there are no loads, nothing of them is compiled.
        """
        some = unnamed(loads) if len(loads.table) else None
        rows = self.workers[0].stepper.mech.packed.rows
        return rows, self._constants(self.kind[which]), unnamed(drives), some

    def _constants(self, kind: Ints) -> Array:
        """Shared by all, or (blocks, rows, columns, W) of each."""
        if not len(self._columns):
            return self._shared
        if self._const is None or not np.array_equal(self._const[0], kind):
            each = np.repeat(self._shared.reshape(1, -1), len(self.numbers), axis=0)
            each[:, self._words] = self.numbers[:, self._columns].view(np.float64)
            self._const = kind, to_lanes(each[kind].reshape(-1, *self._shared.shape))
        return self._const[1]

    def _in_blocks(self, work: Callable[[int, int, Array], None], count: int) -> None:
        """`work(begin, end, workspace)` of `count` blocks of lanes over the threads."""
        shape = len(self.workers[0].stepper.mech.packed.rows), at.WORK, LANE_WIDTH
        self.spread(lambda _, begin, end: work(begin, end, np.zeros(shape)), count)


def to_lanes(array: Array) -> Array:
    """(m, ...) as (blocks, ..., W), the last instance repeated."""
    blocks = -(-len(array) // LANE_WIDTH)
    missing = blocks * LANE_WIDTH - len(array)
    padded = np.concatenate((array, np.repeat(array[-1:], missing, axis=0)))
    shaped = padded.reshape(blocks, LANE_WIDTH, *array.shape[1:])
    return np.ascontiguousarray(np.moveaxis(shaped, 1, -1))


def from_lanes(blocks: Array, size: int) -> Array:
    """(blocks, ..., W) as (size, ...)."""
    moved = np.moveaxis(blocks, -1, 1)
    return moved.reshape(len(blocks) * LANE_WIDTH, *moved.shape[2:])[:size].copy()
