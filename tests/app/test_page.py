"""The page as a person meets it, in Debian's chromium."""

from __future__ import annotations

import json
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from pgraph_app.core.state import poses
from pgraph_app.model.update import NewModel, OpenBuiltIn
from pgraph_app.scene.view import viewpoint
from pgraph_app.server import Server
from pgraph_core.show import shapes

from .conftest import NOBODY, until

CTRL_Z, CTRL_SHIFT_Z = "Control+z", "Control+Shift+z"


def row(page: Any, name: str) -> Any:
    return page.locator(f'table.bodies tr[data-name="{name}"]')


def node(page: Any, name: str) -> Any:
    return page.locator(f'svg.digraph g.node[data-name="{name}"]')


def field(page: Any, name: str, k: int = 0) -> Any:
    return page.locator(f'[data-view=properties] [data-field="{name}"] .cell').nth(k)


def sentence(page: Any) -> str:
    """The sentence beside the refused cell."""
    page.wait_for_selector(".cell.refused")
    return page.locator(".sentence:visible").first.inner_text()


def selected_everywhere(page: Any, name: str) -> bool:
    """Table, digraph, Pgraph and properties all show `name` and nothing else as selected."""
    marks = page.evaluate("""() => [
      [...document.querySelectorAll('table.bodies tr.selected')].map((e) => e.dataset.name),
      [...document.querySelectorAll('svg.digraph g.node.selected')].map((e) => e.dataset.name),
      [...new Set([...document.querySelectorAll('.vectors .selected')].map((e) => e.dataset.name))],
      [document.querySelector('.properties .heading strong')?.textContent],
    ]""")
    return all(mark == [name] for mark in marks)


def drawn(page: Any, node: str) -> bool:
    """The 3D view has such a node."""
    return page.evaluate("(name) => name in window.__viserSceneTree.getState()", node)


def outlined(page: Any) -> bool:
    """The 3D view has the outline of a selected body."""
    return drawn(page, "/selected/outline")


def place(page: Any, node: str) -> list[float] | None:
    """Where the 3D view has a node [m]; None where it has none."""
    return page.evaluate(
        "(name) => window.__viserMutable.nodeRefFromName[name]?.position.toArray() ?? null", node
    )


def pixel(page: Any, served: Server, name: str) -> tuple[float, float]:
    """Where the middle of a body is on the page, through the page's own camera."""
    state = served.store.state
    client = max(served.viser.get_clients())
    camera = served.viser.get_clients()[client].camera
    k = state.derived.number[name] - 1
    positions, wxyz = poses(state)
    body = state.model.body(name)
    piece = shapes.pieces(body, [state.model.body(state.derived.names[c - 1]).link
                                 for c in state.derived.children[k + 1]])[0]  # fmt: skip
    world = positions[k] + shapes.to_matrix(wxyz[k]) @ np.asarray(piece.position)
    x, y, z = shapes.to_matrix(np.asarray(camera.wxyz)).T @ (world - camera.position)
    box = page.locator("canvas").first.bounding_box()
    scale = box["height"] / 2 / np.tan(camera.fov / 2)
    return box["x"] + box["width"] / 2 + scale * x / z, box["y"] + box["height"] / 2 + scale * y / z


# -- one selection -----------------------------------------------------------------------------


def test_click_a_row(page):
    row(page, "left_tibia").locator("td.number").click()
    until(lambda: selected_everywhere(page, "left_tibia"), "left_tibia selected everywhere")
    until(lambda: outlined(page), "its outline in 3D")


def test_click_a_node_of_the_digraph(page):
    node(page, "right_radius").locator("circle").last.click()
    until(lambda: selected_everywhere(page, "right_radius"), "right_radius selected everywhere")
    page.keyboard.press("Escape")
    until(lambda: not outlined(page), "no outline in 3D")


def test_click_an_entry_of_pgraph(page):
    page.locator('.vectors button.entry[data-name="thorax"]').click()
    until(lambda: selected_everywhere(page, "thorax"), "thorax selected everywhere")


def test_click_a_body_in_3d(page, served):
    until(lambda: place(page, "/bodies/8"), "the bodies in 3D")
    page.wait_for_timeout(800)  # the camera's last move arrives
    page.mouse.click(*pixel(page, served, "right_humerus"))
    until(lambda: selected_everywhere(page, "right_humerus"), "right_humerus selected everywhere")


