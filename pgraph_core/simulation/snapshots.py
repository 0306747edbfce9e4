"""Check the words of a snapshot before they are put into a run.

Kernels trust the tables of a run. A snapshot is data of unknown origin, whose digest anybody can
compute, so its words are checked against the structure of the mechanism that restores it: the
numbers of a state are finite, indices and counts lie within their tables, and integers that steps
never change are those of the mechanism. Numbers that steps start from (factors, impulses) may be
anything, because a step that fails leaves such behind.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable, Mapping
from dataclasses import dataclass, field
from typing import TYPE_CHECKING, Any

import numpy as np

from ..engine import layout as at
from ..engine.arrays import FACTORED
from ..engine.records import CONTACT_TALLY, COUNTERS
from ..engine.stepping import gauss
from ..errors import InputError, Problem
from ..tolerances import EPS
from .loop import UNCOUNTED

if TYPE_CHECKING:
    from .recording import Recording

MOST_COUNTED = int(2 / EPS)  # a count above it is not exact as a number
COUNT = (0, MOST_COUNTED)
ENDLESS = ("clip", "jacobian_rate", "jacobian_time", "clock")  # may be infinite or unknown
ADDRESSES = ("guard", "approach")  # addresses, of which this process keeps its own
COUNTS = ("crowded", "fallbacks", "calmed", "overflows", "cuts", "chains", "passed")


@dataclass(frozen=True, eq=False)
class Law:
    """The values that the words of one array may have."""

    array: Any  # array of the run, equal in all integers without a range
    ranges: Mapping[str, tuple[int, int]] = field(default_factory=dict)  # ranges of integer fields
    free: tuple[str, ...] = ()  # fields that are not checked
    finite: bool = True  # whether numbers are finite
    also: Callable[[Any], Any] | None = None  # whether further conditions hold

    def holds(self, found: Any, *, failed: bool = False) -> bool:
        """True if an array, or a stack of them, obeys the law, after a failed step if `failed`."""
        for name in found.dtype.names or ("",):
            x, own = (found[name], self.array[name]) if name else (found, self.array)
            if name in self.free:
                continue
            if x.dtype.kind == "f":
                fine = np.isfinite(x) | failed | (not self.finite)
            elif name in self.ranges:
                low, high = self.ranges[name]
                fine = (low <= x) & (x <= high)
            else:
                fine = x == own
            if not np.all(fine):
                return False
        return self.also is None or bool(np.all(self.also(found)))


def check(kind: str, laws: Iterable[Law], arrays: Iterable[Any], state: memoryview) -> None:
    """Check the bytes that are to be put into the arrays. Raises InputError."""
    place = 0
    for law, array in zip(laws, arrays, strict=True):
        found = np.frombuffer(state, array.dtype, array.size, place).reshape(array.shape)
        if not law.holds(found):
            refuse(kind)
        place += array.nbytes


def refuse(kind: str) -> None:
    """Raises InputError: a word has a value that no snapshot of this mechanism has."""
    text = "holds values that no state of this mechanism has: it was not written by save"
    raise InputError(Problem(f"{kind}.restore", "snapshot", text))


def laws_of(record: Recording, width: float, given: Any, arrays: Iterable[Any]) -> list[Law]:
    """Return the laws of arrays of a run with steps of `width` [s] and the knots `given`."""
    known = {id(law.array): law for law in reversed(_of_run(record, width, given))}  # first counts
    return [known.get(id(array)) or Law(array) for array in arrays]


def _of_run(record: Recording, widest: float, given: Any) -> list[Law]:
    scene, steps, nv = record.scene, record.steps, record.scene.packed.nv
    control = {
        "taken": COUNT,
        "left": (UNCOUNTED - MOST_COUNTED, UNCOUNTED),
        "rejected": (0, 1),
        "broken": (0, 2),
        "fastest": (0, len(scene.packed.rows) - 1),
        "corner": (0, len(record.plan.corners)),
    }

    def widths(found: Any) -> Any:
        """The width of steps is the stepper's, of which a part may be done."""
        done = found["done"]
        bounded = (found["bound"] == np.inf) | (steps.control["approach"] != 0)
        bounded &= found["lag"] == steps.control["lag"]
        return (found["widest"] == widest) & (done >= 0) & (done < widest) & bounded

    found = [
        Law(steps.control_table, control, (*ENDLESS, *ADDRESSES, "bound", "lag"), also=widths),
        Law(steps.stages, finite=False, also=lambda found: np.isfinite(found[..., at.Y, :])),
        Law(steps.counters_table, dict.fromkeys(COUNTERS.names or (), COUNT)),
        _of_active(scene.active),
        _of_knots(record, given),
        *_of_space(scene.space, nv),
    ]
    if steps.memory:
        stages, real = steps.memory
        found += [Law(stages, finite=False), _of_matrices(real, nv)]
    if scene.touching is not None:
        found += _of_contacts(scene.touching)
    return found


