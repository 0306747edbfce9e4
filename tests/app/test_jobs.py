"""Background jobs: one class does simulations, reports and searches."""

import math
from dataclasses import replace

import numpy as np
import pytest

import pgraph_core as pg
from pgraph_app.capture import Dynamics, Fit, Fitted, Take
from pgraph_app.core import jobs
from pgraph_app.core.jobs import Finder, Finding, Job, Worker, cancelled
from pgraph_app.model import Found
from pgraph_app.report import Analysis
from pgraph_app.run import Kernels, Simulation
from pgraph_app.search import Search
from pgraph_core.errors import Problem

from .store import ME, after, begun, built_in, do, until

GOAL = (
    do.AskSearch(ME, "optimise"), do.SetGoal(ME, 1, "signal", "1"),
    do.FreeNumber(ME, "bodies.1.mass", True),
)  # fmt: skip
MODEL = pg.Model.serial(2)
TRIAL = pg.Trial(t=np.arange(9.0), coordinates={"1": np.zeros(9)})
TAKE = Take((("trial.csv", b""),), TRIAL)
MOTION = Fitted(MODEL, TAKE, TRIAL, np.zeros((9, 2)), np.zeros((9, 2, 7)))
OPEN = (
    do.OpenTrial(ME, "trial.csv", ""),
    do.ErrandDone(1, Found(value=(TAKE.files, TRIAL, TAKE.reading))),
)
ASK = {
    Fit: (*OPEN, do.FitPose(ME)),
    Dynamics: (*OPEN, do.FitPose(ME), do.Done(1, MOTION), do.ComputeMoments(ME)),
    Simulation: (do.Simulate(ME),), Analysis: (do.Analyse(ME, "precision"),),
    Search: (*GOAL, do.StartSearch(ME)),
}  # fmt: skip
every = pytest.mark.parametrize("kind", ASK)


def asked(kind, compiled=True):
    state = after(begun(MODEL, compiled=compiled), *ASK[kind])
    assert isinstance(getattr(state, kind.FIELD), kind)
    return state


def test_each_kind_of_job_is_tested():
    assert set(ASK) == set(Job.__subclasses__())


@every
@pytest.mark.parametrize(
    ("error", "fact"),
    [
        (pg.InputError(Problem("simulate", "method", "euler")), "euler"),
        (ZeroDivisionError("0"), "ZeroDivisionError"),
        (KeyboardInterrupt(), "cancelled"),
    ],
)
def test_a_job_that_fails_leaves_its_reason(kind, error, fact):
    def work(job, report):
        raise error

    state, heard = asked(kind), []
    Worker(kind, work, heard.append).render(state, state)
    until(lambda: heard, "the end")
    failed = after(state, *heard)
    assert getattr(failed, kind.FIELD) is None
    assert fact in getattr(failed, kind.PROBLEM)
    assert getattr(after(failed, *ASK[kind]), kind.PROBLEM) == ""


@every
def test_news_of_another_job_are_ignored(kind):
    state = asked(kind)
    number = getattr(state, kind.FIELD).id
    late = do.Progress(number + 1, {}), do.Done(number + 1, None), do.Failed(number + 1, "no")
    assert after(state, *late) is state


@every
@pytest.mark.parametrize("how", ["dropped", "cancelled"])
def test_a_job_ends_when_it_is_dropped_or_cancelled(kind, how):
    """It is told so by what `report` returns, also if it was cancelled before the kernels came."""

    ends = []

    def work(job, report):
        until(lambda: not report(*news), "the cancellation")
        ends.append(job.id)

    news = (1, "", None) if kind is Search else (0.5,)
    state, heard = asked(kind, compiled=False), []
    over = cancelled(state, kind) if how == "cancelled" else replace(state, **{kind.FIELD: None})
    worker = Worker(kind, work, heard.append)
    worker.render(state, state)
    ready = replace(state, kernels=Kernels(ready=True))
    if how == "cancelled":
        worker.render(state, replace(over, kernels=Kernels(ready=True)))
    else:
        worker.render(state, ready)
        worker.render(ready, over)
    until(lambda: ends, "the end")
    assert ends == [getattr(state, kind.FIELD).id]


@every
def test_a_server_that_stops_ends_its_jobs(kind, monkeypatch):
    """Python waits for threads that compute before it exits."""
    monkeypatch.setattr(jobs, "REPORT", math.inf)
    heard = []

    def work(job, progress):
        while progress():
            pass

    worker, state = Worker(kind, work, heard.append), asked(kind)
    worker.render(state, state)
    worker.stop()
    until(lambda: heard, "the end of the job")
    assert isinstance(heard[0], do.Done)


# -- findings --------------------------------------------------------------------------------------


@pytest.mark.parametrize("kind", Finding.__subclasses__())
def test_a_finding_is_of_the_present_model_or_unknown(kind):
    state = seen(kind)
    assert kind.wanted(state)
    assert kind.known(state) is None
    found = after(state, do.Learned(kind.about(state.model)))
    assert kind.known(found).found
    edited = after(found, EDIT)
    assert kind.known(edited) is None
    assert after(edited, do.Learned(kind.about(state.model))) is edited


@pytest.mark.parametrize("kind", Finding.__subclasses__())
@pytest.mark.parametrize("error", [pg.InputError(Problem("x", "y", "euler")), ValueError("euler")])
def test_a_finding_that_fails_tells_why(kind, error, monkeypatch):
    def fails(model):
        raise error

    monkeypatch.setattr(kind, "find", fails)
    state = seen(kind)
    known = kind.known(after(state, do.Learned(kind.about(state.model))))
    assert "euler" in known.problem
    assert known.found is None


@pytest.mark.parametrize("kind", Finding.__subclasses__())
def test_a_model_is_found_about_again_when_it_comes_back(kind):
    """Undo returns to a model that was asked about before and whose finding came too late."""
    state, heard = seen(kind), []
    finder = Finder(kind, heard.append)
    edited = after(state, EDIT)
    for k, (old, new) in enumerate([(state, state), (state, edited), (edited, state)], 1):
        finder.render(old, new)
        until(lambda k=k: len(heard) == k, "the finding")
    assert [one.finding.model for one in heard] == [state.model, edited.model, state.model]
    known = after(state, heard[-1])
    finder.render(state, known)
    finder.render(known, known)
    hidden = after(known, do.Disconnected(ME), EDIT)
    finder.render(known, hidden)
    assert finder._queue.empty()


EDIT = do.EditBodies(ME, 1, ("coupler",), "mass", (((), "7"),))


def seen(kind):
    return after(begun(built_in("four_bar")), do.Sees(ME, "search", True))
