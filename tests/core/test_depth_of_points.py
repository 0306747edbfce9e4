"""Notices of overlapping contact points relative to the size of their body."""

import numpy as np
import pytest

import pgraph_core as pg


@pytest.mark.parametrize("size", [1.0, 1e-2, 1e-4])
@pytest.mark.parametrize(("share", "noticed"), [(1e-3, False), (0.2, True)])
def test_a_deep_start_is_noticed_at_any_size(size, share, noticed):
    half = size / 2
    body = pg.Body(
        name="b", joint="free", mass=1.0, inertia=size * size / 6 * np.eye(3),
        q=(0, 0, (0.5 - share) * size, 1, 0, 0, 0),
    )  # fmt: skip
    points = [(x, y, -half) for x in (-half, half) for y in (-half, half)]
    model = pg.Model(bodies=[body], contacts=[pg.Contact(name="c", body="b", points=points)])
    run = pg.simulate(model, t_end=0.005, method="moreau_jean", step=1e-3, estimate=False)
    assert any("'c'" in notice for notice in run.notices) == noticed
