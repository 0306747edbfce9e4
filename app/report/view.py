"""The reports tab: settings, progress, and the figure with its rows."""

from __future__ import annotations

import re
from collections.abc import Sequence
from typing import Any

from pgraph_core.study.axes import applicable, first_axis

from ..core.bridge import Bridge
from ..core.views import Host, Payload, Place, requests, topic
from ..run.trust import method_label
from . import Client, DownloadReport, Report, State, in_progress, latest

KINDS = ("precision", "stability")
KNOWN = ": known to "
PARTS = ("analysis", "report", "reporting", "analysis_problem")


class DownloadView:
    def __init__(self, bridge: Bridge):
        self._bridge = bridge

    def render(self, old: State, new: State) -> None:
        for asked in requests(old, new, DownloadReport):
            if (report := latest(new.report, asked.kind)) is not None:
                name = re.sub(r"[^\w-]+", "_", f"{report.model.name}_{report.kind}")
                self._bridge.download(asked.client, f"{name}.html", page(report).encode())


def page(report: Report) -> str:
    """Return the report as a standalone page."""
    return report.result.html()


def drawn(state: State) -> dict[str, str]:
    """Return the figure of the latest report of each kind, or ""."""
    found = {kind: latest(state.report, kind) for kind in KINDS}
    if (now := in_progress(state)) is not None:
        found[now.kind] = now
    return {kind: "" if one is None else one.result.figure() for kind, one in found.items()}


def _measured(state: State, page: Client) -> tuple[object, ...]:
    return ("reports" in page.sees and state.derived,)


def reports(state: State) -> Payload:
    """Return the content of the reports tab, except the figure."""
    asked, now, newest = state.reporting, state.analysis, state.report
    running = in_progress(state)
    both = [newest, newest and newest.other]
    if running is not None:  # the one before has the same place
        both = [running, latest(newest, "precision")]
    return {
        "target": asked.target,
        "t_end": asked.t_end,
        "axis": asked.axis or first_axis(state.model),
        "axes": [[name, name.replace("_", " ")] for name in applicable(state.model)],
        "empty": not state.model.rows,
        "job": None if now is None else {"kind": now.kind, "fraction": now.fraction},
        "problem": state.analysis_problem,
        "results": [
            result(one, one.model is state.model, one is running) for one in both if one is not None
        ],
    }


def result(report: Report, current: bool, running: bool) -> Payload:
    """Return the result as text and rows."""
    found = (precision if report.kind == "precision" else stability)(report.result)
    if report.result.t_end < report.asked * (1 - 1e-9):
        found["title"] += f" of {report.asked:g} s"
    ended = report.result
    if running:
        found |= {"title": f"{found['title']}, so far", "advice": ""}
    elif ended.cancelled if report.kind == "precision" else not ended.complete:
        found["title"] += ", cancelled"
    stale = "" if current else "Measured before the model was changed."
    return {"kind": report.kind, "stale": stale, "running": running, **found}


def precision(study: Any) -> Payload:
    """Return the conclusion first, then all runs that reached their end, sorted by error."""
    done = [row for row in study.rows if row.error and row.time]
    rows = [
        [row.method, str(row.setting), f"{row.error:.1e}", f"{1e3 * row.time:.3g} ms"]
        for row in sorted(done, key=lambda row: -(row.error or 0.0))
    ]
    known = study.reference
    source = f"Reference: {known['source']}, accurate to {known['accuracy']:.0e}."
    return {
        "title": f"Error against run time, {study.t_end:.4g} s",
        "advice": study.said(method_label),
        "use": "" if (row := study.advised()) is None else f"{row.method} at {row.setting}",
        "table": f"All {len(rows)} runs that reached the end",
        "head": ["method", "setting", "error", "time"],
        "rows": rows,
        "notes": [source, *study.notes],
    }


def stability(found: Any) -> Payload:
    """Return the problems, with one line per method and verdict."""
    axis, rows = found.axis.replace("_", " "), []
    for (method, verdict), cells in found.troubles().items():
        first = cells[0]
        example = f"{axis} {first.value:.3g}, step {first.step:g} s: {first.text}"
        rows.append([method, f"{len(cells)} {verdict.lower()}", example])
    row = found.advised()
    return {
        "title": f"Stability over {axis}, {found.t_end:g} s",
        "advice": found.said(method_label),
        "use": "" if row is None else f"{row.method} at step {row.step:g} s",
        "table": "Failures, with an example of each" if rows else "",
        "head": ["method", "cells", "for example"],
        "rows": rows,
        "notes": compared_with(found.references),
    }


def compared_with(references: Sequence[str]) -> list[str]:
    """Return one line per source of reference solutions, with its accuracy."""
    groups: dict[str, list[str]] = {}
    for text in references:
        source, _, known = text.rpartition(KNOWN)
        groups.setdefault(source or text, []).extend([known] if source else [])
    lines = []
    for source, found in groups.items():
        low, high = min(found, key=_number, default=""), max(found, key=_number, default="")
        known = low if low == high else f"{low} to {high}"
        lines.append(f"Compared with {source}" + (f"{KNOWN}{known}" if found else ""))
    return lines


def _number(text: str) -> float:
    digits = re.match(r"[\d.e+-]+", text)
    return float(digits[0].rstrip(".")) if digits else 0.0


VIEWS = (
    Place(
        topic("reports", lambda state, page: reports(state), *PARTS, page=_measured),
        50, Host("reports", "drawer", "Accuracy"),
    ),
    Place(topic("figure", drawn, "report", "analysis"), 50),
    Place(lambda desk: DownloadView(desk.bridge), 50),
)  # fmt: skip
