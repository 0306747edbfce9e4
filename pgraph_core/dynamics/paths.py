"""Lengths and moment arms of the forces along paths of a model."""

from __future__ import annotations

from typing import Any

import numpy as np

from ..engine.compiler.jit import ready
from ..engine.motion import path_arms
from ..forces import BetweenPoints, Spring
from ..packing import Array
from ..packing.packed import Packed
from .scene import NO_CONSTRAINTS, Scene


class Paths:
    """The paths of the springs, struts and other forces along paths of a model, in its order."""

    def __init__(self, packed: Packed):
        """Pack a spring without a force along each path."""
        given = [f for f in packed.model.forces if isinstance(f, BetweenPoints)]
        self.names = tuple(f.name for f in given)
        springs = tuple(_idle(f) for f in given)
        self._scene = Scene(packed, packed.passive, packed.loads(springs), NO_CONSTRAINTS)
        self._kernel, self._still = ready(path_arms), np.zeros(packed.nv)

    def measured(self, q: Array) -> tuple[Array, Array]:
        """Return the lengths (n,) [m] and the moment arms -dL/dq (n, nv) [m, 1] at q."""
        n, nv = len(self.names), len(self._still)
        lengths, arms = np.empty(n), np.zeros((n, nv))
        self._kernel(self._scene.address, q, self._still, lengths, arms)
        return lengths, arms


def _idle(f: BetweenPoints) -> Spring:
    """Return a spring of stiffness 0 along the path of a force."""
    path: dict[str, Any] = {
        name: getattr(f, name) for name in ("name", "body", "other", "point", "other_point", "via")
    }
    return Spring(**path, stiffness=0.0, rest=0.0)
