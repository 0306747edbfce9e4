"""Fits to measured data: values, errors, directions without data, outliers, several cases."""

import math
from typing import Any

import numpy as np
import pytest

import pgraph_core as pg

from ..nights import combined
from ..refusals import assert_names
from .test_gradients import described


@pytest.mark.parametrize(
    "names", [("t", "upper [kg]"), ("t [m]", "upper [rad]"), ("t", "upper [x]")]
)
def test_data_in_units_of_another_kind_are_refused(names):
    data = dict(zip(names, ([0.0, 0.1, 0.2], [0.3, 0.2, 0.1])))
    with pytest.raises(pg.InputError):
        pg.fit(described("double_pendulum"), data, {"bodies.upper.mass": (0.1, 2.0)})


TIMES = np.linspace(0.0, 1.5, 151)
FIT = {"method": "rk4", "step": 1e-3}


def measured(seed, noise=1e-3):
    true = described("double_pendulum").edit("lower", mass=1.3).edit("upper", q=[1.0])
    run = pg.simulate(true, t_eval=TIMES, t_end=1.5, estimate=False, **FIT)
    rng = np.random.default_rng(seed)
    columns = {name: run.columns()[name] for name in ("upper", "v.lower")}
    return {"t": TIMES} | {k: x + noise * rng.normal(size=len(x)) for k, x in columns.items()}


FREE = {"bodies.lower.mass": (0.1, 5.0), "q.upper": (-1.0, 2.0)}


def test_fits_find_the_truth_within_their_errors():
    start = described("double_pendulum").edit("lower", mass=0.9).edit("upper", q=[0.8])
    apart, found = [], None
    for seed in range(6):
        found = pg.fit(start, measured(seed), FREE, **FIT)
        assert found.converged
        for path, true in zip(FREE, (1.3, 1.0)):
            apart.append(abs(found.values[path] - true) / found.errors[path])
    assert np.median(apart) < 2.0
    assert max(apart) < 4.0
    assert found is not None
    assert found.model.body("lower").mass == found.values["bodies.lower.mass"]


def swinging(first, **options):
    """Times from `first` on, and the motion of a damped pendulum that starts then, or earlier."""
    rod = pg.Body(name="rod", axes=(0, 1, 0), com=(0, 0, -0.5), damping=0.2, inertia=(0.02,) * 3)
    model, t = pg.Model(bodies=[rod]), first + TIMES
    given = {"t_start": first, "estimate": False, **FIT, **options}
    return model, {"t": t, "rod": pg.simulate(model, [1.0], t_eval=t, **given)["rod"]}


DAMPING = {"bodies.rod.damping": (0.0, 1.0)}


@pytest.mark.parametrize("first", [0.0, 0.2, 5.0, -3.0, 1.7e9])
def test_the_initial_state_is_that_of_the_first_row(first):
    """A pendulum does not depend on the origin of time, be it the clock of a logger."""
    model, data = swinging(first)
    found = pg.fit(model.edit("rod", damping=0.05), data, DAMPING, q=[1.0], **FIT)
    assert found.x == pytest.approx([0.2], rel=1e-5)  # 1.7e9 s are rounded to 2e-7 s


def test_each_measurement_starts_with_its_own_first_row():
    model = swinging(0.0)[0].edit("rod", damping=0.05)
    cases = {str(first): (swinging(first)[1], {"q": [1.0]}) for first in (0.0, 5.0, -3.0)}
    assert pg.fit(model, cases, DAMPING, **FIT).x == pytest.approx([0.2], rel=1e-7)


def test_the_initial_state_may_lie_before_the_data():
    model, data = swinging(0.0)
    late = {name: values[40:] for name, values in data.items()}
    start = model.edit("rod", damping=0.05)
    found = pg.fit(start, late, DAMPING, t_start=0, q=[1.0], **FIT)
    assert found.x == pytest.approx([0.2], rel=1e-7)
    own = pg.fit(start, {"late": (late, {"t_start": 0.0, "q": [1.0]})}, DAMPING, **FIT)
    assert own.x == pytest.approx([0.2], rel=1e-7)
    refused: tuple[Any, ...] = (0.5, "0", np.nan)
    for first in refused:
        with pytest.raises(pg.InputError):
            pg.fit(start, late, DAMPING, t_start=first, q=[1.0], **FIT)


