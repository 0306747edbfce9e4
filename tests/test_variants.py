"""Variants of files and calls that once were slow, misread or silent."""

from __future__ import annotations

import gc
import json
import sys
import tracemalloc
from contextlib import suppress

import numpy as np
import pytest

import pgraph_core as pg
from pgraph_core.contact.tables import tables
from pgraph_core.formats import read_model
from tests.refusals import assert_names

from .nights import at_night

INERTIAL = """<inertial><mass value="1"/>
  <inertia ixx=".1" iyy=".1" izz=".1" ixy="0" ixz="0" iyz="0"/></inertial>"""
BALL = '<sphere radius=".1"/>'


def robot(inside="", geometry=BALL, more=""):
    solid = f"<visual><geometry>{geometry}</geometry></visual>"
    return f"""<robot name="r"><link name="b"/><link name="a">{INERTIAL}{solid}</link>
      <joint name="j" type="continuous"><parent link="b"/><child link="a"/>{inside}</joint>
      {more}</robot>"""


def calls(function) -> int:
    """Return how many functions a call calls: a measure of work that no other program changes."""
    count = 0

    def tell(*_):
        nonlocal count
        count += 1

    sys.setprofile(tell)
    try:
        with suppress(pg.PgraphError):
            function()
    finally:
        sys.setprofile(None)
    return count


def repeated(form: str, n: int) -> str:
    return "".join(form.replace("#", str(i)) for i in range(n))


def world(form: str, rest: str = ""):
    return lambda n: (
        f"<mujoco><worldbody>{repeated(form, n)}</worldbody>{repeated(rest, n)}</mujoco>"
    )


GEOM = '<geom type="box" size=".1 .1 .1"/>'
GROWING = {
    "boxes": world(GEOM),
    "free": world(f'<body pos="# 0 0"><freejoint/>{GEOM}</body>'),
    "arms": world(f'<body pos="# 0 0"><joint/>{GEOM}<body><joint/>{GEOM}</body></body>'),
    "sites": lambda n: "<mujoco><worldbody><body><joint/>" + GEOM + repeated('<site name="s#"/>', n)
    + "</body></worldbody></mujoco>",
    "driven": world(f'<body pos="# 0 0"><joint name="j#"/>{GEOM}</body>',
                    '<actuator><motor joint="j#"/></actuator>'),
    "limited": world(f'<body pos="# 0 0"><joint name="j#" actuatorfrcrange="-1 1"/>{GEOM}</body>',
                     '<actuator><motor joint="j#"/></actuator>'),
    "links": lambda n: robot(more=repeated(
        f'<link name="l#">{INERTIAL}</link><joint name="k#" type="continuous"><parent link="b"/>'
        '<child link="l#"/></joint>', n)),
    "cells": lambda n: json.dumps({"bodies": [{"name": "a", "com": ["=1"] * n}]}),
    "masses": lambda n: json.dumps({"bodies": [
        {"name": f"b{i}", "mass": f"=1+{i}", "com": [0, 0, 1]} for i in range(n)]}),
    "wrong": lambda n: json.dumps({"bodies": [
        {"name": f"b{i}", "mass": "=1if"} for i in range(n)]}),
}  # fmt: skip


@pytest.mark.parametrize("kind", GROWING)
def test_the_work_of_reading_grows_as_the_file(kind, tmp_path):
    """F17, R6: twice the parts take at most a little more than twice the calls."""
    if "mujoco" in GROWING[kind](1):
        pytest.importorskip("mujoco")
    suffix = {"<mujoco": ".xml", "<robot ": ".urdf"}
    texts = [GROWING[kind](n) for n in (50, 100, 200)]
    paths = [tmp_path / f"{n}{suffix.get(text[:7], '.json')}" for n, text in enumerate(texts)]
    for path, text in zip(paths, texts):
        path.write_text(text)
    first, *work = (calls(lambda path=path: read_model(path)) for path in paths)
    assert work[1] < 2.3 * work[0]
    assert first > 0


