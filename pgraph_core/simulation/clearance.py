"""Gaps between shapes that may touch."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

import numpy as np

from ..contact import packed_shapes
from ..contact.tables import Tables
from ..contact.tables import tables as tables_of
from ..dynamics.scene import NO_CONSTRAINTS, Scene
from ..engine.arrays import Guard
from ..engine.compiler.address import address_of, address_of_array, buffer, unnamed
from ..engine.contact import clearance as kernels
from ..engine.records import CLEARANCE, CONTACT, LIMIT, POSE, rows_of, table
from ..fields import EVERY
from ..mechanism import Mechanism
from ..packing import Array
from ..portable import Unportable
from ..result.records import Named

LEAST_ROOM = 8  # contact points for which a search has room


class Clearance(Unportable):
    """Contact candidates and conditions that may become true, sharing one kernel address."""

    def __init__(
        self, mech: Mechanism, tables: Tables | None, conditions: Any = None, margin: float = 0.0
    ):
        """Initialise without any pairs or conditions that are known to be clear.

        `conditions` are records of LIMIT; things are near from a gap of `margin` on [m].
        """
        given = tables_of(mech.packed, ()) if tables is None else tables
        limits = [] if tables is None else [_limits(tables)]
        limits += [] if conditions is None else [conditions]
        count = len(given.candidates.on_ground) + len(given.candidates.pairs)
        self._kept = Guard(
            geometry=given.geometry, ground=given.ground, candidates=given.candidates,
            poses=table(POSE, len(given.geometry.shapes)),
            search=packed_shapes.search_space(given.geometry, len(given.candidates.members)),
            found=table(CONTACT, max(given.room, LEAST_ROOM) if given.touches else 0),
            limits=np.concatenate(limits), state=table(CLEARANCE, 1),
            reach=np.zeros(len(mech.packed.run.rows)), gaps=np.zeros(count),
        )  # fmt: skip
        self._kept.state["margin"] = margin
        self._buffer = buffer()
        kernels.save_guard(self._buffer, unnamed(self._kept))
        self.address = address_of_array(self._buffer)

    @property
    def look_back(self) -> int:
        """The address of the kernel that checks each completed step."""
        return address_of(kernels.watch_clearance)

    def gaps(self, scene: Scene, q: Array, pairs: int) -> Array:
        """Return gaps of contact pairs (n, pairs) [m] at states q (n, nq), or inf if unknown."""
        found = np.full((len(q), pairs), np.inf)
        kernels.frame_gaps(scene.address, self.address, np.ascontiguousarray(q), found)
        return found


def _limits(tables: Tables) -> Any:
    """Return LIMIT records for the limits of joints. A run with others does not look ahead."""
    rows = [
        (*one.at_q.tolist(), *one.at_v.tolist(), *one.weights.tolist(), one.bound, -1)
        for one in tables.coordinate_limits
        if len(one.at_q) == 1
    ]
    return rows_of(LIMIT, rows)


def gaps_later(mech: Mechanism, tables: Tables, q: Array, known: Mapping[str, Array]) -> Named:
    """Return gaps of contact pairs at the states q (n, nq), computed on first access.

    `known` are gaps for members of one contact.
    """

    def found() -> dict[str, Array]:
        scene = Scene(mech.packed, mech.packed.passive, mech.packed.loads(()), NO_CONSTRAINTS)
        gaps = Clearance(mech, tables).gaps(scene, q, len(tables.touches))
        own = {touch.name: gap for touch, gap in zip(tables.touches, gaps.T)}
        return own | {
            t.name: known[t.name] for t in tables.touches if t.body == EVERY and t.name in known
        }

    return Named(found, "contact_gap", "contact")
