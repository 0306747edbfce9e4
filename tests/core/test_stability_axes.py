"""Axes of the stability map: how each changes a model, and models to which it does not apply."""

from __future__ import annotations

import numpy as np
import pytest

import pgraph_core as pg
import pgraph_models
from pgraph_core.study.axes import AXES, first_axis
from pgraph_core.study.rescaling import rescaled
from pgraph_core.study.stability import in_scenario

from .test_cases import DOWN, mass

pytestmark = pytest.mark.quick


def built_in(name):
    return pg.Model.load(pgraph_models.path(name))


def sprung():
    spring = pg.Force(name="s", kind="spring", body="b", stiffness=50.0, rest=0.2)
    bodies = (mass("a", stiffness=200.0, q=(0.1,)), mass("b", "a", above=1.0, v=(2.0,)))
    return pg.Model(bodies=bodies, forces=(spring,), **DOWN)


def touching():
    contact = pg.Contact(name="c", body="a", law="soft", points=((0, 0, 0),))
    return pg.Model(bodies=(pg.Body(name="a", joint="free"),), contacts=(contact,))


MODELS = {
    "contact_stiffness": touching,
    "friction": touching,
    "inertia": lambda: built_in("quadruped"),
    "redundancy": lambda: built_in("four_bar"),
    "singularity": lambda: built_in("four_bar"),
}


@pytest.mark.parametrize("name", AXES)
def test_every_usual_value_makes_a_valid_model_and_leaves_the_old_one(name):
    model = MODELS.get(name, sprung)()
    before = model.to_json()
    for value in AXES[name].values:
        made = AXES[name].applied(model, value)
        assert isinstance(made, pg.Model)
        if len(made.bodies) < 300:
            pg.Mechanism(made)
    assert model.to_json() == before


@pytest.mark.parametrize(
    "name", [n for n in AXES if n not in ("step", "singularity", "chain_length", "speed")]
)
def test_an_axis_that_a_model_has_not_is_refused(name):
    model = pg.Model(bodies=(pg.Body(name="a", joint="weld", inertia=np.zeros((3, 3))),))
    if name.endswith("_scale"):
        motion = pg.Constraint(name="m", kind="motion", body="a", q_of_t=pg.Sine())
        model = pg.Model(bodies=(pg.Body(name="a"),), constraints=(motion,))
    with pytest.raises(pg.InputError):
        pg.stability_map(model, axis=name, methods=["rk4"], steps=[1e-2])


def test_axes_change_their_numbers_and_keep_the_rest():
    """Forces at the start, critical damping, the mass and reach of a chain, ratios of masses."""
    made = AXES["stiffness"].applied(sprung(), 2e6)
    a = made.body("a")
    assert a.stiffness == (2e6,)
    assert a.stiffness[0] * a.q[0] == pytest.approx(200.0 * 0.1)
    assert made.forces[0].stiffness == pytest.approx(50.0 * 1e4)
    made = AXES["mass_ratio"].applied(sprung(), 1e-9)
    assert made.body("b").mass / made.body("a").mass == pytest.approx(1e-9)
    model = pg.Model(bodies=(mass("a", stiffness=200.0),), gravity=(0, 0, 0))
    made = AXES["damping_ratio"].applied(model, 1.0)
    assert made.body("a").damping == pytest.approx((2 * np.sqrt(200.0),))
    model = pg.Model(bodies=(mass("a", tip=(0, -1, 0)),), **DOWN)
    made = AXES["chain_length"].applied(model, 50)
    assert sum(b.mass for b in made.bodies) == pytest.approx(1.0)
    position, _ = pg.Mechanism(made).pose(np.zeros(50), "50")
    assert position[1] == pytest.approx(-0.98)
    own = AXES["chain_length"].own
    assert own(model) == 1.0
    assert own(model.edit("a", stiffness=2.0)) is None  # a chain would lose it
    assert own(model.add(mass("b", parent="a"))) is None


@pytest.mark.parametrize("axis", ["mass_ratio", "inertia", "length_scale", "mass_scale"])
def test_numbers_that_follow_from_shapes_are_varied_like_given_ones(axis):
    steel = {
        "shape": pg.Shape(kind="box", size=(1.0, 0.1, 0.1)),
        "density": 7850.0,
        "derived": ("mass", "com", "inertia"),
    }
    bodies = (pg.Body(name="a", **steel), pg.Body(name="b", parent="a", link=(1, 0, 0), **steel))
    model = plain = pg.Model(bodies=bodies)
    for body in bodies:
        numbers = {"mass": body.mass, "com": body.com, "inertia": body.inertia}
        plain = plain.edit(body.name, derived=(), density=None, **numbers)
    derived, own = (AXES[axis].applied(m, 1e-9).body("b") for m in (model, plain))
    assert derived.mass == own.mass > 0
    assert (derived.com, derived.inertia) == (own.com, own.inertia)
    assert first_axis(model) == first_axis(plain) == "mass_ratio"


