"""The packed form of a model with canonical numbers, with all arrays that the kernels require."""

from __future__ import annotations

import math
import struct
from collections.abc import Iterable, Mapping, Sequence
from functools import cached_property
from typing import Any, NamedTuple, TypeAlias

import numpy as np
from numpy.typing import NDArray

from ..engine import layout as at
from ..engine import packing
from ..engine.motions import facts
from ..engine.packing import pack
from ..engine.signals import first_values
from ..engine.tree import bodies
from ..errors import Problem, shown
from ..fields import GROUND
from ..joints import DIRECTED, TRACKED, code_of, slides
from ..model import Body, Force, Model
from ..stateful import Stateful
from ..topology import Topology
from . import Array, Arrays, Drives, Ints, Loads, System, length_in, numbers, quaternions, system
from .constraints import Blocks, blocks
from .forces import NO_LOADS, bends, drives, loads, on_bodies
from .placed import Placed
from .signals import Places, signals

INT, EMPTY = np.dtype(np.int64), np.empty
NOWHERE = np.zeros((0, 3)), np.zeros((0, 3, 3))


class Joint(NamedTuple):
    """The motions of a joint, and the indices of its coordinates in q and v."""

    kinds: tuple[int, ...]  # kinds of its motions, see `engine/layout.py`
    q: slice
    v: slice


