"""Rows of the points of paths and of the stations of cables in forms."""

from __future__ import annotations

from typing import Any

import pgraph_core as pg

from ..core.cells import Display, button, cell, field, group, shown
from ..core.views import Payload
from . import about, cables, places, riding
from .gains import GROUND

NO_BODY = ("", "choose a body")  # first entry of a list that adds a body


def grouped(item: Any, path: list[Payload]) -> Payload:
    """Return the rows of the points of a path, which are shown at once if it has only its ends."""
    count = len(item._places) + 2 * ("through" not in type(item).model_fields)
    return group("Path", path, count <= 2, f"{count} points")


def path(
    model: pg.Model, item: Any, name: str, cells: Any, display: Display, at: Any
) -> list[Payload]:
    """Return the rows of each point of a path: its body, the point and those of an obstacle."""
    shows, found = about(item, name), list[Payload]()
    for i, (place, row) in enumerate(zip(getattr(item, name), map(dict, cells[name]))):
        radius = "" if place.is_obstacle else f"{places.round_at(model, item, i, at)} m"
        found.append(
            field(name, f"Via {i + 1}", [cell((i, 0), place.body)], kind="names",
                  options=[GROUND], help=shows.help,
                  buttons=_of_row(name, i, "the path lies on a sphere or cylinder here",
                                  radius, (i, places.OF_VIA.index("radius"))))
        )  # fmt: skip
        for number, key in enumerate(places.OF_VIA[1:], start=1):
            if key in ("shifts", "when"):
                found += _of_ride(name, (i, number), key, place)
            elif places.belongs(key, place):
                found.append(_of_place(name, (i, number), key, place, row.get(key), display))
    more = field(name, "+ via", [cell((), "")], kind="names", options=[NO_BODY, GROUND],
                 help=shows.help)  # fmt: skip
    return [*found, more]


def _of_row(
    name: str, i: int, rounds: str, radius: str, index: tuple[int, int], up: bool = False
) -> list[Payload]:
    """Return the buttons of a point of a path: round (if it may be an obstacle), up and out."""
    return [
        *([button("Round", "", rounds, field=name, index=index, text=radius)] if radius else []),
        *([button("↑", "", "one place up", field=name, index=[i], text=cables.UP)] if up else []),
        button("×", "", "take this point out", field=name, index=[i], text=""),
    ]


def stations(model: pg.Model, item: Any, cells: Any, display: Display) -> list[Payload]:
    """Return the rows of each station of a cable."""
    found, name = list[Payload](), "through"
    count = len(item.through)
    for i, (one, row) in enumerate(zip(item.through, map(dict, cells))):
        radius = "" if one.radius else f"{cables.usual_radius(model)} m"
        word = cables.word(i, one, count, item.closed)
        found.append(
            field(name, f"{i + 1}. {word}", [cell((i, 0), one.body)],
                  kind="names", options=[(GROUND, GROUND)],
                  help=about(one, "body").help or "body of this station",
                  buttons=_of_row(name, i, "a wheel here, on which the cable lies", radius,
                                  (i, cables.OF_STATION.index("radius")), up=i > 0))
        )  # fmt: skip
        found += [
            _of_station(model, (i, number), key, one, row.get(key), display)
            for number, key in enumerate(cables.OF_STATION[1:], start=1)
            if key == "point" or one.radius
        ]
    more = field(name, "+ body", [cell((), "")], kind="names", options=[NO_BODY, GROUND],
                 help="led on to a further body, as its last station")  # fmt: skip
    return [*found, more]


def _of_station(
    model: pg.Model,
    index: tuple[int, int],
    key: str,
    one: pg.Pulley,
    value: Any,
    display: Display,
) -> Payload:
    """Return the row of one field of a station."""
    name, shows = "through", about(one, key)
    if key in ("side", "grip"):
        options = cables.SIDES if key == "side" else cables.GRIPS
        now = {None: "", True: "yes", False: "no"}[value] if key == "grip" else str(value or "")
        return field(name, shows.label, [cell(index, now)], kind="choice", options=options,
                     help=shows.help)  # fmt: skip
    if key == "friction":
        number = "" if value is None else shown(value, "number", display)
        return field(name, shows.label, [cell(index, number)], help=shows.help)
    if key == "radius":
        length = "" if value in (None, 0.0) else shown(value, "length", display)
        return field(name, shows.label, [cell(index, length)], unit=display.length,
                     help=f"{shows.help}; nothing: a point")  # fmt: skip
    implied = key == "axis" and value is None
    numbers = cables.implied_axis(model, one) if implied else value
    of, unit = ("length", display.length) if key == "point" else ("number", "")
    row = [
        cell((*index, j), shown(x, of, display), implied=implied)
        for j, x in enumerate(numbers or ("", "", ""))
    ]
    return field(name, "Centre" if one.radius and key == "point" else shows.label, row, unit=unit,
                 help=shows.help, pick=key)  # fmt: skip


def _of_ride(name: str, index: tuple[int, int], key: str, place: pg.Via) -> list[Payload]:
    """Return the row with the displacements of a point, or with the range in which it counts."""
    if not getattr(place, key):  # a plain point has no row for it
        return []
    shows = about(place, key)
    text, says = riding.text_of_range(place.when), "such as shank -0.8 0.2 [rad, m]"
    if key == "shifts":
        text, says = riding.text_of_shifts(place.shifts), riding.SAYS
    one = cell(index, text)
    return [field(name, shows.label, [one], kind="text", help=f"{shows.help}: {says}")]


def _of_place(
    name: str, index: tuple[int, int], key: str, place: Any, value: Any, display: Display
) -> Payload:
    """Return the row of a field of a point of a path: a number, or a vector that can be picked."""
    shows, direction = about(place, key), key in ("axis", "rotation")
    of, unit = ("number", "") if direction else ("length", display.length)
    if key == "inner":
        options = [("", "past it"), ("yes", "through it")]
        now = "yes" if value else ""
        return field(name, shows.label, [cell(index, now)], kind="choice", options=options,
                     help=shows.help)  # fmt: skip
    if key == "radius":
        one = cell(index, shown(value, of, display))
        return field(name, shows.label, [one], unit=unit, help=shows.help)
    numbers = value or (None,) * (4 if key == "rotation" else 3)
    row = [cell((*index, k), shown(x, of, display)) for k, x in enumerate(numbers)]
    pick = {"axis": "axis", "radii": "", "rotation": ""}.get(key, "point")
    return field(name, shows.label, row, unit=unit, help=shows.help, pick=pick)
