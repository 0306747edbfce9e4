"""Commands for simulation: `pgraph run`, `pgraph sweep` over many values, `pgraph export`."""

from __future__ import annotations

import re
from argparse import ArgumentParser, ArgumentTypeError, Namespace
from pathlib import Path
from typing import Any

import numpy as np

import pgraph_core as pg
from pgraph_core.errors import FileError, Problem, needed, percent
from pgraph_core.model.files import write_atomic
from pgraph_core.result.logs import NEEDED

from .terminal import (
    MODEL,
    RUN,
    SCENARIO,
    T_END,
    Answer,
    aligned,
    command,
    count,
    first_scenario,
    names,
    open_model,
    positive,
    progress_bar,
    settings,
    takes,
    whole,
)

SHOWN = 12  # rows of a sweep's table that are printed


# -- run -------------------------------------------------------------------------------------------


def divided(text: str) -> tuple[str, int | str]:
    """Return the beam and the number of its segments in 'BEAM=N'. Raises ArgumentTypeError."""
    beam, mark, number = text.rpartition("=")
    if not mark or not (number.isdecimal() or number == "auto"):
        raise ArgumentTypeError(f"{text!r} must be BEAM=N or BEAM=auto, as in rod=40")
    return beam, number if number == "auto" else int(number)


@command(
    "run",
    "simulate; print status, error estimate, energy and cost",
    *MODEL,
    *RUN,
    takes(
        "--nodes",
        type=divided,
        action="append",
        default=[],
        metavar="BEAM=N",
        help="segments of a beam, or BEAM=auto; repeatable",
    ),
    takes(
        "-o",
        "--output",
        metavar="FILE",
        help="write the run to FILE: .npz, .csv, .mat, .mcap, .rrd or .html",
    ),
)
def run(args: Namespace) -> Answer:
    _writable(args.output)
    model = open_model(args, told=True)
    for beam, number in args.nodes:
        model = model.edit(model.part(beam, "beam").name, kind="beam", nodes=number)
    scenario = first_scenario(model, args.scenario)
    bar = progress_bar()
    bar("loading", 0.0)  # kernels: at a first start a second or two
    result = pg.simulate(
        pg.Mechanism(model),
        scenario=scenario,
        progress=lambda fraction: bar("running", fraction),
        **settings(args),
    )
    bar("", 1.0)
    if args.output and args.output.lower().endswith(".html"):
        result.to_html(args.output)
    elif args.output:
        result.save(args.output)
    data = {"model": model.name, "scenario": scenario} | facts(result)
    if args.output:
        data["output"] = args.output
    return Answer(data, "\n".join(_run_lines(data)), "" if result.status.ok else result.message)


def _writable(output: str | None) -> None:
    """Check the output path in advance. Raises FileError, MissingPackage."""
    suffix = Path(output).suffix.lower() if output else ".npz"
    if suffix not in (".npz", ".csv", ".mat", ".mcap", ".rrd", ".html"):
        text = "must end in .npz (the whole run), .csv or .mat (tables), .mcap or .rrd (logs) or "
        text += ".html (a figure that plays it)"
        raise FileError(Problem(str(output), "", text))
    if suffix in NEEDED:
        needed(*NEEDED[suffix])


def facts(result: pg.Result) -> dict[str, Any]:
    """Return the answer keyed by the attributes of `Result`, with energy and drift extremes."""
    return {
        "status": result.status.name,
        "message": result.message,
        "method": result.header["method"],
        "step": result.header["step"],
        "t": result.t[-1],
        "frames": len(result.t),
        "error_estimate": result.error_estimate,
        "accuracy": result.accuracy,
        **({"space_error": result.space_error} if result.model.beams else {}),
        "energy": [result.energy[0], result.energy[-1]],
        "energy_drift": result.energy_drift,
        "constraint_drift": result.constraint_drift.max(axis=0),
        "counters": result.counters,
        "timing": result.timing,
        "notices": result.notices,
        "header": result.header,
    }


def _in_space(error: float) -> str:
    return f"{error:.2g} m, of the segments of beams" if np.isfinite(error) else "not estimated"


