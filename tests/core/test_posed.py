"""Bodies posed by compiled kernels: what the paper's operators say of the same state at rest."""

from __future__ import annotations

import numpy as np
import pytest

import pgraph_core as pg
from pgraph_core.constraints.posed import Packed, Posed
from pgraph_core.constraints.tree import Tree
from pgraph_core.paper import Operators
from pgraph_core.paper.constraint_rows import rows_of

from .test_constraint_kinds import ROWS, case
from .trees import moved, random_case, scaled_error

ROUNDING = 1e-12  # of trees of up to twelve bodies


def at_rest(s):
    return Posed(Tree(s.model, s.topology), s.q, Packed.of(s.model))


@pytest.mark.parametrize("seed", range(12))
def test_posed_bodies_are_those_of_the_operators(seed):
    s = random_case(seed)
    posed, op = at_rest(s), Operators(s.model, s.topology, s.q)
    assert posed.nv == op.nv
    for name in ("position", "rotation", "mass_matrix", "speeds"):
        assert scaled_error(getattr(posed, name), getattr(op, name)) < ROUNDING
    point = np.array([0.3, -0.2, 0.5])
    for k in range(1, s.topology.nb + 1):
        for name in ("point_position", "point_jacobian", "point_bias"):
            found, expected = (getattr(each, name)(k, point) for each in (posed, op))
            assert scaled_error(found, expected) < ROUNDING
        assert scaled_error(posed.joint(k).H, op.joint(k).H) < ROUNDING
        assert scaled_error(posed.omega(k), op.omega(k)) == 0.0


@pytest.mark.parametrize("seed", range(4))
@pytest.mark.parametrize("kind", ROWS)
def test_rows_of_posed_bodies_are_those_of_the_operators(kind, seed):
    s, c = case(kind, seed)
    found = rows_of(at_rest(s), c, 0.3, 0.2)
    expected = rows_of(Operators(s.model, s.topology, s.q, s.v), c, 0.3, 0.2)
    for name in ("J", "residual", "speed", "wrench"):
        assert scaled_error(getattr(found, name), getattr(expected, name)) < ROUNDING


@pytest.mark.parametrize("seed", range(12))
def test_a_finite_move_is_taken_back_by_its_own_size(seed):
    s = random_case(seed)
    tree, step = Tree(s.model, s.topology), 0.3 * s.v
    q = tree.advanced(s.q, step)
    assert scaled_error(q, moved(s.model, s.q, step)) < ROUNDING
    assert scaled_error(tree.apart(s.q, q), step) < ROUNDING


def test_angles_are_told_from_lengths():
    kinds = ("free", "spherical", "universal", "cylindrical")
    bodies = tuple(pg.Body(name=kind, joint=kind) for kind in kinds)
    model = pg.Model(bodies=bodies)
    turns = Tree(model, pg.Topology.of(model)).turns
    angles = [1, 1, 1, 0, 0, 0, *(1, 1, 1), *(1, 1), *(1, 0)]
    np.testing.assert_array_equal(turns, np.array(angles, dtype=bool))
