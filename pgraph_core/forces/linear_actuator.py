"""An actuator along a path: a cylinder, a spindle, or a motor that pulls a tendon."""

from __future__ import annotations

import math
from collections.abc import Iterator
from typing import Any, ClassVar, Literal, Self

import numpy as np
from pydantic import model_validator

from ..curves import Table
from ..errors import shown
from ..fields import Expression, Number, field, refuse
from ..signals.grammar import filled
from ..units import NONE, M, N, S
from .base import KIND, Array, DrivenByKnots, InKnots, Places, held, over_time, tree_of
from .path import BetweenPoints, pack_points
from .strut import PULL, STOP

GIVEN = 0  # column of the knot after it, of which no kernel reads this one, that has the input


class LinearActuator(BetweenPoints, DrivenByKnots):
    """An actuator that pushes the ends of a path apart by `bias` + gain x input - kp l - kd l'.

    l is the length of the path [m]. A negative force pulls. With kp = gain, the input is the length
    at which it holds; with kd = gain, it is a rate. The force is limited to the range from
    `force_low` to `force_high`, if it does not depend on the length and its rate.

    Examples
    --------
    >>> import pgraph_core as pg
    >>> pg.LinearActuator(name="cylinder", body="boom", other="base", input=2e4).gain
    1.0
    """

    ABOUT: ClassVar[str] = "a cylinder, spindle or driven tendon: a force along a path"
    PASSIVE: ClassVar[bool] = False
    SCALES: ClassVar[tuple[str, ...]] = ("bias", "gain", "kp", "kd")
    VARIES: ClassVar[tuple[str, ...]] = ("input",)
    VARIES_SINCE: ClassVar[int] = 9
    SINCE: ClassVar[int] = 9
    INPUT: ClassVar[str] = "input"
    ANY_UNIT: ClassVar[tuple[str, ...]] = ("input",)

    kind: Literal["linear_actuator"] = field(KIND, default="linear_actuator")
    input: Number | Table | Expression = field(
        "a number, a table over time, or an expression",
        converter=over_time, default=0.0, dim=NONE,
        help="a number, a table t value; t value; ..., or =2*sin(3*t) - q.arm",
    )  # fmt: skip
    gain: Number = field(
        "a finite number [N per input]", default=1.0, dim=N, help="gain of the input"
    )
    bias: Number = field(
        "a finite number [N]", default=0.0, dim=N, help="force at input 0; a push if positive"
    )
    kp: Number = field(
        "a finite number [N/m]", default=0.0, label="kp", dim=N / M,
        help="position gain, on the length of the path",
    )  # fmt: skip
    kd: Number = field(
        "a finite number [N s/m]", default=0.0, label="kd", dim=N * S / M,
        help="velocity gain, on the rate of the length",
    )  # fmt: skip
    force_low: Number | None = field(
        "a number, the least force [N], or None",
        default=None, label="At least", dim=N, help="least force; 0 if it cannot pull",
    )  # fmt: skip
    force_high: Number | None = field(
        "a number, the greatest force [N], or None",
        default=None, label="At most", dim=N, help="greatest force; 0 if it cannot push",
    )  # fmt: skip
    input_low: Number | None = field(
        "a number, the lower bound of its input, or None",
        default=None, dim=NONE, help="lower bound of the input",
    )  # fmt: skip
    input_high: Number | None = field(
        "a number, the upper bound of its input, or None",
        default=None, dim=NONE, help="upper bound of the input",
    )  # fmt: skip

    @model_validator(mode="after")
    def _possible(self) -> Self:
        found = self._input_problems()
        least, most = self.forces
        if least >= most:
            text = f"must be below force_high, {shown(most)}, got {shown(least)}"
            found.append(("force_low", text))
        limited = [x for x in ("force_low", "force_high") if getattr(self, x) is not None]
        if limited and (self.kp or self.kd):
            text = "limits a force without kp and kd; give those to a pg.Strut along the same path"
            found.append((limited[0], f"{text}, got kp {self.kp:g} and kd {self.kd:g}"))
        refuse(found)
        return self

    @property
    def _varies(self) -> bool:
        return not isinstance(self.input, float)

    @property
    def forces(self) -> tuple[float, float]:
        """The minimum and maximum force [N]."""
        low, high = self.force_low, self.force_high
        return (-math.inf if low is None else low), (math.inf if high is None else high)

    def _varying(self, at: Places) -> Iterator[InKnots]:
        """Yield the pull of the input, without the parts of length and rate."""
        bias, gain = tree_of(self.bias), tree_of(self.gain)
        push = held(filled("bias + gain*u", bias=bias, gain=gain, u=self.given), *self.forces)
        yield InKnots(PULL, filled("-push", push=push), everywhere=False)

    def force_at(self, u: float) -> float:
        """Return the force at an input, without the parts of length and rate [N]."""
        least, most = self.forces
        return min(max(self.bias + self.gain * u, least), most)

    def put_input(self, knots: Array, u: float) -> None:
        """Write an input and its pull into the knots."""
        knots[0, PULL], knots[1, GIVEN] = -self.force_at(u), u

    def input_in(self, knots: Array) -> float:
        """Return the input in the knots."""
        return float(knots[1, GIVEN])

    def slope_of_input(self, u: float) -> float:
        """Return the rate of change of the pull with the input, 0 at its bounds."""
        least, most = self.forces
        return -self.gain if least < self.bias + self.gain * u < most else 0.0


def pack(f: LinearActuator, one: Any, at: Places) -> Array:
    """Write the points, and return the knots of a strut with the pull of the input."""
    pack_points(f, one, at)
    one["drives"] = 1
    one["spring"], one["damper"] = (0.0, 0.0, f.kp), (0.0, 0.0, f.kd)
    knots = np.array([[0.0, 0.0, 0.0, 0.0], *[[0.0, 0.0, 0.0, np.inf]] * STOP])
    if isinstance(f.input, float):
        f.put_input(knots, f.input)
    return knots
