"""The table as a spreadsheet: keys, focus, drag, clipboard, and what is typed ahead."""

from typing import Any

import pytest

import pgraph_core as pg
import pgraph_models
from pgraph_app.model import NewModel, Undo
from pgraph_app.server import Server

from .conftest import NOBODY, held, opened, settled, until
from .on_page import (
    ask,
    choose_body,
    chosen,
    copied,
    field,
    focused,
    name_cell,
    names,
    nothing_refused,
    notice,
    paste,
    refused,
    row,
    row_cell,
    rows_selected,
    typed,
)


@pytest.fixture
def chain(page: Any, served: Server) -> Any:
    """The page on five bodies in a row."""
    return opened(page, served, pg.Model.serial(5))


def test_keys_move_and_type_as_in_a_spreadsheet(chain: Any, served: Server):
    page = chain
    name_cell(page, "2").focus()
    for key, place in (
        ("ArrowDown", ["3", "name"]), ("ArrowRight", ["3", "parent"]), ("ArrowUp", ["2", "parent"]),
        ("Tab", ["2", "DoF"]), ("End", ["2", "holonomic"]), ("Home", ["2", "name"]),
        ("Control+ArrowDown", ["5", "name"]), ("Control+Home", ["1", "name"]),
        ("Enter", ["2", "name"]), ("Shift+Enter", ["1", "name"]), ("PageDown", ["5", "name"]),
    ):  # fmt: skip
        page.keyboard.press(key)
        assert focused(page) == place, key
    rows_selected(page, "5")
    page.keyboard.type("toe")  # replaces what is there
    page.keyboard.press("ArrowLeft")  # within the text now
    page.keyboard.type("_")
    page.keyboard.press("Shift+Enter")
    until(lambda: names(served)[-1] == "to_e", "the typed name")
    until(lambda: focused(page) == ["4", "name"], "the row above, once it was taken")
    page.keyboard.press("F2")
    page.keyboard.type("th")
    page.keyboard.press("Escape")
    assert name_cell(page, "4").input_value() == "4"
    assert served.store.state.model.body("4").name == "4"

    # drop-downs offer what is possible
    parent = row_cell(page, "3", "parent")
    parent.focus()
    offered = parent.locator("option").all_inner_texts()
    assert set(offered) == {"ground", "1", "2"}
    chosen(parent, "1")
    until(lambda: served.store.state.model.body("3").parent == "1", "the new parent")
    page.wait_for_function("() => pgraph.latest.digraph.separation.length === 1")
    joint = row_cell(page, "3", "DoF")
    joint.focus()
    chosen(joint, "3")
    until(lambda: served.store.state.model.body("3").joint == "spherical", "a ball joint")
    page.wait_for_function("document.querySelector('.count').textContent.includes('7 DoF')")


def test_what_is_typed_before_the_server_answers_goes_where_it_belongs(chain: Any, served: Server):
    page = chain
    name_cell(page, "1").focus()
    page.keyboard.press("F2")
    with held(served):
        page.keyboard.press("Control+a")
        for name in ("crank", "coupler", "rocker"):
            page.keyboard.type(name)
            page.keyboard.press("Enter")
        assert focused(page) == ["4", "name"]
        page.keyboard.press("Shift+Enter")
        page.keyboard.press("ArrowRight")
        page.keyboard.press("ArrowRight")
        chosen(row_cell(page, "3", "DoF"), "3")  # by its name until then
        page.keyboard.press("Escape")
        name_cell(page, "5").focus()
        page.keyboard.type("toe")
        page.keyboard.press("Enter")
        page.keyboard.type("foot")  # the last row: typed anew
        page.keyboard.press("Tab")
    until(lambda: names(served) == ["crank", "coupler", "rocker", "4", "foot"], "all the names")
    model = served.store.state.model
    assert [model.body(name).parent for name in names(served)[1:]] == names(served)[:-1]
    until(lambda: served.store.state.model.body("rocker").joint == "spherical", "its joint")
    nothing_refused(page)
    shown = page.locator("tr td:nth-child(2)").evaluate_all(
        "(all) => all.map((one) => one.querySelector('input')?.value ?? one.textContent)"
    )
    assert shown == names(served)


