"""Error, error estimate and time of all methods: smooth, stiff, on loops, over many periods."""

from __future__ import annotations

from collections.abc import Iterator
from functools import partial
from typing import Any, NamedTuple

import numpy as np

import pgraph_core as pg
from pgraph_core.dynamics.states import differences

from .measure import Effort, Row, compared, spent
from .scenes import built_in

MINUTES = 20.0
POINT = np.zeros((3, 3))  # inertia of a point mass
DOWN: dict[str, Any] = {"gravity": (0.0, -9.81, 0.0), "up": "y"}
STIFF = "spring of 1e8 N/m"
ON_LOOPS = ("rk4", "radau5")
LOOPS = {"andrews": (0.03, (600, 2400)), "four_bar": (1.0, (200, 800)),
         "slider_crank": (0.5, (200, 800))}  # fmt: skip
PERIODIC = (("gauss6", 10), ("rk4", 48), ("semi_implicit_euler", 48))  # steps per period


class Motion(NamedTuple):
    """A model, how it starts, and how long it moves [s]."""

    model: pg.Model
    q: tuple[float, ...]
    v: tuple[float, ...]
    t_end: float


def rows(effort: Effort) -> Iterator[Row]:
    for name, motion in list(motions().items())[: effort.pick(None, 1)]:
        yield from accuracy(effort, name, motion)
    if not effort.quick:
        for name, (t_end, counts) in LOOPS.items():
            for count in counts:
                yield from on_loops(effort, name, t_end, count)
    yield from long_runs(effort)


def chain(n: int) -> tuple[pg.Body, ...]:
    """n point masses on a hanging chain of 1 m and 1 kg."""
    part = 1.0 / n
    same: dict[str, Any] = {"mass": part, "com": (0.0, -part, 0.0), "inertia": POINT}
    links = [(0.0, -part if i else 0.0, 0.0) for i in range(n)]
    parents = ["ground", *map(str, range(1, n))]
    return tuple(
        pg.Body(name=str(i), parent=parent, link=link, **same)
        for i, (parent, link) in enumerate(zip(parents, links), 1)
    )


def motions() -> dict[str, Motion]:
    """The motions that are measured; `work_precision` takes them too."""
    inertia = np.diag([0.234375, 0.46875, 0.234375])
    top = pg.Body(name="top", joint="spherical", mass=15.0, com=(0.0, 1.0, 0.0), inertia=inertia)
    bob = pg.Body(
        name="bob", joint="compound", motions=(("rotate", (0, 0, 1)), ("translate", (0, -1, 0))),
        com=(0.0, -1.0, 0.0), inertia=POINT, stiffness=(0.0, 1e8),
    )  # fmt: skip
    spin = (0.0, 150.0, -4.61538)
    bent = (np.pi / 4, *(99 * (0.0,)))
    sunk = (1.0, 9.81 * np.cos(1.0) / 1e8)
    return {
        "double pendulum": Motion(pg.Model(bodies=chain(2), **DOWN), (1.5, 0.5), (0, 0), 3.0),
        "top at 150 rad/s": Motion(pg.Model(bodies=(top,)), (1, 0, 0, 0), spin, 1.0),
        "chain of 100": Motion(pg.Model(bodies=chain(100), **DOWN), bent, 100 * (0.0,), 0.5),
        STIFF: Motion(pg.Model(bodies=(bob,), **DOWN), sunk, (0, 0), 1.0),
    }


def settings(name: str) -> list[dict[str, Any]]:
    """Methods with the steps and tolerances that are shown."""
    found: list[dict[str, Any]] = [{"method": "rk4", "step": 1e-3}]
    found += [{"method": "dopri5", "rtol": x} for x in (1e-5, 1e-8)]
    found += [{"method": "dop853", "rtol": x} for x in (1e-5, 1e-8, 1e-11)]
    stiff = [{"method": "radau5", "rtol": x} for x in (1e-5, 1e-8)]
    if name == STIFF:
        return [{"method": "rk4", "step": 2e-4}, {"method": "dop853", "rtol": 1e-8}, *stiff]
    return found if name == "chain of 100" else found + stiff


