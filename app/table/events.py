"""What is done to rows of the table, several at once; each is one undo step."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Annotated, Literal

from pydantic import Field

from ..core.event import FromPage, Text

Bodies = Annotated[tuple[Text, ...], Field(min_length=1, max_length=10_000)]


@dataclass(frozen=True)
class AddBody(FromPage):
    """A new body as child of `parent`; None: of the ground."""

    parent: Text | None


@dataclass(frozen=True)
class DeleteBodies(FromPage):
    """Their children are attached to what stays, or deleted too."""

    bodies: Bodies
    children: Literal["attach", "delete"]


@dataclass(frozen=True)
class Duplicate(FromPage):
    """The bodies once more; as branches with all that they carry."""

    bodies: Bodies
    subtree: bool


@dataclass(frozen=True)
class MirrorBranch(FromPage):
    """The branch of a body reflected about the plane normal to an axis of its parent."""

    body: Text
    plane: Literal["x", "y", "z"]


@dataclass(frozen=True)
class MoveRows(FromPage):
    """The rows to the place before that of a body; None: last."""

    bodies: Bodies
    before: Text | None


@dataclass(frozen=True)
class SetParent(FromPage):
    bodies: Bodies
    parent: Text


@dataclass(frozen=True)
class CountBodies(FromPage):
    """So many bodies: more hang on the last one in a row, fewer end the table earlier."""

    serial: int
    text: Text


@dataclass(frozen=True)
class Paste(FromPage):
    """Lines of a spreadsheet over the cells of `rows` from `column` on; more become new rows.

    Without `rows` all become new rows, which hang on `under` unless they say otherwise.
    """

    serial: int
    text: Annotated[str, Field(max_length=1_000_000)]
    rows: Annotated[tuple[Text, ...], Field(max_length=10_000)] = ()
    column: Annotated[int, Field(ge=0, le=3)] = 0
    under: Text | None = None
