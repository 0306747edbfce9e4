"""Forms as a person meets them: numbers, units, repairs, lists, and what is half typed."""

import json
import re
from typing import Any

import pytest

import pgraph_core as pg
from pgraph_app import constraints
from pgraph_app.constraints.update import EditPart, OpenPart
from pgraph_app.constraints.view import choices
from pgraph_app.model import Redo, Undo
from pgraph_app.properties.update import EditBodies
from pgraph_app.properties.world import DeleteParameter, EditWorld
from pgraph_app.run import SetScenario
from pgraph_app.scenario.update import DeleteSwitch
from pgraph_app.session import Select

from ..nights import at_night
from .conftest import NOBODY, opened, until
from .on_page import (
    choose_body,
    chosen,
    field,
    nothing_refused,
    part_field,
    press_under_pointer,
    refused,
    selections,
    typed,
)


@pytest.fixture
def bench(page: Any, served: Any) -> Any:
    """The page on three hinged bodies."""
    return opened(page, served, pg.Model.serial(3))


def model(served: Any) -> Any:
    return served.store.state.model


def nobody(page: Any) -> None:
    """Nothing is selected: the form is that of the model, with all its parts unfolded."""
    page.evaluate("document.activeElement.blur(); pgraph.send('Select', { body: null })")
    page.wait_for_function("() => pgraph.latest.properties.bodies.length === 0")
    unfold(page, "properties")


def unfold(page: Any, view: str) -> None:
    page.evaluate(
        "(view) => document.querySelectorAll(`[data-view=${view}] details`)"
        ".forEach((one) => { one.open = true; })",
        view,
    )


def test_an_impossible_inertia_is_refused_with_its_offer_and_repaired(bench, served):
    choose_body(bench, "2")
    before = model(served)
    unfold(bench, "properties")
    field(bench, "inertia", 8).focus()
    bench.keyboard.type("1")  # said while it is typed
    bench.wait_for_selector(".offer")
    assert bench.locator(".refused").count() == 0
    bench.keyboard.type("e")  # no number yet: nothing is said of it
    until(lambda: bench.locator(".sentence:visible").count() == 0, "nothing said")
    bench.keyboard.press("Backspace")
    bench.wait_for_selector(".offer")
    bench.keyboard.press("Enter")
    refused(bench, "inertia")
    bench.wait_for_selector(".offer")
    assert model(served) is before
    bench.locator(".offer").click()
    until(lambda: model(served).body("2").inertia[2][2] == 1.0, "the repaired inertia")
    nothing_refused(bench)
    bench.keyboard.press("Control+z")
    until(lambda: model(served) is before, "one undo step")
    until(lambda: field(bench, "inertia", 8).input_value() != "1", "the undo on the page")
    for k in (0, 4, 8):  # number by number: taken once it is possible
        typed(field(bench, "inertia", k), "7")
    until(lambda: model(served).body("2").inertia[0][0] == 7.0, "a possible inertia")
    nothing_refused(bench)


def test_escape_leaves_a_cell_before_it_clears_the_selection(bench, served):
    choose_body(bench, "2")
    cell = field(bench, "mass")
    cell.focus()
    bench.keyboard.type("7")
    for focused in (True, False):  # what is typed is taken back, then the cell is left
        bench.keyboard.press("Escape")
        assert cell.evaluate("(cell) => cell === document.activeElement") == focused
        assert bench.evaluate("() => pgraph.latest.selection") == "2"
    assert cell.input_value() == "1"
    bench.keyboard.press("Escape")
    until(lambda: not any(selections(served)), "nothing selected")


