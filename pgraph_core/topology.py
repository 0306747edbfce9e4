"""The digraph: canonical numbers, Pgraph and jdof by the paper's seven steps, and the inverse.

Numbers are the paper's: bodies from 1, the ground 0. `parent[i - 1]` is the parent of body i.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property
from typing import Any, NamedTuple, TypeAlias

import numpy as np
from numpy.typing import NDArray

from .errors import InputError, Problem, choices, explained, shown
from .fields import GROUND
from .model import Model
from .model.joint_constraint import InJoints
from .numbering import canonical, children_of
from .portable import EqualByFields, Portable, keep_unchanged

Ints: TypeAlias = "NDArray[np.int64]"


@explained
@dataclass(frozen=True, eq=False)
class Topology(EqualByFields, Portable):
    """The bodies of a model in a canonical numbering, where a parent precedes its children.

    A table whose rows have this order keeps it: body k is row k. Otherwise, a row above its parent
    waits for it and comes next.
    """

    names: tuple[str, ...]  # by number
    row: Ints  # (nb,) row of the table, from 0, by number
    parent: Ints  # (nb,) numbers of the parents, 0 = ground
    dof: Ints  # (nb,) degrees of freedom of the joint to the parent

    def __post_init__(self) -> None:
        """Make the arrays read-only, because they are shared between mechanisms."""
        keep_unchanged((self.row, self.parent, self.dof))

    def __setstate__(self, state: dict[str, Any]) -> None:
        vars(self).update(state)
        self.__post_init__()

    @classmethod
    def of(cls, model: Model) -> Topology:
        """Build the topology of a valid model in O(n)."""
        bodies, rows = model.rows, model.row
        if bodies is not model.bodies:
            rows = {body.name: i for i, body in enumerate(bodies)}
        given = [0 if b.parent == GROUND else rows[b.parent] + 1 for b in bodies]
        order = canonical(given)
        number = [0] * (len(order) + 1)  # by row, from 1
        for i, row in enumerate(order, start=1):
            number[row + 1] = i
        return cls(
            names=tuple([bodies[row].name for row in order]),
            row=np.array(order, dtype=np.int64),
            parent=np.array([number[given[row]] for row in order], dtype=np.int64),
            dof=np.array([bodies[row].dof for row in order], dtype=np.int64),
        )

    @cached_property
    def _number(self) -> dict[str, int]:
        return {GROUND: 0, **{name: i for i, name in enumerate(self.names, start=1)}}

    @property
    def nb(self) -> int:
        """The number of bodies, one for every table row, including welded ones."""
        return len(self.names)

    def number(self, name: str) -> int:
        """Return the number of a body.

        Parameters
        ----------
        name : str
            Name of a body, or "ground", which has the number 0.

        Raises
        ------
        InputError
            If no body has this name. The message lists the bodies.
        """
        if name not in self._number:
            text = f"no body has this name; choose one of {choices(self.names)}"
            raise InputError(Problem(f"body '{name}'", "", text))
        return self._number[name]

    @property
    def pgraph(self) -> Ints:
        """The path-defined directed graph vector (Fig. 4)."""
        return pgraph_of(self.parent)

    @property
    def jdof(self) -> Ints:
        """The joint degrees of freedom along Pgraph, with 0 at every re-entry (Fig. 4)."""
        return jdof_of(self.pgraph, self.dof)

    @property
    def tips(self) -> Ints:
        """The numbers of bodies without children, ascending."""
        return np.flatnonzero(self._children() == 0)

    @property
    def separation_bodies(self) -> Ints:
        """The numbers of bodies with more than one child, ascending, excluding the ground."""
        many = np.flatnonzero(self._children() > 1)
        return many[many > 0]

    def _children(self) -> Ints:
        """Count the children as an (nb + 1,) array, at least 1 for the ground."""
        count = np.bincount(self.parent, minlength=self.nb + 1)
        count[0] = max(count[0], 1)
        return count

    def adjacency(self) -> Any:
        """S, eq. (1): an (nb, nb) sparse matrix, 1 if the row's body is a child of the column's."""
        from scipy import sparse

        child = np.flatnonzero(self.parent)
        ones = np.ones(len(child))
        return sparse.csr_array((ones, (child, self.parent[child] - 1)), shape=(self.nb, self.nb))


class Loop(NamedTuple):
    """A cut edge in the digraph: a constraint from one body to another, or to the ground (0)."""

    name: str
    kind: str
    body: int
    other: int


def loops_of(model: Model, topology: Topology) -> tuple[Loop, ...]:
    """Return the constraints between bodies as edges of the digraph that are not in the tree.

    A place on a beam is the row of the beam, where the topology has it as one.
    """
    of = {name: beam for name, beam in model.beam_of.items() if name not in topology._number}
    return tuple(
        Loop(c.name, c.kind, *(topology.number(of.get(name, name)) for name in pair))
        for c in model.constraints
        if not isinstance(c, InJoints)
        for pair in c._links
    )


@explained
def pgraph_of(parent: Sequence[int] | Ints) -> Ints:
    """Return the Pgraph of a tree with the given numbering, by the seven steps in Fig. 4.

    Children with smaller numbers are visited first. If there are several roots, the ground (0) is
    the first separation body (rule R20).

    Parameters
    ----------
    parent : array_like of int (n,)
        Number of the parent of each body, 0 for the ground.

    Returns
    -------
    ndarray of int (m,)
        The path through the tree.

    Raises
    ------
    InputError
        If `parent` does not describe a forest.

    Examples
    --------
    >>> pg.pgraph_of([0, 1, 2, 1]).tolist()
    [1, 2, 3, 1, 4]
    """
    children = _untraversed(parent)
    roots = children[0]
    pgraph: list[int] = []
    if not roots:
        return np.array(pgraph, dtype=np.int64)
    separation_stack: list[int] = []
    i = 0 if len(roots) > 1 else roots.pop()  # step 1: the root
    while True:
        pgraph.append(i)  # step 2
        if len(children[i]) > 1:  # step 3: a separation body
            separation_stack.append(i)
        if not children[i]:  # step 4: a tip body
            if not separation_stack:  # step 5
                break
            i = separation_stack.pop()
            pgraph.append(i)  # step 5: back to the last separation body, which adds no DoF
            if len(children[i]) > 1:
                separation_stack.append(i)
        i = children[i].pop()  # steps 4 and 6: an untraversed child, the left one
    return np.array(pgraph, dtype=np.int64)  # step 7


def _untraversed(parent: Sequence[int] | Ints) -> list[list[int]]:
    """Return the children in reverse order, so that pop() returns the leftmost child. Raises
    InputError."""
    numbers = _whole("parent", parent)
    nb = len(numbers)
    for i, p in enumerate(numbers.tolist(), start=1):
        if not 0 <= p <= nb:
            raise InputError(Problem(f"body {i}", "parent", f"must be from 0 to {nb}, got {p}"))
    if len(canonical(numbers.tolist())) < nb:
        reached = {row + 1 for row in canonical(numbers.tolist())}
        lost = next(i for i in range(1, nb + 1) if i not in reached)
        raise InputError(
            Problem(f"body {lost}", "parent", "its path does not lead to the ground (a cycle)")
        )
    return [list(c[::-1]) for c in children_of(numbers.tolist())]


def _whole(name: str, values: Sequence[int] | Ints) -> Ints:
    """Convert to an array of integers. Raises InputError."""
    try:
        numbers = np.asarray(values)
    except ValueError:  # lists of unequal length
        numbers = np.asarray(None)
    if numbers.ndim != 1 or (len(numbers) and numbers.dtype.kind not in "iu"):
        raise InputError(Problem(name, "", "must be a list of whole numbers, 0 for the ground"))
    return numbers.astype(np.int64)


@explained
def jdof_of(pgraph: Sequence[int] | Ints, dof: Sequence[int] | Ints) -> Ints:
    """Return the joint degrees of freedom along Pgraph, i.e. the vector jdof (rule R2).

    Parameters
    ----------
    pgraph : array_like of int (m,)
        The path of `pgraph_of`.
    dof : array_like of int (n,)
        Degrees of freedom of the joint of each body.

    Returns
    -------
    ndarray of int (m,)
        `dof[i - 1]` at the first occurrence of body i, and 0 elsewhere.
    """
    pgraph, first = _first_occurrences(pgraph)
    dof = _whole("dof", dof)
    if len(dof) != len(first):
        text = f"needs one whole number per body: {len(first)}, got {len(dof)}"
        raise InputError(Problem("dof", "", text))
    jdof = np.zeros(len(pgraph), dtype=np.int64)
    jdof[first] = dof[pgraph[first] - 1]
    return jdof


def find(pgraph: Sequence[int] | Ints) -> Ints:
    """Return the index (from 0) of each body's first occurrence in Pgraph (Fig. 7)."""
    return np.sort(np.unique(np.asarray(pgraph, dtype=np.int64), return_index=True)[1])


@explained
def parent_of(pgraph: Sequence[int] | Ints) -> Ints:
    """Return the parents of the tree that belongs to a Pgraph vector.

    The first occurrence of each body is preceded by its parent.

    Parameters
    ----------
    pgraph : array_like of int (m,)
        The path of `pgraph_of`.

    Returns
    -------
    ndarray of int (n,)
        Number of the parent of each body, 0 for the ground.
    """
    pgraph, first = _first_occurrences(pgraph)
    parent = np.zeros(len(first), dtype=np.int64)
    before = np.where(first > 0, pgraph[np.maximum(first - 1, 0)], 0)
    parent[pgraph[first] - 1] = before
    return parent


def _first_occurrences(pgraph: Sequence[int] | Ints) -> tuple[Ints, Ints]:
    """Return Pgraph and the first index of each body except the ground. Raises InputError."""
    pgraph = _whole("pgraph", pgraph)
    first = find(pgraph)
    first = first[pgraph[first] != 0]
    if not np.array_equal(np.sort(pgraph[first]), np.arange(1, len(first) + 1)):
        given = f"must hold every number from 1 to {len(first)}, got {shown(pgraph.tolist())}"
        raise InputError(Problem("pgraph", "", given))
    return pgraph, first
