"""Several shapes per body, and the fields that follow from them."""

import json
from typing import Any

import numpy as np
import pytest
import trimesh

import pgraph_core as pg
from pgraph_core.show import shapes

pytestmark = pytest.mark.quick

BOX = {"kind": "box", "size": (1.0, 0.2, 0.2), "position": (0.5, 0.0, 0.0)}
BALL = {"kind": "sphere", "radius": 0.3, "position": (1.0, 0.0, 0.0)}


def body(**fields):
    return pg.Body(**{"name": "arm", "inertia": (0.01,) * 3, **fields})


def version(model: pg.Model) -> int:
    return json.loads(model.to_json())["schema_version"]


def test_one_shape_is_the_first_of_the_shapes():
    one = body(shape=BOX)
    assert one.shapes == (pg.Shape(**BOX),) == (one.shape,)
    assert one == body(shapes=[BOX])
    two = body(shapes=[BOX, BALL])
    assert two.shape == pg.Shape(**BOX)
    assert (body().shape, body().shapes) == (None, ())
    model = pg.Model(bodies=[two])
    assert model.edit("arm", shape=BALL).body("arm") == body(shape=BALL)
    assert model.edit("arm", shape=None).body("arm") == body()
    assert model.edit("arm", shapes=[BALL, BOX]).body("arm").shape == pg.Shape(**BALL)
    assert model.edit("arm", mass=2.0).body("arm").shapes == two.shapes


def test_a_file_is_of_schema_1_unless_it_needs_more():
    plain = pg.Model(bodies=[body(shape=BOX)])
    assert version(plain) == 1
    assert not {"shapes", "density", "derived", "role"} & set(plain.to_json().split('"'))
    for fields in (
        {"shapes": [BOX, BALL]}, {"shape": {**BOX, "colour": "#ff8000"}},
        {"shape": {**BOX, "role": "visual"}}, {"shape": BOX, "density": 9.0, "derived": ["mass"]},
        {"shape": BOX, "derived": ["tip"]},
    ):  # fmt: skip
        model = pg.Model(bodies=[body(**fields)])
        assert version(model) == 2
        assert pg.Model.from_json(model.to_json()) == model


def test_a_formula_in_a_shape_is_saved_with_several():
    bodies = [{"name": "arm", "shapes": [{**BOX}, {**BALL, "radius": "=r/2"}]}]
    model = pg.Model(parameters={"r": 0.8}, bodies=bodies)
    assert model.body("arm").shapes[1].radius == 0.4
    again = pg.Model.from_json(model.to_json()).replace(parameters={"r": 1.0})
    assert again.body("arm").shapes[1].radius == 0.5


def test_shapes_touch_and_are_drawn_by_their_role():
    two = body(
        joint="free", shapes=[{**BOX, "role": "visual"}, {**BALL, "role": "collision"}],
        q=(0, 0, 1, 1, 0, 0, 0), com=(1, 0, 0),
    )  # fmt: skip
    assert [piece.kind for piece in shapes.pieces(two, [])] == ["box"]
    model = pg.Model(bodies=[two], contacts=[pg.Contact(name="floor", body="arm")])
    run = pg.simulate(pg.Mechanism(model), t_end=1.0)
    assert run.status.ok, run.message
    assert run.q[-1, 2] == pytest.approx(0.3, abs=1e-3)  # rests on the ball
    with pytest.raises(pg.ModelError, match="'arm'"):
        model.edit("arm", shape={**BOX, "role": "visual"})


def test_every_shape_that_touches_carries():
    """A table on two balls stands level: each carries half the weight."""
    balls = [{"kind": "sphere", "radius": 0.1, "position": (x, 0, 0)} for x in (-1, 1)]
    table = body(
        joint="planar", axes=[(1, 0, 0), (0, 0, 1), (0, 1, 0)], shapes=balls, q=(0, 0.1, 0)
    )
    model = pg.Model(bodies=[table], contacts=[pg.Contact(name="floor", body="arm")])
    run = pg.simulate(pg.Mechanism(model), t_end=0.5)
    np.testing.assert_allclose(run.q[-1], (0, 0.1, 0), atol=1e-4)
    assert run.contact_force["floor"][-1][5] == pytest.approx(9.81, rel=1e-3)


