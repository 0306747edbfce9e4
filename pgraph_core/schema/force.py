"""Forces that act beside gravity: torques of motors and servos on joints."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Annotated, ClassVar, Literal, Self

from pydantic import Field, model_validator

from .fields import Described, Frozen, Number, Numbers, refuse


class Table(Frozen):
    """A number over time: straight lines between the knots, constant outside them."""

    t: Numbers = Field(description="ascending times [s], at least one")
    value: Numbers = Field(description="one finite number a time")

    @model_validator(mode="after")
    def _knots(self) -> Self:
        if not self.t or len(self.t) != len(self.value):
            sizes = f"{len(self.t)} times, {len(self.value)} values"
            refuse([("value", f"needs one value a time, at least one; given {sizes}")])
        if any(a >= b for a, b in zip(self.t, self.t[1:])):
            refuse([("t", f"the times t must ascend; given {list(self.t)}")])
        return self


class Force(Described):
    """A motor adds `torque` to a joint coordinate; a servo adds kp (target - q) - kd v besides.

    `torque_limit` bounds the magnitude of the whole. Torque stands for force where the
    coordinate is a translation.
    """

    FOLLOWERS: ClassVar[Mapping[str, tuple[str, ...]]] = {"kind": ("kp", "kd")}

    name: str = Field(description="text that is not empty")
    kind: Literal["motor", "servo"] = Field(default="motor", description="'motor' or 'servo'")
    body: str = Field(description="the name of a body, whose joint to its parent is driven")
    coordinate: Annotated[int, Field(ge=0, le=5)] = Field(
        default=0, description="the number of a degree of freedom of the joint, from 0"
    )
    torque: Number | Table = Field(
        default=0.0, description="a number or a table over time [N m, N]"
    )
    kp: Annotated[Number, Field(ge=0)] = Field(
        default=0.0, description="a number >= 0 [N m/rad, N/m]"
    )
    kd: Annotated[Number, Field(ge=0)] = Field(
        default=0.0, description="a number >= 0 [N m s/rad, N s/m]"
    )
    target: Number | Table = Field(
        default=0.0, description="a number or a table over time [rad, m]"
    )
    torque_limit: Annotated[Number, Field(gt=0)] | None = Field(
        default=None, description="a number > 0 [N m, N], or nothing"
    )

    @model_validator(mode="after")
    def _motor_has_no_gains(self) -> Self:
        if self.kind == "motor" and (self.kp or self.kd):
            refuse([("kind", "a motor has no kp and kd; use kind 'servo'")])
        return self
