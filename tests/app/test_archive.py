"""Models with meshes: saved and opened again elsewhere, by folders and by files of one piece."""

from __future__ import annotations

import base64
import io
import json
import shutil
import zipfile
from pathlib import Path

import numpy as np
import pytest
import trimesh

import pgraph_core as pg
from pgraph_app.core.cells import Refusal
from pgraph_app.core.state import Notice, State, initial
from pgraph_app.features import update
from pgraph_app.model import archive
from pgraph_app.model.archive import mesh_folder as folder
from pgraph_app.model.update import OpenArchive, Undo
from pgraph_app.model.worker import answer
from pgraph_app.properties.update import UploadMesh
from pgraph_app.session.update import Connected
from pgraph_core.mesh_files import load_mesh
from pgraph_core.show.shapes import unreadable

ME = 1


def mesh(file: Path, size: float = 0.1) -> Path:
    trimesh.creation.box((size, size, size)).export(file)
    return file


def shaped(model: pg.Model, name: str, file: Path | str) -> pg.Model:
    return model.edit(name, shape={"kind": "mesh", "file": str(file)})


def notice_of(state: State) -> Notice:
    notice = state.clients[ME].notice
    assert notice is not None
    return notice


def file_of(model: pg.Model, name: str) -> Path:
    shape = model.body(name).shape
    assert shape is not None
    assert shape.file is not None
    return Path(shape.file)


@pytest.fixture
def home(tmp_path, monkeypatch) -> Path:
    monkeypatch.setenv("XDG_DATA_HOME", str(tmp_path / "home"))
    return tmp_path


@pytest.fixture
def away(tmp_path) -> Path:
    (tmp_path / "away").mkdir()
    return tmp_path / "away"


def test_a_saved_folder_opens_elsewhere(home, away):
    model = shaped(pg.Model.serial(2), "1", mesh(home / "part.stl"))
    model.save(away / "machine.json")
    assert '"file": "meshes/part.stl"' in (away / "machine.json").read_text()
    (home / "part.stl").unlink()
    moved = away.rename(home / "elsewhere")
    again = pg.Model.load(moved / "machine.json")
    assert file_of(again, "1") == moved / "meshes" / "part.stl"
    assert unreadable(again.bodies) == ()
    before = (moved / "machine.json").read_bytes()
    again.save(moved / "machine.json")
    assert (moved / "machine.json").read_bytes() == before


def test_two_meshes_of_one_name_stay_two(home, away):
    (home / "b").mkdir()
    model = shaped(pg.Model.serial(3), "1", mesh(home / "part.stl"))
    model = shaped(model, "2", mesh(home / "b" / "part.stl", 0.2))
    model = shaped(model, "3", home / "part.stl")
    model.save(away / "m.json")
    again = pg.Model.load(away / "m.json")
    one, two, three = (file_of(again, name) for name in "123")
    assert one == three != two
    saved, first = (load_mesh(file) for file in (two, home / "b" / "part.stl"))
    np.testing.assert_array_equal(saved.triangles, first.triangles)
    assert len(list((away / "meshes").iterdir())) == 2


def test_a_mesh_that_cannot_be_found_is_kept_by_name_and_said(away):
    shaped(pg.Model.serial(1), "1", "/not/there.stl").save(away / "m.json")
    again = pg.Model.load(away / "m.json")
    assert file_of(again, "1") == away / "meshes" / "there.stl"
    (said,) = unreadable(again.bodies)
    assert "there is no such file" in said
    assert not (away / "meshes").exists()


def test_uploaded_downloaded_and_opened_again_on_another_machine(home, monkeypatch):
    """Drop, save, reopen: as the page does it, on two machines."""
    state = update(initial(pg.Model.serial(2)), Connected(ME))
    content = base64.b64encode(mesh(home / "part.stl").read_bytes()).decode()
    state = update(state, UploadMesh(ME, ("2",), "part.stl", content))
    state = update(state, answer(state.errands[0]))
    name, download = archive.packed(state.model)
    assert name == "serial_2.zip"
    monkeypatch.setenv("XDG_DATA_HOME", str(home / "another"))
    there = update(initial(pg.Model.serial(1)), Connected(ME))
    sent = base64.b64encode(download).decode()
    there = update(there, OpenArchive(ME, name, sent))
    there = update(there, answer(there.errands[0]))
    assert notice_of(there).title == "Opened serial 2"
    assert file_of(there.model, "2").is_relative_to(folder())
    assert unreadable(there.model.bodies) == ()
    assert archive.packed(there.model)[0] == name
    assert update(there, Undo(ME)).model.name == "serial 1"


