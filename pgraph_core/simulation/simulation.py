"""simulate: a run from a mechanism, a state and a method, in chunks of compiled frames."""

from __future__ import annotations

import time
from collections.abc import Callable, Sequence
from importlib.metadata import version
from typing import Any

import numpy as np

from ..mechanism import Mechanism
from ..model import Force
from ..result import Result
from .acting import acting
from .arguments import MOST_CHOSEN, Asked, check_choices, forces_of, method_name, span_of
from .estimate import error_estimate
from .phased_recording import PhasedRecording
from .planning import Planned, planned
from .recording import Recording

VERSION = version("pgraph-dynamics")


def simulate(
    mech: Mechanism,
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
    forces = forces_of(mech, forces)
    given = mech.model.scenario(scenario) if scenario is not None else None
    check_choices(frames, t_eval, stabilise, rtol, progress)
    span, name = span_of(given, t_start, t_end), method_name(given, method, rtol)
    acts = acting(mech, given, forces, switches, tau, (q, v), span)
    asked = Asked(given, span, name, step, rtol, atol, max_steps, frames, t_eval, stabilise)
    made = planned(mech, acts, asked)
    record = (PhasedRecording if made.plan.sites else Recording)(
        mech, made.plan, acts.q, acts.v, acts.tau
    )
    record.notices += made.notices
    built, busy = time.perf_counter(), time.thread_time()
    record.run(progress)
    stepped, busy = time.perf_counter(), time.thread_time() - busy
    wanted = estimate and record.status.ok
    error = error_estimate(record, acts.q, acts.v, progress) if wanted else np.nan
    timing = {
        "build": built - began - made.choice.looked,
        "stiffness": made.choice.looked,
        "step": stepped - built,
        "step_processor": busy,  # without what other programs took
        "estimate": time.perf_counter() - stepped,
    }
    header = _header(mech, scenario, asked, made)
    header["forces"] = [(*span, f.model_dump(mode="json", exclude_none=True)) for f in forces]
    return record.result(error, timing, header, made.shown)


def _header(mech: Mechanism, scenario: str | None, asked: Asked, made: Planned) -> dict[str, Any]:
    """What the run was made of, for its result."""
    given = made.plan.tolerance
    return {
        "version": VERSION,
        "model_hash": mech.model.hash,
        "scenario": scenario,
        "method": made.choice.method.name,
        "why": made.choice.why,
        "step": made.plan.step,
        "rtol": None if given is None or given.fixed else given.rtol,
        "t_start": asked.span[0],
        "t_end": asked.span[1],
        "stabilise": asked.stabilise,
    }
