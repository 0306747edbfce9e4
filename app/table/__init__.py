"""The table of the bodies."""

from __future__ import annotations

from abc import abstractmethod
from typing import Annotated, Literal

from pydantic import Field

import pgraph_core as pg
from pgraph_core.model.editing import free_name

from ..core import cells
from ..core.cells import Refusal
from ..core.edit import MOST_BODIES, STAND_IN, replaced, selected, with_model
from ..core.events import Bodies, FromPage, ModelEdit, Text
from ..core.state import Notice, replied, told
from ..model import Client as Client
from ..model import State as State
from ..properties import beam_cells
from ..properties.update import rows_edited
from . import paste as pasting

# -- edits of one or several table rows, where each event is one undo step (pure) ------------------


GROUND = "ground"


class Growth(ModelEdit):
    """An edit that adds bodies, which are selected then."""

    def edit(self, state: State) -> tuple[pg.Model, str]:
        model, label = self.grown(state.model)
        if len(model.bodies) > MOST_BODIES:
            text = f"would be {len(model.bodies)} bodies; {MOST_BODIES} at most"
            raise pg.ModelError(pg.Problem("the table", "", text))
        return model, label

    @abstractmethod
    def grown(self, model: pg.Model) -> tuple[pg.Model, str]:
        """Return the model with more bodies and a description. Raises PgraphError."""

    def then(self, before: State, after: State) -> State:
        known = before.graph.number
        new = tuple(name for name in after.ids if name not in known)
        return selected(after, self.client, new[0], new) if new else after


class AddBody(Growth):
    """Add a body as child of `parent`, or on the ground if it is None."""

    parent: Text | None

    def grown(self, model: pg.Model) -> tuple[pg.Model, str]:
        rows = {body.name: body for body in model.rows}
        parent = self.parent if self.parent in rows else None
        name = free_name(str(len(model.row) + 1), rows)
        return model.add(rod(model, name, parent or GROUND)), "add a body"


class AddBeam(Growth):
    """Add a straight beam at the tip of `parent`, or on the ground if it is None."""

    parent: Text | None

    def grown(self, model: pg.Model) -> tuple[pg.Model, str]:
        rows = {body.name: body for body in model.rows}
        parent = self.parent if self.parent in rows else GROUND
        name = free_name("beam", rows)
        link = rows[parent].tip_point if parent in model.row else (0.0, 0.0, 0.0)
        beam = pg.Beam(name=name, parent=parent, link=link, **beam_cells.NEW)
        return model.add(beam), "add a beam"


class Duplicate(Growth):
    """Copy the bodies together with the branches that they carry."""

    bodies: Bodies
    subtree: bool

    def grown(self, model: pg.Model) -> tuple[pg.Model, str]:
        bodies = _tops(model, self.bodies) if self.subtree else self.bodies
        return model.duplicate(bodies, subtree=self.subtree), f"duplicate {_label(self.bodies)}"


class MirrorBranch(Growth):
    """Mirror branches of bodies about the plane normal to an axis of each parent."""

    body: Text
    plane: Literal["x", "y", "z"]
    bodies: Bodies | None = None  # all selected bodies, None for `body` alone

    def grown(self, model: pg.Model) -> tuple[pg.Model, str]:
        chosen = self.bodies or (self.body,)
        for name in _tops(model, chosen):
            model = model.mirror(name, self.plane)
        return model, f"mirror {_label(chosen)}"


class DeleteBodies(ModelEdit):
    """Delete bodies. Their children are reattached to the remaining bodies or deleted too."""

    bodies: Bodies
    children: Literal["attach", "delete"]

    def edit(self, state: State) -> tuple[pg.Model, str]:
        model = state.model.remove(self.bodies, children=self.children)
        return model, f"delete {_label(self.bodies)}"


class MoveRows(ModelEdit):
    """Move the rows before a body, or to the end if it is None."""

    bodies: Bodies
    before: Text | None

    def edit(self, state: State) -> tuple[pg.Model, str]:
        model, chosen, label = state.model, set(self.bodies), f"move {_label(self.bodies)}"
        if self.before in chosen:
            return model, label
        left = [b.name for b in model.bodies if b.name not in chosen]
        place = left.index(self.before) if self.before in left else len(left)
        bodies = [name for name in self.bodies if name in model.row]
        if not bodies:
            raise Refusal("A beam stands below the bodies; its row does not move.")
        return model.move(bodies, place), label


