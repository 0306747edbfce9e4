"""Model edits: each is one undo step with a reply to its page (pure).

Selections and opened parts of pages follow the names of bodies and parts. Each message carries the
version of the model that its page has seen. Older names are translated.
"""

from __future__ import annotations

import re
from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import replace
from typing import Any

import pgraph_core as pg
from pgraph_core.errors import counted
from pgraph_core.model.description import TOLD

from .cells import Refusal
from .rows import followed, places
from .state import Notice, Rename, S, Step, replied, told

UNDO_DEPTH = 200
ALSO = "Also changed"  # title of what an edit changed besides; undo withdraws it
MOST_BODIES = 1000
MOST_RENAMES = 1000  # limit on remembered renames
NAMED = ("constraints", "contacts", "forces", "sites", "outputs", "controls", "beams")  # but bodies
STAND_IN = re.compile(r"serial \d+|model")  # names that nobody has given
OF_BODIES = ("body", "bodies", "parent", "before", "rows", "under")  # fields of events
IN_CELLS = ("parent", "body", "other", "frame", "at")  # cells with the name of a body as text


def edited(
    state: S,
    client: int,
    make: Callable[[], tuple[pg.Model, str]],
    serial: int | None = None,
    offer: Callable[[], str] = lambda: "",
) -> S:
    """Apply the new model from `make() -> (model, description)` as one undo step.

    If the edit is rejected, the message is shown next to the edited cell (`serial`), with a button
    for the repair `offer`. Without a cell, it is shown as a notice.
    """
    try:
        model, label = make()
    except (Refusal, pg.PgraphError) as problem:
        if serial is None:
            return told(state, client, Notice("Not done", str(problem), bad=True))
        return replied(state, client, serial, str(problem), offer())
    said = [*model.notices, *_pointed(state.model, model)]
    state = with_model(state, model, label)
    if serial is not None:
        state = replied(state, client, serial)
    return _noticed(state, client, said)


def attempted(state: S, client: int, make: Callable[[], pg.Model], label: str) -> S:
    """Apply the new model from `make()`, or notify the page about the reason for its failure."""
    return edited(state, client, lambda: (make(), label))


def _pointed(before: pg.Model, now: pg.Model) -> Iterator[str]:
    """Yield a message for each contact that still uses points although its body now has a shape."""
    for contact in now.contacts:
        name = contact.body
        bare = name in before.row and not before.body(name).shapes
        if contact.points and bare and name in now.row and now.body(name).shapes:
            points = counted(len(contact.points), "point")
            yield (
                f"contact '{contact.name}' still touches at {points} of '{name}' alone; "
                "delete them to let the shape touch"
            )


def _noticed(state: S, client: int, said: Sequence[str]) -> S:
    """Notify the page about side effects of the edit, and about parts that it did not change."""
    return told(state, client, Notice(ALSO, "; ".join(said))) if said else state


def with_model(state: S, model: pg.Model, label: str) -> S:
    """Replace the current model by `model`, as one undo step. Do nothing if the model is
    unchanged."""
    if model is state.model:
        return state
    vars(model).pop(TOLD, None)  # the page shows notices at each edit, so no run repeats them
    step = Step(state.model, label, state.document)
    undo = (*state.undo, step)[-UNDO_DEPTH:]
    return replace(showing(state, model), undo=undo, redo=(), greeting=None)


def replaced(state: S, model: pg.Model, label: str) -> S:
    """Open a different model as one undo step, with its own run settings and camera view.

    The selection, drawings, plots and measurements of the previous model are discarded.
    """
    after = with_model(state, model, label).opened(state)
    return replace(after, framed=state.framed + 1, document=state.framed + 1)


def showing(state: S, model: pg.Model) -> S:
    """Show `model`. Selections follow names or rows, and the playback is reset to its start."""
    changed = list(renamed(state.model, model))
    rows = followed(state.rows, state.model, model, changed)
    moved = places(state.rows, state.model) != places(rows, model)
    version = state.version + (moved or bool(changed))
    renames = (*state.renames, *(Rename(version, *said) for said in changed))[-MOST_RENAMES:]
    names = {(kind, old): new for kind, old, new in changed}
    return replace(
        state, model=model, rows=rows, renames=renames, version=version,
        moved=version if moved else state.moved,
    ).followed(state, names)  # fmt: skip


def selected(state: S, client: int, body: str | None, bodies: tuple[str, ...]) -> S:
    """Return `state` with these bodies selected on one page, or unchanged if `body` is unknown."""
    if body is not None and body not in state.graph.number:
        return state
    page, wanted = state.clients.get(client), {*bodies, body}
    if page is None:
        return state
    known = tuple(b.name for b in (*state.model.bodies, *state.model.beams) if b.name in wanted)
    return replace(state, clients={**state.clients, client: page.choosing(body, known)})


# -- names that changed ----------------------------------------------------------------------------


def renamed(old: pg.Model, new: pg.Model) -> Iterator[tuple[str, str, str]]:
    """Yield (kind, old name, new name) for each row that has been renamed."""
    for kind in ("bodies", *NAMED, "scenarios"):
        for a, b in _pairs(getattr(old, kind), getattr(new, kind)):
            if all(getattr(a, f, None) == getattr(b, f, None) for f in ("mass", "inertia", "kind")):
                yield kind, a.name, b.name
                if kind == "beams":  # its row of the table
                    yield "bodies", a.name, b.name
    if len(old.parameters) == len(new.parameters):
        for a, b in zip(old.parameters, new.parameters):
            if a not in new.parameters and b not in old.parameters:
                yield "parameters", a, b


def _pairs(old: Sequence[Any], new: Sequence[Any]) -> list[tuple[Any, Any]]:
    if len(old) != len(new):
        return []
    other = [(a, b) for a, b in zip(old, new) if a.name != b.name]
    before, after = {a.name for a, _ in other}, {b.name for _, b in other}
    return [(a, b) for a, b in other if a.name not in after and b.name not in before]


def as_now(renames: Sequence[Rename], event: Any) -> Any:
    """Translate a page's event to the current names."""
    seen = getattr(event, "seen", None)
    if seen is None or not renames or renames[-1].number <= seen:
        return event
    late = [rename for rename in renames if rename.number > seen]

    def now(value: Any, kind: str) -> Any:
        if isinstance(value, tuple):
            return tuple(now(each, kind) for each in value)
        for rename in late:
            if (rename.kind, rename.old) == (kind, value):
                value = rename.new
        return value

    changes = {
        field: (
            now(value, kind)
            if field != "entries"
            else tuple((at, now(text, kind)) for at, text in value)
        )
        for field, kind, value in _names(event, vars(event))
    }
    return replace(event, **changes) if changes else event


def _names(event: Any, fields: Mapping[str, Any]) -> Iterator[tuple[str, str, Any]]:
    """Yield (field, kind, value) for the event fields that hold names of model parts."""
    for field in OF_BODIES:
        if fields.get(field) is not None:
            yield field, "bodies", fields[field]
    about = type(event).__name__
    if fields.get("field") in IN_CELLS:
        for field in {"text", "entries"} & fields.keys():
            yield field, "bodies", fields[field]
    if fields.get("part") in NAMED and fields.get("name") is not None:
        yield "name", fields["part"], fields["name"]
    elif about == "PickName":
        yield "name", "bodies", fields["name"]
    elif about.endswith("Parameter"):
        yield "name", "parameters", fields["name"]
    elif about == "Plot":
        yield "of", "bodies", fields["of"]
