"""Autosave: an edited model survives kill -9, and nothing else comes back (interface 1.9)."""

import json
import os
import socket
import subprocess
import sys
from pathlib import Path

import pytest

import pgraph_core as pg
from pgraph_app.features import initial
from pgraph_app.model import recovered
from pgraph_app.session.autosave import Autosave, left_behind, state_folder

from .store import ME, after, begun, do, notice, until

HOST = "127.0.0.1"


@pytest.fixture
def state():
    return begun(pg.Model.serial(3))


def edited(state, mass):
    return after(state, do.EditBodies(ME, 1, ("2",), "mass", (((), mass),)))


def saver(folder, sent=None):
    return Autosave(folder, "serial", (sent if sent is not None else []).append)


def files(folder):
    """Return the contents of the session files, whoever they belong to."""
    return [json.loads(path.read_text()) for path in sorted(folder.glob("*.json"))]


def test_an_edit_is_on_disk_when_the_next_view_draws(tmp_path, state, monkeypatch):
    """Views draw in turn, this one first: what acknowledges an edit comes after it."""
    keeper, now, folder = saver(tmp_path / "new"), state, tmp_path / "new"
    keeper.render(state, state)
    for k in range(20):
        old, now = now, edited(now, str(k + 2))
        keeper.render(old, now)
        (kept,) = files(folder)
        assert pg.Model.from_json(kept["text"]) == now.model
        assert left_behind(folder) == ()  # it still runs
    keeper.stop()
    (kept,) = left_behind(folder)
    assert pg.Model.from_json(kept.text) == now.model
    assert (kept.given, kept.ended) == ("serial", True)
    assert [path.suffix for path in folder.iterdir()] == [".json"]  # no lock, no part of a file
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
    until(lambda: blocked.is_dir() and files(blocked), "the file")
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


def test_a_saved_model_is_not_at_risk_until_the_next_edit(tmp_path, state):
    keeper, now = saver(tmp_path), edited(state, "2")
    keeper.render(state, state)
    keeper.render(state, now)
    asked = after(now, do.Save(ME, 2, "here.json"))
    done = after(asked, do.Saved(ME, 2, "here.json", ""))
    keeper.render(now, done)
    assert files(tmp_path) == []
    keeper.render(done, edited(done, "3"))
    keeper.stop()
    assert len(left_behind(tmp_path)) == 1


def test_each_document_has_a_file_until_its_opening_is_undone(tmp_path, state):
    """An edited model that another one replaces is kept. Undo and Redo switch between both."""
    keeper, now = saver(tmp_path), edited(state, "2")
    keeper.render(state, state)
    keeper.render(state, now)
    texts = []
    for event in (do.NewModel(ME, 2, "4"), do.Undo(ME), do.Redo(ME), do.Undo(ME), do.Redo(ME)):
        old, now = now, after(now, event)
        keeper.render(old, now)
        texts.append({len(pg.Model.from_json(kept["text"]).bodies) for kept in files(tmp_path)})
    assert texts == [{3, 4}, {3}, {3, 4}, {3}, {3, 4}]
    keeper.stop()
    assert {len(pg.Model.from_json(kept.text).bodies) for kept in left_behind(tmp_path)} == {3, 4}


def leave(folder, number=0, **fields):
    session = {"given": "serial", "text": pg.Model.serial(5).to_json(), "ended": False, **fields}
    path = folder / f"{number:016x}-0.json"
    path.write_text(json.dumps(session))
    return path


def test_a_session_that_was_killed_comes_back_as_one_undo_step(tmp_path, state):
    leave(tmp_path)
    (tmp_path / "2-0.json").write_text("{")
    leave(tmp_path, 3, text="[]")
    (left,) = left_behind(tmp_path)
    again = recovered(initial(state.model), [left], "serial")
    assert len(again.model.bodies) == 5
    assert "serial" in notice(after(again, do.Connected(ME)))
    assert after(again, do.Undo(ME)).model is state.model
    other = after(recovered(initial(state.model), [left], "quadruped"), do.Connected(ME))
    assert "1 model" in notice(other)
    assert other.model is state.model
    (name,) = other.kept
    opened = after(other, do.OpenKept(ME, name))
    assert (len(opened.model.bodies), opened.kept) == (5, {})
    leave(tmp_path, ended=True)  # stopped, not killed: it is offered, not opened
    offered = recovered(initial(state.model), left_behind(tmp_path), "serial")
    assert offered.model is state.model
    assert len(offered.kept) == 1


