"""Runs: the paper's stance, how runs end, drives, and what they record."""

import sys
from pathlib import Path

import numpy as np
import pytest

import pgraph_core as pg
import pgraph_models
from pgraph_core.paper import Operators

from ..worlds import built_in
from .test_constraints import FEET, parallelogram
from .trees import random_case, scaled_error, with_joints

pytestmark = pytest.mark.quick


@pytest.fixture(scope="module")
def quadruped():
    return built_in("quadruped")


@pytest.fixture(scope="module")
def stance(quadruped):
    return pg.simulate(quadruped, scenario="stance")


def test_stance_feet_stand_still(quadruped, stance):
    """Checklist E7 over 0.25 s at 1 ms, by the drift and by the poses themselves."""
    assert stance.status.ok, stance.message
    assert stance.t[-1] == pytest.approx(0.25)
    assert stance.constraint_drift[:, 0].max() < 1e-6  # m
    assert stance.constraint_drift[:, 1].max() < 1e-9  # m/s
    for name in FEET:
        tip = np.array(quadruped.model.body(name).tip_point)
        places = []
        for q, v in zip(stance.q, stance.v):
            position, rotation = quadruped.pose(q, name)
            places.append(position + rotation @ tip)
            assert abs(quadruped.jacobian(q, name, tip)[3:] @ v).max() < 1e-9
        assert np.ptp(places, axis=0).max() < 1e-6


def test_stance_does_not_depend_on_the_step(quadruped, stance):
    half = pg.simulate(quadruped, scenario="stance", step=5e-4, t_eval=stance.t, estimate=False)
    assert scaled_error(half.q, stance.q) < 1e-6
    for name in FEET:
        assert scaled_error(half.constraint_force[name], stance.constraint_force[name]) < 1e-4
    fine = pg.simulate(quadruped, scenario="stance", step=1.25e-4, frames=2, estimate=False)
    true = abs(stance.q[-1] - fine.q[-1]).max()
    assert true / 3 < stance.error_estimate < 3 * true


def test_stance_moves_and_pushes(stance, tmp_path):
    """The spine flexes, the feet only push and bear the weight, the free root bears nothing."""
    assert abs(stance.q[-1] - stance.q[0]).max() > 0.05
    vertical = np.array([stance.constraint_force[name][:, 4] for name in FEET])
    assert vertical.min() > 0
    assert 200 < vertical.sum(axis=0).mean() < 500
    assert abs(stance.joint_force[:, 0]).max() < 1e-6
    stance.save(tmp_path / "run.npz")
    again = pg.Result.load(tmp_path / "run.npz")
    assert (again.status, again.message) == (stance.status, stance.message)
    np.testing.assert_array_equal(again.q, stance.q)
    np.testing.assert_array_equal(again.body_pose, stance.body_pose)
    assert again.energy_drift == stance.energy_drift


@pytest.mark.parametrize("stabilise", ["project", "baumgarte", None])
def test_loops_hold_whatever_stabilises_them(stabilise):
    mech = pg.Mechanism(parallelogram())
    options = {"t_end": 1.0, "method": "rk4", "step": 1e-3, "stabilise": stabilise}
    run = pg.simulate(mech, np.array([0.7, -0.7, 0.7]), np.zeros(3), **options)
    assert run.status.ok
    assert run.constraint_drift[:, 0].max() < (1e-10 if stabilise == "project" else 1e-6)
    assert run.energy_drift < 1e-7
    np.testing.assert_allclose(run.q[:, 0], -run.q[:, 1], atol=1e-6)


@pytest.mark.parametrize("seed", [1, 17])
def test_loops_of_any_joints_keep_their_energy_and_close(seed):
    """The tree starts at rest with one point held. A Python torque of zero changes nothing."""
    s = random_case(seed, most=6, kinds=("revolute", "spherical", "prismatic", "free"))
    point = pg.Constraint(name="held", body=s.topology.names[-1], point=(0.1, 0.2, -0.1))
    mech = pg.Mechanism(with_joints(s, q=s.q).replace(constraints=(point,)))
    options = {"t_end": 0.2, "method": "rk4", "step": 1e-3}
    run = pg.simulate(mech, **options)
    assert run.status.ok
    assert run.energy_drift < 1e-9
    assert run.constraint_drift.max() < 1e-12
    python = pg.simulate(mech, tau=lambda t, q, v: np.zeros(mech.nv), **options)
    np.testing.assert_allclose(python.q, run.q, rtol=0, atol=1e-12)


