"""`pgraph report MODEL`: error against run time of each method and of the installed peers."""

from __future__ import annotations

import json
from argparse import ArgumentParser, BooleanOptionalAction, Namespace
from pathlib import Path
from typing import Any

import pgraph_core as pg
import pgraph_models
from pgraph_core.errors import FileError, InputError, Problem, choices

from .terminal import (
    Answer,
    Bar,
    compile_kernels,
    count,
    first_scenario,
    model_argument,
    names,
    numbers,
    open_model,
    positive,
    progress_bar,
)

HELP = "error against run time of every method and of the installed peers"


def arguments(parser: ArgumentParser) -> None:
    model_argument(parser, "?")
    parser.add_argument("--case", metavar="NAME", help="a verification case instead of MODEL")
    parser.add_argument("--scenario", help="default: the model's first one")
    parser.add_argument("--t-end", type=positive, metavar="S", help="duration [s]")
    parser.add_argument("--methods", type=names, metavar="M,M", help="default: all that fit")
    parser.add_argument("--steps", type=numbers, metavar="S,S", help="default: h0 halved 8 times")
    parser.add_argument("--tolerances", type=numbers, metavar="R,R", help="default: 1e-2 .. 1e-12")
    parser.add_argument("--fixed", action="store_true", help="also run adaptive methods at steps")
    parser.add_argument("--target", type=positive, metavar="E", help="error to recommend for")
    parser.add_argument("--rounds", type=count, default=5, help="rounds of timing; default: 5")
    parser.add_argument(
        "--clock", choices=("wall", "processor"), default="processor",
        help="wall includes time of other programs; default: processor",
    )  # fmt: skip
    parser.add_argument(
        "--quantity", choices=("position", "velocity", "force"), default="position",
        help="whose error is measured; force: that of constraints; default: position",
    )  # fmt: skip
    parser.add_argument(
        "--longest", type=positive, metavar="S", help="leave out longer runs; default: 1"
    )
    parser.add_argument(
        "--peers", action=BooleanOptionalAction, default=True, help="compare with other engines"
    )
    parser.add_argument(
        "-o", "--output", metavar="FILE", help="write a page (.html), .json, .svg or .txt"
    )


def answer(args: Namespace) -> Answer:
    """Raises PgraphError. A target that no method reaches is exit code 1, after all rows."""
    _checked(args)
    mech, options = _motion(args)
    bar = progress_bar()
    compile_kernels(bar)
    study = _study(mech, args, options, bar)
    data = json.loads(study.to_json())
    if args.output:
        study.save(args.output)
        data["output"] = args.output
    return Answer(data, str(study), _problem(study))


def _checked(args: Namespace) -> None:
    """Raises PgraphError for arguments that do not fit, before the work."""
    if (args.model is None) == (args.case is None):
        raise InputError(Problem("pgraph report", "", "give either a MODEL or --case NAME"))
    endings = pg.Study.SUFFIXES
    if args.output and Path(args.output).suffix.lower() not in endings:
        raise FileError(Problem(args.output, "", f"must end in {', '.join(endings)}"))


def _motion(args: Namespace) -> tuple[pg.Mechanism, dict[str, Any]]:
    if args.case is not None:
        return _case(args.case)
    model = open_model(args.model)
    scenario = first_scenario(model, args.scenario)
    return pg.Mechanism(model), {"scenario": scenario}


def _case(name: str) -> tuple[pg.Mechanism, dict[str, Any]]:
    """The motion of a case and its reference; the method is what is compared here."""
    found = list(pgraph_models.cases(name))
    if len(found) > 1:
        text = f"names several cases; choose one of {choices([case.name for case in found], 40)}"
        raise InputError(Problem(f"case '{name}'", "", text))
    case = found[0]
    kept = {key: x for key, x in case.options.items() if key not in ("method", "step", "rtol")}
    kept["t_end"] = float(case.t[-1]) if case.t is not None else 1.0
    return pg.Mechanism(case.model), {**kept, "reference": case}


def _study(mech: pg.Mechanism, args: Namespace, options: dict[str, Any], bar: Bar) -> pg.Study:
    from pgraph_core.study.engines import installed_peers

    asked = ("t_end", "methods", "steps", "tolerances", "target", "longest")
    options |= {name: getattr(args, name) for name in asked if getattr(args, name) is not None}
    try:
        return pg.work_precision(
            mech,
            fixed=args.fixed,
            rounds=args.rounds,
            clock=args.clock,
            quantity=args.quantity,
            peers=tuple(installed_peers()) if args.peers else (),
            progress=lambda fraction: bar("measuring", fraction),
            **options,
        )
    finally:
        bar("", 1.0)


def _problem(study: pg.Study) -> str:
    """Why the study has nothing to recommend; "" if it has."""
    if not any(row.ok for row in study.rows):
        return next((row.reason for row in study.rows if row.reason), "no run reached the end")
    if study.target is None:
        return ""
    try:
        study.recommend()
    except InputError as unmet:
        return unmet.problems[0].text
    return ""
