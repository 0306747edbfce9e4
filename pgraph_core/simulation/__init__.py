"""Simulation runs: options become a plan, the plan is stepped, and frames are recorded.

The package is not called `simulate`, which would hide the function `pgraph_core.simulate`.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from typing import TYPE_CHECKING, Any

import numpy.typing as npt

from .. import words
from ..engine.compiler.clock import LOADING, clocks
from ..errors import explained
from ..mechanism import Mechanism, mechanism_of
from ..model import Force, Model
from ..result import Result, Runs
from .continuing import state_of
from .estimate import error_estimate
from .monitors import monitors_of
from .options import MOST_CHOSEN, Options, inputs_of, shown_progress
from .plan import begun_with, plan_of
from .recorded import result_of
from .recording import Recording
from .sampling import refuse_unsampled
from .space import fine_enough, refines, with_space_error
from .start import (
    by_names,
    given_states,
    notices_of_start,
    refuse_interval,
    rows_of,
    torques_or_drives,
    unread,
    with_state,
)

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
    start: Result | None = None,
    t_start: float = 0.0,
    t_end: float | None = None,
    method: str | None = None,
    step: float | None = None,
    rtol: float | None = None,
    atol: float = 0.0,
    max_steps: int = MOST_CHOSEN,
    tau: Torque | None = None,
    sample: float | None = None,
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
        Initial configuration (nq,) and velocity (nv,), in the order of `mech.names`. A dictionary
        or pandas row maps body names to values. All other coordinates then keep their values from
        the scenario or model. Lists are not accepted if the table of bodies is in a different
        order. A free joint has q = [x, y, z, qw, qx, qy, qz] and v = [angular, linear], where
        [x, y, z] is relative to the `link` of the body. A dictionary may contain [x, y, z] only.
        The velocities of free and ball joints are in the axes of the parent. To convert an angular
        velocity w in body axes, as used by MuJoCo, pass R @ w, where R is the rotation of the body.
    states : array or dict, optional
        Initial states (nx,) of the controls, in the order of `run.states`, or values by control
        name. All other controls use the initial states of the model. If states are given, a sample
        at `t_start` is not taken again.
    start : Result, optional
        A run of the same joints, at whose end this run goes on, in place of `q`, `v`, `states` and
        `t_start`. It also goes on with the states of drives with a lag or an integral, the
        constraints that are switched on and the places where they hold, the conditions that have
        acted, and the impulses and friction springs of contacts. Switches before its end have
        acted. `joined` puts the runs together.
    t_start, t_end : float
        Start and end time [s]. By default, the run starts at 0. It ends at the last value of
        `t_eval`, or otherwise after the duration of the scenario, which defaults to 1 s.
    method : str, optional
        Name of the integration method. By default ("auto"), it is selected automatically. For
        models with rigid contacts, joint limits or joint friction, "moreau_jean" (time stepping) is
        used, or "dop853" or "dopri5" if `rtol` is given. With the latter two, "rk4" and
        "semi_implicit_euler", runs with contacts or limits are event-driven and always use
        projection onto the constraints.
    step : float, optional
        Step size [s]. If `rtol` is given, this is the maximum step size.
    rtol, atol : float, optional
        Relative and absolute tolerances of an adaptive method. The solver keeps the error of each
        step below ``atol + rtol * scale``, where the scale is one radian, the length of the
        mechanism or its highest speed so far. Default values are 1e-8 for `rtol` and 0 for `atol`.
    max_steps : int
        Maximum number of adaptive steps.
    tau : array, dict, callable or Feedback, optional
        Joint torques (nv,) or a dictionary by body name, or a function f(t, q, v), or f(t, y) with
        y = [q, v] as in SciPy, that is called at every stage, or the result of `lqr` or
        `place_poles`. Functions compiled with `numba.njit` are about 100 times faster than Python
        functions. Note that pulses shorter than a step may be missed. Use a smaller `step`, or a
        `pg.Motor` with a table, since steps end at its knots.
    sample : float, optional
        Time between samples [s] of a controller. The function `tau` is then called once at the
        start and at each multiple of `sample` after it, in the order of time, and its torques are
        held in between, as in a loop of a `pg.Stepper`. Steps end at samples. A function that
        remembers earlier calls, such as the sum of a PI controller, requires it.
    frames : int, optional
        Number of evenly spaced frames to record. The default is about 1000.
    t_eval : array, optional
        Times at which to record the state [s], instead of `frames`.
    scenario : str, optional
        Name of a scenario of the model. Its fields are overridden by the other arguments.
    forces : sequence of Force
        Additional forces. Their names must not occur in the model.
    inputs : dict, optional
        Inputs of motors, servos and actuators by name, which replace the values of the model. Each
        input is a number or a `pg.Table` over time.
    stabilise : {"project", "baumgarte", None}
        Method used to remove constraint drift.
    switches : sequence of tuple, optional
        Tuples (t, constraint name, True or False), which switch a constraint on or off at time t,
        between two steps. A frame at t contains the state after the switch.
    events : callable or sequence of callable
        Functions f(t, q, v), or f(t, y) with y = [q, v] as in SciPy, whose zeros are located to
        rounding error and listed in `run.user_events`. Each function can have the attributes
        `direction` (1 or -1 for rising or falling zeros only) and `terminal` (True to end the run
        with `Status.STOPPED`, or the number of the event that does). They must not remember earlier
        calls. They are also among `run.events`.
    progress : callable or bool, optional
        Function that is called with the completed fraction. If it returns False, the run is
        cancelled. If True, a progress bar is shown (requires tqdm).
    estimate : bool, optional
        Whether to estimate the error with a second run that uses half the step or a tighter
        tolerance. By default, this is done unless `tau` is a Python function, which may have
        internal state. If there is no estimate, it is nan and `message` contains the reason.
    wrt : str or sequence of str, optional
        Parameters with respect to which the run is differentiated. They can be paths in the model
        as for `sweep` ("bodies.arm.mass", or the name of a parameter), initial values ("q.arm" and
        "v.arm") or inputs ("inputs.knee"). The derivatives are available from
        `run.sensitivity(path)` and `run.gradient(function)`. They refer to the discrete steps, with
        constant step sizes.

    Returns
    -------
    Result
        The recorded motion. Numerical failures do not raise an exception, but are reported in its
        `status`.

    Raises
    ------
    InputError
        If an argument is invalid.

    Examples
    --------
    A double pendulum that swings for two seconds:

        run = pg.simulate(pg.Model.serial(2), t_end=2.0)
        print(run.q[-1], run.error_estimate)
    """
    (began, _), loaded = clocks(), LOADING.seconds
    mech = mechanism_of(mechanism, "simulate")
    asked = {"tau": tau, "forces": forces}
    if tau is not None:
        mech, forces, tau = torques_or_drives(mech, forces, tau)
    if sample is not None:
        refuse_unsampled(tau, asked["tau"])
    memory = None
    if start is not None:
        given = {"q": q, "v": v, "states": states, "t_start": t_start or None}
        q, v, states, t_start, memory = state_of(mech, start, "simulate", given)
    call = {
        "t_start": t_start, "t_end": t_end, "method": method, "step": step, "rtol": rtol,
        "atol": atol, "max_steps": max_steps, **asked, "frames": frames, "t_eval": t_eval,
        "scenario": scenario, "inputs": inputs, "stabilise": stabilise,
        "switches": switches, "states": states, "q": q, "v": v,
    }  # fmt: skip
    told: tuple[str, ...] = ()
    if mech.divided and estimate is not False and refines(mech):
        mech, told = fine_enough(mech, simulate, call)
        q, v = call["q"], call["v"]
    options = Options.unchecked(
        scenario=scenario, t_start=t_start, t_end=t_end, method=method, step=step, rtol=rtol,
        atol=atol, max_steps=max_steps, frames=frames, t_eval=t_eval, stabilise=stabilise,
        forces=forces, switches=switches, estimate=estimate, sample=sample,
        inputs=() if inputs is None else inputs_of(inputs, "simulate"), memory=memory,
    )  # fmt: skip
    if q is not None or v is not None:
        refuse_interval(q, v, t_end)
        q, v = by_names(mech, scenario, q, v, tau)
    plan = plan_of(mech, options, tau, q, v)
    if states is not None:
        plan = begun_with(plan, given_states(mech, states))
    state = plan.start
    if q is not None or v is not None:
        state = with_state(mech, state, q, v, float(plan.times[0]))
    tau = plan.tau if tau is None else tau
    monitors = () if events is NO_EVENTS else monitors_of(events, (mech.nq, mech.nv))
    record = Recording(mech, plan, *state, tau, monitors)
    if len(wrt):
        from .sensitivity import derivatives_of

        record.carried = derivatives_of(record, options, q, v, wrt)
    said = notices_of_start(mech, options, (q, v, states), state[0])
    said += unread(mech.model) if start is not None else []
    result = _recorded(record, progress, estimate, (began, loaded), said)
    if mech.divided and estimate is not False:
        result = with_space_error(result, simulate, call, told)
    return result


