"""Archives as people pack the files of a robot: which file is the model."""

import base64
import io
import zipfile

import pytest

import pgraph_core as pg
from pgraph_app.core.cells import Refusal
from pgraph_app.model.archive import unpacked

from ..test_osim import LEG, VTP, document
from .store import ME, answered, begun, do, notice

BODY = '<body name="a"><joint axis="0 1 0"/><geom size=".1" mass="1"/></body>'
ROBOT = f'<mujoco model="robot"><worldbody>{BODY}</worldbody></mujoco>'
SCENES = {
    "beside": {"scene.xml": "robot.xml", "robot.xml": None},
    "in a folder": {"scene.xml": "parts/robot.xml", "parts/robot.xml": None},
    "below a folder": {"x/scene.xml": "robot.xml", "x/robot.xml": None},
    "in a row": {"a.xml": "b.xml", "b.xml": "c.xml", "c.xml": None},
}


def zipped(files):
    content = io.BytesIO()
    with zipfile.ZipFile(content, "w") as archive:
        for name, text in files.items():
            archive.writestr(name, text)
    return content.getvalue()


@pytest.mark.parametrize("layout", SCENES)
def test_a_file_that_another_includes_is_part_of_it(tmp_path, layout):
    pytest.importorskip("mujoco")
    files = {
        name: f'<mujoco model="{name}"><include file="{other}"/></mujoco>' if other else ROBOT
        for name, other in SCENES[layout].items()
    }
    model, _ = unpacked(zipped(files), tmp_path)
    assert [body.name for body in model.bodies] == ["a"]


def test_of_several_models_the_names_are_said(tmp_path):
    with pytest.raises(Refusal) as refused:
        unpacked(zipped({"one.xml": ROBOT, "two.xml": ROBOT}), tmp_path)
    assert "one.xml" in str(refused.value)
    assert "two.xml" in str(refused.value)


OWN = pg.Model.serial(1).replace(name="own").to_json()
URDF = '<robot name="urdf"><link name="base"/></robot>'
SEVERAL = {
    "two of Pgraph": {"a.json": OWN, "b.json": OWN},
    "a scene with a part, and another": {
        "scene.xml": '<mujoco><include file="robot.xml"/></mujoco>',
        "robot.xml": ROBOT,
        "other.xml": ROBOT,
    },
    "two formats": {"bot.urdf": URDF, "bot.xml": ROBOT},
    "in folders": {"x/a/bot.urdf": URDF, "x/b/bot.urdf": URDF},
    "at two levels": {"bot.xml": ROBOT, "old/bot.xml": ROBOT},
}


@pytest.mark.parametrize("which", SEVERAL)
def test_of_several_models_the_page_offers_a_choice(tmp_path, monkeypatch, which):
    pytest.importorskip("mujoco")
    monkeypatch.setenv("XDG_DATA_HOME", str(tmp_path))
    files = SEVERAL[which]
    state = begun(pg.Model.serial(3))
    sent = base64.b64encode(zipped(files)).decode()
    asked = answered(state, do.OpenArchive(ME, "bot.zip", sent))
    offered = asked.clients[ME].members
    assert asked.model is state.model
    assert set(offered.names) == set(files) - {"robot.xml"}
    for name in offered.names:
        chosen = answered(asked, do.OpenArchive(ME, offered.file, sent, name))
        assert len(chosen.model.bodies) == 1
    wrong = answered(asked, do.OpenArchive(ME, offered.file, sent, "none.xml"))
    assert wrong.clients[ME].members.names == offered.names


@pytest.mark.parametrize("junk", ["package.xml", "launch/bot.xml", "config.xml"])
def test_an_xml_file_that_is_no_model_is_not_offered(tmp_path, junk):
    pytest.importorskip("mujoco")
    files = {"bot/bot.xml": ROBOT, junk: "<launch><node name='a'/></launch>"}
    assert len(unpacked(zipped(files), tmp_path)[0].bodies) == 1


def test_a_model_of_opensim_is_opened_alone_and_with_its_pictures(tmp_path, monkeypatch):
    monkeypatch.setenv("XDG_DATA_HOME", str(tmp_path / "data"))
    bone = "<attached_geometry><Mesh><mesh_file>bone.vtp</mesh_file></Mesh></attached_geometry>"
    text = document(LEG.replace("</Body>", f"{bone}</Body>"))
    state = begun(pg.Model.serial(1))
    alone = answered(state, do.OpenText(ME, "leg.osim", text))
    assert alone.model.names == ("leg",)
    files = {"x/leg.osim": text, "x/Geometry/bone.vtp": VTP}
    sent = base64.b64encode(zipped(files)).decode()
    told = answered(state, do.OpenArchive(ME, "x.zip", sent))
    assert [len(x.model.body("leg").shapes) for x in (alone, told)] == [0, 1]


@pytest.mark.parametrize(
    "name",
    [
        "w.sdf",
        "w.world",
        "s.usda",
        "p.step",
        "m.mjb",
        "bot.urdf.xacro",
        "a.proto",
        "a.bvh",
    ],
)
def test_a_format_that_is_not_read_is_named_on_the_page_too(tmp_path, name):
    state = begun(pg.Model.serial(1))
    alone = answered(state, do.OpenText(ME, name, "anything"))
    sent = base64.b64encode(zipped({f"x/{name}": "anything"})).decode()
    for told in (alone, answered(state, do.OpenArchive(ME, "x.zip", sent))):
        assert told.model is state.model
        assert name in notice(told)
        assert "JSON" not in notice(told)


def test_a_program_in_an_archive_is_refused_and_not_run(tmp_path):
    """A xacro file that would write a file when it is read, which its name does."""
    left = tmp_path / "left"
    name = f"${{open('{left}', 'w').write('x')}}"
    text = f'<robot name="r" xmlns:xacro="http://ros.org/wiki/xacro"><link name="{name}"/></robot>'
    with pytest.raises(Refusal, match="macros can execute code"):
        unpacked(zipped({"x/bot.urdf.xacro": text}), tmp_path / "keep")
    assert not left.exists()


def test_an_archive_within_an_archive_is_told_to_be_unpacked(tmp_path):
    robot = zipped({"robot.urdf": '<robot name="r"><link name="a"/></robot>'})
    with pytest.raises(Refusal, match="within") as refused:
        unpacked(zipped({"in/robot.zip": robot}), tmp_path / "keep")
    assert "in/robot.zip" in str(refused.value)
    assert unpacked(robot, tmp_path / "keep")[0].bodies  # as the sentence says
