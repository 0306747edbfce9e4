"""Property cells of a body: displayed fields, and typed text as an edit.

Values are SI, formulas are shown as text. Some fields are shown in another form than stored: an
orientation as angles, an inertia about the frame's origin, a shape by its parts.
"""

from __future__ import annotations

import math
import re
from collections.abc import Sequence
from typing import Any, cast

import numpy as np

import pgraph_core as pg
from pgraph_core.fields import About, about
from pgraph_core.joints import COMBINED, DEFAULT, PER_MOTION, TRACKED, JointKind, units_of
from pgraph_core.model.shape import mass_properties_of
from pgraph_core.rotation import matrix, multiply, unit
from pgraph_core.shapes import KINDS as SHAPES
from pgraph_core.shapes import Sized, kind_of

from ..core.cells import (
    Display,
    Quantity,
    Refusal,
    content,
    quantity_in,
    replaced,
    valid_name,
    whole,
)
from . import track_cells
from .length import end_of

Entry = tuple[tuple[int, ...], str]  # index of a cell in its field, and what was typed
Content = Any  # nested tuples of numbers, formulas and None

DERIVED = ("mass", "com", "inertia", "tip")
ALL = "all"  # stands for all of these
NO_SHAPE = "none"
SLENDER = 0.1  # radius of a new shape over its length
LEAST = 0.05  # least length of a new shape [m]
UNKNOWN = (2 * LEAST * SLENDER,) * 3  # edges of a shape that has none among its fields [m]
NO_TURN = (1.0, 0.0, 0.0, 0.0)
HALF = math.sqrt(0.5)
Z_TO = ((HALF, 0.0, HALF, 0.0), (HALF, -HALF, 0.0, 0.0), NO_TURN)  # turns of z to x, to y, to z


def of_shape(field: str) -> tuple[int, str]:
    """Split a field name: "shape_size" gives (0, "size"), "shape_2_size" gives (2, "size")."""
    _, at, *name = field.split("_")
    return (int(at), "_".join(name)) if at.isdigit() else (0, "_".join((at, *name)))


def quantity_of(body: pg.Body, field: str, index: tuple[int, ...]) -> Quantity:
    """Return the quantity of a cell, which determines its unit on the page."""
    name = of_shape(field)[1] if field.startswith("shape_") else field
    if field == "mass":
        return "mass"
    if name == "rotation_euler" or (name == "rotation_axis" and index == (3,)):
        return "angle"
    if field in ("q", "v", "limits", "rest") and index:
        kinds = _of_coordinates(body, field)
        return kinds[index[0]] if index[0] < len(kinds) else "number"
    return quantity_in(shows(field).unit)


def shows(field: str) -> About:
    """Return the description of a field of a body or its shapes (shape_..., shape_1_...)."""
    of_a_shape = field.startswith("shape_")
    name = of_shape(field)[1] if of_a_shape else field
    if name in ("rotation_euler", "rotation_axis"):
        name = "rotation"
    known = (pg.Shape if of_a_shape else pg.Body).model_fields
    return about(known[name], name) if name in known else About(name)


def _of_coordinates(body: pg.Body, field: str) -> list[Quantity]:
    shown: dict[str, Quantity] = {"rad": "angle", "m": "length", "1": "number"}
    units = [units_of(m) for m in body.sequence]
    if field in ("q", "v"):
        return [shown[unit] for pair in units for unit in pair[field == "v"]]
    return [shown[q[0]] if len(q) == 1 else "number" for q, _ in units]


