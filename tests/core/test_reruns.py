"""Reruns give the same bits: in another process, with another hash seed, on other threads."""

import dataclasses
import hashlib
import json
import os
import pickle
import subprocess
import sys
from concurrent.futures import ThreadPoolExecutor

import numpy as np
import pytest

import pgraph_core as pg
import pgraph_models
from pgraph_core.simulation.loop import Steps

from ..nights import combined
from .trees import random_case

SEEDS = (0, 1, 2, 5, 6, 8)  # the others lack inertia at home


def digest(*arrays):
    return hashlib.sha256(b"".join(np.ascontiguousarray(a).tobytes() for a in arrays)).hexdigest()


def answers():
    found = {}
    for seed in SEEDS:
        s = random_case(seed)
        mech = pg.Mechanism(s.model)
        vdot = mech.forward_dynamics(s.q, s.v, s.tau, s.external)
        motion, M = mech.body_motion(s.q, s.v, s.vdot), mech.mass_matrix(s.q)
        run = pg.simulate(mech, s.q, 0.1 * s.v, t_end=0.05, method=("rk4", "auto")[seed % 2])
        found[f"run {seed}"] = digest(M, vdot, *motion, run.t, run.q, run.v, run.vdot, run.energy)
        for threads in (1, 2):
            many = pg.BatchStepper(mech, 40, threads=threads)
            many.reset(np.tile(s.q, (40, 1)), 0.1 * np.linspace(0, 1, 40)[:, None] * s.v)
            many.step(n=20)
            found[f"batch {seed}, {threads}"] = digest(many.q, many.v)
    run = pg.simulate(pg.Model.load(pgraph_models.path("quadruped")), scenario="stance", t_end=0.05)
    return found | {"stance": digest(run.q, run.v, *run.constraint_force.values())}


def test_another_process_gives_the_same_bits():
    """The process has another hash seed, and batches run on one thread and two."""
    code = "import json; from tests.core.test_reruns import answers; print(json.dumps(answers()))"
    command, env = [sys.executable, "-c", code], {**os.environ, "PYTHONHASHSEED": "1"}
    done = subprocess.run(command, check=True, capture_output=True, text=True, env=env)
    here = answers()
    assert json.loads(done.stdout) == here
    assert all(here[f"batch {seed}, 1"] == here[f"batch {seed}, 2"] for seed in SEEDS)


SHORT = {"t_end": 0.02, "frames": 4}
WAYS = [
    *({"method": m, "step": 1e-3} for m in ("rk4", "semi_implicit_euler", "gauss6")),
    {"method": "dop853", "rtol": 1e-9},
    {"method": "radau5", "rtol": 1e-7},
    {"method": "radau5", "step": 1e-3},
]


@pytest.mark.parametrize("way", WAYS, ids=lambda way: "-".join(map(str, way.values())))
def test_a_run_after_others_has_the_bits_of_the_first(way):
    """Scene and loop are used again: torques, failures and other states leave nothing behind."""
    model, rng = pg.Model.serial(3), np.random.default_rng(1)
    tau, q, v = rng.normal(size=(3, 3))
    used = pg.Mechanism(model)
    old = pg.simulate(used, v, q, **SHORT, **way)
    kept = old.q.copy(), old.v.copy()
    for state in ((q, v), (None, v), (q, None), (None, None)):
        pg.simulate(used, v, q, tau=10 * tau, **SHORT, **way)
        pg.simulate(used, q, 1e200 * v, **SHORT, **way)
        for given in (None, tau, lambda t, q, v: 0 * v):
            found = pg.simulate(used, *state, tau=given, **SHORT, **way)
            first = pg.simulate(pg.Mechanism(model), *state, tau=given, **SHORT, **way)
            for name in ("t", "q", "v", "vdot", "kinetic_energy", "work", "constraint_drift"):
                assert np.array_equal(getattr(found, name), getattr(first, name)), name
            assert np.array_equal(found.error_estimate, first.error_estimate, equal_nan=True)
            assert found.counters == first.counters
    assert all(map(np.array_equal, kept, (old.q, old.v)))


@pytest.mark.parametrize(("name", "way"), combined(["four_bar", "skate"], WAYS[-3:]), ids=str)
def test_a_run_with_loops_after_others_has_the_bits_of_the_first(name, way):
    """Memories of constraint solvers and singular positions are cleared."""
    model = pg.Model.load(pgraph_models.path(name))
    used, scenario = pg.Mechanism(model), next((s.name for s in model.scenarios), None)
    options = {"scenario": scenario, "t_end": 0.8, "frames": 5, **way}
    first = pg.simulate(pg.Mechanism(model), **options)
    for share in (1.0, 0.5):
        pg.simulate(used, first.q[0], -share * first.v[0], **options)
        found = pg.simulate(used, **options)
        for at in ("q", "v", "vdot", "constraint_drift"):
            assert np.array_equal(getattr(found, at), getattr(first, at)), at
        for at in first.constraint_force:
            assert np.array_equal(found.constraint_force[at], first.constraint_force[at])
        assert (found.notices, found.counters) == (first.notices, first.counters)
        assert found.error_estimate == first.error_estimate


@pytest.mark.parametrize("options", [{}, {"switches": [(0.75, "loop", False)]}], ids=["", "cut"])
def test_notices_that_are_read_late_are_those_of_the_run(options):
    """Singular positions are looked for when someone reads of them, after other runs, or pickles.

    The arrays of a run are those of the next one by then. The loop is opened after it was flat.
    """
    model = pg.Model.load(pgraph_models.path("four_bar"))
    given = {"scenario": "turn", "t_end": 0.8, "frames": 5, **options}
    first = pg.simulate(pg.Mechanism(model), **given).notices
    assert sum("passed a singular position" in text for text in first) == 1
    used = pg.Mechanism(model)
    late, sent, beside = (pg.simulate(used, **given) for _ in range(3))
    pg.simulate(used, used.home()[0], [0.3, -0.3, 0.3], **{**given, "scenario": None})
    assert late.notices == first
    assert pickle.loads(pickle.dumps(sent)).notices == first
    assert dataclasses.replace(beside, message="another").notices == first
    assert (late == sent, late.notices) == (True, first)


def test_threads_that_share_a_mechanism_do_not_share_workspaces():
    mech, rng = pg.Mechanism(pg.Model.serial(3)), np.random.default_rng(2)
    starts = rng.normal(size=(60, 3))

    def last(q):
        return pg.simulate(mech, q, method="rk4", step=1e-3, **SHORT).q[-1]

    alone = [last(q) for q in starts]
    with ThreadPoolExecutor(8) as pool:
        together = list(pool.map(last, starts))
    assert np.array_equal(alone, together)


@pytest.mark.parametrize("way", WAYS, ids=lambda way: "-".join(map(str, way.values())))
def test_a_repeated_run_makes_no_loop(way, monkeypatch):
    """Neither for itself nor for the finer run that tells its error."""
    mech, (q, v) = pg.Mechanism(pg.Model.serial(3)), np.random.default_rng(1).normal(size=(2, 3))
    first = pg.simulate(mech, q, v, **SHORT, **way)
    made = []
    monkeypatch.setattr(Steps, "__init__", lambda *_, **__: made.append(1))
    again = pg.simulate(mech, q, v, **SHORT, **way)
    assert not made
    assert np.array_equal(again.error_at, first.error_at)
    assert first.error_at[-1] > 0.0
