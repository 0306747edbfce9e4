"""Properties and constraints as a person meets them (interface.md 1.5, 1.6; D9, D12-D18)."""

from __future__ import annotations

from typing import Any

import pytest

from pgraph_app.model.update import NewModel, OpenBuiltIn
from pgraph_app.properties.world import EditWorld
from pgraph_app.session.update import SetDisplay

from .conftest import NOBODY, last_step, steps_after, until


@pytest.fixture
def bench(page: Any, served: Any) -> Any:
    """The page on three hinged bodies."""
    served.send(NewModel(NOBODY, 0, "3"))
    page.wait_for_function("() => pgraph.latest.table.rows.length === 3")
    for client in served.store.state.clients:
        served.send(SetDisplay(client, "angle", "rad"))
        served.send(SetDisplay(client, "length", "m"))
    yield page
    page.evaluate("() => pgraph.front('Digraph')")


def model(served: Any) -> Any:
    return served.store.state.model


def cell(page: Any, field: str, k: int = 0) -> Any:
    return page.locator(f'[data-view=properties] [data-field="{field}"] .cell').nth(k)


def tie_cell(page: Any, field: str, k: int = 0) -> Any:
    return page.locator(f'.tie.open [data-field="{field}"] .cell').nth(k)


def choose_body(page: Any, name: str) -> None:
    page.locator(f'tr[data-name="{name}"] td.number').click()
    page.wait_for_function("(n) => pgraph.latest.properties.bodies.includes(n)", arg=name)


def typed(cell: Any, text: str) -> None:
    cell.fill(text)
    cell.press("Enter")


def test_1_5_an_impossible_inertia_is_refused_with_its_inequality_and_repaired(bench, served):
    choose_body(bench, "2")
    before = model(served)
    cell(bench, "inertia", 8).focus()
    bench.keyboard.type("1")  # said while it is typed
    bench.wait_for_selector(".offer")
    assert "triangle inequality" in bench.locator(".sentence:visible").first.inner_text()
    assert bench.locator(".refused").count() == 0
    bench.keyboard.type("e")  # no number yet: nothing is said of it
    until(lambda: bench.locator(".sentence:visible").count() == 0, "nothing said")
    bench.keyboard.press("Backspace")
    bench.wait_for_selector(".offer")
    bench.keyboard.press("Enter")
    bench.wait_for_selector(".refused")
    bench.wait_for_selector(".offer")
    assert "triangle inequality" in bench.locator(".sentence:visible").first.inner_text()
    assert model(served) is before
    bench.locator(".offer").click()
    until(lambda: model(served).body("2").inertia[2][2] == 1.0, "the repaired inertia")
    until(lambda: bench.locator(".refused").count() == 0, "no refused cell")
    bench.keyboard.press("Control+z")
    until(lambda: model(served) is before, "one undo step")


def test_1_5_an_inertia_is_typed_number_by_number(bench, served):
    choose_body(bench, "2")
    for k in (0, 4, 8):
        typed(cell(bench, "inertia", k), "7")
    until(lambda: model(served).body("2").inertia[0][0] == 7.0, "taken once it is possible")
    until(lambda: bench.locator(".refused").count() == 0, "no refused cell")


def test_1_5_shape_and_mass_from_its_density(bench, served):
    choose_body(bench, "1")
    summary = bench.locator('summary:text-is("Shape")')
    if not summary.evaluate("e => e.parentElement.open"):
        summary.click()
    cell(bench, "shape_kind").focus()
    cell(bench, "shape_kind").select_option("box")
    cell(bench, "shape_size", 2).wait_for()
    for k in range(3):
        typed(cell(bench, "shape_size", k), "100 mm")
        until(lambda k=k: model(served).body("1").shape.size[k] == 0.1, "an edge")
    typed(bench.get_by_label("Density"), "steel")  # Enter takes it as the button does
    bench.get_by_text("The density must be a number").wait_for()
    bench.get_by_label("material").select_option("7850")
    bench.locator(".take").click()
    until(lambda: abs(model(served).body("1").mass - 7.85) < 1e-12, "7.85 kg of steel")