def test_functions_of_time_keep_the_times_of_the_data():
    push = pg.Motor(name="push", body="rod", torque="=2*sin(8*t)")
    model, _ = swinging(0.0)
    model = model.add(push)
    t = 0.3 + TIMES
    data = {"t": t, "rod": pg.simulate(model, [1.0], t_start=0.3, t_eval=t, **FIT)["rod"]}
    found = pg.fit(model.edit("rod", damping=0.05), data, DAMPING, q=[1.0], **FIT)
    assert found.x == pytest.approx([0.2], rel=1e-7)


def test_a_printed_fit_compares_residuals_with_the_spread_of_the_data():
    """Only a run that is farther from the data than their mean is said to be so."""
    model, data = swinging(0.0)
    rod, rng = data["rod"], np.random.default_rng(0)
    fits = {
        rms: pg.fit(model, {**data, "rod": rod + shift}, DAMPING, q=[1.0], **FIT)
        for rms, shift in ((1e-3, 1e-3 * rng.normal(size=len(rod))), (2.0, 2.0))
    }
    for rms, found in fits.items():
        told, left = repr(found), np.sqrt(np.mean(found.residuals["rod"] ** 2))
        assert f"{left:.3g}" in told
        assert left == pytest.approx(rms, rel=0.1)
        assert f"{np.std(rod):.3g}" in told
        assert found.units["rod"] == "rad"
        assert ("mean" in told) == (left > np.std(rod))


def test_files_and_tables_are_read_like_dicts(tmp_path):
    pandas = pytest.importorskip("pandas")
    data = measured(0)
    table = pandas.DataFrame(data)
    table.rename(columns={"t": "t [s]", "upper": "upper [rad]"}).to_csv(
        tmp_path / "x.csv", index=False
    )
    start = described("double_pendulum").edit("upper", q=[0.9])
    found = [pg.fit(start, d, FREE, **FIT) for d in (data, table, tmp_path / "x.csv")]
    assert found[0].values == pytest.approx(found[1].values, rel=1e-9)
    assert found[0].values == pytest.approx(found[2].values, rel=1e-9)


@pytest.mark.parametrize(
    ("noise", "method"), combined([0.0, 1e-9, 1e-3], ["rk4", "dop853", "radau5"])
)
def test_a_direction_that_data_do_not_determine_is_named(noise, method):
    """Masses, inertia and damping times one number give the same motion, with or without noise."""
    rod = pg.Body(
        name="rod", axes=(0, 1, 0), com=(0, 0, -0.4), mass=1.0, inertia=np.diag([0.03, 0.02, 0.03]),
        damping=0.05, q=[1.0],
    )  # fmt: skip
    model = pg.Model(bodies=[rod])
    given = {"method": method, "step": 1e-2 if method == "rk4" else None}
    exact = pg.simulate(model, t_eval=TIMES, t_end=1.5, estimate=False, **given)["rod"]
    data = {"t": TIMES, "rod": exact + noise * np.random.default_rng(0).normal(size=len(TIMES))}
    paths = ["bodies.rod.damping", "bodies.rod.mass", "bodies.rod.inertia.1.1"]
    found = pg.fit(model, data, dict(zip(paths, ((0.0, 1.0), (0.5, 2.0), (0.001, 0.055)))), **given)
    assert len(found.undetermined) == 1
    assert all(path in found.undetermined[0] for path in paths[1:])
    assert np.isnan(found.errors["bodies.rod.mass"])
    assert "nan" not in repr(found)


@pytest.mark.parametrize(
    ("change", "free"),
    [
        ({"upper": None}, {"bodies.lower.mass": (0.1, 5.0)}),
        ({"uper": TIMES, "upper": None}, FREE),
        ({"upper": TIMES * np.nan}, FREE),
        ({"upper": TIMES[:3]}, FREE),
        ({"t": -TIMES}, FREE),
        ({}, {"bodies.lower.mas": (0.1, 5.0)}),
        ({}, {"bodies.lower.mass": (-1.0, 5.0)}),
        ({}, {"bodies.lower.mass": (2.0, 5.0)}),
        ({}, {"bodies.lower.mass": 3.0}),
        ({}, {"bodies.lower.tip.0": (-1.0, 1.0)}),
        ({}, {}),
    ],
)
def test_what_cannot_be_fitted_is_refused(change, free):
    data = {k: x for k, x in (measured(0) | {"v.lower": None} | change).items() if x is not None}
    with pytest.raises(pg.InputError):
        pg.fit(described("double_pendulum"), data, free, **FIT)


