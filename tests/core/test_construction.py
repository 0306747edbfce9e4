"""From a description or from columns to a mechanism, and from one mechanism to the next."""

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

import pgraph_core as pg
import pgraph_models

from .trees import random_case, random_model, shuffled

seeds = st.integers(0, 2**32 - 1)
QUADRUPED = pg.Model.load(pgraph_models.path("quadruped"))


def same(one: pg.Mechanism, other: pg.Mechanism) -> bool:
    return all(map(np.array_equal, one.packed.system, other.packed.system))


BODY_FIELDS = ("joint", "motions", "link", "rotation", "mass", "com", "inertia")
JOINT_FIELDS = ("q", "v", "armature", "stiffness", "damping", "rest", "friction")


def of_columns(model: pg.Model) -> pg.Model:
    bodies, rows = model.bodies, model.row
    return pg.Model.from_columns(
        [0 if b.parent == "ground" else rows[b.parent] + 1 for b in bodies],
        names=[b.name for b in bodies],
        gravity=model.gravity,
        **{k: [getattr(b, k) for b in bodies] for k in BODY_FIELDS + JOINT_FIELDS},
    )


@given(seeds)
@settings(max_examples=40)
def test_columns_and_model_make_the_same_mechanism(seed):
    rng = np.random.default_rng(seed)
    model = shuffled(rng, random_model(rng, int(rng.integers(1, 12))))
    mech, other = pg.Mechanism(of_columns(model)), pg.Mechanism(model)
    topology = pg.Topology.of(model)
    assert mech.names == other.names == topology.names
    assert (mech.nb, mech.nq, mech.nv) == (other.nb, other.nq, other.nv)
    for field in ("pgraph", "jdof", "row", "parent", "dof"):
        assert getattr(mech.topology, field).tolist() == getattr(topology, field).tolist()
    assert same(mech, other)


@pytest.mark.parametrize("joint", ["weld", "universal", "planar", "spherical", "free", "compound"])
def test_every_kind_of_joint_has_its_default_motions(joint):
    link = (0.1, 0, 0)
    ours = pg.Mechanism(pg.Model.from_columns([0, 1], joint=["revolute", joint], link=link))
    bodies = (pg.Body(name="1", link=link), pg.Body(name="2", parent="1", joint=joint, link=link))
    assert same(ours, pg.Mechanism(pg.Model(bodies=bodies)))
    assert ours.model.bodies == bodies


def test_columns_default_to_a_chain_of_hinges_and_are_copied():
    mass = np.array([1.0, 2.0, 3.0])
    model = pg.Model.from_columns([0, 1, 2], mass=mass)
    mass[:] = 5.0
    rows = zip("123", ("ground", "1", "2"), (1.0, 2.0, 3.0))
    bodies = [pg.Body(name=n, parent=p, mass=m) for n, p, m in rows]
    assert model == pg.Model(name="columns", bodies=bodies)


def test_a_chain_of_five_thousand_columns():
    """A comb upside down, whose rows stand before their parents."""
    n = 5_000
    parent = np.append(np.arange(2, n + 1), 0)
    mech = pg.Mechanism(pg.Model.from_columns(parent, link=(0.01, 0, 0), com=(0.01, 0, 0)))
    assert (mech.nb, mech.pgraph[:3].tolist()) == (n, [1, 2, 3])
    assert np.isfinite(mech.forward_dynamics(*mech.home())).all()


@pytest.mark.parametrize("update", [{"rotation": (0.0,) * 4}, {"name": " a"}])
def test_a_copy_of_a_body_is_looked_at_again(update):
    rod = pg.Model.serial(1).bodies[0]
    assert pg.Model(bodies=(rod,)).bodies[0] is rod
    with pytest.raises(pg.ModelError):
        pg.Model(bodies=(rod.model_copy(update=update),))


EDITS = [
    {"parent": "left_femur"},
    {"parent": "lumbar", "mass": 0.25, "link": (0.1, 0.2, 0.3)},
    {"com": (0.1, 0, 0.2), "inertia": np.diag([0.1, 0.1, 0.2])},
    {"dof": 3},
    {"name": "foot"},
    {"stiffness": 3.0},
    {"mass": 0.4},  # as it is
    {"parent": "left_tibia"},  # as it is
]


@pytest.mark.parametrize("changes", EDITS)
def test_an_edited_mechanism_is_that_of_the_edited_model(changes):
    mech, model = pg.Mechanism(QUADRUPED), QUADRUPED.edit("left_hind_paw", **changes)
    edited = mech.edit("left_hind_paw", **changes)
    assert same(edited, pg.Mechanism(model))
    assert edited.model == model
    assert edited.names == pg.Mechanism(model).names
    assert mech.model is QUADRUPED
    assert same(mech, pg.Mechanism(QUADRUPED))


def test_a_long_series_of_edits_ends_where_the_edits_of_the_model_end():
    mech, model = pg.Mechanism(pg.Model.serial(6)), pg.Model.serial(6)
    rng = np.random.default_rng(0)
    for _ in range(60):
        i = int(rng.integers(2, 7))
        changes = {"parent": str(rng.integers(1, i)), "mass": float(rng.uniform(1, 2))}
        mech, model = mech.edit(str(i), **changes), model.edit(str(i), **changes)
        assert mech.model == model
    assert same(mech, pg.Mechanism(model))


