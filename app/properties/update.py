"""What the events do to properties of bodies and of the model, and to how they are shown (pure)."""

from __future__ import annotations

import base64
import binascii
import math
from collections.abc import Callable
from dataclasses import replace
from typing import Any

import pgraph_core as pg
from pgraph_core.shapes.meshes import mass_properties

from ..core import cells
from ..core.cells import Refusal
from ..core.intents import Display, FillMass, ReadArchive, ReadMesh
from ..core.state import Notice, Reply, State, told, with_client
from ..events import Event, OpenArchive
from ..model.answering import answered
from ..model.errands import sent
from . import body_cells
from . import events as asked
from .body_cells import edit_of, mended
from .world import world_edited

LABELS = {
    "rotation": "orientation", "rotation_euler": "orientation", "rotation_axis": "orientation",
    "com": "centre of mass", "link": "link vector", "motions": "motions",
}  # fmt: skip
CHOICES = {
    "angle": ("rad", "deg"), "length": ("m", "mm"), "turn": ("quaternion", "euler", "axis"),
    "about": ("com", "origin"),
}  # fmt: skip

Typed = asked.EditBodies | asked.Check | asked.Mend


def update(state: State, event: Event) -> State | None:
    """The state after an event of the properties; None for any other event."""
    match event:
        case asked.Check():
            return checked(state, event)
        case asked.EditBodies():
            return edited(state, event)
        case asked.Mend():
            return repaired(state, event)
        case asked.FillFromShape():
            return filled(state, event)
        case asked.UploadMesh(client, bodies, name, content):
            make = lambda data: ReadMesh(bodies, name, data)  # noqa: E731
            return uploaded(state, client, content, make)
        case OpenArchive(client, name, content):
            return uploaded(state, client, content, lambda data: ReadArchive(name, data))
        case asked.EditWorld(client, serial, field, index, text):
            display = display_of(state, client)
            make = lambda: world_edited(state.model, display, field, index, text)  # noqa: E731
            return answered(state, client, serial, make, f"{field} of the model")
        case asked.SetDisplay(client, what, value) if value in CHOICES[what]:
            display = replace(display_of(state, client), **{what: value})
            return with_client(state, client, display=display)
    return None


def display_of(state: State, client: int) -> Display:
    """How numbers are shown on a page."""
    page = state.clients.get(client)
    return page.display if page is not None else Display()


# -- bodies ------------------------------------------------------------------------------------


def edited(state: State, event: asked.EditBodies) -> State:
    """Typed cells of one body or several: one undo step, or the sentence that refuses them."""
    return answered(
        state, event.client, event.serial, lambda: _edited(state, event), _label(event),
        lambda: _offer(state, event),
    )  # fmt: skip


def checked(state: State, event: asked.Check) -> State:
    """What the model has against half-typed cells, and a repair; to type on is no fault."""
    reply = Reply(event.serial, "")
    try:
        _edited(state, event)
    except pg.PgraphError as problem:
        reply = Reply(event.serial, str(problem), _offer(state, event))
    except Refusal:
        pass
    return with_client(state, event.client, reply=reply)


def _label(event: Typed) -> str:
    field = event.field.removeprefix("shape_") if event.field != "shape_kind" else "shape"
    several = f"{len(event.bodies)} bodies"
    of = event.bodies[0] if len(event.bodies) == 1 else several
    return f"{LABELS.get(event.field, field)} of {of}"


def _changes(state: State, event: Typed) -> dict[str, dict[str, Any]]:
    display, changes = display_of(state, event.client), {}
    for name in event.bodies:
        body = state.model.body(name)
        try:
            changes[name] = (
                cells.change(body, "name", (), event.entries[0][1])
                if event.field == "name"
                else edit_of(state.model, body, event.field, event.entries, display)
            )
        except Refusal as refusal:
            field = LABELS.get(event.field, event.field.replace("_", " "))
            raise Refusal(f"body '{name}', {field}: {refusal}") from None
    return changes


