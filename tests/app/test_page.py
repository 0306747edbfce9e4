"""A first look at the page: one selection everywhere, files in and out, keys, menus, questions."""

import base64
import json
from pathlib import Path
from typing import Any

import pytest

import pgraph_core as pg
from pgraph_app.model import NewModel
from pgraph_app.run import SetScenario
from pgraph_core.formats import SAVED

from .conftest import NOBODY, opened, until
from .on_page import (
    ask,
    at_rest,
    choose_body,
    client_of,
    cut_off,
    drawn,
    drop,
    field,
    middle_of,
    name_cell,
    names,
    node,
    notice,
    on_screen,
    refused,
    row,
    row_cell,
    selected_everywhere,
    selections,
    typed,
    within,
)
from .store import zipped

ARM = """<robot name="arm"><link name="base"/><link name="upper"/><link name="lower"/>
<joint name="turn" type="revolute"><parent link="base"/><child link="upper"/><axis xyz="0 2 0"/>
<limit lower="-1" upper="2" effort="30" velocity="4"/></joint>
<joint name="slide" type="prismatic"><parent link="upper"/><child link="lower"/></joint></robot>"""

ENDLESS = """<mujoco><compiler><lengthrange mode="all" inttotal="1e9"/></compiler><worldbody>
<body><joint name="x" axis="0 1 0"/><geom size=".1" mass="1"/></body></worldbody>
<actuator><muscle name="m" joint="x"/></actuator></mujoco>"""


def no_question(page: Any) -> None:
    page.wait_for_function("!document.querySelector('dialog:modal')")


def test_one_selection_is_shown_by_table_digraph_pgraph_properties_and_3d(page, served):
    row(page, "shank").locator("td.number").click()
    selected_everywhere(page, "shank")
    drawn(page, "/selected/0/fill")
    node(page, "arm").locator("circle").last.click()
    selected_everywhere(page, "arm")
    page.keyboard.press("Escape")
    drawn(page, "/selected/0/fill", there=False)
    page.locator('.vectors .entry[data-name="thigh"]').first.click()
    selected_everywhere(page, "thigh")
    until(lambda: within(page, served), "the model in the 3D view")
    at_rest(page)
    page.mouse.click(*on_screen(page, middle_of(served, "shank")))
    selected_everywhere(page, "shank")
    page.keyboard.press("Delete")
    row(page, "shank").wait_for(state="detached")
    page.keyboard.press("Control+z")
    until(lambda: "shank" in served.store.state.derived.names, "the body back")
    row(page, "shank").locator("td.number").click()
    selected_everywhere(page, "shank")
    cell = name_cell(page, "thigh")
    typed(cell, "femur", "Tab")
    selected_everywhere(page, "femur")
    assert row_cell(page, "shank", "parent").input_value() == "femur"
    assert served.store.state.model.body("shank").parent == "femur"


def test_a_second_page_has_its_own_selection_and_sees_the_edits(page, open_page, served, request):
    other = open_page()
    request.addfinalizer(other.close)
    assert not other.evaluate("window.uncovered")
    row(page, "thigh").locator("td.number").click()
    row(other, "shank").locator("td.number").click()
    selected_everywhere(page, "thigh")
    selected_everywhere(other, "shank")
    row(page, "shank").locator(".others i").wait_for()  # where the other is
    half_typed = field(other, "mass")
    half_typed.fill("12.")
    typed(field(page, "mass"), "9")
    typed(name_cell(page, "trunk"), "hips")
    row(other, "hips").wait_for()
    assert half_typed.input_value() == "12."
    other.keyboard.press("Escape")
    other.close()
    page.wait_for_function("!document.querySelector('.others i')")


