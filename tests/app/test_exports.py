"""A run as a file: the numbers in it are the run's, and the animation needs nothing else."""

from __future__ import annotations

import csv
import io
import re

import numpy as np
import pytest

import pgraph_core as pg
from app import events
from app.state import Request, Run, initial
from app.update import update
from app.views import exports


@pytest.fixture(scope="module")
def run() -> Run:
    model = pg.Model.serial(3)
    return Run(model, Request(), pg.simulate(pg.Mechanism(model), t_end=0.2))


def test_the_table_holds_the_run_s_numbers(run):
    head, *rows = csv.reader(io.StringIO(exports.table(run).decode()))
    numbers = np.array(rows, dtype=float)
    assert numbers[:, head.index("t [s]")].tolist() == run.result.t.tolist()
    assert numbers[:, head.index("q 2 0 [rad]")].tolist() == run.result.q[:, 1].tolist()


def test_the_arrays_are_read_back_as_the_run(run, tmp_path):
    file = tmp_path / "run.npz"
    file.write_bytes(exports.arrays(run))
    again = pg.Result.load(file)
    np.testing.assert_array_equal(again.q, run.result.q)
    assert again.mechanism.model == run.model


def test_the_animation_is_one_page_that_asks_for_nothing_else(run):
    page = exports.animation(run).decode()
    assert page.lstrip().lower().startswith("<!doctype html")
    assert not re.search(r'<(script|link|img)[^>]+(src|href)="https?://', page)


def test_only_a_finished_run_is_exported(run):
    state = update(initial(run.model), events.Connected(1))
    assert update(state, events.Export(1, "csv")) is state
    state = update(update(state, events.Simulate(1)), events.Simulated(1, run.result))
    assert update(state, events.Export(1, "csv")).exporting.what == "csv"