def accuracy(effort: Effort, name: str, motion: Motion) -> Iterator[Row]:
    """Errors against a run of another tolerance, their estimates, and the steps' time."""
    mech = pg.Mechanism(motion.model)
    t = np.linspace(0.0, effort.pick(motion.t_end, 0.1), effort.pick(41, 5))
    start = (np.array(motion.q, dtype=float), np.array(motion.v, dtype=float))
    given: dict[str, Any] = {"t_end": t[-1], "t_eval": t}
    known = pg.simulate(mech, *start, **given, method="dop853", rtol=1e-13).q
    for setting in settings(name)[: effort.pick(None, 2)]:
        runs = [pg.simulate(mech, *start, **given, **setting) for _ in range(effort.pick(9, 1))]
        run = runs[0]
        off = differences(run.mechanism.packed, run.q, known[: len(run.q)])
        chosen = f"rtol {setting['rtol']:g}" if "rtol" in setting else f"step {setting['step']:g} s"
        yield {
            "case": name, "method": setting["method"], "setting": chosen,
            "status": run.status.name, "error": max(float(x.max()) for x in off),
            "estimate": float(run.error_estimate), "energy drift": float(run.energy_drift),
            "evaluations": run.counters["evaluations"],
            "seconds": min(r.timing["step_processor"] for r in runs),
        }  # fmt: skip


def on_loops(effort: Effort, name: str, t_end: float, count: int) -> Iterator[Row]:
    """Given steps on closed loops."""
    model = built_in(name)
    mech, scenario = pg.Mechanism(model), next((s.name for s in model.scenarios), None)
    given: dict[str, Any] = {"t_end": t_end, "scenario": scenario, "frames": 2, "estimate": False}
    known = pg.simulate(mech, method="dop853", rtol=1e-12, **given).q[-1]
    given["step"] = t_end / count
    sides = {m: partial(pg.simulate, mech, method=m, **given) for m in ON_LOOPS}
    times = {row["by"]: row["seconds"] for row in compared(effort, name, sides, rounds=7)}
    for method, call in sides.items():
        run = call()
        error = float(np.abs(run.q[-1] - known).max())
        yield {"case": name, "steps": count, "method": method, "error": error,
               "evaluations": run.counters["evaluations"], "seconds": times[method]}  # fmt: skip


def long_runs(effort: Effort) -> Iterator[Row]:
    """Largest error of the energy, relative to its range, early and late in very long runs."""
    rod = pg.Body(name="rod", mass=1.0, com=(0, -0.5, 0), inertia=np.diag([1 / 12, 0, 1 / 12]),
                  q=np.pi / 3)  # fmt: skip
    point: dict[str, Any] = {"mass": 1.0, "com": (0, -1, 0), "inertia": POINT, "tip": (0, -1, 0)}
    upper = pg.Body(name="upper", q=0.5, **point)
    lower = pg.Body(name="lower", parent="upper", link=(0, -1, 0), q=0.2, **point)
    cases = {"pendulum": ((rod,), 1.76, 1e6), "double pendulum": ((upper, lower), 2.6, 1e5)}
    for name, (bodies, period, count) in cases.items():
        mech, count = pg.Mechanism(pg.Model(bodies=bodies, **DOWN)), effort.pick(count, 4)
        few = pg.simulate(mech, t_end=3 * period, frames=301, estimate=False)
        for method, steps in PERIODIC:
            given: dict[str, Any] = {"t_end": count * period, "step": period / steps}
            given |= {"method": method, "frames": effort.pick(2001, 101), "estimate": False}
            pg.simulate(mech, **given | {"t_end": period})  # compiles
            seconds, run = spent(partial(pg.simulate, mech, **given))
            off = np.abs(run.energy - run.energy[0]) / np.ptp(few.potential_energy)
            part = max(2, len(off) // 100)
            yield {
                "case": f"{name}, {count:g} periods", "method": method, "steps per period": steps,
                "energy, first 1 %": float(off[:part].max()),
                "energy, last 1 %": float(off[-part:].max()), "seconds": seconds,
            }  # fmt: skip
