"""Files that pages open are read in child processes: the same results, within limits."""

import base64
import time
from functools import partial

import pytest

import pgraph_core as pg
from pgraph_app.core.cells import Refusal
from pgraph_app.model import apart
from pgraph_app.model.apart import Reader, refused
from pgraph_app.model.worker import Errands

from .store import ME, OTHER, after, begun, do, notice, until, zipped

URDF = '<robot name="r"><link name="base"/><link name="a"><inertial><mass value="1"/>'
URDF += '<inertia ixx="1" iyy="1" izz="1"/></inertial></link><joint name="j" type="continuous">'
URDF += '<parent link="base"/><child link="a"/></joint></robot>'
BODY = '<body name="a"><joint name="x" axis="0 1 0"/><geom size=".1" mass="1"/></body>'
LIMITED = '<actuator><muscle name="odd" joint="x" lengthrange="0 1"/></actuator>'
MJCF = f"<mujoco><worldbody>{BODY}</worldbody>{LIMITED}</mujoco>"
MEASURED = LIMITED.replace('lengthrange="0 1"', "")
ENDLESS = '<mujoco><compiler><lengthrange mode="all" inttotal="1e9"/></compiler>'
ENDLESS += f"<worldbody>{BODY}</worldbody>{MEASURED}</mujoco>"


def work_of(event):
    """Return the work of the errand that an event sends."""
    return after(begun(pg.Model.serial(1)), event).errands[-1].work


def archive(name, text):
    return do.OpenArchive(ME, "x.zip", base64.b64encode(zipped((name, text.encode()))).decode())


@pytest.mark.parametrize(
    "event",
    [
        do.OpenText(ME, "m.xml", MJCF),
        do.OpenText(ME, "m.json", pg.Model.serial(2).to_json() + " " * 500_000),
        archive("r/r.urdf", URDF),
    ],
)
def test_a_child_finds_what_the_page_would_find(event, tmp_path, monkeypatch):
    pytest.importorskip("mujoco")
    monkeypatch.setenv("XDG_DATA_HOME", str(tmp_path))
    work = work_of(event)
    here, there = work(None), Reader(work).result()
    assert there == here
    assert there.opened.lost == here.opened.lost
    assert there.opened.notices == here.opened.notices


@pytest.mark.parametrize(
    "event",
    [
        do.OpenText(ME, "r.urdf", URDF.replace('ixx="1"', 'ixx="one"')),
        archive("r/r.urdf", "<robot/>"),
    ],
)
def test_a_refusal_of_a_child_is_that_of_the_reader(event, tmp_path, monkeypatch):
    pytest.importorskip("mujoco")
    monkeypatch.setenv("XDG_DATA_HOME", str(tmp_path))
    work = work_of(event)
    with pytest.raises((pg.PgraphError, Refusal)) as here:
        work(None)
    with pytest.raises(Refusal) as there:
        Reader(work).result()
    assert str(there.value) == str(here.value)


@pytest.mark.parametrize(
    ("expression", "facts"),
    [
        ("bytes(2**33)", "GB"),
        ("[1][2]", "IndexError"),
        ("__import__('os').abort()", "-6"),
        ("print('no answer') or __import__('time').sleep(1e4)", "60 s"),
        ("sum(iter(int, 1))", "60 s"),
    ],
)
def test_a_child_that_fails_is_refused_and_leaves_nothing(expression, facts, tmp_path, monkeypatch):
    monkeypatch.setattr(apart, "LONGEST", 2)
    left = tmp_path / "left"
    make = f"__import__('pathlib').Path({str(left)!r}).mkdir()"
    with pytest.raises(Refusal, match=facts):
        Reader(partial(eval, f"{make} or {expression}"), left).result()
    assert left.exists() == (facts in ("GB", "IndexError"))  # the work tidies up by itself


def test_a_fault_of_pgraph_is_told_as_one(caplog):
    try:
        [].pop()
    except IndexError as error:
        text = refused(error)
    assert "IndexError" in text
    assert "test_apart.py" in text
    assert "pop from" not in text


def test_an_endless_file_of_one_page_delays_no_other_page(tmp_path):
    """Its reading ends when the page cancels it, or is gone."""
    pytest.importorskip("mujoco")
    done = []
    errands = Errands(done.append)

    def shown(old, *events):
        new = after(old, *events)
        errands.render(old, new)
        return new

    state = begun(pg.Model.serial(1), ME, OTHER)
    state = shown(state, do.OpenText(ME, "m.xml", ENDLESS))
    state = shown(state, do.OpenText(ME, "again.xml", MJCF))
    assert "m.xml" in notice(state)
    assert len(state.errands) == 1
    state = shown(state, do.OpenText(OTHER, "r.urdf", URDF))
    until(lambda: len(done) == 1, "the other page's file")
    state = shown(state, done[0])
    assert [b.name for b in state.model.bodies] == ["base", "a"]
    begin = time.monotonic()
    state = shown(state, do.CancelReading(ME))
    assert not state.errands
    until(lambda: len(done) == 2, "the end of the reading that was cancelled")
    assert time.monotonic() - begin < apart.LONGEST / 2
    assert shown(state, done[1]) is state
    state = shown(state, do.OpenText(ME, "m.xml", ENDLESS))
    shown(state, do.Disconnected(ME))
    until(lambda: len(done) == 3, "the end of the reading of a page that is gone")