def outliers(seed):
    data = measured(seed)
    wrong = np.random.default_rng(seed).choice(len(TIMES), 15, replace=False)
    for name in ("upper", "v.lower"):
        data[name] = data[name].copy()
        data[name][wrong] += 0.5
    return data


@pytest.mark.parametrize(("loss", "seed"), combined(["soft_l1", "huber", "cauchy"], [0, 1, 2]))
def test_robust_losses_bear_outliers_without_a_given_noise(loss, seed):
    start = described("double_pendulum").edit("lower", mass=0.9).edit("upper", q=[0.8])
    found = pg.fit(start, outliers(seed), FREE, loss=loss, **FIT)
    assert found.converged
    assert found.noise["upper"] == pytest.approx(1e-3, rel=0.5)
    for path, true in zip(FREE, (1.3, 1.0)):
        assert abs(found.values[path] - true) < 4.0 * found.errors[path]


def test_several_cases_share_the_model_and_have_their_own_starts():
    true = described("double_pendulum").edit("lower", mass=1.3)
    rng = np.random.default_rng(0)
    cases, starts = {}, {"slow": 0.3, "fast": 1.5}
    for name, angle in starts.items():
        run = pg.simulate(true, {"upper": angle}, t_eval=TIMES, t_end=1.5, estimate=False, **FIT)
        noisy = run["upper"] + 1e-3 * rng.normal(size=len(TIMES))
        cases[name] = ({"t": TIMES, "upper": noisy}, {"q": {"upper": angle + 0.05}})
    free = {"bodies.lower.mass": (0.1, 5.0), "q.upper@slow": (-1.0, 1.0), "q.upper@fast": (1, 2)}
    found = pg.fit(described("double_pendulum"), cases, free, **FIT)
    assert found.converged
    assert {*found.runs} == {*cases}
    assert {*found.residuals} == {"upper@slow", "upper@fast"}
    for (path, value), expected in zip(found.values.items(), (1.3, 0.3, 1.5)):
        assert abs(value - expected) < 4.0 * found.errors[path]
    one = pg.fit(true, {"slow": cases["slow"]}, {"bodies.lower.mass": (0.1, 5.0)}, **FIT)
    assert one.errors["bodies.lower.mass"] > found.errors["bodies.lower.mass"]
    for change in ({"q.upper@fats": (0, 1)}, {"q.lower@slow": (-1, 1)}, {"mass@slow": (0, 1)}):
        with pytest.raises(pg.InputError):
            pg.fit(described("double_pendulum"), cases, free | change, **FIT)


@pytest.mark.parametrize("how", [False, KeyboardInterrupt])
def test_a_fit_that_is_stopped_returns_its_best(how):
    told = []

    def progress(values, run):
        told.append(values)
        if len(told) == 3:
            if how is KeyboardInterrupt:
                raise KeyboardInterrupt
            return False

    start = described("double_pendulum").edit("lower", mass=0.9).edit("upper", q=[0.8])
    found = pg.fit(start, measured(0), FREE, progress=progress, **FIT)
    assert not found.converged
    assert found.values in told


def test_a_fit_passes_by_invalid_models():
    """Differences of what is packed leave the valid inertias near the bound."""
    rod = pg.Body(
        name="rod", joint="revolute", axes=[(0, 1, 0)], mass=1.0, com=(0, 0, -0.4), q=[1.0],
        inertia=np.diag([0.03, 0.05, 0.03]), damping=0.01,
    )  # fmt: skip
    model = pg.Model(bodies=[rod], gravity=(0, 0, -9.81))
    run = pg.simulate(model.edit("rod", inertia=np.diag([0.04, 0.07, 0.04])), t_eval=TIMES,
                      t_end=1.5, estimate=False, **FIT)  # fmt: skip
    free = {"bodies.rod.inertia.1.1": (0.03, 0.0599), "bodies.rod.damping": (0.0, 1.0)}
    found = pg.fit(model, {"t": TIMES, "rod": run["rod"]}, free, **FIT)
    assert "at its bound" in found.message
    assert found.model.body("rod").inertia[1][1] == pytest.approx(0.0599, rel=1e-3)


