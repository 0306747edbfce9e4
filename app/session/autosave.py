"""Autosave: each edit is written before it is acknowledged, so a killed server loses none.

A session is one run of the server, with a random id. Each model opened in a session (a document)
has a separate file, `ID-DOCUMENT.json`, which is not written by any other session. A lock on
`ID.lock`, which the operating system frees when the process ends, shows whether the session is
still running. Where files cannot be locked or the lock is missing, the process named in the file
shows it. A file is removed once its model is saved, opened by another session or discarded. The
store renders Autosave before the views. A thread flushes files to the disk a moment later, retries
failed writes, and writes again what others have removed.
"""

from __future__ import annotations

import contextlib
import json
import logging
import os
import secrets
import threading
import time
from collections.abc import Callable, Iterable
from dataclasses import asdict, dataclass
from pathlib import Path
from typing import IO

import pgraph_core as pg
from pgraph_core.markup import ordinary, reason_of
from pgraph_core.model.files import shown_path, user_folder

from ..core.events import Event
from ..model import Kept
from . import NotKept, Saved, State

try:
    import fcntl
except ImportError:  # Windows: sessions that still run are offered as well
    fcntl = None

DELAY, RETRY = 0.4, 1.0  # [s] before a file is flushed, and before it is tried or looked at again
LARGEST = 1 << 28  # size of the largest session file that is read [bytes]
log = logging.getLogger(__name__)


def state_folder() -> Path:
    """Return the folder for session files: $XDG_STATE_HOME/pgraph."""
    return user_folder("XDG_STATE_HOME", ".local/state")


@dataclass(frozen=True)
class Session:
    """The content of a session file."""

    given: str  # the model that the server was started with
    text: str  # the model as JSON
    ended: bool  # the server was stopped, not killed
    process: int = 0  # id of the server's process

    def kept(self, path: Path) -> Kept:
        """Return the content shown on the page. Raises KeyError, TypeError or ValueError."""
        name = str(json.loads(self.text)["name"])
        name.encode()
        return Kept(path, self.given, path.stat().st_mtime, self.text, self.ended, name)

    @property
    def runs(self) -> bool:
        """Return True if the server's process may still run."""
        if self.ended or self.process in (0, os.getpid()) or fcntl is None:
            return False  # on Windows, asking would end the process
        try:
            os.kill(self.process, 0)
        except (ProcessLookupError, OverflowError):
            return False
        except OSError:  # a process of another user
            return True
        return True


def left_behind(folder: Path) -> tuple[Kept, ...]:
    """Return the models of terminated sessions, newest first.

    A warning names a file or folder that cannot be read, which stays as it is.
    """
    found, sessions = [], dict[str, list[Path]]()
    try:
        there = list(folder.iterdir())
    except FileNotFoundError:  # nobody has edited yet
        there = []
    except OSError as error:
        log.warning("autosaves in %s cannot be read: %s", folder, reason_of(error))
        there = []
    for path in there:
        sessions.setdefault(path.stem.rpartition("-")[0] or path.stem, []).append(path)
    for session, paths in sessions.items():
        files = [path for path in paths if path.suffix == ".json"]
        rest = [path for path in paths if path.suffix == ".new"]
        lock = folder / f"{session}.lock"
        held = _held(lock)
        if held is False:
            for path in rest if files else [*rest, lock]:
                with contextlib.suppress(OSError):  # the folder may be read-only
                    path.unlink()
        for path in files if not held else ():
            try:
                one = Session(**json.loads(_content(path)))
                if held is False or not one.runs:
                    found.append(one.kept(path))
            except (OSError, ValueError, TypeError, KeyError, RecursionError) as error:
                log.warning("the autosave %s cannot be read: %s", path, reason_of(error))
    return tuple(sorted(found, key=lambda kept: kept.time, reverse=True))


def _content(path: Path) -> str:
    """Return the text of an ordinary file of at most LARGEST bytes. Raises OSError, ValueError."""
    with ordinary(path) as file:
        text = file.read(LARGEST + 1)
    if len(text) > LARGEST:
        raise ValueError(f"it has more than {LARGEST >> 20} MB")
    return text.decode()


def _held(lock: Path) -> bool | None:
    """Check whether a process holds the lock of a session. Returns None if that is not known."""
    try:
        with ordinary(lock) as file:
            return {True: False, False: True, None: None}[_locked(file, shared=True)]
    except (OSError, ValueError):
        return None


