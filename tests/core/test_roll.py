"""A joint that rolls along a line, beside a screw's law for a turn and beside a curve."""

import math

import numpy as np
import pytest

import pgraph_core as pg
from pgraph_core.joints import beside
from pgraph_core.paper import Operators

PITCH = 0.3  # [m a turn]: a wheel of radius PITCH / 2π
AXIS = np.array((0.2, -0.5, 0.8)) / np.linalg.norm((0.2, -0.5, 0.8))


def chain(middle):
    """A joint between two hinges."""
    inertia = np.diag((0.02, 0.03, 0.04))
    arm = pg.Body(name="arm", joint="revolute", axes=(0, 1, 0), mass=1.0, com=(0.1, 0, 0),
                  inertia=inertia, q=0.4, v=1.0)  # fmt: skip
    wheel = pg.Body(name="wheel", parent="arm", link=(0.3, 0.1, 0), mass=2.0, com=(0.02, 0.05, 0.1),
                    inertia=inertia, q=0.7, v=-2.0, **middle)  # fmt: skip
    hand = pg.Body(name="hand", parent="wheel", joint="revolute", axes=(1, 0, 0), mass=0.5,
                   link=(0, 0.2, 0.1), com=(0, 0.1, 0), inertia=inertia, v=3.0)  # fmt: skip
    return pg.Model(bodies=[arm, wheel, hand])


ROLL = {"joint": "roll", "axes": AXIS, "pitch": PITCH}


def test_a_wheel_rolls_its_circumference_in_a_turn_across_its_axis():
    wheel = pg.Body(name="wheel", mass=1.0, inertia=np.eye(3), **ROLL)
    run = pg.simulate(pg.Model(bodies=[wheel], gravity=(0, 0, 0)), v=[2 * math.pi], t_end=1.0)
    way = run.position("wheel")[-1] - run.position("wheel")[0]
    assert np.linalg.norm(way) == pytest.approx(PITCH, rel=1e-9)
    assert way @ AXIS == pytest.approx(0.0, abs=1e-12)


def test_its_motion_is_that_of_a_curve_and_of_the_operators_of_the_paper():
    way = PITCH / math.tau * beside(AXIS)
    line = {axis: f"{x:.17g}*q" for axis, x in zip("xyz", way.tolist())}
    track = pg.Track(**line, angles=["q"], axes=[tuple(AXIS)], range=(-3.0, 3.0))
    mech, other = (pg.Mechanism(chain(x)) for x in (ROLL, {"joint": "curve", "track": track}))
    q, v, tau = np.array(((0.4, 0.7, -0.3), (1.0, -2.0, 3.0), (0.1, 0.2, 0.3)))
    vdot = mech.forward_dynamics(q, v, tau)
    np.testing.assert_allclose(vdot, other.forward_dynamics(q, v, tau), rtol=1e-9)
    M, C = mech.mass_matrix(q), mech.bias_force(q, v)
    np.testing.assert_allclose(M @ vdot + C, tau, atol=1e-12)
    ops = Operators(mech.model, mech.topology, q, v)
    np.testing.assert_allclose(ops.mass_matrix, M, atol=1e-12)
    np.testing.assert_allclose(ops.bias_force, C, atol=1e-12)
    for one, two in zip(mech.forward_derivatives(q, v, tau), other.forward_derivatives(q, v, tau)):
        np.testing.assert_allclose(one, two, rtol=1e-7, atol=1e-7)


def test_its_energy_is_conserved():
    run = pg.simulate(chain(ROLL), t_end=0.05, step=1e-3, method="rk4")
    assert np.ptp(run.energy) < 1e-7
