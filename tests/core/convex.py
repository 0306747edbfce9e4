"""Signed distance of convex shapes from their points alone: the oracle of the contact kernels.

The difference A - B of two polytopes is the hull of all differences of vertices. Where it holds
the origin, the depth is the nearest facet of Qhull's; else the nearest point of the hull is found
by Wolfe's method. Nothing of ours is run.
"""

import numpy as np
from scipy.spatial import ConvexHull, QhullError


def signed_distance(a: np.ndarray, b: np.ndarray) -> float:
    """Signed distance of the hulls of two sets of points, negative where they penetrate."""
    difference = (a[:, None] - b[None]).reshape(-1, 3)
    try:
        depth = ConvexHull(difference).equations[:, 3].max()
    except QhullError:  # flat: segments and points
        depth = np.inf
    return float(depth) if depth <= 0 else nearest(difference)


def nearest(points: np.ndarray) -> float:
    """Distance of the origin from the hull of points [Wolfe 1976]."""
    size = float((points**2).sum(axis=1).max())
    active = [int(np.argmin((points**2).sum(axis=1)))]
    weight = np.ones(1)
    last = np.inf
    while True:
        x = weight @ points[active]
        j = int(np.argmin(points @ x))
        stuck = not x @ x < last  # rounding: no step brings it nearer
        last = x @ x
        if stuck or j in active or points[j] @ x > x @ x - 1e-15 * size:
            return float(np.linalg.norm(x))
        active.append(j)
        active, weight = _shrunk(points, active, np.append(weight, 0.0))


def _shrunk(points: np.ndarray, active: list[int], weight: np.ndarray) -> tuple:
    """Points of which the nearest point of their affine hull is a convex combination."""
    while True:
        p = points[active]
        system = np.ones((len(p) + 1, len(p) + 1))
        system[0, 0] = 0
        system[1:, 1:] = p @ p.T
        wanted = np.linalg.lstsq(system, np.eye(len(p) + 1)[0], rcond=None)[0][1:]
        low = wanted <= 1e-13
        if not low.any():
            return active, wanted
        step = np.where(low, weight / np.maximum(weight - wanted, 1e-300), np.inf)
        weight = weight + min(1.0, step.min()) * (wanted - weight)
        kept = weight > 1e-13
        if kept.all():
            kept[np.argmin(weight)] = False
        active = [k for k, keep in zip(active, kept) if keep]
        weight = weight[kept] / weight[kept].sum()