class Packed:
    """Packed arrays for a model: tree, forces and constraints. Each array is created on first use.

    The data does not depend on a state or a run and is immutable, apart from caches.
    """

    model: Model
    numbers: Numbers  # the table of bodies
    rows: Ints
    const: Array
    nb: int
    nq: int
    nv: int
    springs: int  # number of springs in joints or between bodies
    # forces last asked for, packed, and when their tables bend
    _driven: tuple[tuple[Force, ...], Drives, Array] | None = None

    def __init__(self, model: Model):
        self.model, self.numbers = model, numbers_of(model)
        self.nb, self.nq = len(model.bodies), sum([len(body.q) for body in model.bodies])
        self._arrays, springs = packed(self.numbers)
        self.rows, self.const = self._arrays[:2]
        self.springs = springs + sum([passive(f) for f in model.forces])
        self.nv = len(self._arrays[-1]) - self.nq

    @property
    def tree(self) -> tuple[Ints, Array]:
        """The rows and constants of the tree, in the form that most kernels take."""
        return self.rows, self.const

    @cached_property
    def system(self) -> System:
        """All body constants by name."""
        return system(self._arrays, self.nq)

    # -- names and numbers -----------------------------------------------------------------------

    @cached_property
    def run(self) -> Packed:
        """The tree of a run, extended by a row, a coordinate and a speed for each control state.

        A state is the speed, and the coordinate its integral.
        """
        count = len(self.model.states)
        if not count:
            return self
        rows, const, bodies_i, bodies_f, home = self._arrays
        n, rows = len(rows), rows.copy()
        rows[:, at.TRACK] += count  # tracks stand behind all motions
        new, k = np.zeros((count, rows.shape[1]), INT), np.arange(count)
        new[:, at.KIND], new[:, at.QI], new[:, at.VI] = at.STATE, self.nq + k, self.nv + k
        own = np.zeros((count, const.shape[1]))
        own[:, at.AXIS + 2] = own[:, at.ARMATURE] = 1.0
        own[:, at.BASE : at.BASE + 9 : 4] = 1.0
        made, none = object.__new__(Packed), np.zeros(count)
        made.model, made.numbers = self.model, self.numbers
        made.nb, made.springs = self.nb, self.springs
        made.nq, made.nv = self.nq + count, self.nv + count
        made.rows, made.const = np.vstack((rows, new)), np.vstack((const[:n], own, const[n:]))
        home = np.concatenate((home[: self.nq], none, home[self.nq :], none))
        made._arrays = made.rows, made.const, bodies_i, bodies_f, home
        return made

    @cached_property
    def _own_signals(self) -> Any:
        """The signals of the controls and muscles without a run."""
        return self.loads((), states=True).signals

    def with_states(self, t: float, q: Array, v: Array, signals: Any = None) -> tuple[Array, Array]:
        """Return q and v at the start time t, followed by the initial states of controls and
        muscles, by the `signals` of a run's loads with its inputs, or those of the model.
        """
        if self.run is self:
            return q, v
        signals = self._own_signals if signals is None else signals
        none = np.zeros(self.run.nv - self.nv)
        q, v = np.append(q[: self.nq], none), np.append(v[: self.nv], none)
        code, states = signals[0].copy(), signals[2]
        first_values(code, states, t, q, v, 0)
        parts = enumerate(self.model.states, start=self.nv)
        resting = [(i, own.at_rest) for i, (_, _, own) in parts if own.at_rest is not None]
        if not resting:
            return q, v
        at_q = Placed(self.model, self.topology, self.system, self.poses(q), q)
        for _ in states:  # fibres, which follow from activations, some of which follow from fibres
            before = v.copy()
            for i, at_rest in resting:
                v[i] = at_rest(at_q, v[i - 1])
            first_values(code, states, t, q, v, 1)
            if np.array_equal(before, v, equal_nan=True):
                break
        return q, v

    @cached_property
    def topology(self) -> Topology:
        """The names and numbers of the bodies."""
        numbers, names = self.system.bodies_i[1:], [body.name for body in self.model.bodies]
        row, parent, dof = (numbers[:, k].copy() for k in (at.TABLE, at.BODY_PARENT, at.DOF))
        row -= 1
        return Topology(tuple([names[i] for i in row.tolist()]), row, parent, dof)

    @cached_property
    def length(self) -> float:
        """The largest length among links, centres of mass and radii of gyration [m]."""
        return length_in(len(self.rows), self.const, self._arrays[4][: self.nq])

    @cached_property
    def joints(self) -> Mapping[str, Joint]:
        """The movable joints, by body name."""
        _, kinds, at_q, at_v, *_ = self.rows[1:].T.tolist()
        at_q.append(self.nq)
        at_v.append(self.nv)
        found: dict[str, Joint] = {}
        row = 0
        own_rows = self.system.bodies_i[1:, at.OWN_ROWS].tolist()
        for name, count in zip(self.topology.names, own_rows):
            end = row + count
            if count:
                spans = slice(at_q[row], at_q[end]), slice(at_v[row], at_v[end])
                found[name] = Joint(tuple(kinds[row:end]), *spans)
            row = end
        return found

    @cached_property
    def by_unit(self) -> tuple[Ints, Ints]:
        """The indices into q of angles [rad] and of lengths [m], outside quaternions."""
        row, places, _ = numbers(self.rows)
        turns = facts("angle")[self.rows[row, at.KIND]]
        return places[turns], places[~turns]

    @cached_property
    def slides(self) -> NDArray[np.bool_]:
        """A mask (nv,) of the velocities that are translations [m/s], not rotations [rad/s]."""
        row, _, of_v = numbers(self.rows)
        found = np.zeros(self.nv, dtype=bool)
        found[of_v[~facts("angle")[self.rows[row, at.KIND]]]] = True
        return found

    @cached_property
    def quaternions(self) -> list[tuple[int, int, int]]:
        """The tuple (row, first index into q, first index into v) for each quaternion."""
        return quaternions(self.rows)

    def body_of(self, row: int) -> str:
        """Return the name of the body whose joint a row belongs to."""
        own = row - len(self.system.body_of_row)
        if own >= 0:
            return self.model.states[own][0].name
        return self.topology.names[self.system.body_of_row[row] - 1]

    def moved_fastest(self, row: int) -> str:
        """Return a sentence about the fastest coordinate, of a body or a control."""
        word = "control" if row >= len(self.system.body_of_row) else "body"
        return f"{word} '{self.body_of(row)}' moved fastest"

    def singular(self, row: int) -> Problem:
        """Return the error for a row whose motion does not move any inertia."""
        body = self.model.body(self.body_of(row))
        number = self.system.body_of_row
        motion = body.sequence[row - int(np.argmax(number == number[row]))]
        kind, axis = motion.kind, shown(motion.axis)
        where, text = f"body '{body.name}'", "so that the mass matrix is singular; give"
        if slides(motion):
            along = f"axis {axis}" if kind in DIRECTED else "track"
            return Problem(where, "mass", f"no mass moves along its {along}, {text} mass")
        about, remedy = f"its axis {axis}", ", armature or a com that is not on the axis"
        if kind not in DIRECTED:
            about, remedy = f"some axis of its {body.joint} joint", " or another joint"
        shape, point = "a shape", ""
        if not any(map(any, body.inertia)):
            point = f": it is a point of {body.mass:g} kg at {shown(body.com)}"
        if body.touching:
            shape = "derived=('mass', 'com', 'inertia') with a density"
            point += " whatever its shapes" * bool(point)
        text = f"there is none about {about}{point}, {text} inertia, {shape}{remedy}"
        return Problem(where, "inertia", text)

    # -- forces and constraints ------------------------------------------------------------------

    def poses(self, q: Array) -> tuple[Array, Array]:
        """Return origins (nb, 3) [m] and rotations (nb, 3, 3) of all body frames in the world."""
        position, rotation = np.empty((self.nb, 3)), np.empty((self.nb, 9))
        work = np.zeros((len(self.rows), at.WORK))
        bodies.poses(*self.system[:4], q, np.zeros(self.nv), work, position, rotation)
        return position, rotation.reshape(self.nb, 3, 3)

    @cached_property
    def home_poses(self) -> tuple[Array, Array]:
        """The poses of all body frames in the initial state."""
        return self.poses(self.system.q)

    @cached_property
    def blocks(self) -> Blocks:
        """The model's constraints, including inactive ones."""
        poses = self.home_poses if self.model.constraints else NOWHERE
        return blocks(self.model, self.topology, self.system, poses)

    @cached_property
    def active(self) -> Ints:
        """The indices of the model's active constraints."""
        return np.array([i for i, c in enumerate(self.model.constraints) if c.active], np.int64)

    @cached_property
    def passive(self) -> Drives:
        """The springs, dampers and friction in the joints and tendons."""
        tendons = tuple(f for f in self.model.forces if passive(f))
        return drives(self.model, self.topology, self.system, tendons)

    def drives(self, forces: tuple[Force, ...]) -> Drives:
        """Return the springs and dampers in the joints, and the given tendons, motors and servos.

        The last answer is kept: runs of one scenario ask again and again.
        """
        kept = self._driven
        if kept is None or kept[0] != forces:
            new = drives(self.model, self.topology, self.system, forces)
            kept = (forces, new, bends(new))
            self._driven = kept
        return kept[1]

    def bends(self, drives: Drives) -> Array:
        """Return the times in ascending order at which the slope in a drive table changes [s]."""
        kept = self._driven
        return kept[2] if kept is not None and kept[1] is drives else bends(drives)

    def bend(self, forces: tuple[Force, ...]) -> bool:
        """Check whether a force, a relation or a track bends where the motion passes."""
        return bool(self.model.bending or self.model.cornered) or any(f._bends for f in forces)

    def loads(
        self, forces: tuple[Force, ...], *, states: bool = False, named: tuple[Force, ...] = (),
        watched: Sequence[str] = (), bent: bool = False, touching: bool = False,
    ) -> Loads:  # fmt: skip
        """Return the given wrenches, springs between bodies, and expressions of all forces.

        If `states` is True, the friction of contacts and the control states are included even if
        they are not used by forces. Expressions may name further drives, `named`. Steps end where
        comparisons in `watched` change, with `bent` where a force or a relation has a bend, and
        with `touching` where soft and penalty contacts touch.
        """
        states = states or any(isinstance(f, Stateful) for f in forces)
        found = NO_LOADS
        if on_bodies(forces):
            found = loads(self.model, self.topology, self.system, forces, self.home_poses)
        rubbing = self.model.rubbing if states else ()
        acts = any(f._varies for f in forces) or rubbing or (states and self.model.stateful)
        bent = bent and self.bend(forces)
        if not (acts or watched or bent or touching):
            return found
        places = self.places(forces)
        given = self.model, forces, self.drives(forces), found
        return found._replace(
            signals=signals(places, *given, named, watched, rubbing, bent, touching)
        )

    def places(self, forces: tuple[Force, ...] = ()) -> Places:
        """Return where signals are, in a run in which these forces act."""
        return Places(self.model, self.topology, self.system, self.placed, forces)

    def placed(self) -> Placed:
        """Return the poses and rows of the bodies."""
        return Placed(self.model, self.topology, self.system, self.home_poses)

    @cached_property
    def passive_loads(self) -> Loads:
        """The springs and torsion springs between bodies, and the drags."""
        return self.loads(tuple(f for f in self.model.forces if passive(f)))


