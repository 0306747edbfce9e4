"""Copies of a branch of the tree, either unchanged or mirrored from left to right."""

from __future__ import annotations

import re
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from typing import Any

from ..curves import VectorTable
from ..fields import GROUND, AtPoint, Frozen, OfSums, Quat, Vec3, facts
from ..forces import Between, BetweenPoints, Force, Wrench
from ..joints import DIRECTED, SIZE, Motion
from ..rotation import multiply
from ..shapes import kind_of
from .beam import Beam
from .body import Body, Shape
from .constraint import Constraint
from .contact import Contact
from .curve_point import CurvePoint
from .editing import free_name, renamed
from .expressions import (
    drives_read,
    expressions_of,
    named_in,
    read_by,
    read_through,
    renamed_in,
)
from .joint_constraint import OfOne, OfTwo
from .output import Output, Site
from .parameters import LONGEST_FORMULA, Formula, at, negated, ordered, probed
from .scenario import Scenario

Names = Mapping[str, str]  # names of the copies by old names


def branch(rows: Sequence[Body], roots: Iterable[str]) -> list[str]:
    """Return the names of `roots` and all their descendants, in row order."""
    children: dict[str, list[str]] = {}
    for body in rows:
        children.setdefault(body.parent, []).append(body.name)
    found, stack = set(), list(roots)
    while stack:
        name = stack.pop()
        if name not in found:
            found.add(name)
            stack += children.get(name, ())
    return [body.name for body in rows if body.name in found]


def names_of_copies(
    names: Iterable[str], taken: Iterable[str], name: Callable[[str], str]
) -> dict[str, str]:
    """Return an unused name for each copy."""
    used, found = set(taken), {}
    for old in names:
        found[old] = free_name(name(old), used)
        used.add(found[old])
    return found


def copied(
    parts: Mapping[str, Sequence[Any]],
    formulas: Sequence[Formula],
    root: Body,
    names: Names,
    mirror: Mirror | None = None,
    places: Sequence[Body] = (),
) -> tuple[dict[str, Any], list[str]]:
    """Return all parts including copies for the copied bodies, and a list of parts that cannot be
    copied.

    Parts between a copied body and another one connect the copy to the same other body. `places`
    are bodies that stand for places on beams.
    """
    bodies = _rows(parts["bodies"], names, mirror)
    known = {body.name: body for body in (*parts["bodies"], *places)}
    copy = _Copy(names, mirror, root, known, parts)
    found: dict[str, Any] = {"bodies": bodies, "beams": _rows(parts["beams"], names, mirror)}
    called: dict[str, Names] = {"bodies": names, "beams": names}  # names of the copies of each kind
    for kind in ("constraints", "contacts", "sites", "outputs", "forces"):
        copy.names = {**names, **called["sites"]} if kind == "outputs" else names
        new, called[kind] = copy.parts(parts[kind])
        found[kind] = (*parts[kind], *new)
        copy.called = called.get("outputs", {})
    found["scenarios"] = tuple(copy.scenario(s, called) for s in parts["scenarios"])
    lost = list(dict.fromkeys(copy.lost))
    new = (x for f in formulas for x in copy.formulas(f, parts[f.part], called[f.part]))
    found["formulas"] = ordered((*formulas, *new))
    return found, lost


def _rows(rows: Sequence[Any], names: Names, mirror: Mirror | None) -> tuple[Any, ...]:
    """Return bodies or beams with the copies in the rows below the last original."""
    last = max((i for i, body in enumerate(rows) if body.name in names), default=len(rows) - 1)
    new = []
    for body in rows:
        if body.name in names:
            copy = body if mirror is None else mirror.row(body)
            parent = names.get(body.parent, body.parent)
            new.append(copy.unchecked_copy({"name": names[body.name], "parent": parent}))
    return (*rows[: last + 1], *new, *rows[last + 1 :])


def _numbers(one: Any, two: Any) -> Iterator[tuple[tuple[int, ...], float, float]]:
    """Yield (place, number, number) of two numbers, or of two nested tuples of equal lengths."""
    if isinstance(one, tuple):
        for k, (x, y) in enumerate(zip(one, two)):
            for place, a, b in _numbers(x, y):
                yield (k, *place), a, b
    elif isinstance(one, (int, float)):
        yield (), one, two


