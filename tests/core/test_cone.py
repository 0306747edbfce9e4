"""The impulse of one contact: Signorini's and Coulomb's laws, checked from their definition."""

from __future__ import annotations

import numba
import numpy as np
import pytest

from pgraph_core.engine.compiler.jit import OPTIONS
from pgraph_core.engine.compiler.lane import LANE_WIDTH, lanes
from pgraph_core.engine.contact.cone import contact

COUNT = 100 * LANE_WIDTH


@numba.njit(**OPTIONS)
def solve(own, u, old, mu, out):
    for i in range(out.shape[0]):
        now = (u[i, 0], u[i, 1], u[i, 2])
        before = (old[i, 0], old[i, 1], old[i, 2])
        out[i, 0], out[i, 1], out[i, 2] = contact(own[i], now, before, mu[i], 1.0)


@numba.njit(**OPTIONS)
def solve_in_lanes(own_, u_, old_, mu_, out_):
    own, u, old, mu, out = lanes(own_), lanes(u_), lanes(old_), lanes(mu_), lanes(out_)
    for i in range(out.shape[0]):
        now = (u[i, 0], u[i, 1], u[i, 2])
        before = (old[i, 0], old[i, 1], old[i, 2])
        one = 1.0 + 0.0 * mu[i]
        out[i, 0], out[i, 1], out[i, 2] = contact(own[i], now, before, mu[i], one)


def legs(rng):
    """Several joints, whose directions move by different amounts."""
    return rng.normal(size=(3, rng.integers(3, 12))) * 10 ** rng.uniform(-1, 1, size=(3, 1))


def planar(rng):
    """Nothing moves across the plane."""
    return np.diag([1.0, 1.0, 0.0]) @ rng.normal(size=(3, rng.integers(2, 6)))


def hinge(rng):
    """One joint, that moves the point along one oblique direction."""
    return rng.normal(size=(3, 1))


def upright(rng):
    """A slider along the normal."""
    return np.array([[1.0], [0.0], [0.0]]) * rng.uniform(0.1, 10)


def uneven(rng):
    """Mobilities from 1e-6 to 1e6."""
    return rng.normal(size=(3, 5)) * 10 ** rng.uniform(-3, 3, size=(3, 1))


def problems(kind, seed=0):
    """(own (n, 9), velocities without impulse (n, 3), μ (n,)) of contacts of any kind."""
    rng = np.random.default_rng(seed)
    maps = [kind(rng) for _ in range(COUNT)]
    own = np.array([(y @ y.T).ravel() for y in maps])
    free = np.array([y @ rng.normal(size=y.shape[1]) for y in maps])
    return own, free, 10 ** rng.uniform(-2, 0.3, COUNT)


def missed(own, free, mu, impulse):
    """How far each is from its laws, relative to its velocities."""
    u = free + np.einsum("nij,nj->ni", own.reshape(-1, 3, 3), impulse)
    size = np.abs(free).max(axis=1)
    n, t = impulse[:, 0], impulse[:, 1:]
    far = np.maximum(-u[:, 0], np.maximum(-n * own[:, 0], np.minimum(u[:, 0], n * own[:, 0])))
    rim = mu * np.maximum(n, 0.0)
    slip, drag = np.linalg.norm(u[:, 1:], axis=1), np.linalg.norm(t, axis=1)
    mobility = np.maximum(own[:, 4], own[:, 8])
    far = np.maximum(far, (drag - rim) * mobility)
    inside = np.minimum(slip, np.maximum(rim - drag, 0.0) * mobility)  # it slips, not on the rim
    against = np.where(
        drag > 0, np.linalg.norm(slip[:, None] * t + drag[:, None] * u[:, 1:], axis=1), 0
    )
    against = np.divide(against, drag, out=np.zeros_like(drag), where=drag > 0)
    return np.maximum(far, np.maximum(inside, against)) / size


@pytest.mark.parametrize("kind", [legs, planar, hinge, upright, uneven])
def test_the_impulse_of_one_contact_fits_its_laws(kind):
    own, free, mu = problems(kind)
    found = np.empty((COUNT, 3))
    solve(own, free, np.zeros((COUNT, 3)), mu, found)
    assert (found[free[:, 0] < 0, 0] > 0).all()
    assert missed(own, free, mu, found).max() < 1e-8
    if kind is legs:
        states = [(found[:, 0] == 0), np.hypot(*found[:, 1:].T) < 0.999 * mu * found[:, 0]]
        assert 0.05 < states[0].mean() < 0.7
        assert 0.01 < states[1].mean() < 0.7


def test_where_the_impulse_was_before_does_not_matter():
    own, free, mu = problems(legs)
    rng, found, again = np.random.default_rng(1), np.empty((COUNT, 3)), np.empty((COUNT, 3))
    solve(own, free, np.zeros((COUNT, 3)), mu, found)
    old = rng.normal(size=(COUNT, 3))
    moved = free + np.einsum("nij,nj->ni", own.reshape(-1, 3, 3), old)
    solve(own, moved, old, mu, again)
    scale = np.abs(found).max(axis=1, keepdims=True) + np.abs(old).max(axis=1, keepdims=True)
    assert np.abs((again - found) / scale).max() < 1e-7


def test_without_friction_there_is_none():
    own, free, _ = problems(legs)
    found = np.empty((COUNT, 3))
    solve(own, free, np.zeros((COUNT, 3)), np.zeros(COUNT), found)
    assert not found[:, 1:].any()
    np.testing.assert_allclose(found[:, 0], np.maximum(-free[:, 0] / own[:, 0], 0.0), rtol=1e-15)


def test_a_floor_that_moves_where_the_body_cannot_pulls_with_all_friction():
    """A body on a rail, the floor moves across the rail."""
    own = np.diag([1.0, 1.0, 0.0]).ravel()[None]
    found = np.empty((1, 3))
    solve(own, np.array([[-1.0, 0.01, 5.0]]), np.zeros((1, 3)), np.array([0.5]), found)
    assert np.hypot(found[0, 1], found[0, 2]) == pytest.approx(0.5 * found[0, 0], rel=1e-12)
    slip = np.array([0.01 + found[0, 1], 5.0])
    np.testing.assert_allclose(found[0, 1:] / -0.5, slip / np.linalg.norm(slip), rtol=1e-9)


@pytest.mark.parametrize("kind", [legs, planar, uneven])
def test_lanes_have_the_bits_of_numbers(kind):
    own, free, mu = problems(kind, seed=2)
    old = np.random.default_rng(3).normal(size=(COUNT, 3))
    found = np.empty((COUNT, 3))
    solve(own, free, old, mu, found)

    def side_by_side(x):
        return np.ascontiguousarray(np.moveaxis(x.reshape(-1, LANE_WIDTH, *x.shape[1:]), 1, -1))

    out = side_by_side(np.empty((COUNT, 3)))
    solve_in_lanes(*map(side_by_side, (own, free, old, mu)), out)
    np.testing.assert_array_equal(np.moveaxis(out, -1, 1).reshape(COUNT, 3), found)
