"""Cones and cut cones: mass, rest on each side, tipping, against closed forms."""

from __future__ import annotations

import math

import numpy as np
import pytest

import pgraph_core as pg
from pgraph_core.shapes import kind_of
from pgraph_core.shapes.cylinders import SIDES

R, H = 0.2, 0.6


def cone(end: float = 0.0, **fields) -> pg.Shape:
    return pg.Shape(**{"kind": "cylinder", "radius": R, "length": H, "end_radius": end, **fields})


def on_floor(shape: pg.Shape, rotation=(1, 0, 0, 0), height: float = H / 2, **world) -> pg.Model:
    body = pg.Body(name="cone", joint="free", link=(0, 0, height), rotation=rotation, density=1e3,
                   shape=shape, derived=("mass", "com", "inertia"))  # fmt: skip
    return pg.Model(bodies=[body], contacts=[pg.Contact(name="floor", body="cone", **world)])


def test_a_cone_has_the_mass_of_a_third_of_its_cylinder():
    (body,) = on_floor(cone()).bodies
    mass = 1e3 * math.pi * R**2 * H / 3
    assert body.mass == pytest.approx(mass, rel=1e-12)
    np.testing.assert_allclose(body.com, (0, 0, -H / 4), atol=1e-12)
    across = 3 / 20 * mass * R**2 + 3 / 80 * mass * H**2
    np.testing.assert_allclose(np.diag(body.inertia), (across, across, 0.3 * mass * R**2))


@pytest.mark.parametrize("end", [0.0, 0.05, R, 0.3])
def test_its_solid_is_inside_the_round_one_by_no_more_than_stated(end):
    places = kind_of(cone(end)).solids(cone(end))[0].vertices
    radius = R + (end - R) * (places[:, 2] / H + 0.5)
    np.testing.assert_allclose(np.hypot(*places[:, :2].T), radius, atol=1e-12)
    assert len(places) == SIDES + (SIDES if end else 1)


@pytest.mark.parametrize("end", [0.0, 0.1])
@pytest.mark.parametrize("scale", [1e-2, 1.0])
def test_a_cone_stands_on_its_base_and_bears_its_weight(end, scale):
    shape = cone(end * scale, radius=R * scale, length=H * scale)
    model = on_floor(shape, height=H / 2 * scale)
    run = pg.simulate(model, t_end=0.3, step=1e-3, estimate=False)
    np.testing.assert_allclose(run.q[:, 2], 0.0, atol=1e-7 * scale)
    weight = 9.81 * model.bodies[0].mass
    assert run.contact_force["floor"][-1, 5] == pytest.approx(weight, rel=1e-6)


def test_a_cone_that_lies_keeps_the_height_of_its_axis():
    """On a side of the pyramid, at R cos(π / SIDES) below the axis at its base."""
    near = R * math.cos(math.pi / SIDES)
    tilt = math.atan2(near, H)  # of the axis, when a side lies on the floor
    half = (math.pi / 2 + tilt) / 2
    turn = np.array((math.cos(half), 0, math.sin(half), 0))
    about_axis = math.pi / SIDES  # an edge of the pyramid is along x before
    spin = np.array((math.cos(about_axis / 2), 0, 0, math.sin(about_axis / 2)))
    from pgraph_core.rotation import multiply

    middle = near * math.cos(tilt) / 2  # of the axis over the floor
    run = pg.simulate(
        on_floor(cone(), tuple(multiply(turn, spin)), middle), t_end=0.5, step=1e-3, estimate=False
    )
    assert np.ptp(run.q[:, 2]) < 1e-4 * R


@pytest.mark.parametrize(("share", "falls"), [(0.95, False), (1.05, True)])
def test_a_cone_tips_where_its_centre_leaves_its_base(share, falls):
    """On a slope of atan(R cos(π / SIDES) / (H / 4))."""
    slope = share * math.atan(4 * R * math.cos(math.pi / SIDES) / H)
    model = on_floor(cone(), friction=5.0)
    g = 9.81 * np.array((math.sin(slope), 0, -math.cos(slope)))
    run = pg.simulate(model.replace(gravity=tuple(g)), t_end=1.0, step=1e-3, estimate=False)
    tilted = abs(run.q[-1, 4:6]).max() > 0.05
    assert tilted == falls


def test_a_ball_rests_on_the_blunt_end_of_a_cut_cone():
    base = pg.Body(name="base", joint="weld", link=(0, 0, H / 2), shape=cone(0.1))
    ball = {"kind": "sphere", "radius": 0.05}
    top = pg.Body(name="ball", joint="free", link=(0, 0, H + 0.06), shape=ball)
    touch = pg.Contact(name="touch", body="ball", other="base")
    run = pg.simulate(pg.Model(bodies=[base, top], contacts=[touch]), t_end=0.5, step=1e-3)
    assert run.q[-1, 2] == pytest.approx(-0.01, abs=1e-6)


def test_a_tapered_capsule_and_formats_without_cones_are_told(tmp_path):
    with pytest.raises(pg.ModelError, match=r"taper.*0\.05"):
        pg.Shape(kind="capsule", radius=0.1, length=0.3, end_radius=0.05)
    for write, name in ((pg.write_mjcf, "a.xml"), (pg.write_urdf, "a.urdf")):
        report = write(on_floor(cone()), tmp_path / name)
        assert "cylinder" in str(report)
