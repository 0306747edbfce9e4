"""The reports in the page: settings, results and advice."""

from __future__ import annotations

import json
import threading
import time
from dataclasses import replace
from typing import Any

import pytest

import pgraph_core as pg
from pgraph_app.core.state import Kernels, State, initial
from pgraph_app.features import update
from pgraph_app.model.update import Edit
from pgraph_app.report.update import (
    Analyse,
    CancelAnalysis,
    DownloadReport,
    Measuring,
    SetReport,
    UseAdvised,
)
from pgraph_app.report.view import compared_with, drawn, page, reports
from pgraph_app.report.worker import Analyst
from pgraph_app.run.view import run
from pgraph_app.session.update import Connected
from pgraph_core.study.axes import AXES

ME = 1


@pytest.fixture
def state() -> State:
    model = pg.Model.serial(2)
    state = replace(initial(model), kernels=Kernels(ready=True))
    return update(state, Connected(ME))


def measured(state: State, kind: Any) -> State:
    """The state after a report, by the thread that measures it."""
    heard: list[Any] = []
    done = threading.Event()

    def send(event: Any) -> None:
        heard.append(event)
        if not isinstance(event, Measuring):
            done.set()

    state = update(state, Analyse(ME, kind))
    Analyst(send).render(state, state)
    assert done.wait(120)
    for event in heard:
        state = update(state, event)
    return state


def test_error_against_run_time(state):
    state = update(state, SetReport(ME, 1, "t_end", "0.2"))
    state = measured(state, "precision")
    assert state.analysis is None
    sent = reports(state)["results"][0]
    assert "Take " in sent["advice"]
    assert sent["rows"]
    assert state.report is not None
    assert state.report.result.figure().startswith("<svg")
    assert "<html" in page(state.report)[:400].lower()
    assert json.dumps(reports(state), allow_nan=False)
    row, used = state.report.result.advised(), update(state, UseAdvised(ME)).request
    assert (used.method, used.step, used.rtol) == (row.method, row.step, row.rtol)
    assert sent["use"] == f"{row.method} at {row.setting}"
    assert run(update(state, UseAdvised(ME)))["request"]["rtol"] == row.rtol
    stale = update(state, Edit(ME, 2, "1", "mass", (), "3"))
    assert reports(stale)["results"][0]["stale"] == "Measured before the model was changed."


def test_there_is_no_report_of_a_model_without_bodies():
    empty = update(initial(pg.Model()), Connected(ME))
    assert reports(empty)["empty"]
    for kind in ("precision", "stability"):
        asked = update(empty, Analyse(ME, kind))
        assert asked.analysis is None
        assert "no body" in reports(asked)["problem"]


def test_stability(state):
    state = update(state, SetReport(ME, 1, "axis", "step"))
    state = update(state, SetReport(ME, 2, "t_end", "0.1"))
    sent = reports(measured(state, "stability"))["results"][0]
    assert sent["title"].startswith("Stability over step")
    assert all(fact in sent["advice"] for fact in ("Take ", " at a step of "))


def test_both_reports_stay_and_each_has_its_button(state):
    state = update(state, SetReport(ME, 1, "t_end", "0.1"))
    first = measured(state, "precision")
    both = measured(update(first, SetReport(ME, 2, "axis", "mass_ratio")), "stability")
    assert [one["kind"] for one in reports(both)["results"]] == ["stability", "precision"]
    for narrow, wide in drawn(both).values():
        assert narrow.startswith("<svg")
        assert wide.startswith("<svg")
        assert narrow != wide
    found = both.report.result
    row, used = found.advised(), update(both, UseAdvised(ME, "stability")).request
    assert (used.method, used.step, used.rtol) == (row.method, row.step, None)
    assert f"Take {row.method} at a step of {row.step:g} s" in found.advice
    assert reports(both)["results"][0]["use"] == f"{row.method} at step {row.step:g} s"
    assert (
        update(both, UseAdvised(ME, "precision")).request == update(first, UseAdvised(ME)).request
    )
    again = measured(both, "precision")
    assert [one["kind"] for one in reports(again)["results"]] == ["precision", "stability"]
    assert again.report.other.result is found
    assert update(both, DownloadReport(ME, "precision")).clients[ME].reports == (1, "precision")


def test_what_does_not_hold_is_a_line_each_and_the_legend_is_above_the_map(state):
    state = update(state, SetReport(ME, 1, "t_end", "0.3"))
    state = measured(update(state, SetReport(ME, 2, "axis", "mass_ratio")), "stability")
    sent, found = reports(state)["results"][0], state.report.result
    bad = [cell for cell in found.cells if cell.status != "OK"]
    assert sum(int(cells.split()[0]) for _, cells, _ in sent["rows"]) == len(bad)
    assert len({(method, cells.split()[1]) for method, cells, _ in sent["rows"]}) == len(
        sent["rows"]
    )
    assert len(sent["notes"]) == len({text.rpartition(": known")[0] for text in found.references})
    svg = drawn(state)["stability"][0]
    for verdict in {cell.status for cell in found.cells}:
        assert svg.index(f">{verdict.lower()}: ") < svg.index(found.methods[0] + "</text>")


def test_references_of_a_map_are_grouped():
    one, two = "dop853 rtol 1e-12", "dopri5 rtol 1e-11"
    told = compared_with(
        [f"{one}: known to 3e-13", f"{one}: known to 2e-12", f"{two}: known to 1e-9"]
    )
    assert told == [
        f"Compared with {one}: known to 3e-13 to 2e-12", f"Compared with {two}: known to 1e-9",
    ]  # fmt: skip
    assert compared_with(["a closed form"]) == ["Compared with a closed form"]


def test_a_report_that_cannot_be_made_says_why(state):
    state = update(state, SetReport(ME, 1, "axis", "contact_stiffness"))
    state = measured(state, "stability")
    assert state.report is None
    assert "contact" in state.analysis_problem


@pytest.mark.parametrize(
    ("field", "text", "sentence"),
    [
        ("target", "2", "The error that is wanted must be above 0 and at most 1; given 2."),
        ("t_end", "1e9", "The duration must be above 0 and at most 60; given 1e+09."),
        ("axis", "nonsense", f"The axis must be one of {', '.join(AXES)}."),
    ],
)
def test_settings_that_do_not_fit_are_refused(state, field, text, sentence):
    refused = update(state, SetReport(ME, 7, field, text))
    assert refused.reporting == state.reporting
    assert refused.clients[ME].reply.text == sentence


def test_a_cancelled_report_ends_soon(state):
    asked = update(state, Analyse(ME, "precision"))
    heard: list[Any] = []
    analyst = Analyst(heard.append)
    analyst.render(asked, asked)
    while not heard:
        time.sleep(0.01)
    cancelled = update(asked, CancelAnalysis(ME))
    analyst.render(asked, cancelled)
    end = time.monotonic() + 30
    while isinstance(heard[-1], Measuring) and time.monotonic() < end:
        time.sleep(0.01)
    assert not isinstance(heard[-1], Measuring)
    assert update(cancelled, heard[-1]).analysis is None