def test_a_second_page_has_its_own_selection_and_sees_the_edit(page, open_page):
    other = open_page()
    other.wait_for_selector("#pgraph-loading", state="detached")
    assert not other.evaluate("window.uncovered")
    row(page, "thorax").locator("td.number").click()
    row(other, "lumbar").locator("td.number").click()
    until(lambda: selected_everywhere(page, "thorax"), "thorax on the first page")
    until(lambda: selected_everywhere(other, "lumbar"), "lumbar on the second")
    half_typed = field(other, "mass")
    half_typed.fill("12.")
    field(page, "mass").fill("9")
    page.keyboard.press("Enter")
    row(page, "pelvis").locator("input.name").fill("hips")
    page.keyboard.press("Enter")
    row(other, "hips").wait_for()
    assert half_typed.input_value() == "12."
    other.keyboard.press("Escape")
    other.close()


# -- edits -------------------------------------------------------------------------------------


def test_rename_follows_everywhere(page, served):
    cell = row(page, "lumbar").locator("input.name")
    cell.fill("loin")
    cell.press("Tab")
    until(lambda: selected_everywhere(page, "loin"), "loin selected everywhere")
    assert row(page, "thorax").locator("select").first.input_value() == "loin"
    assert served.store.state.model.body("thorax").parent == "loin"


def test_choose_another_parent(page, served):
    cell = row(page, "left_femur").locator("select").first
    cell.focus()
    offered = cell.locator("option").all_inner_texts()
    assert "ground" in offered
    assert not {"left_femur", "left_tibia", "left_hind_paw"} & set(offered)
    cell.select_option("thorax")
    until(lambda: served.store.state.model.body("left_femur").parent == "thorax", "the new parent")
    page.wait_for_function("() => pgraph.latest.digraph.separation.length === 3")


def test_type_a_mass(page, served):
    row(page, "thorax").locator("td.number").click()
    until(lambda: selected_everywhere(page, "thorax"), "thorax selected")
    field(page, "mass").fill("1e-6")
    field(page, "mass").press("Enter")
    until(lambda: served.store.state.model.body("thorax").mass == 1e-6, "a mass of 1e-6 kg")


def test_choose_the_degrees_of_freedom(page, served):
    cell = row(page, "lumbar").locator("select").nth(1)
    cell.focus()
    cell.select_option("3")
    until(lambda: served.store.state.model.body("lumbar").joint == "spherical", "a ball joint")
    until(lambda: "23 DoF" in page.locator(".count").first.inner_text(), "23 DoF")


def test_a_duplicate_name_is_refused_with_a_sentence(page, served):
    before = served.store.state.model
    cell = row(page, "lumbar").locator("input.name")
    cell.fill("thorax")
    cell.press("Enter")
    assert "thorax" in sentence(page)
    assert cell.input_value() == "thorax"
    assert served.store.state.model is before
    cell.press("Escape")
    assert cell.input_value() == "lumbar"
    until(lambda: page.locator(".sentence:visible").count() == 0, "no sentence any more")


def test_a_negative_mass_is_refused_with_a_sentence(page, served):
    row(page, "thorax").locator("td.number").click()
    until(lambda: selected_everywhere(page, "thorax"), "thorax selected")
    before = served.store.state.model
    field(page, "mass").fill("-2")
    field(page, "mass").press("Tab")
    assert "mass" in sentence(page)
    assert field(page, "mass").input_value() == "-2"
    assert served.store.state.model is before
    field(page, "mass").fill("2")
    field(page, "mass").press("Enter")
    until(lambda: served.store.state.model.body("thorax").mass == 2.0, "the corrected mass")
    until(lambda: page.locator(".refused").count() == 0, "no refused cell any more")


def test_a_name_is_text_and_never_markup(page):
    hostile = '<img src=x onerror="window.hacked=1">'
    cell = row(page, "lumbar").locator("input.name")
    cell.fill(hostile)
    cell.press("Tab")
    until(lambda: selected_everywhere(page, hostile), "the odd name")
    assert page.evaluate("window.hacked") is None
    assert page.locator(".pgraph img").count() == 0


def test_undo_and_redo_by_keys_and_buttons(page, served):
    row(page, "thorax").locator("td.number").click()
    until(lambda: selected_everywhere(page, "thorax"), "thorax selected")
    mass = served.store.state.model.body("thorax").mass
    field(page, "mass").fill("3.25")
    field(page, "mass").press("Enter")
    until(lambda: served.store.state.model.body("thorax").mass == 3.25, "the new mass")
    page.keyboard.press(CTRL_Z)
    until(lambda: served.store.state.model.body("thorax").mass == mass, "undone by key")
    page.keyboard.press(CTRL_SHIFT_Z)
    until(lambda: served.store.state.model.body("thorax").mass == 3.25, "redone by key")
    undo = page.locator("button.undo")
    until(lambda: "mass of thorax" in (undo.get_attribute("title") or ""), "what undo would undo")
    page.locator("button.undo").click()
    until(lambda: served.store.state.model.body("thorax").mass == mass, "undone by button")
    page.locator("button.redo").click()
    until(lambda: field(page, "mass").input_value() == "3.25", "redone by button")


