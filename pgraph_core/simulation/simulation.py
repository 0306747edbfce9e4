"""simulate: a run from a mechanism, a state and a method, in chunks of compiled frames."""

from __future__ import annotations

import time
from collections.abc import Callable, Sequence
from typing import Any

import numpy as np

from ..errors import InputError, Problem
from ..mechanism import Mechanism
from ..model import Force, Model
from ..result import Result
from .estimate import error_estimate
from .options import MOST_CHOSEN, Options, mechanism_of
from .plan import plan_of, with_state
from .recording import Recording


def simulate(
    mechanism: Mechanism | Model,
    q: Any = None,
    v: Any = None,
    *,
    t_start: float = 0.0,
    t_end: float | None = None,
    method: str | None = None,
    step: float | None = None,
    rtol: float | None = None,
    atol: float = 0.0,
    max_steps: int = MOST_CHOSEN,
    tau: Any = None,
    frames: int | None = None,
    t_eval: Any = None,
    scenario: str | None = None,
    forces: Sequence[Force] = (),
    stabilise: str | None = "project",
    switches: Any = None,
    progress: Callable[[float], Any] | None = None,
    estimate: bool = True,
) -> Result:
    """Run a mechanism from (q, v), its initial state by default, at `t_start` to `t_end` [s].

    `tau` is an array (nv,) or a function f(t, q, v), called at every stage: a Python one, or one
    compiled by `numba.njit`, which costs a hundredth. `frames` is how many evenly spaced states
    are recorded, `t_eval` their times. `scenario` names a run of the model, whose parts the other
    arguments replace; `forces` act beside its own. `stabilise` keeps constraints: "project",
    "baumgarte" or None.
    `switches` are (t, name of a constraint, True or False): it goes on or off then, between two
    steps and without anything being built anew; frames at that time show what is after it.
    `progress(fraction)` is called now and then; a run stops where it returns False. Without
    `estimate` the second run that estimates the error is left out, and the estimate is nan.

    Methods that choose their steps keep the error of each below `rtol` times the mechanism's own
    scales (a radian, its length, its highest speeds) plus `atol`, by default 1e-8 and 0; `step`
    is then the largest one, and `max_steps` ends a run that takes more. With a `step` and no
    `rtol` every step is as wide as it.

    Rigid contacts and joint limits are stepped over by "moreau_jean", the choice of "auto" where
    no `rtol` is given; "dop853" and "dopri5", its choices where one is, and "rk4" and
    "semi_implicit_euler" go from event to event of points on the ground (gait phases), and always
    project.

    Raises InputError for arguments that do not fit. A numerical failure is a Status.
    """
    began = time.perf_counter()
    mech = mechanism_of(mechanism, "simulate")
    if progress is not None and not callable(progress):
        text = f"must be a function of the fraction that is done; given {progress!r}"
        raise InputError(Problem("simulate", "progress", text))
    options = Options(
        scenario, t_start, t_end, method, step, rtol, atol, max_steps, frames, t_eval, stabilise,
        forces, switches,
    )  # fmt: skip
    plan = plan_of(mech, options, tau, q, v)
    state = with_state(mech, plan.start, q, v)
    tau = plan.tau if tau is None else tau
    record = Recording(mech, plan, *state, tau)
    built, busy = time.perf_counter(), time.thread_time()
    record.run(progress)
    stepped, busy = time.perf_counter(), time.thread_time() - busy
    wanted = estimate and record.ended.ok
    error = error_estimate(record, *state, progress) if wanted else np.nan
    timing = {
        "build": built - began,
        "step": stepped - built,
        "step_processor": busy,  # without the time of other programs
        "estimate": time.perf_counter() - stepped,
    }
    return record.result(error, timing)
