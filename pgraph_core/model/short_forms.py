"""The short forms of a body's joint: dof, axes, motions, q, v, limits and values per motion."""

from __future__ import annotations

import math
from collections.abc import Mapping
from typing import Any

from .. import joints
from ..errors import shown
from ..fields import listed, refuse, whole
from ..joints import DIRECTED, PER_MOTION, JointKind, Motion


def pick_joint(data: dict[str, Any], dof: Any) -> None:
    """Fill in `joint` and `motions` by a number of degrees of freedom."""
    number = whole(dof)
    if number is None or not 0 <= number <= 6:
        refuse([("dof", f"must be a whole number from 0 to 6, got {shown(dof)}")])
        return
    kind, motions = joints.OF_DOF[number]
    given = data.get("joint", kind)
    if not isinstance(given, str) or given not in joints.DEFAULT:
        return
    usual = motions if given == kind else joints.DEFAULT[given]
    motions = data.get("motions") or tuple(m[:2] for m in usual)
    data["joint"], data["motions"] = given, motions
    try:
        agrees = joints.nv(tuple(Motion(m[0], joints.Z) for m in motions)) == number
    except (KeyError, IndexError, TypeError):
        return  # ill-formed motions are refused by their own field
    if not agrees:
        refuse([("dof", f"{number} disagrees with joint '{given}'; give one of the two")])


def fill_motions(data: dict[str, Any], kind: JointKind) -> None:
    """Fill in `motions`. `axes` alone are the directions of the motions of this kind."""
    given = listed(data.get("motions"))
    if given == () and joints.DEFAULT[kind]:
        text = f"a {kind} joint has motions, got []; omit the field, or give joint='weld'"
        refuse([("motions", text)])
        return
    try:
        motions = tuple(_motion(*m) for m in given) if given else joints.DEFAULT[kind]
    except TypeError:
        return  # ill-formed motions are refused by their own field
    axes = _directions(data.get("axes"))
    moving = [m for m in motions if m.kind in DIRECTED]
    if axes != () and kind != "weld":
        if axes is None or len(axes) != len(moving):
            given = shown(data["axes"])
            text = f"a {kind} joint takes {_count(len(moving))}, got {given}"
            refuse([("axes", text)])
            return
        left = iter(axes)
        motions = tuple(Motion(m.kind, next(left)) if m.kind in DIRECTED else m for m in motions)
    data["motions"] = tuple(m[:2] for m in motions)
    data["axes"] = tuple(m.axis for m in motions if m.kind in DIRECTED)
    try:
        _fill_coordinates(data, motions)
    except (KeyError, TypeError):
        return  # a motion of no known kind


def _motion(kind: Any, axis: Any = None) -> Motion:
    return Motion(kind, axis or joints.Z)


LETTERS = {
    sign + letter: tuple(float(f"{sign}1") if letter == x else 0.0 for x in "xyz")
    for sign in ("", "-")
    for letter in "xyz"
}


def _directions(axes: Any) -> tuple[Any, ...] | None:
    """Return one (x, y, z) per motion, or None for anything else.

    Outer brackets may be omitted, and "y" or "-y" can be used as a direction.
    """
    axes = listed(axes if axes is not None else ())
    axes = (axes,) if isinstance(axes, str) else axes
    if isinstance(axes, tuple):
        axes = tuple([LETTERS.get(a, a) if isinstance(a, str) else a for a in axes])
    if isinstance(axes, tuple) and len(axes) == 3 and not any(isinstance(a, tuple) for a in axes):
        axes = (axes,)
    if not isinstance(axes, tuple):
        return None
    ok = all(isinstance(a, tuple) and len(a) == 3 and all(map(_finite, a)) for a in axes)
    return axes if ok else None


def _finite(x: Any) -> bool:
    number = isinstance(x, (int, float)) and not isinstance(x, bool)
    return number and abs(x) < math.inf


def _fill_coordinates(data: dict[str, Any], motions: tuple[Motion, ...]) -> None:
    """Fill in q, v, limits and what has a value per motion."""
    free = joints.floats(motions)
    for name, rest in (("q", joints.home(motions)), ("v", (0.0,) * joints.nv(motions))):
        given = listed(data.get(name, ()))
        if given == ():
            data[name] = rest
        elif isinstance(given, Mapping) or (free and given is not None):
            data[name], problem = joints.joined(name, given, rest, free)
            refuse([(name, problem)] if problem else [])
    if "limits" in data:
        data["limits"] = _limits(listed(data["limits"]), len(motions))
    usual: dict[str, Any] = dict.fromkeys(PER_MOTION, (0.0,) * len(motions))
    usual["pitch"] = tuple([joints.KINDS[m.kind].pitch for m in motions])
    for name in usual.keys() & data.keys():
        value = listed(data[name])
        value = value if isinstance(value, tuple) else (value,)
        if len(value) == 1 and (motions or value == (0,)):
            screws = [m.kind in joints.PITCHED for m in motions]
            all_have = name != "pitch" or not any(screws)
            value = tuple(value[0] if screw or all_have else 0.0 for screw in screws)
        usual[name] = value or usual[name]
    data.update(usual)


def _limits(value: Any, count: int) -> Any:
    """Return one pair or None per motion, expanding a single pair, or () if there are no bounds.

    All other values are rejected by the field.
    """
    if not isinstance(value, tuple):
        return value
    if len(value) == 2 and not any(isinstance(x, tuple) for x in value):
        value = (value,)
    value = tuple(map(_bound, value))
    if all(pair is None for pair in value):
        return ()
    return value * count if len(value) == 1 and count else value


def _bound(pair: Any) -> Any:
    """Return a pair with None for infinite bounds, or None if there are no finite bounds."""
    if isinstance(pair, tuple) and len(pair) == 2:
        pair = tuple(None if x == end else x for x, end in zip(pair, (-math.inf, math.inf)))
    return None if pair in ((), (None, None)) else pair


def _count(n: int) -> str:
    return {0: "no axes", 1: "one axis [x, y, z]"}.get(n, f"{n} axes, each [x, y, z]")
