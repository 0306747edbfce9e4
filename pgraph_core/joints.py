"""Joint kinds as ordered elementary motions, and what the DoF column of the table picks."""

from __future__ import annotations

from typing import Literal, NamedTuple

Vector = tuple[float, float, float]
JointKind = Literal[
    "weld",
    "revolute",
    "prismatic",
    "cylindrical",
    "universal",
    "spherical",
    "planar",
    "free",
    "compound",
]
MotionKind = Literal["rotate", "translate", "ball", "free"]

X, Y, Z = (1.0, 0.0, 0.0), (0.0, 1.0, 0.0), (0.0, 0.0, 1.0)


class Motion(NamedTuple):
    """One elementary motion of a joint; a joint is a sequence of them, from parent to body."""

    kind: MotionKind
    axis: Vector  # in the body's axes at q = 0; of no meaning for ball and free


BALL = Motion("ball", Z)

SIZE: dict[MotionKind, tuple[int, int]] = {  # (nq, nv) of a motion
    "rotate": (1, 1),
    "translate": (1, 1),
    "ball": (4, 3),
    "free": (7, 6),
}

DEFAULT: dict[JointKind, tuple[Motion, ...]] = {
    "weld": (),
    "revolute": (Motion("rotate", Z),),
    "prismatic": (Motion("translate", Z),),
    "cylindrical": (Motion("rotate", Z), Motion("translate", Z)),
    "universal": (Motion("rotate", X), Motion("rotate", Y)),
    "spherical": (BALL,),
    "planar": (Motion("translate", X), Motion("translate", Y), Motion("rotate", Z)),
    "free": (Motion("free", Z),),
    "compound": (BALL, Motion("translate", Z)),
}

# The DoF column: number -> (kind, motions).
OF_DOF: tuple[tuple[JointKind, tuple[Motion, ...]], ...] = (
    ("weld", DEFAULT["weld"]),
    ("revolute", DEFAULT["revolute"]),
    ("universal", DEFAULT["universal"]),
    ("spherical", DEFAULT["spherical"]),
    ("compound", DEFAULT["compound"]),
    ("compound", (BALL, Motion("translate", X), Motion("translate", Y))),
    ("free", DEFAULT["free"]),
)


def nq(motions: tuple[Motion, ...]) -> int:
    """Number of position coordinates of a joint."""
    return sum(SIZE[m.kind][0] for m in motions)


def nv(motions: tuple[Motion, ...]) -> int:
    """Degrees of freedom of a joint."""
    return sum(SIZE[m.kind][1] for m in motions)


def home(motions: tuple[Motion, ...]) -> tuple[float, ...]:
    """q = 0 of a joint: zeros, and the unit quaternion [1, 0, 0, 0] of a ball or free motion."""
    zero = {"rotate": (0.0,), "translate": (0.0,), "ball": (1.0, 0.0, 0.0, 0.0)}
    zero["free"] = (0.0, 0.0, 0.0, *zero["ball"])
    return tuple(x for m in motions for x in zero[m.kind])
