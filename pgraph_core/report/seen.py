"""What of a motion is compared: where the bodies' tips are, and how the bodies are turned."""

from __future__ import annotations

from collections.abc import Callable
from typing import NamedTuple

import numpy as np

from ..mechanism import Mechanism
from ..mechanism.bodies import bodies_over, turned
from ..mechanism.scale import length_of
from ..system import Array


class Seen(NamedTuple):
    """Observables of n states."""

    vectors: Array  # (n, a, k) points [m], or whatever has a norm
    turns: Array  # (n, b, 4) rotations, unit quaternions [w, x, y, z]


See = Callable[[Array], Seen]  # of states q (n, nq)


def motion_of_bodies(mech: Mechanism) -> See:
    """Every body's tip and rotation, whatever the bodies hang on."""
    names = mech.names
    tips = np.array([mech.model.body(name).tip_point for name in names]).reshape(-1, 3)

    def see(q: Array) -> Seen:
        n = len(q)
        still, none = np.zeros((n, mech.nv)), np.zeros((n, mech.nb, 6))
        pose = bodies_over(mech.system, q, still, still, none).pose
        return Seen(pose[..., :3] + turned(pose[..., 3:], tips), pose[..., 3:])

    return see


def reach(mech: Mechanism) -> float:
    """The characteristic length: the longest way from a root to a tip, along the links [m]."""
    model, far = mech.model, {"ground": 0.0}
    longest = length_of(mech)
    for name in mech.names:
        body = model.body(name)
        link = 0.0 if body.parent == "ground" else float(np.linalg.norm(body.link))
        far[name] = far[body.parent] + link
        longest = max(longest, far[name] + float(np.linalg.norm(body.tip_point)))
    return longest or 1.0