def test_a_refusal_stands_beside_its_cell_and_keeps_the_text(chain: Any, served: Server):
    page, before = chain, served.store.state.model
    name_cell(page, "1").focus()
    page.keyboard.type("2")
    page.keyboard.press("Enter")
    assert focused(page) == ["1", "name"]  # the page itself knows that name
    refused(page, "'2'", "row 2")
    with held(served):
        page.keyboard.type("x" * 101)
        page.keyboard.press("Enter")
        page.keyboard.type("two")
    refused(page, "100")
    assert focused(page) == ["2", "name"]
    page.keyboard.press("Enter")
    until(lambda: names(served)[:2] == ["1", "two"], "the second name")
    assert name_cell(page, "1").input_value() == "2" + "x" * 101
    name_cell(page, "1").press("Escape")
    cell = name_cell(page, "3")
    for text, part in (("x" * 10_000, "100"), ("\u202e", "control"), (" ", "empty"), ("4", "'4'")):
        typed(cell, text)
        refused(page, part)
        assert cell.input_value() == text
        cell.press("Escape")
        assert cell.input_value() == "3"
        page.wait_for_function("!document.querySelector('.bodies .sentence')")
    page.keyboard.press("Control+z")
    until(lambda: served.store.state.model is before, "the only edit undone")

    hostile = '<img src=x onerror="window.hacked=1">'
    typed(cell, hostile, "Tab")
    until(lambda: names(served)[2] == hostile, "the odd name")
    settled(page, served)
    assert row_cell(page, "4", "parent").input_value() == hostile
    assert page.evaluate("window.hacked") is None
    assert page.locator(".pgraph img").count() == 0


def test_rows_are_selected_moved_dragged_and_deleted(chain: Any, served: Server):
    page = chain
    row(page, "2").locator("td.number").click()
    row(page, "4").locator("td.number").click(modifiers=["Shift"])
    rows_selected(page, "2", "3", "4")
    row(page, "3").locator("td.number").click(modifiers=["Control"])
    rows_selected(page, "2", "4")
    page.keyboard.press("Alt+ArrowUp")
    until(lambda: names(served) == ["2", "4", "1", "3", "5"], "both above the first")
    page.keyboard.press("Delete")
    page.locator(".ask .attach, .ask button").filter(has_text="attach").first.click()
    until(lambda: names(served) == ["1", "3", "5"], "both gone")
    assert served.store.state.model.body("3").parent == "1"
    page.keyboard.press("Control+z")
    until(lambda: len(names(served)) == 5, "both back in one step")
    page.keyboard.press("Control+z")
    until(lambda: names(served) == ["1", "2", "3", "4", "5"], "in their order")

    row(page, "5").wait_for()
    settled(page, served)  # a row that is drawn anew is not dragged on
    handle = row(page, "5").locator("td.number")
    handle.drag_to(row(page, "2"), target_position={"x": 60, "y": 2})
    until(lambda: names(served) == ["1", "5", "2", "3", "4"], "5 before 2")
    page.wait_for_function("pgraph.latest.table.rows[1].name === '5'")
    settled(page, served)
    handle.drag_to(row(page, "1"), target_position={"x": 60, "y": 13})
    until(lambda: served.store.state.model.body("5").parent == "1", "5 on 1")

    choose_body(page, "3")
    page.locator("button.add").click()
    until(lambda: names(served)[-1] == "6", "a body more")
    assert served.store.state.model.body("6").parent == "3"
    rows_selected(page, "6")
    choose_body(page, "3")
    page.keyboard.press("Delete")
    page.locator(".ask button").filter(has_text="branch").click()
    until(lambda: names(served) == ["1", "5", "2"], "the branch gone")
    page.keyboard.press("Control+k")
    page.keyboard.type("number of bodies")
    page.keyboard.press("Enter")
    typed(page.get_by_label("number of bodies"), "7")
    until(lambda: len(names(served)) == 7, "four more")
    page.locator(".ask .keep").click()


