"""Walks by methods that take runs of their own instead of a stepper."""

import numpy as np
import pytest

import pgraph_core as pg
import pgraph_models


def test_pieces_of_a_walk_by_events_are_one_run():
    """Event-driven contacts need runs. Two pieces end where one run ends."""
    model = pg.Model.load(pgraph_models.path("quadruped_hips"))
    mech, step = pg.Mechanism(model), 2.5e-4
    walk = pg.Walk(mech, "trot", method="rk4", step=step)
    pieces = [walk.step(0.01) for _ in range(2)]
    whole = pg.simulate(mech, scenario="trot", t_end=0.02, method="rk4", step=step, estimate=False)
    assert [piece.t[-1] for piece in pieces] == [0.01, 0.02]
    np.testing.assert_allclose(walk.q, whole.q[-1], rtol=0, atol=1e-6)
    np.testing.assert_allclose(walk.v, whole.v[-1], rtol=0, atol=1e-4)


def test_a_walk_that_failed_goes_on_after_a_change_only():
    model = pg.Model.load(pgraph_models.path("quadruped_hips"))
    walk = pg.Walk(pg.Mechanism(model), "trot", step=1e-3)
    q, v = walk.q, walk.v
    walk.v = np.full_like(v, 1e140)
    assert not walk.step(0.01).status.ok
    with pytest.raises(pg.InputError, match="failed"):
        walk.step(0.01)
    walk.q, walk.v = q, v
    assert walk.step(0.002).status.ok
