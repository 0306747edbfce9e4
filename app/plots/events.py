"""What happens to the plots of one page."""

from __future__ import annotations

from dataclasses import dataclass

from ..core.event import FromPage, Text


@dataclass(frozen=True)
class Plot(FromPage):
    """A signal is plotted, or no more: a quantity `kind` of the body or constraint `of`."""

    kind: Text
    of: Text
    on: bool
