"""Verification cases: models with known motion, their run options and required accuracy.

A case file is JSON: the reference, how it was obtained, and `cases`, each a model, the options of
its run, and the observables to compare (`KINDS`). No code knows a case by name.
"""

from __future__ import annotations

import json
from collections.abc import Callable, Mapping
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any, NamedTuple, TypeAlias

import numpy as np

from .analysis import linear
from .dynamics.arguments import wrong_type
from .errors import FileError, Problem, Suggests, choices, explained
from .mechanism import Mechanism
from .model import Model
from .model.files import read
from .packing import Array
from .result import Result
from .rotation import matrix
from .simulation import simulate

Given: TypeAlias = "Mapping[str, Any]"


class States(NamedTuple):
    """States that can be evaluated without a simulation."""

    mechanism: Mechanism
    q: Array  # (n, nq)
    v: Array  # (n, nv)


Motion: TypeAlias = "Result | States"


# -- of every frame: (n, k) ------------------------------------------------------------------------


def positions(motion: Motion, given: Given) -> Array:
    return _of_joints(motion.mechanism, motion.q, given, "q")


def speeds(motion: Motion, given: Given) -> Array:
    return _of_joints(motion.mechanism, motion.v, given, "v")


def accelerations(motion: Motion, given: Given) -> Array:
    mech = motion.mechanism
    if isinstance(motion, Result):
        return _of_joints(mech, motion.vdot, given, "v")
    found = np.array([mech.forward_dynamics(q, v) for q, v in zip(motion.q, motion.v)])
    return _of_joints(mech, found, given, "v")


def _of_joints(mech: Mechanism, states: Array, given: Given, which: str) -> Array:
    """Return the columns for the joints of `bodies` (default: all), or only some `columns`.

    `absolute`: summed from the ground outwards.
    """
    names = given.get("bodies", mech.names)
    if not given.get("absolute"):
        found = np.column_stack([states[:, getattr(mech.joints[name], which)] for name in names])
        return found[:, given["columns"]] if "columns" in given else found
    sums = np.zeros((len(states), mech.nb + 1))
    for number, (name, parent) in enumerate(zip(mech.names, mech.topology.parent.tolist()), 1):
        own = states[:, getattr(mech.joints[name], which)].sum(axis=1)
        sums[:, number] = sums[:, parent] + own
    return sums[:, [mech.topology.number(name) for name in names]]


def point(motion: Motion, given: Given) -> Array:
    """Return the position of `point` on `body` [m], or the coordinates named by `axes` ("xy")."""
    place = np.array(given.get("point", (0.0, 0.0, 0.0)))
    poses = (motion.mechanism.pose(q, given["body"]) for q in motion.q)
    return np.array([x + R @ place for x, R in poses])[:, _axes(given)]


def point_velocity(motion: Motion, given: Given) -> Array:
    """[m/s], world axes."""
    mech, place = motion.mechanism, given.get("point", (0.0, 0.0, 0.0))
    jacobians = (mech.jacobian(q, given["body"], point=place) for q in motion.q)
    return np.array([J[3:] @ v for J, v in zip(jacobians, motion.v)])[:, _axes(given)]


def direction(motion: Motion, given: Given) -> Array:
    """Return the direction of `axis` of `body` in world coordinates."""
    axis = np.array(given["axis"])
    return np.array([motion.mechanism.pose(q, given["body"])[1] @ axis for q in motion.q])


def rotation(motion: Motion, given: Given) -> Array:
    """Return the rotation matrices of `body`, flattened row by row, as an (n, 9) array."""
    return np.array([motion.mechanism.pose(q, given["body"])[1].ravel() for q in motion.q])


def spin(motion: Motion, given: Given) -> Array:
    """Return the angular velocity of `body` in its own frame [rad/s]."""
    mech, name = motion.mechanism, given["body"]
    return np.array(
        [
            mech.pose(q, name)[1].T @ mech.jacobian(q, name)[:3] @ v
            for q, v in zip(motion.q, motion.v)
        ]
    )


def energy(motion: Motion, given: Given) -> Array:
    """Return the total of kinetic and potential energy [J]."""
    mech = motion.mechanism
    return np.array([[sum(mech.energy(q, v))] for q, v in zip(motion.q, motion.v)])


