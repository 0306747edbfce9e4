"""Constraints between coordinates of joints."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from typing import Any, ClassVar, Literal, Self

from pydantic import model_validator

from .. import joints
from ..curves import OverTime, Polynomial
from ..errors import shown
from ..fields import (
    GROUND,
    Number,
    OnSum,
    Text,
    Whole,
    field,
    listed,
    refuse,
)
from ..functions import Function, corners_of, problems_of
from ..signals import Node
from ..units import NONE, Q, S
from .constraint import KIND, Constraint
from .poses import half_reach

over_time: Callable[[OverTime | str | Mapping[str, Any]], OverTime] = listed
function: Callable[[Function | str | Mapping[str, Any]], Function] = listed


class InJoints(Constraint):
    """A constraint on joint coordinates, not on positions between bodies."""

    # () -> the body and degree of freedom along which its wrench is given
    _first: ClassVar[Callable[..., tuple[str, int]]]

    def pulls(self, bodies: Mapping[str, Any]) -> bool:
        name, k = self._first()
        body = bodies.get(name)
        units = [joints.units_of(m)[1] for m in body.sequence] if body is not None else []
        along = [(unit, len(own)) for own in units for unit in own]
        return along[k] == ("m", 1) if k < len(along) else True

    def onto(self, bodies: Any) -> None:
        """Apply nothing: its force acts in the joints."""


def first_q(model: Any, name: str) -> float:
    """Return the first initial coordinate of a joint, or 0 if there is none."""
    return next(iter(model.body(name).q), 0.0) if name != GROUND else 0.0


class OfOne(InJoints):
    """A constraint on one coordinate of the joint of `body`."""

    coordinate: Whole = field(
        "the index of a degree of freedom of the joint of `body`, starting at 0",
        default=0, ge=0, le=5, help="index of the joint degree of freedom, starting at 0",
    )  # fmt: skip

    def _first(self) -> tuple[str, int]:
        return self.body, self.coordinate


class OfTwo(OfOne):
    """A constraint by which the coordinate of one joint follows that of another joint."""

    FOLLOWS: ClassVar[str] = ""  # the field that needs a second body

    other: Text = field("the name of a body", default=GROUND, label="Other")
    other_coordinate: Whole = field(
        "the index of a degree of freedom of the joint of `other`, starting at 0",
        default=0, ge=0, le=5, label="Other's",
        help="index of the degree of freedom of the second joint",
    )  # fmt: skip

    @model_validator(mode="after")
    def _two_joints(self) -> Self:
        if self.other == GROUND:
            text = f"a {self.kind} needs a second body, whose joint it follows, got 'ground'"
            refuse([("other", text)])
        return self

    @property
    def _fits_one_body(self) -> bool:
        return self.coordinate != self.other_coordinate


class Gear(OfTwo):
    """A gear with q of the joint of `body` = ratio x q of the joint of `other` + offset."""

    ROWS: ClassVar[int] = 1
    ABOUT: ClassVar[str] = "one joint follows another: q = ratio × q + offset"

    kind: Literal["gear"] = field(KIND, default="gear")
    ratio: Number = field(
        "a finite number: q of `body` is ratio x q of `other` + offset; a ratio that varies is the "
        "slope of a pg.Relation, such as curve='=2*q + 0.1*q^2'",
        default=1.0, dim=NONE, help="q of the body = ratio × q of the other + offset",
    )  # fmt: skip
    offset: Number = field("a finite number [rad, m]", default=0.0, dim=Q)

    @classmethod
    def begun(cls, model: Any, body: str, other: str) -> dict[str, Any]:
        first, second = (first_q(model, name) for name in (body, other))
        return {"offset": first - second}

    @model_validator(mode="after")
    def _turns(self) -> Self:
        if self.ratio == 0:
            text = "must not be zero; use kind 'motion' to hold a joint, got 0"
            refuse([("ratio", text)])
        return self

    def _blocks(self, e: Any) -> list[Any]:
        own = e.coordinate(self.body, self.coordinate)
        other = e.coordinate(self.other, self.other_coordinate, -self.ratio)
        return [e.sum_of_q((own, other), self.offset)]


class Relation(OfTwo):
    """A relation with q of the joint of `body` = f(q of the joint of `other`), f a smooth curve.

    The curve is given by points (`Curve`), by a polynomial, or by an expression of the other
    coordinate, which is called q or, with its body, q.NAME.

    Examples
    --------
    >>> import pgraph_core as pg
    >>> lift = pg.Relation(name="lift", body="follower", other="cam", curve="=0.02*(1-cos(q.cam))")
    """

    SINCE: ClassVar[int] = 9
    ROWS: ClassVar[int] = 1
    ABOUT: ClassVar[str] = "one joint follows a curve over another: q = f(q)"

    kind: Literal["relation"] = field(KIND, default="relation")
    curve: Function = field(
        "an expression of the other coordinate such as '=0.02*(1-cos(q))', points such as {'x': "
        "[...], 'value': [...], 'kind': 'natural', 'clamped', 'periodic', 'quintic' or 'hermite'} "
        "(with 'slope'), or {'kind': 'polynomial', 'coefficients': [...]} [rad, m]",
        converter=function, dim=Q, over=Q, label="Follows",
        help="joint coordinate as a function of the other one",
    )  # fmt: skip

    @classmethod
    def begun(cls, model: Any, body: str, other: str) -> dict[str, Any]:
        value, x = (first_q(model, name) for name in (body, other))
        rise, way = (half_reach(model, name) for name in (body, other))
        return {"curve": {"x": (x, x + way), "value": (value, value + rise)}}

    @model_validator(mode="after")
    def _smooth(self) -> Self:
        refuse([("curve", text) for text in problems_of(self.curve)])
        return self

    @property
    def has_corners(self) -> bool:
        """True if the second derivative of the curve jumps somewhere."""
        return bool(corners_of(self.curve, Node("signal")))

    def _blocks(self, e: Any) -> list[Any]:
        own = e.coordinate(self.body, self.coordinate)
        other = e.coordinate(self.other, self.other_coordinate, 0.0)
        return [e.related(own, other, self.curve)]


class Motion(OfOne):
    """A prescribed motion: the joint of `body` follows a function of time with any force."""

    ROWS: ClassVar[int] = 1
    ABOUT: ClassVar[str] = "a joint follows a function of time with the force that this needs"

    kind: Literal["motion"] = field(KIND, default="motion")
    q_of_t: OverTime = field(
        "an expression of t such as '=0.5*sin(2*t)', a table over time {'t': [...], 'value': "
        "[...]}, or {'kind': 'sine' or 'polynomial', ...} [rad, m]",
        converter=over_time, dim=Q, label="Follows", help="joint coordinate as a function of time",
    )  # fmt: skip
    interpolation: Literal["spline", "monotone"] = field(
        "'spline' (smooth, may overshoot) or 'monotone' (stays between neighbouring values)",
        default="spline", since=7,
        label="Interpolation", help="interpolation method of a table",
    )  # fmt: skip

    @classmethod
    def begun(cls, model: Any, body: str, other: str) -> dict[str, Any]:
        start = first_q(model, body)
        return {"q_of_t": {"kind": "polynomial", "coefficients": (start, 0.0)}}

    @model_validator(mode="after")
    def _cubic(self) -> Self:
        if isinstance(self.q_of_t, Polynomial) and len(c := self.q_of_t.coefficients) > 4:
            text = f"a polynomial over time has one to four coefficients, got {shown(list(c))}"
            refuse([("q_of_t", text)])
        return self

    def _blocks(self, e: Any) -> list[Any]:
        own = e.coordinate(self.body, self.coordinate)
        return [e.following(own, self.q_of_t, self.interpolation)]


class Sum(OnSum, InJoints):
    """A constraint on the sum of `coefficients` x joint coordinates."""

    def _first(self) -> tuple[str, int]:
        name, k, _ = self.terms[0]
        return name, k


class Velocity(Sum):
    """A constant weighted sum of joint velocities: the sum of coefficients x v is `value`."""

    ROWS: ClassVar[int] = 1
    ABOUT: ClassVar[str] = "a sum of joint velocities has a value (nonholonomic)"

    kind: Literal["velocity"] = field(KIND, default="velocity")
    value: Number = field(
        "a finite number [rad/s, m/s]",
        default=0.0, dim=Q / S, help="prescribed value of the sum of coefficients × v",
    )  # fmt: skip

    def _blocks(self, e: Any) -> list[Any]:
        return [e.sum_of_v(e.terms(), self.value)]


class Coupling(Sum):
    """A constant weighted sum of joint positions: the sum of coefficients x q is `value`."""

    SINCE: ClassVar[int] = 3
    ROWS: ClassVar[int] = 1
    ABOUT: ClassVar[str] = "a sum of joint positions has a value, as a tendon without stretch"

    kind: Literal["coupling"] = field(KIND, default="coupling")
    value: Number = field(
        "a finite number [rad, m]",
        default=0.0, dim=Q, help="prescribed value of the sum of coefficients × q",
    )  # fmt: skip

    @classmethod
    def begun(cls, model: Any, body: str, other: str) -> dict[str, Any]:
        return {**super().begun(model, body, other), "value": first_q(model, body)}

    def _blocks(self, e: Any) -> list[Any]:
        return [e.sum_of_q(e.terms(), self.value)]
