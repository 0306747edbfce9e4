"""`pgraph run MODEL`: simulate, and say how it ended, how accurate it is and what it cost."""

from __future__ import annotations

import math
import time
from argparse import ArgumentParser, Namespace
from typing import Any

import pgraph_core as pg
from pgraph_core.engine import warm_up

from . import given
from .answer import Answer
from .bar import progress_bar

HELP = "simulate; print status, error estimate, energy and cost"


def arguments(parser: ArgumentParser) -> None:
    parser.add_argument("model", metavar="MODEL", help="a file or the name of a built-in model")
    parser.add_argument("--scenario", help="default: the model's first one, if it has any")
    parser.add_argument("--t-end", type=given.duration, metavar="S", help="duration [s]")
    parser.add_argument("--method", help="the integrator; default: the scenario's, else auto")
    parser.add_argument("--step", type=given.duration, metavar="S", help="step [s]")
    parser.add_argument(
        "--rtol", type=given.tolerance, metavar="R", help="tolerance of a step; it is then chosen"
    )
    parser.add_argument("-o", "--output", metavar="FILE", help="write the whole run to FILE (.npz)")


def answer(args: Namespace) -> Answer:
    model = given.model(args.model)
    scenario = args.scenario or next((s.name for s in model.scenarios), None)
    asked = {name: getattr(args, name) for name in ("t_end", "method", "step", "rtol")}
    options = {name: value for name, value in asked.items() if value is not None}
    bar = progress_bar()
    compiling = time.perf_counter()
    for i, n, _ in warm_up():  # apart, so that the run's time is the run's
        bar("compiling", i / n)
    compiling = time.perf_counter() - compiling
    result = pg.simulate(
        pg.Mechanism(model),
        scenario=scenario,
        progress=lambda fraction: bar("running", fraction),
        **options,
    )
    bar("", 1.0)
    if args.output:
        result.save(args.output)
    data = {"model": model.name, "scenario": scenario} | facts(result)
    data["timing"] = {"compile": compiling} | data["timing"]
    if args.output:
        data["output"] = args.output
    return Answer(
        data, "\n".join(_lines(data, result.plan)), "" if result.status.ok else result.message
    )


def facts(result: pg.Result) -> dict[str, Any]:
    """What a run says of itself, under the names of `Result`; energies and drifts as extremes."""
    return {
        "status": result.status.name,
        "message": result.message,
        "method": result.header["method"],
        "step": result.header["step"],
        "t": result.t[-1],
        "frames": len(result.t),
        "error_estimate": result.error_estimate,
        "energy": [result.energy[0], result.energy[-1]],
        "energy_drift": result.energy_drift,
        "constraint_drift": result.constraint_drift.max(axis=0),
        "counters": result.counters,
        "timing": result.timing,
        "plan": result.plan.to_dict(),
        "left_out": result.left_out,
        "notices": result.notices,
        "header": result.header,
    }


def _lines(data: dict[str, Any], plan: pg.Plan) -> list[str]:
    scenario = f", scenario {data['scenario']}" if data["scenario"] else ""
    position, velocity = data["constraint_drift"]
    counters = (
        f"{count} {name.replace('_', ' ')}" for name, count in data["counters"].items() if count
    )
    timing = (f"{name} {1e3 * seconds:.3g} ms" for name, seconds in data["timing"].items())
    return [
        f"{data['model']}{scenario}: {data['message']}",
        f"method             {data['method']}, {_steps(data)}, t = {data['t']:.6g} s",
        f"error estimate     {_estimate(data)}",
        f"energy             {data['energy'][0]:.6g} J at first, {data['energy'][1]:.6g} J at last",
        f"energy drift       {data['energy_drift']:.3g} of its range",
        f"constraint drift   {position:.3g} m, {velocity:.3g} m/s",
        f"cost               {', '.join(counters)}",
        f"time               {', '.join(timing)}",
        *plan.lines(),
        *(f"note               {text}" for text in data["notices"]),
        *([f"written            {data['output']}"] if "output" in data else []),
    ]


def _steps(data: dict[str, Any]) -> str:
    """How the steps were chosen."""
    if data["step"] is None:
        return f"steps to a tolerance of {data['header']['rtol']:g}"
    return f"step {data['step']:.6g} s"


def _estimate(data: dict[str, Any]) -> str:
    error = data["error_estimate"]
    if math.isnan(error):
        ended = data["status"] == "DONE"
        why = "a function gives the torques" if ended else "the run did not reach its end"
        return f"none: {why}"
    return f"{error:.3g} rad or m"
