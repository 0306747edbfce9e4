"""The reports in the page: settings, results and advice."""

import dataclasses
import json
import threading
from functools import partial

import pytest

import pgraph_core as pg
from pgraph_app import report
from pgraph_app.core.jobs import Worker
from pgraph_app.report import Analysis, latest
from pgraph_app.report.view import drawn, page, reports
from pgraph_app.run.trust import method_label
from pgraph_app.run.view import run

from .store import LIMIT, ME, after, begun, do, until


def measured(state, kind):
    """Return the state after a report, by the thread that measures it."""
    heard, done = [], threading.Event()

    def send(event):
        heard.append(event)
        if not isinstance(event, do.Progress):
            done.set()

    state = after(state, do.Analyse(ME, kind))
    Worker(Analysis, Analysis.work, send).render(state, state)
    assert done.wait(LIMIT)
    return after(state, *heard)


@pytest.fixture(scope="module", autouse=True)
def two_methods():
    """Studies compare two methods only, and time each run once."""
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(report, "ROUNDS", 1)
        for study in ("work_precision", "stability_map"):
            few = partial(getattr(pg, study), methods=("semi_implicit_euler", "dopri5"))
            patch.setattr(pg, study, few)
        yield


@pytest.fixture(scope="module")
def precise():
    state = after(begun(pg.Model.serial(2)), do.SetReport(ME, 1, "t_end", "0.1"))
    return measured(state, "precision")


@pytest.fixture(scope="module")
def both(precise):
    state = after(precise, do.SetReport(ME, 2, "axis", "mass_ratio"))
    return measured(state, "stability")


def test_error_against_run_time(precise):
    assert precise.analysis is None
    (sent,) = reports(precise)["results"]
    assert sent["rows"]
    assert precise.report.result.figure().startswith("<svg")
    assert "<html" in page(precise.report)[:400].lower()
    assert json.dumps(reports(precise), allow_nan=False)
    row, used = precise.report.result.advised(), after(precise, do.UseAdvised(ME))
    asked = used.request
    assert (asked.method, asked.step, asked.rtol) == (row.method, row.step, row.rtol)
    assert sent["use"] == f"{row.method} at {row.setting}"
    assert method_label(row.method) in sent["advice"]
    assert run(used)["request"]["rtol"] == row.rtol
    stale = after(precise, do.EditBodies(ME, 2, ("1",), "mass", (((), "3"),)))
    assert (sent["stale"], bool(reports(stale)["results"][0]["stale"])) == ("", True)


def test_the_cells_of_a_map_come_one_by_one(both):
    """The map so far is shown in place of the last one, and cannot be used yet."""
    found = latest(both.report, "stability").result
    state = after(both, do.Analyse(ME, "stability"))
    before = drawn(state)
    so_far = dataclasses.replace(found, cells=found.cells[:1], complete=False)
    job = state.analysis
    state = after(state, do.Progress(job.id, job.changes(0.25, so_far)))
    one, other = reports(state)["results"]
    assert (one["kind"], one["running"], other["running"]) == ("stability", True, False)
    assert "so far" in one["title"]
    assert drawn(state)["stability"] != before["stability"]
    assert drawn(state)["precision"] == before["precision"]
    assert reports(state)["job"] == {"kind": "stability", "fraction": 0.25}
    ended = after(state, do.Done(job.id, found))
    assert not any(one["running"] for one in reports(ended)["results"])


def test_there_is_no_report_of_a_model_without_bodies():
    empty = begun(pg.Model())
    assert reports(empty)["empty"]
    for kind in ("precision", "stability"):
        asked = after(empty, do.Analyse(ME, kind))
        assert asked.analysis is None
        assert reports(asked)["problem"]


def test_both_reports_stay_and_each_has_its_button(precise, both):
    newest, older = reports(both)["results"]
    assert (newest["kind"], older["kind"]) == ("stability", "precision")
    assert all(svg.startswith("<svg") for svg in drawn(both).values())
    found = both.report.result
    row, used = found.advised(), after(both, do.UseAdvised(ME, "stability")).request
    assert (used.method, used.step, used.rtol) == (row.method, row.step, None)
    assert newest["use"] == f"{row.method} at step {row.step:g} s"
    assert f"{method_label(row.method)} at a step of {row.step:g} s" in newest["advice"]
    use = do.UseAdvised(ME, "precision")
    assert after(both, use).request == after(precise, use).request
    again = after(both, do.Analyse(ME, "precision"))
    again = after(again, do.Done(again.analysis.id, precise.report.result))
    assert [one["kind"] for one in reports(again)["results"]] == ["precision", "stability"]
    assert again.report.other.result is found
    wanted = do.DownloadReport(ME, "precision")
    assert after(both, wanted).clients[ME].asked is wanted


def test_each_verdict_of_a_map_is_a_line_and_the_legend_is_above_it(both):
    sent, found = reports(both)["results"][0], both.report.result
    bad = [cell for cell in found.cells if cell.status != "OK"]
    assert bad
    assert sum(int(cells.split()[0]) for _, cells, _ in sent["rows"]) == len(bad)
    kinds = [(method, cells.split()[1]) for method, cells, _ in sent["rows"]]
    assert len(set(kinds)) == len(kinds)
    assert len(sent["notes"]) == len({text.rpartition(": known")[0] for text in found.references})
    svg = drawn(both)["stability"]
    for verdict in {cell.status for cell in found.cells}:
        assert svg.index(f">{verdict.lower()}: ") < svg.index(found.methods[0] + "</text>")


def test_a_report_that_cannot_be_made_says_why():
    state = after(begun(pg.Model.serial(1)), do.SetReport(ME, 1, "axis", "contact_stiffness"))
    state = measured(state, "stability")
    assert state.report is None
    assert "contact" in state.analysis_problem


def test_a_cancelled_report_ends(monkeypatch):

    def measure(analysis, progress):
        until(lambda: not progress(0.5), "the cancellation")
        return "measured so far"

    monkeypatch.setitem(report.MEASURES, "precision", measure)
    asked, heard = after(begun(pg.Model.serial(1)), do.Analyse(ME, "precision")), []
    analyst = Worker(Analysis, Analysis.work, heard.append)
    analyst.render(asked, asked)
    until(lambda: heard, "progress")
    cancelled = after(asked, do.CancelAnalysis(ME))
    analyst.render(asked, cancelled)
    until(lambda: not isinstance(heard[-1], do.Progress), "the end")
    assert after(cancelled, heard[-1]).analysis is None
    assert after(cancelled, heard[-1]).report.result == "measured so far"
