"""Forces besides gravity: on joints, on bodies, and between two points or bodies.

One class a kind; `Force(kind=...)` makes them too. Their signs and angles are in
docs/description.md.
"""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any, ClassVar, Literal, Self

import numpy.typing as npt
from pydantic import model_validator

from .curves import Table, VectorTable
from .fields import GROUND, Number, OfKinds, Vec3, field, maybe_vector, refuse_no_direction

KIND = "one of motor, servo, wrench, spring, torsion"


def _over_time(value: float | Table | Mapping[str, npt.ArrayLike]) -> Number | Table:
    """A number or a table over time."""
    return value  # type: ignore[return-value]


def _vector_over_time(value: npt.ArrayLike | VectorTable | Mapping[str, Any]) -> Vec3 | VectorTable:
    """Three numbers, or a table of them over time."""
    return value  # type: ignore[return-value]


class Force(OfKinds):
    """Acts on `body`. Its kinds are Motor, Servo, Wrench, Spring and Torsion."""

    KINDS: ClassVar[dict[str, type[OfKinds]]] = {}
    WORD: ClassVar[str] = "force"
    NOTHING: ClassVar[Mapping[str, Any]] = {
        "other": GROUND, "coordinate": 0, "torque": 0.0, "kp": 0.0, "kd": 0.0, "target": 0.0,
    }  # fmt: skip

    name: str = field("text that is not empty", label="Name")
    kind: str = field(KIND, label="Kind")
    body: str = field("the name of a body", label="Body")

    def __init__(self, /, **data: Any):
        """A force of the given kind. Raises ModelError."""
        super().__init__(**data)


class OnJoint(Force):
    """Acts on a coordinate of the joint of `body`."""

    coordinate: int = field(
        "the number of a degree of freedom of the joint, from 0",
        default=0, ge=0, le=5, help="which degree of freedom of the body's joint, from 0",
    )  # fmt: skip
    torque: Number | Table = field(
        "a number or a table over time [N m, N]",
        converter=_over_time, default=0.0, unit="N m, N",
        help="a number, or over time: t value; t value; ...",
    )  # fmt: skip


class Motor(OnJoint):
    """`torque` on a coordinate of the joint of `body` (a force where it is a translation)."""

    ABOUT: ClassVar[str] = "a torque or force on a joint"

    kind: Literal["motor"] = field(KIND, default="motor")
    torque_limit: Number | None = field(
        "a number > 0 [N m, N], or nothing",
        default=None, gt=0, label="At most", unit="N m, N", help="largest magnitude; empty: none",
    )  # fmt: skip

    @classmethod
    def _foreign(cls, field: str, value: Any) -> str:
        if field in ("kp", "kd"):
            return "a motor has no kp and kd; use kind 'servo'"
        return super()._foreign(field, value)

    @classmethod
    def _empty(cls, field: str, value: Any) -> bool:
        return field == "target" or super()._empty(field, value)  # as it always was


class Servo(OnJoint):
    """`torque` + kp (target - q) - kd v on a coordinate of the joint of `body`."""

    ABOUT: ClassVar[str] = "holds or drives a joint at a target: kp, kd"

    kind: Literal["servo"] = field(KIND, default="servo")
    kp: Number = field(
        "a number >= 0 [N m/rad, N/m]",
        default=0.0, ge=0, label="kp", unit="N m/rad, N/m",
        help="torque per position off the target",
    )  # fmt: skip
    kd: Number = field(
        "a number >= 0 [N m s/rad, N s/m]",
        default=0.0, ge=0, label="kd", unit="N m s/rad", help="torque per velocity",
    )  # fmt: skip
    target: Number | Table = field(
        "a number or a table over time [rad, m]",
        converter=_over_time, default=0.0, unit="rad, m",
        help="a number, or over time: t value; t value; ...",
    )  # fmt: skip
    torque_limit: Number | None = field(
        "a number > 0 [N m, N], or nothing",
        default=None, gt=0, label="At most", unit="N m, N", help="largest magnitude; empty: none",
    )  # fmt: skip


class OnBody(Force):
    """Acts on `body` itself."""


class Between(OnBody):
    """Acts between `body` and `other`. Passive: it acts in every question, others in runs only."""

    other: str = field("the name of a body, or 'ground'", default=GROUND, label="Other")


class Wrench(OnBody):
    """`torque` and `force` on `body` at `point`."""

    ABOUT: ClassVar[str] = "a force and a torque on a body"

    kind: Literal["wrench"] = field(KIND, default="wrench")
    torque: Vec3 | VectorTable = field(
        "three finite numbers [x, y, z] or a table of them over time [N m]",
        converter=_vector_over_time, default=(0.0, 0.0, 0.0), unit="N m",
    )  # fmt: skip
    force: Vec3 | VectorTable = field(
        "three finite numbers [x, y, z] or a table of them over time [N]",
        converter=_vector_over_time, default=(0.0, 0.0, 0.0), unit="N",
    )  # fmt: skip
    frame: Literal["world", "body"] = field(
        "'world' or 'body': the axes of torque and force",
        default="world", label="Axes of", help="whose axes force and torque are in",
    )  # fmt: skip
    point: Vec3 | None = field(
        "three finite numbers in the axes of `body` [m]; left out: its origin",
        converter=maybe_vector, default=None, unit="length",
        help="in the axes of the body; empty: its origin",
    )  # fmt: skip


class Spring(Between):
    """stiffness (length - rest) + damping x its rate pull `point` and `other_point` together."""

    ABOUT: ClassVar[str] = "pulls two points together, with damper"

    kind: Literal["spring"] = field(KIND, default="spring")
    point: Vec3 | None = field(
        "three finite numbers in the axes of `body` [m]; left out: its tip",
        converter=maybe_vector, default=None, unit="length",
        help="in the axes of the body; empty: its tip",
    )  # fmt: skip
    other_point: Vec3 | None = field(
        "three finite numbers in the axes of `other` [m]; left out: its origin",
        converter=maybe_vector, default=None, unit="length",
        help="in the axes of the other; empty: its origin",
    )  # fmt: skip
    stiffness: Number = field("a number >= 0 [N/m]", default=0.0, ge=0, unit="N/m")
    damping: Number = field("a number >= 0 [N s/m]", default=0.0, ge=0, unit="N s/m")
    rest: Number | None = field(
        "a length >= 0 without force [m]; left out: as in the initial state",
        default=None, ge=0, unit="length", help="without force; empty: as in the initial state",
    )  # fmt: skip


class Torsion(Between):
    """-stiffness (angle - rest) - damping x its rate turn `body` about `axis` against `other`."""

    ABOUT: ClassVar[str] = "turns two bodies back to an angle, with damper"

    kind: Literal["torsion"] = field(KIND, default="torsion")
    axis: Vec3 | None = field(
        "a direction [x, y, z] that is not zero, in the axes of `body`; left out: z",
        converter=maybe_vector, default=None, help="direction in the axes of the body; empty: z",
    )  # fmt: skip
    stiffness: Number = field("a number >= 0 [N m/rad]", default=0.0, ge=0, unit="N m/rad")
    damping: Number = field("a number >= 0 [N m s/rad]", default=0.0, ge=0, unit="N m s/rad")
    rest: Number = field(
        "the angle without torque [rad]", default=0.0, unit="angle", help="the angle without torque"
    )

    @model_validator(mode="after")
    def _axis_points_somewhere(self) -> Self:
        refuse_no_direction(axis=self.axis)
        return self
