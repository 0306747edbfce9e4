"""Parsing and dispatch of commands."""

from __future__ import annotations

import gc
import logging
import os
import signal
import socket
import sys
from argparse import Namespace, RawDescriptionHelpFormatter
from collections.abc import Sequence
from difflib import get_close_matches
from importlib.metadata import version
from pathlib import Path

import pgraph_models
from pgraph_core.errors import InputError, PgraphError, Problem, needed, plain
from pgraph_core.model.links import is_link

from . import capture, models, paths, run, study  # noqa: F401  they make commands
from .terminal import (
    COMMANDS,
    FILES,
    NAMED,
    Parser,
    model_path,
    open_model,
    print_answer,
    print_problems,
    takes,
    whole,
)

START = (
    takes("model", metavar="MODEL", nargs="?", default="quadruped_hips",
          help=f"{NAMED} (default: quadruped_hips)"),
    *FILES,
    takes("--host", default="127.0.0.1", help="default: 127.0.0.1, this machine only"),
    takes("--port", type=whole(0, 65535, " (any free port)"), default=8080, help="default: 8080"),
    takes(
        "--token", choices=("auto", "on", "off"), default="auto",
        help="whether only the printed address opens the page (default: auto, on unless --host is "
        "this machine's own)",
    ),
    takes("--log", metavar="FILE", help="append a line for each event on the page"),
    takes("--no-browser", action="store_true", help="do not open the browser"),
    takes("--version", action="version", version=f"pgraph {version('pgraph-dynamics')}"),
)  # fmt: skip


def main(argv: Sequence[str] | None = None) -> int:
    """Run the program. Return 0 on success, 1 for a model or run problem, 2 for incorrect usage."""
    words = list(sys.argv[1:] if argv is None else argv)
    for name in ("stdout", "stderr"):  # None if the shell has closed them
        setattr(sys, name, getattr(sys, name) or open(os.devnull, "w"))  # noqa: SIM115
    try:
        if words and words[0] in COMMANDS:
            return _command(words[0], words[1:])
        if words and (text := _no_command(words[0], words[1:])):
            print(text, file=sys.stderr)
            raise SystemExit(2)  # the code of wrong usage
        return _start(words)
    except OSError as error:
        if error.filename is not None:
            raise
        os.dup2(os.open(os.devnull, os.O_WRONLY), sys.stdout.fileno())  # nothing is left to flush
        if isinstance(error, BrokenPipeError):  # the reader, such as `head`, has closed the pipe
            return 0
        print(f"pgraph: error: the output cannot be written: {error.strerror}", file=sys.stderr)
        return 1


MEANT = {
    "simulate": "run",
    "sim": "run",
    "benchmark": "bench",
    "validate": "check",
    "list": "models",
}


def _no_command(word: str, rest: Sequence[str]) -> str:
    """Return a suggestion for an unknown first word, or "" if it is a model or an option."""
    if word.startswith("-") or Path(word).suffix or os.sep in word or Path(word).exists():
        return ""
    if word in pgraph_models.names() and not (rest and not rest[0].startswith("-")):
        return ""
    close = [MEANT[word]] if word in MEANT else []
    close = close or get_close_matches(word, [*COMMANDS, *pgraph_models.names()], n=1)
    if not rest and word not in ("help", "map") and not (close and close[0] in COMMANDS):
        return ""  # a model that is not there
    hint = f"did you mean {close[0]}? " if close and close[0] != word else ""
    what = "is neither a command nor a model"
    return f"pgraph: error: {word!r} {what}; {hint}the commands are {', '.join(COMMANDS)}"


def _command(name: str, words: Sequence[str]) -> int:
    command = COMMANDS[name]
    parser = Parser(
        prog=f"pgraph {name}", description=f"{command.help[0].upper()}{command.help[1:]}."
    )
    for add in command.arguments:
        add(parser)
    parser.add_argument("--json", action="store_true", help="print JSON instead of text")
    args = parser.read(words)
    try:
        answer = command.answer(args)
    except PgraphError as error:
        print_problems(error.problems, args.json)
        return 1
    except ModuleNotFoundError as error:  # numba, where a lean installation has to compile
        print_problems([Problem(f"package '{error.name}'", "", str(error))], args.json)
        return 1
    print_answer(answer, args.json)
    sys.stdout.flush()
    if answer.problem:
        print(plain(answer.problem), file=sys.stderr)
    return 1 if answer.problem else 0


def _start(words: Sequence[str]) -> int:
    listed = "\n".join(f"  pgraph {name:9} {command.help}" for name, command in COMMANDS.items())
    parser = Parser(
        prog="pgraph",
        description="Multibody dynamics from a four-column table. Opens the page in the browser.",
        epilog=f"commands, each with --help and --json:\n{listed}",
        formatter_class=RawDescriptionHelpFormatter,
    )
    for add in START:
        add(parser)
    args = parser.read(words)
    try:
        start(args)
    except PgraphError as error:
        print_problems(error.problems, as_json=False)
        return 1
    return 0


# -- pgraph [MODEL] --------------------------------------------------------------------------------


def start(args: Namespace) -> None:
    """Serve the page until interrupted by Ctrl+C."""
    model = open_model(args)
    _bind(args.host)
    if args.log is not None:
        _log_to(args.log)
    needed("viser")
    from ..server import serve  # here: no other command needs viser
    from ..session.autosave import state_folder

    named = args.model in pgraph_models.names() or is_link(args.model)
    given = args.model if named else str(model_path(args.model).resolve())
    stopped: list[int] = []  # no exception in the middle of the set-up
    signal.signal(signal.SIGINT, lambda number, _: stopped.append(number))
    server = serve(
        model, host=args.host, port=args.port, open_browser=not args.no_browser,
        given=given, keep=state_folder(), token=args.token,
    )  # fmt: skip
    print("Press Ctrl+C to stop.", flush=True)
    gc.collect()
    gc.freeze()  # later garbage collections skip the objects that exist by now
    server.wait(lambda: bool(stopped))


def _log_to(path: str) -> None:
    """Log page events with timestamps to a file. Raises InputError if it cannot be written."""
    try:
        handler = logging.FileHandler(path, encoding="utf-8")
    except OSError as error:
        text = f"cannot be written: {error.strerror or error}; give a file in a folder of yours"
        raise InputError(Problem(f"--log {path}", "", text)) from None
    handler.setFormatter(logging.Formatter("%(asctime)s %(levelname)s %(message)s"))
    ours = logging.getLogger(__name__.partition(".")[0])
    ours.addHandler(handler)
    ours.setLevel(logging.INFO)


def _bind(host: str) -> None:
    """Raise InputError if this machine lacks the address: viser would retry forever."""
    try:
        family, kind, protocol, _, address = socket.getaddrinfo(host, 0, type=socket.SOCK_STREAM)[0]
        with socket.socket(family, kind, protocol) as free:
            free.bind(address)
    except (OSError, UnicodeError) as error:
        reason = getattr(error, "strerror", None) or error
        text = f"cannot be served on: {reason}; use 127.0.0.1, or 0.0.0.0 for all networks"
        raise InputError(Problem(f"host {host!r}", "", text)) from None
