"""The description: what edits do, and laws of building, editing and storing."""

from __future__ import annotations

import json
import math
from collections.abc import Callable

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

import pgraph_core as pg
import pgraph_models

pytestmark = pytest.mark.fast

FINITE = st.floats(-10, 10, allow_nan=False)


@st.composite
def edits(draw, n: int) -> tuple[str, dict]:
    """An edit of a body of serial(n) that may be refused (a cycle, a taken name)."""
    name = str(draw(st.integers(1, n)))
    change = draw(
        st.one_of(
            st.fixed_dictionaries({"mass": st.floats(0, 10)}),
            st.fixed_dictionaries({"parent": st.sampled_from(["ground", *map(str, range(1, n))])}),
            st.fixed_dictionaries({"dof": st.integers(0, 6)}),
            st.fixed_dictionaries({"link": st.tuples(FINITE, FINITE, FINITE)}),
            st.fixed_dictionaries({"com": st.tuples(FINITE, FINITE, FINITE)}),
            st.fixed_dictionaries({"stiffness": st.floats(0, 1e6)}),
        )
    )
    return name, change


def refused(call: Callable[[], object]) -> tuple[pg.Problem, ...]:
    """The problems with which a call is refused; none where it is done."""
    try:
        call()
    except pg.PgraphError as error:
        return error.problems
    return ()


# -- serial, sec. 4.1 ----------------------------------------------------------------------------


def test_serial_is_the_paper_s_default_table():
    model = pg.Model.serial(7)
    assert [b.name for b in model.bodies] == ["1", "2", "3", "4", "5", "6", "7"]
    assert [b.parent for b in model.bodies] == ["ground", "1", "2", "3", "4", "5", "6"]
    assert {b.dof for b in model.bodies} == {1}
    assert model.constraints == ()


@pytest.mark.parametrize("n", [1, 2, 1000, np.int64(3)])
def test_serial_has_n_bodies(n):
    assert len(pg.Model.serial(n).bodies) == n


@pytest.mark.parametrize("n", [0, -1, 1.0, "3", True, None, math.nan])
def test_serial_takes_a_whole_number_from_1(n):
    with pytest.raises(pg.ModelError, match="must be a whole number >= 1; given"):
        pg.Model.serial(n)


# -- edit ----------------------------------------------------------------------------------------


def test_an_edit_is_a_new_model():
    model = pg.Model.serial(3)
    heavy = model.edit("2", mass=2.5)
    assert (model.body("2").mass, heavy.body("2").mass) == (1.0, 2.5)
    assert model == pg.Model.serial(3)


@pytest.mark.parametrize(
    "change", [{}, {"mass": 1.0}, {"dof": 1}, {"joint": "revolute"}, {"name": "2"}, {"dof": None}]
)
def test_an_edit_that_changes_nothing_gives_the_same_model(change: dict):
    model = pg.Model.serial(3)
    assert model.edit("2", **change) is model


@given(edits(6))
def test_a_refused_edit_leaves_the_model_as_it_was(edit: tuple[str, dict]):
    model = pg.Model.serial(6)
    before = model.to_json()
    refused(lambda: model.edit(edit[0], **edit[1]))
    assert model.to_json() == before


@given(st.lists(edits(6), max_size=12))
def test_edits_then_build_equals_build_from_json(steps: list[tuple[str, dict]]):
    model = pg.Model.serial(6)
    for name, change in steps:
        try:
            model = model.edit(name, **change)
        except pg.PgraphError:
            continue
    again = pg.Model.from_json(model.to_json())
    assert again == model
    assert again.hash == model.hash
    one, other = pg.Topology.of(model), pg.Topology.of(again)
    assert one.pgraph.tolist() == other.pgraph.tolist()
    assert one.jdof.tolist() == other.jdof.tolist()


def test_references_follow_a_new_name():
    model = pg.Model.load(pgraph_models.path("quadruped"))
    renamed = model.edit("left_hind_paw", name="foot").edit("lumbar", name="loin")
    foot = next(c for c in renamed.constraints if c.name == "left_hind_paw")
    assert foot.body == "foot"
    assert renamed.body("thorax").parent == "loin"
    assert {f.body for f in renamed.scenario("stance").forces} >= {"foot", "loin"}
    back = renamed.edit("foot", name="left_hind_paw").edit("loin", name="lumbar")
    assert back == model


def test_a_new_dof_resets_the_joint_and_says_so():
    model = pg.Model.serial(2).edit("2", q=0.5, stiffness=3.0)
    ball = model.edit("2", dof=3)
    assert ball.body("2").joint == "spherical"
    assert ball.body("2").q == (1.0, 0.0, 0.0, 0.0)
    said = "body '2': the joint is now spherical (3 DoF); reset: axes, motions, q, stiffness"
    assert ball.notices == (said,)
    assert ball.edit("2", mass=2.0).notices == ()


