"""Cables and ropes: their stations, as they are picked and typed (pure)."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from typing import Any, NamedTuple

import numpy as np

import pgraph_core as pg
from pgraph_core.model.poses import Pose, poses
from pgraph_core.packing.cable_lines import faults_of
from pgraph_core.rotation import matrix, unit_vector
from pgraph_core.shapes import kind_of

from ..core.cells import Display, Refusal, content, quoted, replaced
from ..core.state import derive, of_model
from .curves import plain
from .gains import GROUND

Fields = dict[str, Any]  # those of a pg.Pulley
Vector = tuple[float, float, float]
WHEEL = 0.05  # radius of a wheel without a round shape, relative to the model
OVER = 0.2  # least height of a point on the ground over its neighbour, relative to the model
STRETCH = 0.002  # strain of a new elastic cable under the weight of all bodies
DAMPED = 0.05  # damping ratio of the same cable
SURE = 1e-3  # rad: least bend of the line through the centres at which the side follows from it
ON_AXIS = 1e-6  # [1] distance and angle from a hinge at which a shape is a wheel on it
OF_STATION = tuple(pg.Pulley.model_fields)  # whose numbers stand in the indices of their cells
UP = "up"  # a text of a row's button: one place up
SIDES = (("", "as it bends"), ("1", "1: right hand"), ("-1", "-1: left hand"))
GRIPS = (("", "grips if on its hinge"), ("yes", "grips"), ("no", "slides"))


def leads(kind: str) -> bool:
    """Check whether a part of that kind leads through any number of stations."""
    known = pg.Constraint.KINDS.get(kind) or pg.Force.KINDS.get(kind)
    return known is not None and "through" in known.model_fields


@of_model
def faults(model: pg.Model) -> Mapping[str, str]:
    """Return the reason why a cable or rope cannot lie on its wheels, by its name."""
    return faults_of(pg.Mechanism(model).packed)


# -- stations --------------------------------------------------------------------------------------


def station(model: pg.Model, name: str, point: Vector | None = None) -> Fields:
    """Return a wheel about the hinge of a body, or a point of another one.

    The wheel has the radius of a round shape on its hinge. The point is the origin of what slides,
    and the tip of another body, if it has one.
    """
    if name == GROUND:
        return {"body": name, **({} if point is None else {"point": point})}
    body = model.body(name)
    axis = hinge_of(body)
    if axis is None:
        slides = bool(body.sequence) and not any(m.facts.turns for m in body.sequence)
        tip = None if slides else body.tip
        return {"body": name, "point": point or tip or (0.0, 0.0, 0.0)}
    found = next(filter(None, (_round(shape, axis) for shape in body.shapes)), None)
    if found is not None:
        return {"body": name, "point": found[0], "radius": found[1]}
    return {"body": name, "radius": usual_radius(model)}


def usual_radius(model: pg.Model) -> float:
    """Return the radius of a wheel that no shape tells [m]."""
    return float(f"{WHEEL * derive(model).size:.1g}")


def hinge_of(body: pg.Body) -> np.ndarray | None:
    """Return the axis of a hinge (3,) in the axes of its body, or None for another joint."""
    facts = [m.facts for m in body.sequence]
    if not (len(facts) == 1 and facts[0].single and facts[0].turns and not facts[0].travels):
        return None
    return np.asarray(unit_vector(body.sequence[0].axis))


def _round(shape: pg.Shape, axis: np.ndarray) -> tuple[Vector, float] | None:
    """Return the centre and radius of a round shape on a hinge, or None."""
    rolls, at = kind_of(shape).rolls, np.asarray(shape.position, float)
    if not rolls or shape.radius is None:
        return None
    along = matrix(shape.rotation)[:, 2] if rolls == "disc" else axis
    off = max(
        np.linalg.norm(np.cross(axis, at)) / shape.radius, np.linalg.norm(np.cross(axis, along))
    )
    if off > ON_AXIS:
        return None
    x, y, z = (float(c) for c in at)
    return (x, y, z), float(shape.radius)


def bare(model: pg.Model, through: Sequence[pg.Pulley]) -> list[tuple[pg.Pulley, Any]]:
    """Return the wheels that no round shape shows, each with its axis (3,) in its body's axes."""
    found = []
    for one in through:
        axis = _axis(model, {"body": one.body, "axis": one.axis}) if one.radius else None
        if axis is None:
            continue
        axis = unit_vector(axis)
        shapes = () if one.body == GROUND else model.body(one.body).shapes
        if (one.point, one.radius) not in (_round(shape, axis) for shape in shapes):
            found.append((one, axis))
    return found


