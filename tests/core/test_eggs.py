"""Eggs, beside ellipsoids and beside their own points."""

import numpy as np
import pytest

import pgraph_core as pg
from pgraph_core import shapes as solids
from pgraph_core.model.shape import mass_properties
from pgraph_core.shapes.eggs import egg

from .touching import Scene, random_pose, random_solid

KINDS = ["sphere", "capsule", "box", "hull", "cylinder", "ellipsoid"]


def points_of(radius, low, high, n=80):
    """Points on the surface of an egg."""
    u, t = np.meshgrid(np.linspace(-np.pi / 2, np.pi / 2, 2 * n), np.linspace(0, 2 * np.pi, n))
    places = np.stack((np.cos(u) * np.cos(t), np.cos(u) * np.sin(t), np.sin(u)), -1)
    return (
        places.reshape(-1, 3)
        * (radius, radius, 1)
        * np.where(np.sin(u).ravel()[:, None] > 0, (1, 1, high), (1, 1, low))
    )


def test_an_egg_of_equal_halves_is_an_ellipsoid():
    shape = pg.Shape(kind="egg", radius=0.1, length=0.2, end_radius=0.2)
    same = pg.Shape(kind="ellipsoid", radii=(0.1, 0.1, 0.2))
    for one, other in zip(mass_properties(shape, 7.0), mass_properties(same, 7.0)):
        np.testing.assert_allclose(one, other, atol=1e-15)
    rng = np.random.default_rng(3)
    for kind in KINDS:
        partner, poses = random_solid(rng, kind), [random_pose(rng, 0.6) for _ in range(2)]
        a, b = (
            Scene([x, partner], poses)
            for x in (egg(0.1, 0.2, 0.2), solids.ellipsoid((0.1, 0.1, 0.2)))
        )
        assert a.gap() == pytest.approx(b.gap(), abs=1e-14)
        assert a.on_ground().gap == pytest.approx(b.on_ground().gap, abs=1e-14)


@pytest.mark.parametrize("kind", KINDS)
def test_its_gap_and_normal_separate_its_points_from_the_other_shape(kind):
    """Its points are beyond the plane of the contact, and one is as near to it as the gap says."""
    rng = np.random.default_rng(4)
    sizes = 0.15, 0.1, 0.4
    places = points_of(*sizes)
    for _ in range(4):
        partner, poses = random_solid(rng, kind), [random_pose(rng, 0.8) for _ in range(2)]
        scene = Scene([egg(*sizes), partner], poses)
        touch = scene.pair()
        k = int(np.argmin(touch.gap))
        own = places @ poses[0][3:].reshape(3, 3).T + poses[0][:3]
        heights = (own - touch.b[k]) @ touch.normal[k]
        assert heights.min() == pytest.approx(touch.gap[k], abs=1e-3)
        ground = scene.on_ground()
        assert ground.gap.min() == pytest.approx(own[:, 2].min(), abs=1e-3)
        assert scene.gap() == pytest.approx(touch.gap.min(), abs=1e-12)
        turned = Scene([partner, egg(*sizes)], poses[::-1])
        assert turned.gap() == pytest.approx(scene.gap(), abs=1e-9)


def test_an_egg_stands_on_its_flatter_end():
    """Its centre of mass is below the centre of curvature there, which is radius² / length high."""
    shape = pg.Shape(kind="egg", radius=0.1, length=0.06, end_radius=0.12)
    body = pg.Body(name="egg", joint="free", mass=0.1, shape=shape, q=(0, 0, 0.0601, 1, 0, 0, 0))
    model = pg.Model(bodies=[body], contacts=[pg.Contact(name="c", body="egg", other="ground")])
    run = pg.simulate(model, t_end=0.02, step=1e-3, method="moreau_jean")
    assert run.q[-1][2] == pytest.approx(0.06, abs=1e-5)
    assert run.q[-1][3] == pytest.approx(1.0, abs=1e-9)
