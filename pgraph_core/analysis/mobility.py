"""Degrees of freedom under constraints: ranks, redundant rows by name and singular positions.

Ranks are those of the rows in the mass metric, turning rows times the model's length. If
constraints are only satisfied to second order, a gap g makes the positions and rows uncertain by
the square root of g. Smaller singular values are treated as zero. Rows are judged in the order of
the model: the later of two that say the same is called redundant.
"""

from __future__ import annotations

from collections import Counter
from collections.abc import Iterator, Sequence
from dataclasses import asdict, dataclass
from itertools import groupby
from typing import Any, NamedTuple

import numpy as np

from ..dynamics import Dynamics
from ..dynamics.arguments import finite, position
from ..errors import InputError, Suggests, counted, explained
from ..model import Motion
from ..packing import Array
from ..tolerances import EPS, NEARBY, NOTABLE, SOLVED
from .assembly import closed, contradiction, descended, indices
from .rows import COORDINATE, Group, Rows, apart, axis_name

LOOK_ROUNDS = 40
POSITIONS_TRIED = 3  # nearby positions that are examined
BRANCH_LOOKS = 12  # nearby positions at a branch point
ALONG = np.cos(2 * NEARBY)  # cosine between directions of one branch
PANEL = 16  # groups that are freed of what came before at once: a matrix product, not a vector's
MOST_LISTED = 8  # names or branches in a sentence
# translations and rotations that a kind holds: the kind to choose if others are redundant
HOLDING = {
    (3, 3): "weld", (3, 2): "revolute", (2, 3): "prismatic", (2, 2): "cylindrical",
    (3, 1): "universal", (3, 0): "point", (2, 0): "line", (1, 0): "plane", (0, 3): "orientation",
}  # fmt: skip
HELD = {kind: held for held, kind in HOLDING.items()}


@dataclass(frozen=True)
class Redundant:
    """A redundant constraint row."""

    constraint: str
    kind: str  # kind of the constraint
    direction: str  # "rotation about x", in world axes unless a body is named
    bodies: tuple[str, ...]  # bodies that it connects
    only_here: bool  # True if it is not redundant at nearby positions

    def __str__(self) -> str:
        return f"{self.direction} of constraint '{self.constraint}'"


class Remark(NamedTuple):
    """A line of a report, about one constraint or about the whole mechanism."""

    constraint: str  # its name, or ""
    text: str
    bad: bool = False  # True if the model may not be the intended one


@explained
@dataclass(frozen=True)
class Mobility(Suggests):
    """The degrees of freedom of a constrained mechanism at one position."""

    tree: int  # degrees of freedom without the constraints
    constraints: int  # number of active constraints
    rows: int  # number of their rows, velocity rows included
    rank: int  # rank of all rows here
    dof: int  # degrees of freedom: tree - rank
    positions: int  # dimension of the positions that can be reached by closing loops alone
    redundant: tuple[Redundant, ...]
    extra: int  # degrees of freedom that exist only here: a singular position
    finite: bool  # True if they are finite motions, False if they exist to first order only
    joints: tuple[str, ...]  # joints that take part in motions from a singular position
    branches: tuple[tuple[float, ...], ...]  # (nv,) directions of the branches of motion
    branch: int  # index of the branch that the velocity follows, -1 for none
    prescribed: int  # degrees of freedom that prescribed motions determine
    moved: float  # distance of the given position from the assembled one [rad or m]
    names: tuple[str, ...]  # the joint of each degree of freedom
    ties: tuple[str, ...]  # names of the active constraints
    doubts: tuple[str, ...] = ()  # defaults of constraints that hardly fit the model

    @property
    def headline(self) -> str:
        """The degrees of freedom in one sentence."""
        if not self.rows:
            return f"{counted(self.tree, 'degree')} of freedom, no active constraint."
        here = "only in this position" if self.finite else "to first order only"
        extra = f", {self.extra} of them {here}" if self.extra else ""
        locked = ": it is locked" if self.extra == self.dof and extra and not self.finite else ""
        left = f"{counted(self.dof, 'degree')} of freedom left{extra}{locked}"
        return f"{left}: {self.tree} of the tree, less {self.rank} of {counted(self.rows, 'row')}."

    @property
    def remarks(self) -> tuple[Remark, ...]:
        """Redundant rows of each constraint, then what concerns the whole mechanism."""
        return (*_of_constraints(self), *_of_all(self))

    def to_dict(self) -> dict[str, Any]:
        """Return the fields as a dictionary for JSON, including the text of the report as
        `text`."""
        return asdict(self) | {"text": str(self)}

    def __str__(self) -> str:
        lines = (f"constraint '{of}' {text}" if of else text for of, text, _ in self.remarks)
        return "\n".join((self.headline, *(f"  {line}" for line in lines), *self.doubts))


