"""Constraints between two bodies, or a body and the ground, beside the joints of the tree."""

from __future__ import annotations

from typing import Literal

from pydantic import Field

from .fields import Described, Vec3
from .names import GROUND


class Constraint(Described):
    """`point` of `body` stays at `other_point` of `other` (three rows, bilateral)."""

    name: str = Field(description="text that is not empty")
    kind: Literal["point"] = Field(default="point", description="'point'")
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
    active: bool = Field(default=True, description="true or false")
