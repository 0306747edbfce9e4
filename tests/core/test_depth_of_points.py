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


def test_a_deep_body_does_not_lift_another_that_it_does_not_touch():
    """Each island is pushed apart alone: 8e-6 of the size is a depth that is tolerated."""

    def box(name: str, x: float, depth: float) -> pg.Body:
        cube = {"kind": "box", "size": (1, 1, 1)}
        start = (x, 0, 0.5 - depth, 1, 0, 0, 0)
        return pg.Body(name=name, joint="free", mass=6.0, inertia=np.eye(3), shape=cube, q=start)

    def heights(*bodies: pg.Body) -> np.ndarray:
        floor = pg.Contact(name="floor", body="*", friction=0.5)
        model = pg.Model(bodies=bodies, contacts=[floor])
        given = {"method": "moreau_jean", "step": 1e-3, "estimate": False}
        return pg.simulate(model, t_end=0.05, **given)["still"][:, 2]

    still = box("still", 0.0, 8e-6)
    beside = heights(still, box("deep", 3.0, 1e-3))
    assert beside == pytest.approx(heights(still), abs=1e-12)
    assert beside[-1] == pytest.approx(0.5 - 8e-6, abs=1e-7)
