"""The digraph: its lines keep clear of names and nodes, and its seven steps make Pgraph."""

import random
from itertools import pairwise

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

import pgraph_core as pg
from pgraph_app.digraph.view import seven_steps
from pgraph_core.show.digraph import (
    CHARACTER,
    LABEL,
    LONGEST_LABEL,
    MOST_LANES,
    NODE,
    TIDY,
    gutter,
    layout,
)

from .store import trees

pytestmark = pytest.mark.quick


def crosses(segment, box) -> bool:
    """True if a segment meets a box (by samples)."""
    (x0, y0), (x1, y1) = segment
    low_x, low_y, high_x, high_y = box
    steps = [i / 50 for i in range(51)]
    places = ((x0 + s * (x1 - x0), y0 + s * (y1 - y0)) for s in steps)
    return any(low_x < x < high_x and low_y < y < high_y for x, y in places)


def test_a_tree_without_loops_is_as_compact_as_before():
    assert layout((0, 1, 2), (1, 1, 1)).height < layout((0, 1, 2), (1, 1, 1), [(1, 3)]).height
    assert layout((0, 1, 2), (1, 1, 1), [(3, 0)]).height == layout((0, 1, 2), (1, 1, 1)).height


@pytest.mark.parametrize("n", [16, 60, 500, 1000])
def test_every_size_has_its_layout(n):
    place = layout(tuple(max(0, k - 3) for k in range(n)), (6,) * n, [(1, n), (2, n // 2)])
    assert place.kind == ("tree" if n <= TIDY else "lanes")
    assert len(place.x) == n + 1
    assert all(place.routes)


@settings(max_examples=30)
@given(trees(near=6), st.data())
def test_the_seven_steps_make_pgraph_and_jdof_and_leave_an_empty_stack(parent, data):
    dof = tuple(data.draw(st.integers(0, 6)) for _ in parent)
    pgraph, jdof, stack = [], [], []
    for step in seven_steps(parent, dof):
        if step.pull:
            stack.pop()
        if step.push is not None:
            stack.append(step.push)
        if step.adds:
            pgraph.append(step.adds[0])
            jdof.append(step.adds[1])
    expected = pg.pgraph_of(parent)
    assert pgraph == expected.tolist()
    assert jdof == pg.jdof_of(expected, dof).tolist()
    assert stack == []


def test_the_steps_of_the_gripper_are_those_of_the_worked_example():
    steps = seven_steps((0, 1, 2, 3, 3), (1, 1, 1, 1, 1))
    assert [(step.step, step.body) for step in steps] == [
        ("1", 1), ("2", 1), ("4", 2), ("2", 2), ("4", 3), ("2", 3), ("3", 3), ("4", 4), ("2", 4),
        ("4, 5", 3), ("6", 5), ("2", 5), ("4, 7", 5),
    ]  # fmt: skip
    back = [s for s in seven_steps((0, 1, 1, 1), (1,) * 4) if s.pull and s.push == 1]
    assert len(back) == 1  # a separation body with children left
    assert seven_steps((), ()) == []


@settings(max_examples=15)
@given(trees(near=6), st.integers(0, 10**6))
def test_loop_edges_end_at_their_bodies_and_cross_no_name_and_no_node(parent, seed):
    n, draw = len(parent), random.Random(seed)
    loops = [(draw.randint(1, n), draw.randint(1, n)) for _ in range(3)]
    loops = [(a, b) for a, b in loops if a != b]
    letters = tuple(draw.randint(1, 25) for _ in parent)
    place = layout(parent, letters, loops)
    for (a, b), route in zip(loops, place.routes):
        for k, (x, y) in ((a, route[0]), (b, route[-1])):
            assert abs(x - place.x[k]) <= NODE / 2
            assert abs(y - place.y[k]) <= NODE / 2
        assert all(0 <= x <= place.width and 0 <= y <= place.height for x, y in route)
        for k in range(1, n + 1):
            reach = LABEL - 14 + CHARACTER * min(letters[k - 1], LONGEST_LABEL)
            x, y = place.x[k], place.y[k]
            name = (x + NODE / 2 + 2, y - 6, x + reach, y + 6)
            node = (x - 11, y - 11, x + 11, y + 11)
            for segment in pairwise(route):
                assert place.kind == "lanes" or not crosses(segment, name), (parent, loops, k)
                assert k in (a, b) or not crosses(segment, node), (parent, loops, k)


@settings(max_examples=60)
@given(trees(30), st.randoms(use_true_random=False), st.data())
def test_lines_of_the_gutter_join_parents_and_children_in_lanes_of_their_own(parent, chance, data):
    """Also where rows are in another order than numbers; loops are arcs between their bodies."""
    n = len(parent)
    row = list(range(n))
    if data.draw(st.booleans()):
        chance.shuffle(row)
    ends = st.tuples(st.integers(0, n), st.integers(0, n)).filter(lambda pair: pair[0] != pair[1])
    loops = tuple(data.draw(st.lists(ends, max_size=4))) if n > 1 else ()
    found = gutter(tuple(parent), tuple(row), loops)
    for k, p in enumerate(parent, 1):
        if not p:
            continue
        a, b = row[p - 1], row[k - 1]
        for between in range(min(a, b) + 1, max(a, b)):
            assert ("|", found.lane[k - 1]) in {m[:2] for m in found.marks[between]}
        leaves = {(m.shape, m.end) for m in found.marks[a] if m.start == found.lane[p - 1]}
        assert (("vd" if b > a else "^u")[found.lane[p - 1] != found.lane[k - 1]],
                found.lane[k - 1]) in leaves  # fmt: skip
        if row == sorted(row):  # no other body stands in the lane between them
            between = found.lane[p : k - 1]
            assert found.lane[k - 1] not in between or max(found.lane) == MOST_LANES - 1
    first_children = {p: parent.index(p) + 1 for p in parent if p}
    for p, k in first_children.items():
        assert found.lane[k - 1] == found.lane[p - 1]
    columns = {}
    for i, (a, b) in enumerate(loops):
        arcs = [(r, m) for r, marks in enumerate(found.marks) for m in marks
                if m.shape in "DU" and m.of == i]  # fmt: skip
        if not (a and b):
            assert not arcs
            continue
        assert sorted(r for r, _ in arcs) == sorted((row[a - 1], row[b - 1]))
        (low, first), (high, _) = sorted(arcs)
        for other_low, other_high in columns.get(first.end, []):
            assert high < other_low or other_high < low
        columns.setdefault(first.end, []).append((low, high))


def test_the_lanes_of_the_quadruped_are_those_of_the_drawing():
    parent = (0, 1, 2, 3, 4, 5, 6, 4, 8, 9, 1, 11, 12, 1, 14, 15)
    found = gutter(parent, tuple(range(16)))
    assert found.lane == (*[0] * 7, *[1] * 3, *[2] * 3, *[3] * 3)
    assert [(m.shape, m.end) for m in found.marks[0]] == [("v", 0), ("d", 2), ("d", 3)]


def test_a_thousand_branches_of_one_body_share_the_last_lane():
    found = gutter((0, *[1] * 999), tuple(range(1000)))
    assert max(found.lane) == MOST_LANES - 1
    assert max(map(len, found.marks)) <= 2 * MOST_LANES
