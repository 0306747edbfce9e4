"""Every case comes as near to its reference as it must, by its own file."""

from __future__ import annotations

import json

import numpy as np
import pytest

import pgraph_core as pg
import pgraph_models
from benchmarks import between
from pgraph_models import build_cases

LONG = ("a02_n_four_bar_40", "chain_n_links_1000")  # seconds each


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
    assert case.accuracy < 1e-11  # references are far better than what is asked for


def test_case_files_are_as_built(tmp_path):
    """References as they came; models, runs and targets from the code."""
    build_cases.write(tmp_path)
    for file in sorted(pgraph_models.CASES.rglob("*.json")):
        again = tmp_path / file.relative_to(pgraph_models.CASES)
        assert again.read_bytes() == file.read_bytes(), file.name


def test_a_family_and_its_members():
    assert pgraph_models.case_names("chain_n_links") == (
        "chain_n_links_10",
        "chain_n_links_100",
        "chain_n_links_1000",
    )
    assert [case.name for case in pgraph_models.cases("heavy_top")] == ["heavy_top"]
    with pytest.raises(
        pg.InputError, match="case 'horse': no case has this name; choose one of a0"
    ):
        pgraph_models.cases("horse")


def own_case(**changes):
    """A case of the user's own: a pendulum that stays where it hangs."""
    body = {"name": "a", "com": [0, 0, -1], "axes": [[0, 1, 0]]}
    seen = {"kind": "q", "reference": "q", "target": 1e-12, **changes}
    return {
        "name": "own",
        "description": "hangs",
        "why_hard": "it is not",
        "how_obtained": "by thought",
        "estimated_accuracy": 0.0,
        "t": [0.0, 1.0],
        "reference": {"q": [0.0, 0.0]},
        "cases": [{"model": {"bodies": [body]}, "run": {}, "observables": [seen]}],
    }


def test_a_case_of_ones_own(tmp_path):
    file = tmp_path / "own.json"
    file.write_text(json.dumps(own_case()))
    (case,) = pg.load_cases(file)
    assert pg.verify(case).ok
    file.write_text(json.dumps(own_case(reference=[0.5, 0.5])))
    (case,) = pg.load_cases(file)
    missed = pg.verify(case)
    assert not missed.ok
    assert missed.error == pytest.approx(0.5)


@pytest.mark.parametrize(
    ("changes", "said"),
    [
        ({"kind": "colour"}, "kind: no observable is called 'colour'; choose one of q, v, "),
        ({"reference": "nowhere"}, "nowhere: is missing in a case"),
        ({"target": "small"}, "cases: cannot be read: could not convert string to float"),
    ],
)
def test_what_is_wrong_with_a_case_file_is_said(changes, said, tmp_path):
    file = tmp_path / "own.json"
    file.write_text(json.dumps(own_case(**changes)))
    with pytest.raises(pg.FileError) as refused:
        pg.load_cases(file)
    assert said in str(refused.value)


def test_a_run_that_ends_early_misses():
    """What it has is compared, what it lacks is infinitely far off."""
    (case,) = pgraph_models.cases("double_pendulum")
    run = case.motion(max_steps=50)
    assert not run.status.ok
    errors = case.observables[0].errors(run)
    assert np.isfinite(errors[0])
    assert np.isinf(errors[-1])


@pytest.mark.parametrize("ratio", between.RATIOS[::4])
def test_any_mass_ratio_is_as_exact_as_rounding_lets_it(ratio):
    """A double pendulum against 50 digits, at three times what one digit of its numbers does."""
    row = between.chain("mass ratio", ratio, (1.0, ratio))
    assert row.ok, row


@pytest.mark.nightly
def test_between_and_beyond_the_cases():
    assert [row for row in between.rows() if not row.ok] == []
