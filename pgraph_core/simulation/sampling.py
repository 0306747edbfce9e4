"""Torque functions that are called at samples, and whose torques are held in between."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np

from ..dynamics.arguments import answer_of, has_state, of_state
from ..dynamics.remembering import Calls
from ..errors import InputError, Problem, shown
from ..model import Output
from ..model.settings import MOST_FRAMES
from ..packing import Array
from ..result.measured import reading_times
from ..tolerances import ROUNDING, SOLVED
from .run_plan import NO_TIMES


def refuse_unsampled(tau: Any, given: Any) -> None:
    """Raise InputError if `tau` is not a function that can be called at samples.

    `given` is what the user gave, of which drives have become forces.
    """
    if callable(tau) and not hasattr(tau, "acting"):
        return
    text = f"holds the torques of a function tau=f(t, q, v), got tau={shown(given)}; "
    text += "leave it out, or give the function"
    if given is None:
        text += ". A control of a model has its own rate, pg.Sampled(sample=...)"
    elif hasattr(given, "drives"):
        text = f"calls a function tau=f(t, q, v) at its rate, got a {type(given).__name__}, which "
        text += "acts at every time; give a function of its gains K"
    elif hasattr(tau, "acting"):
        text = "does not apply to a walking controller, which has its own clock; leave it out"
    raise InputError(Problem("simulate", "sample", text))


def samples_of(sample: float | None, step: float, span: tuple[float, float]) -> Array:
    """Return the times of samples from the start to before the end of a run [s].

    They are multiples of `step`, or of `sample` if that is no multiple of it or steps are chosen
    (0). Raises InputError if steps are wider, or if there are too many.
    """
    if sample is None:
        return NO_TIMES
    if sample < step * (1.0 - SOLVED):
        text = f"{sample:g} s is below the step of the run, {step:g} s; give step={sample:g} or "
        text += "less, or a longer time between samples"
        raise InputError(Problem("simulate", "sample", text))
    count = (span[1] - span[0]) / sample
    if count > MOST_FRAMES:
        text = f"{sample:g} s makes {count:.3g} samples of this run, and {MOST_FRAMES} are "
        text += f"allowed; give {(span[1] - span[0]) / MOST_FRAMES:.2g} or more, or a shorter run"
        raise InputError(Problem("simulate", "sample", text))
    k, steps = np.arange(np.ceil(count * (1.0 - SOLVED))), round(sample / step) if step else 0
    if steps and abs(steps * step - sample) <= SOLVED * step:
        return span[0] + k * steps * step  # a Stepper counts times in this way
    return span[0] + k * sample


def with_readings(outputs: Sequence[Output], times: Array, step: float) -> Array:
    """Return the times of frames, with those at which imperfect outputs are read.

    `step` is that of fixed steps, or 0. Raises InputError if steps are wider than the time between
    samples, if values would be older than the run, or if there are too many samples.
    """
    start, end = float(times[0]), float(times[-1])
    read = [times[:0]]
    for o in outputs:
        if (given := o.imperfect) is None:
            continue
        where, count = f"output '{o.name}'", (end - start) / given.sample
        if given.sample < step * (1.0 - SOLVED):
            text = f"{given.sample:g} s is below the step of the run, {step:g} s; give step="
            text += f"{given.sample:g} or less, or a longer time between samples"
            raise InputError(Problem(where, "imperfect.sample", text))
        if given.latency > end - start:
            text = f"{given.latency:g} s is longer than the run, of {end - start:g} s; give a "
            raise InputError(Problem(where, "imperfect.latency", f"{text}shorter one"))
        if count > MOST_FRAMES:
            text = f"{given.sample:g} s makes {count:.3g} samples of this run, and {MOST_FRAMES} "
            raise InputError(Problem(where, "imperfect.sample", f"{text}are allowed; give more"))
        read.append(reading_times(given, start, end))
    new = np.unique(np.concatenate(read))
    if not len(new):
        return times
    near = ROUNDING * max(abs(start), abs(end))
    new = new[np.append(True, np.diff(new) > near)]
    after = np.clip(np.searchsorted(times, new), 1, len(times) - 1)
    off = np.minimum(np.abs(times[after - 1] - new), np.abs(times[after] - new))
    return np.union1d(times, new[off > near])


class Sampled:
    """A torque function, and the torques of its last sample."""

    def __init__(self, function: Any, goes_on: bool = False):
        """Wrap the function. One with a state of its own starts again, unless the run goes on."""
        if has_state(function) and not goes_on:
            function.restart()
        self.function, self.calls = of_state(function), Calls(function)
        self._t = -np.inf
        self._torques: Array = NO_TIMES

    def at(self, t: float, q: Array, v: Array) -> Array:
        """Return the torques (nv,) at t, for which the function is called once.

        Raises InputError if it raises, or if its answer does not fit.
        """
        if t != self._t:  # a run may begin again where bodies come close at its start
            self._torques = answer_of(self.function, t, q.copy(), v.copy()).astype(float)
            self._t = t
            self.calls.note(t, q, v, self._torques)
        return self._torques

    def trouble(self, t: float) -> str:
        """Return the reason why the last sample gave no torques, or ""."""
        if np.isfinite(self._torques).all():
            return ""
        return f"the function tau returned torques that are not finite, at t = {self._t:.6g} s"
