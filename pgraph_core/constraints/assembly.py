"""Assembling: consistent positions and velocities from inconsistent ones, and how far it moved."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import asdict, dataclass
from typing import TYPE_CHECKING, Any

import numpy as np

from ..engine import motion
from ..errors import InputError, Problem, choices
from ..rotation import Array
from ..system import Ints
from .closing import SPEED, closed, contradiction, speed_contradiction, stopped
from .tied import Tied
from .tree import Tree

if TYPE_CHECKING:
    from ..mechanism import Mechanism
    from ..mechanism.scene import Scene

ASSEMBLY_ROUNDS = 50  # of the projection, which is enough from nearby
FAR = 0.5  # rad, m: a projection that moves more may have ended anywhere
NOTABLE = 1e-6  # rad, m, rad/s, m/s: a move that is said


@dataclass(frozen=True)
class Assembly:
    """What assembling a state changed."""

    moved: float  # largest move of a joint [rad or m]
    joint: str  # the body whose joint moved most; "" where none did notably
    turned: bool  # whether that move is an angle
    speed_change: float  # largest change of a joint velocity [rad/s or m/s]

    @property
    def notable(self) -> bool:
        """Whether anything moved by more than rounding."""
        return max(self.moved, self.speed_change) > NOTABLE

    def __str__(self) -> str:
        unit = "rad" if self.turned else "m"
        parts: list[str] = []
        if self.moved > NOTABLE:
            parts.append(f"joints were moved by up to {self.moved:.3g} {unit} ('{self.joint}')")
        if self.speed_change > NOTABLE:
            parts.append(f"velocities were changed by up to {self.speed_change:.3g} rad/s or m/s")
        if not parts:
            return "the state meets its constraints"
        return f"{' and '.join(parts)} to meet the constraints"

    def to_dict(self) -> dict[str, Any]:
        """The fields by name."""
        return asdict(self)


def assembled(
    mech: Mechanism, q: Array, v: Array, active: Ints, scene: Scene, t: float = 0.0
) -> tuple[Array, Array, Assembly]:
    """(q, v, report) that meets the constraints `active` of `scene`, near (q, v).

    In the mass metric. From nearby by the projection of runs; where that does not end, or ends
    far away, by damped steps. Raises InputError naming what cannot be met, and by how much.
    """
    held = tuple(mech.model.constraints[i] for i in active.tolist())
    new_q, new_v = q.copy(), v.copy()
    rounds = (
        motion.projection(scene.address, t, new_q, new_v, ASSEMBLY_ROUNDS) if len(active) else 0
    )
    changes = [float(np.max(np.abs(b - a), initial=0.0)) for a, b in ((q, new_q), (v, new_v))]
    if rounds >= 0 and max(changes) <= NOTABLE:
        return new_q, new_v, Assembly(changes[0], "", True, changes[1])
    tied = Tied(Tree(mech.model, mech.topology), held, q, v, t)
    far = rounds < 0 or float(np.abs(tied.tree.apart(q, new_q)).max(initial=0.0)) > FAR
    if far or not np.isfinite(new_v).all():
        ended = closed(tied)
        if not ended.closed and rounds < 0:
            raise InputError(contradiction(ended))
        new_q = ended.tied.q if ended.closed else new_q
        new_v = _speeds(tied.at(new_q))
    elif len(active):
        _speeds(tied.at(new_q, new_v))
    return new_q, new_v, _report(tied, new_q, new_v)


def _speeds(tied: Tied) -> Array:
    v, missed = stopped(tied)
    if missed > SPEED and float(np.abs(tied.at(tied.q, v).slip).max()) > NOTABLE:
        raise InputError(speed_contradiction(tied))
    return v


def _report(before: Tied, q: Array, v: Array) -> Assembly:
    step, turns = np.abs(before.tree.apart(before.q, q)), before.tree.turns
    moves = [(float(step[span].max()), name, span) for name, span in before.tree.joints]
    most, name, span = max(moves, key=lambda m: m[0], default=(0.0, "", slice(0, 0)))
    turned = bool(turns[span][step[span].argmax()]) if most > 0 else True
    change = float(np.max(np.abs(v - before.speeds), initial=0.0))
    return Assembly(most, name if most > NOTABLE else "", turned, change)


def indices(mech: Mechanism, names: Sequence[str] | None) -> Ints:
    """Indices of the named constraints; of the active ones where no names are given."""
    if names is None:
        return mech.active
    known = [c.name for c in mech.model.constraints]
    for name in names:
        if name not in known:
            text = f"no constraint is named '{name}'; choose one of {choices(known)}"
            raise InputError(Problem("assemble", "active", text))
    return np.array(sorted(known.index(name) for name in names), dtype=np.int64)
