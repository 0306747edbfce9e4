"""Links that carry a model."""

import base64
import json
import zlib

import pytest

import pgraph_core as pg
import pgraph_models
from pgraph_app.cli.main import main
from pgraph_core.model.links import MOST, is_link

from .refusals import assert_names, refusal


def fragment(text: str) -> str:
    packed = zlib.compress(text.encode(), 9)
    return "#m=" + base64.urlsafe_b64encode(packed).decode().rstrip("=")


@pytest.mark.parametrize("name", pgraph_models.names())
def test_every_built_in_model_goes_through_a_link(name):
    model = pg.load(name)
    link = pg.link(model)
    assert pg.load(link) == model
    assert len(link) < 12_000
    assert link.isascii()
    assert link.startswith("http://localhost:8080/#m=")


def test_formulas_parameters_and_any_name_go_through_a_link():
    body = {"name": "Größe 🦿 #m= <b>", "axes": [(0, 1, 0)], "mass": "=2*m"}
    model = pg.Model(name="\\ud800 é", parameters={"m": 1.5}, bodies=[body])
    again = pg.load(pg.link(model, base="https://example.org/page"))
    assert again == model
    assert again.edit("m", 2.0).bodies[0].mass == 4.0


def test_a_cut_or_changed_link_is_refused_wherever_it_is_cut():
    link = pg.link(pg.load("pendulum"))
    start = link.index("#m=") + 3
    for end in range(start, len(link)):
        text = str(refusal(lambda end=end: pg.load(link[:end]), pg.FileError))
        assert_names(text, "link", "empty" if end == start else "cut")
    for k in range(start + 4, len(link), 7):
        other = "A" if link[k] != "A" else "B"
        changed = link[:k] + other + link[k + 1 :]
        assert refusal(lambda changed=changed: pg.load(changed), pg.PgraphError)
    for strange in ("%", " ", "\n", "é"):
        given = link[:-5] + strange + link[-5:]
        text = str(refusal(lambda given=given: pg.load(given), pg.FileError))
        assert_names(text, repr(strange), "copy the link again")
    assert pg.load(f"{link} \n") == pg.load("pendulum")


def test_refusals(tmp_path):
    bomb = fragment(" " * 50 * MOST)
    assert len(bomb) < 100_000
    assert_names(str(refusal(lambda: pg.load(bomb), pg.FileError)), "more than 1 MB")
    newer = json.dumps({"schema_version": 99, "bodies": []})
    assert_names(str(refusal(lambda: pg.load(fragment(newer)))), "99", "update Pgraph")
    assert_names(str(refusal(lambda: pg.load(fragment("[1]")))), "link", "JSON object")
    shape = {"kind": "mesh", "file": str(tmp_path / "secret.stl")}
    body = {"name": "a", "shape": shape, "density": 1.0, "derived": ["inertia"]}
    stolen = fragment(json.dumps({"bodies": [body]}))
    text = str(refusal(lambda: pg.load(stolen), pg.FileError))
    assert_names(text, "files of meshes")
    assert "secret" not in text  # it was not looked for
    model = pg.Model.serial(2)
    assert_names(str(refusal(lambda: pg.link(model, base="file.html"))), "base", "http://")
    assert_names(str(refusal(lambda: pg.link(model, base="http://a/#b"))), "base", "fragment")
    assert_names(str(refusal(lambda: pg.link("pendulum"))), "model", "pg.Model")
    heights = [[0.123456789 * (i * j) % 1.7 for i in range(300)] for j in range(300)]
    ground = pg.Shape(kind="heightfield", heights=heights, size=(1, 1, 1))
    large = pg.Model(bodies=[pg.Body(name="hill", joint="fixed", shape=ground)])
    assert_names(str(refusal(lambda: pg.link(large))), "1 MB", "save")


def test_bodies_with_meshes_are_named(tmp_path):
    (tmp_path / "tri.obj").write_text(
        "v 0 0 0\nv 1 0 0\nv 0 1 0\nv 0 0 1\nf 1 3 2\nf 1 2 4\nf 1 4 3\nf 2 3 4\n"
    )
    shape = pg.Shape(kind="mesh", file=str(tmp_path / "tri.obj"))
    model = pg.Model(bodies=[pg.Body(name="skull", shape=shape)])
    assert_names(str(refusal(lambda: pg.link(model))), "skull", "mesh")


def test_a_path_is_no_link():
    assert not any(map(is_link, ("a.json", "m=.json", "C:/a#m=b.json", None)))


def test_commands_print_and_take_links(capsys, tmp_path):
    assert main(["link", "pendulum"]) == 0
    link = capsys.readouterr().out.strip()
    assert link == pg.link(pg.load("pendulum"))
    assert main(["info", link, "--json"]) == 0
    assert json.loads(capsys.readouterr().out)["names"] == ["rod"]
    assert main(["convert", link, str(tmp_path / "a.json")]) == 0
    assert pg.load(tmp_path / "a.json") == pg.load("pendulum")
    capsys.readouterr()
    assert main(["run", link[:-9]]) == 1
    assert_names(capsys.readouterr().err, "link", "cut")
    assert main(["link", "quadruped"]) == 0
    assert_names(capsys.readouterr().err, "characters", "2000", "file")
