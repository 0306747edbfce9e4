"""Settings of a run: one declaration for calls, scenarios, the command line and the page."""

import inspect
import json
from dataclasses import replace
from typing import Any

import numpy as np
import pytest

import pgraph_core as pg
from pgraph_app.cli import main
from pgraph_app.run import Request, Run
from pgraph_app.run.view import form, idle_step
from pgraph_core.fields import about
from pgraph_core.model.settings import OF, Settings
from pgraph_core.simulation.options import Options

from .app.store import ME, after, begun, do, reply
from .refusals import assert_names, refusal

pytestmark = pytest.mark.quick
OTHER_VALUE: dict[str, Any] = {
    "t_end": 0.25,
    "step": 0.004,
    "method": "dopri5",
    "rtol": 1e-5,
    "frames": 12,
}
BAD = [
    ("step", -1.0),
    ("step", "1 s"),
    ("rtol", 0.5),
    ("rtol", 1e-17),
    ("t_end", 0.0),
    ("frames", 1),
]
ROD = pg.Model.serial(1)


def in_scenario(**settings: Any) -> pg.Model:
    """Return a pendulum with a scenario of these settings."""
    return ROD.add(pg.Scenario(name="s", **settings))


def headed(model: pg.Model, **call: Any) -> tuple[Any, ...]:
    """Return the method, step, tolerance and times of a run in the scenario."""
    run = pg.simulate(model, scenario="s", estimate=False, **{"t_end": 0.02, **call})
    return run.header["method"], run.header["step"], run.header["rtol"], len(run.t)


def test_simulate_takes_all_options_by_their_names_with_their_defaults_and_explains_them():
    """The signature is written once more, for editors: it is the options' own."""
    taken = inspect.signature(pg.simulate).parameters
    text = inspect.getdoc(pg.simulate) or ""
    head = {line.partition(" :")[0] for line in text.splitlines() if " : " in line}
    explained = {name for names in head for name in names.split(", ")}
    for name, info in Options.model_fields.items():
        if name in ("inputs", "memory", "usual"):  # made of arguments, or of a scenario
            continue
        assert taken[name].kind is inspect.Parameter.KEYWORD_ONLY
        assert taken[name].default == info.default, name
        assert name in explained
    assert OF.keys() <= Options.model_fields.keys()


def test_every_setting_is_in_scenarios_flags_and_cells(capsys):
    assert OTHER_VALUE.keys() == OF.keys(), "give the new setting a value here"
    assert pg.Scenario.model_fields.keys() >= OF.keys()
    cells = {cell["name"]: cell for cell in form(begun(ROD).request)}
    assert cells.keys() == OF.keys()
    for command in ("run", "sweep"):
        with pytest.raises(SystemExit):
            main([command, "--help"])
        said = " ".join(capsys.readouterr().out.split())
        for name, info in OF.items():
            assert_names(said, f"--{name.replace('_', '-')} ", about(info, name).help)
    for name, info in OF.items():
        assert cells[name]["label"] == about(info, name).label
        assert about(info, name).help


@pytest.mark.parametrize("name", OF)
def test_a_setting_typed_on_the_page_is_kept_in_the_scenario_and_in_its_file(name):
    state = begun(in_scenario(t_end=0.5))
    text = str(OTHER_VALUE[name])
    state = after(state, do.SetRun(ME, 1, name, text), do.KeepSettings(ME))
    kept = state.model.scenario("s")
    assert getattr(kept, name) == OTHER_VALUE[name] == getattr(state.request, name)
    read = pg.Model.from_json(state.model.to_json())
    assert read.scenario("s") == kept
    assert after(begun(read), do.SetScenario(ME, 1, "s")).request == state.request


@pytest.mark.parametrize("name", OF)
def test_a_file_needs_the_version_that_has_its_settings(name):
    other = in_scenario(**{"step": 0.01, name: OTHER_VALUE[name]})
    version = json.loads(other.to_json())["schema_version"]
    assert version == max(1, about_since(name))


def about_since(name: str) -> int:
    """Return the first schema version with a setting."""
    return next(x.since for x in OF[name].metadata if hasattr(x, "since"))


@pytest.mark.parametrize(("name", "value"), BAD)
def test_a_value_is_refused_alike_everywhere(name, value, capsys):
    allowed = about_value(name)
    call = {"t_end": 0.01, name: value}
    assert_names(str(refusal(lambda: pg.simulate(ROD, **call))), "simulate", name, str(value))
    said = str(refusal(lambda: pg.Scenario(name="s", **{name: value})))
    assert_names(said, "'s'", name, allowed, str(value))
    with pytest.raises(SystemExit) as stopped:
        main(["run", "pendulum", f"--{name.replace('_', '-')}={value}"])
    assert stopped.value.code == 2
    assert_names(capsys.readouterr().err, name.replace("_", "-"), allowed, str(value))
    state = after(begun(ROD), do.SetRun(ME, 1, name, str(value)))
    label = about(OF[name], name).label.lower()
    assert_names(reply(state), label)
    assert state.request == begun(ROD).request


