"""Reading of untrusted files in a child process with memory and time limits. It can be stopped.

A file of a few hundred bytes can ask a reader for hours of work or for all memory, or crash a
library. A child process does not delay other pages. Starting the process takes 1 s.
"""

from __future__ import annotations

import logging
import os
import shutil
import threading
from collections.abc import Callable
from functools import partial
from pathlib import Path
from queue import SimpleQueue
from typing import Any

import pgraph_core as pg
from pgraph_core.children import MOST_MEMORY, Child, place_of

from ..core.cells import Refusal
from ..core.events import Event
from . import Errand, ErrandDone, Found, State

LONGEST = 60  # [s] limit on processor time (the largest files of the tests take 5 s)
PATIENCE = 5  # limit on wall time relative to LONGEST, for a busy machine
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
        self._child, self._leaves = Child(partial(work, None), LONGEST), leaves

    def stop(self) -> None:
        """Stop the child process, or prevent it from starting."""
        self._child.stop()

    def result(self) -> Found:
        """Wait for the child process. Raises Refusal with the reason if there is no result."""
        with CHILDREN:
            new = self._leaves is not None and not self._leaves.exists()
            try:
                return self._child.result(PATIENCE)
            except InterruptedError:
                why = "reading was cancelled"
            except TimeoutError:
                why = TOO_LONG
            except ChildProcessError as ended:
                end = f"the process that read it ended with code {ended.errno}"
                why = f"{end}; the file is damaged, or needs more memory than there is"
            except Exception as error:
                raise Refusal(refused(error)) from None
            if self._leaves is not None and new:
                shutil.rmtree(self._leaves, ignore_errors=True)
                self._leaves.unlink(missing_ok=True)
            raise Refusal(why)


def refused(error: Exception) -> str:
    """Return the message for an error in an errand."""
    if isinstance(error, (pg.PgraphError, Refusal, OSError)):
        return str(error)
    if isinstance(error, MemoryError):
        return f"it needs more than {MOST_MEMORY / 2**30:.0f} GB of memory; make it smaller"
    log.error("an errand failed", exc_info=error)
    return (
        f"Pgraph failed to read it, which is a bug in Pgraph ({type(error).__name__} in "
        f"{place_of(error)}); please report it together with the file"
    )


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
