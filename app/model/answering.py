"""One edit of the model answered to the page that asked: taken as one undo step, or refused."""

from __future__ import annotations

from collections.abc import Callable

import pgraph_core as pg

from ..core.cells import Refusal
from ..core.state import Notice, Reply, State, told, with_client
from .update import with_model


def answered(
    state: State,
    client: int,
    serial: int,
    make: Callable[[], pg.Model],
    label: str,
    offer: Callable[[], str] = lambda: "",
) -> State:
    """`make()` as the new model, or the sentence beside the cell; `offer` says what would do."""
    try:
        model = make()
    except (Refusal, pg.PgraphError) as problem:
        return with_client(state, client, reply=Reply(serial, str(problem), offer()))
    state = with_model(state, model, label)
    state = with_client(state, client, reply=Reply(serial, ""))
    return noticed(state, client, model)


def attempted(state: State, client: int, make: Callable[[], pg.Model], label: str) -> State:
    """`make()` as the new model, or a notice why not: for what has no cell."""
    try:
        model = make()
    except (Refusal, pg.PgraphError) as problem:
        return told(state, client, Notice("Not done", str(problem), bad=True))
    return noticed(with_model(state, model, label), client, model)


def noticed(state: State, client: int, model: pg.Model) -> State:
    """What the edit changed besides, said to the page that made it."""
    text = "; ".join(model.notices)
    return told(state, client, Notice("Also changed", text)) if text else state