def _edited(state: State, event: Typed) -> pg.Model:
    if event.field == "name" and len(event.bodies) > 1:
        raise Refusal("several bodies cannot have one name; select one")
    changes = _changes(state, event)
    if len(changes) == 1:
        ((name, change),) = changes.items()
        return state.model.edit(name, **change)
    return state.model.edit_all(changes)


def _offer(state: State, event: Typed) -> str:
    """What a repair would do with the refused entries; "" where there is none."""
    try:
        changes = _changes(state, event)
        bodies = [mended(state.model.body(n), *_one(event, c)) for n, c in changes.items()]
        if None in bodies:
            return ""
        state.model.edit_all({n: b for n, b in zip(changes, bodies) if b is not None})
    except (Refusal, pg.PgraphError, ValueError, OverflowError):
        return ""
    return {"inertia": "Use the nearest possible inertia"}.get(event.field, "Make it a unit one")


def _one(event: Typed, change: dict[str, Any]) -> tuple[str, Any]:
    field = "rotation" if event.field.startswith("rotation") else event.field
    return field, change


def repaired(state: State, event: asked.Mend) -> State:
    """The offer taken."""

    def make() -> pg.Model:
        new = {}
        for name, change in _changes(state, event).items():
            mending = mended(state.model.body(name), *_one(event, change))
            if mending is None:
                raise Refusal("there is nothing to repair")
            new[name] = mending
        return state.model.edit_all(new)

    return answered(state, event.client, event.serial, make, f"repair {_label(event)}")


# -- mass from shape, meshes -------------------------------------------------------------------


def filled(state: State, event: asked.FillFromShape) -> State:
    """Mass properties from the shapes: at once, or by an errand where a mesh has to be read."""
    try:
        density = cells.number(event.density)
        if density <= 0:
            raise Refusal(f"must be > 0 [kg/m³]; given {density:g}")
        bodies = [state.model.body(name) for name in event.bodies]
        bare = next((b.name for b in bodies if b.shape is None), None)
        if bare is not None:
            raise Refusal(f"needs a shape, which '{bare}' does not have; choose one first")
    except (Refusal, pg.PgraphError) as problem:
        sentence = f"The density {problem}" if isinstance(problem, Refusal) else str(problem)
        return with_client(state, event.client, reply=Reply(event.serial, sentence))
    if any(b.shape is not None and b.shape.kind == "mesh" for b in bodies):
        state = with_client(state, event.client, reply=Reply(event.serial, ""))
        return sent(state, event.client, FillMass(event.bodies, density))
    of = event.bodies[0] if len(bodies) == 1 else f"{len(bodies)} bodies"
    make = lambda: state.model.edit_all(mass_of(bodies, density))  # noqa: E731
    return answered(state, event.client, event.serial, make, f"mass of {of} from shape")


def mass_of(bodies: list[pg.Body], density: float) -> dict[str, dict[str, Any]]:
    """Mass, centre of mass and inertia of bodies that fill their shapes. Raises PgraphError."""
    found = {}
    for body in bodies:
        assert body.shape is not None
        mass, com, inertia = mass_properties(body.shape, density)
        if not (math.isfinite(mass) and mass >= 0):
            raise Refusal(f"gives '{body.name}' a mass of {mass}")
        even = body_cells.possible(inertia)  # symmetric to the last digit
        found[body.name] = {"mass": float(mass), "com": tuple(map(float, com)), "inertia": even}
    return found


def uploaded(
    state: State, client: int, content: str, make: Callable[[bytes], ReadMesh | ReadArchive]
) -> State:
    """An errand that keeps and reads the file."""
    try:
        data = base64.b64decode(content, validate=True)
    except (binascii.Error, ValueError):
        notice = Notice("Not done", "The file did not arrive whole; try again.", bad=True)
        return told(state, client, notice)
    return sent(state, client, make(data))
