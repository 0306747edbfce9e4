"""Limits and small steps of the page's update functions."""

from __future__ import annotations

from dataclasses import replace
from types import SimpleNamespace

import numpy as np
import pytest

import pgraph_core as pg
from pgraph_app.core.edit import renamed
from pgraph_app.core.state import initial
from pgraph_app.features import update
from pgraph_app.playback.update import StepFrames, Tick
from pgraph_app.run import update as runs
from pgraph_app.run.update import Simulate, Simulated
from pgraph_app.session.update import Connected
from pgraph_app.table import update as tables
from pgraph_app.table.update import AddBody

ME = 1


@pytest.fixture
def state():
    return update(initial(pg.Model.serial(3), {}), Connected(ME))


def ran(state, times):
    pose = np.zeros((len(times), 3, 7))
    pose[:, :, 3] = 1.0
    result = SimpleNamespace(t=np.array(times), body_pose=pose)
    return update(update(state, Simulate(ME)), Simulated(1, result))


def frames(parts):
    return [t for part in parts for t in part.t]


def test_a_preview_ends_with_the_run(state):
    state = ran(state, [0.0, 0.5, 1.0])
    state = replace(state, playback=replace(state.playback, time=0.5, playing=False, preview=True))
    state = update(state, Tick(0.25))
    assert (state.playback.time, state.playback.preview) == (0.75, True)
    state = update(state, Tick(0.25))
    assert (state.playback.time, state.playback.preview) == (1.0, False)


def test_a_run_of_one_instant_has_no_frames_to_step_through(state):
    state = ran(state, [0.0])
    state = replace(state, playback=replace(state.playback, playing=True))
    assert update(state, StepFrames(ME, 1)) is state


def test_another_body_in_a_row_is_no_new_name():
    old = pg.Model.serial(3)
    assert list(renamed(old, old.edit("2", name="b"))) == [("bodies", "2", "b")]
    assert list(renamed(old, old.edit("2", name="b", mass=9.0))) == []


def test_a_table_may_have_exactly_as_many_bodies_as_allowed(state, monkeypatch):
    monkeypatch.setattr(tables, "MOST_BODIES", 4)
    state = update(state, AddBody(ME, "3"))
    assert len(state.model.bodies) == 4
    assert len(update(state, AddBody(ME, "3")).model.bodies) == 4


def test_parts_of_a_live_run_are_joined_in_step(monkeypatch):
    """Each count of joins belongs to one part, whatever has been joined."""
    monkeypatch.setattr(pg, "joined", lambda parts: SimpleNamespace(t=frames(parts)))
    live = SimpleNamespace(parts=(), joined=())
    for k in range(runs.TOGETHER**2 + 3):
        parts, joined = runs.grown(live, SimpleNamespace(t=[k]))
        live = SimpleNamespace(parts=parts, joined=joined)
        assert len(parts) == len(joined)
    assert joined == (2, 0, 0, 0)
    assert frames(parts) == list(range(runs.TOGETHER**2 + 3))
