"""Scene: a mechanism with its forces and constraints, and the workspaces of the kernels."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import numpy as np

from .blocks import Blocks
from .kernels import layout as at
from .kernels import motion
from .kernels.handle import address_of_array, buffer
from .system import Array, Drives, Ints, Loads

if TYPE_CHECKING:
    from .callback import UserTorque
    from .mechanism import Mechanism

NO_GAINS = np.zeros(2)
NO_USER = (0, np.zeros((0, 0)), np.zeros(0, dtype=np.int64))


class Scene:
    """What kernels take of a run behind one `address`; it belongs to one thread at a time.

    `active` may be changed between calls, and `given` (nv,), the torques beside all others.
    """

    def __init__(
        self,
        mech: Mechanism,
        drives: Drives,
        loads: Loads,
        active: Ints,
        *,
        gains: Array = NO_GAINS,
        user: UserTorque | None = None,
    ):
        """`active` are the indices of constraints."""
        self.mech, self.drives, self.loads = mech, drives, loads
        self.blocks: Blocks = mech.blocks
        self.active = np.zeros(len(self.blocks.blocks_i) + 1, dtype=np.int64)
        self.given = np.zeros(mech.nv)
        self.user = user
        self.work = np.zeros((len(mech.system.rows), at.WORK))
        self.space = space(mech.nq, mech.nv, len(mech.system.rows), self.blocks, active)
        self.activate(active)
        tables = (*self.blocks[2:], self.active)
        acts = NO_USER if user is None else (user.address, user.exchange, user.answer)
        parts = (self.work, self.space, gains, self.given, acts)
        self._kept = (*mech.tree, drives, loads, tables, *parts)
        self._buffer = buffer()
        motion.save_scene(self._buffer, self._kept)
        self.address = address_of_array(self._buffer)

    def activate(self, constraints: Ints) -> None:
        """Switch on the blocks of these constraints, and no others."""
        first = self.blocks.first.tolist()
        spans = [(first[i], first[i + 1]) for i in constraints.tolist()]
        chosen = [block for span in spans for block in range(*span)]
        self.active[0] = len(chosen)
        self.active[1 : len(chosen) + 1] = chosen
        self._spans = [(self.blocks.names[i], *s) for i, s in zip(constraints.tolist(), spans)]

    def forces(self, wrenches: Array) -> dict[str, Array]:
        """{name: (..., 6)} [torque, force] on `body` at `point` from wrenches (blocks, ..., 6)."""
        return {
            name: wrenches[a] if b == a + 1 else wrenches[a:b].sum(axis=0)
            for name, a, b in self._spans
        }


def space(nq: int, nv: int, rows: int, blocks: Blocks, active: Ints) -> tuple[Any, ...]:
    """Workspace of the constraint kernels, for as many rows as may be active at once."""
    count = len(blocks.blocks_i)
    chosen = [b for i in active.tolist() for b in range(blocks.first[i], blocks.first[i + 1])]
    m = -(-int(blocks.blocks_i[chosen, at.B_SIZE].sum()) // 3) * 3  # whole blocks of three
    return (
        np.zeros((count, 3 * nv)),
        np.zeros((count, nv + at.SLOT), dtype=np.int64),
        np.zeros((m, m)),
        np.zeros((m, m)),
        np.zeros((count, at.PLACE)),
        np.zeros((9, max(m, nq, 3))),
        np.zeros((rows, 3)),
        np.zeros((rows, 6)),
        np.zeros((2, 18)),
        np.zeros((m, m)),
        np.zeros(nv, dtype=np.int64),
    )
