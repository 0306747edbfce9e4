"""`pgraph [MODEL]`: opens the page in the browser."""

from __future__ import annotations

import logging
import signal
import socket
import threading
from argparse import ArgumentParser, Namespace

from pgraph_core.errors import InputError, Problem

from .terminal import open_model, port


def arguments(parser: ArgumentParser) -> None:
    parser.add_argument(
        "model",
        metavar="MODEL",
        nargs="?",
        default="quadruped",
        help="a file or the name of a built-in model (default: quadruped)",
    )
    parser.add_argument("--host", default="127.0.0.1", help="default: 127.0.0.1, this machine only")
    parser.add_argument("--port", type=port, default=8080, help="default: 8080")
    parser.add_argument(
        "--token",
        choices=("auto", "on", "off"),
        default="auto",
        help="whether only the printed address opens the page (default: auto, on unless --host is "
        "this machine's own)",
    )
    parser.add_argument("--log", metavar="FILE", help="append a line for each event on the page")
    parser.add_argument("--no-browser", action="store_true", help="do not open the browser")


def start(args: Namespace) -> None:
    """Serve the page until Ctrl+C."""
    model = open_model(args.model)
    _bind(args.host)
    if args.log is not None:
        _log_to(args.log)
    from ..run.update import Simulate
    from ..server import serve  # here: no other command needs viser
    from ..session.autosave import state_folder

    stopped = threading.Event()  # no exception in the middle of the set-up
    signal.signal(signal.SIGINT, lambda *_: stopped.set())
    server = serve(
        model, host=args.host, port=args.port, open_browser=not args.no_browser,
        given=args.model, keep=state_folder(), token=args.token,
    )  # fmt: skip
    if model.scenarios and not server.store.state.undo:
        server.send(Simulate(0))  # ready to play when the page is seen
    server.wait(stopped)


def _log_to(path: str) -> None:
    """What the page does, with times, in a file. Raises InputError if it cannot be written."""
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
    """Raises InputError if this machine has no such address; viser would try it forever."""
    try:
        family, kind, protocol, _, address = socket.getaddrinfo(host, 0, type=socket.SOCK_STREAM)[0]
        with socket.socket(family, kind, protocol) as free:
            free.bind(address)
    except (OSError, UnicodeError) as error:
        reason = getattr(error, "strerror", None) or error
        text = f"cannot be served on: {reason}; use 127.0.0.1, or 0.0.0.0 for all networks"
        raise InputError(Problem(f"host {host!r}", "", text)) from None
