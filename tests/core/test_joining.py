"""Runs that start later than 0, and runs joined to one."""

import numpy as np
import pytest

import pgraph_core as pg
import pgraph_models

from ..worlds import ball, on_ground

pytestmark = pytest.mark.quick

HALF, WHOLE = 0.12, 0.25


def swinging() -> pg.Model:
    drive = pg.Table(t=(0.0, 0.07, 0.2), value=(0.0, 3.0, -2.0))
    return pg.Model.serial(2).replace(forces=(pg.Motor(name="drive", body="1", torque=drive),))


def bouncing() -> pg.Model:
    return on_ground(ball(place=(0, 0, 0.06), radius=0.05), restitution=0.8)


def halves(model: pg.Model, **settings) -> tuple[pg.Result, pg.Result, pg.Result]:
    first = pg.simulate(model, t_end=HALF, **settings)
    state = first.q[-1], first.v[-1]
    second = pg.simulate(model, *state, t_start=HALF, t_end=WHOLE, **settings)
    return first, second, pg.joined((first, second))


@pytest.mark.parametrize(
    ("model", "settings", "bound"),
    [
        (pg.Model.load(pgraph_models.path("quadruped")), {"scenario": "stance"}, 1e-11),
        (swinging(), {"method": "rk4", "step": 1e-3}, 1e-12),
        (swinging(), {"method": "dop853", "rtol": 1e-11}, 1e-9),
        (swinging(), {"method": "radau5", "step": 1e-2}, 1e-10),
        (bouncing(), {"method": "moreau_jean", "step": 1e-3}, 1e-12),
        (bouncing(), {"method": "rk4", "step": 1e-3}, 1e-10),
    ],
    ids=["stance", "rk4", "dop853", "radau5", "moreau_jean", "events"],
)
def test_two_halves_are_the_whole(model, settings, bound):
    whole = pg.simulate(model, t_end=WHOLE, **settings)
    first, second, both = halves(model, **settings)
    assert second.status.ok
    assert second.t[0] == HALF
    assert both.t[-1] == whole.t[-1] == WHOLE
    assert np.all(np.diff(both.t) > 0)
    assert len(both.t) == len(first.t) + len(second.t) - 1 == len(both.to_csv().splitlines()) - 1
    np.testing.assert_allclose(both.q[-1], whole.q[-1], rtol=0, atol=bound)
    np.testing.assert_allclose(both.v[-1], whole.v[-1], rtol=0, atol=100 * bound)
    assert both.work[-1] == first.work[-1] + second.work[-1]
    assert both.counters["steps"] == first.counters["steps"] + second.counters["steps"]
    assert both.events == (*first.events, *second.events)
    assert all(len(gap) == len(both.t) for gap in both.contact_gap.values())


def test_runs_that_do_not_meet_are_refused():
    first, second, _ = halves(swinging(), method="rk4", step=1e-3)
    other = pg.simulate(pg.Model.serial(3), t_start=WHOLE, t_end=WHOLE + 0.01, step=1e-3)
    for runs, key in (
        ((second, first), r"runs.*earlier run first"), ((second, other), "joints"), ((), "none")
    ):  # fmt: skip
        with pytest.raises(pg.InputError, match=key):
            pg.joined(runs)
