"""Optimal designs against closed forms, and what a search tells of its limits."""

import json
import math
from typing import Any

import numpy as np
import pytest

import pgraph_core as pg

from ..worlds import built_in

OPTIONS: dict[str, Any] = {"t_end": 1.0, "method": "rk4", "step": 5e-3, "frames": 51}


def oscillator(mass=2.0, stiffness=40.0, damping=0.0):
    """A block on a spring that starts at rest, 0.5 m from where the spring pushes nothing."""
    spring = pg.Spring(name="s", body="block", other="ground", stiffness=stiffness, rest=0.0)
    block = pg.Body(
        name="block", joint="prismatic", axes=[(1, 0, 0)], mass=mass, q=[0.5], damping=damping
    )
    return pg.Model(bodies=[block], forces=[spring], gravity=(0, 0, 0))


def pushed(knots=5):
    """A block of 1 kg that a force over time pushes from rest."""
    block = pg.Body(name="block", joint="prismatic", axes=[(1, 0, 0)], mass=1.0)
    table = pg.Table(t=np.linspace(0.0, 1.0, knots), value=np.zeros(knots))
    push = pg.Motor(name="push", body="block", torque=table)
    return pg.Model(bodies=[block], gravity=(0, 0, 0), forces=[push])


def effort(run):
    return np.array(run.mechanism.model.part("push", "force").torque.value)


STIFFNESS = {"forces.s.stiffness": (20.0, 60.0)}


@pytest.mark.parametrize("solver", ["SLSQP", "trust-constr", "L-BFGS-B"])
def test_a_stiffness_brings_the_block_back_fastest(solver):
    """The block is farthest on the other side at t = 1 where its half period is 1 s."""
    model = oscillator(stiffness=25.0)
    found = pg.optimise(model, "final block", {"forces.s.stiffness": (10.0, 30.0)}, solver=solver,
                        **OPTIONS)  # fmt: skip
    assert found.converged
    assert found.values["forces.s.stiffness"] == pytest.approx(2.0 * math.pi**2, rel=1e-4)
    assert found.objective == pytest.approx(-0.5, rel=1e-6)


def test_what_shall_be_largest_has_a_minus():
    found = pg.optimise(oscillator(), "-final block", {"forces.s.stiffness": (20.0, 100.0)},
                        **OPTIONS)  # fmt: skip
    assert found.values["forces.s.stiffness"] == pytest.approx(8.0 * math.pi**2, rel=1e-4)


def test_squares_are_made_least():
    """Two unknown numbers follow from a curve."""
    aim = pg.simulate(oscillator(stiffness=30.0, damping=1.0), estimate=False, **OPTIONS)
    free = STIFFNESS | {"bodies.block.damping": (0.0, 5.0)}
    found = pg.optimise(
        oscillator(damping=0.2), lambda run: run["block"] - aim["block"], free, **OPTIONS
    )
    assert found.converged
    assert [*found.values.values()] == pytest.approx([30.0, 1.0], rel=1e-6)


@pytest.mark.parametrize("knots", [3, 9])
def test_a_push_over_time_is_the_known_least_effort(knots):
    """From rest to rest over 1 m in 1 s: of linear forces, 6 (1 - 2 t) has the least ∫F²."""

    def squared(run):
        f = effort(run)  # ∫ of a squared line between knots
        return np.sum(f[1:] ** 2 + f[1:] * f[:-1] + f[:-1] ** 2) / (3.0 * (len(f) - 1))

    found = pg.optimise(
        pushed(knots), squared, {"forces.push.torque": (-20.0, 20.0)},
        subject_to={"final block": (1.0, 1.0), "final v.block": (0.0, 0.0)}, **OPTIONS,
    )  # fmt: skip
    assert found.converged
    t = np.linspace(0.0, 1.0, knots)
    assert [*found.values.values()] == pytest.approx((6.0 * (1.0 - 2.0 * t)).tolist(), abs=2e-3)
    assert found.objective == pytest.approx(12.0, rel=1e-5)
    assert len(found.active) == 2


