"""Rows in any order are the same machine: the numbers of bodies change, the physics does not."""

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

import pgraph_core as pg

from .trees import random_case, scaled_error, shuffled

pytestmark = pytest.mark.quick

seeds = st.integers(0, 2**32 - 1)
SAME = 1e-12  # relative: sums over at most 12 bodies, in another order


def pair(seed):
    s = random_case(seed)
    other = shuffled(np.random.default_rng(seed), s.model)
    return s, pg.Mechanism(s.model), pg.Mechanism(other)


def order(one, other, of):
    """Return the indices of `other`'s coordinates ("q") or freedoms ("v") in those of `one`."""
    sizes = [len(getattr(one.model.body(name), of)) for name in one.names]
    places = dict(zip(one.names, np.split(np.arange(sum(sizes)), np.cumsum(sizes)[:-1])))
    return np.concatenate([places[name] for name in other.names])


def conditioned(mech, q):
    return SAME + 1e-15 * (np.linalg.cond(mech.mass_matrix(q)) if mech.nv else 1.0)


@given(seeds)
@settings(max_examples=60)
def test_joint_space_quantities_are_permuted(seed):
    s, one, other = pair(seed)
    i, j = order(one, other, "q"), order(one, other, "v")
    body = np.array([one.names.index(name) for name in other.names])
    q, v, tau, vdot, external = s.q[i], s.v[j], s.tau[j], s.vdot[j], s.external[body]
    assert scaled_error(other.mass_matrix(q), one.mass_matrix(s.q)[np.ix_(j, j)]) < SAME
    assert scaled_error(other.bias_force(q, v), one.bias_force(s.q, s.v)[j]) < SAME
    expected = one.inverse_dynamics(s.q, s.v, s.vdot, s.external)[j]
    assert scaled_error(other.inverse_dynamics(q, v, vdot, external), expected) < SAME
    found = other.forward_dynamics(q, v, tau, external)
    expected = one.forward_dynamics(s.q, s.v, s.tau, s.external)[j]
    assert scaled_error(found, expected) < conditioned(one, s.q)
    expected = one.forward_derivatives(s.q, s.v, s.tau)
    for x, y in zip(other.forward_derivatives(q, v, tau), expected):
        assert scaled_error(x, y[np.ix_(j, j)]) < conditioned(one, s.q)


@given(seeds)
@settings(max_examples=20)
def test_bodies_move_and_press_alike(seed):
    s, one, other = pair(seed)
    i, j = order(one, other, "q"), order(one, other, "v")
    body = [one.names.index(name) for name in other.names]
    found = other.body_motion(s.q[i], s.v[j], s.vdot[j], s.external[body])
    expected = one.body_motion(s.q, s.v, s.vdot, s.external)
    for x, y in zip(found, expected):
        assert scaled_error(x, y[body]) < SAME
    assert scaled_error(other.energy(s.q[i], s.v[j]), one.energy(s.q, s.v)) < SAME
    assert scaled_error(other.momentum(s.q[i], s.v[j]), one.momentum(s.q, s.v)) < SAME
    for name in one.names:
        found = other.jacobian(s.q[i], name, (0.1, -0.2, 0.3))
        assert scaled_error(found, one.jacobian(s.q, name, (0.1, -0.2, 0.3))[:, j]) < SAME


@given(seeds)
@settings(max_examples=10)
def test_runs_end_in_the_same_state(seed):
    """40 steps: rounding grows with the condition of M and with time."""
    s, one, other = pair(seed)
    i, j = order(one, other, "q"), order(one, other, "v")
    options = {"t_end": 0.01, "step": 2.5e-4, "frames": 2, "method": "rk4"}
    expected = pg.simulate(one, s.q, 0.2 * s.v, **options)
    found = pg.simulate(other, s.q[i], 0.2 * s.v[j], **options)
    bound = 10 * conditioned(one, s.q)
    assert scaled_error(found.q[-1], expected.q[-1][i]) < bound
    assert scaled_error(found.v[-1], expected.v[-1][j]) < bound
