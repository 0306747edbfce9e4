"""The parts of a model as they are given: as objects in any list, or as data with problems."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np

from ..errors import ModelError, Problem, shown
from ..fields import EVERY, GROUND, Described, part_problems
from ..rotation import matrix
from ..sentences import PAIR, no_such_field
from .body import Body
from .checks import PARTS, beam_problems, reference_problems, tree_problems
from .part_checks import is_ground
from .poses import Pose, carried
from .segments import named, place_in, rigid
from .world import World


def by_class(data: Mapping[str, Any]) -> dict[str, Any]:
    """Return the fields of a model with each part in the list of its class, or {} if all are.

    For example, `springs=[...]` are forces, and `joints=[...]` can contain bodies and constraints.
    """

    def home(part: Any) -> str:
        return next((key for key, kind in PARTS.items() if isinstance(part, kind)), "")

    found, moved = dict(data), False
    for key, value in data.items():
        parts = value if isinstance(value, (list, tuple)) else (value,)
        homes = [home(part) for part in parts]
        if parts and all(homes) and not (parts is value and {*homes} == {key}):
            found = {name: x for name, x in found.items() if name != key or parts is not value}
            found.pop(key, None)
            for name, part in zip(homes, parts):
                found[name] = (*found.get(name, ()), part)
            moved = True
    return found if moved else {}


def grounded(parts: Mapping[str, Sequence[Any]]) -> dict[str, list[Any]]:
    """Return bodies and parts with the ground under its name and as their second end.

    A body keeps its name "world". Only parts with interchangeable ends are swapped. The result is
    empty if nothing changes.
    """
    bodies = {body.name: body for body in parts["bodies"]}

    def grounds(name: str) -> bool:
        return name not in bodies and is_ground(name)

    def renamed(part: Any, fields: Sequence[str]) -> Any:
        named = {x: getattr(part, x) for x in fields if x in type(part).model_fields}
        new: dict[str, Any] = {x: GROUND for x, name in named.items() if grounds(name)}
        for x in getattr(part, "PLACES", ()):
            if any(grounds(place.body) and place.body != GROUND for place in getattr(part, x)):
                new[x] = tuple(
                    place.unchecked_copy({"body": GROUND}) if grounds(place.body) else place
                    for place in getattr(part, x)
                )
        now = {**named, **new}
        other = now.get("other", GROUND)
        if now.get("body") == GROUND and (other in bodies or other == EVERY):
            start, home = Pose(np.zeros(3), np.eye(3)), np.eye(3)
            for body in _chain(bodies, other):
                start, home = carried(start, body, body.q), home @ matrix(body.rotation)
            if changed := part._exchanged(start, home):
                new |= {**changed, "body": other, "other": GROUND}
        return part.model_copy(update=new) if new else part

    ends = {
        "bodies": ("parent",),
        "beams": ("parent",),
        "constraints": PAIR,
        "forces": PAIR,
        "contacts": PAIR,
    }
    found = {key: [renamed(part, fields) for part in parts[key]] for key, fields in ends.items()}
    return found if any(list(parts[key]) != each for key, each in found.items()) else {}


def _chain(bodies: Mapping[str, Body], name: str) -> list[Body]:
    """Return the bodies from the ground to this one."""
    found = list[Body]()
    while name in bodies and bodies[name] not in found:
        found.insert(0, bodies[name])
        name = bodies[name].parent
    return found


def problems(data: Mapping[str, Any], known: Mapping[str, Any]) -> list[Problem]:
    """Return all problems in `data` as a model with the fields `known`, in the order given."""
    found = [Problem("model", key, no_such_field(key, known)) for key in data if key not in known]
    world = {key: data[key] for key in World.model_fields if key in data}
    found += part_problems(World, world, "model")
    valid: dict[str, list[Any]] = {}
    for key, kind in PARTS.items():
        items = data.get(key, ())
        if not isinstance(items, (list, tuple)):
            text = f"must be a list, got {shown(items)}"
            if key == "contacts":
                both = "pg.Contact(body='*'), pg.Contact(body='*', other='*')"
                text += f"; all shapes touch the ground and each other by contacts=[{both}]"
            found.append(Problem("model", key, text))
            items = ()
        valid[key] = []
        for i, item in enumerate(items):
            bad = part_problems(kind, item, _where(kind, item, i))
            found += bad
            if part := _mended(kind, item, bad):
                valid[key].append(part)
    rows = data.get("bodies", ())
    rows = rows if isinstance(rows, (list, tuple)) else ()
    names = [_text(row, "name", f"row {i + 1}") for i, row in enumerate(rows)]
    parents = [_text(row, "parent", GROUND) for row in rows]
    found += beam_problems(valid, names)
    held = {body.name: body for body in rigid(valid)}
    unsure = dict.fromkeys(_names(data.get("beams")))  # the beams, also those with problems
    held = dict.fromkeys(x for x in (*named(valid), *parents) if place_in(x, unsure)) | held
    found += tree_problems(
        [*names, *held],
        [*parents, *(b.parent if b and b.parent in names else GROUND for b in held.values())],
    )
    bodies = dict.fromkeys(names) | {body.name: body for body in valid.pop("bodies")} | held
    valid.pop("beams")
    known_names = (_names(data.get("constraints", ())), _names(data.get("contacts", ())))
    given = data.get("parameters")
    parameters = given if isinstance(given, Mapping) else {}
    read = ("forces", "outputs", "controls")  # parts that expressions read
    lost = {x for key in read for x in _names(data.get(key))} - {
        part.name for key in read for part in valid[key]
    }
    return found + reference_problems(
        bodies, **valid, names=known_names, parameters=parameters, lost=lost
    )


def made_of(data: Mapping[str, Any]) -> dict[str, list[Any]]:
    """Return the lists of parts in which some are dictionaries, with these made. All are valid."""
    listed = {key: data[key] for key in PARTS if data.get(key)}
    return {
        key: [_mended(PARTS[key], item, []) for item in items]
        for key, items in listed.items()
        if any(isinstance(item, Mapping) for item in items)
    }


def _names(items: Any) -> list[str]:
    return [_text(item, "name", "") for item in items] if isinstance(items, (list, tuple)) else []


def _mended(kind: type[Described], item: Any, bad: list[Problem]) -> Any:
    """Return the part without its invalid fields, so that other names can be checked, or None.

    A body is not repaired, because its joint decides which forces and states fit.
    """
    if isinstance(item, kind):
        return item
    if not isinstance(item, Mapping) or (bad and kind is Body):
        return None
    refused = {p.field for p in bad}
    refused |= {name for field in refused for name in kind._followers().get(field, ())}
    try:
        return kind(**{key: value for key, value in item.items() if key not in refused})
    except ModelError:
        return None


def _where(kind: type[Described], item: Any, i: int) -> str:
    word = kind.word()
    name = _field(item, "name", None)
    if isinstance(name, str) and name.strip():
        return f"{word} {shown(name)}"
    return f"row {i + 1}" if kind is Body else f"{word} {i + 1}"


def _text(item: Any, name: str, default: str) -> str:
    value = _field(item, name, default)
    return value if isinstance(value, str) else default


def _field(item: Any, name: str, default: Any) -> Any:
    value = item.get(name) if isinstance(item, Mapping) else getattr(item, name, None)
    return default if value is None else value
