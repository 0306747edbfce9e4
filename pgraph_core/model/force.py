"""Forces that act beside gravity: on joints, on bodies, and between two points or bodies."""

from __future__ import annotations

import math
from collections.abc import Mapping
from typing import Annotated, Any, ClassVar, Literal, Self

from pydantic import Field, model_validator

from .curves import Table, VectorTable
from .fields import Described, Number, Vec3, refuse
from .names import GROUND
from .sentences import shown

TAKES: dict[str, tuple[str, ...]] = {  # beside name, kind and body
    "motor": ("coordinate", "torque", "torque_limit"),
    "servo": ("coordinate", "torque", "kp", "kd", "target", "torque_limit"),
    "wrench": ("torque", "force", "frame", "point"),
    "spring": ("other", "point", "other_point", "stiffness", "damping", "rest"),
    "torsion": ("other", "axis", "stiffness", "damping", "rest"),
}
BETWEEN = ("spring", "torsion")  # passive: they act in every question, the others in runs only
OWN = tuple(dict.fromkeys(field for fields in TAKES.values() for field in fields))
LEFT_OUT: dict[str, dict[str, Any]] = {  # where a kind takes a field that is not given
    "wrench": {"torque": (0.0, 0.0, 0.0), "force": (0.0, 0.0, 0.0), "frame": "world"},
    "spring": {"stiffness": 0.0, "damping": 0.0},
    "torsion": {"stiffness": 0.0, "damping": 0.0, "rest": 0.0},
}


class Force(Described):
    """motor: `torque` on a joint coordinate; servo: kp (target - q) - kd v besides, the whole at
    most `torque_limit` (torque stands for force where the coordinate is a translation).
    wrench: `torque` and `force` on `body` at `point`. spring: between `point` and `other_point`.
    torsion: about `axis` between two bodies. Their signs and angles are in docs/description.md.
    """

    FOLLOWERS: ClassVar[Mapping[str, tuple[str, ...]]] = {"kind": OWN}

    name: str = Field(description="text that is not empty")
    kind: Literal["motor", "servo", "wrench", "spring", "torsion"] = Field(
        default="motor", description="one of " + ", ".join(TAKES)
    )
    body: str = Field(description="the name of a body; of a motor or servo the one whose joint")
    other: str = Field(default=GROUND, description="the name of a body, or 'ground'")
    coordinate: Annotated[int, Field(ge=0, le=5)] = Field(
        default=0, description="the number of a degree of freedom of the joint, from 0"
    )
    torque: Number | Table | Vec3 | VectorTable = Field(
        default=0.0,
        description="a number or a table over time [N m, N]; of a wrench three numbers each [N m]",
    )
    force: Vec3 | VectorTable | None = Field(
        default=None, description="three finite numbers [x, y, z] or a table of them over time [N]"
    )
    frame: Literal["world", "body"] | None = Field(
        default=None, description="'world' or 'body': the axes of torque and force"
    )
    point: Vec3 | None = Field(
        default=None,
        description="three finite numbers in the axes of `body` [m]; left out: a wrench's body "
        "origin, a spring's tip",
    )
    other_point: Vec3 | None = Field(
        default=None,
        description="three finite numbers in the axes of `other` [m]; left out: its origin",
    )
    axis: Vec3 | None = Field(
        default=None,
        description="a direction [x, y, z] that is not zero, in the axes of `body`; left out: z",
    )
    stiffness: Annotated[Number, Field(ge=0)] | None = Field(
        default=None, description="a number >= 0 [N/m; of torsion N m/rad]"
    )
    damping: Annotated[Number, Field(ge=0)] | None = Field(
        default=None, description="a number >= 0 [N s/m; of torsion N m s/rad]"
    )
    rest: Number | None = Field(
        default=None,
        description="a finite number: of a spring its length >= 0 without force [m], left out: as "
        "in the initial state; of torsion the angle without torque [rad]",
    )
    kp: Annotated[Number, Field(ge=0)] = Field(
        default=0.0, description="a number >= 0 [N m/rad, N/m]"
    )
    kd: Annotated[Number, Field(ge=0)] = Field(
        default=0.0, description="a number >= 0 [N m s/rad, N s/m]"
    )
    target: Number | Table = Field(
        default=0.0, description="a number or a table over time [rad, m]"
    )
    torque_limit: Annotated[Number, Field(gt=0)] | None = Field(
        default=None, description="a number > 0 [N m, N], or nothing"
    )

    @model_validator(mode="before")
    @classmethod
    def _kinds_own(cls, data: Any) -> Any:
        """The numbers that a kind takes and that are left out."""
        if not isinstance(data, dict):
            return data
        return LEFT_OUT.get(str(data.get("kind")), {}) | data

    @model_validator(mode="after")
    def _complete(self) -> Self:
        refuse(_problems(self))
        return self


def _problems(f: Force) -> list[tuple[str, str]]:
    if f.kind == "motor" and (f.kp or f.kd):
        return [("kind", "a motor has no kp and kd; use kind 'servo'")]
    takes = (*TAKES[f.kind], "target") if f.kind == "motor" else TAKES[f.kind]
    found = [
        (name, f"means nothing to a {f.kind}; {_which(name)}")
        for name in OWN
        if name not in takes and getattr(f, name) != Force.model_fields[name].default
    ]
    one = isinstance(f.torque, (float, int, Table))
    if f.kind in ("motor", "servo") and not one:
        text = f"a {f.kind}'s torque is one number, or a table of one number a time"
        found.append(("torque", f"{text}; given {shown(f.torque)}"))
    if f.kind == "wrench" and one:
        text = "a wrench's torque is three numbers [x, y, z], or a table of them over time"
        found.append(("torque", f"{text}; given {shown(f.torque)}"))
    if f.axis is not None and not 1e-9 < math.hypot(*f.axis) < 1e9:
        found.append(("axis", f"a direction must not be zero; given {shown(f.axis)}"))
    if f.kind == "spring" and f.rest is not None and f.rest < 0:
        found.append(("rest", f"a spring's length must be >= 0 [m]; given {shown(f.rest)}"))
    return found


def _which(field: str) -> str:
    kinds = [kind for kind, fields in TAKES.items() if field in fields]
    return f"it belongs to kind {' or '.join(kinds)}" if len(kinds) < 4 else "leave it out"
