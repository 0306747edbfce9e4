"""Live runs, plots and what comes after a run, in a real browser (interface 1.7, 1.8, 1.10)."""

from __future__ import annotations

import pytest

import pgraph_core as pg
from pgraph_app.model.update import OpenText
from pgraph_app.plots.update import Plot
from pgraph_app.report.update import SetReport
from pgraph_app.run.update import StopLive
from pgraph_app.server import Server

from .conftest import NOBODY, until


@pytest.fixture
def two_rods(page, served: Server):
    """The page on two swinging rods."""
    model = pg.Model.serial(2)
    until(lambda: served.store.state.kernels.ready, "compiled kernels", seconds=300)
    served.send(OpenText(NOBODY, "rods", model.to_json()))
    until(lambda: page.locator("table.bodies tr[data-name]").count() == 2, "two rods")
    yield page
    served.send(StopLive(NOBODY))
    for client in served.store.state.clients:
        for kind in ("q", "energy"):
            served.send(Plot(client, kind, "1" if kind == "q" else "", False))


def test_live_it_plays_while_it_computes_and_follows_an_edit(two_rods, served):
    page = two_rods
    page.locator("button.live").click()
    until(lambda: served.store.state.t_end > 0.2, "a live run")
    until(lambda: "at 0." not in page.locator(".lively .said").inner_text(), "its time said")
    page.locator('tr[data-name="2"] td').first.click()
    mass = page.locator('[aria-label^="Mass"], [data-field="mass"] input').first
    mass.fill("5")
    mass.press("Enter")
    until(lambda: served.store.state.run.result.mechanism.model.body("2").mass == 5, "the edit")
    page.locator("button.play").click()
    until(lambda: not served.store.state.live.running, "a pause")
    page.locator("button.stop").click()
    until(lambda: page.locator(".after").is_visible(), "the run to keep")
    assert served.store.state.run.result.t[-1] > 0.2


def test_what_is_refused_in_the_settings_is_not_simulated_and_told(two_rods, served):
    page, before = two_rods, served.store.state.last_run
    duration = page.get_by_label("duration", exact=True).first
    duration.fill("-1")
    duration.press("Enter")
    page.locator('[data-view="run"] .refused').wait_for()
    page.locator("button.simulate").click()
    page.get_by_text("Nothing was simulated: the duration “-1” is refused").wait_for()
    assert served.store.state.last_run is before
    assert page.evaluate("document.activeElement.ariaLabel") == "duration"
    duration.fill("0.1")
    page.locator("button.simulate").click()  # which takes what is being typed
    until(lambda: served.store.state.last_run is not before, "a run")
    assert served.store.state.last_run.result.t[-1] == pytest.approx(0.1)


def test_a_click_on_a_quantity_plots_it_and_the_cursor_follows(two_rods, served):
    page = two_rods
    page.locator("button.simulate").click()
    page.locator(".summary dd").first.wait_for()
    page.get_by_role("tab", name="Plots").click()
    page.locator('tr[data-name="1"] td').first.click()
    page.locator('.chip-button[data-kind="q"][data-of="1"]').click()
    page.locator('.chip-button[data-kind="energy"]').click()
    until(lambda: page.locator("figure.plot").count() == 2, "two charts")
    chart = page.locator("canvas.chart").first
    box = chart.bounding_box()
    chart.click(position={"x": 52 + (box["width"] - 60) / 2, "y": 60})
    until(lambda: abs(served.store.state.playback.time - 1.0) < 0.05, "the middle of the run")
    legend = page.locator("figure.plot .legend").first
    shown = served.store.state.run.result
    frame = abs(shown.t - served.store.state.playback.time).argmin()
    until(lambda: f"{shown.q[frame, 0]:.3g}"[:5] in legend.inner_text(), "the value there")
    page.locator("figure.plot .remove").first.click()
    until(lambda: page.locator("figure.plot").count() == 1, "one chart")
    page.get_by_role("tab", name="Digraph").click()


def test_a_report_is_measured_shown_and_enlarged(two_rods, served):
    page = two_rods
    client = next(iter(served.store.state.clients))
    served.send(SetReport(client, 1, "t_end", "0.05"))
    page.get_by_role("tab", name="Report").click()
    page.locator("button.precision").click()
    page.locator(".outcome .figure svg").wait_for(timeout=60_000)
    assert page.locator(".outcome .advice").inner_text().startswith("Take ")
    assert page.locator(".outcome .rows tbody tr").count() > 5
    page.locator(".outcome .figure").click()
    large = page.locator(".figure-large svg")
    until(lambda: large.bounding_box()["width"] > 700, "the figure over all panels")
    page.keyboard.press("Escape")
    until(lambda: page.locator(".figure-large").count() == 0, "the page again")
    page.get_by_role("tab", name="Digraph").click()


def test_a_run_is_downloaded_as_a_table(two_rods, served):
    page = two_rods
    page.locator("button.simulate").click()
    page.locator(".after").wait_for()
    with page.expect_download() as download:
        page.get_by_role("button", name="Export …", exact=True).click()
        page.locator("button.export.csv").click()
    text = download.value.path().read_text()
    assert text.splitlines()[0].startswith("t [s],")
    assert len(text.splitlines()) == len(served.store.state.run.result.t) + 1


def chosen(select, value: str) -> None:
    """A drop-down is filled when it is opened."""
    select.focus()
    select.select_option(value)


def test_d14_a_constraint_goes_off_by_a_condition_set_by_clicks(two_rods, served):
    """A tie of the second rod opens at a force; the log has it, and a click goes there."""
    page, store = two_rods, served.store
    tie = pg.Constraint(name="tie", kind="point", body="2", point=(0.0, 0.0, 0.0))
    served.send(OpenText(NOBODY, "tied", pg.Model.serial(2).add(tie).to_json()))
    until(lambda: store.state.model.constraints, "the tied rods")
    page.get_by_role("tab", name="Constraints").click()
    page.locator(".tie button.when").click()
    switch = page.locator(".switch")
    switch.wait_for()
    until(lambda: store.state.model.scenarios, "a scenario")
    assert store.state.request.scenario == store.state.model.scenarios[0].name
    chosen(switch.get_by_label("when", exact=True), "force")
    value = switch.get_by_label("value")
    until(lambda: value.input_value() == "50", "a force to begin with")
    value.fill("-1")
    value.press("Enter")
    until(lambda: "above -1" in str(store.state.model.scenarios[0].switches[0].when), "-1 N")
    chosen(switch.get_by_label("above or below"), "below")
    page.locator(".going .sentence").first.wait_for()
    assert "not below 0" in page.locator(".going .sentence").first.inner_text()
    assert str(store.state.model.scenarios[0].switches[0].when) == "force of tie above -1"
    value.fill("0.5")
    value.press("Enter")
    until(lambda: "above 0.5" in str(store.state.model.scenarios[0].switches[0].when), "0.5 N")
    page.locator("button.simulate").click()
    page.locator(".scenario .log .fall").first.click()
    opened = store.state.run.result.events[0]
    assert (opened.contact, opened.after) == ("tie", "off")
    until(lambda: store.state.playback.time == pytest.approx(opened.t), "the time of the event")
