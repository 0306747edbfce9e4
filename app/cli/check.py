"""`pgraph check MODEL`: every problem of a description at once."""

from __future__ import annotations

from argparse import ArgumentParser, Namespace

from . import given
from .answer import Answer

HELP = "every problem found in a model; exit code 1 if there is any"


def arguments(parser: ArgumentParser) -> None:
    parser.add_argument("model", metavar="MODEL", help="a file or the name of a built-in model")


def answer(args: Namespace) -> Answer:
    """Reading a model raises with all its problems, which `main` prints."""
    model = given.model(args.model)
    return Answer({"problems": []}, f"{model.name}: no problem found")
