"""Instances of a batch against single runs, to rounding."""

import numpy as np
import pytest

import pgraph_core as pg
from pgraph_core.engine.compiler.elementary import sine_cosine
from pgraph_core.engine.compiler.lane import LANE_WIDTH, lanes
from tests.core.trees import random_case


def states(mech, size, seed=0):
    """Random states and torques of `size` instances."""
    rng = np.random.default_rng(seed)
    q, _ = mech.home()
    qs = np.repeat(q[None], size, axis=0) + 0.3 * rng.normal(size=(size, mech.nq))
    for body in mech.model.bodies:
        if body.dof in (3, 6):  # a quaternion at the end of its coordinates
            k = mech.joints[body.name].q.stop
            qs[:, k - 4 : k] /= np.linalg.norm(qs[:, k - 4 : k], axis=1)[:, None]
    return qs, rng.normal(size=(size, mech.nv)), rng.normal(size=(size, mech.nv))


def batch_at(mech, qs, vs, **options):
    """A batch in these states."""
    batch = pg.BatchStepper(mech, len(qs), **options)
    batch.reset(qs, vs)
    return batch


def close(a, b, tolerance):
    assert np.max(np.abs(a - b)) <= tolerance * max(1.0, np.max(np.abs(b)))


@pytest.mark.parametrize("seed", [0, 2, 6])  # the others lack inertia at home
def test_forward_and_inverse_dynamics_of_random_forests(seed):
    """1e-11: condition of the mass matrices of random forests with all joint kinds."""
    mech = pg.Mechanism(random_case(seed).model)
    qs, vs, taus = states(mech, LANE_WIDTH + 1, seed)
    batch = batch_at(mech, qs, vs)
    vdots = batch.acceleration(taus)
    close(vdots, np.array([mech.forward_dynamics(*row) for row in zip(qs, vs, taus)]), 1e-11)
    close(batch.inverse_dynamics(vdots), taus, 1e-10)


def free_and_ball():
    free = pg.Body(name="a", dof=6, com=(0.1, 0, 0))
    ball = pg.Body(name="b", parent="a", dof=3, link=(0.2, 0, 0), com=(0.1, 0.05, 0))
    return pg.Model(bodies=(free, ball))


@pytest.mark.parametrize("model", [pg.Model.serial(5), free_and_ball()], ids=["hinges", "balls"])
@pytest.mark.parametrize(
    ("size", "method"),
    [(1, "rk4"), (LANE_WIDTH - 1, "semi_implicit_euler"), (3 * LANE_WIDTH + 1, "rk4")],
)
def test_steps_equal_single_runs(model, size, method):
    mech = pg.Mechanism(model)
    qs, vs, taus = states(mech, size)
    batch = batch_at(mech, qs, vs, step=1e-3, method=method)
    assert batch.step(taus, n=100).all()
    for i in range(size):
        one = pg.simulate(mech, qs[i], vs[i], tau=taus[i], t_end=0.1, step=1e-3, method=method)
        close(batch.q[i], one.q[-1], 1e-12)
        close(batch.v[i], one.v[-1], 1e-11)
        close(batch.work[i], one.work[-1], 1e-12)
    for joint in (mech.joints[b.name].q for b in mech.model.bodies if b.dof in (3, 6)):
        unit = np.linalg.norm(batch.q[:, joint.stop - 4 : joint.stop], axis=-1)
        np.testing.assert_allclose(unit, 1, atol=1e-13)


