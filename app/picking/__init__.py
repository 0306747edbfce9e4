"""Picking of points, axes and faces of bodies in the 3D view, for a field or a measurement."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Literal

from ..constraints import Part

Vector = tuple[float, float, float]
GROUND = "ground"


@dataclass(frozen=True)
class Spot:
    """A point on a body or on the ground."""

    body: str
    point: Vector  # position in the body's axes [m]
    direction: Vector | None  # unit vector: the normal of a face, or the axis of what is round
    what: str  # "corner", "centre of a face", "flat face", ...


@dataclass(frozen=True)
class Aim:
    """A pick in progress, with one spot for the cells of a field or two for a measurement."""

    wants: Literal["point", "axis", "measure"]
    field: str = ""  # field that receives the spot
    index: tuple[int, ...] = ()  # index of its row in the field
    bodies: tuple[str, ...] = ()  # whose field it is
    part: Part | None = None  # list of the constraint, contact or force,
    name: str = ""  # and its name
    spots: tuple[Spot, ...] = ()  # measured spots
    under: Spot | None = None  # the pointer now
