"""Where a loop is cut: a constraint in place of a joint to a second parent."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any

from .. import joints
from ..errors import ModelError, Problem
from .body import Body
from .constraint import Constraint

CUT = {  # joint kind -> kind of the constraint that is left of it where a loop is cut
    "weld": "weld",
    "revolute": "revolute",
    "prismatic": "prismatic",
    "cylindrical": "cylindrical",
    "universal": "universal",
    "spherical": "point",
}


def cut_joint(
    body: Body, parent: str, taken: Sequence[str], given: Mapping[str, Any]
) -> Constraint:
    """The constraint in place of a joint of `body` to a second parent. Raises ModelError.

    `given` has joint, name, and fields of the constraint; what is None is as in the body's joint.
    """
    given = {key: value for key, value in given.items() if value is not None}
    joint = given.pop("joint", body.joint)
    where = f"body '{body.name}'"
    if joint not in CUT:
        text = f"a loop is not cut at a {joint} joint; choose one of {', '.join(CUT)}"
        raise ModelError(Problem(where, "joint", text))
    if "axis" not in given and joint == body.joint != "weld":
        if joint == "universal" and body.motions != joints.DEFAULT["universal"]:
            text = "its axes do not say where the second parent's stands; give axis and other_axis"
            raise ModelError(Problem(where, "axes", text))
        if joint in ("revolute", "prismatic", "cylindrical"):
            given["axis"] = body.axes[0]
    name = given.pop("name", None) or free_name(f"{body.name}-{parent}", taken)
    return Constraint(name=name, kind=CUT[joint], body=body.name, other=parent, **given)


def free_name(name: str, taken: Sequence[str]) -> str:
    """The name, with a number behind it where it is taken."""
    numbered = (f"{name} {k}" for k in range(2, len(taken) + 3))
    return next(free for free in (name, *numbered) if free not in taken)
