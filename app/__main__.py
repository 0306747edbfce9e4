"""Entry point for `python -m app` and the console script `pgraph`."""

from __future__ import annotations

import os
import sys


def main() -> int:
    """Run the program and return its exit code."""
    # before NumPy is imported: on busy processors OpenBLAS's threads wait a hundred times as long
    # for each other as matrices of a mechanism take to compute
    os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")
    try:
        from pgraph_app.cli import main

        return main()
    except KeyboardInterrupt:
        print("Stopped.", file=sys.stderr)
        return 130  # the shells' code for Ctrl+C


if __name__ == "__main__":
    sys.exit(main())