def test_the_clipboard_carries_rows_and_names_what_it_refuses(chain: Any, served: Server):
    page = chain
    row(page, "2").locator("td.number").click()
    row(page, "3").locator("td.number").click(modifiers=["Shift"])
    rows_selected(page, "2", "3")
    page.wait_for_function("pgraph.latest.copied?.bodies.join() === '2,3'")
    text = copied(page)
    head, *lines = [line.split("\t") for line in text.splitlines()]
    assert head[:3] == ["name", "parent", "joint"]
    assert [line[:3] for line in lines] == [["2", "1", "revolute"], ["3", "2", "revolute"]]
    paste(page, text)
    until(lambda: names(served)[5:] == ["6", "7"], "two new rows")
    model = served.store.state.model
    assert model.body("7").inertia == model.body("3").inertia
    assert [model.body(name).parent for name in ("6", "7")] == ["1", "6"]
    name_cell(page, "6").click()
    paste(page, "hip\tground\t3\nknee\t\t0 weld\n")
    until(lambda: names(served)[5:] == ["hip", "knee"], "both filled")
    assert served.store.state.model.body("hip").joint == "spherical"
    row(page, "hip").wait_for()
    before = served.store.state.model
    paste(page, "a\tnowhere")
    notice(page, "'a'", "parent", "'nowhere'")
    assert served.store.state.model is before
    page.evaluate("document.activeElement.blur()")
    paste(page, "wing\tground\t1\n")  # with no row in focus, as in an empty table
    until(lambda: names(served)[-1] == "wing", "a row on the ground")

    ask(page, "new")
    page.locator(".asked[data-asked=newQuestion] input[type=text]").first.focus()
    paste(page, "name\tparent\tmass\nhip\tnowhere\t3\n")
    page.wait_for_function("document.body.textContent.includes(\"'nowhere'\")")
    assert names(served)[-1] == "wing"
    paste(page, "name\tparent\tmass\nhip\tground\t3\nknee\thip\t2\n")
    until(lambda: names(served) == ["hip", "knee"], "the rows alone")
    assert [body.mass for body in served.store.state.model.bodies] == [3.0, 2.0]
    page.wait_for_function("!document.querySelector('.asked:not(:empty)')")


@pytest.mark.nightly
def test_branches_are_duplicated_and_mirrored(page: Any, served: Server, quadruped: pg.Model):
    opened(page, served, quadruped)
    choose_body(page, "left_femur")
    page.keyboard.press("Control+d")
    page.locator(".ask button").filter(has_text="all it carries").click()
    rows_selected(page, *(f"left_{x}_2" for x in ("femur", "tibia", "hind_paw")))
    page.evaluate("pgraph.rows.mirror(pgraph.host('table'))")
    page.locator(".ask .plane-z").click()
    until(lambda: "right_femur_2" in names(served), "its mirror image")
    model = served.store.state.model
    assert model.body("right_femur_2").link == model.body("right_femur").link


