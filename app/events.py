"""What can happen. The page's own events are validated by their annotations (`from_page`)."""

from __future__ import annotations

import json
from dataclasses import dataclass
from typing import Annotated, Any, Literal

from pydantic import ConfigDict, Field, TypeAdapter

from .state import SHOWABLE, SPEEDS

Text = Annotated[str, Field(max_length=20_000)]
Finite = Annotated[float, Field(allow_inf_nan=False)]
EditField = Literal[
    "name", "parent", "dof", "joint", "axes", "link", "rotation", "mass", "com", "inertia",
    "tip", "q", "v", "stiffness", "damping", "rest", "friction", "armature",
]  # fmt: skip


@dataclass(frozen=True)
class FromPage:
    """An event that one open page sent."""

    __pydantic_config__ = ConfigDict(extra="forbid")
    client: int


@dataclass(frozen=True)
class Connected(FromPage):
    pass


@dataclass(frozen=True)
class Disconnected(FromPage):
    pass


@dataclass(frozen=True)
class Misread(FromPage):
    """The page sent something that is no event."""

    text: str


@dataclass(frozen=True)
class Select(FromPage):
    body: Text | None


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
class AddBody(FromPage):
    """A new body as child of `parent`; None: of the ground."""

    parent: Text | None


@dataclass(frozen=True)
class DeleteBody(FromPage):
    body: Text
    children: Literal["attach", "delete"]


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
class OpenText(FromPage):
    """A file's content, read by the page."""

    name: Text
    content: Annotated[str, Field(max_length=8_000_000)]


@dataclass(frozen=True)
class Save(FromPage):
    """Write the model to a path on the server's machine."""

    serial: int
    path: Text


@dataclass(frozen=True)
class Download(FromPage):
    pass


@dataclass(frozen=True)
class SetScenario(FromPage):
    serial: int
    scenario: Text


@dataclass(frozen=True)
class SetRun(FromPage):
    serial: int
    field: Literal["t_end", "step", "method"]
    text: Text


@dataclass(frozen=True)
class Simulate(FromPage):
    pass


@dataclass(frozen=True)
class Cancel(FromPage):
    pass


@dataclass(frozen=True)
class Play(FromPage):
    pass


@dataclass(frozen=True)
class Pause(FromPage):
    pass


@dataclass(frozen=True)
class Scrub(FromPage):
    time: Finite


@dataclass(frozen=True)
class StepFrames(FromPage):
    frames: Annotated[int, Field(ge=-1000, le=1000)]


@dataclass(frozen=True)
class Speed(FromPage):
    speed: Annotated[float, Field(ge=SPEEDS[0], le=SPEEDS[-1])]


@dataclass(frozen=True)
class Loop(FromPage):
    loop: bool


@dataclass(frozen=True)
class Show(FromPage):
    what: Text
    on: bool


@dataclass(frozen=True)
class Theme(FromPage):
    dark: bool


@dataclass(frozen=True)
class Viewport(FromPage):
    """The page's 3D view has this width over height."""

    aspect: Annotated[float, Field(gt=0.05, lt=20)]


@dataclass(frozen=True)
class Tick:
    """Wall-clock time went by while playing [s]."""

    dt: float


@dataclass(frozen=True)
class Progress:
    job: int
    fraction: float


@dataclass(frozen=True)
class Simulated:
    job: int
    result: Any


@dataclass(frozen=True)
class Failed:
    job: int
    text: str


@dataclass(frozen=True)
class Compiling:
    done: int
    total: int
    name: str


@dataclass(frozen=True)
class Compiled:
    problem: str = ""


@dataclass(frozen=True)
class Saved:
    """The outcome of a Save: "" where it was written."""

    client: int
    serial: int
    path: str
    problem: str


Event = FromPage | Tick | Progress | Simulated | Failed | Compiling | Compiled | Saved

PAGE_EVENTS = {
    kind.__name__: TypeAdapter(kind)
    for kind in (
        Select, Edit, NewModel, AddBody, DeleteBody, Undo, Redo, OpenBuiltIn, OpenText, Save,
        Download, SetScenario, SetRun, Simulate, Cancel, Play, Pause, Scrub, StepFrames, Speed,
        Loop, Show, Theme, Viewport,
    )
}  # fmt: skip


def from_page(client: int, text: str) -> FromPage:
    """The event in a page's message `{"event": name, ...fields}`; Misread if there is none."""
    try:
        fields = json.loads(text)
        adapter = PAGE_EVENTS[fields.pop("event")]
        fields["client"] = client
        event = adapter.validate_json(json.dumps(fields), strict=True)
    except (ValueError, KeyError, TypeError, AttributeError, RecursionError) as problem:
        return Misread(client, f"{type(problem).__name__}: {problem}"[:300])
    if isinstance(event, Show) and event.what not in SHOWABLE:
        return Misread(client, f"nothing is called {event.what!r}")
    return event
