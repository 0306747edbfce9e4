"""Lengths of a new muscle."""

from __future__ import annotations

import numpy as np

import pgraph_core as pg
from pgraph_core.model.poses import poses


def lengths(model: pg.Model, body: str, other: str) -> dict[str, float]:
    """Return l_opt and l_slack, each half of the way between the ends of a new muscle [m].

    Its fibre then begins at its optimal length, where it has no passive force.
    """
    at = poses(model.standing)
    way = np.asarray(at[body].place(model.body(body).tip_point)) - at[other].position
    half = float(f"{0.5 * np.linalg.norm(way):.3g}")
    return {"l_opt": half, "l_slack": half} if half else {}
