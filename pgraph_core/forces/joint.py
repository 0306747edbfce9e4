"""Motors, servos and actuators that drive a joint coordinate or a sum of coordinates."""

from __future__ import annotations

import math
from abc import abstractmethod
from typing import Any, ClassVar, Literal, NamedTuple, Self

from pydantic import model_validator

from ..curves import Table
from ..errors import shown
from ..fields import EMPTY, ByName, Expression, Flag, Number, OfSums, Whole, by_name, field, refuse
from ..units import NONE, Dim, J, Q, S
from .base import KIND, Driven, over_time


class OnJoint(Driven, OfSums):
    """A drive acting on a coordinate of the joint of `body`, or on a sum of joint coordinates.

    Its length is gear x q, or gear x the sum of coefficients x q. Its force acts on each
    coordinate, multiplied by that factor. One field is its input, which runs and steppers can give.
    """

    INPUT: ClassVar[str] = "torque"  # the field that is the input
    FIRST: ClassVar[tuple[str, ...]] = ("coordinate", INPUT)
    VARIES: ClassVar[tuple[str, ...]] = ("torque",)

    coordinate: Whole = field(
        "the index of a degree of freedom of the joint, starting at 0",
        default=0, ge=0, le=5, help="index of the joint degree of freedom, starting at 0",
    )  # fmt: skip
    coefficients: ByName = field(
        "body name -> numbers, one per degree of freedom of its joint; empty: `coordinate` alone",
        converter=by_name, default=EMPTY, label="Coefficient", dim=NONE, since=3,
        help="coefficients of a weighted sum of coordinates, one per degree of freedom",
    )  # fmt: skip
    gear: Number = field(
        "a nonzero number",
        default=1.0, dim=NONE, since=3, help="gear ratio",
    )  # fmt: skip
    torque: Number | Table | Expression = field(
        "a number, a table over time, or an expression [N m, N]",
        converter=over_time, default=0.0, dim=J / Q,
        help="a number, a table t value; t value; ..., or =2*sin(3*t) - q.arm",
    )  # fmt: skip
    torque_limit: Number | None = field(
        "a number > 0 [N m, N], or None",
        default=None, gt=0, label="At most", dim=J / Q, help="maximum magnitude; default: none",
    )  # fmt: skip
    torque_low: Number | None = field(
        "a number below torque_limit [N m, N], or None: -torque_limit",
        default=None, label="At least", dim=J / Q, since=3,
        help="lower limit; default: minus the upper limit",
    )  # fmt: skip
    input_low: Number | None = field(
        "a number, the lower bound of its input, or None",
        default=None, dim=NONE, since=3, help="lower bound of the input",
    )  # fmt: skip
    input_high: Number | None = field(
        "a number, the upper bound of its input, or None",
        default=None, dim=NONE, since=3, help="upper bound of the input",
    )  # fmt: skip

    lag: Number = field(
        "a time >= 0 [s], or None: no lag",
        default=0.0, ge=0, dim=S, since=3, help="time constant of a first-order lag of the input",
    )  # fmt: skip
    integrates: Flag = field(
        "true or false: whether the integral of the input acts in its place",
        default=False, since=3, help="use the time integral of the input",
    )  # fmt: skip
    start: Number | None = field(
        "a number, the initial value with a lag or integral; default: the input, or 0",
        default=None, dim=NONE, since=3,
        help="initial value; default: the input with a lag, 0 with an integral",
    )  # fmt: skip
    state_low: Number | None = field(
        "a number, the lower bound of the integral, or None", default=None, dim=NONE,
        help="lower bound of the integral",
    )  # fmt: skip
    state_high: Number | None = field(
        "a number, the upper bound of the integral, or None", default=None, dim=NONE,
        help="upper bound of the integral",
    )  # fmt: skip

    @model_validator(mode="after")
    def _possible(self) -> Self:
        found = []
        if self.has_state:
            found += self._no_state_of()
        if self.lag and self.integrates:
            found.append(("lag", "must be 0 if the integral of the input is used"))
        if self.start is not None and not self.has_state:
            found.append(("start", "needs a lag, or `integrates`"))
        found += self._state_problems()
        if self.gear == 0:
            found.append(("gear", "must not be zero, got 0"))
        if self.coefficients and not any(any(x) for x in self.coefficients.values()):
            found.append(("coefficients", "at least one must differ from zero"))
        least, most = self.torques
        if least >= most:
            found.append(("torque_low", f"must be below torque_limit, got {shown(least)}"))
        refuse(found + self._input_problems())
        return self

    def _no_state_of(self) -> list[tuple[str, str]]:
        """Return problems with varying fields beside a lag or integral, integrated exactly."""
        given = getattr(self, self.INPUT)
        found: dict[str, Any] = {self.INPUT: given} if isinstance(given, str) else {}
        if not self.law.kp and not isinstance(self.law.torque, float):
            found["torque"] = self.law.torque
        text = "must be a number if the input has a lag or integral, got "
        return [(x, text + (y if isinstance(y, str) else "a table")) for x, y in found.items()]

    def _state_problems(self) -> list[tuple[str, str]]:
        """Return the problems with the bounds on the integral."""
        low, high = self.states
        if not self.integrates:
            given = [
                name for name in ("state_low", "state_high") if getattr(self, name) is not None
            ]
            return [(name, "needs `integrates`: it bounds the integral") for name in given]
        if low > high:
            text = f"must be at most state_high, {shown(high)}, got {shown(low)}"
            return [("state_low", text)]
        if not low <= (start := self.start or 0.0) <= high:
            return [("start", f"must be from {low:g} to {high:g}, got {shown(start)}")]
        return []

    def _dim_of(self, name: str) -> Dim:
        """Return the dimension of a field. The bounds on the input and on its integral follow."""
        acts = super()._dim_of(self.INPUT)
        if name in ("start", "state_low", "state_high"):
            return acts
        if name in (self.INPUT, "input_low", "input_high"):
            return acts / S if self.integrates else acts
        return super()._dim_of(name)

    @property
    def has_state(self) -> bool:
        """Return True if the force has a lag or integrates its input over time."""
        return bool(self.lag) or self.integrates

    @property
    def states(self) -> tuple[float, float]:
        """The minimum and maximum of the input's integral."""
        low, high = self.state_low, self.state_high
        return (-math.inf if low is None else low), (math.inf if high is None else high)

    @property
    def torques(self) -> tuple[float, float]:
        """The minimum and maximum torque, before the gear [N m, N]."""
        most = math.inf if self.torque_limit is None else self.torque_limit
        return (-most if self.torque_low is None else self.torque_low), most

    @property
    def _bends(self) -> bool:
        return any(map(math.isfinite, self.torques))

    @property
    def terms(self) -> tuple[tuple[str, int, float], ...]:
        """The (body, degree of freedom, factor) of each coordinate that is driven."""
        if not self.coefficients:
            return ((self.body, self.coordinate, self.gear),)
        return tuple((name, k, self.gear * x) for name, k, x in super().terms)

    @property
    def aims(self) -> bool:
        """Return True if the input moves the target of a spring, else it is a part of the torque.

        An input u other than the target is equivalent to a target of u / kp, which has no limit for
        kp = 0. It is therefore added to the torque, unless the table is required for a lag or a
        table of torque.
        """
        own = self.has_state or not isinstance(self.law.torque, float)
        return self.law.kp != 0.0 and (own or self.INPUT == "target")

    @property
    @abstractmethod
    def law(self) -> Law:
        """The torque at an input u: torque + gain u - kp length - kd rate."""


