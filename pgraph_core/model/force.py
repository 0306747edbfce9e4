"""Forces besides gravity: on joints, on bodies, and between two points or bodies.

One class a kind; `Force(kind=...)` makes them too. Their signs and angles are in
docs/description.md.
"""

from __future__ import annotations

import math
from abc import abstractmethod
from collections.abc import Mapping
from typing import Any, ClassVar, Literal, NamedTuple, Self

import numpy.typing as npt
from pydantic import model_validator

from ..errors import shown
from .curves import Table, VectorTable
from .fields import (
    EMPTY,
    GROUND,
    AtPoint,
    ByName,
    Flag,
    Number,
    OfKinds,
    OfSums,
    OnSum,
    Quat,
    Text,
    Vec3,
    Whole,
    WithOther,
    by_name,
    field,
    maybe_vector,
    quaternion,
    refuse,
    refuse_no_direction,
    vector,
)

KIND = "one of motor, servo, wrench, spring, torsion, speed_servo, actuator, tendon, drag"


def _over_time(value: float | Table | Mapping[str, npt.ArrayLike]) -> Number | Table:
    """A number or a table over time."""
    return value  # type: ignore[return-value]


def _vector_over_time(value: npt.ArrayLike | VectorTable | Mapping[str, Any]) -> Vec3 | VectorTable:
    """Three numbers, or a table of them over time."""
    return value  # type: ignore[return-value]


class Force(OfKinds):
    """Acts on `body`.

    Its kinds are Motor, Servo, SpeedServo, Actuator, Tendon, Wrench, Spring, Torsion and Drag.
    """

    PASSIVE: ClassVar[bool] = False  # acts in every question, others in runs only
    KINDS: ClassVar[dict[str, type[OfKinds]]] = {}
    WORD: ClassVar[str] = "force"
    NOTHING: ClassVar[Mapping[str, Any]] = {
        "other": GROUND, "coordinate": 0, "torque": 0.0, "kp": 0.0, "kd": 0.0, "target": 0.0,
        "gear": 1.0, "coefficients": {},
    }  # fmt: skip

    name: Text = field("text that is not empty", label="Name")
    kind: Text = field(KIND, label="Kind")
    body: Text = field("the name of a body", label="Body")

    def __init__(self, /, **data: Any):
        """A force of the given kind. Raises ModelError."""
        super().__init__(**data)


def ends_of(f: Force) -> tuple[float | None, float | None]:
    """Least and greatest length that a force allows [m, rad]; None where it bounds none."""
    return getattr(f, "low", None), getattr(f, "high", None)


def _refuse_crossed_ends(f: Force) -> None:
    low, high = ends_of(f)
    if low is not None and high is not None and low > high:
        refuse([("low", f"must be at most high, {shown(high)}; given {shown(low)}")])