def held(model: pg.Model, body: pg.Body, field: str, display: Display) -> Content:
    """Return the content of the cells of a field."""
    if field.startswith("track_") and body.track:
        return {f: text for f, _, text in track_cells.rows(body.track, display)}[field]
    of_a_shape = field.startswith("shape_")
    at, name = of_shape(field) if of_a_shape else (0, field)
    if of_a_shape and at >= len(body.shapes):
        return NO_SHAPE if name == "kind" else None
    holder = body.shapes[at] if of_a_shape else body
    match name:
        case "rotation_euler":
            return euler_of(holder.rotation)
        case "rotation_axis":
            return axis_of(holder.rotation)
        case "colour":
            return hexadecimal(body.shapes[at].colour)
        case _ if of_a_shape:
            return _kept_shape(model, body, at).get(name)
        case "inertia" if display.about == "origin":
            return shifted(body.inertia, body.mass, body.com, 1.0)
        case "tip" if body.tip is None:
            return body.com
        case "limits":
            bounds = model.cells(body)["limits"] or (None,) * len(body.sequence)
            return tuple((None, None) if pair is None else pair for pair in bounds)
    value = model.cells(body)[field]
    if field in PER_MOTION and not isinstance(value, (tuple, list)):
        return (value,) * len(body.sequence)  # one formula for all
    return value


def edit_of(
    model: pg.Model, body: pg.Body, field: str, entries: Sequence[Entry], display: Display
) -> dict[str, Any]:
    """Return the `model.edit` arguments that store typed text in cells. Raises Refusal."""
    if field.startswith("shape_"):
        at, name = of_shape(field)
        if at > len(body.shapes) or (at == len(body.shapes) and name != "kind"):
            raise Refusal("no longer has this shape")
        if name == "kind":
            return _with_kind(body, at, entries[0][1])
        if name in ("role", "colour"):
            return _with_shape(model, body, at, {name: entries[0][1].strip() or None})
        if name == "end_radius" and not entries[0][1].strip():
            return _with_shape(model, body, at, {name: None})
    if field == "derived":
        return following(body, entries[0][1])
    if field == "axes" and len(entries[0][0]) == 1:
        (at,), text = entries[0]
        if at >= len(body.axes):
            raise Refusal("no longer has this axis")
        return {"axes": (*body.axes[:at], direction(text, display), *body.axes[at + 1 :])}
    if field.startswith("track_"):
        return track_cells.edit_of(body, field, entries[0][1], display)
    if field == "motions":
        motions = _motions(body, entries)
        return {"motions": motions} | _track_for(body, [kind for kind, _ in motions])
    if field == "joint":
        own = DEFAULT.get(cast(JointKind, entries[0][1]), ())
        return {field: entries[0][1]} | _track_for(body, [m.kind for m in own])
    if field == "parent":
        return {field: entries[0][1]}
    if field in ("name", "dof"):
        text = entries[0][1]
        return {field: valid_name(text) if field == "name" else whole(text, 0, 6)}
    if field == "tip" and any(not text.strip() for _, text in entries):
        return {"tip": None}
    value = held(model, body, field, display)
    for index, text in entries:
        if field == "limits" and not text.strip():
            new = None
        else:
            new = content(text, quantity_of(body, field, index), display, rate=field == "v")
        value = replaced(value, index, new)
        if field == "inertia" and len(index) == 2:
            value = replaced(value, (index[1], index[0]), new)
    return kept(model, body, field, value, display)


def _track_for(body: pg.Body, kinds: Sequence[str]) -> dict[str, Any]:
    """Return a first track for a new curve, or none for a joint that is no longer one."""
    if not set(TRACKED).isdisjoint(kinds):
        return {} if body.track else track_cells.begun(body)
    return {"track": None} if body.track else {}


def letter_of(axis: Sequence[Any]) -> str:
    """Return "x" or "-z" for an axis along a frame axis, or "" for any other axis."""
    for k, letter in enumerate("xyz"):
        for sign, name in ((1.0, letter), (-1.0, f"-{letter}")):
            if tuple(axis) == tuple(sign * (i == k) for i in range(3)):
                return name
    return ""


def direction(text: str, display: Display) -> tuple[Any, ...]:
    """Return an axis typed as "x", "-z" or three numbers. Raises Refusal."""
    typed = text.strip().lower()
    if re.fullmatch(r"[+-]?[xyz]", typed):
        sign = -1.0 if typed[0] == "-" else 1.0
        return tuple(sign * (letter == typed[-1]) for letter in "xyz")
    parts = re.split(r"[\s,;]+", typed.strip("[]() "))
    if len(parts) != 3:
        raise Refusal(f"must be x, y, z, with or without a minus, or three numbers, got {text!r}")
    return tuple(content(part, "number", display) for part in parts)