class Law(NamedTuple):
    """The drive law torque + gain u - kp length - kd rate, with input u."""

    gain: float
    torque: float | Table | str
    kp: float
    kd: float


class Motor(OnJoint):
    """A motor that applies `torque` to a joint coordinate of `body` (a force for translations)."""

    ABOUT: ClassVar[str] = "a torque or force on a joint, also by state feedback (LQR)"

    kind: Literal["motor"] = field(KIND, default="motor")

    @classmethod
    def _foreign(cls, field: str, value: Any) -> str:
        if field in ("kp", "kd"):
            return "a motor has no kp and kd; use kind 'servo'"
        if field == "speed":
            to = f"{value!r}*t" if isinstance(value, (int, float)) else "..."
            servo = f"pg.SpeedServo(..., speed={shown(value)}, kd=10.0) with a kd > 0"
            motion = f"for exactly this speed the constraint pg.Motion(..., q_of_t='={to}')"
            return f"a motor has a torque; use kind 'speed_servo': {servo}, or {motion}"
        return super()._foreign(field, value)

    @classmethod
    def _empty(cls, field: str, value: Any) -> bool:
        return field == "target" or super()._empty(field, value)  # unchanged since version 1

    @property
    def _bends(self) -> bool:
        return super()._bends and (self.has_state or self._varies)  # else at knots of its table

    @property
    def law(self) -> Law:
        return Law(1.0, 0.0, 0.0, 0.0)


