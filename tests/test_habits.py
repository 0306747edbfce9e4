"""What users of other tools write is understood."""

import numpy as np
import pytest

import pgraph_core as pg

pytestmark = pytest.mark.quick


@pytest.mark.parametrize("given", [(1, 2, 2.5), [1.0, 2.0, 2.5], np.array([1, 2, 2.5])])
def test_three_moments_are_the_diagonal_of_the_inertia(given):
    body = pg.Body(name="a", inertia=given)
    assert body.inertia == ((1, 0, 0), (0, 2, 0), (0, 0, 2.5))
    assert pg.Model(bodies=[body]).edit("a", inertia=given).bodies[0] == body


@pytest.mark.parametrize("given", [(1, 2), (1, 2, 3, 4), (1, 2, 4), (1, -1, 1), (1, 2, "x"), 3.0])
def test_moments_that_no_body_has_are_refused(given):
    with pytest.raises(pg.ModelError, match="inertia"):
        pg.Body(name="a", inertia=given)


@pytest.mark.parametrize("given", [0.01 * np.eye(3), (0.01, 0.01, 0.01)])
def test_an_inertia_that_is_given_is_not_taken_for_the_default(given):
    ball = {"name": "ball", "joint": "free", "mass": 0.5}
    assert pg.Model(bodies=[pg.Body(**ball)]).doubts
    assert pg.Model(bodies=[pg.Body(**ball, inertia=given)]).doubts == ()


def test_a_run_gives_each_of_its_columns_by_name():
    ball = pg.Body(name="ball", joint="free")
    arm = pg.Body(name="arm", joint="revolute", axes=((0, 1, 0),))
    floor = pg.Contact(name="floor", body="ball", points=((0, 0, 0),))
    run = pg.simulate(pg.Model(bodies=[ball, arm], contacts=[floor]), t_end=0.1)
    for name, column in run.columns().items():
        np.testing.assert_array_equal(run[name], getattr(column, "values", column))
