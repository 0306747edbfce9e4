"""Ctrl+C while compiled code calls Python, while threads share work, and while processes start.

Python raises the exception of a signal at the next line that the main thread runs. In a function
that compiled code calls, it would be lost, and between two threads' parts of a step it would leave
half of them undone. The exception therefore waits for the end of the piece of work. Processes of a
sweep receive no signal of a terminal, because the process that has started them ends them.
"""

from __future__ import annotations

import signal
import threading
from collections.abc import Iterator
from contextlib import contextmanager
from typing import Any


class Deferred:
    """A piece of work, after which an interrupt is raised that came within it.

    Pieces may be nested: an inner one raises what came within an outer one. In other threads than
    the main one, which receive no signals, there is nothing to wait for.
    """

    def __init__(self) -> None:
        self.caught: BaseException | None = None
        self._before: Any = None
        self._outer: Deferred | None = None

    def __enter__(self) -> Deferred:
        if threading.current_thread() is threading.main_thread():
            handler = signal.getsignal(signal.SIGINT)
            outer = getattr(handler, "__self__", None)
            if isinstance(outer, Deferred):
                self._outer = outer
            elif callable(handler):
                self._before = handler
                signal.signal(signal.SIGINT, self._keep)
        return self

    def __exit__(self, kind: Any, error: BaseException | None, trace: Any) -> None:
        if self._before is not None:
            signal.signal(signal.SIGINT, self._before)
        caught = (self._outer or self).caught
        if caught is not None and not isinstance(error, type(caught)):
            raise caught

    def _keep(self, *signalled: Any) -> None:
        """Call the handler of the process, and keep what it raises."""
        try:
            self._before(*signalled)
        except BaseException as error:
            self.caught = error


@contextmanager
def starting() -> Iterator[None]:
    """Hold back Ctrl+C from this thread, and for ever from the processes that it starts meanwhile.

    They inherit the mask of signals. Otherwise each would write where it was.
    """
    if not hasattr(signal, "pthread_sigmask"):  # Windows
        yield
        return
    before = signal.pthread_sigmask(signal.SIG_BLOCK, {signal.SIGINT})
    try:
        yield
    finally:
        signal.pthread_sigmask(signal.SIG_SETMASK, before)
