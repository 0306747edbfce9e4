"""Benchmarks: one module each, run by `pgraph bench`. They need a clone: the wheel has none.

A benchmark is a module of this folder that defines `MINUTES`, about how long it takes. The module's
name is the benchmark's, the first line of its docstring says what it measures, and `rows(effort)`
yields the results. `PEERS` are packages that it compares with where they are installed, `NEEDS`
packages without which it cannot run. So adding a benchmark is adding a file.
"""

from __future__ import annotations

import pkgutil
from collections.abc import Callable, Iterator
from dataclasses import dataclass
from importlib import import_module

from .machine import absent
from .measure import Effort, Row


@dataclass(frozen=True)
class Benchmark:
    """One benchmark, as its module declares it."""

    name: str
    what: str  # the first line of its docstring
    minutes: float  # of a full run
    rows: Callable[[Effort], Iterator[Row]]
    peers: tuple[str, ...] = ()
    needs: tuple[str, ...] = ()

    @property
    def without(self) -> list[str]:
        """Packages of peers that are not installed."""
        return absent(self.peers)

    @property
    def lacks(self) -> list[str]:
        """Packages that have to be installed first."""
        return absent(self.needs)


def benchmarks() -> dict[str, Benchmark]:
    """All benchmarks by name, in alphabetical order."""
    found = {}
    for info in pkgutil.iter_modules(__path__):
        module = import_module(f"{__name__}.{info.name}")
        if not hasattr(module, "MINUTES"):
            continue  # a helper
        what = (module.__doc__ or "").split("\n")[0].rstrip(".")
        peers, needs = getattr(module, "PEERS", ()), getattr(module, "NEEDS", ())
        found[info.name] = Benchmark(info.name, what, module.MINUTES, module.rows, peers, needs)
    return found
