"""Files that pages open are read in child processes: the same results, within limits."""

import base64
import json
import struct
import time
from functools import partial

import numpy as np
import pytest

import pgraph_core as pg
from pgraph_app.core.cells import Refusal
from pgraph_app.model import apart
from pgraph_app.model.apart import Errands, Reader, refused

from ..nights import at_night
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
        *at_night(archive("r/r.urdf", "<robot/>")),
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
        ("sum(iter(int, 1))", "60 s"),
        *at_night(("print('no answer') or __import__('time').sleep(1e4)", "60 s")),
    ],
)
def test_a_child_that_fails_is_refused_and_leaves_nothing(expression, facts, tmp_path, monkeypatch):
    if facts == "60 s":  # others end by themselves, however busy the machine is
        monkeypatch.setattr(apart, "LONGEST", 2)
        monkeypatch.setattr(apart, "PATIENCE", 2)
    left = tmp_path / "left"
    make = f"__import__('pathlib').Path({str(left)!r}).mkdir()"
    with pytest.raises(Refusal, match=facts):
        Reader(partial(eval, f"{make} or {expression}"), left).result()
    assert left.exists() == (facts in ("GB", "IndexError"))  # the work tidies up by itself


def glb(nodes: int, triangles: int) -> bytes:
    """Return a glTF file in which each of many nodes shows the same triangles."""
    places = np.random.default_rng(1).random((3 * triangles, 3)).astype("<f4").tobytes()
    view = {"buffer": 0, "byteOffset": 0, "byteLength": len(places)}
    accessor = {"bufferView": 0, "componentType": 5126, "type": "VEC3", "count": 3 * triangles}
    text = json.dumps({
        "asset": {"version": "2.0"}, "scene": 0, "scenes": [{"nodes": [*range(nodes)]}],
        "nodes": [{"mesh": 0}] * nodes, "accessors": [accessor],
        "meshes": [{"primitives": [{"attributes": {"POSITION": 0}}]}],
        "bufferViews": [view], "buffers": [{"byteLength": len(places)}],
    }).encode()  # fmt: skip
    text += b" " * (-len(text) % 4)
    chunks = struct.pack("<II", len(text), 0x4E4F534A) + text
    chunks += struct.pack("<II", len(places), 0x004E4942) + places
    return struct.pack("<4sII", b"glTF", 2, 12 + len(chunks)) + chunks


@pytest.mark.parametrize(("nodes", "triangles"), [(2, 100), *at_night((2000, 150_000))])
def test_a_mesh_that_fills_the_memory_is_refused_before_it_is_drawn(
    nodes, triangles, tmp_path, monkeypatch
):
    monkeypatch.setenv("XDG_DATA_HOME", str(tmp_path))
    mesh = ("meshes/m.glb", glb(nodes, triangles))
    body = {"name": "a", "inertia": [1, 1, 1], "shape": {"kind": "mesh", "file": "meshes/m.glb"}}
    model = ("m.json", json.dumps({"bodies": [body]}).encode())
    sent = base64.b64encode(zipped(model, mesh)).decode()
    reader = Reader(work_of(do.OpenArchive(ME, "x.zip", sent)))
    if nodes == 2:
        assert len(reader.result().opened.bodies) == 1
        return
    with pytest.raises(Refusal, match="GB"):
        reader.result()


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
