"""Damaged files of every kind: a reader answers with a value or a refusal, and lives.

Good files are damaged by their bytes, by their words and numbers, and by pieces of one another.
Each reader works in a process of its own with limited memory, so that a death or a hang is seen.
"""

import json
import multiprocessing
import os
import random
import re
import resource
import tempfile
from concurrent.futures import ProcessPoolExecutor
from pathlib import Path

import pytest
import trimesh

import pgraph_core as pg
import pgraph_models
from pgraph_app.core import cells
from pgraph_app.features import initial, update
from pgraph_app.model import archive
from pgraph_app.session import Connected
from pgraph_app.table import Paste
from pgraph_core.formats import read_model, write_model
from pgraph_core.mesh_files import load_mesh

EXPLORES = bool(os.environ.get("PGRAPH_EXPLORE"))
MEMORY = 1 << 30  # bytes beyond what the process has at its start
NUMBERS = (
    "nan", "inf", "-inf", "1e999", "-1", "0", "1e308", "1e-320", "9" * 400, "0x10", "1_0", "",
    "true", "null", '""', "[]", "{}", "\u0661", "1e", "-", "2147483648", "18446744073709551616",
)  # fmt: skip
WORD = re.compile(rb"[A-Za-z_]\w*")
NUMBER = re.compile(rb"-?\d+\.?\d*(?:[eE][-+]?\d+)?")
PIECE = re.compile(rb"<[^>]*>|\{|\}|\[|\]|,|\n|\"[^\"]*\"")
JOINED = b"""<mujoco><default><default class="x"><geom density="500"/></default></default>
<worldbody><geom type="plane" size="1 1 1"/><body name="a" pos="0 0 1"><freejoint/>
<geom class="x" size="0.1"/>
<body name="b" pos="0 0 1"><joint name="h" axis="0 1 0" range="-1 1"/>
<geom type="capsule" fromto="0 0 0 0 0 1" size="0.05"/><site name="s"/></body></body></worldbody>
<equality><joint joint1="h" polycoef="0 1 0 0 0"/></equality>
<actuator><motor joint="h" gear="3" ctrlrange="-1 1"/></actuator></mujoco>"""
COLLADA = b"""<COLLADA><asset><unit meter="1"/><up_axis>Z_UP</up_axis></asset><library_geometries>
<geometry id="g"><mesh><source id="p"><float_array id="f" count="12">0 0 0 1 0 0 0 1 0 0 0 1
</float_array><technique_common><accessor source="#f" count="4" stride="3"/></technique_common>
</source><vertices id="v"><input semantic="POSITION" source="#p"/></vertices><triangles count="4">
<input semantic="VERTEX" source="#v" offset="0"/><p>0 2 1 0 1 3 0 3 2 1 2 3</p></triangles></mesh>
</geometry></library_geometries><library_visual_scenes><visual_scene id="s"><node>
<instance_geometry url="#g"/></node></visual_scene></library_visual_scenes></COLLADA>"""
MESHES = ("stl", "obj", "off", "ply", "glb")


def a_model(path: Path) -> object:
    """The model must also be one that can be used and saved."""
    model, _ = read_model(path)
    pg.Mechanism(model)
    return pg.Model.from_json(model.to_json())


def an_archive(path: Path) -> object:
    with tempfile.TemporaryDirectory() as keep:
        return archive.unpacked(path.read_bytes(), Path(keep))


def pasted(path: Path) -> object:
    text = path.read_bytes().decode("utf-8", "replace")
    state = update(initial(pg.Model.serial(2)), Connected(1))
    return update(state, Paste(1, serial=1, text=text, rows=(), column=0))


READERS = {"json": a_model, "urdf": a_model, "xml": a_model, "dae": load_mesh, "zip": an_archive,
           "npz": pg.Result.load, "txt": pasted} | dict.fromkeys(MESHES, load_mesh)  # fmt: skip


def good_files(kind: str, folder: Path) -> list[bytes]:
    if kind in ("json", "urdf", "xml"):
        for name in ("quadruped", "four_bar"):
            model = pg.Model.load(pgraph_models.path(name))
            file = folder / f"{name}.{kind}"
            model.save(file) if kind == "json" else write_model(model, file)
    elif kind in MESHES:
        trimesh.creation.box((1, 1, 1)).export(folder / f"box.{kind}")
    elif kind == "npz":
        pg.simulate(pg.Model.serial(2), t_end=0.01).save(folder / "run.npz")
    elif kind == "zip":
        trimesh.creation.box((1, 1, 1)).export(folder / "box.stl")
        cup = {"name": "cup", "inertia": [1, 1, 1], "shape": {"kind": "mesh", "file": "box.stl"}}
        (folder / "model.json").write_text(json.dumps({"bodies": [cup]}), "utf-8")
        return [archive.zipped(folder)]
    table = b"Body\tParent\tDoF\tMass\tlink x\na\tground\t1 hinge\t1.5\t0.2\nb\ta\t3\t2\t0.1\n"
    more = {"xml": [JOINED], "dae": [COLLADA], "txt": [table]}.get(kind, [])
    return [file.read_bytes() for file in sorted(folder.iterdir())] + more


