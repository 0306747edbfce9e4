"""Canonical numbers of a tree, in which parents precede their children."""

from __future__ import annotations

from collections.abc import Sequence


def children_of(parent: Sequence[int]) -> tuple[tuple[int, ...], ...]:
    """Return the child numbers of the ground (0) and of bodies 1..nb in ascending order."""
    found: list[list[int]] = [[] for _ in range(len(parent) + 1)]
    for k, p in enumerate(parent, 1):
        found[p].append(k)
    return tuple(map(tuple, found))


def canonical(parent: Sequence[int]) -> list[int]:
    """Return row indices (from 0) by number. Rows on a cycle are omitted.

    `parent` has rows from 1, 0 for the ground. The rows are numbered from the top. A row above its
    parent waits for it, and follows it with all that wait for this row.
    """
    children = children_of(parent)
    numbered = [True] + [False] * len(parent)
    order: list[int] = []
    for row, p in enumerate(parent, start=1):
        ready = [row] if numbered[p] and not numbered[row] else []
        while ready:
            i = ready.pop()
            numbered[i] = True
            order.append(i - 1)
            ready.extend(child for child in reversed(children[i]) if child < row)
    return order
