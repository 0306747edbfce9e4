"""Interface 1.9 to 1.11 in the browser: files, two people, a lost connection, keys."""

from __future__ import annotations

import random
from typing import Any

import pytest

import pgraph_core as pg
from pgraph_app.model.update import Edit, OpenText, Undo
from pgraph_app.run.update import SetScenario
from pgraph_app.session.update import Select
from pgraph_app.table.view import table
from tests.test_urdf import TWO, robot

from .conftest import NOBODY, until
from .test_page import field, row


def drop(page: Any, name: str, content: str) -> None:
    """A file dropped on the page; `content` is JavaScript for its parts."""
    page.evaluate(
        """([name, content]) => {
      const data = new DataTransfer();
      data.items.add(new File(eval(content), name));
      for (const type of ['dragover', 'drop']) {
        document.body.dispatchEvent(new DragEvent(type, { dataTransfer: data, bubbles: true }));
      }
    }""",
        [name, content],
    )


@pytest.mark.parametrize(
    ("name", "content", "said"),
    [
        ("bad.json", "['{\"bodies\": 3']", "bad.json was not opened"),
        ("noise.json", "[new Uint8Array([255, 0, 254])]", "noise.json was not opened"),
        ("big.json", "[new Uint8Array(1e8)]", "it has 100.0 MB; a model file has at most 8 MB"),
    ],
)
def test_1_10_a_file_that_is_no_model_is_refused_in_a_sentence(page, served, name, content, said):
    before = served.store.state.model
    drop(page, name, content)

    def answered() -> bool:
        notices = [client.notice for client in served.store.state.clients.values()]
        return (
            any(n and n.bad and n.title == said for n in notices) or page.get_by_text(said).count()
        )

    until(answered, said)
    assert served.store.state.model is before


def test_1_10_a_mesh_dropped_on_the_page_is_the_shape_of_what_is_selected(
    page, served, tmp_path, monkeypatch
):
    monkeypatch.setenv("XDG_DATA_HOME", str(tmp_path))
    drop(page, "part.stl", "['solid broken']")
    page.get_by_text("select the body first whose shape it is").wait_for()
    row(page, "thorax").locator("td.number").click()
    page.wait_for_function("() => pgraph.latest.selected[0] === 'thorax'")
    drop(page, "huge.stl", "[new Uint8Array(1e8)]")
    page.get_by_text("it has 100.0 MB; a mesh file has at most 10 MB").wait_for()
    before = served.store.state.model
    drop(page, "part.stl", "['solid broken']")
    notices = lambda: [c.notice for c in served.store.state.clients.values()]  # noqa: E731
    until(lambda: any(n and "part.stl" in n.text for n in notices()), "a sentence")
    assert served.store.state.model is before
    corners = ((0, 0, 0), (0.1, 0, 0), (0, 0.1, 0), (0, 0, 0.1))
    faces = ("3 0 2 1", "3 0 1 3", "3 0 3 2", "3 1 2 3")
    lines = ["OFF", "4 4 6", *(" ".join(map(str, c)) for c in corners), *faces]
    drop(page, "part.off", f"[{chr(10).join(lines)!r}]")
    until(lambda: served.store.state.model.body("thorax").shape.kind == "mesh", "its shape")


def test_1_10_a_model_dropped_on_the_page_is_opened(page, served):
    drop(page, "two.json", """['{"name": "two", "bodies": [{"name": "a"}, {"name": "b"}]}']""")
    row(page, "b").wait_for()
    assert [body.name for body in served.store.state.model.bodies] == ["a", "b"]
    page.keyboard.press("Control+z")
    row(page, "pelvis").wait_for()


