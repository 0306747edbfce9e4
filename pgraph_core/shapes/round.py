"""Solids of revolution about z: their profiles, mass and drawn surfaces."""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import Any

import numpy as np

from ..errors import needed
from .contract import Volume
from .solid import Array

SECTIONS = 28  # sections of a tapered solid that is drawn
ROUND = 20  # points around a ball or a rim
_ANGLES = np.linspace(0, 2 * np.pi, ROUND, endpoint=False)
RING = np.column_stack((np.cos(_ANGLES), np.sin(_ANGLES), 0 * _ANGLES)) / 2  # diameter 1
BALL = np.concatenate([np.roll(RING * 2, k, axis=1) for k in range(3)])  # radius 1
Segment = tuple[float, float, float, float, float]  # (from, to, a, b, c), r² = a + b z + c z²


def turned(profile: Sequence[Segment]) -> Volume:
    """Return the volume of discs along z, exact with Gauss quadrature."""
    nodes, weights = np.polynomial.legendre.leggauss(3)
    z, dz, square = [], [], []
    for low, high, a, b, c in profile:
        at = (low + high) / 2 + (high - low) / 2 * nodes
        z.append(at)
        dz.append((high - low) / 2 * weights)
        square.append(a + b * at + c * at * at)
    z, area = np.concatenate(z), math.pi * np.concatenate(dz) * np.concatenate(square)
    volume = float(area.sum())
    middle = float(area @ z) / volume
    disc = area * np.concatenate(square) / 4  # inertia of each disc about a diameter
    across = float(disc.sum() + area @ (z - middle) ** 2)
    return volume, np.array((0.0, 0.0, middle)), np.diag((across, across, 2 * float(disc.sum())))


def far_radius(shape: Any) -> float:
    """Return the radius at the far end (+z)."""
    return shape.radius if shape.end_radius is None else shape.end_radius


def revolved(radii: Array, z: Array) -> Any:
    """Return a trimesh of a profile from one pole to the other."""
    radii[[0, -1]] = 0.0
    return needed("trimesh").creation.revolve(np.column_stack((radii, z)), sections=SECTIONS)
