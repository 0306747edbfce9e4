"""Egg along z: two half ellipsoids of revolution with a common radius, `length` below it and
`end_radius` above it.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import Any

import numpy as np

from ..engine.records import EGG
from .contract import Kind, Size, Volume, around
from .solid import Array, Solid

RINGS, SECTORS = 24, 32  # of what is drawn


class HalfEllipsoids(Solid):
    """A solid egg, whose `half` is that of the half axes below and above its radius."""

    @property
    def box(self) -> tuple[Array, Array]:
        a, low, high = self.radii or ()
        return np.array((a, a, (low + high) / 2)), np.array((0.0, 0.0, (high - low) / 2))

    @property
    def rounds(self) -> None:
        return None


def egg(radius: float, low: float, high: float) -> Solid:
    """Create an egg along z."""
    return HalfEllipsoids(EGG, np.zeros((0, 3)), radii=(radius, low, high))


class Egg(Kind):
    name = "egg"
    needs = ("radius", "length", "end_radius")

    def half_turn(self, shape: Any, plane: int) -> int | None:
        return 0 if plane == 2 else None

    def fitted(self, edges: Sequence[float]) -> dict[str, Any]:
        return {"radius": edges[0] / 2, "length": edges[2] / 2, "end_radius": edges[2] / 2}

    def edges(self, shape: Any) -> Size:
        return 2 * shape.radius, 2 * shape.radius, shape.length + shape.end_radius

    def corners(self, shape: Any) -> Array:
        middle = (0.0, 0.0, (shape.end_radius - shape.length) / 2)
        return middle + around(np.array(self.edges(shape)) / 2)

    def volume(self, shape: Any, unit: str = "m") -> Volume:
        a, halves = shape.radius, np.array((shape.length, shape.end_radius))
        parts = 2 / 3 * math.pi * a * a * halves
        volume = float(parts.sum())
        z = float(parts @ (halves * (-3 / 8, 3 / 8))) / volume
        across = volume * a * a / 5 + float(parts @ halves**2) / 5 - volume * z * z
        moments = (across, across, volume * 2 / 5 * a * a)
        return volume, np.array((0.0, 0.0, z)), np.diag(moments)

    def surface(self, shape: Any) -> tuple[Array, Array]:
        at, turn = (
            np.linspace(-np.pi / 2, np.pi / 2, RINGS),
            np.arange(SECTORS) * 2 * np.pi / SECTORS,
        )
        high = np.where(at > 0, shape.end_radius, shape.length) * np.sin(at)
        across = shape.radius * np.cos(at)
        ring = np.stack((np.cos(turn), np.sin(turn)), axis=1)
        places = np.concatenate(
            [np.column_stack((r * ring, np.full(SECTORS, z))) for r, z in zip(across, high)]
        )
        i, k = np.meshgrid(np.arange(RINGS - 1), np.arange(SECTORS), indexing="ij")
        a, b = (i * SECTORS + k).ravel(), (i * SECTORS + (k + 1) % SECTORS).ravel()
        low, up = np.stack((a, b, b + SECTORS), 1), np.stack((a, b + SECTORS, a + SECTORS), 1)
        return places, np.concatenate((low, up))

    def solids(self, shape: Any) -> tuple[Solid, ...]:
        return (egg(shape.radius, shape.length, shape.end_radius),)
