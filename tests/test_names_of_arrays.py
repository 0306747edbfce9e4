"""Arrays of a run that names of joints and bodies index, and parts whose name stands first."""

import pickle

import numpy as np
import pytest

import pgraph_core as pg

JOINTS = ("revolute", "slide", "ball", "free", "universal")


def chain(joints: tuple[str, ...]) -> pg.Model:
    """One body after the other, 0.3 m apart."""
    bodies = [
        pg.Body(f"b{i}", parent=f"b{i - 1}" if i else None, joint=kind, link=(0, 0, -0.3 * (i > 0)),
                com=(0, 0.01, -0.1), inertia=(0.02, 0.03, 0.01))
        for i, kind in enumerate(joints)
    ]  # fmt: skip
    return pg.Model(bodies)


@pytest.mark.parametrize("joints", [(x,) for x in JOINTS] + [JOINTS, ("weld", *JOINTS[::-1])])
def test_a_name_indexes_what_its_columns_hold(joints):
    run = pg.simulate(chain(joints), t_end=0.05, frames=6)
    for name, joint in run.mechanism.joints.items():
        assert np.array_equal(run.q[name], run[name])
        assert np.array_equal(run.v[name].reshape(6, -1), run.v[:, joint.v])
        assert np.array_equal(run.vdot[name], run.vdot(name))
    for k, name in enumerate(run.mechanism.names):
        for kind in ("position", "velocity", "angular_velocity", "acceleration", "joint_torque",
                     "angular_acceleration"):  # fmt: skip
            vectors = getattr(run, kind)
            assert vectors.shape == (6, len(joints), 3)
            assert np.array_equal(vectors[name], run[f"{kind}.{name}"])
            assert np.array_equal(vectors[name], vectors[:, k])
        for kind in ("body_pose", "body_velocity", "body_acceleration", "joint_force"):
            assert np.array_equal(getattr(run, kind)[name], getattr(run, kind)[:, k])


@pytest.mark.parametrize("use", [
    lambda q: q[0], lambda q: q[:, 0], lambda q: 2 * q, np.sin, lambda q: np.vstack((q, q)),
    lambda q: q - q.mean(axis=0), lambda q: np.abs(q).max(axis=1), lambda q: q[q > 0],
])  # fmt: skip
def test_what_is_computed_from_named_columns_is_a_plain_array(use):
    run = pg.simulate(chain(("revolute", "ball")), q={"b0": 0.3}, t_end=0.01, frames=3)
    plain = np.array(run.q.tolist())
    assert type(use(run.q)) is type(use(plain))
    assert np.array_equal(use(run.q), use(plain))
    assert repr(run.q) == repr(plain)


def test_an_unknown_name_is_refused_with_those_that_exist():
    run = pg.simulate(chain(("revolute", "weld")), t_end=0.01)
    for array, known in ((run.q, ("b0",)), (run.position, ("b0", "b1"))):
        for wrong in ("b2", "", "B0"):
            with pytest.raises(KeyError) as refused:
                array[wrong]
            assert all(name in str(refused.value) for name in known)


def test_names_outlive_pickles_and_files(tmp_path):
    run = pg.simulate(chain(("revolute", "ball")), t_end=0.01)
    run.save(tmp_path / "run.npz")
    for copy in (pickle.loads(pickle.dumps(run)), pg.Result.load(tmp_path / "run.npz")):
        assert copy == run
        assert np.array_equal(copy.q["b1"], run.q["b1"])
        assert np.array_equal(copy.position["b1"], run.position["b1"])


@pytest.mark.parametrize("word", ["world", "World", "earth", None])
def test_the_ground_has_the_names_that_other_programs_give_it(word):
    a = pg.Body("a", parent=word, com=(0, 0, -1))
    model = pg.Model([a], forces=[pg.Spring("s", body="a", other=word or "ground", stiffness=1.0)])
    assert model.body("a").parent == "ground"
    assert model["s"].other == "ground"


def test_a_body_called_world_keeps_its_name():
    model = pg.Model([pg.Body("world"), pg.Body("a", parent="world")])
    assert model.body("a").parent == "world"
    with pytest.raises(pg.ModelError, match="earht"):
        pg.Model([pg.Body("a", parent="earht")])


@pytest.mark.parametrize("kind", [pg.Body, pg.Motor, pg.Spring, pg.Point, pg.Site, pg.Contact])
def test_the_name_stands_first(kind):
    own = {} if kind is pg.Body else {"body": "a"}
    assert kind("x", **own) == kind(name="x", **own)
    with pytest.raises(pg.ModelError, match="first"):
        kind("x", "y", *(() if own else ("z",)), **own)
    with pytest.raises(pg.ModelError):
        kind(3, **own)


def test_a_linear_model_is_a_and_b():
    linear = pg.Mechanism(chain(("revolute",))).linearise()
    A, B = linear
    assert A is linear.A
    assert B is linear.B


@pytest.mark.parametrize("kind", [pg.Motor, pg.Servo])
def test_a_joint_is_named_by_its_body(kind):
    assert kind("m", joint="a") == kind("m", body="a")
