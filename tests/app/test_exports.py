"""A run as a file: the numbers in it are the run's, and the animation needs nothing else."""

from __future__ import annotations

import csv
import io
import json
import re
import zipfile
from typing import Any

import numpy as np
import pytest
import trimesh
import viser

import pgraph_core as pg
import pgraph_models
from pgraph_app.core.state import Exporting, Request, Run, State, initial
from pgraph_app.features import update
from pgraph_app.model.derived import derive
from pgraph_app.run import view
from pgraph_app.run.update import Export, Simulate, Simulated
from pgraph_app.scene import marks
from pgraph_app.scene.update import Show
from pgraph_app.session.update import Connected
from pgraph_core.live import module
from pgraph_core.show import animation


@pytest.fixture(scope="module")
def run() -> Run:
    model = pg.Model.serial(3)
    return Run(model, Request(), pg.simulate(pg.Mechanism(model), t_end=0.2))


def test_the_table_holds_the_run_s_numbers(run):
    head, *rows = csv.reader(io.StringIO(view.table(run).decode()))
    numbers = np.array(rows, dtype=float)
    assert numbers[:, head.index("t [s]")].tolist() == run.result.t.tolist()
    assert numbers[:, head.index("2 [rad]")].tolist() == run.result.q[:, 1].tolist()


def test_the_arrays_are_read_back_as_the_run(run, tmp_path):
    file = tmp_path / "run.npz"
    suffix, content = view.arrays(run)
    assert suffix == "npz"
    file.write_bytes(content)
    again = pg.Result.load(file)
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
    assert again is not None
    assert again.file == str(away / "meshes" / "part.stl")


def test_the_animation_is_one_page_that_asks_for_nothing_else(run):
    page = view.animation(run).decode()
    assert page.lstrip().lower().startswith("<!doctype html")
    assert not re.search(r'<(script|link|img)[^>]+(src|href)="https?://', page)


@pytest.mark.skipif(bool(module.stale()), reason="the module is older than the kernels")
def test_a_living_figure_opens_the_masses(run):
    page = view.living(run).decode()
    (text,) = re.findall(r'<script[^>]*id="figure"[^>]*>(.*?)</script>', page, re.DOTALL)
    engine = json.loads(text)["engine"]
    assert engine["methods"]
    assert [field["path"] for field in engine["open"]] == [f"bodies.{i}.mass" for i in (1, 2, 3)]


def test_a_living_figure_of_what_cannot_travel_is_the_recording():
    model = pg.Model.serial(1)
    result = pg.simulate(model, tau=lambda t, q, v: np.array([np.sin(t)]), t_end=0.1)
    page = view.living(Run(model, Request(), result)).decode()
    assert "torques come from Python" in page


@pytest.fixture(scope="module")
def walk() -> Run:
    model = pg.Model.load(pgraph_models.path("quadruped_hips"))
    result = pg.simulate(pg.Mechanism(model), scenario="trot", t_end=0.8, estimate=False)
    return Run(model, Request(), result)


def drawn(run: Run, shown: frozenset[str]) -> list[dict[str, tuple[Any, ...]]]:
    """What of a run's marks stands in the scene at each picture of its animation."""
    server = viser.ViserServer(host="127.0.0.1", port=0, verbose=False)
    pictures: list[dict[str, tuple[Any, ...]]] = []

    def taken(_: float) -> None:
        nodes = server.scene._handle_from_node_name
        pictures.append({
            name: np.array(getattr(nodes[name], field))
            for name, field in MARKS.items()
            if name in nodes
        })  # fmt: skip

    try:
        animation.draw(server, run.result, taken, view.overlays(server, run, shown))
    finally:
        server.stop()
    return pictures


MARKS = {"/forces": "points", "/cones": "batched_positions", "/footprints": "batched_positions"}


def test_an_animation_shows_forces_and_footprints_where_the_page_does(walk):
    """No arrow is longer than the largest force; feet leave more prints, on the ground."""
    pictures = drawn(walk, frozenset({"shapes", "forces", "cones", "footprints"}))
    assert all(set(MARKS) == set(picture) for picture in pictures[1:])
    assert len(pictures[-1]["/footprints"]) > len(pictures[0]["/footprints"])
    state = State(walk.model, derive(walk.model), walk.request, last_run=walk)
    longest = marks.scale(state) * max(
        np.linalg.norm(force[:, 3:], axis=1).max() for force in walk.result.contact_force.values()
    )
    sizes = [np.linalg.norm(np.diff(p["/forces"], axis=1), axis=-1) for p in pictures[1:]]
    assert 0.1 * longest < max(size.max() for size in sizes) < 1.0001 * longest
    heights = np.concatenate([picture["/footprints"][:, 1] for picture in pictures])
    assert np.abs(heights).max() < 2e-3


def test_an_animation_of_a_page_that_shows_no_marks_has_none(walk):
    assert not any(drawn(walk, frozenset({"shapes"})))


def test_what_the_page_shows_goes_with_the_export(run):
    state = update(initial(run.model), Connected(1))
    state = update(update(state, Simulate(1)), Simulated(1, run.result))
    state = update(state, Show(1, "footprints", True))
    assert "footprints" in update(state, Export(1, "html")).exporting.shown


def test_only_a_finished_run_is_exported(run):
    state = update(initial(run.model), Connected(1))
    assert update(state, Export(1, "csv")) is state
    state = update(update(state, Simulate(1)), Simulated(1, run.result))
    assert update(state, Export(1, "csv")).exporting.what == "csv"


@pytest.mark.parametrize(
    ("what", "begins"), [("png", b"\x89PNG"), ("svg", b"<svg"), ("gif", b"GIF89a")]
)
def test_a_picture_is_of_the_time_that_is_shown(run, what, begins):
    asked = Exporting(1, what, run, time=0.1)
    suffix, content = view.made(asked)
    assert suffix == what
    assert content.startswith(begins)
    if what == "png":
        assert content != view.made(Exporting(1, what, run, time=0.0))[1]
