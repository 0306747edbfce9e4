"""The rows of a model on the pages: ids of rows with names, and rows that events name by place.

Pages identify a row and its typed content by an id. A row without a name, such as a contact
point, is identified by its index. An event contains the version of the model for which it was
created, and is rejected if rows have since been added, removed or moved.
"""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from dataclasses import dataclass, field
from typing import Any

import pgraph_core as pg
from pgraph_core.joints import PER_MOTION
from pgraph_core.model.checks import PARTS

from .cells import Refusal

LISTS = (*PARTS, "parameters")  # lists of a model whose rows have names
GONE = "The row has been deleted, so the typed value was not used."
MOVED = "Rows were added or removed after this was typed. Check its row, then press Enter again."
PLACED = {  # fields whose cells are in rows without names
    "points", "via", "through", "coefficients", "steps", "motions", "axes", "q", "v", "constraints",
    "contacts", *PER_MOTION,
}  # fmt: skip


@dataclass(frozen=True)
class Rows:
    """The ids of rows with names, by list and name. A list that was not changed counts from 0."""

    ids: Mapping[str, Mapping[str, int]] = field(default_factory=dict)
    given: int = 0  # ids below were given to a row

    def named(self, model: pg.Model, part: str) -> Mapping[str, int]:
        """Return the ids of bodies, constraints, ... by their names, in order."""
        return self.ids.get(part) or {name: k for k, name in enumerate(names_of(model, part))}


def names_of(model: pg.Model, part: str) -> tuple[str, ...]:
    found = getattr(model, part)
    return tuple(found) if part == "parameters" else tuple(x.name for x in found)


def followed(
    rows: Rows, old: pg.Model, new: pg.Model, renames: Iterable[tuple[str, str, str]]
) -> Rows:
    """Return the ids after an edit. `renames` are (part, old name, new name)."""
    ids, given = dict(rows.ids), rows.given
    was = {(part, now): before for part, before, now in renames}
    for part in LISTS:
        if getattr(old, part) is getattr(new, part):
            continue
        known = rows.named(old, part)
        given, found = max(given, len(known)), dict[str, int]()
        for name in names_of(new, part):
            number = known.get(was.get((part, name), name), given)
            given = max(given, number + 1)
            found[name] = number
        ids[part] = found
    return Rows(ids, given)


def places(rows: Rows, model: pg.Model) -> tuple[object, ...]:
    """Return what changes if rows that events name by place come, go or move."""
    named = (tuple(rows.named(model, part).values()) for part in ("bodies", "constraints"))
    return (
        *named,
        [(len(body.shapes), len(body.motions)) for body in model.bodies],
        [len(contact.points) for contact in model.contacts],
        [len(getattr(x, "coefficients", ())) for x in (*model.constraints, *model.forces)],
        [len(x._places) for x in model.forces],
        [(len(s.switches), len(s.forces)) for s in model.scenarios],
        len(model.ground.steps),
    )


def refuse_moved(event: Any, moved: int) -> None:
    """Raise Refusal for an event that names a row by place if rows have moved since its version."""
    typed, seen = getattr(event, "typed", None), getattr(event, "seen", None)
    version = seen if typed is None else typed
    if version is None or version >= moved:
        return
    fields = vars(event)
    name, entries = str(fields.get("field")), fields.get("entries") or ((fields.get("index"),),)
    if "number" in fields or name.startswith("shape_") or (name in PLACED and entries[0][0]):
        raise Refusal(MOVED)


def scenario(rows: Rows, model: pg.Model, chosen: str, event: Any) -> str:
    """Return the scenario that an event names by its id, or `chosen` if it names none.

    Raises Refusal if it is gone.
    """
    if event.scenario is None:
        return chosen
    known = {number: name for name, number in rows.named(model, "scenarios").items()}
    if event.scenario not in known:
        raise Refusal("The scenario has been deleted.")
    return known[event.scenario]
