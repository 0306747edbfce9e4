"""Constraints as blocks of kernel rows, with the columns defined in `engine/layout.py`.

`Endpoints` contains the points and directions of one constraint in the axes of its two bodies. The
class of each kind makes blocks of them. `blocks` packs all constraints of a model.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from functools import partial
from itertools import accumulate
from typing import Any, NamedTuple

import numpy as np

from ..curves import Polynomial
from ..engine import layout as at
from ..engine.records import joined, table
from ..errors import ModelError, Problem
from ..forces import VIA
from ..functions import Curve, Function, Pieces
from ..model import Constraint, Model, Rolling, Sine, Table
from ..model.constraint import AtPoints
from ..pulleys import Pulley
from ..rotation import normals_of, unit_vector
from ..tolerances import EPS, TOUCHING
from ..topology import Topology
from ..tracks import Track
from . import Array, Ints, System, home_of, joint_coordinates, point_in_row, row_of_velocity
from .cables import Segment, one_length, segments
from .forces import terms_of
from .pieces import pieces
from .placed import Placed
from .programs import of_coordinate, of_time

GRAIN = EPS**0.5  # grain of a way over its length, which two steps of Newton's method make exact

Term = tuple[int, int, float]  # index into v, into q or -1, coefficient


class Block(NamedTuple):
    """A block of up to three rows of the same type."""

    type: int
    rows: int
    values: Array  # (28,)
    terms: tuple[Term, ...] = ()
    curve: tuple[tuple[float, ...], ...] = ()
    knots: int | None = None  # B_KNOTS, None: the rows of the curve
    ends: tuple[int, int] = (0, 0)  # rows of the bodies, or (that of the first term, 0)
    bodies: tuple[int, int] | None = None  # bodies of a span, in place of a curve
    stations: Any = None  # records VIA of a segment of a cable, in place of a curve
    chain: int = 0  # number of blocks before it in a chain of a cable


class Endpoints:
    """The endpoints of a constraint, as points and directions in body axes."""

    def __init__(
        self,
        c: Constraint,
        model: Model,
        topology: Topology,
        packed: System,
        home: tuple[Array, Array],
        size: float,
    ):
        self.c, self.model, self.packed, self.size, self.poses = c, model, packed, size, home
        self.topology = topology
        self.a, self.b = map(topology.number, c.pair)
        self.position_a, self.rotation_a = _pose(home, self.a)
        self.position_b, self.rotation_b = _pose(home, self.b)
        self.turn = self.rotation_b.T @ self.rotation_a  # from the axes of a to those of b
        self.point = np.array(model.point_of(c))
        self.other_point = self._other_point()

    def _other_point(self) -> Array:
        if isinstance(self.c, AtPoints) and self.c.other_point is not None:
            return np.array(self.c.other_point)
        if isinstance(self.c, Rolling):
            return np.zeros(3)
        world = self.position_a + self.rotation_a @ self.point
        return self.rotation_b.T @ (world - self.position_b)

    def directions(self) -> tuple[Array, Array]:
        """Return (axis, other_axis) as unit vectors in body axes, coinciding at home by default."""
        c: Any = self.c  # one along axes
        axis, other = c.axis, c.other_axis
        if axis is not None and other is not None:
            return unit_vector(axis), unit_vector(other)
        if axis is None and other is not None:
            return self.turn.T @ unit_vector(other), unit_vector(other)
        along = unit_vector(axis or (0.0, 0.0, 1.0))
        return along, self.turn @ along

    def values(
        self, value: float = 0.0, dirs: Sequence[Array] = (), aims: Sequence[Array] = ()
    ) -> Array:
        """Return the (28,) values of a block from points and from directions in body axes."""
        points = (self.a, self.point), (self.b, self.other_point)
        own, other = (point_in_row(self.packed, *point) for point in points)
        out = block_values({at.PA: own, at.PB: other, at.VALUE: value})
        for column, number, vectors in ((at.DIR, self.b, dirs), (at.AIM, self.a, aims)):
            home = home_of(self.packed, number)
            for r, vector in enumerate(vectors):
                out[column + 3 * r : column + 3 * r + 3] = home @ vector
        return out

    def scaled(self, offset: float = 0.0) -> Array:
        """Return the (28,) values of a coordinate row, with a scale of rounding for points."""
        return block_values({at.PA: self.size, at.VALUE: offset})

    # -- blocks --------------------------------------------------------------------------------

    def pinned(self) -> Block:
        """Create a block that fixes the point in all directions."""
        return Block(at.T_PIN, 3, self.values())

    def held(self, dirs: Sequence[Array]) -> Block:
        """Create a block that fixes the point along directions in the axes of b."""
        return Block(at.T_POINT, len(dirs), self.values(dirs=dirs))

    def turned_as_at_home(self) -> Block:
        """Create a block against rotation. Row r, a_s · b_t = 0, (r, s, t) cyclic, is about b_r."""
        b = np.eye(3)
        a = self.turn.T @ b
        aims = [a[:, (r + 1) % 3] for r in range(3)]
        dirs = [self.size * b[(r + 2) % 3] for r in range(3)]
        return Block(at.T_ALIGN, 3, self.values(dirs=dirs, aims=aims))

    def aligned(self, axis: Array, normals: Sequence[Array]) -> Block:
        """Create a block that keeps an axis of a normal to directions on b."""
        dirs = [self.size * normal for normal in normals]
        return Block(at.T_ALIGN, len(dirs), self.values(dirs=dirs, aims=[axis for _ in normals]))

    def apart(self) -> Array:
        """Return the vector from the point on b to that on a in the initial state [m]."""
        own = self.position_a + self.rotation_a @ self.point
        return own - (self.position_b + self.rotation_b @ self.other_point)

    def rod(self, length: float) -> Block:
        """Create a block that keeps the points a length apart [m]."""
        return Block(at.T_DISTANCE, 1, self.values(length))

    @property
    def ground_normal(self) -> Array:
        """The ground normal (3,), or the z-axis of another body."""
        return np.array(self.model.ground_normal if self.b == 0 else (0.0, 0.0, 1.0))

    def rolling(self, radius: float, dirs: Sequence[Array], axis: Array | None) -> Block:
        """Create a block for a sphere, or for a disc about an axis, on a plane with the given
        normal."""
        semi_axes = np.eye(3) if axis is None else normals_of(axis)
        return Block(at.T_ROUND, 3, self.values(0.0, dirs, [radius * a for a in semi_axes]))

    def blade(self, axis: Array) -> Block:
        """Create a block without velocity along an axis on a."""
        return Block(at.T_BLADE, 1, self.values(aims=[axis]))

    def coordinate(self, name: str, k: int, factor: float = 1.0) -> Term:
        """Return the block term (index in v, index in q, factor) for a joint coordinate."""
        at_v, at_q = joint_coordinates(self.packed, self.topology.number(name))[k]
        return at_v, at_q, factor

    def terms(self) -> tuple[Term, ...]:
        """Return the terms of a constraint on a sum of coordinates."""
        c: Any = self.c  # one on a sum
        return tuple(terms_of(c, self.topology, self.packed))

    def sum_of_q(self, terms: tuple[Term, ...], value: float) -> Block:
        """Create a block that keeps a sum of coordinates at a value."""
        return Block(at.T_COORD, 1, self.scaled(value), terms)

    def sum_of_v(self, terms: tuple[Term, ...], value: float) -> Block:
        """Create a block that keeps a sum of velocities at a value."""
        return Block(at.T_VELOCITY, 1, self.scaled(value), tuple((v, -1, x) for v, _, x in terms))

    def following(self, own: Term, q: Any, interpolation: str) -> Block:
        """Create a block in which a coordinate follows a function of time."""
        if isinstance(q, str):
            rows = tuple(map(tuple, of_time(q, self.model.parameters).tolist()))
            return Block(at.T_COORD, 1, self.scaled(), (own,), rows, at.SINE - len(rows) // 2)
        knots = at.SINE if isinstance(q, Sine) else None
        return Block(at.T_COORD, 1, self.scaled(), (own,), curve(q, interpolation), knots)

    def related(self, own: Term, other: Term, function: Function | Pieces) -> Block:
        """Create a block in which a coordinate follows a function of another one."""
        values, terms = self.scaled(), (own, other)
        function = function.pieces if isinstance(function, Curve) else function
        if isinstance(function, Pieces):
            return Block(at.T_RELATION, 1, values, terms, pieces(function))
        given = function.coefficients if isinstance(function, Polynomial) else function
        rows = tuple(map(tuple, of_coordinate(given, self.model.parameters).tolist()))
        return Block(at.T_RELATION, 1, values, terms, rows, at.SINE - len(rows) // 2)

    def roped(self, through: Sequence[Pulley], closed: bool, length: float | None) -> list[Block]:
        """Create a block for each segment of a rope, which keeps its length."""
        at_ = Placed(self.model, self.topology, self.packed, self.poses)
        refuse = partial(self.refuse, "through")
        for k, one in enumerate(through, start=1):
            if one.friction:
                text = f"number {k}, the wheel of '{one.body}', has the friction {one.friction:g}, "
                text += "and a rope that is always taut may push, where friction has no bound; "
                raise refuse(f"{text}use a Cable without stiffness, which does not stretch either")
        found = segments(through, closed, at_, self.model, self.packed, refuse)
        if length is not None and len(found) > 1:
            raise self.refuse("length", one_length("rope", len(found)))
        return [self._segment(one, length) for one in found]

    def _segment(self, one: Segment, length: float | None) -> Block:
        longer = 0.0 if length is None else length - one.length
        ends = {at.PA: one.rows[0]["point"], at.PB: one.rows[-1]["point"]}
        values = block_values({**ends, at.VALUE: one.value + longer})
        rows = int(one.rows[0]["row"]), int(one.rows[-1]["row"])
        return Block(at.T_CABLE, 1, values, ends=rows, stations=one.rows)

    def on_curve(self, track: Track) -> Block:
        """Create a block that keeps the point on a curve on b."""
        x, home = track.pieces.x, home_of(self.packed, self.b)
        powers = track.pieces.c[::-1, :, :3] @ home.T  # (8, pieces, 3)
        powers[0] += point_in_row(self.packed, self.b, (0.0, 0.0, 0.0))
        found = np.zeros((3 * (len(x) - 1) + 1, at.KNOT))
        for k in range(3):
            found[k:-1:3, at.PIECE_AT] = x[:-1]
            found[k:-1:3, at.PIECE_POWERS : at.PIECE_RATE] = powers[:, :, k].T
        found[-1, at.PIECE_AT] = x[-1]
        if track.closed:
            found[0, at.PIECE_RATE] = 1.0 / (x[-1] - x[0])
        line = powers[0]
        values = {
            at.PA: point_in_row(self.packed, self.a, self.point),
            at.PB: line[np.abs(line).max(axis=1).argmax()],  # the size of the curve
            at.DIR: home @ track.aside,
            at.GRAIN: GRAIN * (x[-1] - x[0]),
            at.REACH: TOUCHING * float(np.ptp(line, axis=0).max()),
        }
        return Block(at.T_CURVE, 2, block_values(values), (), tuple(map(tuple, found.tolist())))

    def refuse(self, field: str, text: str) -> ModelError:
        """Create an error about this constraint."""
        return ModelError(Problem(f"constraint '{self.c.name}'", field, text))


def _pose(home: tuple[Array, Array], number: int) -> tuple[Array, Array]:
    if number == 0:
        return np.zeros(3), np.eye(3)
    return home[0][number - 1], home[1][number - 1]


def curve(q_of_t: Table | Sine | Polynomial, interpolation: str) -> tuple[tuple[float, ...], ...]:
    """Return the rows for `curves`, where a table becomes a cubic spline."""
    match q_of_t:
        case Sine(mean=mean, amplitude=amplitude, frequency=frequency, phase=phase):
            return ((mean, amplitude, frequency, phase, 0.0),)
        case Polynomial(coefficients=c):
            return ((0.0, *c, *(0.0,) * (4 - len(c))),)
        case Table(t=t, value=value):
            first, last = ((t[k], value[k], 0.0, 0.0, 0.0) for k in (0, -1))
            if len(t) == 1:
                return (last,)
            pieces = q_of_t.spline(interpolation).c[::-1].T
            return (first, *((x, *map(float, piece)) for x, piece in zip(t, pieces)), last)


# -- all constraints of a model ------------------------------------------------------------


class Blocks(NamedTuple):
    """All constraints in a model in order, including inactive ones."""

    names: tuple[str, ...]
    first: Ints  # (nc + 1,) constraint i has the blocks first[i] to first[i + 1] - 1
    blocks_i: Ints  # (nb, 9)
    blocks_f: Array  # (nb, 40)
    terms_i: Ints  # (nt, 2)
    terms_f: Array  # (nt,)
    curves: Array  # (nk, 10)
    stations: Any  # records VIA of cables


def blocks_of(ends: Endpoints) -> list[Block]:
    """Return the blocks for a constraint, depending on its kind. Raises ModelError."""
    return ends.c._blocks(ends)


def blocks(model: Model, topology: Topology, packed: System, home: tuple[Array, Array]) -> Blocks:
    """Return the blocks for a valid model, given the body poses `home` in the initial state.

    Raises ModelError if a constraint contradicts that state.
    """
    size = radius_of_gyration(packed)
    found = [
        blocks_of(Endpoints(c, model, topology, packed, home, size)) for c in model.constraints
    ]
    flat = [
        block._replace(ends=_rows(c, block, topology, packed))
        for c, items in zip(model.constraints, found)
        for block in items
    ]
    knots = [(*x, *(0.0,) * (at.KNOT - len(x))) for block in flat for x in block.curve]
    return Blocks(
        tuple(c.name for c in model.constraints),
        np.array(_starts([len(items) for items in found]), dtype=np.int64),
        *block_arrays(flat),
        np.array(knots).reshape(-1, at.KNOT),
        stations_in(flat),
    )


def stations_in(found: Sequence[Block]) -> Any:
    """Return the records VIA of all cables among blocks."""
    return joined(VIA, [x.stations for x in found if x.stations is not None and not x.chain])


def _starts(counts: Sequence[int]) -> list[int]:
    """Return the first index of each group, and the end of the last group."""
    return [*accumulate(counts, initial=0)]


def block_values(entries: Mapping[int, Any]) -> Array:
    """Return the (28,) values of a block, given {first column: number or vector}."""
    out = np.zeros(at.BLOCK_F)
    for column, x in entries.items():
        out[column : column + np.size(x)] = x
    return out


def block_arrays(found: Sequence[Block]) -> tuple[Ints, Array, Ints, Array]:
    """Return blocks_i, blocks_f, terms_i and terms_f for these blocks, which may be empty."""
    terms = [term for block in found for term in block.terms]
    starts = _starts([len(b.terms) for b in found]), _starts([len(b.curve) for b in found])
    ints = []
    station = 0
    for b, term, knot in zip(found, *starts):
        curve = knot, len(b.curve) if b.knots is None else b.knots
        if b.stations is not None:
            station += 0 if b.chain else len(b.stations)  # the last ones of its chain
            curve = station - len(b.stations), len(b.stations)
        ints.append((b.type, *b.ends, b.rows, term, len(b.terms), *(b.bodies or curve), b.chain))
    return (
        np.array(ints, dtype=np.int64).reshape(-1, at.BLOCK_I),
        np.array([b.values for b in found], dtype=float).reshape(-1, at.BLOCK_F),
        np.array([term[:2] for term in terms], dtype=np.int64).reshape(-1, 2),
        np.array([term[2] for term in terms], dtype=float),
    )


def with_blocks(blocks: Blocks, ints: Ints, floats: Array, terms_i: Ints, terms_f: Array) -> Blocks:
    """Append blocks, given as by `block_arrays`, which belong to no constraint."""
    ints = ints.copy()
    ints[:, at.B_TERM] += len(blocks.terms_i)
    strung = np.isin(ints[:, at.B_TYPE], (at.T_SLACK, at.T_WRAP))
    ints[strung, at.B_STATION] += len(blocks.stations)
    return blocks._replace(
        blocks_i=np.vstack((blocks.blocks_i, ints)),
        blocks_f=np.vstack((blocks.blocks_f, floats)),
        terms_i=np.vstack((blocks.terms_i, terms_i)),
        terms_f=np.concatenate((blocks.terms_f, terms_f)),
    )


NO_STATIONS = table(VIA, 0)
NO_BLOCKS = Blocks(
    (), np.zeros(1, np.int64), *block_arrays(()), np.zeros((0, at.KNOT)), NO_STATIONS
)


def values_of(
    c: Constraint, model: Model, topology: Topology, packed: System, poses: tuple[Array, Array]
) -> list[Array]:
    """Return the (28,) values of each block of a constraint, by default at these poses."""
    ends = Endpoints(c, model, topology, packed, poses, radius_of_gyration(packed))
    return [block.values for block in blocks_of(ends)]


def _rows(c: Constraint, block: Block, topology: Topology, packed: System) -> tuple[int, int]:
    """Return the rows for the two bodies, or for the first coordinate in a coordinate block."""
    if block.stations is not None:
        return block.ends
    a, b = (packed.row_of(topology.number(name)) for name in c.pair)
    if block.terms:
        a = row_of_velocity(packed.rows, block.terms[0][0])
    return a, b


def radius_of_gyration(packed: System, otherwise: float = 1.0) -> float:
    """Return the radius of gyration about body origins over all moving bodies [m], or `otherwise`.

    A rotation times this length compares with a displacement, so the entries of Ω's diagonal have
    the same magnitude.
    """
    moments, masses = moments_and_masses(packed)
    moves = packed.bodies_i[:, at.ROW] > 0
    moment, mass = float(moments[moves].sum()), float(masses[moves].sum())
    return float(np.sqrt(moment / mass)) if moment > 0 and mass > 0 else otherwise


def moments_and_masses(packed: System) -> tuple[Array, Array]:
    """Return the polar moments about the body origins [kg m²] and the masses, (nb + 1,) each."""
    bodies = packed.bodies_f
    masses, com = bodies[:, at.B_MASS], bodies[:, at.B_COM : at.B_COM + 3]
    trace = bodies[:, at.B_INERTIA : at.B_INERTIA + 3].sum(axis=1)
    return trace / 2 + masses * (com**2).sum(axis=1), masses
