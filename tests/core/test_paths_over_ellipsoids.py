"""Paths over ellipsoids: spheres, ellipses, polylines of least length, and both sides."""

import itertools
import math

import numpy as np
import pytest
from scipy.optimize import minimize
from scipy.special import ellipeinc

import pgraph_core as pg
from pgraph_core.rotation import matrix, unit
from tests.refusals import assert_names

from .test_paths_over_obstacles import ROWS, TURNED, ball, egg, stand

pytestmark = pytest.mark.quick
TURN = matrix(unit(TURNED["rotation"]))


@pytest.mark.parametrize("centre", [(0.3, -0.6, 0.1), (0.0, -0.9, -0.2)])
def test_an_ellipsoid_with_equal_axes_is_a_sphere(centre):
    one, two = stand(egg(*centre, 0.6, 0.6, 0.6, **TURNED)), stand(ball(*centre, 0.6))
    for q in np.random.default_rng(1).uniform(-0.5, 0.5, (20, 3)):
        np.testing.assert_allclose(one.path_length(q), two.path_length(q), rtol=1e-13)
        np.testing.assert_allclose(one.moment_arms(q), two.moment_arms(q), rtol=0, atol=1e-12)


def arc_of_ellipse(a, b, x, y):
    """Return the length of an ellipse over x = -x to x, past (0, b)."""
    return 2.0 * a * ellipeinc(math.asin(x / a), 1.0 - (b / a) ** 2)


@pytest.mark.parametrize("radii", [(0.9, 0.5, 0.6), (0.4, 0.9, 1.2), (0.9, 0.3, 0.36)])
def test_in_a_plane_of_symmetry_the_path_lies_on_an_ellipse(radii):
    """Its ends are (±3, h): the tangent from there touches at x = a² (1 - h y / b²) / 3."""
    a, b, _ = radii
    high = 0.1
    # x / a = cos s, y / b = sin s: 3 cos s / a + h sin s / b = 1
    s = math.atan2(high / b, 3.0 / a) + math.acos(1.0 / math.hypot(3.0 / a, high / b))
    x, y = a * math.cos(s), b * math.sin(s)
    expected = 2.0 * math.hypot(3.0 - x, high - y) + arc_of_ellipse(a, b, x, y)
    mech = stand(egg(0, 0, 0, *radii), point=(3.0, high, 0.0), other_point=(-3.0, high, 0.0))
    assert mech.path_length(np.zeros(3))[0] == pytest.approx(expected, abs=1e-11)


def least_polyline(p, q, radii, count):
    """Return the length of the shortest polyline of `count` chords on an ellipsoid between the
    curves on which lines from p and q touch it, with both lines."""
    a, b = p / radii, q / radii
    normal = np.cross(a, b) / np.linalg.norm(np.cross(a, b))

    def touching(x, other, angle):
        up = x / np.linalg.norm(x)
        ahead = other - (other @ up) * up
        ahead = ahead / np.linalg.norm(ahead)
        ring = math.cos(angle) * ahead + math.sin(angle) * normal
        near = 1.0 / np.linalg.norm(x)
        return near * up + math.sqrt(1.0 - near * near) * ring

    s = np.linspace(0.0, 1.0, count + 1)[:, None]
    bulges = s * (1 - s) * np.polynomial.legendre.legvander(2 * s[:, 0] - 1, 11)

    def length(unknown):
        first, last = touching(a, b, unknown[0]), touching(b, a, unknown[1])
        angle = math.acos(first @ last)
        arc = (np.sin((1 - s) * angle) * first + np.sin(s * angle) * last) / math.sin(angle)
        arc = arc + (bulges @ unknown[2:])[:, None] * normal
        line = np.vstack((p, radii * arc / np.linalg.norm(arc, axis=1)[:, None], q))
        return float(np.linalg.norm(np.diff(line, axis=0), axis=1).sum())

    return minimize(length, np.zeros(14), method="BFGS", options={"gtol": 1e-9}).fun


@pytest.mark.parametrize(
    ("radii", "p", "q"),
    [
        ((1.0, 0.7, 0.5), (1.2, 0.3, 0.2), (-1.1, 0.1, 0.2)),
        ((0.4, 1.0, 0.3), (0.5, 0.5, 0.1), (-0.4, -0.5, 0.2)),
        ((1.0, 0.9, 0.3), (0.8, 0.9, 0.3), (-0.9, 0.1, -0.4)),
    ],
)
def test_no_polyline_over_an_ellipsoid_is_shorter(radii, p, q):
    """A polyline of n chords is longer or shorter by a multiple of n⁻²."""
    coarse, fine = (least_polyline(np.array(p), np.array(q), radii, n) for n in (150, 300))
    mech = stand(egg(0, 0, 0, *radii), point=p, other_point=q)
    assert mech.path_length(np.zeros(3))[0] == pytest.approx(fine + (fine - coarse) / 3, abs=1e-8)
    assert fine > np.linalg.norm(np.subtract(p, q)) + 0.02


