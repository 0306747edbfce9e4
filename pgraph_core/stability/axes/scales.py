"""The same motion of a mechanism of another size, of another weight, at another pace."""

from __future__ import annotations

from ..axis import Axis
from ..dimensions import rescaled

VALUES = (1e-9, 1e-6, 1e-3, 1.0, 1e3, 1e6, 1e9)

LENGTH_SCALE = Axis(
    "length_scale",
    "factor on every length, gravity too",
    "",
    VALUES,
    lambda model, value: rescaled(model, length=value),
)
MASS_SCALE = Axis(
    "mass_scale",
    "factor on every mass, forces too",
    "",
    VALUES,
    lambda model, value: rescaled(model, mass=value),
)
TIME_SCALE = Axis(
    "time_scale",
    "factor on every time, steps and duration too",
    "",
    VALUES,
    lambda model, value: rescaled(model, time=value),
    pace=float,
)
