"""Random models and states, and helpers that move, shuffle and compare them."""

import numpy as np

from pgraph_core import joints
from pgraph_core.paper import bodies_of
from pgraph_core.rotation import multiply
from pgraph_core.topology import Topology

from ..random_models import KINDS, State, random_body, random_case, random_model, random_state

__all__ = ["KINDS", "State", "random_body", "random_case", "random_model", "random_state"]


def moved(model, q, step):
    """q after the displacement `step` [rad, m], laid out as v: turns by exponentials.

    A turn is about axes fixed in the parent, so its quaternion multiplies from the left.
    """
    out, i, j = np.array(q, dtype=float), 0, 0
    for body in bodies_of(model, Topology.of(model)):
        for motion in body.sequence:
            nq, nv = joints.SIZE[motion.kind]
            x, d = q[i : i + nq], step[j : j + nv]
            if nq == nv:
                out[i] = x[0] + d[0]
            else:
                out[i : i + nq - 4] = x[:-4] + d[3:]
                out[i + nq - 4 : i + nq] = multiply(exponential(d[:3]), x[-4:])
            i, j = i + nq, j + nv
    return out


def exponential(turn):
    """Quaternion of a rotation vector."""
    half = np.linalg.norm(turn) / 2
    return (np.cos(half), *(np.sinc(half / np.pi) / 2 * np.asarray(turn)))


def shuffled(rng, model):
    """The same mechanism with its rows in another order."""
    order = rng.permutation(len(model.bodies))
    return model.replace(bodies=tuple(model.bodies[i] for i in order))


def scaled_error(found, expected):
    """Largest difference relative to the largest expected number (or 1)."""
    found, expected = np.asarray(found), np.asarray(expected)
    assert found.shape == expected.shape
    if not expected.size:
        return 0.0
    return float(abs(found - expected).max() / max(1.0, abs(expected).max()))


def with_joints(s, **fields):
    """The model of a state with fields of all joints, laid out as its q or its v."""
    model, i, j = s.model, 0, 0
    for body in bodies_of(s.model, s.topology):
        nq, nv = len(body.q), body.dof
        own = {k: x[i : i + nq] if k == "q" else x[j : j + nv] for k, x in fields.items()}
        model = model.edit(body.name, **own) if nv else model
        i, j = i + nq, j + nv
    return model
