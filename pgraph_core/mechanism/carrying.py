"""A state on another topology: coordinates kept by the joint's name and kind."""

from __future__ import annotations

from collections.abc import Mapping
from typing import TYPE_CHECKING, NamedTuple

from ..engine import layout as at
from ..system import Array, System

if TYPE_CHECKING:
    from .mechanism import Mechanism


class Carried(NamedTuple):
    """A state of a mechanism that has been that of another."""

    q: Array  # (nq,)
    v: Array  # (nv,)
    reset: tuple[str, ...]  # joints that start anew: the other has none of that name and kind


class Joint(NamedTuple):
    """What moves in a joint, and where in q and v."""

    kinds: tuple[int, ...]  # of its motions, as in `engine/layout.py`
    q: slice
    v: slice


def joints_of(names: tuple[str, ...], system: System, nq: int, nv: int) -> Mapping[str, Joint]:
    """The joints that move, by name of their bodies."""
    kinds, at_q, at_v = (system.rows[1:, k].tolist() for k in (at.KIND, at.QI, at.VI))
    at_q.append(nq)
    at_v.append(nv)
    found: dict[str, Joint] = {}
    row = 0
    for name, count in zip(names, system.bodies_i[1:, at.OWN_ROWS].tolist()):
        end = row + count
        if count:
            spans = slice(at_q[row], at_q[end]), slice(at_v[row], at_v[end])
            found[name] = Joint(tuple(kinds[row:end]), *spans)
        row = end
    return found


def carried(mech: Mechanism, other: Mechanism, q: Array, v: Array) -> Carried:
    """The state (q, v) of `other` as one of `mech`; joints that it lacks start at home."""
    new_q, new_v = mech.home()
    theirs, reset = other.joints, []
    for name, joint in mech.joints.items():
        old = theirs.get(name)
        if old is None or old.kinds != joint.kinds:
            reset.append(name)
            continue
        new_q[joint.q] = q[old.q]
        new_v[joint.v] = v[old.v]
    return Carried(new_q, new_v, tuple(reset))
