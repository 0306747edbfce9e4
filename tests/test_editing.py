"""Edits of several rows: duplicate, mirror, move, remove, edit_all."""

import numpy as np
import pytest

import pgraph_core as pg
import pgraph_models
from pgraph_core.model.copies import free_name, other_side

pytestmark = pytest.mark.quick
SERIAL = pg.Model.serial(3)


def names(model: pg.Model) -> list[str]:
    return [body.name for body in model.bodies]


def test_copies_have_free_names_and_mirrored_ones_those_of_the_other_side():
    for name, taken, free in (
        ("femur", ["femur_2"], "femur"),
        ("femur_2", ["femur", "femur_2"], "femur_3"),
        ("3", ["1", "2", "3"], "4"),
        ("leg 2", ["leg 2"], "leg 2_2"),
        ("9" * 5000, ["9" * 5000], "9" * 5000 + "_2"),
    ):
        assert free_name(name, taken) == free
    for names in (("left_femur", "right_femur"), ("RightPaw", "LeftPaw"), ("hip.R", "hip.L")):
        assert [other_side(name) for name in names] == [*reversed(names)]
    assert other_side("roll") == "roll"


def test_a_duplicated_branch_acts_as_its_original():
    model = pg.Model.load(pgraph_models.path("quadruped")).duplicate("left_femur")
    assert names(model)[13:16] == ["left_femur_2", "left_tibia_2", "left_hind_paw_2"]
    assert model.body("left_tibia_2").parent == "left_femur_2"
    assert model.body("left_femur_2").parent == "pelvis"
    assert "left_hind_paw_2" in [c.name for c in model.constraints]
    kinds = [(f.kind, f.body) for f in model.scenario("stance").forces]
    assert ("servo", "left_tibia") in kinds
    for kind in [kind for kind, body in kinds if body == "left_tibia"]:
        assert (kind, "left_tibia_2") in kinds
    assert pg.Model.from_json(model.to_json()) == model


def test_two_equal_trees_have_the_energy_of_one_twice():
    both, one = pg.Mechanism(SERIAL.duplicate("1")), pg.Mechanism(SERIAL)
    q, v = np.array([0.3, -0.2, 0.9]), np.array([1.0, 2.0, -3.0])
    twice = both.energy(np.tile(q, 2), np.tile(v, 2))
    assert twice == pytest.approx(2 * np.array(one.energy(q, v)), rel=1e-14)
    assert np.count_nonzero(both.mass_matrix(np.tile(q, 2))[:3, 3:]) == 0


def test_bodies_are_duplicated_without_their_children():
    model = pg.Model.serial(4).duplicate("2", subtree=False)
    assert names(model) == ["1", "2", "5", "3", "4"]
    assert model.body("5").parent == "1"
    several = pg.Model.serial(4).duplicate(["2", "3"], subtree=False)
    assert names(several) == ["1", "2", "3", "5", "6", "4"]
    assert several.body("6").parent == "5"


def test_parts_without_a_mirror_image_are_noticed():
    model = SERIAL.edit("3", joint="spherical").edit("2", rotation=(0.6, 0.8, 0, 0))
    model = model.replace(
        constraints=(
            pg.Distance(name="rod", body="3", other_point=(0, 0, 1)),
            pg.Point(name="pin", body="3"),
        ),
        forces=(
            pg.Motor(name="motor", body="3", coordinate=0, torque=1.0),
            pg.Wrench(name="wind", body="3", force=(1, 0, 0)),
        ),
    )
    mirrored = model.mirror("3", plane="y")
    assert [c.name for c in mirrored.constraints] == ["rod", "pin", "pin_2"]
    parts = ("constraint 'rod'", "force 'motor'", "force 'wind'")
    assert [text.startswith(part) for text, part in zip(mirrored.notices, parts, strict=True)]


def test_several_rows_move_together():
    model = pg.Model.serial(5)
    assert names(model.move(["4", "2"], 0)) == ["2", "4", "1", "3", "5"]
    assert names(model.move(["1", "2"], 3)) == ["3", "4", "5", "1", "2"]


def test_children_of_several_removed_bodies_stay_where_they_are():
    turn = (np.sqrt(0.5), 0.0, 0.0, np.sqrt(0.5))  # 90 degrees about z
    model = pg.Model.serial(4).edit("2", rotation=turn)
    left = model.remove(["3", "2"])
    assert names(left) == ["1", "4"]
    one_by_one = model.remove("2").remove("3").body("4")
    assert left.body("4").parent == one_by_one.parent == "1"
    # 3 was at (0.2, 0, 0) in a frame turned by 90 degrees at (0.2, 0, 0)
    assert model.remove("2").body("3").link == pytest.approx((0.2, 0.2, 0.0), abs=1e-15)
    assert model.remove("2").body("3").rotation == pytest.approx(turn)
    assert np.allclose(left.body("4").link, one_by_one.link, atol=1e-15)
    assert np.allclose(left.body("4").rotation, one_by_one.rotation, atol=1e-15)
    assert names(model.remove(["2", "4"], children="delete")) == ["1"]


