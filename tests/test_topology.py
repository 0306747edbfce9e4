"""Numbers, Pgraph and jdof: the paper's vectors, and laws on random forests."""

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

import pgraph_core as pg
import pgraph_models
from pgraph_core.numbering import children_of
from pgraph_core.topology import find

pytestmark = pytest.mark.quick

FIG1 = [0, 1, 2, 2, 3, 2, 6]  # the parents of bodies 1 to 7


@st.composite
def forests(draw, roots: int | None = None, largest: int = 40) -> list[int]:
    """Parents by number, in any order: a canonical forest with its numbers permuted."""
    n = draw(st.integers(1, largest))
    parents = [draw(st.integers(0 if roots is None else 1, i)) if i else 0 for i in range(n)]
    new = draw(st.permutations(range(1, n + 1)))
    permuted = [0] * n
    for i, p in enumerate(parents):
        permuted[new[i] - 1] = new[p - 1] if p else 0
    return permuted


def model_of(parent: list[int]) -> pg.Model:
    above = [str(p) if p else "ground" for p in parent]
    rows = [pg.Body(name=str(i), parent=p, dof=i % 7) for i, p in enumerate(above, 1)]
    return pg.Model(bodies=rows)


def test_fig1():
    """The built-in model keeps the numbers of the figure, which are canonical."""
    topology = pg.Topology.of(pg.Model.load(pgraph_models.path("fig1_tree")))
    assert topology.parent.tolist() == FIG1
    assert topology.names == ("1", "2", "3", "4", "5", "6", "7")
    assert topology.pgraph.tolist() == pg.pgraph_of(FIG1).tolist() == [1, 2, 3, 5, 2, 4, 2, 6, 7]
    assert topology.jdof.tolist() == [1, 1, 1, 1, 0, 1, 0, 1, 1]
    assert topology.tips.tolist() == [4, 5, 7]
    assert topology.separation_bodies.tolist() == [2]


def test_fig9_the_quadruped():
    topology = pg.Topology.of(pg.Model.load(pgraph_models.path("quadruped")))
    fig9 = [1, 2, 3, 4, 5, 6, 7, 4, 8, 9, 10, 1, 11, 12, 13, 1, 14, 15, 16]
    assert topology.pgraph.tolist() == fig9
    assert topology.jdof.tolist() == [6, 1, 1, 1, 1, 1, 1, 0, 1, 1, 1, 0, 1, 1, 1, 0, 1, 1, 1]
    assert topology.tips.tolist() == [7, 10, 13, 16]
    assert topology.separation_bodies.tolist() == [1, 4]


def test_fig1_adjacency_is_eq_4():
    eq4 = np.zeros((7, 7))
    for child, parent in ((2, 1), (3, 2), (4, 2), (5, 3), (6, 2), (7, 6)):
        eq4[child - 1, parent - 1] = 1
    assert np.array_equal(pg.Topology.of(model_of(FIG1)).adjacency().toarray(), eq4)


@pytest.mark.parametrize(
    ("parent", "pgraph"),
    [
        ([], []),
        ([0], [1]),
        ([0, 1, 2], [1, 2, 3]),
        ([0, 0], [0, 1, 0, 2]),
        ([0, 1, 0], [0, 1, 2, 0, 3]),  # two roots: the ground is the first separation body
        ([0, 1, 1, 1], [1, 2, 1, 3, 1, 4]),  # three children
        ([0, 1, 2, 2, 1], [1, 2, 3, 2, 4, 1, 5]),  # nested separation bodies
        ([2, 3, 0], [3, 2, 1]),  # not canonical
    ],
)
def test_small_graphs(parent: list[int], pgraph: list[int]):
    assert pg.pgraph_of(parent).tolist() == pgraph
    assert pg.parent_of(pgraph).tolist() == parent


def test_a_weld_is_no_reentry():
    """R2: the 0 of body 2's weld and the 0 of its re-entry differ by their place alone."""
    pgraph = pg.pgraph_of([0, 1, 2, 2])
    assert pgraph.tolist() == [1, 2, 3, 2, 4]
    assert pg.jdof_of(pgraph, [6, 0, 1, 1]).tolist() == [6, 0, 1, 0, 1]
    assert find(pgraph).tolist() == [0, 1, 2, 4]


