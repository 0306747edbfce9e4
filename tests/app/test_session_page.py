"""Two people at one model, and a connection that is lost."""

import random

import pytest

from pgraph_app.model import Undo
from pgraph_app.table.view import table

from .conftest import NOBODY, held, until
from .on_page import cut_off, field, name_cell, names, row, rows_selected, typed


@pytest.mark.nightly  # by day: two pages in test_page, and edits of two people in test_session
def test_two_pages_edit_at_once_and_agree(page, open_page, served):
    """A half-typed cell is left alone, and undo leads back to the start."""
    start = served.store.state.model
    other = open_page()
    try:
        half = name_cell(other, "trunk")
        half.fill("half-typed")
        row(page, "trunk").locator(".others i").wait_for()  # where the other is
        rng = random.Random(3)
        for k in range(12):
            for at in (page, other):
                body = rng.choice(list(start.row))
                field_, text = rng.choice(
                    (("mass", str(1 + k)), ("dof", str(k % 4)), ("name", "trunk"))
                )
                at.evaluate(
                    "([k, body, field, text]) => pgraph.send('EditBodies', "
                    "{ serial: 10000 + k, bodies: [body], field, entries: [[[], text]] })",
                    [k, body, field_, text],
                )
        for at in (page, other):
            at.evaluate("pgraph.send('Select', { body: 'arm' })")
        until(  # senders take turns, and each one's events are in order: all edits are done
            lambda: [p.selection for p in served.store.state.clients.values()].count("arm") == 2,
            "the last event of both",
        )
        joints = [row["joint"] for row in table(served.store.state)["rows"]]
        for at in (page, other):
            at.wait_for_function(
                "(joints) => pgraph.latest.table.rows.map((row) => row.joint).join() === joints",
                arg=",".join(joints),
            )
        assert half.input_value() == "half-typed"
        steps = [step.model is start for step in reversed(served.store.state.undo)].index(True) + 1
        for _ in range(steps):
            served.send(Undo(NOBODY))
        until(lambda: served.store.state.model is start, "the start")
        other.keyboard.press("Escape")
    finally:
        other.close()
    page.wait_for_function("!document.querySelector('.others i')")


def test_a_page_asks_before_it_closes_while_an_edit_waits_for_its_answer(page, served):
    """The server drops what a closed page asked for and what it has not begun."""
    asks = """() => {
      const closing = new Event('beforeunload', { cancelable: true });
      window.dispatchEvent(closing);
      return closing.defaultPrevented; }"""
    assert not page.evaluate(asks)
    with held(served):
        typed(name_cell(page, "trunk"), "torso")
        assert page.evaluate(asks)
    until(lambda: not page.evaluate(asks), "the answer")
    assert "torso" in names(served)
    hint = "{ serial: pgraph.nextSerial(), part: '', name: '', cell: '', text: '1', caret: 1 }"
    with held(served):
        page.evaluate(f"pgraph.send('AskHint', {hint})")
        assert page.evaluate(asks)
    until(lambda: not page.evaluate(asks), "the hint")


def test_a_page_that_comes_back_has_all_that_a_person_had_on_it(page, served):
    row(page, "shank").locator("td.number").click()
    row(page, "thigh").locator("td.number").click(modifiers=["Shift"])
    rows_selected(page, "thigh", "shank")
    half = name_cell(page, "trunk")
    half.evaluate("(cell) => { cell.value = 'half-typed'; }")
    cut_off(page, served)
    selected = lambda: [c.selected for c in served.store.state.clients.values()]  # noqa: E731
    until(lambda: selected() == [("thigh", "shank")], "both rows selected")
    assert half.input_value() == "half-typed"
    half.press("Escape")

    page.evaluate("pgraph.send('Select', { body: null })")
    page.evaluate("document.querySelector('details.display').open = true")
    page.locator('[data-view=properties] [data-unit="length"]').click()
    page.wait_for_function("() => pgraph.latest.properties.display.length === 'mm'")
    row(page, "shank").locator("td.number").click()
    page.wait_for_function("() => pgraph.latest.properties.bodies.join() === 'shank'")
    field(page, "link", 1).fill("-3")
    page.evaluate("window.kept = document.activeElement")
    cut_off(page, served)
    now = lambda: [c.display.length for c in served.store.state.clients.values()]  # noqa: E731
    until(lambda: now() == ["mm"], "its units")
    page.wait_for_function("kept.isConnected")  # the cell itself again
    assert field(page, "link", 1).input_value() == "-3"
    field(page, "link", 1).press("Enter")
    until(lambda: served.store.state.model.body("shank").link[1] == -0.003, "3 mm")
    typed(field(page, "com", 1), "5")
    until(lambda: served.store.state.model.body("shank").com[1] == 0.005, "another edit")