def test_all_sessions_of_an_instant_are_offered_and_only_the_one_opened_goes(tmp_path, state):
    """Sessions of other models are offered, the newest killed one of this model is restored."""
    for k in range(30):
        path = leave(tmp_path, k, given="serial" if k % 3 else "other", ended=k % 2 == 0)
        os.utime(path, ns=(10**18 + k // 10, 10**18 + k // 10))
    left = left_behind(tmp_path)
    now = recovered(initial(state.model), left, "serial")
    assert (len(left), len(now.kept)) == (30, 29)
    again = {kept.path for kept in left} - {kept.path for kept in now.kept.values()}
    keeper = Autosave(tmp_path, "serial", lambda event: None, again)
    keeper.render(now, now)
    assert len(files(tmp_path)) == 30  # the restored one is in a file of this session
    now, old = after(now, do.Connected(ME), do.OpenKept(ME, next(iter(now.kept)))), now
    keeper.render(old, now)
    old, now = now, after(now, do.DiscardKept(ME, next(iter(now.kept))))
    keeper.render(old, now)
    assert (len(files(tmp_path)), len(now.kept)) == (29, 27)
    keeper.stop()
    assert len(left_behind(tmp_path)) == 29


def test_a_session_that_cannot_be_read_stays_on_offer(tmp_path, state):
    leave(tmp_path, text='{"name": "later", "bodies": [], "of a later version": 1}')
    now = recovered(initial(state.model), left_behind(tmp_path), "serial")
    assert now.model is state.model
    opened = after(now, do.Connected(ME), do.OpenKept(ME, *now.kept))
    assert "later" in notice(opened)
    assert opened.kept == now.kept


@pytest.mark.parametrize(
    ("kills", "seed"),
    [(12, 0), *(pytest.param(100, seed, marks=pytest.mark.nightly) for seed in range(5))],
)
def test_no_acknowledged_edit_is_lost_where_sessions_are_killed(tmp_path, kills, seed):
    """Random interleavings of two models in two folders, edited by up to two processes."""
    command = [sys.executable, "-m", "tests.app.kills", str(tmp_path), str(kills), str(seed)]
    done = subprocess.run(command, text=True, capture_output=True, check=False)
    assert done.returncode == 0, done.stderr
    assert int(done.stdout) > 0


EDITING = """
import sys, threading
import pgraph_app.server
from pgraph_app.cli import main
from pgraph_app.table import CountBodies
serve = pgraph_app.server.serve
def served(*args, **options):
    server = serve(*args, **options)
    def edit():
        for line in sys.stdin:
            server.send(CountBodies(-1, 1, line.strip()))
            while len(server.store._drawn.model.bodies) != int(line):
                pass
            print("edited", flush=True)
    threading.Thread(target=edit, daemon=True).start()
    print("bodies", len(server.store.state.model.bodies), flush=True)
    return server
pgraph_app.server.serve = served
main(sys.argv[1:])
"""


class Command:
    """`pgraph MODEL --port PORT` in a folder."""

    def __init__(self, state, folder, model, port):
        command = [sys.executable, "-c", EDITING, model, "--port", str(port), "--no-browser"]
        env = os.environ | {"XDG_STATE_HOME": str(state), "PYTHONPATH": os.pathsep.join(sys.path)}
        pipes = {"stdin": subprocess.PIPE, "stdout": subprocess.PIPE, "cwd": folder, "env": env}
        self.process = subprocess.Popen(command, text=True, **pipes)
        self.said = ""
        self.bodies = int(self.heard("bodies").split()[1])

    def heard(self, word):
        """Return the line that starts with a word, once it is printed."""
        while line := self.process.stdout.readline():
            self.said += line
            if line.startswith(word):
                return line
        raise AssertionError(f"it ended; it said {self.said}")

    def killed_after(self, bodies):
        """Kill it once an edit to this many bodies is acknowledged."""
        self.process.stdin.write(f"{bodies}\n")
        self.process.stdin.flush()
        self.heard("edited")
        self.kill()

    def kill(self):
        self.process.kill()
        self.process.communicate()


@pytest.mark.nightly
def test_commands_that_are_killed_lose_no_edit_whatever_their_ports_and_folders(tmp_path):
    """Same names in two folders, the port of another model, and a port that is taken."""
    state, folders = tmp_path / "state", (tmp_path / "x", tmp_path / "y")
    for n, folder in enumerate(folders, 2):
        folder.mkdir()
        for k, name in enumerate(("a", "b")):
            pg.Model.serial(n + 2 * k).replace(name=name).save(folder / f"{name}.json")
    with socket.create_server((HOST, 0)) as taken:
        port = taken.getsockname()[1]
        Command(state, folders[0], "a.json", port).killed_after(6)
    Command(state, folders[0], "b.json", port).killed_after(7)  # R1
    one = Command(state, folders[1], "a.json", port)  # R3
    assert one.bodies == 3
    assert "2 models" in one.said
    one.killed_after(8)
    with socket.create_server((HOST, port)):  # R2
        one = Command(state, tmp_path, "x/a.json", port)
        other = Command(state, folders[0], "../y/a.json", port + 1)  # R4
    assert (one.bodies, other.bodies) == (6, 8)
    one.kill()
    other.kill()
    last = Command(state, folders[1], "b.json", 0)
    assert last.bodies == 5
    assert "3 models" in last.said
    last.kill()


def kept_of(folder):
    return [pg.Model.from_json(kept.text) for kept in left_behind(folder)]


@pytest.mark.parametrize("gone", ["the lock", "the file", "the folder"])
def test_what_others_remove_is_written_again(tmp_path, state, gone):
    """A second server, or somebody who tidies up, does not lose an edit of a server that runs."""
    folder = tmp_path / "state"
    keeper, now = saver(folder), edited(state, "5")
    keeper.render(state, state)
    keeper.render(state, now)
    for path in list(folder.iterdir()):
        if gone == "the folder" or path.suffix == {"the lock": ".lock", "the file": ".json"}[gone]:
            path.unlink()
    if gone == "the folder":
        folder.rmdir()
    until(lambda: [*folder.glob("*.json")] and [*folder.glob("*.lock")], "files of the session")
    until(lambda: left_behind(folder) == (), "a lock that is held")
    keeper.stop()
    assert kept_of(folder) == [now.model]


def test_where_files_cannot_be_locked_a_process_that_runs_keeps_its_files(
    tmp_path, state, monkeypatch
):
    """Another process is a child that sleeps; once it has ended, its model is offered."""

    def refused(*_):
        raise OSError("no locks here")

    monkeypatch.setattr("pgraph_app.session.autosave.fcntl.flock", refused)
    keeper, now = saver(tmp_path), edited(state, "5")
    keeper.render(state, state)
    with subprocess.Popen([sys.executable, "-c", "input()"], stdin=subprocess.PIPE) as other:
        monkeypatch.setattr("pgraph_app.session.autosave.os.getpid", lambda: other.pid)
        keeper.render(state, now)
        monkeypatch.undo()
        monkeypatch.setattr("pgraph_app.session.autosave.fcntl.flock", refused)
        assert left_behind(tmp_path) == ()
        other.communicate(b"\n")
    assert kept_of(tmp_path) == [now.model]


def test_a_model_that_cannot_be_written_is_told_whatever_the_error(tmp_path, state, monkeypatch):
    told = []
    keeper = saver(tmp_path, told)
    keeper.render(state, state)
    with monkeypatch.context() as broken:
        broken.setattr(pg.Model, "model_dump_json", lambda *_, **__: 1 / 0)
        keeper.render(state, now := edited(state, "5"))
        assert "ZeroDivisionError" in told[-1].problem
    until(lambda: told[-1].problem == "", "the write that is tried again")
    keeper.stop()
    assert kept_of(tmp_path) == [now.model]


@pytest.mark.parametrize("made", ["damaged", "a pipe", "a device", "unreadable text"])
def test_a_file_that_cannot_be_read_is_named_and_stays(tmp_path, caplog, made):
    path = tmp_path / "0123456789abcdef-0.json"
    if made == "a pipe":
        os.mkfifo(path)
    elif made == "a device":
        path.symlink_to("/dev/zero")
    else:
        name = r"\\ud800" if made == "unreadable text" else "arm"
        text = f'{{"given": "", "text": "{{\\"name\\": \\"{name}\\"}}", "ended": false}}'
        path.write_text(text if made == "unreadable text" else text[:-3])
    assert left_behind(tmp_path) == ()
    assert path.name in caplog.text
    assert [each.name for each in tmp_path.iterdir()] == [path.name]


@pytest.fixture
def soon(monkeypatch):
    """Failed writes are tried again at once."""
    monkeypatch.setattr("pgraph_app.session.autosave.RETRY", 0.01)


def tries(keeper, monkeypatch):
    """Return a list that grows with every try to write."""
    made, write = [], keeper._write_due
    monkeypatch.setattr(keeper, "_write_due", lambda **how: made.append(write(**how)))
    return made


def out_of_reach(folder, patch, *calls):
    """Refuse what is in a folder, as a system does if nobody may enter it (root always may)."""

    def refusing(real):
        def asked(path, *args, **how):
            if path.parent == folder:
                raise PermissionError(13, "Permission denied", str(path))
            return real(path, *args, **how)

        return asked

    for name in calls or ("stat", "open", "unlink"):
        patch.setattr(Path, name, refusing(getattr(Path, name)))


def test_a_folder_out_of_reach_is_told_once_and_its_lock_is_kept(
    tmp_path, state, monkeypatch, soon
):
    """Without its lock, a server that starts as the folder is back would take the model over."""
    sent = []
    keeper, now = saver(tmp_path, sent), edited(state, "5")
    keeper.render(state, state)
    keeper.render(state, now)
    before = {path.name for path in tmp_path.iterdir()}
    made = tries(keeper, monkeypatch)
    with monkeypatch.context() as refused:
        out_of_reach(tmp_path, refused)
        until(lambda: sent, "a warning before any edit")
        old, now = now, edited(now, "6")
        keeper.render(old, now)
        until(lambda: len(made) > 5, "more tries")
    until(lambda: sent[-1].problem == "", "the word that it works")
    assert len(sent) == 2
    assert {path.name for path in tmp_path.iterdir()} == before
    assert left_behind(tmp_path) == ()  # it is still locked
    keeper.stop()
    assert kept_of(tmp_path) == [now.model]


def test_a_lock_that_cannot_be_made_is_told_once(tmp_path, state, monkeypatch, soon):
    sent = []
    keeper = saver(tmp_path, sent)
    keeper.render(state, state)
    made = tries(keeper, monkeypatch)
    with monkeypatch.context() as refused:
        out_of_reach(tmp_path, refused)
        keeper.render(state, now := edited(state, "5"))
        until(lambda: len(made) > 5, "more tries")
    until(lambda: sent[-1].problem == "", "the word that it works")
    assert len(sent) == 2
    keeper.stop()
    assert kept_of(tmp_path) == [now.model]


def test_a_server_ends_and_starts_in_a_folder_that_became_read_only(tmp_path, state, monkeypatch):
    """Locks stay there, but are free."""
    keeper, now = saver(tmp_path), edited(state, "5")
    keeper.render(state, state)
    keeper.render(state, now)
    (
        tmp_path / "0123456789abcdef.lock"
    ).touch()  # of a server that was killed before its first edit
    with monkeypatch.context() as refused:
        out_of_reach(tmp_path, refused, "unlink")
        keeper.stop()
        assert kept_of(tmp_path) == [now.model]
    assert len([*tmp_path.glob("*.lock")]) == 2


def test_a_folder_that_cannot_be_read_is_named(tmp_path, caplog):
    assert left_behind(tmp_path / "new") == ()
    assert not caplog.text
    (folder := tmp_path / "state").symlink_to(tmp_path / "state")  # a circle: root fails as well
    assert left_behind(folder) == ()
    assert str(folder) in caplog.text
