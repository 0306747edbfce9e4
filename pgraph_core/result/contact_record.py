"""ContactRecord: forces, gaps, phases and events of contacts and joint limits over a run."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from ..packing.system import Array
from ..portable import EqualByFields

SWING, ACCEPTANCE, SLIP, STANCE = "swing", "weight acceptance", "slip", "stance"
PHASES = (SWING, ACCEPTANCE, SLIP, STANCE)  # by number, as kernels know them
FREE, STOP = "free", "stop"  # a joint between its limits, and at one


class Event(NamedTuple):
    """A change of one contact point at one instant; a bounce goes from swing to swing."""

    t: float  # [s]
    contact: str  # its name, with the number of the point where it has several
    body: str
    before: str  # the phase it was in
    after: str
    cause: str

    def __str__(self) -> str:
        """The event as a sentence."""
        change = f"{self.before} to {self.after}" if self.before != self.after else self.after
        where = self.contact if self.body in self.contact else f"{self.contact} of {self.body}"
        return f"t = {self.t:.9g} s: {where}: {change}: {self.cause}"


@dataclass(frozen=True, eq=False)
class ContactRecord(EqualByFields):
    """By touch: the contact's name, or `name[body]` where it has several; n frames."""

    force: Mapping[str, Array] = field(default_factory=dict)
    """(n, 6) [torque, force] on the touch's body about its origin, world axes [N m, N]."""
    gap: Mapping[str, Array] = field(default_factory=dict)
    """(n,) smallest gap [m], negative where it penetrates; inf where nothing is near."""
    slip: Mapping[str, Array] = field(default_factory=dict)
    """(n,) fastest slip [m/s] of its touching points."""
    limit: Mapping[str, Array] = field(default_factory=dict)
    """(n,) torque or force of a joint limit along its coordinate [N m, N], by limit."""
    wrench: Array = field(default_factory=lambda: np.zeros((0, 0, 6)))
    """(n, nb, 6) [torque, force] of all contacts on every body about its origin, world axes."""

    residual: Array = field(default_factory=lambda: np.zeros((0, 3)))
    """(n, 3) see `Result.contact_residual`."""

    normal: Mapping[str, Array] = field(default_factory=dict)
    """(n,) part of the force off the ground [N], of touches with the ground."""
    phases: Mapping[str, NDArray[np.str_]] = field(default_factory=dict)
    """(n,) swing, weight acceptance, slip or stance by contact point; a limit: free or stop."""
    events: tuple[Event, ...] = ()
    """Changes, in order of time."""

    def arrays(self) -> dict[str, Array]:
        """All arrays by names for a file."""
        found = {
            f"contact {what}:{name}": array
            for what in KINDS
            for name, array in getattr(self, what).items()
        }
        if self.events:
            times, *texts = zip(*self.events)
            found |= {"contact event times": np.array(times), "contact events": np.array(texts)}
        found |= {"contact residual": self.residual} if self.residual.size else {}
        return found | ({"contact wrench": self.wrench} if self.wrench.size else {})

    @classmethod
    def of_arrays(cls, arrays: Mapping[str, Array]) -> ContactRecord:
        """The way back; other names are passed over."""
        parts: list[dict[str, Any]] = [
            {
                key.removeprefix(f"contact {what}:"): array
                for key, array in arrays.items()
                if key.startswith(f"contact {what}:")
            }
            for what in KINDS
        ]
        force, gap, slip, limit, normal, phases = parts
        wrench = arrays.get("contact wrench", NOTHING.wrench)
        texts = arrays.get("contact events", np.empty((5, 0))).T.tolist()
        times = arrays.get("contact event times", np.empty(0)).tolist()
        events = tuple(Event(t, *text) for t, text in zip(times, texts))
        residual = arrays.get("contact residual", NOTHING.residual)
        return cls(force, gap, slip, limit, wrench, residual, normal, phases, events)

    def columns(self) -> dict[str, NDArray[Any]]:
        """Columns of a table, units in their names."""
        found: dict[str, NDArray[Any]] = {}
        for name, force in self.force.items():
            found |= {f"{name} F{axis} [N]": force[:, 3 + i] for i, axis in enumerate("xyz")}
            if name in self.normal:
                found[f"{name} normal force [N]"] = self.normal[name]
            found |= {f"{name} gap [m]": self.gap[name], f"{name} slip [m/s]": self.slip[name]}
        found |= {f"{name} phase": phase for name, phase in self.phases.items()}
        return found | {f"{name} [N m, N]": torque for name, torque in self.limit.items()}


KINDS = ("force", "gap", "slip", "limit", "normal", "phases")
NOTHING = ContactRecord()
