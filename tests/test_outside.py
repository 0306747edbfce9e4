"""No file outside of the allowed folders is opened, copied or overwritten.

Every spelling of a path is tried by every way into the program. Python's audit hook reports
opened files.
"""

import json
import os
import re
import sys
import zipfile
from functools import partial
from io import BytesIO
from pathlib import Path

import numpy as np
import pytest
import trimesh

import pgraph_core as pg
from pgraph_app.core.cells import Refusal
from pgraph_app.features import initial, update
from pgraph_app.model import OpenText, archive
from pgraph_app.model.apart import answer
from pgraph_app.session import Connected, Save, Saved
from pgraph_app.session.autosave import Files
from pgraph_core.mesh_files import load_mesh
from pgraph_core.model import files as model_files

KEY = b"-----BEGIN OPENSSH PRIVATE KEY-----\nsecret\n"
SPELLINGS = {
    "absolute": "{mine}/box.stl",
    "absolute, no mesh": "{mine}/key.stl",
    "absolute, with a detour": "{folder}/../private/box.stl",
    "a system file": "/etc/passwd",
    "up": "../private/box.stl",
    "up to the root": "../" * 40 + "etc/passwd",
    "up, backslashes": "..\\private\\box.stl",
    "up, encoded": "%2e%2e/private/box.stl",
    "up, encoded slash": "..%2fprivate%2fbox.stl",
    "up, one character of two dots": "\u2025/private/box.stl",
    "up, another slash": "..\u2215private\u2215box.stl",
    "up, invisible character": "..\u200b/private/box.stl",
    "accent in one": "../priv\u00e9/box.stl",
    "home": "~/box.stl",
    "variable": "$HOME/box.stl",
    "link": "link.stl",
    "linked folder": "linked/box.stl",
    "link upwards": "up/private/box.stl",
    "circle of links": "circle.stl",
    "link to a device": "zero.stl",
    "device": "/dev/zero",
    "environment": "/proc/self/environ",
    "root by /proc": "/proc/self/root{mine}/box.stl",
    "pipe": "{mine}/pipe.stl",
    "NUL": "../private/box.stl\0.stl",
    "line break": "../private/box.stl\n",
    "address": "file://{mine}/box.stl",
    "share": "\\\\server\\share\\box.stl",
    "package": "package://model/../../private/box.stl",
    "very long": "a/" * 3000 + "../" * 3000 + "../private/box.stl",
}


@pytest.fixture
def folders(tmp_path, monkeypatch) -> tuple[Path, Path]:
    """(the folder of a model that has links out of it, a folder of private files beside it)"""
    folder, mine, accent = tmp_path / "model", tmp_path / "private", tmp_path / "priv\u00e9"
    for made in (folder, mine, accent):
        made.mkdir()
    for place in (mine, accent):
        trimesh.creation.box((1, 1, 1)).export(place / "box.stl")
    for name in ("id_rsa", "key.stl"):
        (mine / name).write_bytes(KEY)
    os.mkfifo(mine / "pipe.stl")
    links = {
        "link.stl": mine / "box.stl", "chain.stl": "link.stl", "linked": mine, "up": "..",
        "circle.stl": "circle.stl", "zero.stl": "/dev/zero", "stolen.stl": mine / "id_rsa",
        "relative.stl": "../private/box.stl",
    }  # fmt: skip
    for name, to in links.items():
        (folder / name).symlink_to(to)
    monkeypatch.setenv("HOME", str(mine))
    monkeypatch.setenv("XDG_DATA_HOME", str(tmp_path / "home"))
    monkeypatch.chdir(folder)
    return folder, mine


OPENED: list[str] | None = None


def _hear(event: str, given: tuple) -> None:
    if event == "open" and OPENED is not None and isinstance(given[0], (str, bytes, os.PathLike)):
        OPENED.append(os.fsdecode(given[0]))


sys.addaudithook(_hear)


@pytest.fixture
def opened():
    """The paths of all files that are opened from now on."""
    global OPENED
    OPENED = []
    yield OPENED
    OPENED = None


def shape(name: str) -> dict:
    return {"kind": "mesh", "file": name}


def text(name: str) -> str:
    cup = {"name": "cup", "inertia": [1, 1, 1], "shape": shape(name)}
    return json.dumps({"bodies": [{"name": "a"}, cup]})


def of_a_file(name: str, folder: Path) -> pg.Model:
    (folder / "model.json").write_text(text(name))
    return pg.Model.load(folder / "model.json")


def of_text(name: str, folder: Path) -> pg.Model:
    return pg.Model.from_json(text(name))


