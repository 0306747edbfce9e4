"""A linear spring and damper along a path, with limits on its length."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from typing import Any, ClassVar, Literal, Self

from pydantic import model_validator

from ..engine.compiler.jit import part
from ..engine.records import REAL
from ..fields import Expression, NotNegative, Number, field, refuse
from ..units import M, N, S
from .base import (
    KIND,
    Array,
    Load,
    Places,
    Sprung,
    limits,
    number_or_law,
    pack_rates,
    rates_of,
    refuse_crossed_ends,
    row,
    stops_of,
)
from .path import BetweenPoints, on_path, pack_points, points_of


class Spring(BetweenPoints, Sprung):
    """A spring and damper along a path, whose length `low` and `high` limit if it is straight."""

    ABOUT: ClassVar[str] = "a spring between two or more points, with damper and length limits"
    NEW: ClassVar[dict[str, Any]] = {"stiffness": 100.0}

    kind: Literal["spring"] = field(KIND, default="spring")
    stiffness: NotNegative | Expression = field(
        "a number >= 0 [N/m], or an expression", converter=number_or_law, default=0.0, dim=N / M
    )
    damping: NotNegative | Expression = field(
        "a number >= 0 [N s/m], or an expression", converter=number_or_law, default=0.0,
        dim=N * S / M,
    )  # fmt: skip
    rest: Number | None = field(
        "a length >= 0 without force [m]; default: as in the initial state",
        default=None, ge=0, dim=M, help="rest length; default: as in the initial state",
    )  # fmt: skip
    low: Number | None = field(
        "the smallest length > 0 [m], or None",
        default=None, gt=0, dim=M, since=3, help="minimum length; default: unlimited",
    )  # fmt: skip
    high: Number | None = field(
        "the largest length > 0 [m], or None",
        default=None, gt=0, dim=M, since=3,
        help="maximum length, for example of a string; default: unlimited",
    )  # fmt: skip

    @model_validator(mode="after")
    def _possible(self) -> Self:
        refuse_crossed_ends(self)
        limited = [name for name in ("low", "high") if getattr(self, name) is not None]
        if (self.via or self._rides) and limited:
            text = "limits a straight spring, without `via` and shifts; use a pg.Strut along the "
            text += "same path, whose `spring` is steep beyond it, such as {'x': [0, 1, 2], "
            text += "'value': [0, 0, 1e5]} for at most 1 m"
            refuse([(name, text) for name in limited])
        return self

    @property
    def _bounds(self) -> bool:
        return limits(self)

    def _stops(self, body_of: Callable[[str], Any]) -> Iterator[tuple[float, dict[str, Any]]]:
        own, other = points_of(self, body_of(self.body))
        ends = {"body": self.body, "point": own, "other": self.other, "other_point": other}
        return stops_of(self, "length", kind="distance", **ends)


def pack(f: Spring, one: Any, at: Places) -> Array | None:
    """Write the points, stiffness, damping and rest length."""
    apart = pack_points(f, one, at)
    one["rest"] = apart if f.rest is None else f.rest
    return pack_rates(f, one)


@part
def pull(one, knots, length, rate, t):
    """Compute the tension stiffness (length - rest) + damping x rate."""
    stiffness, damping = rates_of(one, knots)
    elastic, damping = stiffness * (length - one.rest), damping * rate
    put_in = 0.0 if one.knots == 0 else -elastic * rate
    return elastic + damping, put_in, damping * rate


@part
def energy(one, knots, length):
    """Return the stored energy ½ stiffness (length - rest)²."""
    if one.knots > 0:
        return 0.0 * one.rest
    return 0.5 * one.stiffness * (length - one.rest) ** 2


ROW = row(point_a=(REAL, 3), point_b=(REAL, 3), stiffness=REAL, damping=REAL, rest=REAL)
LOAD = Load(Spring, ROW, pack, on_path(pull, energy), columns=len(Spring.VARIES))
