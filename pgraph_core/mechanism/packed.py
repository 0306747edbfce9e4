"""A model numbered and packed: what a mechanism is made of, before anything is asked of it."""

from __future__ import annotations

from collections.abc import Mapping
from functools import cached_property
from typing import Any, Self

import numpy as np

from ..columns import Columns
from ..constraints.blocks import Blocks, blocks
from ..contact.tables import Tables, tables
from ..engine import layout as at
from ..engine.compiler.jit import ready
from ..engine.packing import numbering
from ..engine.tree import bodies, dynamics
from ..errors import InputError, Problem
from ..loads import TYPES as LOADS
from ..loads import loads
from ..model import Contact, Force, Model
from ..model.force import BETWEEN
from ..plan import Plan
from ..portable import Portable
from ..system import Array, Drives, Ints, Loads, System, bends, drives, packed, system
from ..topology import Topology
from .back_ends import NO_EXTERNAL
from .carrying import Joint, joints_of

NOWHERE = np.zeros((0, 3)), np.zeros((0, 3, 3))
NEW = object.__new__
FORWARD = dynamics.forward_dynamics
OVERFLOW = Problem("dynamics", "", "the result is not finite: the given numbers are too large")
NO_LOADS = Loads(
    np.zeros((0, at.LOAD_I), dtype=np.int64),
    np.zeros((0, at.LOAD_F)),
    np.zeros((0, 7)),
)


