"""Trees and loops held by constraints, advanced by explicit steps side by side in lanes."""

from __future__ import annotations

from functools import partial

import numpy as np

from ..engine import layout as at
from ..engine.compiler.address import address_of
from ..engine.compiler.jit import JIT, ready
from ..engine.compiler.lane import LANE_WIDTH
from ..engine.lockstep import block as columns
from ..engine.lockstep import loops as kernels
from ..engine.stepping import run
from ..packing import Array, Ints
from ..simulation.stepper import Stepper
from .feet import FeetLanes, drives_of
from .instances import COPY, IN_LANES, WORD, Instances, number_arrays

GAINS = ("stiffness", "damping", "low", "high", "friction")  # fields of a drive that lanes vary
TIMES = 0  # column of knots
NO_TRACE = np.zeros((0, 0, 0))


def on_constraints(stepper: Stepper, varying: Ints) -> bool:
    """Return True for constrained instances whose explicit steps can be taken in lanes.

    `varying` are the places, in words, of the numbers that differ between instances.
    """
    record = stepper.recording
    scene, steps = record.scene, record.steps
    drives = scene.drives.table
    acts = scene.touching is not None or scene.user is not None or scene.loads.number
    follows = drives["terms"].any() or drives["lag"].any() or drives["integrates"].any()
    if not JIT or stepper.method not in IN_LANES or not scene.active[0] or acts or follows:
        return False
    if scene.gains.any() or not steps.control["project"] or steps.control["guard"]:
        return False
    free = [scene.packed.const, *scene.packed.system[2:4], *steps.given]
    first = 0
    for a in number_arrays(stepper):
        mine = varying[(varying >= first) & (varying < first + a.nbytes // WORD)] - first
        first += a.nbytes // WORD
        if not len(mine) or any(a is one or np.shares_memory(a, one) for one in free):
            continue
        if a is drives:
            places = [drives.dtype.fields[name][1] // WORD for name in GAINS]
            fine = np.isin(mine % (drives.itemsize // WORD), places).all()
        else:
            fine = a is scene.drives.knots and (mine % a.shape[1] != TIMES).all()
        if not fine:
            return False
    return True


class LoopLanes(FeetLanes):
    """Constrained instances side by side in lanes, bitwise identical to separate runs."""

    def prepare(self) -> None:
        """Allocate one block per worker."""
        stepper = self.workers[0].stepper
        self._drives = drives_of(stepper)
        a, b, c = stepper.recording.plan.method.tableau[:3]
        self._tableau = np.ascontiguousarray(a), b, c
        self._room = [_room(worker.stepper) for worker in self.workers]
        ready(kernels.step_loops)

    def trace(self, n: int) -> Array:
        """Compute `Instances.trace` in a single call."""
        states = np.full((n, len(self.codes), self.q.shape[1] + self.v.shape[1]), np.nan)
        self.control["fresh"][self.codes == at.RUNNING] = 0
        self.spread(partial(self._in_lanes, n, states), len(self.codes))
        return states

    def _part(self, n: int, number: int, *span: int) -> None:
        if n == 0:
            Instances._part(self, n, number, *span)
        else:
            self._in_lanes(n, NO_TRACE, number, *span)

    def _in_lanes(self, n: int, states: Array, number: int, *span: int) -> None:
        worker = self.workers[number]
        held, state = self._room[number]
        kernels.step_loops(
            worker.run, address_of(run.advance_run), COPY, worker.own, worker.numbers,
            self._drives, held, self._tableau, state, self._tables(), self.kind, self.codes,
            states, n, *span,
        )  # fmt: skip


def _room(stepper: Stepper) -> tuple[tuple[Array, ...], Ints]:
    """Return (block arrays, lane continuation) as buffers for one worker."""
    scene, steps = stepper.recording.scene, stepper.recording.steps
    space, drives = scene.space, scene.drives
    wide = max(len(steps.q), len(steps.v))
    shapes = (
        scene.packed.const.shape, scene.work.shape, (columns.VECTORS, wide),
        (len(drives.table), columns.DRIVE), drives.knots.shape, steps.stages.shape,
        (1, columns.LANE), scene.blocks.blocks_f.shape, space.y.shape, space.omega.shape,
        space.factor.shape, space.place.shape, space.vectors.shape, space.linear.shape,
        space.carried.shape, space.nulls.shape, (2, len(space.omega)), (4, 1),
        (3, wide),
    )  # fmt: skip
    held = tuple(np.zeros((*shape, LANE_WIDTH)) for shape in shapes)
    return held, np.zeros((2, LANE_WIDTH), dtype=np.int64)