class OnJoint(Force, OfSums):
    """Acts on a coordinate of the joint of `body`, or on a sum of coordinates of joints.

    Its length is gear x q, or gear x the sum of coefficients x q; what it gives acts on each
    coordinate times that factor. One field is its input, which runs and steppers can give.
    """

    INPUT: ClassVar[str] = "torque"  # the field that is the input

    coordinate: Whole = field(
        "the number of a degree of freedom of the joint, from 0",
        default=0, ge=0, le=5, help="which degree of freedom of the body's joint, from 0",
    )  # fmt: skip
    coefficients: ByName = field(
        "body name -> numbers, one a degree of freedom of its joint; empty: `coordinate` alone",
        converter=by_name, default=EMPTY, label="Coefficient", help="acts on a sum: one a degree",
    )  # fmt: skip
    gear: Number = field(
        "a number that is not zero", default=1.0, help="its torque acts times this on the joint"
    )
    torque: Number | Table = field(
        "a number or a table over time [N m, N]",
        converter=_over_time, default=0.0, unit="N m, N",
        help="a number, or over time: t value; t value; ...",
    )  # fmt: skip
    torque_limit: Number | None = field(
        "a number > 0 [N m, N], or nothing",
        default=None, gt=0, label="At most", unit="N m, N", help="largest magnitude; empty: none",
    )  # fmt: skip
    torque_low: Number | None = field(
        "a number below torque_limit [N m, N], or nothing: -torque_limit",
        default=None, label="At least", unit="N m, N", help="least torque; empty: minus the most",
    )  # fmt: skip
    input_low: Number | None = field(
        "the least value of its input, or nothing", default=None, help="least value of its input"
    )
    input_high: Number | None = field(
        "the greatest value of its input, or nothing",
        default=None, help="greatest value of its input",
    )  # fmt: skip

    lag: Number = field(
        "a time >= 0 [s], or nothing: no lag",
        default=0.0, ge=0, unit="s", help="time constant with which the input acts",
    )  # fmt: skip
    integrates: Flag = field(
        "true or false: whether the integral of the input acts in its place",
        default=False, help="the integral of the input over time acts in its place",
    )  # fmt: skip
    start: Number | None = field(
        "what acts when a run begins, with a lag or integral; left out: the input, or 0",
        default=None, help="what acts first; empty: the input with a lag, 0 with an integral",
    )  # fmt: skip
    state_low: Number | None = field(
        "the least value of the integral, or nothing", default=None,
        help="least value of the integral of its input",
    )  # fmt: skip
    state_high: Number | None = field(
        "the greatest value of the integral, or nothing", default=None,
        help="greatest value of the integral of its input",
    )  # fmt: skip

    @model_validator(mode="after")
    def _possible(self) -> Self:
        found = []
        if self.has_state and not self.law.kp and isinstance(self.law.torque, Table):
            text = "must be a number where the input has a lag or integral; given a table"
            found.append(("torque", text))
        if self.lag and self.integrates:
            found.append(("lag", "must be 0 where the integral of the input acts"))
        if self.start is not None and not self.has_state:
            found.append(("start", "needs a lag, or `integrates`"))
        found += self._state_problems()
        if self.gear == 0:
            found.append(("gear", "must not be zero; given 0"))
        if self.coefficients and not any(any(x) for x in self.coefficients.values()):
            found.append(("coefficients", "at least one must differ from zero"))
        least, most = self.torques
        if least >= most:
            found.append(("torque_low", f"must be below torque_limit; given {shown(least)}"))
        low, high = self.inputs
        if low > high:
            text = f"must be at most input_high, {shown(high)}; given {shown(low)}"
            found.append(("input_low", text))
        elif text := self.input_problem(getattr(self, self.INPUT)):
            found.append((self.INPUT, text))
        refuse(found)
        return self

    def _state_problems(self) -> list[tuple[str, str]]:
        """What is wrong with the bounds of the integral."""
        low, high = self.states
        if not self.integrates:
            given = [
                name for name in ("state_low", "state_high") if getattr(self, name) is not None
            ]
            return [(name, "needs `integrates`: it bounds the integral") for name in given]
        if low > high:
            text = f"must be at most state_high, {shown(high)}; given {shown(low)}"
            return [("state_low", text)]
        if not low <= (start := self.start or 0.0) <= high:
            return [("start", f"must be from {low:g} to {high:g}; given {shown(start)}")]
        return []

    @property
    def has_state(self) -> bool:
        """Whether what acts follows its input over time."""
        return bool(self.lag) or self.integrates

    @property
    def states(self) -> tuple[float, float]:
        """Least and greatest value of the integral of the input."""
        low, high = self.state_low, self.state_high
        return (-math.inf if low is None else low), (math.inf if high is None else high)

    def input_problem(self, value: float | Table) -> str:
        """Why a value, or one of a table, is none of its inputs; "" where it is."""
        low, high = self.inputs
        values = value.value if isinstance(value, Table) else (value,)
        bad = next((x for x in values if not low <= x <= high), None)
        return "" if bad is None else f"must be from {low:g} to {high:g}; given {shown(bad)}"

    @property
    def inputs(self) -> tuple[float, float]:
        """Least and greatest value of the input."""
        low, high = self.input_low, self.input_high
        return (-math.inf if low is None else low), (math.inf if high is None else high)

    @property
    def torques(self) -> tuple[float, float]:
        """Least and greatest torque, before the gear [N m, N]."""
        most = math.inf if self.torque_limit is None else self.torque_limit
        return (-most if self.torque_low is None else self.torque_low), most

    @property
    def terms(self) -> tuple[tuple[str, int, float], ...]:
        """(body, degree of freedom, factor) of each coordinate that it acts on."""
        if not self.coefficients:
            return ((self.body, self.coordinate, self.gear),)
        return tuple((name, k, self.gear * x) for name, k, x in super().terms)

    @property
    @abstractmethod
    def law(self) -> Law:
        """Its torque at an input u: torque + gain u - kp length - kd rate."""


