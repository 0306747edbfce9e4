"""Links on the page and in figures: the model goes with them."""

import json

import pytest

import pgraph_core as pg
from pgraph_core.live.export import page as page_of
from pgraph_core.simulation import simulate

from .conftest import opened, until
from .store import ME, after, begun, do, notice
from .test_figures import figure as figure

KEEP = "navigator.clipboard.writeText = async (text) => { window.kept = text; }"


@pytest.mark.quick
def test_a_link_is_opened_and_a_damaged_one_is_told():
    state, other = begun(pg.load("pendulum")), pg.load("four_bar")
    link = pg.link(other)
    assert after(state, do.OpenLink(ME, link)).model == other
    same = after(state, do.OpenLink(ME, link[:-20]))
    assert same.model == state.model
    assert "cut" in notice(same)


def test_the_page_copies_a_link_and_opens_one(page, served):
    model, other = pg.load("four_bar"), pg.load("pendulum")
    opened(page, served, model)
    page.evaluate(KEEP)
    page.evaluate("pgraph.send('ShareLink')")
    page.wait_for_function("window.kept")
    link = page.evaluate("window.kept")
    assert link.startswith(served.url.partition("?")[0])
    assert pg.load(link) == model
    page.evaluate("(hash) => { location.hash = hash; }", pg.link(other).partition("#")[2])
    until(lambda: served.store.state.model == other, "the model of the link")
    assert page.evaluate("location.hash") == ""


def test_a_figure_gives_its_model_as_a_file_and_as_a_link(figure):
    run = simulate(pg.load("pendulum"), t_end=0.2, estimate=False)
    shown = figure(page_of(run, live=False))
    shown.wait_for_selector("body[data-ready]")
    with shown.expect_download() as file:
        shown.click("#download")
    assert pg.Model.from_json(file.value.path().read_text()) == run.model
    shown.evaluate(KEEP)
    shown.click("#link")
    shown.wait_for_function("window.kept")
    assert pg.load(shown.evaluate("window.kept")) == run.model


def test_a_figure_of_a_body_with_a_mesh_keeps_its_path_to_itself(tmp_path):
    corners, faces = "v 0 0 0\nv 1 0 0\nv 0 1 0\nv 0 0 1\n", "f 1 3 2\nf 1 2 4\nf 1 4 3\nf 2 3 4\n"
    (tmp_path / "skull.obj").write_text(corners + faces)
    shape = pg.Shape(kind="mesh", file=str(tmp_path / "skull.obj"))
    model = pg.Model(bodies=[pg.Body(name="head", shape=shape)], gravity=(0, 0, 0))
    text = page_of(simulate(model, t_end=0.1, estimate=False), live=False)
    given = json.loads(text.split('id="figure">')[1].split("</script>")[0])
    assert given["link"] == ""
    assert str(tmp_path) not in text
