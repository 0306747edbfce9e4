"""Model files from somebody else: none reads what it must not, and none stops the reader."""

from __future__ import annotations

import json
import os
import time
from pathlib import Path

import numpy as np
import pytest
import trimesh

import pgraph_core as pg
from pgraph_app.core.events import Misread, from_page
from pgraph_app.core.state import initial
from pgraph_app.features import update
from pgraph_app.model import archive
from pgraph_app.model.update import OpenText, too_many
from pgraph_app.model.worker import answer
from pgraph_app.session.update import Connected
from pgraph_core.markup import parse_markup
from pgraph_core.mesh_files import load_mesh
from pgraph_core.model import files

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


def escapes(folder: Path, mine: Path) -> list[str]:
    os.symlink(mine / "box.stl", folder / "link.stl")
    os.symlink(mine, folder / "linked")
    absolute = [str(mine / name) for name in ("id_rsa", "key.stl", "box.stl", "none.stl")]
    return [
        *absolute, "../private/box.stl", "x/../../private/box.stl", "link.stl", "linked/box.stl",
        "/proc/self/environ", "bad\0name.stl",
    ]  # fmt: skip


def test_a_model_file_names_no_mesh_outside_of_its_folder(folders):
    folder, mine = folders
    for file in escapes(folder, mine):
        (folder / "model.json").write_text(text_of(file))
        with pytest.raises(pg.ModelError) as refused:
            pg.Model.load(folder / "model.json")
        (problem,) = refused.value.problems
        assert (problem.where, problem.field) == ("body 'cup'", "shape")
        assert repr(file) in problem.text
        assert str(folder) in problem.text
        assert "roots=" in problem.text


def test_text_without_a_folder_names_no_mesh_outside_of_the_current_one(folders, monkeypatch):
    folder, mine = folders
    monkeypatch.chdir(folder)
    for file in escapes(folder, mine):
        with pytest.raises(pg.ModelError) as refused:
            pg.Model.from_json(text_of(file))
        (problem,) = refused.value.problems
        assert (problem.where, problem.field) == ("body 'cup'", "shape")
        assert repr(file) in problem.text
        assert "roots=" in problem.text
    trimesh.creation.box((1, 1, 1)).export(folder / "box.stl")
    model = pg.Model.from_json(text_of("box.stl"))
    assert pg.Model.from_json(model.to_json()) == model
    outside = text_of(str(mine / "box.stl"))
    assert mesh_of(pg.Model.from_json(outside, roots=[mine])) == str(mine / "box.stl")


def mesh_of(model: pg.Model) -> str | None:
    shape = model.body("cup").shape
    return shape.file if shape is not None else None


def test_a_file_of_a_run_names_no_mesh_outside_of_its_folder(folders):
    folder, mine = folders
    run = pg.simulate(pg.Mechanism(pg.Model.serial(1)), t_end=0.01)
    run.save(folder / "run.npz")
    with np.load(folder / "run.npz") as data:
        arrays = dict(data)
    header = json.loads(str(arrays["header"]))
    for file in escapes(folder, mine):
        header["model"]["bodies"][0]["shape"] = {"kind": "mesh", "file": file}
        arrays["header"] = np.array(json.dumps(header))
        np.savez(folder / "other.npz", **arrays)
        with pytest.raises(pg.ModelError) as refused:
            pg.Result.load(folder / "other.npz")
        (problem,) = refused.value.problems
        assert (problem.where, problem.field) == ("body '1'", "shape")
        assert repr(file) in problem.text


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
    shape = model.body("cup").shape
    assert shape is not None
    assert load_mesh(shape.file or "").is_watertight
    monkeypatch.setenv("PGRAPH_MESHES", str(mine))
    assert pg.Model.load(folder / "model.json") == model


@pytest.mark.parametrize("name", ["id_rsa", "key.stl"])
def test_what_is_no_mesh_is_neither_opened_nor_saved(folders, name, tmp_path):
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
    """To the digits of its format, without what else the file holds."""
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
    saved = pg.Model.load(tmp_path / "out" / "m.json").body("cup").shape
    assert saved is not None
    again, first = load_mesh(saved.file or ""), load_mesh(file)
    np.testing.assert_array_equal(again.vertices[again.faces], first.vertices[first.faces])
    assert b"secret" not in Path(saved.file or "").read_bytes()