def test_add_and_delete_bodies(page, served):
    row(page, "left_hind_paw").locator("td.number").click()
    until(lambda: selected_everywhere(page, "left_hind_paw"), "the paw selected")
    page.locator("button.add").click()
    until(lambda: selected_everywhere(page, "17"), "the new body selected")
    assert served.store.state.model.body("17").parent == "left_hind_paw"
    row(page, "left_femur").locator("td.number").click()
    until(lambda: selected_everywhere(page, "left_femur"), "the femur selected")
    page.locator("button.delete").click()
    page.get_by_text("delete its whole branch").click()
    until(lambda: len(served.store.state.model.bodies) == 13, "the branch gone")
    row(page, "right_femur").locator("td.number").click()
    until(lambda: selected_everywhere(page, "right_femur"), "the other femur selected")
    page.locator("button.delete").click()
    page.get_by_text("attach its child to pelvis").click()
    until(lambda: len(served.store.state.model.bodies) == 12, "the femur gone")
    assert served.store.state.model.body("right_tibia").parent == "pelvis"


# -- models ------------------------------------------------------------------------------------


def test_new_asks_one_question(page, served):
    page.locator("button.new").click()
    answer = page.get_by_label("How many bodies?")
    answer.fill("0")
    answer.press("Enter")
    assert "from 1 to 1000" in sentence(page)
    answer.fill("5")
    answer.press("Enter")
    row(page, "5").wait_for()
    assert page.locator("table.bodies tr[data-name]").count() == 5
    assert page.locator("svg.digraph g.node").count() == 5
    until(lambda: drawn(page, "/bodies/5"), "five bodies in 3D")
    until(lambda: not drawn(page, "/bodies/6"), "no sixth")
    page.locator("button.undo").click()
    row(page, "pelvis").wait_for()


def test_a_new_model_is_seen_whole(page, served):
    """Also where `up` changes, at which viser goes back to its own camera."""
    page.get_by_role("button", name="New").click()
    page.get_by_label("How many bodies?").fill("5")
    page.get_by_label("How many bodies?").press("Enter")
    until(lambda: served.store.state.model.up == "z", "the new model")

    def framed() -> bool:
        state = served.store.state
        client = max(served.viser.get_clients())  # the page that came last
        aspect = state.clients[client].aspect
        if aspect is None:
            return False
        place, _ = viewpoint(state, aspect)
        camera = served.viser.get_clients()[client].camera
        return bool(np.allclose(camera.position, place, atol=1e-3))

    until(framed, "the camera on the new model")


def test_a_large_model_is_batched_and_in_lanes(page, served):
    page.locator("button.new").click()
    page.get_by_label("How many bodies?").fill("120")
    page.get_by_label("How many bodies?").press("Enter")
    row(page, "120").wait_for()
    until(lambda: drawn(page, "/bodies/capsule"), "one node for all bodies")
    assert not drawn(page, "/bodies/1")
    assert page.evaluate("pgraph.latest.digraph.kind") == "lanes"
    page.wait_for_timeout(800)  # the camera's last move arrives
    page.mouse.click(*pixel(page, served, "60"))
    until(lambda: page.evaluate("pgraph.latest.selection"), "a body of the batch selected")
    assert abs(int(page.evaluate("pgraph.latest.selection")) - 60) <= 1  # its neighbours overlap


def test_open_a_built_in_model(page):
    page.locator("button.open").click()
    page.locator('.gallery [data-model="fig1_tree"]').click()
    until(lambda: page.locator("table.bodies tr[data-name]").count() == 7, "seven bodies")
    vector = page.locator(".vectors button.entry span:first-child")
    pgraph = [str(k) for k in (1, 2, 3, 4, 2, 5, 2, 6, 7)]
    until(lambda: vector.all_inner_texts() == pgraph, "its Pgraph")


@pytest.mark.parametrize("which", ["new", "open", "save"])
def test_escape_closes_a_question_right_away(page, which):
    """The one of Open has no text to type: Escape was not heard there."""
    for _ in range(2):
        page.locator(f"button.{which}").click()
        page.locator(".asked:not(:empty)").wait_for()
        page.keyboard.press("Escape")
        until(lambda: page.locator(".asked:not(:empty)").count() == 0, "no question")


