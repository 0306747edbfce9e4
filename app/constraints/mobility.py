"""A readable report about degrees of freedom and redundant constraint rows."""

from __future__ import annotations

import threading
from collections import Counter
from collections.abc import Callable
from queue import SimpleQueue
from typing import Any

import pgraph_core as pg
from pgraph_core.errors import counted

from ..core.events import Event
from ..core.views import Payload
from . import State
from .update import MobilityFound

# translations and rotations that a kind holds: the kind to choose if others are redundant
HOLDING = {
    (3, 3): "weld", (3, 2): "revolute", (2, 3): "prismatic", (2, 2): "cylindrical",
    (3, 1): "universal", (3, 0): "point", (2, 0): "line", (1, 0): "plane", (0, 3): "orientation",
}  # fmt: skip
MOST_NAMED = 8  # joints or constraints in one sentence
ROWS = {kind: rows for rows, kind in HOLDING.items()}


def mobility_report(state: State, by_itself: int) -> Payload:
    """Return a headline, lines that each name a constraint, and whether the report is current."""
    active = [c for c in state.model.constraints if c.active]
    if not active:
        text = f"{counted(state.derived.dof, 'degree')} of freedom, none taken by constraints."
        return {"state": "done", "text": text, "lines": []}
    report = state.mobility
    if report is None or report.model is not state.model:
        if state.derived.dof > by_itself and state.mobility_asked is not state.model:
            text = f"{counted(state.derived.dof, 'degree')} of freedom of the tree."
            return {"state": "large", "text": text, "lines": []}
        return {"state": "waiting", "text": "Counting degrees of freedom ...", "lines": []}
    if report.found is None:
        lines = [_line(c.name, "", True) for c in active if f"'{c.name}'" in report.problem]
        return {"state": "failed", "text": sentence(report.problem), "lines": lines}
    return {"state": "done", "text": headline(report.found), "lines": lines_of(state, report.found)}


def sentence(text: str) -> str:
    """Format as a sentence with a capital letter and a full stop."""
    return text[:1].upper() + text[1:].rstrip(".") + "."


def headline(found: Any) -> str:
    """Return a headline like '1 degree of freedom left: 3 of the tree less 2 by constraints.'"""
    left = counted(found.dof, "degree") + " of freedom left"
    if found.extra and found.finite:
        left += f", {found.extra} of them only in this position"
    left += found.locked
    return f"{left}: {found.tree} of the tree, less {found.rank} of {counted(found.rows, 'row')}."


def lines_of(state: State, found: Any) -> list[Payload]:
    """Return one line per constraint about its redundant directions, with an alternative."""
    by_name: dict[str, list[Any]] = {}
    for row in found.redundant:
        by_name.setdefault(row.constraint, []).append(row)
    kinds = {c.name: c.kind for c in state.model.constraints}
    lines = [
        _line(name, needless(kinds.get(name, ""), rows), False) for name, rows in by_name.items()
    ]
    if found.prescribed:
        moves = counted(found.prescribed, "way") + " to move"
        lines.append(_line("", f"Prescribed motions drive it: they decide {moves}.", False))
    elif found.redundant and found.dof == 0:
        lines.append(_line("", locking(state.model), True))
    if found.redundant and found.dof + found.prescribed > 0:
        text = (
            "The motion is not affected; the forces along these directions are those of least norm."
        )
        lines.append(_line("", text, False))
    if found.extra:
        joints = ", ".join(f"'{name}'" for name in found.joints[:MOST_NAMED])
        leads = "the branch taken follows the velocity" if found.finite else "they lead nowhere"
        lines.append(
            _line("", f"Singular position: {joints} can move in more ways; {leads}.", True)
        )
    return lines


def locking(model: pg.Model) -> str:
    """Return which constraints hold which joints of a model that cannot move."""
    ties = [c.name for c in model.constraints if c.active]
    held = [body.name for body in model.bodies if body.dof]
    joints = f"the joint{'s' * (len(held) > 1)} of {_named(held)}"
    locks = "together lock" if len(ties) > 1 else "locks"
    return f"Nothing can move: {_named(ties)} {locks} {joints}. Check where and how they act."


def _named(names: list[str]) -> str:
    """Return the quoted names in a sentence, at most MOST_NAMED of them."""
    few = [f"'{name}'" for name in names[:MOST_NAMED]]
    rest = len(names) - len(few)
    return _listed([*few, f"{rest} more"] if rest else few)


def needless(kind: str, rows: list[Any]) -> str:
    """Return a remark about redundant rows, suggesting a constraint kind with fewer of them."""
    always = [row for row in rows if not row.only_here]
    here = [row for row in rows if row.only_here]
    parts = []
    if always:
        parts.append(f"unnecessarily removes {_listed([r.direction for r in always])}")
        if better := instead(kind, always):
            parts.append(better)
    if here:
        parts.append(f"depends on other rows in {_listed([r.direction for r in here])} only here")
    return "; ".join(parts)


def _listed(words: list[str]) -> str:
    *first, last = words
    return f"{', '.join(first)} and {last}" if first else last


def instead(kind: str, rows: list[Any]) -> str:
    """Return a suggestion for a kind that imposes the remaining directions alone, if any."""
    if kind not in ROWS:
        return ""
    turned = Counter("turn" if r.direction.startswith("rotation") else "move" for r in rows)
    left = (ROWS[kind][0] - turned["move"], ROWS[kind][1] - turned["turn"])
    if left == (0, 0):
        return "it has no effect: delete it, or switch it off"
    better = HOLDING.get(left)
    return f"a '{better}' would do" if better else ""


def _line(name: str, text: str, bad: bool) -> Payload:
    return {"constraint": name, "text": text, "bad": bad}


BY_ITSELF = 300  # degrees of freedom up to which the report comes unasked: it costs O(n³)


class Reports:
    """Mobility reports for the latest model."""

    def __init__(self, send: Callable[[Event], None]):
        self._send = send
        self._asked: pg.Model | None = None  # model of the last request
        self._newest: SimpleQueue[pg.Model] = SimpleQueue()
        threading.Thread(target=self._work, name="pgraph-reports", daemon=True).start()

    def render(self, old: State, new: State) -> None:
        if new.model is not self._asked and wanted(new):
            self._asked = new.model
            self._newest.put(new.model)

    def _work(self) -> None:
        while True:
            model = self._newest.get()
            while not self._newest.empty():  # only the newest is of interest
                model = self._newest.get()
            self._send(report(model))


def wanted(state: State) -> bool:
    """Return True if a page shows constraints but their report is missing."""
    if not state.model.constraints or not any(
        "constraints" in c.sees for c in state.clients.values()
    ):
        return False
    if state.mobility is not None and state.mobility.model is state.model:
        return False
    return state.derived.dof <= BY_ITSELF or state.mobility_asked is state.model


def report(model: pg.Model) -> MobilityFound:
    """Return the degrees of freedom and redundant rows at first, or why they are unknown."""
    try:
        return MobilityFound(model, pg.Mechanism(model).mobility())
    except pg.PgraphError as error:
        return MobilityFound(model, None, str(error))
    except Exception as error:  # said on the page: the session goes on
        return MobilityFound(model, None, f"No report: {type(error).__name__}: {error}")
