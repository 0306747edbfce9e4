"""Free trees side by side in SIMD lanes: the steps of `Instances` where no instance branches."""

from __future__ import annotations

from typing import Any

import numpy as np

from ..dynamics.batch import from_lanes, some, to_lanes
from ..engine import layout as at
from ..engine.compiler.address import unnamed
from ..engine.compiler.lane import LANE_WIDTH
from ..engine.stepping import batch as kernels
from ..packing.system import Array, Ints
from ..simulation.stepper import Stepper
from .instances import Instances, number_arrays

METHODS = ("rk4", "semi_implicit_euler")


def fits_lanes(stepper: Stepper, varying: Ints) -> bool:
    """Whether these are trees of springs, dampers and given torques that differ in bodies alone."""
    record = stepper.recording
    scene, plan = record.scene, record.plan
    tables = len(plan.drives.table) > plan.drives.passive or len(plan.loads.knots) > 0
    branches = len(scene.active) > 1 or scene.touching is not None or record.user is not None
    if stepper.method not in METHODS or tables or branches:
        return False
    _, places = _const_places(stepper)
    always = sum(a.size for a in record.steps.given)
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

    def _constants(self) -> Array:
        """Shared by all, or (blocks, rows, columns, W) of each."""
        if not len(self._columns):
            return self._shared
        if self._const is None or not np.array_equal(self._const[0], self.kind):
            each = np.repeat(self._shared.reshape(1, -1), len(self.numbers), axis=0)
            each[:, self._words] = self.numbers[:, self._columns].view(np.float64)
            own = each[self.kind].reshape(-1, *self._shared.shape)
            self._const = self.kind.copy(), to_lanes(own, -(-len(self.kind) // LANE_WIDTH))
        return self._const[1]

    def step(self, n: int) -> None:
        """n steps of all instances that run; `given` acts."""
        stepper, blocks = self.workers[0].stepper, -(-len(self.kind) // LANE_WIDTH)
        record = stepper.recording
        plan, packed = record.plan, record.scene.packed
        nq, nv = packed.nq, packed.nv
        method = plan.method
        width = float(self.control["widest"][0])
        q, v, given = (to_lanes(x, blocks) for x in (self.q, self.v, self.given))
        out = tuple(np.empty((blocks, 2, k, LANE_WIDTH)) for k in (nq, nv))
        system: tuple[Any, ...] = (
            packed.rows, self._constants(), unnamed(plan.drives), some(plan.loads),
            method.tableau[:3], np.array([0.0, n * width]), np.array([n]), np.array([width]),
        )  # fmt: skip

        def work(_: int, begin: int, end: int) -> None:
            stages = np.zeros((at.STAGE + method.evaluations, nq + nv, LANE_WIDTH))
            space = np.zeros((len(packed.rows), at.WORK, LANE_WIDTH))
            kernels.run(*system, q, v, given, space, stages, out, 0, 2, begin, end)

        self.spread(work, blocks)
        new_q, new_v = (from_lanes(x, len(self.kind)) for x in (q, v))
        good = np.isfinite(new_q).all(axis=1) & np.isfinite(new_v).all(axis=1)
        runs = self.codes == at.RUNNING
        taken, control = runs & good, self.control
        self.q[taken], self.v[taken] = new_q[taken], new_v[taken]
        control["taken"][taken] += n
        control["time"][taken] = (control["origin"] + control["taken"] * control["widest"])[taken]
        control["failed"][runs & ~good] = control["time"][runs & ~good]
        control["fastest"][runs & ~good] = 1
        self.codes[runs & ~good] = at.NOT_FINITE
