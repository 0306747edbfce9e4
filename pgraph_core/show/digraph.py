"""Layout and SVG of the digraph, as a tidy tree for small models and lanes for large ones."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass, replace
from html import escape
from typing import Literal, NamedTuple

TIDY = 40  # bodies up to which the tree is drawn as a tree
ROW, ROW_OF_LOOPS = 37.0, 48.0  # [px] distance of levels without and with loops between them
LANE, LANE_ROW = 18.0, 22.0
MOST_LANES = 24  # beside a list: further branches share the last one
CHARACTER, NODE = 6.2, 26.0  # [px] width of a letter and of a node
LONGEST_LABEL = 20  # shown letters of a name
LABEL = NODE / 2 + 14  # [px] from a node's middle to where its name begins
CLEAR, BELOW, APART = (13.0, 17.0, 4.0)  # [px] loops from nodes, levels, other loops

Point = tuple[float, float]
Interval = tuple[float, float]


@dataclass(frozen=True)
class Layout:
    """Node centres by number in pixels, starting with the ground, with y pointing down."""

    kind: Literal["tree", "lanes"]
    x: tuple[float, ...]
    y: tuple[float, ...]
    width: float
    height: float
    routes: tuple[tuple[Point, ...], ...] = ()  # corners of the lines of loops


def layout(
    parent: tuple[int, ...], letters: tuple[int, ...], loops: Sequence[tuple[int, int]] = ()
) -> Layout:
    """Return positions for the ground and bodies 1..nb, with names of `letters` letters.

    `loops` are pairs of bodies, whose lines avoid nodes and names. Loops to the ground (0) have no
    line.
    """
    if len(parent) > TIDY:
        place = _lanes(parent, letters)
        return _shifted(place, _left_of(place, loops))
    between = any(a and b for a, b in loops)
    place = _tree(parent, letters, ROW_OF_LOOPS if between else ROW)
    return _shifted(place, _between(place, letters, loops))


def _tree(parent: tuple[int, ...], letters: tuple[int, ...], row: float) -> Layout:
    """Pack each subtree as tightly as its outline allows, parents centred over children."""
    children: list[list[int]] = [[] for _ in range(len(parent) + 1)]
    for k, p in enumerate(parent, 1):
        children[p].append(k)
    right = [_reach(c) for c in (0, *letters)]
    tree = _subtree(0, children, right)
    x = tuple(tree.x[k] - min(tree.left) + 4 for k in range(len(parent) + 1))
    y = tuple(tree.depth[k] * row + NODE for k in range(len(parent) + 1))
    width = max(a + b for a, b in zip(x, right))
    return Layout("tree", x, y, width, max(y) + NODE)


def _reach(letters: int) -> float:
    """Return the extent of a node and its label to the right of its centre [px]."""
    return LABEL + CHARACTER * min(letters, LONGEST_LABEL)


@dataclass
class _Subtree:
    """Positions relative to the subtree's root, and its outline at each level."""

    x: dict[int, float]
    depth: dict[int, int]
    left: list[float]
    right: list[float]


def _subtree(root: int, children: list[list[int]], right: list[float]) -> _Subtree:
    whole = _Subtree({}, {}, [], [])
    firsts: list[float] = []
    for child in children[root]:
        part = _subtree(child, children, right)
        dx = max((r - at for r, at in zip(whole.right, part.left)), default=0.0)
        firsts.append(dx)
        whole.x |= {k: x + dx for k, x in part.x.items()}
        whole.depth |= {k: d + 1 for k, d in part.depth.items()}
        deeper = len(whole.left)
        whole.left += [at + dx for at in part.left[deeper:]]
        whole.right = [at + dx for at in part.right] + whole.right[len(part.right) :]
    middle = (firsts[0] + firsts[-1]) / 2 if firsts else 0.0
    return _Subtree(
        {root: 0.0} | {k: x - middle for k, x in whole.x.items()},
        {root: 0} | whole.depth,
        [-NODE / 2, *(at - middle for at in whole.left)],
        [right[root], *(at - middle for at in whole.right)],
    )


