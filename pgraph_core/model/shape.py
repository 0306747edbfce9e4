"""Body shapes, and the mass properties of homogeneous bodies with these shapes."""

from __future__ import annotations

import math
import re
from collections.abc import Callable, Mapping, Sequence
from typing import Annotated, Any, Literal, NamedTuple, Self

import numpy as np
import numpy.typing as npt
from pydantic import BeforeValidator, model_validator

from ..errors import ModelError, Problem, shown
from ..fields import (
    Finite,
    Frozen,
    Number,
    Quat,
    Row3,
    Text,
    Vec3,
    field,
    listed,
    maybe_vector,
    quaternion,
    refuse,
    vector,
)
from ..rotation import matrix
from ..shapes import KINDS, SIZES, ShapeKind
from ..shapes.contract import Kind
from ..units import NONE, RAD, M, S

Array = np.ndarray


HEX = re.compile("#[0-9a-fA-F]{6}")


def _colour(value: Any) -> Any:
    """Convert '#rrggbb' to three numbers from 0 to 1."""
    if isinstance(value, str) and HEX.fullmatch(value):
        return tuple(int(value[k : k + 2], 16) / 255 for k in (1, 3, 5))
    return listed(value)


Colour = Annotated[Row3, BeforeValidator(_colour)]


_colour_in: Callable[[npt.ArrayLike | None], Colour | None] = _colour
_scale_in: Callable[[npt.ArrayLike], Number | Vec3] = listed
Heights = Annotated[tuple[tuple[Finite, ...], ...], BeforeValidator(listed)]


_heights_in: Callable[[npt.ArrayLike | None], Heights | None] = listed


class Shape(Frozen):
    """A solid in the body's frame [m], which may be drawn, collide with others, or both."""

    kind: ShapeKind = field(f"one of {', '.join(KINDS)}")
    size: Vec3 | None = field(
        "the three edge lengths of a box [m]; of a heightfield along x and y, and how far its "
        "solid reaches below its lowest height",
        converter=maybe_vector, default=None, label="Edges", dim=M,
    )  # fmt: skip
    radius: Number | None = field("a radius > 0 [m]", default=None, gt=0, dim=M)
    radii: Vec3 | None = field(
        "the three half axes of an ellipsoid [m]",
        converter=maybe_vector, default=None, label="Half axes", dim=M,
    )  # fmt: skip
    heights: Heights | None = field(
        "rows of heights of a heightfield [m], finite numbers, all rows equally long: "
        "heights[i][j] is at place i along x and j along y",
        converter=_heights_in, default=None, dim=M,
    )  # fmt: skip
    length: Number | None = field(
        "a length > 0 along z [m], a capsule's without its caps",
        default=None, gt=0, dim=M,
    )  # fmt: skip
    end_radius: Number | None = field(
        "a radius >= 0 [m] at the far end (+z) of a cylinder, 0 for a cone, or of a capsule that "
        "is only drawn",
        default=None, ge=0, dim=M, help="radius at the far end, if tapered",
    )  # fmt: skip
    file: Text | None = field("the name of a mesh file", default=None)
    scale: Number | Vec3 = field(
        "a scale factor > 0 of the mesh, or three nonzero factors, one per axis",
        converter=_scale_in, default=1.0, dim=NONE,
    )  # fmt: skip
    hull: Literal["convex", "parts"] | None = field(
        "'convex': a mesh touches by its convex hull, closed or not; 'parts': by several convex "
        "parts that together are about the mesh",
        default=None,
    )  # fmt: skip
    position: Vec3 = field(
        "three finite numbers [x, y, z] [m]",
        converter=vector, default=(0.0, 0.0, 0.0), dim=M, role="point",
    )  # fmt: skip
    rotation: Quat = field(
        "a quaternion [w, x, y, z]",
        converter=quaternion, default=(1.0, 0.0, 0.0, 0.0), label="Orientation", role="frame",
    )  # fmt: skip

    role: Literal["visual", "collision", "both"] = field(
        "'visual': drawn, 'collision': touches, or 'both'",
        default="both",
        since=2,
        help="use of the shape",
    )
    colour: Colour | None = field(
        "three numbers [red, green, blue] from 0 to 1, or '#rrggbb'",
        converter=_colour_in, default=None, dim=NONE, since=2,
        help="#rrggbb; default: the colour of the branch",
    )  # fmt: skip
    opacity: Number = field(
        "a number from 0 to 1", default=1.0, dim=NONE, since=2, ge=0, le=1,
        help="from 0 (invisible) to 1 (opaque)",
    )  # fmt: skip
    surface_velocity: Vec3 = field(
        "three finite numbers [m/s], in the axes of the shape: velocity of its surface relative to "
        "the body",
        converter=vector, default=(0.0, 0.0, 0.0), dim=M / S, role="vector", since=7,
        label="Surface",
        help="surface velocity relative to the body, for example of a belt",
    )  # fmt: skip
    surface_spin: Vec3 = field(
        "three finite numbers [rad/s], in the axes of the shape: spin of its surface relative to "
        "the body, about the origin of the shape",
        converter=vector, default=(0.0, 0.0, 0.0), dim=RAD / S, role="axial", since=7,
        label="Spin",
        help="surface rotation about the shape origin, for example of a turntable",
    )  # fmt: skip

    @model_validator(mode="before")
    @classmethod
    def _of_its_kind(cls, data: Any) -> Any:
        """Reject dimensions that belong to other kinds before checking their values."""
        name = data.get("kind") if type(data) is dict or isinstance(data, Mapping) else None
        if isinstance(name, str) and name in KINDS:
            kind, data = KINDS[name], KINDS[name].read(data)
            if not data.keys().isdisjoint(FOREIGN[name]):
                own = " and ".join(kind.needs)
                refuse([
                    ("shape", f"{kind.one} has no {f}: give {own}{_doubled(kind, f, data[f])}, "
                    f"got {f} {shown(data[f])}")
                    for f in FOREIGN[name]
                    if data.get(f) is not None
                ])  # fmt: skip
        return data

    @model_validator(mode="after")
    def _complete(self) -> Self:
        own = vars(self)  # faster than descriptors for thousands of shapes
        kind = KINDS[own["kind"]]
        problems = [(name, f"{kind.one} needs {name}") for name in kind.needs if own[name] is None]
        size, radii, scale, colour = own["size"], own["radii"], own["scale"], own["colour"]
        if size is not None and min(size) <= 0:
            text = f"a {self.kind}'s edges must be > 0 [m], got {shown(size)}"
            problems.append(("shape", text))
        if radii is not None and min(radii) <= 0:
            text = f"the radii of an ellipsoid must be > 0 [m], got {shown(radii)}"
            problems.append(("shape", text))
        problems += [("shape", text) for text in kind.problems(self)]
        if not (all(scale) if isinstance(scale, tuple) else scale > 0):
            text = f"scale must be > 0, or three factors that are not 0, got {shown(scale)}"
            problems.append(("shape", text))
        if not 0.5 < math.hypot(*own["rotation"]) < 2:
            given = shown(self.rotation)
            problems.append(("shape", f"rotation must be a unit quaternion, got {given}"))
        if colour is not None and not 0 <= min(colour) <= max(colour) <= 1:
            given = shown(colour)
            problems.append(("shape", f"colour must be from 0 to 1, got {given}"))
        refuse(problems)
        return self

    @property
    def moves(self) -> bool:
        """True if the surface moves relative to the body."""
        return any(self.surface_velocity) or any(self.surface_spin)


