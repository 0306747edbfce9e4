"""Models with meshes, saved and opened again elsewhere, in folders and in single files."""

import base64
import json
import tracemalloc
from pathlib import Path

import numpy as np
import pytest
import trimesh

import pgraph_core as pg
from pgraph_app.core.cells import Refusal
from pgraph_app.model import archive
from pgraph_core.mesh_files import load_mesh
from pgraph_core.show.shapes import unreadable

from .store import ME, after, answered, begun, do, notice, zipped

pytestmark = pytest.mark.quick


def mesh(file: Path, size: float = 0.1) -> Path:
    trimesh.creation.box((size, size, size)).export(file)
    return file


def shaped(model, name, file):
    return model.edit(name, shape={"kind": "mesh", "file": str(file)})


def file_of(model, name):
    return Path(model.body(name).shape.file)


def files_in(folder):
    return [file for file in folder.rglob("*") if file.is_file()]


MODEL = pg.Model.serial(1).to_json().encode()


@pytest.fixture
def home(tmp_path, monkeypatch):
    monkeypatch.setenv("XDG_DATA_HOME", str(tmp_path / "home"))
    (tmp_path / "away").mkdir()
    return tmp_path


def test_a_saved_folder_opens_elsewhere(home):
    model = shaped(pg.Model.serial(2), "1", mesh(home / "part.stl"))
    model.save(home / "away" / "machine.json")
    assert '"file": "meshes/part.stl"' in (home / "away" / "machine.json").read_text()
    (home / "part.stl").unlink()
    moved = (home / "away").rename(home / "elsewhere")
    again = pg.Model.load(moved / "machine.json")
    assert file_of(again, "1") == moved / "meshes" / "part.stl"
    assert unreadable(again.bodies) == ()
    before = (moved / "machine.json").read_bytes()
    again.save(moved / "machine.json")
    assert (moved / "machine.json").read_bytes() == before


def test_two_meshes_of_one_name_stay_two(home):
    (home / "b").mkdir()
    model = shaped(pg.Model.serial(4), "1", mesh(home / "part.stl"))
    model = shaped(model, "2", mesh(home / "b" / "part.stl", 0.2))
    model = shaped(shaped(model, "3", home / "part.stl"), "4", "/not/there.stl")
    model.save(home / "away" / "m.json")
    again = pg.Model.load(home / "away" / "m.json")
    one, two, three, none = (file_of(again, name) for name in "1234")
    assert one == three != two
    saved, first = (load_mesh(file) for file in (two, home / "b" / "part.stl"))
    np.testing.assert_array_equal(saved.triangles, first.triangles)
    assert len(files_in(home / "away" / "meshes")) == 2
    assert none == home / "away" / "meshes" / "there.stl"  # kept by name
    (missing,) = unreadable(again.bodies)
    assert "there.stl" in missing


def encoded(content):
    return base64.b64encode(content).decode()


def test_uploaded_downloaded_and_opened_again_on_another_machine(home, monkeypatch):
    content = encoded(mesh(home / "part.stl").read_bytes())
    upload = do.UploadMesh(ME, ("2",), "part.stl", content)
    state = answered(begun(pg.Model.serial(2)), upload)
    name, download = archive.packed(state.model)
    assert name == "serial_2.zip"
    monkeypatch.setenv("XDG_DATA_HOME", str(home / "another"))
    opened = do.OpenArchive(ME, name, encoded(download))
    there = answered(begun(pg.Model.serial(1)), opened)
    assert there.model.name == "serial 2"
    assert there.clients[ME].notice is None
    assert file_of(there.model, "2").is_relative_to(archive.mesh_folder())
    assert unreadable(there.model.bodies) == ()
    assert archive.packed(there.model)[0] == name
    assert after(there, do.Undo(ME)).model.name == "serial 1"
    plain = pg.Model.serial(2)  # without meshes
    assert archive.packed(plain) == ("serial_2.json", plain.to_json().encode())


@pytest.mark.parametrize(
    ("content", "words"),
    [
        (b"PK no", "zip"),
        (b"", "zip"),
        ([("a.txt", b"")], "a.txt"),
        ([("a.json", MODEL), ("meshes/x.stl", bytes(101_000_000))], "101 MB"),
        ([("a.json", b"{")], "JSON"),
    ],
)
def test_a_zip_that_is_no_model_is_refused(home, content, words):
    state = begun(pg.Model.serial(2))
    sent = content if isinstance(content, bytes) else zipped(*content)
    now = answered(state, do.OpenArchive(ME, "x.zip", encoded(sent)))
    assert now.model is state.model
    assert now.clients[ME].notice.bad
    assert "x.zip" in notice(now)
    assert words in notice(now)


def test_a_zip_that_lies_about_a_size_is_not_unpacked(home):
    """It says 10 bytes, and holds 30 MB."""
    packed = bytearray(zipped(("a.json", bytes(30_000_000))))
    entry = packed.rindex(b"PK\x01\x02")  # in the list of files at the end
    packed[entry + 24 : entry + 28] = (10).to_bytes(4, "little")
    tracemalloc.start()
    try:
        with pytest.raises(Refusal, match="damaged"):
            archive.unpacked(bytes(packed), home / "keep")
        _, peak = tracemalloc.get_traced_memory()
    finally:
        tracemalloc.stop()
    assert peak < 3_000_000


def test_a_zip_writes_nowhere_but_where_meshes_are_kept(home):
    named = shaped(pg.Model.serial(1), "1", "meshes/fine.stl").to_json().encode()
    hostile = zipped(
        ("a.json", named), ("../../evil.stl", b"x"), ("/etc/evil.stl", b"x"),
        ("meshes/../evil.stl", b"x"), ("meshes/evil.sh", b"x"), ("meshes/fine.stl", b"x"),
    )  # fmt: skip
    archive.unpacked(hostile, home / "keep")
    assert [p.name for p in files_in(home)] == ["fine.stl"]
    with pytest.raises(Refusal):
        archive.unpacked(hostile[:-40], home / "keep")


def test_opening_an_archive_keeps_only_meshes_of_its_model(home, monkeypatch):
    part = ("meshes/part.stl", mesh(home / "part.stl").read_bytes())
    shape = {"kind": "mesh", "file": "meshes/part.stl"}
    model = ("m.json", json.dumps({"bodies": [{"name": "a", "shape": shape}]}).encode())
    content, keep = zipped(model, part, ("meshes/other.stl", bytes(1_000_000))), home / "keep"
    for _ in range(2):  # the second finds what the first has left
        opened, _ = archive.unpacked(content, keep)
        assert files_in(keep) == [file_of(opened, "a")]
    with pytest.raises(pg.PgraphError):
        archive.unpacked(zipped(("m.json", b'{"bodies": 1}'), part), home / "refused")
    assert not files_in(home / "refused")
    monkeypatch.setattr(archive, "LARGEST_KEPT", 1000)
    archive.unpacked(content, keep)  # it is there
    with pytest.raises(Refusal, match="MB"):
        archive.unpacked(zipped(model, part), keep)
