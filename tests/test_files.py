"""Model files: what is written comes back; what is there is replaced whole or not at all."""

from __future__ import annotations

import os
import stat
from pathlib import Path

import pytest

import pgraph_core as pg
import pgraph_models
from pgraph_core.mesh_files import load_mesh
from pgraph_core.model import files

pytestmark = pytest.mark.fast

MODEL = pg.Model.serial(3)


@pytest.mark.parametrize("name", pgraph_models.names())
def test_what_is_saved_comes_back(name: str, tmp_path: Path):
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


def test_a_file_may_start_with_a_byte_order_mark(tmp_path: Path):
    (tmp_path / "m.json").write_text(MODEL.to_json(), encoding="utf-8-sig")
    assert pg.Model.load(tmp_path / "m.json") == MODEL


def test_names_in_any_script_come_back(tmp_path: Path):
    model = MODEL.edit("1", name="Über-Schenkel 左脚 \U0001f43e")
    model.save(tmp_path / "m.json")
    assert pg.Model.load(tmp_path / "m.json") == model


@pytest.mark.parametrize("step", ["fsync", "replace", "chmod"])
@pytest.mark.parametrize("existed", [True, False])
def test_a_failed_write_leaves_the_old_file(step: str, existed: bool, tmp_path: Path, monkeypatch):
    file = tmp_path / "m.json"
    if existed:
        MODEL.save(file)

    def full(*_args, **_kwargs):
        raise OSError(28, "No space left on device")

    monkeypatch.setattr(files.os, step, full)
    with pytest.raises(pg.FileError) as refused:
        MODEL.edit("1", mass=9.0).save(file)
    said = f"{file}: cannot be written: No space left on device; choose another place"
    assert str(refused.value) == said
    assert [p.name for p in tmp_path.iterdir()] == (["m.json"] if existed else [])
    if existed:
        assert pg.Model.load(file) == MODEL


def test_an_interrupted_write_leaves_the_old_file_and_nothing_else(tmp_path: Path, monkeypatch):
    file = tmp_path / "m.json"
    MODEL.save(file)

    def interrupted(*_args):
        raise KeyboardInterrupt

    monkeypatch.setattr(files.os, "fsync", interrupted)
    with pytest.raises(KeyboardInterrupt):
        MODEL.edit("1", mass=9.0).save(file)
    assert [p.name for p in tmp_path.iterdir()] == ["m.json"]
    assert pg.Model.load(file) == MODEL


def test_a_refused_model_never_reaches_the_file(tmp_path: Path):
    file = tmp_path / "m.json"
    MODEL.save(file)
    before = file.read_bytes()
    with pytest.raises(pg.ModelError):
        MODEL.edit("1", mass=-1).save(file)
    assert file.read_bytes() == before


def test_permissions_and_links_stay(tmp_path: Path):
    file, link = tmp_path / "m.json", tmp_path / "link.json"
    MODEL.save(file)
    file.chmod(0o600)
    link.symlink_to(file)
    MODEL.edit("1", mass=2.0).save(link)
    assert link.is_symlink()
    assert pg.Model.load(file).body("1").mass == 2.0
    assert stat.S_IMODE(file.stat().st_mode) == 0o600


def test_a_new_file_obeys_the_umask(tmp_path: Path):
    mask = os.umask(0o027)
    try:
        MODEL.save(tmp_path / "m.json")
    finally:
        os.umask(mask)
    assert stat.S_IMODE((tmp_path / "m.json").stat().st_mode) == 0o640


