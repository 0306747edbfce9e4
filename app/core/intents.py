"""What one person is in the middle of: how numbers are shown, what is being picked, what was asked.

Degrees and millimetres are of the page alone: models and files hold radians and metres.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Any, Literal

import pgraph_core as pg

Part = Literal["constraints", "contacts", "forces"]
Slot = Literal["body", "other"]
Quantity = Literal["angle", "length", "number"]


@dataclass(frozen=True)
class Display:
    """The units and forms in which one page shows and takes numbers."""

    angle: Literal["rad", "deg"] = "rad"
    length: Literal["m", "mm"] = "m"
    turn: Literal["quaternion", "euler", "axis"] = "quaternion"  # of an orientation
    about: Literal["com", "origin"] = "com"  # of an inertia

    def unit(self, quantity: Quantity) -> str:
        """The name of the unit a quantity is shown in."""
        return {"angle": self.angle, "length": self.length, "number": ""}[quantity]

    def shown(self, value: float, quantity: Quantity) -> float:
        """An SI value in the page's unit: of the nearest numbers the one with fewest digits."""
        if quantity == "length" and self.length == "mm":
            return _shortest(value * 1000, value, quantity, self)
        if quantity == "angle" and self.angle == "deg":
            return _shortest(math.degrees(value), value, quantity, self)
        return value

    def si(self, value: float, quantity: Quantity) -> float:
        """A value in the page's unit as SI."""
        if quantity == "length" and self.length == "mm":
            return value / 1000
        if quantity == "angle" and self.angle == "deg":
            return math.radians(value)
        return value


def _shortest(near: float, value: float, quantity: Quantity, display: Display) -> float:
    """The shortest decimal that is read back as `value`: 30 deg stay 30, not 29.999999999999996."""
    rounded = (float(f"{near:.{digits}g}") for digits in (12, 14, 15, 16))
    return next((x for x in rounded if display.si(x, quantity) == value), near)


@dataclass(frozen=True)
class Picking:
    """A body is to be clicked: for a part that is there, or the next one of a new part."""

    part: Literal["constraints", "contacts", "forces", "loops", "limits"]
    kind: str  # of the part; of a loop the kind of its joint
    slot: Slot = "body"
    name: str | None = None  # of the part; None: a new one
    body: str | None = None  # of a new part, once that is picked


@dataclass(frozen=True)
class Assemble:
    """Move the initial state onto the constraints."""


@dataclass(frozen=True)
class ReadMesh:
    """Keep an uploaded mesh as a file and make it the shape of these bodies."""

    bodies: tuple[str, ...]
    file: str
    content: bytes


@dataclass(frozen=True)
class ReadArchive:
    """Keep the meshes of an uploaded zip and open its model."""

    file: str
    content: bytes


@dataclass(frozen=True)
class FillMass:
    """Mass, centre of mass and inertia of these bodies from their shapes and a density."""

    bodies: tuple[str, ...]
    density: float  # [kg/m³]


@dataclass(frozen=True)
class Errand:
    """Something that takes a moment, done beside the store; its answer changes `model`'s bodies."""

    id: int
    client: int
    model: pg.Model
    what: Assemble | ReadMesh | ReadArchive | FillMass


@dataclass(frozen=True)
class MobilityReport:
    """Degrees of freedom that the constraints of `model` leave, or why that is not known."""

    model: pg.Model
    found: Any = None  # pg.Mobility
    problem: str = ""
