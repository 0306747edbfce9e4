"""The impulse of a single block keeps its law, whatever the impulse before."""

from __future__ import annotations

import numpy as np
import pytest

from pgraph_core.engine import layout as at
from pgraph_core.engine.compiler.jit import kernel
from pgraph_core.engine.compiler.kinds import F1, F2, i8
from pgraph_core.engine.contact.sweeps import answer


@kernel(i8(i8, i8, F2, F1, F1, F1, F1))
def ask(kind, rows, own, bounds, u, old, out):
    """Write λ of a block of Ω `own`, whose velocity is u for the `old` λ."""
    three = (u[0], u[1], u[2]), (old[0], old[1], old[2])
    x = answer(kind, rows, (bounds[0], bounds[1]), 0, own, three[0], three[1])
    out[0], out[1], out[2] = x[0], x[1], x[2]
    return 0


def blocks(kind, rows):
    """(Ω, bounds, velocity without impulses, velocity at the old λ, λ) of random blocks."""
    dice = np.random.default_rng(kind)
    for _ in range(300):
        spread = dice.normal(size=(3, 3)) * 10.0 ** dice.uniform(-1, 1, 3)[:, None]
        own = spread @ spread.T + 0.1 * np.diag(np.diag(spread @ spread.T))
        bounds, old, free = dice.uniform(0, 1, 2), dice.normal(size=3), dice.normal(size=3)
        if kind == at.T_CONTACT:
            bounds[1] = 0.0
        old[rows:] = 0.0
        u, found = free + own @ old, np.zeros(3)
        ask(kind, rows, own.reshape(1, 9), bounds, u, old, found)
        yield own, bounds, u, old, found


def assert_in_disc(pull, slip, radius, size):
    """Friction holds, or is at its bound against the slip."""
    force, speed = np.linalg.norm(pull), np.linalg.norm(slip)
    assert force <= radius * (1 + 1e-9)
    if speed > 1e-9 * size:
        np.testing.assert_allclose(pull, -radius * slip / speed, atol=1e-7 * radius)


def test_a_contact_keeps_the_laws_of_signorini_and_coulomb():
    for own, (mu, _), u, old, found in blocks(at.T_CONTACT, 3):
        after = u + own @ (found - old)
        size = abs(u).max() + abs(own).max() * abs(found - old).max()
        assert found[0] >= 0.0
        assert after[0] >= -1e-9 * size
        assert found[0] * after[0] <= 1e-9 * size * max(found[0], 1.0)
        assert_in_disc(found[1:], after[1:], mu * found[0], size)


def test_torques_at_a_contact_stay_within_their_bounds_against_the_turn():
    """First about the normal, at the old torques across it, then these."""
    for own, (spinning, rolling), u, old, found in blocks(at.T_TURN, 3):
        size = abs(u).max() + abs(own).max() * abs(found - old).max()
        spun = u[0] + own[0, 0] * (found[0] - old[0])
        assert abs(found[0]) <= spinning
        if abs(spun) > 1e-9 * size:
            assert found[0] == pytest.approx(-spinning * np.sign(spun))
        assert_in_disc(found[1:], (u + own @ (found - old))[1:], rolling, size)


@pytest.mark.parametrize("kind", [at.T_LIMIT, at.T_FRICTION])
def test_one_row_keeps_its_law(kind):
    """A limit only pushes, and joint friction is within its bound."""
    for own, (most, _), u, old, found in blocks(kind, 1):
        after, x = u[0] + own[0, 0] * (found[0] - old[0]), found[0]
        if kind == at.T_LIMIT:
            assert x >= 0.0
            assert after > -1e-9
            assert x * after == pytest.approx(0.0, abs=1e-9)
        else:
            assert abs(x) <= most
            assert abs(after) < 1e-9 or x == pytest.approx(-most * np.sign(after))
