"""Living figures: a page that computes by itself what Python computes, bit for bit."""

import contextlib
import io
import json
import runpy
from collections.abc import Callable, Iterator
from functools import partial
from pathlib import Path
from typing import Any

import numpy as np
import pytest

import pgraph_core as pg
import pgraph_models
from pgraph_core.live import module
from pgraph_core.live.export import page, recorded
from pgraph_core.live.run import LiveRun, Setup
from pgraph_core.simulation.paths import Path as Field
from pgraph_core.simulation.paths import with_numbers

from ..core.test_cables import atwood
from ..nights import at_night
from .conftest import UNDRAWN

# After an edit of a kernel the module is of the old one until it is made again (nightly).
of_these_sources = pytest.mark.skipif(bool(module.stale()), reason=module.stale())
ROOT = Path(__file__).resolve().parents[2]
WITHOUT_WALK, WITH_WALK = 1.2e6, 2.5e6  # [bytes] of a page: what issue 19 asks for
LATER = "document.querySelector('#clock').textContent > '0.10 s'"
SIMULATE = """async (options) => { try {
  const { t, q, v } = await pgraph_live.simulate(options);
  const arrays = q instanceof Float64Array && v instanceof Float64Array;
  return { t, q: [...q], v: [...v], arrays };
} catch (error) { return { refused: error.message }; } }"""


def model_of(name: str) -> pg.Model:
    return pg.Model.load(pgraph_models.path(name))


@pytest.fixture
def figure(browser: Any, tmp_path: Path) -> Iterator[Callable[..., Any]]:
    """Open a text as a page from a file, offline. Nothing may be loaded or thrown."""
    with contextlib.ExitStack() as pages:
        faults: list[str] = []

        def opened(html: str, before: str = "", **options: Any) -> Any:
            file = tmp_path / f"figure {len(list(tmp_path.iterdir()))}.html"
            file.write_text(html, encoding="utf-8")
            context = browser.new_context(viewport={"width": 900, "height": 800}, **options)
            pages.callback(context.close)
            context.set_offline(True)
            shown = context.new_page()
            shown.on("pageerror", lambda error: faults.append(str(error)))
            shown.on("request", lambda r: faults.append(r.url) if r.url[:5] != "file:" else None)
            shown.add_init_script(UNDRAWN)
            if before:
                shown.add_init_script(before)
            shown.goto(file.as_uri())
            return shown

        yield opened
        assert faults == []


def ready(shown: Any) -> str:
    shown.wait_for_selector("body[data-ready]")
    return shown.evaluate("document.body.dataset.ready")


CASES = {
    "pendulum": ("pendulum", None, ["bodies.rod.mass", "bodies.rod.q.0"]),
    "loop": ("four_bar", "turn", ["bodies.coupler.mass", "scenarios.turn.v.coupler.0"]),
    "double": ("double_pendulum", None, ["bodies.lower.mass", "bodies.lower.link.2", "gravity.2"]),
    "stance": ("quadruped", "stance", ["bodies.pelvis.mass"]),
    "walk": ("quadruped", "bound", ["ground.friction"]),
    "trot": ("quadruped_hips", "trot", ["ground.friction", "scenarios.trot.gait.speed=0.2:0.8:4"]),
    "mass of a walk": ("quadruped_hips", "trot", ["bodies.pelvis.mass=5:15:3"]),
}
WALKS = ("walk", "trot", "mass of a walk")


