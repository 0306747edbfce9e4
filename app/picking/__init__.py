"""Picking of points, axes and faces of bodies in the 3D view, for a field or a measurement."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field, replace
from typing import Literal, Self

from .. import scene, signals
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
    snapped: bool = False  # whether it is such a corner, centre, joint or tip near the ray


@dataclass(frozen=True)
class Aim:
    """A pick in progress: a spot for a field, two for a measurement, a body for an expression."""

    wants: Literal["point", "axis", "measure", "signal"]
    field: str = ""  # field that receives the spot
    index: tuple[int, ...] = ()  # index of its row in the field
    bodies: tuple[str, ...] = ()  # whose field it is
    part: Part | None = None  # list of the constraint, contact or force,
    name: str = ""  # and its name
    seen: int = 0  # version of the model at its start
    spots: tuple[Spot, ...] = ()  # measured spots
    under: Spot | None = None  # the pointer now


@dataclass(frozen=True)
class Client(scene.Client, signals.Client):
    aim: Aim | None = None  # pick in progress in its 3D view

    @property
    def aims(self) -> bool:
        return self.aim is not None

    def afresh(self) -> Self:
        return replace(super().afresh(), aim=None)

    def escaped(self) -> Self | None:
        return super().escaped() if self.aim is None else replace(self, aim=None)


@dataclass(frozen=True)
class State(scene.State, signals.State):
    clients: Mapping[int, Client] = field(default_factory=dict)
