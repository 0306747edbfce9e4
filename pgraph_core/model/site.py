"""Sites: named frames on bodies, for tools, sensors and targets."""

from __future__ import annotations

from typing import Self

from pydantic import model_validator

from .fields import GROUND, Described, Quat, Vec3, field, quaternion, refuse, vector


class Site(Described):
    """A named frame that is fixed in a body, or in the world where `body` is "ground".

    It has no mass. `mech.pose`, `mech.jacobian` and `mech.inverse_kinematics` take its name as
    they take a body's.
    """

    name: str = field("text that is not empty", label="Name")
    body: str = field("the name of a body, or 'ground'", label="Body")
    point: Vec3 = field(
        "three finite numbers in the axes of `body` [m]",
        converter=vector, default=(0.0, 0.0, 0.0), unit="length",
        help="its origin in the axes of the body",
    )  # fmt: skip
    rotation: Quat = field(
        "a quaternion [w, x, y, z] that is not zero, of its axes in those of `body`",
        converter=quaternion, default=(1.0, 0.0, 0.0, 0.0),
    )  # fmt: skip

    @model_validator(mode="after")
    def _turned(self) -> Self:
        refuse([("rotation", "a quaternion must not be zero")] if not any(self.rotation) else [])
        return self

    @property
    def touches(self) -> tuple[str, ...]:
        """The name of its body; the ground is none."""
        return () if self.body == GROUND else (self.body,)