@pytest.mark.parametrize("name", [n for n in AXES if n.endswith("_scale")])
def test_no_threshold_has_a_unit(name):
    """The same mechanism in other units: the same verdicts, errors alike."""
    top = pg.Body(
        name="top", joint="spherical", mass=2.0, com=(0.1, 0, 0.4),
        inertia=np.diag([0.2, 0.3, 0.1]), v=(1.0, 0.0, 6.0),
    )  # fmt: skip
    bob = mass("bob", "top", damping=0.01, stiffness=2.0)
    options = {"values": [1e-9, 1.0, 1e9], "methods": ["rk4"], "steps": [1e-2], "t_end": 0.3}
    found = pg.stability_map(pg.Model(bodies=(top, bob), **DOWN), axis=name, **options)
    errors = [cell.error for cell in found.cells]
    assert len({cell.status for cell in found.cells}) == 1
    np.testing.assert_allclose(errors, errors[1], rtol=1e-3)


@pytest.mark.parametrize("factors", [(3.0, 1.0, 1.0), (1.0, 5.0, 1.0), (1.0, 1.0, 7.0)])
def test_a_rescaled_model_moves_the_same(factors):
    """Angles as they were, slides and times as many times as large: dimensional analysis."""
    length, weight, time = factors
    slide = pg.Body(
        name="s", joint="prismatic", axes=((0, 1, 0),), mass=2.0, stiffness=30.0, damping=0.4,
        rest=0.1, v=(0.5,),
    )  # fmt: skip
    forces = (
        pg.Force(name="m", kind="motor", body="s", torque=0.7),
        pg.Force(name="servo", kind="servo", body="a", kp=3.0, kd=0.2, target=0.4),
        pg.Force(name="spring", kind="spring", body="a", stiffness=20.0, damping=0.1, rest=0.3),
        pg.Force(name="push", kind="wrench", body="a", force=(1.0, 2.0, 0.0)),
    )
    model = pg.Model(bodies=(slide, mass("a", "s", damping=0.05)), forces=forces, **DOWN)
    scaled = rescaled(model, length=length, mass=weight, time=time)
    runs = [
        pg.simulate(pg.Mechanism(m), t_end=0.5 * t, step=0.01 * t, method="rk4", estimate=False)
        for m, t in ((model, 1.0), (scaled, time))
    ]
    np.testing.assert_allclose(runs[1].q, runs[0].q * (length, 1.0), rtol=1e-10, atol=1e-12)
    energy = runs[0].energy * weight * (length / time) ** 2
    np.testing.assert_allclose(runs[1].energy, energy, rtol=1e-9)




def test_every_shape_of_a_body_is_rescaled():
    box = {"kind": "box", "size": (0.1, 0.2, 0.4), "position": (0.1, 0.0, 0.2)}
    ball = {"kind": "sphere", "radius": 0.3, "role": "collision", "colour": "#ff0000"}
    rod = {"kind": "capsule", "radius": 0.1, "length": 0.5, "role": "visual"}
    body = pg.Body(
        name="a", shapes=(box, ball, rod), density=500, derived=("mass", "com", "inertia", "tip")
    )
    scaled = rescaled(pg.Model(bodies=[body]), length=2.0, mass=3.0).body("a")
    assert [s.size or (s.radius, s.length) for s in scaled.shapes] == [
        (0.2, 0.4, 0.8), (0.6, None), (0.2, 1.0),
    ]  # fmt: skip
    assert scaled.shape == scaled.shapes[0]
    assert scaled.shapes[0].position == (0.2, 0.0, 0.4)
    assert [s.role for s in scaled.shapes] == ["both", "collision", "visual"]
    assert scaled.shapes[1].colour == (1.0, 0.0, 0.0)
    assert scaled.mass == pytest.approx(3 * body.mass, rel=1e-14)  # from density and volume
    np.testing.assert_allclose(scaled.inertia, 12 * np.array(body.inertia), rtol=1e-13, atol=1e-13)
