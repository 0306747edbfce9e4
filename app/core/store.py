"""A queue, and the one thread that owns the state: it applies events and lets the views draw."""

from __future__ import annotations

import logging
import queue
import threading
import time
from collections.abc import Callable, Sequence
from typing import Protocol

from ..core.events import Event, update
from ..playback.update import Tick
from .state import State

FRAME = 1 / 60  # [s] between ticks while playing
log = logging.getLogger(__name__)


class View(Protocol):
    """Whatever follows the state: it draws, or works, where `old` and `new` differ."""

    def render(self, old: State, new: State) -> None: ...


class Store:
    """`send(event)` from any thread; everything else happens in the store's own."""

    def __init__(self, state: State, update: Callable[[State, Event], State] = update):
        self.state = state
        self._update = update
        self._events: queue.SimpleQueue[Event | None] = queue.SimpleQueue()
        self._thread = threading.Thread(target=self._loop, name="pgraph-store", daemon=True)
        self._views: Sequence[View] = ()

    def start(self, views: Sequence[View]) -> None:
        """Draw for the first time, then follow the events."""
        self._views = views
        self._draw(self.state, self.state)
        self._thread.start()

    def send(self, event: Event) -> None:
        """Queue an event; never waits."""
        self._events.put(event)

    def stop(self) -> None:
        """Finish the events queued so far and end the thread."""
        self._events.put(None)
        self._thread.join(timeout=5.0)

    def _loop(self) -> None:
        ticked = time.perf_counter()
        while True:
            playing = self.state.playback.playing
            due = ticked + FRAME
            try:
                wait = max(due - time.perf_counter(), 0.0) if playing else None
                event = self._events.get(timeout=wait)
            except queue.Empty:
                now = time.perf_counter()
                event, ticked = Tick(now - ticked), now
            if event is None:
                return
            if not playing:
                ticked = time.perf_counter()
            self._apply(event)

    def _apply(self, event: Event) -> None:
        """One event; a fault in it or in a view is logged and the page goes on."""
        try:
            old, self.state = self.state, self._update(self.state, event)
        except Exception:
            log.exception("the event %s failed; the state stays as it was", type(event).__name__)
            return
        if self.state is not old:
            self._draw(old, self.state)

    def _draw(self, old: State, new: State) -> None:
        for view in self._views:
            try:
                view.render(old, new)
            except Exception:
                log.exception("%s could not draw", type(view).__name__)
