"""What takes a moment is sent to a thread beside the store, and its answer applied (pure)."""

from __future__ import annotations

from dataclasses import replace
from typing import Any

from ..constraints.events import ErrandDone
from ..core.intents import Assemble, Errand, FillMass, ReadArchive, ReadMesh
from ..core.state import Notice, State, told
from ..events import Event
from .answering import attempted
from .update import shown_model

LABELS = {Assemble: "assemble", ReadMesh: "mesh file", FillMass: "mass from shape"}

Task = Assemble | ReadMesh | ReadArchive | FillMass


def update(state: State, event: Event) -> State | None:
    """The state after an errand came back; None for any other event."""
    match event:
        case ErrandDone():
            return done(state, event)
    return None


def sent(state: State, client: int, what: Task) -> State:
    """One more errand under way, for the model as it stands."""
    errand = Errand(state.errand_count + 1, client, state.model, what)
    return replace(state, errands=(*state.errands, errand), errand_count=errand.id)


def done(state: State, event: ErrandDone) -> State:
    """Its changes as one undo step; nothing but a word where the model is another one by now."""
    errand = next((e for e in state.errands if e.id == event.id), None)
    if errand is None:
        return state
    state = replace(state, errands=tuple(e for e in state.errands if e.id != event.id))
    if isinstance(errand.what, ReadArchive):
        return shown_model(state, errand.client, errand.what.file, event.opened, event.problem)
    label = LABELS[type(errand.what)]
    if event.problem:
        return told(state, errand.client, Notice(f"Not done: {label}", event.problem, bad=True))
    if errand.model is not state.model:
        text = "The model was changed meanwhile; ask again."
        return told(state, errand.client, Notice(f"Not done: {label}", text, bad=True))
    changes: dict[str, dict[str, Any]] = {name: dict(x) for name, x in event.changes.items()}
    if changes:
        before = state.model
        state = attempted(state, errand.client, lambda: before.edit_all(changes), label)
        if state.model is before:
            return state
    return told(state, errand.client, Notice(label.capitalize(), event.text))
