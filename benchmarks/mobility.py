"""How long a mobility report takes: rings of links, and windows of loops that share their cranks.

    python -m benchmarks.mobility [--rounds 5]

Prints the median and quartiles of reports on new descriptions of the same mechanism, packing
included, with the rank and the number of redundant rows.
"""

from __future__ import annotations

import argparse
import math
import time
from collections.abc import Callable

import pgraph_core as pg

from .machine import machine
from .timing import spread


def rings(bodies: int, loops: int) -> pg.Model:
    """Regular polygons of revolute links about z, each pinned to the ground where it began."""
    each = bodies // loops
    turn = 2 * math.pi / each
    table: list[pg.Body] = []
    pins: list[pg.Constraint] = []
    for k in range(loops):
        for i in range(each):
            parent, link = (f"{k}.{i - 1}", (1.0, 0.0, 0.0)) if i else ("ground", (0.0, 0.0, k))
            table.append(pg.Body(name=f"{k}.{i}", parent=parent, link=link, q=(turn,)))
        last = {"body": f"{k}.{each - 1}", "point": (1.0, 0.0, 0.0), "other_point": (0.0, 0.0, k)}
        pins.append(pg.Constraint(name=f"pin {k}", **last))
    return pg.Model(bodies=tuple(table), constraints=tuple(pins))


def windows(count: int) -> pg.Model:
    """A row of parallelograms of rods of 1 m, each sharing a crank with the next."""
    table = [pg.Body(name="crank 0", q=(0.3,))]
    loops: list[pg.Constraint] = []
    for i in range(count):
        table.append(pg.Body(name=f"coupler {i}", parent=f"crank {i}", link=(0, 1, 0), q=(-0.3,)))
        table.append(pg.Body(name=f"crank {i + 1}", link=(i + 1, 0, 0), q=(0.3,)))
        ends = {"body": f"coupler {i}", "point": (1, 0, 0), "other": f"crank {i + 1}"}
        loops.append(pg.Constraint(name=f"loop {i}", other_point=(0, 1, 0), **ends))
    return pg.Model(bodies=tuple(table), constraints=tuple(loops))


CASES: dict[str, Callable[[], pg.Model]] = {
    "ring of 50": lambda: rings(50, 1),
    "ring of 100": lambda: rings(100, 1),
    "5 rings of 200": lambda: rings(1000, 5),
    "50 windows": lambda: windows(50),
    "500 windows": lambda: windows(500),
}


def main() -> None:
    """Time every case."""
    options = argparse.ArgumentParser(description=__doc__)
    options.add_argument("--rounds", type=int, default=5, help="reports a case")
    rounds = options.parse_args().rounds
    print(machine()["cpu"])
    for name, make in CASES.items():
        model, seconds = make(), []
        for _ in range(rounds):
            begun = time.perf_counter()
            report = pg.Mechanism(model).mobility()
            seconds.append(time.perf_counter() - begun)
        low, median, high = (1e3 * s for s in spread(seconds))
        print(
            f"{name:15s} {report.tree:5d} DoF, {report.rows:4d} rows, rank {report.rank:4d}, "
            f"{len(report.redundant):3d} redundant: {median:7.1f} ms [{low:.1f}, {high:.1f}]"
        )


if __name__ == "__main__":
    main()
