"""A bushing: a 6 by 6 stiffness and damping between two frames, such as a rubber mount."""

from __future__ import annotations

import math
from collections.abc import Callable
from typing import Annotated, Any, ClassVar, Literal, Self

import numpy as np
import numpy.typing as npt
from pydantic import BeforeValidator, model_validator

from ..engine.compiler.elementary import atan2
from ..engine.compiler.jit import part
from ..engine.records import REAL
from ..engine.rows import point_of, point_velocity, rotation_of, spin_of
from ..engine.vec import add, add_scaled, cross, dot, mat_mul, matrix, mul, mul_t, scale, sub, xyz
from ..errors import shown
from ..fields import AtPoint, Finite, Quat, Vec3, field, listed, maybe_vector, quaternion, refuse
from ..rotation import matrix as turn_of
from ..rotation import unit
from ..tolerances import EPS, TINY
from ..units import M, N, S
from .base import KIND, Between, Load, Places, on_pair, row

Row6 = tuple[Finite, Finite, Finite, Finite, Finite, Finite]


def _square(value: Any) -> Any:
    """Return a 6 by 6 matrix. A list of six numbers is used as the diagonal."""
    value = listed(value)
    flat = isinstance(value, tuple) and not any(isinstance(x, tuple) for x in value)
    if flat and len(value) == 6:
        return tuple(tuple(x if i == k else 0.0 for k in range(6)) for i, x in enumerate(value))
    return value


Mat6 = Annotated[tuple[Row6, Row6, Row6, Row6, Row6, Row6], BeforeValidator(_square)]
NOTHING: Mat6 = ((0.0,) * 6,) * 6  # type: ignore[assignment]


square: Callable[[npt.ArrayLike], Mat6] = _square


class Bushing(AtPoint, Between):
    """A rubber element between a frame on `body` and one on `other`.

    The deformation e consists of the displacement and the rotation vector of the frame on `body`,
    in the axes of the frame on `other`. The force and torque are the gradient of the energy e K e /
    2, for rotations of less than half a turn. In addition, there is a damping force proportional to
    the relative linear and angular velocity, in the same axes.
    """

    ABOUT: ClassVar[str] = "a bushing: springs and dampers along and about three axes"
    SCALES: ClassVar[tuple[str, ...]] = ("stiffness", "damping")
    SINCE: ClassVar[int] = 5
    NEW: ClassVar[dict[str, Any]] = {"stiffness": (1e5,) * 3 + (100.0,) * 3}

    kind: Literal["bushing"] = field(KIND, default="bushing")
    rotation: Quat = field(
        "a nonzero quaternion [w, x, y, z] in the axes of `body`",
        converter=quaternion, default=(1.0, 0.0, 0.0, 0.0), role="frame",
    )  # fmt: skip
    other_point: Vec3 | None = field(
        "three finite numbers in the axes of `other` [m]; default: the initial position of `point`",
        converter=maybe_vector, default=None, dim=M, role="point",
        help="in the axes of the second body; default: the initial position of the point",
    )  # fmt: skip
    other_rotation: Quat | None = field(
        "a nonzero quaternion [w, x, y, z] in the axes of `other`; default: as in the "
        "initial state",
        default=None, role="frame",
        help="orientation in the axes of the second body; default: as in the initial state",
    )  # fmt: skip
    stiffness: Mat6 = field(
        "six numbers >= 0, along and about x, y, z, or a symmetric 6x6 matrix without negative "
        "eigenvalues [N/m, N/rad, N m/rad]",
        converter=square, default=NOTHING, dim=N / M, role="screw",
        help="along and about x, y, z: N/m, N m/rad",
    )  # fmt: skip
    damping: Mat6 = field(
        "six numbers >= 0, along and about x, y, z, or a symmetric 6x6 matrix without negative "
        "eigenvalues [N s/m, N s/rad, N m s/rad]",
        converter=square, default=NOTHING, dim=N * S / M, role="screw",
        help="along and about x, y, z: N s/m, N m s/rad",
    )  # fmt: skip

    @property
    def _exerts(self) -> bool:
        return bool(np.any(self.stiffness) or np.any(self.damping))

    @model_validator(mode="after")
    def _passive(self) -> Self:
        found = []
        for name in ("stiffness", "damping"):
            given = np.array(getattr(self, name))
            if not np.array_equal(given, given.T):
                found.append((name, f"must be symmetric, got {shown(getattr(self, name))}"))
            elif (least := np.linalg.eigvalsh(given)[0]) < -6 * EPS * np.abs(given).max():
                found.append((name, f"must have no eigenvalue below 0; it has {least:.3g}"))
        for name in ("rotation", "other_rotation"):
            if (q := getattr(self, name)) is not None and not any(q):
                found.append((name, "a quaternion must not be zero"))
        refuse(found)
        return self