def _locked(file: IO[bytes], *, shared: bool) -> bool | None:
    """Lock a file for this process. Returns False if another process holds the lock, and None if
    files cannot be locked."""
    if fcntl is None:
        return None
    try:
        fcntl.flock(file, (fcntl.LOCK_SH if shared else fcntl.LOCK_EX) | fcntl.LOCK_NB)
    except BlockingIOError:
        return False
    except OSError:  # a file system without locks
        return None
    return True


class Autosave:
    """Saves the models of this session after every edit."""

    def __init__(
        self,
        folder: Path,
        given: str,
        send: Callable[[Event], None],
        opened: Iterable[Path] = (),
    ):
        """`opened` are files of earlier sessions whose models this session starts with."""
        self._folder, self._given, self._send = folder, given, send
        self._id, self._lock = "", None
        self._over = set(opened)  # to be removed once this session's own files are written
        self._models: dict[int, pg.Model] = {}  # by document, the last one
        self._current = -1
        self._elsewhere: dict[int, pg.Model] = {}  # by document, as started or saved: not at risk
        self._opened: dict[int, pg.Model] = {}  # by document, as opened from a file or the gallery
        self._due: set[int] = set()  # documents to be written
        self._files: dict[int, Path] = {}
        self._changed = threading.Condition()
        self._settled = True  # on the disk, not only handed to the system
        self._stopped = False
        self._failed = ""
        self._thread = threading.Thread(target=self._loop, name="pgraph-autosave", daemon=True)

    def render(self, old: State, new: State) -> None:
        if self._current < 0:
            self._elsewhere[0] = new.undo[0].model if new.undo else new.model
            self._current = new.document
            self._thread.start()
        gone = {old.kept[label].path for label in old.kept.keys() - new.kept.keys()}
        moved = new.model is not old.model or (old is new and new.undo)
        if not (moved or gone or new.saved is not old.saved):
            return
        with self._changed:
            if new.document not in self._models and new.document and not gone and not self._over:
                self._opened[new.document] = new.model
            self._over |= gone
            if new.saved is not None:
                self._elsewhere[new.saved[0]] = new.saved[1]
            self._models[new.document] = new.model
            self._due |= {new.document, self._current} & self._models.keys()
            self._current, self._settled = new.document, False
            self._write_due()
            self._changed.notify()

    def stop(self) -> None:
        """Mark the files as belonging to a session that was stopped, not killed."""
        with self._changed:
            self._stopped = True
            self._changed.notify()
        if self._thread.is_alive():
            self._thread.join(timeout=5.0)
        if self._lock is not None:
            with contextlib.suppress(OSError):  # gone, or in a folder that is read-only now
                self._lock_path.unlink()
            self._lock.close()

    @property
    def _lock_path(self) -> Path:
        return self._folder / f"{self._id}.lock"

    def _loop(self) -> None:
        stopped = False
        while not stopped:
            with self._changed:
                self._changed.wait_for(lambda: self._stopped or not self._settled, RETRY)
                self._changed.wait_for(lambda: self._stopped, RETRY if self._failed else DELAY)
                stopped = self._stopped
                if stopped or self._removed():
                    self._due |= self._files.keys()
                if self._due or stopped:
                    self._settled = False
                    self._write_due(ended=stopped)
                files = [] if self._settled else list(self._files.values())
                self._settled = not self._failed
            for path in files:
                _flush(path)

    def _write_due(self, *, ended: bool = False) -> None:
        """Write all files that are due. The files remain after this process ends."""
        problem = ""
        try:
            while self._due:
                document = min(self._due)
                self._write(document, ended)
                self._due.discard(document)
            if self._over and self._current in self._files:
                _flush(self._files[self._current])
            while self._over:
                self._over.pop().unlink(missing_ok=True)
        except OSError as error:
            where = error.filename or self._folder
            problem = f"{where} cannot be written: {error.strerror or error}."
        except Exception as error:  # whatever it is, people must know that edits are not kept
            log.exception("autosave failed")
            problem = f"the model cannot be written: {type(error).__name__}: {error}."
        if problem != self._failed:
            log.warning("the model is %s", f"not kept: {problem}" if problem else "kept again")
            self._send(NotKept(problem))
        self._failed = problem

    def _write(self, document: int, ended: bool) -> None:
        """Replace the file of a document, or remove it if there are no unsaved changes."""
        model = self._models[document]
        away = document != self._current and model is self._opened.get(document)
        if away or model is self._elsewhere.get(document):
            if document in self._files:
                self._files.pop(document).unlink(missing_ok=True)
            return
        if self._lock is None or _is(self._lock, self._lock_path) is False:
            self._begin()
        path = self._folder / f"{self._id}-{document}.json"
        text = model.model_dump_json(exclude_none=True)
        session = Session(self._given, text, ended, os.getpid())
        new = path.with_suffix(".new")
        new.write_text(json.dumps(asdict(session)), "utf-8")
        new.replace(path)
        self._files[document] = path

    def _begin(self) -> None:
        """Choose an id and lock it. Another process may remove the lock file before that.

        Files under an earlier id, whose lock has been removed, are due again. An id whose lock
        cannot be written is tried again, so the page keeps showing the same problem.
        """
        self._folder.mkdir(parents=True, exist_ok=True, mode=0o700)
        self._due |= self._files.keys()
        self._over |= set(self._files.values())
        self._files.clear()
        if self._lock is not None:
            self._lock.close()
            self._id, self._lock = "", None
        while self._lock is None:
            self._id = self._id or secrets.token_hex(8)
            file = self._lock_path.open("xb")
            if _locked(file, shared=False) is not False and self._lock_path.exists():
                self._lock = file
            else:
                file.close()
                self._id = ""

    def _removed(self) -> bool:
        """Check whether the lock or a file of this session is gone, or out of reach."""
        if self._lock is None:
            return False
        there = all(os.path.exists(path) for path in self._files.values())
        return not there or not _is(self._lock, self._lock_path)