def test_damaged_meshes_are_sentences(tmp_path):
    """Any byte changed in any format: a mesh, or a FileError."""
    rng, refused = np.random.default_rng(1), 0
    for suffix in ("stl", "obj", "ply", "off", "glb"):
        file = tmp_path / f"part.{suffix}"
        trimesh.creation.box((1, 1, 1)).export(file)
        whole = file.read_bytes()
        for _ in range(60):
            damaged = bytearray(whole)
            for at in rng.integers(len(whole), size=3):
                damaged[at] = int(rng.integers(256))
            file.write_bytes(bytes(damaged[: rng.integers(len(whole) // 2, 2 * len(whole))]))
            try:
                mesh = load_mesh(file)
            except pg.FileError:
                refused += 1
            else:
                assert np.isfinite(mesh.vertices).all()
    assert refused > 30


# -- text that would take for ever -----------------------------------------------------------------


def cost(text: str) -> float:
    """Processor time of refusing a text [s], the least of three."""
    times = []
    for _ in range(3):
        start = time.process_time()
        with pytest.raises(pg.FileError):
            files.parse(text, "text")
        times.append(time.process_time() - start)
    return min(times)


def twins(n: int) -> str:
    return "{" + ",".join(f'"k{i}":0' for i in range(n)) + f',"k{n - 1}":1}}'


@pytest.mark.timed
def test_twin_keys_are_found_in_linear_time():
    with pytest.raises(pg.FileError, match="field 'k9' is given twice in one object"):
        files.parse(twins(10), "text")
    assert cost(twins(200_000)) < 100 * cost(twins(10_000))  # 20 if linear, 400 if quadratic


@pytest.mark.parametrize(
    ("text", "facts"),
    [
        ("[" * 200_000, ("nest too deeply", "100")),
        ('{"a":' * 200_000, ("nest too deeply", "100")),
        ('{"]":' * 101 + "0" + "}" * 101, ("nest too deeply", "100")),
        ('["]", ' * 101 + '"["' + ', "["]' * 101, ("nest too deeply", "100")),
        ("[" + "0," * 5_000_001 + "0]", ("5000001 values", "5000000")),
        (" " * 64_000_001, ("64 MB",)),
    ],
)
def test_text_beyond_the_limits_is_refused_before_it_is_read(text, facts):
    with pytest.raises(pg.FileError) as refused:
        files.parse(text, "big.json")
    assert str(refused.value).startswith("big.json: ")
    for fact in facts:
        assert fact in str(refused.value)


def test_a_hundred_levels_are_read():
    assert files.parse('{"a":' * 100 + "0" + "}" * 100, "text")["a"]


def test_brackets_in_strings_nest_nothing():
    assert files.parse('{"name": "' + "[{" * 500 + '"}', "text")["name"].count("[") == 500
    assert files.parse('{"name": "' + "[{" * 500 + '\\"[["}', "text")["name"].count("[") == 502


@pytest.mark.timed
def test_an_unfinished_string_of_quotes_takes_linear_time():
    assert cost('"' + '\\"' * 2_000_000) < 150 * cost('"' + '\\"' * 100_000)


@pytest.mark.timed
def test_a_page_refuses_too_many_bodies_before_it_makes_them():
    state = update(initial(pg.Model.serial(2)), Connected(ME))
    rows = [{"name": str(i)} for i in range(100_000)]
    start = time.process_time()
    after = update(state, OpenText(ME, "m.json", json.dumps({"bodies": rows})))
    after = update(after, answer(after.errands[0]))  # a long text is read as an errand
    assert time.process_time() - start < 3
    assert after.model is state.model
    assert "100000 bodies; the page takes 1000 at most" in str(after.clients[ME].notice)


@pytest.mark.parametrize("encoding", ["utf-7", "rot13", "none", "base64"])
def test_an_encoding_that_no_reader_knows_is_a_sentence(encoding):
    text = f'<?xml version="1.0" encoding="{encoding}"?><robot name="r"/>'
    with pytest.raises(pg.FileError, match=r"^a\.urdf, line 1: not XML: "):
        parse_markup(text.encode(), "a.urdf")


STEP = {"low": [0, 0], "high": [1, 1], "height": 0.1}
FIELD = {"kind": "heightfield", "size": [1, 1, 1], "heights": [[0.0] * 400] * 300}


@pytest.mark.parametrize(
    ("model", "said"),
    [
        ({"ground": {"steps": [STEP] * 2001}}, "2001 steps; the page takes 2000 at most"),
        ({"bodies": [{"name": "a", "shape": FIELD}]}, "120000 heights; the page takes 100000"),
        ({"bodies": [{"name": "a", "shapes": [FIELD]}]}, "120000 heights; the page takes 100000"),
        ({"sites": [{"name": f"s{k}"} for k in range(2001)]}, "2001 sites; the page takes 2000"),
    ],
)
def test_the_page_takes_as_much_as_it_draws_in_time(model, said):
    state = update(initial(pg.Model.serial(1)), Connected(ME))
    text = json.dumps({"bodies": [{"name": "a"}]} | model)
    state = update(state, OpenText(ME, "a.json", text))
    if state.errands:
        state = update(state, answer(state.errands[0]))
    assert state.model.name == "serial 1"
    assert said in str(state.clients[ME].notice)


@pytest.mark.parametrize(
    "data", [{"bodies": 1}, {"bodies": [1, {"shape": 1}, {"shapes": [1, {"heights": [1]}]}]},
             {"ground": 1}, {"ground": {"steps": 1}}, {"forces": "x" * 9000}]
)  # fmt: skip
def test_what_is_counted_may_be_anything(data):
    assert too_many(data) == ""


def test_a_text_too_long_for_a_cell_is_told_in_words():
    sent = {"event": "Edit", "serial": 1, "body": "a", "field": "name", "index": [], "text": ""}
    event = from_page(ME, json.dumps(sent | {"text": "x" * 20_001}))
    assert event == Misread(ME, "text: String should have at most 20000 characters")


@pytest.mark.parametrize("key", ["shape", "shapes"])
def test_the_page_opens_what_is_within_its_limits(key):
    state = update(initial(pg.Model.serial(1)), Connected(ME))
    field = FIELD | {"heights": [[0.0] * 310] * 310}
    body = {"name": "a", key: field if key == "shape" else [field]}
    state = update(state, OpenText(ME, "a.json", json.dumps({"name": "hill", "bodies": [body]})))
    if state.errands:
        state = update(state, answer(state.errands[0]))
    assert state.model.name == "hill"
