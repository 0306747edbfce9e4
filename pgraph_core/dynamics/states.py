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
