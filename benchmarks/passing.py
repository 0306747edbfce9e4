"""Shapes shot at walls: whether anything passes, and whether what comes back is right.

`python -m benchmarks.passing` prints the cells that are not right, and counts. The closed form: a
ball whose surface is 30 cm from the wall turns there, and leaves at e times its speed. Soft and
penalty contacts last for up to π times their depth over the speed, and that is a tenth of the
thinner shape. A cell is right where speed and place fit that; told where the run says in a notice,
its status or an error that it does not; else it is wrong.

Other shapes fly tilted, some turning, at walls that are fixed or free. They have no closed form: a
cell is right where the shape is on its side of the wall in every frame, momentum is kept by a free
wall, and energy grows by less than a hundredth.
"""

from __future__ import annotations

import tempfile
from collections import Counter
from collections.abc import Callable, Iterator
from dataclasses import dataclass
from itertools import product
from pathlib import Path

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


TILT = 0.3  # rad, of a shape to the wall
SHAPES: dict[str, Callable[[float], dict[str, object]]] = {
    "box": lambda a: {"kind": "box", "size": (a, a, a)},
    "plate": lambda a: {"kind": "box", "size": (0.05 * a, a, a)},
    "capsule": lambda a: {"kind": "capsule", "radius": 0.05 * a, "length": a},
    "cylinder": lambda a: {"kind": "cylinder", "radius": a / 6, "length": a},
    "ellipsoid": lambda a: {"kind": "ellipsoid", "radii": (a / 2, a / 6, a / 4)},
    "mesh": lambda a: {"kind": "mesh", "file": _wedge(a), "hull": "convex"},
}
LOST = 1e-6  # of momentum
ADDED = 0.01  # of the energy: what gyroscopic moments, of first order in the step, may add
PASSED = 0.5  # of the sum of both half thicknesses: a centre nearer to the wall's is through


def _wedge(a: float) -> str:
    """The file of a closed wedge of length a."""
    low = [(x * a, y * a, -0.05 * a) for x in (-0.5, 0.5) for y in (-0.5, 0.5)]
    corners = [*low, (-0.5 * a, 0.0, 0.1 * a), (0.5 * a, 0.0, 0.1 * a)]
    faces = ((1, 2, 4), (1, 4, 3), (1, 5, 2), (3, 4, 6), (2, 5, 6), (2, 6, 4), (1, 3, 6), (1, 6, 5))
    lines = [f"v {x} {y} {z}" for x, y, z in corners] + [f"f {i} {j} {k}" for i, j, k in faces]
    path = Path(tempfile.gettempdir()) / f"wedge_{a:g}.obj"
    path.write_text("\n".join(lines) + "\n")
    return str(path)


@dataclass(frozen=True)
class Shot:
    """One shot of a shape that is no ball."""

    kind: str
    size: float
    speed: float
    wall: float
    free: bool
    spin: float
    frames: int
    law: str = "complementarity"
    method: str = "auto"
    step: float | None = None

    def model(self) -> pg.Model:
        """The shape flies along x; the wall's face is at x = 0."""
        away = self.size + 0.003 + 1.3e-3 * self.speed
        turn = (0.0, np.sin(TILT / 2), 0.0)
        shape = pg.Body(
            name="shape", joint="free", q=(-away, 0, 0, np.cos(TILT / 2), *turn),
            v=(0, self.spin, 0.5 * self.spin, self.speed, 0, 0), mass=0.1,
            shape=SHAPES[self.kind](self.size), derived=("inertia",),
        )  # fmt: skip
        joint: dict[str, object] = {"joint": "weld", "link": (self.wall / 2, 0, 0)}
        if self.free:
            joint = {"joint": "free", "q": (self.wall / 2, 0, 0, 1, 0, 0, 0), "mass": 0.3}
        wall = pg.Body(
            name="wall", shape={"kind": "box", "size": (self.wall, 4.0, 4.0)},
            derived=("inertia",), **joint,  # type: ignore[arg-type]
        )  # fmt: skip
        hit = pg.Contact(name="hit", body="shape", other="wall", law=self.law, friction=0.3)  # type: ignore[arg-type]
        return pg.Model(bodies=(shape, wall), gravity=(0, 0, 0), contacts=(hit,))

    def run(self) -> tuple[str, str]:
        """(right, told or wrong; what was not right)."""
        model = self.model()
        away = self.size + 0.003 + 1.3e-3 * self.speed
        try:
            run = pg.simulate(
                model, t_end=2 * away / self.speed, method=self.method, step=self.step,
                frames=self.frames, estimate=False,
            )  # fmt: skip
        except pg.InputError as error:
            return "told", str(error)
        x = run["shape"][:, 0]
        y = run["wall"][:, 0] if self.free else np.full(len(x), self.wall / 2)
        through = bool((y - x < PASSED * self.wall / 2).any())
        momentum = 0.1 * run.v[-1, 3] + (0.3 * run.v[-1, 9] if self.free else 0.0)
        lost = self.free and abs(momentum - 0.1 * self.speed) > LOST * 0.1 * self.speed
        energy = run.kinetic_energy
        gained = bool(energy.max() > (1 + ADDED) * energy[0])
        checks = {"through": through, "momentum": lost, "energy": gained}
        wrong = [name for name, so in checks.items() if so]
        if not wrong:
            return "right", ""
        said = [n for n in run.notices if "hit" in n]
        return "told" if said or not run.status.ok else "wrong", f"{wrong} {said}"


def shots() -> Iterator[Shot]:
    """All of them."""
    walls = ((1e-3, False), (0.1, False), (1e-3, True), (0.02, True))
    for kind, speed, (wall, free), spin, frames in product(
        SHAPES, (1.0, 30.0, 1000.0), walls, (0.0, 3.0), (3, 300)
    ):
        yield Shot(kind, 0.02 if spin == 0.0 else 0.5, speed, wall, free, spin, frames)
    for kind, speed, step in product(SHAPES, (10.0, 300.0), (1e-4, 1e-2)):
        yield Shot(kind, 0.1, speed, 1e-3, False, 1.0, 30, step=step)
    for kind, speed, law, method in product(
        SHAPES, (3.0, 300.0), ("soft", "penalty"), ("auto", "rk4")
    ):
        yield Shot(kind, 0.1, speed, 0.005, False, 1.0, 30, law=law, method=method)


def main() -> None:
    """Print every cell that is not right, and how many are what."""
    counts: Counter[str] = Counter()
    for one in shots():
        verdict, why = one.run()
        counts[verdict] += 1
        if verdict != "right":
            print(f"{one}: {verdict}, {why}", flush=True)
    print(dict(counts), f"of {counts.total()} shots of shapes", flush=True)
    counts.clear()
    for cell in cells():
        verdict, back, off = cell.run()
        counts[verdict] += 1
        if verdict != "right":
            print(f"{cell}: {verdict}, speed {back:+.4f}, place {off:+.2e}")
    print(dict(counts), f"of {counts.total()} shots of balls")


if __name__ == "__main__":
    main()
