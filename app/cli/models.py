"""`pgraph models`: the built-in models."""

from __future__ import annotations

from argparse import ArgumentParser, Namespace

import pgraph_core as pg
import pgraph_models

from .terminal import Answer, aligned

HELP = "list the built-in models"


def arguments(parser: ArgumentParser) -> None:
    """It has none."""


def answer(args: Namespace) -> Answer:
    models = {name: pg.Model.load(pgraph_models.path(name)) for name in pgraph_models.names()}
    rows = [
        {
            "name": name,
            "nb": len(model.bodies),
            "nv": sum(body.dof for body in model.bodies),
            "scenarios": [s.name for s in model.scenarios],
            "path": str(pgraph_models.path(name)),
        }
        for name, model in models.items()
    ]
    table = aligned(
        ((row["name"], row["nb"], row["nv"], ", ".join(row["scenarios"])) for row in rows),
        header=("model", "bodies", "DoF", "scenarios"),
    )
    return Answer({"models": rows}, table)