def test_a_shape_gives_the_mass_and_bad_numbers_stay_beside_their_cells(bench, served):
    choose_body(bench, "1")
    unfold(bench, "properties")
    chosen(field(bench, "shape_kind"), "box")
    field(bench, "shape_size", 2).wait_for()
    for k in range(3):
        typed(field(bench, "shape_size", k), "100 mm")
        until(lambda k=k: model(served).body("1").shape.size[k] == 0.1, "an edge")
    typed(bench.get_by_label("Density"), "steel")  # Enter takes it as the button does
    bench.locator(".sentence:visible").first.wait_for()
    bench.get_by_label("material").select_option("7850")
    bench.locator(".take").click()
    until(lambda: abs(model(served).body("1").mass - 7.85) < 1e-12, "7.85 kg of steel")
    before, cell = model(served), field(bench, "mass")
    until(lambda: cell.input_value() == "7.85", "the mass on the page")
    for text in ("-2", "1e400", "<b>1</b>", "nan", "🦿", "9" * 10_000):
        typed(cell, text)
        refused(bench, "mass")
        assert cell.input_value() == text
        assert model(served) == before
        assert bench.locator("b", has_text=re.compile("^1$")).count() == 0
        cell.press("Escape")
        nothing_refused(bench)
    typed(cell, "1e-6")
    until(lambda: model(served).body("1").mass == 1e-6, "the corrected mass")
    bench.locator('tr[data-name="3"] td.number').click()
    bench.locator('tr[data-name="2"] td.number').click(modifiers=["Control"])
    bench.wait_for_function("() => pgraph.latest.properties.bodies.length === 2")
    typed(field(bench, "axes"), "-x")  # a letter is the axis of several bodies
    both = lambda: all(model(served).body(n).axes == ((-1.0, 0.0, 0.0),) for n in "23")  # noqa: E731
    until(both, "the axis of both")


@pytest.mark.nightly
def test_one_parameter_drives_two_links_and_units_never_reach_the_file(bench, served):
    nobody(bench)
    bench.get_by_label("new parameter name").fill("rod")
    typed(bench.get_by_label("new parameter value"), "0.2")
    until(lambda: model(served).parameters == {"rod": 0.2}, "a parameter")
    for name in ("2", "3"):
        choose_body(bench, name)
        typed(field(bench, "link"), "=rod")
        until(lambda n=name: any(f.name == n for f in model(served).formulas), "a formula")
    nobody(bench)
    unfold(bench, "properties")
    bench.locator('[data-view=properties] [data-unit="length"]').click()
    bench.wait_for_function("() => pgraph.latest.properties.display.length === 'mm'")
    choose_body(bench, "3")
    typed(field(bench, "com", 1), "5")
    until(lambda: model(served).body("3").com[1] == 0.005, "5 mm are 0.005 m")
    nobody(bench)
    typed(bench.get_by_label("parameter value", exact=True), "0.5")
    until(lambda: model(served).body("3").link[0] == model(served).body("2").link[0] == 0.5, "both")


OF_A_BODY = [
    ("link", 0, "0.1 0 -2e-1", (0.1, 0.0, -0.2)), ("link", 0, "[1,2,3]", (1.0, 2.0, 3.0)),
    ("link", 1, "5, 6", (0.2, 5.0, 6.0)), ("com", 0, "(1;2; 3)", (1.0, 2.0, 3.0)),
    ("axes", 0, "z", ((0.0, 0.0, 1.0),)), ("axes", 0, "-X", ((-1.0, 0.0, 0.0),)),
    ("link", 0, "1,5", None), ("link", 1, "1 2 3", None), ("link", 0, "1 2 x", None),
    ("com", 0, "z", None),
]  # fmt: skip
OF_THE_MODEL = [
    ("gravity", 0, "0 1.62 0", lambda m: m.gravity == (0.0, 1.62, 0.0)),
    ("gravity", 1, "[0, -3.7]", lambda m: m.gravity[1:] == (0.0, -3.7)),
    ("uphill", 0, "y", lambda m: m.ground.uphill == (0.0, 1.0, 0.0)),
    ("steps", 0, "4 1 6 2 0.25", lambda m: m.ground.steps[0].model_dump()
        == {"low": (4.0, 1.0), "high": (6.0, 2.0), "height": 0.25}),
]  # fmt: skip


def shown_of(page: Any, name: str) -> list[str]:
    cells = page.locator(f'[data-view=properties] [data-field="{name}"] .cell')
    return cells.evaluate_all("(all) => all.map((cell) => cell.value)")


def test_several_numbers_typed_into_a_cell_fill_its_row(bench, served):
    choose_body(bench, "2")
    before = model(served)
    for name, at, text, value in OF_A_BODY:
        cell, shown = field(bench, name, at), shown_of(bench, name)
        typed(cell, text)
        if value is None:
            refused(bench)
            assert model(served) is before
            cell.press("Escape")
            nothing_refused(bench)
            continue
        until(lambda n=name, v=value: getattr(model(served).body("2"), n) == v, f"{name} {value}")
        nothing_refused(bench)
        bench.keyboard.press("Control+z")
        until(lambda: model(served) is before, "one undo step")
        until(lambda n=name, v=shown: shown_of(bench, n) == v, "the row as it was")
    nobody(bench)
    served.send(EditWorld(NOBODY, 1, "steps", (((), ""),)))
    field(bench, "steps", 0).wait_for(state="attached")  # its part of the form may be folded
    nobody(bench)
    for name, at, text, right in OF_THE_MODEL:
        typed(field(bench, name, at), text)
        until(lambda right=right: right(model(served)), f"{name} {text}")


