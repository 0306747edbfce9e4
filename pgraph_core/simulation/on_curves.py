"""Notices about points on curves: past an end, or at a crossing where a run begins."""

from __future__ import annotations

from collections.abc import Iterator
from typing import Any

import numpy as np

from ..fields import GROUND
from ..model.curve_point import CurvePoint
from ..packing import Array
from ..tolerances import NOTABLE
from .running import Running


def on_curves(record: Running) -> Iterator[str]:
    """Yield a notice about each point that begins at a crossing of its curve, and about the first
    one that goes past an end, in the frames."""
    n, first = record.steps.recorded, None
    constraints = record.mech.model.constraints
    held = [constraints[i] for i in record.plan.ever.tolist()]
    for c in held if n else ():
        if not isinstance(c, CurvePoint):
            continue
        places = _places(record, c, n)
        size = float(np.ptp(c.curve.line(), axis=0).max())
        near = c.curve.around(places[0], NOTABLE * size)
        if len(near) > 1:
            branches = " and ".join(f"{q:.6g}" for q in near)
            yield (
                f"constraint '{c.name}' begins where its curve crosses itself, at the coordinates "
                f"{branches}; which branch its point takes is not determined: begin beside it"
            )
        if c.curve.closed:
            continue
        low, high = c.curve.pieces.x[[0, -1]].tolist()
        q, slack = c.curve.nearest(places), NOTABLE * (high - low)
        beyond = ((q < low - slack) | (q > high + slack)) & _acts(record, c.name, n)
        i = int(np.argmax(beyond)) if beyond.any() else n
        if i < (n if first is None else first[0]):
            first = i, c, ("beginning", low) if q[i] < low else ("end", high)
    if first is not None:
        i, c, (end, s) = first
        place = ", ".join(f"{x:.4g}" for x in c.curve.at(s)[0].tolist())
        yield (
            f"the point of constraint '{c.name}' is past the {end} [{place}] of its curve at t = "
            f"{record.steps.times[i]:.6g} s, and the bend there goes on; give more points, or stop "
            "it by a limit or a contact"
        )


def _acts(record: Running, name: str, n: int) -> Any:
    """Return a mask (n,) of the frames in which a constraint has a force, since it may be off."""
    blocks = record.mech.packed.blocks
    k = blocks.names.index(name)
    own = record.out.wrenches[:n, blocks.first[k] : blocks.first[k + 1]]
    acts = np.any(own, axis=(1, 2))
    return acts if np.any(acts) else np.logical_not(acts)


def _places(record: Running, c: CurvePoint, n: int) -> Array:
    """Return the point (n, 3) of a constraint in the axes of `other`, in the frames."""
    mech, found = record.mech, []
    a, b = (mech.topology.number(name) - 1 for name in c.pair)
    point = np.array(mech.model.point_of(c))
    for q in record.out.q[:n, : mech.nq]:
        position, rotation = mech.poses(q)
        place = position[a] + rotation[a] @ point
        found.append(place if c.other == GROUND else rotation[b].T @ (place - position[b]))
    return np.array(found)
