"""Autosave: an edited model survives kill -9, and nothing else comes back (interface 1.9)."""

import json
import socket
import subprocess
import sys

import pytest

import pgraph_core as pg
from pgraph_app.core.state import initial
from pgraph_app.model.update import recovered
from pgraph_app.server import serve
from pgraph_app.session.autosave import Autosave, left_behind, state_folder

from .store import ME, after, begun, do, notice, until

HOST, PORT = "127.0.0.1", 1  # nobody serves there


@pytest.fixture
def state():
    return begun(pg.Model.serial(3))


def edited(state, mass):
    return after(state, do.Edit(ME, 1, "2", "mass", (), mass))


def saver(folder, sent=None):
    return Autosave(folder, HOST, PORT, "serial", (sent if sent is not None else []).append)


def test_an_edit_is_on_disk_when_the_next_view_draws(tmp_path, state, monkeypatch):
    """Views draw in turn, this one first: what acknowledges an edit comes after it."""
    keeper, now, folder = saver(tmp_path / "new"), state, tmp_path / "new"
    keeper.render(state, state)
    for k in range(20):
        old, now = now, edited(now, str(k + 2))
        keeper.render(old, now)
        (kept,) = left_behind(folder, HOST, PORT)
        assert pg.Model.from_json(kept.text) == now.model
    keeper.stop()
    (kept,) = left_behind(folder, HOST, PORT)
    assert pg.Model.from_json(kept.text) == now.model
    assert (kept.given, kept.ended) == ("serial", True)
    assert [path.name for path in folder.iterdir()] == ["127.0.0.1 1.json"]  # no part of a file
    monkeypatch.setenv("XDG_STATE_HOME", str(tmp_path))
    assert state_folder() == tmp_path / "pgraph"


def test_a_failed_write_is_retried_and_reported_on_every_page(tmp_path, state):
    blocked = tmp_path / "folder"
    blocked.write_text("a file where the folder is to be")
    sent = []
    keeper, now = saver(blocked, sent), edited(state, "2")
    keeper.render(state, state)
    keeper.render(state, now)
    assert isinstance(sent[0], do.NotKept)
    failing = after(now, sent[0], do.Connected(7))  # a page that opens later
    assert failing.clients[7].notice.bad
    assert "folder" in notice(failing, 7)
    blocked.unlink()
    until(lambda: left_behind(blocked, HOST, PORT), "the file")
    until(lambda: len(sent) > 1, "the word that it works")
    keeper.stop()
    works = after(failing, sent[1])
    assert not works.clients[7].notice.bad
    assert after(works, do.Connected(8)).clients[8].notice is None
    assert len(sent) == 2


def test_nothing_is_written_without_an_edit_or_after_undo(tmp_path, state):
    keeper, now = saver(tmp_path), edited(state, "2")
    keeper.render(state, state)
    keeper.render(state, now)
    keeper.render(now, after(now, do.Undo(ME)))
    keeper.stop()
    assert list(tmp_path.iterdir()) == []


def leave(folder, port=PORT, **fields):
    session = {"given": "serial", "text": pg.Model.serial(5).to_json(), "ended": False, **fields}
    (folder / f"{HOST} {port}.json").write_text(json.dumps(session))


def test_a_session_that_was_killed_comes_back_as_one_undo_step(tmp_path, state):
    leave(tmp_path)
    (tmp_path / f"{HOST} 2.json").write_text("{")
    leave(tmp_path, 3, text="[]")
    (left,) = left_behind(tmp_path, HOST, PORT)
    again = recovered(initial(state.model), [left], "serial")
    assert len(again.model.bodies) == 5
    assert "serial" in notice(after(again, do.Connected(ME)))
    assert after(again, do.Undo(ME)).model is state.model
    other = recovered(initial(state.model), [left], "quadruped")
    assert other.model is state.model
    (name,) = other.kept
    opened = after(other, do.OpenKept(ME, name))
    assert (len(opened.model.bodies), opened.kept) == (5, {})
    leave(tmp_path, ended=True)  # in order: it is offered, not opened
    offered = recovered(initial(state.model), left_behind(tmp_path, HOST, PORT), "serial")
    assert offered.model is state.model
    assert len(offered.kept) == 1


def test_a_session_that_is_still_served_is_left_alone(tmp_path):
    server = serve(pg.Model.serial(2), port=0, open_browser=False)
    try:
        leave(tmp_path, server.port)
        assert left_behind(tmp_path, HOST, PORT) == ()
    finally:
        server.stop()


KILLED = """
import sys, time
from pathlib import Path
import pgraph_core as pg
from pgraph_app.server import serve
from pgraph_app.table.update import CountBodies
keep, port = Path(sys.argv[1]), int(sys.argv[2])
server = serve(pg.Model.serial(3), port=port, open_browser=False, given="three", keep=keep)
print(len(server.store.state.model.bodies), flush=True)
server.send(CountBodies(-1, 1, "7"))
sys.stdin.read()
"""


@pytest.mark.nightly
def test_after_kill_9_the_model_is_there_when_the_server_starts_again(tmp_path):
    with socket.socket() as free:
        free.bind((HOST, 0))
        port = free.getsockname()[1]

    def printed():
        """What a server prints until it is killed, once there is a file."""
        command = [sys.executable, "-c", KILLED, str(tmp_path), str(port)]
        pipes, lines = {"stdin": subprocess.PIPE, "stdout": subprocess.PIPE}, []
        server = subprocess.Popen(command, text=True, **pipes)
        try:
            while not lines or not lines[-1].isdigit():
                lines.append(server.stdout.readline().strip())
            until(lambda: list(tmp_path.glob("*.json")), "the file")
        finally:
            server.kill()
            server.wait()
        return lines

    assert printed()[-1] == "3"
    lines = printed()
    assert lines[-1] == "7"
    assert any("serial 3" in line for line in lines)