def _run_lines(data: dict[str, Any]) -> list[str]:
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
        *(
            [f"error in space     {_in_space(data['space_error'])}"]
            if "space_error" in data
            else []
        ),
        f"energy             {first:.6g} J at the start, {last:.6g} J at the end",
        f"energy drift       {percent(data['energy_drift'])} of its range",
        f"constraint drift   {position:.3g} m, {velocity:.3g} m/s",
        f"cost               {', '.join(counters)}",
        f"time               {', '.join(timing)}",
        *(f"note               {text}" for text in data["notices"]),
        *([f"written            {data['output']}"] if "output" in data else []),
    ]


def _steps(data: dict[str, Any]) -> str:
    """Return the step size, or the tolerance for adaptive steps."""
    if data["step"] is None:
        return f"steps to a tolerance of {data['header']['rtol']:g}"
    return f"step {data['step']:.6g} s"


# -- sweep -----------------------------------------------------------------------------------------


def varied(text: str) -> tuple[str, np.ndarray | tuple[float, ...]]:
    """Parse PATH=a:b:n or PATH=a,b,c, or PATH=a:b, which is a pair rather than an array."""
    path, _, given = text.rpartition("=")
    try:
        numbers = [float(x) for x in given.replace(":", ",").split(",")]
        if ":" in given and len(numbers) == 3:
            low, high, n = numbers
            if n != int(n) or not 1 <= n <= 1e6:
                raise ArgumentTypeError(f"needs a whole number of points, got {text!r}")
            return path, np.linspace(low, high, int(n))
    except ValueError:
        numbers = []
    if not path or not numbers or (":" in given and len(numbers) != 2):
        form = "must be PATH=first:last:points, PATH=low:high or PATH=1,2,3"
        raise ArgumentTypeError(f"{form}, got {text!r}")
    return path, tuple(numbers) if ":" in given else np.array(numbers)


def _samples(parser: ArgumentParser) -> None:
    from pgraph_core.sweeps.sweep import SAMPLES  # other commands need no kernels

    parser.add_argument("--samples", choices=SAMPLES, default="grid", help="default: grid")


@command(
    "sweep",
    "run a parameter sweep and write a table",
    *MODEL,
    takes(
        "--set", type=varied, action="append", required=True, metavar="PATH=VALUES",
        help="bodies.NAME.FIELD=first:last:points, or values with commas, or low:high for samples; "
        "may be repeated",
    ),
    takes("--metric", action="append", required=True, metavar="NAME",
          help="such as 'max knee' or energy_drift; may be repeated"),
    takes("-o", "--output", metavar="FILE", help="the table: .csv or .parquet"),
    takes("--resume", action="store_true", help="continue an interrupted sweep"),
    _samples,
    takes("-n", type=count, metavar="N", help="number of samples"),
    takes("--seed", type=whole(0), default=0, help="seed of the samples; default: 0"),
    takes("--workers", type=count, metavar="N", help="processes; default: all cores"),
    takes("--scheduler", metavar="ADDRESS", help="a Dask scheduler: tcp://host:8786"),
    *RUN,
)  # fmt: skip
def sweep(args: Namespace) -> Answer:
    model = open_model(args)
    given = [path for path, _ in args.set]
    if twice := next((path for path in given if given.count(path) > 1), None):
        text = "is given twice: write all its values in one --set, as PATH=1,2,3"
        raise pg.InputError(pg.Problem("sweep", twice, text))
    for path, values in args.set if args.samples == "grid" else ():
        if isinstance(values, tuple):
            text = "is a range without a number of points: write PATH=first:last:points, "
            raise pg.InputError(pg.Problem("sweep", path, f"{text}or --samples"))
    bar = progress_bar()
    table = pg.sweep(
        model, dict(args.set), args.metric, first_scenario(model, args.scenario),
        samples=args.samples, n=args.n, seed=args.seed, workers=args.workers,
        scheduler=args.scheduler, out=args.output, resume=args.resume,
        progress=lambda x: bar("sweep", x), **settings(args),
    )  # fmt: skip
    bar("", 1.0)
    columns = table.columns()
    failed = [int(i) for i in table.failed]
    data = {"model": model.name, "points": len(table), "failed": failed, "table": columns}
    problem = f"{len(failed)} of {len(table)} points failed" if failed else ""
    return Answer(data, "\n".join(_table_lines(table, failed, args.output)), problem)