def test_1_11_two_pages_edit_at_once_and_agree(page, open_page, served):
    """25 edits from each; a half-typed cell is left alone, and undo leads back to the start."""
    start = served.store.state.model
    other = open_page()
    try:
        half = row(other, "pelvis").locator("input.name")
        half.fill("half-typed")
        row(page, "pelvis").locator(".others i").wait_for()  # where the other is
        rng = random.Random(3)
        for k in range(25):
            for at in (page, other):
                body = rng.choice(list(start.row))
                field, text = rng.choice(
                    (("mass", str(1 + k)), ("dof", str(k % 4)), ("name", "pelvis"))
                )
                at.evaluate(
                    "([k, body, field, text]) => pgraph.send('Edit', "
                    "{ serial: 10000 + k, body, field, index: [], text })",
                    [k, body, field, text],
                )
        last = "() => { pgraph.send('Select', { body: 'thorax' }); return true; }"
        assert page.evaluate(last) and other.evaluate(last)  # noqa: PT018
        until(  # senders take turns, and each one's events are in order: all edits are done
            lambda: [p.selection for p in served.store.state.clients.values()].count("thorax") >= 2,
            "the last event of both",
        )
        expected = None

        def agreed() -> bool:
            nonlocal expected
            expected = [row["joint"] for row in table(served.store.state)["rows"]]
            seen = "() => pgraph.latest.table.rows.map((row) => row.joint)"
            return page.evaluate(seen) == expected == other.evaluate(seen)

        until(agreed, "both pages on the model")
        assert half.input_value() == "half-typed"
        steps = [step.model is start for step in reversed(served.store.state.undo)].index(True) + 1
        for _ in range(steps):
            served.send(Undo(NOBODY))
        until(lambda: served.store.state.model is start, "the start")
        other.keyboard.press("Escape")
    finally:
        other.close()
    until(lambda: page.locator(".others i").count() == 0, "no mark when that page is gone")


def test_1_11_a_page_that_comes_back_has_its_rows_selected_and_its_cell_half_typed(page, served):
    row(page, "thorax").locator("td.number").click()
    row(page, "lumbar").locator("td.number").click(modifiers=["Shift"])
    until(lambda: page.locator("tr.selected").count() == 2, "two rows")
    half = row(page, "pelvis").locator("input.name")
    half.evaluate("(cell) => { cell.value = 'half-typed'; }")
    before = set(served.store.state.clients)
    served.viser._websock_server.disconnect_all_clients()
    until(lambda: set(served.store.state.clients) - before, "the page to come back")

    def selections() -> list[tuple[str, ...]]:
        return [page.selected for page in served.store.state.clients.values()]

    until(lambda: selections() == [("lumbar", "thorax")], "both rows")
    assert half.input_value() == "half-typed"
    half.press("Escape")


def test_1_11_forms_keep_what_is_half_typed_and_their_units_through_a_lost_connection(page, served):
    row(page, "left_femur").locator("td.number").click()
    page.wait_for_function("() => pgraph.latest.properties.bodies[0] === 'left_femur'")
    page.locator('[data-view=properties] [data-unit="length"]').click()
    page.wait_for_function("() => pgraph.latest.properties.display.length === 'mm'")
    field(page, "link", 1).fill("-3")
    page.evaluate("window.kept = document.activeElement")
    before = set(served.store.state.clients)
    served.viser._websock_server.disconnect_all_clients()
    until(lambda: set(served.store.state.clients) - before, "the page to come back")
    now = lambda: [c.display.length for c in served.store.state.clients.values()]  # noqa: E731
    until(lambda: now() == ["mm"], "its units")
    until(lambda: page.evaluate("kept.isConnected"), "the cell itself again")
    assert field(page, "link", 1).input_value() == "-3"
    field(page, "link", 1).press("Enter")
    until(lambda: served.store.state.model.body("left_femur").link[1] == -0.003, "3 mm")
    page.locator('[data-view=properties] [data-unit="length"]').click()


def test_1_11_a_joint_changed_by_another_leaves_the_half_typed_cell_and_its_focus(page, served):
    row(page, "left_femur").locator("td.number").click()
    page.wait_for_function("() => pgraph.latest.properties.bodies[0] === 'left_femur'")
    field(page, "com", 1).focus()
    page.keyboard.type("0.12")
    served.send(Edit(NOBODY, 1, "left_femur", "joint", (), "spherical"))
    page.wait_for_function("() => pgraph.latest.properties.subtitle.includes('spherical')")
    page.keyboard.type("5")
    page.keyboard.press("Enter")
    until(lambda: served.store.state.model.body("left_femur").com[1] == 0.125, "all of it")


def test_1_3_a_cell_left_for_another_body_in_the_digraph_is_committed(page, served):
    row(page, "left_femur").locator("td.number").click()
    page.wait_for_function("() => pgraph.latest.properties.bodies[0] === 'left_femur'")
    mass = served.store.state.model.body("pelvis").mass
    field(page, "mass").focus()
    page.keyboard.type("1.75")
    served.send(Select(max(served.store.state.clients), "pelvis"))
    until(lambda: served.store.state.model.body("left_femur").mass == 1.75, "its own mass")
    assert served.store.state.model.body("pelvis").mass == mass