def damaged(good: list[bytes], seed: int) -> bytes:
    """One of the good files with one to four faults."""
    rng = random.Random(seed)
    content = rng.choice(good)
    for _ in range(rng.choice((1, 1, 1, 2, 3, 4))):
        a, b = sorted(rng.randrange(len(content) + 1) for _ in range(2))
        other = rng.choice(good)
        fault = rng.choice(("flip", "cut", "end", "repeat", "splice", *3 * (NUMBER, WORD, PIECE)))
        if fault == "flip":
            content = content[:a] + bytes([rng.randrange(256)]) + content[a + 1 :]
        elif fault == "cut":
            content = content[:a] + content[b:]
        elif fault == "end":
            content = content[:a]
        elif fault == "repeat":
            b = min(len(content), a + rng.choice((1, 8, 64, 512)))
            content = content[:b] + content[a:b] * rng.choice((1, 2, 50)) + content[b:]
        elif fault == "splice":
            content = content[:a] + other[rng.randrange(len(other) + 1) :]
        elif found := [m.span() for m in fault.finditer(content)]:
            words = [x.encode() for x in NUMBERS] if fault is NUMBER else fault.findall(other)[:400]
            a, b = rng.choice(found)
            content = content[:a] + rng.choice([*words, b"", b"ground", b"\xc3\xa9"]) + content[b:]
    return content


def attack(kind: str, seeds: range) -> list[str]:
    """The damaged files that raise anything but a refusal with a text."""
    wrong = []
    with tempfile.TemporaryDirectory() as place:
        (folder := Path(place, "good")).mkdir()
        good, path = good_files(kind, folder), Path(place, f"input.{kind}")
        for content in good:  # its libraries load now
            path.write_bytes(content)
            READERS[kind](path)
        pages = int(Path("/proc/self/statm").read_text().split()[0])
        limit = pages * resource.getpagesize() + MEMORY
        resource.setrlimit(resource.RLIMIT_AS, (limit, limit))
        for seed in seeds:
            path.write_bytes(damaged(good, seed))
            try:
                READERS[kind](path)
            except (pg.PgraphError, cells.Refusal) as error:
                if not str(error):
                    wrong.append(f"seed {seed}: a refusal without a text")
            except Exception as error:
                wrong.append(f"seed {seed}: {error!r}")
    return wrong


@pytest.mark.filterwarnings("ignore:.*fork:DeprecationWarning")
@pytest.mark.parametrize("kind", READERS)
def test_a_damaged_file_gets_a_value_or_a_refusal(kind):
    if kind == "xml":
        pytest.importorskip("mujoco")
    first = int.from_bytes(os.urandom(3), "little") if EXPLORES else 0
    seeds = range(first, first + (5000 if EXPLORES else 25))
    with ProcessPoolExecutor(1, mp_context=multiprocessing.get_context("fork")) as pool:
        assert pool.submit(attack, kind, seeds).result(3600 if EXPLORES else 120) == []


TURNED = (
    '<robot name="r"><link name="a"/><link name="b"><inertial><mass value="1"/>'
    '<origin rpy="1 1 1"/><inertia ixx="1e308" iyy="1e308" izz="1e308" ixy="1e308"'
    ' ixz="1e308" iyz="1e308"/></inertial></link><joint name="j" type="revolute">'
    '<parent link="a"/><child link="b"/><axis xyz="0 0 1"/></joint></robot>'
)
HUGE = '<body name="b" quat="1e308 1e308 0 0"><freejoint/><geom size="0.1"/></body>'
COPIES = '<replicate count="{}">'
HILLS = (
    '<mujoco><asset><hfield name="h" nrow="30000" ncol="30000" size="1 1 1 1"/></asset></mujoco>'
)


@pytest.mark.parametrize(
    ("name", "text", "facts"),
    [
        ("a.urdf", TURNED, ["link 'b'", "overflow"]),
        ("a.xml", f"<mujoco><worldbody>{HUGE}</worldbody></mujoco>", ["body 'b'"]),
        ("a.xml", f"<mujoco><asset>{HILLS}</asset></mujoco>", ["line 1, hfield, nrow", "ncol"]),
        *(
            ("a.xml", f"<mujoco><worldbody>{COPIES.format(count) * n}<geom size='1'/>"
             f"{'</replicate>' * n}</worldbody></mujoco>", ["20000"])
            for count, n in (("1000000", 1), ("300", 5), (" 99999999 ", 1))
        ),
    ],
)  # fmt: skip
def test_numbers_without_measure_are_refused(name, text, facts, tmp_path):
    if name.endswith(".xml"):
        pytest.importorskip("mujoco")
    (tmp_path / name).write_text(text)
    with pytest.raises(pg.PgraphError) as refused:
        read_model(tmp_path / name)
    assert [fact for fact in facts if fact not in str(refused.value)] == []
