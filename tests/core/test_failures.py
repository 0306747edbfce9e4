"""Runs that fail at once, absurd numbers, and models in which nothing moves."""

from __future__ import annotations

import numpy as np
import pytest

import pgraph_core as pg


def hinge(**fields):
    return pg.Model(bodies=(pg.Body(name="b", mass=1.0, com=(1, 0, 0), **fields),))


def test_a_run_that_fails_at_its_start_keeps_its_first_frame():
    """A hinge without inertia about its axis."""
    none = np.zeros((3, 3))
    point = pg.Body(name="b", mass=1.0, axes=((1, 0, 0),), com=(1, 0, 0), q=(0.3,), inertia=none)
    run = pg.simulate(pg.Model(bodies=(point,)), t_end=1.0)
    assert run.status is pg.Status.SINGULAR
    assert (len(run.t), run.t[0], run.q[-1, 0]) == (1, 0.0, 0.3)
    assert np.isnan(run.error_estimate)


def test_a_torque_that_is_no_number_at_the_start_keeps_its_first_frame():
    run = pg.simulate(hinge(axes=((0, 1, 0),), q=(0.2,)), t_end=1.0, v=np.array([1e200]))
    assert len(run.t) >= 1
    assert run.q[0, 0] == 0.2


@pytest.mark.parametrize("frames", [10**12, 10**9])
def test_absurd_frames_are_refused(frames):
    with pytest.raises(pg.InputError, match="simulate, frames: must be at most"):
        pg.simulate(hinge(), t_end=1.0, frames=frames)


@pytest.mark.parametrize("fields", [{"mass": 1e308}, {"com": (1e200, 0, 0)}, {"tip": (0, 1e90, 0)}])
def test_absurd_sizes_are_refused_by_the_body(fields):
    body = pg.Body(name="huge", **{"mass": 1.0, "com": (1, 0, 0), **fields})
    with pytest.raises(pg.InputError, match="body 'huge': has a mass, length or inertia of"):
        pg.simulate(pg.Model(bodies=(body,)), t_end=1.0)


def test_a_model_in_which_nothing_moves_says_so():
    """A hinge about the vertical, which is the default; not one that hangs at rest."""
    still = pg.simulate(hinge(axes=((0, 0, 1),)), t_end=0.5)
    assert any("nothing moves" in text for text in still.notices)
    hanging = pg.Body(name="b", mass=1.0, com=(0, 0, -1), axes=((0, 1, 0),))
    turning = hinge(axes=((0, 0, 1),), v=(1.0,))
    for model in (pg.Model(bodies=(hanging,)), turning, hinge(axes=((0, 1, 0),))):
        run = pg.simulate(model, t_end=0.5)
        assert not any("nothing moves" in text for text in run.notices)
