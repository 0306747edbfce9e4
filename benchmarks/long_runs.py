"""The energy of conservative motion over very many periods, by a symplectic method and by others.

`python -m benchmarks.long_runs` prints the table of docs/methods.md; `--periods N` takes fewer.
"""

from __future__ import annotations

import time
from argparse import ArgumentParser

import numpy as np

import pgraph_core as pg

FRAMES = 2001


def pendulum() -> tuple[pg.Model, float]:
    """(a rod of 1 m that swings by 60 degrees, its period [s])."""
    rod = pg.Body(
        name="rod", mass=1.0, com=(0, -0.5, 0), inertia=np.diag([1 / 12, 0, 1 / 12]), q=np.pi / 3
    )
    return pg.Model(bodies=(rod,), gravity=(0, -9.81, 0), up="y"), 1.76


def double_pendulum() -> tuple[pg.Model, float]:
    """(two point masses that swing by 30 degrees: mass matrix and energies change, its period)."""
    mass = {"mass": 1.0, "com": (0, -1, 0), "inertia": np.zeros((3, 3)), "tip": (0, -1, 0)}
    bodies = (
        pg.Body(name="upper", q=0.5, **mass),
        pg.Body(name="lower", parent="upper", link=(0, -1, 0), q=0.2, **mass),
    )
    return pg.Model(bodies=bodies, gravity=(0, -9.81, 0), up="y"), 2.6


SETTINGS = (("gauss6", 10), ("rk4", 48), ("semi_implicit_euler", 48))  # steps a period
SCENES = {"pendulum": (pendulum, 1.0), "double pendulum": (double_pendulum, 0.1)}


def main() -> None:
    """Print the table."""
    parser = ArgumentParser(description=__doc__)
    parser.add_argument("--periods", type=float, default=1e6)
    periods = parser.parse_args().periods
    print("| motion | periods | method | steps a period | energy, first 1 % | last 1 % | time |")
    print("| --- | --- | --- | --- | --- | --- | --- |")
    for name, (make, share) in SCENES.items():
        model, period = make()
        mech = pg.Mechanism(model)
        few = pg.simulate(mech, t_end=3 * period, frames=301, estimate=False)
        for method, steps in SETTINGS:
            began = time.thread_time()
            count = round(periods * share)
            run = pg.simulate(
                mech, t_end=count * period, method=method, step=period / steps, frames=FRAMES,
                estimate=False,
            )  # fmt: skip
            off = np.abs(run.energy - run.energy[0]) / np.ptp(few.potential_energy)
            part = FRAMES // 100
            first, last = off[:part].max(), off[-part:].max()
            took = time.thread_time() - began
            print(
                f"| {name} | {count:.0e} | {method} | {steps} | {first:.1e} | {last:.1e} | "
                f"{took:.0f} s |", flush=True,
            )  # fmt: skip


if __name__ == "__main__":
    main()
