"""Constraints, contacts, forces and limits as parts of a model: defaults, edits, files."""

import math

import numpy as np
import pytest

import pgraph_core as pg
from pgraph_core.topology import loops_of

pytestmark = pytest.mark.quick

SPHERE = {"kind": "sphere", "radius": 0.1}


@pytest.fixture
def model():
    """Three bodies in a row with one part of every kind that names bodies."""
    return pg.Model(
        bodies=(
            pg.Body(name="a", limits=(-1, 1)),
            pg.Body(name="b", parent="a", joint="universal", limits=(None, (0, math.inf))),
            pg.Body(name="c", parent="b", shape=SPHERE, limit_restitution=0.5),
        ),
        ground=pg.Ground(slope=0.1, steps=(pg.Step(low=(0, 0), high=(1, 2), height=0.1),)),
        constraints=(
            pg.Constraint(name="gear", kind="gear", body="a", other="c", ratio=2),
            pg.Constraint(name="row", kind="velocity", coefficients={"b": (1, 0), "c": 2}),
            pg.Constraint(name="roll", kind="rolling", body="c"),
            pg.Constraint(name="turn", kind="motion", body="a", q_of_t=pg.Sine(amplitude=0.1)),
        ),
        contacts=(
            pg.Contact(name="floor", body="*"),
            pg.Contact(name="own", body="a", points=((0, 0, 1),), law="soft", stiffness=1e5),
        ),
        forces=(
            pg.Force(name="spring", kind="spring", body="a", other="c", stiffness=2),
            pg.Wrench(name="push", body="c", force={"t": (0, 1), "value": ((0, 0, 0), (1, 2, 3))}),
        ),
        scenarios=(
            pg.Scenario(
                name="s", constraints=("gear", "row"), contacts=("own",),
                forces=(pg.Torsion(name="twist", body="b", other="c", stiffness=1),),
            ),
        ),
    )  # fmt: skip


def test_a_written_model_comes_back(model):
    assert pg.Model.from_json(model.to_json()) == model
    assert '"stiffness"' not in model.to_json().split('"push"')[1].split("}")[0]


def test_a_new_name_is_followed_everywhere(model):
    renamed = model.edit("c", name="paw")
    assert renamed.constraints[0].other == "paw"
    assert renamed.constraints[1].coefficients == {"b": (1, 0), "paw": (2,)}
    assert [f.pair[1] for f in renamed.forces] == ["paw", "ground"]
    assert renamed.scenarios[0].forces[0].other == "paw"
    assert renamed.edit("a", name="x").contacts[1].body == "x"
    assert '"c"' not in renamed.to_json()
    assert model.edit("b", name="y").body("c").parent == "y"
    assert renamed.edit("paw", name="c") == model


def test_parts_go_with_their_body(model):
    left = model.remove("c")
    assert [c.name for c in left.constraints] == ["turn"]
    assert left.forces == left.scenarios[0].forces == ()
    assert left.scenarios[0].constraints == ()
    assert pg.Model.from_json(left.to_json()) == left
    gone = ("constraint 'gear'", "constraint 'row'", "constraint 'roll'", "force 'spring'")
    parts = zip(left.notices, (*gone, "force 'push'"), strict=True)
    assert all(text.startswith(part) for text, part in parts)


def test_a_new_joint_resets_limits_and_removes_parts_that_do_not_fit(model):
    edited = model.edit("a", dof=3)
    assert edited.body("a").limits == ()
    assert [c.name for c in edited.constraints] == ["row", "roll"]
    assert edited.scenarios[0].constraints == ("row",)
    assert any(text.startswith("constraint 'gear'") for text in edited.notices)
    assert [f.name for f in edited.forces] == ["spring", "push"]


def test_limits_are_pairs_a_motion_with_open_sides():
    assert pg.Body(name="a", limits=(0, 1)).limits == ((0, 1),)
    assert pg.Body(name="a", limits=(-math.inf, math.inf)).limits == ()
    both = pg.Body(name="a", joint="universal", limits=(-1, 1))
    assert both.limits == ((-1, 1), (-1, 1))
    assert pg.Body(name="a", joint="universal", limits=(None, (0, math.inf))).limits == (
        None,
        (0, None),
    )


def test_the_ground_rises_uphill():
    level = pg.Model(up="y")
    assert level.ground_normal == (0, 1, 0)
    tilted = pg.Model(up="y", ground={"slope": 0.1, "uphill": (0, 5, 2)})
    assert tilted.ground_normal == pytest.approx((0, math.cos(0.1), -math.sin(0.1)))


