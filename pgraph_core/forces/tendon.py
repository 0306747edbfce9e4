"""A tendon along joints: spring, damper, friction and limits on a sum of joint coordinates."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from typing import Any, ClassVar, Literal, Self

from pydantic import model_validator

from ..fields import Number, OnSum, field
from ..units import J, Q, S
from .base import KIND, Force, limits, refuse_crossed_ends, stops_of


class Tendon(OnSum, Force):
    """A tendon whose length is the weighted sum of joint coordinates, `coefficients` x q.

    It can have a spring with the rest length `rest`, a damper and friction. The length is limited
    to the range from `low` to `high`. Tendons are passive, like the springs and dampers of joints.
    """

    ABOUT: ClassVar[str] = "spring, damper, friction and limits of a sum of joint coordinates"
    PASSIVE: ClassVar[bool] = True
    SINCE: ClassVar[int] = 3

    kind: Literal["tendon"] = field(KIND, default="tendon")
    stiffness: Number = field("a number >= 0 [N/m, N m/rad]", default=0.0, ge=0, dim=J / Q**2)
    damping: Number = field("a number >= 0 [N s/m, N m s/rad]", default=0.0, ge=0, dim=J * S / Q**2)
    friction: Number = field("a number >= 0 [N, N m]", default=0.0, ge=0, dim=J / Q)
    rest: Number | None = field(
        "a length without force [m, rad]; default: as in the initial state",
        default=None, dim=Q, help="rest length; default: as in the initial state",
    )  # fmt: skip
    low: Number | None = field(
        "a number, the smallest length [m, rad], or None",
        default=None, dim=Q, help="minimum length",
    )  # fmt: skip
    high: Number | None = field(
        "a number, the largest length [m, rad], or None",
        default=None, dim=Q, help="maximum length",
    )  # fmt: skip

    @model_validator(mode="after")
    def _possible(self) -> Self:
        refuse_crossed_ends(self)
        return self

    @property
    def _bounds(self) -> bool:
        return limits(self)

    def _stops(self, body_of: Callable[[str], Any]) -> Iterator[tuple[float, dict[str, Any]]]:
        return stops_of(self, "value", kind="coupling", coefficients=self.coefficients)
