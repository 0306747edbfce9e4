"""Every case comes as near to its reference as it must, by its own file."""

import json

import mpmath
import numpy as np
import pytest

import pgraph_core as pg
import pgraph_models
from pgraph_models import build_cases, case_models

LONG = ("a02_n_four_bar_10", "a02_n_four_bar_40", "chain_n_links_1000",
        "hanging_chain_frequencies_1000")  # seconds each  # fmt: skip


@pytest.mark.parametrize(
    "name",
    [
        pytest.param(name, marks=[pytest.mark.nightly] if name in LONG else [])
        for name in pgraph_models.case_names()
    ],
)
def test_every_case_reaches_its_target(name):
    (case,) = pgraph_models.cases(name)
    verdict = pg.verify(case)
    assert verdict.ok, (verdict.observable.name, verdict.error)
    assert case.accuracy < 1e-11  # of the reference


def test_case_files_are_as_built(tmp_path):
    build_cases.write(tmp_path)
    built, kept = (
        {file.relative_to(folder): file.read_bytes() for file in folder.rglob("*.json")}
        for folder in (tmp_path, pgraph_models.CASES)
    )
    assert built == kept


def test_a_family_and_its_members():
    family = tuple(f"chain_n_links_{n}" for n in (10, 100, 1000))
    assert pgraph_models.case_names("chain_n_links") == family
    assert [case.name for case in pgraph_models.cases("heavy_top")] == ["heavy_top"]
    with pytest.raises(pg.InputError, match=r"'horse'.* a01_simple_pendulum"):
        pgraph_models.cases("horse")


def own_case(file, **changes):
    body = {"name": "a", "com": [0, 0, -1], "axes": [[0, 1, 0]]}
    seen = {"kind": "q", "reference": "q", "target": 1e-12, **changes}
    texts = dict.fromkeys(("name", "description", "why_hard", "how_obtained"), "own")
    run = {"model": {"bodies": [body]}, "run": {}, "observables": [seen]}
    numbers = {"estimated_accuracy": 0.0, "t": [0.0, 1.0], "reference": {"q": [0.0, 0.0]}}
    file.write_text(json.dumps({**texts, **numbers, "cases": [run]}))
    return file


@pytest.mark.parametrize(("reference", "error"), [([0.0, 0.0], 0.0), ([0.5, 0.5], 0.5)])
def test_a_case_of_ones_own(reference, error, tmp_path):
    (case,) = pg.load_cases(own_case(tmp_path / "own.json", reference=reference))
    verdict = pg.verify(case)
    assert verdict.ok == (error == 0.0)
    assert verdict.error == pytest.approx(error)


@pytest.mark.parametrize(
    ("changes", "fact"),
    [({"kind": "colour"}, "kind.*'colour'.*q, v, "), ({"reference": "nowhere"}, "nowhere"),
     ({"target": "small"}, "cases.*float")],
)  # fmt: skip
def test_faults_of_a_case_file_are_named(changes, fact, tmp_path):
    with pytest.raises(pg.FileError, match=fact):
        pg.load_cases(own_case(tmp_path / "own.json", **changes))


def test_a_run_that_ends_early_misses():
    """The frames that it lacks are infinitely far off."""
    (case,) = pgraph_models.cases("double_pendulum")
    run = case.motion(max_steps=50)
    assert not run.status.ok
    errors = case.observables[0].errors(run)
    assert np.isfinite(errors[0])
    assert np.isinf(errors[-1])


mp = mpmath.mp.clone()
mp.dps = 50


def exact_chain(n, given):
    """Relative angular accelerations of a planar chain of point masses on rods of 1 m.

    In absolute angles a from the downward vertical, with the mass m_i from link i on:
    sum_j m_max(i,j) cos(a_i - a_j) a_j'' = -sum_j m_max(i,j) sin(a_i - a_j) a_j'^2 - g m_i sin a_i.
    """
    angle, speed = ([sum(x[: i + 1]) for i in range(n)] for x in (given, given[n : 2 * n]))
    beyond = [sum(given[2 * n + i :]) for i in range(n)]
    M, f = mp.matrix(n, n), mp.matrix(n, 1)
    for i in range(n):
        f[i] = -9.81 * beyond[i] * mp.sin(angle[i])
        for j in range(n):
            both = beyond[max(i, j)]
            M[i, j] = both * mp.cos(angle[i] - angle[j])
            f[i] -= both * mp.sin(angle[i] - angle[j]) * speed[j] ** 2
    a = list(mp.lu_solve(M, f))
    return np.array([a[0], *(a[i] - a[i - 1] for i in range(1, n))])


def rounding(exact, given) -> float:
    """Relative change of the answer where every given number changes by one part in 2^53."""
    rng, base = np.random.default_rng(0), exact([mp.mpf(x) for x in given])
    moved = mp.mpf(0)
    for _ in range(12):
        signs = rng.choice([-1.0, 1.0], len(given))
        other = exact([mp.mpf(x) * (1 + mp.mpf(s * 2.0**-53)) for x, s in zip(given, signs)])
        moved = max(moved, *abs(other - base))
    return float(moved / max(abs(base)))


@pytest.mark.parametrize(
    "masses", [*((1.0, 10.0**k) for k in range(-12, 13, 4)), (1.0,) * 3, (1.0,) * 10]
)
def test_chains_of_any_mass_ratio_are_as_exact_as_rounding_lets_them(masses):
    """Against 50 digits, at three times the effect of one unit in the last place of the input."""
    n, rng = len(masses), np.random.default_rng(len(masses))
    q, v = rng.uniform(-1.5, 1.5, n), rng.uniform(-2, 2, n)
    bodies = [
        pg.Body(
            name=f"b{i}", parent=f"b{i - 1}" if i else "ground", mass=mass,
            link=(0, -1 if i else 0, 0), com=(0, -1, 0), inertia=np.zeros((3, 3)),
        )
        for i, mass in enumerate(masses)
    ]  # fmt: skip
    mech = pg.Mechanism(pg.Model(bodies=bodies, gravity=(0, -9.81, 0), up="y"))
    given = [*q.tolist(), *v.tolist(), *masses]
    exact = exact_chain(n, [mp.mpf(x) for x in given]).astype(float)
    error = np.abs(mech.forward_dynamics(q, v, np.zeros(n)) - exact).max() / np.abs(exact).max()
    least = 1e-14 if n == 2 else 1e-12
    assert error <= 3 * max(least, rounding(lambda x: exact_chain(n, x), given))


@pytest.mark.parametrize("e", [0.0, 0.3, 0.9, pytest.param(1.0, marks=pytest.mark.nightly)])
def test_impacts_of_a_ball_are_located_at_any_restitution(e):
    """t_k = t_0 (1 + 2 (e + ... + e^k)), t_0 = sqrt(2 h / g), until a flight is too short."""
    fall = np.sqrt(2 / 9.81)
    count = 1 + sum(2 * fall * e**k > 1e-8 for k in range(1, 10))
    exact = fall * (1 + 2 * np.cumsum([0.0, *(e**k for k in range(1, count))]))
    run = pg.simulate(case_models.bouncing_ball(e), t_end=exact[-1] + 1e-3, method="rk4", step=2e-3)
    found = np.array([event.t for event in run.events][:count])
    np.testing.assert_allclose(found, exact, rtol=0, atol=3e-14 * count)