EDGES = """() => {
  const seen = (el) => el.checkVisibility() && el.getBoundingClientRect().width > 0;
  const rows = [...document.querySelectorAll('[data-view=properties] .field')].filter(seen);
  return rows.map((row) => ({
    field: row.dataset.field,
    label: row.querySelector('.what span').getClientRects().length,
    unit: row.querySelector('.what .unit').getClientRects().length,
    cells: [...row.querySelectorAll('.grid:not(.density) .cell')].filter(seen).map((cell) => {
      const { left, right } = cell.getBoundingClientRect();
      return { left, right, value: cell.value, cut: cell.scrollWidth > cell.clientWidth + 1 };
    }),
  }));
}"""


def test_a_form_is_one_grid_and_another_body_is_read_from_its_name_on(page, served, quadruped):
    opened(page, served, quadruped)
    for name in ("left_radius", "pelvis"):
        choose_body(page, name)
        rows = page.evaluate(EDGES)
        assert len(rows) > 5
        lefts = {
            k: {row["cells"][k]["left"] for row in rows if len(row["cells"]) == 3} for k in range(3)
        }
        assert all(len(found) == 1 for found in lefts.values()), lefts
        first = {row["field"]: row["cells"][0]["left"] for row in rows if row["cells"]}
        assert len(set(first.values())) == 1, first
        for one in rows:
            assert one["label"] == 1, one  # line, below which a wide unit may stand
            assert one["unit"] <= 1, one
            widths = [cell["right"] - cell["left"] for cell in one["cells"]]
            if one["field"] not in ("q", "v"):  # three and two in a row
                assert not widths or max(widths) - min(widths) < 1, one
            assert not any(cell["cut"] for cell in one["cells"]), one
    assert page.evaluate("document.documentElement.scrollWidth <= innerWidth")
    page.locator("[data-view=properties] .field:visible").last.scroll_into_view_if_needed()
    heading, panel = page.locator(".heading"), page.get_by_label("selection", exact=True)

    def seen() -> bool:
        return heading.bounding_box()["y"] >= panel.bounding_box()["y"]

    assert not seen()
    choose_body(page, "left_radius")
    until(seen, "the form at its head")


LATE = """() => { const receive = pgraph.receive; window.held = [];
  pgraph.receive = (topic, data) =>
    topic === "properties" && window.held ? window.held.push(data) : receive(topic, data);
  window.letCome = () => { const all = window.held; window.held = null;
    all.forEach((data) => receive("properties", data)); pgraph.receive = receive; }; }"""


def test_what_is_typed_before_the_form_of_the_body_clicked_is_here_is_for_that_body(bench, served):
    cases = [("row", "before"), ("row", "while"), ("row", "after"), ("node", "while")]
    for k, (by, comes) in enumerate(cases):
        choose_body(bench, "1")
        bench.evaluate(LATE)
        if by == "row":
            bench.locator('tr[data-name="2"] td.number').click()
        else:
            bench.locator('[data-view=digraph] [data-name="2"]').first.click()
        field(bench, "body_length").click()
        if comes == "before":
            bench.wait_for_function("held.length")
            bench.evaluate("letCome()")
        bench.keyboard.type(".2")
        if comes == "while":
            bench.wait_for_function("held.length")
            bench.evaluate("letCome()")
        bench.keyboard.type(f"7{k}")
        bench.keyboard.press("Enter")
        until(lambda k=k: _link(served, "3") == float(f"0.27{k}"), "taken")
        if comes == "after":
            bench.evaluate("letCome()")
        assert [_link(served, name) for name in "12"] == [0.0, 0.2]
        value = f"{float(f'0.27{k}'):g}"
        until(lambda v=value: field(bench, "body_length").input_value() == v, "and shown")
        assert bench.locator(".properties .refused").count() == 0


def _link(served: Any, name: str) -> float:
    return max(map(abs, model(served).body(name).link))


