"""The cost of parts without effect: the same run without and with them.

`python -m benchmarks.forced` prints the table of docs/stability.md. The motion must be the same to
rounding; the ratio of the processor times of the steps, least of runs in turn, is what is saved.
"""

from __future__ import annotations

from collections.abc import Callable
from functools import partial
from typing import Any, NamedTuple

import numpy as np

import pgraph_core as pg

LINKS = 6
STEPS = 400
ROUNDS = 25
FAR = 100.0  # m above the ground
HELD = 1e300  # kg m² of armature: a hinge that no torque turns, as a row of its own


class Forced(NamedTuple):
    """A part without effect: the model without it, the same with it, and the method."""

    part: str
    lean: pg.Model
    laden: pg.Model
    method: str = "rk4"


def chain() -> pg.Model:
    """Six rods far above the ground, and a welded one at their end."""
    model = pg.Model.serial(LINKS + 1).edit("1", link=(0.0, 0.0, FAR), v=(1.0,))
    return model.edit(str(LINKS + 1), joint="weld")


def cases() -> list[Forced]:
    """Every part that can be added without effect."""
    lean = chain()
    last = str(LINKS)
    with_part: dict[str, Callable[[], pg.Model]] = {
        "an inactive constraint": partial(
            lean.replace, constraints=(pg.Constraint(name="c", body=last, active=False),)
        ),
        "a spring without stiffness": partial(
            lean.replace, forces=(pg.Force(name="s", kind="spring", body=last, rest=1.0),)
        ),
        "a motor without torque": partial(lean.replace, forces=(pg.Force(name="m", body=last),)),
        "a servo without gain": partial(
            lean.replace, forces=(pg.Force(name="s", kind="servo", body=last),)
        ),
        "a wrench of zero": partial(
            lean.replace, forces=(pg.Force(name="w", kind="wrench", body=last),)
        ),
        "a limit out of reach": partial(lean.edit, last, limits=(-1e6, 1e6)),
        "a soft contact far away": partial(lean.replace, contacts=(_touching("soft"),)),
        "a rigid contact far away": partial(lean.replace, contacts=(_touching("complementarity"),)),
        "a weld kept as a row": partial(
            lean.edit, str(LINKS + 1), joint="revolute", axes=((0, 1, 0),), armature=HELD
        ),
    }
    found = [Forced(part, lean, laden()) for part, laden in with_part.items()]
    return [*found, Forced("an implicit method's Jacobian", lean, lean, "radau5")]


def _touching(law: Any) -> pg.Contact:
    return pg.Contact(name="c", body=str(LINKS), law=law, points=((0.0, 0.0, 0.0),))


def run(model: pg.Model, method: str = "rk4") -> pg.Result:
    """400 steps of a millisecond."""
    mech, end = pg.Mechanism(model), STEPS * 1e-3
    return pg.simulate(mech, t_end=end, step=1e-3, method=method, frames=11, estimate=False)


def apart(lean: pg.Result, laden: pg.Result) -> float:
    """Largest difference of the joints that both have, of the largest position."""
    shared = lean.mechanism.nq
    return float(np.abs(lean.q - laden.q[:, :shared]).max() / np.abs(lean.q).max())


def measured(case: Forced) -> tuple[float, float]:
    """(difference of the motions, ratio of the times of the steps)."""
    sides = (partial(run, case.lean), partial(run, case.laden, case.method))
    first = [side() for side in sides]
    took = [[side().timing["step_processor"] for side in sides] for _ in range(ROUNDS)]
    lean, laden = np.min(took, axis=0)
    return apart(*first), float(laden / lean)


def main() -> None:
    """Print the table as Markdown."""
    print("| part without effect | motion differs by | time of steps |")
    print("| --- | --- | --- |")
    for case in cases():
        difference, ratio = measured(case)
        same = f"{difference:.0e}" if case.method == "rk4" else "another method"
        print(f"| {case.part} | {same} | x {ratio:.2f} |")


if __name__ == "__main__":
    main()