def of_a_run(name: str, folder: Path) -> pg.Model:
    pg.simulate(pg.Model.serial(1), t_end=0.01).save(folder / "run.npz")
    arrays = dict(np.load(folder / "run.npz"))
    header = json.loads(str(arrays["header"]))
    header["model"]["bodies"][0]["shape"] = shape(name)
    np.savez(folder / "other.npz", **arrays | {"header": np.array(json.dumps(header))})
    return pg.Result.load(folder / "other.npz").mechanism.model


def of_a_page(name: str, folder: Path) -> pg.Model:
    state = update(initial(pg.Model.serial(2)), Connected(1))
    after = update(state, OpenText(1, "m.json", text(name)))
    if after.model is state.model:
        raise Refusal(str(after.clients[1].notice))
    return after.model


def of_an_archive(name: str, folder: Path) -> pg.Model:
    content = BytesIO()
    with zipfile.ZipFile(content, "w") as made:
        made.writestr("m.json", text(name))
    return archive.unpacked(content.getvalue(), archive.mesh_folder())[0]


MARKUP = {
    "a.urdf": '<robot name="r"><link name="a"/><link name="b"><collision><geometry>'
    '<mesh filename="{}"/></geometry></collision></link><joint name="j" type="fixed">'
    '<parent link="a"/><child link="b"/></joint></robot>',
    "mesh.xml": '<mujoco><asset><mesh name="m" file="{}"/></asset><worldbody><body name="b">'
    '<freejoint/><geom type="mesh" mesh="m" mass="1"/></body></worldbody></mujoco>',
    "include.xml": '<mujoco><include file="{}"/></mujoco>',
}


def of_markup(file: str, name: str, folder: Path) -> pg.Model:
    if "\0" in name:
        raise Refusal("no character of XML")
    (folder / file).write_text(MARKUP[file].format(name.replace("\n", "&#10;")), "utf-8")
    return (pg.read_urdf if file.endswith("urdf") else pg.read_mjcf)(folder / file)[0]


WAYS = (of_a_file, of_text, of_a_run, of_a_page, of_an_archive,
        *(partial(of_markup, file) for file in MARKUP))  # fmt: skip
NAMED = (("body 'cup'", "shape"), ("body '1'", "shape"))


@pytest.mark.parametrize("way", WAYS)
def test_nothing_outside_is_opened_by_any_name_of_a_mesh(folders, opened, way):
    folder, mine = folders
    for what, spelling in SPELLINGS.items():
        name = spelling.format(mine=mine, folder=folder)
        opened.clear()
        try:
            model = way(name, folder)
        except (pg.PgraphError, Refusal) as refused:
            if way in WAYS[:3] and isinstance(refused, pg.ModelError):
                (problem,) = refused.problems
                assert (problem.where, problem.field) in NAMED, what
                assert len(name) > 1000 or repr(name) in problem.text, what
            continue
        finally:
            seen = {Path(os.path.realpath(path)) for path in opened if path.isprintable()}
            stolen = [path for path in seen if is_outside(path, mine)]
            assert not stolen, (what, stolen)
        for file in (part.file for body in model.bodies for part in body.shapes if part.file):
            if os.path.realpath(file).startswith(str(folder.parent / "home")):
                continue  # of an archive: its own folder
            assert Path(os.path.realpath(file)).is_relative_to(folder), (what, file)
            with pytest.raises(pg.FileError):  # a strange name of nothing
                load_mesh(file)


def is_outside(path: Path, mine: Path) -> bool:
    """Return whether a path is a private file, a device, or a secret of the system."""
    private = (mine, mine.with_name("priv\u00e9"), Path("/dev"), Path("/proc"), Path("/etc"))
    return any(path.is_relative_to(place) for place in private)


def test_nothing_is_written_over_by_a_page(folders):
    folder, mine = folders
    precious = mine / "precious.json"
    precious.write_text("{}")
    (folder / "linked.json").symlink_to(precious)
    os.mkfifo(folder / "pipe.json")
    sent: list = []
    files, state = Files(sent.append), update(initial(pg.Model.serial(2)), Connected(1))
    tries = [mine / "precious.json", *(folder / name for name in (
        "linked.json", "../private/precious.json", "linked/precious.json",
        "up/private/precious.json"))]  # fmt: skip
    never = [folder / "pipe.json", Path("/dev/null"), Path("/dev/full"), mine, folder / "linked"]
    odd = ["a\0.json", "~nobody-here/a.json", "", "/proc/self/mem", "/", "/none/a.json"]
    asked = [(path, False) for path in (*tries, *never, *odd)]
    for path, replace in asked + [(path, True) for path in (*never, *odd)]:
        files.render(state, update(state, Save(1, 1, str(path), replace)))
        assert isinstance(sent[-1], Saved)
        assert sent[-1].problem, path
    assert precious.read_text() == "{}"


def mesh_of(model: pg.Model) -> str:
    return model.body("cup").shape.file