def test_half_typed_cells_live_through_edits_of_others(bench, served):
    choose_body(bench, "2")
    field(bench, "com", 1).focus()
    bench.keyboard.type("0.12")
    served.send(EditBodies(NOBODY, 1, ("2",), "joint", (((), "spherical"),)))
    bench.wait_for_function("() => JSON.stringify(pgraph.latest.properties).includes('spherical')")
    bench.keyboard.type("5")
    bench.keyboard.press("Enter")
    until(lambda: model(served).body("2").com[1] == 0.125, "all of it")
    mass = model(served).body("1").mass
    field(bench, "mass").focus()
    bench.keyboard.type("1.75")  # left for another body: committed
    served.send(Select(max(served.store.state.clients), "1"))
    until(lambda: model(served).body("2").mass == 1.75, "its own mass")
    assert model(served).body("1").mass == mass


# -- constraints and forces ------------------------------------------------------------------------


def test_a_loop_is_closed_and_a_contact_edited_by_clicks(bench, served):
    bench.evaluate("() => pgraph.front('Connections')")
    bench.locator(".add-tie").click()
    bench.locator('[data-kind="loops spherical"]').click()
    bench.wait_for_selector(".pgraph-banner")
    bench.evaluate("() => pgraph.front('Bodies')")
    bench.locator('svg.digraph g.node[data-name="3"] circle').last.click()
    bench.wait_for_function("() => pgraph.latest.constraints.picking?.text.includes(\"'3'\")")
    bench.locator('svg.digraph g.node[data-name="1"] circle').last.click()
    until(lambda: [c.name for c in model(served).constraints] == ["3-1"], "a cut joint")
    bench.evaluate("() => pgraph.front('Connections')")
    bench.wait_for_selector(".tie.open")
    bench.wait_for_function("() => pgraph.latest.digraph.loops.length === 1")
    assert bench.locator(".pgraph-banner").count() == 0
    bench.wait_for_function("() => pgraph.latest.constraints.mobility.state === 'done'")
    bench.locator(".report .headline").wait_for()

    bench.locator(".add-tie").click()
    bench.locator('[data-kind="contacts soft"]').click()
    bench.wait_for_selector(".pgraph-banner")
    bench.locator('tr[data-name="3"] td.number').click()
    bench.get_by_role("button", name="ground", exact=True).click()
    until(lambda: len(model(served).contacts) == 1, "a contact")
    bench.wait_for_function("() => pgraph.latest.table.rows[2].constraints.length === 2")
    part_field(bench, "stiffness").wait_for()
    typed(part_field(bench, "stiffness"), "-1")
    refused(bench, "stiffness")
    typed(part_field(bench, "stiffness"), "1e5")
    until(lambda: model(served).contacts[0].stiffness == 1e5, "a stiffness")
    contact = bench.locator(f'.tie[data-name="{model(served).contacts[0].name}"]')
    contact.locator('input[type="checkbox"]').first.click()
    until(lambda: not model(served).contacts[0].active, "switched off")
    press_under_pointer(contact.locator(".line"), contact.locator(".delete-tie"))
    until(lambda: not model(served).contacts, "deleted")

    choose_body(bench, "3")
    bench.evaluate("() => pgraph.front('Connections')")
    bench.locator("button.add-tie").click()
    bench.locator('[data-kind="constraints weld"]').click()
    picking = lambda: [c.picking for c in served.store.state.clients.values() if c.picking]  # noqa: E731
    until(picking, "the question for the second body")
    assert picking()[0].body == "3"
    bench.keyboard.press("Escape")


# -- rows of lists: typed in one of three while others are put in and taken out --------------------


def rows_of_all_kinds() -> pg.Model:
    """Return a model with three rows of each kind of list, equal ones of points and shapes."""
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
        parameters={"l": 1.0, "m": 2.0, "n": 3.0}, name="lists",
    )  # fmt: skip


def part(name: str, index: tuple[int, ...], text: str, of: str = "k") -> EditPart:
    return EditPart(NOBODY, 1, "contacts" if of == "k" else "constraints", of, name,
                    ((index, text),))  # fmt: skip


def body(name: str, changed: str, index: tuple[int, ...], text: str) -> EditBodies:
    return EditBodies(NOBODY, 1, (name,), changed, ((index, text),))  # type: ignore[arg-type]


