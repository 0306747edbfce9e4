"""A torsion spring and damper that restores the angle between two bodies about an axis."""

from __future__ import annotations

import math
from typing import Any, ClassVar, Literal, Self

from pydantic import model_validator

from ..engine.compiler.elementary import atan2
from ..engine.compiler.jit import part
from ..engine.records import REAL
from ..engine.rows import origin_of, rotation_of, spin_of
from ..engine.vec import add, add_scaled, cross, dot, mul, scale, sub, xyz
from ..fields import (
    Expression,
    NotNegative,
    Number,
    Vec3,
    along,
    field,
    maybe_vector,
    refuse_no_direction,
)
from ..rotation import normals_of, unit_vector
from ..units import RAD, J, S
from .base import (
    KIND,
    Array,
    Load,
    Places,
    Sprung,
    number_or_law,
    on_pair,
    pack_rates,
    rates_of,
    row,
)


class Torsion(Sprung):
    """A torque -stiffness (angle - rest) - damping x rate on `body` about an `axis`."""

    ABOUT: ClassVar[str] = "a torsion spring between two bodies, with damper"
    NEW: ClassVar[dict[str, Any]] = {"stiffness": 1.0}

    kind: Literal["torsion"] = field(KIND, default="torsion")
    axis: Vec3 | None = field(
        "a nonzero vector [x, y, z] in the axes of `body`; default: z",
        converter=maybe_vector, default=None, role="axial",
        help="direction in body axes; default: z",
    )  # fmt: skip
    stiffness: NotNegative | Expression = field(
        "a number >= 0 [N m/rad], or an expression", converter=number_or_law, default=0.0,
        dim=J / RAD,
    )  # fmt: skip
    damping: NotNegative | Expression = field(
        "a number >= 0 [N m s/rad], or an expression", converter=number_or_law, default=0.0,
        dim=J * S / RAD,
    )  # fmt: skip
    rest: Number = field("the angle without torque [rad]", default=0.0, dim=RAD, help="rest angle")

    @model_validator(mode="after")
    def _axis_points_somewhere(self) -> Self:
        refuse_no_direction(axis=self.axis)
        return self

    def _exchanged(self, start: Any, home: Any) -> dict[str, Any]:
        return {"axis": along(-home, self.axis or (0.0, 0.0, 1.0))}


def pack(f: Torsion, one: Any, at: Places) -> Array | None:
    """Write two normals of the axis, the stiffness, the damping and the rest angle."""
    # at q = 0 all rows have the world's axes
    one["first"], one["second"] = normals_of(at.home(f.body) @ unit_vector(f.axis or (0, 0, 1)))
    one["rest"] = f.rest
    return pack_rates(f, one)


@part
def twist(one, work):
    """Return (angle of A relative to B about the axis minus rest, gradient of the angle).

    The angle is that of the twist if the rotation is split into a swing and a twist about the axis.
    It is within ±π. The sine and cosine are those of both normals, added.
    """
    turn_a, turn_b = rotation_of(work, one.row_a), rotation_of(work, one.row_b)
    a1, a2 = mul(turn_a, xyz(one.first)), mul(turn_a, xyz(one.second))
    b1, b2 = mul(turn_b, xyz(one.first)), mul(turn_b, xyz(one.second))
    sine, cosine = dot(a1, b2) - dot(a2, b1), dot(a1, b1) + dot(a2, b2)
    angle = atan2(sine, cosine) - one.rest
    angle -= 2.0 * math.pi * math.floor(angle / (2.0 * math.pi) + 0.5)
    of_sine = sub(cross(a1, b2), cross(a2, b1))
    of_cosine = add(cross(a1, b1), cross(a2, b2))
    slope = add_scaled(scale(cosine, of_sine), -sine, of_cosine)
    return angle, scale(1.0 / (sine * sine + cosine * cosine), slope)


@part
def law(one, knots, work, linear, t):
    """Compute the torque -stiffness angle - damping x rate along the angle's gradient."""
    angle, axis = twist(one, work)
    rate = dot(axis, sub(spin_of(work, one.row_a), spin_of(work, one.row_b)))
    stiffness, damping = rates_of(one, knots)
    elastic, damping = stiffness * angle, damping * rate
    put_in = 0.0 if one.knots == 0 else -elastic * rate
    torque = scale(-elastic - damping, axis)
    p = origin_of(work, one.row_a)
    return p, torque, (0.0, 0.0, 0.0), p, put_in, damping * rate


@part
def energy(one, knots, work):
    """Return the stored energy ½ stiffness angle²."""
    if one.knots > 0:
        return 0.0 * one.rest
    angle, _ = twist(one, work)
    return 0.5 * one.stiffness * angle * angle


ROW = row(
    first=(REAL, 3),  # unit normals of the axis, fixed in both bodies
    second=(REAL, 3),
    stiffness=REAL,  # [N m/rad]
    damping=REAL,  # [N m s/rad]
    rest=REAL,  # [rad]
)
LOAD = Load(Torsion, ROW, pack, on_pair(law, energy), columns=len(Torsion.VARIES))
