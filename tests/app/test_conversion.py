"""Files of other formats on the page: opened, downloaded, and their report."""

from __future__ import annotations

import base64
import io
import zipfile

import pytest
import trimesh

import pgraph_core as pg
from pgraph_app.core.cells import Refusal
from pgraph_app.core.state import initial
from pgraph_app.features import update
from pgraph_app.model import archive
from pgraph_app.model.update import Download, OpenArchive, OpenText
from pgraph_app.model.worker import answer
from pgraph_app.session.update import Connected
from tests.test_urdf import INERTIAL, TWO, link, robot

ME = 1


def after(*events):
    """The state after these events, errands done."""
    state = update(initial(pg.Model.serial(1)), Connected(ME))
    for event in events:
        state = update(state, event)
        for errand in state.errands:
            state = update(state, answer(errand))
    return state


def test_a_urdf_file_opens_with_its_report():
    state = after(OpenText(ME, "arm.urdf", robot(*TWO)))
    assert [b.name for b in state.model.bodies] == ["base", "upper", "lower"]
    report = state.clients[ME].conversion
    assert report.loaded
    assert any(entry.part == "lower" for entry in report.of("warning"))
    assert len(update(state, OpenText(ME, "a.urdf", "<robot/>")).errands) == 1


def test_a_file_that_cannot_be_read_is_a_sentence_and_leaves_the_model():
    state = after(OpenText(ME, "arm.urdf", robot(link("a"), link("b"))))
    assert len(state.model.bodies) == 1
    notice = state.clients[ME].notice
    assert notice is not None
    assert notice.bad
    assert "2 root links" in notice.text
    assert state.clients[ME].conversion is None


def archived(**files: bytes) -> str:
    content = io.BytesIO()
    with zipfile.ZipFile(content, "w") as file:
        for name, data in files.items():
            file.writestr(name.replace("__", "/"), data)
    return base64.b64encode(content.getvalue()).decode()


def test_an_archive_is_the_root_of_its_files(tmp_path, monkeypatch):
    monkeypatch.setenv("XDG_DATA_HOME", str(tmp_path))
    part = trimesh.creation.box((1, 1, 1)).export(file_type="stl")
    mesh = '<visual><geometry><mesh filename="package://bot/meshes/part.stl"/></geometry></visual>'
    away = mesh.replace("package://bot/meshes/part.stl", "../../../../secret.stl")
    text = robot(link("base", INERTIAL + mesh + away)).encode()
    (tmp_path / "secret.stl").write_bytes(part)
    files = {
        "bot__urdf__arm.urdf": text,
        "bot__meshes__part.stl": part,
        "bot__package.xml": b"<a/>",
    }
    state = after(OpenArchive(ME, "bot.zip", archived(**files)))
    shapes = state.model.bodies[0].shapes
    assert [shape.kind for shape in shapes] == ["mesh"]
    assert len([*state.clients[ME].conversion.of("left out")]) == 1
    assert state.clients[ME].conversion.file == "arm.urdf"
    twice = base64.b64decode(archived(**files, bot__urdf__leg_urdf=text))
    twice = twice.replace(b"leg_urdf", b"leg.urdf")
    with pytest.raises(Refusal, match="2 model files"):
        archive.unpacked(twice, tmp_path / "keep")


@pytest.mark.parametrize("suffix", [".urdf", ".xml"])
def test_the_model_is_downloaded_in_other_formats(suffix):
    state = after(Download(ME, suffix))
    assert state.clients[ME].download == suffix
    name, content, report = archive.converted(state.model, suffix)
    assert name == f"serial_1{suffix}"
    assert content.startswith(b"<")
    assert report.file == name