def mobility(
    mech: Dynamics,
    q: Array | None = None,
    v: Array | None = None,
    active: Sequence[str] | None = None,
) -> Mobility:
    """Compute the mobility at the assembled position nearest to q. Defaults to the initial state.

    `active` names constraints, by default the model's active ones. The velocity `v` selects a
    branch at a singular position. The cost is O(n³) in the degrees of freedom. Raises InputError
    if the constraints cannot be met.
    """
    at = mech.home()[0] if q is None else position(mech.packed, q)
    v = None if v is None else finite("v", v, mech.nv, of=mech.packed)
    ended = closed(Rows.of(mech, indices(mech, active), at))
    if not ended.closed:
        raise InputError(contradiction(mech, ended))
    here = ended.rows
    gap = _relative_gap(here)
    basis, found = judged(here, gap=gap)
    position_rows = [group for group in here.groups if group.holonomic]
    holonomic = rank_of(here, position_rows, basis, gap)
    undriven = [g for g in here.groups if not isinstance(g.constraint, Motion)]
    free = rank_of(here, undriven, basis, gap)
    generic, finite_, again, branches = len(basis), True, found, ()
    if found:
        generic, finite_, again, branches = _around(here, basis, found)
    extra = generic - len(basis)
    return Mobility(
        tree=here.nv,
        constraints=len(here.held),
        rows=len(here.J),
        rank=len(basis),
        dof=here.nv - len(basis),
        positions=here.nv - holonomic,
        redundant=_named(here, found, again if extra else found),
        extra=extra,
        finite=finite_,
        joints=_moving(here, basis) if extra else (),
        branches=tuple(tuple(d.tolist()) for d in branches),
        branch=_taken(here, branches, v),
        prescribed=len(basis) - free,
        moved=float(np.max(np.abs(apart(mech, at, here.q)), initial=0.0)),
        names=tuple(name for name, x in here.joints for _ in range(x.stop - x.start)),
        ties=tuple(c.name for c in here.constraints),
        doubts=tuple(text for text in mech.model.doubts if text.startswith("constraint")),
    )


Found = list[tuple[Group, Array]]  # groups with what is redundant of them, (k, rows)


def rank_of(state: Rows, groups: Sequence[Group], basis: Array, gap: float) -> int:
    """Return the rank of selected row groups, where `basis` spans all rows."""
    return len(basis if len(groups) == len(state.groups) else judged(state, groups, gap)[0])


def judged(
    state: Rows, groups: Sequence[Group] | None = None, gap: float = 0.0
) -> tuple[Array, Found]:
    """Return an orthonormal basis (rank, nv) for the row space, and the redundant rows in order.

    `gap` is the largest one, relative to the mechanism's size L. A singular value below 4 √gap of
    the largest of its group is zero: a gap g of second order, κ s²/2, leaves s = √(2 g / κ), which
    is 4 √g at a curvature of κ = 1/(8 L). So is one below 4 √EPS of the largest of all, such as all
    that axes leave which are parallel up to rounding.
    """
    cut = 4 * np.sqrt(max(gap, EPS))
    groups = state.groups if groups is None else groups
    basis, rank = np.empty((min(len(state.J), state.nv), state.nv)), 0
    found: Found = []
    least = 4 * np.sqrt(EPS) * np.linalg.norm(state.scaled)
    for first in range(0, len(groups), PANEL):
        panel, known = groups[first : first + PANEL], rank
        start = panel[0].rows.start
        left_over = _freed(basis[:known], state.scaled[start : panel[-1].rows.stop])
        for group in panel:
            rows = left_over[group.rows.start - start : group.rows.stop - start]
            scale = np.linalg.norm(state.scaled[group.rows], 2) if state.nv else 0.0
            rows = _freed(basis[known:rank], rows / (scale or 1.0))
            left, sizes, right = np.linalg.svd(rows, full_matrices=len(rows) > state.nv)
            new = int((sizes > max(cut, least / (scale or 1.0))).sum())
            if new < len(rows):
                found.append((group, left[:, new:].T))
            basis[rank : rank + new] = right[:new]
            rank += new
    return basis[:rank], found


def _relative_gap(state: Rows) -> float:
    return float(np.max(np.abs(state.gap), initial=0.0)) / state.size


