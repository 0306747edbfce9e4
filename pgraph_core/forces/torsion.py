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
from ..fields import Expression, NotNegative, Number, Vec3, field, maybe_vector, refuse_no_direction
from ..rotation import normals_of, unit_vector
from ..units import RAD, J, S
from .base import KIND, Array, Load, Places, Sprung, number_or_law, pack_rates, rates_of, row


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


def pack(f: Torsion, one: Any, at: Places) -> Array | None:
    """Write the axis, stiffness, damping and rest angle."""
    axis = at.home(f.body) @ unit_vector(f.axis or (0.0, 0.0, 1.0))
    one["axis"] = axis
    # at q = 0 all rows have the world's axes
    one["reference_a"] = one["reference_b"] = normals_of(axis)[0]
    one["rest"] = f.rest
    return pack_rates(f, one)


@part
def twist(one, work):
    """Return (angle of A from rest about its axis, within ±π, gradient of the angle).

    The angle leads from B's reference to A's, seen along the axis. Its gradient is the axis
    while both share it; elsewhere it makes the torque the slope of ½ k angle².
    """
    turn_a = rotation_of(work, one.row_a)
    h = mul(turn_a, xyz(one.axis))
    mine = mul(turn_a, xyz(one.reference_a))
    other = mul(rotation_of(work, one.row_b), xyz(one.reference_b))
    n = cross(other, mine)
    y = dot(h, n)
    x = dot(other, mine)
    angle = atan2(y, x) - one.rest
    angle -= 2.0 * math.pi * math.floor(angle / (2.0 * math.pi) + 0.5)
    across = add(add(cross(h, n), scale(x, h)), scale(-dot(h, mine), other))
    slope = scale(1.0 / (x * x + y * y), add_scaled(scale(x, across), y, n))
    return angle, slope


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
    axis=(REAL, 3),  # axes of A
    reference_a=(REAL, 3),  # perpendicular to it: where the angle is measured
    reference_b=(REAL, 3),
    stiffness=REAL,  # [N m/rad]
    damping=REAL,  # [N m s/rad]
    rest=REAL,  # [rad]
)
LOAD = Load(Torsion, ROW, pack, law, energy, columns=len(Torsion.VARIES))
