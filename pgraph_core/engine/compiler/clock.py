"""Clocks that stand still while kernels are loaded or compiled, which happens once in a program."""

from __future__ import annotations

import threading
import time


class Loading(threading.local):
    """The time [s] that this thread has spent on loading and compiling kernels."""

    seconds = processor = 0.0
    _depth = 0  # kernels that are loaded for one another
    _began = 0.0, 0.0

    def __enter__(self) -> None:
        if self._depth == 0:
            self._began = time.perf_counter(), time.thread_time()
        self._depth += 1

    def __exit__(self, *error: object) -> None:
        self._depth -= 1
        if self._depth == 0:
            self.seconds += time.perf_counter() - self._began[0]
            self.processor += time.thread_time() - self._began[1]


LOADING = Loading()


def clocks() -> tuple[float, float]:
    """Return the time and the processor time of this thread, both without loading kernels [s]."""
    return time.perf_counter() - LOADING.seconds, time.thread_time() - LOADING.processor
