"""Trees at extreme angles and ratios of mass to inertia."""

import mpmath
import numpy as np
import pytest

import pgraph_core as pg


@pytest.mark.parametrize("turns", [1, 10**5, 10**9])
def test_full_turns_change_no_pose(turns):
    """Five hinges in a chain after many turns, against reduction in 60 digits."""
    mech = pg.Mechanism(pg.Model.serial(5))
    q = 0.3 + np.arange(5) + turns * 6.25
    with mpmath.workdps(60):
        near = np.array([float(mpmath.fmod(mpmath.mpf(x), 2 * mpmath.pi)) for x in q])
    for name in mech.names:
        for found, expected in zip(mech.pose(q, name), mech.pose(near, name)):
            np.testing.assert_allclose(found, expected, rtol=0, atol=1e-13)


def test_a_light_slider_with_a_large_inertia_moves():
    """Only the mass counts along the axis; the inertia about it is not the scale of the pivot."""
    body = pg.Body(name="a", joint="prismatic", mass=1e-18, inertia=np.eye(3))
    mech = pg.Mechanism(pg.Model(bodies=[body], gravity=(0, 0, 0)))
    found = mech.forward_dynamics([0.0], [0.0], [3e-18])
    assert found == pytest.approx([3.0], rel=1e-12)


@pytest.mark.parametrize("axis", range(3))
def test_a_massless_base_that_slides_under_its_load_is_named(axis):
    """The load has mass, but none along the axis on which it slides."""
    base = pg.Body(name="base", joint="free", mass=0.0, inertia=np.eye(3))
    load = pg.Body(
        name="load", parent="base", joint="prismatic", axes=(np.eye(3)[axis],), mass=1.0,
        inertia=np.eye(3),
    )  # fmt: skip
    mech = pg.Mechanism(pg.Model(bodies=[base, load]))
    with pytest.raises(pg.InputError, match="'base'"):
        mech.forward_dynamics(*mech.home())
