"""`pgraph report`: rows, a page, exit codes; silent in a pipe."""

from __future__ import annotations

import json

from pgraph_app.cli import main

SHORT = ("--t-end", "0.2", "--methods", "rk4,dop853", "--steps", "0.01", "--tolerances", "1e-6")
QUICK = (*SHORT, "--rounds", "1", "--no-peers")


def test_report_for_people(capsys):
    assert main(["report", "double_pendulum", *QUICK, "--target", "1e-5"]) == 0
    out, err = capsys.readouterr()
    assert err == ""
    assert "error against run time over 0.2 s" in out
    assert "rk4     step 0.01 s" in out
    assert "recommended" in out


def test_report_for_programs(capsys, tmp_path):
    page = tmp_path / "report.html"
    assert main(["report", "double_pendulum", *QUICK, "--json", "-o", str(page)]) == 0
    data = json.loads(capsys.readouterr().out)
    assert [row["method"] for row in data["rows"]] == ["rk4", "dop853"]
    assert data["output"] == str(page)
    assert "<svg" in page.read_text(encoding="utf-8")


def test_a_target_that_is_not_reached_is_exit_code_one_after_all_rows(capsys):
    assert main(["report", "double_pendulum", *QUICK, "--target", "1e-15"]) == 1
    out, err = capsys.readouterr()
    assert "rk4     step 0.01 s" in out
    assert err.startswith("no method reaches 1e-15; the best is ")


def test_a_case_brings_its_reference(capsys):
    words = ["--case", "heavy_top", "--methods", "dop853", "--tolerances", "1e-6,1e-9"]
    assert main(["report", *words, "--rounds", "1", "--no-peers", "--json"]) == 0
    data = json.loads(capsys.readouterr().out)
    assert data["reference"]["source"].startswith("case heavy_top, ")
    rough, fine = data["rows"]
    assert fine["error"] < 1e-6 < rough["error"] < 1e-2
    assert data["t_end"] == 2.0
    assert data["frames"] == 41
