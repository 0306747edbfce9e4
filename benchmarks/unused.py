"""The cost of parts without effect: limits out of reach, contacts far away, zero forces.

The same run without and with the part. Its motion must be the same to rounding.
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
    for span in (0.02, 0.1, 2.0):
        yield from cost(effort, FEW[1], lean, laden[FEW[1]], "rk4", span, whole=True)


def parts() -> tuple[pg.Model, dict[str, pg.Model]]:
    """(six rods far above the ground with a welded one at their end, the same with each part)."""
    lean = pg.Model.serial(LINKS + 1).edit("1", link=(0.0, 0.0, FAR), v=(1.0,))
    lean = lean.edit(str(LINKS + 1), joint="weld")
    last = str(LINKS)

    def force(kind: str, **fields: Any) -> pg.Model:
        given: Any = {"name": "f", "kind": kind, "body": last, **fields}
        return lean.replace(forces=(pg.Force(**given),))

    def touching(law: Any) -> pg.Model:
        point = ((0.0, 0.0, 0.0),)
        return lean.replace(contacts=(pg.Contact(name="c", body=last, law=law, points=point),))

    still = pg.Constraint(name="c", body=last, active=False)
    return lean, {
        "a limit out of reach": lean.edit(last, limits=(-1e6, 1e6)),
        "an inactive constraint": lean.replace(constraints=(still,)),
        "a spring without stiffness": force("spring", rest=1.0),
        "a motor without torque": force("motor"),
        "a servo without gain": force("servo"),
        "a wrench of zero": force("wrench"),
        "a soft contact far away": touching("soft"),
        "a rigid contact far away": touching("complementarity"),
    }


def cost(
    effort: Effort, part: str, lean: pg.Model, laden: pg.Model, method: str, seconds: float,
    *, whole: bool = False,
) -> Iterator[Row]:  # fmt: skip
    """Processor time of the steps, or of whole calls, without the part and with it."""
    mechs = {"without": pg.Mechanism(lean), "pgraph, with it": pg.Mechanism(laden)}
    given = {"t_end": seconds, "frames": 11, "method": method, "estimate": False}

    def run(mech: pg.Mechanism) -> pg.Result:
        return pg.simulate(mech, **given, **METHODS[method])

    def steps(mech: pg.Mechanism) -> float:
        return run(mech).timing["step_processor"]

    one, other = (run(mech) for mech in mechs.values())
    apart = float(np.abs(one.q - other.q[:, : one.mechanism.nq]).max() / np.abs(one.q).max())
    sides: dict[str, Callable[[], object]] = {
        side: partial(run if whole else steps, mech) for side, mech in mechs.items()
    }
    words = f"{part}, {method}, {'a whole call of' if whole else 'the steps of'} {seconds:g} s"
    clocked = frozenset() if whole else frozenset(sides)
    return compared(effort, words, sides, agrees=f"motion {apart:.0e}", clocked=clocked)
