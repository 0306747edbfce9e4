"""Files of other formats on the page: opened, downloaded, and their report."""

import base64

import pytest
import trimesh

import pgraph_core as pg
from pgraph_app.core.cells import Refusal
from pgraph_app.model import archive

from .store import ME, after, answered, begun, do, zipped

pytestmark = pytest.mark.quick

HINGE = """<joint name="elbow" type="revolute"><parent link="base"/><child link="lower"/>
  <axis xyz="0 1 0"/><limit lower="-1" upper="1" effort="2" velocity="3"/></joint>"""
INERTIAL = '<inertial><mass value="2"/><inertia ixx="1" iyy="1" izz="1"/></inertial>'


def robot(*links, joints=""):
    """Return a URDF file with these links, {name: what it holds} or a name."""
    inside = (f'<link name="{name}">{rest}</link>' for name, rest in links)
    return f'<robot name="bot">{"".join(inside)}{joints}</robot>'


@pytest.fixture
def state():
    return begun(pg.Model.serial(1))


def test_a_urdf_file_opens_with_its_report(state):
    arm = robot(("base", INERTIAL), ("lower", ""), joints=HINGE)
    opened = answered(state, do.OpenText(ME, "arm.urdf", arm))
    assert [b.name for b in opened.model.bodies] == ["base", "lower"]
    report = opened.clients[ME].conversion
    assert report.loaded
    assert any(entry.part == "lower" for entry in report.of("warning"))  # it has no mass
    assert len(after(opened, do.OpenText(ME, "a.urdf", "<robot/>")).errands) == 1


def test_an_archive_is_the_root_of_its_files(state, tmp_path, monkeypatch):
    monkeypatch.setenv("XDG_DATA_HOME", str(tmp_path))
    part = trimesh.creation.box((1, 1, 1)).export(file_type="stl")
    (tmp_path / "secret.stl").write_bytes(part)
    meshes = "".join(
        f'<visual><geometry><mesh filename="{file}"/></geometry></visual>'
        for file in ("package://bot/meshes/part.stl", "../../../../secret.stl")
    )
    text = robot(("base", INERTIAL + meshes)).encode()
    files = [
        ("bot/urdf/arm.urdf", text), ("bot/meshes/part.stl", part), ("bot/package.xml", b"<a/>"),
    ]  # fmt: skip
    sent = base64.b64encode(zipped(*files)).decode()
    opened = answered(state, do.OpenArchive(ME, "bot.zip", sent))
    inside, outside = opened.model.bodies[0].shapes
    assert (tmp_path / "secret.stl").read_bytes() == part
    assert inside.file.endswith("bot/meshes/part.stl")
    assert outside.file.endswith("bot/urdf/secret.stl")  # which is not there: a stand-in is drawn
    assert len([*opened.clients[ME].conversion.of("left out")]) == 1
    assert opened.clients[ME].conversion.file == "arm.urdf"
    with pytest.raises(Refusal, match="2"):
        archive.unpacked(zipped(*files, ("bot/urdf/leg.urdf", text)), tmp_path / "keep")


@pytest.mark.parametrize("suffix", [".urdf", ".xml"])
def test_the_model_is_downloaded_in_other_formats(state, suffix):
    asked = after(state, do.Download(ME, suffix))
    assert asked.clients[ME].asked.suffix == suffix
    name, content, report = archive.converted(asked.model, suffix)
    assert name == f"serial_1{suffix}"
    assert content.startswith(b"<")
    assert report.file == name
