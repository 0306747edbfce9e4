"""All ways to run a model with controls have the same bits, files and figures too."""

import subprocess
import sys

import numpy as np
import pytest

import pgraph_core as pg
from tests.controlled import EVERY, WHOLE, pendulum


@pytest.mark.parametrize("method", ["rk4", "semi_implicit_euler", "gauss6"])
def test_runs_steppers_batches_and_sweeps_have_the_same_bits(method):
    model = pendulum(EVERY, WHOLE)
    call = {"step": 1e-2, "method": method}
    run = pg.simulate(model, t_end=1.0, q=[0.4], frames=101, **call)
    assert run.status.ok
    stepper = pg.Stepper(pg.Mechanism(model), q=[0.4], **call)
    stepper.step(n=40)
    kept = stepper.save()
    stepper.step(n=7)
    stepper.restore(kept)
    stepper.step(n=60)
    assert np.array_equal(stepper.q, run.q[-1])
    assert np.array_equal(stepper.states, run.states[-1])
    assert stepper.controls == {name: x[-1] for name, x in run.controls.items()}
    stepper.reset(q=[0.4])
    assert np.array_equal(stepper.record_over(1.0, frames=101).states, run.states)
    batch = pg.BatchStepper(pg.Mechanism(model), 3, set={"k": [1.0, 5.0, 7.0]}, **call)
    batch.reset(q=[[0.4]] * 3)
    batch.step(n=100)
    assert np.array_equal(batch.q[1], run.q[-1])
    assert np.array_equal(batch.v[1], run.v[-1])
    metric = {"last": lambda run: float(run.q[-1, 0]), "x": lambda run: float(run.states[-1, 0])}
    swept = pg.sweep(model, {"k": [1.0, 5.0, 7.0]}, metric, t_end=1.0, q=[0.4], **call)
    assert np.array_equal(np.asarray(swept["last"]), batch.q[:, 0])
    assert np.asarray(swept["x"])[1] == run.states[-1, 0]


def test_the_command_line_has_the_same_bits(tmp_path):
    model = pendulum(EVERY, WHOLE)
    model.save(tmp_path / "m.json")
    call = [sys.executable, "-m", "pgraph_app", "run", "m.json", "--t-end", "1", "--step", "0.01"]
    subprocess.run([*call, "--method", "rk4", "--out", "m.npz"], cwd=tmp_path, check=True)
    found = pg.Result.load(tmp_path / "m.npz")
    run = pg.simulate(model, t_end=1.0, step=0.01, method="rk4")
    assert np.array_equal(found.q, run.q[-len(found.q) :])
    assert np.array_equal(found.states, run.states)


def test_runs_with_controls_round_trip_through_files(tmp_path):
    run = pg.simulate(pendulum(EVERY, WHOLE), t_end=0.5, step=0.01, method="rk4")
    run.save(tmp_path / "r.npz")
    again = pg.Result.load(tmp_path / "r.npz")
    assert again == run
    assert all(np.array_equal(again.controls[name], run.controls[name]) for name in run.controls)
    assert '"schema_version": 7' in run.mechanism.model.to_json()


@pytest.mark.parametrize("method", ["rk4", "semi_implicit_euler"])
def test_a_figure_begins_and_steps_as_a_run(method):
    """The memory that a figure takes over, stepped by the kernels that the module has too."""
    from pgraph_core.live.run import LiveRun, Setup

    model = pendulum(EVERY, WHOLE).edit("arm", q=[0.4])
    live = LiveRun(pg.Mechanism(model), Setup(step=1e-2), method)
    steps = live.record.steps
    while steps.taken < 100:  # a step ends where a comparison changes, and goes on
        steps.advance(1)
    run = pg.simulate(model, t_end=1.0, step=1e-2, method=method, frames=101)
    assert np.array_equal(steps.q[:1], run.q[-1])
    assert np.array_equal(steps.v, np.append(run.v[-1], run.states[-1]))


def test_a_figure_of_a_model_with_controls_leaves_fields_open():
    from pgraph_core.live.opened import follows, opened
    from pgraph_core.live.run import LiveRun, Setup

    def make(mech, method):
        return LiveRun(mech, Setup(step=1e-2), method)

    model = pendulum(EVERY, WHOLE).edit("arm", v=[0.5])
    runs = {method: make(pg.Mechanism(model), method) for method in ("rk4", "dopri5")}
    for path in ("controls.pid.kp=1:9", "controls.i.start=0:1", "k", "bodies.arm.mass=1:3"):
        ((field, of),) = follows(model, runs, [opened(model, path)], make)
        if "bodies" in path:
            assert field.number > 2  # some values, each with its numbers
        else:
            assert field.number == 0  # any value, by a rule
            assert all(of[method].copies for method in runs)


def test_models_without_controls_have_none():
    run = pg.simulate(pendulum(torque="=-3*q.arm"), t_end=0.1)
    assert run.states.shape == (len(run.t), 0)
    assert run.controls == {}
