"""Lists of the page: rows keep focus and what is half typed, wherever others move them."""

from __future__ import annotations

import json
from typing import Any

import pytest

import pgraph_core as pg
from pgraph_app.constraints.update import EditPart, OpenPart
from pgraph_app.model.update import OpenText, Redo, Undo
from pgraph_app.properties.update import EditBodies
from pgraph_app.properties.world import DeleteParameter, EditWorld
from pgraph_app.run.update import SetScenario
from pgraph_app.scenario.update import DeleteSwitch
from pgraph_app.session.update import Select

from .conftest import NOBODY, until

DRAWN = """(items) => {
  window.box ??= document.body.appendChild(pgraph.make("div", { className: "pgraph" }, "head"));
  const create = () => {
    const el = pgraph.make("p", {}, pgraph.cells.input(() => {}, { label: "x" }));
    el.id = window.made = (window.made ?? 0) + 1;
    return el;
  };
  const fill = (el, item) => pgraph.cells.set(el.querySelector("input"), item.name);
  const named = items.map(([id, name]) => ({ id, name }));
  pgraph.keyed(window.box, named, create, fill, () => { window.gone++; });
  return [...window.box.children].map((el) => [el.dataset.name, Number(el.id)]);
}"""


@pytest.fixture
def drawn(page):
    page.evaluate("window.box = null, window.made = 0, window.gone = 0")
    yield lambda *names, ids="": dict(
        page.evaluate(DRAWN, [list(x) for x in zip(ids or names, names)])
    )
    page.evaluate("window.box.remove()")


def test_items_keep_their_elements_by_name(drawn, page):
    assert drawn("a", "b", "c") == {"a": 1, "b": 2, "c": 3}
    moved = drawn("c", "a", "d")
    assert list(moved) == ["c", "a", "d"]
    assert (moved["c"], moved["a"]) == (3, 1)
    assert page.evaluate("window.box.firstChild.textContent") == "head"


def test_a_renamed_item_keeps_its_element(drawn, page):
    drawn("a", "b", "c")
    assert drawn("a", "x", "c", ids="abc") == {"a": 1, "x": 2, "c": 3}
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


# -- rows of forms: typed in one of three while others are put in and taken out --------------------


def rows_of_all_kinds() -> pg.Model:
    """Three rows of each kind of list; those of points and shapes are alike."""
    ball = pg.Shape(kind="sphere", radius=0.1)
    motions = tuple(("rotate", axis) for axis in ((1, 0, 0), (0, 1, 0), (0, 0, 1)))
    bodies = (
        pg.Body(name="a", shapes=(ball, ball, ball), axes=(0, 1, 0)),
        pg.Body(name="b", parent="a", joint="compound", motions=motions),
        pg.Body(name="c", parent="a", axes=(0, 1, 0)),
    )
    step = {"high": (2.0, 1.0), "height": 0.1}
    ties = tuple(pg.Constraint(name=n, kind="point", body="c", active=False) for n in "xyz")
    whole = pg.Constraint(name="sum", kind="velocity", body="a", active=False,
                          coefficients={"a": (1,), "b": (1, 0, 0), "c": (1,)})  # fmt: skip
    switches = tuple(pg.Switch(constraint=n, t=0.5, active=True) for n in "xyz")
    own = pg.Scenario(name="own", t_end=1.0, switches=switches, q=dict.fromkeys("ac", (0.0,)))
    return pg.Model(
        bodies=bodies, constraints=(*ties, whole), scenarios=(own,),
        contacts=(pg.Contact(name="k", body="c", points=((1.0, 0, 0),) * 3),),
        ground=pg.Ground(steps=tuple(pg.Step(low=(k, -1.0), **step) for k in (0.0, 0.5, 1.0))),
        parameters={"l": 1.0, "m": 2.0, "n": 3.0},
    )  # fmt: skip


def part(field: str, index: tuple[int, ...], text: str, name: str = "k") -> EditPart:
    return EditPart(NOBODY, 1, "contacts" if name == "k" else "constraints", name, field,
                    ((index, text),))  # fmt: skip


def body(name: str, field: str, index: tuple[int, ...], text: str) -> EditBodies:
    return EditBodies(NOBODY, 1, (name,), field, ((index, text),))  # type: ignore[arg-type]


def motion(number: int) -> EditBodies:
    return body("b", "motions", (number,), "")


