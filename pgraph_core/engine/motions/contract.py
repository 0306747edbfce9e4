"""The contract of a motion: what its file answers, and how a sweep asks the kind of a row.

A question is one function for all kinds, made at compile time. It compares the kind of the row and
calls that kind's answer, so a sweep contains the code of every kind and no calls by address.
"""

from collections.abc import Iterable, Mapping
from typing import Any, NamedTuple

from ..compiler.jit import part
from ..rows import kind_of, rotation_of


class Motion(NamedTuple):
    """One kind of motion of a row relative to its parent row.

    A quaternion follows the other coordinates in q, and its angular velocity precedes the other
    velocities in v. All functions take (rows, work, k, ...) for row k, and their other arguments
    are those of the questions in `motions`.
    """

    number: int  # the kind's number in `rows`
    coordinates: int  # entries in q
    freedoms: int  # entries in v, columns of H
    attitude: bool  # a quaternion is among the coordinates
    angle: bool  # the only coordinate is an angle [rad]
    turns: bool  # about an axis fixed in the parent row, so its sine and cosine are taken first
    travels: bool  # the origin moves relative to the parent row
    # H depends on the coordinate, which is the only one, or moves the origin across its own axis
    bends: bool
    transmits: bool  # the parent feels loads on the row: false if H spans all velocities
    inert: bool  # a state of a control, which has no frame, energy or scale in common with others
    place: Any  # frame of the row
    set_rates: Any  # velocity and a of the row
    column: Any  # a column of H
    unit_wrench: Any  # a wrench W with Hᵀ W = 1 at one coordinate, 0 at the others
    slopes: Any  # first and second derivative of H in the coordinate, in the parent's axes
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

    H is its only column, in world axes at the origin of row k. All functions take
    (rows, work, k, ...).
    """

    number: int
    angle: bool
    turns: bool
    travels: bool
    bends: bool
    inert: bool
    place: Any  # this and `set_rates` are those of a `Motion`
    set_rates: Any
    column: Any  # H as (angular, linear)
    unit_wrench: Any  # a wrench W with Hᵀ W = 1: H where its length is 1
    slopes: Any  # `slopes` of the `Motion`
    add_motion: Any  # V + H x for a number x, with V = (alpha, linear)
    along: Any  # Hᵀ F of a wrench (moment, force)
    through: Any  # U = I H as (angular, linear), then Hᵀ U, for I = [j b, bᵀ m]
    size: Any  # |angular part of H| · angular + |linear part| · linear, for any two numbers


@part
def straight(rows, work, k, const, q):
    """Return no slopes of H, which does not depend on the coordinates."""
    zero = 0.0 * rotation_of(work, k)[0]  # a number of the kind in `work`
    none = (zero, zero, zero)
    return (none, none), (none, none)


def question(answers: Mapping[int, Any]) -> Any:
    """Return a function of (rows, work, k, *given) that calls the answer of the kind of row k.

    Kinds with the same answer are compared together.
    """
    groups: dict[Any, list[int]] = {}
    for number, answer in answers.items():
        groups.setdefault(answer, []).append(number)
    return _chain(list(groups.items()))


def _chain(groups: list[tuple[Any, list[int]]]) -> Any:
    """Return a function that asks the first group if the kind is in it, otherwise the others."""
    (answer, numbers), *others = groups
    if not others:
        return answer
    among, rest = flag(numbers), _chain(others)

    @part
    def ask(rows, work, k, *given):
        if among(kind_of(rows, k)):
            return answer(rows, work, k, *given)
        return rest(rows, work, k, *given)

    return ask


def flag(numbers: Iterable[int]) -> Any:
    """Return a function that checks whether the number of a kind is among these."""
    bits = sum(1 << number for number in numbers)
    return part(lambda kind: (bits >> kind) & 1 == 1)


def count(values: Mapping[int, int]) -> Any:
    """Return a function of the number of a kind. Values are below 8, and stand in one integer."""
    octal = sum(value << (3 * number) for number, value in values.items())
    return part(lambda kind: (octal >> (3 * kind)) & 7)
