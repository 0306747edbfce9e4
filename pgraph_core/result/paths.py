"""Tensions and lengths of springs, struts, cables and ropes over a run."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from typing import Any, NamedTuple

import numpy as np

from ..dynamics.exerted import path_tensions, rope_spans, spans_over
from ..dynamics.scene import segments_of
from ..forces import Cable, Force, OnJoint
from ..model import Rope
from ..model.expressions import TENSE
from ..packing import Array
from ..packing.packed import Packed
from ..pulleys import cable_limit, segment_names
from .bodies import acting


class Path(NamedTuple):
    """The tension [N] and the length [m] of a path at each frame, (n,) each."""

    tension: Array
    length: Array


def paths_of(run: Any) -> dict[str, Path]:
    """Return the paths by the names of their parts, with "name[k]" for several segments."""
    packed, q = run.mechanism.packed, run.q.copy()
    ropes = of_ropes(packed, run.constraint_force, q)
    return dict((*_of_forces(run), *ropes, *of_cables(packed, run.contacts.limit, q)))


def _of_forces(run: Any) -> Iterator[tuple[str, Path]]:
    own, packed = acting(run), run.mechanism.packed
    drives = tuple(f for f in own if isinstance(f, OnJoint))  # expressions may name them
    given = [(b, e, Force.model_validate(x)) for b, e, x in run.header.get("forces", ())]
    t, (q, v) = run.t.copy(), run._with_states()
    for begin, end, f in (*((-np.inf, np.inf, f) for f in own), *given):
        if not isinstance(f, TENSE) or is_bound(f):
            continue
        found = path_tensions(packed, f, drives, t, q, v)
        acts = (t >= begin) & ((t < end) | (end >= t[-1]))
        lengths = found[:, :, 1]
        if isinstance(f, Cable):  # without what is wound on drums
            rows = (one.rows for one in packed.placed().segments(f))
            lengths = np.column_stack([spans_over(packed, x, run.q.copy())[1] for x in rows])
        for k, name in enumerate(segment_names(f.name, found.shape[1])):
            yield name, Path(np.where(acts, found[:, k, 0], 0.0), lengths[:, k])


def is_bound(f: Force) -> bool:
    """Check whether a force is a cable that does not stretch, whose tension is that of a limit."""
    return isinstance(f, Cable) and f.stiffness is None


def of_ropes(packed: Packed, forces: Mapping[str, Array], q: Array) -> Iterator[tuple[str, Path]]:
    """Yield (name, path) of each segment of the active ropes, at the states q (n, nq).

    `forces` contains the wrenches (n, 6) of constraints.
    """
    ropes = (c.name for c in packed.model.constraints if isinstance(c, Rope))
    for own, k in (x for name in ropes for x in segments_of(packed.blocks, name)):
        if own in forces:
            spans, lengths = rope_spans(packed, k, q)
            yield own, Path(np.einsum("nk,nk->n", forces[own][:, 3:], spans[:, 0, 6:]), lengths)


def of_cables(packed: Packed, limits: Mapping[str, Array], q: Array) -> Iterator[tuple[str, Path]]:
    """Yield (name, path) of each segment of the cables that do not stretch, at the states q (n,
    nq).

    `limits` contains the forces (n,) of limits.
    """
    for f in packed.model.forces:
        found = packed.placed().segments(f) if is_bound(f) else ()
        for own, one in zip(segment_names(f.name, len(found)), found):
            if (limit := cable_limit(own)) in limits:
                yield own, Path(limits[limit], spans_over(packed, one.rows, q)[1])
