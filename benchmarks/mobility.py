"""Mobility reports of large loops: rings of links, and windows that share their cranks."""

from __future__ import annotations

import math
from collections.abc import Iterator

import pgraph_core as pg

from .measure import Effort, Row, compared

MINUTES = 0.5


def rows(effort: Effort) -> Iterator[Row]:
    """Reports on a new mechanism each time, packing included."""
    full = {"ring of 50": (1, 50), "ring of 100": (1, 100), "5 rings of 200": (5, 200)}
    for name, (loops, links) in effort.pick(full, {"ring of 5": (1, 5)}).items():
        yield from report(effort, name, rings(loops, links))
    for count in effort.pick((50, 500), (2,)):
        yield from report(effort, f"{count} windows", windows(count))


def report(effort: Effort, name: str, model: pg.Model) -> Iterator[Row]:
    """The time of one, and what it finds."""
    known = pg.Mechanism(model).mobility()
    agrees = f"{known.tree} DoF, {known.rows} rows, rank {known.rank}, "
    agrees += f"{len(known.redundant)} redundant"
    sides = {"pgraph": lambda: pg.Mechanism(model).mobility()}
    return compared(effort, name, sides, unit="report", agrees=agrees, rounds=effort.pick(5, 2))


def rings(loops: int, links: int) -> pg.Model:
    """Regular polygons of revolute links about z, each pinned to the ground where it began."""
    turn = 2 * math.pi / links
    table: list[pg.Body] = []
    pins: list[pg.Constraint] = []
    for k in range(loops):
        for i in range(links):
            parent, link = (f"{k}.{i - 1}", (1.0, 0.0, 0.0)) if i else ("ground", (0.0, 0.0, k))
            table.append(pg.Body(name=f"{k}.{i}", parent=parent, link=link, q=(turn,)))
        last = {"body": f"{k}.{links - 1}", "point": (1.0, 0.0, 0.0), "other_point": (0, 0, k)}
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
