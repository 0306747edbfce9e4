"""Choosing a method: error, its estimate and cost of all methods on a few motions.

`python -m benchmarks.methods` prints the tables of docs/methods.md.
"""

from __future__ import annotations

import json
import sys
import time
from collections.abc import Callable
from typing import Any, NamedTuple

import numpy as np

import pgraph_core as pg
from pgraph_core.dynamics.states import differences

POINT = ((0.0,) * 3,) * 3  # inertia of a point mass
TIMES = 41
ROUNDS = 9


class Motion(NamedTuple):
    """A model, how it starts, and how long it moves [s]."""

    model: pg.Model
    q: tuple[float, ...]
    v: tuple[float, ...]
    t_end: float


def chain(n: int) -> tuple[pg.Body, ...]:
    """n point masses on a hanging chain of 1 m."""
    length = 1.0 / n
    return tuple(
        pg.Body(
            name=str(i),
            parent="ground" if i == 1 else str(i - 1),
            link=(0.0, 0.0 if i == 1 else -length, 0.0),
            mass=length,
            com=(0.0, -length, 0.0),
            inertia=POINT,
        )
        for i in range(1, n + 1)
    )


def motions() -> dict[str, Motion]:
    """The motions that are measured."""
    down: dict[str, Any] = {"gravity": (0.0, -9.81, 0.0), "up": "y"}
    top = pg.Body(
        name="top",
        joint="spherical",
        mass=15.0,
        com=(0.0, 1.0, 0.0),
        inertia=((0.234375, 0, 0), (0, 0.46875, 0), (0, 0, 0.234375)),
    )
    bob = pg.Body(
        name="bob",
        joint="compound",
        motions=(("rotate", (0, 0, 1)), ("translate", (0, -1, 0))),
        com=(0.0, -1.0, 0.0),
        inertia=POINT,
        stiffness=(0.0, 1e8),
    )
    return {
        "double pendulum": Motion(pg.Model(bodies=chain(2), **down), (1.5, 0.5), (0, 0), 3.0),
        "top at 150 rad/s": Motion(
            pg.Model(bodies=(top,)), (1, 0, 0, 0), (0.0, 150.0, -4.61538), 1.0
        ),
        "chain of 100": Motion(
            pg.Model(bodies=chain(100), **down), (np.pi / 4, *(99 * (0.0,))), 100 * (0.0,), 0.5
        ),
        "spring of 1e8 N/m": Motion(
            pg.Model(bodies=(bob,), **down), (1.0, 9.81 * np.cos(1.0) / 1e8), (0, 0), 1.0
        ),
    }


def settings(name: str) -> list[dict[str, Any]]:
    """Methods with the steps and tolerances that are shown."""
    found: list[dict[str, Any]] = [{"method": "rk4", "step": 1e-3}]
    found += [{"method": "dopri5", "rtol": x} for x in (1e-5, 1e-8)]
    found += [{"method": "dop853", "rtol": x} for x in (1e-5, 1e-8, 1e-11)]
    stiff = [{"method": "radau5", "rtol": x} for x in (1e-5, 1e-8)]
    stiff += [{"method": "ros2", "step": 1e-3}]
    if name == "spring of 1e8 N/m":
        return [{"method": "rk4", "step": 2e-4}, {"method": "dop853", "rtol": 1e-8}, *stiff]
    return found if name == "chain of 100" else found + stiff


def seconds(run: Callable[[], pg.Result]) -> float:
    """Least processor time of the steps alone."""
    return min(run().timing["step_processor"] for _ in range(ROUNDS))


def error_of(run: pg.Result, known: np.ndarray) -> float:
    """Largest error of q, attitudes as angles [rad, m]."""
    return max(float(x.max()) for x in differences(run.mechanism.packed.rows, run.q, known))


def measured(name: str, motion: Motion) -> list[dict[str, Any]]:
    """One row a setting; errors are against a run of another tolerance."""
    mech = pg.Mechanism(motion.model)
    t = np.linspace(0.0, motion.t_end, TIMES)
    start = (np.array(motion.q, dtype=float), np.array(motion.v, dtype=float))
    given: dict[str, Any] = {"t_end": motion.t_end, "t_eval": t}
    reference = pg.simulate(mech, *start, **given, method="dop853", rtol=1e-13)
    rows: list[dict[str, Any]] = []
    for setting in settings(name):

        def run(setting: dict[str, Any] = setting) -> pg.Result:
            return pg.simulate(mech, *start, **given, **setting)

        done = run()
        n = len(done.q)
        rows.append(
            {
                "motion": name,
                **setting,
                "status": done.status.name,
                "error": error_of(done, reference.q[:n]),
                "estimate": float(done.error_estimate),
                "energy_drift": float(done.energy_drift),
                "evaluations": done.counters["evaluations"],
                "ms": 1e3 * seconds(run),
            }
        )
    return rows


def table(rows: list[dict[str, Any]]) -> str:
    """The rows of one motion as Markdown."""
    lines = [
        f"### {rows[0]['motion'][0].upper()}{rows[0]['motion'][1:]}",
        "",
        "| method | setting | error | estimate | energy drift | evaluations | time of steps |",
        "| --- | --- | --- | --- | --- | --- | --- |",
    ]
    for row in rows:
        given = f"rtol {row['rtol']:g}" if "rtol" in row else f"step {row['step']:g} s"
        numbers = (f"{row[k]:.1e}" for k in ("error", "estimate", "energy_drift"))
        if row["status"] != "DONE":
            numbers = (row["status"], "", "")
        cost = (str(row["evaluations"]), f"{row['ms']:.2f} ms")
        lines.append(f"| {' | '.join((row['method'], given, *numbers, *cost))} |")
    return "\n".join(lines)


def main() -> None:
    """Print the tables, or with `--json` the rows."""
    began = time.perf_counter()
    every = [measured(name, motion) for name, motion in motions().items()]
    if "--json" in sys.argv[1:]:
        print(json.dumps([row for rows in every for row in rows], indent=1))
        return
    print("\n\n".join(table(rows) for rows in every))
    print(f"measured in {time.perf_counter() - began:.1f} s", file=sys.stderr)


if __name__ == "__main__":
    main()
