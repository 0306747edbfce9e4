"""Ropes and belts that do not stretch: their length is a constraint."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any, ClassVar, Literal, Self

from pydantic import model_validator

from ..errors import ModelError, Problem
from ..fields import Flag, Number, field, parts_of, refuse
from ..forces import Cable
from ..pulleys import Pulley, links_of, way_problems, with_body
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

    @classmethod
    def _followers(cls) -> Any:
        return {**super()._followers(), "through": ("body",)}

    @classmethod
    def begun(cls, model: Any, body: str, other: str) -> dict[str, Any]:
        return Pulley.from_body_to_body(body, other)

    @model_validator(mode="before")
    @classmethod
    def _ends(cls, data: Any) -> Any:
        """Set `body` to the first moving body along the rope."""
        return with_body(data)

    @model_validator(mode="after")
    def _led(self) -> Self:
        refuse(way_problems(self.through, self.closed))
        return self

    @property
    def _links(self) -> tuple[tuple[str, str], ...]:
        return links_of(self.through, self.closed)

    def _blocks(self, e: Any) -> list[Any]:
        return e.roped(self.through, self.closed, self.length)


def belt(
    bodies: Sequence[str],
    radii: Sequence[float] | float,
    *,
    crossed: bool = False,
    name: str = "belt",
    **fields: Any,
) -> Any:
    """Return a closed belt over wheels at the origins of bodies, which it grips.

    It is a `Rope`, which does not stretch, or with `stiffness` [N/m] a `Cable`. A belt over two
    wheels may be `crossed`, so that they turn in opposite senses. Raises ModelError.

    Parameters
    ----------
    bodies : sequence of str
        Names of two or more bodies with hinges, in the order of the belt.
    radii : float or sequence of float
        Radius of every wheel [m], or one for all.

    Examples
    --------
    >>> import pgraph_core as pg
    >>> pg.belt(["motor", "load"], radii=(0.02, 0.06)).closed
    True
    """
    names = list(bodies)
    sizes = [radii] * len(names) if isinstance(radii, int | float) else list(radii)
    where = "belt"
    if len(sizes) != len(names):
        text = f"needs one radius [m] for each of {len(names)} bodies, got {len(sizes)}"
        raise ModelError(Problem(where, "radii", text))
    if crossed and len(names) != 2:
        text = f"needs two bodies, got {len(names)}; give the side of every pg.Pulley of a pg.Rope"
        raise ModelError(Problem(where, "crossed", text))
    sides = (1, -1) if crossed else (1,) * len(names) if len(names) == 2 else (None,) * len(names)
    through = [Pulley(x, radius=r, side=side) for x, r, side in zip(names, sizes, sides)]
    kind: Any = Cable if fields.get("stiffness") is not None else Rope
    return kind(name=name, through=through, closed=True, **fields)
