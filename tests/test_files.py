"""Model files come back as written, and a file is replaced as a whole or not at all."""

import os
import stat
from pathlib import Path

import pytest

import pgraph_core as pg
import pgraph_models
from pgraph_core.mesh_files import load_mesh
from pgraph_core.model import files
from tests.refusals import assert_names, refusal

pytestmark = pytest.mark.quick

MODEL = pg.Model.serial(3)


@pytest.mark.parametrize("name", pgraph_models.names())
def test_a_saved_model_comes_back(name: str, tmp_path: Path):
    model = pg.Model.load(pgraph_models.path(name))
    model.save(tmp_path / "copy.json")
    assert pg.Model.load(tmp_path / "copy.json") == model
    assert (tmp_path / "copy.json").read_bytes() == pgraph_models.path(name).read_bytes()


def test_every_joint_kind_comes_back():
    joints = ("weld", "revolute", "prismatic", "cylindrical", "universal")
    joints += ("spherical", "planar", "free", "compound")
    bodies = [pg.Body(name=joint, joint=joint) for joint in joints]
    bodies += [pg.Body(name=f"dof {n}", dof=n, damping=0.5 if n else 0) for n in range(7)]
    turns = (("rotate", (0, 0, 1)), ("translate", (1, 0, 0)), ("ball", (0, 0, 1)))
    bodies += [pg.Body(name="own", joint="compound", motions=turns, armature=(1, 2, 0))]
    model = pg.Model(bodies=tuple(bodies))
    assert pg.Model.from_json(model.to_json()) == model


def test_a_byte_order_mark_and_names_in_any_script_come_back(tmp_path: Path):
    model = MODEL.edit("1", name="Über-Schenkel 左脚 \U0001f43e")
    model.save(tmp_path / "m.json")
    assert pg.Model.load(tmp_path / "m.json") == model
    (tmp_path / "m.json").write_text(model.to_json(), encoding="utf-8-sig")
    assert pg.Model.load(tmp_path / "m.json") == model


@pytest.mark.parametrize("step", ["fsync", "replace", "chmod"])
@pytest.mark.parametrize("existed", [True, False])
@pytest.mark.parametrize("error", [OSError(28, "No space left on device"), KeyboardInterrupt()])
def test_a_failed_write_leaves_the_old_file(step, existed, error, tmp_path: Path, monkeypatch):
    file = tmp_path / "m.json"
    if existed:
        MODEL.save(file)

    def fail(*_args, **_kwargs):
        raise error

    monkeypatch.setattr(files.os, step, fail)
    with pytest.raises((pg.FileError, KeyboardInterrupt)) as refused:
        MODEL.edit("1", mass=9.0).save(file)
    if isinstance(error, OSError):
        assert_names(str(refused.value), str(file), "No space left on device")
    assert [p.name for p in tmp_path.iterdir()] == (["m.json"] if existed else [])
    if existed:
        assert pg.Model.load(file) == MODEL


def test_permissions_and_links_stay(tmp_path: Path):
    file, link = tmp_path / "m.json", tmp_path / "link.json"
    MODEL.save(file)
    file.chmod(0o600)
    link.symlink_to(file)
    MODEL.edit("1", mass=2.0).save(link)
    assert link.is_symlink()
    assert pg.Model.load(file).body("1").mass == 2.0
    assert stat.S_IMODE(file.stat().st_mode) == 0o600


def test_a_read_only_file_is_not_replaced(tmp_path: Path):
    """Its folder alone would allow it: a new file takes the place of the old one."""
    file = tmp_path / "m.json"
    MODEL.save(file)
    file.chmod(0o444)
    with pytest.raises(pg.FileError) as refused:
        MODEL.edit("1", mass=2.0).save(file)
    assert_names(str(refused.value), "m.json", "read-only", "another place")
    assert pg.Model.load(file) == MODEL
    assert file.stat().st_mode & 0o777 == 0o444
    file.chmod(0o644)
    MODEL.edit("1", mass=2.0).save(file)


def test_a_new_file_obeys_the_umask(tmp_path: Path):
    mask = os.umask(0o027)
    try:
        MODEL.save(tmp_path / "m.json")
    finally:
        os.umask(mask)
    assert stat.S_IMODE((tmp_path / "m.json").stat().st_mode) == 0o640


@pytest.mark.parametrize(
    ("path", "shown", "reason"),
    [
        ("", "'': ", "Is a directory"),
        (".", ".: ", "Is a directory"),
        ("none/m.json", "none/m.json: ", "No such file"),
        ("m\0.json", r"'m\x00.json': ", "NUL"),
        ("m" * 300, "m" * 300 + ": ", "too long"),
    ],
)
def test_a_place_that_cannot_be_written_or_read_is_named(
    path, shown, reason, tmp_path, monkeypatch
):
    monkeypatch.chdir(tmp_path)
    calls = [lambda: MODEL.save(path)]
    if path and len(path) < 300:
        calls.append(lambda: pg.Model.load(path))
    for call in calls:
        error = str(refusal(call, pg.FileError))
        assert error.startswith(shown)
        assert_names(error, reason)
    assert list(tmp_path.iterdir()) == []


