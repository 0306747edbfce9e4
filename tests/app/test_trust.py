"""The verdict on a run: three levels, in units that people can picture."""

import math
from types import SimpleNamespace as Fake
from typing import Any

import numpy as np
import pytest

import pgraph_core as pg
import pgraph_models
from pgraph_app.run import Request, Run
from pgraph_app.run.trust import below, cost, felt, remedy, summary, trust, verdict
from pgraph_app.run.view import measures
from pgraph_core.analysis.singular import TOO_LOW

from .store import ME, after, begun, do, ran

pytestmark = pytest.mark.quick
TURNING = pg.Model.serial(2)
SLIDING = pg.Model(bodies=(pg.Body(name="a", joint="prismatic", axes=(1, 0, 0)),))
FREE = pg.Model(bodies=(pg.Body(name="a", joint="free"),))


def estimated(model: pg.Model, error: float, **more: Any) -> Any:
    """A run whose error estimate is given."""
    facts = {
        "error_estimate": error, "status": Fake(ok=True, value="done"), "notices": (),
        "message": "", "relative_error": np.array([0.0]), "energy_drift": 0.0, "accuracy": "fine",
        "header": {}, "counters": {}, "timing": {}, "constraint_drift": (),
        "t": np.array([0.0, 0.396, 0.5]), "error_at": np.array([0.0, 1e-3, error]), **more,
    }  # fmt: skip
    return Fake(model=model, ended="", request=Request(), result=Fake(**facts))


@pytest.mark.parametrize(
    ("model", "error", "said"),
    [
        (FREE, 0.0034, "about 3 mm, 0.2°"), (TURNING, 0.0034, "about 0.2°"),
        (SLIDING, 0.0034, "about 3 mm"), (SLIDING, 2.4, "about 2 m"), (TURNING, 0.26, "about 10°"),
        (SLIDING, 9.7e-4, "about 1 mm"), (SLIDING, 4e-5, "about 40 µm"),
        (SLIDING, 1e-9, "within 1 µm"), (FREE, 1e-12, "within 1 µm, 0.001°"),
    ],
)  # fmt: skip
def test_an_error_is_said_in_lengths_and_angles_of_the_joints(model, error, said):
    assert felt(estimated(model, error)) == said


@pytest.mark.parametrize(
    ("run", "level"),
    [
        (estimated(FREE, math.nan), "unknown"),
        (estimated(FREE, math.inf, accuracy="known until 1 s"), "unknown"),
        (estimated(FREE, 1e-9, notices=(f"singular; {TOO_LOW}",)), "unknown"),
        (estimated(FREE, 1e-9, status=Fake(ok=False), message="stopped at 1 s"), "failed"),
    ],
)
def test_what_puts_the_estimate_in_question_is_said_with_its_reason(run, level):
    found, said, why = verdict(run)
    assert found == level
    assert said
    assert why


def test_an_error_known_for_a_part_of_the_run_says_until_when():
    run = estimated(FREE, math.inf, accuracy="known until 0.396 s")
    assert "0.396 s" in verdict(run)[1]


@pytest.mark.parametrize("method", ["dop853", "moreau_jean"])
@pytest.mark.parametrize(("drift", "level"), [(0.0, "good"), (0.009, "good"), (0.049, "rough")])
def test_a_run_is_as_good_as_the_worst_of_its_error_and_its_energy(drift, level, method):
    """The worst fact is said first; what is fine stands below it. Energies of a method of first
    order are no fault of an accurate motion, so no line of it is bad, and the headline is short."""
    run = estimated(FREE, 0.0022, energy_drift=drift, header={"method": method})
    found, said, _ = verdict(run)
    rows = {label: value for label, value, *_ in below(run)}
    assert found == (level if method == "dop853" else "good")
    assert ("4.9 %" in said) == (found == "rough") != ("Energy drift" in rows)
    assert ("2 mm" in said) == (found == "good")
    assert "2 mm" in rows["Error estimate"]
    assert all(fine for _, _, fine in summary(run)) == (found == "good")
    assert len(said) < 28


