"""`python -m pgraph_core.engine`: fill the disk cache, one line `i n name` a kernel.

With `--with-parent` it ends as soon as its standard input is closed, however its parent died.
With `--second` it is the second of the two processes that share the work. With `--later` it
compiles the kernels that few scenes need, such as those of walking and of implicit methods, and
with `--all` these in a process beside the others.
"""

import os
import subprocess
import sys
import threading
from collections.abc import Iterator
from contextlib import contextmanager, nullcontext
from importlib import import_module
from pathlib import Path
from pkgutil import walk_packages

from . import second_process, warm_up


def main() -> None:
    """Compile kernels, saying which."""
    words = sys.argv[1:]
    if "--with-parent" in words:
        threading.Thread(target=_end_with_parent, daemon=True).start()
        if hasattr(os, "nice"):  # not on Windows; the parent, a page, goes first
            os.nice(10)
    if "--later" in words:
        for name in _compile_later():
            print(name, flush=True)
        return
    second = "--second" in words
    with (
        _later_process() if "--all" in words else nullcontext(),
        nullcontext() if second else second_process(),
    ):
        for i, n, name in warm_up(second):
            print(i, n, name, flush=True)


def _compile_later() -> Iterator[str]:
    """Compile the kernels that are left to their first use; yields the name of each."""
    from .compiler.jit import LATER, compile_kernel

    package = __spec__.parent if __spec__ else "pgraph_core.engine"
    for module in walk_packages([str(Path(__file__).parent)], f"{package}."):
        if not module.name.endswith("__main__"):
            import_module(module.name)
    for name in LATER:
        compile_kernel(name)
        yield name


@contextmanager
def _later_process() -> Iterator[None]:
    """Within it another process compiles what few scenes need; it is waited for at the end."""
    with subprocess.Popen([sys.executable, "-m", "pgraph_core.engine", "--later"]):
        yield


def _end_with_parent() -> None:
    sys.stdin.read()
    os._exit(1)  # from a thread: the compiler in the main one is not to be waited for


if __name__ == "__main__":
    main()
