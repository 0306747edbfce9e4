"""Constraints between two bodies, or a body and the ground, beside the joints of the tree."""

from __future__ import annotations

import math
from collections.abc import Mapping
from typing import Annotated, Any, ClassVar, Literal, NamedTuple, Self

from pydantic import Field, model_validator

from .curves import Curve
from .fields import Described, Number, PerMotion, Vec3, refuse
from .names import GROUND
from .sentences import shown

ConstraintKind = Literal[
    "point",
    "weld",
    "revolute",
    "prismatic",
    "cylindrical",
    "universal",
    "distance",
    "line",
    "plane",
    "orientation",
    "gear",
    "motion",
    "rolling",
    "skate",
    "velocity",
]


class Takes(NamedTuple):
    """What a kind of constraint takes beside name, body, other and active."""

    fields: tuple[str, ...]
    needs: tuple[str, ...] = ()


POINTS, AXES = ("point", "other_point"), ("axis", "other_axis")

TAKES: dict[str, Takes] = {
    "point": Takes(POINTS),
    "weld": Takes(POINTS),
    "revolute": Takes(POINTS + AXES),
    "prismatic": Takes(POINTS + AXES),
    "cylindrical": Takes(POINTS + AXES),
    "universal": Takes(POINTS + AXES),
    "distance": Takes((*POINTS, "length"), ("other_point",)),
    "line": Takes(POINTS + AXES),
    "plane": Takes(POINTS + AXES),
    "orientation": Takes(()),
    "gear": Takes(("ratio", "offset", "coordinate", "other_coordinate")),
    "motion": Takes(("q_of_t", "coordinate"), ("q_of_t",)),
    "rolling": Takes((*POINTS, *AXES, "radius")),
    "skate": Takes(("point", "axis"), ("axis",)),
    "velocity": Takes(("coefficients", "value"), ("coefficients",)),
}
IN_JOINTS = ("gear", "motion", "velocity")  # act on coordinates, not between places of bodies
OWN = tuple(dict.fromkeys(field for takes in TAKES.values() for field in takes.fields))
LEFT_OUT: dict[str, Any] = {  # where a kind takes a field that is not given
    "ratio": 1.0,
    "offset": 0.0,
    "coordinate": 0,
    "other_coordinate": 0,
    "value": 0.0,
}


class Constraint(Described):
    """What ties `body` to `other`, bilateral; what the kinds mean is in docs/description.md."""

    FOLLOWERS: ClassVar[Mapping[str, tuple[str, ...]]] = {"kind": OWN}

    name: str = Field(description="text that is not empty")
    kind: ConstraintKind = Field(default="point", description="one of " + ", ".join(TAKES))
    body: str = Field(description="the name of a body")
    other: str = Field(default=GROUND, description="the name of a body, or 'ground'")
    point: Vec3 | None = Field(
        default=None,
        description="three finite numbers in the axes of `body` [m]; left out: its tip",
    )
    other_point: Vec3 | None = Field(
        default=None,
        description="three finite numbers in the axes of `other` [m]; left out: where `point` is "
        "in the initial state",
    )
    axis: Vec3 | None = Field(
        default=None, description="a direction [x, y, z] that is not zero, in the axes of `body`"
    )
    other_axis: Vec3 | None = Field(
        default=None, description="a direction [x, y, z] that is not zero, in the axes of `other`"
    )
    length: Annotated[Number, Field(gt=0)] | None = Field(
        default=None, description="a length > 0 [m]; left out: as in the initial state"
    )
    ratio: Number | None = Field(
        default=None, description="a finite number: q of `body` is ratio x q of `other` + offset"
    )
    offset: Number | None = Field(default=None, description="a finite number [rad, m]")
    coordinate: Annotated[int, Field(ge=0, le=5)] | None = Field(
        default=None, description="the number of a degree of freedom of the joint of `body`, from 0"
    )
    other_coordinate: Annotated[int, Field(ge=0, le=5)] | None = Field(
        default=None,
        description="the number of a degree of freedom of the joint of `other`, from 0",
    )
    q_of_t: Curve | None = Field(
        default=None,
        description="a table over time, or {'kind': 'sine' or 'polynomial', ...} [rad, m]",
    )
    radius: Annotated[Number, Field(gt=0)] | None = Field(
        default=None, description="a radius > 0 [m]; left out: that of the body's shape"
    )
    coefficients: dict[str, PerMotion] | None = Field(
        default=None, description="body name -> numbers, one a degree of freedom of its joint"
    )
    value: Number | None = Field(default=None, description="a finite number [rad/s, m/s]")
    active: bool = Field(default=True, description="true or false")

    @model_validator(mode="before")
    @classmethod
    def _kinds_own(cls, data: Any) -> Any:
        """Numbers that a kind takes and that are left out; the body of a velocity row."""
        if not isinstance(data, dict):
            return data
        data = {key: value for key, value in data.items() if value is not None or key == "name"}
        takes = TAKES.get(str(data.get("kind", "point")), Takes(()))
        data = {key: LEFT_OUT[key] for key in takes.fields if key in LEFT_OUT} | data
        coefficients = data.get("coefficients")
        if takes is TAKES["velocity"] and isinstance(coefficients, Mapping) and coefficients:
            data.setdefault("body", next(iter(coefficients)))
        return data

    @model_validator(mode="after")
    def _complete(self) -> Self:
        refuse(_field_problems(self) + _value_problems(self))
        return self

    @property
    def touches(self) -> tuple[str, ...]:
        """Names of the bodies it acts on, each once; the ground is none."""
        named = (self.body, self.other, *(self.coefficients or ()))
        return tuple(name for name in dict.fromkeys(named) if name != GROUND)


