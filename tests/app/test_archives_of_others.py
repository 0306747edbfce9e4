"""Archives as people pack the files of a robot: which file is the model."""

import io
import zipfile

import pytest

from pgraph_app.core.cells import Refusal
from pgraph_app.model.archive import unpacked

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