def test_limits_and_bounds_that_act_are_named():
    found = pg.optimise(
        oscillator(),
        lambda run: getattr(run.mechanism.model.part("s", "force"), "stiffness"),  # noqa: B009
        STIFFNESS,
        subject_to={"peak v.block": (2.0, None)}, **OPTIONS,
    )  # fmt: skip
    # the highest speed is 0.5 sqrt(k / m)
    assert found.values["forces.s.stiffness"] == pytest.approx(32.0, rel=1e-3)
    assert ["peak v.block" in text for text in found.active] == [True]
    low = pg.optimise(oscillator(), "peak v.block", STIFFNESS, **OPTIONS)
    assert low.values["forces.s.stiffness"] == 20.0
    assert ["forces.s.stiffness" in text for text in low.active] == [True]


def test_gradients_of_goals_are_those_of_differences():
    model = built_in("four_bar").model
    path = "bodies.coupler.link.0"
    goals = ("peak v.left crank", "final energy", "rms constraint_force.pin.x", "settle coupler")
    run = pg.simulate(model, wrt=[path], estimate=False, **OPTIONS)
    from pgraph_core.sweeps.metrics import measured

    for goal in goals:
        if "pin" in goal and "pin" not in run.constraint_force:
            goal = f"rms constraint_force.{next(iter(run.constraint_force))}.x"
        exact = run.gradient(lambda run, goal=goal: measured(run, goal))[path]
        h, beside = 1e-5, []
        for side in (-1, 1):
            link = np.array(model.body("coupler").link) + side * h * np.eye(3)[0]
            q = pg.Mechanism(model).home()[0]
            other = pg.simulate(model.edit("coupler", link=link), q, estimate=False, **OPTIONS)
            beside.append(measured(other, goal))
        assert exact == pytest.approx((beside[1] - beside[0]) / (2 * h), rel=2e-3, abs=1e-7)


def test_an_invalid_model_on_the_way_shortens_the_step():
    """Bounds of single numbers do not say that principal inertias obey a triangle inequality."""
    rod = pg.Body(
        name="rod", joint="revolute", axes=[(0, 1, 0)], mass=1.0, com=(0, 0, -0.4), q=[1.0],
        inertia=np.diag([0.03, 0.05, 0.03]),
    )  # fmt: skip
    model = pg.Model(bodies=[rod], gravity=(0, 0, -9.81))
    free = {"bodies.rod.inertia.1.1": (0.001, 0.059), "bodies.rod.inertia.0.0": (0.021, 0.07)}

    def goal(run):
        inertia = np.array(run.mechanism.model.body("rod").inertia)
        return [run["rod"][-1] - 0.2, 3.0 * (inertia[0, 0] - 0.02)]

    found = pg.optimise(model, goal, free, **OPTIONS)
    assert found.objective < sum(np.square(goal(pg.simulate(model, estimate=False, **OPTIONS))))
    failures = [trial for trial in found.history if trial.failed]
    if failures:
        assert any(name in failures[-1].failed for name in free)
        assert any(name in found.message for name in free)


def test_a_number_on_a_bound_that_has_no_derivative_is_left():
    """Without damping nothing damps, so that no derivative by it exists there."""
    model = oscillator(stiffness=2.0 * math.pi**2, damping=0.0)
    found = pg.optimise(model, "-final block", {"bodies.block.damping": (0.0, 5.0)}, **OPTIONS)
    assert found.converged
    assert found.message == "converged"
    assert found.values["bodies.block.damping"] > 1.0


def test_a_file_keeps_the_history_and_a_search_goes_on_from_it(tmp_path):
    file = tmp_path / "search.jsonl"
    given = {"history": file, **OPTIONS}
    first = pg.optimise(oscillator(stiffness=25.0), "final block", STIFFNESS, most=2, **given)
    lines = [json.loads(line) for line in file.read_text().splitlines()]
    assert [one["values"] for one in lines] == [trial.values for trial in first.history]
    then = pg.optimise(oscillator(stiffness=50.0), "final block", STIFFNESS, **given)
    assert then.history[0].values == first.values
    again = pg.optimise(oscillator(), "final block", STIFFNESS, history=then, **OPTIONS)
    assert again.objective <= then.objective + 1e-12
    with pytest.raises(pg.InputError):
        pg.optimise(oscillator(), "final block", {"bodies.block.mass": (1, 3)}, **given)


