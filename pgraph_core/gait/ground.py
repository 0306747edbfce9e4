"""The height of the ground under a point, where up is y."""

from __future__ import annotations

from ..schema import Model


def height_under(model: Model, x: float, z: float) -> float:
    """Height [m] of the ground at (x, z): of its plane, and of the last step that is there."""
    n = model.ground_normal
    height = -(n[0] * x + n[2] * z) / n[1]
    raised = 0.0
    for step in model.ground.steps:
        (x0, z0), (x1, z1) = step.low, step.high
        if x0 <= x <= x1 and z0 <= z <= z1:
            raised = step.height
    return height + raised / n[1]
