"""Stability maps of extreme scenes: `python -m benchmarks.stability` prints docs/stability.md."""

from __future__ import annotations

import math
import sys
import time
from collections import Counter
from typing import Any, NamedTuple

import pgraph_core as pg
import pgraph_models
from pgraph_core.study.axes import AXES

from . import forced

STEPS = (1e-2, 1e-3, 1e-4)
SLOPE = 0.2  # rad


class Preset(NamedTuple):
    """A map to make."""

    title: str
    model: pg.Model
    axis: str
    values: tuple[float, ...]
    options: dict[str, Any]


def _built_in(name: str) -> pg.Model:
    return pg.Model.load(pgraph_models.path(name))


def _sliding(law: Any) -> pg.Model:
    """A block just above a slope, released with a speed along it."""
    up, along = math.cos(SLOPE), math.sin(SLOPE)
    q = (-1e-3 * along, 0.0, 1e-3 * up, math.cos(SLOPE / 2), 0.0, -math.sin(SLOPE / 2), 0.0)
    block = pg.Body(name="block", joint="free", q=q, v=(0, 0, 0, 0.5 * up, 0, 0.5 * along))
    corners = tuple((x, y, 0.0) for x in (-0.1, 0.1) for y in (-0.1, 0.1))
    contact = pg.Contact(name="base", body="block", law=law, points=corners)
    ground = pg.Ground(slope=SLOPE)
    return pg.Model(name="block on a slope", bodies=(block,), contacts=(contact,), ground=ground)


def presets() -> list[Preset]:
    """The maps of the page."""
    stiff, double = _built_in("stiff_pendulum"), _built_in("double_pendulum")
    whole = {"steps": (1e-1, 1e-2, 1e-3, 1e-4), "t_end": 2.0}
    short = {"steps": STEPS, "t_end": 0.5}
    shorter = {"steps": (1e-2, 1e-3), "t_end": 0.3}
    fine = {"steps": (1e-3, 1e-4, 1e-5), "t_end": 0.1}
    loop = _built_in("four_bar")
    return [
        Preset("Stiffness", stiff, "stiffness", AXES["stiffness"].values, whole),
        Preset("Damping", stiff, "damping_ratio", (0, 0.1, 1, 10), short),
        Preset("Mass ratio", double, "mass_ratio", (1e-12, 1e-6, 1, 1e3, 1e9), short),
        Preset("Inertia", double, "inertia", (1e-15, 1e-6, 1, 1e3), short),
        Preset("Speed", double, "speed", (1, 10, 100), short),
        Preset("Joint friction", double, "joint_friction", (0, 0.1, 1, 10), short),
        Preset("Links", _built_in("pendulum"), "chain_length", (2, 10, 50, 100), shorter),
        Preset("Redundant constraints", loop, "redundancy", (0, 1, 5), shorter),
        Preset("Near a singular position", loop, "singularity", (0, 1e-6, 1e-2), shorter),
        Preset("Friction", _sliding("complementarity"), "friction", (0, 0.1, 0.3, 3), shorter),
        Preset("Stiff contact", _sliding("soft"), "contact_stiffness", (1e3, 1e5, 1e7), fine),
        Preset("Length", double, "length_scale", (1e-9, 1, 1e9), short),
    ]


def section(preset: Preset) -> str:
    """A map as Markdown, with its cost."""
    began = time.process_time()
    found = pg.stability_map(preset.model, axis=preset.axis, values=preset.values, **preset.options)
    seconds = time.process_time() - began
    count = Counter(cell.status for cell in found.cells)
    counts = ", ".join(f"{n} {status}" for status, n in count.items())
    calls = sum(cell.evaluations for cell in found.cells if cell.status != "SLOW")
    cost = f"{len(found.cells)} cells: {counts}. {calls:.1e} evaluations at the given steps, "
    cost += f"{seconds:.1f} s of processor time."
    print(preset.title, f"{seconds:.1f} s", file=sys.stderr, flush=True)
    return f"## {preset.title}\n\n```\n{found}\n```\n\n{cost}"


def main() -> None:
    """Print the page."""
    print(f"{INTRODUCTION}{axes()}\n{MEASURED}")
    for preset in presets():
        print(f"{section(preset)}\n")
    print(LEFT_OUT)
    forced.main()


INTRODUCTION = """# Stability of the methods

    pgraph stability stiff_pendulum --scenario swing -o map.html
    pgraph stability double_pendulum --axis mass_ratio --steps 1e-2,1e-3
    pgraph stability quadruped --scenario stance --all

`pg.stability_map(model, axis=..., values=..., methods=..., steps=..., t_end=...)` runs every method
at every value of an axis, at every step and at half of it. Each cell gets one verdict.
Without `values` the model's own value is among them, marked ◂; without `methods` those that are
right most often come first. The advice is right for the model as it is, if any cell there is.

| verdict | meaning | its text names |
| --- | --- | --- |
| OK | error at most `target` (1e-3 rad or of the mechanism's length) | error, order |
| INACCURATE | bounded, but a larger error | the step that meets the target |
| UNSTABLE | the method makes the motion grow | when, which body, predicted largest step |
| DAMPED | the method loses energy that the model conserves, as much as the error | the loss |
| DRIFT | constraints drift by more than the target | how far, when |
| FAILED | the run ended early, or was refused | the message of the run |
| SLOW | more evaluations than the budget allows | their number |

* **Every verdict needs a reference.** Each value has one: two far finer runs, by different methods
  where possible. Their difference is the accuracy of the reference; if it is worse than the target,
  no cell is called OK.
* **A budget ends every map**: evaluations of a run times elementary motions, of which a row of a
  constraint counts three.
  A reference may take five times as many; where none reaches the end in it, cells of that value
  say so. Implicit steps that cannot be solved are divided, and count. Among the dearest is
  `pgraph stability andrews`, 1 s of Andrews' squeezer: 288 cells, 178 s of processor time.
* **The predicted largest step** of an explicit method is its stability limit (2.83 for RK4) over
  the fastest rate of the linearised motion, at several times of the run. Contacts have no
  prediction.
* **DAMPED in a short run** of semi-implicit Euler may be temporary, because its energy error
  oscillates.
* **An axis** is a name, a function from model to model, usual values and a unit
  (`pgraph_core/study/axes.py`):
"""

MEASURED = """
The sections below are the output of `python -m benchmarks.stability` on two shared cores of an AMD
EPYC.
"""

LEFT_OUT = """## What unused features cost

`mech.plan()` lists what a scene needs, what its runs leave out, and what that saves; `pgraph info`
and `pgraph run` print it. Adding a part without effect does not change the motion. The last column
is the processor time of the steps with that part over the time without it (a chain of six rods,
RK4, least of 25 runs in turn).
"""


def axes() -> str:
    """The list of axes."""
    lines = (
        f"  * `{axis.name}`: {axis.what}{f' [{axis.unit}]' if axis.unit else ''}"
        for axis in AXES.values()
    )
    return "\n".join(lines)


if __name__ == "__main__":
    main()
