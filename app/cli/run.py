"""`pgraph run MODEL`: simulate, and say how it ended, how accurate it is and what it cost."""

from __future__ import annotations

import sys
from argparse import ArgumentParser, Namespace
from collections.abc import Callable
from typing import Any

import pgraph_core as pg

from . import given
from .answer import Answer

HELP = "simulate; print status, error estimate, energy and cost"
BAR = 30  # characters


def arguments(parser: ArgumentParser) -> None:
    parser.add_argument("model", metavar="MODEL", help="a file or the name of a built-in model")
    parser.add_argument("--scenario", help="default: the model's first one, if it has any")
    parser.add_argument("--t-end", type=given.duration, metavar="S", help="duration [s]")
    parser.add_argument("--method", help="the integrator; default: the scenario's, else auto")
    parser.add_argument("--step", type=given.duration, metavar="S", help="fixed step [s]")
    parser.add_argument("--rtol", type=given.duration, help="relative tolerance")
    parser.add_argument("-o", "--output", metavar="FILE", help="write the whole run to FILE (.npz)")


def answer(args: Namespace) -> Answer:
    model = given.model(args.model)
    scenario = args.scenario or next((s.name for s in model.scenarios), None)
    asked = {name: getattr(args, name) for name in ("t_end", "method", "step", "rtol")}
    options = {name: value for name, value in asked.items() if value is not None}
    if scenario is None:
        options.setdefault("t_end", 1.0)
    result = pg.simulate(pg.Mechanism(model), scenario=scenario, progress=progress_bar(), **options)
    if args.output:
        result.save(args.output)
    data = _facts(result, model, scenario) | ({"output": args.output} if args.output else {})
    return Answer(data, _text(data), code=0 if result.status.name == "DONE" else 1)


def _facts(result: Any, model: pg.Model, scenario: str | None) -> dict[str, Any]:
    return {
        "model": model.name,
        "scenario": scenario,
        "status": result.status.name,
        "message": result.status.value,
        "t_end": result.t[-1],
        "error_estimate": result.error_estimate,
        "energy": result.energy[-1],
        "energy_drift": result.energy_drift,
        "constraint_drift": result.constraint_drift.max(axis=0),
        "counters": result.counters,
        "timing": result.timing,
        "left_out": result.left_out,
        "header": result.header,
    }


def progress_bar() -> Callable[[float], bool] | None:
    """A bar on stderr where both outputs are a terminal; nothing in a pipe."""
    if not (sys.stderr.isatty() and sys.stdout.isatty()):
        return None

    def show(fraction: float) -> bool:
        done = round(BAR * fraction)
        end = "\n" if fraction >= 1 else ""
        print(f"\r[{'#' * done}{'.' * (BAR - done)}] {fraction:4.0%}", end=end, file=sys.stderr)
        return True

    return show


def _text(data: dict[str, Any]) -> str:
    return str(data)
