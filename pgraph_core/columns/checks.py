"""Columns as the kernel takes them, and the messages for those that it refuses."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any, TypeAlias

import numpy as np
from numpy.typing import NDArray

from .. import joints
from ..engine import packing
from ..errors import ModelError, Problem, choices, shown
from ..fields import GROUND, name_problem
from ..given import array_of
from ..joints import JointKind, Motion, MotionKind
from ..model import Body
from ..model.checks import tree_problems

Array: TypeAlias = NDArray[np.float64]
Ints: TypeAlias = NDArray[np.int64]

JOINTS: tuple[JointKind, ...] = tuple(joints.DEFAULT)  # kinds by the numbers of `joint`
MOTIONS: tuple[MotionKind, ...] = ("rotate", "translate", "ball", "free")  # ... and of `motion`
PHYSICS = ("armature", "stiffness", "damping", "rest", "friction")
# as `engine/packing.py` numbers what is wrong
COLUMNS = ("parent", "joint", "motion", "axis", "link", "rotation", "mass", "com", "inertia")
COLUMNS += (*PHYSICS, "q", "v", "gravity")
# the arguments of `gather`, and the shape of an entry where they are float64
GIVEN = ("parent", "joint", "motion_of", "motion", "axis", "link", "rotation", "mass", "com")
GIVEN += ("inertia", "physics", "q", "v", "gravity", "kinds")
ENTRY = {"axis": (3,), "link": (3,), "rotation": (4,), "mass": (), "com": (3,), "inertia": (3, 3)}
MOST_VALUES = 100_000_000  # limit on the values of a column, nearly a gigabyte
INT = np.dtype(np.int64)  # compared by `is`, in a third of the time of ==


def refused(column: str, text: str, where: str = "columns") -> ModelError:
    """Return the error of a column as a whole, or of one row."""
    return ModelError(Problem(where, column, text))


def ints(column: str, value: Any) -> Ints:
    """A column of whole numbers. Raises ModelError."""
    if type(value) is np.ndarray and value.dtype is INT and value.ndim == 1:
        return value if value.flags.carray else value.copy()
    array = _array(value)
    if array.ndim != 1 or (len(array) and array.dtype.kind not in "iu"):
        raise refused(column, f"must be a list of whole numbers; given {shown(value)}")
    return array.astype(np.int64)


def _array(value: Any) -> Any:
    """Return an array, without a shape for lists of unequal length or too deep nesting."""
    try:
        return array_of(value)
    except (TypeError, ValueError):
        return np.asarray(None)


def codes(column: str, value: Any, names: Sequence[str]) -> Ints:
    """Return names as indices in `names`. One name stands for all. Raises ModelError."""
    if type(value) is np.ndarray and value.dtype is INT:
        return ints(column, value)
    given = np.atleast_1d(_array(value))
    if given.dtype.kind != "U":
        return ints(column, given)
    known = np.array(names)
    order = np.argsort(known)
    place = order[np.searchsorted(known, given, sorter=order).clip(max=len(known) - 1)]
    unknown = np.flatnonzero(known[place] != given)
    if len(unknown):
        text = f"must be one of {choices(names)}; given {shown(str(given[unknown[0]]))}"
        raise refused(column, text, f"row {unknown[0] + 1}" if given.ndim == 1 else "columns")
    return place.astype(np.int64)


def physics(given: Sequence[Any], nm: int) -> Array:
    """Armature, stiffness, damping, rest and friction as one array (nm, 5)."""
    table = np.zeros((nm, len(PHYSICS)))
    for column, name, value in zip(table.T, PHYSICS, given):
        if value is not None:
            array = floats(name, value, ())
            if len(array) not in (1, nm):
                raise refused(name, _length(array, nm, "motion"))
            column[:] = array
    return table


def floats(column: str, value: Any, entry: tuple[int, ...]) -> Array:
    """Return a column of numbers (n, *entry), also of a single entry. Raises ModelError."""
    try:
        array = array_of(value)
        if array.dtype.kind not in "fiu" and array.size:
            raise TypeError
        if array.size > MOST_VALUES:
            raise refused(column, f"has {array.size} values; {MOST_VALUES} at most")
        array = np.array(array, dtype=np.float64, order="C")
    except (TypeError, ValueError):
        raise refused(column, f"must be numbers; given {shown(value)}") from None
    if array.shape == entry:
        array = array[None]
    if array.shape[1:] != entry and array.size:
        text = f"must have entries of shape {entry}; given an array of shape {array.shape}"
        raise refused(column, text if entry else f"must be a list of numbers; given {shown(value)}")
    return array.reshape(-1, *entry)


def converted(given: Sequence[Any]) -> tuple[Any, ...]:
    """The arguments of `gather` as it takes them. Raises ModelError."""
    return tuple(
        value
        if type(value) is np.ndarray and name not in ENTRY and name not in ("q", "v", "gravity")
        else floats(name, value, ENTRY.get(name, ()))
        for name, value in zip(GIVEN, given)
    )


def names(given: Sequence[str], nb: int) -> tuple[str, ...]:
    """A name a row, each once. Raises ModelError."""
    try:
        found = tuple(given)
        joined = "".join(found)
    except TypeError:
        raise refused("names", f"must be a list of texts; given {shown(given)}") from None
    if len(found) != nb:
        raise refused("names", f"must be {nb}, one a body; given {len(found)}")
    once = set(found)
    if len(once) < nb or "" in once or GROUND in once or " " in joined or not joined.isprintable():
        problems = tree_problems(found, [GROUND] * nb)
        for i, name in enumerate(found, start=1):
            text = "'ground' is the name of the ground; choose another" if name == GROUND else ""
            if text := text or name_problem(name):
                problems.append(Problem(f"row {i}", "name", text))
        if problems:
            raise ModelError(problems)
    return found


def refuse_cycles(parent: Ints) -> None:
    """Raise ModelError where some row's path does not lead to the ground."""
    rows = list(map(str, range(1, len(parent) + 1)))
    label = [GROUND, *rows]
    problems = tree_problems(rows, [label[p] for p in parent.tolist()])
    if problems:
        raise ModelError(
            Problem(p.where.replace("body", "row").replace("'", ""), "parent", p.text)
            for p in problems
        )


