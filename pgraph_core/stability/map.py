"""stability_map: which methods hold where, over one axis that makes a scene extreme."""

from __future__ import annotations

import json
import math
from collections.abc import Callable, Iterable
from dataclasses import asdict, dataclass, replace
from numbers import Real
from pathlib import Path
from typing import Any

from ..errors import FileError, InputError, Problem, choices
from ..integrators import METHODS, method_of
from ..mechanism import Mechanism
from ..model import Model
from ..model.files import write_atomic
from ..portable import Portable
from .axes import AXES
from .cells import Sweep, computed
from .start import in_scenario, started
from .verdict import Cell, Verdict

STEPS = (1e-1, 1e-2, 1e-3, 1e-4)  # [s]
TARGET = 1e-3  # rad, or of the mechanism's length
BUDGET = 20_000_000  # evaluations times motions a run: a second or two


@dataclass(frozen=True)
class StabilityMap(Portable):
    """A verdict on each value of the axis, method and step; `print` shows it as a text."""

    model: str  # name
    axis: str
    what: str  # what a value is
    unit: str
    values: tuple[float, ...]
    methods: tuple[str, ...]
    steps: tuple[float, ...]  # [s]; empty where the values are the steps
    t_end: float  # [s]
    target: float  # largest error that is OK
    references: tuple[str, ...]  # what the cells of each value are compared with
    cells: tuple[Cell, ...]
    complete: bool = True  # False: it was cancelled, and these are the cells so far

    def __str__(self) -> str:
        from .text import text

        return text(self)

    def figure(self) -> str:
        """A heat map as an SVG text that stands alone."""
        from .figure import figure

        return figure(self)

    def to_dict(self) -> dict[str, Any]:
        """All of it as plain values; what is not finite is None, as JSON has it."""
        cells = [{k: _plain(x) for k, x in asdict(cell).items()} for cell in self.cells]
        head = {k: x for k, x in vars(self).items() if k != "cells"}
        return {k: list(x) if isinstance(x, tuple) else x for k, x in head.items()} | {
            "cells": cells
        }

    def to_json(self) -> str:
        """One JSON object."""
        return json.dumps(self.to_dict(), allow_nan=False)

    def save(self, path: str | Path, /) -> None:
        """Write a page (.html), the figure (.svg) or the numbers (.json). Raises FileError."""
        from .page import page

        makers: dict[str, Callable[[], str]] = {
            ".html": lambda: page([self]),
            ".svg": self.figure,
            ".json": self.to_json,
        }
        suffix = Path(path).suffix
        if suffix not in makers:
            text = f"must end in {choices(makers)}; given {suffix!r}"
            raise FileError(Problem(str(path), "", text))
        write_atomic(path, makers[suffix]())


def stability_map(
    mech: Mechanism | Model,
    q: Any = None,
    v: Any = None,
    *,
    axis: str = "stiffness",
    values: Iterable[float] | None = None,
    methods: Iterable[str] | None = None,
    steps: Iterable[float] | None = None,
    t_end: float | None = None,
    target: float = TARGET,
    scenario: str | None = None,
    stabilise: str | None = "project",
    budget: int = BUDGET,
    threads: int | None = None,
    progress: Callable[[float], Any] | None = None,
) -> StabilityMap:
    """A verdict on every value of `axis`, method and step, from runs of `t_end` [s].

    Each cell runs at its step and at half of it and is compared with a reference, two far finer
    runs by different methods: OK means that its error against that is at most `target` [rad; of
    the mechanism's length]. (q, v) is the initial state, that of `scenario` or the model where
    it is left out. `budget` is how many evaluations of the dynamics, times elementary motions, a
    run may take. `progress(fraction)` is called as cells are done; where it returns False the map
    ends with the cells that it has. Raises InputError for what does not fit, with the choices.
    """
    given = mech.model if isinstance(mech, Mechanism) else mech
    model, duration = in_scenario(given, scenario)
    model = started(model, q, v)
    sweep = _checked(
        model, axis, values, methods, steps, t_end or duration, target, budget, stabilise
    )
    rows, cells, complete = computed(sweep, progress, threads)
    return StabilityMap(
        model.name, sweep.axis.name, sweep.axis.what, sweep.axis.unit, sweep.values,
        sweep.methods, sweep.steps, sweep.t_end, sweep.target,
        tuple(_said(row) for row in rows), advised(cells), complete,
    )  # fmt: skip


