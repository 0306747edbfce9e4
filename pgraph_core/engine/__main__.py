"""`python -m pgraph_core.engine`: load the usual kernels, printing a line `i n name` for each.

With `--with-parent`, the process ends as soon as its standard input is closed, so it also ends if
its parent is killed. With `--all`, all other kernels are loaded as well. `--archive` makes the
archive of kernels from the sources, and `--machine-code` makes machine code of the archive for the
usual processors, for a wheel.
"""

import os
import sys
import threading
from pathlib import Path

from . import warm_up


def main() -> None:
    """Run the commands given on the command line and report the result."""
    words = sys.argv[1:]
    if "--with-parent" in words:
        threading.Thread(target=_end_with_parent, daemon=True).start()
        if hasattr(os, "nice"):  # not on Windows. The parent, a page, has priority
            os.nice(10)
    if "--pieces" in words:
        from .compiler.building import make_pieces

        for name in make_pieces(Path(words[1]), "--lanes" in words):
            print(name, flush=True)
    elif {"--archive", "--machine-code"} & {*words}:
        from .compiler import building

        make = building.build if "--archive" in words else building.machine_code
        for line in make():
            print(line, flush=True)
    else:
        for i, n, name in warm_up("--all" in words):
            print(i, n, name, flush=True)


def _end_with_parent() -> None:
    sys.stdin.read()
    os._exit(1)  # from a thread: the compiler in the main one is not to be waited for


if __name__ == "__main__":
    main()