def _lanes(parent: tuple[int, ...], letters: tuple[int, ...]) -> Layout:
    """Arrange one row per body in Pgraph order, with each last child in its parent's lane."""
    n = len(parent)
    last = {p: k for k, p in enumerate(parent, 1)}
    lane, taken = [0] * (n + 1), {0}
    for k, p in enumerate(parent, 1):
        if last[p] == k:
            lane[k] = lane[p]
        else:
            lane[k] = next(i for i in range(n + 1) if i not in taken)
            taken.add(lane[k])
        if k not in last:
            taken.discard(lane[k])
    x = tuple(NODE / 2 + LANE * i for i in lane)
    longest = CHARACTER * min(max(letters, default=0), LONGEST_LABEL)
    y = tuple(k * LANE_ROW + NODE for k in range(n + 1))
    return Layout("lanes", x, y, max(x) + NODE + longest, y[-1] + NODE)


# -- the gutter of a list ---------------------------------------------------------------------


class Mark(NamedTuple):
    """A segment of a line in one row of a list.

    "|" passes the row, "v" and "^" join the middle to the row below and above, "d" and "u" go
    across from one lane to another and then down or up. Lines of loops use the same letters in
    capitals ("I", "D", "U"). Their lanes are to the right of the lanes of bodies.
    """

    shape: str
    start: int  # lane
    end: int  # lane
    of: int  # number of the child, or index of the loop


class Gutter(NamedTuple):
    """Lanes for bodies beside a list with one row per body."""

    lane: tuple[int, ...]  # by number
    loops: int  # number of lanes of loops
    marks: tuple[tuple[Mark, ...], ...]  # by row


def gutter(
    parent: tuple[int, ...], row: tuple[int, ...], loops: tuple[tuple[int, int], ...] = ()
) -> Gutter:
    """Return the lanes for bodies 1..nb with parents `parent` in rows `row` (0 to nb - 1).

    The first child keeps the lane of its parent. Every other child gets the first lane that is free
    from its parent's row to the last row of its lane. Each loop has a separate lane between the
    rows of its bodies.
    """
    first: dict[int, int] = {}
    for k, p in enumerate(parent, 1):
        first.setdefault(p, k)
    at = (-1, *row)  # by number
    marks: list[dict[tuple[str, int, int], Mark]] = [{} for _ in parent]
    lane, taken = [0] * (len(parent) + 1), _Lanes()
    for k, p in enumerate(parent, 1):
        if p and first[p] == k:
            lane[k] = lane[p]
        else:
            rows, last = [at[p] if p else at[k], at[k]], k
            while last in first:
                last = first[last]
                rows.append(at[last])
            lane[k] = taken.free(min(rows), max(rows))
        if p:
            _join(marks, (at[p], lane[p]), (at[k], lane[k]), k)
    beside = _Lanes()
    for i, (a, b) in enumerate(loops):
        if a and b:
            ends = sorted(((at[a], lane[a]), (at[b], lane[b])))
            column = beside.free(ends[0][0], ends[1][0])
            for (there, own), shape in zip(ends, "DU"):
                marks[there][shape, own, i] = Mark(shape, own, column, i)
            for passed in range(ends[0][0] + 1, ends[1][0]):
                marks[passed]["I", column, column] = Mark("I", column, column, i)
    return Gutter(tuple(lane[1:]), len(beside.taken), tuple(tuple(m.values()) for m in marks))


class _Lanes:
    """Lanes and their occupied rows, stored with one bit per row."""

    def __init__(self) -> None:
        self.taken: list[int] = []

    def free(self, low: int, high: int) -> int:
        """Take the first lane that is free from row `low` to row `high`, or the last one."""
        rows = ((1 << (high - low + 1)) - 1) << low
        found = next((k for k, taken in enumerate(self.taken) if not taken & rows), None)
        if found is None:
            found = min(len(self.taken), MOST_LANES - 1)
        if found == len(self.taken):
            self.taken.append(0)
        self.taken[found] |= rows
        return found


