"""Commands for models: `pgraph models`, `info`, `check`, `convert`."""

from __future__ import annotations

import math
import sys
from argparse import Namespace
from pathlib import Path
from typing import Any

import pgraph_core as pg
import pgraph_models
from pgraph_core import joints
from pgraph_core.errors import FileError, ModelError, Problem
from pgraph_core.model.links import SAFE
from pgraph_core.packing.cable_lines import led_problems
from pgraph_core.pulleys import segment_names

from .cad import CAD, assembly, is_cad, listed
from .terminal import (
    FILES,
    MODEL,
    NAMED,
    Answer,
    aligned,
    command,
    model_path,
    open_model,
    read_file,
    takes,
)

# -- models ----------------------------------------------------------------------------------------


@command("models", "list the built-in models")
def models(args: Namespace) -> Answer:
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


# -- link ------------------------------------------------------------------------------------------


@command("link", "print a link that carries the model", *MODEL)
def link(args: Namespace) -> Answer:
    found = pg.link(open_model(args))
    if len(found) > SAFE:
        text = f"the link has {len(found)} characters, and many programs cut it above {SAFE}; "
        print(f"{text}there, send a file", file=sys.stderr)
    return Answer({"link": found, "characters": len(found)}, found)


# -- info ------------------------------------------------------------------------------------------


@command("info", "bodies, degrees of freedom, Pgraph, jdof, tips, mobility", *MODEL)
def info(args: Namespace) -> Answer:
    model = open_model(args, told=True)
    data = facts(model)
    return Answer(data, _text(model, data))


def facts(model: pg.Model) -> dict[str, Any]:
    """Return the answer with the attribute names of `Mechanism` as keys, in number order."""
    topology = pg.Topology.of(model)
    bodies = model.expanded.bodies
    return {
        "name": model.name,
        "nb": topology.nb,
        "nq": sum(joints.nq(body.sequence) for body in bodies),
        "nv": sum(body.dof for body in bodies),
        "pgraph": topology.pgraph,
        "jdof": topology.jdof,
        "names": topology.names,
        "parent": topology.parent,
        "joint": [model.rows[row].joint for row in topology.row],
        "dof": topology.dof,
        "tips": topology.tips,
        "separation_bodies": topology.separation_bodies,
        "mass": math.fsum(body.mass for body in bodies),
        "up": model.up,
        "gravity": model.gravity,
        "beams": [_beam(model, beam) for beam in model.beams],
        "constraints": [constraint.name for constraint in model.constraints],
        "mobility": _mobility(model),
        "forces": [force.name for force in model.forces],
        "segments": _segments(model),
        "scenarios": [scenario.name for scenario in model.scenarios],
    }


def _beam(model: pg.Model, beam: pg.Beam) -> dict[str, Any]:
    """Return the segments of a beam, its stiffness [N m^2] and its lowest frequency [Hz]."""
    stiff = beam.stiff
    return {
        "name": beam.name,
        "nodes": sum(model.expanded.segments[beam.name]),
        "length": beam.extent,
        "EI": stiff.EI,
        "GJ": stiff.GJ,
        "frequency": beam.lowest_frequency / (2 * math.pi),
    }


def _told_of_beam(beam: dict[str, Any]) -> str:
    numbers = [f"{beam['nodes']} segments, {beam['length']:.4g} m"]
    numbers += [f"EI {', '.join(f'{x:.4g}' for x in beam['EI'])} N m²"] if beam["EI"] else []
    numbers += [f"GJ {beam['GJ']:.4g} N m²"] if beam["GJ"] else []
    return f"{beam['name']}: {', '.join(numbers)}, lowest {beam['frequency']:.4g} Hz"


def _mobility(model: pg.Model) -> dict[str, Any] | None:
    """Return the mobility, or why the model cannot be assembled, or None without constraints."""
    if not any(c.active for c in model.constraints):
        return None
    try:
        return pg.Mechanism(model).mobility().to_dict()
    except pg.PgraphError as refused:
        return {"text": str(refused)}


def _segments(model: pg.Model) -> list[str]:
    """Return the names of the segments of cables and ropes, as in `Result.tension`."""
    parts = [x for x in (*model.forces, *model.constraints) if isinstance(x, pg.Cable | pg.Rope)]
    try:
        placed = pg.Mechanism(model).packed.placed() if parts else None
        counts = [len(placed.segments(part)) for part in parts if placed is not None]
    except pg.PgraphError:
        return []  # the mobility and `pgraph check` name the faults of a model
    return [name for part, n in zip(parts, counts) for name in segment_names(part.name, n)]


