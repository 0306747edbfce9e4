"""Simulation runs: options become a plan, the plan is stepped, and frames are recorded.

The package is not called `simulate`, which would hide the function `pgraph_core.simulate`.
"""

from __future__ import annotations

import time
from collections.abc import Callable, Mapping, Sequence
from dataclasses import replace
from typing import TYPE_CHECKING, Any

import numpy.typing as npt

from ..dynamics.arguments import stretched
from ..errors import explained
from ..mechanism import Mechanism, mechanism_of
from ..model import Force, Model
from ..result import Result
from .estimate import error_estimate
from .monitors import monitors_of
from .options import MOST_CHOSEN, Options, inputs_of
from .plan import begun_with, plan_of
from .recording import Recording
from .start import begun_anew, by_names, given_states, torques_by_names, with_state

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
    states: Any = None,
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
    wrt: str | Sequence[Any] = (),
) -> Result:
    """Simulate a mechanism or a model from `t_start` to `t_end`.

    Parameters
    ----------
    mechanism : Mechanism or Model
        The system to simulate.
    q, v : array or dict, optional
        Initial configuration (nq,) and velocity (nv,) in the order of `mech.names`, or values by
        name of body, as a dictionary or a row of pandas. Coordinates that are not named keep the
        values of the scenario or of the model. Lists raise an error if the table of bodies is in
        another order. A free joint has q = [x, y, z, qw, qx, qy, qz] and v = [angular, linear].
    states : array or dict, optional
        Initial states (nx,) of the controls in the order of `run.states`, or values by name of
        control. Controls that are not named start as the model says. A sample at `t_start` of a
        control with given states is taken to be over. `simulate(mech, run.q[-1], run.v[-1],
        states=run.states[-1], t_start=run.t[-1], ...)` continues a run.
    t_start, t_end : float
        Time at the start and at the end [s]. By default the run starts at 0 and ends at the last of
        `t_eval`, else after the duration of the scenario, else after 1 s.
    method : str, optional
        Name of an integration method; "auto" chooses. With rigid contacts or joint limits it
        selects "moreau_jean" (time stepping), or with `rtol` "dop853" or "dopri5", which are
        event-driven like "rk4" and "semi_implicit_euler". Event-driven runs always project onto the
        constraints.
    step : float, optional
        Step [s]. Without `rtol` all steps have this width. Otherwise it is the largest step.
    rtol, atol : float, optional
        Tolerances of an adaptive method, by default 1e-8 and 0. The error of each step stays below
        `rtol` times the mechanism's own scales (a radian, its length, its highest speeds) plus
        `atol`.
    max_steps : int
        Largest number of adaptive steps.
    tau : array, dict or callable, optional
        Torques (nv,) or by name of body, or a function f(t, q, v) that is called at every stage. A
        function compiled by `numba.njit` costs a hundredth of a Python function. A pulse shorter
        than a step is missed: give `step`, or a `pg.Motor` with a table, at whose knots steps end.
    frames : int, optional
        Number of evenly spaced states to record, about 1000 by default.
    t_eval : array, optional
        Times to record instead of `frames` [s].
    scenario : str, optional
        Name of a scenario of the model. Other arguments override its fields.
    forces : sequence of Force
        Forces in addition to those of the model, with different names.
    inputs : dict, optional
        Inputs by name of motor, servo or actuator in place of the model's: numbers or a `pg.Table`
        over time.
    stabilise : {"project", "baumgarte", None}
        How the drift of constraints is removed.
    switches : sequence of tuple, optional
        (t, name of a constraint, True or False) switches it on or off at t, between two steps. A
        frame at t shows the state after it.
    events : callable or sequence of callable
        Functions f(t, q, v) whose zeros are located within steps, to rounding, and listed in
        `run.user_events`. An attribute `direction` of 1 or -1 selects rising or falling zeros. One
        with `terminal = True` ends the run with `Status.STOPPED`.
    progress : callable or bool, optional
        Function of the completed fraction; the run stops if it returns False. True shows a bar in a
        terminal or notebook (tqdm).
    estimate : bool, optional
        Whether to estimate the error from a second run at half the step or a tighter tolerance,
        which doubles the time. By default all runs are estimated, except those with a Python
        function `tau`, which may have internal state. Without an estimate it is nan, and `message`
        gives the reason.
    wrt : str or sequence of str, optional
        Parameters with respect to which the run is differentiated: paths in the model as in `sweep`
        ("bodies.arm.mass", the name of a parameter), "q.arm" and "v.arm" of the initial state, and
        "inputs.knee" of the call. `run.sensitivity(path)` and `run.gradient(function)` give the
        derivatives. They are the derivatives of the computed steps with constant step sizes.

    Returns
    -------
    Result
        The recorded motion. A numerical failure is a `Status` of it, not an exception.

    Raises
    ------
    InputError
        If arguments do not fit.

    Examples
    --------
    A double pendulum that swings for two seconds:

        run = pg.simulate(pg.Model.serial(2), t_end=2.0)
        print(run.q[-1], run.error_estimate)
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
    plan = begun_with(plan_of(mech, options, tau, q, v), given_states(mech, states))
    state = with_state(mech, plan.start, q, v, float(plan.times[0]))
    tau = plan.tau if tau is None else tau
    monitors = () if events is NO_EVENTS else monitors_of(events, (mech.nq, mech.nv))
    record = Recording(mech, plan, *state, tau, monitors)
    if len(wrt):
        from .sensitivity import Carried
        from .variables import Given, variables_of

        given = Given(mech, options, replace(plan, start=state), tau, q, v, Recording, wrt)
        record.carried = Carried(given, variables_of(given, wrt))
    record.ended.notices += stretched(mech.packed, state[0]) if q is not None else []
    record.ended.notices += begun_anew(mech, scenario) if states is not None else []
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
