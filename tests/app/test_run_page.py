"""Runs as a person meets them: play, scrub, live, cancel, plots, operators, reports, export."""

import math
from typing import Any

import numpy as np
import pytest

import pgraph_core as pg
from pgraph_app.gait import Play
from pgraph_app.playback import Loop, Pause
from pgraph_app.plots import Plot
from pgraph_app.report import SetReport
from pgraph_app.server import Server

from .conftest import opened, until
from .on_page import (
    choose_body,
    chosen,
    client_of,
    field,
    notice,
    place,
    pose_of_all,
    press_under_pointer,
    refused,
    row,
    simulate,
    typed,
)


@pytest.fixture
def rods(page: Any, served: Server, compiled: Server) -> Any:
    """The page on two swinging rods."""
    opened(page, served, pg.Model.serial(2).replace(name="rods"))
    yield page
    for client in served.store.state.clients:
        for kind, of in (("q", "1"), ("energy", "")):
            served.send(Plot(client, kind, of, False))


def simulated(page: Any, served: Server) -> Any:
    """A run more, shown."""
    before = served.store.state.last_run
    simulate(page)
    until(lambda: served.store.state.last_run is not before, "a run")
    page.locator("[data-view=trust] .verdict .link").wait_for()
    return served.store.state.last_run.result


def test_a_run_is_simulated_played_scrubbed_hidden_by_an_edit_and_exported(rods, served):
    page, before = rods, served.store.state.last_run
    rest = until(lambda: place(page, "/bodies/2"), "the second rod")
    page.locator("button.method").click()
    duration = page.get_by_label("duration", exact=True).first
    typed(duration, "-1")
    refused(page, "duration")
    simulate(page)
    notice(page, "duration", "-1")
    assert served.store.state.last_run is before
    assert page.evaluate("document.activeElement.ariaLabel") == "duration"
    duration.fill("1")
    result = simulated(page, served)  # which takes what is being typed
    assert result.t[-1] == pytest.approx(1.0)
    trust = page.locator("[data-view=trust]")
    assert trust.get_attribute("data-level") == "good"
    assert "Energy drift" in trust.inner_text()
    assert "Cost" not in trust.inner_text()  # but in the report
    trust.get_by_role("button", name="Report").click()
    assert "Cost" in page.locator(".summary").first.inner_text()

    until(lambda: served.store.state.playback.time > 0, "the run is shown once")
    page.locator("button.back").click()
    until(lambda: not served.store.state.playback.moves, "the start, at rest")
    page.wait_for_function("!pgraph.latest.playback.playing")  # what Play does depends on it
    until(lambda: place(page, "/bodies/2") == pytest.approx(rest, abs=1e-6), "the rod at rest")
    start = place(page, "/bodies/2")
    page.locator("button.play").click()
    until(lambda: served.store.state.playback.playing, "it to play again")
    page.wait_for_function("pgraph.latest.playback.playing")
    until(lambda: place(page, "/bodies/2") != start, "the rod to move")
    page.locator("button.play").click()
    until(lambda: not served.store.state.playback.moves, "a pause")
    scrub = "(e) => { e.value = 0.5; e.dispatchEvent(new Event('input')); }"
    page.locator("input.scrub").evaluate(scrub)
    until(lambda: served.store.state.playback.time == 0.5, "the middle")
    page.wait_for_function("pgraph.latest.time[0] === 0.5")
    until(lambda: place(page, "/bodies/2") != start, "another pose")
    page.locator("button.more").click()
    until(lambda: served.store.state.playback.time > 0.5, "one frame on")
    page.locator("button.back").click()
    until(lambda: served.store.state.playback.time == 0.0, "the start")
    until(lambda: place(page, "/bodies/2") == pytest.approx(rest, abs=1e-6), "the first pose")
    page.locator("select.speed").select_option("0.25")
    page.locator("button.loop").click()
    until(lambda: not served.store.state.playback.loop, "no repeating")
    assert served.store.state.playback.speed == 0.25
    page.locator("button.loop").click()
    page.locator("select.speed").select_option("1")

    page.get_by_role("tab", name="Compare").click()
    page.locator("button.keep-run").click()
    name = page.get_by_label("name of a kept run")
    typed(name, "first")
    until(lambda: [run.name for run in served.store.state.runs] == ["first"], "a kept run")
    page.get_by_label("drop the run").click()
    until(lambda: served.store.state.runs == (), "no kept run")
    with page.expect_download() as download:
        page.locator("button.exports").click()
        page.locator("button.export.csv").click()
    text = download.value.path().read_text()
    assert text.splitlines()[0].startswith("t [s],")
    assert len(text.splitlines()) == len(result.t) + 1

    choose_body(page, "1")
    typed(field(page, "mass"), "7")
    until(lambda: page.locator("button.play.stale").count() == 1, "a run of before the edit")
    page.locator("button.undo").click()
    until(lambda: page.locator("button.play.stale").count() == 0, "the run again")