@of_these_sources
@pytest.mark.parametrize("case", ["pendulum", "loop", *at_night("double", "stance", *WALKS)])
def test_the_page_ends_in_the_same_bits_as_python(case: str, figure: Any) -> None:
    """The model may have changed fields, and the step need not divide the time."""
    name, scenario, fields = CASES[case]
    model = model_of(name)
    html = page(recorded(model, scenario), fields)
    assert len(html.encode()) <= (WITH_WALK if case in WALKS else WITHOUT_WALK)
    shown = figure(html)
    assert ready(shown) == "live"
    given = shown.evaluate("pgraph_live.open")
    changed = {
        one["path"]: max(one["values"] or [one["value"] + 0.37 * (one["high"] - one["value"])])
        for one in given
    }
    changed.pop("scenarios.turn.v.coupler.0", None)  # the loop lets it move with the others only
    of_walks = [{"method": "moreau_jean", "step": 1e-3}, {"method": "moreau_jean", "step": 0.0013}]
    asked = [
        {"method": "rk4", "step": 1e-3},
        {"method": "semi_implicit_euler", "step": 0.0013},
        {"method": "dop853"},
        {"method": "dopri5", "rtol": 1e-4},
        {"method": "dopri5", "step": 0.0013},
        {"method": "dop853", "rtol": 1e-6, "step": 0.01},
        {"rtol": 1e-9},
        {"step": 0.002},
    ]
    for i, steps in enumerate(of_walks if case in WALKS else asked):
        options: dict[str, Any] = {"t_end": 2.3456 if i % 2 else 4.0, **steps}
        values = {} if i == 0 else changed
        other = model
        for path, value in values.items():
            other = with_numbers(other, [Field(other, path)], [value])
        run = pg.simulate(other, scenario=scenario, estimate=False, **options)
        assert run.status.ok
        got = shown.evaluate(SIMULATE, {**options, "set": values})
        assert got.get("arrays"), got
        assert got["t"] == run.t[-1]
        for here, there in ((run.q[-1], got["q"]), (run.v[-1], got["v"])):
            np.testing.assert_array_equal(here.view(np.int64), np.array(there).view(np.int64))


def example(name: str) -> pg.Model:
    """The model of the run of an example."""
    with contextlib.redirect_stdout(io.StringIO()):
        found = runpy.run_path(str(ROOT / "examples" / f"{name}.py"))
    return next(x for x in found.values() if isinstance(x, pg.Result)).mechanism.model


BENT: dict[str, Callable[[], pg.Model]] = {
    "cable": lambda: atwood(cable=pg.Cable, stiffness=1e4),
    "slack": lambda: atwood(cable=pg.Cable),
    "muscles": lambda: model_of("quadruped_muscles"),
    **{name: partial(example, name) for name in ("33_followers", "34_hoist", "35_slots")},
}


@of_these_sources
@pytest.mark.parametrize("case", ["cable", *at_night(*(x for x in BENT if x != "cable"))])
def test_steps_that_end_at_bends_of_forces_are_whole_steps(case: str, figure: Any) -> None:
    model = BENT[case]()
    shown = figure(page(recorded(model, None), []))
    assert ready(shown) == "live"
    impulses = "slack" in case or "hoist" in case
    fixed = {"method": "moreau_jean" if impulses else "rk4", "step": 1e-3}
    for steps in (fixed, {} if impulses else {"method": "dop853"}):
        run = pg.simulate(model, t_end=0.3, estimate=False, **steps)
        got = shown.evaluate(SIMULATE, {"t_end": 0.3, **steps})
        for here, there in ((run.q[-1], got["q"]), (run.v[-1], got["v"])):
            same = np.array(there)[: len(here)]  # those of states follow
            np.testing.assert_array_equal(here.view(np.int64), same.view(np.int64))


@of_these_sources
def test_a_wrong_call_names_what_is_wrong(figure: Any) -> None:
    shown = figure(page(recorded(model_of("pendulum")), ["bodies.rod.mass=0.5:2"]))
    ready(shown)
    for options, word in (
        ({"set": {"bodies.rod.mass": -1}}, "0.5 to 2"),
        ({"set": {"bodies.rod.mass": "heavy"}}, "heavy"),
        ({"set": {"bodies.arm.mass": 1}}, "bodies.rod.mass"),
        ({"method": "gauss6"}, "rk4"),
        ({"step": 0}, "step"),
        ({"method": "rk4", "rtol": 1e-6}, "tolerance"),
        ({"rtol": 1e-20}, "1e-15"),
        ({"rtol": "fine"}, "fine"),
        ({"t_end": -1}, "t_end"),
        ({"t_end": 1e9, "step": 1e-9}, "steps"),
        ({"duration": 1}, "duration"),
        (5, "5"),
    ):
        assert word in shown.evaluate(SIMULATE, options)["refused"]