def test_1_5_one_parameter_for_two_links_and_units_that_never_reach_the_file(bench, served):
    bench.keyboard.press("Escape")
    bench.wait_for_function("() => pgraph.latest.properties.bodies.length === 0")
    summary = bench.locator('summary:text-is("Parameters")')
    if not summary.evaluate("e => e.parentElement.open"):
        summary.click()
    bench.get_by_label("new parameter name").fill("rod")
    typed(bench.get_by_label("new parameter value"), "0.2")
    until(lambda: model(served).parameters == {"rod": 0.2}, "a parameter")
    for name in ("2", "3"):
        choose_body(bench, name)
        typed(cell(bench, "link"), "=rod")
        until(lambda n=name: any(f.name == n for f in model(served).formulas), "a formula")
    bench.locator('[data-view=properties] [data-unit="length"]').click()
    bench.wait_for_function("() => pgraph.latest.properties.display.length === 'mm'")
    typed(cell(bench, "com", 1), "5")
    until(lambda: model(served).body("3").com[1] == 0.005, "5 mm are 0.005 m")
    bench.evaluate(
        "() => { document.activeElement.blur(); pgraph.send('Select', { body: null }); }"
    )
    bench.wait_for_function("() => pgraph.latest.properties.bodies.length === 0")
    typed(bench.get_by_label("parameter value", exact=True), "0.5")
    until(lambda: model(served).body("3").link[0] == model(served).body("2").link[0] == 0.5, "both")


@pytest.mark.parametrize(
    ("field", "at", "text", "value"),
    [
        ("link", 0, "0.1 0 -2e-1", (0.1, 0.0, -0.2)), ("link", 0, "[1,2,3]", (1.0, 2.0, 3.0)),
        ("link", 1, "5, 6", (0.2, 5.0, 6.0)), ("com", 0, "(1;2; 3)", (1.0, 2.0, 3.0)),
        ("axes", 0, "z", ((0.0, 0.0, 1.0),)), ("axes", 2, "-X", ((-1.0, 0.0, 0.0),)),
        ("link", 0, "1,5", None), ("link", 1, "1 2 3", None), ("link", 0, "1 2 x", None),
        ("com", 0, "z", None),
    ],
)  # fmt: skip
def test_several_numbers_typed_into_a_cell_fill_its_row(bench, served, field, at, text, value):
    choose_body(bench, "2")
    before = model(served)
    typed(cell(bench, field, at), text)
    if value is None:
        bench.wait_for_selector(".refused")
        assert model(served) is before
        cell(bench, field, at).press("Escape")
        return
    until(lambda: getattr(model(served).body("2"), field) == value, f"{value}")
    until(lambda: bench.locator(".refused, .waiting").count() == 0, "no refused cell")
    bench.keyboard.press("Control+z")
    until(lambda: model(served) is before, "one undo step")


@pytest.mark.parametrize(
    ("field", "at", "text", "value"),
    [
        ("gravity", 0, "0 1.62 0", lambda m: m.gravity == (0.0, 1.62, 0.0)),
        ("gravity", 1, "[0, -3.7]", lambda m: m.gravity == (0.0, 0.0, -3.7)),
        ("uphill", 0, "y", lambda m: m.ground.uphill == (0.0, 1.0, 0.0)),
        ("steps", 0, "4 1 6 2 0.25", lambda m: m.ground.steps[0].model_dump()
            == {"low": (4.0, 1.0), "high": (6.0, 2.0), "height": 0.25}),
    ],
)  # fmt: skip
def test_several_numbers_fill_a_row_of_the_model(bench, served, field, at, text, value):
    bench.evaluate("() => pgraph.send('Select', { body: null })")
    bench.wait_for_function("() => pgraph.latest.properties.bodies.length === 0")
    if field == "steps":
        served.send(EditWorld(NOBODY, 1, "steps", (((), ""),)))
    until(lambda: cell(bench, field, at).count() == 1, "its cells")
    last = last_step(served)
    folded = "document.querySelectorAll('[data-view=properties] details')"
    bench.evaluate(f"() => {folded}.forEach((one) => {{ one.open = true; }})")
    typed(cell(bench, field, at), text)
    until(lambda: value(model(served)), "all of them")
    assert steps_after(last, served) == 1


