"""The scene of an event-driven run: contact points, and the blocks that act in each phase."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from ..contact.points import ContactPoint, with_points
from ..contact.tables import Tables
from ..dynamics.callback import UserTorque
from ..dynamics.scene import Scene
from ..engine import layout as at
from ..engine import motion
from ..engine.arrays import LAMBDA, RHS, EventContacts, EventData, EventLinks
from ..engine.compiler.address import address_of, address_of_array, buffer, unnamed
from ..engine.contact import phases
from ..engine.contact import points as point_kernels
from ..engine.records import ACCEPTANCE, POINT_FRAME, SLIP, STANCE, table
from ..mechanism import Mechanism
from ..packing.system import Array, Drives, Ints, Loads


class EventScene(Scene):
    """A scene with contact points; `arrange` makes a change of `points["phase"]` effective."""

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
        """All points are in swing. `frames` is how many are to be recorded.

        `watched` is the number of further events, a user's.
        """
        packed = mech.packed
        given = (mech.model, mech.topology, packed.system)
        extended, points = with_points(packed.blocks, contact_points, *given)
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
        self.watched = np.zeros((4, 3 * count + watched))
        self.frames = table(POINT_FRAME, frames, count)
        self._held = np.zeros_like(self.active)
        self._link()
        self.arrange()

    def _link(self) -> None:
        """Save the scenes: the tree alone, held constraints, and all with contact points."""
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
            links,
            self.points,
            self.every,
            self.watched,
            np.zeros((3 * count + 2, max(rows, 1))),
            np.zeros((3 * count + 2, max(count, 1))),
            self.frames,
        )
        self._alive = (tree, held, both, parts)
        self._buffer = buffer()
        phases.save_events(self._buffer, unnamed(EventData(self._kept, parts)))
        self.address, self._held_address = address_of_array(self._buffer), links.held

    def over(self) -> NDArray[np.bool_]:
        """(points, 3) whether a monitor of a contact point has fallen below zero."""
        count = 3 * len(self.contact_points)
        return self.watched[point_kernels.NOW, :count].reshape(-1, 3) < 0

    @property
    def held(self) -> int:
        """Address of the scene whose active blocks are projected."""
        return int(self._held_address)

    @property
    def phase(self) -> Ints:
        """(ns,) phases of the points."""
        return self.points["phase"]

    def switch(self, constraints: Ints) -> None:
        """Activate these constraints in addition to those of the phases."""
        self.activate(constraints)
        self.bilateral = int(self.active[0])
        self.arrange()

    def arrange(self) -> None:
        """Activate the blocks of constraints, of stances and limits, then of sliding points."""
        phase = self.phase
        stances = self.points["held_block"][phase == STANCE]
        sliding = self.points[(phase == SLIP) | (phase == ACCEPTANCE)]
        for active, last in ((self.active, "slide_block"), (self._held, "gap_block")):
            chosen = np.concatenate((stances, sliding[last]))
            active[1 : self.bilateral + 1] = self.active[1 : self.bilateral + 1]
            active[self.bilateral + 1 : self.bilateral + 1 + len(chosen)] = chosen
            active[0] = self.bilateral + len(chosen)

    def hold(self, s: int) -> None:
        """Let a stance of point s hold the point of the ground that it is over."""
        block = self.points["held_block"][s]
        if self.blocks.blocks_i[block, at.B_TYPE] == at.T_POINT:
            f = self.points[s]
            normal = f["normal"]
            foot = f["position"] - f["gap"] * normal
            self.blocks.blocks_f[block, at.PB : at.PB + 3] = foot

    def impact(self, t: float, q: Array, v: Array, chosen: Sequence[int]) -> tuple[Array, Array]:
        """(Ω, velocities) of the rows of constraints and of all rows of these points."""
        blocks = self.points["slide_block"][list(chosen)]
        self.active[0] = self.bilateral + len(blocks)
        self.active[self.bilateral + 1 : self.active[0] + 1] = blocks
        m = point_kernels.impulse_rows(self.address, t, q, v)
        return self.space.omega[:m, :m].copy(), self.space.vectors[RHS, :m].copy()

    def strike(self, impulse: Array, v: Array) -> None:
        """Add the effect of impulses of the rows of `impact` to v, right after it."""
        self.space.vectors[LAMBDA, : len(impulse)] = impulse
        point_kernels.add_impulses(self.address, v)