def _join(
    marks: list[dict[tuple[str, int, int], Mark]], parent: tuple[int, int], child: tuple[int, int],
    of: int,
) -> None:  # fmt: skip
    """Add a line from a parent's row and lane to its child's."""
    (start, a), (end, b) = parent, child
    leaves, arrives = (
        ("v" if a == b else "d", "^") if end > start else ("^" if a == b else "u", "v")
    )
    marks[start][leaves, a, b] = Mark(leaves, a, b, of)
    for passed in range(min(start, end) + 1, max(start, end)):
        marks[passed]["|", b, b] = Mark("|", b, b, of)
    marks[end][arrives, b, b] = Mark(arrives, b, b, of)


# -- the lines of loops ----------------------------------------------------------------------


def _between(
    place: Layout, letters: tuple[int, ...], loops: Sequence[tuple[int, int]]
) -> tuple[tuple[Point, ...], ...]:
    """Route lines between the levels of the tree, crossing levels where there is a gap."""
    levels: dict[float, list[Interval]] = {}
    for x, y, reach in zip(place.x, place.y, (LABEL, *map(_reach, letters))):
        levels.setdefault(y, []).append((x - NODE / 2, x + reach))
    routes = []
    for i, (a, b) in enumerate(loops):
        upper, lower = sorted((a, b), key=lambda k: place.y[k])
        route = _line(place, levels, upper, lower, BELOW + APART * (i % 3)) if a and b else ()
        routes.append(route if upper == a else route[::-1])
    return tuple(routes)


def _line(
    place: Layout, levels: dict[float, list[Interval]], upper: int, lower: int, below: float
) -> tuple[Point, ...]:
    x0, y0, x1, y1 = place.x[upper], place.y[upper], place.x[lower], place.y[lower]
    passed = [y for y in levels if y0 < y < y1]
    x = _gap([span for y in passed for span in levels[y]], x0, x1) if passed else x1
    for y in passed:
        levels[y].append((x - APART / 2, x + APART / 2))
    ahead, back = (1.0 if x > x0 else -1.0), (1.0 if (x if passed else x0) > x1 else -1.0)
    first = y0 + below
    start = ((x0 + 7 * ahead, y0 + 8), (x0 + CLEAR * ahead, first))
    if y0 == y1:
        return (*start, (x1 + CLEAR * back, first), (x1 + 7 * back, y1 + 8))
    step = min((y for y in levels if y > y0), default=y1) - y0
    last = y1 - step + below
    turns = ((x, first), (x, last)) if passed else ()
    return (*start, *turns, (x1 + CLEAR * back, last), (x1 + 7 * back, y1 - 8))


def _gap(taken: list[Interval], x0: float, x1: float) -> float:
    """Find the best x between x0 and x1 outside all intervals."""
    free = [x for low, high in taken for x in (low - APART, high + APART)]
    clear = [x for x in (*free, (x0 + x1) / 2) if all(not a < x < b for a, b in taken)]
    return min(clear, key=lambda x: abs(x - x0) + abs(x - x1))


def _left_of(place: Layout, loops: Sequence[tuple[int, int]]) -> tuple[tuple[Point, ...], ...]:
    """Return lines to the left of all lanes, using separate columns for lines that share rows."""
    columns: list[float] = []  # the row down to which each is taken
    routes: dict[int, tuple[Point, ...]] = {}
    for i in sorted(range(len(loops)), key=lambda i: min(place.y[k] for k in loops[i])):
        a, b = loops[i]
        if not (a and b):
            routes[i] = ()
            continue
        low, high = sorted((place.y[a], place.y[b]))
        column = next((c for c, end in enumerate(columns) if end < low), len(columns))
        columns[column : column + 1] = [high]
        x, (xa, ya), (xb, yb) = (
            -NODE / 2 - APART * column,
            *((place.x[k], place.y[k]) for k in (a, b)),
        )
        routes[i] = ((xa - 9, ya), (x, ya), (x, yb), (xb - 9, yb))
    return tuple(routes[i] for i in range(len(loops)))


