"""Points of parts: where they act by default, those of contacts and those along paths (pure)."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from itertools import pairwise
from typing import Any

import numpy as np

import pgraph_core as pg
from pgraph_core.forces import BetweenPoints
from pgraph_core.rotation import matrix

from ..core.cells import Display, Refusal, content, replaced
from ..core.state import derive
from . import riding
from .cables import WHEEL
from .curves import plain
from .gains import EVERY, GROUND

Item = Any  # pg.Constraint | pg.Contact | pg.Force | pg.Site | pg.Output
Places = Mapping[str, tuple[np.ndarray, np.ndarray]]  # body name -> position, rotation at home
FRICTIONS = ("friction", "static_friction", "rolling_friction", "spinning_friction")


def at_home(names: Sequence[str], positions: np.ndarray, wxyz: np.ndarray) -> Places:
    """Return the home position and rotation matrix for each body name and for the ground."""
    ground = {GROUND: (np.zeros(3), np.eye(3))}
    return ground | {n: (p, matrix(q)) for n, p, q in zip(names, positions, wxyz)}


def implied(model: pg.Model, item: Item, field: str, at: Places) -> Any:
    """Return the displayed default of a missing field, or None."""
    match item, field:
        case pg.Constraint(), "point":
            return model.point_of(item)
        case BetweenPoints() | pg.Bushing(), "point":
            return model.body(item.body).tip_point
        case (pg.Wrench(), "point") | (BetweenPoints() | pg.Rolling(), "other_point"):
            return (0.0, 0.0, 0.0)
        case (pg.Constraint(), "other_point"):
            p, R = at[item.body]
            place, turn = at[item.pair[1]]
            found = turn.T @ (p + R @ np.asarray(model.point_of(item)) - place)
            return tuple(float(x) + 0.0 for x in found)
        case (pg.Distance(), "length") | (pg.Spring(), "rest"):
            there = along(model, item, at)
            return sum(float(np.linalg.norm(a - b)) for a, b in pairwise(there))
        case pg.Contact(), "restitution":
            return model.ground.restitution
        case pg.Contact(), _ if field in FRICTIONS:
            return item.frictions(model.ground)[FRICTIONS.index(field)]
        case pg.Torsion(), "axis":
            return (0.0, 0.0, 1.0)
        case _, "rotation":
            return (1.0, 0.0, 0.0, 0.0)
    return None


def along(model: pg.Model, item: Item, at: Places) -> list[np.ndarray]:
    """Return the world positions [m] of all points of a force or distance, from end to end."""
    point = item.point or implied(model, item, "point", at)
    path = [(item.body, point), *((x.body, x.point) for x in item._places)]
    path.append((item.other, item.other_point or (0.0, 0.0, 0.0)))
    return [at[name][0] + at[name][1] @ np.asarray(x) for name, x in path]


def points(
    model: pg.Model,
    item: pg.Contact,
    data: dict[str, Any],
    index: tuple[int, ...],
    text: str,
    display: Display,
) -> tuple[Any, ...]:
    """Return the contact points after a number was typed, or a point was added or removed."""
    points = tuple(data["points"])
    if len(index) == 2:
        return replaced(points, index, content(text, "length", display))
    if text:
        tip = model.body(item.body).tip_point if item.body != EVERY else (0.0, 0.0, 0.0)
        return (*points, tip)
    return tuple(p for i, p in enumerate(points) if i != index[0])


OF_VIA = tuple(pg.Via.model_fields)  # whose numbers stand in the indices of their cells
BESIDE = 0.4  # largest radius of a new obstacle over the distance to the nearest other point
ELLIPSOIDS = ("radii", "rotation")  # fields of these alone, and those of spheres and cylinders
ROUND = ("radius", "axis", "inner")


def belongs(key: str, place: pg.Via) -> bool:
    """Check whether a field of a point of a path is shown for it."""
    if key == "point" or not place.is_obstacle:
        return key == "point"
    return key not in (("axis", "inner") if place.radii is not None else ("rotation",))


def path(
    model: pg.Model,
    item: Item,
    old: Any,
    index: tuple[int, ...],
    text: str,
    display: Display,
    at: Places,
) -> tuple[Any, ...]:
    """Return the points of a path after a cell was typed, or a point was added or removed.

    A new point is in the middle of the last span, so that the path is as it was, and also where a
    point gets another body.
    """
    places = [dict(plain(place)) for place in old]
    if not index:
        *_, a, b = along(model, item, at)
        return (*places, _on(text.strip(), 0.5 * (a + b), at))
    if index[0] >= len(places):
        raise Refusal("no longer has this point")
    if len(index) == 1:
        return tuple(place for i, place in enumerate(places) if i != index[0])
    i, number, *component = index
    if number >= len(OF_VIA):
        raise Refusal("no longer has this entry")
    place, key = places[i], OF_VIA[number]
    if key == "body":
        place |= _on(text.strip(), along(model, item, at)[i + 1], at)
    elif not text.strip() and key != "point":
        cleared = {key, *pg.Via.FOLLOWERS.get(key, ())}
        place = places[i] = {name: x for name, x in place.items() if name not in cleared}
    elif key == "inner":
        place[key] = True
    elif key == "shifts":
        place[key] = riding.shifts_of(model, text)
    elif key == "when":
        place[key] = riding.range_of(model, text)
    else:
        new = content(text, "number" if key in ("axis", "rotation") else "length", display)
        others = {"radius": ELLIPSOIDS, "radii": ROUND}.get(key, ())
        place = places[i] = {name: x for name, x in place.items() if name not in others}
        start = {"radii": (new,) * 3, "rotation": (1.0, 0.0, 0.0, 0.0)}.get(key, (0.0, 0.0, 0.0))
        old = new if key == "radius" else tuple(place.get(key) or start)
        place[key] = replaced(old, tuple(component), new)
    return tuple(places)


def round_at(model: pg.Model, item: Item, i: int, at: Places) -> float:
    """Return the radius of a new obstacle at point i of a path [m]."""
    there, size = along(model, item, at), WHEEL * derive(model).size
    apart = (float(np.linalg.norm(x - there[i + 1])) for k, x in enumerate(there) if k != i + 1)
    return float(f"{min(size, BESIDE * min(apart)) or size:.1g}")


def _on(name: str, place: np.ndarray, at: Places) -> dict[str, Any]:
    """Return the body and the point in its axes of a place in world axes [m]. Raises Refusal."""
    if name not in at:
        raise Refusal(f"no body is named '{name}'")
    p, R = at[name]
    return {"body": name, "point": tuple(float(x) + 0.0 for x in R.T @ (place - p))}
