"""The notice about an energy balance that is violated by more than 1 %, of every kind of result."""

import pickle
from dataclasses import replace

import numpy as np
import pytest

import pgraph_core as pg
import pgraph_models
from pgraph_core.errors import percent
from pgraph_core.result import result

from ..worlds import ball, on_ground

pytestmark = pytest.mark.quick

COARSE = 0.12  # s: off by 87 % in 20 s
VISIBLE = 0.01


def about_energy(run: pg.Result) -> list[str]:
    return [x for x in run.notices if "energy balance" in x or "dissipation decreases" in x]


def swinging(t_end: float = 20.0, **settings) -> pg.Result:
    given = {"method": "rk4", "step": COARSE, "q": [1.5, 0.5]} | settings
    return pg.simulate(pg.Model.serial(2), t_end=t_end, **given)


def continued() -> pg.Result:
    first = swinging(9.6, estimate=False)
    rest = {"method": "rk4", "step": COARSE, "estimate": False}
    return pg.simulate(first.model, t_end=20.0, start=first, **rest)


def stepped() -> pg.Result:
    return pg.Stepper(pg.Model.serial(2), q=[1.5, 0.5], step=COARSE, method="rk4").record(160)


def parts() -> list[pg.Result]:
    stepper = pg.Stepper(pg.Model.serial(2), q=[1.5, 0.5], step=COARSE, method="rk4")
    return [stepper.record(32) for _ in range(5)]


def ended_by_an_event() -> pg.Result:
    def late(t, q, v):
        return t - 15.0

    vars(late)["terminal"] = True
    return swinging(events=[late], estimate=False)


@pytest.mark.parametrize(
    "made",
    [
        swinging,
        lambda: swinging(estimate=False),
        lambda: swinging(estimate=False, t_eval=np.linspace(0.0, 19.2, 41)),
        continued,
        stepped,
        lambda: pg.joined(parts()),
        lambda: pg.joined([pg.joined(parts()[:3]), *parts()[3:]]),
        ended_by_an_event,
    ],
)
def test_a_result_whose_balance_is_violated_says_so_once_with_its_own_drift(made, tmp_path):
    run = made()
    assert run.energy_drift > VISIBLE
    (said,) = about_energy(run)
    assert f"{100 * run.energy_drift:.2g} %" in said
    assert "a smaller step" in said
    run.save(tmp_path / "run.npz")
    copies = pickle.loads(pickle.dumps(run)), pg.Result.load(tmp_path / "run.npz"), replace(run)
    assert all(copy.notices == run.notices for copy in copies)


@pytest.mark.parametrize("method", ["rk4", "semi_implicit_euler", "gauss6", "moreau_jean"])
def test_no_method_needs_an_estimate_to_say_it(method):
    limits = (-3.0, 3.0) if method == "moreau_jean" else (None, None)
    arm = pg.Body(
        name="a", axes=[(0, 1, 0)], mass=1.0, com=(0.5, 0, 0), inertia=(0.1,) * 3, limits=limits
    )
    stiff = pg.Spring(name="s", body="a", point=(1, 0, 0), other_point=(1, 0, 1), stiffness=4e3)
    model = pg.Model(bodies=[arm], forces=[stiff])
    for step in (0.012, 1e-4):
        run = pg.simulate(model, t_end=0.5, step=step, method=method, estimate=False)
        assert len(about_energy(run)) == (run.energy_drift > VISIBLE)


@pytest.mark.parametrize("step", [1e-3, 2e-3])
def test_the_pieces_of_a_walk_and_the_whole_say_how_far_each_is_off(step):
    """Steps of 2 ms are too large for the feet, and those of 1 ms are not."""
    walk = pg.Walk(pg.Model.load(pgraph_models.path("quadruped")), "bound", step=step)
    pieces = [walk.step(0.05) for _ in range(8)]
    whole = pg.joined(pieces)
    for run in (*pieces, whole):
        assert len(about_energy(run)) == (run.energy_drift > VISIBLE)
    assert bool(about_energy(whole)) == (step == 2e-3)


def test_accurate_parts_join_to_a_run_without_the_notice():
    runs = [swinging(t_end=1.0, step=1e-3, estimate=False)]
    rest = {"method": "rk4", "step": 1e-3, "estimate": False}
    runs.append(pg.simulate(runs[0].model, t_end=2.0, start=runs[0], **rest))
    assert not about_energy(pg.joined(runs))


def test_contacts_that_give_energy_are_told_in_place_of_the_balance():
    """Compliant contacts store energy, which counts as dissipated until they open."""
    model = on_ground(ball(place=(0, 0, 0.3), mass=1.0), law="penalty", restitution=0.5)
    run = pg.simulate(model, t_end=0.6, method="rk4", step=1e-3, estimate=False)
    assert not about_energy(run)
    gap = run.contact_gap["floor"]
    after = (gap > 0.0) & (np.minimum.accumulate(gap) < 0.0)
    lost = run.dissipation - np.where(np.cumsum(after) > 10, 1.0, 0.0)
    (said,) = about_energy(replace(run, dissipation=lost))
    assert "dissipation decreases by" in said


def test_a_run_whose_notices_nobody_reads_computes_no_balance(monkeypatch):
    asked = []
    monkeypatch.setattr(result, "of_balance", lambda run, _: asked.append(run) or ())
    run = swinging(estimate=False)
    joined = pg.joined([swinging(t_end=1.0, estimate=False)])
    assert len(run.t)
    asked.clear()
    assert run.energy_drift > VISIBLE
    assert not asked
    assert run.notices == run.notices == joined.notices == ()
    assert len(asked) == 2  # each once


@pytest.mark.parametrize("law", ["complementarity", "soft", "penalty"])
def test_a_box_that_rests_has_no_drift(law):
    """Its energies change by rounding, of which any drift is a notable part."""
    box = pg.Body(
        "b", joint="free", link=(0, 0, 0.05), mass=1.0, derived=("inertia",),
        shape=pg.Shape("box", size=(0.1, 0.1, 0.1)),
    )  # fmt: skip
    model = pg.Model([box], contacts=[pg.Contact("c", body="b", law=law)])
    assert pg.simulate(model, t_end=0.5).energy_drift < 1e-5


@pytest.mark.parametrize(("share", "said"), [
    (1.23e-16, "1.2e-14 %"), (0.0112, "1.1 %"), (1.0, "100 %"), (1.74, "170 %"), (22.3, "2200 %"),
    (3e44, "more than 10000 %"),
])  # fmt: skip
def test_a_share_is_a_plain_number(share, said):
    assert percent(share) == said