def test_models_are_made_opened_and_saved(page, served, tmp_path: Path, leg):
    for which in ("new", "open", "save"):  # Escape closes a question
        ask(page, which)
        page.keyboard.press("Escape")
        no_question(page)
    page.evaluate("pgraph.front('Connections')")  # the new bodies come to the front
    ask(page, "new")
    answer = page.locator(".asked[data-asked=newQuestion] input[type=text]").first
    for text in ("0", "x", ""):
        typed(answer, text)
        page.locator(".sentence:visible").filter(has_text=text).first.wait_for()
    typed(answer, "5")
    row(page, "5").wait_for()
    assert page.locator("table.bodies tr[data-name]").count() == 5
    assert page.locator("svg.digraph g.node").count() == 5
    drawn(page, "/bodies/5")
    drawn(page, "/bodies/6", there=False)
    until(lambda: within(page, served), "the new model in the 3D view")
    page.locator("button.undo").click()
    row(page, "trunk").wait_for()

    ask(page, "open")
    page.locator('.gallery [data-model="fig1_tree"]').click()
    page.wait_for_function("pgraph.latest.table.rows.length === 7")
    vector = page.locator(".vectors .entry span:first-child")
    until(lambda: vector.all_inner_texts() == [*"123524267"], "its Pgraph")

    good, bad = tmp_path / "good.json", tmp_path / "bad.json"
    good.write_text(leg.to_json())
    bad.write_text('{"bodies": 3')
    ask(page, "open")
    page.locator('.ask input[type="file"]').set_input_files(bad)
    notice(page, "bad.json")
    assert len(names(served)) == 7
    ask(page, "open")
    page.locator('.ask input[type="file"]').set_input_files(good)
    row(page, "shank").wait_for()

    ask(page, "save")
    assert page.get_by_label("name of the model").count() == 0  # it has one
    path = page.locator(".asked input[type=text]").last
    typed(path, str(tmp_path / "no such folder" / "mine.json"))
    refused(page, "no such folder")
    typed(path, str(tmp_path / "mine.json"))
    until(lambda: (tmp_path / "mine.json").exists(), "the file")
    until(lambda: pg.Model.load(tmp_path / "mine.json") == leg, "all of it")
    no_question(page)
    ask(page, "save")
    with page.expect_download() as download:
        page.locator("button.download").first.click()
    assert json.loads(Path(download.value.path()).read_text()) == json.loads(leg.to_json())
    served.send(NewModel(NOBODY, 0, "3"))
    page.wait_for_function("() => pgraph.latest.toolbar.unnamed")
    page.keyboard.press("Escape")
    no_question(page)
    ask(page, "save")
    name = page.get_by_label("name of the model")
    assert name.input_value() == "serial 3"
    name.fill("moon rover")
    with page.expect_download() as download:
        page.locator("button.download").first.click()
    assert download.value.suggested_filename == "moon_rover.json"
    assert served.store.state.model.name == "moon rover"
    page.keyboard.press("Escape")


def test_a_model_is_downloaded_in_each_format_that_is_written(page, served):
    """By the question of saving, and listed in the menu of exports."""
    assert page.evaluate("() => pgraph.latest.toolbar.formats.map((f) => f[0])") == [*SAVED]
    for suffix, name in SAVED.items():
        ask(page, "save")
        with page.expect_download() as download:
            page.get_by_role("button", name=name, exact=True).click()
        assert download.value.suggested_filename.endswith(suffix)
        page.get_by_role("dialog", name="report of the file").wait_for()
        page.get_by_role("button", name="Close").click()
        no_question(page)