def test_a_fit_that_ends_beside_runs_that_fail_has_not_converged():
    """Some runs of a ball that nearly comes to rest have no derivatives. The optimum is beyond."""
    ball = pg.Body(
        name="ball", joint="prismatic", axes=(0, 0, 1), mass=1.0,
        shape=pg.Shape(kind="sphere", radius=0.05),
    )  # fmt: skip
    floor = pg.Contact(name="floor", body="ball", restitution=0.495)
    height, e, gravity = 0.6, 0.45, 9.81
    t = np.linspace(0.0, 1.4, 120)
    z = height - gravity / 2 * t**2
    begin, speed = math.sqrt(2 * height / gravity), e * math.sqrt(2 * height * gravity)
    for _ in range(30):
        since = t[t >= begin] - begin
        z[t >= begin] = np.maximum(speed * since - gravity / 2 * since**2, 0.0)
        begin, speed = begin + 2 * speed / gravity, e * speed
    z += 0.05 + 1.8e-4 * np.random.default_rng(1).standard_normal(len(t))
    free = {"contacts.floor.restitution": (0.05, 0.99)}
    start = {"q": {"ball": height + 0.05}, "v": {"ball": 0.0}}
    model = pg.Model(bodies=[ball], contacts=[floor])
    found = pg.fit(model, {"t": t, "ball": z}, free, t_start=0.0, **start)
    (value,), (error,) = found.values.values(), found.errors.values()
    assert not found.converged or abs(value - e) < 3 * error


@pytest.mark.nightly
def test_errors_cover_the_truth_in_95_of_100_noise_seeds():
    start = described("double_pendulum").edit("lower", mass=0.9).edit("upper", q=[0.8])
    covered = dict.fromkeys(FREE, 0)
    for seed in range(100):
        found = pg.fit(start, measured(seed), FREE, **FIT)
        for path, true in zip(FREE, (1.3, 1.0)):
            covered[path] += abs(found.values[path] - true) < 2.0 * found.errors[path]
    # 95.4 are expected of a normal variable: fewer than 90 come by chance in 1 of 100 cases
    assert min(covered.values()) >= 90, covered


# -- units, starts, residuals and results as data --------------------------------------------------


def oscillating(stiffness=40.0, **fields):
    """A block of 2 kg on a spring, and times over six of its periods."""
    spring = pg.Spring(name="s", body="block", other="ground", stiffness=stiffness, rest=0.0)
    block = pg.Body(name="block", joint="prismatic", axes=[(1, 0, 0)], mass=2.0, q=[0.5], **fields)
    return pg.Model(bodies=[block], forces=[spring], gravity=(0, 0, 0))


LONG = np.linspace(0.0, 8.0, 201)
STEP = {"method": "rk4", "step": 1e-2}
STIFFNESS = {"forces.s.stiffness": (10.0, 100.0)}


def waving(noise=1e-3, stiffness=40.0):
    """The closed form of `oscillating`, with noise."""
    noisy = noise * np.random.default_rng(0).normal(size=len(LONG))
    return {"t": LONG, "block": 0.5 * np.cos(np.sqrt(stiffness / 2.0) * LONG) + noisy}


@pytest.mark.parametrize(("unit", "time"), [("mm", "ms"), ("cm", "s"), ("km", "us"), ("m", "min")])
def test_data_and_noise_in_units_of_one_kind_are_converted(unit, time):
    per = {"mm": 1e3, "cm": 1e2, "km": 1e-3, "m": 1.0}[unit]
    own = {"ms": 1e3, "s": 1.0, "us": 1e6, "min": 1 / 60}[time]
    plain = waving()
    data = {f"t [{time}]": own * LONG, f"block [{unit}]": per * plain["block"]}
    found = pg.fit(oscillating(39.0), data, STIFFNESS, sigma={"block": per * 1e-3}, **STEP)
    same = pg.fit(oscillating(39.0), plain, STIFFNESS, sigma={"block": 1e-3}, **STEP)
    assert found.x == pytest.approx(same.x, rel=1e-9)
    assert found.errors == pytest.approx(same.errors, rel=1e-6)


