"""Outputs: what sensors of a model read off motions of its bodies."""

from __future__ import annotations

from typing import Any

import numpy as np

from .. import joints
from ..dynamics.states import BodyMotion
from ..engine.records import table
from ..engine.tree import sensors as kernels
from ..model import Model
from ..model.fields import GROUND
from ..model.output import OF_JOINT, OF_LOAD, READINGS, Output
from ..packing.packed import Packed
from ..packing.system import Array
from ..rotation import unit

KINDS = list(READINGS)


class Sensors:
    """The outputs of a model as a table for the kernel."""

    def __init__(self, packed: Packed, model: Model):
        """`loads`: whether any reads what a joint passes on; `moves`: what bodies do."""
        wanted, sites = model.outputs, {s.name: s for s in model.sites}
        self.gravity = np.array(model.gravity)
        self.table, self._spans, self.width = table(kernels.SENSOR, len(wanted)), [], 0
        for o, one in zip(wanted, self.table):
            one["kind"], one["first"] = KINDS.index(o.kind), self.width
            if o.kind in OF_JOINT:
                one["entry"] = _entry(packed, model, o)
            else:
                site = sites.get(o.at)
                body = o.at if site is None else site.body
                one["body"] = 0 if body == GROUND else packed.topology.number(body)
                one["point"] = (0.0, 0.0, 0.0) if site is None else site.point
                one["turn"] = (1.0, 0.0, 0.0, 0.0) if site is None else unit(site.rotation)
            self._spans.append((o.name, self.width, self.width + len(o.reading.parts)))
            self.width += len(o.reading.parts)
        self.moves = any(o.kind not in OF_JOINT for o in wanted)
        self.loads = any(o.kind in OF_LOAD for o in wanted)

    def read(self, q: Array, v: Array, motion: BodyMotion) -> Array:
        """(n, width) in n states (n, nq), (n, nv)."""
        out = np.empty((len(q), self.width))
        kernels.read_sensors(self.table, self.gravity, q, v, *motion, out)
        return out

    def by_name(self, read: Array) -> dict[str, Any]:
        """{name: (...,), (..., 3) or (..., 4)} of what was read, (..., width)."""
        return {name: read[..., a] if b == a + 1 else read[..., a:b] for name, a, b in self._spans}


def _entry(packed: Packed, model: Model, o: Output) -> int:
    """Where in q or v a coordinate of a joint stands."""
    joint = packed.joints[o.at]
    if o.kind == "joint_velocity":
        return joint.v.start + o.coordinate
    place = joints.places(model.body(o.at).sequence)[o.coordinate]
    assert place is not None
    return joint.q.start + place


def no_motion(n: int) -> BodyMotion:
    """Of no bodies, for outputs of joints alone."""
    return BodyMotion(np.empty((n, 0, 7)), *(np.empty((n, 0, 6)) for _ in range(3)))