def test_files_are_dropped_on_the_page(page, served, tmp_path, monkeypatch):
    monkeypatch.setenv("XDG_DATA_HOME", str(tmp_path))
    before = served.store.state.model
    for name, content, parts in (
        ("bad.json", "['{\"bodies\": 3']", ["bad.json"]),
        ("noise.json", "[new Uint8Array([255, 0, 254])]", ["noise.json"]),
        ("big.json", "[new Uint8Array(9e6)]", ["9.0 MB", "8 MB"]),
        ("part.stl", "['solid broken']", ["select"]),
    ):
        drop(page, name, content)
        notice(page, *parts)
    row(page, "thigh").locator("td.number").click()
    page.wait_for_function("() => pgraph.latest.selected[0] === 'thigh'")
    drop(page, "huge.stl", "[new Uint8Array(11e6)]")
    notice(page, "11.0 MB", "10 MB")
    drop(page, "part.stl", "['solid broken']")
    notice(page, "part.stl")
    assert served.store.state.model is before
    corners = ((0, 0, 0), (0.1, 0, 0), (0, 0.1, 0), (0, 0, 0.1))
    faces = ("3 0 2 1", "3 0 1 3", "3 0 3 2", "3 1 2 3")
    lines = ["OFF", "4 4 6", *(" ".join(map(str, c)) for c in corners), *faces]
    drop(page, "part.off", f"[{chr(10).join(lines)!r}]")
    until(lambda: served.store.state.model.body("thigh").shape is not None, "a shape")
    assert served.store.state.model.body("thigh").shape.kind == "mesh"
    drop(page, "two.json", """['{"name": "two", "bodies": [{"name": "a"}, {"name": "b"}]}']""")
    row(page, "b").wait_for()
    assert names(served) == ["a", "b"]

    drop(page, "arm.urdf", f"[{ARM!r}]")  # its report's lines lead to bodies
    sheet = page.get_by_role("dialog", name="report of the file")
    sheet.wait_for()
    assert names(served) == ["base", "upper", "lower"]
    sheet.get_by_role("button").filter(has_text="'slide'").click()
    until(lambda: "lower" in selections(served), "the body is selected")
    sheet.get_by_role("button", name="Close").click()
    assert not sheet.count()
    page.keyboard.press("Control+z")
    row(page, "b").wait_for()


@pytest.mark.nightly
def test_a_reading_is_cancelled_and_a_model_of_an_archive_is_chosen(
    page, served, tmp_path, monkeypatch
):
    monkeypatch.setenv("XDG_DATA_HOME", str(tmp_path))
    before = served.store.state.model
    drop(page, "endless.xml", f"[{ENDLESS!r}]")
    page.get_by_text("Reading endless.xml").wait_for()
    page.locator(".reading").get_by_role("button", name="Cancel").click()
    notice(page, "endless.xml", "cancelled")
    until(lambda: not page.locator(".reading").is_visible(), "nothing is read")
    assert served.store.state.model is before

    robots = [(f"{name}/{name}.urdf", ARM.replace("upper", name).encode()) for name in ("a", "z")]
    content = base64.b64encode(zipped(*robots)).decode()
    drop(page, "two.zip", f"[Uint8Array.from(atob('{content}'), (c) => c.charCodeAt(0))]")
    sheet = page.locator("dialog.pgraph-members")
    sheet.get_by_role("button", name="z/z.urdf").click()
    row(page, "z").wait_for()
    assert not sheet.count()
    page.get_by_role("dialog", name="report of the file").get_by_role(
        "button", name="Close"
    ).click()
    page.keyboard.press("Control+z")
    row(page, "thigh").wait_for()


def test_keys_palette_and_menus_lead_everywhere(page, served):
    page.keyboard.press("?")
    sheet = page.get_by_role("dialog", name="keyboard shortcuts")
    sheet.wait_for()
    page.keyboard.press("Escape")
    until(lambda: sheet.count() == 0, "the sheet closed")
    for words, sign in (
        ("Show plots", '[role="tab"][title="Plots"][aria-selected="true"]'),
        ("Stability map", '[role="tab"][title="Accuracy"][aria-selected="true"]'),
        ("thigh", 'tr.selected[data-name="thigh"]'),
        ("New model", 'dialog[data-asked="newQuestion"]'),
    ):
        name_cell(page, "trunk").click()  # from a field, too
        page.keyboard.press("Control+k")
        box = page.get_by_label("search bodies and commands")
        box.fill(words)
        page.locator("[role=option]").filter(has_text=words).first.wait_for()
        page.keyboard.press("Enter")
        page.locator(sign).first.wait_for()
        box.wait_for(state="detached")
    page.keyboard.press("Escape")
    no_question(page)
    page.evaluate("pgraph.frame.drawer(false)")

    row(page, "shank").locator("td.number").click(button="right")
    menu = page.get_by_role("menu")
    menu.get_by_role("menuitem", name="Add a body on it").click()
    until(lambda: len(names(served)) == 5, "a body more")
    assert served.store.state.model.bodies[-1].parent == "shank"
    page.keyboard.press("Control+z")
    until(lambda: len(names(served)) == 4, "undone")
    node(page, "thigh").locator("circle").last.click(button="right")
    menu.wait_for()
    page.keyboard.press("Escape")
    until(lambda: menu.count() == 0, "no menu")
    until(lambda: within(page, served), "the model in the 3D view")
    at_rest(page)
    page.mouse.click(*on_screen(page, middle_of(served, "arm")), button="right")
    menu.wait_for()
    page.keyboard.press("Escape")
    cut_off(page, served)
    page.wait_for_function("pgraph.latest?.properties")
    assert menu.count() == 0  # is not asked for again
    seen = set()
    for _ in range(6):
        page.keyboard.press("F6")
        seen.add(
            page.evaluate("document.activeElement.closest('[data-view]')?.dataset.view ?? 'view'")
        )
    assert len(seen) == 6, seen


