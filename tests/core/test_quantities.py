"""Body motion, momentum, derivatives and joint friction, each against a law."""

import numpy as np
import pytest

import pgraph_core as pg
from pgraph_core.paper import Operators
from tests.core.trees import random_model, random_state, scaled_error


@pytest.mark.parametrize("seed", range(3))
def test_body_motion_equals_the_operators(seed):
    """V = Φ H v, eq. (17), and the root joints carry what gravity and motion need, eq. (22)."""
    rng = np.random.default_rng(seed)
    model = random_model(rng, 9, armature=False)  # a rotor's torque is no force between bodies
    mech = pg.Mechanism(model)
    state = random_state(rng, model)
    q, v = state.q, state.v
    vdot = rng.normal(size=mech.nv)
    motion = mech.body_motion(q, v, vdot)
    expected = Operators(model, mech.topology, q, v)
    velocity = (expected.Phi @ (expected.H @ v)).reshape(mech.nb, 6)
    assert scaled_error(motion.velocity, velocity) < 1e-12
    tau = expected.H.T @ motion.force.ravel()
    assert scaled_error(tau, mech.inverse_dynamics(q, v, vdot)) < 1e-11


def test_momentum_of_a_free_mechanism_is_kept_without_gravity():
    """Angular about the centre of mass, and linear: 1e-9 over RK4's error at 1 ms."""
    trunk = pg.Body(
        name="trunk", dof=6, com=(0.1, 0.02, 0), inertia=(0.01,) * 3, v=(1, 2, 3, 0.1, 0.2, 0.3)
    )  # fmt: skip
    arm = pg.Body(name="arm", parent="trunk", link=(0.3, 0, 0), com=(0.1, 0, 0), v=(4.0,))
    mech = pg.Mechanism(pg.Model(bodies=(trunk, arm), gravity=(0, 0, 0)))
    run = pg.simulate(mech, t_end=1.0, step=1e-3)
    start, end = mech.momentum(run.q[0], run.v[0]), mech.momentum(run.q[-1], run.v[-1])
    assert np.allclose(start, end, atol=1e-9)
    moved = mech.centre_of_mass(run.q[-1]) - mech.centre_of_mass(run.q[0])
    assert np.allclose(moved, start[3:] / 2.0 * 1.0, atol=1e-9)


def test_friction_stops_a_sliding_block_where_coulomb_says():
    """x = v0² m / (2 f). Regularisation creeps 1e-3 m/s · f/m in the last moment."""
    block = pg.Body(name="b", joint="prismatic", axes=((1, 0, 0),), mass=2.0, friction=4.0, v=(1,))
    mech = pg.Mechanism(pg.Model(bodies=(block,)))
    run = pg.simulate(mech, t_end=1.0, step=1e-4)
    assert abs(run.q[-1, 0] - 0.25) < 1e-5
    assert abs(run.v[-1, 0]) < 1e-9
    assert abs(run.dissipation[-1] - 1.0) < 1e-9
    assert run.energy_drift < 1e-9


def test_friction_holds_a_block_on_a_slope_but_for_a_creep():
    """Below the limit the block creeps at v = creep · r / √(1 - r²), r = load / friction."""
    block = pg.Body(name="b", joint="prismatic", axes=((1, 0, 0),), mass=1.0, friction=10.0)
    mech = pg.Mechanism(pg.Model(bodies=(block,), gravity=(6.0, 0, 0)))
    run = pg.simulate(mech, t_end=0.1, step=1e-5, frames=3, method="rk4")
    assert abs(run.v[-1, 0] - 1e-3 * 0.6 / 0.8) < 1e-7