def test_starts_are_all_searched():
    """The goal has two minima within the bounds: half a period and one and a half."""
    free = {"forces.s.stiffness": (10.0, 220.0)}
    model = oscillator(stiffness=190.0, damping=0.3)
    one = pg.optimise(model, "final block", free, **OPTIONS)
    several = pg.optimise(model, "final block", free, starts=4, **OPTIONS)
    assert len(several.endings) == 4
    assert several.objective == min(end.objective for end in several.endings)
    assert several.objective < one.objective
    assert several.values["forces.s.stiffness"] == pytest.approx(2.0 * math.pi**2, rel=0.02)
    given = [{"forces.s.stiffness": 15.0}, {"forces.s.stiffness": 200.0}]
    assert len(pg.optimise(model, "final block", free, starts=given, **OPTIONS).endings) == 2


@pytest.mark.parametrize("how", [False, KeyboardInterrupt])
def test_a_search_that_is_stopped_returns_its_best(how):
    told = []

    def progress(trial, run):
        told.append(trial)
        assert run.status.ok
        if len(told) == 3:
            if how is KeyboardInterrupt:
                raise KeyboardInterrupt
            return False

    free = {"forces.s.stiffness": (10.0, 30.0)}
    found = pg.optimise(oscillator(stiffness=25.0), "final block", free, progress=progress,
                        **OPTIONS)  # fmt: skip
    assert len(told) == len(found.history) == 3
    assert not found.converged
    assert found.objective == min(trial.objective for trial in told)


def test_a_search_with_few_iterations_says_so():
    found = pg.optimise(oscillator(stiffness=25.0), "final block", STIFFNESS, most=1, **OPTIONS)
    assert not found.converged
    assert "most" in found.message


def test_a_search_whose_other_runs_all_fail_has_not_converged():
    rod = pg.Body("1", axes=(0, 1, 0), com=(0, 0, -0.5))
    model = pg.Model([rod, rod.model_copy(update={"name": "2", "parent": "1", "link": (0, 0, -1)})])
    free = {"v.2": (-1, 1)}
    few = pg.optimise(model, "final 1", free, t_end=0.1, max_steps=3)
    assert not few.converged
    assert "limited by" in few.message
    assert pg.optimise(model, "final 1", free, t_end=0.1).converged


def test_limits_that_no_number_can_keep_are_said():
    found = pg.optimise(oscillator(), "final block", STIFFNESS,
                        subject_to={"peak v.block": (5.0, None)}, **OPTIONS)  # fmt: skip
    assert not found.converged
    assert "constraints" in found.message


@pytest.mark.parametrize(
    ("goal", "free", "more"),
    [
        ("finl block", STIFFNESS, {}),
        ("final blok", STIFFNESS, {}),
        (3.0, STIFFNESS, {}),
        (lambda run: math.nan, STIFFNESS, {}),
        (lambda run: "far", STIFFNESS, {}),
        (lambda run: [], STIFFNESS, {}),
        ("final block", {}, {}),
        ("final block", {"forces.s.stifness": (1, 2)}, {}),
        ("final block", {"forces.s.stiffness": (50, 60)}, {}),
        ("final block", {"forces.s.stiffness": (60, 20)}, {}),
        ("final block", {"bodies.block.mass": (-1.0, 5.0)}, {}),
        ("final block", {"bodies.block.tip": (-1.0, 1.0)}, {}),
        ("final block", STIFFNESS, {"solver": "newton"}),
        ("final block", STIFFNESS, {"solver": "least_squares"}),
        ("final block", STIFFNESS, {"solver": "L-BFGS-B", "subject_to": {"peak block": (0, 1)}}),
        ("final block", STIFFNESS, {"subject_to": {"peak block": 3}}),
        ("final block", STIFFNESS, {"subject_to": {"peak block": (2, 1)}}),
        ("final block", STIFFNESS, {"subject_to": {"peak block": (None, None)}}),
        ("final block", STIFFNESS, {"starts": 0}),
        ("final block", {"forces.s.stiffness": None}, {"starts": 3}),
        ("final block", STIFFNESS, {"starts": [{"mass": 1.0}]}),
        ("final block", STIFFNESS, {"wrt": ["q.block"]}),
        ("final block", STIFFNESS, {"tol": 0.0}),
        ("final block", STIFFNESS, {"differences": 2.0}),
        ("final block", STIFFNESS, {"history": 3}),
    ],
)
def test_what_cannot_be_optimised_is_refused(goal, free, more):
    with pytest.raises(pg.InputError):
        pg.optimise(oscillator(), goal, free, **OPTIONS | more)


