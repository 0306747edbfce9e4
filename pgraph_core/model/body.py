"""A row of the table, consisting of a body and the joint that connects it to its parent."""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping, Sequence
from functools import cached_property
from typing import TYPE_CHECKING, Annotated, Any, ClassVar, Literal, Self

import numpy as np
import numpy.typing as npt
from pydantic import BeforeValidator, model_validator

from .. import joints
from ..errors import PgraphError, shown
from ..fields import (
    EVERY,
    GROUND,
    Described,
    Flag,
    Mat3,
    Number,
    Once,
    PerMotion,
    Quat,
    Text,
    Vec3,
    Vec3s,
    field,
    inertia_matrix,
    listed,
    maybe_part_of,
    maybe_vector,
    name_problem,
    parts_of,
    per_motion,
    quaternion,
    refuse,
    vector,
    vectors,
)
from ..joints import (
    PER_MOTION,
    TRACKED,
    Finding,
    JointKind,
    Motion,
    MotionKind,
    joint_problems,
    physics_problems,
    track_problems,
)
from ..tolerances import NOTABLE
from ..tracks import Track
from ..units import KG, NONE, J, M, Q, S
from .inertia import inertia_problems
from .shape import Shape as Shape
from .shape import mass_properties_of, tip_of
from .short_forms import fill_motions, pick_joint

JOINT_FIELDS = ("axes", "motions", "q", "v", "limits", *PER_MOTION)  # whose lengths follow from it
OneShape = Annotated[Shape, Once]
Limit = Sequence[float | None] | None


Motions = tuple[tuple[MotionKind, Vec3], ...]
Limits = tuple[tuple[Number | None, Number | None] | None, ...]
_motions_in: Callable[[Sequence[tuple[str, npt.ArrayLike]]], Motions] = listed
_limits_in: Callable[[Limit | Sequence[Limit]], Limits] = listed
Derived = Literal["mass", "com", "inertia", "tip"]
POINT = ((0.0, 0.0, 0.0),) * 3  # inertia of a point mass


_derived_in: Callable[[Sequence[Derived]], tuple[Derived, ...]] = listed


def _parent_in(value: str | None) -> str:
    """Return "ground" if there is no parent."""
    return GROUND if value is None else value


Parent = Annotated[Text, BeforeValidator(_parent_in)]


