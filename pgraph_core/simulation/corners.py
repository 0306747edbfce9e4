"""Discontinuities of forces, which a run with derivatives must not pass."""

from __future__ import annotations

from dataclasses import replace
from typing import Any

import numpy as np

from ..engine import layout as at
from ..engine import motion
from ..forces.obstacles import POINT
from ..packing import Array
from ..tolerances import VISIBLE
from .recording import Recording, scene_of

SPAN = np.dtype([
    ("body_a", int), ("row_a", int), ("point_a", float, 3), ("row_b", int), ("point_b", float, 3),
])  # fmt: skip


class Corners:
    """Discontinuities of forces, at zero length of springs and struts and at half a turn of
    torsions and bushings.

    The derivatives of a run do not include the effect of the time of such a jump.
    """

    def __init__(self, record: Recording):
        self.record, loads = record, record.scene.loads
        spring, strut, torsion, bushing = (
            getattr(loads, kind)[0] for kind in ("spring", "strut", "torsion", "bushing")
        )
        line = strut["spring"]
        pulls = line[:, 1] - line[:, 0] * line[:, 2]  # at a length of 0, as below
        stops = strut["bump_length"] * strut["bump_stiffness"]
        turns = bushing["stiffness"].reshape(-1, 6, 6)[:, 3:].any(axis=(1, 2))
        stiff = (spring["stiffness"] > 0.0) | (spring["knots"] > 0)
        # a path with via points has a tension where a span has no length
        stiff &= (spring["rest"] != 0.0) | (spring["vias"] > 0)
        presses = (pulls != 0.0) | (stops != 0.0) | (strut["vias"] > 0)
        found = [
            ("spring", _spans(loads.spring, loads.riders[0], stiff), self._lengths),
            ("strut", _spans(loads.strut, loads.riders[0], presses), self._lengths),
            ("torsion", torsion, self._twists),
            ("bushing", bushing[turns], self._turns),
        ]
        self.laws = [one for one in found if len(one[1])]
        # times of the next and the last look [s]
        self.next = self._time = float(record.steps.clock["time"])
        self.frame = int(record.steps.clock["frame"])  # the next one at the last look
        self._last: list[Array] = []
        if self.laws:  # the scene of the run keeps its memory
            plan = replace(record.plan, contacts=None)
            self._scene = scene_of(record.mech, plan)
            motion.energy(self._scene.address, record.q, record.v)
            self._last = [of(loads)[0] for _, loads, of in self.laws]

    def passed(self) -> str:
        """Return a message about a force that has jumped since the last check, or "".

        The next check takes place after half the time to a discontinuity at the present rate, and
        at most after twice the last interval.
        """
        record = self.record
        motion.energy(self._scene.address, record.q, record.v)
        t = float(record.steps.clock["time"])
        ahead, since = np.inf, max(t - self._time, np.finfo(float).tiny)
        for i, (kind, loads, of) in enumerate(self.laws):
            now, margin = of(loads)
            before, self._last[i] = self._last[i], now
            step = np.linalg.norm(now - before, axis=1)
            if kind in ("torsion", "bushing"):
                flips = step > np.pi
            else:  # between both lies a point that is within 1 % of the step from a length of 0
                height = np.linalg.norm(np.cross(now, before), axis=1)
                flips = ((now * before).sum(1) < 0.0) & (height < VISIBLE * step * step)
            if flips.any():
                row = record.mech.topology.names[int(loads["body_a"][flips.argmax()]) - 1]
                where = "half a turn" if kind in ("torsion", "bushing") else "a length of 0"
                return f"the {kind} on body '{row}' passes {where}, where its force jumps"
            rate = step / since
            with np.errstate(divide="ignore", over="ignore"):  # at rest
                ahead = min(ahead, float((margin / rate).min()))
        self.next, self._time = t + min(0.5 * ahead, 2.0 * since), t
        self.frame = int(record.steps.clock["frame"])
        return ""

    def _points(self, table: Any, end: str) -> Array:
        work, row = self._scene.work, table[f"row_{end}"]
        turned = np.einsum("nij,nj->ni", self._rows(table, end), table[f"point_{end}"])
        return work[row, at.X : at.X + 3] + turned

    def _rows(self, table: Any, end: str) -> Array:
        return self._scene.work[table[f"row_{end}"], at.R : at.R + 9].reshape(-1, 3, 3)

    def _lengths(self, table: Any) -> tuple[Array, Array]:
        apart = self._points(table, "a") - self._points(table, "b")
        return apart, np.linalg.norm(apart, axis=1)

    def _twists(self, table: Any) -> tuple[Array, Array]:
        (a1, a2), (b1, b2) = (
            [np.einsum("nij,nj->ni", self._rows(table, end), table[x]) for x in ("first", "second")]
            for end in "ab"
        )
        sine, cosine = ((a1 * b2 - a2 * b1).sum(1), (a1 * b1 + a2 * b2).sum(1))
        angle = np.arctan2(sine, cosine)
        angle = np.remainder(angle - table["rest"] + np.pi, 2.0 * np.pi) - np.pi
        return angle[:, None], np.pi - np.abs(angle)

    def _turns(self, table: Any) -> tuple[Array, Array]:
        mine, other = (
            self._rows(table, end) @ table[f"axes_{end}"].reshape(-1, 3, 3) for end in "ab"
        )
        from scipy.spatial.transform import Rotation

        turn = Rotation.from_matrix(other.transpose(0, 2, 1) @ mine).as_rotvec()
        return turn, np.pi - np.linalg.norm(turn, axis=1)


def _spans(own: Any, riders: Any, chosen: Array) -> Any:
    """Return the straight spans of chosen loads along paths, as records of their two ends.

    There are none beside a point that counts in a range, where switches of a run bring jumps.
    """
    (table, _, vias), found = own, []
    ranged = set(riders["row"][riders["gate"] >= 0].tolist())
    for one in table[chosen]:
        inside = vias[one["first_via"] : one["first_via"] + one["vias"]]
        rows = [one["row_a"], *inside["row"], one["row_b"]]
        points = [one["point_a"], *inside["point"], one["point_b"]]
        round_ = [x["shape"] != POINT or int(x["row"]) in ranged for x in inside]
        round_ = [False, *round_, False]
        ends = zip(rows, points, rows[1:], points[1:], round_, round_[1:])
        found += [(one["body_a"], a, p, b, q) for a, p, b, q, *past in ends if not any(past)]
    return np.array(found, SPAN)
