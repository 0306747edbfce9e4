"""A run in progress, as those who judge it read it."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import numpy as np

from ..dynamics.arguments import UserTorque
from ..dynamics.scene import Scene
from ..engine.arrays import Frames
from ..mechanism import Mechanism
from ..packing import Array, Ints
from .loop import Outcome, Steps
from .plan import RunPlan

if TYPE_CHECKING:
    from .contact_events import ContactEvents


class Running:
    """The plan, scene, stepping loop and frames of a run, and how it has gone so far."""

    mech: Mechanism
    plan: RunPlan
    tau: Any  # torques, a function of (t, q, v), or None
    user: UserTorque | None = None  # caller of a torque function
    scene: Scene
    steps: Steps
    out: Frames
    q: Array  # (nq + nx,) the present state, with the states of controls
    v: Array
    began: tuple[Array, Array]  # the first state that satisfies the constraints
    held: set[int]  # constraints that are active now
    events: ContactEvents | None = None  # decisions at events of contact points
    ended: Outcome

    @property
    def done(self) -> int:
        """The number of recorded frames."""
        return int(self.steps.control["frame"])

    @property
    def active(self) -> Ints:
        """Return the indices of the currently active constraints."""
        return np.array(sorted(self.held), dtype=np.int64)
