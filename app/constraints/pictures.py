"""Pictures of the curves of motions and relations, and where a relation is now (pure)."""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping
from typing import Any

import numpy as np

import pgraph_core as pg
from pgraph_core import joints
from pgraph_core.paper import bodies_of, q_slices
from pgraph_core.signals import parsed
from pgraph_core.signals.meaning import constant

from ..core.cells import Display, Quantity
from ..core.views import NOTHING, Payload
from ..pose.solving import ranges, shown_q
from . import Client, State
from .relations import ends_of, quantities

Array = np.ndarray
DRAWN = 121  # points of a drawn curve, two pixels apart, among them its middle
WAY = np.finfo(float).eps ** (1 / 3)  # part of a range over which differences have the least error
SI = {"length": "m", "angle": "rad", "number": ""}


def of_motion(item: pg.Motion) -> Payload | None:
    """Return the curve through the table of a prescribed motion, and the range of its values."""
    if not isinstance(item.q_of_t, pg.Table) or len(item.q_of_t.t) < 2:
        return None
    t, value = _sampled(np.array(item.q_of_t.t), item.q_of_t.spline(item.interpolation))
    note = f"from {value.min():.4g} to {value.max():.4g}"
    return {"lines": [{"t": t.tolist(), "y": value.tolist()}], "note": note}


def _sampled(knots: Array, values: Callable[[Array], Array]) -> tuple[Array, Array]:
    """Return (n,) places from the first knot to the last one, among them all knots, and values."""
    x = np.unique([*np.linspace(knots[0], knots[-1], DRAWN), *knots])
    return x, values(x)


def of_relation(state: State, item: pg.Relation, display: Display) -> Payload | None:
    """Return the curve of a relation and its slope, in the units of the page, or None.

    Both are drawn from the first point to the last one, or over `window`.
    """
    model, curve, of = state.model, item.curve, quantities(state.model, item)
    knots = np.array(curve.x if isinstance(curve, pg.Curve) else window(state, item))
    if len(knots) < 2:
        return None

    def values(x: Array) -> Array:
        return _values(curve, x, model.parameters)

    x, y = _sampled(knots, values)
    way = WAY * (x[-1] - x[0])
    slope = (values(x + way) - values(x - way)) / (2 * way)
    (unit, by), (of_value, times) = (display.of_unit(SI[one]) for one in of)
    points = isinstance(curve, pg.Curve)
    dots = {"t": (by * knots).tolist(), "y": (times * values(knots)).tolist()} if points else None
    per = "" if of[0] == of[1] else f" [{SI[of[1]] or 1}/{SI[of[0]] or 1}]"
    if not np.isfinite(y).any():
        return None
    shape = {"title": f"[{of_value}]" if of_value else "", "dots": dots}
    lines = [shape | _line(by * x, times * y), {"title": f"slope{per}"} | _line(by * x, slope)]
    return {"lines": lines, "unit": unit}


def _line(x: Array, y: Array) -> Payload:
    """Return the part of a line that has values."""
    there = np.isfinite(y)
    return {"t": x[there].tolist(), "y": y[there].tolist()}


def _values(curve: Any, x: Array, parameters: Mapping[str, float]) -> Array:
    """Return the values of the curve of a relation at x (n,), NaN where it has none."""
    if isinstance(curve, pg.Curve):
        return curve.values(x)
    if isinstance(curve, pg.Polynomial):
        return np.polynomial.polynomial.polyval(x, curve.coefficients)
    tree = parsed(curve)

    def value(x: float) -> float:
        try:
            return float(constant(tree, {"q": x, **parameters}, lambda _: x))
        except (ArithmeticError, ValueError, TypeError):  # a complex power is no float
            return math.nan

    return np.array([value(one) for one in x.tolist()])


def window(state: State, item: pg.Relation | pg.Cam) -> tuple[float, ...]:
    """Return the ends of the slider of the coordinate that a relation follows, or nothing.

    A hinge without limits turns within the turn that it is in.
    """
    (name, k), _ = ends_of(item)
    if name not in state.model.row or (q := shown(state, name)) is None:
        return ()
    reach = ranges(state.model.body(name), q, state.derived.size)
    return reach[k] if k < len(reach) else ()


def shown(state: State, name: str) -> Array | None:
    """Return the coordinates of a joint at the pose shown."""
    bodies = bodies_of(state.whole, pg.Topology.of(state.whole))
    places = {body.name: place for body, place in zip(bodies, q_slices(bodies))}
    return shown_q(state)[places[name]] if name in places else None


def open_relation(state: State, page: Client) -> pg.Relation | pg.Cam | None:
    """Return the relation or the cam whose form a page shows."""
    part, name = page.opened or ("", "")
    found = next((c for c in state.model.constraints if c.name == name), None)
    drawn = isinstance(found, (pg.Relation, pg.Cam))
    return found if part == "constraints" and drawn else None


def present(state: State, page: Client) -> Payload | None:
    """Return the coordinates of both joints of the open relation at the pose shown, if they have
    positions.

    A periodic curve is drawn over one period, and its mark is there.
    """
    item = open_relation(state, page)
    if item is None:
        return NOTHING
    x, value = (_coordinate(state, *end) for end in ends_of(item))
    if x is None or value is None:
        return None
    of, display = quantities(state.model, item), page.display
    text = f"now {_number(x, of[0], display)}, {_number(value, of[1], display)}"
    if isinstance(item, pg.Cam):
        x %= math.tau  # drawn over one turn
    elif isinstance(item.curve, pg.Curve) and item.curve.kind == "periodic":
        first, last = item.curve.x[0], item.curve.x[-1]
        periods = math.floor((x - first) / (last - first))
        x -= periods * (last - first)
        value -= periods * (item.curve.value[-1] - item.curve.value[0])
    at = [display.of_unit(SI[one])[1] * y for one, y in zip(of, (x, value))]
    return {"at": at, "text": text}


def _number(x: float, of: Quantity, display: Display) -> str:
    unit, by = display.of_unit(SI[of])
    return f"{by * x:.4g} {unit}".strip()


def _coordinate(state: State, name: str, k: int) -> float | None:
    """Return one coordinate of a joint at the pose shown, None if it has no position."""
    if name not in state.model.row:
        return None
    place = dict(enumerate(joints.places(state.model.body(name).sequence))).get(k)
    q = shown(state, name)
    return None if place is None or q is None else float(q[place])