def test_runs_without_derivatives_need_differences():
    torque: dict[str, Any] = {"tau": lambda t, q, v: 0.0 * v}
    with pytest.raises(pg.InputError) as refused:
        pg.optimise(oscillator(), "final block", STIFFNESS, **OPTIONS | torque)
    assert "differences" in str(refused.value)
    found = pg.optimise(oscillator(stiffness=25.0), "final block", {"forces.s.stiffness": (10, 30)},
                        differences=1e-4, **OPTIONS | torque)  # fmt: skip
    assert found.values["forces.s.stiffness"] == pytest.approx(2.0 * math.pi**2, rel=1e-3)


@pytest.mark.parametrize("noise", [0.01, 0.05])
@pytest.mark.parametrize("prior", [(0.7, 0.02), (0.8, 0.02), (0.8, 0.1)])
def test_a_prior_is_weighed_against_the_noise_of_the_data(noise, prior):
    """The fit is that with the noise of its residuals, whatever the spread of the data is."""
    arm = pg.Body(name="arm", axes=(0, 1, 0), mass=0.7, com=(0, 0, -0.5), inertia=(0.1, 0.1, 0.1))
    model = pg.Model(bodies=(arm,), forces=(pg.Spring(
        name="s", body="arm", point=(0, 0, -1), other_point=(0.5, 0, -1), stiffness=20.0),
    ))  # fmt: skip
    t = np.linspace(0, 2, 101)
    options = {"q": (1.0,)}
    curve = pg.simulate(model, t_eval=t, estimate=False, **options)["arm"]
    data = {"t": t, "arm": curve + noise * np.random.default_rng(0).normal(size=t.size)}
    free = {"bodies.arm.mass": (0.2, 3.0)}
    given = {"priors": {"bodies.arm.mass": prior}, **options}
    found = pg.fit(model, data, free, **given)
    same = pg.fit(model, data, free, sigma={"arm": found.noise["arm"]}, **given)
    assert found.noise["arm"] == pytest.approx(noise, rel=0.3)
    assert found.x == pytest.approx(same.x, abs=0.3 * same.errors["bodies.arm.mass"])


def test_an_input_of_many_values_needs_few_runs():
    """A pendulum of two bodies is brought to rest elsewhere by 32 values, with least effort."""
    n, t_end = 16, 1.0
    upper = pg.Body(name="upper", axes=(0, 1, 0), com=(0, 0, -0.5), inertia=(0.05, 0.05, 0.01))
    lower = upper.model_copy(update={"name": "lower", "parent": "upper", "link": (0, 0, -1.0)})
    table = pg.Table(t=np.linspace(0.0, t_end, n), value=np.zeros(n))
    motors = [pg.Motor(name=name, body=name, torque=table) for name in ("upper", "lower")]
    model = pg.Model(bodies=[upper, lower], forces=motors)

    def squared(run):
        values = [run.mechanism.model.part(m.name, "force").torque.value for m in motors]
        return sum(np.sum(np.square(f)) - 0.5 * (f[0] ** 2 + f[-1] ** 2) for f in values)

    found = pg.optimise(
        model, squared, {f"forces.{m.name}.torque": (-30, 30) for m in motors},
        subject_to={"final upper": (0.5, 0.5), "final lower": (0.3, 0.3),
                    "final v.upper": (0, 0), "final v.lower": (0, 0)},
        t_end=t_end, method="rk4", step=1e-2, frames=21,
    )  # fmt: skip
    assert found.converged
    assert found.evaluations < 120  # by SLSQP alone more than 800
    assert found.constraints["final upper"] == pytest.approx(0.5, abs=1e-6)
    assert abs(found.integration["final upper"]) < 1e-4
    assert np.isnan([*found.errors.values()]).all()


