"""Arguments of `simulate` that cannot be meant: a sentence, never an error of Python's."""

from __future__ import annotations

import pickle

import pytest

import pgraph_core as pg

MECH = pg.Mechanism(pg.Model.serial(2))
LIST = "must be a list of pg.Force; given"
HINGE = "the joint of '1' has 1 degrees of freedom; given"


@pytest.mark.parametrize(
    ("given", "sentence"),
    [
        ({"forces": 5}, f"simulate, forces: {LIST} 5"),
        ({"forces": ("a",)}, f"simulate, forces: {LIST} ('a',)"),
        (
            {"forces": [pg.Force(name="z", body="1", coordinate=1)]},
            f"force 'z', coordinate: {HINGE} 1",
        ),
        (
            {"forces": [pg.Force(name="z", kind="servo", body="1", coordinate=3, kp=1)]},
            f"force 'z', coordinate: {HINGE} 3",
        ),
        (
            {"forces": [pg.Force(name="z", body="nobody")]},
            "force 'z', body: no body is named 'nobody'; choose one of 1, 2",
        ),
        ({"rtol": "a"}, "simulate, rtol: must be a finite number > 0; given 'a'"),
        (
            {"progress": 3},
            "simulate, progress: must be a function of the fraction that is done; given 3",
        ),
    ],
)
def test_an_argument_that_cannot_be_meant_is_a_sentence(given, sentence):
    with pytest.raises(pg.InputError) as refused:
        pg.simulate(MECH, t_end=0.01, **given)
    assert str(refused.value) == sentence


ARM = pg.Body(name="arm", axes=(0, 1, 0), com=(0.25, 0, 0))
FORE = pg.Body(name="fore", parent="arm", axes=(0, 1, 0), com=(0.25, 0, 0), link=(0.5, 0, 0))
DRIVE = pg.Servo(name="drive", body="arm", kp=10.0, kd=1.0)
START = pg.Scenario(name="s", q={"arm": 1.0}, t_end=0.1)
MODEL = pg.Model(bodies=[ARM, FORE], forces=[DRIVE], scenarios=[START])


@pytest.mark.parametrize(
    ("path", "given", "both"),
    [
        ("bodies.arm.q.0", {"q": [0.0, 0.0]}, "q= of the call"),
        ("bodies.arm.q.0", {"q": {"arm": 0.0}}, "q= of the call"),
        ("bodies.fore.v.0", {"v": [0.0, 0.0]}, "v= of the call"),
        ("bodies.arm.q.0", {"scenario": "s"}, "q of 'arm' in scenario 's'"),
        ("scenarios.s.q.arm.0", {"scenario": "s", "q": [0.0, 0.0]}, "q= of the call"),
        ("forces.drive.target", {"inputs": {"drive": 0.5}}, "inputs['drive'] of the call"),
        ("scenarios.s.t_end", {"scenario": "s", "t_end": 0.05}, "t_end=0.05 of the call"),
        ("scenarios.s.t_end", {}, "give scenario='s'"),
    ],
)
def test_a_swept_number_that_something_else_replaces_is_refused(path, given, both):
    with pytest.raises(pg.InputError) as refused:
        pg.sweep(MODEL, {path: [0.1, 0.2]}, "final arm", workers=1, **{"t_end": 0.01, **given})
    assert path in str(refused.value)
    assert both in str(refused.value)


def test_a_swept_number_that_counts_is_swept():
    given = {"q": {"arm": 0.3}, "inputs": {"other": 1.0}}
    given["forces"] = [pg.Servo(name="other", body="fore", kp=1.0)]
    for path in ("bodies.fore.q.0", "forces.drive.target"):
        found = pg.sweep(MODEL, {path: [0.1, 0.2]}, "max v.fore", t_end=0.05, workers=1, **given)
        low, high = found["max v.fore"]
        assert low != high


@pytest.mark.parametrize(
    ("call", "fact"),
    [
        (lambda m: {"bodies.arm.q.0": [0.1, 0.9], "scenario": "s"}, "scenario 's'"),
        (
            lambda m: {"bodies.arm.mass": [1, 2], ("bodies", "arm", "mass"): [3, 4]},
            "is given twice",
        ),
        (lambda m: {"bodies.arm.mass": ["1", "2"]}, "must be finite numbers"),
        (lambda m: {"bodies.arm.mass": [True, False]}, "must be finite numbers"),
    ],
)
def test_values_of_a_batch_that_would_do_nothing_are_refused(call, fact):
    given = call(MODEL)
    scenario = given.pop("scenario", None)
    with pytest.raises(pg.InputError, match=fact):
        pg.BatchStepper(MODEL, 2, set=given, scenario=scenario)