def test_a_model_without_meshes_is_downloaded_as_it_is():
    model = pg.Model.serial(2)
    assert archive.packed(model) == ("serial_2.json", model.to_json().encode())


def zipped(*files: tuple[str, bytes]) -> bytes:
    content = io.BytesIO()
    with zipfile.ZipFile(content, "w", zipfile.ZIP_DEFLATED) as made:
        for name, data in files:
            made.writestr(name, data)
    return content.getvalue()


MODEL = pg.Model.serial(1).to_json().encode()


@pytest.mark.parametrize(
    ("content", "said"),
    [
        (b"PK no", "no zip that can be read"),
        (b"", "no zip that can be read"),
        (zipped(("a.txt", b"")), "0 model files"),
        (zipped(("a.json", MODEL), ("b.json", MODEL)), "2 model files"),
        (zipped(("a.json", MODEL), ("meshes/x.stl", bytes(101_000_000))), "101 MB unpacked"),
        (zipped(("a.json", b"{")), "not JSON"),
    ],
)
def test_a_zip_that_is_no_model_is_a_sentence(home, content, said):
    state = update(initial(pg.Model.serial(2)), Connected(ME))
    sent = base64.b64encode(content).decode()
    asked = update(state, OpenArchive(ME, "x.zip", sent))
    after = update(asked, answer(asked.errands[0]))
    assert after.model is state.model
    assert notice_of(after).title == "x.zip was not opened"
    assert said in notice_of(after).text


def test_a_zip_writes_nowhere_but_where_meshes_are_kept(home):
    named = shaped(pg.Model.serial(1), "1", "meshes/fine.stl").to_json().encode()
    hostile = zipped(
        ("a.json", named), ("../../evil.stl", b"x"), ("/etc/evil.stl", b"x"),
        ("meshes/../evil.stl", b"x"), ("meshes/evil.sh", b"x"), ("meshes/fine.stl", b"x"),
    )  # fmt: skip
    archive.unpacked(hostile, home / "keep")
    written = sorted(p.name for p in home.rglob("*") if p.is_file())
    assert written == ["fine.stl"]
    with pytest.raises(Refusal):
        archive.unpacked(hostile[:-40], home / "keep")


def test_a_damaged_zip_is_a_sentence_and_leaves_nothing(home):
    """Any byte changed, any part cut off: what was packed, or a refusal."""
    body = ("meshes/fine.stl", bytes(range(256)) * 4)
    whole, kept = zipped(("a.json", MODEL), body), home / "keep"
    rng = np.random.default_rng(0)
    said = []
    for _ in range(1000):
        damaged = bytearray(whole)
        damaged[rng.integers(len(whole))] ^= int(rng.integers(1, 256))
        try:
            archive.unpacked(bytes(damaged[: rng.integers(len(whole) // 2, 2 * len(whole))]), kept)
        except Refusal as refusal:
            said.append(str(refusal))
        else:
            shutil.rmtree(kept)
        assert not kept.exists()
    assert len(said) > 100
    assert {text.split(" (")[0].split(":")[0] for text in said} <= {
        "it is no zip that can be read", "it holds 0 model files",
    }  # fmt: skip


def _zip(**files: bytes) -> bytes:
    content = io.BytesIO()
    with zipfile.ZipFile(content, "w", zipfile.ZIP_DEFLATED) as made:
        for name, data in files.items():
            made.writestr(name.replace("__", "/").replace("_", "."), data)
    return content.getvalue()


def test_an_opened_archive_leaves_the_meshes_that_its_model_names(tmp_path, monkeypatch):
    part = mesh(tmp_path / "part.stl").read_bytes()
    shape = {"kind": "mesh", "file": "meshes/part.stl"}
    text = json.dumps({"bodies": [{"name": "a", "shape": shape}]}).encode()
    content = _zip(m_json=text, meshes__part_stl=part, meshes__other_stl=b"\0" * 1_000_000)
    for _ in range(2):  # the second finds what the first has left
        model, _ = archive.unpacked(content, tmp_path / "keep")
        left = [file for file in (tmp_path / "keep").rglob("*") if file.is_file()]
        assert left == [file_of(model, "a")]
    refused = _zip(m_json=b'{"bodies": 1}', meshes__part_stl=part)
    with pytest.raises(pg.PgraphError):
        archive.unpacked(refused, tmp_path / "refused")
    assert not any(file.is_file() for file in (tmp_path / "refused").rglob("*"))
    monkeypatch.setattr(archive, "LARGEST_KEPT", 1000)
    archive.unpacked(content, tmp_path / "keep")  # it is there
    with pytest.raises(Refusal, match="would hold more than 0 MB; remove there"):
        archive.unpacked(_zip(m_json=text, meshes__part_stl=part), tmp_path / "keep")