def _field_problems(c: Constraint) -> list[tuple[str, str]]:
    """Fields that the kind lacks, and fields that mean nothing to it."""
    takes = TAKES[c.kind]
    known = Constraint.model_fields
    found = [
        (name, f"kind '{c.kind}' needs it: {str(known[name].description).split(';')[0]}")
        for name in takes.needs
        if getattr(c, name) is None
    ]
    found += [
        (name, f"means nothing to kind '{c.kind}'; {_which(name)}")
        for name in OWN
        if name not in takes.fields and getattr(c, name) is not None
    ]
    if c.kind in ("line", "plane", "universal"):
        given = (c.axis is not None) + (c.other_axis is not None)
        if c.kind == "universal" and given == 1:
            missing = "axis" if c.axis is None else "other_axis"
            found.append(
                (missing, "a universal constraint takes both axis and other_axis, or none")
            )
        if c.kind != "universal" and given != 1:
            of = "along the line" if c.kind == "line" else "normal to the plane"
            text = f"a {c.kind} constraint takes one direction {of}: other_axis in the axes of "
            found.append(("other_axis", f"{text}`other`, or axis as `body` has it at first"))
    return found


def _which(field: str) -> str:
    kinds = [kind for kind, takes in TAKES.items() if field in takes.fields]
    return f"it belongs to kind {' or '.join(kinds)}" if len(kinds) < 4 else "leave it out"


def _value_problems(c: Constraint) -> list[tuple[str, str]]:
    found = [
        (name, f"a direction must not be zero; given {shown(axis)}")
        for name, axis in (("axis", c.axis), ("other_axis", c.other_axis))
        if axis is not None and not 1e-9 < math.hypot(*axis) < 1e9
    ]
    if c.kind == "gear" and c.ratio == 0:
        found.append(("ratio", "must not be zero; use kind 'motion' to hold a joint; given 0"))
    if c.kind in IN_JOINTS:
        found += _other_problems(c)
    if c.coefficients is not None and not any(any(x) for x in c.coefficients.values()):
        found.append(("coefficients", "at least one must differ from zero"))
    return found


def _other_problems(c: Constraint) -> list[tuple[str, str]]:
    """A gear ties the joints of two bodies; the others know no second body."""
    if c.kind == "gear" and c.other == GROUND:
        return [("other", "a gear needs a second body, whose joint it follows; given 'ground'")]
    if c.kind != "gear" and c.other != GROUND:
        text = f"means nothing to kind '{c.kind}'; leave it out; given {shown(c.other)}"
        return [("other", text)]
    return []
