"""Scaling of a model to a person by distances of markers (`scale`)."""

import numpy as np
import pytest

import pgraph_core as pg

from .refusals import assert_names, refusal

pytestmark = pytest.mark.quick


EGG = np.array((0.06, 0.04, 0.05))
SLIDES = {"kind": "polynomial", "coefficients": [0, 0.01]}


def leg(factor=1.0):
    """A thigh and a shank of boxes, with muscle, contact and curve, grown by a factor."""
    k = factor
    box = pg.Shape(kind="box", size=(0.1 * k, 0.12 * k, 0.4 * k), position=(0, 0, -0.2 * k))
    thigh = pg.Body(name="thigh", axes=(0, 1, 0), shape=box, density=1000 / k**3,
                    derived=("mass", "com", "inertia"))  # fmt: skip
    knee = pg.Track(x=f"{0.01 * k}*sin(q)", z=((0, -0.4 * k), (1, -0.39 * k), (2, -0.4 * k)),
                    angles=("q",), axes=[(0, 1, 0)], range=(0, 2), unit="rad")  # fmt: skip
    shank = pg.Body(name="shank", parent="thigh", joint="curve", track=knee, mass=3, q=0.3,
                    com=(0, 0, -0.2 * k), inertia=np.diag([0.04, 0.03, 0.02]) * k**2,
                    tip=(0, 0, -0.4 * k))  # fmt: skip
    muscle = pg.Muscle(
        name="m", body="thigh", point=(0.04 * k, 0, -0.1 * k), other="shank",
        other_point=(0.03 * k, 0, -0.05 * k), f_max=900, l_opt=0.1 * k, l_slack=0.2 * k,
        via=[("thigh", (0.05 * k, 0, -0.3 * k))],
    )  # fmt: skip
    spring = pg.Spring(
        name="s", body="thigh", point=(0.06 * k, 0, -0.1 * k), other="shank", stiffness=0,
        other_point=(0.03 * k, 0, -0.1 * k),
        shifts=[{"body": "shank", "along": (k, 0, 0), "curve": SLIDES}],
        other_shifts=[{"body": "shank", "along": (0, 0, k), "curve": SLIDES}],
        via=[pg.Via(body="thigh", point=(0.02 * k, 0, -0.3 * k), radii=EGG * k)],
    )  # fmt: skip
    sites = [pg.Site(name=n, body=b, point=np.array(x) * k) for n, b, x in
             (("hip", "thigh", (0, 0, 0)), ("knee", "thigh", (0, 0.05, -0.4)),
              ("ankle", "shank", (0, 0.05, -0.4)))]  # fmt: skip
    return pg.Mechanism(pg.Model(bodies=[thigh, shank], forces=[muscle, spring], sites=sites))


def standing(mech, **labels):
    pose = mech.pose(mech.home()[0])
    markers = {
        labels.get(s.name, s.name): np.tile(pose[s.name].position, (3, 1)) for s in mech.model.sites
    }
    return pg.Trial(t=np.arange(3) / 100, markers=markers, up="z")


def test_a_person_who_is_the_model_grown_evenly_gives_the_model_grown_evenly():
    """Lengths by 1.1, the mass is kept, and inertias by 1.1 squared."""
    person = leg(1.1)
    scaled, report = pg.scale(leg(), standing(person), pairs={
        "thigh": [("hip", "knee")], "shank": [("knee", "ankle"), ("hip", "ankle")],
    })  # fmt: skip
    found, rng = pg.Mechanism(scaled), np.random.default_rng(0)
    q, v = [0.4, 0.7], rng.normal(size=2)
    assert np.allclose(found.mass_matrix(q), person.mass_matrix(q), rtol=1e-12)
    assert np.allclose(found.bias_force(q, v), person.bias_force(q, v), rtol=1e-12)
    assert np.allclose(found.path_length(q), person.path_length(q), rtol=1e-12)
    for name in ("hip", "knee", "ankle", "shank"):
        assert np.allclose(found.pose(q, name).position, person.pose(q, name).position, atol=1e-15)
    a, b = found.model.forces[0], person.model.forces[0]
    assert np.allclose((a.l_opt, a.l_slack), (b.l_opt, b.l_slack))
    assert np.allclose(scaled.body("thigh").shape.size, person.model.body("thigh").shape.size)
    assert np.allclose(scaled.body("shank").tip, person.model.body("shank").tip)
    assert_names(repr(report), "thigh: 1.1, 1.1, 1.1", "hip to knee", "factor 1.1")


