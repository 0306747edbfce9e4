"""What makes one row of the table a rigid body with a joint."""

from __future__ import annotations

import itertools
import math
from typing import Any

import numpy as np

from .. import joints
from ..joints import JointKind, Motion
from .sentences import EVERY, GROUND, name_problem, numbers, shown

# what a joint has besides its limits, one number a motion
PER_MOTION = ("stiffness", "damping", "rest", "friction", "armature", "limit_restitution")
TRIANGLE = 1e-9  # relative slack of the inertia's symmetry and triangle inequality

Finding = tuple[str, str]  # (field, sentence)
Motions = tuple[Motion, ...]
Numbers = tuple[float, ...]
Limits = tuple[tuple[float | None, float | None] | None, ...]


def name_problems(name: str) -> list[Finding]:
    """Names that would not show as they are, or that mean something else."""
    if text := name_problem(name):
        return [("name", text)]
    if name == GROUND:
        return [("name", "'ground' is the name of the ground; choose another")]
    if name == EVERY:
        return [("name", "'*' stands for every body in contacts; choose another")]
    return []


def joint_problems(
    joint: JointKind, motions: Motions, q: Numbers, v: Numbers, limits: Limits
) -> list[Finding]:
    """What is wrong with a joint's motions, axes, initial state and limits."""
    found: list[Finding] = []
    if joint != "compound" and _kinds(motions) != _kinds(joints.DEFAULT[joint]):
        found.append(("motions", f"are not those of a {joint} joint; use joint 'compound'"))
    if any(m.kind == "free" for m in motions) and len(motions) > 1:
        found.append(("motions", "a free motion stands alone; use ball and translate motions"))
    if joints.nv(motions) > 6:
        found.append(("motions", f"give {joints.nv(motions)} degrees of freedom; at most 6"))
    for m in motions:
        if m.kind in ("rotate", "translate") and not 1e-9 < math.hypot(*m.axis) < 1e9:
            found.append(("axes", f"a direction must not be zero; given {list(m.axis)}"))
    found += _parallel_problems(motions)
    for name, value, length in (("q", q, joints.nq(motions)), ("v", v, joints.nv(motions))):
        if len(value) != length:
            found.append((name, f"a {joint} joint has {numbers(length)}; given {len(value)}"))
        elif name == "q":
            found += quaternion_problems(value, motions)
    return found + (_limit_problems(limits, motions) or outside(q, motions, limits))


def _limit_problems(limits: tuple[Any, ...], motions: tuple[Motion, ...]) -> list[Finding]:
    """Pairs that are not one a motion, the wrong way round, or on what has no single position."""
    if not limits:
        return []
    if not motions:
        return [("limits", f"a weld has no motion; given {shown(limits)}")]
    if len(limits) != len(motions):
        text = f"give one pair for all motions, or one a motion: {len(motions)}"
        return [("limits", f"{text}; given {shown(limits)}")]
    bounded = [(pair, m) for pair, m in zip(limits, motions) if pair is not None]
    if any(m.kind in ("ball", "free") for _, m in bounded):
        text = "bound a rotate or translate motion, not a ball or free one"
        return [("limits", f"{text}; given {shown(limits)}")]
    return [
        ("limits", f"the least must be less than the greatest; given {shown(pair)}")
        for pair, _ in bounded
        if None not in pair and pair[0] >= pair[1]
    ]


def outside(q: Numbers, motions: Motions, limits: Limits) -> list[Finding]:
    """Positions beyond the limits of their motions, where both are well-formed."""
    found: list[Finding] = []
    start = 0
    if len(limits) != len(motions) or len(q) != joints.nq(motions):
        return []
    for m, pair in zip(motions, limits):
        if pair is not None and m.kind in ("rotate", "translate"):
            low, high = pair
            if (low is not None and q[start] < low) or (high is not None and q[start] > high):
                text = f"must start within its limits {shown(pair)}; given {shown(q[start])}"
                found.append(("q", text))
        start += joints.SIZE[m.kind][0]
    return found


def _parallel_problems(motions: tuple[Motion, ...]) -> list[Finding]:
    """Two successive turns (or slides) along one line are one degree of freedom, not two."""
    return [
        (
            "axes",
            f"two successive directions are parallel; given {list(a.axis)} and {list(b.axis)}; "
            "turn one of them",
        )
        for a, b in itertools.pairwise(motions)
        if a.kind == b.kind
        and a.kind in ("rotate", "translate")
        and _norm(_cross(a.axis, b.axis)) <= 1e-9 * _norm(a.axis) * _norm(b.axis)
    ]


