"""The result of `stability_map`, with a verdict on each run and a readable summary."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import asdict, dataclass, replace
from enum import StrEnum
from typing import Any

import numpy as np

from ..errors import choices, explained
from ..integrators import METHODS
from ..mechanism import Mechanism
from ..packing import Array, row_of_velocity
from ..portable import jsonable
from ..result import Result, Status
from ..tolerances import NAMED
from .figures import Look, Saved, Square, heat_map
from .measures import TRUST, joint_errors
from .reference import KnownMotion

NAN = float("nan")
AIM = 2  # an advised step aims at this part of the target
WRONG = 1  # rad, or of the length, or of the energies: from there on the motion is another one


class Verdict(StrEnum):
    """The verdict on a run, exactly one per cell. (How a run ended is its `Status`.)"""

    OK = "OK"
    DIVIDED = "DIVIDED"
    INACCURATE = "INACCURATE"
    UNSTABLE = "UNSTABLE"
    DAMPED = "DAMPED"
    DRIFT = "DRIFT"
    FAILED = "FAILED"
    SLOW = "SLOW"
    NOT_RUN = "NOT_RUN"


@dataclass(frozen=True)
class Cell:
    """The comparison of one run with the reference, for one value, method and step size.

    Errors are the maximum over time of the rotation of a joint [rad], or of its translation
    relative to the length of the mechanism. Energies are relative to their range in the reference.
    """

    value: float
    method: str
    step: float  # [s]
    status: Verdict
    text: str  # why, and a remedy
    error: float = NAN
    error_half: float = NAN  # at half of the step
    order: float = NAN  # observed, from these two
    step_needed: float = NAN  # to meet the target: one that was run, or by the order [s]
    time: float = NAN  # time of the failure, or of the start of growth [s]
    body: str = ""  # the first at fault
    step_limit: float = NAN  # predicted largest stable step [s]
    energy_lost: float = 0.0  # loss that the model does not dissipate
    energy_gained: float = 0.0
    constraint_drift: float = 0.0  # over the mechanism's length
    evaluations: int = 0  # evaluations of the dynamics
    step_taken: float = NAN  # mean step, shorter than `step` if steps were divided [s]


@dataclass(frozen=True)
class Evidence:
    """The measurements on which a verdict is based."""

    target: float
    mech: Mechanism
    run: Result  # at the step
    known: KnownMotion
    errors: Array  # (n, elementary motions) of every frame
    growth: Array  # (n,) spurious energy over the range of energies
    cell: Cell  # with the verdict OK


def judged(
    cell: Cell, target: float, mech: Mechanism, whole: Result, half: Result, known: KnownMotion
) -> Cell:
    """Complete `cell` from one run with its step size and one with half of it."""
    found = evidence(cell, target, mech, whole, half, known)
    for question in (_unstable, _failed, _drifts, _unknown, _damped, _inaccurate):
        answer = question(found)
        if answer is not None:
            return _with_division(answer)
    order = f", order {found.cell.order:.1f}" if np.isfinite(found.cell.order) else ""
    return _with_division(replace(found.cell, text=f"error {found.cell.error:.1e}{order}"))


def _with_division(cell: Cell) -> Cell:
    """Say that the steps of a cell were divided. A cell that is OK was not run with its step."""
    if not cell.step_taken < cell.step:
        return cell
    status = Verdict.DIVIDED if cell.status is Verdict.OK else cell.status
    text = f"{cell.text}; its equations were not solved at this step, so steps were divided, to "
    return replace(cell, status=status, text=f"{text}{cell.step_taken:.2g} s on average")


def mean_step(run: Result, method: str, step: float) -> float:
    """Return the mean step [s] of a run that divided steps of this size, or the size."""
    divided = METHODS[method].implicit and run.counters["rejected_steps"] > 0
    count = run.counters["steps"]
    return float(run.t[-1] - run.t[0]) / count if divided and count else step


def evidence(
    cell: Cell, target: float, mech: Mechanism, whole: Result, half: Result, known: KnownMotion
) -> Evidence:
    """Compute errors, energies and drift over the recorded frames."""
    errors, other = (joint_errors(mech, run.q, known.at(run.t)) for run in (whole, half))
    growth = spurious_energy(whole, known.energy)
    error = float(errors.max(initial=0.0)) if whole.status.ok else NAN
    error_half = float(other.max(initial=0.0)) if half.status.ok else NAN
    order = NAN
    if np.isfinite(error) and error_half > 10 * known.accuracy:
        order = float(np.log2(error / error_half))
    drift = float(whole.constraint_drift[:, 0].max(initial=0.0))
    cell = replace(
        cell,
        error=error,
        error_half=error_half,
        order=order,
        step_limit=step_limit(cell.method, known.rate),
        energy_lost=steady_loss(growth),
        energy_gained=float(growth.max(initial=0.0)),
        constraint_drift=drift / (mech.packed.length or 1.0),
        evaluations=whole.counters["evaluations"],
        step_taken=mean_step(whole, cell.method, cell.step),
    )
    return Evidence(target, mech, whole, known, errors, growth, cell)


def step_limit(method: str, rate: float) -> float:
    """Return the largest stable step [s] of an explicit method at a rate [1/s], or NaN."""
    chosen = METHODS[method]
    bounded = not chosen.stable and chosen.limit > 0.0 and rate > 0.0
    return chosen.limit / rate if bounded else NAN


def spurious_energy(run: Result, scale: float) -> Array:
    """Compute the energy not explained by work or dissipation, divided by `scale` [J], (n,)."""
    with np.errstate(over="ignore", invalid="ignore"):
        ledger = run.energy - run.work + run.dissipation
        found = (ledger - ledger[:1]) / (scale or 1.0)
    return np.where(np.isfinite(found), found, np.inf)


def steady_loss(growth: Array) -> float:
    """Return the mean loss in the last third if it grows from third to third, or 0."""
    if len(growth) < 3 or not np.isfinite(growth).all():
        return 0.0
    thirds = [float(part.mean()) for part in np.array_split(growth, 3)]
    return max(0.0, -thirds[2]) if thirds[0] > thirds[1] > thirds[2] else 0.0


def rises(growth: Array) -> bool:
    """Check whether energy is gained in the last third, and more than any earlier third changes."""
    if len(growth) < 3:
        return False
    first, second, last = (float(part.mean()) for part in np.array_split(growth, 3))
    return last > max(abs(first), abs(second))


def _unstable(found: Evidence) -> Cell | None:
    """Return an unstable verdict if the motion grows, by spurious energy or instability."""
    run, cell = found.run, found.cell
    beyond = cell.step > (1 - NAMED) * cell.step_limit
    missed = not cell.error <= found.target and cell.energy_gained > found.target
    sudden = not cell.order < METHODS[cell.method].order + 1  # an error of order shrinks with it
    grown = found.growth > WRONG
    burst = run.status is Status.NOT_FINITE
    if not (burst or grown.any() or (beyond and missed and sudden and rises(found.growth))):
        return None
    bad = np.flatnonzero(grown | (found.errors.max(axis=1, initial=0.0) > WRONG))
    first = int(bad[0]) if len(bad) else len(run.t) - 1
    body, time = found.mech.packed.body_of(_first_row(found, first)), float(run.t[first])
    text = f"grows from t = {time:.3g} s on (step {time / cell.step:.0f}), body '{body}' first"
    if np.isfinite(cell.step_limit):
        text += f"; rate times step is {found.known.rate * cell.step:.3g}, "
        text += f"the predicted limit a step of {cell.step_limit:.3g} s"
    return replace(cell, status=Verdict.UNSTABLE, text=text, time=time, body=body)


def _first_row(found: Evidence, frame: int) -> int:
    """Return the row with the largest error, or acceleration if only the start is recorded."""
    if found.errors[frame].max(initial=0.0) > 0.0:
        return int(np.argmax(found.errors[frame])) + 1
    fastest = int(np.argmax(np.abs(found.run.vdot[frame])))
    return row_of_velocity(found.mech.packed.rows, fastest)


def _failed(found: Evidence) -> Cell | None:
    """Return the cell for a run that ended early, with the cause, the body and the time."""
    if found.run.status.ok:
        return None
    many = found.run.status is Status.TOO_MANY_STEPS
    time = float(found.run.t[-1]) if len(found.run.t) else 0.0
    status = Verdict.SLOW if many else Verdict.FAILED
    return replace(found.cell, status=status, text=found.run.message, time=time)


def _drifts(found: Evidence) -> Cell | None:
    if not found.cell.constraint_drift > found.target:
        return None
    time = float(found.run.t[int(np.argmax(found.run.constraint_drift[:, 0]))])
    text = f"constraints drift by {found.cell.constraint_drift:.1e} of the length at t = "
    text += f"{time:.3g} s"
    if found.run.header["stabilise"] != "project":
        text += "; use stabilise='project'"
    return replace(found.cell, status=Verdict.DRIFT, text=text, time=time)


def _unknown(found: Evidence) -> Cell | None:
    """Return a verdict if the reference is less accurate than the target, so that no run can
    pass."""
    known = found.known
    if known.accuracy < found.target:
        return None
    text = f"cannot be judged: the motion is {known.known} ({known.source})"
    return replace(found.cell, status=Verdict.INACCURATE, text=text)


def _damped(found: Evidence) -> Cell | None:
    """Return a damped verdict if energy loss, half of it in amplitude, explains the error."""
    lost, error = found.cell.energy_lost, found.cell.error
    if not (lost > found.target and lost > error / 2):
        return None
    text = f"{lost:.1e} of the energy is lost, which the model conserves; error {error:.1e}"
    return _with_needed(found, Verdict.DAMPED, text, max(lost, error))


def _inaccurate(found: Evidence) -> Cell | None:
    error, half, target = found.cell.error, found.cell.error_half, found.target
    if error <= target and half <= TRUST * target:
        return None
    text = f"error {error:.1e}"
    if error <= target:
        text += f" by accident: {half:.1e} at half of the step"
    return _with_needed(found, Verdict.INACCURATE, text, error)


def _with_needed(found: Evidence, status: Verdict, text: str, excess: float) -> Cell:
    """Compute the cell with the step at which `excess` meets the target at this order."""
    cell = found.cell
    if not np.isfinite(cell.order):
        return _without_order(found, status, text)
    if not round(cell.order) > 0:
        text += "; it does not shrink with the step"
        return replace(cell, status=status, text=text)
    order = min(cell.order, METHODS[cell.method].order)
    step = cell.step * min((found.target / AIM / excess) ** (1.0 / order), 1.0)
    return replace(cell, status=status, text=text, step_needed=step)


def _without_order(found: Evidence, status: Verdict, text: str) -> Cell:
    """Return a cell whose order is unknown, with the result of the run at half of the step."""
    cell = found.cell
    if np.isfinite(cell.error_half) and cell.error_half + found.known.accuracy <= found.target:
        text += f"; half of the step has error {cell.error_half:.1e}"
        return replace(cell, status=status, text=text, step_needed=cell.step / 2)
    why = "the run at half of the step ended early" if np.isnan(cell.error_half) else (
        f"at half of the step it is {cell.error_half:.1e}, below what the reference resolves"
    )  # fmt: skip
    return replace(cell, status=status, text=f"{text}; its order is not known, since {why}")


# -- what a cell advises: what other runs have shown, then what an order predicts ------------------


def advised(cells: Sequence[Cell]) -> tuple[Cell, ...]:
    """Add advice to each cell that is not OK.

    It names the largest step with which its method is OK, or else the one that its finest run
    predicts, and the methods that are OK at its value and step.
    """
    good: dict[tuple[float, float], list[str]] = {}
    steps: dict[tuple[float, str], list[Cell]] = {}
    for cell in sorted(cells, key=lambda cell: cell.step):
        steps.setdefault((cell.value, cell.method), []).append(cell)
    for cell in cells:
        if cell.status is Verdict.OK:
            good.setdefault((cell.value, cell.step), []).append(cell.method)
    found = []
    for cell in cells:
        if cell.status not in (Verdict.OK, Verdict.NOT_RUN):
            finer = [c for c in steps[cell.value, cell.method] if c.step <= cell.step]
            cell = _with_step(cell, finer)
            if others := good.get((cell.value, cell.step), []):
                cell = replace(cell, text=f"{cell.text}; at this step use {choices(others, 3)}")
        found.append(cell)
    return tuple(found)


def _with_step(cell: Cell, finer: Sequence[Cell]) -> Cell:
    """Return a cell with the step at which its method reaches the target, given the cells of its
    method from the finest step up to its own.
    """
    right = [c.step for c in finer if c.status is Verdict.OK]
    if right:
        text = f"{cell.text}; use a step of {max(right):.2g} s"
        return replace(cell, text=text, step_needed=max(right))
    finest = finer[0]
    if not np.isfinite(finest.step_needed):
        return replace(cell, step_needed=NAN)
    text = cell.text
    if np.isfinite(finest.order):
        text += f"; its order, {finest.order:.1f}, predicts that a step of about "
        text += f"{finest.step_needed:.2g} s does, which was not run"
    elif finest is not cell:
        text += f"; a step of {finest.step_needed:.2g} s has error {finest.error_half:.1e}"
    return replace(cell, text=text, step_needed=finest.step_needed)


OWN = "◂"  # marks the model's own value
LOOK = {  # letter of the text map, colour and ink of the figure, meaning
    Verdict.OK: Look(".", "#2e9e5b", "#ffffff", "reaches the target"),
    Verdict.DIVIDED: Look(
        ":", "#5fa8a0", "#ffffff", "reaches the target, but with shorter steps than this one"
    ),
    Verdict.INACCURATE: Look(
        "i", "#e3b341", "#1b1f24", "bounded, but less accurate than the target"
    ),
    Verdict.UNSTABLE: Look("U", "#c2352b", "#ffffff", "the method makes the motion grow"),
    Verdict.DAMPED: Look(
        "d", "#8d6cc9", "#ffffff", "the method takes energy that the model conserves"
    ),
    Verdict.DRIFT: Look("D", "#d9782d", "#ffffff", "constraints drift"),
    Verdict.FAILED: Look("F", "#5a2327", "#ffffff", "the run ended early, or was refused"),
    Verdict.SLOW: Look("s", "#8a939e", "#ffffff", "more steps than the budget allows"),
    Verdict.NOT_RUN: Look("-", "#d5d9de", "#1b1f24", "not run in the time of the map"),
}


@explained
@dataclass(frozen=True)
class StabilityMap(Saved):
    """Verdicts for each axis value, method and step size. `print` shows them as text."""

    model: str  # name
    axis: str
    what: str  # meaning of a value
    unit: str
    values: tuple[float, ...]
    methods: tuple[str, ...]
    steps: tuple[float, ...]  # [s], empty if the values are the steps
    t_end: float  # [s]
    target: float  # largest error that is OK
    references: tuple[str, ...]  # source of the reference of each value
    cells: tuple[Cell, ...]
    complete: bool = True  # False: it was cancelled, and these are the cells so far
    own: float | None = None  # the value of the model as it is, if it is among them
    scenario: str | None = None

    def __str__(self) -> str:
        text = [self.title, "", *self.grid, "", *self._legend(), "", self.advice, ""]
        return "\n".join([*text, *self.findings()]).rstrip()

    @property
    def grid(self) -> list[str]:
        """The lines of the map: a letter for each run, and a space for one that is not known."""
        per = len(self.steps) or 1
        widest = max(len(self._label(v)) for v in self.values)
        head = "".join(f"  {name:{per}}" for name in self.methods)
        lines = [f"{'':{widest}}{head}".rstrip()]
        for value in self.values:
            line = f"{self._label(value):{widest}}"
            for name in self.methods:
                letters = [" "] * per  # letters of a cell that is not known yet
                for c in self.cells:
                    if (c.value, c.method) == (value, name):
                        letters[self._column(c)] = LOOK[c.status].letter
                line += f"  {''.join(letters):{max(per, len(name))}}"
            lines.append(line.rstrip())
        return lines

    def _label(self, value: float) -> str:
        return f"{value:g} {OWN}" if value == self.own else f"{value:g}"

    def _taken(self) -> tuple[tuple[str, float], list[Cell]] | None:
        """Compute the recommended (method, step size), and the cells in which it is accurate.

        The criteria are, in order: success for the unchanged model, success for the most values,
        and cost.
        """
        right: dict[tuple[str, float], list[Cell]] = {}
        for cell in self.cells:
            if cell.status is Verdict.OK:
                width = self.steps[self._column(cell)] if self.steps else cell.step
                right.setdefault((cell.method, width), []).append(cell)
        chosen = {k: v for k, v in right.items() if any(c.value == self.own for c in v)} or right
        count = max((len(cells) for cells in chosen.values()), default=0)
        return min(
            (item for item in chosen.items() if len(item[1]) == count),
            key=lambda item: sum(cell.evaluations for cell in item[1]), default=None,
        )  # fmt: skip

    def advised(self) -> Cell | None:
        """The run with the recommended method and step size, for the unmodified model if it is in
        the map.

        Return None if no run of the unchanged model reaches the target.
        """
        taken = self._taken()
        cells = [] if taken is None else taken[1]
        return next((c for c in cells if not self.steps or self.own in (None, c.value)), None)

    @property
    def advice(self) -> str:
        """The recommended method and step as a sentence, by completed cells if cancelled."""
        return self.said()

    def said(self, label: Callable[[str], str] = str) -> str:
        """Return `advice`, with methods named by `label`."""
        whole = len(self.values) * len(self.methods) * (len(self.steps) or 1)
        taken = self._taken()
        done = sum(cell.status is not Verdict.NOT_RUN for cell in self.cells)
        if done == whole:
            return self._said(taken, label)
        so_far = f"{'Out of time' if self.complete else 'Cancelled'} after {done} of {whole} runs"
        if taken is None:
            return f"{so_far}, which is too few to say more."
        return f"{so_far}. {self._said(taken, label)}"

    def _said(
        self, taken: tuple[tuple[str, float], list[Cell]] | None, label: Callable[[str], str]
    ) -> str:
        if taken is None:
            failed = [cell for cell in self.cells if cell.status is Verdict.FAILED]
            if failed and len(failed) == len(self.cells):
                return f"No method reaches the end: {failed[0].text}."
            return f"No method reaches the target with any of these steps{self._nearest(label)}."
        (method, step), cells = taken
        if not self.steps:
            return f"Take {label(method)} at a step of {step:g} s."
        axis, values = self.axis.replace("_", " "), [cell.value for cell in cells]
        where = f"all values of {axis}"
        if len(cells) < len(self.values):
            where = f"{len(cells)} of {len(self.values)} values of {axis}, "
            where += f"{min(values):g} to {max(values):g}"
        text = f"Take {label(method)} at a step of {step:g} s: reaches the target at {where}"
        if self.own is not None and self.own in values:
            return f"{text}, this model's own {self.own:g} among them."
        if self.own is not None:
            return f"{text}; at this model's own {self.own:g} no run does."
        return f"{text}."

    def _nearest(self, label: Callable[[str], str]) -> str:
        """Return the run with the least error, of the unchanged model if it is in the map."""
        known = [c for c in self.cells if np.isfinite(c.error)]
        near = min([c for c in known if c.value == self.own] or known, default=None,
                   key=lambda c: c.error)  # fmt: skip
        if near is None:
            return ""
        return f"; {label(near.method)} at a step of {near.step:g} s comes closest: {near.text}"

    @property
    def title(self) -> str:
        """Return a sentence with the varied quantity, the duration and the target."""
        unit = f" [{self.unit}]" if self.unit else ""
        steps = ", ".join(f"{s:g}" for s in self.steps)
        each = f"; steps {steps} s from left to right" if self.steps else ""
        scenario = f", scenario {self.scenario}" if self.scenario else ""
        return (
            f"{self.model}{scenario}: {self.what}{unit}, {self.t_end:g} s, "
            f"errors up to {self.target:g} rad or of the length are OK{each}"
        )

    def _legend(self) -> list[str]:
        """Return legend entries for the letters that occur."""
        there = {cell.status for cell in self.cells}
        lines = [f"{LOOK[v].letter}  {v:11} {LOOK[v].text}" for v in Verdict if v in there]
        if self.own is not None:
            lines.append(f"{OWN}  the model as it is")
        return lines if self.complete else [*lines, "cancelled: only the finished cells are here"]

    def troubles(self) -> dict[tuple[str, Verdict], list[Cell]]:
        """Return the cells that were run for each method and verdict other than OK."""
        groups: dict[tuple[str, Verdict], list[Cell]] = {}
        for cell in self.cells:
            if cell.status not in (Verdict.OK, Verdict.NOT_RUN):
                groups.setdefault((cell.method, cell.status), []).append(cell)
        return groups

    def findings(self) -> list[str]:
        """Return a description of the first cell and the number of cells, for each method and
        verdict other than OK."""
        found = []
        for (method, status), cells in self.troubles().items():
            where = f"{self.axis} {cells[0].value:g}, step {cells[0].step:g} s"
            more = f" ({len(cells)} cells)" if len(cells) > 1 else ""
            found.append(f"{method} {status}{more}, as at {where}: {cells[0].text}")
        return found

    def figure(self) -> str:
        """Return the figure as standalone SVG text."""
        there = {c.status for c in self.cells}
        looks = {  # without a letter where all is well
            v: look._replace(letter="" if v is Verdict.OK else look.letter)
            for v, look in LOOK.items() if v in there
        }  # fmt: skip
        squares = []
        for c in self.cells:
            text = f"{c.method}, {c.value:g}, step {c.step:g} s: {c.status}: {c.text}"
            place = self.values.index(c.value), self.methods.index(c.method), self._column(c)
            squares.append(Square(*place, looks[c.status], text))
        values, steps = [self._label(x) for x in self.values], [f"{x:g} s" for x in self.steps]
        legend = [look._replace(text=f"{v.lower()}: {look.text}") for v, look in looks.items()]
        axis = self.axis.replace("_", " ") + (f" [{self.unit}]" if self.unit else "")
        if self.own is not None:
            axis += f"; {OWN}: the model as it is"
        return heat_map(self.title, axis, values, self.methods, steps, squares, legend)

    def _column(self, cell: Cell) -> int:
        """Return the index of the requested step, which times in other units change."""
        if not self.steps or cell.step in self.steps:
            return self.steps.index(cell.step) if self.steps else 0
        own = sorted({c.step for c in self.cells if c.value == cell.value})
        return self.steps.index(sorted(self.steps)[own.index(cell.step)])

    def to_dict(self) -> dict[str, Any]:
        """Return plain values for JSON, with None for numbers that are not finite."""
        return jsonable(asdict(self))
