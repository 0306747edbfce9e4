"""A progress bar on a terminal, and none in a pipe."""

from __future__ import annotations

import sys
from collections.abc import Callable

WIDTH = 30  # characters

Bar = Callable[[str, float], bool]  # what is done, how much of it; the work goes on


def progress_bar() -> Bar:
    """What draws the bar, or says nothing where nobody looks."""
    return drawn if sys.stderr.isatty() and sys.stdout.isatty() else silent


def drawn(what: str, fraction: float) -> bool:
    """A bar on stderr, wiped off when there is nothing left to do; the work goes on."""
    done = round(WIDTH * fraction)
    bar = f"{what:10}[{'#' * done}{'.' * (WIDTH - done)}] {fraction:4.0%}" if what else ""
    print(f"\r{bar or ' ' * (WIDTH + 17)}", end="" if what else "\r", file=sys.stderr, flush=True)
    return True


def silent(what: str, fraction: float) -> bool:
    """Nothing."""
    return True
