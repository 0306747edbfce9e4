"""`pgraph sweep MODEL`: run a model at many values of its fields, and write a table."""

from __future__ import annotations

import time
from argparse import ArgumentParser, ArgumentTypeError, Namespace
from collections.abc import Callable

import numpy as np

import pgraph_core as pg
from pgraph_core.sweeps.paths import SAMPLES

from .terminal import (
    Answer,
    Bar,
    aligned,
    compile_kernels,
    count,
    first_scenario,
    model_argument,
    open_model,
    positive,
    progress_bar,
    tolerance,
)

HELP = "run a model at many values of its fields; write a table"
SHOWN = 12  # rows of the table that are printed


def varied(text: str) -> tuple[str, np.ndarray]:
    """PATH=a:b:n, PATH=a:b or PATH=a,b,c."""
    path, _, given = text.rpartition("=")
    try:
        numbers = [float(x) for x in given.replace(":", ",").split(",")]
        if ":" in given and len(numbers) == 3:
            low, high, n = numbers
            if n != int(n) or not 1 <= n <= 1e6:
                raise ArgumentTypeError(f"needs a whole number of points; given {text!r}")
            return path, np.linspace(low, high, int(n))
    except ValueError:
        numbers = []
    if not path or not numbers or (":" in given and len(numbers) != 2):
        form = "must be PATH=first:last:points, PATH=low:high or PATH=1,2,3"
        raise ArgumentTypeError(f"{form}; given {text!r}")
    return path, np.array(numbers)


def arguments(parser: ArgumentParser) -> None:
    model_argument(parser)
    parser.add_argument(
        "--set", type=varied, action="append", required=True, metavar="PATH=VALUES",
        help="bodies.NAME.FIELD=first:last:points, or values with commas, or low:high for samples; "
        "may be repeated",
    )  # fmt: skip
    parser.add_argument(
        "--metric", action="append", required=True, metavar="NAME",
        help="as 'max knee' or energy_drift; may be repeated",
    )  # fmt: skip
    parser.add_argument("-o", "--output", metavar="FILE", help="the table: .csv or .parquet")
    parser.add_argument("--resume", action="store_true", help="go on where a sweep was interrupted")
    parser.add_argument("--samples", choices=SAMPLES, default="grid", help="default: grid")
    parser.add_argument("-n", type=count, metavar="N", help="number of samples")
    parser.add_argument("--seed", type=int, default=0, help="of the samples; default: 0")
    parser.add_argument("--workers", type=count, metavar="N", help="processes; default: all cores")
    parser.add_argument("--scheduler", metavar="ADDRESS", help="a Dask scheduler: tcp://host:8786")
    parser.add_argument("--scenario", help="default: the model's first one")
    parser.add_argument("--t-end", type=positive, metavar="S", help="duration [s]")
    parser.add_argument("--method", help="integration method; default: the scenario's, else auto")
    parser.add_argument("--step", type=positive, metavar="S", help="step [s]")
    parser.add_argument("--rtol", type=tolerance, metavar="R", help="relative tolerance")


def answer(args: Namespace) -> Answer:
    model = open_model(args.model)
    asked = {name: getattr(args, name) for name in ("t_end", "method", "step", "rtol")}
    bar = progress_bar()
    compile_kernels(bar)
    table = pg.sweep(
        model, dict(args.set), args.metric, first_scenario(model, args.scenario),
        samples=args.samples, n=args.n, seed=args.seed, workers=args.workers,
        scheduler=args.scheduler, out=args.output, resume=args.resume, progress=_with_time(bar),
        **{name: value for name, value in asked.items() if value is not None},
    )  # fmt: skip
    bar("", 1.0)
    columns = table.columns()
    failed = [int(i) for i in table.failed]
    data = {"model": model.name, "points": len(table), "failed": failed, "table": columns}
    return Answer(data, "\n".join(_lines(table, failed, args.output)))


def _with_time(bar: Bar) -> Callable[[float], bool]:
    began = time.perf_counter()

    def progress(fraction: float) -> bool:
        left = (time.perf_counter() - began) * (1.0 / fraction - 1.0)
        return bar(f"{left:6.0f} s  ", fraction)

    return progress


def _lines(table: pg.Sweep, failed: list[int], output: str | None) -> list[str]:
    names = [*table.paths, *table.values]
    columns = table.columns()
    rows = [[float(columns[name][i]) for name in names] for i in range(min(len(table), SHOWN))]
    more = len(table) - len(rows)
    return [
        aligned(rows, names),
        *([f"... and {more} more points"] if more else []),
        *(f"point {i} failed: {table.reason[i]}" for i in failed[:SHOWN]),
        *([f"{len(failed)} of {len(table)} points failed"] if len(failed) > SHOWN else []),
        *([f"written to {output}"] if output else []),
    ]