def _text(model: pg.Model, data: dict[str, Any]) -> str:
    names = ("ground", *data["names"])
    known = {body.name: body for body in model.rows}
    rows = (
        (i, name, names[parent], known[name].joint, int(dof), known[name].mass)
        for i, (name, parent, dof) in enumerate(zip(data["names"], data["parent"], data["dof"]), 1)
    )
    lines = (
        f"{data['name']}: {data['nb']} bodies, nv = {data['nv']}, nq = {data['nq']}, "
        f"{data['mass']:.6g} kg, {data['up']} up",
        f"Pgraph             [{_listed(data['pgraph'])}]",
        f"jdof               [{_listed(data['jdof'])}]",
        f"tips               {_listed(data['tips'])}",
        f"separation bodies  {_listed(data['separation_bodies']) or 'none'}",
        *(f"beam               {_told_of_beam(beam)}" for beam in data["beams"]),
        f"constraints        {', '.join(data['constraints']) or 'none'}",
        *([f"segments           {', '.join(data['segments'])}"] if data["segments"] else []),
        f"scenarios          {', '.join(data['scenarios']) or 'none'}",
        *(("", data["mobility"]["text"]) if data["mobility"] else ()),
        "",
        aligned(rows, header=("#", "body", "parent", "joint", "DoF", "mass [kg]")),
    )
    return "\n".join(lines)


def _listed(numbers: Any) -> str:
    return " ".join(map(str, numbers))


# -- check -----------------------------------------------------------------------------------------


@command("check", "list every problem of a model; exit code 1 if there is one", *MODEL)
def check(args: Namespace) -> Answer:
    """Check a model. Raises PgraphError with all problems in the model and its meshes."""
    model, report = read_file(args)
    notes = [str(e) for kind in ("warning", "left out") for e in report.of(kind)]
    data: dict[str, Any] = {"problems": []}
    data |= {} if report.loaded else {"loaded": False}
    if problems := [*mesh_problems(model), *led_problems(pg.Mechanism(model).packed)]:
        raise ModelError(problems)
    notes += model.doubts
    data |= {"notes": notes} if notes else {}
    found = (
        "no problem found"
        if "loaded" not in data
        else "some elements that affect the motion are omitted"
    )
    lines = [f"{model.name}: {found}", *(f"note: {text}" for text in notes)]
    return Answer(data, "\n".join(lines))


def mesh_problems(model: pg.Model) -> list[Problem]:
    """Return one problem for each body with an unreadable mesh file.

    A file that is not there is a doubt if it would only be drawn.
    """
    from pgraph_core.mesh_files import load_mesh  # imported late, because it needs the compiler

    found = []
    for body in model.bodies:
        for shape in body.shapes:
            file = shape.file
            if not file or (shape.role == "visual" and not Path(file).exists()):
                continue
            try:
                load_mesh(file)
            except pg.PgraphError as error:
                found.append(Problem(f"body '{body.name}'", "shape", str(error)))
    return found


# -- convert ---------------------------------------------------------------------------------------


@command(
    "convert",
    "convert a model to another format, such as .json or .urdf",
    takes("model", metavar="IN", help=NAMED),
    takes("out", metavar="OUT", help="output file; the suffix selects the format"),
    *FILES,
    *CAD,
    takes(
        "--repair",
        action="store_true",
        help="replace physically impossible inertias by the closest valid ones",
    ),
)
def convert(args: Namespace) -> Answer:
    """Raises PgraphError."""
    from pgraph_core.formats import write_model  # other commands need no kernels

    given = model_path(args.model)
    if given.exists() and Path(args.out).exists() and given.samefile(args.out):
        raise FileError(Problem(args.out, "", "is the file that is read; choose another name"))
    model, read = assembly(args) if is_cad(args) else read_file(args)
    if args.repair:
        model = read.repaired(model)
    written = write_model(model, args.out)
    lines = [str(report) for report in (read, written) if report.entries]
    lines += listed(args, read) if is_cad(args) else []
    data = {"read": read.to_dict(), "written": written.to_dict()}
    text = "\n".join([*lines, f"{args.out}: {len(model.bodies)} bodies written"])
    return Answer(data, text)