@pytest.mark.parametrize(
    ("path", "reason"),
    [
        ("", "'': cannot be written: Is a directory"),
        (".", ".: cannot be written: Is a directory"),
        ("none/m.json", "none/m.json: cannot be written: No such file or directory"),
        ("m\0.json", r"'m\x00.json': cannot be written: its path holds a NUL character"),
        ("m" * 300, "m" * 300 + ": cannot be written: File name too long"),
    ],
)
def test_places_that_cannot_be_written(path: str, reason: str, tmp_path: Path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    with pytest.raises(pg.FileError) as refused:
        MODEL.save(path)
    assert str(refused.value) == f"{reason}; choose another place"
    assert list(tmp_path.iterdir()) == []


@pytest.mark.parametrize(
    ("path", "reason"),
    [
        ("none.json", "none.json: cannot be read: No such file or directory"),
        (".", ".: cannot be read: Is a directory"),
        ("m\0.json", r"'m\x00.json': cannot be read: its path holds a NUL character"),
    ],
)
def test_places_that_cannot_be_read(path: str, reason: str, tmp_path: Path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    with pytest.raises(pg.FileError) as refused:
        pg.Model.load(path)
    assert str(refused.value) == f"{reason}; give the path of a model file"


def test_a_file_of_version_1_is_read_for_ever():
    """Written by version 1 of the schema; this text never changes."""
    model = pg.Model.from_json(VERSION_1)
    assert [(b.name, b.parent, b.dof) for b in model.bodies] == [
        ("base", "ground", 6),
        ("arm", "base", 1),
    ]
    assert model.body("arm").stiffness == (2.0,)
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


@pytest.mark.parametrize("name", ["m.json", "m.csv", "m.zip", "m.urdf", "m.xml"])
def test_a_file_too_large_is_refused_before_it_is_read(name: str, tmp_path: Path):
    (tmp_path / name).touch()
    os.truncate(tmp_path / name, 50 << 30)  # without content: no machine could hold it
    with pytest.raises(pg.FileError, match="it has 53687 MB; 64 MB at most"):
        pg.Model.load(tmp_path / name)


def test_so_is_a_run(tmp_path: Path):
    (tmp_path / "run.npz").touch()
    os.truncate(tmp_path / "run.npz", 50 << 30)
    with pytest.raises(pg.FileError, match=r"is no run: not an \.npz file"):
        pg.Result.load(tmp_path / "run.npz")
    (tmp_path / "run.npz").write_bytes(b"PK")
    os.truncate(tmp_path / "run.npz", 50 << 30)
    with pytest.raises(pg.FileError, match="damaged"):
        pg.Result.load(tmp_path / "run.npz")


@pytest.mark.parametrize("suffix", [".json", ".urdf", ".xml"])
def test_a_pipe_or_a_device_is_no_file(suffix: str, tmp_path: Path):
    """A pipe that nobody writes to waits for ever; a device never ends."""
    pipe, device = tmp_path / f"pipe{suffix}", tmp_path / f"zero{suffix}"
    os.mkfifo(pipe)
    device.symlink_to("/dev/zero")
    for path in (pipe, device):
        with pytest.raises(pg.FileError, match="cannot be read: it is no ordinary file"):
            pg.Model.load(path)
        with pytest.raises(pg.FileError, match="it is no ordinary file"):
            pg.Result.load(path)
    mesh = tmp_path / "pipe.stl"
    os.mkfifo(mesh)
    with pytest.raises(pg.FileError, match="it is no ordinary file"):
        load_mesh(mesh)


@pytest.mark.parametrize("name", ["m.json", "m.csv"])
def test_a_pipe_is_not_written_to_either(name: str, tmp_path: Path):
    os.mkfifo(tmp_path / name)
    with pytest.raises(pg.FileError, match="cannot be written: it is no ordinary file"):
        files.write_atomic(tmp_path / name, "x")
    assert stat.S_ISFIFO((tmp_path / name).stat().st_mode)


def test_links_in_a_circle_are_a_sentence(tmp_path: Path):
    (tmp_path / "a.json").symlink_to("b.json")
    (tmp_path / "b.json").symlink_to("a.json")
    with pytest.raises(pg.FileError, match="cannot be read: Too many levels of symbolic links"):
        pg.Model.load(tmp_path / "a.json")
    with pytest.raises(pg.FileError, match="cannot be written: its links lead in a circle"):
        MODEL.save(tmp_path / "a.json")