FINISH = """([topic, hidden, problem]) => {
  Object.defineProperty(document, "hidden", { configurable: true, get: () => hidden });
  const before = pgraph.latest[topic], job = { text: "50 %", fraction: 0.5 };
  pgraph.receive(topic, { ...before, job });
  pgraph.receive(topic, { ...before, job: null, problem });
  const told = document.title;
  delete document.hidden;
  document.dispatchEvent(new Event("visibilitychange"));
  pgraph.receive(topic, before);
  return [told, document.title];
}"""


@pytest.mark.parametrize("topic", ["run", "reports"])
def test_work_that_ends_behind_another_window_is_told_in_the_title(page, topic):
    plain = "leg – Pgraph"
    page.wait_for_function("pgraph.latest.toolbar.name === 'leg'")
    for problem, mark in (("", "✓"), ("It failed.", "✗")):
        told, after = page.evaluate(FINISH, [topic, True, problem])
        assert told.startswith(f"{mark} {problem}")
        assert told.endswith(f" – {plain}")
        assert after == plain
    assert page.evaluate(FINISH, [topic, False, ""]) == [plain, plain]  # before one's eyes


def test_nothing_of_the_model_before_is_left_on_the_page(page, served):
    """Hidden parts are empty too, and half-typed text does not enter a body of the same name."""
    zebra = pg.Force(name="zebra", kind="servo", body="2", kp=1.0)
    own = pg.Scenario(
        name="zebra run", t_end=1.0, forces=(zebra.model_copy(update={"name": "zebra drive"}),),
        switches=(pg.Switch(constraint="zebra tie", t=0.5, active=False),),
    )  # fmt: skip
    tie = pg.Constraint(name="zebra tie", kind="point", body="3")
    model = pg.Model.serial(3).replace(forces=(zebra,), constraints=(tie,), scenarios=(own,))
    opened(page, served, model)
    served.send(SetScenario(client_of(served), 1, "zebra run"))
    page.get_by_role("tab", name="Scenarios").click()
    page.wait_for_function(
        "document.querySelectorAll('.drives .tie').length === 1"
        " && document.querySelectorAll('.switch').length === 1"
    )
    page.evaluate("pgraph.front('Matrices')")
    value = page.locator('[data-view="operators"] .value')
    until(lambda: "3 × 3" in value.inner_text(), "the mass matrix of three bodies")
    choose_body(page, "2")
    page.wait_for_function("() => pgraph.latest.properties.bodies[0] === '2'")
    field(page, "mass").focus()
    page.keyboard.type("7.5")
    opened(page, served, pg.Model.serial(4))
    until(lambda: "4 × 4" in value.inner_text(), "the one of four")
    assert served.store.state.model.body("2").mass == model.body("2").mass
    notice(page, "7.5")
    left = """() => [...document.querySelectorAll('[data-view]')]
      .filter((host) => host.textContent.includes('zebra')).map((host) => host.dataset.view)"""
    assert page.evaluate(left) == []
