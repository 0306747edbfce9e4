"""Notices about cables: a rope that pushes, and a wheel that a cable would leave."""

from __future__ import annotations

from collections.abc import Iterator
from typing import Any

import numpy as np

from ..analysis.rows import Rows
from ..packing import Array
from ..packing.cable_lines import Lying, cables_of, ropes_of, spans_in
from ..tolerances import NOTABLE, SOLVED, VISIBLE
from .running import Running

HALF_TURN = 0.95 * np.pi  # rad: frames may miss the jump itself


def on_wheels(record: Running) -> Iterator[str]:
    """Yield a notice about the first wheel that each cable would leave, in the frames."""
    mech, n = record.mech, record.steps.recorded
    number = mech.topology.number
    for cable in cables_of(mech.packed):
        for i in range(n):
            place, turned = mech.poses(record.out.q[i, : mech.nq])

            def turn(name: str, turned: Array = turned) -> Array:
                return turned[number(name) - 1] if number(name) else np.eye(3)

            def point(name: str, at: Any, place: Array = place, turn: Any = turn) -> Array:
                own = place[number(name) - 1] if number(name) else np.zeros(3)
                return own + turn(name) @ np.asarray(at, float)

            if text := _left(cable, point, turn):
                t = record.steps.times[i]
                yield f"{cable.part.word()} '{cable.part.name}': at t = {t:.6g} s {text}"
                break


def _left(cable: Lying, point: Any, turn: Any) -> str:
    """Return what is wrong with a cable on its wheels, or ""."""
    for rows, names, grips in cable.segments:
        spans = spans_in(rows, names, point, turn)
        wheels = [k for k in range(len(rows)) if rows[k]["radius"]]
        axes = {k: turn(names[k]) @ rows[k]["axis"] for k in wheels}
        for k, (span, a, b) in enumerate(zip(spans, names, names[1:])):
            if np.linalg.norm(span[3:6] - span[:3]) < VISIBLE * _size(rows[k : k + 2], spans):
                return (
                    f"'{a}' and '{b}', which follow each other along it, have come together; stop "
                    "them before by a limit of a joint or a contact"
                )
        for k in wheels:
            if k - 1 in axes and abs(axes[k - 1] @ axes[k]) < 1.0 - NOTABLE:
                return (
                    f"the axes of the wheels '{names[k - 1]}' and '{names[k]}' are no longer "
                    "parallel, and its length is not exact; put a point between them"
                )
        for k in wheels:
            if not 0 < k < len(rows) - 1:
                continue
            u, before, after = axes[k], spans[k - 1, 6:], spans[k, 6:]
            flat = [x - (x @ u) * u for x in (before, after)]
            angle = np.arctan2(u @ np.cross(*flat), flat[0] @ flat[1])
            near = rows[k]["wrap"]
            angle += 2.0 * np.pi * np.round((near - angle) / (2.0 * np.pi))
            if angle * np.sign(rows[k]["radius"]) < -VISIBLE:
                return (
                    f"it would leave the wheel '{names[k]}', on which the run keeps it; use a "
                    "spring or strut over an obstacle, which lets it go"
                )
        for k, carrier, side in grips:
            span, axis, ahead = spans[0 if k == 0 else -1], axes[k], turn(carrier) @ side
            normal = np.cross(axis, span[6:])
            angle = np.arctan2(np.cross(axis, ahead) @ normal, ahead @ normal)
            if abs(angle) > HALF_TURN:
                return (
                    f"it has turned by half a turn about the wheel '{names[k]}' since the start, "
                    f"as seen from '{carrier}', and its length jumps beyond that; only turns of a "
                    "wheel on its hinge are counted"
                )
    return ""


def pushing(record: Running) -> Iterator[str]:
    """Yield a notice about the first frame in which a rope would have to push."""
    from ..dynamics.exerted import rope_spans
    from ..dynamics.scene import segments_of

    packed, n = record.mech.packed, record.steps.recorded
    for rope in ropes_of(packed):
        name = rope.part.name
        for own, k in segments_of(packed.blocks, name):
            spans, _ = rope_spans(packed, k, record.out.q[:n, : record.mech.nq].copy())
            pull = np.einsum("nk,nk->n", record.out.wrenches[:n, k, 3:6], spans[:, 0, 6:])
            pushes = np.flatnonzero(pull < -SOLVED * np.abs(pull).max(initial=0.0))
            if len(pushes) and not _is_relative(record, rope):
                t = record.steps.times[pushes[0]]
                yield (
                    f"constraint '{name}': its segment '{own}' would have to push from t = "
                    f"{t:.6g} s on, where a rope slackens; use a pg.Cable without stiffness, which "
                    "does"
                )
                break


def _is_relative(record: Running, rope: Lying) -> bool:
    """Check whether the tensions of a belt are relative to an unknown pretension.

    The rows of its segments are then redundant: no motion changes the sum of their lengths.
    """
    mech = record.mech
    if not rope.part.closed:
        return False
    k = mech.packed.blocks.names.index(rope.part.name)
    rows = Rows.of(mech, np.array([k]), record.out.q[0, : mech.nq].copy()).J
    return int(np.linalg.matrix_rank(rows)) < len(rows)


def _size(rows: Any, spans: Array) -> float:
    """Return the size of the ends of a span, or for two points that of the longest span [m]."""
    wide = float(np.abs(rows["radius"]).max())
    return wide or float(np.linalg.norm(spans[:, 3:6] - spans[:, :3], axis=1).max())
