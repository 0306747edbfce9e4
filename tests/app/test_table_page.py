"""Interface 1.3 and 1.4 in the browser: the table as a spreadsheet."""

from __future__ import annotations

import re
from typing import Any

import pytest

from pgraph_app.model.update import NewModel, OpenBuiltIn
from pgraph_app.server import Server

from .conftest import NOBODY, held, until
from .test_page import row, sentence


def names(served: Server) -> list[str]:
    return [body.name for body in served.store.state.model.bodies]


def focused(page: Any) -> list[str]:
    """Row and kind of the focused cell."""
    return page.evaluate("""() => {
      const cell = document.activeElement;
      return [cell.closest('tr')?.dataset.name, cell.getAttribute('aria-label') ?? cell.tagName];
    }""")


def chosen(page: Any) -> list[str]:
    return page.locator("tr.selected").evaluate_all("(rows) => rows.map((e) => e.dataset.name)")


def paste(page: Any, text: str) -> None:
    """What the browser does at Ctrl+V with this on the clipboard."""
    page.evaluate(
        """(text) => {
      const data = new DataTransfer();
      data.setData('text/plain', text);
      document.activeElement.dispatchEvent(new ClipboardEvent('paste',
        { clipboardData: data, bubbles: true, cancelable: true }));
    }""",
        text,
    )


def copied(page: Any) -> str:
    return page.evaluate("""() => {
      const data = new DataTransfer();
      document.activeElement.dispatchEvent(new ClipboardEvent('copy',
        { clipboardData: data, bubbles: true, cancelable: true }));
      return data.getData('text/plain');
    }""")


@pytest.fixture
def chain(page: Any, served: Server) -> Any:
    """The page on five bodies in a row."""
    served.send(NewModel(NOBODY, 1, "5"))
    page.wait_for_function("() => pgraph.latest.table.rows.length === 5")
    return page


def test_1_3_arrows_tab_home_and_enter_move_as_in_a_spreadsheet(chain, served):
    page = chain
    row(page, "2").locator("input.name").focus()
    for key, place in (
        ("ArrowDown", ["3", "name"]), ("ArrowRight", ["3", "parent"]), ("ArrowUp", ["2", "parent"]),
        ("Tab", ["2", "DoF"]), ("End", ["2", "holonomic"]), ("Home", ["2", "name"]),
        ("Control+ArrowDown", ["5", "name"]), ("Control+Home", ["1", "name"]),
        ("Enter", ["2", "name"]), ("Shift+Enter", ["1", "name"]), ("PageDown", ["5", "name"]),
    ):  # fmt: skip
        page.keyboard.press(key)
        assert focused(page) == place, key
    until(lambda: chosen(page) == ["5"], "the row of the focus selected")
    page.keyboard.type("toe")  # replaces what is there
    page.keyboard.press("ArrowLeft")  # within the text now
    page.keyboard.type("_")
    page.keyboard.press("Shift+Enter")
    until(lambda: names(served)[-1] == "to_e", "the typed name")
    until(lambda: focused(page) == ["4", "name"], "the row above, once it was taken")
    page.keyboard.press("F2")
    page.keyboard.type("th")
    page.keyboard.press("Escape")
    assert row(page, "4").locator("input.name").input_value() == "4"
    assert served.store.state.model.body("4").name == "4"


def test_1_3_what_is_typed_before_the_server_answers_goes_where_it_belongs(chain, served):
    page = chain
    row(page, "1").locator("input.name").focus()
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
        row(page, "3").locator("select").nth(1).select_option("3")  # by its name until then
        page.keyboard.press("Escape")
        row(page, "5").locator("input.name").focus()
        page.keyboard.type("toe")
        page.keyboard.press("Enter")
        page.keyboard.type("foot")  # the last row: typed anew
        page.keyboard.press("Tab")
    until(lambda: names(served) == ["crank", "coupler", "rocker", "4", "foot"], "all the names")
    model = served.store.state.model
    assert [model.body(name).parent for name in names(served)[1:]] == names(served)[:-1]
    until(lambda: served.store.state.model.body("rocker").joint == "spherical", "its joint")
    until(lambda: page.locator(".waiting").count() == 0, "all cells answered")
    assert page.locator("tr .name").evaluate_all("(all) => all.map((e) => e.value)") == names(
        served
    )
    assert page.locator(".refused").count() == 0