class SetParent(ModelEdit):
    bodies: Bodies
    parent: Text

    def edit(self, state: State) -> tuple[pg.Model, str]:
        changes = {name: {"parent": self.parent} for name in self.bodies}
        return rows_edited(state.model, changes), f"parent of {_label(self.bodies)}"


class CountBodies(ModelEdit):
    """Set the number of bodies by appending a chain or by removing the last rows."""

    serial: int
    text: Text

    def edit(self, state: State) -> tuple[pg.Model, str]:
        try:
            n = cells.whole(self.text, 1, MOST_BODIES)
        except Refusal as refusal:
            raise Refusal(f"The number of bodies {refusal}.") from None
        return sized(state.model, n), f"{n} bodies"


class Paste(FromPage):
    """Paste spreadsheet lines into `rows` starting at `column`. Further lines become new rows.

    If `rows` is not given, all bodies are added as new rows. They are children of `under` unless
    another parent is specified. `afresh` makes a new model of them.
    """

    serial: int
    text: Annotated[str, Field(max_length=1_000_000)]
    rows: Annotated[tuple[Text, ...], Field(max_length=10_000)] = ()
    column: Annotated[int, Field(ge=0, le=3)] = 0
    under: Text | None = None
    afresh: bool = False

    def applied(self, state: State) -> State:
        client, serial = self.client, self.serial
        old = pg.Model(bodies=()) if self.afresh else state.model
        try:
            model, names, notice = pasting.rows_of(
                old, self.text, self.rows, self.column, self.under, rod
            )
            if self.afresh and not names:
                raise Refusal(f"it would be 0 bodies; from 1 to {MOST_BODIES}")
        except (Refusal, pg.PgraphError) as problem:
            return replied(state, client, serial, f"Nothing was pasted: {problem}")
        if names and not old.bodies and STAND_IN.fullmatch(model.name):
            model = model.replace(name=names[0])
        if self.afresh:
            state = replaced(state, model, f"new model of {len(names)} bodies")
        else:
            state = with_model(state, model, "paste")
            state = selected(state, client, names[0], names) if names else state
        state = replied(state, client, serial)
        return told(state, client, Notice("Pasted", notice)) if notice else state


def rod(model: pg.Model, name: str, parent: str) -> pg.Body:
    """Return a slender rod that swings at the tip of `parent`."""
    new = pg.Model.serial(2).bodies[1]
    link = model.body(parent).tip or new.link if parent in model.row else (0.0, 0.0, 0.0)
    return new.unchecked_copy({"name": name, "parent": parent, "link": link})


def _tops(model: pg.Model, names: tuple[str, ...]) -> tuple[str, ...]:
    """Return the bodies that are not carried by another body in the list."""
    chosen, rows = set(names), {body.name: body for body in model.rows}

    def carried(name: str) -> bool:
        while name in rows and (name := rows[name].parent) in rows:
            if name in chosen:
                return True
        return False

    return tuple(name for name in names if not carried(name))


def _label(bodies: tuple[str, ...]) -> str:
    return bodies[0] if len(bodies) == 1 else f"{len(bodies)} bodies"


def sized(model: pg.Model, n: int) -> pg.Model:
    """Return `model` with n bodies, extending a chain at the last one or removing last ones."""
    if n < len(model.bodies):
        return model.remove([b.name for b in model.bodies[n:]])
    rows, names = list(model.bodies), set(model.row)
    while len(rows) < n:
        parent = rows[-1] if rows else None
        name = free_name(str(len(names) + 1), names)
        new = rod(model, name, GROUND)
        if parent is not None:
            new = new.unchecked_copy({"parent": parent.name, "link": parent.tip or new.link})
        rows.append(new)
        names.add(name)
    return model if n == len(model.bodies) else model.replace(bodies=tuple(rows))
