"""Pulleys, drums and points along which a cable leads."""

from __future__ import annotations

import re
from collections.abc import Callable, Iterable, Mapping, Sequence
from itertools import pairwise
from typing import Any, ClassVar, Literal, Self

from pydantic import model_validator

from .errors import shown
from .fields import (
    GROUND,
    Flag,
    Frozen,
    Number,
    OfKinds,
    Text,
    Vec3,
    field,
    listed,
    maybe_vector,
    refuse,
    refuse_no_direction,
    vector,
)
from .units import M

SEGMENT = re.compile(r"(.+)\[([1-9]\d?)\]", re.DOTALL)  # name and number of a part of a cable


class Pulley(Frozen):
    """A wheel on which a cable lies, or with radius 0 a point through which it passes.

    A cable grips a wheel that is centred on the hinge of its body, so that it moves with its rim,
    and slides over any other one without friction. `grip` states one of both. With `friction` μ it
    sticks or slips: if it turns by θ on the wheel, the tensions on both sides have a ratio of at
    most e^μθ. At an end of the cable, a wheel is a drum on which it winds, and a point is where it
    is fixed.

    Examples
    --------
    >>> import pgraph_core as pg
    >>> pg.Pulley("sheave", radius=0.1).body
    'sheave'
    """

    OF_WHEELS: ClassVar[tuple[str, ...]] = ("axis", "side", "grip", "friction")
    FOLLOWERS: ClassVar[dict[str, tuple[str, ...]]] = {"radius": OF_WHEELS}

    body: Text = field("the name of a body, or 'ground'", label="Body")
    point: Vec3 = field(
        "three finite numbers in the axes of its `body` [m]",
        converter=vector, default=(0.0, 0.0, 0.0), dim=M, role="point",
        help="centre of the wheel, or the point, in the axes of its body",
    )  # fmt: skip
    radius: Number = field(
        "a length >= 0 [m], 0 for a point",
        default=0.0, ge=0, dim=M, help="radius of the wheel; 0: a point",
    )  # fmt: skip
    axis: Vec3 | None = field(
        "a direction in the axes of its `body`; default: the axis of its hinge",
        converter=maybe_vector, default=None, role="axial",
        help="axis of the wheel, in the axes of its body; default: that of its hinge",
    )  # fmt: skip
    side: Literal[1, -1] | None = field(
        "1 if the cable turns about the axis by the right hand, -1 if by the left hand, or None",
        default=None, help="1: the cable turns about the axis by the right hand, -1: by the left "
        "hand; default: as the line through the centres bends",
    )  # fmt: skip
    grip: Flag | None = field(
        "true, false or None",
        default=None, help="whether the cable moves with the rim; default: if the wheel is centred "
        "on the hinge of its body",
    )  # fmt: skip
    friction: Number | None = field(
        "a number >= 0, or None",
        default=None, ge=0, help="Coulomb's coefficient between cable and wheel, on which "
        "it may slip; default: it grips or slides as `grip` says",
    )  # fmt: skip

    @model_validator(mode="after")
    def _round(self) -> Self:
        refuse_no_direction(axis=self.axis)
        given = [name for name in self.OF_WHEELS if getattr(self, name) is not None]
        if not self.radius and given:
            text = f"belongs to a wheel, got {shown(getattr(self, given[0]))} without a radius; "
            refuse([(given[0], f"{text}give radius=0.05 [m] for example, or leave it out")])
        if self.friction is not None and self.grip is not None:
            text = f"got {shown(self.friction)} beside grip={self.grip}, and a cable with friction "
            never = "does not slip" if self.grip else "slides without friction"
            text += f"sticks or slips; leave grip out, or friction if it {never}"
            refuse([("friction", text)])
        return self


def along(through: Any) -> Any:
    """Return the fields of pulleys for a list whose points may be names or pairs (body, point)."""

    def station(x: Any) -> Any:
        if isinstance(x, str):
            return {"body": x}
        pair = isinstance(x, (list, tuple)) and len(x) == 2
        return {"body": x[0], "point": x[1]} if pair else x

    return tuple(map(station, through)) if isinstance(through, (list, tuple)) else through


