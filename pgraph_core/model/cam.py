"""Cams: a follower whose joint has a lift over the turn of another one, with the drawn profile."""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping, Sequence
from functools import cached_property
from pathlib import Path
from typing import Annotated, Any, ClassVar, Literal, Self

import numpy as np
from pydantic import BeforeValidator, Discriminator, Tag, model_validator

from ..cams import (
    CamSegment,
    Follower,
    Rule,
    enough,
    extruded,
    lowest,
    outline,
    pieces_of,
    problems_of,
    profile,
    values,
)
from ..errors import InputError, Problem, shown
from ..fields import Number, field, listed, refuse
from ..functions import Array, Curve, Pieces
from ..joints import SIZE
from ..rotation import matrix
from ..tolerances import NOTABLE
from ..units import RAD, M
from .body import Body
from .constraint import KIND
from .files import write_atomic
from .joint_constraint import OfTwo, first_q

FEWEST = 3  # points of a polygon
STL_HEAD = 80  # bytes before the number of triangles


def _which(value: Any) -> str:
    """Return the tag of a motion: segments, or points."""
    return "curve" if isinstance(value, (Curve, dict)) else "segments"


Segments = Annotated[tuple[CamSegment, ...], BeforeValidator(listed)]
CamMotion = Annotated[
    Annotated[Curve, Tag("curve")] | Annotated[Segments, Tag("segments")], Discriminator(_which)
]
Given = Sequence[CamSegment | Mapping[str, Any]] | Curve | Mapping[str, Any]
_motion: Callable[[Given], CamMotion] = listed


