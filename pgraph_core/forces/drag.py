"""Fluid drag on a box: Stokes and pressure drag, as in MuJoCo's inertia box model."""

from __future__ import annotations

import math
from typing import Any, ClassVar, Literal, Self

from pydantic import model_validator

from ..engine.compiler.jit import part
from ..engine.records import REAL
from ..engine.rows import point_of, point_velocity, rotation_of, spin_of
from ..engine.vec import dot, matrix, mul, mul_t, xyz
from ..errors import shown
from ..fields import Number, Quat, Vec3, field, maybe_vector, quaternion, refuse, vector
from ..rotation import matrix as turn_of
from ..rotation import unit
from ..units import KG, PA, M, S
from .base import KIND, Load, OnBody, Places, on_pair, row


class Drag(OnBody):
    """Viscous and pressure drag from a fluid at rest on a box fixed to `body`.

    The force along an edge a is -3 pi d viscosity u - density b c |u| u / 2, and the torque about
    it is -pi d^3 viscosity w - density a (b^4 + c^4) |w| w / 64. Here, d is the mean edge length,
    and u and w are the linear velocity of the centre and the angular velocity. This is equivalent
    to the fluid model of MuJoCo that is based on inertia boxes.
    """

    ABOUT: ClassVar[str] = "a fluid's drag on a box around the body"
    PASSIVE: ClassVar[bool] = True
    SINCE: ClassVar[int] = 3
    SCALES: ClassVar[tuple[str, ...]] = ("density", "viscosity")
    NEW: ClassVar[dict[str, Any]] = {"size": (0.1, 0.1, 0.1), "density": 1000.0}

    kind: Literal["drag"] = field(KIND, default="drag")
    size: Vec3 = field(
        "three edges > 0 of the box [m]", converter=vector, dim=M, help="edge lengths of the box"
    )
    density: Number = field("a number >= 0 [kg/m^3]", default=0.0, ge=0, dim=KG / M**3)
    viscosity: Number = field("a number >= 0 [Pa s]", default=0.0, ge=0, dim=PA * S)
    point: Vec3 | None = field(
        "three finite numbers in the axes of `body` [m]; default: its centre of mass",
        converter=maybe_vector, default=None, dim=M, role="point",
        help="centre of the box; default: the centre of mass",
    )  # fmt: skip
    rotation: Quat = field(
        "a nonzero quaternion [w, x, y, z] of the box in the axes of `body`",
        converter=quaternion, default=(1.0, 0.0, 0.0, 0.0), role="frame",
    )  # fmt: skip

    @model_validator(mode="after")
    def _box(self) -> Self:
        found = []
        if min(self.size) <= 0:
            found.append(("size", f"each edge must be > 0 [m], got {shown(self.size)}"))
        if not any(self.rotation):
            found.append(("rotation", "a quaternion must not be zero"))
        refuse(found)
        return self


def pack(f: Drag, one: Any, at: Places) -> None:
    """Write the box and the properties of the surrounding fluid."""
    point = at.body(f.body).com if f.point is None else f.point
    one["point_a"] = at.in_row(f.body, point)
    one["axes"] = (at.home(f.body) @ turn_of(unit(f.rotation))).ravel()
    one["box"], one["density"], one["viscosity"] = f.size, f.density, f.viscosity


@part
def drag_of(one, turn, spin, speed):
    """Return (torque, force) on a box with angular velocity `spin` and velocity `speed`."""
    x, y, z = xyz(one.box)
    mean = (x + y + z) / 3.0
    axes = matrix(one.axes)
    u = mul_t(axes, mul_t(turn, speed))
    w = mul_t(axes, mul_t(turn, spin))
    viscous = -3.0 * math.pi * mean * one.viscosity
    swirl = -math.pi * mean * mean * mean * one.viscosity
    press = -0.5 * one.density
    churn = -one.density / 64.0
    x4, y4, z4 = x * x * x * x, y * y * y * y, z * z * z * z
    force = (
        (viscous + press * y * z * abs(u[0])) * u[0],
        (viscous + press * z * x * abs(u[1])) * u[1],
        (viscous + press * x * y * abs(u[2])) * u[2],
    )
    torque = (
        (swirl + churn * x * (y4 + z4) * abs(w[0])) * w[0],
        (swirl + churn * y * (z4 + x4) * abs(w[1])) * w[1],
        (swirl + churn * z * (x4 + y4) * abs(w[2])) * w[2],
    )
    return mul(turn, mul(axes, torque)), mul(turn, mul(axes, force))


@part
def law(one, knots, work, linear, t):
    """Compute a drag opposing the velocity of the box's centre and its angular velocity."""
    a = one.row_a
    p = point_of(xyz(one.point_a), work, a)
    speed = point_velocity(work, linear, a, p)
    torque, force = drag_of(one, rotation_of(work, a), spin_of(work, a), speed)
    lost = -dot(torque, spin_of(work, a)) - dot(force, speed)
    return p, torque, force, p, 0.0, lost


def linear(table: Any) -> bool:
    """Check whether no load has pressure drag, which is quadratic in speed."""
    return not (table["density"] > 0).any()


ROW = row(
    point_a=(REAL, 3),  # middle of the box
    axes=(REAL, 9),  # directions of the box, row-major
    box=(REAL, 3),  # its edges [m]
    density=REAL,  # density of the fluid [kg/m³]
    viscosity=REAL,  # [Pa s]
)
LOAD = Load(Drag, ROW, pack, on_pair(law), linear=linear)