def cup(file: Path) -> pg.Model:
    return pg.Model(bodies=[{"name": "cup", "inertia": (0.01,) * 3, "shape": shape(str(file))}])


def test_a_saved_run_carries_its_meshes(folders):
    folder, mine = folders
    run = pg.simulate(cup(mine / "box.stl"), t_end=0.01)
    run.save(folder / "run.npz")
    again = pg.Result.load(folder / "run.npz")
    np.testing.assert_array_equal(again.q, run.q)
    assert mesh_of(again.mechanism.model) == str(folder / "meshes" / "box.stl")
    assert (folder / "meshes" / "box.stl").is_file()


def test_a_folder_that_the_user_allows_may_hold_meshes(folders, monkeypatch):
    folder, mine = folders
    (folder / "model.json").write_text(text("../private/box.stl"))
    model = pg.Model.load(folder / "model.json", roots=[mine])
    assert load_mesh(mesh_of(model)).is_watertight
    outside = text(str(mine / "box.stl"))
    assert mesh_of(pg.Model.from_json(outside, roots=[mine])) == str(mine / "box.stl")
    with pytest.raises(pg.ModelError, match="roots="):
        pg.Model.load(folder / "model.json")
    monkeypatch.setenv("PGRAPH_MESHES", str(mine))
    assert pg.Model.load(folder / "model.json") == model
    trimesh.creation.box((1, 1, 1)).export(folder / "box.stl")
    model = pg.Model.from_json(text("box.stl"))
    assert pg.Model.from_json(model.to_json()) == model


@pytest.mark.parametrize("name", ["id_rsa", "key.stl"])
def test_a_file_without_a_mesh_is_neither_opened_nor_saved(folders, name, tmp_path):
    _, mine = folders
    with pytest.raises(pg.FileError):
        load_mesh(mine / name)
    model = cup(mine / name)
    (tmp_path / "out").mkdir()
    with pytest.raises(pg.FileError, match=f"body 'cup', shape.*{re.escape(str(mine / name))}"):
        model.save(tmp_path / "out" / "m.json")
    assert not list((tmp_path / "out").rglob("*"))
    with pytest.raises(pg.FileError):
        archive.packed(model)


@pytest.mark.parametrize("suffix", ["stl", "obj", "ply", "off", "glb"])
def test_a_saved_copy_holds_the_geometry_and_nothing_else(tmp_path, suffix):
    """Equal to the digits of its format, without other content of the file."""
    solid = trimesh.creation.icosphere(subdivisions=1, radius=0.7)
    solid.apply_scale([1, 1 / 3, 1])
    file = tmp_path / f"part.{suffix}"
    solid.export(file)
    with file.open("ab") as more:
        more.write(b"\n# secret\n" if suffix == "obj" else b"")
    (tmp_path / "out").mkdir()
    cup(file).save(tmp_path / "out" / "m.json")
    saved = mesh_of(pg.Model.load(tmp_path / "out" / "m.json"))
    again, first = load_mesh(saved), load_mesh(file)
    np.testing.assert_array_equal(again.vertices[again.faces], first.vertices[first.faces])
    assert b"secret" not in Path(saved).read_bytes()


@pytest.mark.parametrize(
    ("text", "fact"),
    [
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
        model_files.parse(text, "big.json")


STEP = {"low": [0, 0], "high": [1, 1], "height": 0.1}
FIELD = {"kind": "heightfield", "size": [1, 1, 1], "heights": [[0.0] * 400] * 300}


@pytest.mark.parametrize(
    ("model", "count", "limit"),
    [
        ({"bodies": [{"name": str(i)} for i in range(100_000)]}, "100000 bodies", "1000"),
        ({"ground": {"steps": [STEP] * 2001}}, "2001 steps", "2000"),
        ({"bodies": [{"name": "a", "shape": FIELD}]}, "120000 heights", "100000"),
        ({"bodies": [{"name": "a", "shapes": [FIELD]}]}, "120000 heights", "100000"),
        ({"sites": [{"name": f"s{k}"} for k in range(2001)]}, "2001 sites", "2000"),
    ],
)
def test_the_page_takes_no_more_than_it_can_draw(model, count, limit):
    state = opened_in_a_page({"bodies": [{"name": "a"}]} | model)
    assert state.model.name == "serial 1"
    assert all(fact in str(state.clients[1].notice) for fact in (count, limit))


def opened_in_a_page(data: dict):
    state = update(initial(pg.Model.serial(1)), Connected(1))
    state = update(state, OpenText(1, "a.json", json.dumps(data)))
    return update(state, answer(state.errands[0])) if state.errands else state


def test_the_page_opens_what_is_within_its_limits():
    body = {"name": "a", "shape": FIELD | {"heights": [[0.0] * 310] * 310}}
    assert opened_in_a_page({"name": "hill", "bodies": [body]}).model.name == "hill"
