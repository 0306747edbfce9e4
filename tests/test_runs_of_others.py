"""Runs, batches, sweeps, fits and regulators as users of other programs call them."""

import itertools

import numpy as np
import pytest

import pgraph_core as pg

from .test_parts_of_others import ARM, LOOSE, TWO
from .test_states import arm

pytestmark = pytest.mark.quick


def test_a_run_gives_each_of_its_columns_by_name():
    ball = pg.Body(name="ball", joint="free", inertia=(0.01,) * 3)
    arm = pg.Body(name="arm", joint="revolute", axes=((0, 1, 0),), com=(1, 0, 0))
    floor = pg.Contact(name="floor", body="ball", points=((0, 0, 0),))
    run = pg.simulate(pg.Model(bodies=[ball, arm], contacts=[floor]), t_end=0.1)
    for name, column in run.columns().items():
        np.testing.assert_array_equal(run[name], getattr(column, "values", column))


def test_a_run_goes_to_matlab_with_its_names_and_units(tmp_path):
    from scipy.io import loadmat

    names = ("a", "1", "a.0", "é", "a_0", "names")
    bodies = [pg.Body(name=x, joint="free", inertia=(0.01,) * 3) for x in names]
    run = pg.simulate(pg.Model(bodies=bodies), t_end=0.1)
    run.save(tmp_path / "run.mat")
    read = loadmat(tmp_path / "run.mat", simplify_cells=True)
    numbers = {name: x for name, x in run.columns().items() if getattr(x, "unit", "1")}
    names = [str(name) for name in read["names"]]
    assert set(names) <= set(numbers)
    words = [word for word in read if not word.startswith("__") and word not in ("names", "units")]
    assert len(words) == len(names) == len(read["units"])
    for name, word in zip(names, words):
        np.testing.assert_array_equal(read[word], run[name])


def test_a_run_goes_to_xarray_with_its_units():
    pytest.importorskip("xarray")
    run = pg.simulate(arm().model, t_end=0.1)
    table = run.to_xarray()
    np.testing.assert_array_equal(table["j2"], run["j2"])
    assert (table["j2"].units, table["t"].units) == ("rad", "s")


def test_weights_of_a_regulator_may_be_named():
    cart = pg.Body(name="cart", joint="prismatic", axes=(1, 0, 0), mass=2.0)
    model = pg.Model(bodies=[cart], forces=[pg.Motor(name="push", body="cart")])
    named, by_position = pg.lqr(model, Q=3.0, R=0.5), pg.lqr(model, 3.0, 0.5)
    assert np.array_equal(named.K, by_position.K)


SWING = {"t_end": 0.3, "q0": [0.4, 0.0]}


@pytest.mark.parametrize(
    "tau",
    [
        {"arm": lambda t, q, v: np.sin(t) - v[0], "hand": 0.5},
        {"arm": lambda t, x: [np.sin(t) - x[2]], "hand": 0.5},
        [lambda t, q, v: np.sin(t) - v[0], 0.5],
    ],
)
def test_functions_and_numbers_may_be_mixed_in_torques(tau):
    one = pg.simulate(TWO, tau=lambda t, q, v: [np.sin(t) - v[0], 0.5], **SWING)
    np.testing.assert_array_equal(pg.simulate(TWO, control=tau, **SWING).q, one.q)


def test_a_function_of_one_joint_may_return_a_number():
    runs = [pg.simulate(pg.Model([ARM]), t_end=0.1, tau=f)
            for f in (lambda t, q, v: 2.0 * t, lambda t, q, v: [2.0 * t])]  # fmt: skip
    np.testing.assert_array_equal(runs[0].q, runs[1].q)


def test_a_drive_in_the_place_of_torques_drives():
    servo = pg.Servo("s", "arm", kp=20.0, kd=2.0, target=1.0)
    one = pg.simulate(TWO.add(servo), **SWING)
    for tau in (servo, [servo]):
        np.testing.assert_array_equal(pg.simulate(TWO, control=tau, **SWING).q, one.q)


