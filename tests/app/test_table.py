"""Interface 1.2 to 1.4 as reducers: several rows selected, copied, moved, pasted, counted."""

from __future__ import annotations

import pytest

import pgraph_core as pg
from app import events
from app.state import State, initial
from app.update import update

ME, OTHER = 1, 2


@pytest.fixture
def state() -> State:
    """Fig. 1's seven bodies, looked at by two pages."""
    model = pg.Model.serial(7).edit("4", parent="2").edit("5", parent="3").edit("6", parent="2")
    return after(initial(model), events.Connected(ME), events.Connected(OTHER))


def after(state: State, *happened: events.Event) -> State:
    for event in happened:
        state = update(state, event)
    return state


# -- 1.2: one selection, of several rows -------------------------------------------------------


def test_several_rows_are_selected_in_the_table_s_order(state):
    state = after(state, events.SelectBodies(ME, "2", ("5", "2", "5", "nobody")))
    assert (state.clients[ME].selection, state.clients[ME].selected) == ("2", ("2", "5"))
    assert state.clients[OTHER].selected == ()
    assert after(state, events.Select(ME, "3")).clients[ME].selected == ("3",)
    assert after(state, events.Select(ME, None)).clients[ME].selected == ()


def test_what_is_selected_follows_names_and_goes_with_its_body(state):
    state = after(state, events.SelectBodies(ME, "5", ("3", "5")))
    renamed = after(state, events.Edit(OTHER, 1, "5", "name", (), "knee"))
    assert (renamed.clients[ME].selection, renamed.clients[ME].selected) == ("knee", ("3", "knee"))
    gone = after(state, events.DeleteBody(OTHER, "5", "delete"))
    assert (gone.clients[ME].selection, gone.clients[ME].selected) == ("3", ("3",))
