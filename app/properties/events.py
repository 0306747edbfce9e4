"""What happens to properties: of bodies, one or several, of the model, and how they are shown."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Annotated, Literal

from pydantic import Field

from ..constraints.events import Entries, Index
from ..core.event import FromPage, Text

Bodies = Annotated[tuple[Text, ...], Field(min_length=1, max_length=1000)]
BodyField = Literal[
    "name", "joint", "motions", "axes", "link", "rotation", "rotation_euler", "rotation_axis",
    "mass", "com", "inertia", "tip", "q", "v", "stiffness", "damping", "rest", "friction",
    "armature", "limits", "limit_restitution", "shape_kind", "shape_size", "shape_radius",
    "shape_length", "shape_scale", "shape_position", "shape_rotation",
]  # fmt: skip
WorldField = Literal[
    "name", "up", "gravity", "friction", "restitution", "slope", "uphill", "steps",
]  # fmt: skip


@dataclass(frozen=True)
class EditBodies(FromPage):
    """Cells of one field were typed into, for one body or several."""

    serial: int
    bodies: Bodies
    field: BodyField
    entries: Entries


@dataclass(frozen=True)
class Check(FromPage):
    """The same while it is typed: what would be said of it; nothing is changed."""

    serial: int
    bodies: Bodies
    field: BodyField
    entries: Entries


@dataclass(frozen=True)
class Mend(FromPage):
    """The same with the nearest that the bodies can take: the offer beside a refusal."""

    serial: int
    bodies: Bodies
    field: BodyField
    entries: Entries


@dataclass(frozen=True)
class FillFromShape(FromPage):
    """Mass, centre of mass and inertia from the shapes and a typed density."""

    serial: int
    bodies: Bodies
    density: Text


@dataclass(frozen=True)
class UploadMesh(FromPage):
    """A mesh file, read by the page, as the shape of these bodies."""

    bodies: Bodies
    name: Text
    content: Annotated[str, Field(max_length=15_000_000)]  # base64


@dataclass(frozen=True)
class EditWorld(FromPage):
    serial: int
    field: WorldField
    index: Index
    text: Text


@dataclass(frozen=True)
class EditParameter(FromPage):
    """A parameter's value; with an unknown name a new parameter."""

    serial: int
    name: Text
    text: Text


@dataclass(frozen=True)
class RenameParameter(FromPage):
    serial: int
    name: Text
    text: Text


@dataclass(frozen=True)
class DeleteParameter(FromPage):
    """Cells that use it keep their numbers."""

    name: Text


@dataclass(frozen=True)
class SetDisplay(FromPage):
    what: Literal["angle", "length", "turn", "about"]
    value: Literal["rad", "deg", "m", "mm", "quaternion", "euler", "axis", "com", "origin"]
