"""Batch: many instances of one mechanism at once, over SIMD lanes and cores.

Same kernel source as a single mechanism; compiled for lanes when a batch is first asked for.
"""

from __future__ import annotations

import os
from collections.abc import Callable, Sequence
from concurrent.futures import ThreadPoolExecutor
from functools import cache
from itertools import pairwise
from typing import Any

import numpy as np

from ..engine import layout as at
from ..engine.compiler.address import unnamed
from ..engine.compiler.lane import LANE_WIDTH
from ..engine.stepping import batch as kernels
from ..errors import InputError, Problem, choices, explained
from ..model import Model
from ..packing.system import Array, Loads
from ..portable import Portable
from .arguments import finite, wrong_type
from .dynamics import Dynamics


@explained
class Batch(Portable):
    """m instances of a mechanism: same tree and joints, own states and, if given, own numbers.

    `models` gives each instance its own masses, lengths, ...; without it all share those of
    `mech`; forces are those of `mech` in any case. `threads` is how many cores work (all by
    default). Instances are trees: a model whose constraints, contacts or joint limits act needs
    `constraints="ignore"`, which leaves them out.
    """

    def __init__(
        self,
        mech: Dynamics | Model,
        size: int | None = None,
        *,
        models: Sequence[Model] | None = None,
        threads: int | None = None,
        constraints: str | None = None,
    ):
        """Raises InputError where the models are not of one kind, or are more than trees."""
        mech = Dynamics(mech) if isinstance(mech, Model) else mech
        if not isinstance(mech, Dynamics):
            raise wrong_type("batch", "mech", "a pg.Mechanism or a pg.Model", mech)
        _as_trees(mech, constraints)
        self.mech = mech
        self.models = None if models is None else [type(mech)(m) for m in models]
        self.size = _size(size, self.models)
        self.threads = os.cpu_count() or 1 if threads is None else threads
        self.blocks = -(-self.size // LANE_WIDTH)
        self.const = self._constants()

    def forward_dynamics(self, q: Any, v: Any, tau: Any = None) -> Array:
        """v' (m, nv) of the trees, eq. (26), for q (m, nq), v and tau (m, nv)."""
        mech, packed = self.mech, self.mech.packed
        arrays = (self.lanes("q", q, mech.nq), self.lanes("v", v, mech.nv))
        given, loads = self.given(tau), some(packed.passive_loads)
        drives = unnamed(packed.passive)
        out = np.empty_like(given)

        def work(begin: int, end: int, space: Array) -> None:
            kernels.forward_dynamics(
                packed.rows, self.const, drives, loads, *arrays, given, space,
                np.empty_like(given[0]), out, begin, end,
            )  # fmt: skip

        self.spread(work)
        return self.rows(out)

    def inverse_dynamics(self, q: Any, v: Any, vdot: Any) -> Array:
        """τ (m, nv) that gives v' (m, nv), eq. (24), in addition to joint springs and dampers."""
        mech, packed = self.mech, self.mech.packed
        state = (self.lanes("q", q, mech.nq), self.lanes("v", v, mech.nv))
        rates, loads = self.lanes("vdot", vdot, mech.nv), some(packed.passive_loads)
        drives = unnamed(packed.passive)
        out = np.empty_like(rates)

        def work(begin: int, end: int, space: Array) -> None:
            kernels.inverse_dynamics(
                packed.rows, self.const, drives, loads, *state, rates, space,
                np.empty_like(out[0]), np.zeros_like(out[0][:0]), out, begin, end,
            )  # fmt: skip

        self.spread(work)
        return self.rows(out)

    def _constants(self) -> Array:
        """The shared constants, or every block's own as lanes."""
        if self.models is None:
            return self.mech.packed.system.const
        rows = self.mech.packed.system.rows
        for i, other in enumerate(self.models):
            if not np.array_equal(other.packed.system.rows, rows):
                text = "has another tree or other joints than the mechanism; give models like it"
                raise InputError(Problem(f"models[{i}]", "", text))
            mine, its = (
                (*m.packed.drives(m.model.forces), *m.packed.loads(m.model.forces))
                for m in (self.mech, other)
            )
            if not all(map(np.array_equal, mine, its)):
                text = "has other springs, motors or forces than the mechanism; those are shared"
                raise InputError(Problem(f"models[{i}]", "", text))
        stacked = np.stack([m.packed.system.const for m in self.models])
        return to_lanes(stacked, self.blocks)

    def given(self, tau: Any) -> Array:
        if tau is None:
            return np.zeros((self.blocks, self.mech.nv, LANE_WIDTH))
        return self.lanes("tau", tau, self.mech.nv)

    def lanes(self, name: str, value: Any, n: int) -> Array:
        """(m, n) as (blocks, n, W); places beyond m repeat the last instance."""
        array = finite(name, value, self.size, n)
        return to_lanes(array, self.blocks)

    def rows(self, blocks: Array) -> Array:
        """(blocks, ..., W) as (m, ...)."""
        return from_lanes(blocks, self.size)

    def spread(self, work: Callable[[int, int, Array], None]) -> None:
        """Run `work(begin, end, workspace)` over all blocks on `threads` cores."""
        parts = min(self.threads, self.blocks)
        edges = np.linspace(0, self.blocks, parts + 1).astype(int).tolist()
        shape = (len(self.mech.packed.system.rows), at.WORK, LANE_WIDTH)

        def part(begin: int, end: int) -> None:
            work(begin, end, np.zeros(shape))

        if parts <= 1:
            part(0, self.blocks)
            return
        for done in [pool(parts).submit(part, *edge) for edge in pairwise(edges)]:
            done.result()


def some(loads: Loads) -> tuple[Any, ...] | None:
    """Loads on bodies as kernels of lanes take them: without any, nothing of them is compiled."""
    return unnamed(loads) if len(loads.table) else None


def _as_trees(mech: Dynamics, constraints: str | None) -> None:
    """Raises InputError where something acts that a batch leaves out, and nobody said so."""
    if constraints not in (None, "ignore"):
        text = f"is {constraints!r:.60}; choose one of {choices(('ignore',))}, or leave it out"
        raise InputError(Problem("batch", "constraints", text))
    if constraints is None and (acting := _acting(mech.model)):
        text = f"a batch is made of trees, but the model has {acting}; give constraints='ignore'"
        text += " to run without, or use simulate for one instance at a time"
        raise InputError(Problem("batch", "constraints", text))


def _acting(model: Model) -> str:
    """The first thing of a model that couples its tree, in words; "" for a tree."""
    kinds = (("constraint", model.constraints), ("contact", model.contacts))
    found = [f"the {kind} '{x.name}'" for kind, group in kinds for x in group if x.active]
    found += [f"limits of the joint of '{b.name}'" for b in model.bodies if any(b.limits)]
    return found[0] if found else ""


@cache
def pool(threads: int) -> ThreadPoolExecutor:
    """Threads kept between batches: starting them costs as much as a small one."""
    return ThreadPoolExecutor(threads)


def _size(size: int | None, models: Sequence[Dynamics] | None) -> int:
    if models is not None and size is not None and size != len(models):
        raise InputError(Problem("batch", "size", f"is {size}, but {len(models)} models are given"))
    size = len(models) if models is not None else size
    if size is None or size < 1:
        raise InputError(Problem("batch", "size", f"must be a whole number >= 1; given {size}"))
    return int(size)


def to_lanes(array: Array, blocks: int) -> Array:
    """(m, ...) as (blocks, ..., W), the last instance repeated."""
    missing = blocks * LANE_WIDTH - len(array)
    padded = np.concatenate((array, np.repeat(array[-1:], missing, axis=0)))
    shaped = padded.reshape(blocks, LANE_WIDTH, *array.shape[1:])
    return np.ascontiguousarray(np.moveaxis(shaped, 1, -1))


def from_lanes(blocks: Array, size: int) -> Array:
    """(blocks, ..., W) as (size, ...)."""
    moved = np.moveaxis(blocks, -1, 1)
    return moved.reshape(-1, *moved.shape[2:])[:size].copy()
