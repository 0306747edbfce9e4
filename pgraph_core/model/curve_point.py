"""A point that stays on a curve of another body, as in a slot."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from typing import Annotated, Any, ClassVar, Literal, Self

import numpy as np
from pydantic import BeforeValidator, model_validator

from ..fields import AtPoint, Once, field, listed, refuse
from ..tracks import Track
from .constraint import KIND, ToOther
from .poses import poses

Given = Track | Mapping[str, Any] | Sequence[Sequence[float]]


def _as_track(value: Any) -> Any:
    """Return points, the short form of a curve, as its fields."""
    value = listed(value)
    points = isinstance(value, tuple) and not any(isinstance(x, int | float) for x in value)
    return {"points": value} if points else value


_track: Callable[[Given], Track] = _as_track


class CurvePoint(AtPoint, ToOther):
    """A constraint that keeps `point` on a curve of `other`, as a pin in a slot.

    The curve is given by points, which a spline of degree 5 joins, or as a `Track` with functions
    x, y and z of a coordinate. It may be closed, and may cross itself: a point that comes to a
    crossing keeps its branch. Past an end of an open curve the bend of the end goes on.

    Examples
    --------
    >>> import pgraph_core as pg
    >>> points = [(0, 0, 0), (0.1, 0, 0.02), (0.2, 0, 0)]
    >>> slot = pg.CurvePoint(name="slot", body="pin", point=(0, 0, 0), other="plate", curve=points)
    """

    SINCE: ClassVar[int] = 9
    ROWS: ClassVar[int] = 2
    ABOUT: ClassVar[str] = "the point stays on a curve, as in a slot: 2 rows"

    kind: Literal["curve_point"] = field(KIND, default="curve_point")
    curve: Annotated[Track, Once, BeforeValidator(_as_track)] = field(
        "two or more points [x, y, z] in the axes of `other` [m], or {'points': [...], 'closed': "
        "true or false}, or {'x': ..., 'y': ..., 'z': ..., 'range': [first, last]} with numbers, "
        "pairs or expressions of a coordinate q, as 'cos(q)'",
        converter=_track, role="track", label="Curve", help="curve in the axes of the second body",
    )  # fmt: skip

    @classmethod
    def begun(cls, model: Any, body: str, other: str) -> dict[str, Any]:
        """Return an arc of `other` that begins at the tip of `body`."""
        found, tip = poses(model.standing), model.body(body).tip_point
        start = (found[body].place(tip) - found[other].position) @ found[other].rotation
        size = float(np.linalg.norm(tip)) or 1.0
        ways = np.array(((0.0, 0.0, 0.0), (0.5, 0.0, 0.1), (1.0, 0.0, 0.0)))
        return {"curve": {"points": (start + size * ways + 0.0).tolist()}}

    @model_validator(mode="before")
    @classmethod
    def _closed(cls, data: Any) -> Any:
        """Accept `closed` beside the points of a curve."""
        if not isinstance(data, dict) or "closed" not in data:
            return data
        data = dict(data)
        curve, closed = _as_track(data.get("curve")), data.pop("closed")
        if isinstance(curve, Track) or (isinstance(curve, dict) and "closed" in curve):
            refuse([("closed", "stands in the curve; leave it out beside it")])
        if isinstance(curve, dict):
            data["curve"] = {**curve, "closed": closed}
        return data

    @model_validator(mode="after")
    def _turns_nothing(self) -> Self:
        curve = self.curve
        names = [x for x, given in (("up", curve.up), ("angles", curve.angles)) if given]
        text = "turns a body along a track, but this curve holds a point alone; leave it out"
        refuse([(f"curve.{name}", text) for name in names])
        return self

    def _blocks(self, e: Any) -> list[Any]:
        return [e.on_curve(self.curve)]
