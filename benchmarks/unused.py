"""The cost of parts without effect: limits out of reach, contacts far away, zero forces.

The same run without and with the part. Its motion must have the same bits.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator
from functools import partial
from typing import Any

import numpy as np

import pgraph_core as pg

from .measure import Effort, Row, compared

MINUTES = 3.0
LINKS = 6
FAR = 100.0  # m above the ground
METHODS: dict[str, dict[str, Any]] = {
    "semi_implicit_euler": {"step": 1e-3}, "rk4": {"step": 1e-3}, "gauss6": {"step": 1e-3},
    "dopri5": {}, "dop853": {}, "radau5": {},
}  # fmt: skip
FEW = ("a limit out of reach", "a rigid contact far away")  # tried with every method
SPANS = (0.02, 2.0, 20.0)  # s, of whole calls


def rows(effort: Effort) -> Iterator[Row]:
    lean, laden = parts()
    seconds = effort.pick(0.4, 0.01)
    for part in effort.pick(list(laden), list(laden)[:2]):
        yield from cost(effort, part, lean, laden[part], "rk4", seconds)
    if effort.quick:
        return
    for part in FEW:
        for method in METHODS:
            yield from cost(effort, part, lean, laden[part], method, seconds)
    for part in laden:
        for span in SPANS:
            yield from cost(effort, part, lean, laden[part], "dop853", span, whole=True)


Laden = tuple[pg.Model, dict[str, Any]]  # a model, and options of its run


def parts() -> tuple[pg.Model, dict[str, Laden]]:
    """(six rods far above the ground with a welded one at their end, the same with each part)."""
    lean = pg.Model.serial(LINKS + 1).edit("1", link=(0.0, 0.0, FAR), v=(1.0,))
    lean = lean.edit(str(LINKS + 1), joint="weld")
    last = str(LINKS)

    def force(kind: str, **fields: Any) -> Laden:
        given: Any = {"name": "f", "kind": kind, "body": last, **fields}
        return lean.replace(forces=(pg.Force(**given),)), {}

    def touching(law: Any, *, active: bool = True) -> Laden:
        given: Any = {"name": "c", "body": last, "law": law, "points": ((0.0, 0.0, 0.0),)}
        return lean.replace(contacts=(pg.Contact(**given, active=active),)), {}

    tied = lean.replace(constraints=(pg.Constraint(name="c", body=last, active=False),))
    when = {"coordinate": last, "above": 1e6}
    waits = {"switches": (pg.Switch(constraint="c", active=True, when=when),)}
    return lean, {
        "a limit out of reach": (lean.edit(last, limits=(-1e6, 1e6)), {}),
        "an inactive constraint": (tied, {}),
        "a condition that never holds": (tied, waits),
        "a scenario": (lean.replace(scenarios=(pg.Scenario(name="s"),)), {"scenario": "s"}),
        "an inactive contact": touching("complementarity", active=False),
        "a spring without stiffness": force("spring", rest=1.0),
        "a motor without torque": force("motor"),
        "a servo without gain": force("servo"),
        "a wrench of zero": force("wrench"),
        "a soft contact far away": touching("soft"),
        "a rigid contact far away": touching("complementarity"),
    }


def cost(
    effort: Effort, part: str, lean: pg.Model, laden: Laden, method: str, seconds: float,
    *, whole: bool = False,
) -> Iterator[Row]:  # fmt: skip
    """Processor time of the steps, or of whole calls, without the part and with it."""
    model, options = laden
    given = {"t_end": seconds, "frames": 11, "method": method, "estimate": False}
    given |= METHODS[method]
    runs = {
        "without": partial(pg.simulate, pg.Mechanism(lean), **given),
        "pgraph, with it": partial(pg.simulate, pg.Mechanism(model), **given, **options),
    }

    def steps(run: Callable[[], pg.Result]) -> float:
        return run().timing["step_processor"]

    one, other = (run() for run in runs.values())
    apart = float(np.abs(one.q - other.q).max() / np.abs(one.q).max())
    sides: dict[str, Callable[[], object]] = {
        side: run if whole else partial(steps, run) for side, run in runs.items()
    }
    words = f"{part}, {method}, {'a whole call of' if whole else 'the steps of'} {seconds:g} s"
    clocked = frozenset() if whole else frozenset(sides)
    return compared(effort, words, sides, agrees=f"motion {apart:.0e}", clocked=clocked)
