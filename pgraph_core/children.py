"""Work in a child process with limits on processor time and memory. It can be stopped.

A file of a few hundred bytes can ask a reader for hours of work or for all memory, or crash a
library. Starting the process takes 1 s.
"""

from __future__ import annotations

import os
import pickle
import signal
import subprocess
import sys
import threading
import traceback
from collections.abc import Callable
from contextlib import suppress
from pathlib import Path
from typing import Any

MOST_MEMORY = 4 << 30  # [bytes] limit on address space (the largest files of the tests: 1.5 GB)
NICE = 10  # other processes go first
Work = Callable[[], Any]  # can be pickled


class Child:
    """A child process that calls `work` once, within `longest` seconds of processor time."""

    def __init__(self, work: Work, longest: int):
        self._work, self._longest = work, longest
        self._lock = threading.Lock()
        self._process: subprocess.Popen[bytes] | None = None
        self._stopped = False

    def stop(self) -> None:
        """Stop the child process, or prevent it from starting."""
        with self._lock:
            self._stopped = True
            if self._process is not None:
                self._process.kill()

    def result(self, patience: float) -> Any:
        """Wait for the result, at most `patience` times as long as on a machine of its own.

        Raises the error of the work, InterruptedError if it was stopped, TimeoutError, and
        ChildProcessError with the code of a process that crashed.
        """
        with self._lock:
            if self._stopped:
                raise InterruptedError
            self._process = process = subprocess.Popen(
                [sys.executable, "-m", __name__, str(self._longest)],
                stdin=subprocess.PIPE,
                stdout=subprocess.PIPE,
                stderr=subprocess.DEVNULL,
            )
        with process:
            try:
                sent, longest = pickle.dumps(self._work), patience * self._longest
                answer, _ = process.communicate(sent, timeout=longest)
            except subprocess.TimeoutExpired:
                process.kill()
                raise TimeoutError from None
        if self._stopped:
            raise InterruptedError
        if process.returncode == -signal.SIGXCPU:
            raise TimeoutError
        if process.returncode != 0:
            raise ChildProcessError(process.returncode, "a child process ended")
        done, found = pickle.loads(answer)
        if done:
            return found
        raise found


def place_of(error: Exception) -> str:
    """Return the file and the line in which an error was raised, also in a child process."""
    if place := vars(error).get("place"):
        return place
    last = traceback.extract_tb(error.__traceback__)[-1]
    return f"{Path(last.filename).name}, line {last.lineno}"


def main() -> None:
    """Read the work from standard input, do it, and write the result to standard output."""
    out = os.dup(1)
    os.dup2(2, 1)  # libraries print what is no answer
    with suppress(ImportError):  # not on Windows
        import resource

        longest = int(sys.argv[1])
        resource.setrlimit(resource.RLIMIT_CPU, (longest, longest + 1))
        resource.setrlimit(resource.RLIMIT_AS, (MOST_MEMORY, MOST_MEMORY))
        os.nice(NICE)
    try:
        content = pickle.dumps((True, pickle.load(sys.stdin.buffer)()))
    except Exception as error:
        vars(error)["place"] = place_of(error)
        content = pickle.dumps((False, error))
    with open(out, "wb") as pipe:
        pipe.write(content)


if __name__ == "__main__":
    main()