@pytest.mark.nightly
def test_the_gutter_draws_lanes_nodes_and_loops_and_marks_the_way_to_the_ground(page, served):
    opened(page, served, pg.Model.load(pgraph_models.path("quadruped_hips")))
    row(page, "right_hind_paw").wait_for()
    places = page.evaluate("""() => [...document.querySelectorAll("tr[data-name] .node")]
      .map((node) => Number(node.querySelector("circle").getAttribute("cx")))""")
    lanes = [sorted(set(places)).index(place) for place in places]
    assert lanes == [*[0] * 7, *[1] * 3, *[2] * 3, *[3] * 3]
    kinds = page.evaluate("""() => [...document.querySelectorAll("tr[data-name] .node")]
      .map((node) => node.getAttribute("class"))""")
    assert [k for k, kind in enumerate(kinds, 1) if "tip" in kind] == [7, 10, 13, 16]
    assert [k for k, kind in enumerate(kinds, 1) if "separation" in kind] == [1, 4]
    choose_body(page, "right_radius")
    page.wait_for_function("""() => [...new Set([...document.querySelectorAll("tr .edge.path")]
      .map((edge) => Number(edge.dataset.of)))].sort((a, b) => a - b).join() === "2,3,4,8,9" """)
    heights = page.evaluate("""() => [...document.querySelectorAll("tr[data-name]")]
      .map((tr) => tr.getBoundingClientRect().height)""")
    assert set(heights) == {29}

    opened(page, served, pg.Model.load(pgraph_models.path("four_bar")))
    loops = page.evaluate("""() => [...document.querySelectorAll("tr .loop")]
      .map((path) => [path.closest("tr").dataset.name, path.textContent,
                      getComputedStyle(path).strokeDasharray !== "none"])""")
    loop = served.store.state.derived.loops[0].name
    assert loops == [["coupler", loop, True], ["right crank", loop, True]]
    assert page.evaluate("pgraph.latest.table.rows[2].parent") == "ground"
    for name, act in (("right crank", page.mouse.down), ("left crank", page.mouse.up)):
        box = row(page, name).locator("td.number").bounding_box()
        page.mouse.move(box["x"] + 20, box["y"] + 14, steps=4)  # with Shift it closes a loop
        act()
        page.keyboard.down("Shift") if name == "right crank" else page.keyboard.up("Shift")
    until(lambda: len(served.store.state.model.constraints) == 2, "a second loop")
    served.send(Undo(NOBODY))
    until(lambda: len(served.store.state.model.constraints) == 1, "the loop alone")
    settled(page, served)
    tied = row(page, "coupler").locator("td.constraint.on")
    assert (tied.inner_text(), loop in tied.get_attribute("title")) == ("point", True)
    assert row(page, "left crank").locator("td.constraint").inner_text() == "holonomic"
    assert page.locator("table.bodies th").all_inner_texts()[1:] == [
        "Body", "Parent", "DoF", "Constraint",
    ]  # fmt: skip
    row_cell(page, "coupler", "point").click()
    page.locator('[data-view="constraints"]', has_text=loop).wait_for()
    page.get_by_role("tab", name="Connections", selected=True).wait_for()


@pytest.mark.nightly
def test_a_thousand_rows_are_typed_into(page: Any, served: Server):
    served.send(NewModel(NOBODY, 1, "1000"))
    page.wait_for_function("() => pgraph.latest.table.rows.length === 1000")
    page.wait_for_function("() => pgraph.latest.digraph.kind === 'lanes'")
    row(page, "500").locator("td.number").click()
    page.keyboard.press("Enter")
    page.keyboard.type("middle")
    page.keyboard.press("Enter")
    until(lambda: names(served)[499] == "middle", "the typed name")
    until(lambda: focused(page) == ["501", "name"], "the next row")


def test_undo_and_redo_by_keys_and_buttons(page: Any, served: Server):
    choose_body(page, "thigh")
    mass = served.store.state.model.body("thigh").mass
    now = lambda: served.store.state.model.body("thigh").mass  # noqa: E731
    typed(field(page, "mass"), "3.25")
    until(lambda: now() == 3.25, "the new mass")
    for press, wanted in (
        (lambda: page.keyboard.press("Control+z"), mass),
        (lambda: page.keyboard.press("Control+Shift+z"), 3.25),
        (lambda: page.locator("button.undo").click(), mass),
        (lambda: page.locator("button.redo").click(), 3.25),
    ):
        press()
        until(lambda x=wanted: now() == x, f"{wanted} kg")
    until(lambda: field(page, "mass").input_value() == "3.25", "the mass on the page")