def _table_lines(table: pg.Sweep, failed: list[int], output: str | None) -> list[str]:
    names = [*table.paths, *table.values]
    columns = table.columns()
    rows = [[float(columns[name][i]) for name in names] for i in range(min(len(table), SHOWN))]
    more = len(table) - len(rows)
    return [
        aligned(rows, names),
        *([f"... and {more} more points"] if more else []),
        *(f"point {i} failed: {table.reason[i]}" for i in failed[:SHOWN]),
        *([f"written to {output}"] if output else []),
    ]


# -- export ----------------------------------------------------------------------------------------


def size(text: str) -> tuple[int, int]:
    """Parse a width and height in pixels."""
    found = re.fullmatch(r"(\d{1,5})x(\d{1,5})", text)
    if not found:
        raise ArgumentTypeError(f"must be WIDTHxHEIGHT in pixels, such as 1280x720, got {text!r}")
    return int(found[1]), int(found[2])


USUAL = {
    "what": "view", "columns": (), "at": None, "size": None, "view": "start", "dark": False,
    "fps": 30.0, "speed": 1.0, "fmi": 3, "kind": None, "platform": None, "method": None,
    "step": None, "rtol": None, "input": None,
}  # fmt: skip
TAKES = {  # the options that each kind of file accepts
    "page": (),
    "FMU": ("fmi", "kind", "platform", "method", "step", "rtol", "input"),
    "film": ("size", "view", "dark", "fps", "speed"),
    "picture of the view": ("what", "at", "size", "view", "dark"),
    "picture of the digraph": ("what", "size"),
    "picture of the plot": ("what", "columns", "size"),
}


@command(
    "export",
    "write an interactive figure, a picture, a film or an FMU",
    *MODEL, SCENARIO, T_END,
    takes("--live", action="store_true", help="an interactive figure with kernels and sliders"),
    takes(
        "--open", action="append", default=[], metavar="PATH[=LOW:HIGH]",
        help="parameter with a slider, or of an FMU, as bodies.lower.mass=0.2:5; may be repeated",
    ),
    takes("--what", choices=("view", "digraph", "plot"), default="view", help="in a picture"),
    takes("--columns", type=names, default=(), metavar="A,B",
          help="columns of a plot; default: all joints"),
    takes("--at", type=float, metavar="S", help="time of a picture [s]"),
    takes("--size", type=size, metavar="WxH", help="in pixels, as 1280x720"),
    takes("--view", choices=("start", "front", "side", "top", "isometric"), default="start"),
    takes("--dark", action="store_true", help="dark background of a picture or film"),
    takes("--fps", type=positive, default=30.0, help="frames per second of a film"),
    takes("--speed", type=positive, default=1.0, help="speed of a film: 0.5 is slow motion"),
    takes("--fmi", type=int, choices=(2, 3), default=3, help="version of an FMU"),
    takes("--kind", action="append", choices=("cs", "me"),
          help="co-simulation or model exchange of an FMU; default: each that is possible"),
    takes("--input", action="append", metavar="NAME",
          help="of an FMU: a motor, servo, actuator or wrench; default: all but wrenches; may be "
          "repeated"),
    takes("--platform", action="append", metavar="NAME",
          help="of an FMU, such as x86_64-linux; default: all; may be repeated"),
    takes("--method", help="of an FMU: rk4, semi_implicit_euler, dopri5, dop853 or moreau_jean"),
    takes("--step", type=positive, metavar="S", help="step of an FMU [s]"),
    takes("--rtol", type=positive, help="tolerance of an FMU whose method chooses its steps"),
    takes(
        "-o", "--output", required=True, metavar="FILE",
        help="a page (.html), a picture (.png; plot, digraph: .svg), a film (.mp4, .gif) or an FMU "
        "(.fmu)",
    ),
)  # fmt: skip
def export(args: Namespace) -> Answer:
    """Raises PgraphError."""
    suffix = Path(args.output).suffix.lower()
    if suffix in (".mp4", ".gif"):
        kind = "film"
    elif suffix == ".fmu":
        kind = "FMU"
    else:
        kind = f"picture of the {args.what}" if suffix in (".png", ".svg") else "page"
    for option, usual in USUAL.items():
        if getattr(args, option) != usual and option not in TAKES[kind]:
            text = f"--{option} does not apply to a {kind}; remove it, or use another kind of file"
            raise FileError(Problem(args.output, "", text))
    if kind == "FMU":
        return _fmu(args)
    return _page(args) if kind == "page" else _drawn(args, kind == "film")


