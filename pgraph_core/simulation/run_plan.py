"""Plans of runs: the forces and contacts of a run, its method and steps, and its recorded times."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field, fields, replace
from functools import cached_property
from typing import TYPE_CHECKING, Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from ..dynamics.scene import Scene
from ..engine.tree.heights import lowest
from ..errors import InputError
from ..forces import BetweenPoints
from ..integrators import RK4, Method
from ..model import Contact, Force
from ..packing import Array, Drives, Ints, Loads
from ..result.records import Memory
from .conditions import ConditionOf
from .kinks import Kink
from .options import Tolerance, steps_between
from .switches import Change

if TYPE_CHECKING:
    from ..contact.tables import Tables
    from .event_scene import ContactPoint

NO_TIMES = np.zeros(0)
NO_SUBSTEPS = np.zeros(0, dtype=np.int64)
NO_GAINS = np.zeros(2)


class Idle(NamedTuple):
    """Inactive contacts with the ground."""

    contact_of: Mapping[str, str]  # by the bodies that they would keep above it
    numbers: Ints  # numbers of the bodies
    normal: Array  # normal of the ground
    bodies: tuple[Ints, Array]  # tables of the bodies for kernels

    def below(self, scene: Scene, q: Array) -> bool:
        """Check whether one of the bodies is below the ground at q."""
        return lowest(scene.address, self.numbers, *self.bodies, self.normal, q) < 0.0


@dataclass(frozen=True, eq=False)
class Way:
    """The method, steps and contacts of a run."""

    method: Method = RK4
    times: Array = field(default_factory=lambda: NO_TIMES)  # (n,) recorded times [s]
    substeps: Ints = field(default_factory=lambda: NO_SUBSTEPS)  # (n - 1,) fixed steps a frame
    width: Array = field(default_factory=lambda: NO_TIMES)  # (n - 1,) of them [s]
    tolerance: Tolerance | None = None  # None: fixed steps
    contacts: Tables | None = None  # active contacts
    contact_points: tuple[ContactPoint, ...] = ()  # and limits, of an event-driven run
    project: bool = False
    gains: Array = field(default_factory=lambda: NO_GAINS)  # (2,) of Baumgarte
    changes: tuple[Change, ...] = ()  # constraints that are switched on and off
    # times of a held function, with the start
    samples: Array = field(default_factory=lambda: NO_TIMES)
    corners: Array = field(default_factory=lambda: NO_TIMES)  # at which steps end [s]
    kinks: tuple[Kink, ...] = ()  # corners of prescribed motions
    parts: int = 1  # divisions of intervals shorter than a fixed step, more in a finer run
    shown: NDArray[np.bool_] | None = None  # mask of the requested frames, None for all
    why: str = ""  # this method
    told: tuple[str, ...] = ()  # notices
    too_wide: bool = False  # fixed steps exceed the method's limit at the start
    refused: InputError | None = None  # why the method asked for takes no contacts: another does

    @cached_property
    def step(self) -> float | None:
        """The step size [s], or None if the method chooses it."""
        return float(self.width.max(initial=0.0)) if self.tolerance is None else None

    @cached_property
    def stops(self) -> list[float]:
        """The times of frames at which steps stop for a change or a sample."""
        return [*(change.t for change in self.changes), *self.samples[1:].tolist()]

    @property
    def impulses(self) -> bool:
        """Return True if rigid contacts or joint limits act."""
        return self.contacts is not None and self.contacts.rigid

    @property
    def touches(self) -> int:
        """The number of contact pairs and limits that are recorded."""
        return len(self.contacts.touches) + len(self.contacts.limits) if self.contacts else 0

    @property
    def headed(self) -> dict[str, Any]:
        """Return entries for the result's header."""
        rtol = self.tolerance.rtol if self.tolerance is not None else None
        return {"method": self.method.name, "why": self.why, "step": self.step, "rtol": rtol}


@dataclass(frozen=True, eq=False, kw_only=True)
class RunPlan(Way):
    """A run, checked and complete except for its initial state.

    Contacts and limits are ignored until bodies come close to each other. The run then continues
    with the plan `way` from its current state.
    """

    drives: Drives
    driving: tuple[str, ...]  # names of the motors, servos and actuators among them
    loads: Loads
    acting: tuple[Force, ...]  # the forces in these tables
    varying: tuple[Force | Contact, ...] = ()  # parts with expressions, by their numbers
    wrapped: tuple[BetweenPoints, ...] = ()  # forces along paths past obstacles
    ranged: tuple[BetweenPoints, ...] = ()  # those with points that count in a range
    active: Ints  # indices of the constraints active at the start
    idle: Idle | None = None  # contacts of bodies that nothing keeps above the ground
    conditions: tuple[ConditionOf, ...] = ()  # under which constraints go on and off
    ever: Ints = field(default_factory=lambda: NO_SUBSTEPS)  # active constraints of all times
    length: float = 1.0  # length of the mechanism, a scale of errors [m]
    start: tuple[Array, Array] = (NO_TIMES, NO_TIMES)  # q, v if the call gives none
    memory: Memory | None = None  # the memory of the run that goes on
    states: Array | None = None  # (nx,) given states of controls, nan for those that are not
    tau: Any = None  # the controller of the scenario's gait
    way: Way | None = None  # continuation once bodies come close, None for no change
    declared: Tables | None = None  # contacts and limits that are ignored until then
    notices: tuple[str, ...] = ()
    header: Mapping[str, Any] = field(default_factory=dict)  # header of the result

    @cached_property
    def calls(self) -> bool:
        """Return True if steps call Python functions for the values of conditions."""
        return any(c.called for c in self.conditions)

    @cached_property
    def reusable(self) -> bool:
        """Return True if the next run can take the scene and the loop of a run by this plan."""
        acts = self.contacts or self.contact_points or self.stops or self.calls
        return not (acts or len(self.samples)) and self.memory is None

    @property
    def yields(self) -> bool:
        """Return True if steps end where soft and penalty contacts touch.

        Event-driven steps may be repeated, so that nothing is kept of the one before.
        """
        tables = self.contacts if self.way is None else self.way.contacts
        points = self.contact_points if self.way is None else self.way.contact_points
        return tables is not None and tables.compliant and not points

    @cached_property
    def touching(self) -> RunPlan:
        """Return the plan with contacts and limits active from the start of a run."""
        if self.way is None:
            return self
        given = {one.name: getattr(self.way, one.name) for one in fields(Way)}
        return replace(self, way=None, header={**self.header, **self.way.headed}, **given)

    def onward(self) -> RunPlan:
        """Return the plan with contacts and limits active from now on, with the run's frames."""
        other = self.touching
        told = tuple(dict.fromkeys((*self.told, *other.told)))
        kept = {"times": self.times, "shown": self.shown, "samples": self.samples}
        other = replace(other, changes=self.changes, told=told, **kept)
        if other.tolerance is not None:
            return other
        substeps, width = steps_between(self.times, float(other.width.max(initial=0.0)))
        return replace(other, substeps=substeps, width=width)
