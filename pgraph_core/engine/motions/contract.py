"""The contract of a motion: what its file answers, and how a sweep asks the kind of a row.

A question is one function for all kinds, made at compile time. It compares the kind of the row and
calls that kind's answer, so a sweep contains the code of every kind and no calls by address.
"""

from collections.abc import Mapping
from typing import Any, NamedTuple

from ..compiler.jit import part
from ..rows import kind_of


class Motion(NamedTuple):
    """One kind of motion of a row relative to its parent row.

    A quaternion follows the other coordinates in q, and its angular velocity precedes the other
    velocities in v. All functions take (rows, work, k, ...) for row k, and their other arguments
    are those of the questions in `motions`.
    """

    number: int  # in `rows`
    coordinates: int  # entries in q
    freedoms: int  # entries in v, columns of H
    attitude: bool  # a quaternion is among the coordinates
    angle: bool  # the only coordinate is an angle about an axis [rad]
    travels: bool  # the origin moves relative to the parent row
    transmits: bool  # the parent feels loads on the row: false if H spans all velocities
    inert: bool  # a state of a control, which has no frame, energy or scale in common with others
    place: Any  # frame of the row
    set_rates: Any  # velocity and a of the row
    column: Any  # a column of H
    add_motion: Any  # V + H x
    project: Any  # Hᵀ F
    condense: Any  # the articulated inertia felt by the parent
    relay: Any  # the bias force felt by the parent, after `condense`
    solve: Any  # v' after `relay`
    is_singular: Any  # whether that inertia vanishes along the motion
    diagonal: Any  # the diagonal of D⁻¹
    restore: Any  # the inertia, where `condense` factored it in place
    past: Any  # three wrenches beyond the joint, and its share of them
    mobility: Any  # speed of the joint along a wrench
    respond: Any  # v from the shares of joints
    gather: Any  # the shares of joints from v


class Single(NamedTuple):
    """A kind of motion with one degree of freedom, which `single` completes to a `Motion`.

    H is its only column, in world axes at the origin of row k. The functions after `set_rates` take
    (work, k, ...).
    """

    number: int
    angle: bool
    travels: bool
    inert: bool
    place: Any  # as those of a `Motion`
    set_rates: Any
    column: Any  # H as (angular, linear)
    add_motion: Any  # V + H x for a number x, with V = (alpha, linear)
    along: Any  # Hᵀ F of a wrench (moment, force)
    through: Any  # U = I H as (angular, linear), then Hᵀ U, for I = [j b, bᵀ m]
    size: Any  # |angular part of H| · angular + |linear part| · linear, for any two numbers


def by_kind(answers: Mapping[int, Any]) -> Any:
    """Return a function of (kind, *given) that calls the answer with this number.

    Kinds with the same answer are compared together. Answers that are numbers are returned.
    """
    groups: dict[Any, list[int]] = {}
    for number, answer in answers.items():
        groups.setdefault(answer, []).append(number)
    return _chain(list(groups.items()))


def _chain(groups: list[tuple[Any, list[int]]]) -> Any:
    """Return a function that compares the kind with the first group, then with the others."""
    (answer, numbers), *others = groups
    found = part(lambda *given: answer) if isinstance(answer, int) else answer
    if not others:
        return part(lambda kind, *given: found(*given))
    among, rest = _among(numbers), _chain(others)

    @part
    def ask(kind, *given):
        if among(kind):
            return found(*given)
        return rest(kind, *given)

    return ask


def _among(numbers: list[int]) -> Any:
    """Return a function that checks whether a kind has one of the numbers."""
    first, *others = numbers
    if not others:
        return part(lambda kind: kind == first)
    rest = _among(others)
    return part(lambda kind: kind == first or rest(kind))


def question(answers: Mapping[int, Any]) -> Any:
    """Return a function of (rows, work, k, *given) that calls the answer of the kind of row k."""
    chain = by_kind(answers)

    @part
    def ask(rows, work, k, *given):
        return chain(kind_of(rows, k), rows, work, k, *given)

    return ask