@pytest.mark.parametrize("radii", [(1.0, 0.4, 0.3), (1.0, 1.0, 0.3), (0.2, 0.2, 1.0)])
def test_the_free_path_is_the_shorter_one_of_both_sides(radii):
    """At ends that are nearly opposite there are two, and the length has no jump between them."""
    p, shorter = np.array((0.9, 0.8, 0.7)), set()
    for y, z in itertools.product((-0.1, -0.02, 0.0, 0.03, 0.1), repeat=2):
        q = -1.1 * p + (0.0, y, z)
        ends = {"point": tuple(p), "other_point": tuple(q)}
        free = stand(egg(0, 0, 0, *radii), **ends).path_length(np.zeros(3))[0]
        sides = [
            stand(egg(0, 0, 0, *radii, side=tuple(sign * x)), **ends).path_length(np.zeros(3))[0]
            for sign in (-1.0, 1.0)
            for x in (np.array((0.0, 0.7, -0.8)), np.array((0.8, -0.9, 0.0)))
        ]
        assert free == pytest.approx(min(sides), rel=1e-12)
        shorter.add(int(np.argmin(sides)))
    assert len(shorter) > 1


@pytest.mark.parametrize("radii", [(1.0, 0.4, 0.3), (0.9, 0.9, 0.3), (0.25, 0.25, 1.0)])
def test_arms_are_the_slopes_of_lengths_at_any_place(radii):
    ends = {"point": (2.0, 0.3, 0.2), "other_point": (-1.5, 0.4, 0.1)}
    mech, h = stand(egg(0, 0, 0, *radii, **TURNED), **ends), 1e-4
    q, steps = np.random.default_rng(2).normal(size=(40, 3)) - (0.5, 0.2, 0.1), h * np.eye(3)
    away = np.add(q, ends["point"]) @ TURN / radii
    for place in q[np.linalg.norm(away, axis=1) > 1.1]:
        behind, ahead = (mech.path_length(place + s * steps)[:, 0] for s in (-1, 1))
        far = [mech.path_length(place + 2.0 * s * steps)[:, 0] for s in (-1, 1)]
        slope = (8.0 * (ahead - behind) - (far[1] - far[0])) / (12.0 * h)
        bent = np.abs(ahead + behind - 2.0 * mech.path_length(place)[0]).max()
        if bent < 1e2 * h * h:  # not where it lifts off
            np.testing.assert_allclose(mech.moment_arms(place)[0], -slope, rtol=0, atol=1e-9)


def test_a_mirror_image_has_the_same_length_and_files_hold_it():
    trunk = pg.Body(name="trunk", joint="fixed", mass=1.0)
    leg = pg.Body(name="left leg", parent="trunk", link=(0, 0.3, 0), mass=1.0, tip=(0, 0, -1))
    head = pg.Via(body="trunk", point=(0.05, 0.28, -0.3), radii=(0.2, 0.1, 0.15), **TURNED,
                  side=(0.1, 0.5, -0.3))  # fmt: skip
    given = {"point": (0.1, 0.1, -0.8), "other_point": (0.0, 0.2, 0.4), "stiffness": 9.0}
    muscle = pg.Spring(name="left", body="left leg", other="trunk", via=[head], **given)
    model = pg.Model(bodies=[trunk, leg], forces=[muscle]).mirror("left leg", plane="y")
    assert pg.Model.from_json(model.to_json()) == model
    mech = pg.Mechanism(model)
    for q in (-0.3, 0.2, 0.0):
        one, two = mech.path_length([q, q])
        assert one == pytest.approx(two, rel=1e-12)
    assert one > np.linalg.norm(np.subtract((0.1, 0.4, -0.8), (0.0, 0.2, 0.4))) + 1e-3


def test_a_tendon_over_an_ellipsoid_is_left_out_of_mjcf(tmp_path):
    mech = stand(egg(0.3, -0.9, 0.1, 0.6, 0.5, 0.4))
    report = pg.write_mjcf(mech.model, tmp_path / "m.xml")
    assert not report.loaded
    assert_names(str(report), "'s'", "ellipsoid")


def test_a_point_inside_an_ellipsoid_is_told():
    for x, told in ((0.0, 1), (0.6, 0)):
        mech = stand(egg(-3.0 + x, -1.1, 0.1, 0.4, 0.5, 0.4))
        notices = pg.simulate(mech, t_end=1e-3, method="rk4", step=1e-3).notices
        assert sum("inside" in text and "0.5 m" in text for text in notices) == told


@pytest.mark.parametrize(("row", "told"), [("eggs", 1), ("posts", 0), ("egg", 0)])
def test_a_path_that_slips_to_another_way_is_told_with_its_time_and_jump(row, told):
    """The path over both ends where the end of the spring passes y = 0.016 m."""
    model = stand(*ROWS[row]).model.edit("s", stiffness=1e-3)
    start = {"q": [0.1, 0.1, 0.02], "v": [0.0, -1.0, -0.2]}
    run = pg.simulate(model, t_end=0.2, method="rk4", step=0.02, **start)
    found = [text for text in run.notices if "slips" in text]
    assert len(found) == told
    for text in found:
        assert_names(text, "'s'", "t = 0.083", "0.322 m", "cylinder")
