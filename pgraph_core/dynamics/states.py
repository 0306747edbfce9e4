"""A state carried to another topology, the distance of two states, the size of a mechanism."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from ..engine import layout as at
from ..packing.packed import Packed
from ..packing.system import Array, Ints


class Carried(NamedTuple):
    """A state of one mechanism as a state of another."""

    q: Array  # (nq,)
    v: Array  # (nv,)
    reset: tuple[str, ...]  # joints at home: the other has none of this name and kind


def carried(new: Packed, old: Packed, q: Array, v: Array) -> Carried:
    """The state (q, v) of `old` as one of `new`; joints that `old` lacks start at home."""
    new_q, new_v = new.system.q.copy(), new.system.v.copy()
    theirs, reset = old.joints, []
    for name, joint in new.joints.items():
        before = theirs.get(name)
        if before is None or before.kinds != joint.kinds:
            reset.append(name)
            continue
        new_q[joint.q] = q[before.q]
        new_v[joint.v] = v[before.v]
    return Carried(new_q, new_v, tuple(reset))


def angles(p: Array, q: Array) -> Array:
    """Angles between unit quaternions [rad], |p - q| = 2 sin(a/4): exact for small ones too.

    p and -p are the same rotation.
    """
    apart = np.minimum(np.linalg.norm(p - q, axis=-1), np.linalg.norm(p + q, axis=-1))
    return 4.0 * np.arcsin(np.clip(apart / 2.0, 0.0, 1.0))


def differences(rows: Ints, q: Array, other: Array) -> tuple[Array, Array]:
    """((n,) largest rotation [rad], (n,) largest translation [m]) from motion q to `other`.

    Motions are (n, nq), `rows` those of the mechanism's joints. Attitudes differ by an angle.
    """
    kinds, places = rows[1:, at.KIND], rows[1:, at.QI]
    apart = np.abs(q - other)
    if not kinds.any():  # hinges alone
        return apart.max(axis=1, initial=0.0), np.zeros(len(q))
    free = places[kinds == at.FREE]
    slides = np.concatenate([places[kinds == at.TRANSLATE], free, free + 1, free + 2])
    turned = apart[:, places[kinds == at.ROTATE]].max(axis=1, initial=0.0)
    for i in (*places[kinds == at.BALL].tolist(), *(free + 3).tolist()):
        turned = np.maximum(turned, angles(q[:, i : i + 4], other[:, i : i + 4]))
    return turned, apart[:, slides].max(axis=1, initial=0.0)


def length_of(packed: Packed) -> float:
    """Largest of a mechanism's own lengths: links, centres of mass, radii of gyration [m]."""
    return length_in(packed.const)


def length_in(const: Array) -> float:
    """`length_of` from the rows' constants."""
    const = const[1:]
    mass = np.where(const[:, at.MASS] > 0, const[:, at.MASS], np.inf)
    gyration = const[:, at.INERTIA : at.INERTIA + 3].sum(axis=1) / mass
    found = [np.sqrt(gyration.max(initial=0.0))]
    for column in (at.LINK, at.COM):
        found.append(np.linalg.norm(const[:, column : column + 3], axis=1).max(initial=0.0))
    return float(max(found))