class Cam(OfTwo):
    """A cam on `other`, with a knife edge, a roller or a flat face on `body` as its follower.

    The follower moves along its own axis, across the axis of the cam, or turns about an axis that
    is parallel to that of the cam, at the given `distance`. Both joints have one coordinate and are
    on the same body. Where the lift is 0, the follower touches the circle of the base radius, and
    its coordinate is 0. The follower moves away from the cam as its coordinate grows.

    Examples
    --------
    >>> import math, pgraph_core as pg
    >>> turn = [
    ...     pg.CamSegment(lift=0.02, angle=math.radians(90), law="3-4-5"),
    ...     pg.CamSegment(lift=0.02, angle=math.radians(60)),
    ...     pg.CamSegment(lift=0.0, angle=math.radians(90), law="cycloidal"),
    ...     pg.CamSegment(lift=0.0),
    ... ]
    >>> cam = pg.Cam(name="lift", body="valve", other="shaft", base_radius=0.04, motion=turn)
    >>> cam.profile().shape
    (720, 2)
    """

    SINCE: ClassVar[int] = 9
    ROWS: ClassVar[int] = 1
    ABOUT: ClassVar[str] = "a follower on a cam: knife edge, roller or flat face"

    kind: Literal["cam"] = field(KIND, default="cam")
    motion: CamMotion = field(
        "segments of a turn such as [{'lift': 0.02, 'angle': 1.57, 'law': '3-4-5', '4-5-6-7', "
        "'cycloidal' or 'modified sine'}, ..., {'lift': 0}], or points over a turn such as "
        "{'x': [...], 'value': [...], 'kind': 'periodic'}",
        converter=_motion, label="Lift", help="lift of the follower over a turn of the cam",
    )  # fmt: skip
    base_radius: Number = field(
        "a length > 0 [m]",
        gt=0, dim=M, help="least radius of the cam, at lift 0",
    )  # fmt: skip
    follower: Follower = field(
        "one of knife, roller, flat", default="knife", help="what touches the cam"
    )
    roller_radius: Number | None = field(
        "a length > 0 [m]", default=None, gt=0, dim=M, help="radius of a roller"
    )
    eccentricity: Number = field(
        "a finite number [m]", default=0.0, dim=M,
        help="distance of the follower's line from the axis of the cam, to the side of its "
        "direction × that axis",
    )  # fmt: skip
    distance: Number | None = field(
        "a length > 0 [m], of a follower that turns",
        default=None, gt=0, dim=M, help="distance of the axes, of a follower that turns",
    )  # fmt: skip
    arm: Number | None = field(
        "a length > 0 [m], of a follower that turns",
        default=None, gt=0, dim=M,
        help="from the axis of a follower that turns to its knife edge or its roller's centre",
    )  # fmt: skip
    phase: Number = field(
        "an angle [rad]", default=0.0, dim=RAD, help="angle of the cam at which the lift begins"
    )

    @classmethod
    def _followers(cls) -> Mapping[str, tuple[str, ...]]:
        sizes = "motion", "eccentricity", "roller_radius", "arm"  # the base radius follows
        own = {
            **dict.fromkeys(sizes, ("base_radius",)),
            "distance": ("arm", "eccentricity", "base_radius"),
            "follower": ("roller_radius", "arm", "base_radius"),
        }
        return {**super()._followers(), **own}

    def onto(self, bodies: Any) -> None:
        bodies.on_cam(self)

    # -- checks --------------------------------------------------------------------------------

    @model_validator(mode="after")
    def _fits(self) -> Self:
        refuse([("motion", text) for text in problems_of(self.motion)[:1]])
        refuse(self._foreign_lengths())
        refuse(self._lengths())
        refuse(self._undercut())
        return self

    def _foreign_lengths(self) -> list[tuple[str, str]]:
        """Return lengths that are missing, or that this kind of follower does not have."""
        rolls, turns, found = self.follower == "roller", self.distance is not None, []
        if rolls and self.roller_radius is None:
            found.append(("roller_radius", "a roller needs its radius, a length > 0 [m]"))
        if not rolls and self.roller_radius is not None:
            text = f"belongs to follower='roller', got '{self.follower}'; leave it out"
            found.append(("roller_radius", text))
        if not turns and self.arm is not None:
            text = "belongs to a follower that turns; give the distance of the axes, too"
            found.append(("arm", f"{text}, or leave it out"))
        if turns and self.follower == "flat" and self.arm is not None:
            found.append(("arm", "a flat face leads through its own axis; leave the arm out"))
        if turns and self.follower != "flat" and self.arm is None:
            text = f"a {self.follower} that turns needs the length of its arm, a length > 0 [m]"
            found.append(("arm", text))
        if self.eccentricity and (turns or self.follower == "flat"):
            why = "a follower that turns has none" if turns else "a flat face slides along the cam"
            text = f"{why}, so that it changes nothing; leave it out"
            found.append(("eccentricity", f"{text}, got {shown(self.eccentricity)}"))
        return found

    def _lengths(self) -> list[tuple[str, str]]:
        """Return lengths with which the follower does not reach the base circle."""
        rule = self.rule
        if not rule.turns:
            if abs(rule.eccentricity) < rule.prime:
                return []
            what = "the base radius and the radius of the roller together"
            what = what if rule.roller else "the base radius"
            text = f"must be less than {what}, {rule.prime:.6g} m, or the follower misses the cam"
            return [("eccentricity", f"{text}, got {shown(self.eccentricity)}")]
        if rule.follower == "flat":
            low, high = rule.base, math.inf
        else:
            low, high = abs(rule.arm - rule.prime), rule.arm + rule.prime
        if low < rule.distance < high:
            return []
        text = f"is more than {low:.6g}" + (f" and less than {high:.6g}" if high < math.inf else "")
        return [("distance", f"{text} m with these radii and this arm, got {shown(self.distance)}")]

    def _undercut(self) -> list[tuple[str, str]]:
        """Return where the follower cannot follow the lift, as on a profile that cuts itself."""
        angle, margin = lowest(self.rule, self.lift, self._ends)
        if margin > 0.0:
            return []
        f, slope, bend = values(self.lift, np.array([angle]))
        size = sum(float(np.abs(x).max()) for x in values(self.lift, self.lift.places))
        most = self.base_radius + 100.0 * (size + (self.roller_radius or 0.0))
        if self.distance is not None:
            most = self.distance + (self.arm or 0.0)
        least = enough(self.rule, self.lift, self._ends, most, self._reaches)
        what = {
            "flat": "the face would have to lie inside the profile",
            "roller": "the roller is larger than the curvature of the profile",
            "knife": "the knife edge cannot go there",
        }[self.follower]
        text = f"the profile is undercut where the cam is at {math.degrees(angle):.4g} degrees, "
        text += f"lift {f[0]:.4g}: {what}; "
        if least is not None:
            text += f"give a base radius of at least {least:.4g} m, "
        text += "give the lift more angle, or lift less"
        text += ", or take a smaller roller" if self.follower == "roller" else ""
        return [("base_radius", f"{text}, got {shown(self.base_radius)}")]

    def _reaches(self, base: float) -> bool:
        return not self.unchecked_copy({"base_radius": base})._lengths()

    @property
    def _ends(self) -> Sequence[float]:
        """The angles between which the law is one formula."""
        if isinstance(self.motion, Curve):
            return self.lift.places.tolist()
        ends, rest = [self.phase], math.tau - math.fsum(x.angle or 0.0 for x in self.motion)
        for one in self.motion:
            ends.append(ends[-1] + (one.angle or rest))
        return ends

    def problems_with(self, bodies: Mapping[str, Body | None]) -> list[tuple[str, str]]:
        """Return why these bodies are no cam and follower, as (field, text)."""
        follower, cam = bodies.get(self.body), bodies.get(self.other)
        if follower is None or cam is None:
            return []
        if [m.facts.pivots for m in cam.sequence] != [True]:
            text = f"the joint of a cam is a hinge, and that of '{cam.name}' is {_joint(cam)}"
            return [("other", f"{text}; give the cam a body with joint='revolute'")]
        if [m.facts.flat for m in follower.sequence] != [True]:
            text = f"that of '{follower.name}' is {_joint(follower)}; give it joint='prismatic'"
            return [("body", f"the joint of a follower is a slider or a hinge, and {text}")]
        if follower.parent != cam.parent:
            text = f"'{follower.name}' is on '{follower.parent}' and '{cam.name}' on '{cam.parent}'"
            return [("body", f"a cam and its follower have joints on the same body, but {text}")]
        axis, way = (b.sequence[0].along(matrix(b.rotation)) for b in (cam, follower))
        if follower.sequence[0].facts.travels:
            if self.distance is not None:
                text = f"belongs to a follower that turns, and '{follower.name}' slides"
                return [("distance", f"{text}; leave it and the arm out")]
            if abs(float(axis @ way)) > NOTABLE:
                text = f"'{follower.name}' must slide across the axis of '{cam.name}', and is "
                text += f"{math.degrees(math.acos(min(1.0, abs(float(axis @ way))))):.4g} degrees"
                return [("body", f"{text} from it; turn its axis")]
            return []
        far = _apart(follower, cam)
        if self.distance is None:
            text = f"the joint of '{follower.name}' is a hinge; give the distance of its axis from "
            text += f"that of '{cam.name}', {far:.6g} m, and its arm"
            return [("distance", text)]
        if float(axis @ way) < 1.0 - NOTABLE:
            text = f"the axes of '{follower.name}' and '{cam.name}' must have the same direction"
            return [("body", f"{text}; turn one of them")]
        if abs(far - self.distance) > NOTABLE * self.distance:
            text = f"is {far:.9g} m between the joints of '{follower.name}' and '{cam.name}'"
            return [("distance", f"{text}, got {shown(self.distance)}")]
        return []

    # -- geometry ------------------------------------------------------------------------------

    @cached_property
    def lift(self) -> Pieces:
        """The lift over a turn of the cam, in polynomials."""
        return pieces_of(self.motion, self.phase)

    @property
    def rule(self) -> Rule:
        """The lengths of the cam and its follower [m]."""
        return Rule(
            self.follower, self.base_radius, self.roller_radius or 0.0, self.eccentricity,
            self.arm or 0.0, self.distance or 0.0,
        )  # fmt: skip

    def plane(self, bodies: Mapping[str, Body]) -> Array:
        """Return x, y and z of the profile as columns (3, 3), in the axes of the cam's body.

        At 0 of the cam's joint, y is the direction of a follower that slides, or leads to the axis
        of one that turns. z is the axis of the cam.
        """
        follower, cam = bodies[self.body], bodies[self.other]
        home = matrix(cam.rotation)
        z = cam.sequence[0].along(home)
        y = np.subtract(follower.link, cam.link)
        if follower.sequence[0].facts.travels:
            y = follower.sequence[0].along(matrix(follower.rotation))
        y = y - z * (z @ y)
        y = y / np.linalg.norm(y)
        return home.T @ np.column_stack((np.cross(y, z), y, z))

    def profile(self, model: Any = None, points: int = 720) -> Array:
        """Return points of the cam's profile, counter-clockwise about its axis.

        Parameters
        ----------
        model : Model, optional
            The model of the cam. With it, the points are in the axes of the cam's body.
        points : int
            The number of points, at equal angles of the cam.

        Returns
        -------
        ndarray (points, 2) or (points, 3)
            In the plane of the cam, whose y is the direction of the follower (or leads to its axis,
            if it turns) while the cam's joint is at 0, or in the axes of the cam's body [m].

        Raises
        ------
        InputError
            If there are fewer than three points.

        Examples
        --------
        >>> import numpy as np, pgraph_core as pg
        >>> turn = [pg.CamSegment(lift=0.01, angle=3.0), pg.CamSegment(lift=0)]
        >>> cam = pg.Cam(name="lift", body="valve", other="shaft", base_radius=0.04, motion=turn)
        >>> np.savetxt("profile.csv", cam.profile(points=3600), delimiter=",")  # doctest: +SKIP
        """
        if not isinstance(points, int) or points < FEWEST:
            text = f"must be a whole number of {FEWEST} or more, got {shown(points)}"
            raise InputError(Problem("profile", "points", text))
        found = profile(self.rule, self.lift, points)
        flat: Any = np.column_stack((found.real, found.imag))
        if model is None:
            return flat
        return flat @ self.plane({b.name: b for b in model.bodies})[:, :2].T

    def face(self, model: Any, points: int = 72) -> Array:
        """Return the points of what touches the cam.

        Parameters
        ----------
        model : Model
            The model of the cam.
        points : int
            The number of points on the circle of a roller.

        Returns
        -------
        ndarray (n, 3)
            The circle of a roller, the knife edge, or the ends of the part of a flat face that
            touches the cam, in the axes of the follower's body [m].
        """
        bodies = {b.name: b for b in model.bodies}
        follower, cam = bodies[self.body], bodies[self.other]
        home, own = matrix(cam.rotation), matrix(follower.rotation)
        turned = home @ self.plane(bodies)
        found = outline(self.rule, self.lift, points)
        place = np.add(cam.link, np.column_stack((found.real, found.imag)) @ turned[:, :2].T)
        return (place - follower.link) @ own

    def write_stl(self, path: str | Path, width: float, model: Any, points: int = 720) -> None:
        """Write the cam as a solid in the axes of its body [m], for a mesh shape or a workshop.

        Parameters
        ----------
        path : str or Path
            The STL file.
        width : float
            The width along the axis of the cam [m], half of it to either side of the body's origin.
        model : Model
            The model of the cam.
        points : int
            The number of points of the profile.

        Raises
        ------
        InputError
            If the width is not positive, or if the axis of the cam does not see its whole profile.

        Examples
        --------
        >>> cam.write_stl("cam.stl", 0.01, model)  # doctest: +SKIP
        >>> solid = pg.Shape(kind="mesh", file="cam.stl")  # doctest: +SKIP
        """
        if not width > 0.0:
            text = f"must be a length > 0 [m], got {shown(width)}"
            raise InputError(Problem("write_stl", "width", text))
        axis = self.plane({b.name: b for b in model.bodies})[:, 2]
        found = extruded(self.profile(model, points), width * axis)
        if found is None:
            text = f"of '{self.name}' has a part that its axis does not see, and no solid is made "
            raise InputError(Problem("write_stl", "profile", text + "of it; use cam.profile()"))
        found = found - 0.5 * width * axis
        normals = np.cross(found[:, 1] - found[:, 0], found[:, 2] - found[:, 0])
        rows = np.zeros(len(found), [("numbers", "<f4", (4, 3)), ("attribute", "<u2")])
        size = np.linalg.norm(normals, axis=1, keepdims=True)
        rows["numbers"] = np.concatenate(((normals / size)[:, None], found), axis=1)
        head = b"Pgraph".ljust(STL_HEAD, b" ") + np.uint32(len(found)).tobytes()
        write_atomic(path, head + rows.tobytes())

    # -- as a constraint -----------------------------------------------------------------------

    @classmethod
    def begun(cls, model: Any, body: str, other: str) -> dict[str, Any]:
        """Return a cam that rises, rests and returns, of about the size of the model.

        A follower that is not at 0 rests at its coordinate.
        """
        follower, cam = model.body(body), model.body(other)
        turns = [m.facts.pivots for m in follower.sequence] == [True]
        far = _apart(follower, cam) or 0.1
        q, angle = first_q(model, body), first_q(model, other)
        lift = q or (math.radians(15.0) if turns else 0.2 * far)
        third = math.tau / 3.0
        turn = (CamSegment(lift=lift, angle=third), CamSegment(lift=lift, angle=third / 2.0),
                CamSegment(lift=0.0, angle=third), CamSegment(lift=0.0))  # fmt: skip
        phase = angle - (1.25 * third if q else 0.0)
        if turns:
            return {"motion": turn, "phase": phase, "base_radius": 0.5 * far, "distance": far,
                    "arm": far}  # fmt: skip
        return {"motion": turn, "phase": phase, "base_radius": max(0.5 * far, 2.0 * abs(lift))}

    def _blocks(self, e: Any) -> list[Any]:
        own = e.coordinate(self.body, self.coordinate)
        other = e.coordinate(self.other, self.other_coordinate, 0.0)
        return [e.related(own, other, self.lift)]


def _apart(follower: Body, cam: Body) -> float:
    """Return the distance of the joint of a follower from the axis of a cam [m]."""
    apart = np.subtract(follower.link, cam.link)
    if [m.facts.pivots for m in cam.sequence] == [True]:
        axis = cam.sequence[0].along(matrix(cam.rotation))
        apart = apart - axis * (axis @ apart)
    return float(np.linalg.norm(apart))


def _joint(body: Body) -> str:
    count = sum(SIZE[m.kind][1] for m in body.sequence)
    return f"{body.joint} with {count} degrees of freedom" if count != 1 else f"a {body.joint}"
