"""A sweep of the quadruped's stance against a loop of single runs, and by Dask's workers."""

from __future__ import annotations

import os
import signal
import time
from collections.abc import Iterator
from typing import Any

import numpy as np

import pgraph_core as pg

from .machine import has
from .measure import Effort, Row, compared
from .scenes import built_in

MINUTES = 4.0
PEERS = ("distributed",)
PATH, SCENARIO = "bodies.pelvis.mass", "stance"
METRICS = ("final lumbar", "max lumbar")


def rows(effort: Effort) -> Iterator[Row]:
    model = built_in("quadruped")
    single, many = effort.pick((20, 416), (1, 8))
    for metric in METRICS:
        yield from in_turn(effort, model, metric, single, many)
    if effort.quick:
        return
    masses = values(10_000)
    begin = time.perf_counter()
    table = pg.sweep(model, {PATH: masses}, METRICS[0], SCENARIO)
    seconds = time.perf_counter() - begin
    few = np.linspace(0, len(masses) - 1, single).astype(int)
    same = loop(model, masses[few], METRICS[0]) == table.values[METRICS[0]][few].tolist()
    yield {"case": "10 000 points", "by": "all cores", "by the clock [s]": seconds,
           "same bits": str(same)}  # fmt: skip
    if has("distributed"):
        begin = time.perf_counter()
        other = by_dask(model, masses, METRICS[0]).values[METRICS[0]]
        seconds = time.perf_counter() - begin
        same = np.array_equal(other, table.values[METRICS[0]])
        yield {"case": "10 000 points", "by": "four Dask workers, one killed",
               "by the clock [s]": seconds, "same bits": str(same)}  # fmt: skip


def values(n: int) -> np.ndarray:
    return np.linspace(7.0, 9.0, n)


def in_turn(effort: Effort, model: pg.Model, metric: str, single: int, many: int) -> Iterator[Row]:
    """Processor time per point of a sweep on one core, and of loops; each clocks itself."""
    few, points = values(single), values(many)

    def clocked(call: Any, count: int) -> Any:
        def seconds() -> float:
            begin = time.process_time()
            call()
            return (time.process_time() - begin) / count

        return seconds

    sides = {
        "pgraph, sweep": clocked(
            lambda: pg.sweep(model, {PATH: points}, metric, SCENARIO, workers=1), many
        ),
        "loop": clocked(lambda: loop(model, few, metric), single),
        "loop without estimates": clocked(lambda: loop(model, few, metric, estimate=False), single),
    }
    given = {"unit": "point", "clocked": set(sides), "rounds": effort.pick(3, 1)}
    return compared(effort, f"sweep of {metric}", sides, **given)


def loop(model: pg.Model, masses: np.ndarray, metric: str, **options: Any) -> list[float]:
    """What a user writes without `sweep`."""
    take = max if metric.startswith("max") else lambda x: x[-1]
    runs = (
        pg.simulate(model.edit("pelvis", mass=float(x)), scenario=SCENARIO, **options)
        for x in masses
    )
    return [float(take(run["lumbar"])) for run in runs]


def by_dask(model: pg.Model, masses: np.ndarray, metric: str) -> pg.Sweep:
    """By four workers, one of which is killed after a third of the points."""
    from distributed import Client, LocalCluster

    local: Any = LocalCluster(n_workers=4, threads_per_worker=1, dashboard_address=":0")
    with local as cluster:
        killed: list[int] = []

        def progress(fraction: float) -> None:
            if fraction > 0.3 and not killed:
                killed.append(next(iter(cluster.workers.values())).pid)
                os.kill(killed[0], signal.SIGKILL)

        with Client(cluster) as client:
            given: dict[str, Any] = {"scheduler": client, "progress": progress}
            return pg.sweep(model, {PATH: masses}, metric, SCENARIO, **given)