def test_the_work_of_contacts_grows_as_the_bodies():
    """Twice the bodies on the ground take at most a little more than twice the lines."""

    def lines(count: int) -> int:
        ball = {"shape": pg.Sphere(0.1), "mass": 1.0, "joint": "free"}
        bodies = [pg.Body(name=f"b{i}", q=(i, 0, 1, 1, 0, 0, 0), **ball) for i in range(count)]
        mech = pg.Mechanism(pg.Model(bodies=bodies, contacts=[pg.Contact(body="*")]))
        done = 0

        def tell(frame, event, _):
            nonlocal done
            done += event == "line"
            return tell if frame.f_code.co_filename.endswith("tables.py") else None

        sys.settrace(tell)
        try:
            assert len(tables(mech.packed, mech.model.contacts).touches) == count
        finally:
            sys.settrace(None)
        return done

    few, many = lines(20), lines(40)
    assert 100 < many < 2.3 * few


def test_garbage_is_collected_again_after_a_file_is_read_or_refused(tmp_path):
    path = tmp_path / "robot.urdf"
    path.write_text(robot())
    pg.load(path)
    with pytest.raises(pg.FileError):
        pg.load(tmp_path / "none.urdf")
    assert gc.isenabled()


def test_trees_that_are_alike_touch_as_all_pairs_do(tmp_path):
    """One friction in all trees makes contacts of '*', and another one adds pairs of its tree."""
    pytest.importorskip("mujoco")
    tree = f'<body pos="# 0 2"><freejoint/>{GEOM}</body>'
    floor = '<geom type="plane" size="1 1 1"/>'
    rough = tree.replace("size", 'friction="2" size').replace("#", "9")
    for more, every in (("", True), (rough, False)):
        path = tmp_path / "trees.xml"
        text = f"<mujoco><worldbody>{floor}{repeated(tree, 4)}{more}</worldbody></mujoco>"
        path.write_text(text)
        contacts = read_model(path)[0].contacts
        assert all(c.body == "*" for c in contacts) == every
        assert len(contacts) == (2 if every else 2 + 1 + 4)


@pytest.mark.parametrize(
    ("inside", "acts"),
    [
        ('<joint_properties friction="0.5" damping="0.1"/>', True),
        ('<joint_properties damping="1"/>', True),
        ('<joint_properties friction="0.0" damping="0"/>', False),
        ('<Joint_Properties friction="1"/>', True),
        ("<joint_properties><friction>0.5</friction></joint_properties>", True),
        ("<joint_properties><friction>0.0</friction></joint_properties>", False),
        ('<dynamics damping="1"/><joint_properties friction="1"/>', True),
    ],
)
def test_friction_that_another_program_writes_is_told_where_people_run(inside, acts, tmp_path):
    """F28 and F30."""
    path = tmp_path / "arm.urdf"
    path.write_text(robot(inside))
    _, report = read_model(path)
    assert report.loaded != acts
    assert_names(str(report), "oint_", "line 3")
    model = pg.load(path)
    run = pg.simulate(model, t_end=0.01)
    for told in (run.notices, pg.Stepper(model).notices, pg.simulate_batch(model)[0].notices):
        assert any("joint_properties" in text.lower() for text in told) == acts
    heavier = model.edit("a", mass=2.0).replace(gravity=(0, 0, -1))
    assert bool(heavier.lost) == acts


@pytest.mark.parametrize(("command", "rest"), [
    ("run", "--t-end 0.01"), ("check", ""), ("export", "-o arm.html"), ("convert", "arm.json"),
    ("sweep", "--set bodies.a.mass=1:2:2 --metric energy_drift --t-end 0.01 --workers 1"),
])  # fmt: skip
def test_each_command_tells_what_a_file_lost(command, rest, tmp_path, monkeypatch, capsys):
    from app.cli.main import main

    monkeypatch.chdir(tmp_path)
    (tmp_path / "arm.urdf").write_text(robot('<joint_properties friction="0.5"/>'))
    with suppress(SystemExit):
        main([command, "arm.urdf", *rest.split()])
    said = capsys.readouterr()
    assert_names(said.out + said.err, "arm.urdf, line", "<joint_properties>")