def passive(f: Force) -> bool:
    """Check whether a force acts in every question."""
    return f.PASSIVE and not f._varies


def packed(numbers: Numbers) -> tuple[Arrays, int]:
    """Return the arrays for a table, and the number of its motions with a spring."""
    _, body, motion, start, tracks = numbers
    nb, n = len(body), len(motion) + 1
    rows, const = EMPTY((n, at.ROWS), INT), EMPTY((n + len(tracks), at.CONST))
    home = EMPTY(len(start))
    bodies_i, bodies_f = EMPTY((nb, at.BODIES_I), INT), EMPTY((nb, at.BODY))
    springs = pack(*numbers, rows, const, bodies_i, bodies_f, home)
    return (rows, const, bodies_i, bodies_f, home), springs


# -- the table of bodies ---------------------------------------------------------------------------


# parent (nb,) rows from 1, 0 = ground; body (nb + 1, 18), motion (nm, 11); q and v (nq + nv,);
# tracks (nt, 32)
Numbers: TypeAlias = tuple[Ints, Array, Array, Array, Array]
BODY, MOTION = (
    struct.Struct(f"{n}d").pack for n in (packing.TABLE_BODY.total, packing.TABLE_MOTION.total)
)
# bytes of the body, its motions, q and v, and its track
Record: TypeAlias = tuple[bytes, bytes, bytes, bytes, bytes]