def test_the_place_of_a_free_joint_leaves_its_rotation():
    turned = LOOSE.model_copy(update={"q": (0, 0, 2, 0, 1, 0, 0)})
    run = pg.simulate(pg.Model([turned], gravity=0), t_end=0.1, q0={"ball": (1, 2, 3)})
    np.testing.assert_array_equal(run.q[0], (1, 2, 3, 0, 1, 0, 0))


def test_a_duration_from_zero_is_the_end():
    runs = [pg.simulate(TWO, **{name: 0.1}) for name in ("duration", "t_end")]
    np.testing.assert_array_equal(runs[0].q, runs[1].q)


@pytest.mark.parametrize("name", ["simulate_batch", "rollout", "batch", "simulate_many"])
def test_a_run_for_each_row_of_initial_states(name):
    q0, v0 = np.random.default_rng(0).normal(size=(2, 3, 2))
    many = getattr(pg, name)(TWO, q0=q0, v0=v0, t_end=0.1, dt=0.01)
    for run, q, v in zip(many, q0, v0, strict=True):
        one = pg.simulate(TWO, q, v, t_end=0.1, step=0.01)
        np.testing.assert_array_equal(run.q, one.q)
    assert [run.v[0, 0] for run in pg.simulate_batch(TWO, None, v0, t_end=0.1)] == [*v0[:, 0]]
    alike = pg.simulate_batch(TWO, q0, v0[0], t_end=0.1)
    assert [(*run.q[0], *run.v[0]) for run in alike] == [(*q, *v0[0]) for q in q0]


def test_the_position_of_a_point_is_that_of_its_body_turned():
    top = pg.Body("top", joint="spherical", com=(0, 0, 0.1), inertia=(0.1, 0.2, 0.15))
    run = pg.simulate(pg.Model([top]), t_end=0.3, v=[1, 2, 3])
    point = np.array((0.1, -0.2, 0.3))
    for q, found in zip(run.q, run.position("top", point=point)):
        place, turn = run.mechanism.pose(q, "top")
        np.testing.assert_allclose(found, place + turn @ point, atol=1e-14)
    with pytest.raises(pg.InputError, match=r"run\.joint_torque, point.*run\.velocity"):
        run.joint_torque("top", point=point)


def test_the_velocity_and_acceleration_of_a_point_are_rates_of_its_position():
    bodies = [
        pg.Body("base", joint="free", com=(0.1, 0, 0), inertia=(0.2, 0.1, 0.15)),
        pg.Body("arm", parent="base", link=(0.2, 0, 0), axes=(0, 1, 0), com=(0, 0, 0.3)),
    ]
    run = pg.simulate(
        pg.Model(bodies), v={"base": (1, 2, 3, 0.5, 0, 0), "arm": 4.0}, t_end=0.1, frames=2001,
        rtol=1e-11,
    )  # fmt: skip
    for name, point in itertools.product(("base", "arm"), ((0.1, -0.2, 0.3), (0, 0, 0))):
        place, speed = (getattr(run, x)(name, point) for x in ("position", "velocity"))
        felt = run.acceleration(name, point=point)
        for rate, of in ((speed, place), (felt, speed)):  # central differences of 0.1 ms
            slope = (of[2:] - of[:-2]) / (run.t[2:] - run.t[:-2])[:, None]
            np.testing.assert_allclose(rate[1:-1], slope, atol=1e-5)
        if not any(point):
            np.testing.assert_allclose(felt, run.acceleration[name], atol=1e-14)


def test_a_regulator_of_a_model_without_drives_acts_on_all_joints_and_is_its_gains():
    motors = [pg.Motor(f"{name} motor", body=name) for name in ("arm", "hand")]
    K = pg.lqr(TWO, 1.0, 0.1)
    same = pg.lqr(TWO.add(motors[0]).add(motors[1]), 1.0, 0.1)
    np.testing.assert_array_equal(K.K, same.K)
    np.testing.assert_array_equal(np.asarray(K), K.K)
    run = pg.simulate(TWO, t_end=0.3, q0=[0.1, 0], tau=lambda t, x: -K @ x, rtol=1e-10)
    np.testing.assert_allclose(run.q, pg.simulate(K.model, t_end=0.3, q0=[0.1, 0]).q, atol=1e-7)


