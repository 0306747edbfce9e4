"""The 3D view."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field, replace
from typing import Any, Self

from .. import pose

SHOWN_AT_FIRST = frozenset({"shapes", "joining", "sites", "branches", "forces"})


@dataclass(frozen=True)
class Client(pose.Client):
    turned: bool = False  # whether a person moved its camera since it was set
    follow: bool = True  # whether its camera goes along with what travels
    view: tuple[int, str] = (0, "")  # number of requests for a view, and its name

    def again(self, fresh: Any) -> Self:
        return replace(super().again(fresh), view=fresh.view)


@dataclass(frozen=True)
class State(pose.State):
    clients: Mapping[int, Client] = field(default_factory=dict)
    shown: frozenset[str] = SHOWN_AT_FIRST
