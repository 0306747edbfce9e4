"""Ropes and belts that do not stretch: their length is a constraint."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any, ClassVar, Literal

from ..errors import ModelError, Problem, explained
from ..fields import Number, field
from ..forces import Cable
from ..pulleys import AlongPulleys, Pulley
from ..units import M
from .constraint import KIND, Constraint


class Rope(AlongPulleys, Constraint):
    """A rope or belt of constant length, which is always taut.

    It leads through points and over wheels, in their order. A wheel that it grips divides it into
    segments, each of which has its own tension and is one row. With `closed` it is a belt, which
    returns to its first wheel.

    Examples
    --------
    >>> import pgraph_core as pg
    >>> through = [("left", (0, 0, 0)), pg.Pulley(body="sheave", radius=0.1), ("right", (0, 0, 0))]
    >>> pg.Rope(name="rope", through=through).through[1].radius
    0.1
    """

    ABOUT: ClassVar[str] = "a rope or belt of constant length over wheels and points"
    SINCE: ClassVar[int] = 9

    kind: Literal["rope"] = field(KIND, default="rope")
    length: Number | None = field(
        "a length > 0 between its ends [m]; default: as in the initial state",
        default=None, gt=0, dim=M, help="length between its ends; default: as in the initial state",
    )  # fmt: skip

    def onto(self, bodies: Any) -> None:
        bodies.along_rope(self)

    def _blocks(self, e: Any) -> list[Any]:
        return e.roped(self.through, self.closed, self.length)


@explained
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
    through = [Pulley(body=x, radius=r, side=side) for x, r, side in zip(names, sizes, sides)]
    kind: Any = Cable if fields.get("stiffness") is not None else Rope
    return kind(name=name, through=through, closed=True, **fields)
