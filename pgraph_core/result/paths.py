"""Tensions and lengths of springs, struts, cables and ropes over a run."""

from __future__ import annotations

from collections.abc import Iterator
from typing import Any, NamedTuple

import numpy as np

from ..dynamics.scene import path_tensions, rope_spans, segments_of
from ..forces import LOADS, Force, Load, OnBody, OnJoint
from ..model import Rope
from ..packing import Array
from .bodies import acting


class Path(NamedTuple):
    """The tension [N] and the length [m] of a path at each frame, (n,) each."""

    tension: Array
    length: Array


def paths_of(run: Any) -> dict[str, Path]:
    """Return the paths by the names of their parts, with "name[k]" for several segments."""
    return dict((*_of_forces(run), *_of_ropes(run)))


def _of_forces(run: Any) -> Iterator[tuple[str, Path]]:
    own = acting(run)
    drives = tuple(f for f in own if isinstance(f, OnJoint))  # expressions may name them
    given = [(b, e, Force.model_validate(x)) for b, e, x in run.header.get("forces", ())]
    t, (q, v) = run.t.copy(), run._with_states()
    for begin, end, f in (*((-np.inf, np.inf, f) for f in own), *given):
        if not (isinstance(f, OnBody) and _load_of(f).action.tension):
            continue
        found = path_tensions(run.mechanism.packed, f, drives, t, q, v)
        acts = (t >= begin) & ((t < end) | (end >= t[-1]))
        many = found.shape[1] > 1
        for k in range(found.shape[1]):
            name = f"{f.name}[{k + 1}]" if many else f.name
            yield name, Path(np.where(acts, found[:, k, 0], 0.0), found[:, k, 1])


def _load_of(f: OnBody) -> Load:
    return next(kind for kind in LOADS if kind.part is type(f))


def _of_ropes(run: Any) -> Iterator[tuple[str, Path]]:
    packed = run.mechanism.packed
    ropes = (c.name for c in run.mechanism.model.constraints if isinstance(c, Rope))
    for own, k in (x for name in ropes for x in segments_of(packed.blocks, name)):
        if own in run.constraint_force:
            spans, lengths = rope_spans(packed, k, run.q.copy())
            pull = np.einsum("nk,nk->n", run.constraint_force[own][:, 3:], spans[:, 0, 6:])
            yield own, Path(pull, lengths)
