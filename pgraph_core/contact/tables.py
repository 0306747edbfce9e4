"""Tables of contacts and joint limits for kernels, with the fields in `engine/records.py`."""

from __future__ import annotations

import math
from collections.abc import Iterator, Sequence
from functools import lru_cache
from typing import TYPE_CHECKING, Any, NamedTuple

import numpy as np

from ..engine import layout as at
from ..engine.arrays import Candidates, Geometry, Ground
from ..engine.contact.manifold import MOST
from ..engine.records import (
    APART,
    CREEP,
    GROUND_PAIR,
    MEMBER,
    PAIR_LAW,
    PENALTY,
    POINTS,
    RIGID,
    SHAPE_PAIR,
    SOFT,
    joined,
    rows_of,
)
from ..errors import ModelError, PgraphError, Problem
from ..fields import EVERY, GROUND
from ..forces import VIA
from ..forces.cable import Cable
from ..model import Body, Contact, Model, Shape
from ..model.contact import PAIRED
from ..packing import Array, Drives, Ints, System, home_of, row_of_velocity
from ..packing.constraints import (
    NO_STATIONS,
    Block,
    Blocks,
    block_arrays,
    block_values,
    moments_and_masses,
    radius_of_gyration,
    stations_in,
    with_blocks,
)
from ..packing.forces import acting_on
from ..packing.signals import number_of_cable
from ..rotation import matrix
from ..shapes import kind_of
from ..shapes.solid import Solid, points
from ..tolerances import NAMED
from ..topology import Topology
from . import packed_shapes
from .covered import Covered
from .limits import Limit, cable_rows, limit_rows
from .packed_shapes import Placed
from .terrain import terrain_of

if TYPE_CHECKING:
    from ..packing.packed import Packed

LAWS = {"complementarity": RIGID, "soft": SOFT, "penalty": PENALTY}
ON_FIELD = 64  # room for contact points of a shape on a heightfield
SINKS = 1e-4  # default depth of a contact under its weight, relative to the bodies' size
LOWEST = 0.05  # restitution of soft and penalty contacts: less would take ever more
START_DEPTH = 0.1  # default depth due to the initial speed, relative to the thinner shape


class ContactPair(NamedTuple):
    """A shape over the ground, a pair of shapes, or all members of a contact together."""

    name: str
    body: str
    other: str
    contact: Contact


class Tables(NamedTuple):
    """Contacts and limits in a scene: the kernel arrays, and the meaning of their rows."""

    touches: tuple[ContactPair, ...]
    limits: tuple[str, ...]  # names of limits, one a block
    geometry: Geometry
    ground: Ground
    candidates: Candidates
    laws: Any  # records of PAIR_LAW, one per touch
    limit_blocks: tuple[Ints, Array, Ints, Array]  # arrays of `Blocks`
    room: int  # contact points that there is room for
    remembers: bool  # penalty friction sticks to anchors
    turns: bool  # a contact resists rolling or spinning
    tendons: bool  # some limits bound sums of coordinates, or lengths
    hulls: tuple[tuple[float, str], ...]  # (volume over the mesh's, body) of hulls far larger
    friction_blocks: tuple[Ints, Array, Ints, Array] = block_arrays(())  # joint friction
    stations: Any = NO_STATIONS  # records VIA of the cables among the limits
    cables: tuple[Cable, ...] = ()  # segments of those that do not stretch: the last limits

    def __bool__(self) -> bool:
        return bool(self.touches or self.limits or self.frictions)

    def measured(self, model: Any) -> list[int]:
        """Return the number, for expressions, of the contact or cable of each pair and limit."""
        numbers = {c.name: i for i, c in enumerate(model.contacts)}
        of = [numbers.get(pair.contact.name, -1) for pair in self.touches]
        of += [-1] * (len(self.limits) - len(self.cables))
        return [*of, *(number_of_cable(model, cable) for cable in self.cables)]

    @property
    def frictions(self) -> int:
        """The number of joint coordinates and tendons with friction."""
        return len(self.friction_blocks[0])

    @property
    def coordinate_limits(self) -> Iterator[Limit]:
        """Yield the limits of joints and tendons, excluding lengths between points."""
        ints, floats, terms, factors = self.limit_blocks
        scales = floats[:, (at.VALUE, at.SIZE, at.REBOUND)].tolist()
        for name, block, values in zip(self.limits, ints.tolist(), scales):
            if block[at.B_TYPE] == at.T_LIMIT:
                own = slice(block[at.B_TERM], block[at.B_TERM] + block[at.B_TERMS])
                at_v, at_q = terms[own].T
                yield Limit(name, block[at.B_A], at_v, at_q, factors[own], *values)

    @property
    def compliant(self) -> bool:
        """Return True if a contact is soft or has a penalty law."""
        return any(t.contact.law != "complementarity" for t in self.touches)

    @property
    def rigid(self) -> bool:
        """Return True if impulses are required, by a rigid contact, a limit or joint friction."""
        rigid = any(t.contact.law == "complementarity" for t in self.touches)
        return rigid or bool(self.limits or self.frictions)


