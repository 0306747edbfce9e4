"""A rope over any number of points, which pulls and never pushes."""

from __future__ import annotations

from typing import Any, ClassVar, Literal

from ..engine.compiler.jit import part
from ..engine.records import REAL
from ..fields import Number, field
from ..units import M, N
from .base import KIND, Load, Places, row
from .path import BetweenPoints, on_path, pack_points


class Rope(BetweenPoints):
    """A rope along a path, with the pull stiffness (length - rest) if it is longer than `rest`."""

    ABOUT: ClassVar[str] = "a rope between two or more points, which never pushes"
    SCALES: ClassVar[tuple[str, ...]] = ("stiffness",)
    SINCE: ClassVar[int] = 9
    NEW: ClassVar[dict[str, Any]] = {"stiffness": 1e4}

    kind: Literal["rope"] = field(KIND, default="rope")
    stiffness: Number = field("a number >= 0 [N/m]", default=0.0, ge=0, dim=N / M)
    rest: Number | None = field(
        "a length >= 0 without force [m]; default: as in the initial state",
        default=None, ge=0, dim=M, help="rest length; default: as in the initial state",
    )  # fmt: skip


def pack(f: Rope, one: Any, at: Places) -> None:
    """Write the points, stiffness and rest length."""
    length = pack_points(f, one, at)
    one["stiffness"], one["rest"] = f.stiffness, length if f.rest is None else f.rest


@part
def pull(one, knots, length, rate, t):
    """Compute the tension stiffness (length - rest), which is never negative."""
    return one.stiffness * max(length - one.rest, 0.0), 0.0, 0.0


@part
def energy(one, knots, length):
    """Return the stored energy ½ stiffness (length - rest)², or 0 if it is slack."""
    return 0.5 * one.stiffness * max(length - one.rest, 0.0) ** 2


ROW = row(point_a=(REAL, 3), point_b=(REAL, 3), stiffness=REAL, rest=REAL)
LOAD = Load(Rope, ROW, pack, on_path(pull, energy))
