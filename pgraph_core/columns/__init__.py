"""Columns: a table of bodies as NumPy columns, checked and packed without a loop over its rows."""

from __future__ import annotations

import struct
from collections.abc import Mapping, Sequence
from functools import cached_property
from typing import Any, TypeAlias

import numpy as np

from .. import joints
from ..engine import packing
from ..engine.compiler.jit import JIT, ready
from ..errors import explained
from ..fields import GROUND
from ..joints import Motion
from ..model import Body, Model
from ..model.editing import edited
from ..model.world import DOWN
from ..portable import Portable
from .checks import (
    INT,
    JOINTS,
    KINDS,
    MOTIONS,
    PHYSICS,
    Array,
    Ints,
    codes,
    converted,
    ints,
    joint_of,
    physics,
    refusal,
    refuse_cycles,
)
from .checks import names as names_of

EDITS = 64  # edits that are kept one by one

NO_INTS, NO_FLOATS, NO_AXES = np.empty(0, INT), np.empty(0), np.empty((0, 3))
ORIGIN, IDENTITY = np.zeros((1, 3)), np.array([[1.0, 0.0, 0.0, 0.0]])
ONE, SMALL, PASSIVE = np.ones(1), 0.01 * np.eye(3)[None], np.zeros((1, len(PHYSICS)))
GRAVITY = np.array(DOWN["z"])
REVOLUTE = np.array([JOINTS.index("revolute")])
NEW = object.__new__


