"""Errands of pages, done in a thread one after the other."""

from __future__ import annotations

import threading
from collections.abc import Callable
from queue import SimpleQueue

import pgraph_core as pg

from ..core.cells import Refusal
from ..core.events import Event
from ..core.state import State
from . import Errand
from .update import ErrandDone


class Errands:
    """Does what pages ask for; what needs the kernels waits until they are compiled."""

    def __init__(self, send: Callable[[Event], None]):
        self._send = send
        self._begun = 0  # id of the last errand that was queued
        self._queue: SimpleQueue[Errand] = SimpleQueue()
        threading.Thread(target=self._work, name="pgraph-errands", daemon=True).start()

    def render(self, old: State, new: State) -> None:
        for errand in new.errands:
            if errand.compiled and not new.kernels.ready:
                return  # those behind it wait too: they were asked for later
            if errand.id > self._begun:
                self._begun = errand.id
                self._queue.put(errand)

    def _work(self) -> None:
        while True:
            self._send(answer(self._queue.get()))


def answer(errand: Errand) -> ErrandDone:
    """What an errand found, or the sentence why it failed."""
    try:
        return ErrandDone(errand.id, errand.work(errand.model))
    except (pg.PgraphError, Refusal, OSError) as error:
        return ErrandDone(errand.id, problem=str(error))
    except Exception as error:  # shown on the page: the session goes on
        return ErrandDone(errand.id, problem=f"{type(error).__name__}: {error}")