def test_a_run_reports_its_progress_and_may_be_cancelled():
    mech, seen = pg.Mechanism(pg.Model.serial(3)), []
    pg.simulate(mech, t_end=1.0, method="rk4", step=1e-4, progress=seen.append)
    assert seen == sorted(seen)
    assert seen[-1] == pytest.approx(1.0)
    run = pg.simulate(mech, t_end=300.0, method="rk4", step=1e-4, progress=lambda share: False)
    assert run.status is pg.Status.CANCELLED
    assert len(run.t) > 0
    assert run.t[-1] < 300


@pytest.mark.parametrize("method", ["rk4", "semi_implicit_euler"])
def test_a_python_torque_equals_a_compiled_motor(method):
    plain = pg.Model.serial(2)
    ramp = pg.Table(t=(0.0, 0.5), value=(0.0, 2.0))
    driven = plain.replace(forces=(pg.Force(name="motor", body="2", torque=ramp),))
    options = {"t_end": 0.4, "method": method, "step": 1e-3}
    compiled = pg.simulate(driven, **options)
    python = pg.simulate(plain, tau=lambda t, q, v: np.array([0.0, 4.0 * t]), **options)
    np.testing.assert_allclose(python.q, compiled.q, rtol=0, atol=1e-12)
    np.testing.assert_allclose(python.work, compiled.work, rtol=0, atol=1e-12)


def test_a_servo_holds_its_target_within_its_limit():
    servo = pg.Servo(name="s", body="1", kp=50.0, kd=3.0, target=0.3, torque_limit=5.0)
    mech = pg.Mechanism(pg.Model.serial(1).replace(forces=(servo,), gravity=(0, 0, 0)))
    run = pg.simulate(mech, t_end=3.0, method="rk4", step=1e-3)
    assert run.q[-1, 0] == pytest.approx(0.3, abs=1e-6)
    assert abs(run.vdot[0] - 5.0 / mech.mass_matrix(run.q[0])[0, 0]) < 1e-9


def test_initial_states_may_be_given_by_names():
    """The bits are those of arrays. Bodies that are not named start as in the scenario."""
    model = pg.Model.load(pgraph_models.path("double_pendulum"))
    start = pg.simulate(model, scenario="swing", t_end=0.01)
    named = pg.simulate(model, q={"lower": 0.2}, v={"upper": [1.0]}, scenario="swing", t_end=0.5)
    q = [start.q[0, 0], 0.2]
    given = pg.simulate(model, q=q, v=[1.0, start.v[0, 1]], scenario="swing", t_end=0.5)
    assert np.array_equal(named.q, given.q)
    stepper = pg.Stepper(model, scenario="swing", q={"lower": 0.2})
    assert np.array_equal(stepper.q, q)
    stepper.reset(q={"upper": 0.7})
    assert np.array_equal(stepper.q, [0.7, start.q[0, 1]])

    wrong = [
        ({"uper": 1.0}, "'uper'"), ({"upper": [1.0, 2.0]}, "'upper'"), ({"upper": "up"}, "'up'"),
        ({"upper": np.nan}, "finite"),
    ]  # fmt: skip
    for q, fact in wrong:
        with pytest.raises(pg.InputError, match=fact):
            pg.simulate(model, q=q)


def test_frames_and_t_eval_do_not_change_the_steps():
    mech = pg.Mechanism(pg.Model.serial(2))
    options = {"t_end": 0.4, "method": "rk4", "step": 1e-3}
    full = pg.simulate(mech, **options)
    few = pg.simulate(mech, frames=5, **options)
    grid = pg.simulate(mech, t_eval=[0.0, 0.1, 0.3], **options)
    assert len(full.t) == 401
    np.testing.assert_allclose(few.t, [0, 0.1, 0.2, 0.3, 0.4])
    np.testing.assert_allclose(few.q, full.q[::100], rtol=0, atol=1e-12)
    np.testing.assert_allclose(grid.q, full.q[[0, 100, 300]], rtol=0, atol=1e-12)
    assert full.counters["steps"] == 400
    assert full.counters["evaluations"] >= 1600


