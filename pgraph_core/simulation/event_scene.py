"""The scene of an event-driven run: contact points and limits, and the active blocks in each
phase.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from functools import cached_property
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from ..contact.limits import Limit
from ..contact.tables import ContactPair, Tables, tables
from ..dynamics.arguments import UserTorque
from ..dynamics.scene import ContactSpace, Scene
from ..engine import layout as at
from ..engine import motion
from ..engine.arrays import (
    BARRED,
    CALMED,
    LAMBDA,
    LOOSE,
    MISSED,
    REPORT,
    RHS,
    EventContacts,
    EventData,
    EventLinks,
)
from ..engine.compiler.address import address_of, address_of_array, buffer, unnamed
from ..engine.contact import phases, striking
from ..engine.contact import points as point_kernels
from ..engine.records import ACCEPTANCE, POINT, POINT_FRAME, SLIP, STANCE, table
from ..errors import InputError, Problem
from ..fields import GROUND
from ..mechanism import Mechanism
from ..model import Body, Contact, Model
from ..packing import Array, Drives, Ints, Loads, System, home_of, point_in_row
from ..packing.constraints import Block, Blocks, block_arrays, block_values, with_blocks
from ..rotation import matrix, normals_of
from ..shapes import kind_of
from ..topology import Topology
from .monitors import room_for

INSTEAD = "use method 'moreau_jean'"


class ContactPoint(NamedTuple):
    """A point, ellipsoid or disc on a body above the ground, or one end of a joint's range."""

    name: str
    pair: str  # its contact pair, or a limit's own name
    body: str
    friction: float
    restitution: float
    point: tuple[float, float, float] = (0.0, 0.0, 0.0)  # or the centre, in body axes [m]
    semi_axes: tuple[
        tuple[float, ...], ...
    ] = ()  # semi-axes of an ellipsoid or disc, in body axes [m]
    limit: Limit | None = None
    of_shape: bool = False  # a shape touches there: the contact gives no points


class Impact(NamedTuple):
    """Normal velocities before and after an impact and normal impulses of its points."""

    before: Array
    after: Array
    impulse: Array
    loose: int | None  # a point of the first impact whose impulses are not unique
    fastest: float  # largest velocity of a row before
    missed: float  # residual of the laws relative to the largest velocity
    calmed: bool  # restitution would have increased the energy


def contact_points(
    model: Model, topology: Topology, packed: System, tables: Tables
) -> tuple[ContactPoint, ...]:
    """Return the points of rigid contacts with the ground, and all joint limits.

    Raises InputError for contacts whose points events are not located for.
    """
    rigid = [t for t in tables.touches if t.contact.law == "complementarity"]
    points = (p for pair in rigid for p in _points(model, pair))
    return (*points, *_limits(topology, packed, tables))


def _points(model: Model, pair: ContactPair) -> Iterator[ContactPoint]:
    contact, ground = pair.contact, model.ground
    if pair.other != GROUND:
        raise _refused(contact, "other", "events are located between a body and the ground")
    if ground.steps:
        raise _refused(contact, "other", "events are located on a ground without steps")
    if any(shape.moves for shape in model.body(pair.body).touching) and not contact.points:
        raise _refused(contact, "body", "events are located for surfaces that do not move")
    if contact._varies:
        raise _refused(
            contact, "friction", "events are located with a coefficient that is a number"
        )
    all_kinds = contact.frictions(ground)
    friction = all_kinds.kinetic
    if all_kinds.static != friction or all_kinds.rolling or all_kinds.spinning:
        text = "events are located with one coefficient of friction, without rolling or spinning"
        raise _refused(contact, "friction", text)
    bounce = ground.restitution if contact.restitution is None else contact.restitution
    places = _places(model.body(pair.body), contact)
    for k, (point, semi_axes) in enumerate(places):
        name = pair.name if len(places) == 1 else f"{pair.name}[{k}]"
        own = not contact.points
        yield ContactPoint(
            name, pair.name, pair.body, friction, bounce, point, semi_axes, of_shape=own
        )


def _places(body: Body, contact: Contact) -> list[tuple[Any, Any]]:
    """Compute (point, semi-axes) in body axes for all features that can touch a plane."""
    if contact.points:
        return [(point, ()) for point in contact.points]
    found: list[tuple[Any, Any]] = []
    for shape in body.touching:
        turn = matrix(shape.rotation)
        for solid in kind_of(shape).solids(shape):
            if solid.rounds is None:
                what = (
                    f"events are located for hulls of ellipsoids, which {kind_of(shape).one} is not"
                )
                raise _refused(contact, "body", what)
            for centre, axes in zip(*solid.rounds):
                point = tuple((np.array(shape.position) + turn @ centre).tolist())
                alike = np.ptp(axes.diagonal()) == 0  # a sphere or point, however it is turned
                axes = axes if alike else axes @ turn.T
                found.append((point, tuple(map(tuple, axes.tolist())) if axes.any() else ()))
    return found