class Law(NamedTuple):
    """torque + gain u - kp length - kd rate, u the input."""

    gain: float
    torque: float | Table
    kp: float
    kd: float


class Motor(OnJoint):
    """`torque` on a coordinate of the joint of `body` (a force where it is a translation)."""

    ABOUT: ClassVar[str] = "a torque or force on a joint"

    kind: Literal["motor"] = field(KIND, default="motor")

    @classmethod
    def _foreign(cls, field: str, value: Any) -> str:
        if field in ("kp", "kd"):
            return "a motor has no kp and kd; use kind 'servo'"
        return super()._foreign(field, value)

    @classmethod
    def _empty(cls, field: str, value: Any) -> bool:
        return field == "target" or super()._empty(field, value)  # as it always was

    @property
    def law(self) -> Law:
        return Law(1.0, 0.0, 0.0, 0.0)


class Servo(OnJoint):
    """`torque` + kp (target - q) - kd v on a coordinate of the joint of `body`."""

    ABOUT: ClassVar[str] = "holds or drives a joint at a target: kp, kd"
    INPUT: ClassVar[str] = "target"

    kind: Literal["servo"] = field(KIND, default="servo")
    kp: Number = field(
        "a number >= 0 [N m/rad, N/m]",
        default=0.0, ge=0, label="kp", unit="N m/rad, N/m",
        help="torque per position off the target",
    )  # fmt: skip
    kd: Number = field(
        "a number >= 0 [N m s/rad, N s/m]",
        default=0.0, ge=0, label="kd", unit="N m s/rad, N s/m", help="torque per velocity",
    )  # fmt: skip
    target: Number | Table = field(
        "a number or a table over time [rad, m]",
        converter=_over_time, default=0.0, unit="rad, m",
        help="a number, or over time: t value; t value; ...",
    )  # fmt: skip

    @property
    def law(self) -> Law:
        return Law(self.kp, self.torque, self.kp, self.kd)


class SpeedServo(OnJoint):
    """`torque` + kd (speed - v) on a coordinate of the joint of `body`."""

    ABOUT: ClassVar[str] = "drives a joint at a speed: kd"
    INPUT: ClassVar[str] = "speed"

    kind: Literal["speed_servo"] = field(KIND, default="speed_servo")
    kd: Number = field(
        "a number >= 0 [N m s/rad, N s/m]",
        default=0.0, ge=0, label="kd", unit="N m s/rad, N s/m",
        help="torque per velocity off the speed",
    )  # fmt: skip
    speed: Number | Table = field(
        "a number or a table over time [rad/s, m/s]",
        converter=_over_time, default=0.0, unit="rad/s, m/s",
        help="a number, or over time: t value; t value; ...",
    )  # fmt: skip

    @property
    def law(self) -> Law:
        return Law(self.kd, self.torque, 0.0, self.kd)


class Actuator(OnJoint):
    """`torque` + gain x input - kp q - kd v on a coordinate of the joint of `body`.

    The general linear drive; gains may have any sign. Motors and servos are cases of it.
    """

    ABOUT: ClassVar[str] = "torque + gain × input - kp q - kd v on a joint"
    INPUT: ClassVar[str] = "input"

    kind: Literal["actuator"] = field(KIND, default="actuator")
    input: Number | Table = field(
        "a number or a table over time",
        converter=_over_time, default=0.0, help="a number, or over time: t value; t value; ...",
    )  # fmt: skip
    gain: Number = field("a finite number [N m, N per input]", default=1.0, help="torque per input")
    kp: Number = field(
        "a finite number [N m/rad, N/m]",
        default=0.0, label="kp", unit="N m/rad, N/m", help="torque against position",
    )  # fmt: skip
    kd: Number = field(
        "a finite number [N m s/rad, N s/m]",
        default=0.0, label="kd", unit="N m s/rad, N s/m", help="torque against velocity",
    )  # fmt: skip

    @property
    def law(self) -> Law:
        return Law(self.gain, self.torque, self.kp, self.kd)