KINDS: dict[str, tuple[Any, ...]] = {
    # what shows it; its rows; the cell in a row; how another takes out a row; what it holds
    "points": (
        OpenPart(NOBODY, "contacts", "k"), "Constraints",
        '[data-field="points"]:has(input)', "input",
        lambda k: part("points", (k,), ""),
        lambda m: [p[0] for p in m.contacts[0].points],
    ),
    "coefficients": (
        OpenPart(NOBODY, "constraints", "sum"), "Constraints",
        '[data-field="coefficients"]:has(input)', "input",
        lambda k: part("coefficients", (), "abc"[k], "sum"),
        lambda m: [x[0] for x in m.constraints[-1].coefficients.values()],
    ),
    "shapes": (
        Select(NOBODY, "a"), "Properties", '[data-field$="_radius"]', "input",
        lambda k: body("a", f"shape_{k}_kind" if k else "shape_kind", (), "none"),
        lambda m: [s.radius for s in m.body("a").shapes],
    ),
    "axes": (
        Select(NOBODY, "b"), "Properties", '[data-field="axes"]', "input", motion,
        lambda m: [a[0] for a in m.body("b").axes],
    ),
    "coordinates": (
        Select(NOBODY, "b"), "Properties", '[data-field="v"] input', "", motion,
        lambda m: list(m.body("b").v),
    ),
    "steps": (
        Select(NOBODY, None), "Properties", '[data-field="steps"]', "input",
        lambda k: EditWorld(NOBODY, 1, "steps", (((k,), ""),)),
        lambda m: [s.low[0] for s in m.ground.steps],
    ),
    "parameters": (
        Select(NOBODY, None), "Properties",
        ".parameter:not(.fresh)", "[aria-label='parameter value']",
        lambda k: DeleteParameter(NOBODY, "lmn"[k]),
        lambda m: list(m.parameters.values()),
    ),
    "switches": (
        SetScenario(NOBODY, 1, "own"), "Scenario", ".switch", "[aria-label='value']",
        lambda k: DeleteSwitch(NOBODY, k),
        lambda m: [s.t for s in m.scenarios[0].switches],
    ),
}  # fmt: skip


@pytest.fixture
def rows(page, served):
    """Shows the rows of a kind; (locator of their cells, removal, values of the model)."""

    def shown(kind: str):
        event, tab, selector, cell, out, values = KINDS[kind]
        served.send(OpenText(NOBODY, "lists", rows_of_all_kinds().to_json()))
        page.wait_for_function("pgraph.latest.table.rows.length === 3")
        for client in served.store.state.clients:
            if "client" in vars(event):
                served.send(type(event)(**{**vars(event), "client": client}))
        page.evaluate(f"pgraph.front('{tab}')")
        found = page.locator(f"[data-view={tab.lower()}] {selector}")
        until(lambda: found.count() == 3, f"three rows of {kind}")
        page.evaluate(f"document.querySelectorAll('[data-view={tab.lower()}] details')"
                      ".forEach((one) => { one.open = true; })")  # fmt: skip
        return found, cell, out, lambda: values(served.store.state.model)

    yield shown
    page.evaluate("document.activeElement?.blur()")
    page.evaluate("['Digraph', 'Properties'].forEach(pgraph.front)")


@pytest.mark.parametrize("how", ["above", "below", "above, undone"])
@pytest.mark.parametrize("kind", KINDS)
def test_what_is_typed_stays_in_its_row(page, served, rows, kind, how):
    found, inside, out, values = rows(kind)
    cell = found.nth(1).locator(inside).first if inside else found.nth(1)
    cell.evaluate("(cell) => { cell.focus(); window.typed = cell; }")
    page.keyboard.press("Control+a")
    page.keyboard.type("0.2")
    before = values()
    served.send(out(2 if how == "below" else 0))
    until(lambda: len(values()) == 2, "a row less")
    until(lambda: found.count() == 2, "a row less on the page")
    if "undone" in how:
        served.send(Undo(NOBODY))
        until(lambda: found.count() == 3, "the row again")
        served.send(Redo(NOBODY))
        until(lambda: found.count() == 2, "a row less again")
    at = 1 if how == "below" else 0
    assert page.evaluate("[typed.isConnected, typed.value]") == [True, "0.2"]
    now = found.nth(at).locator(inside).first if inside else found.nth(at)
    assert now.evaluate("(cell) => cell === typed && cell === document.activeElement")
    page.keyboard.type("5")
    page.keyboard.press("Enter")
    wanted = [x for k, x in enumerate(before) if k != (2 if how == "below" else 0)]
    wanted[at] = 0.25
    until(lambda: values() == pytest.approx(wanted), f"{json.dumps(wanted)}, not {values()}")


@pytest.mark.parametrize("kind", KINDS)
def test_what_is_typed_into_a_row_that_goes_lands_in_no_other(page, served, rows, kind):
    found, inside, out, values = rows(kind)
    cell = found.nth(1).locator(inside).first if inside else found.nth(1)
    cell.evaluate("(cell) => { cell.focus(); }")
    page.keyboard.press("Control+a")
    page.keyboard.type("0.375")
    before = values()
    served.send(out(1))
    until(lambda: found.count() == 2, "a row less on the page")
    page.locator("[role=alert]", has_text="meanwhile").or_(
        page.locator("[role=alert]", has_text="gone")).first.wait_for()  # fmt: skip
    assert values() == [before[0], before[2]]