@of_these_sources
def test_the_reader_plays_changes_and_pulls(figure: Any) -> None:
    shown = figure(page(recorded(model_of("double_pendulum")), ["bodies.lower.link.2=-2:-0.5"]))
    ready(shown)
    clock = shown.locator("#clock")
    shown.keyboard.press("Space")
    shown.wait_for_function(LATER)
    shown.keyboard.press("Space")
    shown.keyboard.press("Home")
    assert clock.inner_text() == "0.00 s"
    slider = shown.get_by_label("link z of lower [m]")
    slider.focus()
    slider.press("End")
    shown.wait_for_function(LATER)
    shown.locator("#plotted").select_option("v.lower [rad/s]")
    drawn = [shown.locator(f"#{path}").get_attribute("d") for path in ("recorded", "computed")]
    assert all(path.startswith("M0.0 ") for path in drawn)
    assert drawn[1] not in drawn[0]
    shown.emulate_media(media="print")
    assert not shown.locator("#controls").is_visible()
    assert shown.locator("#plot svg").is_visible()
    shown.emulate_media(media="screen")
    shown.get_by_role("button", name="Reset").click()
    assert "-1 m" in shown.locator("#open").inner_text()
    box = shown.locator("canvas").bounding_box()
    found = shown.evaluate(FOUND, places_on(box))  # a place on the canvas where a body is
    shown.mouse.move(*found)
    shown.mouse.down()
    shown.mouse.move(found[0] + 80, found[1] - 60, steps=4)
    shown.wait_for_function(LATER)
    shown.mouse.up()


FOUND = "(all) => all.find(([x, y]) => pgraph_live.at(x, y) !== null)"


def places_on(box: Any) -> list[list[float]]:
    """Return places on the canvas, from its middle outwards."""
    x, y = np.meshgrid(np.linspace(-0.5, 0.5, 31), np.linspace(-0.5, 0.5, 21))
    order = np.argsort(np.hypot(x, y), axis=None)
    place = [box["x"] + (0.5 + x) * box["width"], box["y"] + (0.5 + y) * box["height"]]
    return np.stack(place).reshape(2, -1).T[order].tolist()


@of_these_sources
def test_a_view_that_is_lost_comes_back(figure: Any) -> None:
    """The view stays above the ground. Fit view, Reset and the key F show the mechanism again."""
    shown = figure(page(recorded(model_of("pendulum"))))
    ready(shown)
    box = shown.locator("canvas").bounding_box()
    left, top, wide, high = box["x"], box["y"], box["width"], box["height"]
    places = places_on(box)

    def seen() -> bool:
        return shown.evaluate(FOUND, places) is not None

    def dragged(dx: float, dy: float) -> None:
        shown.mouse.move(left + 30, top + 0.5 * high)
        shown.mouse.down()
        shown.mouse.move(left + 30 + dx, top + 0.5 * high + dy, steps=5)
        shown.mouse.up()

    assert seen()
    dragged(0, -high / 2)
    assert seen()
    for way in ("Fit view", "Reset", "f"):
        shown.keyboard.down("Shift")
        dragged(3 * wide, 0)
        shown.keyboard.up("Shift")
        assert not seen()
        if way == "f":
            shown.keyboard.press("f")  # while the button has the focus
        else:
            shown.get_by_role("button", name=way).click()
        assert seen(), way


