"""Interface 1.9 and 1.11: many edits of two people, undone to the start; what is told to whom."""

from __future__ import annotations

import json
import random
from dataclasses import replace

import pytest

import pgraph_core as pg
import pgraph_models
from pgraph_app.core.events import Event
from pgraph_app.core.state import State, initial
from pgraph_app.digraph.view import digraph
from pgraph_app.features import update
from pgraph_app.model.derived import derive
from pgraph_app.model.update import Edit, Redo, Undo
from pgraph_app.session.update import Connected, Disconnected, Hello, Select, SelectBodies
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
    """After any edits, what is sent is what a page that has just come is sent.

    Numbers of rows and colours of bodies stay through edits: they alone follow from the history.
    """
    rng = random.Random(100 + seed)
    state = update(initial(pg.Model.serial(7)), Connected(ME))
    for _ in range(60):
        state = update(state, random_event(rng, state))
        fresh = initial(pg.Model.from_json(state.model.to_json()))
        for view in (table, digraph):
            fresh = replace(fresh, rows=state.rows)
            assert json.dumps(view(state)) == json.dumps(view(fresh))


@pytest.mark.nightly
def test_1_11_a_thousand_random_edits_leave_model_and_pages_equal():
    rng = random.Random(7)
    state = update(initial(pg.Model.serial(7)), Connected(ME))
    for k in range(1000):
        state = update(state, random_event(rng, state))
        if k % 50 == 0:
            fresh = initial(pg.Model.from_json(state.model.to_json()))
            fresh = replace(fresh, rows=state.rows)
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


# -- undo is each person's own ---------------------------------------------------------------------


def both(model: pg.Model) -> State:
    """Two people who have said who they are."""
    state = initial(model)
    for client, page in ((ME, "mine"), (OTHER, "theirs")):
        hello = Hello(client, 0, page, None, (), False, ("rad", "m", "quaternion", "com"))
        state = update(update(state, Connected(client)), hello)
    return state


def typed(client: int, body: str, field: str, text: str) -> Edit:
    return Edit(client, 1, body, field, (), text)  # type: ignore[arg-type]


def test_undo_takes_back_one_s_own_edit_and_leaves_the_other_s():
    start = both(pg.Model.serial(3))
    state = start
    for event in (typed(ME, "1", "mass", "5"), typed(OTHER, "2", "mass", "7"),
                  typed(OTHER, "1", "name", "arm")):  # fmt: skip
        state = update(state, event)
    back = update(state, Undo(ME))
    assert (back.model.body("arm").mass, back.model.body("2").mass) == (1.0, 7.0)
    assert len(back.undo) == 2
    again = update(back, Redo(ME))
    assert again.model == state.model
    theirs = update(update(back, Undo(OTHER)), Undo(OTHER))
    assert theirs.model == start.model
    assert update(theirs, Undo(ME)) is theirs


def test_what_another_changed_since_is_not_undone_and_said():
    state = both(pg.Model.serial(3))
    for event in (typed(ME, "1", "mass", "5"), typed(OTHER, "1", "mass", "7")):
        state = update(state, event)
    refused = update(state, Undo(ME))
    assert refused.model is state.model
    assert "mass of '1' was changed since" in refused.clients[ME].notice.text
    assert update(state, Undo(OTHER)).model.body("1").mass == 5.0


def test_a_body_that_one_added_goes_unless_another_hung_something_on_it():
    state = update(both(pg.Model.serial(2)), AddBody(ME, "2"))
    (added,) = {body.name for body in state.model.bodies} - {"1", "2"}
    hung = update(state, AddBody(OTHER, added))
    refused = update(hung, Undo(ME))
    assert refused.model is hung.model
    assert "cannot be undone" in refused.clients[ME].notice.text
    moved = update(state, typed(OTHER, "1", "mass", "3"))
    assert [body.name for body in update(moved, Undo(ME)).model.bodies] == ["1", "2"]
    deleted = update(moved, DeleteBodies(ME, (added,), "attach"))
    later = update(deleted, typed(OTHER, "2", "mass", "4"))
    assert added in update(later, Undo(ME)).model.row


def test_who_is_gone_leaves_edits_that_anyone_may_take_back():
    state = update(both(pg.Model.serial(2)), typed(OTHER, "1", "mass", "5"))
    assert update(state, Undo(ME)) is state
    assert update(update(state, Disconnected(OTHER)), Undo(ME)).model.body("1").mass == 1.0