def complement(basis: Array, n: int) -> Array:
    """Return n - rank orthonormal columns (n, n - rank) orthogonal to the rows of `basis`."""
    if not len(basis):
        return np.eye(n)
    return np.linalg.qr(basis.T, mode="complete")[0][:, len(basis) :]


def _freed(basis: Array, y: Array) -> Array:
    """Remove the components along an orthonormal basis from vectors (..., nv), in the metric M."""
    for _ in range(2):
        y = y - (y @ basis.T) @ basis
    return y


def _around(here: Rows, basis: Array, found: Found) -> tuple[int, bool, Found, tuple[Array, ...]]:
    """Return the maximum rank nearby, whether any such position is reachable, and its redundancies.

    If nearby positions have a larger rank and one degree of freedom, the branch directions are also
    returned.
    """
    rank = len(basis)
    if rank == here.nv:
        return rank, True, found, ()
    random = np.random.default_rng(0)
    most, again = rank, found
    steps: list[Array] = []
    back = 0
    for n in range(BRANCH_LOOKS):
        if n >= POSITIONS_TRIED and (most == rank or here.nv - most != 1):
            break
        step, other = _look(here, here.step(_freed(basis, random.normal(size=here.nv))))
        if other is None:
            continue
        if other is here:
            back += 1
            continue
        steps.append(step)
        around, redundant = judged(other, gap=_relative_gap(other))
        if len(around) > most:
            most, again = len(around), redundant
    if back and not steps:
        return here.nv, False, [], ()
    single = most > rank and here.nv - most == 1
    return most, True, again, _branches(here, steps) if single else ()


def _look(here: Rows, step: Array) -> tuple[Array, Rows | None]:
    """Return a move to a nearby position, and that position.

    The result is `here` if the move returned to the start, and None if no position was found.
    """
    reach = np.where(here.turns, 1.0, here.size)
    step = step * (NEARBY / float(np.max(np.abs(step) / reach)))
    ended = descended(here.at(here.advanced(step)), rounds=LOOK_ROUNDS)
    moved = apart(here.mech, here.q, ended.rows.q)
    if not ended.closed:
        return moved, None
    stayed = float(np.max(np.abs(moved) / reach)) < NEARBY / 2
    return moved, here if stayed else ended.rows


def _branches(here: Rows, steps: list[Array]) -> tuple[Array, ...]:
    """Compute the distinct directions of motion, scaled to a largest entry of 1.

    Directions of the same branch differ due to its curvature, by at most NEARBY for each of two
    moves.
    """
    found: list[Array] = []
    for step in steps:
        if all(abs(_cosine(here, step, other)) < ALONG for other in found):
            found.append(step / step[np.abs(step).argmax()])
    return tuple(found)


def _cosine(here: Rows, a: Array, b: Array) -> float:
    x, y = here.root.T @ a, here.root.T @ b
    return float(x @ y / np.sqrt((x @ x) * (y @ y)))


def _taken(here: Rows, branches: tuple[Array, ...], v: Array | None) -> int:
    if v is None or not branches or not np.abs(v).max() > 0:
        return -1
    along = [abs(_cosine(here, d, v)) for d in branches]
    return int(np.argmax(along)) if max(along) > ALONG else -1


def _named(state: Rows, found: Found, around: Found) -> tuple[Redundant, ...]:
    """Return redundant rows by direction, with `only_here` set if they are not redundant nearby."""
    elsewhere = {(g.constraint.name, g.nature): _directions(state, g, n) for g, n in around}
    rows: list[Redundant] = []
    for group, null in found:
        c = group.constraint
        here = _directions(state, group, null)
        there = elsewhere.get((c.name, group.nature), [])
        first = sorted(here, key=lambda d: d not in there)
        named = [(d, k >= len(there)) for k, d in enumerate(first)]
        bodies = c.body, *_others(group)
        rows += [Redundant(c.name, c.kind, d, bodies, only) for d, only in named]
    return tuple(rows)


def _others(group: Group) -> tuple[str, ...]:
    c = group.constraint
    named = c.touches if group.nature == COORDINATE else c.pair
    return tuple(name for name in dict.fromkeys(named) if name != c.body)


def _directions(state: Rows, group: Group, null: Array) -> list[str]:
    """Return a description of the combinations of a group's rows, along axes if possible."""
    if group.nature == COORDINATE:
        return ["coordinate"] * len(null)
    spanned = _upright(null @ group.directions)
    about = "about" if group.nature == "rotation" else "along"
    other = state.mech.topology.number(group.constraint.pair[1])
    named = [f"{group.nature} {about} {axis_name(d, state, other)}" for d in spanned]
    return named[: len(null)] + [group.nature] * (len(null) - len(named))