def numbers_of(model: Model) -> Numbers:
    """Return the table for a valid model. Row 0 contains gravity."""
    rows = model.row
    parent = [0 if b.parent == GROUND else rows[b.parent] + 1 for b in model.bodies]
    ground = struct.pack("18d", *model.gravity, *(0.0,) * (packing.TABLE_BODY.total - 3))
    body, motion, q, v, tracks = zip(*map(record_of, model.bodies)) if rows else ((),) * 5
    return (
        np.array(parent, np.int64),
        _floats([ground, *body]).reshape(-1, packing.TABLE_BODY.total),
        _floats(motion).reshape(-1, packing.TABLE_MOTION.total),
        _floats([*q, *v]),
        _floats(tracks).reshape(-1, at.CONST),
    )


def _floats(records: Iterable[bytes]) -> Array:
    """Join records into a newly allocated array that can be passed to kernels."""
    return np.frombuffer(bytearray().join(records))


def record_of(body: Body) -> Record:
    """Return the float64 numbers for a row, cached on the body.

    Body: link 3, rotation 4, mass, com 3, inertia 6 (xx, yy, zz, xy, xz, yz), number of motions. A
    motion: kind, axis (3), armature, stiffness, damping, rest, friction, pitch per radian.
    """
    own = vars(body)
    known = own.get("record")
    return known if known is not None else own.setdefault("record", _record(own))


def _record(b: Mapping[str, Any]) -> Record:
    (xx, xy, xz), (_, yy, yz), (_, _, zz) = b["inertia"]
    motions, q, v = b["motions"], b["q"], b["v"]
    row = BODY(
        *b["link"],
        *_unit(b["rotation"]),
        b["mass"],
        *b["com"],
        xx,
        yy,
        zz,
        xy,
        xz,
        yz,
        len(motions),
    )
    physics = zip(b["armature"], b["stiffness"], b["damping"], b["rest"], b["friction"], b["pitch"])
    moved, curve = b"", b""
    for (kind, axis), (*values, pitch) in zip(motions, physics):
        direction = _unit(axis) if kind in DIRECTED else axis
        track = b["track"] if kind in TRACKED else None
        curve += track.rows.tobytes() if track else b""
        count = len(track.rows) if track else 0
        moved += MOTION(code_of(kind, track), *direction, *values, pitch / math.tau, count)
    return row, moved, struct.pack(f"{len(q)}d", *q), struct.pack(f"{len(v)}d", *v), curve


def _unit(x: tuple[float, ...]) -> tuple[float, ...]:
    norm = math.hypot(*x)
    return tuple(c / norm for c in x) if norm != 1.0 else x
