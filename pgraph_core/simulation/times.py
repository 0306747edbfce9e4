"""When a run is recorded, and how many steps of what width lie in between."""

from __future__ import annotations

from numbers import Integral
from typing import Any

import numpy as np

from ..errors import InputError, Problem
from ..system import Array, Ints

MOST_STEPS = 1_000_000_000  # a day of computing
FRAMES = 1000  # recorded where nothing else is asked for: more are seldom looked at


def schedule(
    t_start: float, t_end: float, step: float, frames: Any, t_eval: Any
) -> tuple[Array, Ints, Array]:
    """(times, substeps, width): when to record, and how many steps of what width in between."""
    times = given_times(t_start, t_end, step, frames, t_eval)
    return times, *steps_between(times, step)


def given_times(t_start: float, t_end: float, step: float, frames: Any, t_eval: Any) -> Array:
    """When to record a run whose steps are given: at most FRAMES times where nothing is said.

    It begins at `t_start`; where `t_eval` does not, the first frame is not for the caller.
    """
    span = t_end - t_start
    if span / step > MOST_STEPS:
        text = f"{step:g} s makes {span / step:.3g} steps; give {span / MOST_STEPS:g} s or more"
        raise InputError(Problem("simulate", "step", text))
    if frames is None:
        steps = max(int(np.ceil(span / step - 1e-9)), 1)
        frames = steps // -(-steps // FRAMES) + 1 if t_eval is None else None
    return frame_times(t_start, t_end, frames, t_eval)


def steps_between(times: Array, step: float) -> tuple[Ints, Array]:
    """(substeps, width) between recorded times: how many steps, of what width."""
    if step == 0.0:  # the method chooses them
        return np.zeros(0, dtype=np.int64), np.zeros(0)
    apart = np.diff(times)
    substeps = np.maximum(np.ceil(apart / step - 1e-9), 1).astype(np.int64)
    return substeps, apart / substeps


def frame_times(t_start: float, t_end: float, frames: Any, t_eval: Any) -> Array:
    """When to record: `frames` times evenly from `t_start` to `t_end`, or those of `t_eval`."""
    if t_eval is not None:
        return _grid(t_eval, t_start, t_end)
    if not isinstance(frames, Integral) or isinstance(frames, bool) or frames < 2:
        text = f"must be a whole number >= 2; given {frames!r}"
        raise InputError(Problem("simulate", "frames", text))
    return np.linspace(t_start, t_end, int(frames))


def _grid(t_eval: Any, t_start: float, t_end: float) -> Array:
    try:
        times = np.array(t_eval, dtype=float)
    except (TypeError, ValueError):
        times = np.array(np.nan)
    if times.ndim != 1 or len(times) == 0 or not np.isfinite(times).all():
        raise InputError(Problem("simulate", "t_eval", "must be a list of finite times [s]"))
    if np.any(np.diff(times) <= 0) or times[0] < t_start or times[-1] > t_end + 1e-12 * abs(t_end):
        text = f"must ascend within {t_start:g} to t_end = {t_end:g} s"
        raise InputError(Problem("simulate", "t_eval", text))
    return times if times[0] == t_start else np.concatenate(([t_start], times))
