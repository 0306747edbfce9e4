"""What gaits survive: pushes, friction, slopes, kerbs, rough ground, wrong masses, other orders.

`python -m benchmarks.gait_robustness [--seconds 60]` prints the table of docs/gaits.md.
"""

from __future__ import annotations

import argparse
import multiprocessing
from typing import Any

import numpy as np

import pgraph_core as pg

from .gait_checks import STEP, mechanism

SECONDS, PUSH_AT, PUSH_FOR = 60.0, 3.0, 0.1  # s
GAITS = (
    ("quadruped_hips", "trot"),
    ("quadruped_hips", "crawl"),
    ("quadruped_hips", "gallop"),
    ("quadruped", "bound"),
)
# what is tried, from mild to hard; the last one of an unbroken row that it survives is reported
TRIED: dict[str, tuple[float, ...]] = {
    "push to the side [N s]": (5, 10, 15, 20, 25, 30),
    "push forward [N s]": (10, 20, 30, 40),
    "push back [N s]": (10, 20, 30, 40),
    "friction up to": (0.8, 0.9, 1.0),
    "friction down to": (0.6, 0.5, 0.4, 0.3, 0.2),
    "slope up [deg]": (2, 4, 6, 8, 10),
    "slope down [deg]": (2, 4, 6, 8, 10),
    "kerbs, not told [cm]": (1, 2, 3, 4, 5, 6, 8),
    "kerbs, known [cm]": (1, 2, 3, 4, 5, 6, 8, 10, 12),
    "rough ground, not told [cm]": (0.5, 1, 1.5, 2, 3),
    "rough ground, known [cm]": (0.5, 1, 1.5, 2, 3),
    "to the side [m/s]": (0.1, 0.2, 0.3),
    "turning [rad/s]": (0.2, 0.4, 0.6, 0.8, 1.0),
    "masses more by [%]": (5, 10, 15, 20),
    "masses less by [%]": (5, 10, 15, 20),
}
SEEDS = 3  # fields of rough ground that are tried
CELL, FIELD = 0.25, (40, 10)  # m: of rough ground; cells ahead and across
FROM, LONG, APART, MANY = 1.2, 0.8, 1.6, 60  # platforms between two kerbs [m]


def survives(case: tuple[str, str, str, float]) -> bool:
    """Whether a walk never falls in SECONDS, and of what was asked for does four fifths."""
    name, gait, what, size = case
    return all(_survives(name, gait, what, size, seed) for seed in range(_seeds(what)))


def _seeds(what: str) -> int:
    return SEEDS if what.startswith("rough") else 1


def _survives(name: str, gait: str, what: str, size: float, seed: int) -> bool:
    try:
        mech, walk = _scene(name, gait, what, size, seed)
        options: dict[str, Any] = {"scenario": gait, "tau": walk, "estimate": False}
        if what.startswith("push"):
            options["forces"] = (_push(what, size),)
        run = pg.simulate(mech, t_end=SECONDS, step=STEP, frames=round(10 * SECONDS) + 1, **options)
    except pg.PgraphError:
        return False
    stands = run.status.ok and not any("fell" in text for text in run.notices)
    return stands and _obeys(run, what, size)


def _obeys(run: pg.Result, what: str, size: float) -> bool:
    """Whether it strafes and turns as fast as it is asked to, less a fifth."""
    late = run.t > 5.0
    seconds = float(run.t[-1] - run.t[late][0])
    heading = np.unwrap(2 * np.arctan2(run.q[late, 5], run.q[late, 3]))
    if what.startswith("turning"):
        return bool((heading[-1] - heading[0]) / seconds > 0.8 * size)
    if what.startswith("to the side"):
        way = np.diff(run.q[late][:, [0, 2]], axis=0)
        side = way[:, 0] * np.sin(heading[1:]) + way[:, 1] * np.cos(heading[1:])
        return bool(side.sum() / seconds > 0.8 * size)
    return True