def test_a_live_run_follows_an_edit_and_a_long_run_is_cancelled(rods, served):
    page = rods
    page.locator(".modes .live").click()
    page.locator("button.play").click()
    until(lambda: served.store.state.t_end > 0.2, "a live run")
    choose_body(page, "2")
    typed(field(page, "mass"), "5")
    until(lambda: served.store.state.run.result.mechanism.model.body("2").mass == 5, "the edit")
    page.locator("button.play").click()
    until(lambda: not served.store.state.live.running, "a pause")
    page.locator(".modes .run").click()
    until(lambda: served.store.state.live is None, "the run joined")
    assert served.store.state.run.result.t[-1] > 0.2

    page.locator("button.method").click()
    for label, text in (("duration", "3600"), ("step", "0.0001")):
        typed(page.get_by_label(label, exact=True), text)
    until(lambda: served.store.state.request.step == 1e-4, "a long run's settings")
    page.keyboard.press("Escape")
    simulate(page)
    until(lambda: served.store.state.job, "the run under way")
    page.get_by_role("button", name="cancel", exact=True).click()
    until(lambda: served.store.state.job is None, "the run cancelled")
    page.locator("[data-view=trust]").filter(has_text="cancelled").wait_for()


@pytest.mark.nightly
def test_play_after_a_live_run_computes_the_run_of_the_settings(rods, served):
    page = rods
    page.locator(".modes .live").click()
    page.locator("button.play").click()
    until(lambda: served.store.state.t_end > 0.1, "a live run")
    page.locator(".modes .run").click()
    until(lambda: served.store.state.live is None, "the run joined")
    recorded = served.store.state.last_run
    page.locator("button.play.stale").click()
    until(lambda: served.store.state.last_run is not recorded, "another run")
    state = served.store.state
    assert (state.last_run.ended, state.last_run.request) == ("", state.request)
    assert state.last_run.result.t[-1] == pytest.approx(state.request.t_end)
    page.locator("button.loop[aria-pressed=false]").click()  # shown once until now
    until(lambda: not served.store.state.playback.preview, "repeating")
    assert served.store.state.playback.loop
    page.locator("button.loop[aria-pressed=true]").wait_for()


SINE = """() => {  // 2 sin(2 pi 3 t) about 5, for 10 s at uneven times: its peak in the spectrum
  const t = Array.from({ length: 1500 }, (_, k) => 10 * (k / 1499) ** 1.1);
  const y = t.map((x) => 5 + 2 * Math.sin(2 * Math.PI * 3 * x));
  const found = pgraph.curves.amplitudes({ t, y }, [0, 10]), top = Math.max(...found.y);
  return [found.t[found.y.indexOf(top)], top]; }"""


POSE = """() => [document.querySelector("[data-view=joints] .at").textContent,
  [...document.querySelectorAll("[data-view=joints] .joint [type=range]")].map((s) => +s.value)]"""