def test_open_a_file_and_a_bad_one(page, tmp_path: Path, quadruped):
    good, bad = tmp_path / "good.json", tmp_path / "bad.json"
    good.write_text(quadruped.remove("left_femur", children="delete").to_json())
    bad.write_text('{"bodies": 3')
    for file, shown in ((bad, "bad.json was not opened"), (good, "Opened")):
        page.locator("button.open").click()
        page.locator('.ask input[type="file"]').set_input_files(file)
        page.get_by_text(shown).first.wait_for()
        if file is bad:
            page.locator("button.open").click()
            if page.locator(".gallery").count():
                page.locator("button.open").click()
    until(lambda: page.locator("table.bodies tr[data-name]").count() == 13, "thirteen bodies")


def test_save_to_a_path_and_download(page, tmp_path: Path, quadruped):
    page.locator("button.save").click()
    path = page.get_by_label("or in the folder in which Pgraph was started, as")
    path.fill(str(tmp_path / "no such folder" / "mine.json"))
    path.press("Enter")
    assert "no such folder" in sentence(page)
    path.fill(str(tmp_path / "mine.json"))
    path.press("Enter")
    until(lambda: (tmp_path / "mine.json").exists(), "the file")
    assert type(quadruped).load(tmp_path / "mine.json") == quadruped
    page.locator("button.save").click()
    with page.expect_download() as download:
        page.locator("button.download").click()
    assert json.loads(Path(download.value.path()).read_text()) == json.loads(quadruped.to_json())


def test_a_model_that_nobody_named_is_asked_for_a_name_when_it_is_saved(page, served):
    page.locator("button.save").click()
    assert page.get_by_label("name of the model").count() == 0  # the quadruped has one
    page.keyboard.press("Escape")
    served.send(NewModel(NOBODY, 0, "3"))
    page.wait_for_function("() => pgraph.latest.toolbar.unnamed")
    page.locator("button.save").click()
    name = page.get_by_label("name of the model")
    assert name.input_value() == "serial 3"
    name.fill("moon rover")
    with page.expect_download() as download:
        page.locator("button.download").first.click()
    assert download.value.suggested_filename == "moon_rover.json"
    assert served.store.state.model.name == "moon rover"


# -- simulate and play -------------------------------------------------------------------------


@pytest.fixture
def simulated(page, served):
    """The page after a second of the quadruped's free fall."""
    until(lambda: served.store.state.kernels.ready, "compiled kernels", seconds=300)
    page.locator('.run [aria-label="scenario"]').focus()
    page.locator('.run [aria-label="scenario"]').select_option("")
    duration = page.get_by_label("duration", exact=True)
    until(lambda: duration.input_value() == "2", "a free run's settings")
    duration.fill("1")
    duration.press("Enter")
    until(lambda: served.store.state.request.t_end == 1.0, "a duration of 1 s")
    page.locator("button.simulate").click()
    page.locator(".summary dd").first.wait_for(timeout=120_000)
    return page


def test_simulate_play_and_see_the_body_move(simulated, served):
    page = simulated
    summary = page.locator(".summary").inner_text()
    assert "Energy drift" in summary
    assert "Cost" not in summary  # but unfolded
    page.locator(".summary .more > summary").click()
    assert "Cost" in page.locator(".summary").inner_text()
    start = place(page, "/bodies/1")
    page.locator("button.play").click()
    until(lambda: place(page, "/bodies/1") != start, "the pelvis to move")
    page.locator("button.play").click()
    until(lambda: not served.store.state.playback.playing, "a pause")
    assert page.locator("output.time").inner_text().endswith("/ 1.000 s")


def test_scrub_step_speed_and_loop(simulated, served):
    page = simulated
    page.locator("input.scrub").evaluate(
        "(e) => { e.value = 0.5; e.dispatchEvent(new Event('input')); }"
    )
    until(lambda: served.store.state.playback.time == 0.5, "the middle")
    middle = place(page, "/bodies/1")
    page.locator("button.more").click()
    until(lambda: served.store.state.playback.time > 0.5, "one frame on")
    page.locator("button.back").click()
    until(lambda: served.store.state.playback.time == 0.0, "the start")
    until(lambda: place(page, "/bodies/1") != middle, "another pose")
    page.locator("select.speed").select_option("0.25")
    page.locator("button.loop").click()
    until(lambda: not served.store.state.playback.loop, "no repeating")
    assert served.store.state.playback.speed == 0.25
    page.locator("button.loop").click()
    page.locator("select.speed").select_option("1")


