"""The tab for searches: objective, free parameters, progress and result."""

from __future__ import annotations

import math

from pgraph_core.result.functions import WAYS

from ..core.views import Host, Payload, Place, topic
from . import Choices, Curves, Found, Offer, State, matches, missing, settled

PARTS = ("model", "searching", "search", "search_problem", "found", "choices")
DRAWN = 300  # points of a drawn curve


def searches(state: State) -> Payload:
    """Return the content of the tab, except the choices."""
    known, now = Choices.known(state), state.search
    asked = settled(state.searching, offered(state))
    found = state.found if state.found and state.found.asked.kind == asked.kind else None
    curves = now.curves if now is not None else found.curves if found is not None else {}
    return {
        "kind": asked.kind,
        "file": asked.file,
        "columns": [[name, signal] for name, signal in asked.match.items()],
        "way": asked.way,
        "signal": asked.signal,
        "limits": [list(limit) for limit in asked.limits],
        "free": {one.path: [one.low, one.high] for one in asked.free},
        "waits": known is None,
        "job": None if now is None else {"trials": now.trials, "said": now.said},
        "problem": state.search_problem or ("" if known is None else known.problem),
        "missing": missing(asked),
        "curves": drawn(state, curves),
        "found": None if found is None else result(found, found.model is state.model),
    }


def offered(state: State) -> Offer:
    """Return the choices that are known, until those of an edited model are found of the former."""
    return (state.choices and state.choices.found) or Offer({}, ())


def choices(state: State) -> Payload:
    """Return the numbers and curves that the tab offers."""
    offer = offered(state)
    return {
        "numbers": [
            {"name": path, "value": value, "unit": unit}
            for path, (value, unit) in offer.numbers.items()
        ],
        "signals": list(offer.signals),
        "ways": list(WAYS),
    }


def drawn(state: State, curves: Curves) -> list[Payload]:
    """Return the curves of the last run and the corresponding data."""
    asked = state.searching
    source = {signal: column for column, signal in matches(asked, curves).items() if signal}
    shown = []
    for name, (t, y, factor) in curves.items():
        data: Payload = {"t": [], "y": []}
        if asked.kind == "fit" and name in source:
            step = -(-len(asked.data["t"]) // DRAWN)
            measured = [factor * y for y in asked.data[source[name]][::step]]
            data = {"t": asked.data["t"][::step], "y": measured}
        shown.append({"name": name, "t": t, "y": y, "data": data})
    return shown


def result(found: Found, current: bool) -> Payload:
    """Return the numbers that were found, or the shares of a ranking."""
    most = max((row[3] for row in found.rows if math.isfinite(row[3])), default=0.0)
    return {
        "kind": found.asked.kind,
        "title": found.title,
        "stale": "" if current else "Found before the model was changed.",
        "rows": [
            {"name": path, "before": before, "found": x,
             "more": more if math.isfinite(more) else None,
             "share": more / most if most and math.isfinite(more) else 0.0}
            for path, before, x, more in found.rows
        ],
        "notes": list(found.notes),
    }  # fmt: skip


VIEWS = (
    Place(topic("choices", choices, "choices", seen="search"), 55),
    Place(topic("search", searches, *PARTS, seen="search"), 55, Host("search", "drawer", "Fit")),
)
