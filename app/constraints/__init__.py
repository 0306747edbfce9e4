"""Constraints, contacts, forces, loops and joint limits, and their tab."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any, Literal

import pgraph_core as pg

Part = Literal["constraints", "contacts", "forces"]
Slot = Literal["body", "other"]


@dataclass(frozen=True)
class Picking:
    """A body is to be clicked: for a part that is there, or the next one of a new part."""

    part: Literal["constraints", "contacts", "forces", "loops", "limits"]
    kind: str  # of the part; of a loop the kind of its joint
    slot: Slot = "body"
    name: str | None = None  # of the part; None: a new one
    body: str | None = None  # of a new part, once that is picked


@dataclass(frozen=True)
class MobilityReport:
    """Degrees of freedom that the constraints of `model` leave, or why that is not known."""

    model: pg.Model
    found: Any = None  # pg.Mobility
    problem: str = ""
