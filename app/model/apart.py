"""Reading of untrusted files in a child process with memory and time limits. It can be stopped.

A file of a few hundred bytes can ask a reader for hours of work or for all memory, or crash a
library. A child process does not delay other pages. Starting the process takes 1 s.
"""

from __future__ import annotations

import logging
import os
import pickle
import shutil
import signal
import subprocess
import sys
import threading
import traceback
from collections.abc import Callable
from contextlib import suppress
from pathlib import Path
from queue import SimpleQueue
from typing import Any

import pgraph_core as pg

from ..core.cells import Refusal
from ..core.events import Event
from . import Errand, ErrandDone, Found, State

LONGEST = 60  # [s] limit on processor time (the largest files of the tests take 5 s)
PATIENCE = 5  # limit on wall time relative to LONGEST, for a busy machine
MOST_MEMORY = 4 * 2**30  # [bytes] limit on address space (the same files take 1.5 GB)
NICE = 10  # edits of pages go first
TOO_LONG = f"reading it takes more than {LONGEST} s; make it smaller"
CHILDREN = threading.BoundedSemaphore(max(os.cpu_count() or 1, 2))  # children that compute at once
Work = Callable[[Any], Found]  # can be pickled, and takes no model
log = logging.getLogger(__name__)


class Reader:
    """A child process that reads one file.

    `leaves` is a file or folder that the work makes. The folder is removed if reading was
    cancelled.
    """

    def __init__(self, work: Work, leaves: Path | None = None):
        self._work, self._leaves = work, leaves
        self._lock = threading.Lock()
        self._process: subprocess.Popen[bytes] | None = None
        self._stopped = False

    def stop(self) -> None:
        """Stop the child process, or prevent it from starting."""
        with self._lock:
            self._stopped = True
            if self._process is not None:
                self._process.kill()

    def result(self) -> Found:
        """Wait for the child process. Raises Refusal with the reason if there is no result."""
        with CHILDREN:
            new = self._leaves is not None and not self._leaves.exists()
            try:
                kind, found = self._answer()
            except Refusal:
                if self._leaves is not None and new:
                    shutil.rmtree(self._leaves, ignore_errors=True)
                    self._leaves.unlink(missing_ok=True)
                raise
        if kind == "refused":
            raise Refusal(found)
        return found

    def _answer(self) -> tuple[str, Any]:
        with self._lock:
            if self._stopped:
                raise Refusal("reading was cancelled")
            self._process = process = subprocess.Popen(
                [sys.executable, "-m", __name__, str(LONGEST)],
                stdin=subprocess.PIPE,
                stdout=subprocess.PIPE,
                stderr=subprocess.DEVNULL,
            )
        with process:
            try:
                work, patience = pickle.dumps(self._work), PATIENCE * LONGEST
                answer, _ = process.communicate(work, timeout=patience)
            except subprocess.TimeoutExpired:
                process.kill()
                raise Refusal(TOO_LONG) from None
        if self._stopped:
            raise Refusal("reading was cancelled")
        if process.returncode == -signal.SIGXCPU:
            raise Refusal(TOO_LONG)
        if process.returncode != 0:
            end = f"the process that read it ended with code {process.returncode}"
            raise Refusal(f"{end}; the file is damaged, or needs more memory than there is")
        return pickle.loads(answer)


def refused(error: Exception) -> str:
    """Return the message for an error in an errand."""
    if isinstance(error, (pg.PgraphError, Refusal, OSError)):
        return str(error)
    if isinstance(error, MemoryError):
        return f"it needs more than {MOST_MEMORY / 2**30:.0f} GB of memory; make it smaller"
    log.error("an errand failed", exc_info=error)
    last = traceback.extract_tb(error.__traceback__)[-1]
    place = f"{Path(last.filename).name}, line {last.lineno}"
    return (
        f"Pgraph failed to read it, which is a bug in Pgraph ({type(error).__name__} in {place}); "
        "please report it together with the file"
    )


def main() -> None:
    """Read the task from standard input, run it, and write the result to standard output."""
    out = os.dup(1)
    os.dup2(2, 1)  # libraries print what is no answer
    with suppress(ImportError):  # not on Windows
        import resource

        longest = int(sys.argv[1])
        resource.setrlimit(resource.RLIMIT_CPU, (longest, longest + 1))
        resource.setrlimit(resource.RLIMIT_AS, (MOST_MEMORY, MOST_MEMORY))
        os.nice(NICE)
    try:
        answer = ("found", pickle.load(sys.stdin.buffer)(None))
        content = pickle.dumps(answer)
    except Exception as error:
        content = pickle.dumps(("refused", refused(error)))
    with open(out, "wb") as pipe:
        pipe.write(content)


if __name__ == "__main__":
    main()


# -- execution of errands, one at a time in a thread, with files read in child processes -----------


class Errands:
    """Runs the errands of pages. Errands that need the kernels wait for their compilation."""

    def __init__(self, send: Callable[[Event], None]):
        self._send = send
        self._begun = 0  # id of the last errand that was queued
        self._queue: SimpleQueue[Errand] = SimpleQueue()
        self._readers: dict[int, Reader] = {}  # by the ids of their errands
        threading.Thread(target=self._work, name="pgraph-errands", daemon=True).start()

    def render(self, old: State, new: State) -> None:
        self._stop_readers(old, new)
        for errand in new.errands:
            if errand.apart and errand.id not in self._readers:
                reader = self._readers[errand.id] = Reader(errand.work, errand.leaves)
                name = f"pgraph-reading-{errand.id}"
                threading.Thread(
                    target=self._read, args=(errand, reader), name=name, daemon=True
                ).start()
        for errand in new.errands:
            if errand.apart or errand.id <= self._begun:
                continue
            if errand.compiled and not new.kernels.ready:
                return  # later errands wait too
            self._begun = errand.id
            self._queue.put(errand)

    def _stop_readers(self, old: State, new: State) -> None:
        """Stop readers that were cancelled or whose page has closed."""
        gone = old.clients.keys() - new.clients.keys()
        wanted = {errand.id for errand in new.errands if errand.client not in gone}
        for known in self._readers.keys() - wanted:
            self._readers.pop(known).stop()

    def _read(self, errand: Errand, reader: Reader) -> None:
        try:
            done = ErrandDone(errand.id, reader.result())
        except Exception as error:
            done = ErrandDone(errand.id, problem=refused(error))
        self._send(done)

    def _work(self) -> None:
        while True:
            self._send(answer(self._queue.get()))


def answer(errand: Errand) -> ErrandDone:
    """Return the result of an errand, or the reason for its failure."""
    try:
        return ErrandDone(errand.id, errand.work(errand.model))
    except Exception as error:  # shown on the page: the session goes on
        return ErrandDone(errand.id, problem=refused(error))