def _scene(
    name: str, gait: str, what: str, size: float, seed: int
) -> tuple[pg.Mechanism, pg.Controller]:
    """The mechanism of a case; the controller is that of the plain model but for known ground."""
    plain = mechanism(name)
    model = plain.model
    given = model.scenario(gait).gait
    assert given is not None
    if what.startswith("friction"):
        model = pg.underfoot(model, friction=size)
    elif what.startswith("slope"):
        model = pg.underfoot(model, slope=float(np.radians(size)) * (1 if "up" in what else -1))
    elif what.startswith("kerbs"):
        model = pg.underfoot(model, steps=platforms(size / 100))
    elif what.startswith("rough"):
        model = pg.underfoot(model, steps=rough(size / 100, seed))
    elif what.startswith("to the side"):
        given = given.edit(drift=size)
    elif what.startswith("turning"):
        given = given.edit(turn=size)
    elif what.startswith("masses"):
        model = _heavier(model, 1 + size / 100 * (1 if "more" in what else -1))
    mech = pg.Mechanism(model)
    return mech, pg.Controller(mech if "known" in what else plain, given)


def platforms(height: float) -> list[pg.Step]:
    """One after the other, a kerb up and a kerb down each."""
    starts = [FROM + k * APART for k in range(MANY)]
    return [pg.Step(low=(x, -9), high=(x + LONG, 9), height=height) for x in starts]


def rough(height: float, seed: int) -> list[pg.Step]:
    """Square cells whose heights are anything up to `height` above or below the plane [m]."""
    heights = np.random.default_rng(seed).uniform(-height, height, FIELD)
    left = -CELL * FIELD[1] / 2
    return [
        pg.Step(
            low=(FROM + CELL * i, left + CELL * j),
            high=(FROM + CELL * (i + 1), left + CELL * (j + 1)),
            height=float(h),
        )
        for (i, j), h in np.ndenumerate(heights)
    ]


def _heavier(model: pg.Model, factor: float) -> pg.Model:
    """All masses times a factor."""
    bodies = tuple(
        b.model_copy(
            update={
                "mass": b.mass * factor,
                "inertia": tuple(tuple(x * factor for x in row) for row in b.inertia),
            }
        )
        for b in model.bodies
    )
    return model.replace(bodies=bodies)


def _push(what: str, size: float) -> pg.Force:
    """A force for PUSH_FOR on the pelvis, whose impulse is `size`."""
    axis = {"side": (0, 0, 1), "ward": (1, 0, 0), "back": (-1, 0, 0)}[what.split(" [")[0][-4:]]
    force = tuple(float(x) * size / PUSH_FOR for x in axis)
    none = (0.0, 0.0, 0.0)
    table = pg.VectorTable(
        t=(PUSH_AT - STEP, PUSH_AT, PUSH_AT + PUSH_FOR, PUSH_AT + PUSH_FOR + STEP),
        value=(none, force, force, none),
    )
    return pg.Force(name="push", kind="wrench", body="pelvis", force=table, point=none)


def table() -> list[str]:
    """A row a disturbance, a column a gait: the last size of an unbroken row that is survived."""
    rowed = [(*gait, what) for gait in GAITS for what in TRIED]
    _survives(*GAITS[0], "friction up to", 1.0, 0)  # compiles before it forks
    with multiprocessing.get_context("fork").Pool() as pool:
        found = dict(zip(rowed, pool.map(_last, rowed, chunksize=1)))
    rows = ["| | " + " | ".join(gait for _, gait in GAITS) + " |", "|---|" + "---|" * len(GAITS)]
    for what, sizes in TRIED.items():
        cells = [found[*gait, what] for gait in GAITS]
        rows.append(f"| {what}, to {sizes[-1]:g} | {' | '.join(cells)} |")
    return rows


def _last(row: tuple[str, str, str]) -> str:
    """The last size of a row before the first that a gait does not survive."""
    best = "none"
    for size in TRIED[row[2]]:
        if not survives((*row, float(size))):
            return best
        best = f"{size:g}"
    return best


def main() -> None:
    global SECONDS
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--seconds", type=float, default=SECONDS)
    SECONDS = parser.parse_args().seconds
    print("\n".join(table()))


if __name__ == "__main__":
    main()
