"""Every problem of a description at once, also where some of its parts are not valid."""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from typing import Any

from ..errors import ModelError, Problem
from .body import Body
from .checks import reference_problems, tree_problems
from .constraint import Constraint
from .contact import Contact
from .fields import Described, part_problems
from .force import Force
from .names import GROUND
from .scenario import Scenario
from .sentences import nearest, shown
from .world import World

PARTS: dict[str, type[Described]] = {
    "bodies": Body,
    "constraints": Constraint,
    "contacts": Contact,
    "forces": Force,
    "scenarios": Scenario,
}


def problems(data: Mapping[str, Any], known: Iterable[str]) -> list[Problem]:
    """Everything wrong with `data` as a model whose fields are `known`, in the order given."""
    found = [
        Problem("model", key, f"no such field; {nearest(key, known)}")
        for key in data
        if key not in known
    ]
    world = {key: data[key] for key in World.model_fields if key in data}
    found += part_problems(World, world, "model")
    valid: dict[str, list[Any]] = {}
    for key, kind in PARTS.items():
        items = data.get(key, ())
        if not isinstance(items, (list, tuple)):
            found.append(Problem("model", key, f"must be a list; given {shown(items)}"))
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
    found += tree_problems(names, [_text(row, "parent", GROUND) for row in rows])
    bodies = dict.fromkeys(names) | {body.name: body for body in valid.pop("bodies")}
    known_names = (_names(data.get("constraints", ())), _names(data.get("contacts", ())))
    return found + reference_problems(bodies, **valid, names=known_names)


def _names(items: Any) -> list[str]:
    return [_text(item, "name", "") for item in items] if isinstance(items, (list, tuple)) else []


def _mended(kind: type[Described], item: Any, bad: list[Problem]) -> Any:
    """The part without its refused fields, to check the names in the others; or None.

    A body is not mended: its joint says what forces and states have to fit.
    """
    if isinstance(item, kind):
        return item
    if not isinstance(item, Mapping) or (bad and kind is Body):
        return None
    refused = {p.field for p in bad}
    refused |= {name for field in refused for name in kind.followers().get(field, ())}
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