def constraint_force(motion: Motion, given: Given) -> Array:
    """Return [torque, force] for `constraint`, or only its `rows`."""
    return _run(motion).constraint_force[given["constraint"]][:, _rows(given)]


def contact_force(motion: Motion, given: Given) -> Array:
    """Return the vector [torque, force] that `contact` exerts on its body, or only the given
    `rows` of it."""
    return _run(motion).contact_force[given["contact"]][:, _rows(given)]


def limit_torque(motion: Motion, given: Given) -> Array:
    """Return the torque or force exerted by `limit` [N m or N]."""
    return np.reshape(_run(motion).contacts.limit[given["limit"]], (-1, 1))


def drift(motion: Motion, given: Given) -> Array:
    """Return the position error of the constraints [m]."""
    return _run(motion).constraint_drift[:, :1]


# -- of a whole run, or of a mechanism -------------------------------------------------------------


def event_times(motion: Motion, given: Given) -> Array:
    """Return the times at which contacts and limits change state [s]."""
    return np.reshape([event.t for event in _run(motion).contacts.events], (-1, 1))


def last_event(motion: Motion, given: Given) -> Array:
    """Return the time of the last state change [s]."""
    return event_times(motion, given)[-1:]


def frequencies(motion: Motion, given: Given) -> Array:
    """Return the natural frequencies `modes` about the first state [rad/s], ascending."""
    found = linear.frequencies(motion.mechanism, motion.q[0])
    return np.reshape(found[given["modes"]], (-1, 1))


def response(motion: Motion, given: Given) -> Array:
    """Return the acceleration of `point` along `direction` per newton along `force` [1/kg]."""
    mech, place = motion.mechanism, given["point"]
    number = mech.topology.number(given["body"]) - 1
    found = []
    for q in motion.q:
        J = mech.jacobian(q, given["body"], point=place)
        x, R = mech.pose(q, given["body"])
        push = np.zeros((mech.nb, 6))
        push[number, 3:] = given["force"]
        push[number, :3] = np.cross(R @ np.array(place), given["force"])
        still = np.zeros(mech.nv)
        by = mech.forward_dynamics(q, still, external=push) - mech.forward_dynamics(q, still)
        found.append([np.array(given["direction"]) @ (J[3:] @ by)])
    return np.array(found)


KINDS: Mapping[str, Callable[[Motion, Given], Array]] = {
    "q": positions,
    "v": speeds,
    "vdot": accelerations,
    "point": point,
    "point_velocity": point_velocity,
    "direction": direction,
    "rotation": rotation,
    "spin": spin,
    "energy": energy,
    "constraint_force": constraint_force,
    "contact_force": contact_force,
    "limit_torque": limit_torque,
    "drift": drift,
    "event_times": event_times,
    "last_event": last_event,
    "frequencies": frequencies,
    "response": response,
}
VECTORS = ("point", "point_velocity", "direction", "spin", "constraint_force", "contact_force")


def errors(kind: str, found: Array, reference: Array, scale: float) -> Array:
    """Find the largest |found - reference| / max(|reference|, scale) in each row, as an (n,)
    array.

    Points, directions and forces are compared as vectors, and rotations by the angle between them
    [rad].
    """
    apart = found - reference
    if kind == "rotation":
        return 2.0 * np.arcsin(np.minimum(np.linalg.norm(apart, axis=1) / np.sqrt(8.0), 1.0))
    if kind in VECTORS:
        size = np.linalg.norm(reference, axis=1)
        return np.linalg.norm(apart, axis=1) / np.maximum(size, scale)
    return np.max(np.abs(apart) / np.maximum(np.abs(reference), scale), axis=1)


def rotations(reference: Array) -> Array:
    """Return flattened rotation matrices (n, 9), converting from quaternions (n, 4) if
    necessary."""
    if reference.shape[1] == 9:
        return reference
    return np.array([np.ravel(matrix(q)) for q in reference])


def _run(motion: Motion) -> Result:
    assert isinstance(motion, Result)  # a case of states alone has no such kind
    return motion


def _axes(given: Given) -> list[int]:
    return ["xyz".index(axis) for axis in given.get("axes", "xyz")]


def _rows(given: Given) -> list[int]:
    return list(given.get("rows", range(6)))


