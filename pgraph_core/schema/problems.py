"""Every problem of a description at once, also where some of its parts are not valid."""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from typing import Any

from ..errors import Problem
from .body import Body
from .checks import GROUND, reference_problems, tree_problems
from .constraint import Constraint
from .fields import Described, nearest, part_problems, shown
from .force import Force
from .scenario import Scenario
from .world import World

PARTS: dict[str, type[Described]] = {
    "bodies": Body,
    "constraints": Constraint,
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
            if not bad:
                valid[key].append(item if isinstance(item, kind) else kind(**item))
    rows = data.get("bodies", ())
    rows = rows if isinstance(rows, (list, tuple)) else ()
    names = [str(_field(row, "name", f"row {i + 1}")) for i, row in enumerate(rows)]
    found += tree_problems(names, [str(_field(row, "parent", GROUND)) for row in rows])
    if len(valid["bodies"]) == len(rows):
        found += reference_problems(**valid)
    return found


def _where(kind: type[Described], item: Any, i: int) -> str:
    word = kind.__name__.lower()
    name = _field(item, "name", None)
    if isinstance(name, str) and name.strip():
        return f"{word} '{name}'"
    return f"row {i + 1}" if kind is Body else f"{word} {i + 1}"


def _field(item: Any, name: str, default: Any) -> Any:
    value = item.get(name) if isinstance(item, Mapping) else getattr(item, name, None)
    return default if value is None else value
