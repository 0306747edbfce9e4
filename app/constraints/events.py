"""What happens to constraints, contacts, forces, loops and joint limits, and in their tab."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import Annotated, Any, Literal

from pydantic import Field

import pgraph_core as pg

from ..core.event import FromPage, Text
from ..core.intents import Part, Slot

Index = Annotated[tuple[Annotated[int, Field(ge=0, le=1000)], ...], Field(max_length=3)]
Entries = Annotated[tuple[tuple[Index, Text], ...], Field(min_length=1, max_length=12)]


@dataclass(frozen=True)
class AddPart(FromPage):
    """A new one of that kind: its bodies are picked next; `body` is known already."""

    part: Literal["constraints", "contacts", "forces", "loops", "limits"]
    kind: Text
    body: Text | None


@dataclass(frozen=True)
class EditPart(FromPage):
    """Cells of one field were typed into."""

    serial: int
    part: Part
    name: Text
    field: Text
    entries: Entries


@dataclass(frozen=True)
class SwitchPart(FromPage):
    part: Literal["constraints", "contacts"]
    name: Text
    on: bool


@dataclass(frozen=True)
class DeletePart(FromPage):
    part: Part
    name: Text


@dataclass(frozen=True)
class DuplicatePart(FromPage):
    part: Part
    name: Text


@dataclass(frozen=True)
class OpenPart(FromPage):
    """Show all of one part in the tab; None: of none."""

    part: Part
    name: Text | None


@dataclass(frozen=True)
class Pick(FromPage):
    """The next body that is clicked becomes this one of a part."""

    part: Part
    name: Text
    slot: Slot


@dataclass(frozen=True)
class PickName(FromPage):
    """Picked without a click on a body: the ground, or "*" for every body of a contact."""

    name: Text


@dataclass(frozen=True)
class Unpick(FromPage):
    pass


@dataclass(frozen=True)
class OpenConstraints(FromPage):
    """The tab to the front, with what touches one body; None: with everything."""

    body: Text | None


@dataclass(frozen=True)
class WatchConstraints(FromPage):
    """The tab came in sight of a page, or went out of it."""

    on: bool


@dataclass(frozen=True)
class AskMobility(FromPage):
    """The report of a model so large that it is not made by itself."""


@dataclass(frozen=True)
class AssembleState(FromPage):
    pass


@dataclass(frozen=True)
class MobilityFound:
    """The report on a model's constraints, or why there is none."""

    model: pg.Model
    found: Any  # pg.Mobility | None
    problem: str = ""


@dataclass(frozen=True)
class ErrandDone:
    """What an errand found: changes of bodies, or a whole model, and a sentence; or a problem."""

    id: int
    changes: Mapping[str, Mapping[str, Any]] = field(default_factory=dict)
    text: str = ""
    problem: str = ""
    opened: pg.Model | None = None
