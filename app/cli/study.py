"""Commands for comparing methods: `pgraph report` and `pgraph stability`."""

from __future__ import annotations

import json
from argparse import ArgumentParser, BooleanOptionalAction, Namespace
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
    Answer,
    Bar,
    command,
    count,
    first_scenario,
    numbers,
    open_model,
    positive,
    progress_bar,
    takes,
)

T_END = takes("--t-end", type=positive, metavar="S", help="duration [s]")


def _writable(output: str | None, suffixes: tuple[str, ...]) -> None:
    """Check the output path in advance. Raises FileError if the suffix is unknown."""
    if output and Path(output).suffix.lower() not in suffixes:
        raise FileError(Problem(output, "", f"must end in {', '.join(suffixes)}"))


# -- report ----------------------------------------------------------------------------------------


@command(
    "report",
    "error against run time of every method and of the installed peers",
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
    takes("--longest", type=positive, metavar="S", help="leave out longer runs; default: 1"),
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

    asked = ("t_end", "methods", "steps", "tolerances", "target", "longest")
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
    """Return the reason why the study recommends nothing, or ""."""
    if not any(row.ok for row in study.rows):
        return next((row.reason for row in study.rows if row.reason), "no run reached the end")
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

    help = "what to vary (default: the first that the model has)"
    parser.add_argument("--axis", choices=tuple(AXES), help=help)


@command(
    "stability",
    "which methods stay accurate as a model is made stiff or extreme",
    *MODEL,
    _axis,
    takes("--values", type=numbers, metavar="X,X", help="default: those of the axis"),
    METHODS,
    takes("--steps", type=numbers, metavar="S,S", help="default: 0.1 to 1e-4 [s]"),
    T_END,
    takes("--target", type=positive, metavar="E", help="largest error that is OK"),
    takes("--scenario", help="default: none"),
    takes("-o", "--output", metavar="FILE", help="write a page (.html), .json, .svg or .txt"),
)
def stability(args: Namespace) -> Answer:
    """Make a map of one axis. Raises PgraphError."""
    _writable(args.output, pg.StabilityMap.SUFFIXES)
    asked = ("axis", "values", "methods", "steps", "t_end", "target", "scenario")
    options = {name: x for name in asked if (x := getattr(args, name)) is not None}
    bar = progress_bar()
    try:
        found = pg.stability_map(open_model(args), progress=lambda x: bar("map", x), **options)
    finally:
        bar("", 1.0)
    if args.output:
        found.save(args.output)
    return Answer(found.to_dict() | ({"output": args.output} if args.output else {}), str(found))