class _Copy:
    """A copier for parts that act on bodies, which also records parts without a mirror image."""

    def __init__(
        self, names: Names, mirror: Mirror | None, root: Body, known: Mapping[str, Body],
        parts: Mapping[str, Sequence[Any]],
    ):  # fmt: skip
        self.names, self.mirror, self.root, self.known = names, mirror, root, known
        self.outputs, self.controls = parts["outputs"], parts["controls"]
        self.called: Names = {}  # the copies of outputs
        self.lost: list[str] = []

    def name(self, name: str) -> str:
        return name if self.mirror is None else other_side(name)

    def parts(self, parts: Sequence[Any]) -> tuple[list[Any], Names]:
        """Return copies of the parts that touch a copied body, with unused names."""
        new = [copy for copy in map(self.part, parts) if copy is not None]
        own = names_of_copies([p.name for p in new], [p.name for p in parts], self.name)
        return [p.unchecked_copy({"name": own[p.name]}) for p in new], own

    def part(self, part: Any) -> Any:
        """Return the copy of a constraint, contact or force under its old name, or None."""
        if self.names.keys().isdisjoint(part.touches):
            return None
        copy = renamed(part, self.names)
        if isinstance(part, (Contact, Force)):
            if self._shared(part):
                text = "was not copied: it reads a control or a drive of the original"
                self.lost.append(f"{part.word()} '{part.name}' {text}")
                return None
            copy = copy.unchecked_copy(renamed_in(copy, self.called, "out"))
        if self.mirror is not None:
            change = self.reflected(part)
            if change is None:
                self.lost.append(
                    f"{part.word()} '{part.name}' was not copied: it has no mirror image"
                )
                return None
            copy = renamed(copy.unchecked_copy(change), self.names)  # points of the original
        return copy

    def _shared(self, part: Contact | Force) -> bool:
        """Check whether a part reads a drive, or a control that follows the original branch."""
        if drives_read(part):
            return True
        through = read_through(part, self.controls)
        if any(named_in(c, "force") for c in through):
            return True
        read = {name for c in through for name, _ in read_by(c, self.outputs)}
        return bool(read) if self.mirror else not read.isdisjoint(self.names)

    def formulas(self, f: Formula, parts: Sequence[Any], called: Names) -> list[Formula]:
        """Return the formulas for the cells of the copy that depend on this one, with their signs.

        There are none for a number, or if the copy depends on the formula in another way.
        """
        if f.name not in called:
            return []
        part = next(x for x in parts if x.name == f.name)
        path = tuple(self.names.get(str(x), x) if k else x for k, x in enumerate(f.path))
        cell = path
        while cell and isinstance(cell[-1], int):
            cell = cell[:-1]
        one, two = (at(self._image(f, probed(part, f.path, x)), cell) for x in (1.0, 2.0))
        all_signs = {place: (x, y) for place, x, y in _numbers(one, two)}
        signs = {place: x for place, (x, y) in all_signs.items() if x != y}
        if any(abs(x) != 1.0 or all_signs[place][1] != 2.0 * x for place, x in signs.items()):
            return []
        if len(signs) == len(all_signs) and len(set(signs.values())) == 1:
            signs = {path[len(cell) :]: next(iter(signs.values()))}
        found = [
            f.unchecked_copy({
                "name": called[f.name], "path": (*cell, *place),
                "text": f.text if sign > 0 else negated(f.text),
            })
            for place, sign in signs.items()
        ]  # fmt: skip
        return found if all(len(x.text) <= LONGEST_FORMULA for x in found) else []

    def _image(self, f: Formula, part: Any) -> Any:
        """Return the copy of a part in which a formula is a number."""
        if f.part not in ("bodies", "beams"):
            return self.part(part)
        return part if self.mirror is None else self.mirror.row(part)

    def scenario(self, s: Scenario, called: Mapping[str, Names]) -> Scenario:
        """Extend a scenario's initial values, forces and list of active parts to the copies."""
        states = {}
        for field in ("q", "v"):
            given = getattr(s, field)
            more = {
                self.names[k]: x if self.mirror is None
                else self.mirror.coordinates(field, x, self.known[k].sequence)
                for k, x in given.items() if k in self.names
            }  # fmt: skip
            states[field] = {**given, **more}
        active = {
            kind: names and (*names, *(called[kind][n] for n in names if n in called[kind]))
            for kind, names in (("constraints", s.constraints), ("contacts", s.contacts))
        }
        forces = (*s.forces, *self.parts(s.forces)[0])
        return s.unchecked_copy({**states, **active, "forces": forces})

    def reflected(self, part: Constraint | Contact | Force | Output) -> dict[str, Any] | None:
        """Return the fields that mirror a part, or None if its fields cannot express the mirror
        image."""
        assert self.mirror is not None
        if isinstance(part, Output):
            return {}
        if not isinstance(part, Site) and not self._in_reach(part):
            return None
        if not self._same_coordinates(part):
            return None
        if getattr(part, "frame", "body") == "world" and not self._upright():
            return None  # the parent's axes are not the world's at q = 0
        if isinstance(part, Wrench) and any(expressions_of(part)):
            return None  # its entries are no numbers to be reflected
        change = self.mirror.fields(part)
        if part.body == self.root.parent and isinstance(part, AtPoint) and part.point is None:
            change["point"] = self.mirror.point(self.known[part.body].tip_point)
        return change

    def _in_reach(self, part: Constraint | Contact | Force) -> bool:
        """Check whether positions on bodies that stay are in the frame of the reflection."""
        own = (*self.names, self.root.parent)
        if any(place.body not in own for place in part._places):
            return False
        placed = "point" in type(part).model_fields or getattr(part, "points", ())
        if part.body not in own and placed:
            return False
        if part.pair[1] in own:
            return True
        return (
            not isinstance(part, Between)
            and not any(getattr(part, f, None) for f in ("other_point", "other_axis"))
            and not isinstance(part, CurvePoint)
        )

    def _same_coordinates(self, part: Constraint | Contact | Force | Site) -> bool:
        """Check whether the degrees of freedom of a part keep their values under reflection."""
        assert self.mirror is not None
        used: list[tuple[str, int]] = []
        if isinstance(part, OfSums):
            used = [(k, i) for k, i, _ in part.terms]
        elif isinstance(part, OfOne):
            used = [(part.body, part.coordinate)]
            if isinstance(part, OfTwo):
                used.append((part.other, part.other_coordinate))
        elif isinstance(part, BetweenPoints):
            used = [(x.body, x.coordinate) for x in part._riding]
            if any(name not in self.names for name, _ in used):
                return False  # a coordinate outside the branch, as for expressions
        if isinstance(part, (Contact, Force)):
            read = read_by(part, self.outputs)
            if any(name not in self.names for name, _ in read):
                return False  # a coordinate outside the branch, whose image may have another sign
            used += read
        return all(self.mirror.keeps(self.known[k], i) for k, i in used if k in self.names)

    def _upright(self) -> bool:
        """Check whether the parent's axes are the world axes at q = 0."""
        name = self.root.parent
        while name != GROUND and self.known[name].rotation == (1.0, 0.0, 0.0, 0.0):
            name = self.known[name].parent
        return name == GROUND


