"""The scene of an event-driven run: contact points, and the blocks that act in each phase."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from ..contact.sites import Site, with_sites
from ..contact.tables import Tables
from ..dynamics.callback import UserTorque
from ..dynamics.scene import Scene
from ..engine import layout as at
from ..engine import motion
from ..engine.arrays import Phased, SiteLinks, Sites
from ..engine.compiler.address import address_of, address_of_array, buffer, unnamed
from ..engine.constraints.proximal import LAMBDA, RHS
from ..engine.contact import phases
from ..engine.contact import sites as site_kernels
from ..mechanism import Mechanism
from ..packing.system import Array, Drives, Ints, Loads


class EventScene(Scene):
    """A scene with sites; `arrange` makes a change of `sites_i[:, S_PHASE]` effective."""

    once = False  # a step that ends at an event is taken again, shorter

    def __init__(
        self,
        mech: Mechanism,
        drives: Drives,
        loads: Loads,
        active: Ints,
        sites: Sequence[Site],
        frames: int,
        *,
        contacts: Tables | None = None,
        user: UserTorque | None = None,
    ):
        """All sites are in swing. `frames` is how many are to be recorded."""
        packed = mech.packed
        given = (mech.model, mech.topology, packed.system)
        extended, tables = with_sites(packed.blocks, sites, *given)
        count = len(sites)
        whole = len(packed.blocks.names) + 2 * np.arange(count)
        everything = np.concatenate((active, whole))
        super().__init__(
            packed, drives, loads, everything, contacts=contacts, user=user, blocks=extended
        )
        self.activate(active)
        self.bilateral = int(self.active[0])
        self.sites, (self.sites_i, self.sites_f) = tuple(sites), tables
        self.every = np.concatenate(([count], self.sites_i[:, at.S_SLIDE]))
        self.watched = np.zeros((4, 3 * count))
        self.frame_phases = np.zeros((frames, count), dtype=np.int64)
        self.frames = np.zeros((frames, count, at.SITE_FRAME))
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
        links = SiteLinks(
            tree=address_of(motion.acceleration),
            bare=address_of_array(tree),
            held=address_of_array(held),
            phased=address_of(phases.phased_acceleration),
            record=address_of(motion.record),
            observe=address_of(site_kernels.observe),
            project=address_of(motion.projection),
        )
        count, rows = len(self.sites), len(self.space.omega)
        parts = Sites(
            links,
            self.sites_i,
            self.sites_f,
            self.every,
            self.watched,
            np.zeros((3 * count + 2, max(rows, 1))),
            np.zeros((3 * count + 2, max(count, 1))),
            self.frame_phases,
            self.frames,
        )
        self._alive = (tree, held, both, parts)
        self._buffer = buffer()
        phases.save_phased(self._buffer, unnamed(Phased(self._kept, parts)))
        self.address, self._held_address = address_of_array(self._buffer), links.held

    @property
    def held(self) -> int:
        """Address of the scene whose active blocks are projected."""
        return int(self._held_address)

    @property
    def phase(self) -> Ints:
        """(ns,) phases of the sites."""
        return self.sites_i[:, at.S_PHASE]

    def switch(self, constraints: Ints) -> None:
        """Activate these constraints in addition to those of the phases."""
        self.activate(constraints)
        self.bilateral = int(self.active[0])
        self.arrange()

    def arrange(self) -> None:
        """Activate the blocks of constraints, then of stances and limits, then of sliding sites."""
        phase = self.phase
        stances = self.sites_i[phase == at.STANCE, at.S_STANCE]
        sliding = self.sites_i[(phase == at.SLIP) | (phase == at.ACCEPTANCE)]
        for active, last in ((self.active, at.S_SLIDE), (self._held, at.S_GAP)):
            chosen = np.concatenate((stances, sliding[:, last]))
            active[1 : self.bilateral + 1] = self.active[1 : self.bilateral + 1]
            active[self.bilateral + 1 : self.bilateral + 1 + len(chosen)] = chosen
            active[0] = self.bilateral + len(chosen)

    def hold(self, s: int) -> None:
        """Let a stance of site s hold the point of the ground that it is over."""
        block = self.sites_i[s, at.S_STANCE]
        if self.blocks.blocks_i[block, at.B_TYPE] == at.T_POINT:
            f = self.sites_f[s]
            normal = f[at.S_NORMAL : at.S_NORMAL + 3]
            foot = f[at.S_PLACE : at.S_PLACE + 3] - f[at.S_DISTANCE] * normal
            self.blocks.blocks_f[block, at.PB : at.PB + 3] = foot

    def impact(self, t: float, q: Array, v: Array, sites: Sequence[int]) -> tuple[Array, Array]:
        """(Ω, velocities) of the rows of constraints and of all rows of these sites."""
        blocks = self.sites_i[list(sites), at.S_SLIDE]
        self.active[0] = self.bilateral + len(blocks)
        self.active[self.bilateral + 1 : self.active[0] + 1] = blocks
        m = site_kernels.impulse_rows(self.address, t, q, v)
        return self.space.omega[:m, :m].copy(), self.space.vectors[RHS, :m].copy()

    def strike(self, impulse: Array, v: Array) -> None:
        """Add the effect of impulses of the rows of `impact` to v, right after it."""
        self.space.vectors[LAMBDA, : len(impulse)] = impulse
        site_kernels.add_impulses(self.address, v)