def _norm(x: tuple[float, ...]) -> float:
    return math.hypot(*x)


def _cross(a: tuple[float, ...], b: tuple[float, ...]) -> tuple[float, ...]:
    return (
        a[1] * b[2] - a[2] * b[1],
        a[2] * b[0] - a[0] * b[2],
        a[0] * b[1] - a[1] * b[0],
    )


def _kinds(motions: tuple[Motion, ...]) -> tuple[str, ...]:
    return tuple(m.kind for m in motions)


def quaternion_problems(q: tuple[float, ...], motions: tuple[Motion, ...]) -> list[tuple[str, str]]:
    found, start = [], 0
    for m in motions:
        size = joints.SIZE[m.kind][0]
        if m.kind in ("ball", "free"):
            quaternion = q[start + size - 4 : start + size]
            if abs(math.hypot(*quaternion) - 1) > 1e-3:
                given = shown(quaternion)
                found.append(("q", f"needs a unit quaternion [w, x, y, z]; given {given}"))
        start += size
    return found


def physics_problems(
    name: str, values: tuple[float, ...], motions: tuple[Motion, ...]
) -> list[tuple[str, str]]:
    if len(values) == len(motions) and not any(values):
        return []
    if values and not motions:
        return [(name, f"a weld has no motion; given {list(values)}")]
    if len(values) != len(motions):
        text = f"give one number for all motions, or one a motion: {len(motions)}"
        text += f"; given {list(values)}"
        return [(name, text)]
    if name != "rest" and any(x < 0 for x in values):
        return [(name, f"must be >= 0; given {list(values)}")]
    if name == "limit_restitution" and any(x > 1 for x in values):
        return [(name, f"must be from 0 to 1; given {list(values)}")]
    scalar = name != "damping"
    if scalar and any(x and m.kind in ("ball", "free") for x, m in zip(values, motions)):
        text = "acts on a rotate or translate motion, not on a ball or free one"
        return [(name, f"{text}; given {list(values)}")]
    return []


def inertia_problems(inertia: tuple[Numbers, ...]) -> list[Finding]:
    """Symmetry, positive semidefiniteness and the triangle inequality of the inertia."""
    size = max(abs(x) for row in inertia for x in row)
    if any(
        abs(inertia[i][j] - inertia[j][i]) > TRIANGLE * size for i, j in ((0, 1), (0, 2), (1, 2))
    ):
        return [("inertia", f"must be symmetric; given {[list(row) for row in inertia]}")]
    slack = TRIANGLE * size
    if _is_plainly_right(inertia, 0.5 * slack):
        return []
    a, b, c = principal_moments(inertia)
    if a < -slack:
        return [
            (
                "inertia",
                f"must be positive semidefinite; its smallest principal moment is {a:.6g} kg m^2",
            )
        ]
    if a + b < c - slack:
        return [
            (
                "inertia",
                f"breaks the triangle inequality: principal moments {a:.6g} + {b:.6g} < {c:.6g} by "
                f"{c - a - b:.3g} kg m^2; no rigid body has it",
            )
        ]
    return []


def _is_plainly_right(inertia: tuple[tuple[float, ...], ...], slack: float) -> bool:
    """Whether tr(I)/2 - I + slack is positive definite, by the pivots of Cholesky's method.

    That is the triangle inequality, from which the rest follows, without eigenvalues.
    """
    (a, d, e), (_, b, f), (_, _, c) = inertia
    half = 0.5 * (a + b + c) + slack
    first, second = half - a, half - b
    if not (first > 0 and (second := second - d * d / first) > 0):
        return False
    left = -f - d * e / first
    return half - c - e * e / first - left * left / second > 0


def principal_moments(inertia: tuple[tuple[float, ...], ...]) -> tuple[float, float, float]:
    """Eigenvalues of a symmetric 3x3 matrix, ascending."""
    (a, d, e), (_, b, f), (_, _, c) = inertia
    if d == e == f == 0.0:
        low, middle, high = sorted((a, b, c))
        return low, middle, high
    low, middle, high = np.linalg.eigvalsh(np.array(inertia))
    return float(low), float(middle), float(high)