def test_a_sweep_is_an_array_of_its_values():
    paths = {"bodies.arm.mass": [1.0, 2.0, 3.0]}
    one = pg.sweep(TWO, paths, "final arm", t_end=0.1, q0=[0.1, 0], workers=1)
    np.testing.assert_array_equal(np.asarray(one), one["final arm"])
    np.testing.assert_array_equal(np.asarray(one.values), one["final arm"])
    two = pg.sweep(TWO, paths, ["final arm", "max hand"], t_end=0.1, q0=[0.1, 0], workers=1)
    np.testing.assert_array_equal(np.asarray(two)[:, 1], two["max hand"])


def test_times_of_measured_data_may_be_an_argument():
    run = pg.simulate(TWO, t_end=0.5, q0=[0.4, 0], frames=50)
    free, options = {"bodies.arm.mass": (1.0, 4.0)}, {"q0": [0.4, 0]}
    found = pg.fit(TWO, {"arm": run["arm"]}, free, t=run.t, **options)
    assert found.values == pg.fit(TWO, {"t": run.t, "arm": run["arm"]}, free, **options).values
    found = pg.identify(TWO, parameters=free, data={"arm": run["arm"]}, times=run.t, **options)
    assert found.values["bodies.arm.mass"] == pytest.approx(2.0, rel=1e-6)


def test_forces_of_a_run_are_called_by_name_as_they_are_indexed():
    ball = pg.Body(name="ball", joint="free", shape={"kind": "sphere", "radius": 0.1})
    model = pg.Model(bodies=[ball], contacts=[pg.Contact(name="floor", body="ball")])
    run = pg.simulate(model, t_end=0.01)
    for given in (("floor",), ("ball", "ground")):
        key = given if len(given) > 1 else given[0]
        np.testing.assert_array_equal(run.contact_force(*given), run.contact_force[key])
    np.testing.assert_array_equal(run.position("ball"), run.position["ball"])
    with pytest.raises(pg.InputError, match=r"'roof'.*floor"):
        run.contact_force("roof")


def test_drives_go_by_their_joints_also_where_the_model_has_none():
    cart = pg.Body(name="cart", joint="prismatic", axes=(1, 0, 0), mass=1)
    pole = pg.Body(name="pole", parent="cart", axes=(0, 1, 0), mass=0.2, com=(0, 0, 0.5))
    bare = pg.Model(bodies=[cart, pole])
    driven = bare.add(pg.Motor(name="drive", body="cart"))
    found = [
        pg.lqr(model, np.eye(4), 0.1, inputs=inputs)
        for model, inputs in ((bare, "cart"), (bare, ["cart"]), (driven, ["cart"]), (driven, None))
    ]
    assert all(np.allclose(each.K, found[-1].K, rtol=1e-9) for each in found)
    assert all(len(each.model.forces) == 1 for each in found)
    with pytest.raises(pg.InputError, match="pole"):
        pg.lqr(bare, np.eye(4), inputs=["pol"])


def test_a_sweep_prints_its_rows():
    rod = pg.Body(name="rod", axes=(0, 1, 0), com=(0, 0, -1))
    table = pg.sweep(pg.Model(bodies=[rod]), {"bodies.rod.mass": [1.0, 2.5]}, "max rod", t_end=0.1)
    head, names, *rows = str(table).splitlines()
    assert names.split()[0] == "bodies.rod.mass"
    assert [x.split()[0] for x in rows] == ["1", "2.5"]


def test_runs_of_a_batch_give_a_column_of_each_by_its_name():
    runs = pg.simulate_batch(pg.Model.serial(2), q=[[0.1, 0.0], [0.2, 0.0]], t_end=0.1)
    assert [column[0] for column in runs["2"]] == [0.0, 0.0]
    assert len(runs[:1]) == 1
    assert runs[1]["1"][0] == 0.2
    assert repr(runs).startswith("<Runs: 2")