def test_one_edit_changes_several_rows_at_once():
    """Names are exchanged, a tree is turned round, and joints are changed."""
    model = SERIAL.replace(constraints=(pg.Point(name="pin", body="3", other="1"),))
    swapped = model.edit_all({"1": {"name": "3"}, "3": {"name": "1"}})
    rows = [(b.name, b.parent) for b in swapped.bodies]
    assert rows == [("3", "ground"), ("2", "3"), ("1", "2")]
    assert (swapped.constraints[0].body, swapped.constraints[0].other) == ("1", "3")
    turned = model.edit_all({"1": {"parent": "2"}, "2": {"parent": "3"}, "3": {"parent": "ground"}})
    assert [b.parent for b in turned.bodies] == ["2", "3", "ground"]
    joints = SERIAL.edit_all({"1": {"dof": 3}, "2": {"dof": 0}})
    assert [b.joint for b in joints.bodies] == ["spherical", "weld", "revolute"]
    assert len(joints.notices) == 2


def test_other_motions_of_a_compound_joint_are_another_joint():
    slide, turn = ("translate", (1.0, 0.0, 0.0)), ("rotate", (0.0, 0.0, 1.0))
    body = pg.Body(
        name="a", joint="compound", motions=(turn, slide), q=(0.3, 0.2), v=(1, 2), damping=(1, 2)
    )
    drive = pg.Motor(name="drive", body="a", coordinate=1, torque=1.0)
    model = pg.Model(bodies=(body,), forces=(drive,))
    other = model.edit("a", motions=(turn,))
    assert (other.body("a").q, other.body("a").v, other.body("a").damping) == ((0,), (0,), (0,))
    reset, gone = other.notices
    assert [x for x in ("body 'a'", "1 DoF", "q, v, damping") if x not in reset] == []
    assert "force 'drive'" in gone
    assert model.edit("a", motions=(slide, turn)).body("a").q == (0.0, 0.0)
    given = model.edit("a", motions=(turn, slide, ("ball", (0, 0, 1))), q=(1, 2, 1, 0, 0, 0))
    assert given.body("a").q[:2] == (1.0, 2.0)
    assert given.notices[0].endswith("v, damping")
    turned = model.edit("a", motions=(("rotate", (0, 1, 0)), slide))
    assert (turned.body("a").q, turned.notices) == ((0.3, 0.2), ())


LINKS = pg.Model(
    bodies=[
        pg.Body(name="upper", axes=(0, 1, 0), tip=(0, 0, -1)),
        pg.Body(name="lower", parent="upper", link=(0, 0, -1), axes=(0, 1, 0), inertia=(1, 1, 1)),
    ]
)


@pytest.mark.parametrize(
    ("joint", "axes"),
    [
        ({"joint": "prismatic"}, ((0, 1, 0),)),
        ({"joint": "prismatic", "axes": (1, 0, 0)}, ((1, 0, 0),)),
        ({"joint": "spherical"}, ()),
    ],
)
def test_another_joint_keeps_chosen_axes_where_it_takes_as_many(joint, axes):
    new = LINKS.edit("lower", **joint)
    assert new["lower"].axes == axes
    assert any("axes" in text for text in new.notices) == (axes == ())
    with pytest.raises(pg.ModelError, match="joint"):
        LINKS.edit("lower", joint="helical")


def test_a_tip_that_moves_alone_and_a_child_that_is_left_are_noticed():
    told = LINKS.edit("upper", tip=(0, 0, -2)).notices
    assert len(told) == 1
    assert "'lower'" in told[0]
    assert LINKS.edit("upper", tip=(0, 0, -1)).notices == ()
    longer = LINKS.edit("upper", tip=(0, 0, -2))
    assert longer.edit("lower", mass=2.0).told == told
    assert longer.edit("lower", link=(0, 0, -2)).told == ()  # it hangs at the tip again
    assert LINKS.edit("lower", tip=(0, 0, -2)).notices == ()
    (hung,) = LINKS.remove("upper").notices
    assert "body 'lower'" in hung
    assert LINKS.remove("upper", children="delete").notices == ()


def test_a_run_repeats_the_notices_of_edits():
    model = LINKS.edit("lower", dof=3).edit("upper", mass=1.5).replace(name="other")
    assert model.notices == ()
    run = pg.simulate(model, t_end=0.01, estimate=False)
    assert sum("body 'lower'" in text for text in run.notices) == 1
    assert not pg.simulate(LINKS, t_end=0.01, estimate=False).notices


def test_formulas_of_a_mirrored_shape_follow_their_numbers():
    """A scale becomes three, of which one is negative, and a height stands at another place."""
    ground = pg.Shape("heightfield", size=(1, 1, 1), heights=[[0, 1, 3], [4, 5, 6]])
    field = pg.Body(name="left_field", shape=ground, mass=1.0)
    solid = {"mass": 1.0, "com": (0, 0, 0), "inertia": np.eye(3)}
    stone = pg.Body(name="left_stone", shape=pg.Shape("mesh", file="stone.stl"), **solid)
    model = pg.Model(bodies=[field, stone], parameters={"a": 1.0})
    model = model.edit("left_stone", shape={**stone.shape.model_dump(), "scale": "=a"})
    heights = [[0, "=a", 3], [4, 5, "=6*a"]]
    model = model.edit("left_field", shape={**ground.model_dump(), "heights": heights})
    for name, plane in (("left_stone", "x"), ("left_field", "y")):
        model = model.mirror(name, plane)
    later = model.replace(parameters={"a": 2.0})
    assert later.body("right_stone").shape.scale == (-2.0, 2.0, 2.0)
    assert later.body("right_field").shape.heights == ((3.0, 2.0, 0.0), (12.0, 5.0, 4.0))
