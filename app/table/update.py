"""Edits of one or several table rows, where each event is one undo step (pure)."""

from __future__ import annotations

from collections.abc import Callable, Iterable
from typing import Annotated, Literal

from pydantic import Field

import pgraph_core as pg

from ..core import cells
from ..core.cells import Refusal
from ..core.edit import MOST_BODIES, STAND_IN, attempted, replaced, selected, with_model
from ..core.events import Bodies, FromPage, ModelEdit, Text
from ..core.state import Notice, replied, told
from . import State
from . import paste as pasting

GROUND = "ground"


class AddBody(FromPage):
    """Add a body as child of `parent`, or on the ground if it is None."""

    parent: Text | None

    def applied(self, state: State) -> State:
        model = state.model

        def make() -> pg.Model:
            on_model = self.parent is not None and self.parent in model.row
            parent = self.parent if on_model and self.parent else GROUND
            return model.add(rod(model, free_number(model.row), parent))

        return grown(state, self.client, make, "add a body")


class Duplicate(FromPage):
    """Copy the bodies together with the branches that they carry."""

    bodies: Bodies
    subtree: bool

    def applied(self, state: State) -> State:
        model, bodies, subtree = state.model, self.bodies, self.subtree

        def make() -> pg.Model:
            return model.duplicate(_tops(model, bodies) if subtree else bodies, subtree=subtree)

        return grown(state, self.client, make, f"duplicate {_label(bodies)}")


class MirrorBranch(FromPage):
    """Mirror branches of bodies about the plane normal to an axis of each parent."""

    body: Text
    plane: Literal["x", "y", "z"]
    bodies: Bodies | None = None  # all selected bodies, None for `body` alone

    def applied(self, state: State) -> State:
        chosen = self.bodies or (self.body,)

        def make() -> pg.Model:
            model = state.model
            for name in chosen:
                if not any(inboard in chosen for inboard in _inboard(model, name)):
                    model = model.mirror(name, self.plane)
            return model

        return grown(state, self.client, make, f"mirror {_label(chosen)}")


def _inboard(model: pg.Model, name: str) -> list[str]:
    """Return the bodies on the path from a body to the ground."""
    found = []
    while (name := model.body(name).parent) in model.row:
        found.append(name)
    return found


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
        return model.move(self.bodies, place), label


class SetParent(ModelEdit):
    bodies: Bodies
    parent: Text

    def edit(self, state: State) -> tuple[pg.Model, str]:
        changes = {name: {"parent": self.parent} for name in self.bodies}
        return state.model.edit_all(changes), f"parent of {_label(self.bodies)}"


class CountBodies(FromPage):
    """Set the number of bodies by appending a chain or by removing the last rows."""

    serial: int
    text: Text

    def applied(self, state: State) -> State:
        try:
            n = cells.whole(self.text, 1, MOST_BODIES)
        except Refusal as refusal:
            return replied(state, self.client, self.serial, f"The number of bodies {refusal}.")
        state = attempted(state, self.client, lambda: sized(state.model, n), f"{n} bodies")
        return replied(state, self.client, self.serial)


class Paste(FromPage):
    """Paste spreadsheet lines into `rows` starting at `column`. Further lines become new rows.

    Without `rows` all become new rows, children of `under` unless they name another parent.
    """

    serial: int
    text: Annotated[str, Field(max_length=1_000_000)]
    rows: Annotated[tuple[Text, ...], Field(max_length=10_000)] = ()
    column: Annotated[int, Field(ge=0, le=3)] = 0
    under: Text | None = None

    def applied(self, state: State) -> State:
        """Paste all lines, or none of them and give the reason."""
        client, serial = self.client, self.serial
        try:
            model, names, notice = pasting.rows_of(
                state.model, self.text, self.rows, self.column, self.under, rod
            )
            if len(model.bodies) > MOST_BODIES:
                raise Refusal(f"it would be {len(model.bodies)} bodies; {MOST_BODIES} at most")
        except (Refusal, pg.PgraphError) as problem:
            return replied(state, client, serial, f"Nothing was pasted: {problem}")
        if names and not state.model.bodies and STAND_IN.fullmatch(model.name):
            model = model.replace(name=names[0])
        state = replied(with_model(state, model, "paste"), client, serial)
        if names:
            state = selected(state, client, names[0], names)
        return told(state, client, Notice("Pasted", notice)) if notice else state


class NewFromLines(FromPage):
    """Create a new model from spreadsheet lines alone, instead of from a number of bodies."""

    serial: int
    text: Annotated[str, Field(max_length=1_000_000)]

    def applied(self, state: State) -> State:
        """Create the model from all lines, or refuse and give the reason."""
        client, serial = self.client, self.serial
        try:
            empty = pg.Model(bodies=())
            model, names, notice = pasting.rows_of(empty, self.text, (), 0, None, rod)
            if not 0 < len(names) <= MOST_BODIES:
                raise Refusal(f"it would be {len(names)} bodies; from 1 to {MOST_BODIES}")
        except (Refusal, pg.PgraphError) as problem:
            return replied(state, client, serial, f"Nothing was pasted: {problem}")
        model = model.replace(name=names[0])
        state = replaced(state, model, f"new model of {len(names)} bodies")
        state = replied(state, client, serial)
        return told(state, client, Notice("Pasted", notice)) if notice else state


def grown(state: State, client: int, make: Callable[[], pg.Model], label: str) -> State:
    """Attempt an edit and select its new bodies. Raises Refusal if there are too many bodies."""

    def limited() -> pg.Model:
        model = make()
        if len(model.bodies) > MOST_BODIES:
            text = f"would be {len(model.bodies)} bodies; {MOST_BODIES} at most"
            raise pg.ModelError(pg.Problem("the table", "", text))
        return model

    after = attempted(state, client, limited, label)
    new = tuple(b.name for b in after.model.bodies if b.name not in state.model.row)
    return selected(after, client, new[0], new) if new else after


def rod(model: pg.Model, name: str, parent: str) -> pg.Body:
    """Return a slender rod at the tip of `parent`. The first rod on the ground has a free joint."""
    root, new = pg.Model.serial(2).bodies
    if not model.bodies:
        free = pg.Model(bodies=(root,)).edit(root.name, joint="free").bodies[0]
        return free.unchecked_copy({"name": name})
    link = (0.0, 0.0, 0.0) if parent == GROUND else model.body(parent).tip or new.link
    return new.unchecked_copy({"name": name, "parent": parent, "link": link})


def free_number(taken: Iterable[str]) -> str:
    """Return the next unused whole number as a name."""
    names = set(taken)
    return next(str(k) for k in range(len(names) + 1, 2 * len(names) + 2) if str(k) not in names)


def _tops(model: pg.Model, names: tuple[str, ...]) -> tuple[str, ...]:
    """Return the bodies that are not carried by another body in the list."""
    chosen = set(names)

    def carried(name: str) -> bool:
        while (name := model.body(name).parent) in model.row:
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
        name = free_number(names)
        new = rod(model, name, GROUND)
        if parent is not None:
            new = new.unchecked_copy({"parent": parent.name, "link": parent.tip or new.link})
        rows.append(new)
        names.add(name)
    return model if n == len(model.bodies) else model.replace(bodies=tuple(rows))
