"""The compilation of the kernels in the background."""

from __future__ import annotations

import subprocess
import sys
import threading
from collections.abc import Callable

from pgraph_core.engine.compiler.archive import current

from ..core.events import Event
from . import Compiled, Compiling

COMPILE = ("-m", "pgraph_core.engine", "--with-parent")

Send = Callable[[Event], None]


def why_compiled() -> str:
    """Return the reason why numba must compile kernels for usual runs, or ""."""
    found = current()
    return found.problem or next(map(found.why, found.stale()), "")


class Compiler:
    """Compiles kernels in a separate process if the package contains no matching kernels.

    If the package contains matching kernels, a run loads them directly, which takes one or two
    seconds at the first start.
    """

    def __init__(
        self,
        send: Send,
        command: tuple[str, ...] = COMPILE,
        why: Callable[[], str] = why_compiled,
    ):
        self._send, self._why = send, why
        self._command = (sys.executable, *command)
        self._process: subprocess.Popen[str] | None = None
        threading.Thread(target=self._watch, name="pgraph-compile", daemon=True).start()

    def stop(self) -> None:
        """End the process."""
        if self._process is not None and self._process.poll() is None:
            self._process.terminate()

    def _watch(self) -> None:
        if not self._why():
            self._send(Compiled())
            return
        said = ""
        with subprocess.Popen(
            self._command,
            stdin=subprocess.PIPE,  # closed by our death, of whatever kind
            stdout=subprocess.PIPE,
            stderr=subprocess.STDOUT,
            text=True,
        ) as process:
            self._process = process
            assert process.stdout is not None
            for line in process.stdout:
                match line.split(maxsplit=2):
                    case [done, total, name] if done.isdigit() and total.isdigit():
                        self._send(Compiling(int(done), int(total), name.strip()))
                    case [*_] if line.strip():
                        said = line.strip()
                        print(said, file=sys.stderr, flush=True)
        self._send(Compiled(said if process.returncode else ""))
