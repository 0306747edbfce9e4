"""Execution of errands, one at a time in a thread, with files read in child processes."""

from __future__ import annotations

import threading
from collections.abc import Callable
from queue import SimpleQueue

from ..core.events import Event
from . import Errand, State
from .apart import Reader, refused
from .update import ErrandDone


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