def test_a_letter_is_the_axis_of_several_bodies(bench, served):
    names = ("2", "3")
    choose_body(bench, "2")
    bench.locator('tr[data-name="3"] td.number').click(modifiers=["Control"])
    bench.wait_for_function("() => pgraph.latest.properties.bodies.length === 2")
    typed(cell(bench, "axes"), "-x")
    until(lambda: all(model(served).body(n).axes == ((-1.0, 0.0, 0.0),) for n in names), "both")


@pytest.mark.parametrize("hostile", ["1e400", "<b>1</b>", "nan", "🦿", "9" * 10_000])
def test_what_is_no_number_is_refused_beside_its_cell(bench, served, hostile):
    choose_body(bench, "1")
    before = model(served)
    typed(cell(bench, "mass"), hostile)
    bench.wait_for_selector(".sentence:visible")
    assert model(served) is before
    assert bench.locator(".pgraph b").count() == 0
    cell(bench, "mass").press("Escape")
    until(lambda: bench.locator(".sentence:visible").count() == 0, "reverted")


def test_d15_close_a_loop_by_clicking_in_the_digraph_and_the_report_comes(bench, served):
    bench.evaluate("() => pgraph.front('Constraints')")
    bench.locator(".add-tie").click()
    bench.locator('[data-kind="loops spherical"]').click()
    bench.wait_for_selector(".pgraph-banner")
    bench.locator('svg.digraph g.node[data-name="3"] circle').last.click()
    bench.wait_for_function("() => pgraph.latest.constraints.picking?.text.includes(\"'3'\")")
    bench.locator('svg.digraph g.node[data-name="1"] circle').last.click()
    until(lambda: [c.name for c in model(served).constraints] == ["3-1"], "a cut joint")
    bench.wait_for_selector(".tie.open")
    bench.wait_for_function("() => pgraph.latest.digraph.loops.length === 1")
    assert bench.locator(".pgraph-banner").count() == 0
    bench.wait_for_function("() => pgraph.latest.constraints.mobility.state === 'done'")
    assert "of freedom left" in bench.locator(".report .headline").inner_text()


def test_d14_d17_a_contact_is_picked_edited_switched_and_deleted(bench, served):
    bench.evaluate("() => pgraph.front('Constraints')")
    bench.locator(".add-tie").click()
    bench.locator('[data-kind="contacts soft"]').click()
    bench.wait_for_selector(".pgraph-banner")
    bench.locator('tr[data-name="3"] td.number').click()
    bench.get_by_role("button", name="ground", exact=True).click()
    until(lambda: len(model(served).contacts) == 1, "a contact")
    bench.wait_for_function("() => pgraph.latest.table.rows[2].constraints.length === 1")
    tie_cell(bench, "stiffness").wait_for()
    typed(tie_cell(bench, "stiffness"), "-1")
    bench.wait_for_selector(".tie .sentence")
    typed(tie_cell(bench, "stiffness"), "1e5")
    until(lambda: model(served).contacts[0].stiffness == 1e5, "a stiffness")
    bench.locator('.tie input[type="checkbox"]').click()
    until(lambda: not model(served).contacts[0].active, "switched off")
    bench.locator(".delete-tie").click()
    until(lambda: not model(served).contacts, "deleted")