SIDES = {"left": "right", "right": "left", "l": "r", "r": "l"}
SIDE = re.compile(r"left|right|(?<![a-z])[lr](?![a-z])", re.IGNORECASE)


def other_side(name: str) -> str:
    """Return the name with left and right, or a standalone l and r, swapped."""

    def swapped(found: re.Match[str]) -> str:
        word = found[0]
        new = SIDES[word.lower()]
        return new.upper() if word.isupper() else new.title() if word.istitle() else new

    return SIDE.sub(swapped, name)


class Mirror:
    """A reflection through the plane normal to axis `k` of the parent's frame, through its origin.

    Points, forces and translations are reflected. Rotations are axial vectors and are reflected
    with the opposite sign. A body frame is reflected, and its axis k is reversed so that the frame
    remains right-handed. All coordinates of rotations and translations therefore keep their values.
    """

    def __init__(self, k: int):
        self.sign = tuple(-1.0 if i == k else 1.0 for i in range(3))

    def point(self, x: Sequence[float]) -> Vec3:
        a, b, c = (s * float(e) + 0.0 for s, e in zip(self.sign, x))
        return (a, b, c)

    def axial(self, x: Sequence[float]) -> Vec3:
        a, b, c = (-s * float(e) + 0.0 for s, e in zip(self.sign, x))
        return (a, b, c)

    def quaternion(self, q: Sequence[float]) -> Quat:
        w, *v = q
        return (float(w), *self.axial(v))

    def coordinates(self, field: str, x: Sequence[float], motions: Sequence[Motion]) -> Any:
        """Reflect q or v of a joint."""
        found: list[float] = []
        for m in motions:
            part = x[len(found) : len(found) + SIZE[m.kind][field == "v"]]
            travels = m.facts.travels
            if m.facts.single:
                found.extend(map(float, part))
            elif field == "q":
                found += (*self.point(part[:3]),) if travels else ()
                found += self.quaternion(part[-4:])
            else:
                found += self.axial(part[:3])
                found += self.point(part[3:]) if travels else ()
        return tuple(found)

    def keeps(self, body: Body, coordinate: int) -> bool:
        """Check whether a degree of freedom of a joint keeps its value under reflection."""
        ones = (1.0,) * body.dof
        return self.coordinates("v", ones, body.sequence)[coordinate] == 1.0

    def fields(self, part: Frozen) -> dict[str, Any]:
        """Return the fields changed by the reflection, according to their roles."""
        of_role = {
            "point": self.point, "direction": self.point, "vector": self.point,
            "axial": self.axial, "frame": self.quaternion, "tensor": self.tensor,
            "screw": self.screw,
        }  # fmt: skip
        found: dict[str, Any] = {}
        for name, info in type(part).model_fields.items():
            role, value = facts(info).role, getattr(part, name)
            if role in of_role and value is not None:
                found[name] = self.value(value, of_role[role])
            elif role == "track" and value is not None:
                found[name] = value.mirrored(self.sign)
            elif role == "parts" and isinstance(value, tuple):
                found[name] = tuple(x.unchecked_copy(self.fields(x)) for x in value)
        return found

    def tensor(self, rows: Sequence[Sequence[float]]) -> Any:
        """(3, 3) numbers."""
        return tuple(
            tuple(a * b * x + 0.0 for b, x in zip(self.sign, row))
            for a, row in zip(self.sign, rows)
        )

    def screw(self, rows: Sequence[Any]) -> Any:
        """Return the mirror image of a (6, 6) matrix that couples displacements and rotations."""
        signs = (*self.sign, *(-x for x in self.sign))
        return tuple(
            tuple(a * b * x + 0.0 for b, x in zip(signs, row)) for a, row in zip(signs, rows)
        )

    def row(self, one: Body | Beam) -> Body | Beam:
        """Return the mirror image of a body or a beam with its original parent and name."""
        if isinstance(one, Body):
            return self.body(one)
        image = one.unchecked_copy(self.fields(one))
        if one.length is None or self.sign[0] > 0:
            return image
        return image.unchecked_copy({"length": None, "points": ((-one.length, 0.0, 0.0),)})

    def body(self, body: Body) -> Body:
        """Return the reflected row with its original parent and name."""
        motions = tuple(
            (m.kind, self.axial(m.axis) if m.facts.turns else self.point(m.axis))
            if m.kind in DIRECTED else (m.kind, m.axis)
            for m in body.sequence
        )  # fmt: skip
        return body.unchecked_copy({
            **self.fields(body),
            "motions": motions,
            "axes": tuple(axis for kind, axis in motions if kind in DIRECTED),
            "pitch": tuple(-x + 0.0 for x in body.pitch),  # a thread has a hand
            "q": self.coordinates("q", body.q, body.sequence),
            "v": self.coordinates("v", body.v, body.sequence),
            "shapes": tuple(map(self.shape, body.shapes)),
        })  # fmt: skip

    def shape(self, shape: Shape) -> Shape:
        """Return the mirror image of a shape, as its kind says."""
        kind, plane = kind_of(shape), self.sign.index(-1.0)
        moved = self.fields(shape) | kind.mirrored(shape, plane)
        if (axis := kind.half_turn(shape, plane)) is not None:
            turn = (0.0, *(float(k == axis) for k in range(3)))
            moved["rotation"] = multiply(moved["rotation"], turn)
            for name in ("surface_velocity", "surface_spin"):
                moved[name] = tuple(x if k == axis else -x for k, x in enumerate(moved[name]))
        return shape.unchecked_copy(moved)

    def value(self, x: Any, reflect: Callable[[Any], Any]) -> Any:
        """Reflect a single value, a table of values over time, or several values."""
        if isinstance(x, VectorTable):
            return x.unchecked_copy({"value": tuple(map(reflect, x.value))})
        if reflect in (self.point, self.axial) and (not x or isinstance(x[0], tuple)):
            return tuple(map(reflect, x))
        return reflect(x)
