"""`pgraph new N`: a new model of N bodies."""

from __future__ import annotations

import json
from argparse import ArgumentParser, Namespace
from pathlib import Path

import pgraph_core as pg
from pgraph_core.errors import FileError, Problem

from .terminal import Answer, count

HELP = "write a model of N bodies: a serial chain of hinges"


def arguments(parser: ArgumentParser) -> None:
    parser.add_argument("n", metavar="N", type=count, help="number of bodies")
    parser.add_argument("-o", "--output", metavar="FILE", help="write to FILE instead")


def answer(args: Namespace) -> Answer:
    model = pg.Model.serial(args.n)
    if args.output is None:
        text = model.to_json().rstrip("\n")
        return Answer(json.loads(text), text)
    if Path(args.output).exists():
        raise FileError(Problem(args.output, "", "exists already; choose another name"))
    model.save(args.output)
    data = {"path": args.output, "name": model.name, "nb": len(model.bodies)}
    return Answer(data, f"Wrote {args.output}: {len(model.bodies)} bodies in a row.")