@of_these_sources
def test_the_slider_of_time_goes_ahead_of_what_has_been_computed(figure: Any) -> None:
    shown = figure(page(recorded(model_of("pendulum"), t_end=3.0), ["bodies.rod.mass=0.5:2"]))
    ready(shown)
    shown.evaluate("""() => {
      const put = (field, x) => { field.value = x; field.dispatchEvent(new Event("input")); };
      put(document.querySelector(".open input"), 2);
      put(document.querySelector("#time"), 2.4);
    }""")
    assert shown.locator("#play").inner_text() == "Play"
    shown.wait_for_function(
        "Math.abs(parseFloat(document.querySelector('#clock').textContent) - 2.4) < 0.02"
    )
    shown.get_by_role("button", name="Play").click()
    shown.wait_for_function("document.querySelector('#play').textContent === 'Play'")
    assert float(shown.locator("#time").get_attribute("max")) == pytest.approx(3.0, abs=1e-6)


@of_these_sources
@pytest.mark.parametrize(
    ("before", "state", "word"),
    [
        ("delete globalThis.WebAssembly", "recorded", "WebAssembly"),
        ("HTMLCanvasElement.prototype.getContext = () => null", "live", "WebGL"),
    ],
)
def test_a_browser_that_lacks_something_shows_the_recorded_run(figure, before, state, word) -> None:
    html = page(recorded(model_of("pendulum")))
    shown = figure(html, before)
    assert ready(shown) == state
    assert word in shown.locator("#said").inner_text()
    if state == "recorded":
        shown.get_by_role("button", name="Play").click()
        shown.wait_for_function(LATER)
        assert word in shown.evaluate(SIMULATE, {})["refused"]


