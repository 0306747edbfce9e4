"""`pgraph stability MODEL`: which methods stay accurate as a model is made extreme."""

from __future__ import annotations

from argparse import ArgumentParser, Namespace
from pathlib import Path
from typing import Any

import pgraph_core as pg
from pgraph_core.errors import FileError, InputError, Problem
from pgraph_core.model.files import write_atomic

from .terminal import (
    Answer,
    model_argument,
    names,
    numbers,
    open_model,
    positive,
    progress_bar,
)

HELP = "which methods stay accurate as a model is made stiff or extreme"


def arguments(parser: ArgumentParser) -> None:
    from pgraph_core.study.axes import AXES

    model_argument(parser)
    parser.add_argument(
        "--axis", choices=tuple(AXES), help="what to vary (default: the first that the model has)"
    )
    parser.add_argument("--all", action="store_true", help="every axis that fits the model")
    parser.add_argument("--values", type=numbers, metavar="X,X", help="default: those of the axis")
    parser.add_argument("--methods", type=names, metavar="M,M", help="default: all that fit")
    parser.add_argument("--steps", type=numbers, metavar="S,S", help="default: 0.1 to 1e-4 [s]")
    parser.add_argument("--t-end", type=positive, metavar="S", help="duration [s]")
    parser.add_argument("--target", type=positive, metavar="E", help="largest error that is OK")
    parser.add_argument("--scenario", help="default: none")
    parser.add_argument(
        "-o", "--output", metavar="FILE", help="write a page (.html), .svg or .json"
    )


def answer(args: Namespace) -> Answer:
    _writable(args)
    model = open_model(args.model)
    asked = {n: getattr(args, n) for n in ("methods", "steps", "t_end", "target", "scenario")}
    options = {name: value for name, value in asked.items() if value is not None}
    if args.values is not None:
        options["values"] = args.values
    maps, lacking = _maps(model, args, options)
    if args.output:
        _written(maps, args.output)
    data = maps[0].to_dict() if not args.all else {"maps": [found.to_dict() for found in maps]}
    data |= {"output": args.output} if args.output else {}
    parts = [str(found) for found in maps] + ["\n".join(lacking)] * bool(lacking)
    return Answer(data, "\n\n\n".join(parts))


def _maps(
    model: pg.Model, args: Namespace, options: dict[str, Any]
) -> tuple[list[pg.StabilityMap], list[str]]:
    """(a map of each axis, a sentence for each axis that does not fit the model)."""
    from pgraph_core.study.axes import AXES

    bar, found, lacking = progress_bar(), [], []
    for axis in AXES if args.all else (args.axis,):
        if args.all and axis == "step":
            continue  # it is in the columns of the others
        try:
            found.append(
                pg.stability_map(
                    model,
                    axis=axis,
                    progress=lambda x, axis=axis: bar((axis or "map")[:9], x),
                    **options,
                )
            )
        except InputError as refused:
            if not args.all or not all(p.field == "axis" for p in refused.problems):
                raise
            lacking.append(str(refused))
        finally:
            bar("", 1.0)
    return found, lacking


def _writable(args: Namespace) -> None:
    """Raises FileError before the work if the file has no known suffix."""
    suffixes = (".html", ".json") if args.all else (".html", ".svg", ".json")
    if args.output and Path(args.output).suffix not in suffixes:
        text = f"must end in {', '.join(suffixes)}"
        raise FileError(Problem(args.output, "", text))


def _written(maps: list[pg.StabilityMap], output: str) -> None:
    from pgraph_core.study.map import maps_page

    if len(maps) == 1 and not output.endswith(".html"):
        maps[0].save(output)
    elif output.endswith(".html"):
        write_atomic(output, maps_page(maps))
    else:
        write_atomic(output, f"[{', '.join(found.to_json() for found in maps)}]\n")