def test_mass_follows_from_shapes_and_density_until_it_is_given():
    model = pg.Model(
        bodies=[
            pg.Body(
                name="arm", shape=BOX, density=1000.0, derived=["mass", "com", "inertia", "tip"]
            )
        ]
    )
    arm = model.body("arm")
    assert arm.mass == pytest.approx(40.0)
    np.testing.assert_allclose((arm.com, arm.tip), ((0.5, 0, 0), (1, 0, 0)), atol=1e-15)
    np.testing.assert_allclose(np.diag(arm.inertia), 40 / 12 * np.array((0.08, 1.04, 1.04)))
    twice = model.edit("arm", density=2000.0).body("arm")
    assert twice.mass == pytest.approx(80.0)
    np.testing.assert_allclose(twice.inertia, 2 * np.array(arm.inertia))
    wider = model.edit("arm", shape={**BOX, "size": (2.0, 0.2, 0.2)}).body("arm")
    assert wider.mass == pytest.approx(80.0)
    heavy = model.edit("arm", mass=1200.0).body("arm")
    assert heavy.derived == ("com", "inertia", "tip")
    np.testing.assert_allclose(heavy.inertia, 30 * np.array(arm.inertia))
    assert pg.Model.from_json(model.to_json()) == model
    through = pg.Mechanism(model).edit("arm", mass=1200.0).model
    assert through.body("arm") == heavy


@pytest.mark.parametrize(
    ("fields", "facts"),
    [
        ({"derived": ["mass"]}, ["derived"]), ({"shape": BOX, "derived": ["mass"]}, ["density"]),
        ({"shape": BOX, "derived": ["weight"]}, ["derived", "'mass', 'com'", "weight"]),
        ({"shape": {"kind": "sphere", "size": [0.04, 0.1]}}, ["shape", "radius"]),
        ({"shapes": [BOX, {"kind": "sphere"}]}, ["shapes", "radius"]),
        ({"shape": {**BOX, "role": "seen"}}, ["shape", "'collision'", "'seen'"]),
        ({"shape": {**BOX, "colour": "red"}}, ["shape", "colour", "#rrggbb", "'red'"]),
        ({"shape": {**BOX, "colour": (2, 0, 0)}}, ["shape", "colour", "0 to 1"]),
        ({"density": -1}, ["density", "> 0", "-1"]), ({"density": 9.0}, ["density", "derived"]),
        ({"shape": BOX, "density": 900.0, "derived": ["tip"]}, ["density", "'mass'"]),
        ({"shape": BALL, "shapes": [BOX]}, ["shape", "shapes"]),
        ({"shape": {**BOX, "radius": 1.0}}, ["shape", "box", "radius", "size"]),
        ({"shape": {**BALL, "length": 1.0}}, ["shape", "sphere", "length", "radius"]),
        ({"mass": 3.0, "shape": BOX, "density": 900.0, "derived": ["mass"]},
         ["mass", "36", "3", "derived"]),
    ],
)  # fmt: skip
def test_wrong_shapes_are_refused(fields, facts):
    with pytest.raises(pg.ModelError) as refused:
        body(**fields)
    field, *facts = facts
    assert f"body 'arm', {field}" in str(refused.value)
    assert all(fact in str(refused.value) for fact in facts)


def test_a_copy_of_a_shape_is_validated_where_a_body_takes_it():
    ball = pg.Shape(kind="sphere", radius=0.1)
    assert pg.Body(name="a", shape=ball).shape is ball
    bad = ball.unchecked_copy({"rotation": (0.0, 0.0, 0.0, 0.0)})
    with pytest.raises(pg.ModelError, match="rotation"):
        pg.Body(name="a", shape=bad)


@pytest.mark.parametrize(("scale", "refused"), [
    (0, True), (-1, True), ((2, 0, 1), True), ((0, 0, 0), True), ((2, -1, 1), False), (3, False),
])  # fmt: skip
def test_no_factor_of_a_mesh_is_zero_but_three_may_mirror_it(scale, refused):
    fields: Any = {"kind": "mesh", "file": "a.stl", "scale": scale}
    if not refused:
        assert pg.Shape(**fields).scale == scale
        return
    with pytest.raises(pg.ModelError, match="scale"):
        pg.Shape(**fields)


@pytest.mark.parametrize("kinds", ["box", "mesh", "mesh box", "box box"])
def test_a_mass_that_contradicts_its_shapes_is_refused_unless_a_file_may_have_changed(
    kinds, tmp_path
):
    trimesh.creation.box((1, 1, 1)).export(tmp_path / "a.stl")
    own: Any = {"box": {"size": (1, 1, 1)}, "mesh": {"file": str(tmp_path / "a.stl")}}
    given = [{"kind": kind, **own[kind]} for kind in kinds.split()]
    fields: Any = {"name": "a", "shapes": given, "density": 1.0, "derived": ("mass",), "mass": 7.0}
    if "mesh" in kinds:
        assert pg.Body(**fields).mass == pytest.approx(len(given))
        return
    with pytest.raises(pg.ModelError, match="mass: follows from the shapes"):
        pg.Body(**fields)
