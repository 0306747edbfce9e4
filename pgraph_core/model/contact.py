"""Contacts: pairs of bodies that may touch, and the contact laws."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from typing import Any, ClassVar, Literal, NamedTuple, Self

from pydantic import model_validator

from ..errors import shown
from ..fields import (
    EVERY,
    GROUND,
    Acting,
    Expression,
    Flag,
    NotNegative,
    Number,
    Text,
    Vec3s,
    field,
    listed,
    refuse,
    vectors,
)
from ..units import NONE, Dim, M, N, S
from .world import Ground, below_kinetic

_number_or_law: Callable[[float | str | None], NotNegative | Expression | None] = listed
PAIRED = 20  # number of bodies up to which every two are a separate contact pair


class Frictions(NamedTuple):
    """The friction coefficients for a single contact."""

    kinetic: float
    static: float
    rolling: float  # [m]
    spinning: float  # [m]


class Contact(Acting):
    """A contact between `body` and `other`.

    Contact forces can push but not pull. With `law="complementarity"`, contacts are rigid, with
    impulses in the friction cone and Newton's law of restitution. With "soft", the normal force is
    k d^1.5 (1 + c d') at a depth d [Hunt & Crossley 1975], and friction is regularised. With
    "penalty", it is k d + c d', and Coulomb friction uses a spring for sticking. By default, the
    damping of the last two reproduces the requested restitution at any impact speed. Rolling and
    spinning are resisted by torques of at most `rolling_friction` and `spinning_friction` times the
    normal force.

    A contact that names both bodies takes the place of a contact of '*' for these two, also if it
    is not active: then they do not touch. Contacts with `points` act in addition to others.
    """

    VARIES_SINCE: ClassVar[int] = 9
    ABOUT: ClassVar[Mapping[str, str]] = {  # one line a law, for who chooses
        "complementarity": "rigid contact: no depth, impulses in the friction cone, restitution",
        "soft": "Hunt and Crossley: k d^1.5 (1 + c d'), smooth friction",
        "penalty": "spring and damper: k d + c d', friction that sticks",
    }

    name: Text = field("a non-empty string", label="Name")
    body: Text = field("the name of a body, or '*' for every body that has a shape", label="Body")
    other: Text = field(
        "'ground', the name of a body, or '*' for every other body that has a shape",
        default=GROUND, label="Other",
    )  # fmt: skip
    law: Literal["soft", "penalty", "complementarity"] = field(
        "one of soft, penalty, complementarity",
        default="complementarity", label="Law", help="contact law",
    )  # fmt: skip
    friction: NotNegative | Expression | None = field(
        "a Coulomb friction coefficient >= 0, or an expression; default: as for the ground",
        converter=_number_or_law, default=None, dim=NONE,
        help="Coulomb coefficient; by default as for the ground",
    )  # fmt: skip
    static_friction: Number | None = field(
        "a friction coefficient >= friction for sticking; default: friction, or as for the ground",
        default=None, dim=NONE, since=2, ge=0,
        help="friction coefficient without sliding; by default equal to the friction",
    )  # fmt: skip
    rolling_friction: Number | None = field(
        "a length >= 0 [m], rolling torque over normal force; default: as for the ground",
        default=None, ge=0, dim=M, since=2,
        help="rolling torque divided by normal force; by default as for the ground",
    )  # fmt: skip
    spinning_friction: Number | None = field(
        "a length >= 0 [m], spinning torque over normal force; default: as for the ground",
        default=None, ge=0, dim=M, since=2,
        help="spinning torque divided by normal force; by default as for the ground",
    )  # fmt: skip
    restitution: Number | None = field(
        "a number from 0 to 1; default: as for the ground",
        default=None, dim=NONE, ge=0, le=1, help="0 to 1; by default as for the ground",
    )  # fmt: skip
    stiffness: Number | None = field(
        "a number > 0 [N/m; of a soft contact N/m^1.5]; default: from the masses",
        default=None, gt=0, dim=N / M, help="default: derived from the masses",
    )  # fmt: skip
    damping: Number | None = field(
        "a number >= 0 [N s/m; of a soft contact s/m]; default: from the restitution",
        default=None, ge=0, dim=N * S / M, help="default: derived from the restitution",
    )  # fmt: skip
    points: Vec3s = field(
        "a list of points [x, y, z] of `body` [m]; default: its shape",
        converter=vectors, default=(), dim=M, role="point",
        help="contact points in body axes; default: the shape of the body",
    )  # fmt: skip
    active: Flag = field("true or false", default=True)

    def _dim_of(self, name: str) -> Dim:
        """Return the dimension of a field. Soft contacts use different dimensions."""
        soft = {"stiffness": N / M**1.5, "damping": S / M} if self.law == "soft" else {}
        return soft.get(name) or super()._dim_of(name)

    @property
    def _varies(self) -> bool:
        """Return True if its friction is an expression in time and the motion."""
        return type(self.friction) is str

    def frictions(self, ground: Ground) -> Frictions:
        """Return the four coefficients of friction, with the ground's values as defaults.

        Expressions are replaced by the value of the ground until a run evaluates them.
        """
        own = None if isinstance(self.friction, str) else self.friction
        kinetic = ground.friction if own is None else own
        static = self.static_friction
        if static is None:
            static = ground.least_to_slide if self.friction is None else kinetic
        rolling, spinning = self.rolling_friction, self.spinning_friction
        return Frictions(
            kinetic,
            static,
            ground.rolling_friction if rolling is None else rolling,
            ground.spinning_friction if spinning is None else spinning,
        )

    @classmethod
    def begun(cls, model: Any, body: str, other: str) -> dict[str, Any]:
        """Return required fields of a new contact: a point of a body without a shape."""
        bare = body != EVERY and model.body(body).shape is None
        return {"points": (model.body(body).tip_point,)} if bare else {}

    def touch_name(self, body: str, other: str) -> str:
        """Return the name used in results for this pair of bodies, or ""."""
        many, most = self.body == EVERY, self.other == EVERY
        if (not many and self.body != body) or (not most and self.other != other):
            return ""
        if not many and not most:
            return self.name
        return f"{self.name}[{body if not most else other if not many else f'{body}, {other}'}]"

    def has_touch(self, name: str) -> bool:
        """Check whether a pair of bodies of this contact has this name in results."""
        return name == self.name or name.startswith(f"{self.name}[")

    def _exchanged(self, start: Any, home: Any) -> dict[str, Any]:
        return {} if self.points else {"body": self.other}

    @model_validator(mode="after")
    def _complete(self) -> Self:
        found = []
        if self.law == "complementarity":
            found += [
                (name, "does not apply to a rigid contact; use law 'soft' or 'penalty'")
                for name in ("stiffness", "damping")
                if getattr(self, name) is not None
            ]
        if self.law == "soft" and self.damping is not None and self.restitution is not None:
            text = "damping also determines the restitution; give one of the two"
            found.append(("restitution", text))
        if isinstance(self.friction, str):
            if self.static_friction is not None:
                text = "needs a friction that is a number, not an expression"
                found.append(("static_friction", f"{text}, got {shown(self.friction)}"))
        elif self.friction is not None and self.static_friction is not None:
            found += below_kinetic("static_friction", self.static_friction, self.friction)
        if self.body == EVERY and self.points:
            found.append(("points", "belong to one body; name it instead of '*' (every body)"))
        refuse(found)
        return self
