"""What touches what, and by which law."""

from __future__ import annotations

from collections.abc import Mapping
from typing import ClassVar, Literal, Self

from pydantic import model_validator

from .fields import EVERY, GROUND, Described, Number, Vec3s, field, refuse, vectors


class Contact(Described):
    """`body` touches `other`; nothing pulls.

    soft: Hunt and Crossley's k d^1.5 (1 + c d') at a depth d with regularised friction; penalty:
    k d + c d' with Coulomb friction that sticks by a spring; complementarity: no depth, impulses
    in the friction cone, Newton's restitution.
    """

    ABOUT: ClassVar[Mapping[str, str]] = {  # one line a law, for who chooses
        "complementarity": "rigid: no depth, impulses in the friction cone, restitution",
        "soft": "Hunt and Crossley: k d^1.5 (1 + c d'), smooth friction",
        "penalty": "spring and damper: k d + c d', friction that sticks",
    }

    name: str = field("text that is not empty", label="Name")
    body: str = field("the name of a body, or '*' for every body that has a shape", label="Body")
    other: str = field(
        "'ground', the name of a body, or '*' for every other body that has a shape",
        default=GROUND, label="Other",
    )  # fmt: skip
    law: Literal["soft", "penalty", "complementarity"] = field(
        "one of soft, penalty, complementarity",
        default="complementarity", label="Law", help="how it pushes back",
    )  # fmt: skip
    friction: Number | None = field(
        "Coulomb's coefficient >= 0; left out: that of the ground",
        default=None, ge=0, help="Coulomb's coefficient; empty: that of the ground",
    )  # fmt: skip
    restitution: Number | None = field(
        "a number from 0 to 1; left out: that of the ground",
        default=None, ge=0, le=1, help="0 to 1; empty: that of the ground",
    )  # fmt: skip
    stiffness: Number | None = field(
        "a number > 0 [N/m; of a soft contact N/m^1.5]; left out: from the masses",
        default=None, gt=0, unit="N/m", help="empty: from the masses",
    )  # fmt: skip
    damping: Number | None = field(
        "a number >= 0 [N s/m; of a soft contact s/m]; left out: from the restitution",
        default=None, ge=0, unit="N s/m", help="empty: from the restitution",
    )  # fmt: skip
    points: Vec3s = field(
        "a list of points [x, y, z] of `body` [m]; left out: its shape",
        converter=vectors, default=(), unit="length",
        help="that touch, in the axes of the body; none: its shape",
    )  # fmt: skip
    active: bool = field("true or false", default=True)

    @property
    def pair(self) -> tuple[str, str]:
        """The names of `body` and `other`, as they are given."""
        return self.body, self.other

    @property
    def touches(self) -> tuple[str, ...]:
        """The names in `body` and `other` but the ground, each once."""
        return tuple(name for name in dict.fromkeys(self.pair) if name != GROUND)

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
