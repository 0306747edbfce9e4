"""What changes the model; each is one undo step."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Annotated, Literal

from pydantic import Field

from ..core.event import FromPage, Text

EditField = Literal[
    "name", "parent", "dof", "joint", "axes", "link", "rotation", "mass", "com", "inertia",
    "tip", "q", "v", "stiffness", "damping", "rest", "friction", "armature",
]  # fmt: skip


@dataclass(frozen=True)
class Edit(FromPage):
    """A cell was typed into: `index` leads into vectors and matrices, () for a scalar."""

    serial: int
    body: Text
    field: EditField
    index: Annotated[tuple[Annotated[int, Field(ge=0, le=6)], ...], Field(max_length=2)]
    text: Text


@dataclass(frozen=True)
class NewModel(FromPage):
    serial: int
    bodies: Text


@dataclass(frozen=True)
class Undo(FromPage):
    pass


@dataclass(frozen=True)
class Redo(FromPage):
    pass


@dataclass(frozen=True)
class OpenBuiltIn(FromPage):
    name: Text


@dataclass(frozen=True)
class OpenKept(FromPage):
    """The model that an earlier session left."""

    name: Text


@dataclass(frozen=True)
class OpenArchive(FromPage):
    """A zip of a model and its meshes, read by the page."""

    name: Text
    content: Annotated[str, Field(max_length=16_000_000)]  # base64


@dataclass(frozen=True)
class OpenText(FromPage):
    """A file's content, read by the page."""

    name: Text
    content: Annotated[str, Field(max_length=8_000_000)]
