"""`pgraph convert IN OUT`: a model from one format to another."""

from __future__ import annotations

from argparse import ArgumentParser, Namespace

from .terminal import Answer, model_path

HELP = "a model from one format to another: .json, .urdf, .xml (MJCF)"


def arguments(parser: ArgumentParser) -> None:
    parser.add_argument("model", metavar="IN", help="a file or the name of a built-in model")
    parser.add_argument("out", metavar="OUT", help="the file to write; its suffix is the format")
    parser.add_argument(
        "--roots", metavar="FOLDER", nargs="+", default=(), help="folders that meshes may lie in"
    )
    parser.add_argument(
        "--repair", action="store_true", help="replace inertias that no body has by the nearest"
    )


def answer(args: Namespace) -> Answer:
    """Raises PgraphError."""
    from pgraph_core.formats.any import read_model, write_model  # other commands need no kernels

    model, read = read_model(model_path(args.model), args.roots)
    if args.repair:
        model = read.repaired(model)
    written = write_model(model, args.out)
    lines = [str(report) for report in (read, written) if report.entries]
    data = {"read": read.to_dict(), "written": written.to_dict()}
    text = "\n".join([*lines, f"{args.out}: {len(model.bodies)} bodies written"])
    return Answer(data, text)
