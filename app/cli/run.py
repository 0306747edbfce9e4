"""`pgraph run MODEL`: simulate, and print status, accuracy and cost."""

from __future__ import annotations

import time
from argparse import ArgumentParser, Namespace
from typing import Any

import pgraph_core as pg

from .terminal import (
    Answer,
    compile_kernels,
    first_scenario,
    model_argument,
    open_model,
    positive,
    progress_bar,
    tolerance,
)

HELP = "simulate; print status, error estimate, energy and cost"


def arguments(parser: ArgumentParser) -> None:
    model_argument(parser)
    parser.add_argument("--scenario", help="default: the model's first one")
    parser.add_argument("--t-end", type=positive, metavar="S", help="duration [s]")
    parser.add_argument("--method", help="integration method; default: the scenario's, else auto")
    parser.add_argument("--step", type=positive, metavar="S", help="step [s]")
    parser.add_argument(
        "--rtol", type=tolerance, metavar="R", help="relative tolerance of adaptive steps"
    )
    parser.add_argument("-o", "--output", metavar="FILE", help="write the run to FILE (.npz)")


def answer(args: Namespace) -> Answer:
    model = open_model(args.model)
    scenario = first_scenario(model, args.scenario)
    asked = {name: getattr(args, name) for name in ("t_end", "method", "step", "rtol")}
    options = {name: value for name, value in asked.items() if value is not None}
    bar = progress_bar()
    compiling = time.perf_counter()
    compile_kernels(bar)
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
    """The answer under the names of `Result`; energies and drifts as extremes."""
    return {
        "status": result.status.name,
        "message": result.message,
        "method": result.header["method"],
        "step": result.header["step"],
        "t": result.t[-1],
        "frames": len(result.t),
        "error_estimate": result.error_estimate,
        "accuracy": result.accuracy,
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
    first, last = data["energy"]
    counters = (
        f"{count} {name.replace('_', ' ')}" for name, count in data["counters"].items() if count
    )
    timing = (f"{name} {1e3 * seconds:.3g} ms" for name, seconds in data["timing"].items())
    return [
        f"{data['model']}{scenario}: {data['message']}",
        f"method             {data['method']}, {_steps(data)}, t = {data['t']:.6g} s",
        f"error estimate     {data['accuracy']}",
        f"energy             {first:.6g} J at the start, {last:.6g} J at the end",
        f"energy drift       {data['energy_drift']:.3g} of its range",
        f"constraint drift   {position:.3g} m, {velocity:.3g} m/s",
        f"cost               {', '.join(counters)}",
        f"time               {', '.join(timing)}",
        *plan.lines(),
        *(f"note               {text}" for text in data["notices"]),
        *([f"written            {data['output']}"] if "output" in data else []),
    ]


def _steps(data: dict[str, Any]) -> str:
    """The step, or the tolerance of adaptive steps."""
    if data["step"] is None:
        return f"steps to a tolerance of {data['header']['rtol']:g}"
    return f"step {data['step']:.6g} s"