class Servo(OnJoint):
    """A servo that applies `torque` + kp (target - q) - kd v to a joint coordinate of `body`."""

    ABOUT: ClassVar[str] = "holds or drives a joint at a target: kp, kd"
    INPUT: ClassVar[str] = "target"
    FIRST: ClassVar[tuple[str, ...]] = ("coordinate", "kp", "kd", INPUT)
    VARIES: ClassVar[tuple[str, ...]] = ("torque", INPUT)

    @classmethod
    def begun(cls, model: Any, body: str, other: str) -> dict[str, Any]:
        return {"target": next(iter(model.body(body).q), 0.0)}

    kind: Literal["servo"] = field(KIND, default="servo")
    kp: Number = field(
        "a number >= 0 [N m/rad, N/m]",
        default=0.0, ge=0, label="kp", dim=J / Q**2,
        help="position gain",
    )  # fmt: skip
    kd: Number = field(
        "a number >= 0 [N m s/rad, N s/m]",
        default=0.0, ge=0, label="kd", dim=J * S / Q**2, help="damping gain",
    )  # fmt: skip
    target: Number | Table | Expression = field(
        "a number, a table over time, or an expression [rad, m]",
        converter=over_time, default=0.0, dim=Q,
        help="a number, a table t value; t value; ..., or =2*sin(3*t) - q.arm",
    )  # fmt: skip

    @property
    def law(self) -> Law:
        return Law(self.kp, self.torque, self.kp, self.kd)

    @property
    def _idle(self) -> str:
        return "" if self.kp or self.kd or self.torque else "its kp and kd are 0"


class SpeedServo(OnJoint):
    """A servo that applies `torque` + kd (speed - v) to a joint coordinate of `body`."""

    ABOUT: ClassVar[str] = "drives a joint at a speed: kd"
    INPUT: ClassVar[str] = "speed"
    FIRST: ClassVar[tuple[str, ...]] = ("coordinate", "kd", INPUT)
    VARIES: ClassVar[tuple[str, ...]] = ("torque", INPUT)
    SINCE: ClassVar[int] = 3
    NEW: ClassVar[dict[str, Any]] = {"kd": 1.0}

    kind: Literal["speed_servo"] = field(KIND, default="speed_servo")
    kd: Number = field(
        "a number >= 0 [N m s/rad, N s/m]",
        default=0.0, ge=0, label="kd", dim=J * S / Q**2,
        help="velocity gain",
    )  # fmt: skip
    speed: Number | Table | Expression = field(
        "a number, a table over time, or an expression [rad/s, m/s]",
        converter=over_time, default=0.0, dim=Q / S,
        help="a number, a table t value; t value; ..., or =2*sin(3*t) - q.arm",
    )  # fmt: skip

    @property
    def law(self) -> Law:
        return Law(self.kd, self.torque, 0.0, self.kd)

    @property
    def _idle(self) -> str:
        return "" if self.kd or self.torque else "its kd is 0"


class Actuator(OnJoint):
    """An actuator with `torque` + gain x input - kp q - kd v on a joint coordinate of `body`.

    This is a general linear drive whose gains can have any sign. Motors and servos are special
    cases.
    """

    ABOUT: ClassVar[str] = "torque + gain × input - kp q - kd v on a joint"
    INPUT: ClassVar[str] = "input"
    FIRST: ClassVar[tuple[str, ...]] = ("coordinate", INPUT, "gain", "kp", "kd")
    VARIES: ClassVar[tuple[str, ...]] = ("torque", INPUT)
    SINCE: ClassVar[int] = 3
    ANY_UNIT: ClassVar[tuple[str, ...]] = ("input",)

    kind: Literal["actuator"] = field(KIND, default="actuator")
    input: Number | Table | Expression = field(
        "a number, a table over time, or an expression",
        converter=over_time, default=0.0, dim=NONE,
        help="a number, a table t value; t value; ..., or =2*sin(3*t) - q.arm",
    )  # fmt: skip
    gain: Number = field(
        "a finite number [N m, N per input]", default=1.0, dim=J / Q, help="gain of the input"
    )
    kp: Number = field(
        "a finite number [N m/rad, N/m]",
        default=0.0, label="kp", dim=J / Q**2, help="position gain",
    )  # fmt: skip
    kd: Number = field(
        "a finite number [N m s/rad, N s/m]",
        default=0.0, label="kd", dim=J * S / Q**2, help="velocity gain",
    )  # fmt: skip

    @property
    def law(self) -> Law:
        return Law(self.gain, self.torque, self.kp, self.kd)
