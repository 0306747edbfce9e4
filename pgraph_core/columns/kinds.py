"""The kinds of joints as a table, from which kernels look up their motions."""

from __future__ import annotations

import numpy as np

from .. import joints
from ..engine.packing import gather
from .checks import JOINTS, MOTIONS, Array


def _kinds() -> Array:
    """Motions of every kind of joint, as `engine/packing/gather.py` takes them."""
    table = np.zeros((len(JOINTS), 1 + 3 * gather.STRIDE))
    for row, kind in zip(table, JOINTS):
        row[gather.COUNT] = len(joints.DEFAULT[kind])
        for n, (motion, axis) in enumerate(joints.DEFAULT[kind]):
            row[1 + n * gather.STRIDE :][: gather.STRIDE] = MOTIONS.index(motion), *axis
    return table


KINDS = _kinds()
