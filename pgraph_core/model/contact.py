"""What touches what, and by which law."""

from __future__ import annotations

from typing import Annotated, Literal, Self

from pydantic import Field, model_validator

from .fields import Described, Number, Vec3, refuse
from .names import EVERY, GROUND


class Contact(Described):
    """`body` touches `other`; nothing pulls.

    soft: Hunt and Crossley's k d^1.5 (1 + c d') at a depth d with regularised friction; penalty:
    k d + c d' with Coulomb friction that sticks by a spring; complementarity: no depth, impulses
    in the friction cone, Newton's restitution.
    """

    name: str = Field(description="text that is not empty")
    body: str = Field(description="the name of a body, or '*' for every body that has a shape")
    other: str = Field(
        default=GROUND,
        description="'ground', the name of a body, or '*' for every other body that has a shape",
    )
    law: Literal["soft", "penalty", "complementarity"] = Field(
        default="complementarity", description="one of soft, penalty, complementarity"
    )
    friction: Annotated[Number, Field(ge=0)] | None = Field(
        default=None, description="Coulomb's coefficient >= 0; left out: that of the ground"
    )
    restitution: Annotated[Number, Field(ge=0, le=1)] | None = Field(
        default=None, description="a number from 0 to 1; left out: that of the ground"
    )
    stiffness: Annotated[Number, Field(gt=0)] | None = Field(
        default=None,
        description="a number > 0 [N/m; of a soft contact N/m^1.5]; left out: from the masses",
    )
    damping: Annotated[Number, Field(ge=0)] | None = Field(
        default=None,
        description="a number >= 0 [N s/m; of a soft contact s/m]; left out: from the restitution",
    )
    points: tuple[Vec3, ...] = Field(
        default=(), description="a list of points [x, y, z] of `body` [m]; left out: its shape"
    )
    active: bool = Field(default=True, description="true or false")

    @model_validator(mode="after")
    def _complete(self) -> Self:
        found = []
        if self.law == "complementarity":
            found += [
                (name, "means nothing to a rigid contact; use law 'soft' or 'penalty'")
                for name in ("stiffness", "damping")
                if getattr(self, name) is not None
            ]
        if self.law == "soft" and self.damping is not None and self.restitution is not None:
            text = "damping says how much of the velocity comes back; give one of the two"
            found.append(("restitution", text))
        if self.body == EVERY and self.points:
            found.append(("points", "belong to one body; name it instead of '*'"))
        refuse(found)
        return self