def test_1_3_a_refused_name_keeps_its_sentence_and_moves_nothing(chain, served):
    page = chain
    row(page, "1").locator("input.name").focus()
    page.keyboard.type("2")
    page.keyboard.press("Enter")
    assert focused(page) == ["1", "name"]  # the page itself knows that name
    assert "'2' is already the name of row 2" in sentence(page)
    with held(served):
        page.keyboard.type("x" * 101)
        page.keyboard.press("Enter")
        page.keyboard.type("two")
    page.get_by_text("at most 100 characters").wait_for()
    assert focused(page) == ["2", "name"]
    page.keyboard.press("Enter")
    until(lambda: names(served)[:2] == ["1", "two"], "the second name")
    assert page.get_by_text("at most 100 characters").is_visible()
    row(page, "1").locator("input.name").press("Escape")


def test_1_4_several_rows_are_selected_moved_and_deleted(chain, served):
    page = chain
    row(page, "2").locator("td.number").click()
    row(page, "4").locator("td.number").click(modifiers=["Shift"])
    until(lambda: chosen(page) == ["2", "3", "4"], "three rows")
    row(page, "3").locator("td.number").click(modifiers=["Control"])
    until(lambda: chosen(page) == ["2", "4"], "without the middle one")
    page.keyboard.press("Alt+ArrowUp")
    until(lambda: names(served) == ["2", "4", "1", "3", "5"], "both above the first")
    page.keyboard.press("Delete")
    page.get_by_text(re.compile("^attach 2 children")).click()
    until(lambda: names(served) == ["1", "3", "5"], "both gone")
    assert served.store.state.model.body("3").parent == "1"
    page.keyboard.press("Control+z")
    until(lambda: len(names(served)) == 5, "both back in one step")


def test_1_4_rows_are_dragged_between_rows_and_onto_one(chain, served):
    page = chain
    handle, target = row(page, "5").locator("td.number"), row(page, "2")
    handle.drag_to(target, target_position={"x": 60, "y": 2})
    until(lambda: names(served) == ["1", "5", "2", "3", "4"], "5 before 2")
    handle.drag_to(row(page, "1"), target_position={"x": 60, "y": 13})
    until(lambda: served.store.state.model.body("5").parent == "1", "5 on 1")


def test_1_4_duplicate_and_mirror_a_branch(page, served):
    row(page, "left_femur").locator("td.number").click()
    until(lambda: chosen(page) == ["left_femur"], "the femur")
    page.keyboard.press("Control+d")
    page.get_by_text("with all it carries").click()
    until(lambda: chosen(page) == [f"left_{x}_2" for x in ("femur", "tibia", "hind_paw")], "a leg")
    page.locator("button.mirror").click()
    page.locator(".ask .plane-z").click()
    until(lambda: "right_femur_2" in names(served), "its mirror image")
    mirrored = served.store.state.model.body("right_femur_2")
    assert mirrored.link == served.store.state.model.body("right_femur").link


def test_1_4_copy_gives_what_paste_takes(chain, served):
    page = chain
    row(page, "2").locator("td.number").click()
    row(page, "3").locator("td.number").click(modifiers=["Shift"])
    until(lambda: chosen(page) == ["2", "3"], "two rows")
    until(lambda: page.evaluate("pgraph.latest.copied?.bodies") == ["2", "3"], "what they carry")
    text = copied(page)
    head, *lines = [line.split("\t") for line in text.splitlines()]
    assert head[:3] == ["name", "parent", "joint"]
    assert [line[:3] for line in lines] == [["2", "1", "revolute"], ["3", "2", "revolute"]]
    paste(page, text)
    until(lambda: names(served)[5:] == ["6", "7"], "two new rows")
    assert served.store.state.model.body("7").inertia == served.store.state.model.body("3").inertia
    assert [served.store.state.model.body(n).parent for n in ("6", "7")] == ["1", "6"]
    row(page, "6").locator("input.name").click()
    paste(page, "hip\tground\t3\nknee\t\t0 weld\n")
    until(lambda: names(served)[5:] == ["hip", "knee"], "both filled")
    assert served.store.state.model.body("hip").joint == "spherical"
    row(page, "hip").wait_for()
    before = served.store.state.model
    paste(page, "a\tnowhere")
    page.get_by_text("Nothing was pasted: body 'a', parent: no body is named 'nowhere'").wait_for()
    assert served.store.state.model is before
    page.evaluate("document.activeElement.blur()")
    paste(page, "wing\tground\t1\n")  # with no row in focus, as in an empty table
    until(lambda: names(served)[-1] == "wing", "a row on the ground")


def test_1_4_search_shows_the_rows_with_the_words(page):
    search = page.get_by_label("search bodies")
    search.fill("hind tibia")
    assert page.locator("tr[data-name]:visible").count() == 2
    search.fill("no such thing")
    assert page.get_by_text("No body has “no such thing” in its row.").is_visible()
    search.press("Escape")
    assert page.locator("tr[data-name]:visible").count() == 16


