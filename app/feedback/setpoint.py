"""The response of a controlled motion to a step of a controller's setpoint."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np

import pgraph_core as pg
from pgraph_core.model.editing import free_name
from pgraph_core.signals import parsed, written
from pgraph_core.signals.meaning import dim_of
from pgraph_core.units import NONE, UNITS

from ..core.cells import Refusal
from ..signals import known_of
from . import NEAR

FRAMES = 200  # points of a curve
SETTLED = 0.02  # part of the step within which the signal stays once it has settled
LAST = 0.2  # part of the time over which a settled signal rests, as in the Plots tab


@dataclass(frozen=True)
class Response:
    """The change of a signal, over the size of a step, and of a controller's value."""

    name: str
    size: float = 0.0  # size of the step
    unit: str = ""  # unit of the size: "angle" and "length" follow the page's units
    curves: tuple[tuple[str, list[float], list[float]], ...] = ()  # name, times [s]
    overshoot: float = 0.0  # largest excess over the setpoint
    settled: float | None = None  # time from which on it stays SETTLED near its end [s], if it does
    left: float = 0.0  # error at the end
    problem: str = ""
    busy: bool = True


def answered(model: pg.Model, name: str, how: dict[str, Any]) -> Response:
    """Return the difference of two runs, in one of which the setpoint steps at the start.

    `how` holds arguments of `simulate`. Raises PgraphError, Refusal.
    """
    control = next((c for c in model.controls if c.name == name), None)
    if not isinstance(control, pg.PID) or not isinstance(control.signal, str):
        raise Refusal("only a PID controller of a signal has a setpoint that can step")
    dim = dim_of(parsed(control.signal), known_of(model).dim)
    unit = UNITS.get(NONE if dim is None else dim, "")
    size = NEAR.get(unit, 1.0)
    names = [c.name for c in model.controls]
    probe, jump = free_name("signal", names), free_name("step", names)
    read = pg.PID(name=probe, signal=0.0, setpoint=control.signal, kp=1.0)
    model = model.replace(controls=(*model.controls, read))
    before = _ran(model, how)
    once = pg.Sampled(name=jump, update=size, sample=2.0 * float(before.t[-1]))  # at t = 0 alone
    given = control.setpoint
    old = given.strip().removeprefix("=") if isinstance(given, str) else repr(given)
    model = model.replace(controls=(*model.controls, once))
    setpoint = f"=({old}) + {written('x', jump)}"
    after = _ran(model.edit(name, kind="control", setpoint=setpoint), how)
    t = before.t[before.t <= after.t[-1]]
    y, u = (
        np.interp(t, after.t, after.controls[x]) - np.interp(t, before.t, before.controls[x])
        for x in (probe, name)
    )
    y /= size
    read_as = control.signal.strip().removeprefix("=").strip()
    curves = tuple((x, t.tolist(), z.tolist()) for x, z in ((read_as, y), (f"x.{name}", u)))
    overshoot, left = max(float(y.max()) - 1.0, 0.0), 1.0 - float(y[-1])
    return Response(name, size, unit, curves, overshoot, _settled(t, y), left, busy=False)


def _settled(t: np.ndarray, y: np.ndarray) -> float | None:
    """Return the time from which on a curve stays near the mean of its last part, if that rests."""
    last = y[t >= t[-1] - LAST * (t[-1] - t[0])]
    if np.ptp(last) > SETTLED:
        return None
    outside = np.flatnonzero(np.abs(y - last.mean()) > SETTLED)
    return float(t[outside[-1] + 1]) if len(outside) else 0.0


def _ran(model: pg.Model, how: dict[str, Any]) -> pg.Result:
    """Return a run to its end. Raises Refusal."""
    run = pg.simulate(model, frames=FRAMES, estimate=False, **how)
    if not run.status.ok or len(run.t) < 2:
        raise Refusal(run.message or run.status.value)
    return run