def loaded():
    """A chain with all kinds of loads, a motor by a table, and a ball joint."""
    wind = pg.VectorTable(t=(0.0, 0.02, 0.05), value=((0, 0, 0), (3, 2, 1), (-4, 0, 2)))
    where = {"body": "4", "other": "1"}
    loads = (
        pg.Force(name="w", kind="wrench", body="3", force=wind, frame="body", point=(0.1, 0, 0.2)),
        pg.Force(name="x", kind="wrench", body="2", torque=(1, 2, 3)),
        pg.Force(name="s", kind="spring", **where, stiffness=80, damping=2, rest=0.3),
        pg.Force(name="g", kind="spring", body="3", stiffness=30, other_point=(1, 2, 0.5)),
        pg.Force(name="t", kind="torsion", **where, axis=(1, 2, 3), stiffness=7, damping=1),
        pg.Motor(name="m", body="2", torque=pg.Table(t=(0, 0.1), value=(0.5, 0.7))),
    )
    model = pg.Model.serial(4).edit("4", joint="spherical").edit("1", stiffness=20.0, damping=0.3)
    for name in "1234":
        model = model.edit(name, inertia=((0.1, 0, 0), (0, 0.1, 0), (0, 0, 0.1)))
    return model.replace(forces=loads)


def test_all_forces_act_at_the_time_of_each_instance():
    """Masses differ; one instance starts again while the others are at another time."""
    masses = 1.0 + 0.2 * np.arange(LANE_WIDTH + 1)
    given = {"step": 1e-3, "method": "rk4"}
    model = loaded()
    batch = pg.BatchStepper(model, len(masses), set={"bodies.3.mass": masses}, **given)
    qs, vs, taus = states(pg.Mechanism(model), len(masses))
    batch.reset(qs, vs)
    batch.step(taus, n=40)
    batch.reset(qs[2], vs[2], which=[2])
    batch.step(taus, n=60)
    vdots = batch.acceleration(taus)
    for i, mass in enumerate(masses):
        mech = pg.Mechanism(model.edit("3", mass=mass))
        one = pg.simulate(
            mech, qs[i], vs[i], tau=taus[i], t_end=0.06 if i == 2 else 0.1, frames=2, **given
        )
        close(batch.q[i], one.q[-1], 1e-11)
        close(vdots[i], one.vdot[-1], 1e-9)
        close(batch.work[i], one.work[-1], 1e-11)


def test_accelerations_with_loops_are_those_of_single_runs():
    """A pendulum of three links whose end is held."""
    held = pg.Constraint(name="hold", body="3", kind="point")
    mech = pg.Mechanism(pg.Model.serial(3).replace(constraints=(held,)))
    batch = pg.BatchStepper(mech, 2)
    taus = np.array([[1.0, -2.0, 0.5], [0.0, 0.3, 0.1]])
    expected = [mech.constrained_dynamics(*mech.home(), tau)[0] for tau in taus]
    close(batch.acceleration(taus), np.array(expected), 1e-12)
    with pytest.raises(pg.InputError, match="inverse_dynamics"):
        batch.inverse_dynamics(taus)


def test_sine_and_cosine_together_of_lanes_and_of_numbers():
    """One ulp below 1, up to 1e4 rad; of numbers at any distance, by an exact reduction."""
    import numba

    @numba.njit(_nrt=False)
    def both(x, s, c):
        a, b, d = lanes(x), lanes(s), lanes(c)
        for i in range(a.shape[0]):
            b[i], d[i] = sine_cosine(a[i])

    @numba.njit(_nrt=False)
    def each(x, s, c):
        for i in range(x.shape[0]):
            s[i], c[i] = sine_cosine(x[i])

    x = np.random.default_rng(0).uniform(-1e4, 1e4, (2000, LANE_WIDTH))
    x[0] = 0.0
    far = np.concatenate((x.ravel(), [1e-300, 1e5, -3e7, 1e300, -np.inf, np.nan]))
    for function, angles in ((both, x), (each, far)):
        s, c = np.empty_like(angles), np.empty_like(angles)
        function(angles, s, c)
        with np.errstate(invalid="ignore"):
            np.testing.assert_allclose(s, np.sin(angles), rtol=0, atol=1.2e-16)
            np.testing.assert_allclose(c, np.cos(angles), rtol=0, atol=1.2e-16)
