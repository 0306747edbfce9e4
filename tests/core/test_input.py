"""What is given wrongly is refused with one sentence that names it."""

from __future__ import annotations

import numpy as np
import pytest

import pgraph_core as pg

MECH = pg.Mechanism(pg.Model.serial(3))
Q, V = MECH.home()
TOP = pg.Mechanism(pg.Model(bodies=(pg.Body(name="top", joint="spherical"),)))
NAN = np.array([0.0, np.nan, 0.0])
LONG = np.zeros(4)


def run(**options):
    return pg.simulate(MECH, t_end=0.01, step=1e-3, **options)


# what is called, and words that its sentence must hold
REFUSED = {
    "mass_matrix, length": (lambda: MECH.mass_matrix(LONG), ("q", "3", "4")),
    "mass_matrix, nan": (lambda: MECH.mass_matrix(NAN), ("q", "finite")),
    "mass_matrix, complex": (lambda: MECH.mass_matrix([1j, 0, 0]), ("q", "numbers")),
    "mass_matrix, zero quaternion": (lambda: TOP.mass_matrix(np.zeros(4)), ("q", "quaternion")),
    "forward_dynamics, zero quaternion": (
        lambda: TOP.forward_dynamics(np.zeros(4), np.zeros(3)),
        ("q", "quaternion"),
    ),
    "bias_force, length": (lambda: MECH.bias_force(Q, LONG), ("v", "3", "4")),
    "bias_force, nan": (lambda: MECH.bias_force(Q, NAN), ("v", "finite")),
    "bias_force, text": (lambda: MECH.bias_force("abc", V), ("q", "numbers")),
    "inverse_dynamics, vdot": (lambda: MECH.inverse_dynamics(Q, V, LONG), ("vdot", "3", "4")),
    "inverse_dynamics, nan": (lambda: MECH.inverse_dynamics(Q, V, NAN), ("vdot", "finite")),
    "forward_dynamics, tau": (lambda: MECH.forward_dynamics(Q, V, LONG), ("tau", "3", "4")),
    "forward_dynamics, q nan": (lambda: MECH.forward_dynamics(NAN, V), ("q", "finite")),
    "forward_dynamics, tau nan": (lambda: MECH.forward_dynamics(Q, V, NAN), ("tau", "finite")),
    "forward_dynamics, external": (
        lambda: MECH.forward_dynamics(Q, V, external=np.zeros((2, 6))),
        ("external", "(3, 6)", "(2, 6)"),
    ),
    "forward_dynamics, external nan": (
        lambda: MECH.forward_dynamics(Q, V, external=np.full((3, 6), np.inf)),
        ("external", "finite"),
    ),
    "constrained_dynamics, v": (lambda: MECH.constrained_dynamics(Q, LONG), ("v", "3", "4")),
    "jacobian, name": (lambda: MECH.jacobian(Q, "4"), ("'4'", "1, 2, 3")),
    "jacobian, point": (lambda: MECH.jacobian(Q, "3", (0, 0)), ("point", "3", "2")),
    "jacobian, nan": (lambda: MECH.jacobian(NAN, "3"), ("q", "finite")),
    "tip_jacobian, nan": (lambda: MECH.tip_jacobian(NAN), ("q", "finite")),
    "pose, name": (lambda: MECH.pose(Q, "paw"), ("'paw'", "1, 2, 3")),
    "pose, length": (lambda: MECH.pose(LONG, "1"), ("q", "3", "4")),
    "pose, nan": (lambda: MECH.pose(NAN, "1"), ("q", "finite")),
    "kernel_operator, length": (lambda: MECH.kernel_operator(LONG), ("q", "3", "4")),
    "simulate, q": (lambda: run(q=LONG), ("q", "3", "4")),
    "simulate, q nan": (lambda: run(q=NAN), ("q", "finite")),
    "simulate, v nan": (lambda: run(v=NAN), ("v", "finite")),
    "simulate, tau": (lambda: run(tau=LONG), ("tau", "3", "4")),
    "simulate, tau of f": (lambda: run(tau=lambda t, q, v: LONG), ("tau", "3", "4")),
    "simulate, method": (lambda: run(method="rk5"), ("rk5", "rk4")),
    "simulate, rtol of rk4": (lambda: run(method="rk4", rtol=1e-8), ("rtol", "dop853")),
    "simulate, rtol below rounding": (lambda: run(rtol=1e-17), ("rtol", "rounding", "1e-17")),
    "simulate, rtol": (lambda: run(rtol=-1.0), ("rtol", "> 0", "-1")),
    "simulate, atol": (lambda: run(atol=-1.0), ("atol", "> 0", "-1")),
    "simulate, max_steps": (lambda: run(max_steps=0), ("max_steps", ">= 1", "0")),
    "simulate, scenario": (lambda: run(scenario="walk"), ("walk", "no scenario")),
    "simulate, stabilise": (lambda: run(stabilise="hope"), ("stabilise", "project")),
    "simulate, frames": (lambda: run(frames=1), ("frames", "2")),
    "simulate, frames and t_eval": (lambda: run(frames=3, t_eval=[0]), ("frames", "t_eval")),
    "simulate, t_eval": (lambda: run(t_eval=[0, 0.005, 0.004]), ("t_eval", "ascend")),
    "simulate, too many steps": (lambda: pg.simulate(MECH, step=1e-300), ("step", "1e-300")),
    "simulate, t_end": (lambda: pg.simulate(MECH, t_end=-1.0), ("t_end", "> 0", "-1")),
    "simulate, step": (lambda: pg.simulate(MECH, step=0.0), ("step", "> 0")),
    "simulate, step nan": (lambda: pg.simulate(MECH, step=float("nan")), ("step", "nan")),
}