KINDS: dict[str, tuple[Any, ...]] = {
    # what shows it; its tab; its rows; the cell in a row; how another takes out a row; its values
    "points": (
        OpenPart(NOBODY, "contacts", "k"), "Part",
        '[data-field="points"]:has(input)', "input",
        lambda k: part("points", (k,), ""),
        lambda m: [p[0] for p in m.contacts[0].points],
    ),
    "coefficients": (
        OpenPart(NOBODY, "constraints", "sum"), "Part",
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
        Select(NOBODY, "b"), "Properties", '[data-field="axes"]', "input",
        lambda k: body("b", "motions", (k,), ""),
        lambda m: [a[0] for a in m.body("b").axes],
    ),
    "coordinates": (
        Select(NOBODY, "b"), "Properties", '[data-field="v"] input', "",
        lambda k: body("b", "motions", (k,), ""),
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
        SetScenario(NOBODY, 1, "own"), "Scenario", ".switch", "[aria-label='at value']",
        lambda k: DeleteSwitch(NOBODY, k),
        lambda m: [s.t for s in m.scenarios[0].switches],
    ),
}  # fmt: skip


TABS = {"Scenario": "Scenarios"}  # where a view stands


NAMED = ("parameters",)  # rows that keep their ids


DAILY = ("coefficients", "coordinates", "parameters")  # others are forms as the first one


@pytest.mark.parametrize("kind", [*DAILY, *at_night(*(x for x in KINDS if x not in DAILY))])
def test_what_is_typed_stays_in_its_cell_and_lands_in_no_other_row(page, served, kind):
    event, tab, selector, inside, out, of = KINDS[kind]
    opened(page, served, rows_of_all_kinds())
    for client in served.store.state.clients:
        served.send(type(event)(**{**vars(event), "client": client}))
    page.evaluate("(tab) => pgraph.front(tab)", TABS.get(tab))
    found = page.locator(f"[data-view={tab.lower()}] {selector}")
    until(lambda: found.count() == 3, f"three rows of {kind}")
    unfold(page, tab.lower())
    values = lambda: of(served.store.state.model)  # noqa: E731

    def cell_of(k: int) -> Any:
        return found.nth(k).locator(inside).first if inside else found.nth(k)

    def shown(number: int) -> None:
        until(lambda: len(values()) == found.count() == number, f"{number} rows")

    def told() -> None:
        page.wait_for_function(
            "[...document.querySelectorAll('[role=alert]')].some((one) => one.checkVisibility())"
        )

    cell_of(1).evaluate("(cell) => { cell.focus(); window.typed = cell; }")
    page.keyboard.press("Control+a")
    page.keyboard.type("0.2")
    for change, number in ((out(0), 2), (Undo(NOBODY), 3), (Redo(NOBODY), 2)):
        served.send(change)
        shown(number)
    before = values()
    assert page.evaluate("[typed.isConnected, typed.value]") == [True, "0.2"]
    place = 0 if kind in NAMED else 1
    assert cell_of(place).evaluate("(cell) => cell === typed && cell === document.activeElement")
    page.keyboard.type("5")
    page.keyboard.press("Enter")
    if kind not in NAMED:  # refused once, since it may be another row now
        page.wait_for_function("typed.matches('.refused')")
        told()
        assert values() == before
        page.keyboard.press("Enter")
    wanted = [*before[:place], 0.25, *before[place + 1 :]]
    until(lambda: values() == pytest.approx(wanted), f"{json.dumps(wanted)}, not {values()}")

    cell_of(1).evaluate("(cell) => cell.focus()")  # the last one: it goes while it is typed in
    page.keyboard.press("Control+a")
    page.keyboard.type("0.375")
    served.send(out(2 if kind in (*NAMED, "coefficients") else 1))
    shown(1)
    left = [0.0] if kind == "coordinates" else wanted[:1]  # a changed joint starts at rest
    assert values() == pytest.approx(left)
    told()


def test_a_kind_is_found_by_typing_and_its_body_is_named(bench, served):
    choose_body(bench, "3")
    bench.evaluate("() => pgraph.front('Connections')")
    bench.locator("button.add-tie").click()
    asked = bench.get_by_role("combobox", name="'3'")
    asked.wait_for()
    bench.keyboard.type("damp")
    shown = bench.locator(".found [role=option]").all_inner_texts()
    assert all("damp" in text.lower() for text in shown)
    assert 0 < len(shown) < 20
    asked.fill("motor")
    bench.keyboard.press("Enter")
    until(lambda: [f.kind for f in model(served).forces] == ["motor"], "a motor")
    assert model(served).forces[0].body == "3"
    names = [(one["part"], one["name"]) for group in choices() for one in group["kinds"]]
    assert len(names) == len(set(names))
    assert len(names) == sum(map(len, constraints.KINDS.values()))
