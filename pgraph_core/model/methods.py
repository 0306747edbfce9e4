"""The names of the integration methods: what a scenario may ask for and `simulate` can do."""

from __future__ import annotations

AUTO = "auto"  # chosen for the scene
METHOD_NAMES = (
    AUTO,
    "semi_implicit_euler",
    "rk4",
    "dopri5",
    "dop853",
    "ros2",
    "radau5",
    "moreau_jean",
)