def test_bodies_motion_and_joint_forces_equal_the_operators():
    s = random_case(11, most=9)
    mech = pg.Mechanism(s.model)
    run = pg.simulate(mech, s.q, s.v, tau=s.tau, t_end=0.02, method="rk4", step=1e-3, frames=3)
    for i in range(len(run.t)):
        op = Operators(s.model, s.topology, run.q[i], run.v[i])
        assert scaled_error(run.vdot[i], op.forward_dynamics(s.tau)) < 1e-10
        vdot = run.vdot[i]
        assert scaled_error(run.body_pose[i, :, :3], op.position) < 1e-12
        assert scaled_error(run.body_velocity[i].reshape(-1), op.V) < 1e-12
        assert scaled_error(run.body_acceleration[i].reshape(-1), op.acceleration(vdot)) < 1e-12
        assert scaled_error(run.joint_force[i].reshape(-1), op.joint_force(vdot)) < 1e-12
        assert run.energy[i] == pytest.approx(op.kinetic_energy + op.potential_energy, rel=1e-12)


def test_csv_names_every_column_with_its_unit():
    bodies = (
        pg.Body(name="trunk", dof=6, inertia=(0.01,) * 3),
        pg.Body(name="slide", joint="prismatic"),
    )
    run = pg.simulate(pg.Model(bodies=bodies), t_end=0.01, step=1e-3)
    header, *rows = run.to_csv().splitlines()
    names = header.split(",")
    assert names[:2] == ["t [s]", "trunk.0 [m]"]
    assert {"trunk.3 [1]", "slide [m]", "v.trunk.0 [rad/s]", "energy [J]"} <= set(names)
    assert {"v.trunk.3 [m/s]", "vdot.slide [m/s^2]"} <= set(names)
    assert len(names) == 6 + 8 + 7 + 7
    assert len(rows) == len(run.t)
    assert float(rows[-1].split(",")[names.index("slide [m]")]) == run.q[-1, 7]


@pytest.mark.parametrize("given", ["q", "v", "tau"])
def test_a_list_is_refused_where_numbers_and_rows_differ_in_order(given):
    """Rows a, b, c where c carries b: numbers count a, c, b."""
    bodies = [pg.Body(name=name, com=(1, 0, 0)) for name in "ab"]
    above = bodies[1].model_copy(update={"parent": "c"})
    model = pg.Model(bodies=[bodies[0], above, pg.Body(name="c", com=(1, 0, 0))])
    with pytest.raises(pg.InputError, match="a, c, b"):
        pg.simulate(model, t_end=0.01, **{given: [0.1, 0.2, 0.3]})
    by_name = pg.simulate(model, t_end=0.01, **{given: {"a": 0.1, "b": 0.2, "c": 0.3}})
    array = pg.simulate(model, t_end=0.01, **{given: np.array([0.1, 0.3, 0.2])})
    assert np.array_equal(by_name.q, array.q)
    serial = pg.Model(bodies=bodies)
    assert pg.simulate(serial, t_end=0.01, **{given: [0.1, 0.2]}).status.ok


def test_a_warm_call_passes_few_functions_and_files():
    """Each step from one function to the next is one that a reader follows. Kernels are apart."""
    core = Path(pg.__file__).parent
    mech = pg.Mechanism(pg.load("double_pendulum"))
    passed = set()

    def seen(frame, event, _):
        code = frame.f_code
        if event == "call" and Path(code.co_filename).is_relative_to(core):
            passed.add((Path(code.co_filename).relative_to(core), code.co_qualname))

    pg.simulate(mech, t_end=0.1)
    before = sys.getprofile()
    sys.setprofile(seen)
    try:
        pg.simulate(mech, t_end=0.1)
    finally:
        sys.setprofile(before)
    own = {(file, name) for file, name in passed if file.parts[0] != "engine"}
    assert len(own) <= 50  # lower these bounds when a call passes fewer
    assert len({file for file, _ in own}) <= 19


def test_a_list_of_forces_whose_entries_change_gives_the_run_of_each():
    """A part that is freed leaves its identity to a new one."""
    mech, forces, found = pg.Mechanism(pg.Model.serial(1)), [None], set()
    for k in range(60):
        forces[0] = None
        forces[0] = pg.Motor(name="m", body="1", torque=float(k), lag=0.05)
        run = pg.simulate(mech, t_end=0.01, step=1e-3, method="rk4", forces=forces, estimate=False)
        found.add(float(run.v[-1, 0]))
    assert len(found) == 60