@explained
class Columns(Portable):
    """A table of nb bodies in columns, with the meaning and the defaults of a `Body`'s fields.

    `parent` (nb,) holds rows of the table from 1, 0 = ground. The columns of bodies are `joint`
    (names, or their places in `JOINTS`), `link` (nb, 3), `rotation` (nb, 4), `mass`
    (nb,), `com` (nb, 3), `inertia` (nb, 3, 3). Those of motions, one after the other in the order
    of the table, are `axis` (nm, 3), `armature`, `stiffness`, `damping`, `rest`, `friction`
    (nm,). One entry stands for all. `motion` (nm,) (of `MOTIONS`) with
    `motion_of` (nm,), the row of each, says what the joints are made of, in place of `joint`.
    `q` (nq,) and `v` (nv,) are the initial state. All of it is checked and copied at once.

    Raises ModelError naming row and column.
    """

    JOINTS = JOINTS  # kinds of joint, in the order of their numbers
    MOTIONS = MOTIONS  # kinds of motion
    _model: Model | None = None  # the description, once it is known

    def __init__(
        self,
        parent: Any,
        *,
        joint: Any = None,
        motion: Any = None,
        motion_of: Any = None,
        axis: Any = None,
        link: Any = None,
        rotation: Any = None,
        mass: Any = None,
        com: Any = None,
        inertia: Any = None,
        armature: Any = None,
        stiffness: Any = None,
        damping: Any = None,
        rest: Any = None,
        friction: Any = None,
        q: Any = None,
        v: Any = None,
        names: Sequence[str] | None = None,
        gravity: Any = None,
    ):
        """Every column but `parent` has a default."""
        parent = ints("parent", parent)
        nb = len(parent)
        kinds = REVOLUTE if joint is None else codes("joint", joint, JOINTS)
        moves = NO_INTS if motion is None else codes("motion", motion, MOTIONS)
        bare = armature is stiffness is damping is rest is friction is None
        nm, nq, nv = packing.sizes(nb, kinds, moves, KINDS)
        given = (
            parent,
            kinds,
            NO_INTS if motion is None else ints("motion_of", motion_of),
            moves,
            NO_AXES if axis is None else axis,
            ORIGIN if link is None else link,
            IDENTITY if rotation is None else rotation,
            ONE if mass is None else mass,
            ORIGIN if com is None else com,
            SMALL if inertia is None else inertia,
            PASSIVE if bare else physics((armature, stiffness, damping, rest, friction), nm),
            NO_FLOATS if q is None else q,
            NO_FLOATS if v is None else v,
            GRAVITY if gravity is None else gravity,
            KINDS,
        )
        empty = np.empty
        self.numbers: Numbers = (
            empty(nb, INT),
            empty((nb + 1, packing.TABLE_BODY)),
            empty((nm, packing.TABLE_MOTION)),
            empty(nq + nv),
        )
        self._nq = nq
        self._keep(None if names is None else names_of(names, nb), None)
        check = ready(packing.gather)
        if not (JIT and all(type(x) is np.ndarray for x in given)):  # numba follows lists that
            given = converted(given)  # hold themselves. Uncompiled code accepts any type
        try:
            wrong, row, above = check(*given, nq, *self.numbers)
        except TypeError:  # lists, single numbers, other types: looked at one by one
            given = converted(given)
            wrong, row, above = check(*given, nq, *self.numbers)
        if wrong != packing.FINE:
            raise refusal(wrong, row, given, (nb, nm, nq, nv))
        if not above:
            refuse_cycles(parent)

    @classmethod
    def of(cls, model: Model, /) -> Columns:
        """Return the columns of a model. `model()` returns the model with all its other parts."""
        columns = cls.__new__(cls)
        columns.numbers, columns._nq = numbers_of(model)
        columns._keep(None, model)
        return columns

    def _keep(self, names: tuple[str, ...] | None, model: Model | None) -> None:
        """Keep the sources of names and description for later use."""
        self._given, self._model = names, model
        self._root: Columns = self  # start of the edits
        self._before: Columns = self  # table before the last edit, and its change
        self._change: Mapping[str, Mapping[str, Any]] = {}
        self._depth = 0  # number of edits since the root

    def __getstate__(self) -> Any:
        if self is not self._root:
            self.model()  # an edited table stands alone once its description is made
        return self.numbers, self._nq, self._given, self._model

    def __setstate__(self, state: Any) -> None:
        self.numbers, self._nq, names, model = state
        self._keep(names, model)

    # -- reading -------------------------------------------------------------------------------

    @property
    def names(self) -> tuple[str, ...]:
        """Names of the rows, by default "1", "2", ..."""
        return self._root._names

    @property
    def row(self) -> Mapping[str, int]:
        """Row of the table by name, from 1, with 0 for 'ground'."""
        return self._root._row

    @property
    def nq(self) -> int:
        """Number of position coordinates."""
        return self._root._nq

    @property
    def springs_between(self) -> int:
        """Number of springs and torsion springs between bodies, which edits here do not change."""
        model = self._root._model
        return 0 if model is None else sum([f.PASSIVE for f in model.forces])

    @property
    def bound(self) -> bool:
        """True if a constraint is active, which edits here do not change."""
        model = self._root._model
        return model is not None and any(c.active for c in model.constraints)

    @cached_property
    def _derived(self) -> frozenset[int]:
        """Rows of bodies with numbers that follow from their shapes."""
        bodies = self._model.bodies if self._model else ()
        return frozenset(row for row, body in enumerate(bodies, start=1) if body.derived)

    @cached_property
    def _names(self) -> tuple[str, ...]:
        if self._given is not None:
            return self._given
        if self._model is not None:
            return tuple([b.name for b in self._model.bodies])
        return tuple(map(str, range(1, len(self.numbers[0]) + 1)))

    @cached_property
    def _row(self) -> Mapping[str, int]:
        return {GROUND: 0, **{name: i for i, name in enumerate(self._names, start=1)}}

    def model(self) -> Model:
        """The description in rows, made when first asked for."""
        if self._model is None:
            if self is self._root:
                model = described(self.names, self.numbers, self.nq)
            else:
                base, changes = self._since()
                model = with_fields(base.model(), changes)
            names, self._nq = self.names, self.nq
            self._keep(names, model)
        assert self._model is not None
        return self._model

    def _since(self) -> tuple[Columns, dict[str, dict[str, Any]]]:
        """The last columns whose description is known, or the root, and all edited since."""
        columns, changes = self, []
        while columns._model is None and columns is not columns._root:
            changes.append(columns._change)
            columns = columns._before
        merged: dict[str, dict[str, Any]] = {}
        for change in reversed(changes):
            for name, fields in change.items():
                merged.setdefault(name, {}).update(fields)
        return columns, merged

    # -- editing -------------------------------------------------------------------------------

    def _edited(self, name: str, changes: Mapping[str, Any]) -> Columns | None:
        """Return the table with a new parent, mass, com or link, or itself without a change.

        Returns None if the description must check the edit: other fields, or possible mistakes.
        Cycles are found when the new table is numbered.
        """
        root, (parent, body, motion, start) = self._root, self.numbers
        rows = root._row
        row = rows.get(name)
        if not row or row in root._derived:
            return None
        for field, value in changes.items():
            if field == "parent":
                to = rows.get(value) if isinstance(value, str) else None
                if to is None:
                    return None
                if parent.item(row - 1) != to:
                    parent = parent.copy()
                    parent[row - 1] = to
            elif field not in DIRECT or (body := written(body, row, field, value)) is None:
                return None
        if parent is self.numbers[0] and body is self.numbers[1]:
            return self
        columns = NEW(Columns)
        columns.numbers = (parent, body, motion, start)
        columns._root = root
        columns._before, columns._change, columns._depth = self, {name: changes}, self._depth + 1
        if columns._depth == EDITS:
            columns._shorten()
        return columns

    def _shorten(self) -> None:
        """The edits since as one, so that no chain of them grows."""
        self._before, self._change = self._since()
        self._depth = 1


