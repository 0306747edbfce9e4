"""What happens to the reports: error against run time, and the stability map."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any, Literal

from ..core.event import FromPage, Text


@dataclass(frozen=True)
class SetReport(FromPage):
    """A setting of the report."""

    serial: int
    field: Literal["target", "axis", "t_end"]
    text: Text


@dataclass(frozen=True)
class Analyse(FromPage):
    """Measure, in the background."""

    kind: Literal["precision", "stability"]


@dataclass(frozen=True)
class CancelAnalysis(FromPage):
    """Stop measuring; what there is so far is kept."""


@dataclass(frozen=True)
class DownloadReport(FromPage):
    """The report as a page of its own."""


@dataclass(frozen=True)
class Measuring:
    id: int
    fraction: float


@dataclass(frozen=True)
class Measured:
    id: int
    report: Any  # pgraph_core's Study or StabilityMap


@dataclass(frozen=True)
class NotMeasured:
    id: int
    text: str
