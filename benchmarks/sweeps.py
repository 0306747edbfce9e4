"""A sweep of the stance next to a loop of single runs: `python -m benchmarks.sweeps [points]`.

Both measure the same metric at the same values, in one process and in turns: processor time, minima
over rounds. Then all points by all cores, and, where Dask is installed, by four of its workers of
which one is killed on the way; the tables must be the same bit for bit.
"""

from __future__ import annotations

import os
import signal
import sys
import time
from importlib.util import find_spec
from typing import Any

import numpy as np

import pgraph_core as pg
import pgraph_models

from .machine import machine

PATH, SCENARIO = "bodies.pelvis.mass", "stance"
METRICS = ("final lumbar", "max lumbar")
ROUNDS, SINGLE, SHORT = 3, 20, 416  # runs of the loop, and points of the sweep, in a round


def values(n: int) -> np.ndarray:
    return np.linspace(7.0, 9.0, n)


def loop(model: pg.Model, masses: np.ndarray, metric: str, **options: Any) -> list[float]:
    """What a user writes without `sweep`."""
    take = max if metric.startswith("max") else lambda x: x[-1]
    runs = (pg.simulate(model.edit("pelvis", mass=float(x)), scenario=SCENARIO, **options)
            for x in masses)  # fmt: skip
    return [float(take(run["lumbar"])) for run in runs]


def alternated(model: pg.Model, metric: str) -> tuple[float, float, float]:
    """Processor time a point [s]: of the loop, of one without error estimates, of the sweep."""
    few, many = values(SINGLE), values(SHORT)
    found: list[list[float]] = [[], [], []]
    for _ in range(ROUNDS):
        for side, (count, call) in enumerate((
            (SINGLE, lambda: loop(model, few, metric)),
            (SINGLE, lambda: loop(model, few, metric, estimate=False)),
            (SHORT, lambda: pg.sweep(model, {PATH: many}, metric, SCENARIO, workers=1)),
        )):  # fmt: skip
            begin = time.process_time()
            call()
            found[side].append((time.process_time() - begin) / count)
    single, plain, swept = map(min, found)
    return single, plain, swept


def by_dask(model: pg.Model, masses: np.ndarray, metric: str) -> pg.Sweep:
    """By four workers, one of which is killed after a third of the points."""
    from distributed import Client, LocalCluster

    local: Any = LocalCluster(n_workers=4, threads_per_worker=1, dashboard_address=":0")
    with local as cluster:
        killed: list[int] = []

        def told(fraction: float) -> None:
            if fraction > 0.3 and not killed:
                killed.append(next(iter(cluster.workers.values())).pid)
                os.kill(killed[0], signal.SIGKILL)

        with Client(cluster) as client:
            table = pg.sweep(
                model, {PATH: masses}, metric, SCENARIO, scheduler=client, progress=told
            )
    assert killed
    return table


def main() -> None:
    """Rows of a table, then the whole sweep."""
    n = int(sys.argv[1]) if len(sys.argv) > 1 else 10_000
    model = pg.Model.load(pgraph_models.path("quadruped"))
    print(machine())
    print("| metric | loop [ms] | without estimate [ms] | sweep, one core [ms] | ratio a core |")
    print("|---|---|---|---|---|")
    for metric in METRICS:
        single, plain, swept = alternated(model, metric)
        cells = (f"{1e3 * x:.2f}" for x in (single, plain, swept))
        print(f"| {metric} | {' | '.join(cells)} | {single / swept:.1f} |", flush=True)
    masses = values(n)
    begin = time.perf_counter()
    table = pg.sweep(model, {PATH: masses}, METRICS[0], SCENARIO)
    spent = time.perf_counter() - begin
    few = np.linspace(0, n - 1, SINGLE).astype(int)
    begin = time.perf_counter()
    same = loop(model, masses[few], METRICS[0]) == table.values[METRICS[0]][few].tolist()
    each = (time.perf_counter() - begin) / SINGLE
    print(f"{n} points by all cores: {spent:.1f} s of the clock; the loop: {each * n:.0f} s")
    print(f"ratio {each * n / spent:.1f}; {SINGLE} single runs have the same bits: {same}")
    if find_spec("distributed"):
        begin = time.perf_counter()
        other = by_dask(model, masses, METRICS[0]).values[METRICS[0]]
        spent = time.perf_counter() - begin
        again = np.array_equal(other, table.values[METRICS[0]])
        print(f"by four Dask workers, one killed: {spent:.1f} s; the same table: {again}")


if __name__ == "__main__":
    main()
