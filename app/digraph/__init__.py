"""The digraph of the paper, and its steps."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field, replace
from typing import Self

from .. import pose


@dataclass(frozen=True)
class Client(pose.Client):
    walk: str = ""  # stepped figure: "pgraph" (Fig. 4), "frames" (Fig. 8) or ""

    def afresh(self) -> Self:
        return replace(super().afresh(), walk="")


@dataclass(frozen=True)
class State(pose.State):
    clients: Mapping[int, Client] = field(default_factory=dict)