def kept(
    model: pg.Model, body: pg.Body, field: str, value: Content, display: Display
) -> dict[str, Any]:
    """Return the body fields that store the content of its cells."""
    of_a_shape = field.startswith("shape_")
    at, name = of_shape(field) if of_a_shape else (0, field)
    match name:
        case "rotation_euler":
            name, value = "rotation", from_euler(_numbers(value, "an angle"))
        case "rotation_axis":
            name, value = "rotation", from_axis(_numbers(value, "an axis"))
        case "inertia" if display.about == "origin":
            _numbers([x for row in value for x in row], "the inertia about the origin")
            value = shifted(value, body.mass, body.com, -1.0)
    return _with_shape(model, body, at, {name: value}) if of_a_shape else {name: value}


def _kept_shape(model: pg.Model, body: pg.Body, at: int) -> dict[str, Any]:
    """Return the fields of a shape. The fields of the first shape include formulas."""
    shape = model.cells(body)["shape"] if at == 0 else body.shapes[at]
    return dict(shape) if isinstance(shape, dict) else shape.model_dump()


def _with_shape(model: pg.Model, body: pg.Body, at: int, change: dict[str, Any]) -> dict[str, Any]:
    if not body.shapes:
        raise Refusal("has no shape; choose its kind first")
    kept = _kept_shape(model, body, at)
    return _with_shapes(body, at, kept | _between_its_ends(body, body.shapes[at], kept, change))


def _between_its_ends(
    body: pg.Body, shape: pg.Shape, kept: dict[str, Any], change: dict[str, Any]
) -> dict[str, Any]:
    """Extend `change` so that a capsule from joint to tip keeps its ends when its radius
    changes."""
    radius, kind = change.get("radius"), kind_of(shape)
    if not isinstance(radius, float) or not isinstance(kept.get("length"), float):
        return change
    if not isinstance(kind, Sized):
        return change
    width, whole = 2 * radius, kind.edges(shape)[2]
    spans = math.isclose(whole, float(np.linalg.norm(end_of(body))), rel_tol=1e-9)
    fits = spans and 0 < width < whole
    return change | kind.fitted((width, width, whole)) if fits else change


def _with_shapes(body: pg.Body, at: int, shape: Any) -> dict[str, Any]:
    """Return the shapes with one of them replaced, or removed if the new one is None."""
    if at == 0 and len(body.shapes) < 2:
        return {"shape": shape}
    new = () if shape is None else (shape,)
    return {"shapes": (*body.shapes[:at], *new, *body.shapes[at + 1 :])}


def _with_kind(body: pg.Body, at: int, kind: str) -> dict[str, Any]:
    """Change the kind of a shape, add a shape or remove one."""
    one = body.unchecked_copy({"shape": body.shapes[at] if at < len(body.shapes) else None})
    shape = _shape(one, kind)
    if shape is not None and at < len(body.shapes):
        old = body.shapes[at]
        shape |= {"role": old.role, "colour": old.colour, "opacity": old.opacity}
    change = _with_shapes(body, at, shape)
    return change if shape is not None or body.shapes[1:] else change | {"derived": ()}


def hexadecimal(colour: Sequence[float] | None) -> str:
    """Return "#rrggbb", or "" for a shape that has the colour of its body."""
    return "" if colour is None else "#" + "".join(f"{round(255 * c):02x}" for c in colour)


def following(body: pg.Body, what: str) -> dict[str, Any]:
    """Return the fields that derive `what` from the shapes, or from a rod if there are none.

    The density is chosen so that a derived mass keeps its value.
    """
    if what not in (*DERIVED, ALL):
        raise Refusal(f"must be one of {', '.join(DERIVED)}")
    wanted = DERIVED if what == ALL else (what,)
    change: dict[str, Any] = {"derived": tuple(dict.fromkeys((*body.derived, *wanted)))}
    shapes = body.shapes or (rod_of(body),)
    if not body.shapes:
        change["shape"] = shapes[0]
    if "mass" in wanted:
        full = mass_properties_of(shapes, 1.0).mass
        change["density"] = body.density or (body.mass / full if body.mass > 0 else 1000.0)
    return change


