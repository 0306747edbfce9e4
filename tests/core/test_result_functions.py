"""Result functions: `run.value`, `run.curve` and metrics of sweeps that are expressions."""

import math

import numpy as np
import pytest

import pgraph_core as pg


@pytest.fixture(scope="module")
def run() -> pg.Result:
    """A pendulum of two links, of which one has a name of two words."""
    link = {"mass": 1.0, "com": (0.5, 0, 0), "inertia": (0.1, 0.1, 0.1), "axis": (0, 1, 0)}
    bodies = (
        pg.Body(name="upper arm", parent="ground", joint="hinge", q=(0.3,), **link),
        pg.Body(name="knee", parent="upper arm", joint="hinge", link=(1, 0, 0), **link),
    )
    return pg.simulate(pg.Model(bodies=bodies), t_end=1.0, frames=101, estimate=False)


def laws(run: pg.Result) -> dict[str, float]:
    """Return the values of result functions, by NumPy."""
    t, v, force = run.t, run["v.knee"], run.joint_force["knee"][:, 3:]
    inside = (t >= 0.25) & (t <= 0.75)
    return {
        "max(abs(v.knee))": np.abs(v).max(),
        "peak(v.knee) - max(v.knee)": np.abs(v).max() - v.max(),
        "max(norm(joint_force.knee))": np.linalg.norm(force, axis=1).max(),
        "max(norm(joint_force.knee.x, joint_force.knee.z))": np.hypot(*force.T[[0, 2]]).max(),
        'max(max("v.upper arm", v.knee))': max(v.max(), run["v.upper arm"].max()),
        'min(q["upper arm"] + knee)': (run["upper arm"] + run["knee"]).min(),
        "rms(window(v.knee, 0.25, 0.75))": math.sqrt(np.trapezoid(v[inside] ** 2, t[inside]) / 0.5),
        "integral(kinetic_energy)": np.trapezoid(run.kinetic_energy, t),
        "final(t) + 2*final(t)^2": 3.0,
        "mean(if(t < 0.5, 0, 1))": 0.505,
    }


def test_values_are_those_of_numpy(run: pg.Result) -> None:
    for text, wanted in laws(run).items():
        assert run.value(text) == pytest.approx(wanted, rel=1e-12), text


@pytest.mark.parametrize(
    ("text", "unit"),
    [
        ("norm(joint_force.knee)", "N"),
        ("v.knee", "rad/s"),
        ("kinetic_energy / (t + final(t))", "kg m^2 s^-3"),
        ("window(vdot.knee, 0.2, 0.4)", "rad s^-2"),
        ("settle(knee)", "s"),
        ("2 * knee", ""),  # a factor may have any unit
    ],
)
def test_units_follow_the_columns(run: pg.Result, text: str, unit: str) -> None:
    curve = run.curve(text)
    assert curve.unit == unit
    assert curve.t.shape == curve.values.shape


def test_a_window_has_its_ends_between_frames(run: pg.Result) -> None:
    curve = run.curve("window(v.knee, 0.123, 0.456)")
    assert curve.t[[0, -1]].tolist() == [0.123, 0.456]
    assert curve.values[0] == np.interp(0.123, run.t, run["v.knee"])


@pytest.mark.parametrize(
    ("text", "facts"),
    [
        ("v.knee", ["v.knee", "curve", "max"]),
        ("max(v.kneee)", ["column 5", "v.kneee", "v.knee"]),
        ("max(joint_force.knee)", ["3 columns", "norm", "joint_force.knee.x"]),
        ("max(v)", ["2 columns", "v.knee"]),
        ("max(energy + v.knee)", ["N m", "rad/s"]),
        ("max(window(energy, 0.5, 3))", ["0 s", "1 s", "3"]),
        ("max(window(energy, 0.5, 0.5))", ["0.5"]),
        ("mean(window(knee, 0, 0.5) + knee)", ["different times"]),
        ("max(sqrt(knee - 100))", ["sqrt"]),
        ("max(1 / t)", ["div", "zero"]),
        ("peak(3)", ["curve", "number"]),
        ("maxi(knee)", ["maxi", "max"]),
        ("max(knee", ["column 9", "','", "end"]),
    ],
)
def test_what_has_no_value_is_refused(run: pg.Result, text: str, facts: list[str]) -> None:
    with pytest.raises(pg.InputError) as refused:
        run.value(text)
    for fact in facts:
        assert fact in str(refused.value)


def test_a_gap_is_named(run: pg.Result) -> None:
    import dataclasses

    v = np.array(run.v)
    v[30] = math.nan
    gap = dataclasses.replace(run, v=v)
    with pytest.raises(pg.InputError, match=r"v\.knee.*0\.3 s"):
        gap.value("max(v.knee)")
    with pytest.raises(pg.InputError, match="nan"):
        gap.value("max(min(1, v.knee))")
    assert np.isnan(gap.curve("v.knee").values).sum() == 1
    assert np.isnan(gap.curve("if(v.knee < 0, 1, 0)").values).sum() == 1
    with pytest.raises(pg.InputError, match=r"v\.knee.*0\.3 s"):
        gap.value("settle(v.knee)")
    assert gap.value("final(v.knee)") == run.v[-1, 1]


@pytest.mark.parametrize("given", [None, 3, b"max(t)", ["max(t)"]])
def test_what_is_no_text_is_refused(run: pg.Result, given: object) -> None:
    for function in (run.value, run.curve):
        with pytest.raises(pg.InputError, match="must be text"):
            function(given)  # pyright: ignore[reportArgumentType]


def test_models_do_not_know_functions_of_whole_curves() -> None:
    with pytest.raises(pg.PgraphError, match="peak"):
        pg.Model.serial(1).add(pg.Motor(name="m", body="1", torque="=peak(q.1)"))


def test_a_sweep_has_result_functions_as_metrics() -> None:
    model = pg.Model.serial(2)
    wanted = ["max v.2", 'max("v.2") - min("v.2")', 'max(norm("joint_force.2"))']
    table = pg.sweep(model, {"bodies.2.mass": [0.5, 1.0]}, wanted, t_end=0.3, workers=1)
    run = pg.simulate(model.edit("2", mass=0.5), t_end=0.3, estimate=False)
    for name in wanted[1:]:
        assert table[name][0] == pytest.approx(run.value(name), rel=1e-9)


def test_a_sweep_refuses_what_cannot_be_read_before_its_first_run() -> None:
    with pytest.raises(pg.InputError, match="maxi"):
        pg.sweep(pg.Model.serial(1), {"bodies.1.mass": [1.0]}, "maxi(abs(v.1))", t_end=1.0)