@of_these_sources
def test_a_figure_that_is_cut_short_says_so(figure) -> None:
    html = page(recorded(model_of("pendulum")))
    cut = figure(html[: len(html) // 2])
    cut.wait_for_selector("#said:not(:empty)", state="attached")
    assert "cut short" in cut.locator("#said").inner_text()


def test_a_figure_that_cannot_compute_is_a_recording_without_a_warning(figure, monkeypatch):
    monkeypatch.setattr(module, "stale", lambda: "the module is old; make it again: python -m x")
    shown = figure(page(recorded(model_of("pendulum")), ["bodies.rod.mass=0.5:2"]))
    assert ready(shown) == "recorded"
    assert "make it" not in shown.locator("body").inner_text()
    assert shown.locator("#said.wrong").count() == 0
    shown.get_by_role("button", name="Play").click()
    shown.wait_for_function(LATER)


@of_these_sources
@pytest.mark.parametrize("how", ["torques", "switches", *at_night("scenario")])
def test_what_the_kernels_of_a_page_lack_stays_behind(figure: Any, how: str) -> None:
    """Cases: torques from Python, switches of the scenario after its first step, or of the call."""
    model = model_of("pendulum" if how == "torques" else "four_bar")
    if how == "torques":
        run = pg.simulate(model, t_end=1.0, tau=lambda t, q, v: -v)
        with pytest.raises(pg.InputError, match="Python"):
            page(run, ["bodies.rod.mass"])
    else:
        switch = pg.Switch(constraint=model.constraints[0].name, t=0.5, active=False)
        opens = pg.Scenario(name="opens", t_end=1.0, switches=[switch])
        run = (
            pg.simulate(model, t_end=1.0, switches=[switch])
            if how == "switches"
            else pg.simulate(model.add(opens), scenario="opens")
        )
    shown = figure(page(run))
    assert ready(shown) == "recorded"
    said = shown.locator("#said").inner_text()
    assert ("Python" if how == "torques" else "switch") in said


@of_these_sources
def test_a_tolerance_ends_steps_at_the_corners_of_tables(figure: Any) -> None:
    """Corners after the figure's own end count too, and one at the end of a run does not."""
    push = pg.Table(t=(0.0, 0.5, 1.0, 2.5), value=(0.0, 3.0, 0.0, 2.0))
    model = model_of("pendulum").add(pg.Motor(name="push", body="rod", torque=push))
    shown = figure(page(pg.simulate(model, t_end=1.0)))
    assert ready(shown) == "live"
    for t_end in (0.7, 1.0, 4.0):
        got = shown.evaluate(SIMULATE, {"t_end": t_end})
        run = pg.simulate(model, t_end=t_end)
        assert run.header["method"] == "dop853"
        assert (got["q"], got["v"]) == (run.q[-1].tolist(), run.v[-1].tolist())


@of_these_sources
def test_what_cannot_be_left_open_is_refused() -> None:
    run = recorded(model_of("double_pendulum"))
    for field, word in (
        ("bodies.lower.mass=2:1", "low < high"),
        ("bodies.lower.mass=much", "low:high"),
        ("bodies.lower.mass=5:9", "around"),
        ("bodies.lower.weight", "no field"),
        ("bodies.lower.mass=-1:2", "smaller range"),
        ("bodies.lower.mass=0.5:2:1", "n > 1"),
        ("bodies.lower.mass=0.5:2:3:4", "low:high:n"),
        ("bodies.lower.mass=0.5:2:2.5", "n > 1"),
        ("bodies.lower.mass=0.5:2:1000", "200"),
    ):
        with pytest.raises(pg.InputError, match=word):
            page(run, [field])


@of_these_sources
def test_fields_that_follow_no_rule_take_some_values(figure: Any) -> None:
    """A number of an axis, which is made one long, follows none of the rules."""
    model, path = model_of("double_pendulum"), "bodies.lower.axes.0.1"
    shown = figure(page(recorded(model), [f"{path}=0.5:2:3"]))
    ready(shown)
    assert shown.evaluate("pgraph_live.open[0].values") == [0.5, 1.0, 1.25, 2.0]
    asked = {"t_end": 1.0, "set": {path: 1.25}}
    run = pg.simulate(with_numbers(model, [Field(model, path)], [1.25]), t_end=1.0)
    np.testing.assert_array_equal(shown.evaluate(SIMULATE, asked)["q"], run.q[-1])
    assert "1.25" in shown.evaluate(SIMULATE, {"set": {path: 0.7}})["refused"]


@of_these_sources
def test_a_field_without_a_rule_takes_some_values_unasked() -> None:
    """The mass of a walker's trunk, by whose weight its controller is planned, between masses."""
    model = model_of("quadruped_hips")
    run = recorded(model, scenario="trot", t_end=0.1)
    fields = given_of(page(run, ["bodies.pelvis.mass=3.5:14", "ground.friction=0.4:1"]))["engine"][
        "open"
    ]
    values, rule = fields[0]["values"], fields[1]["values"]
    assert len(values) == 22
    assert {3.5, 7.0, 14.0} <= set(values)
    assert values == sorted(values)
    assert not rule


def given_of(html: str) -> Any:
    """Return the data of a page's figure."""
    start = html.index('id="figure">') + len('id="figure">')
    return json.loads(html[start : html.index("</script>", start)])


def test_a_run_writes_its_figure(tmp_path: Path) -> None:
    run = pg.simulate(model_of("pendulum"), t_end=1.0)
    run.to_html(tmp_path / "a.html", live=True)
    given = given_of((tmp_path / "a.html").read_text(encoding="utf-8"))
    methods = ["dop853", "rk4", "semi_implicit_euler", "dopri5"]
    assert given["engine"]["methods"] == ([] if module.stale() else methods)
    assert given["recording"]["count"] > 10


def test_a_run_calls_the_kernels_that_its_scene_needs() -> None:
    """Others are not compiled: projection alone takes a quarter of the time of a first run."""
    called = {
        name: {
            kernel for _, kernel in LiveRun(pg.Mechanism(model_of(name)), Setup(), "rk4").links()
        }
        for name in ("pendulum", "four_bar")
    }
    assert called["pendulum"] == {"acceleration", "record", "runge_kutta"}
    assert called["four_bar"] == called["pendulum"] | {"projection", "constrain"}


@pytest.mark.nightly
def test_the_module_is_of_these_sources() -> None:
    """Otherwise figures are recorded only. Before a release: `python -m pgraph_core.live`."""
    assert module.stale() == ""