def test_the_pose_is_that_of_the_time_in_its_heading_also_while_a_run_plays(rods, served):
    """The heading read the time of the picture, the numbers were those of the last stop."""
    pose_of_all(rods)
    result = simulated(rods, served)
    seen = {}

    def read():
        heading, values = rods.evaluate(POSE)
        if heading.startswith("run at "):  # not the pose of the model
            time = float(heading.removeprefix("run at ").removesuffix(" s"))
            frame = int(np.abs(result.t - time).argmin())
            assert result.t[frame] == pytest.approx(time, abs=6e-4)
            assert values == pytest.approx(result.q[frame].tolist(), abs=1e-9)
            seen[time] = values
        return heading

    until(lambda: not served.store.state.playback.moves, "the end of the preview")
    served.send(Loop(client_of(served), True))
    served.send(Play(client_of(served)))
    until(lambda: (read(), len(seen) > 4)[1], "the pose to follow")
    assert len({tuple(values) for values in seen.values()}) > 4
    served.send(Pause(client_of(served)))
    served.send(Loop(client_of(served), False))
    until(lambda: not served.store.state.playback.moves, "a pause")
    now = served.store.state.playback.time
    stopped = f"run at {result.t[np.abs(result.t - now).argmin()]:.3f} s"
    until(lambda: read() == stopped, "the pose where it stopped")


FIGURES = """([of, n, span, uneven, about, way, damping]) => {  // of a curve
  const t = Array.from({ length: n }, (_, k) => span * (k / (n - 1)) ** uneven);
  const w = 10, z = damping, wd = w * Math.sqrt(Math.max(0, 1 - z * z));
  const curves = {
    step: (x) => 1 - Math.exp(-z * w * x) * (Math.cos(wd * x) + (z * w / wd) * Math.sin(wd * x)),
    lag: (x) => 1 - Math.exp(-x), sine: (x) => Math.sin(w * x + 0.3),
    pulse: (x) => Math.exp(-z * w * x) * Math.sin(wd * x),
    still: (x) => 3e-16 * Math.sin(1e4 * x) };
  const y = t.map((x) => about + way * curves[of](x));
  return pgraph.curves.figures({ t, y }, [0, span], Math.max(...y.map(Math.abs))); }"""


def test_the_ruler_names_a_step_and_a_frequency_only_where_there_is_one(rods):
    """Constant curves had an overshoot of 1040 % and 15 Hz, and unsettled ones a wrong one."""

    def said(of, n, span, uneven=1.0, about=0.0, way=1.0, damping=0.25):
        return rods.evaluate(FIGURES, [of, n, span, uneven, about, way, damping])

    for about in (1.0, -0.3, 1e6, 1e-9):
        for n in (3, 200, 2000):
            found = said("still", n, 3.0, about=about, way=about)
            assert (found["step"], found["frequency"]) == (None, None)
            assert found["mean"] == pytest.approx(about)
    shapes = [(1.0, 0.0, 1.0), (1.1, 7.0, -3.0), (0.9, -2e3, 1e3), (1.0, 1e-6, 1e-6)]
    for uneven, about, way in shapes:
        shape = {"uneven": uneven, "about": about, "way": way}
        for damping in (0.05, 0.1, 0.25):
            found = said("step", 2000, 12.0 if damping == 0.05 else 6.0, damping=damping, **shape)
            root = math.sqrt(1 - damping**2)
            overshoot = math.exp(-math.pi * damping / root)
            assert found["step"]["overshoot"] == pytest.approx(overshoot, rel=3e-3)
            assert found["frequency"] == pytest.approx(10 * root / (2 * math.pi), rel=3e-3)
        early = said("step", 600, 2.0, damping=0.05, **shape)  # has not settled
        assert early["step"] == {"settled": False}
        assert early["frequency"] == pytest.approx(
            10 * math.sqrt(1 - 0.05**2) / (2 * math.pi), rel=3e-3
        )
        assert said("step", 200, 1.0, **shape)["frequency"] is None  # fewer than two periods
        found = said("lag", 600, 8.0, **shape)
        assert found["step"]["overshoot"] < 2e-3
        assert found["step"]["time"] == pytest.approx(-math.log(0.02), rel=0.02)
        assert found["frequency"] is None
        assert said("lag", 600, 3.0, **shape)["step"] == {"settled": False}
        assert said("sine", 900, 4.0, **shape)["frequency"] == pytest.approx(
            10 / (2 * math.pi), rel=1e-3
        )
        assert said("sine", 300, 1.2, **shape)["frequency"] is None  # two periods, in part beyond
        found = said("pulse", 2000, 9.0, **shape)["step"]  # it returns to where it began
        t = np.linspace(0.0, 9.0, 90_001)
        y = np.exp(-2.5 * t) * np.sin(10 * math.sqrt(1 - 0.25**2) * t)
        late = t[np.flatnonzero(np.abs(y) > 0.02 * np.ptp(y))[-1]]
        assert found["settled"]
        assert found["overshoot"] is None
        assert found["time"] == pytest.approx(late, rel=0.01)