class Lie(NamedTuple):
    """A station in the initial state, in world axes."""

    centre: np.ndarray  # (3,) [m]
    radius: float
    axis: np.ndarray  # (3,) unit vector, zero for a point


def _lies(model: pg.Model, stations: Sequence[Fields], at: Mapping[str, Pose]) -> list[Lie]:
    found = []
    for one in stations:
        pose, radius = at[one["body"]], number_of(one.get("radius"))
        axis = _axis(model, one) if radius else None
        turned = np.zeros(3) if axis is None else pose.rotation @ unit_vector(axis)
        point = _numbers(one.get("point") or (0.0, 0.0, 0.0))
        found.append(Lie(pose.place(point), radius, turned))
    return found


def _axis(model: pg.Model, one: Fields) -> Any:
    """Return the axis of a wheel in the axes of its body, or None if it needs one."""
    if (axis := one.get("axis")) is not None:
        given = _numbers(axis)
        return given if any(given) else None
    name = one["body"]
    return None if name == GROUND else hinge_of(model.body(name))


def number_of(value: Any) -> float:
    """Return a number, or 1 in place of a formula, which only the model evaluates."""
    return 1.0 if isinstance(value, str) else float(value or 0.0)


def _numbers(value: Any) -> tuple[float, ...]:
    return tuple(0.0 if isinstance(x, str) else float(x) for x in value)


# -- what nobody has said yet ----------------------------------------------------------------------


def settled(model: pg.Model, stations: Sequence[Fields], closed: bool) -> tuple[Fields, ...]:
    """Return stations with points on the ground, axes and uncertain sides that nobody has given.

    A point of the ground is above its neighbour. A wheel without a hinge turns in the plane of its
    neighbours. At a drum, the cable leaves as it does a wheel next to it, or as upright as it can.
    """
    at, found = poses(model.standing), [dict(one) for one in stations]
    for k, one in enumerate(found):
        if one["body"] == GROUND and "point" not in one:
            one["point"] = _hung(model, found, k, at)
    for k, one in enumerate(found):
        if number_of(one.get("radius")) and _axis(model, one) is None:
            one["axis"] = _normal(model, found, k, at)
    lies, last = _lies(model, found, at), len(found) - 1
    wheels = [k for k, lie in enumerate(lies) if lie.axis.any()]
    known: dict[int, float] = {}  # the sense of a wheel about the axis of the first one
    open_ = []
    for k in wheels if last else ():
        same = _sign(float(lies[k].axis @ lies[wheels[0]].axis))
        if found[k].get("side") is not None:
            known[k] = same * found[k]["side"]
        elif bend := 0.0 if k in (0, last) and not closed else _bend(lies, k, closed):
            known[k] = same * bend
        else:
            open_.append(k)
    for k in open_:
        same = _sign(float(lies[k].axis @ lies[wheels[0]].axis))
        beside = [j % len(found) for j in (k - 1, k + 1) if closed or 0 <= j <= last]
        sense = next((known[j] for j in beside if j in known), None)
        if sense is None:
            sense = same * (_upright(model, lies, k) if k in (0, last) and not closed else 1.0)
        known[k] = sense
        found[k]["side"] = int(same * sense)
    return tuple(found)


def _sign(x: float) -> float:
    return -1.0 if x < 0.0 else 1.0


def _up(model: pg.Model) -> np.ndarray:
    return np.eye(3)["xyz".index(model.up)]


