"""Picking marks and hints over each page's 3D view, and context menus for bodies."""

from __future__ import annotations

import math

import numpy as np

from ..core.cells import Display
from ..core.views import NOTHING, Payload, Place, topic
from . import Aim, Client, Spot, State
from .update import MenuOf, place


def _seen(state: State, page: Client) -> tuple[object, ...]:
    """Return the dependencies of the marks on a page."""
    at = state.playback.time, state.run, state.pose, state.derived
    return page.aim, page.display, page.aim and at


def menu(state: State, page: Client) -> Payload:
    """Return the body whose menu is wanted, and where."""
    asked = page.asked
    return {"body": asked.body, "at": asked.at} if isinstance(asked, MenuOf) else NOTHING


def aimed(state: State, page: Client) -> Payload | None:
    """Return picking marks in world axes [m] and the accompanying message."""
    aim = page.aim
    if aim is None:
        return None
    shown = (*aim.spots, *([aim.under] if aim.under and len(aim.spots) != 2 else []))
    marks = [_mark(state, one) for one in shown]
    return {
        "wants": aim.wants,
        "asks": asks(aim),
        "marks": marks,
        "under": "" if aim.under is None else f"{aim.under.what} of {aim.under.body}",
        "measured": measured(state, aim.spots, page.display) if len(aim.spots) == 2 else [],
    }


def _mark(state: State, one: Spot) -> Payload:
    p, R = place(state, one.body)
    at = p + R @ np.asarray(one.point)
    along = None if one.direction is None else (R @ np.asarray(one.direction)).tolist()
    return {"at": at.tolist(), "along": along}


def asks(aim: Aim) -> str:
    """Return the hint for the next click."""
    if aim.wants == "measure":
        first = ("a first point", "a second point", "a point to measure again")[len(aim.spots)]
        return f"Measure: click {first}"
    if aim.wants == "signal":
        return "Click a body for its position, Shift-click for its speed"
    of = aim.name or (aim.bodies[0] if aim.bodies else "")
    label = aim.field.replace("_", " ")
    if aim.wants == "axis":
        return f"{label} of {of}: click a face or a round side"
    return f"{label} of {of}: click a point of a body"


def measured(state: State, spots: tuple[Spot, ...], display: Display) -> list[tuple[str, str]]:
    """Return the distance, its world components, and the angle between faces or axes."""
    (p, R), (q, S) = (place(state, one.body) for one in spots)
    a, b = spots
    gap = (q + S @ np.asarray(b.point)) - (p + R @ np.asarray(a.point))

    def length(x: float) -> str:
        return f"{display.shown(x, 'length'):.6g} {display.unit('length')}"

    found = [("distance", length(float(np.linalg.norm(gap))))]
    found += [(f"Δ{axis}", length(float(x) + 0.0)) for axis, x in zip("xyz", gap)]
    if a.direction is not None and b.direction is not None:
        u, v = R @ np.asarray(a.direction), S @ np.asarray(b.direction)
        angle = math.atan2(float(np.linalg.norm(np.cross(u, v))), float(u @ v))
        text = f"{display.shown(angle, 'angle'):.6g} {display.unit('angle')}"
        found.append(("angle", text))
    return found


VIEWS = (
    Place(topic("aim", aimed, page=_seen), 79),
    Place(topic("menuOf", menu, page=lambda _, page: (page.asked,)), 79),
)
