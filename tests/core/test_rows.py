"""Rows of constraints from the kernels, against the paper's operators at the same state."""

from __future__ import annotations

import numpy as np
import pytest

import pgraph_core as pg
from pgraph_core.analysis.rows import Rows, apart, turns
from pgraph_core.paper import Operators
from tests.oracle.constraint_rows import radius_of_gyration, rows_of

from .test_constraint_kinds import ROWS, case
from .trees import moved, random_case, scaled_error

ROUNDING = 1e-12  # of trees of up to twelve bodies


def kernel_rows(s, v=None, t=0.0):
    return Rows.of(pg.Mechanism(s.model), np.zeros(1, dtype=np.int64), s.q, v, t)


@pytest.mark.parametrize(("seed", "t"), [(0, 0.6), (1, 0.2), (2, 0.0), (2, 0.6), (2, 3.0)])
@pytest.mark.parametrize("kind", ROWS)
def test_rows_are_those_of_the_operators(kind, seed, t):
    """Directions normal to an axis may be any two: what they span and measure is compared."""
    s, c = case(kind, seed)
    op = Operators(s.model, s.topology, s.q, s.v)
    length = radius_of_gyration(op)
    found, expected = kernel_rows(s, s.v, t), rows_of(op, c, length, t)
    assert len(found.J) == ROWS[kind] == c.ROWS
    assert abs(found.length - length) < ROUNDING * length
    slip = expected.J @ s.v - expected.speed
    for mine, theirs in ((found.gap, expected.residual), (found.slip, slip)):
        assert scaled_error(mine @ found.J, theirs @ expected.J) < ROUNDING
        assert abs(np.linalg.norm(mine) - np.linalg.norm(theirs)) < ROUNDING * (
            1 + np.linalg.norm(theirs)
        )
    assert scaled_error(found.J.T @ found.J, expected.J.T @ expected.J) < ROUNDING


def span(vectors):
    """(3, 3) projector onto the span of rows."""
    q = np.linalg.qr(vectors.T)[0]
    return q @ q.T


@pytest.mark.parametrize("seed", range(2))
@pytest.mark.parametrize("kind", ROWS)
def test_groups_have_the_directions_of_the_operators(kind, seed):
    s, c = case(kind, seed)
    found = kernel_rows(s)
    expected = rows_of(Operators(s.model, s.topology, s.q), c, found.length).wrench
    natures = [g.nature for g in found.groups for _ in range(g.rows.start, g.rows.stop)]
    assert len(natures) == ROWS[kind]
    if kind in ("gear", "motion", "velocity"):
        assert natures == ["coordinate"]
        return
    force, torque = expected[:, 3:], expected[:, :3]
    turning = np.abs(force).max(axis=1) == 0.0
    assert [n == "rotation" for n in natures] == turning.tolist()
    for g in found.groups:
        theirs = (torque if g.nature == "rotation" else force)[g.rows]
        assert scaled_error(span(g.directions), span(theirs)) < ROUNDING
        assert np.abs(np.linalg.norm(g.directions, axis=1) - 1.0).max() < ROUNDING
        assert (g.nature == "slip") == (kind == "skate" or not g.holonomic)


@pytest.mark.parametrize("seed", range(6))
def test_a_finite_move_is_taken_back_by_its_own_size(seed):
    s = random_case(seed)
    mech, step = pg.Mechanism(s.model), 0.3 * s.v
    q = Rows.of(mech, np.zeros(0, dtype=np.int64), s.q).advanced(step)
    assert scaled_error(q, moved(s.model, s.q, step)) < ROUNDING
    assert scaled_error(apart(mech, s.q, q), step) < ROUNDING


def test_coordinates_are_angles_or_lengths():
    kinds = ("free", "spherical", "universal", "cylindrical")
    bodies = tuple(pg.Body(name=kind, joint=kind) for kind in kinds)
    found = turns(pg.Mechanism(pg.Model(bodies=bodies)))
    angles = [1, 1, 1, 0, 0, 0, *(1, 1, 1), *(1, 1), *(1, 0)]
    np.testing.assert_array_equal(found, np.array(angles, dtype=bool))