def _upright(vectors: Array) -> list[Array]:
    """Return unit vectors that span the rows, using world axes if these lie in the span."""
    _, sizes, right = np.linalg.svd(vectors)
    basis = right[: int((sizes > SOLVED * sizes.max(initial=0.0)).sum())]
    found: list[Array] = []
    while len(basis):
        inside = basis.T @ basis
        axis = int(np.argmax(np.diag(inside) - SOLVED * np.arange(3)))
        chosen = inside[axis] / np.linalg.norm(inside[axis])
        found.append(chosen)
        rest = basis - np.outer(basis @ chosen, chosen)
        basis = np.linalg.svd(rest)[2][: len(basis) - 1]
    return found


def _moving(state: Rows, basis: Array) -> tuple[str, ...]:
    """Return the joints that move in any motion permitted by all rows."""
    size = np.linalg.norm(state.step(_freed(basis, np.eye(state.nv)).T), axis=1)
    largest = float(size.max(initial=0.0))
    return tuple(name for name, s in state.joints if size[s].max() > NOTABLE * largest)


# -- in words ----------------------------------------------------------------------------------


def _of_constraints(m: Mobility) -> Iterator[Remark]:
    """Yield the redundant rows of each constraint, with a kind that has fewer of them."""
    for (name, kind), group in groupby(m.redundant, lambda row: (row.constraint, row.kind)):
        rows = [*group]
        always, here = ([r.direction for r in rows if r.only_here == x] for x in (False, True))
        text = f"unnecessarily removes {_listed(always)}{_instead(kind, always)}" if always else ""
        only = f"depends on other rows in {_listed(here)} only here" if here else ""
        yield Remark(name, "; ".join(filter(None, (text, only))))


def _instead(kind: str, directions: Sequence[str]) -> str:
    """Return the suggestion of a kind without the rows in these directions, if there is one."""
    turns = Counter(direction.startswith("rotation") for direction in directions)
    moved, turned = HELD.get(kind, (0, 0))
    left = moved - turns[False], turned - turns[True]
    if kind in HELD and left == (0, 0):
        return "; it has no effect: delete it, or switch it off"
    return f"; a '{HOLDING[left]}' would be sufficient" if left in HOLDING else ""


def _of_all(m: Mobility) -> Iterator[Remark]:
    if m.prescribed:
        ways = counted(m.prescribed, "way") + " to move"
        yield Remark("", f"Prescribed motions drive it: they decide {ways}.")
    elif m.redundant and m.dof == 0:
        joints = [*dict.fromkeys(m.names)]
        holds = f"{_quoted(m.ties)} {'together lock' if len(m.ties) > 1 else 'locks'} the joint"
        holds += f"{'s' * (len(joints) > 1)} of {_quoted(joints)}"
        yield Remark("", f"No joint can move: {holds}. Check their positions and directions.", True)
    if m.redundant and m.dof + m.prescribed > 0:
        text = "The motion is not affected. The forces of least norm are returned."
        yield Remark("", text)
    if m.positions != m.dof:
        text = f"Velocities have {counted(m.dof, 'degree')} of freedom, positions {m.positions}: "
        yield Remark("", f"{text}rolling and skate constraints only restrict velocities.")
    if m.moved > NOTABLE:
        text = f"This is the closest assembled position, up to {m.moved:.3g} (rad or m in a joint) "
        yield Remark("", f"{text}away.")
    if m.extra:
        leads = (
            "the velocity determines the branch"
            if m.finite
            else "the additional motions are infinitesimal"
        )
        text = f"Singular position: {_quoted(m.joints)} can move in more ways; {leads}."
        yield Remark("", text, True)
    for n, way in enumerate(m.branches[:MOST_LISTED]):
        taken = " (the velocity takes it)" if n == m.branch else ""
        yield Remark("", f"Branch {n + 1}{taken}: {_motion(m, way)}.")


def _motion(m: Mobility, direction: tuple[float, ...]) -> str:
    parts = [f"{name} {x:+.3g}" for name, x in zip(m.names, direction) if abs(x) > 0.02]
    return ", ".join(parts[:MOST_LISTED]) + (", ..." if len(parts) > MOST_LISTED else "")


def _quoted(names: Sequence[str]) -> str:
    """Return the quoted names in a sentence, at most MOST_LISTED of them."""
    few = [f"'{name}'" for name in names[:MOST_LISTED]]
    rest = len(names) - len(few)
    return _listed([*few, *[f"{rest} more"] * (rest > 0)])


def _listed(words: Sequence[str]) -> str:
    *first, last = words
    return f"{', '.join(first)} and {last}" if first else last
