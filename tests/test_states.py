"""Methods of a state: their forms, many states at once, and inverse kinematics."""

import copy
import gc
import pickle
import weakref
from typing import Any

import numpy as np
import pytest

import pgraph_core as pg

pytestmark = pytest.mark.quick


def arm():
    bodies, parent = [], "ground"
    for k, axis in enumerate([(0, 0, 1), (0, 1, 0), (0, 1, 0), (1, 0, 0), (0, 1, 0), (1, 0, 0)]):
        name = f"j{k + 1}"
        link = (0, 0, 0.3) if k in (1, 2, 3) else (0, 0, 0.05)
        place = {"parent": parent, "link": link, "limits": ((-2.5, 2.5),)}
        bodies.append(pg.Body(name=name, axes=(axis,), inertia=(0.01,) * 3, **place))
        parent = name
    return pg.Mechanism(pg.Model(bodies=bodies))


def test_every_pose_within_the_limits_is_reached():
    mech, random = arm(), np.random.default_rng(5)
    for q in random.uniform(-2.4, 2.4, (6, 6)):
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


@pytest.mark.parametrize(
    ("call", "same"),
    [
        (lambda m, q: pg.mass_matrix(m, q), lambda mech, q: mech.mass_matrix(q)),
        (lambda m, q: pg.crba(m, q), lambda mech, q: mech.mass_matrix(q)),
        (lambda m, q: pg.rnea(m, q, v=q, vdot=q), lambda mech, q: mech.inverse_dynamics(q, q, q)),
        (lambda m, q: pg.fk(m, q, "2")[0], lambda mech, q: mech.pose(q, "2")[0]),
        (lambda m, q: pg.linearize(m, q).A, lambda mech, q: mech.linearise(q).A),
        (lambda m, q: pg.jacobian(m, q, "2"), lambda mech, q: mech.jacobian(q, "2")),
    ],
)
def test_a_method_of_a_mechanism_is_a_function_of_a_model(call, same):
    model, q = pg.Model.serial(2), np.array([0.1, -0.2])
    mech = pg.Mechanism(model)
    np.testing.assert_array_equal(call(model, q), same(mech, q))
    np.testing.assert_array_equal(call(mech, q), same(mech, q))
    assert call.__name__ not in dir(pg)


def test_a_method_of_a_model_is_a_function_of_it():
    model = pg.Model.serial(2)
    assert pg.edit(model, "1", mass=3.0) == model.edit("1", mass=3.0)
    for wrong in (3, None, np.zeros(2)):
        with pytest.raises(pg.InputError, match=r"pg\.Model, got"):
            pg.mass_matrix(wrong, [0.1, 0.2])


def test_the_target_of_one_body_is_given_by_arguments():
    mech, q = arm(), np.full(6, 0.4)
    place, turn = mech.pose(q, "j6")
    tip = place + turn @ (0.1, 0, 0)
    same = mech.inverse_kinematics({"j6": {"place": tip, "rotation": turn, "point": (0.1, 0, 0)}})
    for words in ({"position": tip}, {"place": tip}, {"target": tip}):
        found = mech.inverse_kinematics("j6", **words, rotation=turn, point=(0.1, 0, 0))
        np.testing.assert_array_equal(found, same)
    found = pg.inverse_kinematics(mech.model, body="j6", position=tip, quat=turn, point=(0.1, 0, 0))
    np.testing.assert_array_equal(found, same)
    with pytest.raises(pg.InputError, match=r"inverse_kinematics, position"):
        mech.inverse_kinematics({"j6": tip}, position=tip)


def test_velocities_of_loose_joints_are_in_the_axes_of_the_parent():
    """The rotation of the body turns an angular velocity in its axes, as other programs take it."""
    half, w = 0.2, np.array((0.3, -0.5, 2.0))
    turn = (np.cos(half), np.sin(half), 0.0, 0.0)
    top = {"inertia": (0.1, 0.1, 0.1), "com": (0, 0, 0.1)}
    for joint, q, rest in (("spherical", turn, ()), ("free", (0, 0, 0, *turn), (0, 0, 0))):
        mech = pg.Mechanism(pg.Model([pg.Body("top", joint=joint, **top)]))
        v = (*(mech.pose(q, "top")[1] @ w), *rest)
        np.testing.assert_allclose(mech.velocity(q, v, "top", frame="body")[:3], w, atol=1e-14)


