"""The pose that a gait starts from: on the ground, at its height, the paws parallel to the thighs.

Vectors in a leg's plane are complex numbers x + i y, and a turn by an angle is exp(i angle).
"""

from __future__ import annotations

import cmath
import math
from typing import Any

import numpy as np

from ..mechanism import Mechanism
from ..model import Gait
from ..packing.system import Array
from .anatomy import Anatomy, whole
from .ground import height_under

ROUNDS = 6  # bent legs move the centre of mass: a sixth of the way a round


def standing(mech: Mechanism, gait: Gait, a: Anatomy) -> tuple[Array, Array]:
    """(q, v) at rest, every foot under its hip on the ground of the model."""
    q, v = np.zeros(mech.nq), np.zeros(mech.nv)
    q[3] = 1.0
    wanted = height_under(mech.model, a.centre[0], a.centre[2]) + gait.height
    high = a.centre[1]
    for _ in range(ROUNDS):
        q[1] += wanted - high
        _bend(mech, gait, a, q)
        high = whole(mech, q)[1][1]
    return q, v


def _bend(mech: Mechanism, gait: Gait, a: Anatomy, q: Array) -> None:
    """The legs' joints into q, so that the feet are on the ground."""
    for hip, f in zip(a.hips, a.legs):
        spreads = f["v_spread"] >= 0
        x, z = f["ahead"], f["side"] * gait.width * spreads
        y = height_under(mech.model, hip[0] + x, hip[2] + z) - hip[1] - q[1]
        bend, knee = leg(f, complex(x, -math.hypot(y, z)))
        q[f["q_flex"] : f["q_flex"] + 3] = bend, knee, -knee
        if spreads:
            q[f["q_spread"]] = math.atan2(-z, -y)


def leg(f: Any, foot: complex) -> tuple[float, float]:
    """(hip's angle, knee's) that bring a foot to its place from the hip, as `engine.gait.legs`."""
    a, b = complex(*f["long"]), complex(*f["shank"])
    cosine = (abs(foot) ** 2 - abs(a) ** 2 - abs(b) ** 2) / (2 * abs(a) * abs(b))
    side = cmath.phase(b / a)
    bend = math.copysign(math.acos(min(max(cosine, -1.0), 1.0)), side)
    knee = bend - side
    return cmath.phase(foot / (a + b * cmath.exp(1j * knee))), knee