def test_the_ground_of_a_forest_has_no_dof():
    model = pg.Model(bodies=(pg.Body(name="a"), pg.Body(name="b", parent="a"), pg.Body(name="c")))
    topology = pg.Topology.of(model)
    assert topology.pgraph.tolist() == [0, 1, 2, 0, 3]
    assert topology.jdof.tolist() == [0, 1, 1, 0, 1]
    assert topology.separation_bodies.tolist() == []


def test_a_chain_of_twenty_thousand_needs_no_recursion():
    n = 20_000
    parent = list(range(n))
    assert pg.parent_of(pg.pgraph_of(parent)).tolist() == parent


def test_a_model_without_bodies():
    topology = pg.Topology.of(pg.Model())
    assert topology.nb == 0
    assert topology.pgraph.tolist() == topology.tips.tolist() == []
    assert pg.Mechanism(pg.Model()).mass_matrix([]).shape == (0, 0)


@given(forests())
def test_pgraph_and_jdof_of_any_forest(parent: list[int]):
    """The tree comes back from Pgraph, whose length, zeros of jdof and order follow the tree."""
    pgraph = pg.pgraph_of(parent)
    assert pg.parent_of(pgraph).tolist() == parent
    roots, leaves = parent.count(0), len(parent) - len(set(parent) - {0})
    if roots == 1:
        assert len(pgraph) == len(parent) + leaves - 1
    dof = np.arange(1, len(parent) + 1)
    jdof = pg.jdof_of(pgraph, dof)
    assert len(jdof) == len(pgraph)
    assert np.count_nonzero(jdof) == len(set(pgraph.tolist()) - {0}) == len(parent)
    assert jdof.sum() == dof.sum()
    order = {int(k): i for i, k in enumerate(pgraph[find(pgraph)])}
    for k, children in enumerate(children_of(parent)):
        assert [order[c] for c in children] == sorted(order[c] for c in children)  # left first
        after = [int(pgraph[i + 1]) for i in np.flatnonzero(pgraph[:-1] == k)]
        assert not children or (k == 0 and roots == 1) or set(after) == set(children)


@settings(max_examples=40)
@given(forests())
def test_numbers_follow_the_rows_and_a_row_waits_for_its_parents(parent: list[int]):
    """Each row comes when the lowest row on its path to the ground does."""
    topology = pg.Topology.of(model_of(parent))
    assert all(p < i for i, p in enumerate(topology.parent.tolist(), 1))
    for number, name in enumerate(topology.names, 1):
        up = parent[int(name) - 1]
        assert topology.parent[number - 1] == topology.number(str(up) if up else "ground")

    def ready(row: int) -> int:
        return max(row, ready(parent[row - 1])) if row else 0

    came = [ready(int(name)) for name in topology.names]
    assert came == sorted(came)
    assert pg.Mechanism(model_of(parent)).names == topology.names


@pytest.mark.parametrize(
    ("parent", "rows"),
    [
        (FIG1, [1, 2, 3, 4, 5, 6, 7]),
        ([0, 0, 1, 2, 3], [1, 2, 3, 4, 5]),
        ([2, 3, 0], [3, 2, 1]),
        ([3, 1, 0, 3, 0], [3, 1, 2, 4, 5]),  # 1 and 2 wait for 3
        ([0, 4, 2, 1, 4], [1, 4, 2, 3, 5]),
    ],
)
def test_a_canonical_table_keeps_its_numbers(parent: list[int], rows: list[int]):
    assert pg.Topology.of(model_of(parent)).names == tuple(map(str, rows))
    assert pg.Mechanism(model_of(parent)).names == tuple(map(str, rows))


def test_a_body_added_at_the_end_leaves_the_other_numbers():
    model = pg.Model.load(pgraph_models.path("quadruped"))
    grown = model.add(pg.Body(name="ear", parent="left_radius"))
    assert pg.Topology.of(grown).names == (*pg.Topology.of(model).names, "ear")


@settings(max_examples=40)
@given(forests(roots=1))
def test_adjacency_laws_of_eq_1(parent: list[int]):
    topology = pg.Topology.of(model_of(parent))
    S = topology.adjacency().toarray()
    assert np.flatnonzero(~S.any(axis=1)).tolist() == [0]  # only the root's row is zero
    assert (np.flatnonzero(~S.any(axis=0)) + 1).tolist() == topology.tips.tolist()
    assert not np.linalg.matrix_power(S, topology.nb).any()
