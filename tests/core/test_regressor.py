"""Joint torques are linear in masses, mass centres and inertias (`Mechanism.regressor`)."""

import warnings

import numpy as np

import pgraph_core as pg
from pgraph_core.analysis.mobility import complement, judged
from pgraph_core.analysis.rows import Rows
from pgraph_core.dynamics.many import armature, torques

from ..random_models import random_case, random_model
from ..refusals import assert_names, refusal

# 12 bodies and a few hundred operations per number, of terms that cancel: 1e-12 of the largest
# torque, as in the tests of inverse dynamics
NEAR = 1e-12


def test_torques_of_random_trees_are_linear_in_inertial_parameters():
    for seed in range(200):
        case = random_case(seed)
        mech = pg.Mechanism(case.model)
        wanted = mech.inverse_dynamics(case.q, case.v, case.vdot) - armature(mech) * case.vdot
        found = mech.regressor(case.q, case.v, case.vdot) @ mech.inertial_parameters()
        assert np.abs(found - wanted).max(initial=0) <= NEAR * (1 + np.abs(wanted).max(initial=0))


def test_torques_of_many_states_are_those_of_each():
    for seed in range(40):
        case = random_case(seed)
        mech, rng = pg.Mechanism(case.model), np.random.default_rng(seed)
        v, a = rng.normal(size=(2, 3, mech.nv))
        q, loads = np.tile(case.q, (3, 1)), rng.normal(size=(3, mech.nb, 6))
        wanted = np.array([mech.inverse_dynamics(*state) for state in zip(q, v, a, loads)])
        found = torques(mech, q, v, a, loads)
        assert np.abs(found - wanted).max(initial=0) <= NEAR * (1 + np.abs(wanted).max(initial=0))


def looped(seed):
    """A random tree whose last body is held at a point of the world where it is."""
    rng = np.random.default_rng(seed)
    kinds = ("revolute", "universal", "spherical", "cylindrical")
    model = random_model(rng, int(rng.integers(4, 9)), kinds, armature=False)
    mech = pg.Mechanism(model)
    name = mech.names[-1]
    place = mech.pose(mech.home()[0], name).position
    held = pg.Point(name="held", body=name, point=(0, 0, 0), other_point=tuple(place))
    return pg.Mechanism(model.replace(constraints=(held,)))


def test_what_loops_permit_is_linear_in_inertial_parameters():
    """Nᵀ Y π = Nᵀ τ for velocities N that the constraints permit: their forces drop out."""
    tried = 0
    for seed in range(200):
        mech = looped(seed)
        q, rng = mech.home()[0], np.random.default_rng(seed)
        rows = Rows.of(mech, mech.packed.active, q)
        free = rows.step(complement(judged(rows)[0], mech.nv))
        if not free.shape[1]:
            continue
        v = free @ rng.normal(size=free.shape[1])
        vdot, _ = mech.constrained_dynamics(q, v, rng.normal(size=mech.nv))
        with warnings.catch_warnings(action="ignore"):
            tau = mech.constrained_inverse_dynamics(q, v, vdot)
        found = mech.regressor(q, v, vdot) @ mech.inertial_parameters()
        size = np.abs(found).max() + np.abs(tau).max()
        # the solution for τ has the condition of the rows, and the columns of N are not orthonormal
        assert np.abs(free.T @ (found - tau)).max() <= NEAR * size * (1 + np.abs(free).sum())
        tried += 1
    assert tried > 100


def test_one_state_or_many():
    mech = pg.Mechanism(pg.Model.serial(2))
    y = mech.regressor([0.1, 0.2], [0.3, 0.4], [0.5, 0.6])
    assert y.shape == (2, 20)
    assert np.array_equal(mech.regressor([[0.1, 0.2]] * 3, [0.3, 0.4], [0.5, 0.6]), [y] * 3)
    assert np.array_equal(mech.regressor({"1": 0.1, "2": 0.2}, [0.3, 0.4], [0.5, 0.6]), y)
    assert_names(str(refusal(lambda: mech.regressor([0.1, np.nan], [0, 0], [0, 0]))), "q", "finite")