def rod_of(body: pg.Body) -> pg.Shape:
    """Return the rod along a body that has no shape."""
    return pg.Shape(**(_shape(body, "capsule") or {}))


def _numbers(value: Sequence[Any], what: str) -> list[float]:
    if any(isinstance(x, str) for x in value):
        raise Refusal(f"{what} takes numbers here; formulas go into the quaternion or the com form")
    return list(value)


# -- orientations ------------------------------------------------------------------------------


def euler_of(q: Sequence[float]) -> tuple[float, float, float]:
    """Return roll, pitch, yaw [rad]: R = Rot(z, yaw) Rot(y, pitch) Rot(x, roll), |pitch| <= π/2."""
    R = matrix(q)
    level = math.hypot(R[2, 1], R[2, 2])
    # at 90 degrees of pitch roll and yaw turn about one line: all of it is yaw
    roll = math.atan2(R[2, 1], R[2, 2]) if level > 1e-9 else 0.0
    s, c = math.sin(roll), math.cos(roll)
    yaw = math.atan2(s * R[0, 2] - c * R[0, 1], c * R[1, 1] - s * R[1, 2])
    return (roll, math.atan2(-R[2, 0], level), yaw)


def from_euler(angles: Sequence[float]) -> tuple[float, ...]:
    """Return the quaternion for roll, pitch and yaw [rad]."""
    (a, b, c), (i, j, k) = ([f(x / 2) for x in angles] for f in (math.cos, math.sin))
    return (
        a * b * c + i * j * k,
        i * b * c - a * j * k,
        a * j * c + i * b * k,
        a * b * k - i * j * c,
    )  # fmt: skip


def axis_of(q: Sequence[float]) -> tuple[float, float, float, float]:
    """Return the axis x, y, z and the angle from 0 to π [rad]. Without rotation the axis is z."""
    w, x, y, z = unit(q)
    if w < 0:
        w, x, y, z = -w, -x, -y, -z
    length = math.hypot(x, y, z)
    if length < 1e-15:
        return (0.0, 0.0, 1.0, 0.0)
    return (x / length, y / length, z / length, 2 * math.atan2(length, w))


def from_axis(value: Sequence[float]) -> tuple[float, ...]:
    """Return the quaternion for an axis of any length and an angle [rad]. Raises Refusal."""
    *axis, angle = value
    length = math.hypot(*axis)
    if not 1e-9 < length < 1e9:
        raise Refusal(f"a direction must not be zero, got {axis}")
    return (math.cos(angle / 2), *(math.sin(angle / 2) * x / length for x in axis))


# -- inertia -----------------------------------------------------------------------------------


def shifted(
    inertia: Content, mass: float, com: Sequence[float], sign: float
) -> tuple[tuple[float, ...], ...]:
    """Shift an inertia from the centre of mass to the origin (+1) or back (-1) (Steiner)."""
    c = np.asarray(com)
    new = np.asarray(inertia, float) + sign * mass * (c @ c * np.eye(3) - np.outer(c, c))
    return tuple(tuple(float(x) for x in row) for row in new)


def moments(inertia: Content) -> tuple[float, float, float]:
    """Return the principal moments in ascending order [kg m²]."""
    a, b, c = np.linalg.eigvalsh(np.asarray(inertia, float))
    return float(a), float(b), float(c)


def possible(inertia: Content) -> tuple[tuple[float, ...], ...]:
    """Return the possible inertia nearest to an impossible one, with no negative spread of mass.

    tr(I)/2 - I describes the distribution of mass along each axis. Negative values are set to zero,
    which enforces the triangle inequality.
    """
    found = np.asarray(inertia, float)
    found = (found + found.T) / 2
    spread, axes = np.linalg.eigh(np.trace(found) / 2 * np.eye(3) - found)
    spread = np.maximum(spread, 0.0)
    new = axes @ np.diag(spread.sum() - spread) @ axes.T
    new = (new + new.T) / 2
    return tuple(tuple(float(x) for x in row) for row in new)


