"""The size of a mechanism, which errors are measured against."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from ..engine import layout as at

if TYPE_CHECKING:
    from .mechanism import Mechanism


def length_of(mech: Mechanism) -> float:
    """Largest of the mechanism's own lengths: links, centres of mass, radii of gyration [m]."""
    const = mech.system.const[1:]
    mass = np.where(const[:, at.MASS] > 0, const[:, at.MASS], np.inf)
    gyration = const[:, at.INERTIA : at.INERTIA + 3].sum(axis=1) / mass
    found = [np.sqrt(gyration.max(initial=0.0))]
    for column in (at.LINK, at.COM):
        found.append(np.linalg.norm(const[:, column : column + 3], axis=1).max(initial=0.0))
    return float(max(found))