def test_nothing_of_the_model_before_is_left_on_the_page(page, served):
    """Not in what is hidden either; what was half typed is not put into a body of the same name."""
    zebra = pg.Force(name="zebra", kind="servo", body="2", kp=1.0)
    own = pg.Scenario(
        name="zebra run", t_end=1.0, forces=(zebra.model_copy(update={"name": "zebra drive"}),),
        switches=(pg.Switch(constraint="zebra tie", t=0.5, active=False),),
    )  # fmt: skip
    tie = pg.Constraint(name="zebra tie", kind="point", body="3")
    model = pg.Model.serial(3).replace(forces=(zebra,), constraints=(tie,), scenarios=(own,))
    served.send(OpenText(NOBODY, "zebras", model.to_json()))
    until(lambda: page.locator("tr[data-name='3']").count(), "three bodies")
    client = max(served.store.state.clients)
    served.send(SetScenario(client, 1, "zebra run"))
    page.get_by_role("tab", name="Scenario").click()
    until(
        lambda: page.locator(".drives .tie").count() == page.locator(".switch").count() == 1, "it"
    )
    page.get_by_role("tab", name="Operators").click()
    value = page.locator('[data-view="operators"] .value')
    until(lambda: "3 × 3" in value.inner_text(), "the mass matrix of three bodies")
    row(page, "2").locator("td.number").click()
    page.wait_for_function("() => pgraph.latest.properties.bodies[0] === '2'")
    field(page, "mass").focus()
    page.keyboard.type("7.5")
    served.send(OpenText(NOBODY, "plain", pg.Model.serial(4).to_json()))
    until(lambda: "4 × 4" in value.inner_text(), "the one of four")
    assert served.store.state.model.body("2").mass == model.body("2").mass
    assert "7.5" in page.locator(".pgraph-toast").inner_text()
    left = "() => [...document.querySelectorAll('[data-view]')].filter((host) => host.textContent.includes('zebra')).map((host) => host.dataset.view)"  # noqa: E501
    assert page.evaluate(left) == []
    page.get_by_role("tab", name="Digraph").click()


def test_the_question_mark_lists_the_keys(page):
    page.keyboard.press("?")
    sheet = page.get_by_role("dialog", name="keyboard shortcuts")
    sheet.wait_for()
    assert "undo" in sheet.inner_text()
    page.keyboard.press("Escape")
    until(lambda: sheet.count() == 0, "the sheet closed")


def test_every_command_of_the_palette_does_something(page, served):
    """Those that open a tab, a question or a model, by the words that a person types."""
    for words, sign in (
        ("Show plots", '[role="tab"][title="Plots"][aria-selected="true"]'),
        ("Stability map", '[role="tab"][title="Report"][aria-selected="true"]'),
        ("Show the pose", '[role="tab"][title="Pose"][aria-selected="true"]'),
        ("New model", '.asked[data-asked="newQuestion"]'),
    ):
        page.locator("input.search").click()  # from a field, too
        page.keyboard.press("Control+k")
        box = page.get_by_placeholder("Search commands...")
        box.wait_for()
        box.fill(words)
        page.get_by_text(words, exact=True).locator("visible=true").first.wait_for()
        page.keyboard.press("Enter")
        page.locator(sign).first.wait_for()
        box.wait_for(state="hidden")
    page.locator("button.new").click()  # which closes its question
    page.evaluate("() => { pgraph.front('Digraph'); pgraph.front('Properties'); }")


def test_1_1_a_question_answered_by_nothing_is_refused_too(page, served):
    page.locator("button.new").click()
    cell = page.get_by_label("How many bodies?")
    for text, given in (("x", "'x'"), ("", "''")):
        cell.fill(text)
        cell.press("Enter")
        page.get_by_text(f"must be a whole number from 1 to 1000; given {given}").wait_for()
    cell.press("Escape")
    until(lambda: cell.count() == 0, "the question gone")


def test_a_dropped_urdf_opens_with_a_report_whose_lines_lead_to_bodies(page, served):
    """Its lines are buttons; the model and the list stand beside each other."""
    before = served.store.state.model
    try:
        drop(page, "arm.urdf", f"[{robot(*TWO)!r}]")
        sheet = page.get_by_role("dialog", name="report of the file")
        sheet.wait_for(timeout=60_000)
        assert [b.name for b in served.store.state.model.bodies] == ["base", "upper", "lower"]
        line = sheet.get_by_role("button").filter(has_text="joint 'slide'")
        line.click()
        clients = lambda: served.store.state.clients.values()  # noqa: E731
        until(lambda: any(c.selection == "lower" for c in clients()), "the body is selected")
        sheet.get_by_role("button", name="Close").click()
        assert not sheet.count()
    finally:
        served.store.send(Undo(NOBODY))
        until(lambda: served.store.state.model == before, "the model is back")