def _of_active(active: Any) -> Law:
    """A number of blocks, then so many numbers of blocks."""
    most = len(active) - 1

    def fine(found: Any) -> Any:
        within = (found >= 0) & (found <= most)
        return within & ((found < most) | (np.arange(most + 1) == 0))

    return Law(active, {"": (0, most)}, also=fine)


def _of_knots(record: Recording, given: Any) -> Law:
    """Only those of constant inputs and targets may change."""
    knots = record.plan.drives.knots
    fixed = np.setdiff1d(np.arange(len(knots)), given)
    return Law(knots, also=lambda found: found[..., fixed, :] == knots[fixed])


def _of_matrices(real: Any, nv: int) -> Law:
    """Factors of gauss6, with the rows that were exchanged as numbers."""
    row = nv + gauss.PIVOTS
    return Law(real, finite=False, also=lambda found: _whole(found[..., row, :nv], nv - 1))


def _of_space(space: Any, nv: int) -> list[Law]:
    """Return the laws of the constraints' factors."""
    rows = len(space.omega) or space.vectors.shape[1]  # Ω is not stored where contacts act
    joints = space.slots.shape[1] - at.SLOT

    def slots(found: Any) -> Any:
        most = np.full(at.SLOT + joints, max(nv - 1, 0))
        most[at.SLOTS], most[at.FIRST] = joints, max(rows - 3, 0)
        return (found >= 0) & (found <= most)

    def vectors(found: Any) -> Any:
        known = found[..., FACTORED, :3]
        return _whole(known[..., 1], rows) & _whole(known[..., 2], 1)

    high = np.iinfo(np.int64).max
    watch = {"count": (0, len(space.dips)), "rows": (0, rows), "inside": (0, 1)}
    return [
        Law(space.slots, {"": (0, high)}, also=slots),
        Law(space.vectors, finite=False, also=vectors),
        Law(space.watch, watch),
        *(Law(array, finite=False) for array in space if array.dtype.kind == "f"),
    ]


def _whole(x: Any, most: int) -> Any:
    """Return a mask of whole numbers from 0 to `most`."""
    return (x >= 0) & (x <= most) & (x == np.floor(x))


def _of_contacts(touching: Any) -> list[Law]:
    """Return the laws of the memory of contacts."""
    kept, shapes, pairs = touching.contacts, len(touching.shapes), len(touching.pairs)
    near = {
        "shape_a": (0, max(shapes - 1, 0)),
        "shape_b": (-1, shapes - 1),
        "feature": (-MOST_COUNTED, MOST_COUNTED),
        "slides": (0, 1),
        "pair": (0, max(len(kept.laws) - 1, 0)),
    }
    tally = {
        "found": (0, len(kept.found)),
        "kept": (0, len(kept.kept)),
        "anchored": (0, len(kept.anchors)),
        "frozen": (0, 2),
        "logged": (0, len(kept.changes)),
        **dict.fromkeys(COUNTS, COUNT),
        **{n: (-1, pairs - 1) for n in CONTACT_TALLY.names or () if n.endswith("_pair")},
    }
    return [
        *(Law(table, near, finite=False) for table in (kept.found, kept.kept, kept.anchors)),
        Law(kept.pairs, {"phase": (-1, 3)}, finite=False),
        Law(touching.tally_table, tally, finite=False),
        *(Law(table, finite=False) for table in (kept.wrenches, kept.limit_tau)),
    ]