def tables(mech: Packed, active: tuple[Contact, ...]) -> Tables:
    """Build the tables for these contacts and for all limits. Raises ModelError, FileError."""
    found = _Shapes(mech)
    for contact in active:
        found.add(contact)
    cables = list(cable_rows(mech))
    limits = [*limit_rows(mech), *(own for _, own in cables)]
    return found.tables(limits)._replace(cables=tuple(cable for cable, _ in cables))


def with_friction(contacts: Tables, drives: Drives, rows: Ints) -> Tables:
    """Add a block to the tables for each drive with friction. `rows` are the rows of the system."""
    found = list[Block]()
    for one in drives.table[drives.table["friction"] > 0.0]:
        own, factors = acting_on(drives, one)
        terms = tuple((i, -1, x) for i, x in zip(own.tolist(), factors.tolist()))
        ends = row_of_velocity(rows, int(own[0])), 0
        values = block_values({at.VALUE: one["friction"]})
        found.append(Block(at.T_FRICTION, 1, values, terms, ends=ends))
    return contacts._replace(friction_blocks=block_arrays(found))


class _Shapes:
    """Unique collision shapes, and the pairs that may touch."""

    def __init__(self, mech: Packed):
        self.mech, self.model = mech, mech.model
        self.terrain = terrain_of(mech.model)
        self.boxes: list[int] = []  # numbers of the boxes of the ground's steps, once they touch
        self.covered = Covered(mech)
        self.placed: list[Placed] = []
        self.number: dict[tuple[str, tuple[Any, ...] | int], range] = {}
        self.touches: list[ContactPair] = []
        self.on_ground: list[tuple[int, int]] = []
        self.pairs: list[tuple[int, int, int]] = []
        self.members: list[tuple[int, int]] = []
        self.hulls: list[tuple[float, str]] = []

    def add(self, c: Contact) -> None:
        """Add all the touching pairs that a contact defines."""
        if c.body == EVERY and c.other == EVERY and len(self._shaped()) > PAIRED:
            slot = self._slot(c.name, c)
            self.members += [(i, slot) for b in self._shaped() for i in self._shapes(b, c)]
            return
        for body, other in self.covered.pairs(c):
            name = c.touch_name(body, other)
            if other == GROUND:
                slot = self._slot(name, c, body, other)
                mine = self._shapes(self.model.body(body), c)
                self._refuse_field(c, mine, "can touch other shapes, not the ground")
                self.on_ground += [(i, slot) for i in mine]
                self.pairs += [(i, step, slot) for i in mine for step in self._steps()]
                continue
            mine = self._shapes(self.model.body(body), c)
            others = self._shapes(self.model.body(other), c, points=False)
            if self.placed[mine[0]].row == self.placed[others[0]].row:
                text = f"'{body}' and '{other}' are welded together and cannot collide; remove it"
                raise ModelError(Problem(f"contact '{c.name}'", "other", text))
            if any(self.placed[b].solid.is_field for b in others):
                self._refuse_field(c, mine, "does not touch another heightfield")
            slot = self._slot(name, c, body, other)
            self.pairs += [(a, b, slot) for a in mine for b in others]

    def _steps(self) -> list[int]:
        """Return the indices of the boxes that represent the ground's steps."""
        if not self.boxes:
            self.boxes = [*range(len(self.placed), len(self.placed) + len(self.terrain.boxes))]
            self.placed += self.terrain.boxes
        return self.boxes

    def _refuse_field(self, c: Contact, shapes: list[int], text: str) -> None:
        if any(self.placed[i].solid.is_field for i in shapes):
            raise ModelError(Problem(f"contact '{c.name}'", "body", f"a heightfield {text}"))

    def _shaped(self) -> list[Body]:
        return [b for b in self.model.bodies if b.touching]

    def _slot(self, name: str, c: Contact, body: str = EVERY, other: str = EVERY) -> int:
        self.touches.append(ContactPair(name, body, other, c))
        return len(self.touches) - 1

    def _shapes(self, body: Body, c: Contact, points: bool = True) -> list[int]:
        """Return the indices of a body's collision shapes, or of the contact's own points."""
        own = c.points if points else ()
        shapes: tuple[Shape | None, ...] = (None,) if own else body.touching
        if not shapes:
            text = f"body '{body.name}' has no shape; give it one, or give the contact points"
            raise ModelError(Problem(f"contact '{c.name}'", "body", text))
        if c.law == "penalty" and any(shape.moves for shape in body.touching) and not own:
            text = f"a penalty contact sticks to the body, and the surface of '{body.name}' moves"
            text += " along it; use 'soft' or 'complementarity'"
            raise ModelError(Problem(f"contact '{c.name}'", "law", text))
        found = []
        for k, shape in enumerate(shapes):
            key = (body.name, own or k)
            if key not in self.number:
                placed = self._place(body, own, shape, c)
                self.number[key] = range(len(self.placed), len(self.placed) + len(placed))
                self.placed += placed
            found += self.number[key]
        return found

    def _place(
        self, body: Body, own: tuple[Any, ...], shape: Shape | None, c: Contact
    ) -> list[Placed]:
        number = self.mech.topology.number(body.name)
        packed = self.mech.system
        home = home_of(packed, number)
        offset = packed.bodies_f[number, at.OFFSET : at.OFFSET + 3]
        row = packed.row_of(number)
        if shape is None:
            return [Placed(points(own), row, number, offset.tolist(), home)]
        position = (offset + home @ np.array(shape.position)).tolist()
        rotation = home @ matrix(shape.rotation)
        parts = _solids(c.name, body.name, shape)
        if (excess := kind_of(shape).excess(shape)) > 1 + NAMED:
            self.hulls.append((excess, body.name))
        surface = shape.surface_velocity, shape.surface_spin
        return [Placed(solid, row, number, position, rotation, surface) for solid in parts]

    def tables(self, limits: list[tuple[str, Block]]) -> Tables:
        """Return the tables with these limits, given by name and block."""
        neighbours = packed_shapes.neighbours_of(self.placed, self._partners())
        geometry = packed_shapes.packed(self.placed, neighbours, self.model.gravity)
        room = sum(self._points(i) for i, _ in self.on_ground)
        room += sum(self._room(a, b) for a, b, _ in self.pairs if b not in self.boxes)
        room += MOST * (min(len(self.boxes), 4) * len(self.on_ground) + len(self.members))
        laws = rows_of(PAIR_LAW, _laws([t.contact for t in self.touches], self.mech))
        return Tables(
            touches=tuple(self.touches),
            limits=tuple(name for name, _ in limits),
            geometry=geometry,
            ground=self.terrain.ground,
            candidates=Candidates(
                rows_of(GROUND_PAIR, self.on_ground),
                rows_of(SHAPE_PAIR, self.pairs),
                rows_of(MEMBER, self.members),
                rows_of(APART, sorted(self.covered.apart) if self.members else []),
            ),
            laws=laws,
            limit_blocks=block_arrays([block for _, block in limits]),
            stations=stations_in([block for _, block in limits]),
            room=room,
            remembers=any(t.contact.law == "penalty" for t in self.touches),
            turns=bool((laws["rolling"] > 0).any() or (laws["spinning"] > 0).any()),
            tendons=any(len(block.terms) != 1 for _, block in limits),
            hulls=tuple(self.hulls),
        )

    def _partners(self) -> list[set[Any]]:
        """Return the shapes that each shape may touch, and the slots to which it belongs."""
        found: list[set[Any]] = [set() for _ in self.placed]
        for a, b, _ in self.pairs:
            found[a].add(b)
            found[b].add(a)
        tied: dict[int, set[int]] = {}
        for a, b in self.covered.apart if self.members else ():
            tied.setdefault(a, set()).add(b)
            tied.setdefault(b, set()).add(a)
        rows = {p.body: p.row for p in self.placed}
        for i, slot in self.members:
            mine = self.placed[i]
            others = {b for b in tied.get(mine.body, ()) if rows.get(b) != mine.row}
            found[i].add((slot, frozenset(others)))
        return found

    def _room(self, a: int, b: int) -> int:
        """Return the maximum number of contact points between two shapes."""
        field = self.placed[a].solid.is_field or self.placed[b].solid.is_field
        return ON_FIELD if field else MOST

    def _points(self, i: int) -> int:
        solid = self.placed[i].solid
        return len(solid.vertices) if solid.of_balls else MOST


