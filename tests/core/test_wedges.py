"""Wedges: half a box."""

import numpy as np
import pytest

import pgraph_core as pg
from pgraph_core.model.shape import mass_properties

SIZE = (0.4, 0.3, 0.2)


def test_a_wedge_and_its_mirror_image_are_a_box():
    whole = mass_properties(pg.Shape(kind="box", size=SIZE), 3.0)
    low = mass_properties(pg.Shape(kind="wedge", size=SIZE), 3.0)
    high = mass_properties(pg.Shape(kind="wedge", size=SIZE, rotation=(0, 0, 1, 0)), 3.0)
    assert low.mass + high.mass == pytest.approx(whole.mass)
    np.testing.assert_allclose(low.com, -high.com, atol=1e-15)
    r = low.com
    about = sum(x.inertia + x.mass * (r @ r * np.eye(3) - np.outer(r, r)) for x in (low, high))
    np.testing.assert_allclose(about, whole.inertia, atol=1e-12)


def test_a_ball_slides_down_a_wedge():
    """Without friction along its slope, at g sin of its angle."""
    solid = {"mass": 1.0, "inertia": np.eye(3)}
    wedge = pg.Body(name="wedge", joint="weld", shape=pg.Shape(kind="wedge", size=SIZE), **solid)
    slope = np.array((SIZE[0], 0.0, SIZE[2])) / np.hypot(SIZE[0], SIZE[2])
    start = 0.0500001 * np.array((-slope[2], 0.0, slope[0]))
    ball = pg.Body(name="ball", joint="free", shape=pg.Shape(kind="sphere", radius=0.05), **solid,
                   q=(*start, 1, 0, 0, 0))  # fmt: skip
    touch = pg.Contact(name="c", body="ball", other="wedge", friction=0.0)
    run = pg.simulate(pg.Model(bodies=[wedge, ball], contacts=[touch]), t_end=0.05, step=1e-3)
    assert run.v[-1][3:] @ slope == pytest.approx(-9.81 * slope[2] * 0.05, rel=1e-3)
