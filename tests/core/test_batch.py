"""Batches: what runs over lanes and cores equals what runs alone, to rounding."""

import numpy as np
import pytest

import pgraph_core as pg
from pgraph_core.engine.compiler.elementary import sine_cosine
from pgraph_core.engine.compiler.lane import LANE_WIDTH, lanes
from tests.core.trees import random_case

SIZES = (1, LANE_WIDTH - 1, LANE_WIDTH, 3 * LANE_WIDTH + 1)


def states(mech, size, seed=0):
    """Random states and torques of `size` instances."""
    rng = np.random.default_rng(seed)
    q, _ = mech.home()
    qs = np.repeat(q[None], size, axis=0) + 0.3 * rng.normal(size=(size, mech.nq))
    return qs, rng.normal(size=(size, mech.nv)), rng.normal(size=(size, mech.nv))


def pendulum_chain(n=5):
    return pg.Mechanism(pg.Model.serial(n))


def close(a, b, tolerance):
    assert np.max(np.abs(a - b)) <= tolerance * max(1.0, np.max(np.abs(b)))


@pytest.mark.parametrize("seed", range(6))
def test_forward_and_inverse_dynamics_of_random_forests(seed):
    """1e-11: condition of the mass matrices of random forests with all joint kinds."""
    mech = pg.Mechanism(random_case(seed).model)
    qs, vs, taus = states(mech, LANE_WIDTH + 1, seed)
    batch = mech.batch(len(qs))
    vdots = batch.forward_dynamics(qs, vs, taus)
    alone = [mech.forward_dynamics(*row) for row in zip(qs, vs, taus)]
    close(vdots, np.array(alone), 1e-11)
    close(batch.inverse_dynamics(qs, vs, vdots), taus, 1e-10)


@pytest.mark.parametrize("method", ["semi_implicit_euler", "rk4"])
@pytest.mark.parametrize("size", SIZES)
def test_runs_equal_single_runs(size, method):
    mech = pendulum_chain()
    qs, vs, taus = states(mech, size)
    options = {"t_end": 0.1, "step": 1e-3, "method": method, "frames": 3}
    many = pg.simulate_batch(mech, qs, vs, tau=taus, **options)
    assert many.finite.all()
    for i in range(size):
        one = pg.simulate(mech, qs[i], vs[i], tau=taus[i], **options)
        close(many.q[i], one.q, 1e-12)
        close(many.v[i], one.v, 1e-11)


def test_free_and_ball_joints_keep_unit_quaternions_and_equal_single_runs():
    free = pg.Body(name="a", dof=6, com=(0.1, 0, 0))
    ball = pg.Body(name="b", parent="a", dof=3, link=(0.2, 0, 0), com=(0.1, 0.05, 0))
    mech = pg.Mechanism(pg.Model(bodies=(free, ball)))
    q, _ = mech.home()
    vs = np.random.default_rng(1).normal(size=(4, mech.nv))
    qs = np.repeat(q[None], 4, axis=0)
    many = pg.simulate_batch(mech, qs, vs, t_end=0.5, step=1e-3)
    for i in range(4):
        one = pg.simulate(mech, qs[i], vs[i], t_end=0.5, step=1e-3, frames=2)
        close(many.q[i], one.q, 1e-12)
    assert np.allclose(np.linalg.norm(many.q[:, :, 3:7], axis=-1), 1, atol=1e-14)


def test_parameters_differ_per_instance():
    base = pg.Model.serial(3)
    models = [base.edit("2", mass=0.5 + 0.1 * i) for i in range(LANE_WIDTH + 2)]
    mech = pg.Mechanism(base)
    qs, vs, taus = states(mech, len(models))
    vdots = mech.batch(models=models).forward_dynamics(qs, vs, taus)
    alone = [pg.Mechanism(m).forward_dynamics(*r) for m, *r in zip(models, qs, vs, taus)]
    close(vdots, np.array(alone), 1e-12)


def loaded():
    """A chain with all kinds of loads, and a ball joint."""
    wind = pg.VectorTable(t=(0.0, 0.02, 0.05), value=((0, 0, 0), (3, 2, 1), (-4, 0, 2)))
    where = {"body": "4", "other": "1"}
    loads = (
        pg.Force(name="w", kind="wrench", body="3", force=wind, frame="body", point=(0.1, 0, 0.2)),
        pg.Force(name="x", kind="wrench", body="2", torque=(1, 2, 3)),
        pg.Force(name="s", kind="spring", **where, stiffness=80, damping=2, rest=0.3),
        pg.Force(name="g", kind="spring", body="3", stiffness=30, other_point=(1, 2, 0.5)),
        pg.Force(name="t", kind="torsion", **where, axis=(1, 2, 3), stiffness=7, damping=1),
        pg.Force(name="m", body="2", torque=0.5),
    )
    model = pg.Model.serial(4).edit("4", joint="spherical")
    for name in "1234":
        model = model.edit(name, inertia=((0.1, 0, 0), (0, 0.1, 0), (0, 0, 0.1)))
    return pg.Mechanism(model.replace(forces=loads))