def test_what_does_not_fit_a_new_joint_goes():
    model = pg.Model.load(pgraph_models.path("quadruped"))
    ball = model.edit("lumbar", dof=3, name="loin")
    assert all(f.body not in ("lumbar", "loin") for f in ball.scenario("stance").forces)
    assert len(ball.scenario("stance").forces) == len(model.scenario("stance").forces) - 1
    assert "scenario 'stance': what does not fit the joint of 'lumbar' went" in ball.notices
    bent = model.edit("lumbar", joint="universal")  # its first turn takes the servo
    assert len(bent.scenario("stance").forces) == len(model.scenario("stance").forces)


@pytest.mark.parametrize(
    ("dof", "joint", "nq"),
    [
        (0, "weld", 0),
        (1, "revolute", 1),
        (2, "universal", 2),
        (3, "spherical", 4),
        (4, "compound", 5),
        (5, "compound", 6),
        (6, "free", 7),
    ],
)
def test_dof_picks_the_joint(dof: int, joint: str, nq: int):
    body = pg.Body(name="a", dof=dof)
    assert (body.joint, body.dof, len(body.q), len(body.v)) == (joint, dof, nq, dof)
    assert pg.Body(name="a", dof=np.int64(dof)) == body


# -- add, remove, move, replace ------------------------------------------------------------------


def test_children_of_a_removed_body_stay_where_they_are():
    turn = (math.sqrt(0.5), 0.0, 0.0, math.sqrt(0.5))  # 90 degrees about z
    model = pg.Model.serial(3).edit("2", rotation=turn)
    left = model.remove("2")
    # 3 was at (0.2, 0, 0) in a frame turned by 90 degrees at (0.2, 0, 0).
    assert left.body("3").parent == "1"
    assert left.body("3").link == pytest.approx((0.2, 0.2, 0.0), abs=1e-15)
    assert left.body("3").rotation == pytest.approx(turn)


def test_what_refers_to_a_removed_body_goes_too():
    model = pg.Model.load(pgraph_models.path("quadruped"))
    left = model.remove("left_femur", children="delete")
    assert len(left.bodies) == 13
    assert [c.name for c in left.constraints] == [
        "left_front_paw",
        "right_front_paw",
        "right_hind_paw",
    ]
    assert "constraint 'left_hind_paw' went with its body" in left.notices
    assert left.scenario("stance").constraints == tuple(c.name for c in left.constraints)
    assert pg.Model.from_json(left.to_json()) == left


def test_the_order_of_rows_is_the_order_of_left_children():
    model = pg.Model.serial(3).edit("3", parent="1")
    assert pg.Topology.of(model).names == ("1", "2", "3")
    assert pg.Topology.of(model.move("3", 1)).names == ("1", "3", "2")


def test_added_rows_stand_where_asked():
    model = pg.Model.serial(2).add(pg.Body(name="x", parent="1"), after="1")
    assert [b.name for b in model.bodies] == ["1", "x", "2"]
    assert [b.name for b in model.add(pg.Body(name="y")).bodies] == ["1", "x", "2", "y"]


def test_gravity_follows_up_unless_it_was_chosen():
    model = pg.Model.serial(1)
    assert model.replace(up="y").gravity == (0.0, -9.81, 0.0)
    moon = model.replace(gravity=(0, 0, -1.62))
    assert moon.replace(up="y").gravity == (0.0, 0.0, -1.62)
    assert pg.Model(up="x").gravity == (-9.81, 0.0, 0.0)


# -- values --------------------------------------------------------------------------------------


def test_lists_tuples_and_arrays_are_the_same_body():
    one = pg.Body(name="a", com=[0, 0, 1], axes=[[0, 1, 0]], inertia=np.eye(3))
    other = pg.Body(name="a", com=np.array([0.0, 0.0, 1.0]), axes=(0, 1, 0), inertia=np.eye(3))
    assert one == other
    assert hash(one) == hash(other)


def test_models_and_bodies_do_not_change():
    model = pg.Model.serial(1)
    with pytest.raises(pg.ModelError, match=r"body '1', mass: .*model\.edit\('1', mass=2\.0\)"):
        setattr(model.bodies[0], "mass", 2.0)  # noqa: B010
    with pytest.raises(pg.ModelError, match=r"name: .*model\.replace\(name='other'\)"):
        setattr(model, "name", "other")  # noqa: B010
    assert (model.bodies[0].mass, model.name) == (1.0, "serial 1")