@pytest.mark.parametrize(
    ("given", "unit", "factor"),
    [("deg", "rad", np.pi / 180), ("rpm", "rad/s", np.pi / 30), ("deg/s^2", "rad/s^2", np.pi / 180),
     ("kN", "N", 1e3), ("N mm", "N m", 1e-3), ("mJ", "J", 1e-3), ("km/min", "m/s", 1e3 / 60),
     ("kg m^2", "g m^2", 1e3), ("kg", "m", None), ("m/s", "m/s^2", None), ("x", "m", None)],
)  # fmt: skip
def test_units_are_products_of_words(given, unit, factor):
    from pgraph_core.search.measured import factor_of

    assert factor_of(given, unit) == (None if factor is None else pytest.approx(factor, rel=1e-14))


def test_a_run_is_data():
    run = pg.simulate(oscillating(40.0), t_eval=LONG, estimate=False, **STEP)
    assert pg.fit(oscillating(39.0), run, STIFFNESS, **STEP).x == pytest.approx([40.0], rel=1e-9)
    cases = {"one": run, "two": (run, {"v": [0.0]})}
    assert pg.fit(oscillating(39.0), cases, STIFFNESS, **STEP).x == pytest.approx([40.0], rel=1e-9)


def test_a_false_minimum_is_said_and_left_by_several_starts():
    """Six periods fit a spring that makes seven or five of them, too, but leave a wave."""
    model, data = oscillating(75.0), waving()
    false = pg.fit(model, data, STIFFNESS, **STEP)
    assert abs(false.x[0] - 40.0) > 5.0
    assert any("not noise" in text and "starts" in text for text in false.notices)
    assert all(text in repr(false) for text in false.notices)
    given = pg.fit(model, data, STIFFNESS, sigma={"block": 1e-3}, **STEP)
    assert any("sigma" in text for text in given.notices)
    for starts in (8, [{"forces.s.stiffness": 75.0}, {"forces.s.stiffness": 41.0}]):
        true = pg.fit(model, data, STIFFNESS, starts=starts, sigma={"block": 1e-3}, **STEP)
        assert true.x == pytest.approx([40.0], abs=4.0 * true.errors["forces.s.stiffness"])
        assert true.notices == ()
        assert min(end.objective for end in true.endings) < 2.0 * len(LONG)
    for starts in (0, "many", [{"mass": 1.0}]):
        with pytest.raises(pg.InputError) as refused:
            pg.fit(model, data, STIFFNESS, starts=starts, **STEP)  # type: ignore[arg-type]
        assert "fit" in str(refused.value)


def test_white_residuals_are_noise():
    """Four standard deviations are passed by 1 of 16,000 columns, and by none of 200."""
    from pgraph_core.search.quality import not_noise

    rng = np.random.default_rng(0)
    columns = {str(n): rng.standard_t(2, size=50 + n) for n in range(200)}
    assert not_noise(columns, dict.fromkeys(columns, 0.0)) == []
    walks = {"walk": np.cumsum(rng.normal(size=50))}
    assert not_noise(walks, {"walk": 0.0})
    assert not_noise(walks, {"walk": 1e9}) == []


def test_numbers_that_the_data_determine_together_are_named():
    """Mass, inertia and damping times one number give the same motion: ratios are determined."""
    rod = pg.Body(
        name="rod", axes=(0, 1, 0), com=(0, 0, -0.4), mass=1.0, damping=0.05, q=[1.0],
        inertia=np.diag([0.03, 0.03, 0.03]),
    )  # fmt: skip
    model = pg.Model(bodies=[rod])
    exact = pg.simulate(model, t_eval=TIMES, estimate=False, **FIT)["rod"]
    data = {"t": TIMES, "rod": exact + 1e-4 * np.random.default_rng(0).normal(size=len(TIMES))}
    free = {"bodies.rod.damping": (0.0, 1.0), "bodies.rod.mass": (0.5, 2.0),
            "bodies.rod.inertia.1.1": (0.001, 0.055)}  # fmt: skip
    found = pg.fit(model, data, free, **FIT)
    ratios = {
        frozenset(("bodies.rod.damping", "bodies.rod.mass")): 0.05,
        frozenset(("bodies.rod.inertia.1.1", "bodies.rod.mass")): 0.03,
        frozenset(("bodies.rod.damping", "bodies.rod.inertia.1.1")): 0.05 / 0.03,
    }
    assert len(found.combinations) == 2
    for text, (value, error) in found.combinations.items():
        above, below = text.split(" / ")
        true = ratios[frozenset((above, below))]
        assert min(abs(value - true), abs(value - 1.0 / true)) < 4.0 * error, text
        assert text in repr(found)
    assert all(np.isnan(error) for error in found.errors.values())