def test_slopes_of_metrics_are_those_of_gradients():
    """Metrics of one column are differentiated along it, with the sign and for all numbers."""
    from pgraph_core.search.curves import slope_of_metric
    from pgraph_core.sweeps.metrics import measured

    model, paths = oscillator(damping=0.3), ["forces.s.stiffness", "bodies.block.mass", "q.block"]
    run = pg.simulate(model, wrt=paths, estimate=False, **OPTIONS)
    for metric in ("final block", "rms v.block", "mean energy", "peak block", "range v.block"):
        found = slope_of_metric(run, metric)
        by = run.gradient(lambda run, metric=metric: measured(run, metric))
        assert found == pytest.approx(by, rel=1e-7, abs=1e-8), metric
    assert slope_of_metric(run, "energy_drift") is None


@pytest.mark.parametrize("product", [False, True])
def test_runs_of_a_search_share_slopes_only_of_what_is_linear(product):
    """A mass that is given by a formula is a product of two free numbers, whose slopes change."""
    from pgraph_core.simulation.variables import Wanted

    table = pg.Table(t=[0.0, 0.5, 1.0], value=[0.0, 0.0, 0.0])
    arm = pg.Body(name="arm", axes=(0, 1, 0), com=(0.1, 0, 0), inertia=(0.01,) * 3)
    paths = ["a", *(["b"] if product else []), *(f"forces.push.torque.value.{n}" for n in range(3))]
    shared = Wanted(paths)
    for n in (0.0, 1.0, -2.0):
        own = table.model_copy(update={"value": (n, 0.0, 1.0 - n)})
        push = pg.Motor(name="push", body="arm", torque=own)
        numbers = {"a": 3.0 + n, "b": 1.0 + 0.1 * n * product}
        model = pg.Model(bodies=[arm], forces=[push], parameters=numbers).edit("arm", mass="=a*b")
        runs = [pg.simulate(model, wrt=wrt, estimate=False, **OPTIONS) for wrt in (shared, paths)]
        for path in paths:
            one, other = (run.sensitivity(path) for run in runs)
            assert one == pytest.approx(other, rel=1e-9, abs=1e-12)
    assert (shared.lines is None) == product


def test_lines_of_progress_show_what_is_missed(capsys, monkeypatch):
    from pgraph_core.search import telling as module

    monkeypatch.setattr(module, "SILENCE", -1.0)
    pg.optimise(
        pushed(3), lambda run: np.sum(effort(run) ** 2), {"forces.push.torque": (-20.0, 20.0)},
        subject_to={"final block": (1.0, 1.0)}, most=40, **OPTIONS,
    )  # fmt: skip
    lines = [line for line in capsys.readouterr().err.splitlines() if "optimise" in line]
    assert "final block is missed by 1 of its size" in lines[0]
    assert "constraints are met" in lines[-1]
    assert all("iteration" in line and "at most" in line for line in lines)


def test_squares_have_standard_errors():
    """Those of a fit to the same curve."""
    t = np.linspace(0.0, 1.0, 51)
    aim = pg.simulate(oscillator(stiffness=30.0), estimate=False, **OPTIONS)["block"]
    noisy = aim + 1e-3 * np.random.default_rng(0).normal(size=len(t))
    found = pg.optimise(oscillator(), lambda run: run["block"] - noisy, STIFFNESS, **OPTIONS)
    given = {name: OPTIONS[name] for name in ("method", "step")}
    fit = pg.fit(oscillator(), {"t": t, "block": noisy}, STIFFNESS, **given)
    assert found.errors == pytest.approx(fit.errors, rel=1e-3)
    (pair,), (same,) = found.intervals().values(), fit.intervals().values()
    assert pair == pytest.approx(same, rel=1e-4)
    assert json.loads(found.to_json())["objective"] == found.objective
