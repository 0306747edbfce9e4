"""Bodies without inertia: they have that of their shapes, or are point masses at their com."""

import json
from typing import Any

import numpy as np
import pytest

import pgraph_core as pg

pytestmark = pytest.mark.quick

BOX = {"kind": "box", "size": (1.0, 0.2, 0.2), "position": (0.5, 0.0, 0.0)}
MOMENTS = np.array((0.08, 1.04, 1.04)) / 12  # of 1 kg


def model(**fields):
    return pg.Model([pg.Body(name="a", **fields)])


@pytest.mark.parametrize(("mass", "length"), [(1e-3, 0.01), (1.0, 0.5), (1e4, 20.0)])
def test_a_mass_at_a_distance_swings_as_a_mathematical_pendulum(mass, length):
    swing = model(axes="y", mass=mass, com=(0, 0, -length))
    np.testing.assert_allclose(swing.linearise().frequencies, [np.sqrt(9.81 / length)], rtol=1e-12)
    assert swing.doubts == ()


@pytest.mark.parametrize(
    "call",
    [
        lambda m: pg.simulate(m, t_end=0.1),
        lambda m: pg.simulate(m, t_end=0.1, method="radau5", estimate=False),
        lambda m: pg.simulate(m, t_end=0.1, wrt=["bodies.a.mass"]),
        lambda m: m.linearise(), pg.Stepper, lambda m: pg.BatchStepper(m, size=2),
        lambda m: pg.Mechanism(m).forward_dynamics(*pg.Mechanism(m).home()),
        lambda m: pg.Mechanism(m).forward_derivatives(*pg.Mechanism(m).home()),
    ],
)  # fmt: skip
@pytest.mark.parametrize(
    ("fields", "facts"),
    [
        ({}, ["inertia", "[0.0, 0.0, 1.0]", "com", "shape", "1 kg"]),
        ({"axes": (0, 1, 0), "com": (0, 2, 0)}, ["inertia", "[0.0, 1.0, 0.0]", "[0.0, 2.0, 0.0]"]),
        ({"joint": "free"}, ["inertia", "free", "shape"]),
        ({"joint": "spherical", "com": (0, 0, -1)}, ["inertia", "spherical"]),
        ({"joint": "prismatic", "mass": 0}, ["mass", "[0.0, 0.0, 1.0]"]),
    ],
)
def test_a_joint_that_moves_no_inertia_is_refused_by_its_body_and_axis(call, fields, facts):
    with pytest.raises(pg.InputError, match="body 'a'") as refused:
        call(model(**fields))
    assert [fact for fact in facts if fact not in str(refused.value)] == []


@pytest.mark.parametrize(
    "remedy",
    [
        {"inertia": (1, 1, 1)}, {"com": (1, 0, 0)}, {"armature": 0.1},
        {"shape": {"kind": "sphere", "radius": 0.1}},
    ],
)  # fmt: skip
def test_the_remedies_of_a_point_mass_on_its_axis_work(remedy):
    assert pg.simulate(model(**remedy), t_end=0.01).status.ok


def test_a_sweep_goes_on_where_a_point_is_refused():
    found = pg.sweep(model(axes="y"), {"bodies.a.com.0": [1.0, 0.0]}, "final a", t_end=0.1)
    assert found.status == ("DONE", "REFUSED")
    assert "'a'" in found.reason[1]


def test_inertia_and_centre_follow_from_shapes_with_the_mass_of_the_body():
    arm = model(mass=2.0, shape=BOX)
    for mass, changed in ((2.0, arm), (6.0, arm.edit("a", mass=6.0))):
        body = changed.body("a")
        np.testing.assert_allclose(np.diag(body.inertia), mass * MOMENTS, rtol=1e-12)
        np.testing.assert_allclose(body.com, (0.5, 0, 0), rtol=1e-12)
    given = model(shape=BOX, com=(0, 0, 1)).body("a")
    assert given.com == (0, 0, 1)
    np.testing.assert_allclose(np.diag(given.inertia), MOMENTS, rtol=1e-12)
    assert model(shape=BOX, inertia=(1, 1, 1)).body("a").com == (0, 0, 0)
    assert pg.Model.from_json(arm.to_json()) == arm


@pytest.mark.parametrize("density", [{}, {"density": 100.0}])
def test_a_body_keeps_its_numbers_without_its_shapes(density):
    arm = model(shape=BOX, **density)
    first = arm.body("a")
    for bare in (
        arm.edit("a", shape=None).body("a"), arm.edit("a", shapes=()).body("a"),
        arm.edit("a", derived=()).body("a"), first.model_copy(update={"shape": None}),
    ):  # fmt: skip
        assert (bare.mass, bare.com, bare.inertia) == (first.mass, first.com, first.inertia)
        assert (bare.derived, bare.density) == ((), None)