def _bend(lies: Sequence[Lie], k: int, closed: bool) -> float:
    """Return 1 or -1, in which sense the line through the centres turns about a wheel, or 0."""
    u, n = lies[k].axis, len(lies)
    before = lies[k].centre - lies[(k - 1) % n].centre
    after = lies[(k + 1) % n].centre - lies[k].centre
    first, second = (x - (x @ u) * u for x in (before, after))
    bend = math.atan2(float(u @ np.cross(first, second)), float(first @ second))
    return 0.0 if not SURE < abs(bend) < math.pi - SURE else _sign(bend)


def _upright(model: pg.Model, lies: Sequence[Lie], k: int) -> float:
    """Return the sense about its axis in which a cable is the nearest to upright at a drum."""
    u, r = lies[k].axis, lies[k].radius
    other = lies[k + 1 if k == 0 else k - 1]
    v = other.centre - lies[k].centre
    v = v - (v @ u) * u
    far = float(np.linalg.norm(v))
    if far <= r:
        return 1.0
    across, cosine = np.cross(u, v / far), r / far
    best = []
    for sense in (1.0, -1.0):
        # it leaves along u × its radius; seen from the last station it comes in there
        way = sense if k == 0 else -sense
        touch = r * (cosine * v / far - way * math.sqrt(1.0 - cosine**2) * across)
        span = (v - touch) / np.linalg.norm(v - touch)
        best.append((float(f"{abs(span @ _up(model)):.6g}"), sense))
    return max(best)[1]


def _hung(model: pg.Model, stations: Sequence[Fields], k: int, at: Mapping[str, Pose]) -> Vector:
    """Return a point of the ground above the next station, beside its wheel."""
    up, size, last = _up(model), derive(model).size, len(stations) - 1
    lies = _lies(model, stations, at)
    if 0 < k < last:
        middle = 0.5 * (lies[k - 1].centre + lies[k + 1].centre)
        return _rounded(middle + OVER * size * up, size)
    near, beyond = (k + 1, k + 2) if k == 0 else (k - 1, k - 2)
    one, u = lies[near], lies[near].axis
    aside = np.cross(u, up) if u.any() else np.zeros(3)
    if aside.any():
        aside = aside / np.linalg.norm(aside)
        away = lies[beyond].centre - one.centre if 0 <= beyond <= last else aside
        aside = -_sign(float(away @ aside)) * one.radius * aside
    tops = [float(x.centre @ up) for j, x in enumerate(lies) if j != k]
    rise = max(max(tops) - float(one.centre @ up), OVER * size)
    return _rounded(one.centre + aside + rise * up, size)


def _normal(model: pg.Model, stations: Sequence[Fields], k: int, at: Mapping[str, Pose]) -> Vector:
    """Return the axis of a wheel in its body: as a wheel beside it, as its shape, or across its
    spans."""
    lies, one = _lies(model, stations, at), stations[k]
    turn = at[one["body"]].rotation
    beside = [j for j in (k - 1, k + 1) if 0 <= j < len(lies)]
    shapes = () if one["body"] == GROUND else model.body(one["body"]).shapes
    found = [lies[j].axis for j in beside]
    found += [turn @ matrix(x.rotation)[:, 2] for x in shapes if kind_of(x).rolls == "disc"]
    if len(beside) == 2:
        before, after = (lies[j].centre - lies[k].centre for j in beside)
        long = float(np.linalg.norm(before) * np.linalg.norm(after))
        found.append(np.cross(before, after) / (long or 1.0))
    found.append(np.eye(3)[1 if model.up == "z" else 2])  # the axis of the front view
    u = next(u for u in found if np.linalg.norm(u) > SURE)
    x, y, z = (round(float(c), 9) + 0.0 for c in turn.T @ (u / np.linalg.norm(u)))
    return x, y, z


def _rounded(point: np.ndarray, size: float) -> Vector:
    digits = 4 - math.floor(math.log10(max(size, 1e-9)))
    x, y, z = (round(float(c), digits) + 0.0 for c in point)
    return x, y, z


# -- new ones --------------------------------------------------------------------------------------


