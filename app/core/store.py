"""A queue, and the single thread that owns the state, applies events and lets views draw."""

from __future__ import annotations

import contextlib
import logging
import math
import threading
import time
from collections import deque
from collections.abc import Callable, Sequence
from dataclasses import replace
from typing import Any, Protocol

from .events import Event, FromPage, Leaving, ModelEdit, Tick, Undrawn, failed, update
from .state import State

FRAME = 1 / 60  # [s] between ticks while playing
MOST_WAITING = 1000  # events of one page
MOST_AHEAD = 20  # events of pages that may pass one of the server
AGAIN = 0.1  # [s] between looks whether the pages are ready for a picture that waits
log = logging.getLogger(__name__)


class View(Protocol):
    """An observer that draws or computes when `new` differs from `old`."""

    def render(self, old: Any, new: Any) -> None: ...


class Closed(Exception):
    """Raised when the queue is closed and its last event has been taken."""


class Queue:
    """An event queue that serves senders in turn, so that none can delay the others by much.

    The events of one sender stay in their order. The server is one of the senders. User events have
    priority over its events, but at most MOST_AHEAD times in a row.
    """

    def __init__(self) -> None:
        self._waiting: dict[int | None, deque[Event]] = {}  # queues in the order of their turns
        self._changed = threading.Condition()
        self._closed = False
        self._ahead = 0  # events of pages since the server's last one
        self._woken = False

    def put(self, event: Event) -> None:
        """Append an event, unless too many events from its page are waiting.

        If the page has gone, it replaces them.
        """
        sender = event.client if isinstance(event, FromPage) else None
        with self._changed:
            waiting = self._waiting.setdefault(sender, deque())
            if isinstance(event, Leaving):
                edits = sum(isinstance(one, ModelEdit) for one in waiting)
                event = replace(event, lost=edits)
                waiting.clear()
            if sender is not None and len(waiting) >= MOST_WAITING:
                return
            waiting.append(event)
            self._changed.notify()

    def __len__(self) -> int:
        with self._changed:
            return sum(map(len, self._waiting.values()))

    def close(self) -> None:
        """Refuse further events. `get` raises Closed once those already waiting are taken."""
        with self._changed:
            self._closed = True
            self._changed.notify()

    def wake(self) -> None:
        """Wake up a waiting `get`, which returns None."""
        with self._changed:
            self._woken = True
            self._changed.notify()

    def get(self, seconds: float) -> Event | None:
        """Return the next event, or None after the given time or `wake`. Raises Closed."""
        with self._changed:
            timeout = None if seconds == math.inf else seconds
            self._changed.wait_for(lambda: self._waiting or self._closed or self._woken, timeout)
            self._woken = False
            if not self._waiting:
                if self._closed:
                    raise Closed
                return None
            sender = next(iter(self._waiting))
            if sender is None and self._ahead < MOST_AHEAD:
                sender = next((one for one in self._waiting if one is not None), None)
            self._ahead = 0 if sender is None else self._ahead + 1
            waiting = self._waiting.pop(sender)
            event = waiting.popleft()
            if waiting:
                self._waiting[sender] = waiting  # its next turn comes last
            return event

    def more(self, event: Event) -> list[Event]:
        """Return and remove consecutive events of one kind and sender, if that kind collapses."""
        found: list[Event] = []
        sender = event.client if isinstance(event, FromPage) else None
        with self._changed:
            waiting = self._waiting.get(sender)
            while event.collapses and waiting and type(waiting[0]) is type(event):
                found.append(waiting.popleft())
            if waiting is not None and not waiting:
                del self._waiting[sender]
        return found