def test_a_mass_is_shared_by_volume():
    scaled, report = pg.scale(
        leg(), standing(leg(1.2)), pairs={"thigh": [("hip", "knee")]}, mass=10
    )
    old = leg().model
    ratio = scaled.body("thigh").mass / scaled.body("shank").mass
    assert np.isclose(ratio, 1.2**3 * old.body("thigh").mass / old.body("shank").mass)
    assert np.isclose(report.mass, 10)
    assert_names(repr(report), "as they were: shank")


def test_axes_have_their_own_factors():
    """A box whose sides grow differently has the inertia of the larger box."""
    body = pg.Body(name="b", axes=(0, 1, 0), density=1000,
                   shape=pg.Shape(kind="box", size=(0.1, 0.2, 0.3)))  # fmt: skip
    marks = {"o": (0, 0, 0), "x": (0.1, 0, 0), "z": (0, 0, 0.1)}
    sites = [pg.Site(name=n, body="b", point=p) for n, p in marks.items()]
    model = pg.Model(bodies=[body], sites=sites)
    wide = {n: np.tile(np.array(p) * [1.5, 1, 1.25], (3, 1)) for n, p in marks.items()}
    trial = pg.Trial(t=np.arange(3) / 10, markers=wide)
    scaled, _ = pg.scale(model, trial, pairs={"b": {"x": [("o", "x")], "z": [("o", "z")]}},
                         mass=body.mass * 1.5 * 1.25)  # fmt: skip
    larger = pg.Body(name="b", density=1000, shape=pg.Shape(kind="box", size=(0.15, 0.2, 0.375)))
    assert np.allclose(scaled.body("b").inertia, larger.inertia)
    assert np.allclose(scaled.body("b").shape.size, larger.shape.size)


def test_pairs_that_cannot_be_measured_are_refused():
    mech = leg()
    trial, pair = standing(mech), {"thigh": [("hip", "knee")]}
    gone = pg.Trial(t=trial.t, markers={**trial.markers, "hip": trial.markers["hip"] * np.nan})
    for call, *facts in (
        (lambda: pg.scale(mech, trial, pairs={}), "pairs", "femur"),
        (lambda: pg.scale(mech, 3, pairs=pair), "static", "pg.read_trial"),
        (lambda: pg.scale(mech, trial, pairs={"foot": [("hip", "knee")]}), "'foot'", "thigh"),
        (lambda: pg.scale(mech, trial, pairs={"thigh": [("hip", "toe")]}), "'toe'", "knee"),
        (lambda: pg.scale(mech, trial, pairs={"thigh": ["hip"]}), "'thigh'", "two sites"),
        (lambda: pg.scale(mech, trial, pairs={"thigh": []}), "'thigh'", "no pair"),
        (lambda: pg.scale(mech, trial, pairs={"thigh": {"w": [("hip", "knee")]}}), "axes", "'w'"),
        (lambda: pg.scale(mech, trial, pairs=pair, markers={"hip": "H"}), "'H'", "hip"),
        (lambda: pg.scale(mech, trial, pairs=pair, mass=-1), "mass", "-1"),
        (lambda: pg.scale(mech, gone, pairs=pair), "never seen together"),
    ):
        assert_names(str(refusal(call)), *facts)
    scaled, _ = pg.scale(mech, standing(mech, hip="H"), pairs=pair, markers={"hip": "H"})
    assert scaled.body("thigh").mass == pytest.approx(mech.model.body("thigh").mass)