@pytest.mark.parametrize("method", ["semi_implicit_euler", "rk4"])
def test_wrenches_and_springs_between_bodies_act_in_lanes(method):
    mech = loaded()
    qs, vs, taus = states(mech, LANE_WIDTH + 1)
    batch = mech.batch(len(qs))
    vdots = batch.forward_dynamics(qs, vs, taus)
    close(vdots, np.array([mech.forward_dynamics(*row) for row in zip(qs, vs, taus)]), 1e-12)
    close(batch.inverse_dynamics(qs, vs, vdots), taus, 1e-11)
    options = {"t_end": 0.1, "step": 1e-3, "method": method, "frames": 3}
    many = pg.simulate_batch(mech, qs, vs, tau=taus, **options)
    for i in range(len(qs)):
        one = pg.simulate(mech, qs[i], vs[i], tau=taus[i], **options)
        close(many.q[i], one.q, 1e-11)


def test_instances_with_masses_of_their_own_share_the_loads():
    mech = loaded()
    models = [mech.model.edit("3", mass=1.0 + i) for i in range(3)]
    qs, vs, taus = states(mech, 3)
    vdots = mech.batch(models=models).forward_dynamics(qs, vs, taus)
    alone = [pg.Mechanism(m).forward_dynamics(*r) for m, *r in zip(models, qs, vs, taus)]
    close(vdots, np.array(alone), 1e-12)


HELD = pg.Constraint(name="hold", body="3", kind="point")


@pytest.mark.parametrize(
    ("model", "what"),
    [
        (pg.Model.serial(3).replace(constraints=(HELD,)), "the constraint 'hold'"),
        (pg.Model.serial(3).edit("2", limits=(-1.0, 1.0)), "limits of the joint of '2'"),
    ],
)
def test_what_a_batch_leaves_out_must_be_said(model, what):
    mech = pg.Mechanism(model)
    q, v = (np.repeat(x[None], 2, axis=0) for x in mech.home())
    expected = (
        f"batch, constraints: a batch is made of trees, but the model has {what}; give "
        "constraints='ignore' to run without, or use simulate for one instance at a time"
    )
    for asked in (lambda: mech.batch(2), lambda: pg.simulate_batch(mech, q, v, t_end=0.01)):
        with pytest.raises(pg.InputError) as error:
            asked()
        assert str(error.value) == expected
    with pytest.raises(pg.InputError) as error:
        mech.batch(2, constraints="impose")
    text = "batch, constraints: is 'impose'; choose one of ignore, or leave it out"
    assert str(error.value) == text
    free = pg.simulate_batch(mech, q, v, t_end=0.01, constraints="ignore")
    tree = pg.Mechanism(pg.Model.serial(3))
    alone = pg.simulate_batch(tree, q, v, t_end=0.01)
    assert np.array_equal(free.q, alone.q)


def test_springs_and_dampers_act_as_in_the_mechanism():
    model = pg.Model.serial(3).edit("2", stiffness=20.0, damping=0.3, rest=0.1)
    mech = pg.Mechanism(model)
    qs, vs, taus = states(mech, 3)
    vdots = mech.batch(3).forward_dynamics(qs, vs, taus)
    close(vdots, np.array([mech.forward_dynamics(*r) for r in zip(qs, vs, taus)]), 1e-12)
    close(mech.batch(3).inverse_dynamics(qs, vs, vdots), taus, 1e-11)


def test_one_thread_and_two_give_the_same_bits():
    mech = pendulum_chain()
    qs, vs, taus = states(mech, 5 * LANE_WIDTH)
    runs = [
        pg.simulate_batch(mech, qs, vs, tau=taus, t_end=0.05, threads=threads).q
        for threads in (1, 2)
    ]
    assert np.array_equal(*runs)


def test_an_instance_that_blows_up_leaves_the_others_alone():
    mech = pendulum_chain(2)
    qs, vs, _ = states(mech, 3)
    vs[1] = 1e200
    many = pg.simulate_batch(mech, qs, vs, t_end=0.1)
    assert many.finite.tolist() == [True, False, True]


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


@pytest.mark.parametrize(
    ("call", "sentence"),
    [
        (lambda m: m.batch(0), "batch, size: must be a whole number >= 1; given 0"),
        (
            lambda m: m.batch(2, models=[m.model]),
            "batch, size: is 2, but 1 models are given",
        ),
        (
            lambda m: m.batch(models=[pg.Model.serial(9)]),
            "models[0]: has another tree or other joints than the mechanism; give models like it",
        ),
        (
            lambda m: m.batch(models=[m.model.edit("2", stiffness=1.0)]),
            "models[0]: has other springs, motors or forces than the mechanism; those are shared",
        ),
        (
            lambda m: m.batch(2).forward_dynamics(np.zeros((2, 4)), np.zeros((2, 5))),
            "q: must have shape (2, 5); given (2, 4)",
        ),
    ],
)
def test_refused_with_one_sentence(call, sentence):
    with pytest.raises(pg.InputError) as caught:
        call(pendulum_chain())
    assert str(caught.value) == sentence
