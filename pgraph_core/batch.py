"""Batch: many instances of one mechanism at once, over SIMD lanes and cores.

Same kernel source as a single mechanism; compiled for lanes when a batch is first asked for.
"""

from __future__ import annotations

import os
from collections.abc import Callable, Sequence
from concurrent.futures import ThreadPoolExecutor
from itertools import pairwise
from typing import Any, NamedTuple

import numpy as np

from .errors import InputError, Problem
from .integrators import method_of
from .kernels import batch as kernels
from .kernels import layout as at
from .kernels.lane import LANE_WIDTH
from .mechanism import Mechanism
from .schema import Model
from .simulation import schedule
from .system import Array


class BatchResult(NamedTuple):
    """States of all instances over time; an instance that stopped being finite holds nan."""

    t: Array  # (frames,) [s]
    q: Array  # (m, frames, nq)
    v: Array  # (m, frames, nv)
    finite: Any  # (m,) bool


class Batch:
    """m instances of a mechanism: same tree and joints, own states and, if given, own numbers.

    `models` gives each instance its own masses, lengths, ...; without it all share those of
    `mech`. `threads` is how many cores work (all by default). Constraints are not imposed.
    """

    def __init__(
        self,
        mech: Mechanism,
        size: int | None = None,
        *,
        models: Sequence[Model] | None = None,
        threads: int | None = None,
    ):
        """Raises InputError where the models are not of one kind."""
        self.mech = mech
        self.models = None if models is None else [Mechanism(m) for m in models]
        self.size = _size(size, self.models)
        self.threads = os.cpu_count() or 1 if threads is None else threads
        self.blocks = -(-self.size // LANE_WIDTH)
        self._const = self._constants()

    def forward_dynamics(self, q: Any, v: Any, tau: Any = None) -> Array:
        """v' (m, nv) of the trees, eq. (26), for q (m, nq), v and tau (m, nv)."""
        mech = self.mech
        arrays = (self._lanes("q", q, mech.nq), self._lanes("v", v, mech.nv))
        given = self._given(tau)
        out = np.empty_like(given)

        def work(begin: int, end: int, space: Array) -> None:
            kernels.forward_dynamics(
                mech.system.rows, self._const, *arrays, given, space, out, begin, end
            )

        self._spread(work)
        return self._rows(out)

    def inverse_dynamics(self, q: Any, v: Any, vdot: Any) -> Array:
        """τ (m, nv) that gives v' (m, nv), eq. (24)."""
        mech = self.mech
        state = (self._lanes("q", q, mech.nq), self._lanes("v", v, mech.nv))
        rates = self._lanes("vdot", vdot, mech.nv)
        out = np.empty_like(rates)

        def work(begin: int, end: int, space: Array) -> None:
            kernels.inverse_dynamics(
                mech.system.rows, self._const, *state, rates, space, out, begin, end
            )

        self._spread(work)
        return self._rows(out)

    def simulate(
        self,
        q: Any,
        v: Any,
        *,
        t_end: float,
        step: float = 1e-3,
        method: str = "auto",
        tau: Any = None,
        frames: int | None = 2,
        t_eval: Any = None,
        progress: Callable[[float], Any] | None = None,
    ) -> BatchResult:
        """Run all instances from q (m, nq), v (m, nv) under constant tau (m, nv).

        Springs, dampers, motors and servos of the model act. Arguments as of `simulate`.
        """
        mech = self.mech
        chosen, _ = method_of(method)
        times, substeps, width = schedule(float(t_end), float(step), frames, t_eval)
        state = (self._lanes("q", q, mech.nq).copy(), self._lanes("v", v, mech.nv).copy())
        given = self._given(tau)
        shape = (self.blocks, len(times))
        out = tuple(np.empty((*shape, n, LANE_WIDTH)) for n in (mech.nq, mech.nv))
        tableau = (chosen.a, chosen.b, chosen.c)
        drives = mech.drives(mech.model.forces)
        rows = 3 + 2 * chosen.evaluations
        system = (mech.system.rows, self._const, drives, tableau, times, substeps, width)
        reached = 0
        for first, last in _chunks(substeps, len(times)):

            def work(begin: int, end: int, space: Array, span: Any = (first, last)) -> None:
                stages = np.zeros((rows, max(mech.nq, mech.nv), LANE_WIDTH))
                kernels.run(*system, *state, given, space, stages, out, *span, begin, end)

            self._spread(work)
            reached = last
            if progress is not None and progress(last / len(times)) is False:
                break
        qs, vs = (self._rows(x[:, :reached]) for x in out)
        return BatchResult(times[:reached], qs, vs, np.isfinite(vs[:, -1]).all(axis=1))

    def _constants(self) -> Array:
        """The shared constants, or every block's own as lanes."""
        if self.models is None:
            return self.mech.system.const
        rows = self.mech.system.rows
        for i, other in enumerate(self.models):
            if not np.array_equal(other.system.rows, rows):
                text = "has another tree or other joints than the mechanism; give models like it"
                raise InputError(Problem(f"models[{i}]", "", text))
        stacked = np.stack([m.system.const for m in self.models])
        return _to_lanes(stacked, self.blocks)

    def _given(self, tau: Any) -> Array:
        if tau is None:
            return np.zeros((self.blocks, self.mech.nv, LANE_WIDTH))
        return self._lanes("tau", tau, self.mech.nv)

    def _lanes(self, name: str, value: Any, n: int) -> Array:
        """(m, n) as (blocks, n, W); places beyond m repeat the last instance."""
        array = self.mech.finite(name, value, self.size, n)
        return _to_lanes(array, self.blocks)

    def _rows(self, blocks: Array) -> Array:
        """(blocks, ..., W) as (m, ...)."""
        moved = np.moveaxis(blocks, -1, 1)
        return moved.reshape(-1, *moved.shape[2:])[: self.size].copy()

    def _spread(self, work: Callable[[int, int, Array], None]) -> None:
        """Run `work(begin, end, workspace)` over all blocks on `threads` cores."""
        parts = min(self.threads, self.blocks)
        edges = np.linspace(0, self.blocks, parts + 1).astype(int).tolist()
        shape = (len(self.mech.system.rows), at.WORK, LANE_WIDTH)

        def part(begin: int, end: int) -> None:
            work(begin, end, np.zeros(shape))

        if parts <= 1:
            part(0, self.blocks)
            return
        with ThreadPoolExecutor(parts) as pool:
            for done in [pool.submit(part, *edge) for edge in pairwise(edges)]:
                done.result()


def _size(size: int | None, models: Sequence[Mechanism] | None) -> int:
    if models is not None and size is not None and size != len(models):
        raise InputError(Problem("batch", "size", f"is {size}, but {len(models)} models are given"))
    size = len(models) if models is not None else size
    if size is None or size < 1:
        raise InputError(Problem("batch", "size", f"must be a whole number >= 1; given {size}"))
    return int(size)


def _to_lanes(array: Array, blocks: int) -> Array:
    """(m, ...) as (blocks, ..., W), the last instance repeated."""
    missing = blocks * LANE_WIDTH - len(array)
    padded = np.concatenate((array, np.repeat(array[-1:], missing, axis=0)))
    shaped = padded.reshape(blocks, LANE_WIDTH, *array.shape[1:])
    return np.ascontiguousarray(np.moveaxis(shaped, 1, -1))


def _chunks(substeps: Any, frames: int, steps: int = 2000) -> list[tuple[int, int]]:
    """Frame ranges of about `steps` steps, between which progress is told."""
    taken = np.concatenate(([0], np.cumsum(substeps)))
    group = (taken // steps).astype(int)
    starts = np.flatnonzero(np.diff(group, prepend=-1)).tolist()
    return list(zip(starts, [*starts[1:], frames]))


def simulate_batch(
    mech: Mechanism,
    q: Any,
    v: Any,
    *,
    models: Sequence[Model] | None = None,
    threads: int | None = None,
    **options: Any,
) -> BatchResult:
    """`Batch(mech, ...).simulate(q, v, ...)` in one call."""
    return Batch(mech, len(q), models=models, threads=threads).simulate(q, v, **options)