@pytest.mark.nightly
def test_ready_plots_replace_one_another_or_stand_side_by_side(rods, served):
    page = rods
    simulated(page, served)
    page.locator("button.plots").click()
    chips = page.get_by_role("toolbar", name="ready plots")
    kinds = "() => [...document.querySelectorAll('figure.plot')].map((one) => one.dataset.kind)"
    for chip, keys, plotted in (
        ("Poses", [], ["poses"]), ("Energy", [], ["energy"]),
        ("Poses", ["Control"], ["energy", "poses"]), ("Energy", [], ["poses"]),
    ):  # fmt: skip
        chips.get_by_text(chip, exact=True).click(modifiers=keys)
        until(lambda: page.evaluate(kinds) == plotted, f"{plotted}")  # noqa: B023
    assert chips.locator('[aria-pressed="true"]').all_inner_texts() == ["Poses"]


def test_quantities_are_plotted_and_operators_read_under_the_pointer(rods, served):
    page = rods
    result = simulated(page, served)
    row(page, "1").locator("td").first.click()
    page.wait_for_function("() => pgraph.latest.selected[0] === '1'")
    page.wait_for_function("() => (pgraph.latest.signals?.body ?? '1') === '1'")
    page.locator("button.plots").click()
    for client in served.store.state.clients:  # the first look of a page has begun with it
        served.send(Plot(client, "q", "1", True))
    page.locator('figure.plot[data-kind="q"]').wait_for()
    page.locator("button.add-plot").click()
    page.locator('.chip-button[data-kind="energy"]').click()
    until(lambda: page.locator("figure.plot").count() == 2, "two charts")
    page.keyboard.press("Escape")
    chart = page.locator("canvas.chart").first
    chart.evaluate("(one) => one.closest('figure').scrollIntoView()")  # the new one is in sight
    box = chart.bounding_box()
    strip = page.locator("input.scrub").bounding_box()  # one time axis with the chart above it
    page.mouse.click(strip["x"] + strip["width"] / 2, box["y"] + 60)
    until(lambda: abs(served.store.state.playback.time - result.t[-1] / 2) < 0.1, "the middle")
    legend = page.locator("figure.plot .legend").first

    def value_there() -> str:
        frame = abs(result.t - served.store.state.playback.time).argmin()
        return f"{result.q[frame, 0]:.3g}"[:5].replace("-", "−")

    until(lambda: value_there() in legend.inner_text(), "the value there")
    page.locator("button.measure").click()
    assert page.locator(".measures").first.locator("tr").count() == 2
    page.locator("button.measure").click()
    peak = page.evaluate(SINE)
    assert peak[0] == pytest.approx(3.0, abs=0.1)
    assert peak[1] == pytest.approx(2.0, rel=0.02)
    page.locator("figure.plot .remove").first.click()
    until(lambda: page.locator("figure.plot").count() == 1, "one chart")

    page.get_by_role("tab", name="Matrices").click()
    value = page.locator('[data-view="operators"] .value')
    until(lambda: "2 × 2" in value.inner_text(), "the mass matrix")
    page.locator("canvas.cells").hover(position={"x": 3, "y": 3})
    until(lambda: "M[1, 1]" in value.inner_text().replace(" 1,", ","), "its first entry")
    symbols = page.get_by_label("operator", exact=True)
    assert {"M", "C", "J", "ε_φ", "Φ", "S", "Ω", "Eq. 24"} < {
        *symbols.locator("button").all_inner_texts()
    }
    symbols.get_by_text("θ″", exact=True).click()
    until(lambda: "1 × 2" in value.inner_text(), "the accelerations of the frame")
    symbols.get_by_text("S", exact=True).click()
    page.locator('[data-view=operators] button[value="S"][aria-pressed="true"]').wait_for()
    page.get_by_role("tab", name="Compare").click()
    idle = lambda: all(c.inspected is None for c in served.store.state.clients.values())  # noqa: E731
    until(idle, "nothing computed out of view")


