"""Ropes and belts that do not stretch: their length is a constraint."""

from __future__ import annotations

from collections.abc import Mapping
from itertools import pairwise
from typing import Any, ClassVar, Literal, Self

from pydantic import model_validator

from ..fields import GROUND, Flag, Number, field, parts_of, refuse
from ..pulleys import Pulley, along
from ..units import M
from .constraint import KIND, Constraint


class Rope(Constraint):
    """A rope or belt of constant length, which is always taut.

    It leads through points and over wheels, in their order. A wheel that it grips divides it into
    segments, each of which has its own tension and is one row. With `closed` it is a belt, which
    returns to its first wheel.

    Examples
    --------
    >>> import pgraph_core as pg
    >>> through = [("left", (0, 0, 0)), pg.Pulley("sheave", radius=0.1), ("right", (0, 0, 0))]
    >>> pg.Rope(name="rope", through=through).through[1].radius
    0.1
    """

    ABOUT: ClassVar[str] = "a rope or belt of constant length over wheels and points"
    SINCE: ClassVar[int] = 9
    PLACES: ClassVar[tuple[str, ...]] = ("through",)

    kind: Literal["rope"] = field(KIND, default="rope")
    through: tuple[Pulley, ...] = field(
        "a list of two or more points (body, [x, y, z]) [m] and pulleys {'body': name, 'radius': "
        "length}, in their order",
        converter=parts_of(Pulley), role="parts",
        help="points and wheels along the rope, in their order",
    )  # fmt: skip
    closed: Flag = field(
        "true or false", default=False, help="whether it is a belt that returns to its first wheel"
    )
    length: Number | None = field(
        "a length > 0 between its ends [m]; default: as in the initial state",
        default=None, gt=0, dim=M, help="length between its ends; default: as in the initial state",
    )  # fmt: skip

    @model_validator(mode="before")
    @classmethod
    def _ends(cls, data: Any) -> Any:
        """Set `body` to the first moving body along the rope."""
        return with_body(data)

    @model_validator(mode="after")
    def _led(self) -> Self:
        refuse(way_problems(self.through, self.closed))
        return self

    def _blocks(self, e: Any) -> list[Any]:
        return e.roped(self.through, self.closed, self.length)


def with_body(data: Any) -> Any:
    """Return the fields of a part along a cable with its first moving body as `body`."""
    if not isinstance(data, dict) or not isinstance(data.get("through"), (list, tuple)):
        return data
    through = along(data["through"])
    named = (x.get("body") if isinstance(x, Mapping) else getattr(x, "body", None) for x in through)
    first = next((name for name in named if name != GROUND), None)
    return {**data, "through": through, **({"body": first} if first else {})}


def way_problems(through: tuple[Pulley, ...], closed: bool) -> list[tuple[str, str]]:
    """Return what is wrong with the stations of a cable, as (field, text)."""
    if len(through) < 2:
        text = f"needs two or more points and wheels, got {len(through)}; a rope leads from the "
        return [("through", f"{text}first to the last one")]
    if closed and not all(x.radius for x in through):
        point = next(k for k, x in enumerate(through, start=1) if not x.radius)
        text = f"number {point} of a closed belt is a point on '{through[point - 1].body}'; give "
        return [("through", f"{text}a wheel with a radius [m], or closed=False")]
    for k, (a, b) in enumerate(pairwise(through), start=1):
        if (a.body, a.point) == (b.body, b.point):
            text = f"numbers {k} and {k + 1} are at the same point of '{a.body}'; move one of them "
            return [("through", f"{text}or leave it out")]
    if all(x.body == GROUND for x in through):
        return [("through", "all its points are on the ground; put one of them on a moving body")]
    return []