EDGES = """() => {
  const seen = (el) => el.offsetParent && el.getBoundingClientRect().width > 0;
  const rows = [...document.querySelectorAll('[data-view=properties] .field')].filter(seen);
  return rows.map((row) => ({
    field: row.dataset.field,
    label: row.querySelector('.what span').getClientRects().length,
    lines: row.querySelector('.what').getBoundingClientRect().height / 14.4,
    cells: [...row.querySelectorAll('.grid:not(.density) .cell')].filter(seen).map((cell) => {
      const { left, right } = cell.getBoundingClientRect();
      return { left, right, value: cell.value, cut: cell.scrollWidth > cell.clientWidth };
    }),
  }));
}"""


def test_a_form_is_one_grid_labels_take_one_line_and_no_number_is_cut(bench, served):
    served.send(OpenBuiltIn(NOBODY, "quadruped"))
    bench.wait_for_function("() => pgraph.latest.table.rows.length === 16")
    for name in ("left_radius", "pelvis"):
        choose_body(bench, name)
        rows = bench.evaluate(EDGES)
        assert len(rows) > 8
        lefts = {
            k: {row["cells"][k]["left"] for row in rows if len(row["cells"]) == 3} for k in range(3)
        }
        assert all(len(found) == 1 for found in lefts.values()), lefts
        assert len({row["cells"][0]["left"] for row in rows if row["cells"]}) == 1
        for row in rows:
            if row["field"] != "damping":  # N m s/rad stands below it
                assert row["lines"] < 1.5, row
            assert row["label"] == 1, row
            widths = [cell["right"] - cell["left"] for cell in row["cells"]]
            if row["field"] not in ("q", "v"):  # three and two in a row
                assert not widths or max(widths) - min(widths) < 1, row
            assert not any(cell["cut"] for cell in row["cells"]), row


def test_another_body_is_read_from_its_name_on(bench, served):
    choose_body(bench, "2")
    last = bench.locator("[data-view=properties] .field:visible").last
    last.scroll_into_view_if_needed()
    heading = bench.locator("[data-view=properties] .heading")
    tab = bench.get_by_role("tab", name="Properties", exact=True)

    def seen() -> bool:
        return heading.bounding_box()["y"] > tab.bounding_box()["y"]

    assert not seen()
    choose_body(bench, "3")
    until(seen, "the form at its head")


LATE = """() => { const receive = pgraph.receive; window.held = [];
  pgraph.receive = (topic, data) =>
    topic === "properties" && window.held ? window.held.push(data) : receive(topic, data);
  window.letCome = () => { const all = window.held; window.held = null;
    all.forEach((data) => receive("properties", data)); pgraph.receive = receive; }; }"""


@pytest.mark.parametrize("comes", ["before it is typed", "while it is typed", "after Enter"])
@pytest.mark.parametrize("by", ["row", "node"])
def test_what_is_typed_before_the_form_of_the_body_clicked_is_here_is_for_that_body(
    bench, served, comes, by
):
    choose_body(bench, "1")
    bench.evaluate(LATE)
    if by == "row":
        bench.locator('tr[data-name="2"] td.number').click()
    else:
        bench.locator('[data-view=digraph] [data-name="2"]').first.click()
    cell(bench, "body_length").click()
    if comes == "before it is typed":
        until(lambda: bench.evaluate("window.held.length"), "the form")
        bench.evaluate("letCome()")
    bench.keyboard.type(".2")
    if comes == "while it is typed":
        until(lambda: bench.evaluate("window.held.length"), "the form")
        bench.evaluate("letCome()")
    bench.keyboard.type("75")
    bench.keyboard.press("Enter")
    until(lambda: _link(served, "3") == 0.275, "taken")
    if comes == "after Enter":
        bench.evaluate("letCome()")
    assert [_link(served, name) for name in "123"] == [0.0, 0.2, 0.275]
    until(lambda: cell(bench, "body_length").input_value() == "0.275", "and shown")
    assert bench.locator(".properties .refused").count() == 0


def _link(served: Any, name: str) -> float:
    return max(map(abs, model(served).body(name).link))