FOREIGN = {  # kind -> the fields that say how large others are
    name: sorted(set(SIZES) - {*kind.needs, *kind.may}) for name, kind in KINDS.items()
}


def _doubled(kind: Kind, name: str, value: Any) -> str:
    """Return the fields of a cylinder or a capsule for its size in MuJoCo, or ""."""
    given: Any = listed(value)
    pair = name == "size" and "length" in kind.needs and isinstance(given, tuple)
    if not pair or len(given) != 2 or not all(isinstance(x, (int, float)) for x in given):
        return ""
    return f", for MuJoCo's radius and half length radius={given[0]:g}, length={2 * given[1]:g}"


class MassProperties(NamedTuple):
    """The mass properties of a rigid body in its own frame."""

    mass: float  # [kg]
    com: Array  # (3,) [m]
    inertia: Array  # (3, 3) about the centre of mass, in body axes [kg m^2]


def mass_properties(shape: Shape, density: float, unit: str = "m") -> MassProperties:
    """Return the mass properties of a homogeneous shape with `density` [kg/m^3].

    A mesh must be closed, and `unit` is the unit of its file. Raises ModelError, FileError.
    """
    if not 0 < density < math.inf:
        raise ModelError(
            Problem("shape", "density", f"must be a number > 0 [kg/m^3], got {density}")
        )
    volume, middle, second = KINDS[shape.kind].volume(shape, unit)
    turn = matrix(shape.rotation)
    com = np.array(shape.position) + turn @ middle
    return MassProperties(density * volume, com, density * turn @ second @ turn.T)


def solids_of(shapes: Sequence[Shape]) -> Sequence[Shape]:
    """Return the shapes that have mass: the contact shapes if any, otherwise all shapes."""
    return [s for s in shapes if s.role != "visual"] or shapes


def mass_properties_of(shapes: Sequence[Shape], density: float) -> MassProperties:
    """Return the mass properties of several homogeneous shapes. Overlaps count twice.

    Raises ModelError, FileError.
    """
    parts = [mass_properties(shape, density) for shape in solids_of(shapes)]
    mass = sum(part.mass for part in parts)
    com = np.array(sum(part.mass * part.com for part in parts)) / mass
    inertia = np.zeros((3, 3))
    for part in parts:
        r = part.com - com
        inertia += part.inertia + part.mass * (r @ r * np.eye(3) - np.outer(r, r))
    return MassProperties(mass, com, inertia)


def tip_of(shapes: Sequence[Shape]) -> Vec3:
    """Return the far end of the shapes' bounding box along its longest edge [m]."""
    corners = np.concatenate([corners_of(shape) for shape in solids_of(shapes)])
    low, high = corners.min(axis=0), corners.max(axis=0)
    k = int(np.argmax(high - low))
    tip = (low + high) / 2
    tip[k] = high[k] if abs(high[k]) >= abs(low[k]) else low[k]
    x, y, z = tip.tolist()
    return (x, y, z)


def corners_of(shape: Shape) -> Array:
    """Return (n, 3) points in body axes whose bounding box tightly encloses the shape."""
    points = KINDS[shape.kind].corners(shape)
    return np.array(shape.position) + points @ matrix(shape.rotation).T