def test_a_body_attached_elsewhere_is_packed_again():
    model = pg.Model.serial(4)
    pg.Mechanism(model)  # bodies keep their packed form from here on
    left = model.remove("2")
    assert same(pg.Mechanism(left), pg.Mechanism(pg.Model.from_json(left.to_json())))


@given(seeds)
@settings(max_examples=30)
def test_a_state_is_kept_by_name_whatever_the_order(seed):
    s = random_case(seed)
    one = pg.Mechanism(s.model)
    other = pg.Mechanism(shuffled(np.random.default_rng(seed), s.model))
    there = other.state_from(one, s.q, s.v)
    assert there.reset == ()
    for name, joint in other.joints.items():
        assert there.q[joint.q].tolist() == s.q[one.joints[name].q].tolist()
        assert there.v[joint.v].tolist() == s.v[one.joints[name].v].tolist()
    back = one.state_from(other, there.q, there.v)
    assert back.q.tolist() == s.q.tolist()
    assert back.v.tolist() == s.v.tolist()


def test_joints_of_another_name_or_kind_start_at_home():
    old = pg.Mechanism(pg.Model.serial(4))
    model = pg.Model.serial(4).edit("4", parent="1").edit("2", dof=3).edit("3", name="knee")
    new = pg.Mechanism(model.edit("1", axes=(0, 0, 1)))
    numbers = np.array([1.0, 2.0, 3.0, 4.0])
    q, v, reset = new.state_from(old, 0.1 * numbers, numbers)
    assert reset == ("2", "knee")
    assert q[new.joints["1"].q] == 0.1
    assert q[new.joints["2"].q].tolist() == [1.0, 0.0, 0.0, 0.0]
    assert q[new.joints["4"].q] == 0.4
    assert v[new.joints["4"].v] == 4.0
    assert v[new.joints["knee"].v] == 0.0


NAN = float("nan")
BALL = {"parent": [0], "joint": "spherical"}
WRONG = [  # columns, and the words that their message must hold: row, field, value, choices
    ({"parent": [0, 5]}, "body '2', parent: 1 2 0 5"),
    ({"parent": [0, 3, 2]}, "body '2', parent: 2 -> 3 -> 2"),
    ({"parent": ["a"]}, "columns, parent: ['a']"),
    ({"parent": [0, 1, 2], "mass": [1.0, 1.0, -1.0]}, "body '3', mass: >= 0 -1.0"),
    ({"parent": [0], "mass": "heavy"}, "body '1', mass: 'heavy'"),
    ({"parent": [0, 1, 2], "mass": [1.0, 2.0]}, "columns, mass: 3 2"),
    ({"parent": [0], "link": [[0, NAN, 0]]}, "body '1', link: nan"),
    ({"parent": [0], "link": np.zeros((1, 2))}, "body '1', link: 0.0"),
    ({"parent": [0], "inertia": np.diag([1.0, 1.0, 3.0])}, "body '1', inertia: 1 + 1 < 3"),
    ({"parent": [0, 1], "joint": ["revolute", "hung"]}, "body '2', joint: 'hung' weld compound"),
    ({"parent": [0, 1], "axes": [[0, 0, 1], [0, 0, 0]]}, "body '2', axes: [0.0, 0.0, 0.0]"),
    ({**BALL, "stiffness": 1.0}, "body '1', stiffness: ball 1.0"),
    ({**BALL, "q": [[0.0]]}, "body '1', q: 4 1"),
    ({"parent": [0], "gravity": (0, 0)}, "model, gravity: [0, 0]"),
    ({"parent": [0], "names": ["a", "b"]}, "columns, names: 1 2"),
    ({"parent": [0, 1], "names": ["a", "a"]}, "row 2, name: 'a' row 1"),
    ({"parent": [0], "names": ["ground"]}, "body 'ground', name: 'ground'"),
    ({"parent": [0], "hue": [1]}, "body '1', hue: field"),
]


@pytest.mark.parametrize(("columns", "facts"), WRONG)
def test_a_wrong_column_is_named_with_its_body(columns, facts):
    with pytest.raises(pg.ModelError) as error:
        pg.Model.from_columns(
            columns["parent"], **{k: x for k, x in columns.items() if k != "parent"}
        )
    where, _, values = facts.partition(": ")
    assert str(error.value).startswith(where)
    assert all(value in str(error.value) for value in values.split(" "))


@pytest.mark.parametrize(
    "changes",
    [{"parent": "left_hind_paw"}, {"parent": "nobody"}, {"mass": -1.0}, {"mass": NAN}, {"hue": 1}],
)
def test_a_wrong_edit_of_a_mechanism_is_refused_as_that_of_the_model(changes):
    mech = pg.Mechanism(QUADRUPED)
    with pytest.raises(pg.ModelError) as ours:
        mech.edit("left_femur", **changes)
    with pytest.raises(pg.ModelError) as theirs:
        QUADRUPED.edit("left_femur", **changes)
    assert str(ours.value) == str(theirs.value)
    with pytest.raises(pg.ModelError, match=r"'nobody'.*pelvis"):
        mech.edit("nobody", mass=1.0)