def test_an_edit_hides_the_run_and_undo_brings_it_back(simulated):
    page = simulated
    row(page, "thorax").locator("td.number").click()
    until(lambda: selected_everywhere(page, "thorax"), "thorax selected")
    field(page, "mass").fill("7")
    field(page, "mass").press("Enter")
    until(lambda: page.locator("button.play").is_disabled(), "nothing to play")
    page.locator("button.undo").click()
    until(lambda: page.locator("button.play").is_enabled(), "the run again")


def test_cancel_a_long_run(page, served):
    until(lambda: served.store.state.kernels.ready, "compiled kernels", seconds=300)
    served.send(OpenBuiltIn(NOBODY, "chain_10"))
    page.wait_for_function("() => pgraph.latest.table.rows.length === 10")
    for label, text in (("duration", "3600"), ("step", "0.0001")):
        page.get_by_label(label, exact=True).fill(text)
        page.get_by_label(label, exact=True).press("Enter")
    until(lambda: served.store.state.request.step == 1e-4, "a long run's settings")
    page.locator("button.simulate").click()
    until(lambda: served.store.state.job, "the run under way")
    page.locator("button.cancel").click()
    until(lambda: served.store.state.job is None, "the run cancelled")
    page.get_by_text("The simulation was cancelled.").wait_for()
    until(lambda: not running(), "the run's thread to end", seconds=5)
    page.locator("button.simulate").wait_for()


def running() -> bool:
    import threading

    return any(thread.name == "pgraph-run" for thread in threading.enumerate())


# -- looks -------------------------------------------------------------------------------------


def test_dark_and_light_are_legible(page):
    page.locator("button.theme").click()
    page.wait_for_selector('[data-mantine-color-scheme="dark"]')
    assert contrast(page) > 4.5
    page.locator("button.theme").click()
    page.wait_for_selector('[data-mantine-color-scheme="light"]')
    assert contrast(page) > 4.5


def contrast(page: Any) -> float:
    """WCAG contrast of the table's text against what is behind it."""
    ink, paper = page.evaluate("""() => {
      const numbers = (color) => color.match(/[\\d.]+/g).map(Number);
      let el = document.querySelector('table.bodies td');
      const ink = numbers(getComputedStyle(el).color);
      while (el) {
        const back = numbers(getComputedStyle(el).backgroundColor);
        if (back.length === 3 || back[3] > 0.5) return [ink, back];
        el = el.parentElement;
      }
      return [ink, [255, 255, 255]];
    }""")

    def light(rgb: list[float]) -> float:
        parts = [c / 3294.6 if c <= 10 else ((c / 255 + 0.055) / 1.055) ** 2.4 for c in rgb[:3]]
        return 0.2126 * parts[0] + 0.7152 * parts[1] + 0.0722 * parts[2]

    high, low = sorted((light(ink), light(paper)), reverse=True)
    return (high + 0.05) / (low + 0.05)


def test_nothing_is_cut_off(page):
    row(page, "left_humerus").locator("td.number").click()
    until(lambda: selected_everywhere(page, "left_humerus"), "left_humerus selected")
    cut = page.evaluate("""() => [...document.querySelectorAll('[data-view=properties] input')]
      .filter((e) => e.scrollWidth > e.clientWidth + 1).map((e) => e.value)""")
    assert cut == []
    assert page.evaluate("document.documentElement.scrollWidth <= innerWidth")


def test_show_switches_draw_and_clear(page):
    page.get_by_role("tab", name="Show").click()
    for what in ("names", "links", "coms"):
        box = page.locator(f'[data-what="{what}"]')
        box.check()
        node = f"/bodies/2/{what}"
        until(lambda node=node: drawn(page, node), f"{what} in 3D")
        box.uncheck()
        until(lambda node=node: not drawn(page, node), f"no {what} in 3D")


def test_a_page_that_lost_its_connection_keeps_its_selection(page, served):
    row(page, "thorax").locator("td.number").click()
    until(lambda: selected_everywhere(page, "thorax"), "thorax selected")
    before = set(served.store.state.clients)
    served.viser._websock_server.disconnect_all_clients()
    until(lambda: set(served.store.state.clients) - before, "the page to come back")
    until(lambda: [c.selection for c in served.store.state.clients.values()] == ["thorax"],
          "its selection")  # fmt: skip
    until(lambda: all(c.aspect for c in served.store.state.clients.values()), "its view's shape")
    row(page, "thorax").locator("td.number").wait_for()