def test_a_second_parent_is_a_loop_cut_at_a_joint_like_the_bodys_own():
    model = pg.Model.serial(3).edit("3", parent=("2", "ground"))
    assert model.body("3").parent == "2"
    (cut,) = model.constraints
    assert (cut.kind, cut.body, cut.other, cut.axis) == ("revolute", "3", "ground", (0, 1, 0))
    (notice,) = model.notices
    assert all(x in notice for x in ("body '3'", "'3-ground'", "at [0.6, 0.0, 0.0] of 'ground'"))
    assert [tuple(x) for x in loops_of(model, pg.Topology.of(model))] == [
        ("3-ground", "revolute", 3, 0)
    ]


@pytest.mark.parametrize(
    ("joint", "kind"),
    [
        *((same, same) for same in ("weld", "revolute", "prismatic", "cylindrical", "universal")),
        ("spherical", "point"),
    ],
)
def test_a_cut_joint_leaves_a_constraint_of_its_kind(joint, kind):
    model = pg.Model.serial(3).close_loop("3", "1", joint=joint, name="cut", point=(0, 0, 1))
    assert [(c.name, c.kind, c.point) for c in model.constraints] == [("cut", kind, (0, 0, 1))]


@pytest.mark.parametrize("axes", [None, ((1, 0, 0), (0, 0, 1))])
def test_a_loop_is_cut_at_a_cross_whose_axes_are_the_usual_ones(axes):
    """Others do not say which of them the second parent has."""
    model = pg.Model.serial(3).edit("3", joint="universal", **({"axes": axes} if axes else {}))
    if axes is None:
        assert model.edit("3", parent=("2", "ground")).constraints[0].kind == "universal"
        return
    with pytest.raises(pg.ModelError, match=r"'3', axes.*other_axis"):
        model.edit("3", parent=("2", "ground"))


@pytest.mark.parametrize("length", [11, 12, 13])
def test_a_cycle_of_parents_is_named_whole_up_to_twelve_bodies(length):
    names = [f"b{k}" for k in range(length)]
    with pytest.raises(pg.ModelError) as refused:
        pg.Model(bodies=[pg.Body(name=x, parent=y) for x, y in zip(names, names[1:] + names[:1])])
    way = [*names, "b0"] if length <= 12 else [*names[:12], "..."]
    assert f": {' -> '.join(way)};" in str(refused.value)


def test_a_copy_with_another_joint_has_none_of_the_old_one():
    old = pg.Body(name="a", mass=2.0, q=0.3, v=1.0, limits=(-1, 1), damping=0.5)
    assert old.model_copy(update={"joint": "spherical"}) == pg.Body(
        name="a", mass=2.0, joint="spherical"
    )


@pytest.mark.parametrize(("force", "stays"), [
    (pg.Motor(name="f", coefficients={"a": (1, 0, 0)}), True),
    (pg.SpeedServo(name="f", coefficients={"a": (1, 0, 0)}, kd=1.0), True),
    (pg.Servo(name="f", coefficients={"a": (1, 0, 0)}, kp=1.0), False),
    (pg.Tendon(name="f", coefficients={"a": (1, 0, 0)}, stiffness=1.0), False),
])  # fmt: skip
def test_forces_of_speeds_alone_stay_where_a_joint_becomes_a_ball(force, stays):
    """A ball has speeds about its axes, but no angles."""
    model = pg.Model(bodies=[pg.Body(name="a", joint="planar")], forces=[force])
    assert model.edit("a", joint="spherical").forces == ((force,) if stays else ())


ARM = pg.Body(name="arm", mass=1.2, axes=(0, 1, 0))
SPRING = pg.Spring(name="s", body="arm", stiffness=5.0)


@pytest.mark.parametrize(
    ("part", "fields"),
    [
        (ARM, {"mass": -5}),
        (ARM, {"rotation": (3.0, 0, 0, 0)}),
        (SPRING, {"stiffness": -5.0}),
        (pg.Contact(name="s", body="b"), {"law": "sfot"}),
        (pg.Shape(**SPHERE), {"radius": -1.0}),
        (pg.Model(bodies=[ARM]), {"bodies": (ARM, ARM)}),
    ],
)
def test_no_part_is_made_without_validation(part, fields):
    known = {name: getattr(part, name) for name in type(part).model_fields}
    field = "name" if "bodies" in fields else next(iter(fields))
    for make in (
        lambda: part.model_copy(update=fields),
        lambda: type(part).model_construct(**{**known, **fields}),
    ):
        with pytest.raises(pg.ModelError, match=field):
            make()


def test_names_are_text_and_coordinates_whole_numbers():
    for given in (b"x", bytearray(b"x"), 3):
        with pytest.raises(pg.ModelError, match="name"):
            pg.Body(name=given)
    assert pg.Motor(name="m", body="a", coordinate=np.int64(2)).coordinate == 2
