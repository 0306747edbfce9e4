"""Finds the command that was typed and runs it."""

from __future__ import annotations

import os
import sys
from argparse import ArgumentParser, RawDescriptionHelpFormatter
from collections.abc import Sequence
from importlib.metadata import version

from pgraph_core.errors import PgraphError

from . import models, run, start, study, verify
from .terminal import print_answer, print_problems

COMMANDS = {
    command.name: command for module in (models, run, study, verify) for command in module.COMMANDS
}


def main(argv: Sequence[str] | None = None) -> int:
    """Returns 0 if all is well, 1 if the model or the run has a problem, 2 for wrong usage."""
    words = list(sys.argv[1:] if argv is None else argv)
    try:
        if words and words[0] in COMMANDS:
            return _command(words[0], words[1:])
        return _start(words)
    except KeyboardInterrupt:
        print("Stopped.", file=sys.stderr)
        return 130  # the shells' code for Ctrl+C
    except BrokenPipeError:  # the reader, such as `head`, has closed the pipe
        os.dup2(os.open(os.devnull, os.O_WRONLY), sys.stdout.fileno())  # nothing is left to flush
        return 0


def _command(name: str, words: Sequence[str]) -> int:
    command = COMMANDS[name]
    parser = ArgumentParser(
        prog=f"pgraph {name}", description=f"{command.help[0].upper()}{command.help[1:]}."
    )
    command.arguments(parser)
    parser.add_argument("--json", action="store_true", help="one JSON object instead of text")
    args = parser.parse_args(words)
    try:
        answer = command.answer(args)
    except PgraphError as error:
        print_problems(error.problems, args.json)
        return 1
    print_answer(answer, args.json)
    sys.stdout.flush()
    if answer.problem:
        print(answer.problem, file=sys.stderr)
    return 1 if answer.problem else 0


def _start(words: Sequence[str]) -> int:
    listed = "\n".join(f"  pgraph {name:9} {command.help}" for name, command in COMMANDS.items())
    parser = ArgumentParser(
        prog="pgraph",
        description="Multibody dynamics from a four-column table. Opens the page in the browser.",
        epilog=f"commands, each with --help and --json:\n{listed}",
        formatter_class=RawDescriptionHelpFormatter,
    )
    start.arguments(parser)
    parser.add_argument(
        "--version", action="version", version=f"pgraph {version('pgraph-dynamics')}"
    )
    args = parser.parse_args(words)
    try:
        start.start(args)
    except PgraphError as error:
        print_problems(error.problems, as_json=False)
        return 1
    return 0
