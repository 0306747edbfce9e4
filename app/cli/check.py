"""`pgraph check MODEL`: every problem of a model at once."""

from __future__ import annotations

from argparse import ArgumentParser, Namespace

import pgraph_core as pg
from pgraph_core.errors import ModelError, Problem

from .terminal import Answer, model_argument, open_model

HELP = "list every problem of a model; exit code 1 if there is one"


def arguments(parser: ArgumentParser) -> None:
    model_argument(parser)


def answer(args: Namespace) -> Answer:
    """Raises ModelError with all problems of the model and its meshes."""
    model = open_model(args.model)
    if found := mesh_problems(model):
        raise ModelError(found)
    lines = [f"{model.name}: no problem found", *(f"note: {text}" for text in model.doubts)]
    notes = {"notes": model.doubts} if model.doubts else {}
    return Answer({"problems": [], **notes}, "\n".join(lines))


def mesh_problems(model: pg.Model) -> list[Problem]:
    """One problem for each body whose mesh file cannot be read."""
    from pgraph_core.mesh_files import load_mesh  # it needs the compiler; models without do not

    found = []
    for body in model.bodies:
        for file in (shape.file for shape in body.shapes if shape.file):
            try:
                load_mesh(file)
            except pg.PgraphError as error:
                found.append(Problem(f"body '{body.name}'", "shape", str(error)))
    return found
