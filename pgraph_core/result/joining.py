"""Several consecutive runs as one."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from itertools import pairwise
from typing import Any

import numpy as np

from ..errors import InputError, Problem, explained
from ..integrators import METHODS
from .exports import ARRAYS
from .records import KINDS, OF_CONSTRAINTS, OF_DRIVES, ContactRecord, Named
from .result import Result

ADDED = ("work", "dissipation")  # start from zero in each run
AVERAGED = ("force", "limit", "normal")  # kinds of contact records that are means
ERRORS = ("error_at", "state_error_at", "force_error_at", "space_error_at")


@explained
def joined(runs: Sequence[Result], /) -> Result:
    """Join consecutive runs, each of which begins where the previous one ended.

    The result refers to the mechanism of the last run. The frame that is shared by two runs is
    taken from the later run, so that modified bodies and impacts are visible. Work, dissipation,
    counters and times are added up. The error is known until the end of the first run, because its
    growth in those that follow is unknown.

    Parameters
    ----------
    runs : sequence of Result
        The runs, in chronological order.

    Returns
    -------
    Result
        One run.

    Raises
    ------
    InputError
        If `runs` is empty, or if consecutive runs are not contiguous in time or differ in size.

    Examples
    --------
        whole = pg.joined([first, second])
    """
    if not len(runs):
        raise InputError(Problem("joined", "runs", "needs at least one run, got none"))
    for before, after in pairwise(runs):
        _check(before, after)
    last = runs[-1]
    keep = [slice(0, -1)] * (len(runs) - 1) + [slice(None)]
    arrays = {name: _chained([getattr(r, name) for r in runs], keep) for name in ARRAYS}
    for name in ADDED:
        parts = [getattr(r, name) for r in runs]
        so_far = np.cumsum(
            [np.zeros_like(parts[0][-1]), *(part[-1] for part in parts[:-1])], axis=0
        )
        arrays[name] = _chained([part + offset for part, offset in zip(parts, so_far)], keep)
    for name in ERRORS:
        arrays[name] = _of_first([getattr(r, name) for r in runs], keep)
    known = np.flatnonzero(np.isfinite(arrays["error_at"]))
    until = arrays["t"][known[-1]] if len(known) else np.nan
    text = f"the error of a joined run is known until t = {until:.6g} s, the end of its first part"
    return replace(
        last,
        **arrays,
        constraint_force=Named(
            _by_name([r.constraint_force for r in runs], _of_means(runs), runs), *OF_CONSTRAINTS
        ),
        drive_force=Named(_by_name([r.drive_force for r in runs], keep, runs), *OF_DRIVES),
        contacts=_contacts(runs, keep),
        counters=_added([r.counters for r in runs]),
        timing=_added([r.timing for r in runs]),
        header={
            **last.header,
            "t_start": runs[0].header.get("t_start", 0.0),
            "forces": [force for r in runs for force in r.header.get("forces", ())],
        },
        notices=tuple(
            dict.fromkeys(
                [
                    *(text for r in runs for text in r.notices),
                    *[text] * bool(len(known) and len(runs) > 1),
                ]
            )
        ),
        user_events=tuple(event for r in runs for event in r.user_events),
    )


def _check(before: Result, after: Result) -> None:
    if before.q.shape[1:] != after.q.shape[1:] or before.v.shape[1:] != after.v.shape[1:]:
        text = f"run of {after.q.shape[1]} coordinates after one of {before.q.shape[1]}"
        raise InputError(Problem("joined", "runs", f"{text}: only runs of the same joints join"))
    if not len(before.t) or not len(after.t) or not np.isclose(before.t[-1], after.t[0]):
        ends = [f"{t[k]:g}" if len(t) else "no frame" for t, k in ((before.t, -1), (after.t, 0))]
        later = len(before.t) and len(after.t) and after.t[-1] <= before.t[0]
        do = "give the earlier run first" if later else f"give t_start = {ends[0]}"
        text = f"a run from {ends[1]} s after one to {ends[0]} s; {do}"
        raise InputError(Problem("joined", "runs", text))


def _chained(parts: Sequence[Any], keep: Sequence[slice]) -> Any:
    return np.concatenate([part[some] for part, some in zip(parts, keep)])


def _of_first(parts: Sequence[Any], keep: Sequence[slice]) -> Any:
    """Concatenate the errors of the first run, and inf where later ones may have increased them."""
    unknown = np.where(np.isnan(parts[0][-1]), np.nan, np.inf)
    later = [np.broadcast_to(unknown, part.shape).copy() for part in parts[1:]]
    for part in later[:1]:
        part[0] = parts[0][-1]  # the shared frame
    return _chained([parts[0], *later], keep)


def _of_means(runs: Sequence[Result]) -> list[slice]:
    """Return the frames of each run whose forces are kept.

    With time stepping, the forces of a frame are means since the previous one, so those of a shared
    frame are taken from the earlier run.
    """
    stepped = {method.name for method in METHODS.values() if method.time_stepping}
    before = [r.header.get("method") in stepped for r in runs[:-1]]
    ends = [None if own else -1 for own in before]
    return [slice(int(a), b) for a, b in zip((False, *before), (*ends, None))]


def _by_name(parts: Sequence[Any], keep: Sequence[slice], runs: Sequence[Result]) -> dict[str, Any]:
    """Join arrays by name, filling in zeros for runs that lack one."""
    found = {}
    for name in dict.fromkeys(key for part in parts for key in part):
        like = next(part[name] for part in parts if name in part)
        each = [
            part[name] if name in part else np.zeros((len(r.t), *like.shape[1:]), like.dtype)
            for part, r in zip(parts, runs)
        ]
        found[name] = _chained(each, keep)
    return found


def _contacts(runs: Sequence[Result], keep: Sequence[slice]) -> ContactRecord:
    records = [r.contacts for r in runs]
    some = {kind: _of_means(runs) if kind in AVERAGED else keep for kind in KINDS}
    parts = {
        kind: _by_name([getattr(c, kind) for c in records], own, runs) for kind, own in some.items()
    }
    if parts["pull"]:
        each = [c.pull or r.constraint_force for c, r in zip(records, runs)]
        parts["pull"] = _by_name(each, keep, runs)
    wrench = records[-1].wrench
    if any(c.wrench.size for c in records):
        nb = runs[-1].mechanism.nb
        each = [
            c.wrench if c.wrench.size else np.zeros((len(r.t), nb, 6))
            for c, r in zip(records, runs)
        ]
        wrench = _chained(each, keep)
    events = tuple(event for c in records for event in c.events)
    residual = records[-1].residual
    if any(len(c.residual) for c in records):
        residual = _chained([r.contact_residual for r in runs], keep)
    return ContactRecord(**parts, wrench=wrench, residual=residual, events=events)


def _added(parts: Sequence[Any]) -> dict[str, Any]:
    return {
        key: sum(p.get(key, 0) for p in parts) for key in dict.fromkeys(k for p in parts for k in p)
    }
