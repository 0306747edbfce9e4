"""Keyed lists of the page: elements follow their items and keep focus and half-typed text."""

from __future__ import annotations

import pytest

DRAWN = """(names) => {
  window.box ??= document.body.appendChild(pgraph.make("div", { className: "pgraph" }, "head"));
  const create = () => {
    const el = pgraph.make("p", {}, pgraph.cells.input(() => {}, { label: "x" }));
    el.id = window.made = (window.made ?? 0) + 1;
    return el;
  };
  const fill = (el, item) => pgraph.cells.set(el.querySelector("input"), item.name);
  pgraph.keyed(window.box, names.map((name) => ({ name })), create, fill, () => { window.gone++; });
  return [...window.box.children].map((el) => [el.dataset.name, Number(el.id)]);
}"""


@pytest.fixture
def drawn(page):
    page.evaluate("window.box = null, window.made = 0, window.gone = 0")
    yield lambda *names: dict(page.evaluate(DRAWN, list(names)))
    page.evaluate("window.box.remove()")


def test_items_keep_their_elements_by_name(drawn, page):
    assert drawn("a", "b", "c") == {"a": 1, "b": 2, "c": 3}
    moved = drawn("c", "a", "d")
    assert list(moved) == ["c", "a", "d"]
    assert (moved["c"], moved["a"]) == (3, 1)
    assert page.evaluate("window.box.firstChild.textContent") == "head"


def test_a_renamed_item_keeps_its_element(drawn, page):
    drawn("a", "b", "c")
    assert drawn("a", "x", "c") == {"a": 1, "x": 2, "c": 3}
    assert page.evaluate("window.gone") == 0


def test_removed_items_are_told_and_take_their_sentence_along(drawn, page):
    drawn("a", "b", "c")
    page.evaluate("window.box.children[1].after(pgraph.text('p', 'sentence', 'no'))")
    assert drawn("c", "a") == {"c": 3, "a": 1}
    assert page.evaluate("window.gone") == 1
    assert page.evaluate("window.box.querySelectorAll('.sentence').length") == 0


def test_focus_and_half_typed_text_stay_when_items_move(drawn, page):
    drawn("a", "b", "c")
    cell = "window.box.querySelector('[data-name=b] input')"
    page.evaluate(f"{cell}.focus(), {cell}.value = 'half', {cell}.setSelectionRange(2, 3)")
    drawn("c", "d", "b", "a")
    active = page.evaluate(
        f"[document.activeElement === {cell}, {cell}.value, {cell}.selectionStart]"
    )
    assert active == [True, "half", 2]