@pytest.mark.parametrize(
    ("given", "field", "value"),
    [
        ({"step": 1e-3}, "step", 5e-4), ({"step": 0.04, "rtol": None}, "step", 0.02),
        ({"step": None, "rtol": 1e-6}, "rtol", 1e-7),
    ],
)  # fmt: skip
def test_a_rough_run_offers_half_its_step_or_a_tighter_tolerance(given, field, value):
    run = estimated(FREE, 1e-3, energy_drift=0.5, header={"method": "rk4", **given})
    label, named, text = remedy(run)
    assert (named, float(text)) == (field, value)
    assert label
    report = {name: line for name, line, _ in summary(run)}["Energy drift"]
    assert f"a smaller {'step' if field == 'step' else 'tolerance'}" in report
    assert remedy(estimated(FREE, 1e-3, header={"method": "rk4"})) is None


@pytest.mark.parametrize("model", [FREE, TURNING, SLIDING])
def test_an_error_has_the_unit_of_its_joints(model):
    run = estimated(model, 0.0034, accuracy="0.0034 rad or m, 2 % of the motion")
    text = {label: value for label, value, _ in summary(run)}["Error estimate"]
    assert felt(run) in text
    assert "2 % of the motion" in text
    assert "rad or m" not in text


@pytest.mark.parametrize("error", [math.nan, math.inf, 1e-3])
@pytest.mark.parametrize("drift", [math.nan, 0.0, 10.0])
@pytest.mark.parametrize("loops", [(), ((1e-9, 0.0),), ((1.0, 0.0),)])
def test_up_to_three_short_rows_stand_below_each_verdict(error, drift, loops):
    model = pg.Model.load(pgraph_models.path("four_bar"))
    known = {"energy_drift": drift, "constraint_drift": np.array(loops).reshape(-1, 2)}
    run = estimated(model, error, accuracy="a sentence of many words, and more", **known)
    rows = below(run)
    assert 1 <= len(rows) <= 3
    assert any("error" in row[0] for row in rows) <= (not math.isnan(error))
    assert all(0 < len(value) < 28 for _, value, _, _ in rows)


@pytest.mark.parametrize("drift", [0.0, 6.1e-10, 0.0049, 0.049, 12.0, math.nan])
def test_an_energy_drift_has_one_form_in_the_seal_the_report_and_beside_other_runs(
    drift, monkeypatch
):
    """Runs were compared by 6.1e-10 of the range, and the seal said percent."""
    result = pg.simulate(TURNING, t_end=0.01, step=1e-3)
    monkeypatch.setattr(pg.Result, "energy_drift", drift)
    run = Run(TURNING, Request(), result)
    compared = measures(run)["energy drift"].value
    seal = verdict(run)[1].rpartition(" drifts ")[2]
    below_it = {label: value for label, value, *_ in below(run)}
    seal = below_it.get("Energy drift", seal)
    report = {label: value for label, value, _ in summary(run)}.get("Energy drift", "")
    assert bool(compared) == bool(report) == (not math.isnan(drift))
    if compared:
        assert float(compared.partition(" %")[0]) == pytest.approx(100 * drift, rel=0.05)
        assert compared == seal
        assert report.startswith(compared)


def test_small_steps_are_good_and_large_ones_rough():
    levels = []
    for step in (1e-4, 0.005):
        result = pg.simulate(TURNING, t_end=1.0, step=step, method="semi_implicit_euler")
        levels.append(verdict(Run(TURNING, Request(), result))[0])
    assert levels == ["good", "rough"]


def test_a_run_of_an_earlier_model_is_not_trusted_and_none_is_no_run():
    state = begun(TURNING)
    assert trust(state, None, None, None)["level"] == ""
    state = ran(state, pg.simulate(TURNING, t_end=0.1, step=1e-3))
    assert trust(state, None, None, None)["level"] == "good"
    assert len(trust(state, None, None, None)["lines"]) == 3
    assert trust(state, None, None, None)["better"] is None
    edited = after(state, do.EditBodies(ME, 1, ("1",), "mass", (((), "7"),)))
    told = trust(edited, None, None, None)
    assert (told["level"], told["lines"]) == ("unknown", [])
    assert told["report"]


def test_the_cost_of_a_run_is_its_steps_and_estimate_and_beside_it_its_construction():
    timing = {"build": 0.002, "step": 0.5, "step_processor": 0.4, "estimate": 1.0, "load": 7.0}
    said = cost(Fake(counters={"steps": 250}, timing=timing))
    assert said.startswith("1.5 s: 250 steps")
    assert "2 ms" in said