@pytest.mark.parametrize(
    ("values", "metric", "fact"),
    [
        (["1", "2"], "final arm", "must be a list of numbers"),
        ([1, 2], [lambda run: 1.0, lambda run: 2.0], "two are called '<lambda>'"),
    ],
)
def test_text_is_no_number_and_a_name_is_of_one_metric(values, metric, fact):
    with pytest.raises(pg.InputError, match=fact):
        pg.sweep(MODEL, {"bodies.arm.mass": values}, metric, t_end=0.01, workers=1)


def test_a_row_of_names_is_taken_by_name():
    pandas = pytest.importorskip("pandas")
    row = pandas.Series({"fore": 0.3, "arm": 0.7})
    run = pg.simulate(MODEL, q=row, v=row, t_end=0.01, estimate=False)
    assert run.q[0].tolist() == run.v[0].tolist() == [0.7, 0.3]
    pushed = pg.simulate(MODEL, tau=row, t_end=0.01, estimate=False)
    assert (pushed.q == pg.simulate(MODEL, tau=[0.7, 0.3], t_end=0.01, estimate=False).q).all()
    assert pg.simulate(MODEL, q=pandas.Series([0.7, 0.3]), t_end=0.01).q[0].tolist() == [0.7, 0.3]
    with pytest.raises(pg.InputError, match="not by names"):
        MECH.mass_matrix(row)


@pytest.mark.parametrize("names", [("drive",), ("new", "new"), ("own",)])
def test_a_force_of_the_call_has_a_name_of_its_own(names):
    model = MODEL.edit("s", forces=[pg.Motor(name="own", body="arm", torque=1.0)])
    forces = [pg.Servo(name=name, body="fore", kp=1.0) for name in names]
    for call in (pg.simulate, pg.Stepper):
        with pytest.raises(pg.InputError, match="has a force of this name"):
            call(model, scenario="s", forces=forces)


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
            with pytest.raises(pg.InputError, match="a run does not change"):
                kept["method"] = "x"
        assert dict(one.header) == one.header
    assert "_all" not in vars(touched.contacts.gap)  # gaps are found when they are asked for
    for one in (touched, pickle.loads(pickle.dumps(touched))):
        for array in (one.contacts.force["floor"], one.contacts.gap["floor"], one.contacts.wrench):
            assert not array.flags.writeable
    for one in (mech, pickle.loads(pickle.dumps(mech))):
        for array in (one.pgraph, one.jdof, one.parent, one.topology.dof, one.topology.row):
            assert not array.flags.writeable
        with pytest.raises(pg.InputError, match="is not changed in place"):
            one.joints["arm"] = None


def test_inputs_of_a_stepper_are_given_by_calls():
    stepper = pg.Stepper(MODEL)
    with pytest.raises(pg.InputError, match=r"write st\.step"):
        stepper.inputs["drive"] = 2.0
    assert stepper.inputs == {"drive": 0.0}
    with pytest.raises(pg.InputError, match="means nothing without set"):
        pg.BatchStepper(MODEL, 2).reset(numbers=1)


@pytest.mark.parametrize(
    ("options", "fact"),
    [
        ({"atol": 1e-3}, "simulate, atol: rk4 takes a step"),
        ({"max_steps": 5}, "100 steps of 0.001 s"),
    ],
)
def test_options_of_adaptive_methods_are_not_passed_over(options, fact):
    with pytest.raises(pg.InputError, match=fact):
        pg.simulate(MODEL, t_end=0.1, method="rk4", step=1e-3, **options)
    assert pg.simulate(MODEL, t_end=0.1, method="rk4", step=1e-3, max_steps=100).status.ok


def test_a_quaternion_of_another_length_is_told():
    run = pg.simulate(FALLING, q=[0, 0, 1, 5, 0, 0, 0], t_end=0.01, estimate=False)
    assert any("has length 5" in text for text in run.notices)
    assert not pg.simulate(FALLING, q=[0, 0, 1, 1, 0, 0, 0], t_end=0.01, estimate=False).notices


@pytest.mark.parametrize("limits", [(0,), 0, False, (5,)])
def test_one_number_is_no_pair_of_limits(limits):
    with pytest.raises(pg.ModelError, match="limits"):
        pg.Body(name="b", limits=limits)
