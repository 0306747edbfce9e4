"""Write fields.md, the tables of all fields of a model: `python docs/fields.py`."""

from collections.abc import Iterator
from pathlib import Path
from typing import Any

from pydantic_core import PydanticUndefined

import pgraph_core as pg
from pgraph_core.fields import Frozen, about

PAGE = Path(__file__).with_name("fields.md")
HEAD = """# All fields

Generated from the classes by `docs/fields.py`. [Models](description.md) explains the parts.
Required fields must be given; optional fields can be omitted. Units are in brackets.
"""
BASES = {"Constraints": pg.Constraint, "Forces": pg.Force, "Controls": pg.Control}
PARTS = {
    "Model": (pg.Model, pg.Ground, pg.Step),
    "Bodies": (pg.Body, pg.Shape, pg.Track),
    "Beams": (pg.Beam,),
    "Contacts": (pg.Contact,),
    "Sites and outputs": (pg.Site, pg.Output),
    "Points of paths": (pg.Via, pg.Shift, pg.Within),
    "Functions of time and of state": (
        pg.Table, pg.VectorTable, pg.Sine, pg.Polynomial, pg.Curve, pg.Lines,
    ),
    "Scenarios": (pg.Scenario, pg.Switch, pg.Gait, pg.Footfall, pg.Gains),
}  # fmt: skip


def as_text(value: Any) -> str:
    """Return a default as a user would write it."""
    if value is PydanticUndefined:
        return "required"
    if value is None or value == "" or (isinstance(value, tuple | dict) and not value):
        return "optional"
    if isinstance(value, Frozen):
        return f"`{type(value).__name__}()`"
    return f"`{plain(value)}`"


def plain(value: Any) -> str:
    """Return a number or nested tuple of numbers without `.0`; a large zero matrix is `0`."""
    if isinstance(value, tuple):
        if len(value) > 4:
            return "0"
        return f"({', '.join(map(plain, value))})"
    return f"{value:g}" if isinstance(value, float) else str(value)


def table(part: type[Frozen], left_out: tuple[str, ...] = ()) -> str:
    """Return the fields of a part as a table."""
    lines = ["| field | default | value | meaning |", "|---|---|---|---|"]
    for name, info in part.model_fields.items():
        if name not in left_out:
            default = as_text(info.get_default(call_default_factory=True))
            value = (info.description or "").replace(" | ", " or ")
            lines.append(f"| `{name}` | {default} | {value} | {about(info, name).help} |")
    return "\n".join(lines)


def first_line(part: type[Frozen]) -> str:
    """Return the summary of a class."""
    return (part.__doc__ or "").splitlines()[0]


def sections() -> Iterator[str]:
    """Return the head, then a section for each group of parts."""
    yield HEAD
    for title, parts in PARTS.items():
        yield f"## {title}\n"
        for part in parts:
            yield f"### {part.__name__}\n\n{first_line(part)}\n\n{table(part)}\n"
    for title, base in BASES.items():
        yield f"## {title}\n"
        kinds = list(base.KINDS.items())
        shared = tuple(
            n for n in kinds[0][1].model_fields if all(n in k.model_fields for _, k in kinds)
        )
        named = ", ".join(f"`{name}`" for name in shared)
        yield f"Each kind has {named} and the fields of its table.\n"
        for kind, part in kinds:
            yield f"### {part.__name__}\n\n`kind: {kind}`. {first_line(part)}\n"
            yield f"{table(part, shared)}\n"


def page() -> str:
    """Return the page."""
    return "\n".join(sections())


if __name__ == "__main__":
    PAGE.write_text(page(), encoding="utf-8")
