"""What a model has besides its parts: its name, which way is up, and gravity."""

from __future__ import annotations

from typing import Any, Literal

from pydantic import Field, model_validator

from .fields import Described, Vec3

DOWN: dict[str, Vec3] = {"x": (-9.81, 0.0, 0.0), "y": (0.0, -9.81, 0.0), "z": (0.0, 0.0, -9.81)}


class World(Described):
    """Gravity points down along `up` unless it is given."""

    name: str = Field(default="model", description="text")
    up: Literal["x", "y", "z"] = Field(default="z", description="'x', 'y' or 'z'")
    gravity: Vec3 = Field(default=DOWN["z"], description="three finite numbers [x, y, z] [m/s^2]")

    @model_validator(mode="before")
    @classmethod
    def _gravity_points_down(cls, data: Any) -> Any:
        if isinstance(data, dict) and data.get("gravity") is None:
            data = {**data, "gravity": DOWN.get(str(data.get("up", "z")), DOWN["z"])}
        return data
