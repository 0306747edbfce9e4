"""The disturbances that gaits survive: pushes, friction, slopes, steps, wrong masses."""

from __future__ import annotations

import multiprocessing
from typing import Any

import numpy as np

import pgraph_core as pg

from .gait_checks import STEP, mechanism

SECONDS, PUSH_AT, PUSH_FOR = 8.0, 3.0, 0.1  # s
GAITS = (
    ("quadruped_hips", "trot"),
    ("quadruped_hips", "crawl"),
    ("quadruped_hips", "gallop"),
    ("quadruped", "bound"),
)
# what is tried, from mild to hard; the last one of an unbroken row that it survives is reported
TRIED: dict[str, tuple[float, ...]] = {
    "push to the side [N s]": (2, 4, 6, 8, 10, 12, 15, 18, 22, 26, 30),
    "push forward [N s]": (5, 10, 15, 20, 25, 30, 40),
    "push back [N s]": (5, 10, 15, 20, 25, 30, 40),
    "friction down to": (1.0, 0.9, 0.8, 0.7, 0.6, 0.5, 0.4, 0.3, 0.2),
    "slope up [deg]": (2, 4, 6, 8, 10),
    "slope down [deg]": (2, 4, 6, 8, 10),
    "step up [cm]": (1, 2, 3, 4, 5),
    "step down [cm]": (1, 2, 3, 4, 5),
    "masses more by [%]": (5, 10, 15, 20),
    "masses less by [%]": (5, 10, 15, 20),
}


def survives(case: tuple[str, str, str, float]) -> bool:
    """Whether a walk is on its feet after SECONDS."""
    name, gait, what, size = case
    mech, walk = _scene(name, gait, what, size)
    options: dict[str, Any] = {"scenario": gait, "tau": walk, "estimate": False, "frames": 100}
    if what.startswith("push"):
        options["forces"] = (_push(what, size),)
    try:
        run = pg.simulate(mech, t_end=SECONDS, step=STEP, **options)
    except pg.PgraphError:
        return False
    return run.status.ok and not any("fell" in text for text in run.notices)


def _scene(name: str, gait: str, what: str, size: float) -> tuple[pg.Mechanism, pg.Controller]:
    """The mechanism of a case; the controller is that of the plain model, on its ground."""
    model = mechanism(name).model
    given = model.scenario(gait).gait
    assert given is not None
    if what.startswith("friction"):
        model = pg.underfoot(model, friction=size)
    elif what.startswith("slope"):
        model = pg.underfoot(model, slope=float(np.radians(size)) * (1 if "up" in what else -1))
    elif what.startswith("step"):
        height = size / 100 * (1 if "up" in what else -1)
        model = pg.underfoot(model, steps=[pg.Step(low=(1.2, -9), high=(99, 9), height=height)])
    else:
        factor = 1 + size / 100 * (1 if "more" in what else -1) * what.startswith("masses")
        heavy = tuple(
            b.model_copy(
                update={
                    "mass": b.mass * factor,
                    "inertia": tuple(tuple(x * factor for x in row) for row in b.inertia),
                }
            )
            for b in model.bodies
        )
        return pg.Mechanism(model.replace(bodies=heavy)), pg.Controller(mechanism(name), given)
    mech = pg.Mechanism(model)
    return mech, pg.Controller(mech, given)


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
    cases = [(*gait, what, float(x)) for gait in GAITS for what in TRIED for x in TRIED[what]]
    survives(cases[0])  # compiles before it forks
    with multiprocessing.get_context("fork").Pool() as pool:
        alive = dict(zip(cases, pool.map(survives, cases, chunksize=4)))
    rows = ["| | " + " | ".join(gait for _, gait in GAITS) + " |", "|---|" + "---|" * len(GAITS)]
    for what, sizes in TRIED.items():
        found = [_last(alive, name, gait, what, sizes) for name, gait in GAITS]
        rows.append(f"| {what}, to {sizes[-1]:g} | {' | '.join(found)} |")
    return rows


def _last(
    alive: dict[tuple[str, str, str, float], bool], name: str, gait: str, what: str,
    sizes: tuple[float, ...],
) -> str:  # fmt: skip
    best = "none"
    for size in sizes:
        if not alive[name, gait, what, float(size)]:
            return best
        best = f"{size:g}"
    return best
