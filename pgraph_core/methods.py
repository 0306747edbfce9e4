"""The names of the integration methods: what a scenario may ask for and `simulate` can do."""

from __future__ import annotations

AUTO = "auto"  # chosen for the scene
METHOD_NAMES = (AUTO, "semi_implicit_euler", "rk4", "moreau_jean")