@pytest.mark.parametrize("name", ["a.xml", "b.urdf", "c.json", "d.txt", "e", "f.XML", "g.mjcf"])
@pytest.mark.parametrize("kind", ["urdf", "urdf with a mark", "mjcf", "json"])
def test_a_model_is_read_by_its_content_whatever_its_name(name, kind, tmp_path):
    """F29."""
    if kind == "mjcf":
        pytest.importorskip("mujoco")
    text = {
        "urdf": robot(), "urdf with a mark": "\ufeff<!-- mujoco -->" + robot(),
        "mjcf": world(f"<body>{GEOM}<joint/></body>")(1), "json": pg.Model.serial(2).to_json(),
    }[kind]  # fmt: skip
    (tmp_path / name).write_text(text, encoding="utf-8")
    assert len(pg.load(tmp_path / name).bodies) == (1 if kind == "mjcf" else 2)


@pytest.mark.parametrize("name", ["a.xml", "b.urdf", "c.json", "d.mjcf", "e"])
@pytest.mark.parametrize("text", ["", "<sdf/>", "<html/>", "{", "#usda 1.0", "<robot", "\0\1"])
def test_what_is_no_model_is_refused_with_its_file(name, text, tmp_path):
    (tmp_path / name).write_text(text)
    with pytest.raises(pg.PgraphError, match=name):
        pg.load(tmp_path / name)


@pytest.mark.parametrize(
    ("geometry", "told"),
    [
        ('<mesh filename="part.stl"/>', True), ('<mesh filename="part.obj"/>', True),
        ('<mesh filename="part.stl" scale="1 1 1"/>', True),
        ('<mesh filename="part.stl" scale="0.001"/>', False),
        ('<mesh filename="part.stl" scale="0.001 0.001 0.001"/>', False),
        (BALL, False),
    ],
)  # fmt: skip
def test_a_mesh_in_millimetres_is_doubted(geometry, told, tmp_path):
    """F27."""
    import trimesh

    for suffix in ("stl", "obj"):
        trimesh.creation.box((200, 100, 50)).export(tmp_path / f"part.{suffix}")
    (tmp_path / "arm.urdf").write_text(robot('<origin xyz=".1 0 0"/>', geometry))
    report = read_model(tmp_path / "arm.urdf")[1]
    assert any("millimetres" in entry.text for entry in report.of("warning")) == told


@pytest.mark.parametrize(
    ("mimic", "follower"),
    [("", 0.3), ('multiplier="-1"', -0.3), ('offset="0.2"', 0.5),
     ('multiplier="2" offset="-.1"', 0.5), ('multiplier="0.5"', 0.15)],
)  # fmt: skip
@pytest.mark.parametrize("joint", ["revolute", "prismatic"])
def test_a_follower_starts_where_its_leader_lets_it(mimic, follower, joint, tmp_path):
    """F33: limits of the leader without 0 put it at 0.3."""
    limit = '<limit lower="{}" upper="{}" effort="1" velocity="1"/>'
    ends = f'<link name="c">{INERTIAL}</link>' + "".join(
        f'<joint name="{name}" type="{joint}"><parent link="b"/>{more}</joint>'
        for name, more in (
            ("l", '<child link="d"/>' + limit.format(0.3, 1)),
            ("k", f'<child link="c"/><mimic joint="l" {mimic}/>' + limit.format(-3, 3)),
        )
    )
    (tmp_path / "r.urdf").write_text(robot(more=f'<link name="d">{INERTIAL}</link>{ends}'))
    run = pg.simulate(pg.load(tmp_path / "r.urdf"), t_end=0.01)
    assert run["d"][0] == pytest.approx(0.3)
    assert run["c"][0] == pytest.approx(follower)