def test_the_hash_is_that_of_the_description():
    model = pg.Model.serial(2)
    assert model.hash == pg.Model.serial(2).hash
    assert model.hash != model.edit("2", mass=1.0 + 1e-15).hash


def test_a_tip_is_the_centre_of_mass_unless_given():
    assert pg.Body(name="a", com=(1, 0, 0)).tip_point == (1.0, 0.0, 0.0)
    assert pg.Body(name="a", com=(1, 0, 0), tip=(0, 0, 2)).tip_point == (0.0, 0.0, 2.0)


@pytest.mark.parametrize(
    "inertia",
    [
        np.zeros((3, 3)),  # a point mass
        np.diag([1.0, 1.0, 2.0]),  # a flat plate: equality
        np.diag([0.0, 1.0, 1.0]),  # a thin rod
        np.diag([1e-15, 1e-15, 1e-15]),
        np.diag([1e300, 1e300, 1e300]),
        np.diag([1.0, 1.0, 2.0 + 1e-9]),  # within the slack
    ],
)
def test_inertias_at_the_border_are_bodies(inertia):
    assert pg.Body(name="a", inertia=inertia).inertia == tuple(map(tuple, inertia.tolist()))


@given(st.lists(st.tuples(FINITE, FINITE, FINITE, st.floats(0.01, 5)), min_size=1, max_size=6))
def test_every_cloud_of_points_has_a_valid_inertia(points):
    """Bodies made of point masses are bodies: no false refusal."""
    x, m = np.array([p[:3] for p in points]), np.array([p[3] for p in points])
    r = x - m @ x / m.sum()
    inertia = sum(w * ((p @ p) * np.eye(3) - np.outer(p, p)) for w, p in zip(m, r))
    assert np.array_equal(pg.Body(name="a", inertia=inertia).inertia, inertia)


def test_a_field_that_cannot_be_printed_is_named_in_quotes():
    with pytest.raises(pg.ModelError) as caught:
        pg.Body(**{"name": "a", "\n": 1})
    assert str(caught.value).startswith("body 'a', '\\n': no such field")


# -- damaged descriptions ------------------------------------------------------------------------

JSON = st.recursive(
    st.none() | st.booleans() | st.integers() | st.floats() | st.text(max_size=4),
    lambda inner: st.lists(inner, max_size=3) | st.dictionaries(st.text(max_size=6), inner),
    max_leaves=6,
)


def places(value, path=()):
    """Every place in nested lists and dictionaries."""
    yield path
    items = value.items() if isinstance(value, dict) else enumerate(value)
    for key, item in items if isinstance(value, (dict, list)) else ():
        yield from places(item, (*path, key)) if isinstance(item, (dict, list)) else [(*path, key)]


@given(st.data())
def test_a_damaged_description_is_refused_with_sentences_or_valid(data):
    check_damaged(data)


@pytest.mark.nightly
@settings(max_examples=5000)
@given(st.data())
def test_five_thousand_damaged_descriptions(data):
    check_damaged(data)


def check_damaged(data) -> None:
    model = pg.Model.load(pgraph_models.path("quadruped"))
    model = model.edit("thorax", joint="universal").edit("lumbar", dof=4)
    tree = json.loads(model.to_json())
    tree.pop("$schema"), tree.pop("schema_version")
    path = data.draw(st.sampled_from([p for p in places(tree) if p]))
    target = tree
    for key in path[:-1]:
        target = target[key]
    target[path[-1]] = data.draw(JSON)
    if problems := refused(lambda: pg.Model(**tree)):
        assert all(p.where and p.text and "\n" not in str(p) for p in problems)


@pytest.mark.parametrize(
    ("made", "facts"),
    [
        (lambda: pg.Shape(kind="sphere"), ("shape", "sphere", "radius")),
        (lambda: pg.Shape(kind="sphere", raduis=1), ("raduis", "did you mean radius")),
        (lambda: pg.Table(t=[0, 1], value=[1]), ("table", "value", "2 times, 1 value")),
        (lambda: pg.Step(low=(0, 0), high=(-1, 1), height=1), ("low", "high", "-1.0, 1.0")),
        (lambda: pg.Ground(friction=-1), ("ground", "friction", ">= 0", "-1")),
        (lambda: pg.Sine(amplitude="x"), ("sine", "amplitude", "'x'")),
    ],
)
def test_values_made_directly_are_refused_in_sentences(made, facts):
    """As they are inside a body: never by an error of pydantic."""
    with pytest.raises(pg.ModelError) as refused:
        made()
    assert all(fact in str(refused.value) for fact in facts)
