"""Instances of a batch against single runs, to rounding."""

import numpy as np
import pytest

import pgraph_core as pg
from pgraph_core.engine.compiler.lane import LANE_WIDTH
from tests.core.trees import random_case

pytestmark = pytest.mark.quick


def states(mech, size, seed=0):
    rng = np.random.default_rng(seed)
    q, _ = mech.home()
    qs = np.repeat(q[None], size, axis=0) + 0.3 * rng.normal(size=(size, mech.nq))
    for body in mech.model.bodies:
        if body.dof in (3, 6):  # a quaternion at the end of its coordinates
            k = mech.joints[body.name].q.stop
            qs[:, k - 4 : k] /= np.linalg.norm(qs[:, k - 4 : k], axis=1)[:, None]
    return qs, rng.normal(size=(size, mech.nv)), rng.normal(size=(size, mech.nv))


def assert_close(a, b, tolerance):
    assert np.max(np.abs(a - b)) <= tolerance * max(1.0, np.max(np.abs(b)))


@pytest.mark.parametrize("seed", [0, 2, 6])  # others lack inertia at home
def test_forward_and_inverse_dynamics_of_random_forests(seed):
    """1e-11: condition of the mass matrices of random forests with all joint kinds."""
    mech = pg.Mechanism(random_case(seed).model)
    qs, vs, taus = states(mech, LANE_WIDTH + 1, seed)
    batch = pg.BatchStepper(mech, len(qs))
    batch.reset(qs, vs)
    vdots = batch.acceleration(taus)
    assert_close(vdots, np.array([mech.forward_dynamics(*row) for row in zip(qs, vs, taus)]), 1e-11)
    assert_close(batch.inverse_dynamics(vdots), taus, 1e-10)


def balls():
    free = pg.Body(name="a", dof=6, com=(0.1, 0, 0), inertia=(0.01,) * 3)
    return pg.Model(
        bodies=(free, pg.Body(name="3", parent="a", dof=3, link=(0.2, 0, 0), inertia=(0.01,) * 3))
    )


def loaded():
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


@pytest.mark.parametrize(
    ("model", "size", "method"),
    [(pg.Model.serial(5), 1, "rk4"), (pg.Model.serial(5), 3 * LANE_WIDTH + 1, "rk4"),
     (balls(), LANE_WIDTH - 1, "rk4"), (loaded(), LANE_WIDTH + 1, "semi_implicit_euler"),
     (loaded(), LANE_WIDTH + 1, "rk4")],
)  # fmt: skip
def test_instances_equal_single_runs(model, size, method):
    """Masses differ, and one instance starts again while the others are at another time."""
    masses = 1.0 + 0.2 * np.arange(size)
    given = {"step": 1e-3, "method": method}
    batch = pg.BatchStepper(model, size, set={"bodies.3.mass": masses}, **given)
    qs, vs, taus = states(pg.Mechanism(model), size)
    batch.reset(qs, vs)
    batch.step(taus, n=40)
    batch.reset(qs[:1], vs[:1], which=[0])
    assert batch.step(taus, n=60).all()
    vdots = batch.acceleration(taus)
    for i, mass in enumerate(masses):
        t_end = 0.1 if i else 0.06
        one = pg.simulate(
            model.edit("3", mass=mass), qs[i], vs[i], tau=taus[i], t_end=t_end, frames=2, **given
        )
        assert_close(batch.q[i], one.q[-1], 1e-11)
        assert_close(batch.v[i], one.v[-1], 1e-10)
        assert_close(vdots[i], one.vdot[-1], 1e-9)
        assert_close(batch.work[i], one.work[-1], 1e-11)