@pytest.mark.parametrize(("start", "field"), combined([0.0, 0.5], ["damping", "friction"]))
def test_numbers_may_start_at_zero_and_at_a_bound(field, start):
    """A damper or friction of zero is none, and the search begins beside it."""
    model, place = pg.Model.serial(2), f"bodies.2.{field}.0"
    given = {"v": [0.0, 1.0], "step": 1e-3}
    run = pg.simulate(model.edit("2", **{field: 0.02}), t_eval=TIMES, estimate=False, **given)
    begin = model.edit("2", **{field: 0.1 * start})
    found = pg.fit(begin, {"t": TIMES, "2": run["2"]}, {place: (0.0, 0.05)}, **given)
    assert found.x == pytest.approx([0.02], rel=1e-3)


def test_a_fit_is_data():
    """Intervals are those of Student's distribution, and JSON has null for what is not known."""
    import json

    from scipy.stats import t

    found = pg.fit(oscillating(39.0), waving(), STIFFNESS, **STEP)
    (path,), (error,) = found.values, found.errors.values()
    far = t(len(LONG) - 1).ppf(0.95)
    value = found.values[path]
    assert found.intervals(0.9)[path] == pytest.approx((value - far * error, value + far * error))
    assert found.covariance[0, 0] == pytest.approx(error**2)
    read = json.loads(found.to_json())
    assert read["values"] == found.values
    assert read["errors"] == found.errors
    assert read["converged"] is True
    pandas = pytest.importorskip("pandas")
    table = found.to_pandas()
    assert isinstance(table, pandas.DataFrame)
    assert table.loc[path, "value"] == value
    with pytest.raises(pg.InputError):
        found.intervals(95)


def test_errors_of_runs_name_the_call():
    for change in ({"tau": lambda t, q, v: 0.0 * v}, {"stop": 3.0}, {"method": "rk5"}):
        with pytest.raises(pg.InputError) as refused:
            pg.fit(oscillating(39.0), waving(), STIFFNESS, **STEP | change)  # type: ignore[arg-type]
        assert str(refused.value).startswith("fit")
        assert "wrt" not in str(refused.value).partition(";")[0]


@pytest.mark.parametrize("given", ["none", "other", "data", "free", "earlier"])
@pytest.mark.parametrize("noise", [0.0, 1e-2])
def test_a_start_that_is_not_that_of_the_data_is_named_with_a_remedy(given, noise):
    model, data = swinging(0.0)
    model = model.add(pg.Body(name="other", axes=(0, 1, 0), com=(0, 0, -0.5), mass=1.0))
    data["rod"] = data["rod"] + noise * np.random.default_rng(0).normal(size=len(TIMES))
    first = data["rod"][0]
    start = {"other": 0.4, "data": first}.get(given, 0.0)
    options = {"q": {"rod": start}} if start else {}
    options |= {"t_start": -0.1} if given == "earlier" else {}
    free: dict[str, Any] = {"bodies.rod.damping": (0.05, 1.0)}
    free |= {"q.rod": (0.1, 2.0)} if given == "free" else {}
    try:
        found = pg.fit(model, data, free, **options, **FIT)
        told = " ".join(found.notices)
    except pg.InputError as refused:  # it rests
        told = str(refused)
    here = given in ("none", "other")
    assert (f"rod starts at {start:.4g}" in told) == here
    if here:
        assert_names(told, f"first datum is {first:.4g}", f"give q={{'rod': {first:.6g}}}", "q.rod")