@pytest.mark.parametrize(
    ("folder", "uri", "mesh", "found"),
    [
        ("rob/urdf", "package://rob/meshes/p.stl", "rob/meshes/p.stl", "outside"),
        ("rob", "package://rob/p.stl", "rob/p.stl", ""),
        ("rob", "package://rob/meshes/p.stl", "rob/meshes/p.stl", ""),
        ("w/src/rob/urdf/x", "package://rob/m/v/p.stl", "w/src/rob/m/v/p.stl", "outside"),
        ("rob/urdf", "model://rob/meshes/p.stl", "rob/meshes/p.stl", "outside"),
        ("rob/urdf", "package://other/meshes/p.stl", "rob/meshes/p.stl", "does not exist"),
    ],
)
def test_a_package_without_manifest_is_found_or_named(folder, uri, mesh, found, tmp_path):
    """F34 and F26."""
    import trimesh

    for place in (folder, mesh):
        (tmp_path / place).parent.mkdir(parents=True, exist_ok=True)
    (tmp_path / folder).mkdir(parents=True, exist_ok=True)
    trimesh.creation.box((0.2, 0.1, 0.1)).export(tmp_path / mesh)
    (tmp_path / folder / "r.urdf").write_text(robot("", f'<mesh filename="{uri}"/>'))
    said = " ".join(
        entry.text for entry in read_model(tmp_path / folder / "r.urdf")[1].of("left out")
    )
    assert (found in said) == bool(found) or not said
    assert ("--root FOLDER" in said) == ("roots=[" in said) == (found == "outside")


HUGE = np.broadcast_to(1.0, (10**9,))
SQUARE = np.broadcast_to(1.0, (10**5, 10**5))
MECH = pg.Mechanism(pg.Model.serial(2))
TAKING = {
    "q of a method": lambda: MECH.mass_matrix(HUGE), "many q": lambda: MECH.mass_matrix(SQUARE),
    "v": lambda: MECH.bias_force([0, 0], HUGE), "point": lambda: MECH.jacobian([0, 0], "2", HUGE),
    "external": lambda: MECH.inverse_dynamics([0, 0], [0, 0], [0, 0], SQUARE),
    "q of a run": lambda: pg.simulate(MECH, q=HUGE, t_end=0.1),
    "tau": lambda: pg.simulate(MECH, tau=HUGE, t_end=0.1),
    "times": lambda: pg.simulate(MECH, t_eval=HUGE),
    "runs": lambda: pg.simulate_batch(MECH, SQUARE),
    "a batch": lambda: pg.BatchStepper(MECH, 2).reset(q=SQUARE),
    "a target": lambda: MECH.inverse_kinematics({"2": HUGE}),
    "a table": lambda: pg.Table(t=HUGE, value=HUGE), "com": lambda: pg.Body("a", com=HUGE),
    "q of a body": lambda: pg.Body("a", q=HUGE), "inertia": lambda: pg.Body("a", inertia=SQUARE),
    "heights": lambda: pg.Shape("heightfield", size=(1, 1, 1), heights=SQUARE),
}  # fmt: skip


@pytest.mark.parametrize("name", TAKING)
def test_an_array_is_judged_before_it_is_copied(name):
    """R10."""
    tracemalloc.start()
    try:
        with pytest.raises(pg.PgraphError) as refused:
            TAKING[name]()
        assert tracemalloc.get_traced_memory()[1] < 10**7
    finally:
        tracemalloc.stop()
    assert len(str(refused.value)) < 1000


OPTIONS = {
    "default": {}, "fixed steps": {"method": "rk4", "step": 2e-3},
    "torques": {"tau": lambda t, q, v: -v}, "events": {"events": lambda t, q, v: q[0]},
    "derivatives": {"method": "rk4", "step": 2e-3, "wrt": ["bodies.1.mass"]},
}  # fmt: skip


@pytest.mark.parametrize(
    "name", ["default", "derivatives", *at_night("fixed steps", "torques", "events")]
)
def test_runs_that_are_dropped_leave_their_memory(name):
    """R12: a run of 20,001 frames has 0.9 MB."""

    def run(count):
        for k in range(count):
            model = MECH.model.edit("1", mass=1.0 + 0.01 * k)
            pg.simulate(model, t_end=0.02, frames=501, estimate=False, **OPTIONS[name])
        del model  # with the room for frames that it keeps for its next run
        gc.collect()
        return tracemalloc.get_traced_memory()[0]

    run(1)
    tracemalloc.start()
    try:
        before = run(1)
        assert run(4) - before < 4 * 501 * 4 * 8  # less than a q and a v of each
    finally:
        tracemalloc.stop()
