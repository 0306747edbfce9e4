"""Notices of paths that slip to another way past an obstacle."""

import numpy as np
import pytest

import pgraph_core as pg
from tests.refusals import assert_names


def elbow(side) -> pg.Model:
    """An arm that bends, and a spring behind its elbow over a cylinder."""
    upper = pg.Body(name="upper", joint="weld")
    fore = pg.Body(
        name="fore", parent="upper", link=(0, 0, -0.3), axes=[(0, -1, 0)], mass=1.4, v=(4.0,),
        com=(0, 0, -0.16), inertia=(0.018, 0.018, 0.0015), q=(np.deg2rad(70),),
    )  # fmt: skip
    over = pg.Via(body="upper", point=(0, 0, -0.3), radius=0.021, axis=(0, 1, 0), side=side)
    spring = pg.Spring(name="triceps", body="fore", point=(-0.02, 0, -0.035), other="upper",
                       other_point=(-0.022, 0, -0.08), via=[over], stiffness=1.0)  # fmt: skip
    return pg.Model(gravity=(0, 0, 0), bodies=[upper, fore], forces=[spring])


@pytest.mark.parametrize(("side", "slips"), [((-0.1, 0, -0.3), True), ((-0.07, 0, -0.37), False)])
@pytest.mark.parametrize("frames", [11, 101])
def test_a_path_that_changes_sides_is_told_with_its_time_and_jump(side, slips, frames):
    """It changes where the arc from end to end no longer has the point `side` in its middle."""
    run = pg.simulate(elbow(side), t_end=0.3, frames=frames)
    told = [text for text in run.notices if "slips" in text]
    assert len(told) == slips
    jump = np.abs(np.diff(run.path_length["triceps"])).max()
    assert (jump > 0.05) == slips
    if slips:
        i = int(np.abs(np.diff(run.path_length["triceps"])).argmax())
        assert_names(told[0], "'triceps'", "'upper'", "`side`", "derivatives")
        when = float(told[0].partition("t = ")[2].partition(" s")[0])
        assert run.t[i] <= when <= run.t[i + 1]
