"""The length of a body as a single number, and stretching a body to a new length (pure)."""

from __future__ import annotations

import math
from typing import Any

import numpy as np

import pgraph_core as pg
from pgraph_core.rotation import matrix

from ..core.cells import Refusal

SAME = 1e-6  # distance from the tip of points that move with it, relative to the length
ALONG = 0.999  # cosine within which a shape lies along its body
WHOLE = 0.6  # relative length from which a shape is stretched instead of moved
PARTS = ("constraints", "contacts", "forces")


def end_of(body: pg.Body) -> np.ndarray:
    """Return the vector (3,) from the joint to the tip, or to twice the centre of mass [m]."""
    return np.asarray(body.tip if body.tip is not None else 2 * np.asarray(body.com), float)


def stretched(model: pg.Model, names: tuple[str, ...], length: float) -> pg.Model:
    """Return the model with bodies stretched along their length. Whatever is at their tips moves
    along.

    Shapes along the body are stretched, and other shapes beyond its middle move with the tip. The
    joints of children and the points of constraints, contacts and forces at the tip also move with
    it. The mass is unchanged. The centre of mass, the inertia and all derived fields are updated.
    Raises Refusal, PgraphError.
    """
    if not 0 < length < math.inf:
        raise Refusal(f"must be > 0, got {length:g}")
    changes: dict[str, dict[str, Any]] = {}
    moved: dict[str, tuple[np.ndarray, np.ndarray]] = {}
    for name in names:
        body = model.body(name)
        end = end_of(body)
        old = float(np.linalg.norm(end))
        if old < 1e-9:
            raise Refusal(f"'{name}' has no length: give it a tip first")
        moved[name] = end, end * (length / old)
        changes.setdefault(name, {}).update(_own(body, end / old, old, length))
        for child in model.bodies:
            if child.parent == name and _at(child.link, end):
                changes.setdefault(child.name, {})["link"] = _tuple(moved[name][1])
    found = _points_moved(model.edit_all(changes), moved)
    for name in names:
        reached = float(np.linalg.norm(end_of(found.body(name))))
        if not math.isclose(reached, length, rel_tol=SAME):
            raise Refusal(
                f"would become {reached:.4g} m, as the length of '{name}' is twice the distance of "
                "its centre of mass, which follows from its shape: give it a tip first"
            )
    return found


def _own(body: pg.Body, u: np.ndarray, old: float, new: float) -> dict[str, Any]:
    """Return the changed fields of the body itself."""
    scale = np.eye(3) + (new / old - 1) * np.outer(u, u)
    change: dict[str, Any] = {}
    if body.shapes:
        change["shapes"] = tuple(_shape(s, u, old, new) for s in body.shapes)
    if "tip" not in body.derived and body.tip is not None:
        change["tip"] = _tuple(u * new)
    if "com" not in body.derived:
        change["com"] = _tuple(scale @ np.asarray(body.com))
    if "inertia" not in body.derived:
        inertia = np.asarray(body.inertia)
        spread = scale @ (np.trace(inertia) / 2 * np.eye(3) - inertia) @ scale
        found = np.trace(spread) * np.eye(3) - spread
        change["inertia"] = tuple(map(_tuple, (found + found.T) / 2))
    return change


def _shape(shape: pg.Shape, u: np.ndarray, old: float, new: float) -> pg.Shape:
    """Return a stretched shape."""
    more, place = new - old, np.asarray(shape.position)
    axes = matrix(shape.rotation)
    k = int(np.argmax(np.abs(u @ axes)))
    lies = abs(float(u @ axes[:, k])) > ALONG
    sizes: dict[str, Any] = {}
    if lies and shape.size is not None and shape.size[k] > WHOLE * old:
        size = list(shape.size)
        size[k] += more
        sizes = {"size": tuple(size)}
    elif lies and k == 2 and shape.length is not None and shape.length > WHOLE * old:
        sizes = {"length": shape.length + more}
    elif lies and shape.radii is not None and 2 * shape.radii[k] > WHOLE * old:
        radii = list(shape.radii)
        radii[k] += more / 2
        sizes = {"radii": tuple(radii)}
    if sizes:
        if min(np.atleast_1d(next(iter(sizes.values())))) <= 0:
            raise Refusal(f"is too short for its {shape.kind}, got {new:g} m")
        return shape.unchecked_copy({**sizes, "position": _tuple(place + more / 2 * u)})
    beyond = float(place @ u) > old / 2
    return shape.unchecked_copy({"position": _tuple(place + more * u)}) if beyond else shape


def _points_moved(model: pg.Model, moved: dict[str, tuple[np.ndarray, np.ndarray]]) -> pg.Model:
    """Move points of constraints, contacts and forces that were at an old tip to the new one."""
    for part in PARTS:
        items, any_moved = [], False
        for item in getattr(model, part):
            change = {}
            for field, owner in (("point", "body"), ("other_point", "other")):
                point, at = getattr(item, field, None), moved.get(getattr(item, owner, ""))
                if point is not None and at is not None and _at(point, at[0]):
                    change[field] = _tuple(at[1])
            points, at = getattr(item, "points", ()), moved.get(getattr(item, "body", ""))
            if at is not None and any(_at(p, at[0]) for p in points):
                change["points"] = tuple(_tuple(at[1]) if _at(p, at[0]) else p for p in points)
            for field in item.PLACES:
                places = tuple(_moved(place, moved) for place in getattr(item, field))
                if places != getattr(item, field):
                    change[field] = places
            any_moved = any_moved or bool(change)
            items.append({**model.cells(item, part), **change} if change else item)  # type: ignore[arg-type]
        if any_moved:
            model = model.replace(**{part: tuple(items)})
    return model


def _moved(place: Any, moved: dict[str, tuple[np.ndarray, np.ndarray]]) -> Any:
    """Return the point of a path, moved if it was at an old tip."""
    at = moved.get(place.body)
    if at is None or not _at(place.point, at[0]):
        return place
    return place.unchecked_copy({"point": _tuple(at[1])})


def _at(point: Any, end: np.ndarray) -> bool:
    return float(np.linalg.norm(np.asarray(point) - end)) <= SAME * float(np.linalg.norm(end))


def _tuple(v: Any) -> tuple[float, ...]:
    return tuple(float(x) + 0.0 for x in v)
