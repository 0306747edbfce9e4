"""Error against run time of whole calls, ours and those of MuJoCo, Pinocchio, Exudyn, SUNDIALS.

`pgraph report MODEL -o FILE` draws the diagram of one motion.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator
from typing import Any

import numpy as np

import pgraph_core as pg

from .machine import has
from .measure import Effort, Row
from .methods import STIFF, motions
from .scenes import built_in

MINUTES = 25.0
PEERS = ("mujoco", "pin", "exudyn", "scikit-sundae")
NAMES = {"pin": "pinocchio", "scikit-sundae": "sundials"}  # of the engines; else alike
METHODS = ("rk4", "dopri5", "dop853")  # where the motion is not stiff
LONG, NEAR, FAR = 5e-3, 3.0, 5.0  # peers that take longer [s] should be beaten FAR times, else NEAR


def rows(effort: Effort) -> Iterator[Row]:
    """A row per motion, error and peer, then how many ratios reach 1, NEAR and FAR."""
    found: list[Row] = []
    for name, make in list(SCENES.items())[: effort.pick(None, 1)]:
        for row in make(effort).against_peers():
            found.append({
                "case": name, "by": row["peer"], "error": row["error"], "pgraph": row["ours"],
                "pgraph takes [us]": 1e6 * row["seconds"], "seconds": row["peer_seconds"],
                "ratio": row["ratio"],
            })  # fmt: skip
            yield found[-1]
    ratios = np.array([row["ratio"] for row in found])
    long = np.array([row["seconds"] > LONG for row in found], dtype=bool)
    yield {
        "comparisons": len(found), "at least as fast": int((ratios >= 1).sum()),
        f"at least {NEAR:g} times": int((ratios >= NEAR).sum()),
        f"{FAR:g} times, of those over {1e3 * LONG:g} ms":
            f"{(ratios[long] >= FAR).sum()} of {long.sum()}",
    }  # fmt: skip


def study(effort: Effort, *mech_and_state: Any, **options: Any) -> pg.Study:
    """Compared in processor time, so that the machine need not be quiet."""
    peers = [NAMES.get(peer, peer) for peer in PEERS if has(peer)]
    given = {"methods": METHODS, "peers": effort.pick(peers, ["scipy"]), "target": 1e-6}
    given |= {"rounds": effort.pick(5, 1), "longest": effort.pick(4.0, 0.05)}
    if effort.quick:
        options |= {"t_end": 0.1, "frames": 5, "methods": ("rk4",)}
    return pg.work_precision(*mech_and_state, **{**given, **options})


def motion(name: str, **options: Any) -> Callable[[Effort], pg.Study]:
    """One of `methods`."""
    found = motions()[name]
    q, v = (np.array(x, dtype=float) for x in (found.q, found.v))
    given = {"t_end": found.t_end, **options}
    return lambda effort: study(effort, pg.Mechanism(found.model), q, v, **given)


def named(name: str, **options: Any) -> Callable[[Effort], pg.Study]:
    """A built-in model."""
    return lambda effort: study(effort, pg.Mechanism(built_in(name)), **options)


SCENES: dict[str, Callable[[Effort], pg.Study]] = {
    "double pendulum": motion("double pendulum"),
    "heavy top": motion("top at 150 rad/s"),
    "quadruped stance": named("quadruped", scenario="stance", frames=126),  # its tables' knots
    "chain of 100": motion("chain of 100"),
    STIFF: motion(STIFF, methods=("radau5",)),
    "four-bar": named("four_bar", t_end=1.0, scenario="turn"),
    "tennis racket": named("tennis_racket", t_end=2.0),
    "tree of figure 1": named("fig1_tree", t_end=1.0),
}
