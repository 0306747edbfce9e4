"""Runs that start later than 0, and runs joined to one."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest

import pgraph_core as pg
import pgraph_models

HALF, WHOLE = 0.12, 0.25


def quadruped() -> pg.Mechanism:
    return pg.Mechanism(pg.Model.load(pgraph_models.path("quadruped")))


def swinging() -> pg.Mechanism:
    """Two rods, driven by a torque table whose knots are no ends of steps."""
    drive = pg.Table(t=(0.0, 0.07, 0.2), value=(0.0, 3.0, -2.0))
    force = pg.Force(name="drive", kind="motor", body="1", torque=drive)
    return pg.Mechanism(pg.Model.serial(2).replace(forces=(force,)))


def bouncing() -> pg.Mechanism:
    """A ball that meets the ground before the run is cut, and again after it."""
    shape = pg.Shape(kind="sphere", radius=0.05)
    ball = pg.Body(name="ball", joint="free", q=(0, 0, 0.06, 1, 0, 0, 0), shape=shape)
    contact = pg.Contact(name="floor", body="ball", restitution=0.8)
    return pg.Mechanism(pg.Model(bodies=(ball,), contacts=(contact,)))


def halves(mech: pg.Mechanism, **settings: Any) -> tuple[pg.Result, pg.Result, pg.Result]:
    """(first, second, joined): the second run begins where the first ended."""
    first = pg.simulate(mech, t_end=HALF, **settings)
    state = first.q[-1], first.v[-1]
    second = pg.simulate(mech, *state, t_start=HALF, t_end=WHOLE, **settings)
    return first, second, pg.joined((first, second))


@pytest.mark.parametrize(
    ("mech", "settings", "bound"),
    [
        (quadruped, {"scenario": "stance"}, 1e-11),
        (swinging, {"method": "rk4", "step": 1e-3}, 1e-12),
        (swinging, {"method": "dop853", "rtol": 1e-11}, 1e-9),
        (swinging, {"method": "radau5", "step": 1e-2}, 1e-10),
        (bouncing, {"method": "moreau_jean", "step": 1e-3}, 1e-12),
        (bouncing, {"method": "rk4", "step": 1e-3}, 1e-10),
    ],
    ids=["stance", "rk4", "dop853", "radau5", "moreau_jean", "events"],
)
def test_two_halves_are_the_whole(mech, settings, bound):
    whole = pg.simulate(mech(), t_end=WHOLE, **settings)
    _, second, both = halves(mech(), **settings)
    assert second.status.ok
    assert second.t[0] == HALF
    assert both.t[-1] == whole.t[-1] == WHOLE
    assert np.all(np.diff(both.t) > 0)
    np.testing.assert_allclose(both.q[-1], whole.q[-1], rtol=0, atol=bound)
    np.testing.assert_allclose(both.v[-1], whole.v[-1], rtol=0, atol=100 * bound)


def test_the_ledger_goes_on():
    first, second, both = halves(swinging(), method="rk4", step=1e-3)
    assert both.work[-1] == first.work[-1] + second.work[-1]
    assert both.energy_drift < 1e-7
    assert both.counters["steps"] == first.counters["steps"] + second.counters["steps"]
    assert len(both.t) == len(first.t) + len(second.t) - 1


def test_contact_records_and_events_go_on():
    first, second, both = halves(bouncing(), method="rk4", step=1e-3)
    assert [e.t for e in both.events] == [e.t for e in (*first.events, *second.events)]
    assert len(first.events) > 0 < len(second.events)
    assert {len(x) for x in both.contact_gap.values()} == {len(both.t)}
    assert len(both.to_csv().splitlines()) == len(both.t) + 1


@pytest.mark.parametrize(
    ("arguments", "key"),
    [
        ({"t_start": float("nan")}, "t_start.*nan"),
        ({"t_start": 2.0, "t_end": 1.0}, r"t_end.*t_start = 2 .*1\.0"),
        ({"t_start": 1.0, "t_end": 2.0, "t_eval": [0.5]}, "t_eval.* 1 to t_end = 2"),
    ],
)
def test_times_that_do_not_fit_are_refused(arguments, key):
    with pytest.raises(pg.InputError, match=key):
        pg.simulate(swinging(), **arguments)


def test_runs_that_do_not_meet_are_refused():
    first, second, _ = halves(swinging(), method="rk4", step=1e-3)
    other = pg.simulate(quadruped(), t_start=WHOLE, t_end=WHOLE + 0.01, method="rk4", step=1e-3)
    for runs, key in (
        ((second, first), r"runs.*t_start = 0\.25"),
        ((second, other), "joints"),
        ((), "none"),
    ):
        with pytest.raises(pg.InputError, match=key):
            pg.joined(runs)
