"""What to say where constraints block a motion that their rows leave free: to second order only."""

from __future__ import annotations

import numpy as np

from ..rotation import Array
from .tied import Tied

FAINT = 1e-3  # of the largest: singular values of rows that runs take for none
MOSTLY = 0.9  # of the gap: what lies where rows say next to nothing
NAMED = 0.3  # of the largest: a constraint that takes part
OTHER = 1e-4  # of the mechanism's size: a gap that is no drift


def blocked(tied: Tied) -> str:
    """A sentence on a motion whose gap the rows do not see; "" where it is something else.

    Rows J of such a motion vanish where it begins: its gap grows as its square, against a force
    of infinite size, and projection by J cannot take it back.
    """
    rows, gap = tied.scaled[tied.holonomic], tied.gap[tied.holonomic]
    whole = float(np.linalg.norm(gap))
    if not 0.0 < whole <= OTHER * tied.size:
        return ""
    u, s, _ = np.linalg.svd(rows)
    sizes = np.concatenate((s, np.zeros(len(u) - len(s))))
    faint = u[:, sizes <= FAINT * sizes[0]]
    combination = faint @ (faint.T @ gap)
    if np.linalg.norm(combination) < MOSTLY * whole:
        return ""
    motion = tied.step(rows.T @ combination)
    joint, _ = max(tied.tree.joints, key=lambda j: float(np.linalg.norm(motion[j[1]])))
    full = np.zeros(len(tied.gap))
    full[tied.holonomic] = combination
    names = " and ".join(f"'{name}'" for name in _parts(tied, full))
    return (
        f"constraints {names} leave '{joint}' free to move to first order and block it to second, "
        f"which no finite force does: they are off by {np.abs(gap).max():.2g} m where their rows "
        "say nothing new. Give one of them a kind with fewer rows (line, plane, distance), or a "
        "joint the freedom that is missing; with stabilise=None the run goes on and the gap "
        "stands in constraint_drift"
    )


def _parts(tied: Tied, combination: Array) -> list[str]:
    """Constraints with a notable share of a combination of rows."""
    share = {g.constraint.name: 0.0 for g in tied.groups}
    for g in tied.groups:
        most = float(np.abs(combination[g.rows]).max(initial=0.0))
        share[g.constraint.name] = max(share[g.constraint.name], most)
    largest = max(share.values())
    return [name for name, x in share.items() if x > NAMED * largest]
