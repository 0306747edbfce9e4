"""The text of the lift of a cam, and what follows from another follower."""

from __future__ import annotations

import math
import re
from collections.abc import Mapping
from typing import Any

import numpy as np

import pgraph_core as pg
from pgraph_core.cams import LAWS, riding, values

from ..core.cells import Display, Quantity, Refusal, quantity
from ..core.views import Payload
from .relations import QUANTITIES, short, unit_of_coordinate

MOTIONS = ("segments", "points")
SI = {"length": "m", "angle": "rad", "number": ""}
REST = "rest"
FORMS = {
    "segments": "angle lift law; ... [{x}] [{y}], or with units: 90deg 20mm cycloidal; 60deg 20mm; "
    f"90deg 0; {REST} 0, with {', '.join(LAWS)}",
    "points": "angle lift; ... [{x}] [{y}] over one turn, or with units: 0 0; 90deg 12mm; "
    "180deg 20mm; 360deg 0",
}
POINTS = 24  # points of a lift by points that replaces one by segments
DRAWN = 181  # points of a drawn lift


def kind_of(item: pg.Cam) -> str:
    """Return how the lift of a cam is given, one of `MOTIONS`."""
    return "points" if isinstance(item.motion, pg.Curve) else "segments"


def _of(model: pg.Model, item: pg.Cam) -> Quantity:
    """Return the quantity of the follower's coordinate."""
    return QUANTITIES[unit_of_coordinate(model, item.body, 0)]


def note(model: pg.Model, item: pg.Cam, display: Display) -> str:
    """Return how the text of a lift is written."""
    x, y = display.unit("angle"), display.unit(_of(model, item)) or "rad, m"
    return FORMS[kind_of(item)].format(x=x, y=y)


def written(model: pg.Model, item: pg.Cam, display: Display) -> str:
    """Format the lift of a cam as text, with semicolons between its segments or points."""
    of = _of(model, item)

    def both(x: float | None, y: float) -> str:
        angle = REST if x is None else short(display.shown(x, "angle"))
        return f"{angle} {short(display.shown(y, of))}"

    if isinstance(item.motion, pg.Curve):
        return "; ".join(both(x, y) for x, y in zip(item.motion.x, item.motion.value))
    rows, before = list[str](), 0.0
    for one in item.motion:
        law = "" if one.lift == before and one.law == "3-4-5" else f" {one.law}"
        rows.append(both(one.angle, one.lift) + law)
        before = one.lift
    return "; ".join(rows)


def motion_of(model: pg.Model, item: pg.Cam, text: str, display: Display) -> Any:
    """Parse the text of `written`, with units if they are typed. Raises Refusal."""
    kind, of = kind_of(item), _of(model, item)
    rows = [row.replace(",", " ").split(maxsplit=2) for row in re.split("[;\n]", text)]
    rows = [row for row in rows if row]
    most = 2 if kind == "points" else 3
    if not rows or any(not 2 <= len(row) <= most for row in rows):
        raise Refusal(f"must be rows {note(model, item, display)}")
    lifts = [quantity(row[1], of, display) for row in rows]
    angles = [
        None if row[0] == REST and kind == "segments" else quantity(row[0], "angle", display)
        for row in rows
    ]
    if kind == "points":
        return {"x": tuple(angles), "value": tuple(lifts), "kind": "periodic"}
    laws = [{"law": row[2]} if len(row) == 3 else {} for row in rows]
    return tuple({"angle": a, "lift": h, **law} for a, h, law in zip(angles, lifts, laws))


def given_as(item: pg.Cam, kind: str) -> Any:
    """Return a lift of another kind, of about the same values. Raises Refusal."""
    if kind not in MOTIONS:
        raise Refusal(f"must be one of {', '.join(MOTIONS)}")
    if kind == kind_of(item):
        return item.motion
    if kind == "points":
        x = np.linspace(0.0, math.tau, POINTS + 1)
        lift = values(item.lift, x + item.phase)[0]
        lift[-1] = lift[0]
        return {"x": tuple(x.tolist()), "value": tuple(lift.tolist()), "kind": "periodic"}
    assert isinstance(item.motion, pg.Curve), "it has points"
    x, value = np.array(item.motion.x), np.array(item.motion.value)
    top = int(np.argmax(np.abs(value)))
    up = float(np.clip((x[top] - x[0]) / math.tau, 0.1, 0.9)) * math.tau
    return ({"angle": up, "lift": float(value[top])}, {"lift": 0.0})


def followed(data: Mapping[str, Any], follower: str) -> dict[str, Any]:
    """Return the fields of a cam with another follower, and the lengths that it needs."""
    base, turns = data["base_radius"], data.get("distance") is not None
    return {
        **data,
        "follower": follower,
        "roller_radius": data.get("roller_radius") or base / 4 if follower == "roller" else None,
        "arm": (data.get("arm") or data["distance"]) if turns and follower != "flat" else None,
        "eccentricity": 0.0 if turns or follower == "flat" else data["eccentricity"],
    }


def unused(item: pg.Cam) -> set[str]:
    """Return the fields that the follower of a cam does not have."""
    turns, flat = item.distance is not None, item.follower == "flat"
    found = {"coordinate", "other_coordinate"}  # joints of a cam have one
    found |= set() if item.follower == "roller" else {"roller_radius"}
    found |= {"eccentricity"} if turns else {"distance", "arm"}
    return found | ({"arm", "eccentricity"} if flat else set())


def picture(model: pg.Model, item: pg.Cam, display: Display) -> Payload:
    """Return the lift over a turn and the pressure angle, in the units of the page."""
    x = np.linspace(0.0, math.tau, DRAWN)
    f, *slopes = values(item.lift, x)
    (turn, by), (unit, times) = (display.of_unit(SI[one]) for one in ("angle", _of(model, item)))
    lines = [{"title": f"[{unit}]" if unit else "", "t": (by * x).tolist(),
              "y": (times * f).tolist()}]  # fmt: skip
    if item.follower != "flat":  # whose pressure angle is 0
        angle = by * riding(item.rule, f, *slopes).pressure
        lines.append({"title": f"pressure angle [{turn}]", "t": (by * x).tolist(),
                      "y": angle.tolist()})  # fmt: skip
    return {"lines": lines, "unit": turn}
