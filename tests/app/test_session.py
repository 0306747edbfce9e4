"""Many edits of two people, each with an undo of their own (interface 1.9, 1.11)."""

import json
import random
from dataclasses import replace

import pytest

import pgraph_core as pg
from pgraph_app.core.events import Event
from pgraph_app.digraph.view import digraph
from pgraph_app.features import State, initial
from pgraph_app.session.view import others
from pgraph_app.table.view import table

from .store import ME, OTHER, after, begun, built_in, do

pytestmark = pytest.mark.quick

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
            *[do.EditBodies(client, serial, (body,), field, ((index, text),))] * 5,  # type: ignore[arg-type]
            do.AddBody(client, body),
            do.DeleteBodies(client, some, rng.choice(("attach", "delete"))),
            do.Duplicate(client, (body,), rng.random() < 0.5),
            do.MirrorBranch(client, body, rng.choice(("x", "y", "z"))),
            do.MoveRows(client, some, other),
            do.SetParent(client, some, other),
            do.CountBodies(client, serial, str(rng.randint(-2, 24))),
            do.Paste(client, serial, f"{text}\t{other}\t1", (body,) if serial % 2 else ()),
            do.SelectBodies(client, body, some),
            do.Undo(client),
        )
    )


@pytest.mark.parametrize("seed", range(2))
def test_1_9_random_edits_of_two_people_are_undone_to_the_start(seed):
    """Of 150 edits per seed, refused ones change nothing and every other is one step."""
    rng = random.Random(seed)
    start = built_in("quadruped")
    state = begun(start, ME, OTHER)
    for _ in range(150):
        before, event = state, random_event(rng, state)
        state = after(state, event)
        steps = len(state.undo) - len(before.undo)
        assert (steps, state.model is before.model) in ((0, True), (1, False), (-1, False)), event
        for page in state.clients.values():
            assert set(page.selected) <= set(state.model.row)
            assert page.selection is None or page.selection in page.selected
    assert pg.Model.from_json(state.model.to_json()) == state.model
    last, depth = state.model, len(state.undo)
    state = after(state, *[do.Undo(ME)] * depth)
    assert state.model is start
    assert after(state, *[do.Redo(OTHER)] * depth).model is last


@pytest.mark.parametrize("n", [60, pytest.param(1000, marks=pytest.mark.nightly)])
def test_1_11_payloads_follow_from_the_model_alone(n):
    """After any edits, what is sent is what a page that has just come is sent.

    Ids of rows stay through edits: they alone follow from the history.
    """
    rng = random.Random(n)
    state = begun(pg.Model.serial(7))
    for k in range(n):
        state = after(state, random_event(rng, state))
        if k % max(1, n // 60) == 0:
            fresh = initial(pg.Model.from_json(state.model.to_json()))
            fresh = replace(fresh, rows=state.rows)
            for view in (table, digraph):
                assert json.dumps(view(state)) == json.dumps(view(fresh))
            assert fresh.derived.names == state.derived.names


def test_1_11_each_page_sees_where_the_others_are():
    state = begun(pg.Model.serial(3), ME, OTHER)
    state = after(state, do.SelectBodies(OTHER, "2", ("1", "2")), do.Select(ME, "3"))
    assert others(state, ME).keys() == {"1", "2"}
    assert others(state, OTHER).keys() == {"3"}
    assert others(after(state, do.Disconnected(OTHER)), ME) == {}


def typed(client, body, field, text):
    return do.EditBodies(client, 1, (body,), field, (((), text),))


def test_undo_takes_back_the_last_edit_whoever_made_it():
    """One history, and no merging: each step is the whole model before it."""
    start = begun(pg.Model.serial(3), ME, OTHER)
    one = after(start, typed(ME, "1", "mass", "5"))
    state = after(one, typed(OTHER, "1", "name", "arm"))
    assert after(state, do.Undo(ME)).model is one.model
    assert after(state, do.Undo(ME), do.Undo(OTHER)).model is start.model
    assert after(state, do.Undo(ME), do.Undo(OTHER), *[do.Redo(ME)] * 2).model is state.model
