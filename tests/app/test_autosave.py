"""Interface 1.9: what was edited is there again after kill -9, and nothing else comes back."""

from __future__ import annotations

import json
import os
import signal
import subprocess
import sys
from pathlib import Path

import pytest

import pgraph_core as pg
from pgraph_app.core.events import Event
from pgraph_app.core.state import State, initial
from pgraph_app.features import update
from pgraph_app.model.update import Edit, OpenKept, Undo, recovered
from pgraph_app.session.autosave import Autosave, left_behind, state_folder
from pgraph_app.session.update import Connected, NotKept

from .conftest import until

HOST, PORT = "127.0.0.1", 1  # nobody serves there


@pytest.fixture
def state() -> State:
    return update(initial(pg.Model.serial(3)), Connected(1))


def edited(state: State, mass: str) -> State:
    return update(state, Edit(1, 1, "2", "mass", (), mass))


def saver(folder: Path, sent: list | None = None) -> Autosave:
    return Autosave(folder, HOST, PORT, "serial", (sent if sent is not None else []).append)


def test_the_last_of_many_edits_is_written_and_offered(tmp_path, state):
    keeper, now = saver(tmp_path / "new"), state
    keeper.render(state, state)
    for k in range(20):
        old, now = now, edited(now, str(k + 2))
        keeper.render(old, now)
    until(lambda: left_behind(tmp_path / "new", HOST, PORT), "the file", seconds=5)
    keeper.stop()
    (kept,) = left_behind(tmp_path / "new", HOST, PORT)
    assert pg.Model.from_json(kept.text) == now.model
    assert (kept.given, kept.ended) == ("serial", True)
    assert [path.name for path in (tmp_path / "new").iterdir()] == ["127.0.0.1 1.json"]


def test_an_edit_is_on_disk_when_the_next_view_draws(tmp_path, state):
    """Views draw in turn, this one first: what acknowledges an edit comes after it."""
    keeper, now = saver(tmp_path), state
    keeper.render(state, state)
    for k in range(20):
        old, now = now, edited(now, str(k + 2))
        keeper.render(old, now)
        (kept,) = left_behind(tmp_path, HOST, PORT)
        assert pg.Model.from_json(kept.text) == now.model
    keeper.stop()


def test_what_could_not_be_written_is_tried_again_and_every_page_is_told(tmp_path, state):
    blocked = tmp_path / "folder"
    blocked.write_text("a file where the folder is to be")
    sent: list[Event] = []
    keeper, now = saver(blocked, sent), edited(state, "2")
    keeper.render(state, state)
    keeper.render(state, now)
    assert isinstance(sent[0], NotKept)
    failing = update(update(now, sent[0]), Connected(7))
    assert failing.clients[7].notice is not None  # a page that opens later
    assert failing.clients[7].notice.bad
    blocked.unlink()
    until(lambda: left_behind(blocked, HOST, PORT), "the file", seconds=10)
    until(lambda: len(sent) == 2, "the word that it works", seconds=10)
    keeper.stop()
    works = update(failing, sent[1])
    assert not works.clients[7].notice.bad
    assert update(works, Connected(8)).clients[8].notice is None


def test_nothing_is_written_without_an_edit_or_after_undo(tmp_path, state):
    keeper, now = saver(tmp_path), edited(state, "2")
    keeper.render(state, state)
    keeper.render(state, now)
    keeper.render(now, update(now, Undo(1)))
    keeper.stop()
    assert list(tmp_path.iterdir()) == []


def test_what_cannot_be_written_is_said_once(tmp_path, state):
    (tmp_path / "file").write_text("")
    sent: list[Event] = []
    keeper = saver(tmp_path / "file" / "folder", sent)
    keeper.render(state, state)
    keeper.render(state, edited(state, "2"))
    until(lambda: sent, "the problem", seconds=5)
    keeper.stop()
    (event,) = sent
    told = update(state, event).clients[1].notice
    assert told is not None
    assert told.bad
    assert "file" in told.text


def test_a_session_that_was_killed_comes_back_as_one_undo_step(tmp_path, state):
    text = pg.Model.serial(5).to_json()
    session = {"given": "serial", "text": text, "ended": False}
    (tmp_path / "127.0.0.1 1.json").write_text(json.dumps(session))
    (tmp_path / "127.0.0.1 2.json").write_text("{")
    (tmp_path / "127.0.0.1 3.json").write_text(json.dumps({**session, "text": "[]"}))
    left = left_behind(tmp_path, HOST, PORT)
    assert len(left) == 1
    again = recovered(initial(state.model), left, "serial")
    assert len(again.model.bodies) == 5
    page = update(again, Connected(1)).clients[1]
    assert page.notice is not None
    assert "Undo" in page.notice.text
    assert "serial" in page.notice.text
    assert update(again, Undo(1)).model is state.model
    other = recovered(initial(state.model), left, "quadruped")
    assert other.model is state.model
    (name,) = other.kept
    opened = update(other, OpenKept(1, name))
    assert (len(opened.model.bodies), opened.kept) == (5, {})


def test_a_session_that_ended_in_order_is_offered_not_opened(tmp_path, state):
    session = {"given": "serial", "text": pg.Model.serial(5).to_json(), "ended": True}
    (tmp_path / "127.0.0.1 1.json").write_text(json.dumps(session))
    again = recovered(initial(state.model), left_behind(tmp_path, HOST, PORT), "serial")
    assert again.model is state.model
    assert len(again.kept) == 1


def test_a_session_that_is_still_served_is_left_alone(tmp_path, served):
    session = {"given": "x", "text": pg.Model.serial(2).to_json(), "ended": False}
    (tmp_path / f"127.0.0.1 {served.port}.json").write_text(json.dumps(session))
    assert left_behind(tmp_path, HOST, PORT) == ()


KILLED = """
import sys, time
from pathlib import Path
import pgraph_core as pg
from pgraph_app.server import serve
from pgraph_app.table.update import CountBodies
keep = Path(sys.argv[1])
server = serve(pg.Model.serial(3), port=18300, open_browser=False, given="three", keep=keep)
print(len(server.store.state.model.bodies), flush=True)
server.send(CountBodies(-1, 1, "7"))
time.sleep(60)
"""


def test_after_kill_9_the_model_is_there_when_the_server_starts_again(tmp_path):
    def run() -> subprocess.Popen[str]:
        command = [sys.executable, "-c", KILLED, str(tmp_path)]
        return subprocess.Popen(command, stdout=subprocess.PIPE, text=True)

    def said(process: subprocess.Popen[str]) -> list[str]:
        assert process.stdout is not None
        lines = []
        while not lines or not lines[-1].isdigit():
            lines.append(process.stdout.readline().strip())
        return lines

    first = run()
    try:
        assert said(first)[-1] == "3"
        until(lambda: list(tmp_path.glob("*.json")), "the file", seconds=20)
    finally:
        os.kill(first.pid, signal.SIGKILL)
        first.wait()
    second = run()
    try:
        lines = said(second)
    finally:
        second.kill()
        second.wait()
    assert lines[-1] == "7"
    assert any(line.startswith("Recovered serial 3 as it was at") for line in lines)


def test_the_folder_is_the_one_for_state(monkeypatch, tmp_path):
    monkeypatch.setenv("XDG_STATE_HOME", str(tmp_path))
    assert state_folder() == tmp_path / "pgraph"