def _said(row: Any) -> str:
    if row.known is None:
        return row.problem
    return f"{row.known.how}: known to {row.known.accuracy:.0e}"


def advised(cells: list[Cell]) -> tuple[Cell, ...]:
    """The cells, those in trouble with the methods that do at the same value and step."""
    good: dict[tuple[float, float], list[str]] = {}
    for cell in cells:
        if cell.status is Verdict.OK:
            good.setdefault((cell.value, cell.step), []).append(cell.method)
    found = []
    for cell in cells:
        others = good.get((cell.value, cell.step), [])
        if cell.status is not Verdict.OK and others:
            text = f"{cell.text}; at this step {choices(others, 3)} would do"
            cell = replace(cell, text=text)
        found.append(cell)
    return tuple(found)


def _checked(
    model: Model,
    axis: str,
    values: Any,
    methods: Any,
    steps: Any,
    t_end: Any,
    target: Any,
    budget: int,
    stabilise: str | None,
) -> Sweep:
    if axis not in AXES:
        text = f"no axis is called {axis!r}; choose one of {choices(AXES, len(AXES))}"
        raise _refusal("axis", text)
    chosen = AXES[axis]
    if chosen.of_steps and steps is not None:
        raise _refusal("steps", "the values of axis 'step' are the steps; leave steps out")
    numbers = _numbers("values", chosen.values if values is None else values)
    widths = () if chosen.of_steps else _numbers("steps", STEPS if steps is None else steps)
    for field, each in (("steps", widths), ("values", numbers if chosen.of_steps else ())):
        if any(x <= 0 for x in each):
            raise _refusal(field, f"steps must be > 0 [s]; given {min(each):g}")
    end, aim = _positive("t_end", t_end), _positive("target", target)
    names = tuple(usual_methods(model)) if methods is None else tuple(methods)
    if not names:
        raise _refusal("methods", f"give at least one of {choices(METHODS)}")
    for name in names:
        method_of(name)
    chosen.applied(model, numbers[0])  # refused here where the model has nothing that it varies
    return Sweep(model, chosen, numbers, names, widths, end, aim, int(budget), stabilise)


def usual_methods(model: Model) -> list[str]:
    """All that can take the model: with impulses those that step over them."""
    impulses = any(any(b.limits) for b in model.bodies)
    impulses |= any(c.active and c.law != "soft" for c in model.contacts)
    if impulses:
        return ["semi_implicit_euler", "rk4", "moreau_jean"]
    return [name for name in METHODS if name != "moreau_jean"]


def _numbers(field: str, values: Any) -> tuple[float, ...]:
    try:
        found = tuple(float(x) for x in values)
    except (TypeError, ValueError):
        found = ()
    if not found or not all(map(math.isfinite, found)):
        raise _refusal(field, f"must be finite numbers, at least one; given {values!r:.60}")
    return tuple(dict.fromkeys(found))


def _positive(field: str, value: Any) -> float:
    if isinstance(value, bool) or not isinstance(value, Real) or not 0 < float(value) < math.inf:
        raise _refusal(field, f"must be a finite number > 0; given {value!r}")
    return float(value)


def _refusal(field: str, text: str) -> InputError:
    return InputError(Problem("stability_map", field, text))


def _plain(value: Any) -> Any:
    return None if isinstance(value, float) and not math.isfinite(value) else value