def about_value(name: str) -> str:
    """Return the allowed values of a setting, as its field says."""
    return OF[name].description or ""


@pytest.mark.parametrize(
    ("settings", "call", "expected"),
    [
        ({"step": 2e-3}, {}, ("rk4", 2e-3, None, 11)),
        ({"rtol": 1e-5}, {}, ("dop853", None, 1e-5, 1001)),
        ({"rtol": 1e-5}, {"step": 1e-3}, ("rk4", 1e-3, None, 21)),  # steps for a tolerance
        ({"rtol": 1e-5}, {"method": "rk4"}, ("rk4", 1e-3, None, 21)),  # it takes none
        ({"rtol": 1e-5}, {"rtol": 1e-7}, ("dop853", None, 1e-7, 1001)),
        ({"rtol": 1e-5, "method": "dopri5"}, {}, ("dopri5", None, 1e-5, 1001)),
        ({"step": 2e-3, "method": "rk4"}, {"rtol": 1e-7}, ("dop853", None, 1e-7, 1001)),
        ({"step": 2e-3}, {"method": "dopri5"}, ("dopri5", None, 1e-8, 1001)),
        ({"frames": 5}, {}, ("dop853", None, 1e-8, 5)),
        ({"frames": 5}, {"frames": 7}, ("dop853", None, 1e-8, 7)),
        ({"frames": 5}, {"t_eval": [0.0, 0.01]}, ("dop853", None, 1e-8, 2)),
        ({"method": "RK45"}, {}, ("dopri5", None, 1e-8, 1001)),  # the name in SciPy
    ],
)
def test_a_call_replaces_the_settings_of_its_scenario_that_do_not_fit(settings, call, expected):
    assert headed(in_scenario(**settings), **call) == expected


def test_a_run_in_a_scenario_has_the_bits_of_a_call_with_its_settings():
    settings = {"t_end": 0.1, "rtol": 1e-6, "step": 0.01, "method": "dopri5"}
    one = pg.simulate(in_scenario(**settings), scenario="s")
    other = pg.simulate(ROD, **settings)
    assert np.array_equal(one.q, other.q)
    assert one.counters == other.counters


def test_settings_are_read_from_text_as_numbers_or_names():
    assert Settings.read("step", "1e-3") == 1e-3
    assert Settings.read("method", "rk4") == "rk4"
    assert_names(str(refusal(lambda: Settings.read("step", "soon"))), "step", "> 0", "'soon'")


@pytest.mark.parametrize("name", ["stiff_pendulum", "double_pendulum", "rolling_disc"])
def test_a_scenario_on_the_page_runs_as_simulate_runs_it(name):
    """stiff_pendulum took steps of 10 ms on the page, and a tolerance of 1e-8 in `simulate`."""
    model = pg.load(name)
    scenario = model.scenarios[0]
    request = Request.of(scenario)
    here = pg.simulate(model, t_end=0.05, estimate=False, **request.options(model))
    there = pg.simulate(model, scenario=scenario.name, t_end=0.05, estimate=False)
    assert np.array_equal(here.q, there.q)
    finer = request.unchecked_copy({"step": 7e-4})
    assert finer.options(model)["step"] == finer.step


@pytest.mark.parametrize("method", ["rk4", "moreau_jean"])
def test_a_scenario_with_a_tolerance_that_its_method_does_not_take_is_refused(method):
    text = str(refusal(lambda: pg.Scenario(name="s", method=method, rtol=1e-6)))
    assert_names(text, "scenario 's', rtol", method, "dop853")
    for other in ("auto", "dop853", "radau5"):
        assert pg.Scenario(name="s", method=other, rtol=1e-6).rtol == 1e-6


@pytest.mark.parametrize(
    ("settings", "acts"),
    [
        ({"method": "dop853"}, False),
        ({"method": "radau5", "rtol": 1e-6}, True),  # the largest one
        ({"method": "rk4"}, True),
        ({}, True),
    ],
)
def test_the_cell_of_a_step_that_a_run_does_not_take_says_automatic(settings, acts):
    state = begun(in_scenario(step=0.004, **settings))
    cell = step_cell(state)
    told = cell["value"], cell["placeholder"] == "automatic"
    assert told == ((0.004, False) if acts else (None, True))
    assert_names(cell["help"], *[] if acts else ["0.004 s", "chooses its steps"])
    if "rtol" not in settings:
        assert headed(state.model)[1] == (0.004 if acts else None)


def test_after_a_run_the_cell_of_the_step_follows_the_method_that_was_chosen():
    state = begun(pg.load("stiff_pendulum"))
    given = state.request.step
    assert step_cell(state)["value"] == given is not None
    result = pg.simulate(state.model, t_end=0.01, **state.request.options(state.model))
    assert result.header["step"] is None
    done = replace(state, last_run=Run(state.model, state.request, result))
    assert (step_cell(done)["value"], step_cell(done)["placeholder"]) == (None, "automatic")


def step_cell(state: Any) -> Any:
    """Return the cell of the step on the page."""
    cells = form(state.request, idle_step(state))
    return next(cell for cell in cells if cell["name"] == "step")