class Tendon(OnSum, Force):
    """A tendon along joints: its length is the sum of `coefficients` x q.

    Spring, damper and friction pull it to the length `rest`; it gets no shorter than `low` and no
    longer than `high`. Passive, as springs and dampers of joints.
    """

    ABOUT: ClassVar[str] = "spring, damper, friction and limits of a sum of joint coordinates"
    PASSIVE: ClassVar[bool] = True

    kind: Literal["tendon"] = field(KIND, default="tendon")
    stiffness: Number = field("a number >= 0 [N/m, N m/rad]", default=0.0, ge=0, unit="N/m")
    damping: Number = field("a number >= 0 [N s/m, N m s/rad]", default=0.0, ge=0, unit="N s/m")
    friction: Number = field("a number >= 0 [N, N m]", default=0.0, ge=0, unit="N")
    rest: Number | None = field(
        "a length without force [m, rad]; left out: as in the initial state",
        default=None, unit="rad, m", help="without force; empty: as in the initial state",
    )  # fmt: skip
    low: Number | None = field(
        "the least length [m, rad], or nothing", default=None, unit="rad, m", help="least length"
    )
    high: Number | None = field(
        "the greatest length [m, rad], or nothing",
        default=None, unit="rad, m", help="greatest length",
    )  # fmt: skip

    @model_validator(mode="after")
    def _possible(self) -> Self:
        _refuse_crossed_ends(self)
        return self


class OnBody(Force):
    """Acts on `body` itself."""


class Between(WithOther, OnBody):
    """Acts between `body` and `other`."""

    PASSIVE: ClassVar[bool] = True


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


class Spring(AtPoint, Between):
    """stiffness (length - rest) + damping x its rate pull two points; `low` <= length <= `high`."""

    ABOUT: ClassVar[str] = "pulls two points together, with damper and limits of its length"

    kind: Literal["spring"] = field(KIND, default="spring")
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
    low: Number | None = field(
        "the least length > 0 [m], or nothing",
        default=None, gt=0, unit="length", help="least length; empty: none",
    )  # fmt: skip
    high: Number | None = field(
        "the greatest length > 0 [m], or nothing",
        default=None, gt=0, unit="length", help="greatest length, as of a string; empty: none",
    )  # fmt: skip

    @model_validator(mode="after")
    def _possible(self) -> Self:
        _refuse_crossed_ends(self)
        return self


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


class Drag(OnBody):
    """The drag of a fluid at rest on a box fixed in `body`, viscous and by its pressure.

    Along an edge a: -3 pi d viscosity u - density b c |u| u / 2; about it: -pi d^3 viscosity w -
    density a (b^4 + c^4) |w| w / 64; d the mean edge, u and w the velocity of the middle and the
    spin. That is MuJoCo's fluid model by inertia boxes. Passive.
    """

    ABOUT: ClassVar[str] = "a fluid's drag on a box around the body"
    PASSIVE: ClassVar[bool] = True

    kind: Literal["drag"] = field(KIND, default="drag")
    size: Vec3 = field(
        "three edges > 0 of the box [m]", converter=vector, unit="length", help="edges of the box"
    )
    density: Number = field("a number >= 0 [kg/m^3]", default=0.0, ge=0, unit="kg/m³")
    viscosity: Number = field("a number >= 0 [Pa s]", default=0.0, ge=0, unit="Pa s")
    point: Vec3 | None = field(
        "three finite numbers in the axes of `body` [m]; left out: its centre of mass",
        converter=maybe_vector, default=None, unit="length",
        help="middle of the box; empty: the centre of mass",
    )  # fmt: skip
    rotation: Quat = field(
        "a quaternion [w, x, y, z] that is not zero, of the box in the axes of `body`",
        converter=quaternion, default=(1.0, 0.0, 0.0, 0.0),
    )  # fmt: skip

    @model_validator(mode="after")
    def _box(self) -> Self:
        found = []
        if min(self.size) <= 0:
            found.append(("size", f"each edge must be > 0 [m]; given {shown(self.size)}"))
        if not any(self.rotation):
            found.append(("rotation", "a quaternion must not be zero"))
        refuse(found)
        return self
