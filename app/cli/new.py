"""`pgraph new N`: the table that a new model starts with."""

from __future__ import annotations

import json
from argparse import ArgumentParser, Namespace
from pathlib import Path

import pgraph_core as pg
from pgraph_core.errors import FileError, Problem

from . import given
from .answer import Answer

HELP = "the default table of N bodies: a serial chain, one hinge each"


def arguments(parser: ArgumentParser) -> None:
    parser.add_argument("n", metavar="N", type=given.body_count, help="number of bodies")
    parser.add_argument("-o", "--output", metavar="FILE", help="write it there, not to the screen")


def answer(args: Namespace) -> Answer:
    model = pg.Model.serial(args.n)
    if args.output is None:
        text = model.to_json().rstrip("\n")
        return Answer(json.loads(text), text)
    if Path(args.output).exists():
        raise FileError(Problem(args.output, "", "is there already; choose another name"))
    model.save(args.output)
    data = {"path": args.output, "name": model.name, "nb": len(model.bodies)}
    return Answer(data, f"Wrote {args.output}: {len(model.bodies)} bodies in a row.")
