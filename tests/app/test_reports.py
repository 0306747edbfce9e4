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
from pgraph_app.report.update import Analyse, CancelAnalysis, Measuring, SetReport, UseAdvised
from pgraph_app.report.view import page, reports
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
    sent = reports(state)["result"]
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
    assert reports(stale)["result"]["stale"] == "Measured before the model was changed."


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
    sent = reports(measured(state, "stability"))["result"]
    assert sent["title"].startswith("Stability over step")
    assert all(fact in sent["advice"] for fact in ("Take ", " at a step of "))


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
