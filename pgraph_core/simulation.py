"""simulate: a run from a mechanism, a state and a method, in chunks of compiled frames."""

from __future__ import annotations

import time
from collections.abc import Callable
from importlib.metadata import version
from numbers import Integral, Real
from typing import Any

import numpy as np

from .errors import InputError, Problem
from .integrators import method_of
from .kernels import layout as at
from .mechanism import Mechanism
from .recording import Plan, Recording, error_estimate
from .result import Result
from .schema import Contact
from .system import Array, Ints

MOST_STEPS = 1e9  # a day of computing
FRAMES = 1000  # recorded where nothing else is asked for: more are seldom looked at
STABILISE = ("project", "baumgarte", None)
VERSION = version("pgraph")


def simulate(
    mech: Mechanism,
    q: Any = None,
    v: Any = None,
    *,
    t_end: float | None = None,
    method: str | None = None,
    step: float | None = None,
    tau: Any = None,
    frames: int | None = None,
    t_eval: Any = None,
    scenario: str | None = None,
    stabilise: str | None = "project",
    progress: Callable[[float], Any] | None = None,
) -> Result:
    """Run a mechanism from (q, v), its initial state by default, to `t_end` [s].

    `tau` is an array (nv,) or a function f(t, q, v), called at every stage: a Python one, or one
    compiled by `numba.njit`, which costs a hundredth. `frames` is how many evenly spaced states
    are recorded, `t_eval` their times; the step is shortened to meet them. `scenario` names a run
    of the model, whose parts the other arguments replace. `stabilise` keeps constraints:
    "project", "baumgarte" or None. `progress(fraction)` is called now and then; a run stops where
    it returns False.

    Raises InputError for arguments that do not fit. A numerical failure is a Status.
    """
    began = time.perf_counter()
    given = mech.model.scenario(scenario) if scenario is not None else None
    t_end = _positive("t_end", t_end if t_end is not None else given.t_end if given else 1.0)
    step = _positive("step", step if step is not None else given.step if given else 1e-3)
    name = method if method is not None else given.method if given else "auto"
    contacts = mech.contacts(_touching(mech, given))
    chosen, why = method_of(name, impulses=contacts is not None and contacts.rigid)
    forces = (*mech.model.forces, *(given.forces if given else ()))
    times, substeps, width = schedule(t_end, step, frames, t_eval)
    if stabilise not in STABILISE:
        text = f"must be 'project', 'baumgarte' or None; given {stabilise!r}"
        raise InputError(Problem("simulate", "stabilise", text))
    plan = Plan(
        chosen,
        times,
        substeps,
        width,
        mech.drives(forces),
        mech.loads(forces),
        _active(mech, given),
        contacts,
        _gains(step) if stabilise == "baumgarte" else np.zeros(2),
        stabilise == "project",
    )
    q0, v0 = _start(mech, given, q, v)
    record = Recording(mech, plan, q0, v0, tau)
    built = time.perf_counter()
    record.run(progress)
    stepped = time.perf_counter()
    estimate = error_estimate(record, q0, v0, progress) if record.status.ok else np.nan
    timing = {
        "build": built - began,
        "step": stepped - built,
        "estimate": time.perf_counter() - stepped,
    }
    header = {
        "version": VERSION,
        "model_hash": mech.model.hash,
        "scenario": scenario,
        "method": chosen.name,
        "why": why,
        "step": float(np.max(width, initial=0.0)),
        "t_end": t_end,
        "stabilise": stabilise,
    }
    from_zero = t_eval is None or len(times) == np.size(t_eval)
    return record.result(estimate, timing, header, first=0 if from_zero else 1)


def schedule(t_end: float, step: float, frames: Any, t_eval: Any) -> tuple[Array, Ints, Array]:
    """(times, substeps, width): when to record, and how many steps of what width in between.

    `times` begins at 0; where `t_eval` does not, the first frame is not for the caller.
    """
    if frames is not None and t_eval is not None:
        raise InputError(Problem("simulate", "frames", "give frames or t_eval, not both"))
    if t_end / step > MOST_STEPS:
        text = f"{step:g} s makes {t_end / step:.3g} steps; give {t_end / MOST_STEPS:g} s or more"
        raise InputError(Problem("simulate", "step", text))
    if t_eval is not None:
        times = _grid(t_eval, t_end)
    else:
        steps = max(int(np.ceil(t_end / step - 1e-9)), 1)
        if frames is None:
            frames = steps // -(-steps // FRAMES) + 1
        if not isinstance(frames, Integral) or isinstance(frames, bool) or frames < 2:
            text = f"must be a whole number >= 2; given {frames!r}"
            raise InputError(Problem("simulate", "frames", text))
        times = np.linspace(0.0, t_end, int(frames))
    apart = np.diff(times)
    substeps = np.maximum(np.ceil(apart / step - 1e-9), 1).astype(np.int64)
    return times, substeps, apart / substeps


def _grid(t_eval: Any, t_end: float) -> Array:
    try:
        times = np.array(t_eval, dtype=float)
    except (TypeError, ValueError):
        times = np.array(np.nan)
    if times.ndim != 1 or len(times) == 0 or not np.isfinite(times).all():
        raise InputError(Problem("simulate", "t_eval", "must be a list of finite times [s]"))
    if np.any(np.diff(times) <= 0) or times[0] < 0 or times[-1] > t_end * (1 + 1e-12):
        text = f"must ascend within 0 to t_end = {t_end:g} s"
        raise InputError(Problem("simulate", "t_eval", text))
    return times if times[0] == 0 else np.concatenate(([0.0], times))


def _positive(field: str, value: Any) -> float:
    number = float(value) if isinstance(value, Real) and not isinstance(value, bool) else np.nan
    if not 0 < number < np.inf:
        text = f"must be a finite number > 0 [s]; given {value!r}"
        raise InputError(Problem("simulate", field, text))
    return number


def _gains(step: float) -> Array:
    """Baumgarte's 2α and α² with α = 0.1/h: stable for every method here, gone in 10 steps."""
    alpha = 0.1 / step
    return np.array([2 * alpha, alpha * alpha])


def _active(mech: Mechanism, given: Any) -> Ints:
    if given is None or given.constraints is None:
        return mech.active
    wanted = set(given.constraints)
    return np.array(
        [i for i, c in enumerate(mech.model.constraints) if c.name in wanted], dtype=np.int64
    )


def _touching(mech: Mechanism, given: Any) -> tuple[Contact, ...]:
    """The contacts that act."""
    if given is None or given.contacts is None:
        return tuple(c for c in mech.model.contacts if c.active)
    return tuple(c for c in mech.model.contacts if c.name in given.contacts)


def _start(mech: Mechanism, given: Any, q: Any, v: Any) -> tuple[Array, Array]:
    """Initial state: the arguments, else the scenario's, else the model's."""
    q0, v0 = mech.home()
    if given is not None:
        for state, entries, column in ((q0, given.q, at.QI), (v0, given.v, at.VI)):
            for name, values in entries.items():
                number = mech.topology.number(name)
                row = int(np.flatnonzero(mech.system.body_of_row == number)[0])
                first = mech.system.rows[row, column]
                state[first : first + len(values)] = values
    q0 = q0 if q is None else mech.position(q).copy()
    v0 = v0 if v is None else mech.finite("v", v, mech.nv).copy()
    return q0, v0
