"""Cases: models whose motion is known, how to run them, and how accurate the run must be.

A case file is JSON: the reference, how it was obtained, and `cases`, each a model, the options of
its run, and the observables to compare (`observables.KINDS`). No code knows a case by name.
"""

from __future__ import annotations

import json
from collections.abc import Callable, Mapping
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import numpy as np

from ..dynamics.arguments import wrong_type
from ..errors import FileError, Problem, choices, explained
from ..mechanism import Mechanism
from ..model import Model
from ..model.files import read
from ..packing.system import Array
from ..result import Result
from ..simulation import simulate
from .observables import KINDS, Motion, States, errors, rotations


@dataclass(frozen=True)
class Observable:
    """One quantity of a case and its reference values."""

    kind: str  # of `observables.KINDS`
    given: Mapping[str, Any]  # what the kind needs: a body, a point, ...
    frames: tuple[int, ...] | None  # indices of those compared; None: all
    reference: Array  # (n, k)
    scale: float  # below it, errors are absolute [unit of the quantity]
    target: float  # largest error that passes

    @property
    def name(self) -> str:
        """Kind and part, such as "point of tip"."""
        of = [self.given[key] for key in ("body", "constraint", "contact") if key in self.given]
        return " of ".join([self.kind, *of])

    def of(self, motion: Motion) -> Array:
        """(n, k) its values in a run, or at given states."""
        found = KINDS[self.kind](motion, self.given)
        return found if self.frames is None else found[list(self.frames)]

    def errors(self, motion: Motion) -> Array:
        """(n,) error of each row of the reference; inf after the end of a run that failed."""
        found = np.full_like(self.reference, np.inf)
        try:
            there = self.of(motion)[: len(found)]
            found[: len(there)] = there
        except IndexError:  # a frame after the end of a run that failed
            pass
        with np.errstate(invalid="ignore"):
            return np.nan_to_num(
                errors(self.kind, found, self.reference, self.scale), nan=np.inf, posinf=np.inf
            )


@explained
@dataclass(frozen=True)
class Case:
    """A model whose motion is known."""

    name: str
    description: str
    why_hard: str
    how_obtained: str  # how the reference was computed
    accuracy: float  # estimated, of the reference
    model: Model
    options: Mapping[str, Any]  # of `simulate`: method, rtol or step, t_end, scenario, tau, ...
    t: Array | None  # (n,) times compared [s]; None: the run chooses them, or there is no run
    states: Array | None  # (n, nq) evaluated instead of a run
    observables: tuple[Observable, ...]

    def motion(self, *, progress: Callable[[float], Any] | None = None, **options: Any) -> Motion:
        """The run, with `options` replacing those of the case; its states if it has no run."""
        mech = Mechanism(self.model)
        if self.states is not None:
            return States(mech, self.states, np.zeros((len(self.states), mech.nv)))
        grid = {} if self.t is None else {"t_end": float(self.t[-1]), "t_eval": self.t}
        return simulate(mech, progress=progress, **{**grid, **self.options, **options})


@explained
@dataclass(frozen=True)
class Verdict:
    """The result of a case: the observable with the largest error relative to its target."""

    case: Case
    observable: Observable
    error: float
    run: Result | None
    seconds: float = field(default=0.0)  # of the stepping loop

    @property
    def ok(self) -> bool:
        """Whether the run reached its end and the error is within the target."""
        ended = self.run is None or self.run.status.ok
        return ended and self.error <= self.observable.target


@explained
def verify(case: Case, *, progress: Callable[[float], Any] | None = None) -> Verdict:
    """Run a case and compare it with its reference. Raises InputError if it is given no case."""
    if not isinstance(case, Case):
        raise wrong_type("verify", "case", "a pg.Case, one of those of pg.load_cases(path)", case)
    motion = case.motion(progress=progress, estimate=False)  # the error itself is measured
    found = [float(np.max(each.errors(motion))) for each in case.observables]
    parts = [error / each.target for error, each in zip(found, case.observables)]
    worst = int(np.argmax(parts))
    run = motion if isinstance(motion, Result) else None
    seconds = run.timing["step"] if run else 0.0
    return Verdict(case, case.observables[worst], found[worst], run, seconds)