def test_a_file_of_version_1_is_read():
    """Version 1 of the schema wrote this text, which never changes."""
    model = pg.Model.from_json(VERSION_1)
    assert [(b.name, b.parent, b.dof) for b in model.bodies] == [
        ("base", "ground", 6),
        ("arm", "base", 1),
    ]
    assert model.body("arm").stiffness == (2.0,)
    assert model.body("arm").inertia == ((0.01, 0, 0), (0, 0.01, 0), (0, 0, 0.01))
    (servo,) = model.scenario("go").forces
    assert isinstance(servo, pg.Servo)
    assert servo.target == pg.Table(t=(0.0, 1.0), value=(0.0, 0.5))


VERSION_1 = """{
  "$schema": "pgraph-model",
  "schema_version": 1,
  "name": "old", "up": "y", "gravity": [0.0, -9.81, 0.0],
  "bodies": [
    {"name": "base", "parent": "ground", "joint": "free", "link": [0.0, 1.0, 0.0], "mass": 2.0,
     "com": [0.0, 0.0, 0.0], "inertia": [[0.1, 0.0, 0.0], [0.0, 0.1, 0.0], [0.0, 0.0, 0.1]],
     "q": [0.0, 0.0, 0.0, 1.0, 0.0, 0.0, 0.0]},
    {"name": "arm", "parent": "base", "joint": "revolute", "axes": [[0.0, 0.0, 1.0]],
     "rotation": [1.0, 0.0, 0.0, 0.0], "q": [0.1], "v": [0.2], "stiffness": [2.0],
     "damping": [0.1], "rest": [0.05], "armature": [0.001], "tip": [0.0, 0.1, 0.0],
     "shape": {"kind": "capsule", "radius": 0.1, "length": 0.2, "scale": 1.0,
               "position": [0.0, 0.0, 0.0], "rotation": [1.0, 0.0, 0.0, 0.0]}}
  ],
  "constraints": [
    {"name": "pin", "kind": "point", "body": "arm", "other": "ground", "active": false}
  ],
  "forces": [],
  "scenarios": [
    {"name": "go", "description": "", "q": {"arm": [0.3]}, "v": {}, "t_end": 1.0, "step": 0.001,
     "method": "auto", "constraints": ["pin"], "forces": [
       {"name": "s", "kind": "servo", "body": "arm", "coordinate": 0, "torque": 0.0, "kp": 1.0,
        "kd": 0.1, "target": {"t": [0.0, 1.0], "value": [0.0, 0.5]}, "torque_limit": 5.0}]}
  ]
}
"""


@pytest.mark.parametrize("name", ["m.json", "m.csv", "m.zip", "m.urdf", "m.xml", "m.npz"])
def test_a_file_too_large_is_refused_before_it_is_read(name: str, tmp_path: Path):
    (tmp_path / name).write_bytes(b"PK" if name == "m.npz" else b"")
    os.truncate(tmp_path / name, 50 << 30)  # without content: no machine could hold it
    models = ("m.json", "m.urdf", "m.xml")  # others are refused by their names
    read, word = pg.Result.load if name == "m.npz" else pg.load, "64 MB" if name in models else name
    with pytest.raises(pg.FileError, match=word):
        read(tmp_path / name)


@pytest.mark.parametrize("suffix", [".json", ".urdf", ".xml", ".csv", ".stl"])
def test_a_pipe_or_a_device_is_neither_read_nor_written(suffix: str, tmp_path: Path):
    """A pipe that nobody writes to waits for ever, and a device never ends."""
    pipe, device = tmp_path / f"pipe{suffix}", tmp_path / f"zero{suffix}"
    os.mkfifo(pipe)
    device.symlink_to("/dev/zero")
    for path in (pipe, device):
        for read in (load_mesh,) if suffix == ".stl" else (pg.load, pg.Result.load):
            with pytest.raises(pg.FileError, match="regular file"):
                read(path)
    with pytest.raises(pg.FileError, match="regular file"):
        files.write_atomic(pipe, "x")
    assert stat.S_ISFIFO(pipe.stat().st_mode)


def test_links_in_a_circle_are_refused(tmp_path: Path):
    (tmp_path / "a.json").symlink_to("b.json")
    (tmp_path / "b.json").symlink_to("a.json")
    for call in (pg.load, MODEL.save):
        with pytest.raises(pg.FileError, match=r"a\.json"):
            call(tmp_path / "a.json")


def test_a_scenario_states_a_step_or_leaves_it_out():
    """Files before version 4 without a step mean 1 ms. A given step stays."""
    for step, version in ((None, 4), (2e-3, 1)):
        model = MODEL.replace(scenarios=(pg.Scenario(name="s", step=step),))
        text = model.to_json()
        assert f'"schema_version": {version}' in text
        assert pg.Model.from_json(text) == model
        older = pg.Model.from_json(text.replace(f'_version": {version}', '_version": 3'))
        assert older.scenario("s").step == (step or 1e-3)
