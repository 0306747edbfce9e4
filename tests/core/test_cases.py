"""Published and closed-form motions by fixed steps. See static_models/cases.

`test_verify` runs every case by its own file; here RK4 runs at a step at which its error is known,
on models built independently; the tolerance is about three times what was measured.
"""

import json

import numpy as np
import pytest

import pgraph_core as pg
import pgraph_models

pytestmark = pytest.mark.quick

DOWN = {"gravity": (0.0, -9.81, 0.0), "up": "y"}
NONE = ((0.0,) * 3,) * 3


def case(name):
    data = json.loads((pgraph_models.CASES / f"{name}.json").read_text(encoding="utf-8"))
    return np.array(data["t"]), data["reference"]


def mass(name, parent="ground", *, m=1.0, length=1.0, above=0.0, **fields):
    """A point mass on a rod without mass, hinged about z, hanging down at q = 0."""
    return pg.Body(
        name=name, parent=parent, link=(0, -above, 0), mass=m, com=(0, -length, 0), inertia=NONE,
        **fields,
    )  # fmt: skip


def rod(name, parent="ground", *, m=1.0, length=1.0, along=(1, 0, 0), link=(0, 0, 0)):
    """A uniform slender rod, hinged about z at its end."""
    along = np.array(along, dtype=float)
    inertia = m * length**2 / 12 * (np.eye(3) - np.outer(along, along))
    return pg.Body(
        name=name, parent=parent, link=link, mass=m, com=tuple(length / 2 * along), inertia=inertia
    )


def run(model, t, q, v=None, *, step=1e-3, **options):
    mech = pg.Mechanism(model)
    v = np.zeros(mech.nv) if v is None else v
    done = pg.simulate(mech, q, v, t_end=t[-1], t_eval=t, method="rk4", step=step, **options)
    assert done.status.ok, done.message
    return done


def place(done, name, point):
    return np.array([x + R @ point for x, R in (done.mechanism.pose(q, name) for q in done.q)])


def worst(found, expected):
    return float(np.abs(np.asarray(found) - np.asarray(expected)).max())


@pytest.mark.parametrize("length", [1e-9, 1.0, 1e9])
def test_pendulums_of_all_scales_are_the_same(length):
    """After a quarter of the period it passes the lowest point. No threshold has a unit."""
    _, reference = case("pendulum_scales")
    period = reference["period"][reference["L"].index(length)]
    model = pg.Model(bodies=(mass("a", m=length**3, length=length),), **DOWN)
    t = np.array([0.0, period / 4])
    done = run(model, t, np.array([np.pi / 2]), step=period / 400)
    assert abs(done.q[-1, 0]) < 1e-8
    assert done.v[-1, 0] * np.sqrt(length / 9.81) == pytest.approx(-np.sqrt(2), abs=1e-8)


def test_double_pendulum():
    """Chaotic: 1e-13 a step grows to what is allowed here."""
    t, reference = case("double_pendulum")
    model = pg.Model(bodies=(mass("a"), mass("b", "a", above=1.0)), **DOWN)
    done = run(model, t, np.array([1.5, 0.5]), step=2.5e-4)
    assert worst(np.cumsum(done.q, axis=1), reference["theta_abs"]) < 1e-7
    assert worst(np.cumsum(done.vdot[0]), reference["theta_ddot_at_t0"]) < 1e-13
    assert done.energy[0] == pytest.approx(reference["energy"], rel=1e-14)
