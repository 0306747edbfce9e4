"""Reports: error against run time, and the stability map."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import pgraph_core as pg

from ..run import Request


@dataclass(frozen=True)
class ReportRequest:
    """What a report is asked for."""

    target: float = 1e-6  # the error that is wanted
    t_end: float | None = None  # [s]; None: as the run
    axis: str = ""  # of the stability map; "": the first that the model has


@dataclass(frozen=True)
class Analysis:
    """A report under way."""

    id: int
    kind: str  # precision or stability
    model: pg.Model
    request: Request
    reporting: ReportRequest
    fraction: float = 0.0
    cancelled: bool = False


@dataclass(frozen=True)
class Report:
    """A report, and the model it is of."""

    kind: str
    model: pg.Model
    result: Any  # pgraph_core's Study or StabilityMap
    asked: float = 0.0  # duration of the run [s]


def advised(report: Report | None) -> Any:
    """The row that a report against run time recommends; None where there is none."""
    return report.result.advised() if report is not None and report.kind == "precision" else None