def _laws(contacts: Sequence[Contact], mech: Packed) -> list[tuple[float, ...]]:
    trees, size = _trees(mech.topology, mech.system), radius_of_gyration(mech.system)
    each = {id(c): c for c in contacts}  # one of '*' is that of many pairs
    laws = {k: _law(c, mech.model, trees, size) for k, c in each.items()}
    return [laws[id(c)] for c in contacts]


def _law(c: Contact, model: Model, trees: _Trees, size: float) -> tuple[float, ...]:
    """Compute the parameters (11,) for PAIR_LAW, including defaults.

    By default, the weight of the lightest touching tree compresses the contact by 1e-4 of the size
    of the bodies, and the damping is determined by the restitution. The speed at which friction is
    regularised scales with that of a fall by the size of the smallest touching tree.
    """
    friction = c.frictions(model.ground)
    further = friction.static != friction.kinetic or friction.rolling or friction.spinning
    if further and c.law != "complementarity":
        text = "static, rolling and spinning friction need the law 'complementarity'"
        raise ModelError(Problem(f"contact '{c.name}'", "law", f"{text}, got '{c.law}'"))
    restitution = model.ground.restitution if c.restitution is None else c.restitution
    mass = min(trees.masses(c), default=1.0)
    weight, depth = mass * pull_of(model), SINKS * size
    creep = CREEP * math.sqrt(pull_of(model) * trees.smallest(c))
    soft = c.law == "soft"
    stiffness = weight / depth ** (1.5 if soft else 1.0) if c.stiffness is None else c.stiffness
    damping, loss = c.damping, 0.0
    if damping is None:
        damping = 0.0
        if soft:
            loss = loss_of_impact(restitution)
        elif c.law == "penalty":
            loss = 2.0 * damping_ratio(restitution)
    values = float(LAWS[c.law]), friction.kinetic, restitution, stiffness, damping
    return (*values, friction.static, friction.rolling, friction.spinning, mass, loss, creep)


