"""Property cells of a beam: its form, and typed text as an edit."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from typing import Any, Literal

import numpy as np

import pgraph_core as pg
from pgraph_core.fields import About, about
from pgraph_core.model.beam import AUTO, MATERIALS, MOST_SEGMENTS, SECTIONS, STRAINS
from pgraph_core.model.segments import place_in, point_at
from pgraph_core.rotation import matrix, multiply, unit

from ..core.cells import (
    XYZ,
    Display,
    Payload,
    Quantity,
    Refusal,
    cell,
    choice,
    content,
    field,
    group,
    quantity,
    quantity_in,
    replaced,
    shown,
    valid_name,
    whole,
)
from .body_cells import axis_of, euler_of, from_axis, from_euler

NO_SECTION, NO_MATERIAL = "none", ""
# A slender steel rod, drawn thick enough to see and click. Without damping a run resolves its
# fastest vibrations: 2 s of an arm took more than 45 s, and take 3.5 s with this.
NEW: Mapping[str, Any] = {
    "length": 1.0, "section": ("circle", 0.01), "material": "steel", "damping_ratio": 0.02,
}  # fmt: skip
CELLS = {  # cells that are a part of a field
    "section_kind": About("Section", "", "shape of the cross-section"),
    "sizes": About("Sizes", "length", "sizes of the cross-section"),
    "end": About("End", "length", "position of its tip on the parent; it becomes straight"),
    "deforms": About("Deforms", "", "how it deforms: " + ", ".join(STRAINS)),
}
TURNS: Mapping[str, tuple[tuple[int, ...], Any, Any]] = {  # angles among its numbers, to, from
    "rotation": ((), tuple, tuple),
    "rotation_euler": ((0, 1, 2), euler_of, from_euler),
    "rotation_axis": ((3,), axis_of, from_axis),
}
BeamField = Literal[
    "length", "section_kind", "sizes", "material", "nodes", "damping_ratio", "end", "points", "E",
    "G", "density", "EI", "GJ", "EA", "rho_a", "rho_j", "deforms", "tolerance", "place",
]  # fmt: skip
FIRST = ("length", "section_kind", "sizes", "material", "nodes", "damping_ratio")
STIFF = ("E", "G", "density", "EI", "GJ", "EA", "rho_a", "rho_j")


AT = About("Along the beam", "", "place on its beam, from 0 at the root to 1 at the tip")


def place_row(model: pg.Model, name: str, parent: str) -> list[Payload]:
    """Return the row of a place along a beam that a part names, or none for other bodies."""
    place = place_in(parent, {beam.name: beam for beam in model.beams})
    if parent in model.row or place is None:
        return []
    return [field(name, AT.label, [cell((), place[1])], help=f"{AT.help} of '{place[0]}'")]


def placed(model: pg.Model, parent: str, text: str) -> str:
    """Return the name of the place along the beam of `parent` that was typed. Raises Refusal."""
    beams = {beam.name: beam for beam in model.beams}
    place, at = place_in(parent, beams), quantity(text, "number", Display())
    if place is None:
        raise Refusal(f"'{parent}' is no place on a beam")
    if not 0.0 <= at <= 1.0:
        raise Refusal(f"must be from 0 at the root to 1 at the tip of '{place[0]}', got {text}")
    return place[0] if at == 1.0 else beams[place[0]].at(at)


def shows(name: str) -> About:
    """Return the label, the unit and the help of a field of a beam, or of one of its cells."""
    if name in CELLS:
        return CELLS[name]
    name = "rotation" if name.startswith("rotation_") else name
    known = pg.Beam.model_fields
    return about(known[name], name) if name in known else About(name)


def form(
    model: pg.Model, beam: pg.Beam, display: Display, turn: tuple[str, tuple[str, ...]]
) -> list[Payload]:
    """Return the fields of a beam in groups. `turn` is the field of its orientation."""
    given = any(getattr(beam, name) for name in STIFF)
    fine = [_row(model, beam, name, display) for name in ("deforms", "tolerance")]
    place = [_row(model, beam, name, display) for name in ("link", "end", "points")]
    place.insert(2, _turned(beam, display, *turn))
    return [
        group("Beam", [_row(model, beam, name, display) for name in FIRST if _has(beam, name)]),
        group("Place", place),
        group("Stiffness and mass", [_row(model, beam, name, display) for name in STIFF], given,
              numbers(beam)),
        group("Deformation", fine, bool(beam.strains), ", ".join(beam.deforms)),
        group("Frame", [field("name", "Name", [cell((), beam.name)], kind="text")], False),
    ]  # fmt: skip


def numbers(beam: pg.Beam) -> str:
    """Return the stiffness and the lowest frequency of a beam as text."""
    stiff = beam.stiff
    bends = " and ".join(f"{x:.4g}" for x in dict.fromkeys(stiff.EI or ()))
    found = [f"EI {bends} N m²"] if bends else []
    return ", ".join([*found, f"lowest {beam.lowest_frequency / (2 * math.pi):.3g} Hz"])


def _has(beam: pg.Beam, name: str) -> bool:
    return name != "sizes" or beam.section is not None


def _row(model: pg.Model, beam: pg.Beam, name: str, display: Display) -> Payload:
    says, cells = shows(name), model.cells(beam, "beams")
    match name:
        case "section_kind":
            kind = NO_SECTION if beam.section is None else str(beam.section[0])
            return choice(name, says.label, kind, (NO_SECTION, *SECTIONS), help=says.help)
        case "sizes":
            kind, *sizes = cells["section"]
            names = SECTIONS[kind].sizes
            row = [cell((k,), shown(x, "length", display), names[k]) for k, x in enumerate(sizes)]
            return field(name, says.label, row, unit=display.length, help=says.help, columns=1)
        case "material":
            options = [(NO_MATERIAL, "given below"), *((x, x) for x in MATERIALS)]
            return choice(name, says.label, beam.material or NO_MATERIAL, options, help=says.help)
        case "nodes":
            note = f"a number up to {MOST_SEGMENTS}, or {AUTO}: as many as the tolerance needs"
            return field(name, says.label, [cell((), cells[name])], kind="text", help=says.help,
                         note=note)  # fmt: skip
        case "points":
            text = "; ".join(" ".join(_text(x, display) for x in p) for p in cells[name])
            note = "x y z; x y z; ... in place of the length"
            return field(name, says.label, [cell((), text)], kind="text", unit=display.length,
                         help=says.help, note=note)  # fmt: skip
        case "deforms":
            row = [cell((), ", ".join(beam.deforms))]
            return field(name, says.label, row, kind="text", help=says.help, note=says.help)
        case "EI":
            row = [cell((), " ".join(map(str, _listed(cells[name]))))]
            return field(name, says.label, row, kind="text", unit=says.unit, help=says.help)
    value, of = end_of(beam) if name == "end" else cells[name], quantity_in(says.unit)
    unit = display.unit(of) or says.unit
    if isinstance(value, (tuple, list)):
        row = [cell((k,), shown(x, of, display), XYZ[k]) for k, x in enumerate(value)]
        pick = "point" if name in ("link", "end") else ""
        return field(name, says.label, row, unit=unit, help=says.help, pick=pick)
    return field(name, says.label, [cell((), shown(value, of, display))], unit=unit,
                 help=says.help)  # fmt: skip


def _turned(beam: pg.Beam, display: Display, name: str, names: tuple[str, ...]) -> Payload:
    angles, of, _ = TURNS[name]
    row = [
        cell((k,), shown(x, "angle" if k in angles else "number", display), names[k])
        for k, x in enumerate(of(beam.rotation))
    ]
    says = shows("rotation")
    return field(name, says.label, row, unit=display.angle if angles else "", help=says.help)


def end_of(beam: pg.Beam) -> tuple[float, ...]:
    """Return where its tip is on its parent, as its root is [m]."""
    at = matrix(beam.rotation) @ point_at(beam, 1.0) + beam.link
    return tuple(round(x, 12) + 0.0 for x in at.tolist())


def _text(value: Any, display: Display) -> str:
    x = shown(value, "length", display)
    return x if isinstance(x, str) else f"{x:g}"


def _listed(value: Any) -> Sequence[Any]:
    return value if isinstance(value, (tuple, list)) else (value,)


# -- edits -----------------------------------------------------------------------------------------


def edit_of(
    model: pg.Model,
    beam: pg.Beam,
    name: str,
    entries: Sequence[tuple[tuple[int, ...], str]],
    display: Display,
) -> dict[str, Any]:
    """Return the arguments of `model.edit` that store text typed in the cells of a field.

    Raises Refusal.
    """
    text = entries[0][1].strip()
    match name:
        case "name":
            return {"name": valid_name(text)}
        case "parent":
            return {"parent": text}
        case "section_kind":
            return _with_section(beam, text)
        case "material":
            return {"material": text or None}
        case "nodes":
            return {"nodes": AUTO if text == AUTO else whole(text, 1, MOST_SEGMENTS)}
        case "deforms":
            return {"strains": tuple(text.replace(",", " ").split())}
        case "points":
            rows = [row.replace(",", " ").split() for row in text.split(";") if row.strip()]
            points = tuple(tuple(content(x, "length", display) for x in row) for row in rows)
            straight = beam.length or beam.extent
            return {"points": points, "length": None if points else straight}
        case "EI":
            return {name: tuple(content(x, "number", display) for x in text.split())}
        case "length":
            return {name: content(text, "length", display), "points": ()}
        case "sizes":
            value: Any = model.cells(beam, "beams")["section"]
            for (k,), typed in entries:
                value = replaced(tuple(value), (k + 1,), content(typed, "length", display))
            return {"section": value}
        case _ if name.startswith("rotation"):
            angles, of, back = TURNS[name]
            turned: Any = of(beam.rotation)
            for (k,), typed in entries:
                kind: Quantity = "angle" if k in angles else "number"
                turned = replaced(tuple(turned), (k,), quantity(typed, kind, display))
            return {"rotation": back(turned)}
        case "end":
            end: Any = end_of(beam)
            for index, typed in entries:
                end = replaced(end, index, quantity(typed, "length", display))
            return _led_to(beam, end)
    if name not in pg.Beam.model_fields:
        raise Refusal("a beam has no such field")
    of = quantity_in(shows(name).unit)
    value = model.cells(beam, "beams")[name]
    for index, typed in entries:
        empty = not typed.strip() and not index
        value = None if empty else replaced(value, index, content(typed, of, display))
    return {name: value}


def _led_to(beam: pg.Beam, end: Sequence[float]) -> dict[str, Any]:
    """Return the edit to a straight beam from its root to a point, turned the shortest way."""
    way = np.subtract(end, beam.link)
    length = float(np.linalg.norm(way))
    if length == 0.0:
        raise Refusal("must differ from the link vector, where the beam begins")
    x, w = matrix(beam.rotation)[:, 0], way / length
    y = matrix(beam.rotation)[:, 1]
    half = (1.0 + float(x @ w), *np.cross(x, w)) if x @ w > -1.0 else (0.0, *y)
    return {"rotation": multiply(unit(half), beam.rotation), "length": length, "points": ()}


def _with_section(beam: pg.Beam, kind: str) -> dict[str, Any]:
    """Return the edit to another kind of cross-section, about as wide as before.

    A beam without a section keeps its stiffness and its mass as numbers.
    """
    if kind == NO_SECTION:
        stiff = beam.stiff
        own = {"EI": stiff.EI or (), "GJ": stiff.GJ, "rho_a": stiff.rho_a, "rho_j": stiff.rho_i[0]}
        return {"section": None, "material": None, "E": None, "G": None, "density": None, **own}
    if kind not in SECTIONS:
        raise Refusal(f"must be one of {', '.join(SECTIONS)}, got '{kind}'")
    old = beam.section or ("circle", beam.extent / 100)
    wide = float(old[1]) * (1.0 if old[0] == "rectangle" else 2.0)
    sizes = {"circle": (wide / 2,), "tube": (wide / 2, 0.4 * wide), "rectangle": (wide, wide)}
    given = {} if beam.section else dict.fromkeys(("EI", "GJ", "EA", "rho_a", "rho_j"))
    known = {} if beam.section else {"material": beam.material or NEW["material"], **given}
    known = {key: () if key == "EI" else value for key, value in known.items()}
    return {"section": (kind, *sizes[kind]), **known}