def with_body(data: Any) -> Any:
    """Return the fields of a part along a cable with its first moving body as `body`."""
    if not isinstance(data, dict) or not isinstance(data.get("through"), (list, tuple)):
        return data
    through = along(data["through"])
    named = (x.get("body") if isinstance(x, Mapping) else getattr(x, "body", None) for x in through)
    first = next((name for name in named if name != GROUND), GROUND)
    follows = isinstance(data.get("body"), str | None)  # anything else is refused
    return {**data, "through": through, **({"body": first} if follows else {})}


def links_of(through: tuple[Pulley, ...], closed: bool) -> tuple[tuple[str, str], ...]:
    """Return the pairs of bodies that follow each other along a cable, once each, with a moving
    body as the first."""
    names = [x.body for x in through]
    ends = list(pairwise([*names, names[0]] if closed else names))
    pairs = [(b, a) if a == GROUND else (a, b) for a, b in ends if a != b]
    first = {frozenset(pair): pair for pair in reversed(pairs)}
    return tuple(first[x] for x in dict.fromkeys(map(frozenset, pairs)))


def most_segments(part: Any) -> int:
    """Return how many segments with their own tension a cable may have, 1 for other parts."""
    return len(part.through) - (0 if part.closed else 1) if hasattr(part, "through") else 1


def segment_names(name: str, count: int) -> list[str]:
    """Return the names of the segments of a cable, "name[1]" and so on if there are several."""
    return [f"{name}[{k}]" for k in range(1, count + 1)] if count > 1 else [name]


def cable_limit(segment: str) -> str:
    """Return the name of the limit of a segment of a cable that does not stretch."""
    return f"cable {segment}"


def without_segment(name: str, known: Iterable[str]) -> tuple[str, int]:
    """Return the name of a part and the number of its segment, from 1, or 0 for the whole part.

    `name` is that of one of the `known` parts, or such a name with a number, "rope[2]".
    """
    found = None if name in known else SEGMENT.fullmatch(name)
    return (found[1], int(found[2])) if found else (name, 0)


def way_problems(through: tuple[Pulley, ...], closed: bool) -> list[tuple[str, str]]:
    """Return what is wrong with the stations of a cable, as (field, text)."""
    if len(through) < 2:
        only = f"only '{through[0].body}'" if through else "none"
        text = f"needs two or more points and wheels, got {only}; a rope leads from the first to "
        return [("through", f"{text}the last one")]
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


Place = Pulley | str | tuple[str, Sequence[float]] | Mapping[str, Any]
stations: Callable[[Iterable[Place]], tuple[Pulley, ...]] = listed


class AlongPulleys(OfKinds):
    """A part along points and wheels, of which `body` is the first moving body."""

    PLACES: ClassVar[tuple[str, ...]] = ("through",)

    body: Text = field("the name of a body", default=GROUND, label="Body")
    through: tuple[Pulley, ...] = field(
        "a list of two or more points (body, [x, y, z]) [m] and pulleys {'body': name, 'radius': "
        "length}, in their order",
        converter=stations, role="parts", help="points and wheels along it, in their order",
    )  # fmt: skip
    closed: Flag = field(
        "true or false", default=False, help="whether it is a belt that returns to its first wheel"
    )

    @classmethod
    def _followers(cls) -> Mapping[str, tuple[str, ...]]:
        return {**super()._followers(), "through": ("body",)}

    @classmethod
    def begun(cls, model: Any, body: str, other: str) -> dict[str, Any]:
        return {"through": (Pulley(body=body), Pulley(body=other))}

    @model_validator(mode="before")
    @classmethod
    def _ends(cls, data: Any) -> Any:
        """Set `body` to the first moving body."""
        return with_body(data)

    @model_validator(mode="after")
    def _led(self) -> Self:
        refuse(way_problems(self.through, self.closed))
        return self

    @property
    def _links(self) -> tuple[tuple[str, str], ...]:
        return links_of(self.through, self.closed)