@dataclass(frozen=True)
class Observable:
    """One observable quantity in a case, with its reference values."""

    kind: str  # a key of `KINDS`
    given: Mapping[str, Any]  # arguments of the kind: a body, a point, ...
    frames: tuple[int, ...] | None  # indices of the compared frames, all if None
    reference: Array  # (n, k)
    scale: float  # below it, errors are absolute [unit of the quantity]
    target: float  # largest error that passes

    @property
    def name(self) -> str:
        """The kind and part, such as "point of tip"."""
        of = [self.given[key] for key in ("body", "constraint", "contact") if key in self.given]
        return " of ".join([self.kind, *of])

    def of(self, motion: Motion) -> Array:
        """Return its values in a run or at given states, as an (n, k) array."""
        found = KINDS[self.kind](motion, self.given)
        return found if self.frames is None else found[list(self.frames)]

    def errors(self, motion: Motion) -> Array:
        """Return the error of each row in the reference (n,), or inf after a failed run's end."""
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
class Case(Suggests):
    """A model with known motion."""

    name: str
    description: str
    why_hard: str
    how_obtained: str  # origin of the reference
    accuracy: float  # estimated, of the reference
    model: Model
    options: Mapping[str, Any]  # arguments of `simulate`: method, rtol or step, t_end, tau, ...
    t: Array | None  # (n,) compared times [s], None if the run chooses them or there is no run
    states: Array | None  # (n, nq) evaluated instead of a run
    observables: tuple[Observable, ...]

    def motion(self, *, progress: Callable[[float], Any] | None = None, **options: Any) -> Motion:
        """Run the case with `options` overriding its own. Return the states if it has no run."""
        mech = Mechanism(self.model)
        if self.states is not None:
            return States(mech, self.states, np.zeros((len(self.states), mech.nv)))
        grid = {} if self.t is None else {"t_end": float(self.t[-1]), "t_eval": self.t}
        return simulate(mech, progress=progress, **{**grid, **self.options, **options})


@explained
@dataclass(frozen=True)
class Verdict(Suggests):
    """The result of a case, with the observable whose error is largest relative to its target."""

    case: Case
    observable: Observable
    error: float
    run: Result | None
    seconds: float = field(default=0.0)  # time of the stepping loop

    @property
    def ok(self) -> bool:
        """True if the run reached the end and the error is within the target."""
        ended = self.run is None or self.run.status.ok
        return ended and self.error <= self.observable.target


@explained
def verify(case: Case, *, progress: Callable[[float], Any] | None = None) -> Verdict:
    """Run a case and compare it with its reference.

    Parameters
    ----------
    case : Case
        A case, for example from `load_cases`.
    progress : callable, optional
        Function that is called with the completed fraction.

    Raises
    ------
    InputError
        If `case` is not a Case.
    """
    if not isinstance(case, Case):
        raise wrong_type("verify", "case", "a pg.Case, for example from pg.load_cases(path)", case)
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
    """Load test cases from a file.

    Parameters
    ----------
    path : path
        A JSON file of cases.

    Raises
    ------
    FileError
        If the file cannot be read.
    ModelError
        If a case is not valid.
    """
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


def _case(data: Mapping[str, Any], entry: Mapping[str, Any], path: Path) -> Case:
    """Parse one entry of `cases`. Omitted fields are taken from the file."""
    options = dict(entry.get("run", {}))
    states = entry.get("states")
    t = _times(data, entry, options) if entry.get("grid", True) and states is None else None
    model = entry["model"]
    variant = entry.get("variant")
    return Case(
        data["name"] if variant is None else f"{data['name']}_{variant}",
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
    """Return the reference times up to the end of the run."""
    t = np.array(entry.get("t", data["t"]), dtype=float)
    t_end = options.get("t_end", t[-1])
    return t[t <= t_end * (1 + 1e-12)]


def _observable(
    data: Mapping[str, Any], seen: Mapping[str, Any], t: Array | None, path: Path
) -> Observable:
    given = dict(seen)
    kind, scale, target = given.pop("kind"), given.pop("scale", 1.0), given.pop("target")
    if kind not in KINDS:
        text = f"no observable is named {kind!r}; choose one of {choices(KINDS, 20)}"
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
    """Return literal numbers, or those at a path such as "100/tip_xy" in the file's reference."""
    if not isinstance(reference, str):
        return reference
    found: Any = data["reference"]
    for key in reference.split("/"):
        found = found[int(key)] if isinstance(found, list) else found[key]
    return found