def _recorded(
    record: Recording, progress: Any, estimate: bool | None, since: tuple[float, float],
    said: list[str],
) -> Result:  # fmt: skip
    """Step a run, estimate its error and return its result. `since` are the time at which the call
    began and that spent on loading kernels until then [s], and `said` the notices of its start.
    """
    (began, loaded), (built, busy) = since, clocks()
    with shown_progress(progress, "simulate") as bar:
        record.run(bar)
    stepped, busy = clocks()[0], clocks()[1] - busy
    error = error_estimate(record, estimate)
    timing = {
        "build": built - began,
        "step": stepped - built,
        "step_processor": busy,  # without the time of other programs
        "estimate": clocks()[0] - stepped,
        "load": LOADING.seconds - loaded,  # kernels, once in a program
    }
    record.ended.notices[:0] = said  # a run that comes near something at once begins anew
    result = result_of(record, error, timing)
    record.leave()
    return result


@explained
def simulate_batch(
    mechanism: Mechanism | Model, q: Any = None, v: Any = None, **options: Any
) -> Runs:
    """Simulate a mechanism or a model from each of several initial states.

    A `pg.BatchStepper` steps many states at once, and `pg.sweep` varies the model.

    Parameters
    ----------
    mechanism : Mechanism or Model
        The system to simulate.
    q, v : (n, nq) and (n, nv) arrays, or dict
        Initial states, one in each row. One of them may be None, or a single row for all runs.
    **options
        Other arguments of `simulate`. If `start` is a list of runs, each of them goes on.

    Returns
    -------
    list of Result
        The runs, in the order of the rows. `runs["arm"]` is the list of the column of each run.

    Raises
    ------
    InputError
        If an argument is invalid.

    Examples
    --------
    >>> model = pg.Model.serial(2)
    >>> runs = pg.simulate_batch(model, q=[[0.1, 0.0], [0.2, 0.0]], t_end=1.0)
    """
    mech = mechanism_of(mechanism, "simulate_batch")
    if isinstance(starts := options.get("start"), (list, tuple)):
        return Runs(simulate(mech, q, v, **{**options, "start": run}) for run in starts)
    options = words.renamed(options, ("q", "v")) or options
    q, v = options.pop("q", q), options.pop("v", v)
    return Runs(simulate(mech, *state, **options) for state in rows_of(mech, q, v))
