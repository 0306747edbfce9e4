"""All comparisons of one run."""

from __future__ import annotations

from collections.abc import Iterator
from typing import Any

import numpy as np

import pgraph_core as pg

from . import building, dynamics, lean, limited, runs, touching
from .machine import absent, has, machine
from .scenes import binary_tree, scene
from .timing import Case, Timed, measure, spread

EXPONENT = 1.1


def measured(*, quick: bool) -> dict[str, Any]:
    """All results, as `--json` prints them."""
    rounds, shortest = (5, 0.002) if quick else (21, 0.01)
    timed = measure(list(cases(quick=quick)), rounds, shortest)
    notes = [] if quick else [limited.pinocchio_chain(1000)]
    return {
        "quick": quick,
        "machine": machine(),
        "absent": absent(),
        "rows": [row for t in timed for row in rows(t)],
        "scaling": next(scaling(t) for t in timed if t.case.name.endswith("chains")),
        "notes": notes,
        "not_measured": list(not_measured()),
    }


def not_measured() -> Iterator[str]:
    """Reasons for missing numbers."""
    if has("pin"):
        from . import pinocchio_native

        loaded = pinocchio_native.library(compiling=False)
        if isinstance(loaded, str):
            yield f"a native loop of Pinocchio: {loaded}"


def cases(*, quick: bool) -> Iterator[Case]:
    """Every comparison, made one after the other."""
    quadruped = dynamics.quadruped_tree()
    slow = quadruped._replace(state=quadruped.state._replace(v=0.2 * quadruped.state.v))
    chain = scene("chain of 1000", pg.Model.serial(1000), 0.2)
    tree = scene("tree of 1023", binary_tree(1023), 0.2, seed=4)
    yield dynamics.one_call(quadruped, "forward dynamics, quadruped", goals={"pin.aba": 2.0})
    name = "forward dynamics, quadruped, native loop"
    yield dynamics.native_loop(quadruped, name, compiling=not quick)
    yield dynamics.back_ends(quadruped)
    yield dynamics.derivatives(scene("chain of 10", pg.Model.serial(10)))
    for place in (quadruped, tree):
        yield lean.dynamics(place, 8000 // place.state.topology.nb)
    yield lean.steps(tree, 200)
    for method in runs.METHODS:
        yield runs.steps(slow, method, 2000)
    yield runs.whole_call(estimate=False)
    yield runs.whole_call(estimate=True)
    yield runs.whole_call(estimate=True, chaotic=True)
    yield runs.one_step()
    yield runs.walking()
    for threads in (1, 2):
        yield runs.batch(slow, threads, 256, 400)
    yield dynamics.stance_run()
    yield dynamics.stance_call()
    for place in (chain, tree):
        name = f"forward dynamics, {place.name}"
        yield dynamics.one_call(place, name, goals={}, pinocchio=False)
    yield runs.steps(tree, "semi_implicit_euler", 200, goal=False)
    if not quick:
        yield runs.long_steps(chain, 20)
    for apart in (0.98, 3.0):
        yield touching.balls(1000, apart)
    yield dynamics.chains(1000 if quick else 10000)
    yield building.from_columns(quadruped, goal=50.0, small=True)
    yield building.construction(quadruped, goal=8.0, small=True)
    yield building.from_text(quadruped)
    if not quick:
        yield building.from_columns(chain, goal=1000.0, small=False)
        yield building.construction(chain, goal=100.0, small=False)
    yield building.parent_changed()
    yield building.mass_changed()


def rows(timed: Timed) -> Iterator[dict[str, Any]]:
    """One row a side."""
    case = timed.case
    compared = not case.name.endswith("chains")
    base_is_ours = timed.ours.startswith("pgraph")
    for side in case.sides:
        ours = side == timed.ours or (base_is_ours and side.startswith("pgraph")) or not compared
        yield {
            "case": case.name,
            "side": side,
            "unit": case.unit,
            "seconds": timed.quartiles(side),
            "ratio": None if ours else timed.ratio(side),
            "goal": case.goals.get(side),
            "at_most": case.at_most.get(side),
            "agreement": case.agreement if side == timed.ours else "",
        }


def scaling(timed: Timed) -> dict[str, Any]:
    """Exponent of n in the time of forward dynamics, fitted within every round."""
    lengths = np.log([int(side.removeprefix("n = ")) for side in timed.case.sides])
    by_round = np.log(np.array(list(timed.seconds.values())))  # (lengths, rounds)
    slopes = [float(np.polyfit(lengths, seconds, 1)[0]) for seconds in by_round.T]
    return {"exponent": spread(slopes), "goal": EXPONENT}
