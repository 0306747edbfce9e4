"""`python -m pgraph_core.engine`: fill the disk cache, one line `i n name` a kernel."""

import os

from . import warm_up


def main() -> None:
    """Compile every kernel, saying which; what else runs on the machine, a page, goes first."""
    if hasattr(os, "nice"):  # not on Windows
        os.nice(10)
    for i, n, name in warm_up():
        print(i, n, name, flush=True)


if __name__ == "__main__":
    main()