@pytest.mark.nightly
def test_a_report_is_measured_shown_and_enlarged(rods, served):
    page = rods
    served.send(SetReport(client_of(served), 1, "t_end", "0.05"))
    page.evaluate("pgraph.front('Accuracy')")
    page.locator("button.precision").click()
    page.locator(".outcome .figure svg").wait_for()
    assert page.locator(".outcome .advice").inner_text()
    assert page.locator(".outcome .rows tbody tr").count() > 5
    page.locator(".outcome .figure").click()
    large = page.locator(".figure-large [role=img]")
    until(lambda: large.bounding_box()["width"] > 600, "the figure over all panels")
    page.keyboard.press("Escape")
    until(lambda: page.locator(".figure-large").count() == 0, "the page again")


def test_a_constraint_goes_off_by_a_condition_set_by_clicks(page, served, compiled):
    """A tie of the second rod opens at a force. The log has the event, and a click goes there."""
    store = served.store
    tie = pg.Constraint(name="tie", kind="point", body="2", point=(0.0, 0.0, 0.0))
    opened(page, served, pg.Model.serial(2).add(tie).replace(name="tied"))
    page.get_by_role("tab", name="Connections").click()
    press_under_pointer(page.locator(".tie .line"), page.locator(".tie button.when"))
    switch = page.locator(".switch")
    switch.wait_for()
    until(lambda: store.state.model.scenarios, "a scenario")
    assert store.state.request.scenario == store.state.model.scenarios[0].name

    def when(text: str) -> None:
        said = lambda: str(store.state.model.scenarios[0].switches[0].when)  # noqa: E731
        until(lambda: said() == f"force of tie {text}", text)

    chosen(switch.get_by_label("when"), "force")
    value = switch.get_by_label("value")
    until(lambda: value.input_value() == "50", "a force to begin with")
    typed(value, "-1")
    when("above -1")
    chosen(switch.get_by_label("above or below"), "below")
    page.locator(".going .sentence").first.wait_for()
    when("above -1")
    switch.get_by_label("above or below").press("Escape")
    typed(value, "0.5")
    when("above 0.5")
    simulate(page)
    page.evaluate("pgraph.front('Events')")
    lines = page.locator("[data-view=events] li.fall")
    lines.first.click()
    event, *_ = events = store.state.run.result.events
    assert (event.contact, event.after) == ("tie", "off")
    until(lambda: store.state.playback.time == pytest.approx(event.t), "the time of the event")
    assert [float(t) for t in lines.locator(".t").all_inner_texts()] == pytest.approx(
        sorted(e.t for e in events), abs=1e-4
    )
    marked = page.locator("[data-view=events] [aria-selected=true] .part")
    until(lambda: marked.all_inner_texts() == ["tie"], "the mark of the event")