def test_d1_the_number_of_bodies_is_a_field(chain, served):
    page = chain
    field = page.get_by_label("number of bodies")
    field.fill("7")
    field.press("Enter")
    until(lambda: names(served)[5:] == ["6", "7"], "two more")
    row(page, "7").wait_for()
    field.fill("4")
    field.press("Enter")
    page.get_by_text("Delete the last 3 bodies (5, 6, 7)?").wait_for()
    assert len(names(served)) == 7
    page.locator(".ask .primary").click()
    until(lambda: len(names(served)) == 4, "four")


@pytest.mark.parametrize(
    ("typed", "said"),
    [("x" * 10_000, "at most 100 characters"), ("\u202e", "control characters"), (" ", "empty")],
)
def test_bad_input_in_a_cell_is_refused_beside_it(chain, served, typed, said):
    cell = row(chain, "3").locator("input.name")
    cell.fill(typed)
    cell.press("Enter")
    assert said in sentence(chain)
    assert names(served) == ["1", "2", "3", "4", "5"]
    cell.press("Escape")


def test_1_4_a_thousand_rows_are_shown_within_a_second_and_typed_into(page, served):
    served.send(NewModel(NOBODY, 1, "1000"))
    page.wait_for_function("() => pgraph.latest.table.rows.length === 1000")
    took = page.evaluate("""() => {
      const host = document.querySelector('.pgraph[data-view="table"]');
      const data = JSON.parse(JSON.stringify(pgraph.latest.table));
      return Math.min(...[1, 2, 3].map(() => {
        pgraph.receive('table', { ...data, rows: data.rows.slice(0, 1) });
        const start = performance.now();
        pgraph.receive('table', data);
        host.offsetHeight;
        return performance.now() - start;
      }));
    }""")
    assert took < 1000
    row(page, "500").locator("td.number").click()
    page.keyboard.press("Enter")
    page.keyboard.type("middle")
    page.keyboard.press("Enter")
    until(lambda: names(served)[499] == "middle", "the typed name")
    until(lambda: focused(page) == ["501", "name"], "the next row")


def test_what_is_ordinary_has_no_word_and_its_column_is_narrow(page, served):
    served.send(NewModel(NOBODY, 0, "3"))
    page.wait_for_function("() => pgraph.latest.table.rows.length === 3")
    button = page.locator('tr[data-name="2"] .constraint button')
    assert button.inner_text() == "–"
    assert page.get_by_role("button", name="holonomic", exact=True).count() == 3
    narrow = button.bounding_box()["width"]
    served.send(OpenBuiltIn(NOBODY, "four_bar"))
    page.wait_for_function("() => pgraph.latest.table.rows.some((row) => row.constraints.length)")
    tied = page.locator(".bodies.tied .constraint button").filter(has_not_text="–").first
    assert tied.get_attribute("aria-label") == tied.inner_text()
    assert tied.bounding_box()["width"] > narrow


def test_rows_pasted_where_new_asks_for_a_number_are_a_new_model(chain, served):
    chain.get_by_role("button", name="New", exact=True).click()
    chain.get_by_label("How many bodies?").focus()
    paste(chain, "name\tparent\tmass\nhip\tnowhere\t3\n")
    chain.get_by_text("no body is named 'nowhere'").first.wait_for()
    before = names(served)
    assert before == [body.name for body in served.store.state.model.bodies]
    paste(chain, "name\tparent\tmass\nhip\tground\t3\nknee\thip\t2\n")
    until(lambda: names(served) == ["hip", "knee"], "the rows alone")
    assert [body.mass for body in served.store.state.model.bodies] == [3.0, 2.0]
    assert served.store.state.model.name == "hip"
    until(lambda: chain.get_by_role("dialog", name="New model").count() == 0, "no question")


def test_a_part_is_added_to_what_is_selected_by_then(chain, served):
    rows = names(served)
    chain.locator(f'tr[data-name="{rows[0]}"] td.number').click()
    chain.evaluate("pgraph.front('Constraints')")
    chain.locator("button.add-tie").click()
    chain.locator(f'tr[data-name="{rows[-1]}"] td.number').click()
    until(lambda: chain.evaluate("pgraph.latest.selection") == rows[-1], "the other row")
    chain.locator('.chooser [data-kind="constraints weld"]').click()
    picking = lambda: [c.picking for c in served.store.state.clients.values() if c.picking]  # noqa: E731
    until(picking, "the question for the second body")
    assert picking()[0].body == rows[-1]
    chain.keyboard.press("Escape")
    chain.evaluate("pgraph.front('Digraph')")