def _shifted(place: Layout, routes: tuple[tuple[Point, ...], ...]) -> Layout:
    """Shift the layout to the right until the loop lines lie within the picture."""
    outside = 4 - min((x for route in routes for x, _ in route), default=4.0)
    right = max((x for route in routes for x, _ in route), default=0.0) + 4
    bottom = max((y for route in routes for _, y in route), default=0.0) + 4
    by = max(outside, 0.0)
    return replace(
        place,
        x=tuple(x + by for x in place.x),
        width=max(place.width, right) + by,
        height=max(place.height, bottom),
        routes=tuple(tuple((x + by, y) for x, y in route) for route in routes),
    )


# -- the picture of a notebook ---------------------------------------------------------------

RADIUS = 11  # [px] radius of a node
LOOP = "#d9730d"


def digraph_svg(
    names: Sequence[str], parent: Sequence[int], loops: Sequence[tuple[int, int]] = (),
    size: tuple[int, int] | None = None,
) -> str:  # fmt: skip
    """Return the digraph as SVG, with bodies by number and name, and loops as dashed lines.

    `parent` contains the number of each body's parent, 0 for the ground; `loops` pairs of bodies;
    `size` is (width, height) in pixels. It uses the colour of the surrounding text, so it fits
    light and dark pages.
    """
    place = layout(tuple(parent), tuple(map(len, names)), loops)
    at = list(zip(place.x, place.y))
    edges = "".join(_edge(place.kind, at[p], at[k]) for k, p in enumerate(parent, 1))
    lines = "".join(_loop(route) for route in place.routes if route)
    nodes = "".join(_node(k, name, *at[k]) for k, name in enumerate(names, 1))
    width, height = size or (round(place.width), round(place.height))
    edge = f'width="{width}" height="{height}"'
    box = f'viewBox="0 0 {place.width:.0f} {place.height:.0f}"'
    return (
        f'<svg xmlns="http://www.w3.org/2000/svg" {edge} {box} role="img" '
        'aria-label="digraph of the bodies" style="max-width:100%;height:auto" '
        'font-family="sans-serif" font-size="11" fill="currentColor" stroke="none">'
        f"{edges}{lines}{_ground(*at[0])}{nodes}</svg>"
    )


def _edge(kind: str, start: Point, end: Point) -> str:
    (x0, y0), (x1, y1) = start, end
    if kind == "lanes":  # along the parent's lane, then across to the child
        bend = min(RADIUS, y1 - y0)
        way = f"M{x0:.1f} {y0:.1f}V{y1 - bend:.1f}Q{x0:.1f} {y1:.1f} {x1:.1f} {y1:.1f}"
        return f'<path d="{way}" fill="none" stroke="currentColor" opacity=".5"/>'
    length = max(math.hypot(x1 - x0, y1 - y0), 1.0)
    dx, dy = RADIUS * (x1 - x0) / length, RADIUS * (y1 - y0) / length
    way = f"M{x0 + dx:.1f} {y0 + dy:.1f}L{x1 - dx:.1f} {y1 - dy:.1f}"
    return f'<path d="{way}" stroke="currentColor" opacity=".5"/>'


def _loop(route: tuple[Point, ...]) -> str:
    way = "L".join(f"{x:.1f} {y:.1f}" for x, y in route)
    return f'<path d="M{way}" fill="none" stroke="{LOOP}" stroke-dasharray="5 4"/>'


def _ground(x: float, y: float) -> str:
    hatch = "".join(f"M{x + dx} {y}l-5 6" for dx in (-6.0, 0.0, 6.0, 12.0))
    return f'<path d="M{x - 12} {y}H{x + 12}{hatch}" stroke="currentColor" fill="none"/>'


def shown_name(name: str) -> str:
    """Shorten a name to fit."""
    return name if len(name) <= LONGEST_LABEL else name[: LONGEST_LABEL - 1] + "…"


def _node(number: int, name: str, x: float, y: float) -> str:
    return (
        f"<g><title>{escape(name)}</title>"
        f'<circle cx="{x:.1f}" cy="{y:.1f}" r="{RADIUS}" fill="none" stroke="currentColor"/>'
        f'<text x="{x:.1f}" y="{y + 4:.1f}" text-anchor="middle" font-weight="600">{number}</text>'
        f'<text x="{x + RADIUS + 5:.1f}" y="{y + 4:.1f}">{escape(shown_name(name))}</text></g>'
    )
