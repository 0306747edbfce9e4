"""`python -m pgraph_core.engine`: fill the disk cache, one line `i n name` a kernel.

With `--with-parent` it ends as soon as its standard input is closed, however its parent died.
With `--second` it is the second of the two processes that share the work. With `--all` it compiles
the kernels that few scenes need as well.
"""

import os
import sys
import threading
from contextlib import nullcontext

from . import second_process, warm_up


def main() -> None:
    """Compile every kernel, saying which; what else runs on the machine, a page, goes first."""
    if "--with-parent" in sys.argv[1:]:
        threading.Thread(target=_end_with_parent, daemon=True).start()
    if hasattr(os, "nice"):  # not on Windows
        os.nice(10)
    second, everything = "--second" in sys.argv[1:], "--all" in sys.argv[1:]
    with nullcontext() if second else second_process(everything):
        for i, n, name in warm_up(second, everything):
            print(i, n, name, flush=True)


def _end_with_parent() -> None:
    sys.stdin.read()
    os._exit(1)  # from a thread: the compiler in the main one is not to be waited for


if __name__ == "__main__":
    main()
