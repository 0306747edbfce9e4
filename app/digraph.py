"""Where the digraph's nodes stand: a tidy tree for small models, lanes for large ones (pure)."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Literal

TIDY = 40  # bodies up to which the tree is drawn as a tree
ROW = 37.0  # between levels of the tree [px]
LANE, LANE_ROW = 18.0, 22.0
CHARACTER, NODE, LONGEST = 6.2, 26.0, 20  # [px] a letter and a node; letters shown of a name


@dataclass(frozen=True)
class Layout:
    """Node centres by number, body 0 (ground) first [px]; y grows downwards."""

    kind: Literal["tree", "lanes"]
    x: tuple[float, ...]
    y: tuple[float, ...]
    width: float
    height: float


def layout(parent: tuple[int, ...], letters: tuple[int, ...]) -> Layout:
    """Places for the ground and bodies 1..nb; `letters` is the length of each name."""
    if len(parent) <= TIDY:
        return _tree(parent, letters)
    return _lanes(parent, letters)


def _tree(parent: tuple[int, ...], letters: tuple[int, ...]) -> Layout:
    """Each subtree as compact as its outline allows, each parent in the middle of its children."""
    children: list[list[int]] = [[] for _ in range(len(parent) + 1)]
    for k, p in enumerate(parent, 1):
        children[p].append(k)
    right = [NODE / 2 + CHARACTER * min(c, LONGEST) + 14 for c in (0, *letters)]
    tree = _subtree(0, children, right)
    x = tuple(tree.x[k] - min(tree.left) + 4 for k in range(len(parent) + 1))
    y = tuple(tree.depth[k] * ROW + NODE for k in range(len(parent) + 1))
    width = max(a + b for a, b in zip(x, right))
    return Layout("tree", x, y, width, max(y) + NODE)


@dataclass
class _Subtree:
    """Places relative to the subtree's root, and its outline level by level."""

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
    """One row a body in Pgraph order; the last child keeps its parent's lane, as in a git log."""
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
    longest = CHARACTER * min(max(letters, default=0), LONGEST)
    y = tuple(k * LANE_ROW + NODE for k in range(n + 1))
    return Layout("lanes", x, y, max(x) + NODE + longest, y[-1] + NODE)
