"""Constraints between two bodies, or a body and the ground, in addition to the joints of the tree.

There is one class per kind; `Constraint(kind=...)` creates them as well. `_blocks` makes a kind's
rows for the kernels of points and directions in body axes (`packing.constraints.Endpoints`).
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from typing import Any, ClassVar, Literal, Self

import numpy as np
from pydantic import model_validator

from ..fields import (
    GROUND,
    AtPoint,
    Flag,
    Number,
    OfKinds,
    Text,
    Vec3,
    WithOther,
    along,
    field,
    maybe_vector,
    refuse,
    refuse_no_direction,
    vector,
)
from ..rotation import normals_of, unit_vector
from ..shapes import kind_of
from ..tolerances import NOTABLE
from ..units import M
from .poses import poses

KIND = (
    "one of point, weld, revolute, prismatic, cylindrical, universal, distance, line, curve_point, "
    "plane, orientation, gear, relation, cam, motion, rolling, skate, velocity, coupling, rope"
)


class Constraint(OfKinds):
    """A constraint on `body` relative to another body or the ground. See the class for each kind.

    The kinds: Point, Weld, Revolute, Prismatic, Cylindrical, Universal, Distance, Line, CurvePoint,
    Plane, Orientation, Gear, Relation, Cam, Motion, Rolling, Skate, Velocity, Coupling, Rope.
    """

    KINDS: ClassVar[dict[str, type[OfKinds]]] = {}
    WORD: ClassVar[str] = "constraint"
    ROWS: ClassVar[int] = 0  # number of scalar equations of the kind
    NOTHING: ClassVar[Mapping[str, Any]] = {"other": GROUND}
    # (endpoints) -> the blocks of rows. Raises ModelError if the initial state contradicts them
    _blocks: ClassVar[Callable[..., list[Any]]]

    name: Text = field("a non-empty string", label="Name")
    kind: Text = field(KIND, label="Kind")
    body: Text = field("the name of a body", label="Body")
    active: Flag = field("true or false", default=True)

    def __init__(self, /, **data: Any):
        """Create a constraint of the given kind. Raises ModelError."""
        super().__init__(**data)

    def pulls(self, bodies: Mapping[str, Any]) -> bool:
        """Return False if its wrench on `bodies`, by name or None, never has a force."""
        return True

    def onto(self, bodies: Any) -> None:
        """Apply its wrench to `bodies`, which have a method for each way in which it acts."""
        bodies.at_point(self)


# -- between places of bodies ----------------------------------------------------------------------


class ToOther(WithOther, Constraint):
    """A constraint between `body` and `other`."""


class AtPoints(AtPoint, ToOther):
    """A constraint between a point on `body` and a point on `other`."""

    other_point: Vec3 | None = field(
        "three finite numbers in the axes of `other` [m]; default: the initial position "
        "of `point`",
        converter=maybe_vector, default=None, dim=M, role="point",
        help="in the axes of the second body; default: the initial position of the point",
    )  # fmt: skip

    def _exchanged(self, start: Any, home: Any) -> dict[str, Any]:
        point = self.other_point
        if point is None and self.point is not None:
            point = along(start.rotation, self.point - start.position)
        return {"point": point, "other_point": self.point}


class AlongAxes(AtPoints):
    """A constraint between points, and between a direction in `body` and one in `other`."""

    axis: Vec3 | None = field(
        "a nonzero vector [x, y, z] in the axes of `body`",
        converter=maybe_vector, default=None, role="direction",
        help="direction in body axes; default: as in the initial state",
    )  # fmt: skip
    other_axis: Vec3 | None = field(
        "a nonzero vector [x, y, z] in the axes of `other`",
        converter=maybe_vector, default=None, role="direction",
        help="direction in the axes of the second body; default: as in the initial state",
    )  # fmt: skip

    @model_validator(mode="after")
    def _directions(self) -> Self:
        refuse_no_direction(axis=self.axis, other_axis=self.other_axis)
        return self

    def _exchanged(self, start: Any, home: Any) -> dict[str, Any]:
        given = self.axis or (None if self.other_axis else (0.0, 0.0, 1.0))
        axes = {"axis": self.other_axis, "other_axis": given}
        return {**super()._exchanged(start, home), **axes}


class Point(AtPoints):
    """A constraint that keeps `point` on `body` at `other_point` on `other`."""

    ROWS: ClassVar[int] = 3
    ABOUT: ClassVar[str] = "keeps two points together: 3 rows"
    kind: Literal["point"] = field(KIND, default="point")

    def _blocks(self, e: Any) -> list[Any]:
        return [e.pinned()]


class Weld(AtPoints):
    """A constraint that fixes the position and orientation of `body` relative to `other`."""

    ROWS: ClassVar[int] = 6
    ABOUT: ClassVar[str] = "locks point and orientation, as a rigid joint: 6 rows"
    kind: Literal["weld"] = field(KIND, default="weld")

    def _blocks(self, e: Any) -> list[Any]:
        return [e.pinned(), e.turned_as_at_home()]


class AlongOne(AlongAxes):
    """A constraint of parallel directions, which begins along the axis of a joint."""

    @classmethod
    def begun(cls, model: Any, body: str, other: str) -> dict[str, Any]:
        for axis, name in (("axis", body), ("other_axis", other)):
            if name != GROUND and model.body(name).dof == 1 and (axes := model.body(name).axes):
                return {axis: axes[0]}
        return {}


class Revolute(AlongOne):
    """A hinge. The points coincide, and `axis` stays parallel to `other_axis`."""

    ROWS: ClassVar[int] = 5
    ABOUT: ClassVar[str] = "a hinge: point, and one axis along the other: 5 rows"
    kind: Literal["revolute"] = field(KIND, default="revolute")

    def _blocks(self, e: Any) -> list[Any]:
        axis, other = e.directions()
        return [e.pinned(), e.aligned(axis, normals_of(other))]


class Prismatic(AlongOne):
    """A slider. The orientation is fixed, and `point` stays on the line along `other_axis`."""

    ROWS: ClassVar[int] = 5
    ABOUT: ClassVar[str] = "a slider: orientation, and the point on a line: 5 rows"
    kind: Literal["prismatic"] = field(KIND, default="prismatic")

    def _blocks(self, e: Any) -> list[Any]:
        axis, other = e.directions()
        apart = float(np.arccos(np.clip(abs(other @ e.turn @ axis), 0.0, 1.0)))
        if apart > NOTABLE:
            text = (
                "a prismatic constraint keeps the orientation of the initial state, in which axis "
                f"and other_axis are {apart:.3g} rad apart; leave one of them out"
            )
            raise e.refuse("other_axis", text)
        return [e.turned_as_at_home(), e.held(normals_of(other))]


class Cylindrical(AlongOne):
    """A constraint that keeps `axis` parallel to `other_axis` and `point` on that line."""

    ROWS: ClassVar[int] = 4
    ABOUT: ClassVar[str] = "slides and turns: one axis along the other: 4 rows"
    kind: Literal["cylindrical"] = field(KIND, default="cylindrical")

    def _blocks(self, e: Any) -> list[Any]:
        axis, other = e.directions()
        normals = normals_of(other)
        return [e.aligned(axis, normals), e.held(normals)]


class Universal(AlongAxes):
    """A universal joint. The points coincide, and `axis` stays normal to `other_axis`."""

    ROWS: ClassVar[int] = 4
    ABOUT: ClassVar[str] = "point, and two axes at a right angle: 4 rows"
    kind: Literal["universal"] = field(KIND, default="universal")

    @model_validator(mode="after")
    def _both_or_none(self) -> Self:
        if (self.axis is None) != (self.other_axis is None):
            missing = "axis" if self.axis is None else "other_axis"
            refuse([(missing, "a universal constraint takes both axis and other_axis, or none")])
        return self

    def _exchanged(self, start: Any, home: Any) -> dict[str, Any]:
        found = super()._exchanged(start, home)
        if self.axis is None:
            x, y = (1.0, 0.0, 0.0), (0.0, 1.0, 0.0)
            found |= {"axis": along(start.rotation, x), "other_axis": y}
        return found

    def _blocks(self, e: Any) -> list[Any]:
        if self.axis is None:  # like the joint: about x of `other`, then about y of `body`
            axis, other = np.eye(3)[1], e.turn @ np.eye(3)[0]
        else:
            axis, other = e.directions()
        return [e.pinned(), e.aligned(axis, [other])]


class Distance(AtPoints):
    """A massless rod that keeps the points `length` apart."""

    ROWS: ClassVar[int] = 1
    ABOUT: ClassVar[str] = "a massless rod: two points a length apart: 1 row"
    NEW: ClassVar[Mapping[str, Any]] = {"other_point": (0.0, 0.0, 0.0)}
    kind: Literal["distance"] = field(KIND, default="distance")
    other_point: Vec3 = field(
        "three finite numbers in the axes of `other` [m]",
        converter=vector, dim=M, role="point", help="in the axes of the second body",
    )  # fmt: skip
    length: Number | None = field(
        "a length > 0 [m]; default: as in the initial state",
        default=None, gt=0, dim=M, help="length of the rod; default: as in the initial state",
    )  # fmt: skip

    def _exchanged(self, start: Any, home: Any) -> dict[str, Any]:
        return {"point": self.other_point, "other_point": self.point or (0.0, 0.0, 0.0)}

    def _blocks(self, e: Any) -> list[Any]:
        length = float(np.linalg.norm(e.apart())) if self.length is None else self.length
        if length <= 1e-12 * e.size:
            text = "the two points coincide in the initial state; give a length > 0 [m]"
            raise e.refuse("length", f"{text}, or use kind 'point'")
        return [e.rod(length)]


class OneDirection(AlongAxes):
    """A constraint for which only one of two directions is given."""

    OF: ClassVar[str] = ""

    def _exchanged(self, start: Any, home: Any) -> dict[str, Any]:
        return {}  # the line or plane is that of `other`

    @model_validator(mode="after")
    def _one_direction(self) -> Self:
        if (self.axis is None) == (self.other_axis is None):
            text = f"a {self.kind} constraint takes one direction {self.OF}: other_axis in the axes"
            refuse([("other_axis", f"{text} of `other`, or axis in those of `body`")])
        return self


class Line(OneDirection):
    """A constraint that keeps `point` on the line through `other_point` along the direction."""

    ROWS: ClassVar[int] = 2
    ABOUT: ClassVar[str] = "the point stays on a line: 2 rows"
    OF: ClassVar[str] = "along the line"
    kind: Literal["line"] = field(KIND, default="line")

    @classmethod
    def begun(cls, model: Any, body: str, other: str) -> dict[str, Any]:
        """Return the axis of `other` nearest to the way from its origin to the tip of `body`.

        A slider moves along it, as its first arm turns about that origin. The default is upwards.
        """
        found = poses(model.standing)
        tip, origin = found[body].place(model.body(body).tip_point), found[other]
        way = np.abs(origin.rotation.T @ (np.asarray(tip) - origin.position))
        k = int(np.argmax(way)) if way.any() else "xyz".index(model.up)
        return {"other_axis": tuple(float(i == k) for i in range(3))}

    def _blocks(self, e: Any) -> list[Any]:
        return [e.held(normals_of(e.directions()[1]))]


class Plane(OneDirection):
    """A constraint that keeps `point` on the plane through `other_point` across `direction`."""

    ROWS: ClassVar[int] = 1
    ABOUT: ClassVar[str] = "the point stays on a plane: 1 row"
    OF: ClassVar[str] = "normal to the plane"
    kind: Literal["plane"] = field(KIND, default="plane")

    @classmethod
    def begun(cls, model: Any, body: str, other: str) -> dict[str, Any]:
        return {"other_axis": tuple(float(axis == model.up) for axis in "xyz")}

    def _blocks(self, e: Any) -> list[Any]:
        return [e.held([e.directions()[1]])]


class Orientation(ToOther):
    """A constraint that keeps the initial orientation of `body` relative to `other`."""

    ROWS: ClassVar[int] = 3
    ABOUT: ClassVar[str] = "the orientation is fixed, the position is free: 3 rows"
    kind: Literal["orientation"] = field(KIND, default="orientation")

    def _exchanged(self, start: Any, home: Any) -> dict[str, Any]:
        return {"body": self.other}

    def pulls(self, bodies: Mapping[str, Any]) -> bool:
        return False

    def _blocks(self, e: Any) -> list[Any]:
        return [e.turned_as_at_home()]


# -- velocities of places --------------------------------------------------------------------------


class Rolling(AlongAxes):
    """A sphere, or a disc if `axis` is given, that rolls on a plane without slip."""

    ROWS: ClassVar[int] = 3
    ABOUT: ClassVar[str] = "a sphere or disc rolls without slip (nonholonomic)"
    kind: Literal["rolling"] = field(KIND, default="rolling")
    radius: Number | None = field(
        "a radius > 0 [m]; default: that of the body's shape",
        default=None, gt=0, dim=M, help="default: radius of the body's shape",
    )  # fmt: skip

    @classmethod
    def begun(cls, model: Any, body: str, other: str) -> dict[str, Any]:
        shape = model.body(body).shape
        return {} if shape is not None and kind_of(shape).rolls == "sphere" else {"radius": 0.1}

    def _exchanged(self, start: Any, home: Any) -> dict[str, Any]:
        return {}

    def _blocks(self, e: Any) -> list[Any]:
        normal = e.ground_normal if self.other_axis is None else unit_vector(self.other_axis)
        shape = e.model.body(self.body).shape
        radius = self.radius if self.radius is not None else shape.radius if shape else None
        axis = None if self.axis is None else unit_vector(self.axis)
        return [e.rolling(radius or 0.0, [normal, *normals_of(normal)], axis)]


class Skate(AtPoint, ToOther):
    """A blade on `body`. The velocity of `point` along `axis`, across the blade, is zero."""

    ROWS: ClassVar[int] = 1
    ABOUT: ClassVar[str] = "no velocity across a blade (nonholonomic)"
    NEW: ClassVar[Mapping[str, Any]] = {"axis": (0.0, 1.0, 0.0)}

    kind: Literal["skate"] = field(KIND, default="skate")
    axis: Vec3 = field(
        "a nonzero vector [x, y, z] in the axes of `body`",
        converter=vector, role="direction",
        help="direction across the blade, in body axes",
    )  # fmt: skip

    @model_validator(mode="after")
    def _directions(self) -> Self:
        refuse_no_direction(axis=self.axis)
        return self

    def _blocks(self, e: Any) -> list[Any]:
        return [e.blade(unit_vector(self.axis))]
