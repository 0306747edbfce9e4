"""Runs as files: tables, arrays, figures and pictures."""

import csv
import io
import json
import re
import zipfile
from dataclasses import replace
from types import SimpleNamespace

import numpy as np
import pytest
import trimesh
import viser

import pgraph_core as pg
from pgraph_app.export import Exporting, view
from pgraph_app.features import State
from pgraph_app.gait.view import MOST, FootprintsView
from pgraph_app.run import Playback, Request, Run
from pgraph_app.run.footfalls import prints
from pgraph_app.scene import marks
from pgraph_app.scene.overlays import Overlays
from pgraph_app.scene.solids import drawn_beside
from pgraph_core.live import module
from pgraph_core.show import notebook

from .store import ME, after, begun, built_in, do, ran


@pytest.fixture(scope="module")
def run():
    model = pg.Model.serial(3)
    return Run(model, Request(), pg.simulate(pg.Mechanism(model), t_end=0.1))


def test_the_table_and_the_arrays_hold_the_run_s_numbers(run, tmp_path):
    head, *rows = csv.reader(io.StringIO(view.table(run).decode()))
    numbers = np.array(rows, dtype=float)
    assert numbers[:, head.index("t [s]")].tolist() == run.result.t.tolist()
    assert numbers[:, head.index("2 [rad]")].tolist() == run.result.q[:, 1].tolist()
    suffix, content = view.arrays(run)
    assert suffix == "npz"
    (tmp_path / "run.npz").write_bytes(content)
    again = pg.Result.load(tmp_path / "run.npz")
    np.testing.assert_array_equal(again.q, run.result.q)
    assert again.mechanism.model == run.model


def test_the_arrays_of_a_run_with_meshes_come_with_them(tmp_path):
    trimesh.creation.box((0.1, 0.1, 0.1)).export(tmp_path / "part.stl")
    shape = {"kind": "mesh", "file": str(tmp_path / "part.stl")}
    model = pg.Model.serial(1).edit("1", shape=shape)
    run = Run(model, Request(), pg.simulate(pg.Mechanism(model), t_end=0.01))
    suffix, content = view.arrays(run)
    assert suffix == "zip"
    away = tmp_path / "away"
    zipfile.ZipFile(io.BytesIO(content)).extractall(away)
    again = pg.Result.load(away / "run.npz").mechanism.model.body("1").shape
    assert again.file == str(away / "meshes" / "part.stl")


@pytest.mark.skipif(bool(module.stale()), reason="the module is older than the kernels")
def test_a_living_figure_opens_the_masses(run):
    page = view.living(run).decode()
    (text,) = re.findall(r'<script[^>]*id="figure"[^>]*>(.*?)</script>', page, re.DOTALL)
    engine = json.loads(text)["engine"]
    assert engine["methods"]
    assert [field["path"] for field in engine["open"]] == [f"bodies.{i}.mass" for i in (1, 2, 3)]


def test_an_fmu_has_the_model_of_the_run_or_says_why_there_is_none(run, tmp_path):
    suffix, content, report = view.made(Exporting(1, "fmu", run))
    assert (suffix, report.loaded) == ("fmu", True)
    told = " ".join(map(str, report.of("read")))  # shown on the page with the file
    assert [name for name in run.result.mechanism.names if f"'{name}'" not in told] == []
    with zipfile.ZipFile(io.BytesIO(content)) as archive:
        archive.extract("resources/model.json", tmp_path)
        assert "modelDescription.xml" in archive.namelist()
    assert pg.load(tmp_path / "resources" / "model.json") == run.model
    model = pg.Model.serial(1)
    result = pg.simulate(model, tau=lambda t, q, v: np.array([np.sin(t)]), t_end=0.1)
    with pytest.raises(pg.InputError, match="Python"):
        view.unit(Run(model, Request(), result))


def test_the_page_lists_what_an_fmu_contains(run):
    sent, files = [], []
    bridge = SimpleNamespace(
        server=SimpleNamespace(get_clients=lambda: {1: object()}),
        send=lambda client, name, data: sent.append((name, data)),
        download=lambda client, name, content: files.append(name),
    )
    view.ExportView(bridge)._send(Exporting(1, "fmu", run))
    (report,) = (data for name, data in sent if name == "conversion")
    assert any("output" in entry["text"] for entry in report["entries"])
    assert [name.endswith(".fmu") for name in files] == [True]


def test_a_living_figure_of_torques_in_python_is_the_recording():
    model = pg.Model.serial(1)
    result = pg.simulate(model, tau=lambda t, q, v: np.array([np.sin(t)]), t_end=0.1)
    assert "Python" in view.living(Run(model, Request(), result)).decode()


def test_a_living_figure_without_a_fitting_module_is_a_recording(run, monkeypatch):
    assert view.recorded_only(run) == module.stale()
    monkeypatch.setattr(module, "stale", lambda: "the module is old; make it again: python -m x")
    assert "make it again" in view.recorded_only(run)  # said on the page, to who can do it
    html = view.living(run).decode()
    assert "make it again" not in html
    (text,) = re.findall(r'<script[^>]*id="figure"[^>]*>(.*?)</script>', html, re.DOTALL)
    given = json.loads(text)
    assert (given["engine"]["methods"], given["engine"]["refused"]) == ([], "")
    assert given["recording"]["count"] > 1


@pytest.fixture(scope="module")
def walk():
    model = built_in("quadruped_hips")
    result = pg.simulate(pg.Mechanism(model), scenario="trot", t_end=0.4, estimate=False)
    return Run(model, Request(), result)


