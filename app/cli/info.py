"""`pgraph info MODEL`: numbering, degrees of freedom, mobility and plan of a model."""

from __future__ import annotations

import math
from argparse import ArgumentParser, Namespace
from typing import Any

import pgraph_core as pg
from pgraph_core import joints

from .terminal import Answer, aligned, model_argument, open_model

HELP = "bodies, degrees of freedom, Pgraph, jdof, tips, mobility"


def arguments(parser: ArgumentParser) -> None:
    model_argument(parser)


def answer(args: Namespace) -> Answer:
    model = open_model(args.model)
    data = facts(model)
    return Answer(data, _text(model, data))


def facts(model: pg.Model) -> dict[str, Any]:
    """The answer under the names of `Mechanism`, in number order."""
    topology = pg.Topology.of(model)
    bodies = [model.bodies[row] for row in topology.row]
    return {
        "name": model.name,
        "nb": topology.nb,
        "nq": sum(joints.nq(body.sequence) for body in bodies),
        "nv": sum(body.dof for body in bodies),
        "pgraph": topology.pgraph,
        "jdof": topology.jdof,
        "names": topology.names,
        "parent": topology.parent,
        "joint": [body.joint for body in bodies],
        "dof": topology.dof,
        "tips": topology.tips,
        "separation_bodies": topology.separation_bodies,
        "mass": math.fsum(body.mass for body in bodies),
        "up": model.up,
        "gravity": model.gravity,
        "constraints": [constraint.name for constraint in model.constraints],
        "mobility": _mobility(model),
        "forces": [force.name for force in model.forces],
        "scenarios": [scenario.name for scenario in model.scenarios],
        "plan": pg.Plan.of(model).to_dict(),
    }


def _mobility(model: pg.Model) -> dict[str, Any] | None:
    """The report of mobility, or why it cannot be assembled; None without constraints."""
    if not any(c.active for c in model.constraints):
        return None
    try:
        return pg.Mechanism(model).mobility().to_dict()
    except pg.PgraphError as refused:
        return {"text": str(refused)}


def _text(model: pg.Model, data: dict[str, Any]) -> str:
    names = ("ground", *data["names"])
    rows = (
        (i, name, names[parent], model.body(name).joint, int(dof), model.body(name).mass)
        for i, (name, parent, dof) in enumerate(zip(data["names"], data["parent"], data["dof"]), 1)
    )
    lines = (
        f"{data['name']}: {data['nb']} bodies, nv = {data['nv']}, nq = {data['nq']}, "
        f"{data['mass']:.6g} kg, {data['up']} up",
        f"Pgraph             [{_listed(data['pgraph'])}]",
        f"jdof               [{_listed(data['jdof'])}]",
        f"tips               {_listed(data['tips'])}",
        f"separation bodies  {_listed(data['separation_bodies']) or 'none'}",
        f"constraints        {', '.join(data['constraints']) or 'none'}",
        f"scenarios          {', '.join(data['scenarios']) or 'none'}",
        *(("", data["mobility"]["text"]) if data["mobility"] else ()),
        "",
        *pg.Plan.of(model).lines(),
        "",
        aligned(rows, header=("#", "body", "parent", "joint", "DoF", "mass [kg]")),
    )
    return "\n".join(lines)


def _listed(numbers: Any) -> str:
    return " ".join(map(str, numbers))
