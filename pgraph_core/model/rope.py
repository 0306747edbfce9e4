"""Ropes and belts that do not stretch: their length is a constraint."""

from __future__ import annotations

from typing import Any, ClassVar, Literal, Self

from pydantic import model_validator

from ..fields import Flag, Number, field, parts_of, refuse
from ..pulleys import Pulley, way_problems, with_body
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
