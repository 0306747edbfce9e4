"""ContactRecord: what contacts and joint limits did over a run, however it was stepped."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field

import numpy as np

from .system import Array


@dataclass(frozen=True)
class ContactRecord:
    """By touch: the contact's name, or `name[body]` where it has several; n frames."""

    force: Mapping[str, Array] = field(default_factory=dict)
    """(n, 6) [torque, force] on the touch's body about its origin, world axes [N m, N]."""
    gap: Mapping[str, Array] = field(default_factory=dict)
    """(n,) smallest gap [m], negative where it penetrates; inf where nothing is near."""
    slip: Mapping[str, Array] = field(default_factory=dict)
    """(n,) fastest slip [m/s] of what touches."""
    limit: Mapping[str, Array] = field(default_factory=dict)
    """(n,) torque or force of a joint limit along its coordinate [N m, N], by limit."""
    wrench: Array = field(default_factory=lambda: np.zeros((0, 0, 6)))
    """(n, nb, 6) [torque, force] of all contacts on every body about its origin, world axes."""

    def arrays(self) -> dict[str, Array]:
        """Everything by a name that says what it is of, for a file."""
        found = {
            f"contact {what}:{name}": array
            for what in KINDS
            for name, array in getattr(self, what).items()
        }
        return found | ({"contact wrench": self.wrench} if self.wrench.size else {})

    @classmethod
    def of_arrays(cls, arrays: Mapping[str, Array]) -> ContactRecord:
        """The way back; other names are passed over."""
        parts = [
            {
                key.removeprefix(f"contact {what}:"): array
                for key, array in arrays.items()
                if key.startswith(f"contact {what}:")
            }
            for what in KINDS
        ]
        force, gap, slip, limit = parts
        return cls(force, gap, slip, limit, arrays.get("contact wrench", NOTHING.wrench))

    def columns(self) -> dict[str, Array]:
        """Columns of a table, units in their names."""
        found: dict[str, Array] = {}
        for name, force in self.force.items():
            found |= {f"{name} F{axis} [N]": force[:, 3 + i] for i, axis in enumerate("xyz")}
            found |= {f"{name} gap [m]": self.gap[name], f"{name} slip [m/s]": self.slip[name]}
        return found | {f"{name} [N m, N]": torque for name, torque in self.limit.items()}


KINDS = ("force", "gap", "slip", "limit")
NOTHING = ContactRecord()
