"""Arguments of runs and sweeps, and results that do not change in place."""

import pickle
import time

import numpy as np
import pytest

import pgraph_core as pg
from pgraph_core.engine.compiler.clock import LOADING, clocks

MECH = pg.Mechanism(pg.Model.serial(2))
ARM = pg.Body(name="arm", axes=(0, 1, 0), com=(0.25, 0, 0))
FORE = pg.Body(name="fore", parent="arm", axes=(0, 1, 0), com=(0.25, 0, 0), link=(0.5, 0, 0))
DRIVE = pg.Servo(name="drive", body="arm", kp=10.0, kd=1.0)
START = pg.Scenario(name="s", q={"arm": 1.0}, t_end=0.1)
MODEL = pg.Model(bodies=[ARM, FORE], forces=[DRIVE], scenarios=[START])


def test_forces_and_states_of_the_call_leave_other_numbers_to_sweep():
    given = {"q": {"arm": 0.3}, "inputs": {"other": 1.0}}
    given["forces"] = [pg.Servo(name="other", body="fore", kp=1.0)]
    for path in ("bodies.fore.q.0", "forces.drive.target"):
        found = pg.sweep(MODEL, {path: [0.1, 0.2]}, "max v.fore", t_end=0.05, workers=1, **given)
        low, high = found["max v.fore"]
        assert low != high


def test_a_row_of_pandas_is_taken_by_its_names():
    pandas = pytest.importorskip("pandas")
    row = pandas.Series({"fore": 0.3, "arm": 0.7})
    run = pg.simulate(MODEL, q=row, v=row, t_end=0.01, estimate=False)
    assert run.q[0].tolist() == run.v[0].tolist() == [0.7, 0.3]
    pushed = pg.simulate(MODEL, tau=row, t_end=0.01, estimate=False)
    assert (pushed.q == pg.simulate(MODEL, tau=[0.7, 0.3], t_end=0.01, estimate=False).q).all()
    assert pg.simulate(MODEL, q=pandas.Series([0.7, 0.3]), t_end=0.01).q[0].tolist() == [0.7, 0.3]
    with pytest.raises(pg.InputError, match=r"'fore'.*1, 2"):
        MECH.mass_matrix(row)


LOOPED = MODEL.close_loop("fore", "ground")
BALL = pg.Body(name="ball", joint="free", link=(0, 0, 1), shape={"kind": "sphere", "radius": 0.1})
FALLING = pg.Model(bodies=[BALL], contacts=[pg.Contact(name="floor", body="ball")])


def test_a_run_and_a_mechanism_do_not_change_in_place():
    mech = pg.Mechanism(LOOPED)
    run = pg.simulate(mech, t_end=0.02, estimate=False)
    touched = pg.simulate(FALLING, t_end=0.6, estimate=False)
    for one in (run, pickle.loads(pickle.dumps(run))):
        (force,) = one.constraint_force.values()
        for array in (one.q, one.t, one.work, force, one.mechanism.topology.parent):
            with pytest.raises(ValueError, match="read-only"):
                array[:] = 0
        for kept in (one.header, one.counters, one.timing):
            with pytest.raises(pg.InputError, match="method"):
                kept["method"] = "x"
        assert dict(one.header) == one.header
    assert "_all" not in vars(touched.contacts.gap)  # gaps are found when they are asked for
    for one in (touched, pickle.loads(pickle.dumps(touched))):
        for array in (one.contacts.force["floor"], one.contacts.gap["floor"], one.contacts.wrench):
            assert not array.flags.writeable
    for one in (mech, pickle.loads(pickle.dumps(mech))):
        for array in (one.pgraph, one.jdof, one.parent, one.topology.dof, one.topology.row):
            assert not array.flags.writeable
        with pytest.raises(pg.InputError, match="arm"):
            one.joints["arm"] = None


def test_a_run_is_saved_as_its_suffix_says(tmp_path):
    run = pg.simulate(MODEL, t_end=0.1, frames=3)
    run.save(tmp_path / "run.csv")
    assert (tmp_path / "run.csv").read_text() == run.to_csv()
    for name, write in (("run.foo", run.save), ("run.gif", run.to_html)):
        with pytest.raises(pg.FileError, match=name):
            write(tmp_path / name)


def test_as_many_steps_as_allowed_are_taken():
    assert pg.simulate(MODEL, t_end=0.1, method="rk4", step=1e-3, max_steps=100).status.ok
    assert pg.Stepper(MODEL).inputs == {"drive": 0.0}


def test_a_compiled_torque_that_does_not_fit_ends_the_run():
    numba = pytest.importorskip("numba")
    wrong = numba.njit(lambda t, q, v: np.zeros(3))
    raises = numba.njit(lambda t, q, v: q / int(t * 0))
    assert "3" in pg.simulate(MODEL, t_end=0.1, tau=wrong).message
    assert "raised" in pg.simulate(MODEL, t_end=0.1, tau=raises).message


def test_a_quaternion_of_another_length_is_noticed():
    run = pg.simulate(FALLING, q=[0, 0, 1, 5, 0, 0, 0], t_end=0.01, estimate=False)
    assert any("length 5" in text for text in run.notices)
    ordinary = pg.simulate(FALLING, q=[0, 0, 1, 1, 0, 0, 0], t_end=0.01, estimate=False)
    assert not any("length" in text for text in ordinary.notices)


def test_loading_kernels_is_no_part_of_the_time_of_a_run():
    """It happens once in a program, and would be most of a short run."""
    with LOADING:
        began, loaded = clocks()[0], LOADING.seconds
        with LOADING:
            time.sleep(0.01)
    assert LOADING.seconds - loaded >= 0.01
    assert clocks()[0] - began < LOADING.seconds - loaded
    run = pg.simulate(pg.Model.serial(2), t_end=0.01)
    assert {"build", "step", "estimate", "load"} <= set(run.timing)
    assert pg.simulate(run.mechanism, t_end=0.01).timing["load"] == 0.0


@pytest.mark.parametrize("height", [0.1, 0.05])  # above the ground, and on it at the start
def test_a_place_given_twice_is_named_wherever_the_run_begins(height):
    ball = pg.Body(
        name="b", joint="free", mass=1.0, inertia=(0.1, 0.1, 0.1), link=(0, 0, height),
        shape=pg.Shape(kind="sphere", radius=0.1),
    )  # fmt: skip
    model = pg.Model(bodies=[ball], contacts=[pg.Contact(name="c", body="b")])
    run = pg.simulate(model, q={"b": [0, 0, height]}, t_end=0.01, estimate=False)
    assert "'b': the place" in run.notices[0]