# fields that an edit writes
DIRECT = {"mass": packing.MASS, "com": packing.COM, "link": packing.LINK}


def written(body: Array, row: int, field: str, value: Any) -> Array | None:
    """`body` with a plain finite value in a field of a row, or None."""
    numbers = (value,) if field == "mass" else value
    if type(numbers) is not tuple or len(numbers) != (1 if field == "mass" else 3):
        return None
    for x in numbers:
        if type(x) not in (float, int) or not -np.inf < x < np.inf:
            return None
    if field == "mass" and numbers[0] < 0:
        return None
    given = body
    for column, x in enumerate(numbers, DIRECT[field]):  # one by one: faster than by slices
        if body.item(row, column) != x:
            body = body.copy() if body is given else body
            body[row, column] = x
    return body


# parent (nb,) rows from 1, 0 = ground; body (nb + 1, 18) and motion (nm, 9), whose columns are in
# `engine/packing.py`; q and v in one array (nq + nv,): all in the order of the table
Numbers: TypeAlias = tuple[Ints, Array, Array, Array]


def numbers_of(model: Model) -> tuple[Numbers, int]:
    """(numbers of a model's bodies, nq)."""
    bodies, rows = model.bodies, model.row
    parent = [0 if b.parent == GROUND else rows[b.parent] + 1 for b in bodies]
    records = [b.records for b in bodies]
    numbers = (
        np.array(parent, INT),
        _floats([_ground(model), *[r[0] for r in records]]).reshape(-1, packing.TABLE_BODY),
        _floats([r[1] for r in records]).reshape(-1, packing.TABLE_MOTION),
        _floats([*[r[2] for r in records], *[r[3] for r in records]]),
    )
    return numbers, sum([len(r[2]) for r in records]) // 8


def _ground(model: Model) -> bytes:
    """Row 0 of the table's bodies."""
    return struct.pack(f"{packing.TABLE_BODY}d", *model.gravity, *(0.0,) * (packing.TABLE_BODY - 3))


def _floats(records: list[bytes]) -> Array:
    """Records joined into an array of our own, which kernels may take."""
    return np.frombuffer(bytearray().join(records))


def with_fields(model: Model, changes: Mapping[str, Mapping[str, Any]]) -> Model:
    """Return the model after all edits, valid as a whole. Raises ModelError."""
    bodies = list(model.bodies)
    for name, fields in changes.items():
        bodies[model.row[name]], _ = edited(model.body(name), fields)
    return model if bodies == list(model.bodies) else model.replace(bodies=tuple(bodies))


def described(names: tuple[str, ...], numbers: Numbers, nq: int) -> Model:
    """A model with these rows, whose numbers have been checked."""
    parent, body, motion, start = (x.tolist() for x in numbers)
    label = (GROUND, *names)
    bodies: list[Body] = []
    m = qi = 0
    vi = nq
    for name, p, row in zip(names, parent, body[1:]):
        count = int(row[packing.MOTIONS])
        mine = motion[m : m + count]
        motions = tuple(Motion(MOTIONS[int(x[0])], tuple(x[1:4])) for x in mine)
        q_end, v_end = qi + joints.nq(motions), vi + joints.nv(motions)
        xx, yy, zz, xy, xz, yz = row[packing.INERTIA : packing.INERTIA + 6]
        fields: dict[str, Any] = {
            "name": name,
            "parent": label[p],
            "joint": joint_of(motions),
            "axes": tuple([m.axis for m in motions if m.kind in ("rotate", "translate")]),
            "motions": motions,
            "link": tuple(row[packing.LINK : packing.LINK + 3]),
            "rotation": tuple(row[packing.ROTATION : packing.ROTATION + 4]),
            "mass": row[packing.MASS],
            "com": tuple(row[packing.COM : packing.COM + 3]),
            "inertia": ((xx, xy, xz), (xy, yy, yz), (xz, yz, zz)),
            "q": tuple(start[qi:q_end]),
            "v": tuple(start[vi:v_end]),
        }
        for column, field in enumerate(PHYSICS, start=packing.ARMATURE):
            fields[field] = tuple([x[column] for x in mine])
        fields["limit_restitution"] = (0.0,) * count
        bodies.append(Body.unchecked(**fields))
        m, qi, vi = m + count, q_end, v_end
    return Model(name="columns", gravity=tuple(body[0][:3]), bodies=tuple(bodies))
