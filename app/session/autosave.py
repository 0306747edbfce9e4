"""The model on disk a moment after each edit, so that a server that is killed loses nothing.

One file a session, named by its address: whoever serves there now is not who left it.
"""

from __future__ import annotations

import contextlib
import json
import logging
import os
import socket
import threading
import time
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path

import pgraph_core as pg
from pgraph_core.model.files import write_atomic

from ..core.events import Event
from ..core.state import Kept, State
from ..model.archive import own
from ..session.update import NotKept

DELAY, LONGEST = 0.4, 2.0  # [s] after the last edit, and after the first one not yet written
MOST = 20  # sessions that are offered
log = logging.getLogger(__name__)


def state_folder() -> Path:
    """Where a program keeps what it would not lose: $XDG_STATE_HOME/pgraph."""
    given = os.environ.get("XDG_STATE_HOME") or os.environ.get("LOCALAPPDATA")
    return (Path(given) if given else Path.home() / ".local" / "state") / "pgraph"


@dataclass(frozen=True)
class Session:
    """What is written: the model of a session, what it was started with, how it ended."""

    given: str
    text: str
    ended: bool

    def kept(self, path: Path) -> Kept:
        return Kept(path, self.given, path.stat().st_mtime, self.text, self.ended)


def left_behind(folder: Path, host: str, port: int) -> tuple[Kept, ...]:
    """What sessions left that nobody serves any more, newest first; files that are none are not."""
    found = []
    for path in folder.glob("*.json"):
        with contextlib.suppress(OSError, ValueError, TypeError, pg.PgraphError):
            session = Session(**json.loads(path.read_text("utf-8")))
            if path.name == _name(host, port) or not _served(path.stem):
                own(session.text)
                found.append(session.kept(path))
    return tuple(sorted(found, key=lambda kept: kept.time, reverse=True)[:MOST])


def _name(host: str, port: int) -> str:
    return f"{host.replace(':', '_')} {port}.json"


def _served(address: str) -> bool:
    """Whether somebody answers at the address that a file is named by."""
    host, _, port = address.rpartition(" ")
    host = {"0.0.0.0": "127.0.0.1", "__": "::1"}.get(host, host.replace("_", ":"))
    try:
        with socket.create_connection((host, int(port)), timeout=0.3):
            return True
    except (OSError, ValueError):
        return False


class Autosave:
    """Writes the model of this session, in a thread of its own."""

    def __init__(
        self, folder: Path, host: str, port: int, given: str, send: Callable[[Event], None]
    ):
        self._path = folder / _name(host, port)
        self._given, self._send = given, send
        self._first: pg.Model | None = None  # as it was opened: nothing to keep
        self._due: pg.Model | None = None  # not yet written
        self._changed = threading.Condition()
        self._stopped = False
        self._failed = ""
        self._thread = threading.Thread(target=self._loop, name="pgraph-autosave", daemon=True)

    def render(self, old: State, new: State) -> None:
        if self._first is None:
            self._first = new.undo[0].model if new.undo else new.model
            self._thread.start()
        for label in old.kept.keys() - new.kept.keys():
            if old.kept[label].path != self._path:
                old.kept[label].path.unlink(missing_ok=True)
        if new.model is not old.model or (old is new and new.undo):
            with self._changed:
                self._due = new.model
                self._changed.notify()

    def stop(self) -> None:
        """Write what is due; the session has ended in order."""
        with self._changed:
            self._stopped = True
            self._changed.notify()
        if self._thread.is_alive():
            self._thread.join(timeout=5.0)

    def _loop(self) -> None:
        last: pg.Model | None = None
        while True:
            with self._changed:
                self._changed.wait_for(lambda: self._due is not None or self._stopped)
                end = time.monotonic() + LONGEST
                while not self._stopped and time.monotonic() < end and self._changed.wait(DELAY):
                    pass  # once more DELAY after another edit
                due, self._due, stopped = self._due or last, None, self._stopped
            if due is not None:
                last = due
                self._write(due, stopped)
            if stopped:
                return

    def _write(self, model: pg.Model, ended: bool) -> None:
        problem = ""
        try:
            if model is self._first:
                self._path.unlink(missing_ok=True)
            else:
                self._path.parent.mkdir(parents=True, exist_ok=True, mode=0o700)
                session = {"given": self._given, "text": model.to_json(), "ended": ended}
                write_atomic(self._path, json.dumps(session))
        except pg.PgraphError as error:
            problem = str(error)
        except OSError as error:
            problem = f"{self._path} cannot be written: {error.strerror or error}."
        if problem and problem != self._failed:
            log.warning("the model is not kept: %s", problem)
            self._send(NotKept(problem))
        self._failed = problem