class Body(Described):
    """A rigid body with its joint, in SI units and the frames defined in docs/conventions.md."""

    FOLLOWERS: ClassVar[Mapping[str, tuple[str, ...]]] = dict.fromkeys(
        ("joint", "dof", "axes", "motions"), JOINT_FIELDS
    )

    name: Text = field("a non-empty string", label="Name")
    parent: Parent = field(
        "the name of a body, or 'ground'", converter=_parent_in, default=GROUND, label="Parent"
    )
    joint: JointKind = field(
        "one of " + ", ".join(joints.DEFAULT) + ", or give dof 0 to 6",
        default="revolute",
        help="joint to the parent",
    )
    axes: Vec3s = field(
        "one direction [x, y, z] per motion, in the body's axes at q = 0",
        converter=vectors, default=(), role="joint", label="Axis",
        help="direction in the body's axes at q = 0; any length",
    )  # fmt: skip
    motions: tuple[tuple[MotionKind, Vec3], ...] = field(
        f"({' | '.join(repr(kind) for kind in joints.COMBINED)}, [x, y, z]) pairs "
        "of a compound joint",
        converter=_motions_in, default=(), role="joint",
    )  # fmt: skip
    link: Vec3 = field(
        "three finite numbers [x, y, z] from the parent's origin [m]",
        converter=vector, default=(0.0, 0.0, 0.0), label="Link vector", dim=M, role="point",
        help="position of the body origin relative to the parent, in parent axes at q = 0",
    )  # fmt: skip
    rotation: Quat = field(
        "a unit quaternion [w, x, y, z] in the parent's axes",
        converter=quaternion, default=(1.0, 0.0, 0.0, 0.0), label="Orientation", role="frame",
        help="orientation relative to the parent at q = 0",
    )  # fmt: skip
    mass: Number = field(
        "a finite number >= 0 [kg]", default=1.0, ge=0, dim=KG, help="mass of the body"
    )
    com: Vec3 = field(
        "three finite numbers [x, y, z] in body axes [m]",
        converter=vector, default=(0.0, 0.0, 0.0), label="Centre of mass", dim=M, role="point",
        help="in body axes",
    )  # fmt: skip
    inertia: Mat3 = field(
        "a symmetric 3x3 matrix of finite numbers about the centre of mass, or three principal "
        "moments [kg m^2]",
        converter=inertia_matrix, default=POINT, dim=KG * M**2, role="tensor",
        help="in body axes; default: of the shapes, or of a point mass",
    )  # fmt: skip
    tip: Vec3 | None = field(
        "three finite numbers [x, y, z] in body axes [m], or None",
        converter=maybe_vector, default=None, dim=M, role="point",
        help="end point of the body, in body axes; default: the centre of mass",
    )  # fmt: skip
    q: PerMotion = field(
        "one finite number per position coordinate [rad, m]; of a free joint x, y, z from "
        "`link` and the quaternion w, x, y, z",
        converter=per_motion, default=(), dim=Q, role="joint", label="q",
        help="initial joint position",
    )  # fmt: skip
    v: PerMotion = field(
        "one finite number per degree of freedom [rad/s, m/s]; of a free joint [angular, linear]",
        converter=per_motion, default=(), dim=Q / S, role="joint", label="v",
        help="initial joint velocity",
    )  # fmt: skip
    stiffness: PerMotion = field(
        "numbers >= 0, one for all or one per motion",
        converter=per_motion, default=(), dim=J / Q**2,
        help="spring stiffness of each joint motion",
    )  # fmt: skip
    damping: PerMotion = field(
        "numbers >= 0, one for all or one per motion",
        converter=per_motion, default=(), dim=J * S / Q**2,
        help="viscous damping of each joint motion",
    )  # fmt: skip
    rest: PerMotion = field(
        "finite numbers, one for all or one per motion",
        converter=per_motion, default=(), dim=Q, label="Rest position",
        help="position without spring torque",
    )  # fmt: skip
    friction: PerMotion = field(
        "numbers >= 0 [N m, N], one for all or one per motion",
        converter=per_motion, default=(), dim=J / Q,
        help="Coulomb friction of each joint motion; of a ball or free one, of each of its speeds",
    )  # fmt: skip
    armature: PerMotion = field(
        "numbers >= 0, one for all or one per motion",
        converter=per_motion, default=(), dim=J * S**2 / Q**2,
        help="drive inertia of each joint motion, which only acts on this joint",
    )  # fmt: skip
    limits: tuple[tuple[Number | None, Number | None] | None, ...] = field(
        "[lower, upper] position [rad, m], null for an open end, one pair "
        "for all motions or one per motion",
        converter=_limits_in, default=(), dim=Q, help="lower and upper limit; default: none",
    )  # fmt: skip
    limit_restitution: PerMotion = field(
        "numbers from 0 to 1, one for all or one per motion",
        converter=per_motion, default=(), dim=NONE, label="Rebound",
        help="coefficient of restitution at a limit, 0 to 1",
    )  # fmt: skip
    speed_limit: PerMotion = field(
        "numbers >= 0 [rad/s, m/s], 0 without a limit, one for all or one per motion",
        converter=per_motion, default=(), dim=Q / S, since=9,
        help="speed above which runs issue a notice; it exerts no force",
    )  # fmt: skip
    pitch: PerMotion = field(
        "numbers [m per turn], not 0 for a screw, by default 0.01, one for all screws or one per "
        "motion",
        converter=per_motion, default=(), dim=M, since=5,
        help="screw pitch; negative for a left-handed thread",
    )  # fmt: skip
    track: Annotated[Track, Once] | None = field(
        "a track such as {'points': [[0, 0, 0], [1, 0, 0.5]]}, for a curve",
        converter=maybe_part_of(Track), default=None, role="track", since=9,
        help="curve that the body follows",
    )  # fmt: skip
    shape: OneShape | None = field(
        "a shape such as {'kind': 'sphere', ...}",
        converter=maybe_part_of(Shape),
        default=None,
        role="parts",
    )

    shapes: tuple[OneShape, ...] = field(
        "a list of shapes; the first of them is `shape`",
        converter=parts_of(Shape),
        default=(),
        role="parts",
        since=2,
    )
    density: Number | None = field(
        "a number > 0 [kg/m^3], or None", default=None, gt=0, dim=KG / M**3, since=2
    )
    derived: tuple[Derived, ...] = field(
        "a list of 'mass', 'com', 'inertia', 'tip': fields computed from the shapes",
        converter=_derived_in, default=(), since=2,
    )  # fmt: skip

    any_inertia: Flag = field(
        "true or false: accept a physically impossible inertia", default=False, since=2
    )

    if TYPE_CHECKING:  # also an argument, in place of `joint`
        dof: int = field("a whole number from 0 to 6", default=0)

    else:

        @property
        def dof(self) -> int:
            """The number of degrees of freedom of the joint, 0 to 6."""
            return joints.nv(self.sequence)

    @model_validator(mode="before")
    @classmethod
    def _joint_from_dof(cls, data: Any) -> Any:
        """Select the joint by `dof` and expand the short forms of axes, motions, q, v, ..."""
        if not isinstance(data, dict):
            return data
        data = {
            key: value
            for key, value in data.items()
            if value is not None or key in ("name", "mass", "com", "inertia")  # these refuse None
        }
        if data.get("shape") or data.get("shapes"):
            named = data.get("derived")
            if named is None:
                data["derived"] = following(data)
            elif named and "inertia" not in data and isinstance(named, (list, tuple)):
                data["derived"] = tuple(dict.fromkeys((*named, "inertia")))
        dof = data.pop("dof", None)
        if dof is not None:
            pick_joint(data, dof)
        kind = data.get("joint", "revolute")
        if isinstance(kind, str) and kind in joints.DEFAULT:
            fill_motions(data, kind)
        return data

    @model_validator(mode="after")
    def _physical(self) -> Self:
        if "checked" in vars(self):  # already validated in another model
            return self
        found = name_problems(self.name)
        if self.shape is not None and self.shapes and self.shape != self.shapes[0]:
            found.append(("shape", "differs from the first of `shapes`; give one of the two"))
        elif self.shape is not None:
            vars(self)["shapes"] = self.shapes or (self.shape,)
        vars(self)["shape"] = self.shapes[0] if self.shapes else None
        found += self._derive()
        found += joint_problems(self.joint, self.sequence, self.q, self.v, self.limits)
        found += track_problems(self.track, self.sequence)
        if not 0.5 < math.hypot(*self.rotation) < 2:
            text = f"must be a unit quaternion [w, x, y, z], got {shown(self.rotation)}"
            found.append(("rotation", text))
        for name in PER_MOTION:
            found += physics_problems(name, getattr(self, name), self.sequence)
        if self.floats and any(self.armature) and self.parent != GROUND:
            text = f"of a free joint needs the parent 'ground', got {shown(self.armature)} on "
            text += f"'{self.parent}'; use joint='compound' with three 'translate' motions and a "
            found.append(("armature", text + "'ball', one armature each"))
        refuse([*found, *([] if self.any_inertia else inertia_problems(self.inertia))])
        vars(self)["checked"] = True  # not a field: a copy is checked again
        return self

    def _derive(self) -> list[tuple[str, str]]:
        """Set the fields derived from the shapes, or return the problems."""
        if self.density is not None and "mass" not in self.derived:
            text = "is only used if `derived` contains 'mass'"
            do = "give derived=('mass', 'com', 'inertia'), or leave the density out"
            return [("density", f"{text}; {do}")]
        if not self.derived:
            return []
        if not self.shapes:
            text = f"{', '.join(self.derived)} cannot follow from shapes: the body has none"
            return [("derived", f"{text}; give a shape, or derived=()")]
        fields = vars(self)
        given = {name: fields[name] for name in self.derived if name in self.model_fields_set}
        try:
            if set(self.derived) != {"tip"}:
                if "mass" in self.derived and self.density is None:
                    return [("density", "is needed, since the mass follows from the shapes")]
                found = mass_properties_of(self.shapes, self.density or 1.0)
                if "mass" in self.derived:
                    fields["mass"] = float(found.mass)
                if "com" in self.derived:
                    fields["com"] = tuple(map(float, found.com))
                if "inertia" in self.derived:
                    inertia = found.inertia * (self.mass / found.mass)
                    fields["inertia"] = tuple(tuple(map(float, row)) for row in inertia)
            if "tip" in self.derived:
                fields["tip"] = tip_of(self.shapes)
        except PgraphError as error:
            names = " and ".join(self.derived)
            text = f"{names} cannot follow from it: {error.problems[0]}; give numbers"
            return [("shape", text)]
        if any(shape.file for shape in self.shapes):
            return []  # a file that has changed since
        return [
            (name, f"follows from the shapes as {shown(fields[name])}, got {shown(value)}; "
                   f"leave it out, or take '{name}' out of `derived`")
            for name, value in given.items() if not _alike(value, fields[name])
        ]  # fmt: skip

    @property
    def drawn(self) -> tuple[Shape, ...]:
        """The shapes that are drawn."""
        return tuple(s for s in self.shapes if s.role != "collision")

    @property
    def touching(self) -> tuple[Shape, ...]:
        """The shapes that take part in contact."""
        return tuple(s for s in self.shapes if s.role != "visual")

    @cached_property
    def sequence(self) -> tuple[Motion, ...]:
        pairs = zip(self.motions, self.pitch)
        return tuple(
            Motion(kind, axis, pitch, self.track if kind in TRACKED else None)
            for (kind, axis), pitch in pairs
        )

    @property
    def floats(self) -> bool:
        """True if q of its joint is a place and an attitude, with all six degrees of freedom."""
        return joints.floats(self.sequence)

    @cached_property
    def tip_point(self) -> tuple[float, float, float]:
        """The point `tip` in body axes [m], by default the centre of mass."""
        return self.com if self.tip is None else self.tip

    def unchecked_copy(self, update: Mapping[str, Any]) -> Self:
        """Return a copy with changed fields, without validation."""
        if ("shape" in update) != ("shapes" in update):
            update = {**update, **self._shapes_after(update)}
        return super().unchecked_copy(update)

    def _kept(self, update: Mapping[str, Any]) -> dict[str, Any]:
        kept = super()._kept(update)
        if "shape" in update or "shapes" in update:
            kept |= {"shape": None, "shapes": ()}
            if not (update.get("shape") or update.get("shapes")):
                kept |= {"derived": (), "density": None}
            elif gained := self.gained(update):
                kept["derived"] = gained
        gone = {*kept["derived"], *update.get("derived", ())}
        if "motions" in update:
            gone.add("axes")
        elif "axes" in update or "joint" in update:
            gone.add("motions")
        if update.get("joint", self.joint) != self.joint:
            gone.update((*JOINT_FIELDS, "track"))
        return {name: value for name, value in kept.items() if name not in gone}

    def gained(self, update: Mapping[str, Any]) -> tuple[Derived, ...]:
        """Return the fields that a point derives from its first shape in `update`."""
        shaped = update.get("shapes") or update.get("shape")
        own = self.shapes or "inertia" in self.model_fields_set or self.inertia != POINT
        if own or not shaped or "derived" in update:
            return ()
        names: tuple[Derived, ...] = ("inertia",) if any(self.com) else ("com", "inertia")
        return tuple(name for name in names if name not in update)

    def _shapes_after(self, update: Mapping[str, Any]) -> dict[str, Any]:
        """Return the updated `shape` and `shapes` if either of them is given."""
        if "shapes" in update:
            shapes = tuple(update["shapes"])
            return {"shape": shapes[0] if shapes else None}
        shape = update["shape"]
        return {"shapes": () if shape is None else (shape, *self.shapes[1:])}


def following(data: Mapping[str, Any]) -> tuple[str, ...]:
    """Return the fields that are derived from the shapes because a mass or an inertia is
    missing."""
    mass = ("mass",) * ("density" in data)
    lacking = mass or "inertia" not in data
    return tuple(x for x in (*mass, "com", "inertia") if lacking and x not in data)


def _alike(a: Any, b: Any) -> bool:
    """Check whether two derived values agree to within rounding."""
    size = np.abs(b).max(initial=0.0)
    return a is None or bool(np.abs(np.subtract(a, b)).max(initial=0.0) <= NOTABLE * size)


def name_problems(name: str) -> list[Finding]:
    """Return problems with names that cannot be displayed or have a special meaning."""
    if text := name_problem(name):
        return [("name", text)]
    if name == GROUND:
        return [("name", "'ground' is the name of the ground; choose another")]
    if name == EVERY:
        return [("name", "'*' stands for every body in contacts; choose another")]
    return []
