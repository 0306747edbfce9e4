"""Runs: options become a plan, the plan is stepped, and frames are recorded.

The package is not called `simulate`, which would hide the function `pgraph_core.simulate`.
"""

from __future__ import annotations

import time
from collections.abc import Callable, Mapping, Sequence
from typing import TYPE_CHECKING, Any

import numpy.typing as npt

from ..dynamics.arguments import stretched
from ..errors import explained
from ..mechanism import Mechanism, mechanism_of
from ..model import Force, Model
from ..result import Result
from .estimate import error_estimate
from .options import MOST_CHOSEN, Options, inputs_of
from .plan import by_names, plan_of, torques_by_names, with_state
from .recording import Recording
from .switches import monitors_of

if TYPE_CHECKING:
    from ..packing import Array

    Event = Callable[[float, Array, Array], Any]
    Torque = npt.ArrayLike | Event


NO_EVENTS: tuple[Callable[..., Any], ...] = ()


@explained
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
    tau: Torque | None = None,
    frames: int | None = None,
    t_eval: Any = None,
    scenario: str | None = None,
    forces: Sequence[Force] = (),
    inputs: Mapping[str, Any] | None = None,
    stabilise: str | None = "project",
    switches: Any = None,
    events: Event | Sequence[Event] = NO_EVENTS,
    progress: Callable[[float], Any] | bool | None = None,
    estimate: bool | None = None,
) -> Result:
    """Simulate a mechanism, or a model, from `t_start` to `t_end` [s].

    Starts at (q, v), by default at the initial state of the scenario or of the model. Each is an
    array (nq,), (nv,) in the order of `mech.names`, or {body: value or values}, a dictionary or a
    row of pandas, which leaves the others there. A list is refused where the model lists its bodies
    in another order.

    Torques and forces: `tau` is an array (nv,), {body: value or values}, or a function f(t, q, v)
    that is called at every stage; compiled by `numba.njit` it costs a hundredth of a Python
    function. What it does between two stages, as a pulse shorter than a step, is not seen: give
    `step`, or a `pg.Motor` with a table, at whose knots steps end. `forces` act in addition to
    those of the model, under names of their own. `inputs`, by
    name of a motor, servo or actuator, are numbers or a `pg.Table` over time in place of the
    model's: {"knee": 0.5}. `scenario` names a scenario of the model; other arguments override its
    fields.

    Output: `frames` evenly spaced states, or the states at the times `t_eval`; by default about
    a thousand.

    Steps: with a `step` [s] and no `rtol`, every step has that width. With `rtol`, or neither,
    an adaptive method keeps the error of each step below `rtol` times the mechanism's own scales
    (a radian, its length, its highest speeds) plus `atol`, by default 1e-8 and 0; `step` is then
    the largest step, and `max_steps` the largest number of them.

    Constraints: `stabilise` keeps them by "project", "baumgarte" or not at all (None). `switches`
    are (t, name of a constraint, True or False): the constraint is switched on or off at t,
    between two steps; a frame at t shows the state after it.

    `events` are functions f(t, q, v) whose zeros are located within steps, to rounding: see
    `run.user_events`. With an attribute `direction` of 1 or -1 only rising or falling ones count;
    one with `terminal = True` ends the run there with `Status.STOPPED`.

    Rigid contacts and joint limits are handled by time stepping ("moreau_jean"), the choice of
    "auto" without `rtol`, or from event to event by "dop853" and "dopri5", its choices with
    `rtol`, and by "rk4" and "semi_implicit_euler". Event-driven runs always project.

    `progress(fraction)` is called now and then; the run stops if it returns False. True shows a
    bar, in a terminal or a notebook (tqdm).

    The error is estimated from a finer run of the same motion, at half the step or a tighter
    tolerance, which takes about twice the time; `estimate=False` leaves it out. A Python function
    `tau` is called again for it with `estimate=True` only, since it may remember; without, the
    estimate is nan and the run's `message` says so.

    Returns a Result. Raises InputError for arguments that do not fit; a numerical failure is a
    `Status` of the result.
    """
    began = time.perf_counter()
    mech = mechanism_of(mechanism, "simulate")
    options = Options(
        scenario, t_start, t_end, method, step, rtol, atol, max_steps, frames, t_eval, stabilise,
        forces, switches, estimate,
        () if inputs is None else inputs_of(inputs, "simulate"),
    )  # fmt: skip
    if tau is not None:
        tau = torques_by_names(mech, tau)
    if q is not None or v is not None:
        q, v = by_names(mech, scenario, q, v, tau)
    plan = plan_of(mech, options, tau, q, v)
    state = with_state(mech, plan.start, q, v)
    tau = plan.tau if tau is None else tau
    monitors = () if events is NO_EVENTS else monitors_of(events)
    record = Recording(mech, plan, *state, tau, monitors)
    record.ended.notices += stretched(mech.packed, state[0]) if q is not None else []
    built, busy = time.perf_counter(), time.thread_time()
    if progress is None:
        record.run()
    else:
        from ..show.bars import shown_progress  # other runs load nothing that shows

        with shown_progress(progress, "simulate") as told:
            record.run(told)
    stepped, busy = time.perf_counter(), time.thread_time() - busy
    error = error_estimate(record, estimate)
    timing = {
        "build": built - began,
        "step": stepped - built,
        "step_processor": busy,  # without the time of other programs
        "estimate": time.perf_counter() - stepped,
    }
    result = record.result(error.error, error.notices, timing)
    record.leave()
    return result