def _fmu(args: Namespace) -> Answer:
    """Write an FMU, and tell what its variables are."""
    if args.live or args.t_end is not None:
        option = "--live" if args.live else "--t-end"
        text = f"{option} does not apply to an FMU; remove it, or use another kind of file"
        raise FileError(Problem(args.output, "", text))
    model = open_model(args)
    scenario, others = first_scenario(model, args.scenario), {"step": args.step, "rtol": args.rtol}
    report = pg.write_fmu(
        model, args.output, version=args.fmi, kinds=args.kind, scenario=scenario,
        inputs=args.input, parameters=args.open, platforms=args.platform,
        method=args.method or "auto", **others,
    )  # fmt: skip
    size = Path(args.output).stat().st_size
    data = {"model": model.name, "scenario": scenario, "output": args.output, "bytes": size}
    lines = [f"{args.output}: {size / 1e6:.2f} MB, FMI {args.fmi}.0 of {model.name}"]
    lines += [f"{entry.where} {entry.text}" for entry in report.of("read")]
    lines += [f"note: {e.where}: {e.text}" for kind in ("left out", "warning")
              for e in report.of(kind)]  # fmt: skip
    return Answer(data | {"report": report.to_dict()}, "\n".join(lines))


def _drawn(args: Namespace, film: bool) -> Answer:
    """Render an image or a video."""
    from pgraph_core.show import pictures  # other commands need none of it

    model, bar = open_model(args), progress_bar()
    scenario = first_scenario(model, args.scenario)
    look = {"view": args.view, "dark": args.dark}
    sized = {} if args.size is None else {"size": args.size}
    if args.live or args.open:
        raise FileError(Problem(args.output, "", "is no page"))
    shown = f"the {args.what}" if args.what != "view" else "the mechanism"
    if args.what == "digraph":
        model.to_image(args.output, what="digraph", **sized)
    elif not film and args.what == "view" and args.at is None and args.scenario is None:
        model.to_image(args.output, **sized, **look)
    else:
        run = pg.simulate(model, scenario=scenario, **settings(args))
        if args.what == "plot":
            write_atomic(args.output, pictures.plot(run, args.output, args.columns, **sized))
        elif film:
            told = lambda fraction: bar("drawing", fraction)  # noqa: E731
            run.to_film(args.output, fps=args.fps, speed=args.speed, progress=told, **sized, **look)
            shown = f"{run.t[-1] - run.t[0]:g} s of motion"
        else:
            time = float(run.t[0]) if args.at is None else args.at
            run.to_image(args.output, t=time, **sized, **look)
            shown += f" at {time:g} s"
    bar("", 1.0)
    count = Path(args.output).stat().st_size
    data = {"model": model.name, "scenario": scenario, "output": args.output, "bytes": count}
    return Answer(data, f"{args.output}: {count / 1e6:.2f} MB, {shown} of {model.name}")


def _page(args: Namespace) -> Answer:
    from pgraph_core.live.export import exported  # other commands need none of it

    model, bar = open_model(args), progress_bar()
    scenario, why = first_scenario(model, args.scenario), ""
    bar("loading", 0.0)
    if args.live or args.open:
        result, why = exported(model, scenario, args.open, args.t_end, Path(args.output))
    else:
        result = pg.simulate(model, scenario=scenario, **settings(args))
        result.to_html(args.output)
    bar("", 1.0)
    size = Path(args.output).stat().st_size
    data = {"model": model.name, "scenario": scenario, "output": args.output, "bytes": size}
    lines = [f"{args.output}: {size / 1e6:.2f} MB, {result.t[-1]:g} s of {model.name}"]
    lines += [f"note: recorded only: {why}"] if why else []
    if args.live and model.bodies and not (args.open or why):
        field = f"bodies.{model.bodies[0].name}.mass"
        lines += [f"note: readers can play and pull; let them change numbers with --open {field}"]
    return Answer(data | {"live": args.live and not why, "note": why}, "\n".join(lines))