def pack(f: Bushing, one: Any, at: Places) -> None:
    """Write both frames, in the home axes of their rows, and the two matrices."""
    point = at.body(f.body).tip_point if f.point is None else f.point
    own = turn_of(unit(f.rotation))
    other, turn = f.other_point, at.turn_at_start(f.other)
    if other is None:
        other = turn.T @ (at.at_start(f.body, point) - at.at_start(f.other, (0.0, 0.0, 0.0)))
    axes = turn.T @ at.turn_at_start(f.body) @ own
    if f.other_rotation is not None:
        axes = turn_of(unit(f.other_rotation))
    one["point_a"], one["point_b"] = at.in_row(f.body, point), at.in_row(f.other, other)
    one["axes_a"] = (at.home(f.body) @ own).ravel()
    one["axes_b"] = (at.home(f.other) @ axes).ravel()
    one["stiffness"], one["damping"] = np.ravel(f.stiffness), np.ravel(f.damping)


@part
def row_times(k, i, x, y):
    """Multiply row i of a 6 by 6 matrix by (x, y)."""
    of_x = k[6 * i] * x[0] + k[6 * i + 1] * x[1] + k[6 * i + 2] * x[2]
    return of_x + k[6 * i + 3] * y[0] + k[6 * i + 4] * y[1] + k[6 * i + 5] * y[2]


@part
def times(k, x, y):
    """Multiply a 6 by 6 matrix by (x, y), and return two vectors."""
    first = (row_times(k, 0, x, y), row_times(k, 1, x, y), row_times(k, 2, x, y))
    return first, (row_times(k, 3, x, y), row_times(k, 4, x, y), row_times(k, 5, x, y))


@part
def displaced(one, work):
    """Return (p, axes of B's frame in the world, displacement and rotation vector in them, n, θ /
    tan).

    The rotation vector is θ n. The last number is (θ / 2) / tan(θ / 2), of the slope of θ n.
    """
    p = point_of(xyz(one.point_a), work, one.row_a)
    end = point_of(xyz(one.point_b), work, one.row_b)
    axes = mat_mul(rotation_of(work, one.row_b), matrix(one.axes_b))
    mine = mat_mul(rotation_of(work, one.row_a), matrix(one.axes_a))
    x = mul_t(axes, (mine[0], mine[3], mine[6]))
    y = mul_t(axes, (mine[1], mine[4], mine[7]))
    z = mul_t(axes, (mine[2], mine[5], mine[8]))
    twice = (y[2] - z[1], z[0] - x[2], x[1] - y[0])  # 2 sin θ n
    s = math.sqrt(dot(twice, twice) + TINY)
    c = x[0] + y[1] + z[2] - 1.0  # 2 cos θ
    angle = atan2(s, c)
    n = scale(1.0 / s, twice)
    return p, axes, mul_t(axes, sub(p, end)), scale(angle, n), n, 0.5 * angle * (2.0 + c) / s


@part
def law(one, knots, work, linear, t):
    """Compute the elastic force from the energy gradient, plus the damping force."""
    a = one.row_a
    b = one.row_b
    p, axes, d, turn, n, share = displaced(one, work)
    force, slope = times(one.stiffness, d, turn)
    # the rotation vector follows the spin w by w - turn x w / 2 + (1 - share) n x (n x w)
    torque = add_scaled(slope, 0.5, cross(turn, slope))
    torque = add_scaled(torque, 1.0 - share, cross(n, cross(n, slope)))
    u = mul_t(axes, sub(point_velocity(work, linear, a, p), point_velocity(work, linear, b, p)))
    w = mul_t(axes, sub(spin_of(work, a), spin_of(work, b)))
    drag, swirl = times(one.damping, u, w)
    lost = dot(drag, u) + dot(swirl, w)
    force = mul(axes, scale(-1.0, add(force, drag)))
    torque = mul(axes, scale(-1.0, add(torque, swirl)))
    return p, torque, force, p, 0.0, lost


@part
def energy(one, knots, work):
    """Return the stored energy e K e / 2."""
    _, _, d, turn, _, _ = displaced(one, work)
    force, torque = times(one.stiffness, d, turn)
    return 0.5 * (dot(force, d) + dot(torque, turn))


ROW = row(
    point_a=(REAL, 3),
    point_b=(REAL, 3),
    axes_a=(REAL, 9),  # axes of both frames, row-major
    axes_b=(REAL, 9),
    stiffness=(REAL, 36),  # row-major, of displacements and then of turns
    damping=(REAL, 36),
)
LOAD = Load(Bushing, ROW, pack, on_pair(law, energy))