def at_speed(found: Tables, mech: Packed, speeds: Array) -> Tables:
    """Adapt the tables to a run with these maximum initial body speeds (nb,) [m/s].

    For soft and penalty contacts without a given stiffness, an impact at this speed penetrates the
    thinner shape by at most a tenth.
    """
    laws, trees = found.laws.copy(), _trees(mech.topology, mech.system)
    shapes = found.geometry.shapes[found.geometry.shapes["kind"] != POINTS]
    for row, (_, body, other, c) in zip(laws, found.touches):
        if c.law == "complementarity":
            continue
        names = [n for n in (body, other) if n != GROUND]
        among = speeds if EVERY in names else [speeds[mech.topology.number(n) - 1] for n in names]
        own = [mech.topology.number(n) for n in names if n != EVERY]
        chosen = shapes if EVERY in names else shapes[np.isin(shapes["body"], own)]
        thin = float(chosen["half_extents"].min(axis=1).min(initial=np.inf))
        speed, mass = float(np.sum(np.sort(among)[-2:])), _moved(c, trees)
        soft, stiffness = c.law == "soft", float(row["stiffness"])
        if c.stiffness is None and 0.0 < thin < np.inf:
            deep = START_DEPTH * thin
            energy = mass * speed**2  # = k d², or 4/5 k d^2.5
            needed = 1.25 * energy / deep**2.5 if soft else energy / deep**2
            stiffness = max(stiffness, needed)
        row["stiffness"] = stiffness
    return found._replace(laws=laws)


def _moved(c: Contact, trees: _Trees) -> float:
    """Compute the effective mass in an impact between two trees [kg], 1 / (1/m + 1/M)."""
    masses = trees.masses(c)
    if EVERY in (c.body, c.other):
        return min(masses, default=1.0)
    return 1.0 / sum(1.0 / m for m in masses) if masses else 1.0


def pull_of(model: Model) -> float:
    """Return the magnitude of gravity, or 9.81 if there is no gravity [m/s²]."""
    return float(np.linalg.norm(model.gravity)) or 9.81


