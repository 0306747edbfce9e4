"""The interface of a run in progress to the modules that describe it."""

from __future__ import annotations

from abc import ABC, abstractmethod
from typing import TYPE_CHECKING, Any

import numpy as np

from ..dynamics.arguments import UserTorque
from ..dynamics.scene import Scene
from ..engine.arrays import Frames
from ..mechanism import Mechanism
from ..packing import Array, Ints
from .loop import Outcome, Steps
from .run_plan import RunPlan

if TYPE_CHECKING:
    from .contact_events import ContactEvents
    from .monitors import Watch
    from .sampling import Sampled


class Running(ABC):
    """The plan, scene, stepping loop and frames of a run, and how it has gone so far."""

    mech: Mechanism
    plan: RunPlan
    planned: RunPlan  # the initial plan, with the recorded frames
    tau: Any  # torques, a function of (t, q, v), or None
    user: UserTorque | None = None  # caller of a torque function
    sampled: Sampled | None = None  # a torque function that is called at samples
    scene: Scene
    steps: Steps
    out: Frames
    q: Array  # (nq + nx,) the present state, with the states of controls
    v: Array
    began: tuple[Array, Array]  # the first state that satisfies the constraints
    start: float  # [s]
    held: set[int]  # constraints that are active now
    switching: Any  # the active constraints, and the changes that are still to come
    watch: Watch | None = None  # conditions of switches, then a user's events
    events: ContactEvents | None = None  # decisions at events of contact points
    whole = False  # whether the run goes to the end of its plan, other than a stepper
    ended: Outcome
    met = ""  # description of the run until something came near

    @property
    def active(self) -> Ints:
        """Return the indices of the currently active constraints."""
        return np.array(sorted(self.held), dtype=np.int64)

    @abstractmethod
    def take_sample(self, t: float) -> None:
        """Call the held torque function at t and at the present state. Raises InputError."""

    @abstractmethod
    def repeated(self, plan: RunPlan) -> Running:
        """Return a run of the same motion by another plan, as far as it comes.

        Raises InputError.
        """
