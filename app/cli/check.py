"""`pgraph check MODEL`: every problem of a description at once."""

from __future__ import annotations

from argparse import ArgumentParser, Namespace

import pgraph_core as pg
from pgraph_core.errors import ModelError, Problem

from . import given
from .answer import Answer

HELP = "every problem found in a model; exit code 1 if there is any"


def arguments(parser: ArgumentParser) -> None:
    parser.add_argument("model", metavar="MODEL", help="a file or the name of a built-in model")


def answer(args: Namespace) -> Answer:
    """Reading a model raises with all its problems, which `main` prints; so do its meshes."""
    model = given.model(args.model)
    if found := mesh_problems(model):
        raise ModelError(found)
    return Answer({"problems": []}, f"{model.name}: no problem found")


def mesh_problems(model: pg.Model) -> list[Problem]:
    """One for each body whose mesh file cannot be read."""
    from pgraph_core.mesh_files import load_mesh  # with the compiler: `check` does without

    found = []
    for body in model.bodies:
        if body.shape is not None and body.shape.file:
            try:
                load_mesh(body.shape.file)
            except pg.PgraphError as error:
                found.append(Problem(f"body '{body.name}'", "shape", str(error)))
    return found
