"""Commands that measure: `pgraph report`, `stability`, `verify` and `bench`."""

from __future__ import annotations

import json
import sys
import time
from argparse import ArgumentParser, BooleanOptionalAction, Namespace
from importlib import import_module
from pathlib import Path
from typing import Any

import pgraph_core as pg
import pgraph_models
from pgraph_core.errors import FileError, InputError, Problem, choices

from .terminal import (
    FILES,
    METHODS,
    MODEL,
    NAMED,
    SCENARIO,
    T_END,
    Answer,
    Bar,
    aligned,
    command,
    count,
    first_scenario,
    numbers,
    open_model,
    positive,
    progress_bar,
    takes,
)

WITHIN = takes("--within", type=positive, metavar="S", help="time for all runs; default: 45 s")


def _writable(output: str | None, suffixes: tuple[str, ...]) -> None:
    """Check the output path in advance. Raises FileError if the suffix is unknown."""
    if output and Path(output).suffix.lower() not in suffixes:
        raise FileError(Problem(output, "", f"must end in {', '.join(suffixes)}"))


# -- report ----------------------------------------------------------------------------------------


@command(
    "report",
    "compare error and run time of all methods and of installed peers",
    takes("model", metavar="MODEL", nargs="?", help=NAMED),
    *FILES,
    takes("--case", metavar="NAME", help="a verification case instead of MODEL"),
    SCENARIO,
    T_END,
    METHODS,
    takes("--steps", type=numbers, metavar="S,S", help="default: h0 halved 8 times"),
    takes("--tolerances", type=numbers, metavar="R,R", help="default: 1e-2 .. 1e-12"),
    takes("--target", type=positive, metavar="E", help="error to recommend for"),
    takes("--rounds", type=count, default=3, help="rounds of timing; default: 3"),
    takes("--longest", type=positive, metavar="S", help="skip longer runs; default: 1"),
    WITHIN,
    takes(
        "--peers", action=BooleanOptionalAction, default=True, help="compare with other engines"
    ),
    takes("-o", "--output", metavar="FILE", help="write a page (.html), .json, .svg or .txt"),
)  # fmt: skip
def report(args: Namespace) -> Answer:
    """Run a study. Raises PgraphError. The exit code is 1 if no method reaches the target."""
    if (args.model is None) == (args.case is None):
        raise InputError(Problem("pgraph report", "", "give either a MODEL or --case NAME"))
    _writable(args.output, pg.Study.SUFFIXES)
    mech, options = _motion(args)
    bar = progress_bar()
    study = _study(mech, args, options, bar)
    data = json.loads(study.to_json())
    if args.output:
        study.save(args.output)
        data["output"] = args.output
    return Answer(data, str(study), _problem(study))


def _motion(args: Namespace) -> tuple[pg.Mechanism, dict[str, Any]]:
    if args.case is not None:
        return _case(args.case)
    model = open_model(args)
    scenario = first_scenario(model, args.scenario)
    return pg.Mechanism(model), {"scenario": scenario}


def _case(name: str) -> tuple[pg.Mechanism, dict[str, Any]]:
    """Return the mechanism of a case and its simulation options, except the method."""
    found = list(pgraph_models.cases(name))
    if len(found) > 1:
        text = f"names several cases; choose one of {choices([case.name for case in found], 40)}"
        raise InputError(Problem(f"case '{name}'", "", text))
    case = found[0]
    kept = {key: x for key, x in case.options.items() if key not in ("method", "step", "rtol")}
    kept["t_end"] = float(case.t[-1]) if case.t is not None else 1.0
    return pg.Mechanism(case.model), {**kept, "reference": case}


def _study(mech: pg.Mechanism, args: Namespace, options: dict[str, Any], bar: Bar) -> pg.Study:
    from pgraph_core.study.task import installed_peers

    asked = ("t_end", "methods", "steps", "tolerances", "target", "longest", "within")
    options |= {name: getattr(args, name) for name in asked if getattr(args, name) is not None}
    try:
        return pg.work_precision(
            mech,
            rounds=args.rounds,
            peers=tuple(installed_peers()) if args.peers else (),
            progress=lambda fraction: bar("measuring", fraction),
            **options,
        )
    finally:
        bar("", 1.0)


def _problem(study: pg.Study) -> str:
    """Return the reason for a missing recommendation, or ""."""
    if not any(row.ok for row in study.rows):
        return next((row.reason for row in study.rows if row.reason), "no run reached the end time")
    if study.target is None:
        return ""
    try:
        study.recommend()
    except InputError as unmet:
        return unmet.problems[0].text
    return ""


# -- stability -------------------------------------------------------------------------------------


def _axis(parser: ArgumentParser) -> None:
    from pgraph_core.study.axes import AXES

    help = "parameter to vary (default: the first one available)"
    parser.add_argument("--axis", choices=tuple(AXES), help=help)


