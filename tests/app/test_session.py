"""Interface 1.9 and 1.11: many edits of two people, undone to the start; what is told to whom."""

from __future__ import annotations

import json
import random

import pytest

import pgraph_core as pg
import pgraph_models
from pgraph_app.core.events import Event
from pgraph_app.core.state import State, initial
from pgraph_app.digraph.view import digraph
from pgraph_app.features import update
from pgraph_app.model.derived import derive
from pgraph_app.model.update import Edit, Redo, Undo
from pgraph_app.session.update import Connected, Disconnected, Select, SelectBodies
from pgraph_app.session.view import others
from pgraph_app.table.update import (
    AddBody,
    CountBodies,
    DeleteBodies,
    Duplicate,
    MirrorBranch,
    MoveRows,
    Paste,
    SetParent,
)
from pgraph_app.table.view import table

ME, OTHER = 1, 2
HOSTILE = ["", "letters", "1e400", "nan", "-1", "<b>x</b>", "🦿", "x" * 10_000, "\x00", "1e-6", "3"]


def random_event(rng: random.Random, state: State) -> Event:
    """Something a page can send: half of it is unfit."""
    client, serial = rng.choice((ME, OTHER)), rng.randrange(10**6)
    names = [*state.model.row, "nobody"]
    body, other = rng.choice(names), rng.choice(names)
    some = tuple(rng.sample(names, min(len(names), rng.randint(1, 3))))
    fields = ("name", "parent", "dof", "joint", "mass", "com", "link", "inertia", "q", "damping")
    field = rng.choice(fields)
    text = {
        "parent": rng.choice((other, "ground")),
        "dof": str(rng.randint(-1, 7)),
        "joint": rng.choice(("weld", "prismatic", "planar", "hinge")),
    }.get(field, rng.choice((*HOSTILE, str(rng.uniform(-1, 2)), f"b{rng.randrange(99)}")))
    index = {"com": (rng.randrange(3),), "link": (0,), "inertia": (0, 1), "q": (0,)}.get(field, ())
    return rng.choice(
        (
            *[Edit(client, serial, body, field, index, text)] * 5,  # type: ignore[arg-type]
            AddBody(client, body),
            DeleteBodies(client, some, rng.choice(("attach", "delete"))),
            Duplicate(client, (body,), rng.random() < 0.5),
            MirrorBranch(client, body, rng.choice(("x", "y", "z"))),
            MoveRows(client, some, other),
            SetParent(client, some, other),
            CountBodies(client, serial, str(rng.randint(-2, 24))),
            Paste(client, serial, f"{text}\t{other}\t1", (body,) if serial % 2 else ()),
            SelectBodies(client, body, some),
            Undo(client),
        )
    )


@pytest.mark.parametrize("seed", range(4))
def test_1_9_random_edits_of_two_people_are_undone_to_the_start(seed: int):
    """150 a seed; a refused one changes nothing, every other is one step."""
    rng = random.Random(seed)
    start = pg.Model.load(pgraph_models.path("quadruped"))
    state = initial(start)
    for client in (ME, OTHER):
        state = update(state, Connected(client))
    for _ in range(150):
        before, event = state, random_event(rng, state)
        state = update(state, event)
        steps = len(state.undo) - len(before.undo)
        assert (steps, state.model is before.model) in ((0, True), (1, False), (-1, False)), event
        for page in state.clients.values():
            assert set(page.selected) <= set(state.model.row)
            assert page.selection is None or page.selection in page.selected
    assert pg.Model.from_json(state.model.to_json()) == state.model
    last, depth = state.model, len(state.undo)
    for _ in range(depth):
        state = update(state, Undo(ME))
    assert state.model is start
    for _ in range(depth):
        state = update(state, Redo(OTHER))
    assert state.model is last


@pytest.mark.parametrize("seed", range(2))
def test_1_11_what_pages_are_shown_follows_from_the_model_alone(seed: int):
    """After any edits, what is sent is what a page that has just come is sent."""
    rng = random.Random(100 + seed)
    state = update(initial(pg.Model.serial(7)), Connected(ME))
    for _ in range(60):
        state = update(state, random_event(rng, state))
        fresh = initial(pg.Model.from_json(state.model.to_json()))
        for view in (table, digraph):
            assert json.dumps(view(state)) == json.dumps(view(fresh))


@pytest.mark.nightly
def test_1_11_a_thousand_random_edits_leave_model_and_pages_equal():
    rng = random.Random(7)
    state = update(initial(pg.Model.serial(7)), Connected(ME))
    for k in range(1000):
        state = update(state, random_event(rng, state))
        if k % 50 == 0:
            fresh = initial(pg.Model.from_json(state.model.to_json()))
            assert json.dumps(table(state)) == json.dumps(table(fresh))
    assert derive(state.model).names == state.derived.names


def test_1_11_each_page_sees_where_the_others_are():
    state = initial(pg.Model.serial(3))
    for event in (
        Connected(ME),
        Connected(OTHER),
        SelectBodies(OTHER, "2", ("1", "2")),
        Select(ME, "3"),
    ):
        state = update(state, event)
    assert others(state, ME).keys() == {"1", "2"}
    assert others(state, OTHER).keys() == {"3"}
    assert others(update(state, Disconnected(OTHER)), ME) == {}