class Packed(Portable):
    """A model numbered depth-first and packed for the kernels, edited into new ones.

    Attributes are shared by all that is asked of a mechanism; nothing is kept of a state.
    """

    # forces last asked for, packed, and when their tables bend
    _driven: tuple[tuple[Force, ...], Drives, Array] | None = None

    def __init__(self, model: Model | Columns, /):
        """Number and pack a valid model, or a table in columns."""
        columns = model if isinstance(model, Columns) else Columns.of(model)
        self._pack(columns)

    def _pack(self, columns: Columns) -> None:
        self.columns = columns
        self._packed, springs = packed(columns)
        self._springs = springs + columns.springs_between
        self._rows, self._const, bodies_i, _, home = self._packed
        self.nb, self.nq = len(bodies_i) - 1, columns.nq
        self.nv = len(home) - self.nq
        self._nq, self._nv = (self.nq,), (self.nv,)
        self.rest = np.zeros(self.nv)  # no velocity
        self.work = np.zeros((len(self._rows), at.WORK))  # of kernels: holds nothing between calls
        ready(FORWARD)

    def __getstate__(self) -> Columns:
        return self.columns

    def __setstate__(self, columns: Columns) -> None:
        self._pack(columns)

    @cached_property
    def system(self) -> System:
        """The packed constants."""
        return system(self._packed, self.nq)

    @property
    def tree(self) -> tuple[Ints, Array]:
        """Rows and constants of the tree, as most kernels take them."""
        return self._rows, self._const

    @cached_property
    def model(self) -> Model:
        """The description; of a table in columns it is made when first asked for."""
        return self.columns.model()

    def edit(self, name: str, /, **changes: Any) -> Self:
        """`Mechanism(mech.model.edit(name, **changes))`, at the cost of what changes.

        A new parent, mass, com or link is written into the columns, and nothing else is looked at
        again. Itself where nothing changes. Raises ModelError; this mechanism stays as it is.
        """
        columns = self.columns.edited(name, changes)
        if columns is self.columns:
            return self
        if columns is None:
            return type(self)(self.model.edit(name, **changes))
        return self._repacked(columns)

    def _repacked(self, columns: Columns) -> Self:
        """A mechanism of the same sizes, on the same workspace: it holds nothing between calls."""
        new = NEW(type(self))
        new.columns = columns
        new._packed, springs = arrays, _ = packed(columns)
        new._springs = springs + columns.springs_between
        new._rows, new._const = arrays[0], arrays[1]
        new.nb, new.nq, new.nv = self.nb, self.nq, self.nv
        new._nq, new._nv = self._nq, self._nv
        new.rest, new.work = self.rest, self.work
        return new

    def plan(self, *, scenario: str | None = None, method: str = "auto") -> Plan:
        """What runs of this scene need, what is left out of them, and what that saves."""
        return Plan.of(self.model, scenario=scenario, method=method)

    # -- the digraph ---------------------------------------------------------------------------

    @property
    def names(self) -> tuple[str, ...]:
        """Names of the bodies, by number."""
        return self.topology.names

    @cached_property
    def topology(self) -> Topology:
        """Names and numbers of the bodies."""
        numbers, names = self.system.bodies_i[1:], self.columns.names
        row, parent, dof = (numbers[:, k].copy() for k in (at.TABLE, at.BODY_PARENT, at.DOF))
        row -= 1
        return Topology(tuple([names[i] for i in row.tolist()]), row, parent, dof)

    @property
    def parent(self) -> Ints:
        """(nb,) numbers of the parents, 0 = ground."""
        return self.topology.parent

    @cached_property
    def pgraph(self) -> Ints:
        """The path-defined directed graph vector, Fig. 4."""
        return self._walk[0]

    @cached_property
    def jdof(self) -> Ints:
        """Joint degrees of freedom along Pgraph, Fig. 4."""
        return self._walk[1]

    @cached_property
    def _walk(self) -> tuple[Ints, Ints]:
        path, jdof = np.empty((2, 2 * self.nb + 1), np.int64)
        n = numbering.pgraph(self.system.bodies_i, path, jdof)
        return path[:n].copy(), jdof[:n].copy()

    @property
    def tips(self) -> Ints:
        """Numbers of the tip bodies, ascending."""
        return self.topology.tips

    @property
    def separation_bodies(self) -> Ints:
        """Numbers of the separation bodies, ascending."""
        return self.topology.separation_bodies

    def adjacency(self) -> Any:
        """S, eq. (1): (nb, nb) scipy.sparse."""
        return self.topology.adjacency()

    # -- home and places ---------------------------------------------------------------------

    def home(self) -> tuple[Array, Array]:
        """(q, v): the model's initial state."""
        return self.system.q.copy(), self.system.v.copy()

    def poses(self, q: Array) -> tuple[Array, Array]:
        """((nb, 3) origins [m], (nb, 3, 3) rotations) of all body frames in the world."""
        position, rotation = np.empty((self.nb, 3)), np.empty((self.nb, 9))
        q = self.position(q)
        bodies.poses(*self.system[:4], q, self.rest, self.work, position, rotation)
        return position, rotation.reshape(self.nb, 3, 3)

    # -- what acts -----------------------------------------------------------------------------

    @cached_property
    def joints(self) -> Mapping[str, Joint]:
        """The joints that move: their motions, and where they stand in q and v, by body."""
        return joints_of(self.names, self.system, self.nq, self.nv)

    @cached_property
    def blocks(self) -> Blocks:
        """The model's constraints, active or not, as the kernels take them."""
        poses = self.poses(self.system.q) if self.model.constraints else NOWHERE
        return blocks(self.model, self.topology, self.system, poses)

    @cached_property
    def active(self) -> Ints:
        """Indices of the model's active constraints."""
        return np.array([i for i, c in enumerate(self.model.constraints) if c.active], np.int64)

    @cached_property
    def passive(self) -> Drives:
        """Springs and dampers of the joints."""
        return drives(self.model, self.topology, self.system, ())

    def drives(self, forces: tuple[Force, ...]) -> Drives:
        """Springs and dampers of the joints, and the given motors and servos.

        The last answer is kept: runs of one scenario ask again and again.
        """
        kept = self._driven
        if kept is None or kept[0] != forces:
            new = drives(self.model, self.topology, self.system, forces)
            kept = (forces, new, bends(new))
            self._driven = kept
        return kept[1]

    def bends(self, drives: Drives) -> Array:
        """Ascending times at which tables of these drives bend; kept as they are."""
        kept = self._driven
        return kept[2] if kept is not None and kept[1] is drives else bends(drives)

    def loads(self, forces: tuple[Force, ...]) -> Loads:
        """The given wrenches and springs between bodies."""
        if not any(force.kind in LOADS for force in forces):
            return NO_LOADS
        return loads(self.model, self.topology, self.system, forces, self.poses(self.system.q))

    @cached_property
    def passive_loads(self) -> Loads:
        """Springs and torsion springs between bodies."""
        return self.loads(tuple(f for f in self.model.forces if f.kind in BETWEEN))

    def contacts(self, active: tuple[Contact, ...]) -> Tables | None:
        """What these contacts and the joints' limits make touch; None where nothing does."""
        if not active and not any(any(b.limits) for b in self.model.bodies):
            return None
        return tables(self, active)

    # -- checking what is given ----------------------------------------------------------------

    def check(self, name: str, value: Any, *shape: int) -> Array:
        """An argument as the contiguous float64 array the kernels take. Raises InputError."""
        if type(value) is np.ndarray and value.dtype == np.float64 and value.shape == shape:
            flags = value.flags
            if flags.c_contiguous and flags.writeable:
                return value
        try:
            array = np.asarray(value)
            if array.dtype.kind not in "fiu" and array.size:
                raise TypeError
            array = np.array(array, dtype=np.float64, order="C")
        except (TypeError, ValueError):
            raise InputError(Problem(name, "", f"must be numbers; given {value!r:.60}")) from None
        if array.shape != shape:
            text = f"must have shape {shape}; given {array.shape}"
            raise InputError(Problem(name, "", text))
        return array

    @cached_property
    def _quaternion_rows(self) -> list[int]:
        return np.flatnonzero(self._rows[:, at.KIND] >= at.BALL).tolist()

    def position(self, q: Any) -> Array:
        """q, finite and with quaternions that have a direction; their length does not count.

        Raises InputError.
        """
        q = self.finite("q", q, self.nq)
        for k in self._quaternion_rows:
            i = self._rows[k, at.QI] + (3 if self._rows[k, at.KIND] == at.FREE else 0)
            length = float(np.linalg.norm(q[i : i + 4]))
            if not 1e-3 < length < 1e3:
                text = f"the quaternion [w, x, y, z] of '{self.body_of(k)}' at q[{i}] must have "
                raise InputError(Problem("q", "", f"{text}length 1; its length is {length:.6g}"))
        return q

    def finite(self, name: str, value: Any, *shape: int) -> Array:
        """As `check`, and every number finite. (Dynamics look only where a result is not.)"""
        array = self.check(name, value, *shape)
        bad = np.flatnonzero(~np.isfinite(array))
        if len(bad):
            text = f"must be finite; entry {bad[0]} is {array.flat[bad[0]]}"
            raise InputError(Problem(name, "", text))
        return array

    def singular(self, row: int) -> Problem:
        """What to say of a row whose motion sees no inertia."""
        name = self.names[self.system.body_of_row[row] - 1]
        text = (
            "its joint moves nothing that has inertia about it; give it mass, inertia or armature"
        )
        return Problem(f"body '{name}'", "inertia", text)

    def row_of_velocity(self, index: int) -> int:
        """Row whose motion has v[index]."""
        return int(np.searchsorted(self.system.rows[1:, at.VI], index, side="right"))

    def body_of(self, row: int) -> str:
        """Name of the body whose joint a row belongs to."""
        return self.names[self.system.body_of_row[row] - 1]

    def _state(self, q: Array, v: Array) -> tuple[Array, Array]:
        return self.check("q", q, self.nq), self.check("v", v, self.nv)

    def _external(self, external: Array | None) -> Array:
        return NO_EXTERNAL if external is None else self.check("external", external, self.nb, 6)

    def _explain(self, code: int, **given: Array) -> None:
        """Raise what a kernel's status code means."""
        for name, value in given.items():
            self.finite(name, value, *value.shape)
        self.position(given["q"])
        raise InputError(self.singular(code) if code > 0 else OVERFLOW)