def _refused(contact: Contact, field: str, text: str) -> InputError:
    return InputError(Problem(f"contact '{contact.name}'", field, f"{text}; {INSTEAD}"))


def _limits(topology: Topology, packed: System, tables: Tables) -> Iterator[ContactPoint]:
    for limit in tables.coordinate_limits:
        body = topology.names[int(packed.body_of_row[limit.row]) - 1]
        yield ContactPoint(limit.name, limit.name, body, 0.0, limit.rebound, limit=limit)


def with_points(
    blocks: Blocks,
    declared: Sequence[ContactPoint],
    model: Model,
    topology: Topology,
    packed: System,
) -> tuple[Blocks, Any, Ints]:
    """Compute the constraint blocks followed by those for these points, the POINT table, and each
    point's block with the contact law of an impact.

    Each point has an entry of `names` with the block for all its rows, and a second entry with its
    other blocks.
    """
    normal = np.array(model.ground_normal)
    frame = (normal, *normals_of(normal))
    found, laws, first = list[Block](), list[int](), blocks.first.tolist()
    points = table(POINT, len(declared))
    points["normal"], points["slip_direction"] = frame[:2]
    for one, p in zip(points, declared):
        start = first[-1]
        if p.limit is not None:
            limit = p.limit
            term = int(limit.at_v[0]), int(limit.at_q[0]), float(limit.weights[0])
            values = block_values({at.VALUE: limit.bound})
            found.append(Block(at.T_LIMIT, 1, values, (term,), ends=(limit.row, 0)))
            places, law = (start, start, start), start
        else:
            number = topology.number(p.body)
            point, ends = point_in_row(packed, number, p.point), (packed.row_of(number), 0)
            axes = np.array(p.semi_axes).reshape(-1, 3)
            alike = len({float(a @ a) for a in axes}) <= 1
            axes = axes if alike else axes @ home_of(packed, number).T
            one["turns"] = not alike or point.any()
            one["rim"] = len(axes) > 0 and not axes.any(axis=1).all()
            entries = {at.PA: point, at.DIR: np.concatenate(frame), at.AIM: axes.ravel()}
            kind, values = at.T_ROUND if len(axes) else at.T_POINT, block_values(entries)
            for each, size in ((kind, 3), (kind, 1), (at.T_PIN, 3)):
                found.append(Block(each, size, values, ends=ends))
            values = block_values({at.DIR: entries[at.DIR], at.FRICTION: p.friction})
            found.append(Block(at.T_CONTACT, 3, values, ends=ends))
            held = start if len(axes) else start + 2
            places, law = (held, start, start + 1), start + 3
        one["held_block"], one["slide_block"], one["gap_block"] = places
        laws.append(law)
        one["limit"], one["friction"] = p.limit is not None, p.friction
        first += [start + 1, len(blocks.blocks_i) + len(found)]
    names = (*blocks.names, *(name for s in declared for name in (s.name, s.name)))
    extended = with_blocks(blocks, *block_arrays(found))
    return (
        extended._replace(names=names, first=np.array(first, dtype=np.int64)),
        points,
        np.array(laws),
    )


