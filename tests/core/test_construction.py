"""From a description or from columns to a mechanism, and from one mechanism to the next."""

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

import pgraph_core as pg
import pgraph_models
from pgraph_core.engine import layout as at

from .trees import random_case, random_model, shuffled

seeds = st.integers(0, 2**32 - 1)
QUADRUPED = pg.Model.load(pgraph_models.path("quadruped"))


def same(one: pg.Mechanism, other: pg.Mechanism) -> bool:
    return all(map(np.array_equal, one.packed.system, other.packed.system))


def alike(one: pg.Mechanism, other: pg.Mechanism) -> bool:
    """Compare to 1e-14, because norms are rounded in two ways. The axis of a ball is ignored."""
    pairs = list(zip(one.packed.system, other.packed.system))
    ball = one.packed.system.rows[:, at.KIND] >= at.BALL
    for const in (mech.packed.system.const for mech in (one, other)):
        const[ball, at.AXIS : at.AXIS + 3] = 0.0
    return all(np.allclose(x, y, rtol=1e-14, atol=1e-14) for x, y in pairs)


BODY_FIELDS = ("link", "rotation", "mass", "com", "inertia")
JOINT_FIELDS = ("q", "v", "armature", "stiffness", "damping", "rest", "friction")


def columns_of(model: pg.Model) -> pg.Columns:
    bodies, rows = model.bodies, model.row
    pairs = [(i, m) for i, b in enumerate(bodies, start=1) for m in b.sequence]
    return pg.Columns(
        parent=[0 if b.parent == "ground" else rows[b.parent] + 1 for b in bodies],
        motion=np.array([m.kind for _, m in pairs], dtype=str),
        motion_of=[i for i, _ in pairs],
        axis=np.array([m.axis for _, m in pairs]).reshape(-1, 3),
        names=[b.name for b in bodies],
        gravity=model.gravity,
        **{k: np.array([getattr(b, k) for b in bodies]) for k in BODY_FIELDS},
        **{k: np.array([x for b in bodies for x in getattr(b, k)]) for k in JOINT_FIELDS},
    )


@given(seeds)
@settings(max_examples=40)
def test_columns_and_model_make_the_same_mechanism(seed):
    rng = np.random.default_rng(seed)
    model = shuffled(rng, random_model(rng, int(rng.integers(1, 12))))
    mech, other = pg.Mechanism(columns_of(model)), pg.Mechanism(model)
    topology = pg.Topology.of(model)
    assert mech.names == other.names == topology.names
    assert (mech.nb, mech.nq, mech.nv) == (other.nb, other.nq, other.nv)
    for field in ("pgraph", "jdof", "row", "parent", "dof"):
        assert getattr(mech.topology, field).tolist() == getattr(topology, field).tolist()
    assert alike(mech, other)
    assert alike(mech, pg.Mechanism(columns_of(model).model()))


@pytest.mark.parametrize("joint", ["weld", "universal", "planar", "spherical", "free", "compound"])
def test_every_kind_of_joint_has_its_default_motions(joint):
    link = (0.1, 0, 0)
    ours = pg.Mechanism(pg.Columns(parent=[0, 1], joint=["revolute", joint], link=link))
    bodies = (pg.Body(name="1", link=link), pg.Body(name="2", parent="1", joint=joint, link=link))
    assert same(ours, pg.Mechanism(pg.Model(bodies=bodies)))
    assert ours.model.bodies == bodies


def test_columns_default_to_a_chain_of_hinges_and_are_copied():
    mech = pg.Mechanism(pg.Columns(parent=[0, 1, 2]))
    bodies = [pg.Body(name=n, parent=p) for n, p in zip("123", ("ground", "1", "2"))]
    assert mech.model == pg.Model(name="columns", bodies=bodies)
    assert pg.Mechanism(pg.Columns.of(QUADRUPED)).model is QUADRUPED
    mass = np.array([1.0, 2.0])
    columns = pg.Columns(parent=[0, 1], mass=mass)
    mass[:] = 5.0
    assert [b.mass for b in columns.model().bodies] == [1.0, 2.0]


def test_a_chain_of_twenty_thousand_columns():
    """A comb upside down, whose rows stand before their parents."""
    n = 20_000
    parent = np.append(np.arange(2, n + 1), 0)
    mech = pg.Mechanism(pg.Columns(parent=parent, link=(0.01, 0, 0)))
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
    ({"parent": [0, 5]}, "row 2, parent: 1 2 0 5"),
    ({"parent": [0, 3, 2]}, "row 2, parent: 2 -> 3 -> 2"),
    ({"parent": [0, 2]}, "row 2, parent: '2'"),
    ({"parent": ["a"]}, "columns, parent: ['a']"),
    ({"parent": [0, 1, 2], "mass": [1.0, 1.0, -1.0]}, "row 3, mass: >= 0 -1.0"),
    ({"parent": [0], "mass": "heavy"}, "columns, mass: 'heavy'"),
    ({"parent": [0, 1, 2], "mass": [1.0, 2.0]}, "columns, mass: 3 2"),
    ({"parent": [0], "link": [[0, NAN, 0]]}, "row 1, link: nan"),
    ({"parent": [0], "link": np.zeros((1, 2))}, "columns, link: (3,) (1, 2)"),
    ({"parent": [0], "inertia": np.diag([1.0, 1.0, 3.0])}, "row 1, inertia: 1 + 1 < 3"),
    ({"parent": [0], "inertia": [[1, 0.5, 0], [0, 1, 0], [0, 0, 1]]}, "row 1, inertia: symmetric"),
    ({"parent": [0, 1], "joint": ["revolute", "hinge"]}, "row 2, joint: 'hinge' weld, compound"),
    ({"parent": [0], "joint": 9}, "row 1, joint: 9 weld, compound"),
    ({"parent": [0, 1], "axis": [[0, 0, 1], [0, 0, 0]]}, "row 2, axes: [0.0, 0.0, 0.0]"),
    ({"parent": [0, 1], "joint": "universal", "axis": np.eye(3)}, "columns, axis: 4 3"),
    ({"parent": [0], "rotation": [0.0] * 4}, "row 1, rotation: quaternion"),
    ({"parent": [0], "damping": -1.0}, "row 1, damping: >= 0 -1.0"),
    ({**BALL, "stiffness": 1.0}, "row 1, stiffness: ball 1.0"),
    ({**BALL, "q": [0.0]}, "columns, q: 4 1"),
    ({**BALL, "q": [0.0] * 4}, "row 1, q: quaternion"),
    ({"parent": [0], "gravity": (0, 0)}, "columns, gravity: [0.0, 0.0]"),
    ({"parent": [0, 1], "motion": ["ball"] * 2, "motion_of": [2, 1]}, "columns, motion_of: 1 2"),
    ({"parent": [0], "names": ["a", "b"]}, "columns, names: 1 2"),
    ({"parent": [0, 1], "names": ["a", "a"]}, "row 2, name: 'a' row 1"),
    ({"parent": [0], "names": ["ground"]}, "row 1, name: 'ground'"),
]


@pytest.mark.parametrize(("columns", "facts"), WRONG)
def test_a_wrong_column_is_named_with_its_row(columns, facts):
    with pytest.raises(pg.ModelError) as error:
        pg.Columns(**columns)
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
