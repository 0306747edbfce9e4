"""Undo and redo: each person takes back what that person did, others' later edits stay (pure)."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from typing import Any

import pgraph_core as pg

from ..model import Step
from .cells import Refusal
from .edit import renamed, showing
from .state import Notice, State, told

PARTS = ("bodies", "constraints", "contacts", "forces", "scenarios", "sites", "outputs")


def _last(state: State, steps: Sequence[Step], client: int) -> int | None:
    """The number of the last step that a page may take back: its own, or of a page that is gone."""
    if client not in state.clients:
        return len(steps) - 1 if steps else None
    me = state.clients[client].page
    others = {page.page for page in state.clients.values()} - {me}
    mine = [i for i, step in enumerate(steps) if step.by not in others]
    return mine[-1] if mine else None


def undoable(state: State, client: int) -> Step | None:
    """What Undo of a page would take back."""
    k = _last(state, state.undo, client)
    return None if k is None else state.undo[k]


def redoable(state: State, client: int) -> Step | None:
    """What Redo of a page would do again: only where nobody took back something later."""
    k = _last(state, state.redo, client)
    return state.redo[-1] if state.redo and k == len(state.redo) - 1 else None


def undone(state: State, client: int) -> State:
    """The model without the last step of a page; its run is shown again if it has one."""
    k = _last(state, state.undo, client)
    if k is None:
        return state
    step, later = state.undo[k], state.undo[k + 1 :]
    redo = (*state.redo, Step(state.model, step.label, step.by))
    if not later:
        return replace(showing(state, step.model), undo=state.undo[:k], redo=redo)
    after = later[0].model
    try:
        model = reverted(state.model, step.model, after)
        since = [replace(later[0], model=step.model)]
        since += [replace(x, model=reverted(x.model, step.model, after)) for x in later[1:]]
    except (Refusal, pg.PgraphError) as problem:
        text = f"'{step.label}' cannot be undone any more: {problem}"
        return told(state, client, Notice("Not undone", text, bad=True))
    return replace(showing(state, model), undo=(*state.undo[:k], *since), redo=redo)


def redone(state: State, client: int) -> State:
    """The model that the last undo of a page left."""
    step = redoable(state, client)
    if step is None:
        return state
    undo = (*state.undo, Step(state.model, step.label, step.by))
    return replace(showing(state, step.model), undo=undo, redo=state.redo[:-1])


def reverted(now: pg.Model, before: pg.Model, after: pg.Model) -> pg.Model:
    """`now` with what changed from `before` to `after` taken back; what others changed stays.

    Raises Refusal where the same was changed since, PgraphError where the rest needs it.
    """
    names = [said for said in renamed(after, now) if said[0] in PARTS]
    before, after = _called(before, names), _called(after, names)
    fields: dict[str, Any] = {}
    for key in type(now).model_fields:
        was, then, is_now = (getattr(model, key) for model in (before, after, now))
        if was == then:
            continue
        if key in PARTS:
            fields[key] = _parts(was, then, is_now)
        elif is_now == then:
            fields[key] = was
        else:
            raise Refusal(f"the {key} of the model was changed since")
    return now.replace(**fields)


def _called(model: pg.Model, names: Sequence[tuple[str, str, str]]) -> pg.Model:
    """The model with the names that parts have got since."""
    for kind, old, new in names:
        if any(part.name == old for part in getattr(model, kind)):
            which = {} if kind == "bodies" else {"kind": kind[:-1]}
            model = model.edit(old, **which, name=new)
    return model


def _parts(was: Sequence[Any], then: Sequence[Any], is_now: Sequence[Any]) -> tuple[Any, ...]:
    """Parts by name, each as it is now or as it was; the order follows what is there now."""
    a, b, c = ({part.name: part for part in parts} for parts in (was, then, is_now))
    found: dict[str, Any] = {}
    for name, part in c.items():
        if a.get(name) == b.get(name):
            found[name] = part
        elif name in a and name in b:
            found[name] = _part(a[name], b[name], part)
        elif name in a or part != b[name]:
            raise Refusal(f"'{name}' was changed since by another person")
    for name in a:
        if name in b and name not in c and a[name] != b[name]:
            raise Refusal(f"'{name}' was taken out since by another person")
    if list(b) == list(c):
        return tuple(found.get(name, a[name]) for name in a)
    order, before = list(found), ""
    for name in a:
        if name not in b:
            order.insert(order.index(before) + 1 if before in order else 0, name)
            found[name] = a[name]
        before = name
    return tuple(found[name] for name in order)


def _part(was: Any, then: Any, is_now: Any) -> Any:
    """A part that is there all along: field by field."""
    if is_now == then:
        return was
    if type(was) is not type(is_now):
        raise Refusal(f"'{is_now.name}' was changed since by another person")
    fields = {}
    for key in type(was).model_fields:
        old, changed, current = (getattr(part, key) for part in (was, then, is_now))
        if old == changed:
            continue
        if current != changed:
            raise Refusal(f"the {key} of '{is_now.name}' was changed since by another person")
        fields[key] = old
    return is_now.unchecked_copy(fields)