class EventScene(Scene):
    """A scene with contact points. `arrange` applies a change in `points["phase"]`."""

    once = False  # a step that ends at an event is taken again, shorter

    def __init__(
        self,
        mech: Mechanism,
        drives: Drives,
        loads: Loads,
        active: Ints,
        contact_points: Sequence[ContactPoint],
        frames: int,
        *,
        contacts: Tables | None = None,
        user: UserTorque | None = None,
        watched: int = 0,
    ):
        """Start with all points in swing. `frames` is the number of frames to be recorded.

        `watched` is the number of further events, a user's.
        """
        packed = mech.packed
        given = (mech.model, mech.topology, packed.system)
        extended, points, self._laws = with_points(packed.blocks, contact_points, *given)
        count = len(contact_points)
        whole = len(packed.blocks.names) + 2 * np.arange(count)
        everything = np.concatenate((active, whole))
        super().__init__(
            packed, drives, loads, everything, contacts=contacts, user=user, blocks=extended
        )
        self.activate(active)
        self.bilateral = int(self.active[0])
        self.contact_points, self.points = tuple(contact_points), points
        self.every = np.concatenate(([count], self.points["slide_block"]))
        self.watched = room_for(watched, 3 * count)
        self.frames = table(POINT_FRAME, frames, count)
        self._held = np.zeros_like(self.active)
        self._link()
        self.arrange()

    def _link(self) -> None:
        """Store the scenes: tree, active constraints, and all contact points."""
        tree, held = buffer(), buffer()
        nothing = np.zeros(1, dtype=np.int64)
        both = [
            self._kept._replace(blocks=self._kept.blocks._replace(active=active))
            for active in (nothing, self._held)
        ]
        for place, scene in zip((tree, held), both):
            motion.save_scene(place, unnamed(scene))
        links = EventLinks(
            tree=address_of(motion.acceleration),
            bare=address_of_array(tree),
            held=address_of_array(held),
            acceleration=address_of(phases.event_acceleration),
            record=address_of(motion.record),
            observe=address_of(point_kernels.observe),
            project=address_of(motion.projection),
        )
        count, rows = len(self.contact_points), len(self.space.omega)
        parts = EventContacts(
            links=links,
            points=self.points,
            every=self.every,
            watched=self.watched,
            columns=np.zeros((3 * count + 2, max(rows, 1))),
            small=np.zeros((3 * count + 2, max(count, 1))),
            frames=self.frames,
        )
        self._alive = (tree, held, both, parts)
        self._buffer = buffer()
        phases.save_events(self._buffer, unnamed(EventData(self._kept, parts)))
        self.address, self._held_address = address_of_array(self._buffer), links.held

    def over(self) -> NDArray[np.bool_]:
        """Check whether each monitor of a contact point has fallen below zero, (points, 3)."""
        count = 3 * len(self.contact_points)
        return self.watched[point_kernels.WATCHED.now, :count].reshape(-1, 3) < 0

    @property
    def held(self) -> int:
        """The address of the scene whose active blocks are projected."""
        return int(self._held_address)

    @property
    def phase(self) -> Ints:
        """The phases of the points, (ns,)."""
        return self.points["phase"]

    def switch(self, constraints: Ints) -> None:
        """Activate these constraints in addition to the constraints of the contact phases."""
        self.activate(constraints)
        self.bilateral = int(self.active[0])
        self.arrange()

    def arrange(self) -> None:
        """Activate the blocks for constraints, stances and limits, followed by sliding points."""
        phase = self.phase
        stances = self.points["held_block"][phase == STANCE]
        sliding = self.points[(phase == SLIP) | (phase == ACCEPTANCE)]
        for active, last in ((self.active, "slide_block"), (self._held, "gap_block")):
            chosen = np.concatenate((stances, sliding[last]))
            active[1 : self.bilateral + 1] = self.active[1 : self.bilateral + 1]
            active[self.bilateral + 1 : self.bilateral + 1 + len(chosen)] = chosen
            active[0] = self.bilateral + len(chosen)

    def hold(self, s: int) -> None:
        """Fix point s in stance to the ground point below it."""
        block = self.points["held_block"][s]
        if self.blocks.blocks_i[block, at.B_TYPE] == at.T_PIN:
            f = self.points[s]
            normal = f["normal"]
            foot = f["position"] - f["gap"] * normal
            self.blocks.blocks_f[block, at.PB : at.PB + 3] = foot

    @cached_property
    def _striking(self) -> tuple[int, Any]:
        """The address of the scene with memory for the impulse solver, and what keeps it alive."""
        space = self.touching
        if space is None:
            space = ContactSpace(self.packed, tables(self.packed, ()), self.blocks, 0, steps=False)
        place, scene = buffer(), self._kept._replace(links=space.links)
        motion.save_scene(place, unnamed(scene))
        return address_of_array(place), (place, scene, space)

    def impact(
        self,
        t: float,
        q: Array,
        v: Array,
        chosen: Ints,
        restitution: Array,
        jammed: int,
    ) -> Impact | None:
        """Compute the impulses at the `chosen` points and in the constraints.

        The `jammed` point stops, whatever its friction. Returns None if a velocity is not finite.
        """
        points, floats, vectors = self.points[chosen], self.blocks.blocks_f, self.space.vectors
        blocks = self._laws[chosen]
        floats[blocks, at.BOUNCE] = restitution
        contact = points["limit"] == 0
        floats[blocks[contact], at.PA : at.PA + 3] = points["position"][contact]
        blocks = np.where(chosen == jammed, points["slide_block"], blocks)
        self.active[0] = self.bilateral + len(blocks)
        self.active[self.bilateral + 1 : self.active[0] + 1] = blocks
        m = point_kernels.impulse_rows(self.address, t, q, v)
        u, omega = vectors[RHS, :m].copy(), self.space.omega[:m, :m]
        if not (np.isfinite(omega).all() and np.isfinite(u).all()):
            return None
        address, (*_, space) = self._striking
        striking.strike(address, v)
        report, impulse = vectors[REPORT], vectors[LAMBDA, :m].copy()
        normal, after = self.space.slots[blocks, at.FIRST], u + omega @ impulse
        loose = None
        if report[LOOSE] > 0.0:
            space.tally["loose"] += 1
            loose = int(chosen[np.flatnonzero(blocks == int(report[LOOSE]) - 1)[0]])
        return Impact(
            before=u[normal],
            after=after[normal],
            impulse=impulse[normal],
            loose=loose,
            fastest=float(np.max(np.abs(u), initial=0.0)),
            missed=1.0 if report[BARRED] else float(report[MISSED]),
            calmed=bool(report[CALMED]),
        )

    def strike(self, v: Array, ledger: Array) -> None:
        """Add the effect of the impulses of `impact` to v, directly after it.

        Their work and dissipation are added to `ledger` [J].
        """
        point_kernels.add_impulses(self.address, v, ledger)