@lru_cache(1000)
def damping_ratio(restitution: float) -> float:
    """Return the damping ratio of a linear contact with this restitution, which is at least LOWEST.

    The contact force is never attractive. The contact ends when the force vanishes, before the
    spring is relaxed ([Schwager & Pöschel 2007]).
    """
    from scipy.optimize import brentq

    wanted = min(max(restitution, LOWEST), 1.0)
    if wanted == 1.0:
        return 0.0

    def excess(ratio: float) -> float:
        root = np.sqrt(abs(1.0 - ratio**2)) or 1e-12
        turn = 2.0 * np.log(ratio + root)
        if ratio < 1.0:
            turn = np.arctan2(2.0 * ratio * root, 2.0 * ratio**2 - 1.0)
        return float(np.exp(-ratio * turn / root) - wanted)

    return float(brentq(excess, 0.0, 10.0, xtol=1e-14))  # pyright: ignore


@lru_cache(1000)
def loss_of_impact(restitution: float) -> float:
    """Return χ in k d^1.5 (1 + χ d' / V) for this restitution, at least LOWEST, at any impact
    speed.

    V is the impact speed that corresponds to the remaining energy E. With y = |d'| / V it falls by
    d ln E = -2 χ y² / (1 ± χ y (1 - y²)) dy: + on the way in, from y = 1 to 0; - on the way back,
    to y = 1, or to 1 / χ, where the force ends.
    """
    from scipy.integrate import quad
    from scipy.optimize import brentq

    e = min(max(restitution, LOWEST), 1.0)
    if e == 1.0:
        return 0.0

    def excess(x: float) -> float:
        end = min(1.0, 1.0 / x)
        into = quad(lambda y: y * y / (1.0 + x * y * (1.0 - y * y)), 0.0, 1.0)[0]
        back = quad(lambda y: y * y / (1.0 - x * y * (1.0 - y * y)), 0.0, end)[0]
        return float(np.log(end) - x * (into + back) - np.log(e))

    return float(brentq(excess, 0.5 * (1.0 - e), 1.0 / e, xtol=1e-14))  # pyright: ignore


class _Trees(NamedTuple):
    """The tree of each body (nb + 1,), by its root, and the mass [kg] and radius of gyration [m] of
    the tree that each body starts.

    Bodies welded to the ground are part of the ground, 0.
    """

    topology: Topology
    root: Ints
    mass: Array
    radius: Array  # nan of bodies that start no tree, and of points

    def among(self, c: Contact) -> Ints:
        """Return the roots of the trees named by a contact, or of all trees for '*'."""
        named = [self.topology.number(name) for name in {c.body, c.other} - {GROUND, EVERY}]
        roots = self.root[named] if named else np.unique(self.root)
        return roots[(roots > 0) & (self.mass[roots] > 0.0)]

    def masses(self, c: Contact) -> list[float]:
        """Return the masses of these trees [kg]."""
        return self.mass[self.among(c)].tolist()

    def smallest(self, c: Contact) -> float:
        """Return the smallest radius of gyration of these trees [m], 1 if they are points."""
        found = self.radius[self.among(c)]
        return min(found[found > 0.0].tolist(), default=1.0)


def _trees(topology: Topology, packed: System) -> _Trees:
    joints = packed.bodies_i[1:, at.OWN_ROWS].tolist()
    root = [0] * (topology.nb + 1)
    for k, p in enumerate(topology.parent.tolist(), start=1):
        root[k] = root[p] or (k if joints[k - 1] else 0)
    roots: Ints = np.array(root)
    moment, mass = (
        np.bincount(roots, x, topology.nb + 1).astype(float) for x in moments_and_masses(packed)
    )
    with np.errstate(all="ignore"):
        return _Trees(topology, roots, mass, np.sqrt(moment / mass))


def _solids(contact: str, body: str, shape: Shape) -> tuple[Solid, ...]:
    """Convert a body's shape for the kernels. Raises ModelError with the contact and body names."""
    try:
        return kind_of(shape).solids(shape)
    except PgraphError as error:
        where = f"contact '{contact}'"
        problems = [Problem(where, "", f"the shape of '{body}': {p}") for p in error.problems]
        raise ModelError(problems) from None


def extended(blocks: Blocks, contacts: Tables) -> Blocks:
    """Append blocks for joint friction and limits, then buffer blocks for contact points."""
    room = contacts.room * (2 if contacts.turns else 1)  # a second block that resists turning
    for arrays in (contacts.friction_blocks, contacts.limit_blocks):
        blocks = with_blocks(blocks, *arrays)
    blocks = blocks._replace(stations=joined(VIA, (blocks.stations, contacts.stations)))
    return blocks._replace(
        blocks_i=np.vstack((blocks.blocks_i, np.zeros((room, at.BLOCK_I), np.int64))),
        blocks_f=np.vstack((blocks.blocks_f, np.zeros((room, at.BLOCK_F)))),
    )
