"""What happens on one page alone: coming and going, selecting, looking, saving."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Annotated, Literal

from pydantic import Field

from ..core.event import FromPage, Text


@dataclass(frozen=True)
class Connected(FromPage):
    pass


@dataclass(frozen=True)
class Disconnected(FromPage):
    pass


@dataclass(frozen=True)
class Hello(FromPage):
    """A page that connects says which it is and what it shows: it may have been here before."""

    serial: int
    page: Annotated[str, Field(max_length=100)]  # its own name, the same as long as it is open
    body: Text | None
    bodies: tuple[Text, ...]
    dark: bool
    display: tuple[
        Literal["rad", "deg"],
        Literal["m", "mm"],
        Literal["quaternion", "euler", "axis"],
        Literal["com", "origin"],
    ]


@dataclass(frozen=True)
class Misread(FromPage):
    """The page sent something that is no event."""

    text: str


@dataclass(frozen=True)
class Select(FromPage):
    body: Text | None


@dataclass(frozen=True)
class SelectBodies(FromPage):
    """Several rows at once; `body`, the last of them, is the one whose properties are shown."""

    body: Text
    bodies: tuple[Text, ...]


@dataclass(frozen=True)
class Theme(FromPage):
    dark: bool


@dataclass(frozen=True)
class Viewport(FromPage):
    """The page's 3D view has this width over height."""

    aspect: Annotated[float, Field(gt=0.05, lt=20)]


@dataclass(frozen=True)
class Show(FromPage):
    what: Text
    on: bool


@dataclass(frozen=True)
class Save(FromPage):
    """Write the model to a path on the server's machine."""

    serial: int
    path: Text


@dataclass(frozen=True)
class Saved:
    """The outcome of a Save: "" where it was written."""

    client: int
    serial: int
    path: str
    problem: str


@dataclass(frozen=True)
class NotKept:
    """The model could not be written to where it would survive the server."""

    problem: str


@dataclass(frozen=True)
class Download(FromPage):
    pass
