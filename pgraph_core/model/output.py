"""Sites and outputs: named frames on bodies, and named quantities of a motion."""

from __future__ import annotations

from typing import Literal, NamedTuple, Self

from pydantic import model_validator

from ..fields import (
    GROUND,
    Described,
    Quat,
    Text,
    Vec3,
    Whole,
    field,
    maybe_part_of,
    quaternion,
    refuse,
    vector,
)
from ..units import M
from .imperfect import Imperfect


class Site(Described):
    """A named frame fixed to a body, or to the world if `body` is "ground".

    Sites have no mass. Their names can be used like body names in `mech.pose`, `mech.jacobian` and
    `mech.inverse_kinematics`.
    """

    name: Text = field("a non-empty string", label="Name")
    body: Text = field("the name of a body, or 'ground'", label="Body")
    point: Vec3 = field(
        "three finite numbers in the axes of `body` [m]",
        converter=vector, default=(0.0, 0.0, 0.0), dim=M, role="point",
        help="origin in body axes",
    )  # fmt: skip
    rotation: Quat = field(
        "a nonzero quaternion [w, x, y, z] in the axes of `body`",
        converter=quaternion, default=(1.0, 0.0, 0.0, 0.0), role="frame",
    )  # fmt: skip

    @model_validator(mode="after")
    def _turned(self) -> Self:
        refuse([("rotation", "a quaternion must not be zero")] if not any(self.rotation) else [])
        return self

    @property
    def touches(self) -> tuple[str, ...]:
        """The name of its body, or () for the ground."""
        return () if self.body == GROUND else (self.body,)


Kind = Literal[
    "joint_position", "joint_velocity", "position", "rotation", "velocity", "angular_velocity",
    "velocimeter", "gyro", "accelerometer", "force", "torque",
    "subtree_position", "subtree_velocity", "subtree_momentum", "touch",
]  # fmt: skip
OF_JOINT = ("joint_position", "joint_velocity")
OF_LOAD = ("force", "torque")
OF_SUBTREE = ("subtree_position", "subtree_velocity", "subtree_momentum")
OF_CONTACT = ("touch",)


class Reading(NamedTuple):
    """The numbers in an output, with their unit."""

    parts: tuple[str, ...]  # names of its numbers, ("",) for one number
    unit: str
    about: str


AXES = ("x", "y", "z")
READINGS: dict[str, Reading] = {
    "joint_position": Reading(("",), "rad, m", "coordinate of a joint"),
    "joint_velocity": Reading(("",), "rad/s, m/s", "rate of a coordinate of a joint"),
    "position": Reading(AXES, "m", "position of a frame, in world axes"),
    "rotation": Reading(("w", *AXES), "1", "quaternion of a frame, in world axes"),
    "velocity": Reading(AXES, "m/s", "velocity of a frame, in world axes"),
    "angular_velocity": Reading(AXES, "rad/s", "angular velocity, in world axes"),
    "velocimeter": Reading(AXES, "m/s", "velocity of a frame, in its own axes"),
    "gyro": Reading(AXES, "rad/s", "angular velocity, in its own axes"),
    "accelerometer": Reading(AXES, "m/s^2", "acceleration minus gravity, in its own axes"),
    "force": Reading(AXES, "N", "force that the joint transmits, in its own axes"),
    "torque": Reading(AXES, "N m", "torque that the joint transmits, in its own axes"),
    "subtree_position": Reading(AXES, "m", "centre of mass of a body and all that it carries"),
    "subtree_velocity": Reading(AXES, "m/s", "velocity of this centre of mass"),
    "subtree_momentum": Reading(AXES, "kg m^2/s", "angular momentum about this centre of mass"),
    "touch": Reading(("",), "N", "size of the sum of the contact forces on a body"),
}


class Output(Described):
    """A named quantity, available as `run.outputs[name]` and `stepper.outputs[name]`.

    The kinds `joint_position` and `joint_velocity` refer to a joint coordinate of the body `at`.
    All other kinds refer to the frame of the body or site `at`. The kinds `position` (of the
    origin), `rotation` (quaternion [w, x, y, z]), `velocity` and `angular_velocity` are given in
    world axes. The kinds `velocimeter`, `gyro` and `accelerometer` (acceleration minus gravity)
    behave like sensors that are fixed to the frame and use its axes. The same applies to `force`
    and `torque`, which are exerted by the joint on the body, about the origin of the frame. The
    kinds `subtree_position`, `subtree_velocity` and `subtree_momentum` are the centre of mass of
    the body and of all bodies that it carries, its velocity, and their angular momentum about it,
    in world axes. With `at="ground"`, they are those of the whole model. The kind `touch` is the
    size of the sum of the forces of all contacts on the body, with their friction. With
    `imperfect`, `run.measured[name]` has samples with noise, delay and a range.
    """

    name: Text = field("a non-empty string", label="Name")
    kind: Kind = field(f"one of {', '.join(READINGS)}", label="Kind")
    at: Text = field("the name of a body or site", label="At", help="a body or a site")
    coordinate: Whole = field(
        "the index of a degree of freedom of the joint, starting at 0",
        default=0, ge=0, le=5, help="index of the joint degree of freedom, starting at 0",
    )  # fmt: skip

    imperfect: Imperfect | None = field(
        "the imperfections of a sensor, {'sample': ..., 'density': ...}, or None",
        converter=maybe_part_of(Imperfect), default=None, since=10,
    )  # fmt: skip

    @model_validator(mode="after")
    def _possible(self) -> Self:
        if self.imperfect is not None and self.kind == "rotation":
            text = "does not apply to rotation, a quaternion, whose numbers take no noise; give it "
            refuse([("imperfect", f"{text}to angular_velocity or gyro")])
        if self.coordinate and self.kind not in OF_JOINT:
            refuse([("coordinate", f"does not apply to {self.kind}; remove it")])
        return self

    @property
    def touches(self) -> tuple[str, ...]:
        """The name of its body or site, or () for the ground."""
        return () if self.at == GROUND else (self.at,)

    @property
    def reading(self) -> Reading:
        """The numbers in the output, with their unit."""
        return READINGS[self.kind]
