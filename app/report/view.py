"""The reports: settings, progress, and the figure with its rows."""

from __future__ import annotations

import re
from typing import Any

import viser

from pgraph_core.study.axes import AXES, first_axis

from ..core.bridge import Bridge
from ..core.state import Report, State
from ..core.views import Payload, Place, audience, watching

PARTS = ("analysis", "report", "reporting", "analysis_problem")


class ReportsView:
    def __init__(self, bridge: Bridge):
        self._bridge = bridge
        bridge.host("reports")

    def render(self, old: State, new: State) -> None:
        changed = any(getattr(old, part) is not getattr(new, part) for part in PARTS)
        edited = new.derived is not old.derived
        clients = {*audience(old, new, changed), *watching(old, new, "reports", edited)}
        payload = reports(new) if clients else {}
        figures = set(audience(old, new, new.report is not old.report))
        figure = {"svg": drawn(new)} if figures else {}
        for client in clients:
            self._bridge.send(client, "reports", payload)
        for client in figures:
            self._bridge.send(client, "figure", figure)
        for client, now in new.clients.items():
            before = old.clients.get(client)
            if before is not None and now.reports != before.reports:
                self._download(client, new.report)

    def _download(self, client: int, report: Report | None) -> None:
        handle = self._bridge.server.get_clients().get(client)
        if handle is None or report is None:
            return
        name = re.sub(r"[^\w-]+", "_", f"{report.model.name}_{report.kind}")
        handle.send_file_download(f"{name}.html", page(report).encode(), save_immediately=True)


def page(report: Report) -> str:
    """The report as a page of its own."""
    return report.result.html()


def drawn(state: State) -> str:
    """The figure of the last report, for the width of the tab."""
    report = state.report
    if report is None:
        return ""
    return report.result.figure(narrow=True)


def reports(state: State) -> Payload:
    """Everything but the figure."""
    asked, now, report = state.reporting, state.analysis, state.report
    return {
        "target": asked.target,
        "t_end": asked.t_end,
        "axis": asked.axis or first_axis(state.model),
        "axes": [[name, name.replace("_", " ")] for name in AXES],
        "empty": not state.model.bodies,
        "job": None if now is None else {"kind": now.kind, "fraction": now.fraction},
        "problem": state.analysis_problem,
        "result": None if report is None else result(report, report.model is state.model),
    }


def result(report: Report, current: bool) -> Payload:
    """What came out, in words and rows."""
    found = (precision if report.kind == "precision" else stability)(report.result)
    if report.result.t_end < report.asked * (1 - 1e-9):
        found["title"] += f" of {report.asked:g} s"
    stale = "" if current else "Measured before the model was changed."
    return {"kind": report.kind, "stale": stale, **found}


def precision(study: Any) -> Payload:
    """The answer first, then every run that reached its end, by its error."""
    done = [row for row in study.rows if row.error and row.time]
    rows = [
        [row.method, str(row.setting), f"{row.error:.1e}", f"{1e3 * row.time:.3g} ms"]
        for row in sorted(done, key=lambda row: -(row.error or 0.0))
    ]
    known = study.reference
    source = f"Reference: {known['source']}, good to {known['accuracy']:.0e}."
    return {
        "title": f"Error against run time, {study.t_end:.4g} s",
        "advice": study.answer,
        "use": "" if (row := study.advised()) is None else f"{row.method} at {row.setting}",
        "head": ["method", "setting", "error", "time"],
        "rows": rows,
        "notes": [source, *study.notes],
    }


def stability(found: Any) -> Payload:
    """What needs attention, a line each."""
    rows = [
        [cell.method, f"{cell.value:.3g}", f"{cell.step:g} s", str(cell.status), cell.text]
        for cell in found.cells
        if cell.status != "OK"
    ]
    return {
        "title": f"Stability over {found.axis.replace('_', ' ')}, {found.t_end:g} s",
        "advice": found.advice,
        "use": "",
        "head": ["method", found.axis.replace("_", " "), "step", "verdict", ""],
        "rows": rows[:200],
        "notes": list(dict.fromkeys(found.references)),
    }


VIEWS = (
    Place(
        lambda desk: ReportsView(desk.bridge), 25, "graph", "Report", viser.Icon.REPORT_ANALYTICS
    ),
)