class Store:
    """An event loop. `send(event)` is thread-safe, and all else runs in the store's own thread."""

    def __init__(self, state: State, update: Callable[[Any, Event], Any] = update):
        self.state: Any = state
        self._update = update
        self._events = Queue()
        self._thread = threading.Thread(target=self._loop, name="pgraph-store", daemon=True)
        self._views: Sequence[View] = ()
        self._workers: Sequence[View] = ()
        self._drawn = state  # state that the views show
        self._missed: dict[int, State] = {}  # state of views that failed, by their ids
        # what views send meanwhile goes out as one
        self.together: Callable[[], contextlib.AbstractContextManager[None]] = (
            contextlib.nullcontext
        )
        self.ready: Callable[[], bool] = lambda: True  # whether the pages can take a picture

    def start(self, views: Sequence[View], workers: Sequence[View] = ()) -> None:
        """Draw for the first time, then start processing events.

        Workers process every event immediately. Pictures wait for `ready`, after which the most
        recent picture is drawn.
        """
        self._views, self._workers = views, workers
        self._render(self._workers, self.state, self.state)
        self._render(self._views, self.state, self.state)
        self._thread.start()

    def wake(self) -> None:
        """Check again whether the pages are ready for a new image."""
        self._events.wake()

    def send(self, event: Event) -> None:
        """Queue an event without blocking."""
        self._events.put(event)

    @property
    def waiting(self) -> int:
        """The number of waiting events."""
        return len(self._events)

    def stop(self) -> None:
        """Process the queued events and end the thread."""
        self._events.close()
        self._thread.join(timeout=5.0)

    def _loop(self) -> None:
        with contextlib.suppress(Closed):
            ticked, event = time.perf_counter(), None
            while True:
                playing = self.state.moves
                held = AGAIN if self._drawn is not self.state else math.inf
                left = ticked + FRAME - time.perf_counter() if playing else held
                if left <= 0 and not isinstance(event, Tick):
                    event = None  # events that rush in do not hold up what plays
                else:
                    event = self._events.get(max(left, 0.0))
                now = time.perf_counter()
                if event is None and not playing:
                    self._show()
                    continue
                event = event or Tick(now - ticked)
                if isinstance(event, Tick) or not playing:
                    ticked = now
                self._apply(event)

    def _apply(self, event: Event) -> None:
        """Apply an event, or several drawn as one.

        An exception is logged, its page is told, and the loop continues.
        """
        began = time.perf_counter()
        name = type(event).__name__
        old = self.state
        for one in (event, *self._events.more(event)):
            try:
                self.state = self._update(self.state, one)
            except Exception as error:
                log.exception("the event %s failed; the state stays as it was", name)
                self.state = failed(self.state, one, error)
        spent = {"update": time.perf_counter() - began}
        if self.state is not old:
            spent |= self._render(self._workers, old, self.state)
        if self.state is not self._drawn and (not event.collapses or self.ready()):
            spent |= self._show(True)
        if log.isEnabledFor(logging.INFO):  # with `--log`
            slowest = max(spent, key=spent.__getitem__)
            sender = f"page {event.client}" if isinstance(event, FromPage) else "server"
            log.info(
                "%s of %s: %.1f ms, of which %s %.1f ms",
                name, sender, 1e3 * sum(spent.values()), slowest, 1e3 * spent[slowest],
            )  # fmt: skip

    def _show(self, at_once: bool = False) -> dict[str, float]:
        """Draw pending changes, `at_once` or if the pages are ready for them."""
        old, new = self._drawn, self.state
        if new is old or not (at_once or self.ready()):
            return {}
        self._drawn = new
        with self.together():
            return self._render(self._views, old, new)

    def _render(self, views: Sequence[View], old: State, new: State) -> dict[str, float]:
        """Draw the views and return the seconds spent by each.

        A failed view is tried again with each change, and the pages are told at its first failure.
        """
        spent = dict[str, float]()
        for view in views:
            began = time.perf_counter()
            known, had = id(view) in self._missed, self._missed.pop(id(view), old)
            name = getattr(view, "name", type(view).__name__)
            try:
                view.render(had, new)
            except Exception as error:
                self._missed[id(view)] = had
                log.exception("%s could not draw", type(view).__name__)
                if not known:
                    self.send(Undrawn(name, error))
            spent[name] = spent.get(name, 0.0) + time.perf_counter() - began
        return spent
