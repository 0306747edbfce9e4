"""What `work_precision` and `pgraph report` answer to wrong input: the field and the fact."""

from __future__ import annotations

import re
from typing import Any

import pytest

import pgraph_core as pg
import pgraph_models
from pgraph_app.cli import main
from pgraph_core.integrators import METHODS
from pgraph_core.study.task import installed_peers

NAMES = ", ".join(METHODS)

# (arguments, the sentence)
REFUSED: list[tuple[dict[str, Any], str]] = [
    (
        {"methods": ("rk4", "rk5")},
        f"work_precision, methods: no method is called 'rk5'; choose one of {NAMES}",
    ),
    (
        {"methods": "auto"},
        f"work_precision, methods: no method is called 'auto'; choose one of {NAMES}",
    ),
    (
        {"methods": ()},
        f"work_precision, methods: give at least one; {NAMES}",
    ),
    (
        {"steps": ()},
        "work_precision, steps: must be one number or more, each within 1e-08 and 1; given ()",
    ),
    (
        {"steps": (0.1, -1)},
        "work_precision, steps: must be one number or more, each within 1e-08 and 1; "
        "given (0.1, -1)",
    ),
    (
        {"tolerances": 1e-17},
        "work_precision, tolerances: must be one number or more, each within 1e-15 and 0.1; "
        "given 1e-17",
    ),
    (
        {"tolerances": [10.0**-k for k in range(70)]},
        "work_precision, tolerances: are 70 settings of each method; give 64 at most",
    ),
    ({"t_end": 0}, "work_precision, t_end: must be a finite number > 0 [s]; given 0"),
    ({"clock": "sun"}, "work_precision, clock: must be one of wall, processor; given 'sun'"),
    ({"rounds": 0}, "work_precision, rounds: must be a whole number >= 1; given 0"),
    ({"frames": 2.5}, "work_precision, frames: must be a whole number >= 3; given 2.5"),
    (
        {"target": -1e-6},
        "work_precision, target: must be a finite number > 0, an error without unit such as 1e-6; "
        "given -1e-06",
    ),
    ({"longest": "long"}, "work_precision, longest: must be a finite number > 0 [s]; given 'long'"),
    (
        {"peers": "drake"},
        "work_precision, peers: no peer is called 'drake'; choose from "
        + ", ".join(sorted(installed_peers())),
    ),
    (
        {"reference": 3.0},
        "work_precision, reference: must be a Result, a Case, a Reference, or (t, q) with two "
        "times or more, q of shape (len(t), 1); given float",
    ),
]


@pytest.mark.parametrize(("given", "sentence"), REFUSED)
def test_what_does_not_fit_is_a_sentence(given: dict[str, Any], sentence: str):
    mech = pg.Mechanism(pg.Model.load(pgraph_models.path("pendulum")))
    with pytest.raises(pg.InputError) as refused:
        pg.work_precision(mech, **{"t_end": 1.0, **given})
    field, *_, fact = re.split(": |; ", sentence)
    assert str(refused.value).startswith(f"{field}: ")
    assert fact in str(refused.value)


def test_a_target_that_no_method_reaches_is_said_with_the_best_reached():
    mech = pg.Mechanism(pg.Model.load(pgraph_models.path("pendulum")))
    study = pg.work_precision(mech, t_end=0.2, methods="rk4", steps=0.01, rounds=1, target=1e-12)
    best = study.rows[0].error
    said = f"no method reaches 1e-12; the best is {best:.2g} by rk4 at step 0.01 s"
    with pytest.raises(pg.InputError) as unmet:
        study.recommend()
    assert str(unmet.value) == f"recommend, target: {said}"
    assert said in str(study)


def test_runs_that_were_left_out_are_named_where_a_target_is_not_reached():
    mech = pg.Mechanism(pg.Model.load(pgraph_models.path("pendulum")))
    given = {"methods": "rk4", "steps": [0.1, 1e-3, 1e-8], "rounds": 1, "target": 1e-15}
    study = pg.work_precision(mech, t_end=0.2, longest=0.2, **given)
    assert "1 run was left out: give a larger `longest`" in study.answer


def test_a_report_of_another_kind_is_refused(tmp_path):
    mech = pg.Mechanism(pg.Model.load(pgraph_models.path("pendulum")))
    study = pg.work_precision(mech, t_end=0.2, methods="rk4", steps=0.01, rounds=1)
    path = tmp_path / "report.pdf"
    with pytest.raises(pg.FileError) as refused:
        study.save(path)
    wanted = f"{path}: a report is written as .html, .json, .svg, .txt; given '.pdf'"
    assert str(refused.value) == wanted


# (words after `pgraph report`, exit code, what stderr begins with)
TYPED: list[tuple[list[str], int, str]] = [
    ([], 1, "pgraph report: give either a MODEL or --case NAME"),
    (["pendulum", "--case", "heavy_top"], 1, "pgraph report: give either a MODEL or --case NAME"),
    (["pendulum", "-o", "a.pdf"], 1, "a.pdf: must end in .html, .json, .svg, .txt"),
    (["--case", "none"], 1, "case 'none': no case has this name; choose one of a01"),
    (["--case", "chain_n_links"], 1, "case 'chain_n_links': names several cases; choose one of "),
    (
        ["--case", "painleve_rod_1"],
        1,
        "case 'painleve_rod_1': has no motion over time to compare with; choose another case",
    ),
    (["pendulum", "--methods", "rk5"], 1, "work_precision, methods: no method is called 'rk5'"),
]


@pytest.mark.parametrize(("words", "code", "said"), TYPED)
def test_what_is_typed_wrong_is_a_sentence(capsys, words: list[str], code: int, said: str):
    assert main(["report", *words]) == code
    assert capsys.readouterr().err.startswith(said)


def test_a_number_that_is_none_is_usage(capsys):
    with pytest.raises(SystemExit) as stopped:
        main(["report", "pendulum", "--steps", "a,b"])
    assert stopped.value.code == 2
    assert "must be numbers separated by commas; given 'a,b'" in capsys.readouterr().err
