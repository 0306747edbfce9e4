"""Names that changed while a page's message was on its way (pure).

A page speaks of bodies, constraints and parameters by the names that it knows. It says how many
renames it has heard of; what it says is meant of what carries those names now.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from typing import Any

import pgraph_core as pg

MOST = 1000  # that are remembered
PARTS = ("constraints", "contacts", "forces")
OF_BODIES = ("body", "bodies", "parent", "before", "rows", "under")  # fields of events
IN_CELLS = ("parent", "body", "other", "frame")  # cells of which the text is the name of a body


@dataclass(frozen=True)
class Rename:
    number: int  # from 1
    kind: str  # "bodies", "parameters" or one of PARTS
    old: str
    new: str


def found(old: pg.Model, new: pg.Model) -> Iterator[tuple[str, str, str]]:
    """(kind, old name, new name) of what stands in its row under another name."""
    for kind in ("bodies", *PARTS):
        for a, b in _pairs(getattr(old, kind), getattr(new, kind)):
            if all(getattr(a, f, None) == getattr(b, f, None) for f in ("mass", "inertia", "kind")):
                yield kind, a.name, b.name
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


def remembered(renames: tuple[Rename, ...], old: pg.Model, new: pg.Model) -> tuple[Rename, ...]:
    """With those of an edit from `old` to `new`."""
    last = renames[-1].number if renames else 0
    more = [Rename(last + k, *said) for k, said in enumerate(found(old, new), 1)]
    return (*renames, *more)[-MOST:] if more else renames


def as_now(renames: Sequence[Rename], event: Any) -> Any:
    """An event of a page in the names of now."""
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
    """(field, kind, value) of the fields of an event that are names of what there is."""
    for field in OF_BODIES:
        if fields.get(field) is not None:
            yield field, "bodies", fields[field]
    about = type(event).__name__
    if fields.get("field") in IN_CELLS:
        for field in {"text", "entries"} & fields.keys():
            yield field, "bodies", fields[field]
    if fields.get("part") in PARTS and fields.get("name") is not None:
        yield "name", fields["part"], fields["name"]
    elif about == "PickName":
        yield "name", "bodies", fields["name"]
    elif about.endswith("Parameter"):
        yield "name", "parameters", fields["name"]
    elif about == "Plot":
        yield "of", "bodies", fields["of"]
