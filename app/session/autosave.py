"""The model on disk before an edit is acknowledged, so that a server that is killed loses nothing.

One file a session, named by its address: whoever serves there now is not who left it. The store
draws this view first. A thread flushes the file to the disk a moment later, and writes again
where it could not be written.
"""

from __future__ import annotations

import contextlib
import json
import logging
import os
import socket
import threading
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path

import pgraph_core as pg
from pgraph_core.model.files import user_folder

from ..core.events import Event
from ..core.state import Kept, State
from ..model.archive import own
from ..session.update import NotKept

DELAY, RETRY = 0.4, 1.0  # [s] before a file is flushed, and before it is tried again
MOST = 20  # sessions that are offered
log = logging.getLogger(__name__)


def state_folder() -> Path:
    """Where a program keeps what it would not lose: $XDG_STATE_HOME/pgraph."""
    return user_folder("XDG_STATE_HOME", ".local/state")


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
    """Writes the model of this session at each edit."""

    def __init__(
        self, folder: Path, host: str, port: int, given: str, send: Callable[[Event], None]
    ):
        self._path = folder / _name(host, port)
        self._given, self._send = given, send
        self._first: pg.Model | None = None  # as it was opened: nothing to keep
        self._model: pg.Model | None = None  # the last one; None: no edit yet
        self._changed = threading.Condition()
        self._settled = True  # on the disk, not only handed to the system
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
                self._model, self._settled = new.model, False
                self._write(ended=False)
                self._changed.notify()

    def stop(self) -> None:
        """The session has ended in order."""
        with self._changed:
            self._stopped = True
            self._changed.notify()
        if self._thread.is_alive():
            self._thread.join(timeout=5.0)

    def _loop(self) -> None:
        stopped = False
        while not stopped:
            with self._changed:
                self._changed.wait_for(lambda: self._stopped or not self._settled)
                self._changed.wait_for(lambda: self._stopped, RETRY if self._failed else DELAY)
                stopped = self._stopped
                if self._failed or stopped:
                    self._write(ended=stopped)
                self._settled = not self._failed
            with contextlib.suppress(OSError), self._path.open("rb") as file:
                os.fsync(file.fileno())  # a loss of power keeps what was flushed

    def _write(self, *, ended: bool) -> None:
        """Replace the file. It is handed to the system only: that outlives any death of ours."""
        problem = ""
        try:
            if self._model is self._first:
                self._path.unlink(missing_ok=True)
            elif self._model is not None:
                self._path.parent.mkdir(parents=True, exist_ok=True, mode=0o700)
                text = self._model.model_dump_json(exclude_none=True)
                session = {"given": self._given, "text": text, "ended": ended}
                new = self._path.with_suffix(".new")
                new.write_text(json.dumps(session), "utf-8")
                new.replace(self._path)
        except OSError as error:
            problem = f"{self._path} cannot be written: {error.strerror or error}."
        if problem != self._failed:
            log.warning("the model is %s", f"not kept: {problem}" if problem else "kept again")
            self._send(NotKept(problem))
        self._failed = problem
