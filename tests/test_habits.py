"""Words of other tools are understood."""

from typing import Any

import numpy as np
import pytest

import pgraph_core as pg

pytestmark = pytest.mark.quick


@pytest.mark.parametrize("given", [(1, 2, 2.5), [1.0, 2.0, 2.5], np.array([1, 2, 2.5])])
def test_three_moments_are_the_diagonal_of_the_inertia(given):
    body = pg.Body(name="a", inertia=given)
    assert body.inertia == ((1, 0, 0), (0, 2, 0), (0, 0, 2.5))
    assert pg.Model(bodies=[body]).edit("a", inertia=given).bodies[0] == body


@pytest.mark.parametrize("given", [(1, 2), (1, 2, 3, 4), (1, 2, 4), (1, -1, 1), (1, 2, "x"), 3.0])
def test_moments_that_no_body_has_are_refused(given):
    with pytest.raises(pg.ModelError, match="inertia"):
        pg.Body(name="a", inertia=given)


@pytest.mark.parametrize("given", [0.01 * np.eye(3), (0.01, 0.01, 0.01)])
def test_an_inertia_that_is_given_is_not_taken_for_the_default(given):
    ball = {"name": "ball", "joint": "free", "mass": 0.5}
    assert pg.Model(bodies=[pg.Body(**ball)]).doubts
    assert pg.Model(bodies=[pg.Body(**ball, inertia=given)]).doubts == ()


def test_a_run_gives_each_of_its_columns_by_name():
    ball = pg.Body(name="ball", joint="free")
    arm = pg.Body(name="arm", joint="revolute", axes=((0, 1, 0),))
    floor = pg.Contact(name="floor", body="ball", points=((0, 0, 0),))
    run = pg.simulate(pg.Model(bodies=[ball, arm], contacts=[floor]), t_end=0.1)
    for name, column in run.columns().items():
        np.testing.assert_array_equal(run[name], getattr(column, "values", column))


def arm():
    bodies, parent = [], "ground"
    for k, axis in enumerate([(0, 0, 1), (0, 1, 0), (0, 1, 0), (1, 0, 0), (0, 1, 0), (1, 0, 0)]):
        name = f"j{k + 1}"
        link = (0, 0, 0.3) if k in (1, 2, 3) else (0, 0, 0.05)
        bodies.append(
            pg.Body(name=name, parent=parent, axes=(axis,), link=link, limits=((-2.5, 2.5),))
        )
        parent = name
    return pg.Mechanism(pg.Model(bodies=bodies))


def test_every_pose_within_the_limits_is_reached():
    mech, random = arm(), np.random.default_rng(5)
    for q in random.uniform(-2.4, 2.4, (30, 6)):
        found = mech.inverse_kinematics({"j6": mech.pose(q, "j6")})
        for one, other in zip(mech.pose(found, "j6"), mech.pose(q, "j6")):
            np.testing.assert_allclose(one, other, atol=1e-7)


def test_a_refusal_says_how_many_starts_were_tried():
    mech = arm()
    with pytest.raises(pg.InputError, match=r"5 starts.* m"):
        mech.inverse_kinematics({"j6": (9, 0, 0)}, starts=5)
    wrong: Any = (0, -1, 1.5, True, "many", 10**9)
    for starts in wrong:
        with pytest.raises(pg.InputError, match="starts"):
            mech.inverse_kinematics({"j6": (0.1, 0, 0)}, starts=starts)


def test_velocities_are_given_in_the_axes_asked_for():
    mech, random = arm(), np.random.default_rng(1)
    q, v = random.normal(size=6), random.normal(size=6)
    turn = mech.pose(q, "j5")[1]
    world = mech.velocity(q, v, "j5", (0.1, 0, 0))
    body = mech.velocity(q, v, "j5", (0.1, 0, 0), frame="body")
    np.testing.assert_allclose(world, mech.jacobian(q, "j5", (0.1, 0, 0)) @ v, atol=1e-14)
    np.testing.assert_allclose(turn @ body[:3], world[:3], atol=1e-14)
    np.testing.assert_allclose(turn @ body[3:], world[3:], atol=1e-14)
    wrong: Any = ("tip", None, 1, ["body"])
    for frame in wrong:
        with pytest.raises(pg.InputError, match=r"frame.*world"):
            mech.jacobian(q, "j5", frame=frame)


def test_american_spellings_do_the_same():
    mech = arm()
    q, v = mech.home()
    np.testing.assert_array_equal(mech.center_of_mass(q), mech.centre_of_mass(q))
    np.testing.assert_array_equal(mech.linearize(q, v).A, mech.linearise(q, v).A)


def test_a_run_goes_to_matlab_with_its_names_and_units(tmp_path):
    from scipy.io import loadmat

    bodies = [pg.Body(name=x, joint="free") for x in ("a", "1", "a.0", "é", "a_0", "names")]
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


@pytest.mark.parametrize(
    ("name", "ours"),
    [
        ("forward_kinematics", r"Mechanism\(model\).pose"),
        ("mass_matrix", r"\(model\).mass_matrix"),
        ("simulate_batch", "BatchStepper"),
        ("modes", "linearise"),
        ("gradient", "run.gradient"),
        ("Loop", "Revolute"),
    ],
)
def test_a_function_of_another_program_is_answered_with_ours(name, ours):
    with pytest.raises(AttributeError, match=ours):
        getattr(pg, name)


def test_weights_of_a_regulator_may_be_named():
    cart = pg.Body(name="cart", joint="prismatic", axes=(1, 0, 0), mass=2.0)
    model = pg.Model(bodies=[cart], forces=[pg.Motor(name="push", body="cart")])
    named, by_position = pg.lqr(model, Q=3.0, R=0.5), pg.lqr(model, 3.0, 0.5)
    assert np.array_equal(named.K, by_position.K)


@pytest.mark.parametrize(
    ("call", "named"),
    [
        (lambda model: pg.simulate(model, q=np.zeros((9, 2))), "BatchStepper"),
        (lambda model: pg.simulate(model, forces=lambda t, q, v: 0.0), "tau"),
        (lambda _: pg.simulate(pg.Model.serial(3), (0, 5), [0.1] * 3), "t_span="),
        (lambda model: pg.simulate(model, (0, 5), q0=[0.1]), "5] is in the place of q"),
        (lambda model: pg.simulate(model, t_end=0.1).show(fps=30), "fps"),
        (lambda model: pg.PID(name="p", signal="q.arm", kp=1.0), "'=q.arm'"),
    ],
)
def test_a_refusal_names_what_to_write(call, named):
    with pytest.raises(pg.PgraphError, match=named):
        call(pg.Model.serial(2))


@pytest.mark.parametrize(
    ("change", "falls"),
    [
        ({}, True),
        ({"contacts": [pg.Contact(name="c", body="b")]}, False),
        ({"gravity": (0, 0, 0)}, False),
        ({"constraints": [pg.Point(name="p", body="b", other="ground")]}, False),
    ],
)
def test_a_loose_body_that_touches_nothing_is_doubted(change, falls):
    box = pg.Shape(kind="box", size=(0.2, 0.2, 0.2))
    body = pg.Body(name="b", joint="free", shape=box, derived=("inertia",))
    doubts = pg.Model(bodies=[body], **change).doubts
    assert any("contact" in text for text in doubts) == falls
