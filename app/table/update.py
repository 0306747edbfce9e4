"""What the events do to rows of the table: one undo step each, also for several rows (pure)."""

from __future__ import annotations

from collections.abc import Callable, Iterable

import pgraph_core as pg

from .. import events
from ..core import cells
from ..core.cells import Refusal
from ..core.state import Notice, Reply, State, told, with_client
from ..events import Event
from ..model.update import MOST_BODIES, attempted, with_model
from ..session.update import selected
from . import paste

GROUND = "ground"


def update(state: State, event: Event) -> State | None:
    """The state after an event of the table's rows; None for any other event."""
    model = state.model
    match event:
        case events.AddBody(client, parent):
            return grown(state, client, lambda: _added(model, parent), "add a body")
        case events.Duplicate(client, bodies, subtree):
            label = f"duplicate {_said(bodies)}"
            return grown(state, client, lambda: _twice(model, bodies, subtree), label)
        case events.MirrorBranch(client, body, plane):
            return grown(state, client, lambda: model.mirror(body, plane), f"mirror {body}")
        case events.DeleteBodies(client, bodies, children):
            label = f"delete {_said(bodies)}"
            return attempted(state, client, lambda: model.remove(bodies, children=children), label)
        case events.MoveRows(client, bodies, before):
            label = f"move {_said(bodies)}"
            return attempted(state, client, lambda: _moved(model, bodies, before), label)
        case events.SetParent(client, bodies, parent):
            changes = {name: {"parent": parent} for name in bodies}
            label = f"parent of {_said(bodies)}"
            return attempted(state, client, lambda: model.edit_all(changes), label)
        case events.CountBodies(client, serial, text):
            return counted(state, client, serial, text)
        case events.Paste():
            return pasted(state, event)
        case _:
            return None


def grown(state: State, client: int, make: Callable[[], pg.Model], label: str) -> State:
    """`attempted`, with the new bodies selected; too many of them are refused."""

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
    """A slender rod at the tip of `parent`; the first on the ground is free to move."""
    root, new = pg.Model.serial(2).bodies
    if not model.bodies:
        free = pg.Model(bodies=(root,)).edit(root.name, joint="free").bodies[0]
        return free.model_copy(update={"name": name})
    link = (0.0, 0.0, 0.0) if parent == GROUND else model.body(parent).tip or new.link
    return new.model_copy(update={"name": name, "parent": parent, "link": link})


def _added(model: pg.Model, parent: str | None) -> pg.Model:
    on = parent if parent is not None and parent in model.row else GROUND
    return model.add(rod(model, free_number(model.row), on))


def free_number(taken: Iterable[str]) -> str:
    """The next unused whole number as a name."""
    names = set(taken)
    return next(str(k) for k in range(len(names) + 1, 2 * len(names) + 2) if str(k) not in names)


def _twice(model: pg.Model, bodies: tuple[str, ...], subtree: bool) -> pg.Model:
    return model.duplicate(_tops(model, bodies) if subtree else bodies, subtree=subtree)


def _tops(model: pg.Model, names: tuple[str, ...]) -> tuple[str, ...]:
    """Those of the bodies that are not carried by another of them."""
    chosen = set(names)

    def carried(name: str) -> bool:
        while (name := model.body(name).parent) in model.row:
            if name in chosen:
                return True
        return False

    return tuple(name for name in names if not carried(name))


def _moved(model: pg.Model, bodies: tuple[str, ...], before: str | None) -> pg.Model:
    chosen = set(bodies)
    if before in chosen:
        return model
    left = [b.name for b in model.bodies if b.name not in chosen]
    return model.move(bodies, left.index(before) if before in left else len(left))


def _said(bodies: tuple[str, ...]) -> str:
    return bodies[0] if len(bodies) == 1 else f"{len(bodies)} bodies"


def counted(state: State, client: int, serial: int, text: str) -> State:
    """The table with so many bodies."""
    try:
        n = cells.whole(text, 1, MOST_BODIES)
    except Refusal as refusal:
        return with_client(state, client, reply=Reply(serial, f"The number of bodies {refusal}."))
    state = attempted(state, client, lambda: sized(state.model, n), f"{n} bodies")
    return with_client(state, client, reply=Reply(serial, ""))


def sized(model: pg.Model, n: int) -> pg.Model:
    """`model` with n bodies: more in a row on the last one, or without the last ones."""
    if n < len(model.bodies):
        return model.remove([b.name for b in model.bodies[n:]])
    rows, names = list(model.bodies), set(model.row)
    while len(rows) < n:
        parent = rows[-1] if rows else None
        name = free_number(names)
        new = rod(model, name, GROUND)
        if parent is not None:
            new = new.model_copy(update={"parent": parent.name, "link": parent.tip or new.link})
        rows.append(new)
        names.add(name)
    return model if n == len(model.bodies) else model.replace(bodies=tuple(rows))


def pasted(state: State, event: events.Paste) -> State:
    """The lines of a spreadsheet as rows: all of them, or none and the reason."""
    client, serial = event.client, event.serial
    try:
        model, names, notice = paste.rows_of(
            state.model, event.text, event.rows, event.column, event.under, rod
        )
        if len(model.bodies) > MOST_BODIES:
            raise Refusal(f"it would be {len(model.bodies)} bodies; {MOST_BODIES} at most")
    except (Refusal, pg.PgraphError) as problem:
        return with_client(state, client, reply=Reply(serial, f"Nothing was pasted: {problem}"))
    state = with_model(state, model, "paste")
    state = with_client(state, client, reply=Reply(serial, ""))
    if names:
        state = selected(state, client, names[0], names)
    return told(state, client, Notice("Pasted", notice)) if notice else state
