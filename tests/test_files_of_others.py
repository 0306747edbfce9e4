"""Model files from somebody else: none reads what it must not, and none stops the reader."""

from __future__ import annotations

import json
from pathlib import Path

import numpy as np
import pytest
import trimesh

import pgraph_core as pg
from pgraph_app.core.state import initial
from pgraph_app.features import update
from pgraph_app.model import archive
from pgraph_app.model.update import OpenText
from pgraph_app.model.worker import answer
from pgraph_app.session.update import Connected
from pgraph_core.mesh_files import load_mesh
from pgraph_core.model import files

pytestmark = pytest.mark.quick

SECRET = b"-----BEGIN OPENSSH PRIVATE KEY-----\nsecret\n"
ME = 1


def text_of(file: str) -> str:
    shape = {"kind": "mesh", "file": file}
    return json.dumps({"bodies": [{"name": "a"}, {"name": "cup", "shape": shape}]})


@pytest.fixture
def folders(tmp_path, monkeypatch) -> tuple[Path, Path]:
    """(the folder of a model, a folder of the user's own next to it with a key and a mesh)"""
    monkeypatch.setenv("XDG_DATA_HOME", str(tmp_path / "home"))
    mine, others = tmp_path / "private", tmp_path / "from a colleague"
    mine.mkdir()
    others.mkdir()
    (mine / "id_rsa").write_bytes(SECRET)
    (mine / "key.stl").write_bytes(SECRET)
    trimesh.creation.box((1, 1, 1)).export(mine / "box.stl")
    return others, mine


def mesh_of(model: pg.Model) -> str:
    return model.body("cup").shape.file


def test_a_saved_run_carries_its_meshes(folders):
    folder, mine = folders
    cup = {"name": "cup", "shape": {"kind": "mesh", "file": str(mine / "box.stl")}}
    run = pg.simulate(pg.Mechanism(pg.Model(bodies=[cup])), t_end=0.01)
    run.save(folder / "run.npz")
    again = pg.Result.load(folder / "run.npz")
    np.testing.assert_array_equal(again.q, run.q)
    assert mesh_of(again.mechanism.model) == str(folder / "meshes" / "box.stl")
    assert (folder / "meshes" / "box.stl").is_file()


def test_a_folder_that_the_user_allows_may_hold_meshes(folders, monkeypatch):
    folder, mine = folders
    (folder / "model.json").write_text(text_of("../private/box.stl"))
    model = pg.Model.load(folder / "model.json", roots=[mine])
    assert load_mesh(mesh_of(model)).is_watertight
    outside = text_of(str(mine / "box.stl"))
    assert mesh_of(pg.Model.from_json(outside, roots=[mine])) == str(mine / "box.stl")
    with pytest.raises(pg.ModelError, match="roots="):
        pg.Model.load(folder / "model.json")
    monkeypatch.setenv("PGRAPH_MESHES", str(mine))
    assert pg.Model.load(folder / "model.json") == model
    monkeypatch.chdir(folder)
    trimesh.creation.box((1, 1, 1)).export(folder / "box.stl")
    model = pg.Model.from_json(text_of("box.stl"))
    assert pg.Model.from_json(model.to_json()) == model


@pytest.mark.parametrize("name", ["id_rsa", "key.stl"])
def test_a_file_without_a_mesh_is_neither_opened_nor_saved(folders, name, tmp_path):
    _, mine = folders
    with pytest.raises(pg.FileError):
        load_mesh(mine / name)
    model = pg.Model(bodies=[{"name": "cup", "shape": {"kind": "mesh", "file": str(mine / name)}}])
    (tmp_path / "out").mkdir()
    with pytest.raises(pg.FileError) as refused:
        model.save(tmp_path / "out" / "m.json")
    assert "body 'cup', shape" in str(refused.value)
    assert str(mine / name) in str(refused.value)
    assert not list((tmp_path / "out").rglob("*"))
    with pytest.raises(pg.FileError):
        archive.packed(model)


@pytest.mark.parametrize("suffix", ["stl", "obj", "ply", "off", "glb"])
def test_a_saved_copy_holds_the_geometry_and_nothing_else(tmp_path, suffix):
    """Equal to the digits of its format, without other content of the file."""
    solid = trimesh.creation.icosphere(subdivisions=1, radius=0.7)
    solid.apply_scale([1, 1 / 3, 1])
    solid.metadata["note"] = "secret"
    file = tmp_path / f"part.{suffix}"
    solid.export(file)
    with file.open("ab") as more:
        more.write(b"\n# secret\n" if suffix == "obj" else b"")
    model = pg.Model(bodies=[{"name": "cup", "shape": {"kind": "mesh", "file": str(file)}}])
    (tmp_path / "out").mkdir()
    model.save(tmp_path / "out" / "m.json")
    saved = mesh_of(pg.Model.load(tmp_path / "out" / "m.json"))
    again, first = load_mesh(saved), load_mesh(file)
    np.testing.assert_array_equal(again.vertices[again.faces], first.vertices[first.faces])
    assert b"secret" not in Path(saved).read_bytes()


@pytest.mark.parametrize(
    ("text", "fact"),
    [
        ("[" * 200_000, "100"),
        ('{"a":' * 200_000, "100"),
        ('{"]":' * 101 + "0" + "}" * 101, "100"),
        ('["]", ' * 101 + '"["' + ', "["]' * 101, "100"),
        ("[" + "0," * 5_000_001 + "0]", "5000000"),
        (" " * 64_000_001, "64 MB"),
        ('{"k1":0,"k9":0,"k9":1}', "'k9'"),
    ],
)
def test_text_beyond_the_limits_is_refused_before_it_is_read(text, fact):
    with pytest.raises(pg.FileError, match=rf"big\.json: .*{fact}"):
        files.parse(text, "big.json")


STEP = {"low": [0, 0], "high": [1, 1], "height": 0.1}
FIELD = {"kind": "heightfield", "size": [1, 1, 1], "heights": [[0.0] * 400] * 300}


@pytest.mark.parametrize(
    ("model", "facts"),
    [
        ({"bodies": [{"name": str(i)} for i in range(100_000)]}, ("100000 bodies", "1000")),
        ({"ground": {"steps": [STEP] * 2001}}, ("2001 steps", "2000")),
        ({"bodies": [{"name": "a", "shape": FIELD}]}, ("120000 heights", "100000")),
        ({"bodies": [{"name": "a", "shapes": [FIELD]}]}, ("120000 heights", "100000")),
        ({"sites": [{"name": f"s{k}"} for k in range(2001)]}, ("2001 sites", "2000")),
    ],
)
def test_the_page_takes_no_more_than_it_can_draw(model, facts):
    state = opened_in_a_page({"bodies": [{"name": "a"}]} | model)
    assert state.model.name == "serial 1"
    assert all(fact in str(state.clients[ME].notice) for fact in facts)


def opened_in_a_page(data: dict):
    state = update(initial(pg.Model.serial(1)), Connected(ME))
    state = update(state, OpenText(ME, "a.json", json.dumps(data)))
    return update(state, answer(state.errands[0])) if state.errands else state


@pytest.mark.parametrize("key", ["shape", "shapes"])
def test_the_page_opens_what_is_within_its_limits(key):
    field = FIELD | {"heights": [[0.0] * 310] * 310}
    body = {"name": "a", key: field if key == "shape" else [field]}
    assert opened_in_a_page({"name": "hill", "bodies": [body]}).model.name == "hill"
