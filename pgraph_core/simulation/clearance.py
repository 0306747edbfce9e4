"""Runs that leave contacts and limits out until something comes near, and gaps over a run."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping
from dataclasses import dataclass
from typing import Any

import numpy as np

from ..contact import solids
from ..contact.tables import Tables
from ..dynamics.scene import NO_CONSTRAINTS, Scene
from ..engine import layout as at
from ..engine.arrays import Guard
from ..engine.compiler.address import address_of, address_of_array, buffer, unnamed
from ..engine.contact import clearance as kernels
from ..engine.records import CLEARANCE, CONTACT, LIMIT, POSE, rows_of, table
from ..engine.records import SWING as IN_SWING
from ..mechanism import Mechanism
from ..model.fields import EVERY, GROUND
from ..packing.system import Array
from ..portable import Unportable
from ..result.records import FREE, PHASES, ContactRecord

SWING = PHASES[IN_SWING]
LEAST_ROOM = 8  # contact points for which a search has room


class Clearance(Unportable):
    """What may touch, behind one address: `look_back` is the kernel that watches it."""

    def __init__(self, mech: Mechanism, tables: Tables):
        """Nothing is known to be free yet."""
        count = len(tables.candidates.on_ground) + len(tables.candidates.pairs)
        self._kept = Guard(
            tables.geometry,
            tables.ground,
            tables.candidates,
            table(POSE, len(tables.geometry.shapes)),
            solids.search_space(tables.geometry, len(tables.candidates.members)),
            table(CONTACT, max(tables.room, LEAST_ROOM)),
            _limits(tables),
            table(CLEARANCE, 1),
            np.zeros(len(mech.packed.rows)),
            np.zeros(count),
        )
        self._buffer = buffer()
        kernels.save_guard(self._buffer, unnamed(self._kept))
        self.address = address_of_array(self._buffer)

    @property
    def look_back(self) -> int:
        """Address of the kernel that looks back at each step."""
        return address_of(kernels.watch_clearance)

    def gaps(self, scene: Scene, q: Array, pairs: int) -> Array:
        """(n, pairs) smallest gaps of contact pairs at states q (n, nq) [m]; inf: unknown."""
        found = np.full((len(q), pairs), np.inf)
        kernels.frame_gaps(scene.address, self.address, np.ascontiguousarray(q), found)
        return found


def _limits(tables: Tables) -> Any:
    ints, floats, terms, signs = tables.limit_blocks
    rows = [
        (int(terms[block[at.B_TERM], 1]), int(terms[block[at.B_TERM], 0]), sign, value)
        for block, sign, value in zip(ints, signs[ints[:, at.B_TERM]], floats[:, at.VALUE])
    ]
    return rows_of(LIMIT, rows)


@dataclass(frozen=True)
class Gaps(Mapping[str, Array]):
    """Gaps of contact pairs by name, found when they are first asked for."""

    names: tuple[str, ...]
    find: Callable[[], Array]  # (n, pairs)

    def _found(self) -> dict[str, Array]:
        if "_all" not in self.__dict__:
            self.__dict__["_all"] = dict(zip(self.names, self.find().T))
        return self.__dict__["_all"]

    def __getitem__(self, name: str) -> Array:
        """(n,) of one pair."""
        return self._found()[name]

    def __iter__(self) -> Iterator[str]:
        """Over the names."""
        return iter(self.names)

    def __len__(self) -> int:
        """How many pairs."""
        return len(self.names)

    def __repr__(self) -> str:
        """As of a dictionary."""
        return repr(self._found())

    def __reduce__(self) -> Any:
        """A plain dictionary."""
        return dict, (self._found(),)

    def __deepcopy__(self, memo: Any) -> dict[str, Array]:
        """A plain dictionary."""
        return {name: gap.copy() for name, gap in self._found().items()}


def gaps_of(mech: Mechanism, tables: Tables, q: Array, known: Mapping[str, Array]) -> Gaps:
    """Gaps of contact pairs at the states q (n, nq); of members of one contact those `known`."""
    names = tuple(t.name for t in tables.touches)

    def find() -> Array:
        scene = Scene(mech.packed, mech.packed.passive, mech.packed.loads(()), NO_CONSTRAINTS)
        found = Clearance(mech, tables).gaps(scene, q, len(names))
        for k, pair in enumerate(tables.touches):
            if pair.body == EVERY and pair.name in known:
                found[:, k] = known[pair.name]
        return found

    return Gaps(names, find)


def untouched(mech: Mechanism, tables: Tables, q: Array) -> ContactRecord:
    """The record of a run over the states q in which nothing touched; its zeros take no room."""
    n, names = len(q), [t.name for t in tables.touches]
    still = np.broadcast_to(0.0, (n,))
    return ContactRecord(
        force=dict.fromkeys(names, np.broadcast_to(0.0, (n, 6))),
        gap=gaps_of(mech, tables, q, {}),
        slip=dict.fromkeys(names, still),
        limit=dict.fromkeys(tables.limits, still),
        wrench=np.broadcast_to(0.0, (n, mech.nb, 6)),
        normal={t.name: still for t in tables.touches if t.other == GROUND},
        phases=dict.fromkeys(names, np.broadcast_to(SWING, (n,)))
        | dict.fromkeys(tables.limits, np.broadcast_to(FREE, (n,))),
    )