def refusal(wrong: int, row: int, given: Sequence[Any], sizes: tuple[int, ...]) -> ModelError:
    """Return the kernel's finding as a sentence that names row and column."""
    column = COLUMNS[wrong]
    columns: dict[str, Any] = dict(zip(GIVEN, given))
    if row < 0:
        return refused(column, _shape(column, columns, sizes))
    where = f"row {row}"
    if wrong == packing.NO_PARENT:
        text = f"must be a row from 1 to {sizes[0]}, or 0 for the ground"
        return refused(column, f"{text}; given {columns['parent'][row - 1]}", where)
    if wrong == packing.NO_JOINT:
        code = columns["joint"][_one(columns["joint"], row - 1)]
        text = f"must be one of {choices(JOINTS)}, or a place in this list from 0; given {code}"
        return refused(column, text, where)
    if row == 0:
        return refused("motion_of", f"must ascend within the rows 1 to {sizes[0]}")
    try:
        Body(**_fields(columns, row))
    except ModelError as error:
        return ModelError(Problem(where, p.field, p.text) for p in error.problems)
    return refused(column, "cannot be used", where)


def _shape(column: str, columns: dict[str, Any], sizes: tuple[int, ...]) -> str:
    nb, nm, nq, nv = sizes
    array = columns.get(column, columns["physics"])
    match column:
        case "motion":
            return f"must be as long as motion_of; given {len(array)}"
        case "gravity":
            return f"must be three finite numbers [x, y, z] [m/s^2]; given {shown(array)}"
        case "q" | "v":
            n = nq if column == "q" else nv
            return f"must have {n} numbers, those of all joints; given {len(array)}"
    entry = ENTRY.get(column, ())
    if array.shape[1:] != entry and column not in PHYSICS:
        return f"must have entries of shape {entry}; given an array of shape {array.shape}"
    motions = column == "axis" or column in PHYSICS
    return _length(array, nm if motions else nb, "motion" if motions else "body")


def _length(array: Array, n: int, of: str) -> str:
    return f"must have {n} entries, one a {of}, or one for all; given {len(array)}"


def _one(array: Array, i: int) -> int:
    return i if len(array) > 1 else 0


def _fields(columns: dict[str, Any], row: int) -> dict[str, Any]:
    """The fields of one row as a Body takes them."""
    begin, first_q, first_v = 0, 0, 0
    motions: tuple[Motion, ...] = ()
    for i in range(1, row + 1):
        begin += len(motions)
        first_q, first_v = first_q + joints.nq(motions), first_v + joints.nv(motions)
        motions = _motions(columns, i)
    chosen = range(begin, begin + len(motions))
    if len(columns["axis"]):
        axis = columns["axis"].tolist()
        motions = tuple(
            Motion(m.kind, axis[_one(axis, k)]) if m.kind in ("rotate", "translate") else m
            for m, k in zip(motions, chosen)
        )
    fields = {name: columns[name][_one(columns[name], row - 1)].tolist() for name in BODY_FIELDS}
    table = columns["physics"]
    for j, name in enumerate(PHYSICS):
        fields[name] = [float(table[_one(table, k), j]) for k in chosen]
    for name, first, n in (("q", first_q, joints.nq(motions)), ("v", first_v, joints.nv(motions))):
        if len(columns[name]):
            fields[name] = columns[name][first : first + n].tolist()
    joint = "compound" if len(columns["motion"]) else joint_of(motions)
    return {"name": str(row), "joint": joint, "motions": motions, **fields}


BODY_FIELDS = ("link", "rotation", "mass", "com", "inertia")


def _motions(columns: dict[str, Any], row: int) -> tuple[Motion, ...]:
    """Motions of a row, with the axes of its kind of joint."""
    if len(columns["motion"]):
        chosen = columns["motion"][columns["motion_of"] == row].tolist()
        return tuple(Motion(MOTIONS[k], joints.Z) for k in chosen)
    joint = columns["joint"]
    return joints.DEFAULT[JOINTS[joint[_one(joint, row - 1)]]]


def joint_of(motions: Sequence[Motion]) -> JointKind:
    """The kind of joint that has these kinds of motion."""
    return KIND_OF.get(tuple(m.kind for m in motions), "compound")


KIND_OF: dict[tuple[str, ...], JointKind] = {
    tuple(m.kind for m in motions): kind for kind, motions in joints.DEFAULT.items()
}


def _kinds() -> Array:
    """Motions of every kind of joint, as `engine/packing.py` takes them."""
    table = np.zeros((len(JOINTS), 1 + 3 * packing.STRIDE))
    for row, kind in zip(table, JOINTS):
        row[packing.COUNT] = len(joints.DEFAULT[kind])
        for n, (motion, axis) in enumerate(joints.DEFAULT[kind]):
            row[1 + n * packing.STRIDE :][: packing.STRIDE] = MOTIONS.index(motion), *axis
    return table


KINDS = _kinds()
