"""Impulses of one contact with friction: its laws, from sites that stick to levers of no length."""

from __future__ import annotations

import numpy as np
import pytest

import pgraph_core as pg
from pgraph_core.contact import impacts
from pgraph_core.simulation.event_scene import EventScene

SMALLEST = (1e-2, 1e-9, 1e-160, 1e-310)  # products of the last ones underflow


def thin_spike(random, lever):
    """Ω at the tip of a spike whose axis carries next to no inertia, `lever` m beside it."""
    inertia = np.diag([1e-2, 1e-2, 1e-12])
    x, y, z = random.normal() * lever, random.normal() * lever, -0.5
    cross = np.array([[0, -z, y], [z, 0, -x], [-y, x, 0]])
    omega = np.eye(3) - cross @ np.linalg.inv(inertia) @ cross
    return (omega + omega.T)[[2, 0, 1]][:, [2, 0, 1]] / 2


@pytest.mark.parametrize("friction", [0.0, 1e-3, 0.3, 2.0])
@pytest.mark.parametrize("lever", SMALLEST)
@pytest.mark.parametrize("slip", SMALLEST)
def test_a_contact_stops_and_friction_opposes_its_slip(friction, lever, slip):
    """Without friction or slip too: 1e-9 of the impulses, whose lever multiplies rounding."""
    random = np.random.default_rng(7)
    for _ in range(5):
        omega = thin_spike(random, lever)
        u = random.normal(size=3) * (1.0, slip, slip)
        u[0] = -abs(u[0])
        solved = impacts.impulses(omega, u, 0, [impacts.ContactRow(0, 3, friction, 0.0)])
        lam, after = solved.impulse, solved.velocity
        rounding = 1e-9 * float((np.abs(omega) @ np.abs(lam)).max())
        assert lam[0] > 0
        assert after[0] == pytest.approx(0.0, abs=rounding)
        assert np.hypot(*lam[1:]) <= friction * lam[0] * (1 + 1e-9)
        left = float(np.hypot(*after[1:]))
        opposed = float(lam[1:] @ after[1:])
        assert opposed == pytest.approx(-friction * lam[0] * left, abs=rounding * lam[0])
        assert solved.gain <= rounding * lam[0]


def test_a_spinning_spike_lands_and_its_energy_is_balanced():
    """A frictionless tip beside the axis by less than can be squared: products underflow."""
    spike = pg.Body(
        name="spike",
        joint="free",
        mass=1.0,
        com=(0.0, 0.0, 0.0),
        inertia=((1e-2, 0.0, 0.0), (0.0, 1e-2, 0.0), (0.0, 0.0, 1e-12)),
        q=(0.0, 0.0, 0.51, 1.0, 0.0, 0.0, 0.0),
        v=(0.0, 0.0, 300.0, 1e-180, 2e-170, 0.0),
    )
    for friction in (0.0, 0.5):
        tip = pg.Contact(
            name="tip",
            body="spike",
            law="complementarity",
            friction=friction,
            points=((1e-200, 0.0, -0.5),),
        )
        model = pg.Model(bodies=(spike,), contacts=(tip,))
        run = pg.simulate(pg.Mechanism(model), t_end=0.06, method="rk4", estimate=False)
        assert run.status.ok, run.message
        assert run.counters["impacts"] > 0
        assert run.energy_drift < 1e-9


def test_an_impact_of_numbers_that_overflowed_is_a_status(monkeypatch):
    """A run that has lost its numbers says so, and keeps what was before."""
    broken = np.full((3, 3), np.nan), np.full(3, np.nan)
    monkeypatch.setattr(EventScene, "impact", lambda *_: broken)
    ball = pg.Body(name="ball", joint="free", q=(0.0, 0.0, 0.1, 1.0, 0.0, 0.0, 0.0))
    floor = pg.Contact(name="floor", body="ball", law="complementarity", points=((0, 0, 0),))
    mech = pg.Mechanism(pg.Model(bodies=(ball,), contacts=(floor,)))
    run = pg.simulate(mech, t_end=0.2, method="rk4", step=1e-3)
    assert run.status is pg.Status.NOT_FINITE
    assert "in the impact at t = 0.142" in run.message
    assert run.t[-1] > 0.14