@command(
    "stability",
    "compute a stability map of the methods for extreme parameters",
    *MODEL,
    _axis,
    takes("--values", type=numbers, metavar="X,X", help="default: values of the axis"),
    METHODS,
    takes("--steps", type=numbers, metavar="S,S", help="default: 0.1 to 1e-4 [s]"),
    T_END,
    takes("--target", type=positive, metavar="E", help="largest acceptable error"),
    SCENARIO,
    WITHIN,
    takes("-o", "--output", metavar="FILE", help="write a page (.html), .json, .svg or .txt"),
)
def stability(args: Namespace) -> Answer:
    """Make a map of one axis. Raises PgraphError."""
    _writable(args.output, pg.StabilityMap.SUFFIXES)
    asked = ("axis", "values", "methods", "steps", "t_end", "target", "within")
    options = {name: x for name in asked if (x := getattr(args, name)) is not None}
    model, bar = open_model(args), progress_bar()
    options["scenario"] = first_scenario(model, args.scenario)

    def shown(so_far: pg.StabilityMap) -> None:
        bar.table = tuple(so_far.grid)

    try:
        found = pg.stability_map(model, progress=lambda x: bar("map", x), partial=shown, **options)
    finally:
        bar("", 1.0)
    if args.output:
        found.save(args.output)
    return Answer(found.to_dict() | ({"output": args.output} if args.output else {}), str(found))


# -- the command for verifying Pgraph itself: `pgraph verify` --------------------------------------


HEADER = (
    "case", "compared", "error", "target", "reference", "time [s]", "steps", "method", "verdict"
)  # fmt: skip


def tell(text: str) -> None:
    """Print progress over the last line of a terminal, or do nothing if output is piped."""
    if sys.stderr.isatty():
        print(f"\r\033[K{text}", end="", file=sys.stderr, flush=True)


@command(
    "verify",
    "run verification cases; print errors, targets and cost; exit code 1 if one fails",
    takes(
        "names", metavar="NAME", nargs="*",
        help="a case, a family of cases such as chain_n_links, or a case file; default: all",
    ),
)  # fmt: skip
def verify(args: Namespace) -> Answer:
    """Run verification cases. Raises PgraphError for an unknown name."""
    wanted = args.names or pgraph_models.case_names()
    chosen = [case for name in wanted for case in _cases(name)]
    began = time.perf_counter()
    rows = []
    for i, case in enumerate(chosen):
        tell(f"{case.name}  ({i + 1} of {len(chosen)}, {time.perf_counter() - began:.0f} s)")
        rows.append(facts(pg.verify(case)))
    tell("")
    missed = [row["case"] for row in rows if not row["ok"]]
    summary = f"{len(rows) - len(missed)} of {len(rows)} cases reach their targets"
    table = aligned((_cells(row) for row in rows), HEADER)
    problem = f"missed: {', '.join(missed)}" if missed else ""
    return Answer({"cases": rows}, f"{table}\n\n{summary}", problem)


def _cases(name: str) -> tuple[pg.Case, ...]:
    """Return the built-in cases with a name, or those in a file."""
    return pg.load_cases(name) if Path(name).suffix == ".json" else pgraph_models.cases(name)


def facts(verdict: pg.Verdict) -> dict[str, Any]:
    """Return one result as a dictionary with stable keys for scripts."""
    run, case = verdict.run, verdict.case
    return {
        "case": case.name,
        "compared": verdict.observable.name,
        "error": verdict.error,
        "target": verdict.observable.target,
        "reference_accuracy": case.accuracy,
        "seconds": verdict.seconds,
        "steps": run.counters["steps"] if run else 0,
        "method": run.header["method"] if run else "",
        "ok": verdict.ok,
        "message": run.message if run else "",
    }


def _cells(row: dict[str, Any]) -> tuple[Any, ...]:
    return (
        row["case"],
        row["compared"],
        f"{row['error']:.1e}",
        f"{row['target']:.0e}",
        f"{row['reference_accuracy']:.0e}",
        f"{row['seconds']:.2g}",
        row["steps"],
        row["method"] or "none",
        "ok" if row["ok"] else "MISSED",
    )


# -- `pgraph bench`: list and run the benchmarks. They are only available in a clone ---------------


ROOT = Path(__file__).resolve().parent.parent.parent


@command(
    "bench",
    "run benchmarks, most of them against other programs (in a clone)",
    takes("names", metavar="NAME", nargs="*", help="benchmarks, or `all`; without: list them"),
    takes("--quick", action="store_true", help="only use the smallest sizes"),
    takes("-o", "--output", type=Path, metavar="FILE", help=".json, .csv, .md, .txt"),
    takes(
        "--against", type=Path, metavar="FILE",
        help="a .json of an earlier run; exit code 1 if a ratio to a peer fell by 25 %%",
    ),
)  # fmt: skip
def bench(args: Namespace) -> Answer:
    """Run the benchmarks. Raises InputError outside a clone, or for an unknown name."""
    if not (ROOT / "benchmarks" / "__init__.py").is_file():
        text = "the package is installed without the benchmarks; run it in a clone of Pgraph"
        raise InputError(Problem("pgraph bench", "", text))
    if str(ROOT) not in sys.path:
        sys.path.insert(0, str(ROOT))
    return Answer(*import_module("benchmarks.command").answer(args, tell))