def _is(file: IO[bytes], path: Path) -> bool | None:
    """Check whether a path still leads to an open file. Returns None if that is not known."""
    try:
        return os.path.samestat(os.fstat(file.fileno()), path.stat())
    except (FileNotFoundError, NotADirectoryError):
        return False
    except OSError:  # a folder that may not be entered
        return None


def _flush(path: Path) -> None:
    """Flush a file to disk, so that it survives a loss of power."""
    with contextlib.suppress(OSError), path.open("rb") as file:
        os.fsync(file.fileno())


# -- writing of the model to a file that a page names ----------------------------------------------


class Files:
    """Writes the model for a page, which must confirm before a foreign file is replaced."""

    def __init__(self, send: Callable[[Event], None]):
        self._send = send
        self._written: dict[Path, bytes] = {}  # last content that this session wrote

    def render(self, old: State, new: State) -> None:
        saving = new.saving
        if saving is None or saving is old.saving:
            return
        path = given = Path(saving.path)
        problem = offer = ""
        try:
            path = given = given.expanduser().absolute()
            path = given.resolve()
            problem, offer = self._refused(path, saving.replace)
            if not Path(saving.path).name.isprintable() or saving.path.endswith(("/", "\\")):
                problem = f"{saving.path!r} is not a usable file name; use one such as arm.json."
            if not problem:
                saving.model.save(path)
                self._written[path] = path.read_bytes()
        except pg.PgraphError as error:
            problem = str(error)
        except (OSError, RuntimeError, ValueError) as error:  # a circle of links, '~nobody', a NUL
            problem = f"{shown_path(path)} could not be written: {reason_of(error)}."
        shown = str(path) if path == given else f"{path}, where {given} points to"
        self._send(Saved(saving.client, saving.serial, shown, problem, offer))

    def _refused(self, path: Path, replace: bool) -> tuple[str, str]:
        """Return the reason why a model is not written to a path, with a remedy, or ""."""
        if path.exists() and not path.is_file():
            return f"{path} is not an ordinary file; give the name of a new one.", ""
        if path.suffix != ".json":
            return f"The name of a model file ends in .json, got {path.name!r}.", ""
        if not path.exists():
            return "", ""
        content = path.read_bytes()
        if replace or content == self._written.get(path):
            return "", ""
        changed = time.strftime("%H:%M on %d %B %Y", time.localtime(path.stat().st_mtime))
        whose = "has changed since" if path in self._written else "exists and is not from"
        said = f"{path} {whose} this session (last written at {changed})."
        return said.replace("since this session", "since it was saved here"), "Replace it"