def mended(body: pg.Body, field: str, change: dict[str, Any]) -> dict[str, Any] | None:
    """Find the nearest valid edit for use as a repair, if the field has one."""
    value: Any = change.get(field)
    match field:
        case "inertia" if not any(isinstance(x, str) for row in value for x in row):
            return {"inertia": possible(value)}
        case "rotation" if not any(isinstance(x, str) for x in value) and math.hypot(*value) > 0:
            return {"rotation": unit(value)}
        case "q" if [m.facts.attitude for m in body.sequence] == [True]:
            *place, w, x, y, z = value
            if not any(isinstance(x, str) for x in value) and math.hypot(w, x, y, z) > 0:
                return {"q": (*place, *unit((w, x, y, z)))}
    return None


# -- shapes and motions ------------------------------------------------------------------------


def _shape(body: pg.Body, kind: str) -> dict[str, Any] | None:
    """Return a shape of this kind with about the size and position of the body's old one."""
    if kind == NO_SHAPE:
        return None
    if kind not in SHAPES:
        raise Refusal(f"must be one of {', '.join((NO_SHAPE, *SHAPES))}")
    own = SHAPES[kind]
    if not isinstance(own, Sized):
        raise Refusal(own.elsewhere)
    length, radius, position, rotation = extent(body)
    edges = (2 * radius, 2 * radius, length)
    if own.edged and (old := _edges(body.shape)) is not None:  # keep the edges
        assert body.shape is not None
        edges, rotation = old, body.shape.rotation
    elif own.edged and np.isclose(turn := np.abs(matrix(rotation)), turn.round()).all():
        # turned by right angles: what is typed for its edges is along the axes of the body
        edges, rotation = tuple((turn.round() @ edges).tolist()), NO_TURN
    return {"kind": kind, **own.fitted(edges), "position": position, "rotation": rotation}


def _edges(shape: pg.Shape | None) -> tuple[float, ...] | None:
    """Return the edges (3,) of a shape given by them, such as a box, or None for other shapes."""
    own = None if shape is None else kind_of(shape)
    return own.edges(shape) if own is not None and own.edged else None


def extent(
    body: pg.Body,
) -> tuple[float, float, tuple[float, ...], tuple[float, ...]]:
    """Return (length along z, radius, middle, quaternion) of a rod that represents a body."""
    shape = body.shape
    if shape is not None and (edges := _edges(shape)) is not None:
        k = max((2, 0, 1), key=lambda i: edges[i])
        rest = [x for i, x in enumerate(edges) if i != k]
        return edges[k], min(rest) / 2, shape.position, multiply(shape.rotation, Z_TO[k])
    if shape is not None:
        width, _, length = kind_of(shape).edges(shape) or UNKNOWN
        return length, width / 2, shape.position, shape.rotation
    end = body.tip if body.tip is not None else tuple(2 * x for x in body.com)
    length = math.hypot(*end)
    if length < 1e-6:
        return LEAST, LEAST / 2, (0.0, 0.0, 0.0), (1.0, 0.0, 0.0, 0.0)
    x, y, z = (c / length for c in end)
    turn = (1 + z, -y, x, 0.0) if z > -1 + 1e-9 else (0.0, 1.0, 0.0, 0.0)  # z of the rod to `end`
    return length, SLENDER * length, tuple(c / 2 for c in end), unit(turn)


def _motions(body: pg.Body, entries: Sequence[Entry]) -> tuple[Any, ...]:
    """Return the motions of a compound joint with one replaced, added or removed."""
    motions: list[Any] = list(body.motions)
    for index, text in entries:
        i = index[0] if index else len(motions)  # without: one more
        if not text:
            del motions[i : i + 1]
        elif text not in COMBINED:
            raise Refusal(f"must be one of {', '.join(COMBINED)}")
        elif i < len(motions):
            motions[i] = (text, motions[i][1])
        else:
            free = [a for a in np.eye(3).tolist() if (text, tuple(a)) not in motions]
            motions.append((text, tuple((free or [[0.0, 0.0, 1.0]])[0])))
    if not motions:
        raise Refusal("a joint without motions is a weld; choose that kind")
    return tuple(motions)