# -- files -----------------------------------------------------------------------------------------


@explained
def load_cases(path: str | Path, /) -> tuple[Case, ...]:
    """The cases in a file. Raises FileError or ModelError."""
    data = _object(path)
    try:
        return tuple(_case(data, entry, Path(path)) for entry in data["cases"])
    except KeyError as missing:
        raise FileError(Problem(str(path), str(missing.args[0]), "is missing in a case")) from None
    except (TypeError, ValueError, AttributeError) as wrong:
        raise FileError(Problem(str(path), "cases", f"cannot be read: {wrong}")) from None


def _object(path: str | Path) -> dict[str, Any]:
    try:
        return json.loads(read(path))
    except json.JSONDecodeError as error:
        text = f"not JSON: {error.msg} at column {error.colno}; give a case file of Pgraph"
        raise FileError(Problem(f"{path}, line {error.lineno}", "", text)) from None


def _name(data: Mapping[str, Any], entry: Mapping[str, Any]) -> str:
    variant = entry.get("variant")
    return data["name"] if variant is None else f"{data['name']}_{variant}"


def _case(data: Mapping[str, Any], entry: Mapping[str, Any], path: Path) -> Case:
    """One entry of `cases`; fields that it omits are those of the file."""
    options = dict(entry.get("run", {}))
    states = entry.get("states")
    t = _times(data, entry, options) if entry.get("grid", True) and states is None else None
    model = entry["model"]
    return Case(
        _name(data, entry),
        entry.get("description", data["description"]),
        data["why_hard"],
        data["how_obtained"],
        float(entry.get("estimated_accuracy", data["estimated_accuracy"])),
        Model.load(path.parent / model) if isinstance(model, str) else Model(**model),
        options,
        t,
        None if states is None else np.array(states, dtype=float),
        tuple(_observable(data, seen, t, path) for seen in entry["observables"]),
    )


def _times(data: Mapping[str, Any], entry: Mapping[str, Any], options: Mapping[str, Any]) -> Array:
    """The times of the reference up to the run's end."""
    t = np.array(entry.get("t", data["t"]), dtype=float)
    t_end = options.get("t_end", t[-1])
    return t[t <= t_end * (1 + 1e-12)]


def _observable(
    data: Mapping[str, Any], seen: Mapping[str, Any], t: Array | None, path: Path
) -> Observable:
    given = dict(seen)
    kind, scale, target = given.pop("kind"), given.pop("scale", 1.0), given.pop("target")
    if kind not in KINDS:
        text = f"no observable is called {kind!r}; choose one of {choices(KINDS, 20)}"
        raise FileError(Problem(str(path), "kind", text))
    frames, first = given.pop("frames", None), given.pop("first", None)
    reference = np.atleast_1d(np.array(_found(data, given.pop("reference")), dtype=float))
    if first is not None:
        reference = reference[:first]
    if frames is not None:
        reference = reference.reshape(len(frames), -1)
    reference = reference.reshape(len(reference), -1)
    if t is not None and frames is None:
        reference = reference[: len(t)]
    if kind == "rotation":
        reference = rotations(reference)
    where = None if frames is None else tuple(frames)
    return Observable(kind, given, where, reference, float(scale), float(target))


def _found(data: Mapping[str, Any], reference: Any) -> Any:
    """The numbers themselves, or those at a path such as "100/tip_xy" in the file's reference."""
    if not isinstance(reference, str):
        return reference
    found: Any = data["reference"]
    for key in reference.split("/"):
        found = found[int(key)] if isinstance(found, list) else found[key]
    return found