@pytest.mark.parametrize("case", REFUSED)
def test_refused_with_one_sentence(case):
    call, words = REFUSED[case]
    with pytest.raises(pg.PgraphError) as caught:
        call()
    text = str(caught.value)
    assert len(text.splitlines()) == 1
    for word in words:
        assert word in text


def test_lists_and_integers_are_numbers_too():
    found = MECH.forward_dynamics([0, 0, 0], (1, 0, 0), np.array([0, 0, 1]))
    expected = MECH.forward_dynamics(np.zeros(3), np.array([1.0, 0, 0]), np.array([0, 0, 1.0]))
    np.testing.assert_array_equal(found, expected)


def test_numpy_s_own_numbers_are_numbers():
    done = run(frames=np.int64(3))
    assert len(done.t) == 3
    done = pg.simulate(MECH, t_end=np.float32(0.5), step=np.float32(0.25))
    np.testing.assert_allclose(done.t, [0, 0.25, 0.5])


@pytest.mark.parametrize("grid", [[0.0], [0.005], [0.002, 0.01], (0.0, 0.01)])
def test_the_grid_that_was_asked_for_comes_back(grid):
    done = run(t_eval=grid)
    np.testing.assert_array_equal(done.t, grid)
    assert len(done.q) == len(done.energy) == len(grid)
    full = run()
    np.testing.assert_allclose(
        done.q, full.q[np.round(1e3 * np.array(grid)).astype(int)], atol=1e-9
    )


def test_quaternions_of_any_length_turn_the_same():
    q = np.array([0.9, 0.1, -0.3, 0.2])
    np.testing.assert_allclose(TOP.mass_matrix(3 * q), TOP.mass_matrix(q), atol=1e-15)


def test_arguments_are_not_changed():
    q, v, tau = np.ones(3), np.ones(3), np.ones(3)
    MECH.forward_dynamics(q, v, tau)
    pg.simulate(MECH, q, v, tau=tau, t_end=0.01, step=1e-3)
    assert (q == 1).all()
    assert (v == 1).all()
    assert (tau == 1).all()


def test_a_joint_that_moves_no_inertia_is_named():
    ghost = pg.Body(name="ghost", mass=0.0, inertia=((0.0,) * 3,) * 3)
    mech = pg.Mechanism(pg.Model(bodies=(ghost,)))
    with pytest.raises(pg.PgraphError, match="ghost"):
        mech.forward_dynamics(*mech.home())


def test_a_model_without_bodies_is_refused_or_runs_but_never_crashes():
    try:
        mech = pg.Mechanism(pg.Model())
    except pg.PgraphError:
        return
    assert mech.mass_matrix(np.zeros(0)).shape == (0, 0)
