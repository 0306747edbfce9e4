"""Balls shot at walls: whether anything passes, and whether what comes back is right.

`python -m benchmarks.passing` prints the cells that are not right, and counts. The closed form: a
ball whose surface is 30 cm from the wall turns there, and leaves at e times its speed. Soft and
penalty contacts last for up to π times their depth over the speed, and that is a tenth of the
thinner shape. A cell is right where speed and place fit that; told where the run says in a notice,
its status or an error that it does not; else it is wrong.
"""

from __future__ import annotations

from collections import Counter
from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np

import pgraph_core as pg

AWAY, E = 0.3, 0.5
SPEEDS = (1.0, 10.0, 50.0, 200.0, 1000.0)
SIZES = ((1e-3, 1e-3), (0.01, 0.005), (0.1, 1e-3), (1.0, 0.05))  # radius, wall [m]
LAWS = ("complementarity", "soft", "penalty")
METHODS = ("auto", "moreau_jean", "rk4", "dop853")
CLOSE = 0.01  # of speed and flight: what counts as right
DEEP = 0.1  # of the thinner shape's half: how deep soft contacts go


@dataclass(frozen=True)
class Cell:
    """One shot."""

    law: str
    method: str
    speed: float
    radius: float
    wall: float

    def run(self) -> tuple[str, float, float]:
        """(right, told or wrong; speed after it over speed before; place over the closed form)."""
        mech, q, v = shot(self.speed, self.radius, self.wall, law=self.law, restitution=E)
        t_end = 1.5 * AWAY / self.speed
        try:
            run = pg.simulate(mech, q, v, t_end=t_end, method=self.method, estimate=False)
        except pg.InputError:
            return "told", np.nan, np.nan
        back = float(run.v[-1, 3]) / self.speed
        off = (float(run.q[-1, 0]) - (AWAY - E * 0.5 * AWAY)) / AWAY
        lasts = (
            0.0 if self.law == "complementarity" else np.pi * DEEP * min(self.radius, self.wall / 2)
        )
        if abs(back + E) <= CLOSE and abs(off) <= CLOSE + E * lasts / AWAY:
            return "right", back, off
        said = [n for n in run.notices if "hit" in n]
        return "told" if said or not run.status.ok else "wrong", back, off


def shot(speed: float, radius: float, wall: float, **law: object) -> tuple[pg.Mechanism, ...]:
    """(mechanism, q, v) of a ball that flies along x at a plate."""
    ball = pg.Body(
        name="ball", joint="free", shape={"kind": "sphere", "radius": radius},
        inertia=0.4 * radius**2 * np.eye(3),
    )  # fmt: skip
    plate = pg.Body(
        name="plate", joint="weld", link=(AWAY + radius + 0.5 * wall, 0, 0),
        shape={"kind": "box", "size": (wall, 4.0, 4.0)},
    )  # fmt: skip
    contact = pg.Contact(name="hit", body="ball", other="plate", **law)  # type: ignore[arg-type]
    mech = pg.Mechanism(pg.Model(bodies=(ball, plate), gravity=(0, 0, 0), contacts=(contact,)))
    q, v = mech.home()
    v[3] = speed
    return mech, q, v  # type: ignore[return-value]


def cells() -> Iterator[Cell]:
    """All of them."""
    for law in LAWS:
        for method in METHODS:
            for speed in SPEEDS:
                for radius, wall in SIZES:
                    yield Cell(law, method, speed, radius, wall)


def main() -> None:
    """Print every cell that is not right, and how many are what."""
    counts: Counter[str] = Counter()
    for cell in cells():
        verdict, back, off = cell.run()
        counts[verdict] += 1
        if verdict != "right":
            print(f"{cell}: {verdict}, speed {back:+.4f}, place {off:+.2e}")
    print(dict(counts), f"of {counts.total()}")


if __name__ == "__main__":
    main()
