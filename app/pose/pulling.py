"""The force of a mouse that pulls on a body: a spring and a damper to where it points (pure)."""

from __future__ import annotations

import math

import numpy as np

FREQUENCY = 1.5  # [Hz] at which what is pulled would swing to the mouse
WEIGHTS = 5.0  # the most it pulls, in weights of the whole model


def pull_force(
    point: np.ndarray, velocity: np.ndarray, target: np.ndarray, mass: float
) -> np.ndarray:
    """(3,) [N] on a body at `point`, which moves with `velocity`, towards `target`.

    A spring that would swing `mass` [kg], the model's, at FREQUENCY, critically damped; never
    more than WEIGHTS times its weight, so that a far mouse does not tear the model apart.
    """
    omega = 2 * math.pi * FREQUENCY
    force = mass * (omega**2 * (target - point) - 2 * omega * velocity)
    size, most = float(np.linalg.norm(force)), WEIGHTS * 9.81 * mass
    return force if size <= most else force * (most / size)