@pytest.mark.parametrize("density", [{}, {"density": 100.0}])
def test_what_follows_from_shapes_follows_their_formulas(density):
    body = {"name": "a", **density, "shape": {**BOX, "size": ("=r", 0.2, 0.2)}}
    wide = pg.Model(parameters={"r": 1.0}, bodies=[body]).replace(parameters={"r": 2.0})
    assert wide.body("a") == pg.Body(name="a", **density, shape={**BOX, "size": (2.0, 0.2, 0.2)})


def test_a_derivative_by_the_mass_takes_the_inertia_along():
    def end(mass: float, **options: Any) -> pg.Result:
        arm = model(axes="y", mass=mass, shape=BOX, damping=0.5)
        return pg.simulate(arm, t_end=0.5, v=[1.0], estimate=False, **options)

    found = end(2.0, wrt=["bodies.a.mass"]).sensitivity("bodies.a.mass")[-1, 0]
    slope = (end(2.0 + 1e-5).q[-1, 0] - end(2.0 - 1e-5).q[-1, 0]) / 2e-5
    assert found == pytest.approx(slope, rel=1e-7)


def test_a_mesh_without_a_volume_asks_for_numbers(tmp_path):
    with pytest.raises(pg.ModelError, match=r"body .a., shape: .*inertia.*none\.stl"):
        model(shape={"kind": "mesh", "file": str(tmp_path / "none.stl")})


@pytest.mark.parametrize("version", range(1, 10))
@pytest.mark.parametrize("shape", [{}, {"shape": BOX}, {"shape": BOX, "derived": ["tip"]}])
def test_files_of_earlier_schemas_keep_their_inertia(version, shape):
    """Until schema 8 a body without inertia had 0.01 kg m^2 about each axis."""
    data = {"schema_version": version, "bodies": [{"name": "a", "mass": 2.0, **shape}]}
    read = pg.Model.from_json(json.dumps(data)).body("a")
    old = np.full(3, 0.01)
    new = 2.0 * MOMENTS * bool(shape)
    np.testing.assert_allclose(np.diag(read.inertia), old if version < 9 else new, rtol=1e-12)
    assert read.com == ((0.5, 0, 0) if version == 9 and shape == {"shape": BOX} else (0, 0, 0))


def test_a_point_that_gets_a_shape_has_its_inertia():
    box = {"kind": "box", "size": (0.4, 0.3, 0.2)}
    fields = {"name": "p", "axes": (0, 1, 0), "com": (1.0, 0.0, 0.0), "mass": 2.0}
    whole = pg.Body(**fields, shape=box)
    point = pg.Model(bodies=[pg.Body(**fields)])
    assert point.edit("p", shape=box).body("p").inertia == whole.inertia
    assert point.body("p").model_copy(update={"shape": box}).inertia == whole.inertia
    for derived in (("tip",), ("inertia",), ["tip"]):
        assert pg.Body(**fields, shape=box, derived=derived).inertia == whole.inertia
    given = point.edit("p", shape=box, inertia=(1.0, 1.0, 1.0)).body("p")
    assert np.trace(given.inertia) == 3.0


@pytest.mark.parametrize("step", [None, 1e-3])
def test_functions_are_given_what_their_parameters_are_called(step):
    ball = pg.Body(name="b", axes=(0, 1, 0), com=(1, 0, 0), mass=2.0)
    model = pg.Model(gravity=0, bodies=[ball])
    exact = (1 - np.exp(-2.5)) / 2.5
    for damper in (
        lambda t, q, v: -5 * v, lambda q, v: -5 * v, lambda q, qd: -5 * qd,
        lambda t, v: -5 * v, lambda v: -5 * v, lambda q, v, t: -5 * v, lambda t, x: -5 * x[1:],
        lambda q, v, gain=5.0: -gain * v,
    ):  # fmt: skip
        run = pg.simulate(model, v=[1.0], tau=damper, t_end=1.0, step=step, estimate=False)
        assert run.q[-1, 0] == pytest.approx(exact, abs=1e-6)
    run = pg.simulate(model, v=[1.0], t_end=1.0, events=[lambda q, v: q[0] - 0.5])
    assert [event.t for event in run.user_events] == pytest.approx([0.5], abs=1e-9)


def test_words_of_other_meaning_are_refused():
    for word in ({"length": 1.0}, {"rest_length": 1.0}, {"mu": 0.5}, {"qvel": [1.0]}):
        with pytest.raises(pg.ModelError, match=next(iter(word))):
            pg.Body(name="b", axes=(0, 1, 0), com=(1, 0, 0), **word)
