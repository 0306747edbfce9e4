"""The description: what edits do, and laws of building, editing and storing."""

import json
from collections.abc import Callable

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

import pgraph_core as pg
import pgraph_models

QUADRUPED = pg.Model.load(pgraph_models.path("quadruped"))
FINITE = st.floats(-10, 10, allow_nan=False)
VECTORS = st.tuples(FINITE, FINITE, FINITE)


@st.composite
def edits(draw, n: int) -> tuple[str, dict]:
    """An edit of a body of serial(n) that may be refused (a cycle, a taken name)."""
    name = str(draw(st.integers(1, n)))
    fields = {
        "mass": st.floats(0, 10),
        "parent": st.sampled_from(["ground", *map(str, range(1, n))]),
        "dof": st.integers(0, 6),
        "link": VECTORS,
        "com": VECTORS,
        "stiffness": st.floats(0, 1e6),
    }
    field = draw(st.sampled_from(list(fields)))
    return name, {field: draw(fields[field])}


def refused(call: Callable[[], object]) -> tuple[pg.Problem, ...]:
    try:
        call()
    except pg.PgraphError as error:
        return error.problems
    return ()


@pytest.mark.parametrize(
    "change", [{}, {"mass": 1.0}, {"dof": 1}, {"joint": "revolute"}, {"name": "2"}, {"dof": None}]
)
def test_an_edit_that_changes_nothing_gives_the_same_model(change: dict):
    model = pg.Model.serial(3)
    assert model.edit("2", **change) is model


@given(st.lists(edits(6), max_size=8))
@settings(max_examples=60)
def test_edits_then_build_equals_build_from_json(steps: list[tuple[str, dict]]):
    model = pg.Model.serial(6)
    for name, change in steps:
        before = model.to_json()
        try:
            new = model.edit(name, **change)
        except pg.PgraphError:
            assert model.to_json() == before
            continue
        model = new
    again = pg.Model.from_json(model.to_json())
    assert again == model
    assert again.hash == model.hash
    one, other = pg.Topology.of(model), pg.Topology.of(again)
    assert one.pgraph.tolist() == other.pgraph.tolist()
    assert one.jdof.tolist() == other.jdof.tolist()


def test_a_new_dof_resets_the_joint_with_a_notice():
    ball = pg.Model.serial(2).edit("2", q=0.5, stiffness=3.0).edit("2", dof=3)
    assert ball.body("2").joint == "spherical"
    assert ball.body("2").q == (1.0, 0.0, 0.0, 0.0)
    (notice,) = ball.notices
    for fact in ("body '2'", "spherical", "3 DoF", "axes, motions, q, stiffness"):
        assert fact in notice
    assert ball.edit("2", mass=2.0).notices == ()


def test_forces_that_do_not_fit_a_new_joint_go():
    count = len(QUADRUPED.scenario("stance").forces)
    ball = QUADRUPED.edit("lumbar", dof=3, name="loin")
    assert all(f.body not in ("lumbar", "loin") for f in ball.scenario("stance").forces)
    assert len(ball.scenario("stance").forces) == count - 1
    assert any("scenario 'stance'" in x and "'lumbar'" in x for x in ball.notices)
    bent = QUADRUPED.edit("lumbar", joint="universal")  # its first turn takes the servo
    assert len(bent.scenario("stance").forces) == count


@pytest.mark.parametrize(
    ("dof", "joint", "nq"),
    [(0, "weld", 0), (1, "revolute", 1), (2, "universal", 2), (3, "spherical", 4),
     (4, "compound", 5), (5, "compound", 6), (6, "free", 7)],
)  # fmt: skip
def test_dof_picks_the_joint(dof: int, joint: str, nq: int):
    body = pg.Body(name="a", dof=dof)
    assert (body.joint, body.dof, len(body.q), len(body.v)) == (joint, dof, nq, dof)
    assert pg.Body(name="a", dof=np.int64(dof)) == body


def test_the_order_of_rows_is_the_order_of_left_children():
    model = pg.Model.serial(3).edit("3", parent="1")
    assert pg.Topology.of(model).names == ("1", "2", "3")
    assert pg.Topology.of(model.move("3", 1)).names == ("1", "3", "2")
    model = pg.Model.serial(2).add(pg.Body(name="x", parent="1"), after="1")
    assert [b.name for b in model.bodies] == ["1", "x", "2"]
    assert [b.name for b in model.add(pg.Body(name="y")).bodies] == ["1", "x", "2", "y"]


def test_gravity_follows_up_unless_it_was_chosen():
    model = pg.Model.serial(1)
    assert model.replace(up="y").gravity == (0.0, -9.81, 0.0)
    moon = model.replace(gravity=(0, 0, -1.62))
    assert moon.replace(up="y").gravity == (0.0, 0.0, -1.62)
    assert pg.Model(up="x").gravity == (-9.81, 0.0, 0.0)


def test_a_tip_is_the_centre_of_mass_unless_given():
    assert pg.Body(name="a", com=(1, 0, 0)).tip_point == (1.0, 0.0, 0.0)
    assert pg.Body(name="a", com=(1, 0, 0), tip=(0, 0, 2)).tip_point == (0.0, 0.0, 2.0)


@pytest.mark.parametrize(
    "moments",
    [
        (0, 0, 0),  # a point mass
        (1, 1, 2),  # a flat plate: equality
        (0, 1, 1),  # a thin rod
        (1e-15, 1e-15, 1e-15),
        (1e300, 1e300, 1e300),
        (1, 1, 2 + 1e-9),  # within the slack
    ],
)
def test_inertias_at_the_border_are_bodies(moments):
    inertia = np.diag(np.array(moments, dtype=float))
    assert pg.Body(name="a", inertia=inertia).inertia == tuple(map(tuple, inertia.tolist()))


@given(st.lists(st.tuples(FINITE, FINITE, FINITE, st.floats(0.01, 5)), min_size=1, max_size=6))
def test_every_cloud_of_points_has_a_valid_inertia(points):
    """Bodies made of point masses are bodies: no false refusal."""
    x, m = np.array([p[:3] for p in points]), np.array([p[3] for p in points])
    r = x - m @ x / m.sum()
    inertia = sum(w * ((p @ p) * np.eye(3) - np.outer(p, p)) for w, p in zip(m, r))
    assert np.array_equal(pg.Body(name="a", inertia=inertia).inertia, inertia)


JSON = st.recursive(
    st.none() | st.booleans() | st.integers() | st.floats() | st.text(max_size=4),
    lambda inner: st.lists(inner, max_size=3) | st.dictionaries(st.text(max_size=6), inner),
    max_leaves=6,
)
TREE = json.loads(QUADRUPED.edit("thorax", joint="universal").edit("lumbar", dof=4).to_json())


def places(value, path=()):
    """Every place in nested lists and dictionaries."""
    yield path
    items = value.items() if isinstance(value, dict) else enumerate(value)
    for key, item in items if isinstance(value, (dict, list)) else ():
        yield from places(item, (*path, key)) if isinstance(item, (dict, list)) else [(*path, key)]


@given(st.data())
@settings(max_examples=30)
def test_a_damaged_description_is_refused_by_its_part_or_valid(data):
    tree = json.loads(json.dumps(TREE))
    tree.pop("$schema"), tree.pop("schema_version")
    path = data.draw(st.sampled_from([p for p in places(tree) if p]))
    target = tree
    for key in path[:-1]:
        target = target[key]
    target[path[-1]] = data.draw(JSON)
    if problems := refused(lambda: pg.Model(**tree)):
        assert all(p.where and p.text and "\n" not in str(p) for p in problems)