@pytest.mark.parametrize("count", [1, 2, 3])  # 2 is the number of coordinates
def test_methods_of_a_state_take_an_array_of_states(count):
    mech, rng = pg.Mechanism(pg.Model.serial(2)), np.random.default_rng(0)
    q, v, vdot = rng.normal(size=(3, count, 2))
    calls: list[tuple[Any, tuple[Any, ...]]] = [
        (mech.mass_matrix, (q,)), (mech.energy, (q, v)), (mech.pose, (q, "2")),
        (mech.forward_dynamics, (q, v)), (mech.forward_dynamics, (q, v[0])),
        (mech.forward_derivatives, (q, v)), (mech.inverse_dynamics, (q, v, vdot)),
        (mech.constrained_dynamics, (q, v)), (mech.body_motion, (q, v)),
    ]  # fmt: skip
    for call, given in calls:
        several = call(*given)
        for i in range(count):
            one = call(*(x[i] if isinstance(x, np.ndarray) and x.ndim == 2 else x for x in given))
            pairs = zip(several, one) if isinstance(one, tuple) else [(several, one)]
            assert all(isinstance(x, dict) or np.array_equal(x[i], y) for x, y in pairs)
    for wrong in (q.tolist(), np.zeros((count, 3)), np.zeros((0, 2)), memoryview(q)):
        with pytest.raises(pg.InputError, match="q"):
            mech.mass_matrix(wrong)
    with pytest.raises(pg.InputError, match="v"):
        mech.energy(q, np.zeros((count + 1, 2)))


def site_on_arm():
    return pg.Site(name="tool", body="j6", point=(0.1, 0.2, 0.3), rotation=(0.8, 0.6, 0.0, 0.0))


def test_poses_by_name_are_the_poses_of_each_name():
    mech = pg.Mechanism(arm().model.add(site_on_arm()))
    q = np.linspace(-1.0, 1.0, 6)
    several = np.stack((q, 0.5 * q))
    assert [*mech.pose(q)] == ["ground", *mech.names, "tool"]
    for name, pose in pg.forward_kinematics(mech, q).items():
        np.testing.assert_array_equal(pose, mech.pose(q, name))
        np.testing.assert_array_equal(mech.pose(several)[name].matrix[1], mech.pose(0.5 * q, name))
    with pytest.raises(KeyError, match=r"'hand'.*tool"):
        mech.pose(q)["hand"]


def test_a_pose_is_its_homogeneous_matrix_and_its_two_parts():
    mech = arm()
    pose = mech.pose(np.linspace(-1.0, 1.0, 6), "j6")
    position, rotation = pose
    point = np.array((0.1, -0.2, 0.3))
    np.testing.assert_array_equal(np.asarray(pose)[:3, :3], rotation)
    np.testing.assert_array_equal(pose[:3, 3], position)
    np.testing.assert_allclose(pose @ point, position + rotation @ point, atol=1e-15)
    np.testing.assert_allclose((pose @ [*point, 1.0])[:3], pose @ point, atol=1e-15)
    turned = pg.Body("b", rotation=pose.quaternion, inertia=(1, 1, 1))
    home = pg.Mechanism(pg.Model([turned])).pose([0.0], "b")
    np.testing.assert_allclose(home.rotation, rotation, atol=1e-14)
    found = mech.inverse_kinematics({"j6": pose.matrix})
    np.testing.assert_allclose(mech.pose(found, "j6"), pose, atol=1e-7)
    for theirs, ours in (("translation", position), ("homogeneous", pose.matrix)):
        np.testing.assert_array_equal(getattr(pose, theirs), ours)
    with pytest.raises(AttributeError, match="quaternion"):
        pose.quaternions  # noqa: B018  # pyright: ignore[reportAttributeAccessIssue]


def test_runs_of_a_model_share_its_mechanism():
    """A loop of short runs of a model builds and plans once, and gives the bits of a new one."""
    model = pg.Model.serial(3)
    options = {"t_end": 0.02, "step": 1e-3, "method": "rk4"}
    runs = [pg.simulate(model, [0.1, 0.2, angle], **options) for angle in (0.3, 0.4, 0.3)]
    assert runs[0].mechanism is runs[1].mechanism is pg.Stepper(model).mech
    assert runs[0].mechanism.model is model
    new = pg.simulate(pg.Mechanism(model), [0.1, 0.2, 0.3], **options)
    for run in (runs[0], runs[2]):
        assert run.q.tobytes() == new.q.tobytes()
        assert run.error_at.tobytes() == new.error_at.tobytes()
    assert pg.simulate(model.edit("2", mass=2.0), **options).mechanism is not runs[0].mechanism
    for other in (copy.copy(model), copy.deepcopy(model), pickle.loads(pickle.dumps(model))):
        assert pg.simulate(other, **options).mechanism is not runs[0].mechanism
        assert other == model


def test_only_the_last_models_keep_their_mechanisms():
    """Those of a long history of edits, or of a sweep that keeps its models, would fill memory."""
    models = [pg.Model.serial(2).edit("1", mass=1.0 + k) for k in range(20)]
    made = [weakref.ref(pg.simulate(model, t_end=1e-3, frames=2).mechanism) for model in models]
    gc.collect()
    alive = [mech() is not None for mech in made]
    assert not any(alive[:10])
    assert alive[-1]


def test_functions_of_a_model_keep_no_model_alive():
    model = pg.Model.serial(3)
    first = pg.mass_matrix(model, np.zeros(3))
    mechanism, alive = (weakref.ref(x) for x in (model.mass_matrix.__self__, model))
    np.testing.assert_array_equal(pg.mass_matrix(model, np.zeros(3)), first)
    assert mechanism() is model.mass_matrix.__self__
    del model
    gc.collect()
    assert (alive(), mechanism()) == (None, None)