def drawn(run, *shown):
    """Return which of a run's marks stand in the scene at each of some times."""
    server = viser.ViserServer(host="127.0.0.1", port=0, verbose=False)
    state = State(run.model, request=run.request, last_run=run, shown=frozenset(("shapes", *shown)))
    pictures, still, nodes = [], np.zeros(3), server.scene._handle_from_node_name
    try:
        overlays, feet = Overlays(server), FootprintsView(server)
        for t in np.linspace(run.result.t[0], run.result.t[-1], 12):
            now = replace(state, playback=Playback(float(t)))
            overlays.render(now, *notebook.between(run.result.t, run.result.body_pose, t), still)
            if "footprints" in shown:
                feet.show(now, prints(run.falls, t, MOST))
            there = {name: field for name, field in MARKS.items() if name in nodes}
            pictures.append({n: np.array(getattr(nodes[n], field)) for n, field in there.items()})
    finally:
        server.stop()
    return pictures


MARKS = {"/forces": "points", "/cones": "batched_positions", "/footprints": "batched_positions"}


def test_forces_and_footprints_are_drawn_where_they_are_shown(walk):
    """No arrow is longer than the largest force, and feet leave more prints on the ground."""
    pictures = drawn(walk, "forces", "cones", "footprints")
    assert all(set(MARKS) == set(picture) for picture in pictures[1:])
    assert len(pictures[-1]["/footprints"]) > len(pictures[0]["/footprints"])
    state = State(walk.model, request=walk.request, last_run=walk)
    longest = marks.scale(state) * max(
        np.linalg.norm(force[:, 3:], axis=1).max() for force in walk.result.contact_force.values()
    )
    sizes = [np.linalg.norm(np.diff(p["/forces"], axis=1), axis=-1) for p in pictures[1:]]
    assert 0.1 * longest < max(size.max() for size in sizes) < 1.0001 * longest
    heights = np.concatenate([picture["/footprints"][:, 1] for picture in pictures])
    assert np.abs(heights).max() < 2e-3
    assert not any(drawn(walk))  # a page that shows no marks


def test_a_finished_run_is_exported(run):
    state = begun(run.model)
    assert after(state, do.Export(ME, "csv")) is state
    state = after(ran(state, run.result), do.Export(ME, "csv"))
    assert state.exporting.what == "csv"
    table = view.made(state.exporting).content
    heads = table.decode().partition("\n")[0].split(",")
    assert [
        x for x in heads if x.startswith(f"angular_acceleration.{run.result.mechanism.names[0]}")
    ]


@pytest.mark.parametrize(("what", "begins"), [("png", b"\x89PNG"), ("gif", b"GIF89a")])
def test_a_picture_is_of_the_time_that_is_shown(run, what, begins):
    asked = Exporting(1, what, run, time=0.05)
    suffix, content, _ = view.made(asked)
    assert suffix == what
    assert content.startswith(begins)
    if what == "png":
        assert content != view.made(Exporting(1, what, run, time=0.0))[1]


def test_a_picture_has_the_springs_and_forces_that_the_page_shows(monkeypatch):
    """The hand-over of a press with a spring showed no spring."""
    from pgraph_core.show import pictures

    mass = pg.Body(name="a", joint="prismatic", axes=(0, 0, 1), mass=1.0, link=(0, 0, 1))
    spring = pg.Spring(name="s", body="a", other_point=(0, 0, 2), stiffness=9.81, rest=0.0)
    model = pg.Model(bodies=[mass], forces=[spring])
    done = pg.simulate(model, t_end=0.1, step=1e-2)
    made, drawn = [], pictures.Drawing.draw
    monkeypatch.setattr(
        pictures.Drawing,
        "draw",
        lambda s, pose, beside: made.append(beside) or drawn(s, pose, beside),
    )
    contents = [
        view.made(Exporting(1, "png", Run(model, Request(), done), 0.0, frozenset(shown)))[1]
        for shown in ((), ("joining",))
    ]
    assert contents[0] != contents[1]
    assert [len(x.places) > 0 for x in made] == [False, True]
    corners = made[1].places[:, 2]
    wire = 0.1 / 9  # [m] less than a tenth of the pitch of 9 turns
    assert corners.min() == pytest.approx(1.0, abs=wire)  # from the body to the point above
    assert corners.max() == pytest.approx(2.0, abs=wire)
    view.made(Exporting(1, "gif", Run(model, Request(), done), 0.0, frozenset(("joining",))))
    assert len(made) > 3


def test_a_picture_has_arrows_of_contact_forces():
    ball = pg.Body(
        name="a",
        joint="free",
        mass=1.0,
        shape={"kind": "sphere", "radius": 0.1},
        q=(0, 0, 0.1, 1, 0, 0, 0),
    )
    model = pg.Model(bodies=[ball], contacts=[pg.Contact(name="floor", body="a")])
    done = pg.simulate(model, t_end=0.1)
    faces = drawn_beside(Run(model, Request(), done), frozenset({"forces"}))(
        0.1, done.body_pose[-1]
    )
    assert len(faces.places) == 3 * len(faces.colors) == 3 * len(faces.opacity) > 0
    low, high = faces.places[:, 2].min(), faces.places[:, 2].max()
    assert high > 10 * abs(low)  # it points up from the ground
    np.testing.assert_allclose(np.linalg.norm(faces.normals, axis=1), 1.0)
