"""The seven steps of Fig. 4, one after the other, as they make Pgraph and jdof (pure)."""

from __future__ import annotations

from collections.abc import Sequence
from typing import NamedTuple


class Step(NamedTuple):
    """One step, and what it does to Pgraph, jdof and the stack of separation bodies SBS."""

    step: str  # its number in Fig. 4; two where one leads straight to the other
    text: str
    body: int  # i after it; 0 is the ground
    adds: tuple[int, int] | None = None  # the new entries of Pgraph and jdof
    push: int | None = None  # SBn that goes onto SBS, after the pull
    pull: bool = False
    tip: int = 0  # TBn, where a tip body was met


def seven_steps(parent: Sequence[int], dof: Sequence[int]) -> list[Step]:
    """The steps for bodies 1..n in depth-first numbers; several roots start at the ground (R20)."""
    left: list[list[int]] = [[] for _ in range(len(parent) + 1)]
    for k in range(len(parent), 0, -1):
        left[parent[k - 1]].append(k)  # the left child last, so that pop() takes it
    if not parent:
        return []
    i = 0 if len(left[0]) > 1 else left[0].pop()
    root = "the ground, which carries several bodies" if i == 0 else "the root"
    steps = [Step("1", f"Pgraph and jdof are empty; i = {i}, {root}", i)]
    stack: list[int] = []
    while True:
        steps.append(_entered(i, dof[i - 1] if i else 0))
        if len(left[i]) > 1:
            stack.append(i)
            steps.append(Step("3", f"{i} is a separation body: SBS gets {i}", i, push=i))
        if not left[i]:
            if not stack:
                steps.append(Step("4, 7", f"{i} is a tip and SBS is empty: the end", i, tip=i))
                return steps
            tip, i = i, stack.pop()
            again = len(left[i]) > 1
            if again:
                stack.append(i)
            steps.append(_back(tip, i, again))
            i = left[i].pop()
            steps.append(Step("6", f"i = {i}, the left one of the untraversed children", i))
        else:
            i = left[i].pop()
            steps.append(Step("4", f"i = {i}, the left one of the untraversed children", i))


def _entered(i: int, dof: int) -> Step:
    return Step("2", f"Pgraph gets {i}, jdof gets {dof}", i, adds=(i, dof))


def _back(tip: int, i: int, again: bool) -> Step:
    pushed = ", pushed back" if again else ""
    text = f"{tip} is a tip: pull {i} from SBS{pushed}; Pgraph gets {i}, jdof 0"
    return Step("4, 5", text, i, (i, 0), i if again else None, pull=True, tip=tip)