def begun(
    model: pg.Model, kind: str, stations: Sequence[Fields], closed: bool = False
) -> dict[str, Any]:
    """Return the fields of a new cable or rope. A cable is stiff for the weight of all bodies."""
    found: dict[str, Any] = {"through": settled(model, stations, closed), "closed": closed}
    if kind == "cable":
        mass = sum(body.mass for body in model.bodies) or 1.0
        weight = mass * (math.hypot(*model.gravity) or 1.0)
        k = weight / (STRETCH * derive(model).size)
        found |= {
            "stiffness": float(f"{k:.1g}"),
            "damping": float(f"{2 * DAMPED * math.sqrt(k * mass):.1g}"),
        }
    return found


# -- rows of a form --------------------------------------------------------------------------------


def changed(
    model: pg.Model, data: Fields, index: tuple[int, ...], text: str, display: Display
) -> tuple[Fields, ...]:
    """Return the stations after text was typed or chosen in a row, or a row was added, moved or
    taken out. Raises Refusal."""
    stations = [{"point": (0.0, 0.0, 0.0), **plain(one)} for one in data["through"]]
    if not index:
        if stations and not data["closed"]:
            stations[-1]["side"] = None  # the last station no longer winds the cable
        return settled(model, [*stations, station(model, _body(model, text))], data["closed"])
    k, *cell = index
    if k >= len(stations):
        raise Refusal("no longer has this station")
    if not cell:
        if text == UP and k:
            stations[k - 1 : k + 1] = stations[k], stations[k - 1]
        elif text != UP:
            del stations[k]
        return settled(model, stations, data["closed"])
    number, *component = cell
    if number >= len(OF_STATION):
        raise Refusal("no longer has this entry")
    one, key = stations[k], OF_STATION[number]
    empty = not text.strip()
    match key:
        case "body":
            stations[k] = station(model, _body(model, text))
            return settled(model, stations, data["closed"])
        case "side":
            one["side"] = chosen(SIDE_OF, text)
        case "grip":
            one["grip"] = chosen(GRIP_OF, text)
            one["friction"] = None if text else one.get("friction")
        case "friction":
            one["friction"] = None if empty else content(text, "number", display)
            one["grip"] = one.get("grip") if empty else None  # an inner wheel may slip
        case "axis" if empty:
            one["axis"] = None
        case "radius":
            one["radius"] = 0.0 if empty else content(text, "length", display)
            if one["radius"] == 0.0:
                one |= dict.fromkeys(pg.Pulley.OF_WHEELS)
            else:
                return settled(model, stations, data["closed"])
        case _:
            of = "length" if key == "point" else "number"
            given = _axis(model, one) if key == "axis" and not one.get(key) else one.get(key)
            old = (0.0, 0.0, 0.0) if given is None else tuple(given)
            one[key] = replaced(old, tuple(component), content(text, of, display))
    return tuple(stations)


SIDE_OF = {"": None, "1": 1, "-1": -1}
GRIP_OF = {"": None, "yes": True, "no": False}


def chosen(values: Mapping[str, Any], text: str) -> Any:
    """Return the value of a choice. Raises Refusal."""
    if text not in values:
        raise Refusal(f"must be one of {', '.join(filter(None, values))}, got {quoted(text)}")
    return values[text]


def _body(model: pg.Model, text: str) -> str:
    name = text.strip()
    if name != GROUND and name not in {body.name for body in model.standing}:
        raise Refusal(f"no body is named '{name}'")
    return name


def word(k: int, one: pg.Pulley, count: int, closed: bool) -> str:
    """Return what a station is: 'wheel', 'drum' or 'point'."""
    if not one.radius:
        return "point"
    return "wheel" if closed or 0 < k < count - 1 else "drum"


def implied_axis(model: pg.Model, one: pg.Pulley) -> Vector | None:
    """Return the axis that a wheel has by default, or None without a hinge of its own."""
    axis = None if one.body == GROUND else hinge_of(model.body(one.body))
    if axis is None:
        return None
    x, y, z = (float(c) for c in axis)
    return x, y, z
